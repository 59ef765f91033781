//! Rays, cast and counted.

use splitplane::{Counts, Hit, Ray, Tree};

use super::RayKinds;

/// A tree, and what rays of each kind did to it; `COUNT` says whether the queries count.
pub(super) struct Tracer<'t, const COUNT: bool> {
    tree: &'t Tree,
    pub(super) rays: RayKinds<u64>,
    pub(super) counts: RayKinds<Counts>,
}

impl<'t, const COUNT: bool> Tracer<'t, COUNT> {
    pub(super) fn new(tree: &'t Tree) -> Self {
        Tracer {
            tree,
            rays: RayKinds::default(),
            counts: RayKinds::default(),
        }
    }

    pub(super) fn camera(&mut self, ray: &Ray) -> Option<Hit> {
        self.rays.camera += 1;
        if COUNT {
            self.tree.closest_hit(ray, &mut self.counts.camera)
        } else {
            self.tree.closest_hit(ray, &mut ())
        }
    }

    pub(super) fn bounce(&mut self, ray: &Ray) -> Option<Hit> {
        self.rays.bounce += 1;
        if COUNT {
            self.tree.closest_hit(ray, &mut self.counts.bounce)
        } else {
            self.tree.closest_hit(ray, &mut ())
        }
    }

    pub(super) fn blocked(&mut self, ray: &Ray) -> bool {
        self.rays.shadow += 1;
        if COUNT {
            self.tree.any_hit(ray, &mut self.counts.shadow)
        } else {
            self.tree.any_hit(ray, &mut ())
        }
    }
}
