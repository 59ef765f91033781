//! Every hit of a ray, in one traversal.

use std::ops::ControlFlow;

#[cfg(test)]
use super::traverse::OfMesh;
use super::traverse::{Search, Triangle};
use super::{Aim, Counters, Hit, run};
#[cfg(test)]
use crate::geometry::Mesh;
use crate::geometry::Ray;
use crate::geometry::triangle::Shear;
use crate::tree::Tree;

/// Collects hits; one for each reference that is met, since a leaf does not know the others.
struct All<'a, F> {
    aim: Aim<'a>,
    accept: F,
    hits: &'a mut Vec<Hit>,
}

impl<F: Fn(&Hit) -> bool> Search for All<'_, F> {
    const NEAREST_FIRST: bool = false;

    #[inline(always)]
    fn shear(&mut self) -> Option<&Shear> {
        Some(self.aim.shear())
    }

    #[inline(always)]
    fn limit(&self) -> f64 {
        f64::from(self.aim.ray.t_max)
    }

    #[inline(always)]
    fn test(&mut self, triangle: &impl Triangle) -> ControlFlow<()> {
        let t_max = self.aim.ray.t_max;
        if let Some(hit) = self.aim.meet(triangle, |t| t <= t_max)
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
        aim: Aim::new(ray),
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
        aim: Aim::new(ray),
        accept: |_: &Hit| true,
        hits: &mut hits,
    };
    for &index in mesh.usable_triangles() {
        let _ = search.test(&OfMesh { mesh, index });
    }
    sort(&mut hits);
    hits
}
