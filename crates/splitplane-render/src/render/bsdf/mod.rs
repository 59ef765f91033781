//! How a point of a surface scatters light [PBRT3, 9.1].

mod fresnel;
mod lobe;
mod material;
mod microfacet;
#[cfg(test)]
mod tests;

use glam::{Vec2, Vec3};

pub(super) use lobe::Kinds;
use lobe::Lobe;
pub(super) use material::bsdf_of;

use super::interaction::Interaction;
use super::sampling::ONE_MINUS_EPSILON;

/// As many ways to scatter as a material may combine; a mix of more is cut off, as in pbrt-v3.
const MAX_LOBES: usize = 8;

/// The sum of some lobes, in world space.
#[derive(Clone, Debug)]
pub(super) struct Bsdf {
    /// Index of refraction below the surface over that above.
    pub(super) eta: f32,
    /// Two tangents and the shading normal.
    frame: [Vec3; 3],
    geometric_normal: Vec3,
    lobes: [Share; MAX_LOBES],
    count: usize,
}

/// A lobe, and a factor on it.
#[derive(Clone, Copy, Debug)]
struct Share {
    lobe: Lobe,
    scale: Vec3,
}

/// A direction that a [`Bsdf`] drew.
#[derive(Clone, Copy, Debug)]
pub(super) struct BsdfSample {
    /// Where the light comes from, in world space.
    pub(super) wi: Vec3,
    pub(super) f: Vec3,
    /// In solid angle; of specular scattering the chance of its lobe.
    pub(super) pdf: f32,
    pub(super) kinds: Kinds,
}

impl Bsdf {
    fn new(at: &Interaction, eta: f32) -> Self {
        Bsdf {
            eta,
            frame: [at.tangents[0], at.tangents[1], at.shading_normal],
            geometric_normal: at.place.normal,
            lobes: [Share {
                lobe: Lobe::Lambert { r: Vec3::ZERO },
                scale: Vec3::ONE,
            }; MAX_LOBES],
            count: 0,
        }
    }

    fn add(&mut self, lobe: Lobe) {
        let scale = Vec3::ONE;
        self.add_share(Share { lobe, scale });
    }

    fn add_share(&mut self, share: Share) {
        if let Some(place) = self.lobes.get_mut(self.count) {
            *place = share;
            self.count += 1;
        }
    }

    /// Multiplies all lobes by `scale`.
    fn scale(&mut self, scale: Vec3) {
        for share in &mut self.lobes[..self.count] {
            share.scale *= scale;
        }
    }

    /// Adds the lobes of another, in this frame.
    fn extend(&mut self, other: &Bsdf) {
        for share in &other.lobes[..other.count] {
            self.add_share(*share);
        }
    }

    fn matching(&self, kinds: Kinds) -> impl Iterator<Item = &Share> {
        self.lobes[..self.count]
            .iter()
            .filter(move |share| share.lobe.kinds().within(kinds))
    }

    /// How many of the lobes are of these kinds only.
    pub(super) fn count(&self, kinds: Kinds) -> usize {
        self.matching(kinds).count()
    }

    fn to_local(&self, w: Vec3) -> Vec3 {
        let [s, t, n] = self.frame;
        Vec3::new(w.dot(s), w.dot(t), w.dot(n))
    }

    fn to_world(&self, w: Vec3) -> Vec3 {
        let [s, t, n] = self.frame;
        w.x * s + w.y * t + w.z * n
    }

    /// The sum of the lobes that may scatter from `wi` to `wo`. Which side the directions are on
    /// is asked of the geometric normal, so that light does not leak through [Veach1997, 5.3].
    fn sum(
        &self,
        (wo_world, wo): (Vec3, Vec3),
        (wi_world, wi): (Vec3, Vec3),
        kinds: Kinds,
    ) -> Vec3 {
        let n = self.geometric_normal;
        let side = if wi_world.dot(n) * wo_world.dot(n) > 0.0 {
            Kinds::REFLECTION
        } else {
            Kinds::TRANSMISSION
        };
        self.matching(kinds)
            .filter(|share| share.lobe.kinds().has(side))
            .map(|share| share.scale * share.lobe.f(wo, wi))
            .sum()
    }

    /// The value for light that comes from `wi` and goes to `wo`.
    pub(super) fn f(&self, wo: Vec3, wi: Vec3, kinds: Kinds) -> Vec3 {
        let (wo_local, wi_local) = (self.to_local(wo), self.to_local(wi));
        if wo_local.z == 0.0 {
            return Vec3::ZERO;
        }
        self.sum((wo, wo_local), (wi, wi_local), kinds)
    }

    /// The density with which [`Bsdf::sample`] draws `wi`.
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3, kinds: Kinds) -> f32 {
        let (wo, wi) = (self.to_local(wo), self.to_local(wi));
        let count = self.count(kinds);
        if wo.z == 0.0 || count == 0 {
            return 0.0;
        }
        self.matching(kinds)
            .map(|share| share.lobe.pdf(wo, wi))
            .sum::<f32>()
            / count as f32
    }

    /// Draws a lobe of these kinds by `u.x`, and a direction by it.
    pub(super) fn sample(&self, wo_world: Vec3, u: Vec2, kinds: Kinds) -> Option<BsdfSample> {
        let count = self.count(kinds);
        let chosen = ((u.x * count as f32) as usize).min(count.checked_sub(1)?);
        let Share { lobe, scale } = self.matching(kinds).nth(chosen)?;
        let wo = self.to_local(wo_world);
        if wo.z == 0.0 {
            return None;
        }
        let rest = (u.x * count as f32 - chosen as f32).min(ONE_MINUS_EPSILON);
        let mut drawn = lobe.sample(wo, Vec2::new(rest, u.y))?;
        if drawn.pdf <= 0.0 || drawn.pdf.is_nan() {
            return None;
        }
        drawn.f *= *scale;
        let wi = self.to_world(drawn.wi);
        if !drawn.kinds.has(Kinds::SPECULAR) {
            let others = self
                .matching(kinds)
                .enumerate()
                .filter(|(i, _)| *i != chosen);
            drawn.pdf += others
                .map(|(_, other)| other.lobe.pdf(wo, drawn.wi))
                .sum::<f32>();
            drawn.f = self.sum((wo_world, wo), (wi, drawn.wi), kinds);
        }
        Some(BsdfSample {
            wi,
            f: drawn.f,
            pdf: drawn.pdf / count as f32,
            kinds: drawn.kinds,
        })
    }
}
