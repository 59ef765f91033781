//! Direct light, and perfect reflection and transmission followed [PBRT3, 14.3].

use glam::Vec3;
use splitplane::Ray;

use super::{Gathered, Gatherer, MAX_PASSES};
use crate::render::bsdf::{Bsdf, Kinds};
use crate::render::interaction::Interaction;

/// A specular ray that is still to be followed.
pub(super) struct Pending {
    ray: Ray,
    throughput: Vec3,
    depth: u32,
}

impl<const COUNT: bool> Gatherer<'_, COUNT> {
    /// Each specular hit sends out a reflected and a refracted ray, so a path is a tree; it is
    /// walked depth first.
    pub(super) fn direct(
        &mut self,
        camera_ray: &Ray,
        max_depth: u32,
        all_lights: bool,
    ) -> Gathered {
        let (mut hit, first) = self.first_hit(camera_ray);
        let mut sum = Vec3::ZERO;
        let (mut throughput, mut depth) = (Vec3::ONE, 0);
        self.pending.clear();
        loop {
            sum += throughput * self.direct_at(hit, throughput, depth, max_depth, all_lights);
            let Some(next) = self.pending.pop() else {
                break;
            };
            (throughput, depth) = (next.throughput, next.depth);
            hit = self.bounce(&next.ray);
        }
        Gathered {
            radiance: sum,
            first,
        }
    }

    /// What comes from one hit (`None`: from infinity); rays to follow become pending.
    fn direct_at(
        &mut self,
        mut hit: Option<Interaction>,
        throughput: Vec3,
        depth: u32,
        max_depth: u32,
        all_lights: bool,
    ) -> Vec3 {
        let mut scattering = None;
        for _ in 0..MAX_PASSES {
            let Some(at) = hit else {
                return self.world.from_infinity;
            };
            if let Some(bsdf) = self.world.bsdf(&at, false) {
                scattering = Some((at, bsdf));
                break;
            }
            hit = self.bounce(&at.place.ray(-at.wo));
        }
        let Some((at, bsdf)) = scattering else {
            return Vec3::ZERO;
        };
        let mut sum = self.world.emitted(&at, at.wo);
        if all_lights {
            for light in 0..self.world.lights.count() {
                let (u_light, u_scattering) = (self.sampler.next_2d(), self.sampler.next_2d());
                sum += self.light_from(light, &at, &bsdf, u_light, u_scattering);
            }
        } else {
            sum += self.light_from_one(&at, &bsdf);
        }
        if depth + 1 < max_depth {
            // The last one pending is followed first.
            self.follow(&at, &bsdf, Kinds::TRANSMISSION, throughput, depth);
            self.follow(&at, &bsdf, Kinds::REFLECTION, throughput, depth);
        }
        sum
    }

    fn follow(&mut self, at: &Interaction, bsdf: &Bsdf, side: Kinds, throughput: Vec3, depth: u32) {
        let u = self.sampler.next_2d();
        if let Some(sample) = bsdf.sample(at.wo, u, side.and(Kinds::SPECULAR)) {
            let cosine = sample.wi.dot(at.shading_normal).abs();
            let throughput = throughput * sample.f * (cosine / sample.pdf);
            if throughput != Vec3::ZERO {
                let ray = at.place.ray(sample.wi);
                self.pending.push(Pending {
                    ray,
                    throughput,
                    depth: depth + 1,
                });
            }
        }
    }
}
