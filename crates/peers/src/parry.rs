//! parry3d's triangle mesh.

use anyhow::{Result, anyhow};
use parry3d::math::Vector;
use parry3d::query::{Ray as TheirRay, RayCast};
use parry3d::shape::{CompositeShapeRef, TriMesh};
use splitplane::{Hit, Ray};

use crate::contender::{Contender, Geometry, each, hit};
use crate::rays::Kind;

/// A mesh with its hierarchy.
pub struct Parry(TriMesh);

impl Parry {
    /// Builds it.
    ///
    /// # Errors
    /// A mesh without triangles.
    pub fn build(geometry: &Geometry<'_>) -> Result<Self> {
        let positions = geometry.mesh.positions().iter();
        let positions = positions.map(|&[x, y, z]| Vector::new(x, y, z)).collect();
        TriMesh::new(positions, geometry.triangles.clone())
            .map(Parry)
            .map_err(|error| anyhow!("parry3d: {error:?}"))
    }
}

#[inline(always)]
fn theirs(ray: &Ray) -> TheirRay {
    let vector = |[x, y, z]: [f32; 3]| Vector::new(x, y, z);
    TheirRay::new(vector(ray.origin), vector(ray.direction))
}

/// It takes no infinite length.
#[inline(always)]
fn longest(ray: &Ray) -> f32 {
    ray.t_max.min(f32::MAX)
}

impl Contender for Parry {
    fn closest(&self, _: Kind, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let shape = CompositeShapeRef(&self.0);
        each(rays, hits, |ray| {
            shape
                .cast_local_ray(&theirs(ray), longest(ray), false)
                .map(|(triangle, t)| hit(t, triangle))
        });
    }

    fn any(&self, _: Kind, rays: &[Ray], hits: &mut [bool]) {
        each(rays, hits, |ray| {
            self.0.intersects_local_ray(&theirs(ray), longest(ray))
        });
    }

    fn bytes(&self) -> u64 {
        self.0.bvh().heap_memory_size() as u64
    }
}
