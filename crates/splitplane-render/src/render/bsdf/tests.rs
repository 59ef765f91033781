//! Every lobe: does it draw what its density says, and no more energy than came in?

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use rand::Rng;
use rand_pcg::Pcg32;

use super::fresnel::Fresnel;
use super::lobe::{Kinds, Lobe};
use super::microfacet::TrowbridgeReitz;

const WHITE: Vec3 = Vec3::ONE;

fn rough_lobes() -> Vec<(&'static str, Lobe)> {
    let facets = |x, y| TrowbridgeReitz::new(x, y);
    let glass = Fresnel::Dielectric {
        outside: 1.0,
        inside: 1.5,
    };
    vec![
        ("lambert", Lobe::diffuse(WHITE, 0.0)),
        ("oren-nayar", Lobe::diffuse(WHITE, 30.0)),
        ("through", Lobe::LambertTransmission { t: WHITE }),
        (
            "coated",
            Lobe::Coated {
                d: Vec3::splat(0.5),
                s: Vec3::splat(0.2),
                facets: facets(0.3, 0.3),
            },
        ),
        (
            "metal",
            Lobe::MicrofacetReflection {
                r: WHITE,
                facets: facets(0.3, 0.3),
                fresnel: Fresnel::Full,
            },
        ),
        (
            "brushed",
            Lobe::MicrofacetReflection {
                r: WHITE,
                facets: facets(0.2, 0.6),
                fresnel: Fresnel::Full,
            },
        ),
        (
            "coat",
            Lobe::MicrofacetReflection {
                r: WHITE,
                facets: facets(0.5, 0.5),
                fresnel: glass,
            },
        ),
        (
            "glass",
            Lobe::MicrofacetTransmission {
                t: WHITE,
                facets: facets(0.3, 0.3),
                above: 1.0,
                below: 1.5,
            },
        ),
        (
            "air",
            Lobe::MicrofacetTransmission {
                t: WHITE,
                facets: facets(0.4, 0.2),
                above: 1.5,
                below: 1.0,
            },
        ),
    ]
}

fn directions() -> [Vec3; 4] {
    [
        Vec3::new(0.0, 0.0, 1.0),
        Vec3::new(0.5, -0.2, 0.7).normalize(),
        Vec3::new(-0.9, 0.1, 0.3).normalize(),
        Vec3::new(0.3, 0.3, -0.8).normalize(),
    ]
}

struct Numbers(Pcg32);

impl Numbers {
    fn next(&mut self) -> f32 {
        (self.0.next_u32() >> 8) as f32 / (1 << 24) as f32
    }
    fn pair(&mut self) -> Vec2 {
        Vec2::new(self.next(), self.next())
    }
}

/// The integral of `value` over all directions.
fn integral(value: impl Fn(Vec3) -> f32) -> f64 {
    let (rows, columns) = (1000, 400);
    let mut sum = 0.0;
    for i in 0..rows {
        let z = 2.0 * (i as f32 + 0.5) / rows as f32 - 1.0;
        let r = (1.0 - z * z).sqrt();
        for j in 0..columns {
            let phi = 2.0 * PI * (j as f32 + 0.5) / columns as f32;
            sum += f64::from(value(Vec3::new(r * phi.cos(), r * phi.sin(), z)));
        }
    }
    sum * 4.0 * f64::from(PI) / f64::from(rows * columns)
}

#[test]
fn densities_integrate_to_the_chance_that_a_sample_succeeds() {
    for (name, lobe) in rough_lobes() {
        for wo in directions() {
            let mut numbers = Numbers(Pcg32::new(1, 2));
            let tries = 20_000;
            let successes = (0..tries)
                .filter(|_| lobe.sample(wo, numbers.pair()).is_some())
                .count();
            let chance = successes as f64 / f64::from(tries);
            let density = integral(|wi| lobe.pdf(wo, wi));
            assert!(
                (density - chance).abs() < 0.02,
                "{name} {wo}: {density} {chance}"
            );
        }
    }
}

#[test]
fn samples_fall_where_the_density_says() {
    for (name, lobe) in rough_lobes() {
        for wo in directions() {
            // The mean direction, by samples and by the density.
            let mut numbers = Numbers(Pcg32::new(3, 4));
            let tries = 40_000;
            let drawn: Vec3 = (0..tries)
                .filter_map(|_| lobe.sample(wo, numbers.pair()))
                .map(|s| s.wi)
                .sum::<Vec3>()
                / tries as f32;
            for axis in 0..3 {
                let expected = integral(|wi| lobe.pdf(wo, wi) * wi[axis]);
                let found = f64::from(drawn[axis]);
                assert!(
                    (expected - found).abs() < 0.02,
                    "{name} {wo} {axis}: {expected} {found}"
                );
            }
        }
    }
}

#[test]
fn a_sample_has_the_value_and_density_of_its_direction() {
    for (name, lobe) in rough_lobes() {
        for wo in directions() {
            let mut numbers = Numbers(Pcg32::new(5, 6));
            for _ in 0..500 {
                let Some(sample) = lobe.sample(wo, numbers.pair()) else {
                    continue;
                };
                assert!((sample.wi.length() - 1.0).abs() < 1e-4, "{name}");
                assert_eq!(sample.f, lobe.f(wo, sample.wi), "{name}");
                assert_eq!(sample.pdf, lobe.pdf(wo, sample.wi), "{name}");
                assert!(sample.kinds.within(lobe.kinds()));
            }
        }
    }
}

#[test]
fn no_lobe_gives_more_than_it_gets() {
    for (name, lobe) in rough_lobes() {
        for wo in directions() {
            // Refraction concentrates radiance by the square of the index; energy is what counts.
            let squeezed = match lobe {
                Lobe::MicrofacetTransmission { above, below, .. } => {
                    let eta = if wo.z > 0.0 {
                        below / above
                    } else {
                        above / below
                    };
                    eta * eta
                }
                _ => 1.0,
            };
            let reflects = lobe.kinds().has(Kinds::REFLECTION);
            let given = integral(|wi| {
                let reachable = (wi.z * wo.z > 0.0) == reflects;
                let f = if reachable { lobe.f(wo, wi).x } else { 0.0 };
                f * wi.z.abs() * squeezed
            });
            assert!(given < 1.02 && given > 0.0, "{name} {wo}: {given}");
            if name == "lambert" {
                assert!((given - 1.0).abs() < 0.005);
            }
        }
    }
}

#[test]
fn reflection_is_the_same_both_ways() {
    for (name, lobe) in rough_lobes() {
        if matches!(lobe, Lobe::MicrofacetTransmission { .. }) {
            continue;
        }
        let [a, b, c, _] = directions();
        for (wo, wi) in [(a, b), (b, c), (a, c)] {
            let (there, back) = (lobe.f(wo, wi).x, lobe.f(wi, wo).x);
            assert!(
                (there - back).abs() <= 1e-4 * there,
                "{name}: {there} {back}"
            );
        }
    }
}

#[test]
fn smooth_glass_splits_all_light_between_its_two_directions() {
    let wo = Vec3::new(0.6, 0.0, 0.8);
    for (above, below) in [(1.0, 1.5), (1.5, 1.0), (1.0, 1.0)] {
        let glass = Lobe::FresnelSpecular {
            r: WHITE,
            t: WHITE,
            above,
            below,
        };
        let mut sum = 0.0;
        for i in 0..1000 {
            let u = Vec2::new((i as f32 + 0.5) / 1000.0, 0.5);
            let sample = glass.sample(wo, u).unwrap();
            let eta = if sample.wi.z < 0.0 {
                below / above
            } else {
                1.0
            };
            sum += sample.f.x * sample.wi.z.abs() / sample.pdf * eta * eta / 1000.0;
        }
        assert!((sum - 1.0).abs() < 1e-4, "{above} {below}: {sum}");
    }
}
