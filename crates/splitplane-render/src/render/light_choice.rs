//! Which light is sampled at a place [PBRT3, 12.6 and its later addition, the spatial choice].

use std::sync::OnceLock;

use glam::{Vec2, Vec3};
use splitplane::Aabb;

use super::interaction::Place;
use super::light::Lights;
use super::sampler::radical_inverse_of;
use super::sampling::{Distribution, luminance};
use crate::scene::settings::LightStrategy;

/// Voxels along the longest edge of the scene.
const MAX_VOXELS: f32 = 64.0;

/// With more lights, their contributions to every voxel take too long to estimate.
const MAX_SPATIAL_LIGHTS: u32 = 64;

/// Samples of every light for the estimate in a voxel.
const VOXEL_SAMPLES: u64 = 128;

/// How one of many lights is chosen.
pub(super) enum LightChoice<'l> {
    Fixed(Distribution),
    Spatial(Voxels<'l>),
}

impl<'l> LightChoice<'l> {
    pub(super) fn new(strategy: LightStrategy, lights: &'l Lights, bounds: Aabb) -> Self {
        let count = lights.count();
        let by = |weight: &dyn Fn(u32) -> f32| {
            Distribution::new(&(0..count).map(weight).collect::<Vec<_>>())
        };
        match strategy {
            _ if count <= 1 => LightChoice::Fixed(by(&|_| 1.0)),
            LightStrategy::Uniform => LightChoice::Fixed(by(&|_| 1.0)),
            LightStrategy::Spatial if count <= MAX_SPATIAL_LIGHTS => {
                LightChoice::Spatial(Voxels::new(lights, bounds))
            }
            LightStrategy::Spatial | LightStrategy::Power => {
                LightChoice::Fixed(by(&|light| lights.power(light)))
            }
        }
    }

    /// The light that `u` chooses at `p`, and its probability.
    pub(super) fn pick(&self, p: Vec3, u: f32) -> Option<(u32, f32)> {
        let distribution = match self {
            LightChoice::Fixed(distribution) => distribution,
            LightChoice::Spatial(voxels) => voxels.at(p),
        };
        distribution
            .pick(u)
            .map(|(light, probability)| (light as u32, probability))
    }
}

/// A choice per voxel, made when it is first asked for.
pub(super) struct Voxels<'l> {
    lights: &'l Lights<'l>,
    min: Vec3,
    extent: Vec3,
    counts: [usize; 3],
    choices: Vec<OnceLock<Distribution>>,
}

impl<'l> Voxels<'l> {
    fn new(lights: &'l Lights, bounds: Aabb) -> Self {
        let extent = Vec3::from(bounds.extent());
        let counts = (extent / extent.max_element() * MAX_VOXELS).round();
        // The largest extent is 0, and the quotients NaN, where no triangle can be hit.
        let counts = <[f32; 3]>::from(counts).map(|c| (c as usize).max(1));
        Voxels {
            lights,
            min: bounds.min.into(),
            extent,
            counts,
            choices: (0..counts.iter().product())
                .map(|_| OnceLock::new())
                .collect(),
        }
    }

    fn at(&self, p: Vec3) -> &Distribution {
        let place = <[f32; 3]>::from((p - self.min) / self.extent);
        let voxel: [usize; 3] = std::array::from_fn(|axis| {
            let count = self.counts[axis];
            ((place[axis] * count as f32) as usize).min(count - 1)
        });
        let index = (voxel[2] * self.counts[1] + voxel[1]) * self.counts[0] + voxel[0];
        self.choices[index].get_or_init(|| self.choice(voxel))
    }

    /// In proportion to what the lights would contribute if nothing were in their way; those that
    /// seem to contribute nothing keep a small chance.
    fn choice(&self, voxel: [usize; 3]) -> Distribution {
        let counts = Vec3::from(self.counts.map(|c| c as f32));
        let low = self.min + self.extent * Vec3::from(voxel.map(|v| v as f32)) / counts;
        let mut weights = vec![0.0; self.lights.count() as usize];
        for i in 0..VOXEL_SAMPLES {
            let [x, y, z, u, v] = [2, 3, 5, 7, 11].map(|base| radical_inverse_of(base, i));
            let at = Place::free(low + self.extent / counts * Vec3::new(x, y, z));
            for (light, weight) in (0..).zip(&mut weights) {
                if let Some(sample) = self.lights.sample(light, &at, Vec2::new(u, v)) {
                    *weight += luminance(sample.radiance) / sample.pdf;
                }
            }
        }
        let mean = weights.iter().sum::<f32>() / (VOXEL_SAMPLES as f32 * weights.len() as f32);
        let least = if mean > 0.0 { 0.001 * mean } else { 1.0 };
        for weight in &mut weights {
            *weight = weight.max(least);
        }
        Distribution::new(&weights)
    }
}
