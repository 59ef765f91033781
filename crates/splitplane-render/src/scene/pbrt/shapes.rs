//! Shapes. Defaults are pbrt-v3's [PBRT3, 3].

use std::path::PathBuf;
use std::sync::Arc;

use super::directive::Directive;
use super::lexer::shortened;
use super::params::{Param, Type};
use super::source::{Sources, Span};
use crate::error::SceneError;
use crate::scene::geometry::{Geometry, Notes};
use crate::scene::subdivide::loop_subdivide;
use crate::scene::tessellate::{Quadric, heightfield};

/// Where the triangles of a shape come from.
#[derive(Clone, Debug)]
pub(crate) enum Source {
    Ready(Arc<Geometry>),
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
    alpha(s, d, notes)?;
    let kind = d.name();
    let geometry = match kind {
        "trianglemesh" => triangle_mesh(s, d)?,
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
    Ok(Some(Source::Ready(Arc::new(geometry))))
}

fn alpha(s: &Sources, d: &Directive, notes: &mut Notes) -> Result<(), SceneError> {
    for name in ["alpha", "shadowalpha"] {
        if let Some(param) = d.params.numbers(s, name, &[Type::Float, Type::Texture])?
            && param.numbers() != [1.0]
        {
            notes.warn(
                "alpha",
                || s.place(param.span),
                "alpha masks are not supported; rendered opaque".to_owned(),
            );
        }
    }
    Ok(())
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
    let around = if shines { SEGMENTS_OF_LIGHTS } else { SEGMENTS };
    let (geometry, segments) = quadric.tessellated(degrees.to_radians(), around);
    if !geometry.positions.iter().flatten().all(|c| c.is_finite()) {
        return Err(s.error(
            d.span,
            format!("this \"{}\" has no finite surface", d.name()),
        ));
    }
    notes.tessellated(
        d.name(),
        s.place(d.span),
        geometry.triangles.len(),
        [segments.u, segments.v],
    );
    Ok(Source::Ready(Arc::new(geometry)))
}
