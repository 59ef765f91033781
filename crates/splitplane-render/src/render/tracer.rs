//! Rays, cast and counted.

use splitplane::{Counters, Counts, Hit, Ray, Tree};

use super::RayKinds;
use super::integrator::World;
use super::interaction::spot_of;
use super::texture::evaluate;

/// A tree, and what rays of each kind did to it; `COUNT` says whether the queries count.
pub(super) struct Tracer<'t, const COUNT: bool> {
    tree: &'t Tree,
    world: &'t World<'t>,
    pub(super) rays: RayKinds<u64>,
    pub(super) counts: RayKinds<Counts>,
}

impl<'t, const COUNT: bool> Tracer<'t, COUNT> {
    pub(super) fn new(tree: &'t Tree, world: &'t World<'t>) -> Self {
        Tracer {
            tree,
            world,
            rays: RayKinds::default(),
            counts: RayKinds::default(),
        }
    }

    pub(super) fn camera(&mut self, ray: &Ray) -> Option<Hit> {
        self.rays.camera += 1;
        if COUNT {
            closest(self.tree, self.world, ray, &mut self.counts.camera)
        } else {
            closest(self.tree, self.world, ray, &mut ())
        }
    }

    pub(super) fn bounce(&mut self, ray: &Ray) -> Option<Hit> {
        self.rays.bounce += 1;
        if COUNT {
            closest(self.tree, self.world, ray, &mut self.counts.bounce)
        } else {
            closest(self.tree, self.world, ray, &mut ())
        }
    }

    pub(super) fn blocked(&mut self, ray: &Ray) -> bool {
        self.rays.shadow += 1;
        if COUNT {
            blocked(self.tree, self.world, ray, &mut self.counts.shadow)
        } else {
            blocked(self.tree, self.world, ray, &mut ())
        }
    }
}

fn closest(tree: &Tree, world: &World<'_>, ray: &Ray, counters: &mut impl Counters) -> Option<Hit> {
    if !world.has_alpha {
        return tree.closest_hit(ray, counters);
    }
    tree.closest_hit_where(ray, |hit| is_there(world, hit, false), counters)
}

fn blocked(tree: &Tree, world: &World<'_>, ray: &Ray, counters: &mut impl Counters) -> bool {
    if !world.has_alpha {
        return tree.any_hit(ray, counters);
    }
    tree.any_hit_where(ray, |hit| is_there(world, hit, true), counters)
}

/// Whether the surface is there where a ray hits it, by its alpha textures.
fn is_there(world: &World<'_>, hit: &Hit, for_shadow: bool) -> bool {
    let shape = world.shape(hit.triangle);
    let masks = [
        shape.alpha.as_ref(),
        shape.shadow_alpha.as_ref().filter(|_| for_shadow),
    ];
    masks.into_iter().flatten().all(|mask| {
        let spot = spot_of(world.scene, shape, hit);
        evaluate(mask, &spot).x != 0.0
    })
}
