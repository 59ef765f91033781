//! Direct light, and perfect reflection and transmission followed [PBRT3, 14.3]; Whitted's
//! integrator [PBRT3, 1.3.4] is the same with simpler direct light.

use glam::Vec3;

use super::{Gathered, Gatherer, MAX_PASSES};
use crate::render::bsdf::{Bsdf, Kinds};
use crate::render::camera::{Beam, Beside};
use crate::render::interaction::Interaction;

/// How direct light is gathered at a hit.
#[derive(Clone, Copy, Debug)]
pub(super) enum Lighting {
    /// From all lights, or one at random; by the light's choice of direction and the surface's.
    Direct { all_lights: bool },
    /// From all lights, by the light's choice of direction alone.
    Whitted,
}

/// A specular ray that is still to be sent.
pub(super) struct Pending {
    at: Interaction,
    bsdf: Bsdf,
    side: Kinds,
    /// The rays beside the one that hit.
    beside: Option<[Beside; 2]>,
    throughput: Vec3,
    depth: u32,
}

impl<const COUNT: bool> Gatherer<'_, COUNT> {
    /// Each specular hit sends out a reflected and a refracted ray, so a path is a tree; it is
    /// walked depth first.
    pub(super) fn direct(&mut self, camera: &Beam, max_depth: u32, lighting: Lighting) -> Gathered {
        let (hit, first) = self.first_hit(camera);
        let mut sum = Vec3::ZERO;
        self.pending.clear();
        let (mut throughput, mut depth) = (Vec3::ONE, 0);
        let (mut hit, mut beam) = (hit, *camera);
        loop {
            sum += throughput * self.light_at(hit, &beam, throughput, depth, max_depth, lighting);
            let next = loop {
                let Some(pending) = self.pending.pop() else {
                    return Gathered {
                        radiance: sum,
                        first,
                    };
                };
                if let Some(next) = self.follow(&pending) {
                    break next;
                }
            };
            (beam, throughput, depth) = next;
            hit = self.bounce_beam(&beam);
        }
    }

    /// What comes from one hit (`None`: from infinity); rays to follow become pending.
    fn light_at(
        &mut self,
        mut hit: Option<Interaction>,
        beam: &Beam,
        throughput: Vec3,
        depth: u32,
        max_depth: u32,
        lighting: Lighting,
    ) -> Vec3 {
        let lights = self.world.lights;
        let mut scattering = None;
        let mut direction = Vec3::from(beam.ray.direction);
        let mut beside = beam.beside;
        for _ in 0..MAX_PASSES {
            let Some(mut at) = hit else {
                return lights.radiance_from_infinity(direction);
            };
            if let Some(bsdf) = self.world.bsdf(&mut at, false) {
                scattering = Some((at, bsdf));
                break;
            }
            direction = -at.wo;
            beside = None;
            hit = self.bounce(&at.place.ray(direction));
        }
        let Some((at, bsdf)) = scattering else {
            return Vec3::ZERO;
        };
        let mut sum = self.world.emitted(&at, at.wo);
        match lighting {
            Lighting::Direct { all_lights: true } => {
                for light in 0..lights.count() {
                    let (u_light, u_scattering) = (self.sampler.next_2d(), self.sampler.next_2d());
                    sum += self.light_from(light, &at, &bsdf, u_light, u_scattering);
                }
            }
            Lighting::Direct { all_lights: false } => sum += self.light_from_one(&at, &bsdf),
            Lighting::Whitted => {
                for light in 0..lights.count() {
                    let u = self.sampler.next_2d();
                    let Some(sample) = lights.sample(light, &at.place, u) else {
                        continue;
                    };
                    let f = bsdf.f(at.wo, sample.wi, Kinds::ALL);
                    if f != Vec3::ZERO && !self.tracer.blocked(&at.place.ray_to(&sample.source)) {
                        let cosine = sample.wi.dot(at.shading_normal).abs();
                        sum += f * sample.radiance * (cosine / sample.pdf);
                    }
                }
            }
        }
        if depth + 1 < max_depth {
            let pending = |side: Kinds| Pending {
                at,
                bsdf: bsdf.clone(),
                side,
                beside,
                throughput,
                depth,
            };
            // The last one pending is followed first, with all that comes of it.
            self.pending.push(pending(Kinds::TRANSMISSION));
            self.pending.push(pending(Kinds::REFLECTION));
        }
        sum
    }

    /// The ray of a specular hit with its throughput and depth, if there is one.
    fn follow(&mut self, from: &Pending) -> Option<(Beam, Vec3, u32)> {
        let Pending { at, bsdf, side, .. } = from;
        let u = self.sampler.next_2d();
        let sample = bsdf.sample(at.wo, u, side.and(Kinds::SPECULAR))?;
        let cosine = sample.wi.dot(at.shading_normal).abs();
        let throughput = from.throughput * sample.f * (cosine / sample.pdf);
        if throughput == Vec3::ZERO {
            return None;
        }
        let beside = from.beside.as_ref();
        let beam = Beam {
            ray: at.place.ray(sample.wi),
            beside: beside.map(|beside| beside_specular(at, bsdf.eta, *side, sample.wi, beside)),
        };
        Some((beam, throughput, from.depth + 1))
    }
}

/// The rays beside one that is reflected or refracted to `wi` [PBRT3, 10.1.3].
fn beside_specular(
    at: &Interaction,
    eta: f32,
    side: Kinds,
    wi: Vec3,
    beside: &[Beside; 2],
) -> [Beside; 2] {
    let wo = at.wo;
    let f = &at.footprint;
    let moves = [(f.dpdx, f.duvdx), (f.dpdy, f.duvdy)];
    std::array::from_fn(|axis| {
        let (dp, duv) = moves[axis];
        let mut n = at.shading_normal;
        let mut dn = at.dnduv[0] * duv.x + at.dnduv[1] * duv.y;
        let dwo = -beside[axis].direction - wo;
        let direction = if side == Kinds::REFLECTION {
            let d_cosine = dwo.dot(n) + wo.dot(dn);
            wi - dwo + 2.0 * (wo.dot(n) * dn + d_cosine * n)
        } else {
            // The index on the side of wo over that beyond.
            let mut eta = 1.0 / eta;
            if wo.dot(n) < 0.0 {
                eta = 1.0 / eta;
                n = -n;
                dn = -dn;
            }
            let d_cosine = dwo.dot(n) + wo.dot(dn);
            let (cos_o, cos_i) = (wo.dot(n), wi.dot(n).abs());
            let mu = eta * cos_o - cos_i;
            let d_mu = (eta - eta * eta * cos_o / cos_i) * d_cosine;
            wi - eta * dwo + mu * dn + d_mu * n
        };
        Beside {
            origin: at.place.p + dp,
            direction,
        }
    })
}
