//! Lights, sampled [PBRT3, chapter 12 and 14.2].

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Vec2, Vec3};
use splitplane::{Hit, Ray};

use super::interaction::{Interaction, Place, absolute_sum, gamma};
use super::sampling::{luminance, uniform_triangle};
use crate::scene::light::{AreaLight, Light};
use crate::scene::{Scene, Shape};

/// All lights of a scene by number: first those that are not shapes, then each triangle that
/// shines.
pub(super) struct Lights<'s> {
    scene: &'s Scene,
    /// The triangles that shine, and the index of their shape.
    triangles: Vec<(u32, u32)>,
    /// The number of a shape's first triangle's light, for shapes that shine.
    first_of_shape: Vec<Option<u32>>,
    /// The numbers of the infinite lights.
    infinite: Vec<u32>,
    world_radius: f32,
}

/// Light that may arrive at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightSample {
    pub(super) radiance: Vec3,
    /// Unit vector towards the light.
    pub(super) wi: Vec3,
    /// In solid angle; 1 for lights that only one direction reaches.
    pub(super) pdf: f32,
    /// What must be visible for the light to arrive.
    pub(super) source: Place,
}

impl<'s> Lights<'s> {
    pub(super) fn new(scene: &'s Scene) -> Self {
        let mut triangles = vec![];
        let mut first_of_shape = vec![];
        for (index, shape) in (0..).zip(&scene.shapes) {
            let first = (scene.lights.len() + triangles.len()) as u32;
            first_of_shape.push(shape.area_light.is_some().then_some(first));
            if shape.area_light.is_some() {
                triangles.extend(shape.triangles.clone().map(|triangle| (triangle, index)));
            }
        }
        let infinite = |light: &Light| matches!(light, Light::Infinite { .. });
        Lights {
            scene,
            triangles,
            first_of_shape,
            infinite: (0..)
                .zip(&scene.lights)
                .filter_map(|(i, light)| infinite(light).then_some(i))
                .collect(),
            world_radius: scene.mesh.bounds().diagonal() / 2.0,
        }
    }

    pub(super) fn count(&self) -> u32 {
        (self.scene.lights.len() + self.triangles.len()) as u32
    }

    /// Whether no ray can meet the light by chance.
    pub(super) fn is_delta(&self, light: u32) -> bool {
        matches!(
            self.scene.lights.get(light as usize),
            Some(Light::Point { .. } | Light::Distant { .. })
        )
    }

    /// What rays that leave the scene find.
    pub(super) fn radiance_from_infinity(&self) -> Vec3 {
        self.infinite
            .iter()
            .map(|&light| self.radiance_of_miss(light))
            .sum()
    }

    /// What a ray that leaves the scene finds of one light.
    pub(super) fn radiance_of_miss(&self, light: u32) -> Vec3 {
        match self.scene.lights.get(light as usize) {
            Some(Light::Infinite { radiance }) => Vec3::from(*radiance),
            _ => Vec3::ZERO,
        }
    }

    /// The light that a hit triangle is, if any.
    pub(super) fn light_of(&self, shape_index: u32, triangle: u32) -> Option<u32> {
        let first = self.first_of_shape[shape_index as usize]?;
        Some(first + triangle - self.scene.shapes[shape_index as usize].triangles.start)
    }

    fn area(&self, light: u32) -> Option<(&'s AreaLight, &'s Shape, u32)> {
        let index = (light as usize).checked_sub(self.scene.lights.len())?;
        let &(triangle, shape) = self.triangles.get(index)?;
        let shape = &self.scene.shapes[shape as usize];
        Some((shape.area_light.as_ref()?, shape, triangle))
    }

    /// The luminance of what the light gives off in all.
    pub(super) fn power(&self, light: u32) -> f32 {
        let disk = PI * self.world_radius * self.world_radius;
        luminance(match self.scene.lights.get(light as usize) {
            Some(Light::Point { intensity, .. }) => 4.0 * PI * Vec3::from(*intensity),
            Some(Light::Distant { radiance, .. } | Light::Infinite { radiance }) => {
                disk * Vec3::from(*radiance)
            }
            None => self
                .area(light)
                .map_or(Vec3::ZERO, |(area_light, _, triangle)| {
                    let sides = if area_light.two_sided { 2.0 } else { 1.0 };
                    sides * PI * area(self.corners(triangle)) * Vec3::from(area_light.radiance)
                }),
        })
    }

    /// Draws light that may arrive at `at`; `None` where there is none.
    pub(super) fn sample(&self, light: u32, at: &Place, u: Vec2) -> Option<LightSample> {
        let far = |wi: Vec3| Place::free(at.p + wi * (2.0 * self.world_radius));
        let sample = match self.scene.lights.get(light as usize) {
            Some(Light::Point {
                position,
                intensity,
            }) => {
                let to_light = Vec3::from(*position) - at.p;
                LightSample {
                    radiance: Vec3::from(*intensity) / to_light.length_squared(),
                    wi: to_light.try_normalize()?,
                    pdf: 1.0,
                    source: Place::free((*position).into()),
                }
            }
            Some(Light::Distant { towards, radiance }) => {
                let wi = Vec3::from(*towards);
                LightSample {
                    radiance: (*radiance).into(),
                    wi,
                    pdf: 1.0,
                    source: far(wi),
                }
            }
            Some(Light::Infinite { radiance }) => {
                let (theta, phi) = (PI * u.y, 2.0 * PI * u.x);
                let (sin_theta, cos_theta) = theta.sin_cos();
                let wi = Vec3::new(sin_theta * phi.cos(), sin_theta * phi.sin(), cos_theta);
                let pdf = latitude_pdf(sin_theta)?;
                LightSample {
                    radiance: (*radiance).into(),
                    wi,
                    pdf,
                    source: far(wi),
                }
            }
            None => self.sample_triangle(light, at, u)?,
        };
        (sample.pdf > 0.0 && sample.radiance != Vec3::ZERO).then_some(sample)
    }

    fn sample_triangle(&self, light: u32, at: &Place, u: Vec2) -> Option<LightSample> {
        let (area_light, shape, triangle) = self.area(light)?;
        let p = self.corners(triangle);
        let (b0, b1) = uniform_triangle(u);
        let weights = [b0, b1, 1.0 - b0 - b1];
        let source = Place {
            p: b0 * p[0] + b1 * p[1] + weights[2] * p[2],
            error: gamma(6) * absolute_sum(weights, p),
            normal: self.light_normal(shape, triangle, weights)?,
        };
        let wi = (source.p - at.p).try_normalize()?;
        let pdf = solid_angle_pdf(at.p, &source, wi, area(p))?;
        let radiance = emitted(area_light, source.normal, -wi);
        Some(LightSample {
            radiance,
            wi,
            pdf,
            source,
        })
    }

    /// The density with which [`Lights::sample`] draws `wi`, for lights that are not delta.
    pub(super) fn pdf(&self, light: u32, at: &Place, wi: Vec3) -> f32 {
        if let Some(other) = self.scene.lights.get(light as usize) {
            return match other {
                Light::Infinite { .. } => {
                    latitude_pdf((1.0 - wi.z * wi.z).max(0.0).sqrt()).unwrap_or(0.0)
                }
                Light::Point { .. } | Light::Distant { .. } => 0.0,
            };
        }
        let Some((_, shape, triangle)) = self.area(light) else {
            return 0.0;
        };
        let p = self.corners(triangle);
        let meet = || {
            let weights = meet_triangle(&at.ray(wi), p)?;
            let source = Place {
                p: weights[0] * p[0] + weights[1] * p[1] + weights[2] * p[2],
                error: Vec3::ZERO,
                normal: self.light_normal(shape, triangle, weights)?,
            };
            solid_angle_pdf(at.p, &source, wi, area(p))
        };
        meet().unwrap_or(0.0)
    }

    /// What the light of a hit triangle sends towards `w`.
    pub(super) fn emitted(&self, shape: &Shape, at: &Interaction, w: Vec3) -> Vec3 {
        let light = shape.area_light.as_ref();
        light.map_or(Vec3::ZERO, |light| emitted(light, at.place.normal, w))
    }

    fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.scene.mesh.corners(triangle).map(Vec3::from)
    }

    /// The unit normal to which a triangle shines: as that of a hit there.
    fn light_normal(&self, shape: &Shape, triangle: u32, weights: [f32; 3]) -> Option<Vec3> {
        let p = self.corners(triangle);
        let ray = Ray::new([0.0; 3], [0.0; 3]);
        (p[1] - p[0]).cross(p[2] - p[0]).try_normalize()?;
        let hit = Hit {
            t: 0.0,
            u: weights[1],
            v: weights[2],
            triangle,
        };
        Some(Interaction::new(self.scene, shape, &ray, &hit).place.normal)
    }
}

fn emitted(light: &AreaLight, normal: Vec3, w: Vec3) -> Vec3 {
    if light.two_sided || normal.dot(w) > 0.0 {
        light.radiance.into()
    } else {
        Vec3::ZERO
    }
}

fn area(p: [Vec3; 3]) -> f32 {
    0.5 * (p[1] - p[0]).cross(p[2] - p[0]).length()
}

/// From density by area, 1 over `area`, to density by solid angle seen from `from`.
fn solid_angle_pdf(from: Vec3, source: &Place, wi: Vec3, area: f32) -> Option<f32> {
    let pdf = (source.p - from).length_squared() / (source.normal.dot(wi).abs() * area);
    pdf.is_finite().then_some(pdf)
}

/// The density of directions drawn uniformly in angle from and around the z axis, as pbrt-v3 draws
/// those of a constant light.
fn latitude_pdf(sin_theta: f32) -> Option<f32> {
    (sin_theta > 0.0).then(|| 0.5 * FRAC_1_PI * FRAC_1_PI / sin_theta)
}

/// Where a ray meets a triangle, as weights of its vertices [Moeller1997]. In f64: this decides
/// about a weight only, so it need not agree with the tree's test at the very edges.
fn meet_triangle(ray: &Ray, p: [Vec3; 3]) -> Option<[f32; 3]> {
    let [p0, p1, p2] = p.map(|p| p.as_dvec3());
    let (origin, direction) = (
        Vec3::from(ray.origin).as_dvec3(),
        Vec3::from(ray.direction).as_dvec3(),
    );
    let (e1, e2) = (p1 - p0, p2 - p0);
    let across = direction.cross(e2);
    let inverse = 1.0 / e1.dot(across);
    let from = origin - p0;
    let u = from.dot(across) * inverse;
    let turned = from.cross(e1);
    let v = direction.dot(turned) * inverse;
    let t = e2.dot(turned) * inverse;
    // Written so that a NaN is a miss.
    let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t.is_finite();
    inside.then_some([(1.0 - u - v) as f32, u as f32, v as f32])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_a_triangle_at_the_weighted_point() {
        let p = [Vec3::ZERO, 2.0 * Vec3::X, 4.0 * Vec3::Y];
        let ray = |x, y, dz| Ray::new([x, y, 1.0], [0.0, 0.0, dz]);
        assert_eq!(
            meet_triangle(&ray(1.0, 1.0, -2.0), p),
            Some([0.25, 0.5, 0.25])
        );
        assert_eq!(meet_triangle(&ray(1.0, 1.0, 2.0), p), None);
        assert_eq!(meet_triangle(&ray(1.5, 2.0, -1.0), p), None);
        let level = Ray::new([-1.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
        assert_eq!(meet_triangle(&level, p), None);
    }

    #[test]
    fn densities_of_latitudes_integrate_to_one() {
        let n = 10_000;
        let step = PI / n as f32;
        let sum: f32 = (0..n)
            .map(|i| ((i as f32 + 0.5) * step).sin())
            .map(|sin| latitude_pdf(sin).unwrap() * sin * 2.0 * PI * step)
            .sum();
        assert!((sum - 1.0).abs() < 1e-3);
    }
}
