//! The ways to scatter that surfaces are composed of [PBRT3, chapter 8].
//!
//! Directions point away from the surface, in the frame where the shading normal is z.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Vec2, Vec3};

use super::fresnel::{Fresnel, dielectric, refract};
use super::microfacet::{TrowbridgeReitz, azimuth};
use crate::render::sampling::{ONE_MINUS_EPSILON, cosine_hemisphere, cosine_hemisphere_pdf};

/// Kinds of scattering, as a set of bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) struct Kinds(u8);

impl Kinds {
    pub(in crate::render) const REFLECTION: Kinds = Kinds(1);
    pub(in crate::render) const TRANSMISSION: Kinds = Kinds(2);
    pub(in crate::render) const DIFFUSE: Kinds = Kinds(4);
    pub(in crate::render) const GLOSSY: Kinds = Kinds(8);
    pub(in crate::render) const SPECULAR: Kinds = Kinds(16);
    pub(in crate::render) const ALL: Kinds = Kinds(31);
    pub(in crate::render) const NOT_SPECULAR: Kinds = Kinds(15);

    pub(in crate::render) const fn and(self, other: Kinds) -> Kinds {
        Kinds(self.0 | other.0)
    }

    /// Whether all of these are among `others`.
    pub(in crate::render) const fn within(self, others: Kinds) -> bool {
        self.0 & !others.0 == 0
    }

    pub(in crate::render) const fn has(self, other: Kinds) -> bool {
        other.within(self)
    }
}

/// One way to scatter. `above` is the index of refraction on the normal's side.
#[derive(Clone, Copy, Debug)]
pub(super) enum Lobe {
    Lambert {
        r: Vec3,
    },
    /// Rough and diffuse, with the two constants of [Oren1994].
    OrenNayar {
        r: Vec3,
        a: f32,
        b: f32,
    },
    /// Diffuse to the other side.
    LambertTransmission {
        t: Vec3,
    },
    /// Diffuse under a coat [Ashikhmin2000].
    Coated {
        d: Vec3,
        s: Vec3,
        facets: TrowbridgeReitz,
    },
    SpecularReflection {
        r: Vec3,
        fresnel: Fresnel,
    },
    SpecularTransmission {
        t: Vec3,
        above: f32,
        below: f32,
    },
    /// Smooth glass: reflects or transmits, by Fresnel's chance.
    FresnelSpecular {
        r: Vec3,
        t: Vec3,
        above: f32,
        below: f32,
    },
    MicrofacetReflection {
        r: Vec3,
        facets: TrowbridgeReitz,
        fresnel: Fresnel,
    },
    MicrofacetTransmission {
        t: Vec3,
        facets: TrowbridgeReitz,
        above: f32,
        below: f32,
    },
}

/// A direction that a lobe drew.
pub(super) struct LobeSample {
    pub(super) wi: Vec3,
    pub(super) f: Vec3,
    pub(super) pdf: f32,
    /// What happened.
    pub(super) kinds: Kinds,
}

impl Lobe {
    /// `sigma`: in degrees.
    pub(super) fn diffuse(r: Vec3, sigma: f32) -> Lobe {
        if sigma == 0.0 {
            return Lobe::Lambert { r };
        }
        let sigma2 = sigma.to_radians() * sigma.to_radians();
        Lobe::OrenNayar {
            r,
            a: 1.0 - sigma2 / (2.0 * (sigma2 + 0.33)),
            b: 0.45 * sigma2 / (sigma2 + 0.09),
        }
    }

    pub(super) fn kinds(&self) -> Kinds {
        match self {
            Lobe::Lambert { .. } | Lobe::OrenNayar { .. } => Kinds::REFLECTION.and(Kinds::DIFFUSE),
            Lobe::LambertTransmission { .. } => Kinds::TRANSMISSION.and(Kinds::DIFFUSE),
            Lobe::Coated { .. } => Kinds::REFLECTION.and(Kinds::GLOSSY),
            Lobe::SpecularReflection { .. } => Kinds::REFLECTION.and(Kinds::SPECULAR),
            Lobe::SpecularTransmission { .. } => Kinds::TRANSMISSION.and(Kinds::SPECULAR),
            Lobe::FresnelSpecular { .. } => Kinds::REFLECTION
                .and(Kinds::TRANSMISSION)
                .and(Kinds::SPECULAR),
            Lobe::MicrofacetReflection { .. } => Kinds::REFLECTION.and(Kinds::GLOSSY),
            Lobe::MicrofacetTransmission { .. } => Kinds::TRANSMISSION.and(Kinds::GLOSSY),
        }
    }

    /// The value of the scattering function; zero for specular lobes.
    pub(super) fn f(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        match *self {
            Lobe::Lambert { r } => r * FRAC_1_PI,
            Lobe::OrenNayar { r, a, b } => r * FRAC_1_PI * (a + b * oren_nayar(wo, wi)),
            Lobe::LambertTransmission { t } => t * FRAC_1_PI,
            Lobe::Coated { d, s, facets } => coated(wo, wi, d, s, facets),
            Lobe::MicrofacetReflection { r, facets, fresnel } => {
                let (cos_o, cos_i) = (wo.z.abs(), wi.z.abs());
                let wh = wi + wo;
                if cos_o == 0.0 || cos_i == 0.0 || wh == Vec3::ZERO {
                    return Vec3::ZERO;
                }
                let wh = wh.normalize();
                let reflected = fresnel.evaluate(wi.dot(if wh.z < 0.0 { -wh } else { wh }));
                let shown = facets.density(wh) * facets.visible_from_both(wo, wi);
                r * (shown * reflected / (4.0 * cos_i * cos_o))
            }
            Lobe::MicrofacetTransmission {
                t,
                facets,
                above,
                below,
            } => {
                if same_side(wo, wi) || wo.z == 0.0 || wi.z == 0.0 {
                    return Vec3::ZERO;
                }
                let eta = if wo.z > 0.0 {
                    below / above
                } else {
                    above / below
                };
                let Some((wh, dot_o, dot_i)) = refracting_facet(wo, wi, eta) else {
                    return Vec3::ZERO;
                };
                let root = dot_o + eta * dot_i;
                // Radiance is divided by eta² as it spreads into another solid angle, which
                // cancels the eta² of the change of variables.
                t * (1.0 - dielectric(dot_o, above, below))
                    * (facets.density(wh) * facets.visible_from_both(wo, wi) * dot_i * dot_o
                        / (wi.z * wo.z * root * root))
                        .abs()
            }
            Lobe::SpecularReflection { .. }
            | Lobe::SpecularTransmission { .. }
            | Lobe::FresnelSpecular { .. } => Vec3::ZERO,
        }
    }

    /// The density with which [`Lobe::sample`] draws `wi`, in solid angle; zero for specular lobes.
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        match *self {
            Lobe::Lambert { .. } | Lobe::OrenNayar { .. } => {
                if same_side(wo, wi) {
                    cosine_hemisphere_pdf(wi.z.abs())
                } else {
                    0.0
                }
            }
            Lobe::LambertTransmission { .. } => {
                if same_side(wo, wi) {
                    0.0
                } else {
                    cosine_hemisphere_pdf(wi.z.abs())
                }
            }
            Lobe::Coated { facets, .. } => {
                if !same_side(wo, wi) {
                    return 0.0;
                }
                let wh = (wo + wi).normalize_or_zero();
                let glossy = facets.pdf(wo, wh) / (4.0 * wo.dot(wh));
                0.5 * (cosine_hemisphere_pdf(wi.z.abs()) + glossy)
            }
            Lobe::MicrofacetReflection { facets, .. } => {
                if !same_side(wo, wi) {
                    return 0.0;
                }
                let wh = (wo + wi).normalize_or_zero();
                facets.pdf(wo, wh) / (4.0 * wo.dot(wh))
            }
            Lobe::MicrofacetTransmission {
                facets,
                above,
                below,
                ..
            } => {
                if same_side(wo, wi) {
                    return 0.0;
                }
                let eta = if wo.z > 0.0 {
                    below / above
                } else {
                    above / below
                };
                let Some((wh, dot_o, dot_i)) = refracting_facet(wo, wi, eta) else {
                    return 0.0;
                };
                let root = dot_o + eta * dot_i;
                facets.pdf(wo, wh) * (eta * eta * dot_i / (root * root)).abs()
            }
            Lobe::SpecularReflection { .. }
            | Lobe::SpecularTransmission { .. }
            | Lobe::FresnelSpecular { .. } => 0.0,
        }
    }

    /// Draws the direction that light comes from; `None` where there is none.
    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<LobeSample> {
        let drawn = |wi: Vec3| LobeSample {
            wi,
            f: self.f(wo, wi),
            pdf: self.pdf(wo, wi),
            kinds: self.kinds(),
        };
        match *self {
            Lobe::Lambert { .. } | Lobe::OrenNayar { .. } => {
                let mut wi = cosine_hemisphere(u);
                if wo.z < 0.0 {
                    wi.z = -wi.z;
                }
                Some(drawn(wi))
            }
            Lobe::LambertTransmission { .. } => {
                let mut wi = cosine_hemisphere(u);
                if wo.z > 0.0 {
                    wi.z = -wi.z;
                }
                Some(drawn(wi))
            }
            Lobe::Coated { facets, .. } => {
                if u.x < 0.5 {
                    let u = Vec2::new((2.0 * u.x).min(ONE_MINUS_EPSILON), u.y);
                    let mut wi = cosine_hemisphere(u);
                    if wo.z < 0.0 {
                        wi.z = -wi.z;
                    }
                    return Some(drawn(wi));
                }
                let u = Vec2::new((2.0 * (u.x - 0.5)).min(ONE_MINUS_EPSILON), u.y);
                let wh = facets.sample(wo, u);
                let wi = -wo + 2.0 * wo.dot(wh) * wh;
                same_side(wo, wi).then(|| drawn(wi))
            }
            Lobe::MicrofacetReflection { facets, .. } => {
                let wh = facets.sample(wo, u);
                let along = wo.dot(wh);
                let wi = -wo + 2.0 * along * wh;
                (along >= 0.0 && same_side(wo, wi)).then(|| drawn(wi))
            }
            Lobe::MicrofacetTransmission {
                facets,
                above,
                below,
                ..
            } => {
                let wh = facets.sample(wo, u);
                if wo.dot(wh) < 0.0 {
                    return None;
                }
                let eta = if wo.z > 0.0 {
                    above / below
                } else {
                    below / above
                };
                let wi = refract(wo, wh, eta)?;
                (!same_side(wo, wi)).then(|| drawn(wi))
            }
            Lobe::SpecularReflection { r, fresnel } => {
                let wi = Vec3::new(-wo.x, -wo.y, wo.z);
                let f = r * (fresnel.evaluate(wi.z) / wi.z.abs());
                Some(LobeSample {
                    wi,
                    f,
                    pdf: 1.0,
                    kinds: self.kinds(),
                })
            }
            Lobe::SpecularTransmission { t, above, below } => {
                let (wi, squeezed) = straight_through(wo, above, below)?;
                let f = t * ((1.0 - dielectric(wi.z, above, below)) * squeezed / wi.z.abs());
                Some(LobeSample {
                    wi,
                    f,
                    pdf: 1.0,
                    kinds: self.kinds(),
                })
            }
            Lobe::FresnelSpecular { r, t, above, below } => {
                let reflected = dielectric(wo.z, above, below);
                if u.x < reflected {
                    let wi = Vec3::new(-wo.x, -wo.y, wo.z);
                    let kinds = Kinds::REFLECTION.and(Kinds::SPECULAR);
                    return Some(LobeSample {
                        wi,
                        f: r * (reflected / wi.z.abs()),
                        pdf: reflected,
                        kinds,
                    });
                }
                let (wi, squeezed) = straight_through(wo, above, below)?;
                let pdf = 1.0 - reflected;
                let kinds = Kinds::TRANSMISSION.and(Kinds::SPECULAR);
                Some(LobeSample {
                    wi,
                    f: t * (pdf * squeezed / wi.z.abs()),
                    pdf,
                    kinds,
                })
            }
        }
    }
}

/// The value of [`Lobe::Coated`] [Ashikhmin2000].
fn coated(wo: Vec3, wi: Vec3, d: Vec3, s: Vec3, facets: TrowbridgeReitz) -> Vec3 {
    let pow5 = |x: f32| (x * x) * (x * x) * x;
    let (cos_o, cos_i) = (wo.z.abs(), wi.z.abs());
    let diffuse = 28.0 / (23.0 * PI)
        * d
        * (Vec3::ONE - s)
        * ((1.0 - pow5(1.0 - 0.5 * cos_i)) * (1.0 - pow5(1.0 - 0.5 * cos_o)));
    let Some(wh) = (wi + wo).try_normalize() else {
        return Vec3::ZERO;
    };
    let cos_h = wi.dot(wh);
    let schlick = s + pow5(1.0 - cos_h) * (Vec3::ONE - s);
    diffuse + facets.density(wh) / (4.0 * cos_h.abs() * cos_i.max(cos_o)) * schlick
}

pub(super) fn same_side(a: Vec3, b: Vec3) -> bool {
    a.z * b.z > 0.0
}

/// The upward normal of the facets that refract `wi` to `wo`, and its cosines with both; `eta` is
/// the index on the side of `wi` over that on the side of `wo`.
///
/// **Differs from pbrt-v3:** facets that turn their back to one of the directions do not count, as
/// they are never sampled either [Walter2007, eq. 16 to 20].
fn refracting_facet(wo: Vec3, wi: Vec3, eta: f32) -> Option<(Vec3, f32, f32)> {
    let wh = (wo + wi * eta).try_normalize()?;
    let wh = if wh.z < 0.0 { -wh } else { wh };
    let (dot_o, dot_i) = (wo.dot(wh), wi.dot(wh));
    (dot_o * wo.z > 0.0 && dot_i * wi.z > 0.0).then_some((wh, dot_o, dot_i))
}

/// The refracted direction, and by how much radiance changes as its solid angle does.
fn straight_through(wo: Vec3, above: f32, below: f32) -> Option<(Vec3, f32)> {
    let (eta, normal) = if wo.z > 0.0 {
        (above / below, Vec3::Z)
    } else {
        (below / above, -Vec3::Z)
    };
    Some((refract(wo, normal, eta)?, eta * eta))
}

/// The direction-dependent part of [Oren1994]'s approximation.
fn oren_nayar(wo: Vec3, wi: Vec3) -> f32 {
    let sine = |w: Vec3| (1.0 - w.z * w.z).max(0.0).sqrt();
    let (sin_i, sin_o) = (sine(wi), sine(wo));
    let max_cos = if sin_i > 1e-4 && sin_o > 1e-4 {
        let ((cos_pi, sin_pi), (cos_po, sin_po)) = (azimuth(wi), azimuth(wo));
        (cos_pi * cos_po + sin_pi * sin_po).max(0.0)
    } else {
        0.0
    };
    let (sin_alpha, tan_beta) = if wi.z.abs() > wo.z.abs() {
        (sin_o, sin_i / wi.z.abs())
    } else {
        (sin_i, sin_o / wo.z.abs())
    };
    max_cos * sin_alpha * tan_beta
}
