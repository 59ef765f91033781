//! Every hit of a ray, in one traversal.

use std::ops::ControlFlow;

use super::traverse::Search;
use super::{Counters, Hit, run};
#[cfg(test)]
use crate::geometry::Mesh;
use crate::geometry::Ray;
use crate::geometry::triangle::Shear;
use crate::tree::Tree;

/// Collects hits; one for each reference that is met, since a leaf does not know the others.
struct All<'a, F> {
    shear: Shear,
    t_min: f32,
    t_max: f32,
    accept: F,
    hits: &'a mut Vec<Hit>,
}

impl<F: Fn(&Hit) -> bool> Search for All<'_, F> {
    const NEAREST_FIRST: bool = false;

    #[inline(always)]
    fn shear(&self) -> Option<&Shear> {
        Some(&self.shear)
    }

    #[inline(always)]
    fn limit(&self) -> f64 {
        f64::from(self.t_max)
    }

    #[inline(always)]
    fn test(&mut self, triangle: u32, corners: &[[f32; 3]; 3]) -> ControlFlow<()> {
        if let Some(hit) = self.shear.intersect(corners, triangle)
            && hit.t > self.t_min
            && hit.t <= self.t_max
            && self.shear.meets_plane_beyond(self.t_min, corners)
            && (self.accept)(&hit)
        {
            self.hits.push(hit);
        }
        ControlFlow::Continue(())
    }
}

pub(crate) fn all_hits(
    tree: &Tree,
    ray: &Ray,
    accept: impl Fn(&Hit) -> bool,
    hits: &mut Vec<Hit>,
    counters: &mut impl Counters,
) {
    hits.clear();
    let mut search = All {
        shear: Shear::of(ray),
        t_min: ray.t_min,
        t_max: ray.t_max,
        accept,
        hits,
    };
    run(tree, ray, &mut search, counters);
    sort(hits);
}

/// By t, then by index, each triangle once. Adding 0 makes -0 and 0 the same.
fn sort(hits: &mut Vec<Hit>) {
    let key = |hit: &Hit| hit.t + 0.0;
    hits.sort_unstable_by(|a, b| (key(a).total_cmp(&key(b))).then(a.triangle.cmp(&b.triangle)));
    hits.dedup_by_key(|hit| hit.triangle);
}

/// Every triangle tested, without a tree.
#[cfg(test)]
pub(super) fn test_all(mesh: &Mesh, ray: &Ray) -> Vec<Hit> {
    let mut hits = Vec::new();
    let mut search = All {
        shear: Shear::of(ray),
        t_min: ray.t_min,
        t_max: ray.t_max,
        accept: |_: &Hit| true,
        hits: &mut hits,
    };
    for &triangle in mesh.usable_triangles() {
        let _ = search.test(triangle, &mesh.corners(triangle));
    }
    sort(&mut hits);
    hits
}
