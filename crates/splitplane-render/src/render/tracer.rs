//! Rays, cast and counted.

use splitplane::{Counters, Counts, Hit, Ray, Tree};

use super::{LeafSizes, RayKinds};

/// A tree, and what rays of each kind did to it; `COUNT` says whether the queries count.
pub(super) struct Tracer<'t, const COUNT: bool> {
    tree: &'t Tree,
    pub(super) rays: RayKinds<u64>,
    pub(super) counts: RayKinds<Counts>,
    pub(super) tests_by_leaf_size: RayKinds<LeafSizes>,
}

impl<'t, const COUNT: bool> Tracer<'t, COUNT> {
    pub(super) fn new(tree: &'t Tree) -> Self {
        Tracer {
            tree,
            rays: RayKinds::default(),
            counts: RayKinds::default(),
            tests_by_leaf_size: RayKinds::default(),
        }
    }

    pub(super) fn camera(&mut self, ray: &Ray) -> Option<Hit> {
        self.rays.camera += 1;
        let sizes = &mut self.tests_by_leaf_size.camera;
        if COUNT {
            let counters = &mut Tally::new(&mut self.counts.camera, sizes);
            self.tree.closest_hit(ray, counters)
        } else {
            self.tree.closest_hit(ray, &mut ())
        }
    }

    pub(super) fn bounce(&mut self, ray: &Ray) -> Option<Hit> {
        self.rays.bounce += 1;
        let sizes = &mut self.tests_by_leaf_size.bounce;
        if COUNT {
            let counters = &mut Tally::new(&mut self.counts.bounce, sizes);
            self.tree.closest_hit(ray, counters)
        } else {
            self.tree.closest_hit(ray, &mut ())
        }
    }

    pub(super) fn blocked(&mut self, ray: &Ray) -> bool {
        self.rays.shadow += 1;
        let sizes = &mut self.tests_by_leaf_size.shadow;
        if COUNT {
            let counters = &mut Tally::new(&mut self.counts.shadow, sizes);
            self.tree.any_hit(ray, counters)
        } else {
            self.tree.any_hit(ray, &mut ())
        }
    }
}

/// Counts, and tells tests apart by the leaf that they are made in.
struct Tally<'a> {
    counts: &'a mut Counts,
    sizes: &'a mut LeafSizes,
    leaf: usize,
}

impl<'a> Tally<'a> {
    fn new(counts: &'a mut Counts, sizes: &'a mut LeafSizes) -> Self {
        Tally {
            counts,
            sizes,
            leaf: 0,
        }
    }
}

impl Counters for Tally<'_> {
    #[inline(always)]
    fn triangle_test(&mut self) {
        self.counts.triangle_test();
        self.sizes.0[self.leaf] += 1;
    }
    #[inline(always)]
    fn kd_visit(&mut self) {
        self.counts.kd_visit();
    }
    #[inline(always)]
    fn oblique_visit(&mut self) {
        self.counts.oblique_visit();
    }
    #[inline(always)]
    fn leaf_visit(&mut self, triangles: u32) {
        self.counts.leaf_visit(triangles);
        self.leaf = triangles as usize;
        if self.sizes.0.len() <= self.leaf {
            self.sizes.0.resize(self.leaf + 1, 0);
        }
    }
}
