//! Triangles on their way into a scene.

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::ops::Range;
use std::sync::Arc;

use splitplane::Mesh;

use super::light::AreaLight;
use super::texture::TextureRef;
use super::{Note, Shape, Surface};
use crate::transform::Transform;

/// Triangles in the space of a shape, with what belongs to their vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Geometry {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// One per position, or none.
    pub(crate) normals: Vec<[f32; 3]>,
    /// One per position, or none.
    pub(crate) uvs: Vec<[f32; 2]>,
}

/// Triangles with their place in the world.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub(crate) geometry: Arc<Geometry>,
    pub(crate) to_world: Transform,
    /// ReverseOrientation is in force.
    pub(crate) reversed: bool,
    pub(crate) material: u32,
    pub(crate) area_light: Option<AreaLight>,
    pub(crate) surface: LocalSurface,
    pub(crate) alpha: Option<TextureRef>,
    pub(crate) shadow_alpha: Option<TextureRef>,
}

impl Placed {
    /// A shading normal in the world. As pbrt-v3 does, normals are not brought to unit length: how
    /// they are interpolated depends on their lengths.
    fn normal(&self, n: [f32; 3]) -> [f32; 3] {
        let sign = if self.reversed { -1.0 } else { 1.0 };
        self.to_world.normal(n).map(|c| sign * c)
    }

    fn shape(&self, triangles: Range<u32>, has_normals: bool, has_uvs: bool) -> Shape {
        Shape {
            triangles,
            material: self.material,
            area_light: self.area_light.clone(),
            has_normals,
            has_uvs,
            flip_normals: self.reversed != self.to_world.swaps_handedness(),
            surface: self.surface.in_world(&self.to_world),
            alpha: self.alpha.clone(),
            shadow_alpha: self.shadow_alpha.clone(),
        }
    }

    /// Triangles where they are, of a material and no more.
    pub(crate) fn plain(geometry: Geometry, material: u32) -> Self {
        Placed {
            geometry: Arc::new(geometry),
            to_world: Transform::IDENTITY,
            reversed: false,
            material,
            area_light: None,
            surface: LocalSurface::Flat,
            alpha: None,
            shadow_alpha: None,
        }
    }
}

/// What triangles stand for, in the space of their shape; see [`Surface`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LocalSurface {
    Flat,
    Curved,
    /// Around the origin.
    Sphere {
        radius: f64,
    },
    /// Around the z axis.
    Disk {
        radius: f64,
        height: f64,
    },
}

impl LocalSurface {
    fn in_world(self, to_world: &Transform) -> Surface {
        match self {
            LocalSurface::Flat => Surface::Flat,
            LocalSurface::Curved => Surface::Curved,
            LocalSurface::Sphere { radius } => {
                let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
                    .map(|axis| glam::Vec3::from(to_world.vector(axis)));
                let length = x.length();
                let near = |a: f32, b: f32| (a - b).abs() <= 1e-4 * length;
                let round = near(y.length(), length)
                    && near(z.length(), length)
                    && [x.dot(y), y.dot(z), z.dot(x)]
                        .iter()
                        .all(|dot| dot.abs() <= 1e-4 * length * length);
                if round {
                    Surface::Sphere {
                        center: to_world.point([0.0; 3]),
                        radius: radius as f32 * length,
                    }
                } else {
                    Surface::Curved
                }
            }
            LocalSurface::Disk { radius, height } => {
                let radius = radius as f32;
                Surface::Disk {
                    center: to_world.point([0.0, 0.0, height as f32]),
                    axes: [[radius, 0.0, 0.0], [0.0, radius, 0.0]].map(|v| to_world.vector(v)),
                }
            }
        }
    }
}

/// One geometry for each run of triangles of the same material, so that triangles keep their order;
/// each takes its own vertices along, in the order of their first use.
pub(crate) fn runs(g: &Geometry, materials: &[u32]) -> Vec<(u32, Geometry)> {
    let faces: Vec<(u32, [u32; 3])> = materials
        .iter()
        .copied()
        .zip(g.triangles.iter().copied())
        .collect();
    let run = |run: &[(u32, [u32; 3])]| {
        let mut numbers = HashMap::new();
        let mut own = Geometry::default();
        for (_, triangle) in run {
            own.triangles.push(triangle.map(|index| {
                *numbers.entry(index).or_insert_with(|| {
                    let i = index as usize;
                    own.positions.push(g.positions[i]);
                    own.normals.extend(g.normals.get(i));
                    own.uvs.extend(g.uvs.get(i));
                    own.positions.len() as u32 - 1
                })
            }));
        }
        (run[0].0, own)
    };
    faces.chunk_by(|a, b| a.0 == b.0).map(run).collect()
}

/// The geometry of a scene, in world space; the fields are those of [`super::Scene`].
#[derive(Debug)]
pub(crate) struct Assembled {
    pub(crate) mesh: Mesh,
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) uvs: Vec<[f32; 2]>,
    pub(crate) shapes: Vec<Shape>,
}

/// All pieces in one mesh, in order.
///
/// # Errors
/// A message, where there are more triangles or vertices than a mesh can have or memory can hold.
pub(crate) fn assemble(pieces: Vec<Placed>) -> Result<Assembled, String> {
    let total = |count: fn(&Geometry) -> usize| -> usize {
        pieces
            .iter()
            .map(|piece| count(&piece.geometry))
            .fold(0, usize::saturating_add)
    };
    let vertices = total(|g| g.positions.len());
    let triangles = total(|g| g.triangles.len());
    for (what, count) in [("vertices", vertices), ("triangles", triangles)] {
        if count > Mesh::MAX_COUNT {
            return Err(format!(
                "the scene has {count} {what}; at most {} fit",
                Mesh::MAX_COUNT
            ));
        }
    }
    let any_normals = pieces
        .iter()
        .any(|piece| !piece.geometry.normals.is_empty());
    let any_uvs = pieces.iter().any(|piece| !piece.geometry.uvs.is_empty());
    let mut all = Geometry::default();
    let mut shapes = Vec::with_capacity(pieces.len());
    let mut pieces: VecDeque<Placed> = pieces
        .into_iter()
        .filter(|piece| !piece.geometry.triangles.is_empty())
        .collect();
    let mut first = pieces.pop_front();
    if let Some(first) = &mut first {
        // The first piece becomes the whole: a large mesh that is alone is not copied.
        all = Arc::unwrap_or_clone(std::mem::take(&mut first.geometry));
    }
    let more = |have: usize, all: usize| all.saturating_sub(have);
    let room = more(all.positions.len(), vertices);
    let reserved = all.positions.try_reserve_exact(room).is_ok()
        && all
            .triangles
            .try_reserve_exact(more(all.triangles.len(), triangles))
            .is_ok()
        && (!any_normals
            || (all.normals)
                .try_reserve_exact(more(all.normals.len(), vertices))
                .is_ok())
        && (!any_uvs
            || (all.uvs)
                .try_reserve_exact(more(all.uvs.len(), vertices))
                .is_ok());
    if !reserved {
        return Err(format!(
            "{triangles} triangles with {vertices} vertices do not fit into memory"
        ));
    }
    if let Some(first) = &first {
        let (has_normals, has_uvs) = (!all.normals.is_empty(), !all.uvs.is_empty());
        if first.to_world != Transform::IDENTITY {
            for p in &mut all.positions {
                *p = first.to_world.point(*p);
            }
        }
        for n in &mut all.normals {
            *n = first.normal(*n);
        }
        let count = all.triangles.len() as u32;
        shapes.push(first.shape(0..count, has_normals, has_uvs));
    }
    let fill = |all: &mut Geometry| {
        if any_normals {
            all.normals.resize(all.positions.len(), [0.0; 3]);
        }
        if any_uvs {
            all.uvs.resize(all.positions.len(), [0.0; 2]);
        }
    };
    fill(&mut all);
    for piece in pieces {
        let g = &*piece.geometry;
        let base = all.positions.len() as u32;
        let start = all.triangles.len() as u32;
        let identity = piece.to_world == Transform::IDENTITY;
        all.positions.extend(
            (g.positions.iter()).map(|&p| if identity { p } else { piece.to_world.point(p) }),
        );
        all.triangles
            .extend(g.triangles.iter().map(|t| t.map(|index| base + index)));
        all.normals
            .extend(g.normals.iter().map(|&n| piece.normal(n)));
        all.uvs.extend(&g.uvs);
        fill(&mut all);
        let triangles = start..all.triangles.len() as u32;
        shapes.push(piece.shape(triangles, !g.normals.is_empty(), !g.uvs.is_empty()));
    }
    let mesh = Mesh::new(all.positions, all.triangles).map_err(|error| error.to_string())?;
    Ok(Assembled {
        mesh,
        normals: all.normals,
        uvs: all.uvs,
        shapes,
    })
}

/// What readers should know, each kind once.
#[derive(Debug, Default)]
pub(crate) struct Notes {
    list: Vec<Note>,
    kinds: HashSet<String>,
    /// Curved shapes by kind and segments: how many, of how many triangles, and the first's place.
    tessellated: BTreeMap<(String, [u32; 2]), (usize, usize, String)>,
}

impl Notes {
    /// Adds a warning unless there has been one of this kind.
    pub(crate) fn warn(&mut self, kind: &str, place: impl FnOnce() -> String, text: String) {
        if self.kinds.insert(kind.to_owned()) {
            self.list.push(Note {
                place: place(),
                text,
                warning: true,
            });
        }
    }

    /// Adds these as they are.
    pub(crate) fn add(&mut self, notes: impl IntoIterator<Item = Note>) {
        self.list.extend(notes);
    }

    /// Adds a fact.
    pub(crate) fn tell(&mut self, place: String, text: String) {
        self.list.push(Note {
            place,
            text,
            warning: false,
        });
    }

    /// Adds a curved shape that was made of triangles.
    pub(crate) fn tessellated(
        &mut self,
        kind: &str,
        place: impl FnOnce() -> String,
        triangles: usize,
        segments: [u32; 2],
    ) {
        let entry = self.tessellated.entry((kind.to_owned(), segments));
        let (shapes, sum, _) = entry.or_insert_with(|| (0, 0, place()));
        *shapes += 1;
        *sum += triangles;
    }

    /// How many curved shapes of a kind there are.
    pub(crate) fn count_of(&self, kind: &str) -> usize {
        let of_kind = self.tessellated.iter().filter(|((k, _), _)| k == kind);
        of_kind.map(|(_, (shapes, ..))| shapes).sum()
    }

    pub(crate) fn into_list(mut self) -> Vec<Note> {
        for ((kind, [u, v]), (shapes, triangles, place)) in std::mem::take(&mut self.tessellated) {
            let first = if shapes > 1 {
                " (the first is here)"
            } else {
                ""
            };
            self.tell(
                place,
                format!(
                    "{shapes} × \"{kind}\" made of {triangles} triangles, {u} × {v} segments \
                     each{first}"
                ),
            );
        }
        self.list
    }
}
