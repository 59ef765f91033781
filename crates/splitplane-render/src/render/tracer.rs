//! Rays, cast and counted.

use splitplane::{Counters, Counts, InstanceHit, Ray};

use super::integrator::World;
use super::interaction::spot_of;
use super::part::SceneTree;
use super::texture::evaluate;
use super::{LeafSizes, RayKinds};

/// A tree, and what rays of each kind did to it; `COUNT` says whether the queries count.
pub(super) struct Tracer<'t, const COUNT: bool> {
    tree: SceneTree<'t>,
    world: &'t World<'t>,
    pub(super) rays: RayKinds<u64>,
    pub(super) counts: RayKinds<Counts>,
    pub(super) tests_by_leaf_size: RayKinds<LeafSizes>,
}

impl<'t, const COUNT: bool> Tracer<'t, COUNT> {
    pub(super) fn new(tree: SceneTree<'t>, world: &'t World<'t>) -> Self {
        Tracer {
            tree,
            world,
            rays: RayKinds::default(),
            counts: RayKinds::default(),
            tests_by_leaf_size: RayKinds::default(),
        }
    }

    pub(super) fn camera(&mut self, ray: &Ray) -> Option<InstanceHit> {
        self.rays.camera += 1;
        let sizes = &mut self.tests_by_leaf_size.camera;
        if COUNT {
            let counters = &mut Tally::new(&mut self.counts.camera, sizes);
            closest(self.tree, self.world, ray, counters)
        } else {
            closest(self.tree, self.world, ray, &mut ())
        }
    }

    pub(super) fn bounce(&mut self, ray: &Ray) -> Option<InstanceHit> {
        self.rays.bounce += 1;
        let sizes = &mut self.tests_by_leaf_size.bounce;
        if COUNT {
            let counters = &mut Tally::new(&mut self.counts.bounce, sizes);
            closest(self.tree, self.world, ray, counters)
        } else {
            closest(self.tree, self.world, ray, &mut ())
        }
    }

    pub(super) fn blocked(&mut self, ray: &Ray) -> bool {
        self.rays.shadow += 1;
        let sizes = &mut self.tests_by_leaf_size.shadow;
        if COUNT {
            let counters = &mut Tally::new(&mut self.counts.shadow, sizes);
            blocked(self.tree, self.world, ray, counters)
        } else {
            blocked(self.tree, self.world, ray, &mut ())
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
    fn triangle_tests(&mut self, triangles: u32) {
        self.counts.triangle_tests(triangles);
        self.sizes.0[self.leaf] += u64::from(triangles);
    }
    #[inline(always)]
    fn wide_visit(&mut self) {
        self.counts.wide_visit();
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

fn closest(
    tree: SceneTree<'_>,
    world: &World<'_>,
    ray: &Ray,
    counters: &mut impl Counters,
) -> Option<InstanceHit> {
    let own = |hit| InstanceHit { hit, instance: 0 };
    match (tree, world.has_alpha) {
        (SceneTree::Tree(tree), false) => tree.closest_hit(ray, counters).map(own),
        (SceneTree::Tree(tree), true) => tree
            .closest_hit_where(ray, |hit| is_there(world, &own(*hit), false), counters)
            .map(own),
        (SceneTree::Instances(instances), false) => instances.closest_hit(ray, counters),
        (SceneTree::Instances(instances), true) => {
            instances.closest_hit_where(ray, |found| is_there(world, found, false), counters)
        }
    }
}

fn blocked(
    tree: SceneTree<'_>,
    world: &World<'_>,
    ray: &Ray,
    counters: &mut impl Counters,
) -> bool {
    let own = |hit| InstanceHit { hit, instance: 0 };
    match (tree, world.has_alpha) {
        (SceneTree::Tree(tree), false) => tree.any_hit(ray, counters),
        (SceneTree::Tree(tree), true) => {
            tree.any_hit_where(ray, |hit| is_there(world, &own(*hit), true), counters)
        }
        (SceneTree::Instances(instances), false) => instances.any_hit(ray, counters),
        (SceneTree::Instances(instances), true) => {
            instances.any_hit_where(ray, |found| is_there(world, found, true), counters)
        }
    }
}

/// Whether the surface is there where a ray hits it, by its alpha textures.
fn is_there(world: &World<'_>, found: &InstanceHit, for_shadow: bool) -> bool {
    let shape = world.shape(found.instance, found.hit.triangle);
    let masks = [
        shape.alpha.as_ref(),
        shape.shadow_alpha.as_ref().filter(|_| for_shadow),
    ];
    masks.into_iter().flatten().all(|mask| {
        let spot = spot_of(world.in_place(found.instance), shape, &found.hit);
        evaluate(mask, &spot).x != 0.0
    })
}
