//! Ambient occlusion, as pbrt-v3 has it.

use glam::Vec3;

use super::{Gathered, Gatherer, MAX_PASSES};
use crate::render::camera::Beam;
use crate::render::sampling::{
    UNIFORM_HEMISPHERE_PDF, cosine_hemisphere, cosine_hemisphere_pdf, uniform_hemisphere,
};

impl<const COUNT: bool> Gatherer<'_, COUNT> {
    /// The cosine-weighted part of the hemisphere that is open, times π: pbrt-v3 does not divide
    /// by it.
    pub(super) fn ambient(&mut self, camera: &Beam, cosine: bool, samples: u32) -> Gathered {
        let (mut hit, first) = self.first_hit(camera);
        for _ in 0..MAX_PASSES {
            let Some(mut at) = hit else { break };
            if self.world.bsdf(&mut at, true).is_some() {
                hit = Some(at);
                break;
            }
            hit = self.bounce(&at.place.ray(-at.wo));
        }
        let mut open = 0.0;
        if let Some(at) = hit {
            let normal = at.place.normal;
            let facing = if normal.dot(at.wo) < 0.0 {
                -normal
            } else {
                normal
            };
            let s = at.dpdu.normalize_or_zero();
            let t = normal.cross(s);
            for i in 0..samples {
                let u = self.sampler.array_2d(samples, i);
                let (w, pdf) = if cosine {
                    let w = cosine_hemisphere(u);
                    (w, cosine_hemisphere_pdf(w.z))
                } else {
                    (uniform_hemisphere(u), UNIFORM_HEMISPHERE_PDF)
                };
                let wi = w.x * s + w.y * t + w.z * facing;
                if pdf > 0.0 && !self.tracer.blocked(&at.place.ray(wi)) {
                    open += wi.dot(facing) / (pdf * samples as f32);
                }
            }
            self.sampler.end_array();
        }
        Gathered {
            radiance: Vec3::splat(open),
            first,
        }
    }
}
