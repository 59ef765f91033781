//! Shapes. Defaults are pbrt-v3's [PBRT3, 3].

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec3, DVec4};

use super::directive::Directive;
use super::lexer::shortened;
use super::params::{Param, Type};
use super::source::{Sources, Span};
use crate::error::SceneError;
use crate::scene::curve::{Curve, Knots, nurbs};
use crate::scene::geometry::{Geometry, LocalSurface, Notes};
use crate::scene::subdivide::loop_subdivide;
use crate::scene::tessellate::{Quadric, Segments, heightfield};

/// Where the triangles of a shape come from.
#[derive(Clone, Debug)]
pub(crate) enum Source {
    Ready(Arc<Geometry>, LocalSurface),
    /// A PLY file, to be read.
    Ply {
        path: PathBuf,
    },
}

/// Segments of a full turn of a tessellated surface, and of one that shines: there each triangle
/// is a light.
const SEGMENTS: u32 = 128;
const SEGMENTS_OF_LIGHTS: u32 = 48;

/// The triangles that a Shape directive gives; `None` where its kind is not supported or its file
/// is not there, which is warned about. `subdivision_levels` go before those of the file.
pub(crate) fn shape(
    s: &Sources,
    d: &Directive,
    shines: bool,
    subdivision_levels: Option<u32>,
    notes: &mut Notes,
    find: &dyn Fn(&str, Span) -> Option<PathBuf>,
) -> Result<Option<Source>, SceneError> {
    let kind = d.name();
    let geometry = match kind {
        "trianglemesh" => triangle_mesh(s, d)?,
        "bilinearmesh" => {
            let mut mesh = triangle_mesh(s, d)?;
            mesh.triangles = quads(s, d, mesh.positions.len())?;
            mesh
        }
        "loopsubdiv" => {
            d.params.ignore(&["scheme"]);
            let (positions, triangles) = positions_and_triangles(s, d)?;
            let own = match d.params.integer_in(s, "levels", 0..=16)? {
                Some(levels) => levels,
                None => d.params.integer_in(s, "nlevels", 0..=16)?.unwrap_or(3),
            };
            let levels = subdivision_levels.unwrap_or(own);
            if levels != own {
                notes.warn(
                    "subdivision levels",
                    || s.place(d.span),
                    format!("subdivided to level {levels}, as asked for, not {own}"),
                );
            }
            match loop_subdivide(&positions, &triangles, levels) {
                Ok(geometry) => geometry,
                Err(reason) => {
                    notes.warn(
                        "loopsubdiv",
                        || s.place(d.span),
                        format!("this surface cannot be subdivided ({reason}); rendered as it is"),
                    );
                    Geometry {
                        positions,
                        triangles,
                        ..Geometry::default()
                    }
                }
            }
        }
        "plymesh" => {
            let Some(name) = d.params.text(s, "filename")? else {
                return Err(s.error(d.span, "a \"plymesh\" takes \"string filename\""));
            };
            let span = d.params.get("filename").map_or(d.span, |param| param.span);
            let Some(path) = find(name, span) else {
                notes.warn(
                    &format!("mesh {name}"),
                    || s.place(span),
                    format!(
                        "there is no mesh \"{}\"; rendered without it",
                        shortened(name)
                    ),
                );
                return Ok(None);
            };
            return Ok(Some(Source::Ply { path }));
        }
        "heightfield" => height_field(s, d)?,
        "curve" => {
            let (curve, tube) = curve(s, d)?;
            let [along, around] = if notes.count_of("curve") < MANY_CURVES {
                tube
            } else {
                MANY_CURVE_SEGMENTS
            };
            let (geometry, segments) = curve.tessellated(along, around);
            return ready(s, d, geometry, segments, LocalSurface::Curved, notes).map(Some);
        }
        "nurbs" => {
            let (geometry, segments) = nurbs_surface(s, d)?;
            return ready(s, d, geometry, segments, LocalSurface::Curved, notes).map(Some);
        }
        _ => match quadric(s, d)? {
            Some(quadric) => return tessellated(s, d, quadric, shines, notes).map(Some),
            None => {
                d.params.ignore_all();
                let what = format!("the shape \"{}\"", shortened(kind));
                notes.warn(
                    &what,
                    || s.place(d.span),
                    format!("{what} is not supported; rendered without it"),
                );
                return Ok(None);
            }
        },
    };
    Ok(Some(Source::Ready(Arc::new(geometry), LocalSurface::Flat)))
}

fn triples(param: &Param) -> Vec<[f32; 3]> {
    param
        .numbers()
        .chunks_exact(3)
        .map(|p| [p[0] as f32, p[1] as f32, p[2] as f32])
        .collect()
}

type Indexed = (Vec<[f32; 3]>, Vec<[u32; 3]>);

fn positions_and_triangles(s: &Sources, d: &Directive) -> Result<Indexed, SceneError> {
    let kind = d.name();
    let Some(positions) = d.params.numbers(s, "P", &[Type::Point3])?.map(triples) else {
        return Err(s.error(
            d.span,
            format!("a \"{kind}\" takes \"point P\", its vertices"),
        ));
    };
    if kind == "bilinearmesh"
        || kind == "trianglemesh" && positions.len() == 3 && !d.params.has("indices")
    {
        return Ok((positions, vec![[0, 1, 2]]));
    }
    let Some((indices, span)) = d.params.integers(s, "indices")? else {
        return Err(s.error(
            d.span,
            format!("a \"{kind}\" takes \"integer indices\", three a triangle"),
        ));
    };
    if !indices.len().is_multiple_of(3) {
        return Err(s.error(
            span,
            format!(
                "\"indices\" has {} numbers; it takes three a triangle",
                indices.len()
            ),
        ));
    }
    let mut checked = Vec::with_capacity(indices.len());
    for (i, &index) in indices.iter().enumerate() {
        match u32::try_from(index)
            .ok()
            .filter(|&index| (index as usize) < positions.len())
        {
            Some(index) => checked.push(index),
            None => {
                return Err(s.error(
                    span,
                    format!(
                        "index {i} of \"indices\" is {index}, but \"P\" has the vertices 0 to {}",
                        positions.len() - 1
                    ),
                ));
            }
        }
    }
    Ok((
        positions,
        checked
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect(),
    ))
}

/// The patches of a "bilinearmesh", each as two triangles: corners are in the order of (0, 0),
/// (1, 0), (0, 1), (1, 1).
fn quads(s: &Sources, d: &Directive, vertices: usize) -> Result<Vec<[u32; 3]>, SceneError> {
    let (indices, span) = match d.params.integers(s, "indices")? {
        Some((indices, span)) => (indices.to_vec(), span),
        None if vertices == 4 => (vec![0, 1, 2, 3], d.span),
        None => {
            return Err(s.error(
                d.span,
                "a \"bilinearmesh\" takes \"integer indices\", four a patch",
            ));
        }
    };
    let index = |i: i64| u32::try_from(i).ok().filter(|&i| (i as usize) < vertices);
    let patches: Option<Vec<[u32; 4]>> = indices
        .chunks(4)
        .map(|q| match *q {
            [a, b, c, d] => Some([index(a)?, index(b)?, index(c)?, index(d)?]),
            _ => None,
        })
        .collect();
    let Some(patches) = patches else {
        return Err(s.error(
            span,
            format!("\"indices\" takes four of the {vertices} vertices a patch"),
        ));
    };
    Ok(patches
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, d], [a, d, c]])
        .collect())
}

fn triangle_mesh(s: &Sources, d: &Directive) -> Result<Geometry, SceneError> {
    d.params.ignore(&["S", "faceIndices"]);
    let (positions, triangles) = positions_and_triangles(s, d)?;
    let per_vertex = |param: &Param, given: usize| {
        s.error(
            param.span,
            format!(
                "\"{}\" is given for {given} vertices, but \"P\" has {}",
                param.name,
                positions.len()
            ),
        )
    };
    let normals = match d.params.numbers(s, "N", &[Type::Normal])? {
        None => Vec::new(),
        Some(param) => {
            let normals = triples(param);
            if normals.len() != positions.len() {
                return Err(per_vertex(param, normals.len()));
            }
            normals
        }
    };
    let types = [Type::Float, Type::Point2, Type::Vector2];
    let uvs = match d.params.numbers(s, "uv", &types)? {
        Some(param) => Some(param),
        None => d.params.numbers(s, "st", &types)?,
    };
    let uvs = match uvs {
        None => Vec::new(),
        Some(param) => {
            let uvs: Vec<_> = param
                .numbers()
                .chunks_exact(2)
                .map(|p| [p[0] as f32, p[1] as f32])
                .collect();
            if uvs.len() < positions.len() {
                return Err(per_vertex(param, uvs.len()));
            }
            uvs[..positions.len()].to_vec()
        }
    };
    Ok(Geometry {
        positions,
        triangles,
        normals,
        uvs,
    })
}

fn height_field(s: &Sources, d: &Directive) -> Result<Geometry, SceneError> {
    let nu = d.params.integer_in(s, "nu", 2..=1 << 15)?;
    let nv = d.params.integer_in(s, "nv", 2..=1 << 15)?;
    let heights = d.params.numbers(s, "Pz", &[Type::Float])?;
    let (Some(nu), Some(nv), Some(heights)) = (nu, nv, heights) else {
        return Err(s.error(
            d.span,
            "a \"heightfield\" takes \"integer nu\", \"integer nv\" and \"float Pz\"",
        ));
    };
    if heights.numbers().len() != nu as usize * nv as usize {
        return Err(s.error(
            heights.span,
            format!(
                "\"Pz\" has {} heights; it takes nu × nv",
                heights.numbers().len()
            ),
        ));
    }
    Ok(heightfield(nu, nv, heights.numbers()))
}

/// The surface of revolution that the directive gives; `None` where it gives none.
fn quadric(s: &Sources, d: &Directive) -> Result<Option<Quadric>, SceneError> {
    let float = |name: &str, default: f64| -> Result<f64, SceneError> {
        Ok(d.params.float(s, name)?.map_or(default, f64::from))
    };
    let radius = || -> Result<f64, SceneError> {
        let radius = float("radius", 1.0)?;
        if radius > 0.0 {
            return Ok(radius);
        }
        let span = d.params.get("radius").map_or(d.span, |param| param.span);
        Err(s.error(span, format!("\"radius\" is {radius}; it must be above 0")))
    };
    let range = |low: f64, high: f64| -> Result<(f64, f64), SceneError> {
        let (a, b) = (float("zmin", low)?, float("zmax", high)?);
        Ok((a.min(b), a.max(b)))
    };
    Ok(Some(match d.name() {
        "sphere" => {
            let radius = radius()?;
            let (z_min, z_max) = range(-radius, radius)?;
            Quadric::Sphere {
                radius,
                z_min,
                z_max,
            }
        }
        "cylinder" => {
            let (z_min, z_max) = range(-1.0, 1.0)?;
            Quadric::Cylinder {
                radius: radius()?,
                z_min,
                z_max,
            }
        }
        "disk" => Quadric::Disk {
            radius: radius()?,
            inner_radius: float("innerradius", 0.0)?,
            height: float("height", 0.0)?,
        },
        "cone" => Quadric::Cone {
            radius: radius()?,
            height: float("height", 1.0)?,
        },
        "paraboloid" => {
            let (z_min, z_max) = range(0.0, 1.0)?;
            if z_min < 0.0 || z_max == 0.0 {
                return Err(s.error(
                    d.span,
                    format!("a \"paraboloid\" lies above z = 0, not from {z_min} to {z_max}"),
                ));
            }
            Quadric::Paraboloid {
                radius: radius()?,
                z_min,
                z_max,
            }
        }
        "hyperboloid" => {
            let point = |name: &str, default: [f32; 3]| -> Result<[f64; 3], SceneError> {
                Ok(d.params
                    .triple(s, name, Type::Point3)?
                    .unwrap_or(default)
                    .map(f64::from))
            };
            Quadric::Hyperboloid {
                from: point("p1", [0.0; 3])?,
                to: point("p2", [1.0; 3])?,
            }
        }
        _ => return Ok(None),
    }))
}

fn tessellated(
    s: &Sources,
    d: &Directive,
    quadric: Quadric,
    shines: bool,
    notes: &mut Notes,
) -> Result<Source, SceneError> {
    let degrees = d
        .params
        .float(s, "phimax")?
        .map_or(360.0, f64::from)
        .clamp(0.0, 360.0);
    let surface = quadric.surface(degrees.to_radians());
    let many_lights = shines && surface == LocalSurface::Curved;
    let around = if many_lights {
        SEGMENTS_OF_LIGHTS
    } else {
        SEGMENTS
    };
    let (geometry, segments) = quadric.tessellated(degrees.to_radians(), around);
    ready(s, d, geometry, segments, surface, notes)
}

/// A curved shape that was made of triangles.
fn ready(
    s: &Sources,
    d: &Directive,
    geometry: Geometry,
    segments: Segments,
    surface: LocalSurface,
    notes: &mut Notes,
) -> Result<Source, SceneError> {
    if !geometry.positions.iter().flatten().all(|c| c.is_finite()) {
        return Err(s.error(
            d.span,
            format!("this \"{}\" has no finite surface", d.name()),
        ));
    }
    notes.tessellated(
        d.name(),
        || s.place(d.span),
        geometry.triangles.len(),
        [segments.u, segments.v],
    );
    Ok(Source::Ready(Arc::new(geometry), surface))
}

/// Segments along each part of a curve and around it: round, flat.
const ROUND: [u32; 2] = [24, 24];
const FLAT: [u32; 2] = [12, 6];
/// From so many curves on they are hair or grass, and coarse.
const MANY_CURVES: usize = 2000;
const MANY_CURVE_SEGMENTS: [u32; 2] = [4, 3];

fn curve(s: &Sources, d: &Directive) -> Result<(Curve, [u32; 2]), SceneError> {
    d.params.ignore(&["splitdepth"]);
    let wrong = |message: String| Err(s.error(d.span, message));
    let points: Vec<DVec3> = match d.params.numbers(s, "P", &[Type::Point3])? {
        Some(param) => param
            .numbers()
            .chunks_exact(3)
            .map(DVec3::from_slice)
            .collect(),
        None => return wrong("a \"curve\" takes \"point P\", its control points".to_owned()),
    };
    let degree = d.params.integer_in(s, "degree", 2..=3)?.unwrap_or(3) as usize;
    let is_spline = match d.params.text(s, "basis")? {
        None | Some("bezier") => false,
        Some("bspline") => true,
        Some(other) => {
            return wrong(format!(
                "\"{}\" is not a basis; there are \"bezier\" and \"bspline\"",
                shortened(other)
            ));
        }
    };
    let parts = match Curve::parts(&points, degree, is_spline) {
        Ok(parts) => parts,
        Err(takes) => {
            return wrong(format!(
                "\"P\" has {} points; a curve of degree {degree} takes {takes}",
                points.len()
            ));
        }
    };
    let width = d.params.float(s, "width")?.unwrap_or(1.0);
    let end = |name: &str| -> Result<f64, SceneError> {
        Ok(d.params.float(s, name)?.unwrap_or(width).into())
    };
    let normals = d.params.numbers(s, "N", &[Type::Normal])?;
    let normals: Option<Vec<DVec3>> = normals.map(|param| {
        param
            .numbers()
            .chunks_exact(3)
            .map(DVec3::from_slice)
            .collect()
    });
    let kind = d.params.text(s, "type")?.unwrap_or("flat");
    let (normals, segments) = match (kind, normals) {
        ("flat", _) => (None, FLAT),
        ("cylinder", _) => (None, ROUND),
        ("ribbon", Some(normals)) if normals.len() == parts.len() + 1 => (Some(normals), ROUND),
        ("ribbon", given) => {
            return wrong(format!(
                "a \"ribbon\" of {} parts takes {} normals in \"N\", not {}",
                parts.len(),
                parts.len() + 1,
                given.map_or(0, |normals| normals.len())
            ));
        }
        (other, _) => {
            return wrong(format!(
                "\"{}\" is not a type of curve; there are \"flat\", \"cylinder\" and \"ribbon\"",
                shortened(other)
            ));
        }
    };
    let curve = Curve {
        parts,
        width: [end("width0")?, end("width1")?],
        normals,
    };
    Ok((curve, segments))
}

fn nurbs_surface(s: &Sources, d: &Directive) -> Result<(Geometry, Segments), SceneError> {
    /// As pbrt-v3 dices it.
    const DICED: Segments = Segments { u: 29, v: 29 };
    let wrong = |message: String| s.error(d.span, message);
    let knots = |axis: &str| -> Result<(usize, Knots), SceneError> {
        let count = d.params.integer_in(s, &format!("n{axis}"), 1..=1 << 12)?;
        let order = d.params.integer_in(s, &format!("{axis}order"), 1..=64)?;
        let knots = d
            .params
            .numbers(s, &format!("{axis}knots"), &[Type::Float])?;
        let (Some(count), Some(order), Some(knots)) = (count, order, knots) else {
            return Err(wrong(format!(
                "a \"nurbs\" takes \"integer n{axis}\", \"integer {axis}order\" and \
                 \"float {axis}knots\""
            )));
        };
        let knots = knots.numbers().to_vec();
        let (count, order) = (count as usize, order as usize);
        if knots.len() != count + order || count < order || !knots.is_sorted() {
            return Err(wrong(format!(
                "\"{axis}knots\" has {} numbers; it takes n{axis} + {axis}order = {}, none smaller \
                 than the one before, and n{axis} is at least {axis}order",
                knots.len(),
                count + order
            )));
        }
        let end = |name: &str, default: f64| -> Result<f64, SceneError> {
            let given = d.params.float(s, &format!("{axis}{name}"))?;
            Ok(given.map_or(default, f64::from))
        };
        let range = [end("0", knots[order - 1])?, end("1", knots[count])?];
        Ok((
            count,
            Knots {
                order,
                knots,
                range,
            },
        ))
    };
    let ((nu, u), (nv, v)) = (knots("u")?, knots("v")?);
    let points: Vec<DVec4> = match d.params.numbers(s, "P", &[Type::Point3])? {
        Some(param) => {
            let points = param.numbers().chunks_exact(3);
            points.map(|p| DVec3::from_slice(p).extend(1.0)).collect()
        }
        None => match d.params.numbers(s, "Pw", &[Type::Float])? {
            Some(param) => param
                .numbers()
                .chunks_exact(4)
                .map(DVec4::from_slice)
                .collect(),
            None => {
                return Err(wrong(
                    "a \"nurbs\" takes \"point P\" or \"float Pw\"".to_owned(),
                ));
            }
        },
    };
    if points.len() != nu * nv {
        return Err(wrong(format!(
            "this \"nurbs\" has {} points; it takes nu × nv = {}",
            points.len(),
            nu * nv
        )));
    }
    Ok((nurbs(&u, &v, &points, DICED), DICED))
}
