//! What is measured, behind one trait.

use anyhow::{Context, Result, bail};
use splitplane::{Hit, Mesh, Ray};

use crate::rays::Kind;
use crate::{bvh_crate, embree, obvhs_crate, ours, parry, tinybvh};

/// A structure over a mesh that answers rays.
///
/// Rays have directions of unit length. `u` and `v` of a hit are NaN where the library does not
/// give them; only `t` is compared.
pub trait Contender {
    /// The closest hit of each ray.
    fn closest(&self, kind: Kind, rays: &[Ray], hits: &mut [Option<Hit>]);
    /// Whether each ray hits anything.
    fn any(&self, kind: Kind, rays: &[Ray], hits: &mut [bool]);
    /// Bytes of the structure, with the triangles that it holds itself, without those of the mesh.
    fn bytes(&self) -> u64;
    /// Its work on these rays, where it can tell.
    fn work(&self, _kind: Kind, _rays: &[Ray]) -> Work {
        Work::default()
    }
    /// Moves the structure to another place in memory, where that is cheap.
    fn move_elsewhere(&mut self) {}
    /// Whether its hits are to be those of brute force, bit for bit.
    fn is_exact(&self) -> bool {
        false
    }
}

/// What was done in all, of those that are counted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// Interior nodes visited.
    pub visits: Option<u64>,
    /// Leaves, or blocks of triangles, visited.
    pub blocks: Option<u64>,
    /// Triangles tested.
    pub tests: Option<u64>,
}

/// The triangles that can be hit.
pub struct Geometry<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Three vertices a triangle, as indices into the mesh's positions.
    pub triangles: Vec<[u32; 3]>,
}

impl<'a> Geometry<'a> {
    /// Those of a mesh.
    pub fn of(mesh: &'a Mesh) -> Self {
        let usable = mesh.usable_triangles().iter();
        Geometry {
            mesh,
            triangles: usable.map(|&i| mesh.triangles()[i as usize]).collect(),
        }
    }

    /// The vertices of a triangle.
    pub fn corners(&self, triangle: [u32; 3]) -> [[f32; 3]; 3] {
        triangle.map(|i| self.mesh.positions()[i as usize])
    }
}

/// The names of all contenders but our own trees.
pub const RIVALS: &str = "embree, embree-robust, embree-packet4, -packet8, -packet16 (also after \
                          embree-robust), obvhs-bvh2, obvhs-cwbvh, bvh-crate, parry3d, \
                          tinybvh-bvh8";

/// Builds the contender of that name on `threads` threads.
pub fn build(name: &str, geometry: &Geometry<'_>, threads: usize) -> Result<Box<dyn Contender>> {
    Ok(match name {
        _ if name.starts_with("embree") => embree::build(name, geometry, threads)?,
        "obvhs-bvh2" => Box::new(obvhs_crate::Bvh2::build(geometry)),
        "obvhs-cwbvh" => Box::new(obvhs_crate::CwBvh::build(geometry)),
        "bvh-crate" => Box::new(bvh_crate::Candidates::build(geometry)),
        "parry3d" => Box::new(parry::Parry::build(geometry)?),
        "tinybvh-bvh8" => tinybvh::build(geometry)?,
        _ => Box::new(ours::Ours::build(name, geometry.mesh, threads).with_context(|| {
            format!(
                "there is no contender \"{name}\"; there are {RIVALS}, and our trees by name, each \
                 with /PRESET and @LAYOUT where they are not the default ones"
            )
        })?),
    })
}

/// Answers rays one at a time.
#[inline(always)]
pub fn each<T>(rays: &[Ray], answers: &mut [T], mut answer: impl FnMut(&Ray) -> T) {
    for (ray, into) in rays.iter().zip(answers) {
        *into = answer(ray);
    }
}

/// The hit of a library that tells no more than where and what.
#[inline(always)]
pub fn hit(t: f32, triangle: u32) -> Hit {
    Hit {
        t,
        u: f32::NAN,
        v: f32::NAN,
        triangle,
    }
}

/// Refuses a contender that this build does not have.
#[allow(dead_code)]
pub fn absent(name: &str, how: &str) -> Result<Box<dyn Contender>> {
    bail!("{name} is not part of this build; {how}")
}
