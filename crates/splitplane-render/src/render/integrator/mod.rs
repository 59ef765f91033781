//! How light is gathered along a camera ray.

mod ambient;
mod direct;
mod path;

use glam::{Vec2, Vec3};
use splitplane::{InstanceHit, Ray};

use super::bsdf::{Bsdf, Kinds, bsdf_of};
use super::camera::Beam;
use super::interaction::Interaction;
use super::light::Lights;
use super::light_choice::LightChoice;
use super::part::{InPlace, Part, SceneTree};
use super::sampler::{Sampler, Sequence};
use super::sampling::power_heuristic;
use super::tracer::Tracer;
use crate::scene::settings::{Integrator, LightStrategy};
use crate::scene::{Scene, Shape};
use direct::Lighting;

/// No ray passes through more surfaces in a row that do not scatter; it could meet one again and
/// again where coordinates are too coarse to leave it.
const MAX_PASSES: u32 = 1000;

/// What all threads share.
pub(super) struct World<'s> {
    pub(super) scene: &'s Scene,
    pub(super) lights: &'s Lights<'s>,
    pub(super) choice: LightChoice<'s>,
    pub(super) integrator: Integrator,
    /// Some surfaces are not there everywhere.
    pub(super) has_alpha: bool,
    /// The scene's own geometry, then the objects'; with the shape of every triangle.
    parts: Vec<(Part<'s>, Vec<u32>)>,
}

impl<'s> World<'s> {
    /// The shapes of `scene` must cover its triangles in order.
    pub(super) fn new(scene: &'s Scene, lights: &'s Lights<'s>, integrator: Integrator) -> Self {
        let strategy = match integrator {
            Integrator::Path { light_strategy, .. } => light_strategy,
            Integrator::Direct { .. }
            | Integrator::Whitted { .. }
            | Integrator::AmbientOcclusion { .. } => LightStrategy::Uniform,
        };
        let with_shapes = |part: Part<'s>| {
            let mut shape_of = Vec::with_capacity(part.mesh.triangles().len());
            for (index, shape) in (0..).zip(part.shapes) {
                shape_of.extend(shape.triangles.clone().map(|_| index));
            }
            (part, shape_of)
        };
        let parts: Vec<_> = Part::all(scene).map(with_shapes).collect();
        World {
            scene,
            lights,
            choice: LightChoice::new(strategy, lights, scene.bounds()),
            integrator,
            has_alpha: parts
                .iter()
                .flat_map(|(part, _)| part.shapes)
                .any(|shape| shape.alpha.is_some() || shape.shadow_alpha.is_some()),
            parts,
        }
    }

    /// The part that instance 0, which is the scene's own geometry, or another one stands for.
    fn part(&self, instance: u32) -> &(Part<'s>, Vec<u32>) {
        match instance.checked_sub(1) {
            None => &self.parts[0],
            Some(i) => &self.parts[1 + self.scene.instances[i as usize].object as usize],
        }
    }

    pub(super) fn in_place(&self, instance: u32) -> InPlace<'_> {
        let placed = instance
            .checked_sub(1)
            .map(|i| &self.scene.instances[i as usize]);
        InPlace {
            part: &self.part(instance).0,
            to_world: placed.map(|placed| &placed.to_world),
        }
    }

    pub(super) fn shape(&self, instance: u32, triangle: u32) -> &'s Shape {
        let (part, shape_of) = self.part(instance);
        &part.shapes[shape_of[triangle as usize] as usize]
    }

    fn interaction(&self, ray: &Ray, found: &InstanceHit) -> Interaction {
        let shape = self.shape(found.instance, found.hit.triangle);
        Interaction::new(self.in_place(found.instance), shape, ray, found)
    }

    /// How the surface scatters; its bumps turn the hit's frame.
    fn bsdf(&self, at: &mut Interaction, one_lobe_glass: bool) -> Option<Bsdf> {
        let material = self.shape(at.instance, at.triangle).material;
        bsdf_of(&self.scene.materials[material as usize], at, one_lobe_glass)
    }

    fn emitted(&self, at: &Interaction, w: Vec3) -> Vec3 {
        self.lights
            .emitted(self.shape(at.instance, at.triangle), at, w)
    }

    fn is_light(&self, at: &Interaction, light: u32) -> bool {
        // Objects are no lights.
        let shape = self.parts[0]
            .1
            .get(at.triangle as usize)
            .filter(|_| at.instance == 0);
        shape.is_some_and(|&shape| self.lights.light_of(shape, at.triangle) == Some(light))
    }
}

/// Where a camera ray first met a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct FirstHit {
    /// In scene units.
    pub(super) distance: f32,
    /// The shading normal.
    pub(super) normal: Vec3,
}

/// What a camera ray brought.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gathered {
    pub(super) radiance: Vec3,
    pub(super) first: Option<FirstHit>,
}

/// One thread's means: rays, random numbers, and room to work in.
pub(super) struct Gatherer<'w, const COUNT: bool> {
    pub(super) world: &'w World<'w>,
    pub(super) tracer: Tracer<'w, COUNT>,
    pub(super) sampler: Sampler<'w>,
    pending: Vec<direct::Pending>,
}

impl<'w, const COUNT: bool> Gatherer<'w, COUNT> {
    pub(super) fn new(world: &'w World<'w>, tree: SceneTree<'w>, sequence: &'w Sequence) -> Self {
        Gatherer {
            world,
            tracer: Tracer::new(tree, world),
            sampler: Sampler::new(sequence),
            pending: vec![],
        }
    }

    /// What arrives along a camera ray; the sampler must be at its sample, after the numbers that
    /// the camera took.
    pub(super) fn gather(&mut self, beam: &Beam) -> Gathered {
        match self.world.integrator {
            Integrator::Path {
                max_depth,
                rr_threshold,
                ..
            } => self.path(beam, max_depth, rr_threshold),
            Integrator::Direct {
                max_depth,
                all_lights,
            } => self.direct(beam, max_depth, Lighting::Direct { all_lights }),
            Integrator::Whitted { max_depth } => self.direct(beam, max_depth, Lighting::Whitted),
            Integrator::AmbientOcclusion { cosine, samples } => self.ambient(beam, cosine, samples),
        }
    }

    /// Casts a camera ray and says where it hit.
    fn first_hit(&mut self, beam: &Beam) -> (Option<Interaction>, Option<FirstHit>) {
        let ray = &beam.ray;
        let Some(hit) = self.tracer.camera(ray) else {
            return (None, None);
        };
        let mut at = self.world.interaction(ray, &hit);
        if let Some(beside) = &beam.beside {
            at.set_footprint(beside);
        }
        let first = FirstHit {
            distance: hit.hit.t * Vec3::from(ray.direction).length(),
            normal: at.shading_normal,
        };
        (Some(at), Some(first))
    }

    fn bounce(&mut self, ray: &Ray) -> Option<Interaction> {
        let hit = self.tracer.bounce(ray)?;
        Some(self.world.interaction(ray, &hit))
    }

    fn bounce_beam(&mut self, beam: &Beam) -> Option<Interaction> {
        let mut at = self.bounce(&beam.ray)?;
        if let Some(beside) = &beam.beside {
            at.set_footprint(beside);
        }
        Some(at)
    }

    /// Direct light from one light, chosen at random.
    fn light_from_one(&mut self, at: &Interaction, bsdf: &Bsdf) -> Vec3 {
        if self.world.lights.count() == 0 {
            return Vec3::ZERO;
        }
        let u = self.sampler.next_1d();
        let picked = self.world.choice.pick(at.place.p, u);
        let Some((light, probability)) = picked else {
            return Vec3::ZERO;
        };
        let (u_light, u_scattering) = (self.sampler.next_2d(), self.sampler.next_2d());
        self.light_from(light, at, bsdf, u_light, u_scattering) / probability
    }

    /// Direct light from one light: a direction drawn by the light and one drawn by the surface,
    /// weighted [PBRT3, 14.3.1]. Lights without extent take the first only.
    fn light_from(
        &mut self,
        light: u32,
        at: &Interaction,
        bsdf: &Bsdf,
        u_light: Vec2,
        u_scattering: Vec2,
    ) -> Vec3 {
        let lights = self.world.lights;
        let delta = lights.is_delta(light);
        let mut sum = Vec3::ZERO;
        if let Some(sample) = lights.sample(light, &at.place, u_light) {
            let f = bsdf.f(at.wo, sample.wi, Kinds::NOT_SPECULAR)
                * sample.wi.dot(at.shading_normal).abs();
            if f != Vec3::ZERO && !self.tracer.blocked(&at.place.ray_to(&sample.source)) {
                let weight = if delta {
                    1.0
                } else {
                    let other = bsdf.pdf(at.wo, sample.wi, Kinds::NOT_SPECULAR);
                    power_heuristic(sample.pdf, other)
                };
                sum += f * sample.radiance * (weight / sample.pdf);
            }
        }
        if delta {
            return sum;
        }
        let Some(sample) = bsdf.sample(at.wo, u_scattering, Kinds::NOT_SPECULAR) else {
            return sum;
        };
        let f = sample.f * sample.wi.dot(at.shading_normal).abs();
        let other = lights.pdf(light, &at.place, sample.wi);
        if f == Vec3::ZERO || other == 0.0 {
            return sum;
        }
        let found = match self.bounce(&at.place.ray(sample.wi)) {
            Some(hit) if self.world.is_light(&hit, light) => self.world.emitted(&hit, -sample.wi),
            Some(_) => Vec3::ZERO,
            None => lights.radiance_of_miss(light, sample.wi),
        };
        sum + f * found * (power_heuristic(sample.pdf, other) / sample.pdf)
    }
}
