//! obvhs: the best trees that it builds, with the triangles in the order of the leaves, as its
//! examples have them.

use std::cell::Cell;
use std::time::Duration;

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::{Ray as TheirRay, RayHit};
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use splitplane::{Hit, Ray};

use crate::contender::{Contender, Geometry, Work, each, hit};
use crate::rays::Kind;

fn triangles(geometry: &Geometry<'_>) -> Vec<Triangle> {
    let corners = geometry.triangles.iter().map(|&t| geometry.corners(t));
    corners
        .map(|c| {
            let [v0, v1, v2] = c.map(Vec3A::from);
            Triangle { v0, v1, v2 }
        })
        .collect()
}

fn in_order(triangles: &[Triangle], indices: &[u32]) -> Vec<RtTriangle> {
    indices
        .iter()
        .map(|&i| (&triangles[i as usize]).into())
        .collect()
}

#[inline(always)]
fn theirs(ray: &Ray) -> TheirRay {
    TheirRay::new(
        ray.origin.into(),
        ray.direction.into(),
        ray.t_min,
        ray.t_max,
    )
}

macro_rules! contender {
    ($(#[$doc:meta])* $name:ident, $tree:ty, $build:ident) => {
        $(#[$doc])*
        pub struct $name {
            tree: $tree,
            triangles: Vec<RtTriangle>,
        }

        impl $name {
            /// Builds it.
            pub fn build(geometry: &Geometry<'_>) -> Self {
                let all = triangles(geometry);
                let tree = $build(
                    &all,
                    BvhBuildParams::very_slow_build(),
                    &mut Duration::default(),
                );
                let triangles = in_order(&all, &tree.primitive_indices);
                $name { tree, triangles }
            }
        }

        impl Contender for $name {
            fn closest(&self, _: Kind, rays: &[Ray], hits: &mut [Option<Hit>]) {
                each(rays, hits, |ray| {
                    let mut found = RayHit::none();
                    let test = |ray: &TheirRay, i: usize| self.triangles[i].intersect(ray);
                    let is_hit = self.tree.ray_traverse(theirs(ray), &mut found, test);
                    is_hit.then(|| {
                        let place = found.primitive_id as usize;
                        hit(found.t, self.tree.primitive_indices[place])
                    })
                });
            }

            fn any(&self, _: Kind, rays: &[Ray], hits: &mut [bool]) {
                each(rays, hits, |ray| {
                    let test = |ray: &TheirRay, i: usize| self.triangles[i].intersect(ray);
                    !self.tree.ray_traverse_miss(theirs(ray), test)
                });
            }

            fn bytes(&self) -> u64 {
                (size_of_val(self.tree.nodes.as_slice())
                    + size_of_val(self.tree.primitive_indices.as_slice())
                    + size_of_val(self.triangles.as_slice())) as u64
            }

            fn work(&self, kind: Kind, rays: &[Ray]) -> Work {
                let tests = Cell::new(0);
                let test = |ray: &TheirRay, i: usize| {
                    tests.set(tests.get() + 1);
                    self.triangles[i].intersect(ray)
                };
                for ray in rays {
                    if kind.any_hit() {
                        self.tree.ray_traverse_miss(theirs(ray), test);
                    } else {
                        self.tree
                            .ray_traverse(theirs(ray), &mut RayHit::none(), test);
                    }
                }
                Work {
                    tests: Some(tests.get()),
                    ..Work::default()
                }
            }
        }
    };
}

contender!(
    /// A binary hierarchy, its slowest and best build.
    Bvh2,
    obvhs::bvh2::Bvh2,
    build_bvh2_from_tris
);
contender!(
    /// An eight-wide hierarchy with compressed boxes, its slowest and best build.
    CwBvh,
    obvhs::cwbvh::CwBvh,
    build_cwbvh_from_tris
);
