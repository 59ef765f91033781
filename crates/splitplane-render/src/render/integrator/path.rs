//! pbrt-v3's path tracer [PBRT3, 14.5.4].

use glam::Vec3;

use super::{Gathered, Gatherer, MAX_PASSES};
use crate::render::bsdf::Kinds;
use crate::render::camera::Beam;

/// Russian roulette may end a path after this bounce.
const SAFE_BOUNCES: u32 = 3;

impl<const COUNT: bool> Gatherer<'_, COUNT> {
    pub(super) fn path(&mut self, camera: &Beam, max_depth: u32, rr_threshold: f32) -> Gathered {
        let (mut hit, first) = self.first_hit(camera);
        let mut direction = Vec3::from(camera.ray.direction);
        let mut sum = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        // What refraction did to the throughput; Russian roulette does without it, as it will be
        // undone when the path leaves the medium.
        let mut eta_scale = 1.0;
        let (mut bounces, mut passes) = (0, 0);
        let mut count_emission = true;
        loop {
            if count_emission {
                sum += throughput
                    * match &hit {
                        Some(at) => self.world.emitted(at, at.wo),
                        None => self.world.lights.radiance_from_infinity(direction),
                    };
            }
            let Some(mut at) = hit else { break };
            if bounces >= max_depth {
                break;
            }
            let Some(bsdf) = self.world.bsdf(&mut at, true) else {
                passes += 1;
                if passes > MAX_PASSES {
                    break;
                }
                hit = self.bounce(&at.place.ray(-at.wo));
                continue;
            };
            if bsdf.count(Kinds::NOT_SPECULAR) > 0 {
                sum += throughput * self.light_from_one(&at, &bsdf);
            }
            let u = self.sampler.next_2d();
            let Some(sample) = bsdf.sample(at.wo, u, Kinds::ALL) else {
                break;
            };
            if sample.f == Vec3::ZERO {
                break;
            }
            throughput *= sample.f * (sample.wi.dot(at.shading_normal).abs() / sample.pdf);
            count_emission = sample.kinds.has(Kinds::SPECULAR);
            if sample.kinds.has(Kinds::SPECULAR.and(Kinds::TRANSMISSION)) {
                let eta2 = bsdf.eta * bsdf.eta;
                eta_scale *= if at.wo.dot(at.place.normal) > 0.0 {
                    eta2
                } else {
                    1.0 / eta2
                };
            }
            direction = sample.wi;
            let next = at.place.ray(sample.wi);
            let lasting = (throughput * eta_scale).max_element();
            if lasting < rr_threshold && bounces > SAFE_BOUNCES {
                let end = (1.0 - lasting).max(0.05);
                if self.sampler.next_1d() < end {
                    break;
                }
                throughput /= 1.0 - end;
            }
            hit = self.bounce(&next);
            bounces += 1;
        }
        Gathered {
            radiance: sum,
            first,
        }
    }
}
