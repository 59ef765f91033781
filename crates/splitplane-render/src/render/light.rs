//! Lights, sampled [PBRT3, chapter 12 and 14.2].

use std::f32::consts::PI;

use glam::{Mat3, Vec2, Vec3};
use splitplane::{Hit, InstanceHit, Ray};

use super::environment::Environment;
use super::interaction::{Interaction, Place, absolute_sum, gamma};
use super::part::{InPlace, Part};
use super::sampling::{concentric_disk, frame_around, luminance, uniform_triangle};
use crate::scene::light::{AreaLight, Light, SphereMap};
use crate::scene::texture::Image;
use crate::scene::{Scene, Shape, Surface};
use crate::transform::Transform;

/// All lights of a scene by number, in the order of the file; of a mesh that shines, each triangle
/// is one.
pub(super) struct Lights<'s> {
    scene: &'s Scene,
    sources: Vec<Source<'s>>,
    /// The number of the light of a shape, or of its first triangle, for shapes that shine.
    of_shape: Vec<Option<ShapeLight>>,
    /// The numbers of the infinite lights.
    infinite: Vec<u32>,
    world_radius: f32,
}

/// What shines.
enum Source<'s> {
    Point {
        position: Vec3,
        intensity: Vec3,
        shade: Shade<'s>,
    },
    Distant {
        towards: Vec3,
        radiance: Vec3,
    },
    Infinite(Environment<'s>),
    Triangle {
        triangle: u32,
        shape: u32,
    },
    /// A round shape as a whole.
    Sphere {
        center: Vec3,
        radius: f32,
        /// 1: normals point outwards; -1: inwards.
        side: f32,
        shape: u32,
    },
    Disk {
        center: Vec3,
        axes: [Vec3; 2],
        normal: Vec3,
        shape: u32,
    },
}

/// How the intensity of a light at a point depends on the direction.
enum Shade<'s> {
    None,
    Cone {
        direction: Vec3,
        cos_inner: f32,
        cos_outer: f32,
    },
    Projection {
        to_light: Mat3,
        /// What the picture shows of the plane at z = 1: up to this far from its middle.
        window: Vec2,
        map: Option<&'s Image>,
    },
    Goniometric {
        to_light: Mat3,
        map: Option<&'s Image>,
        sphere: SphereMap,
    },
}

#[derive(Clone, Copy)]
struct ShapeLight {
    first: u32,
    whole: bool,
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
        let mut lights = Lights {
            scene,
            sources: vec![],
            of_shape: vec![],
            infinite: vec![],
            world_radius: scene.bounds().diagonal() / 2.0,
        };
        let mut others = (1..).zip(&scene.lights).peekable();
        for (index, shape) in (0..).zip(&scene.shapes) {
            if let Some(area_light) = &shape.area_light {
                while let Some((_, light)) =
                    others.next_if(|&(number, _)| number <= area_light.after)
                {
                    lights.add(light);
                }
            }
            lights.add_shape(index, shape);
        }
        others.for_each(|(_, light)| lights.add(light));
        lights
    }

    fn add(&mut self, light: &'s Light) {
        let number = self.count();
        let rotation = |transform: &Transform| Mat3::from_mat4(transform.matrix().as_mat4());
        self.sources.push(match light {
            Light::Point {
                position,
                intensity,
            } => Source::Point {
                position: (*position).into(),
                intensity: (*intensity).into(),
                shade: Shade::None,
            },
            Light::Spot {
                position,
                direction,
                intensity,
                cos_inner,
                cos_outer,
            } => Source::Point {
                position: (*position).into(),
                intensity: (*intensity).into(),
                shade: Shade::Cone {
                    direction: (*direction).into(),
                    cos_inner: *cos_inner,
                    cos_outer: *cos_outer,
                },
            },
            Light::Projection {
                to_world,
                intensity,
                fov,
                map,
            } => {
                let (width, height) = map.as_ref().map_or((1, 1), |map| map.size());
                let aspect = width.max(1) as f32 / height.max(1) as f32;
                let window = (fov.to_radians() / 2.0).tan()
                    * if aspect > 1.0 {
                        Vec2::new(aspect, 1.0)
                    } else {
                        Vec2::new(1.0, 1.0 / aspect)
                    };
                Source::Point {
                    position: to_world.point([0.0; 3]).into(),
                    intensity: (*intensity).into(),
                    shade: Shade::Projection {
                        to_light: rotation(&to_world.inverse()),
                        window,
                        map: map.as_deref(),
                    },
                }
            }
            Light::Goniometric {
                to_world,
                intensity,
                map,
                sphere,
            } => Source::Point {
                position: to_world.point([0.0; 3]).into(),
                intensity: (*intensity).into(),
                shade: Shade::Goniometric {
                    to_light: rotation(&to_world.inverse()),
                    map: map.as_deref(),
                    sphere: *sphere,
                },
            },
            Light::Distant { towards, radiance } => Source::Distant {
                towards: (*towards).into(),
                radiance: (*radiance).into(),
            },
            Light::Infinite {
                radiance,
                map,
                sphere,
                to_world,
            } => {
                self.infinite.push(number);
                Source::Infinite(Environment::new(
                    (*radiance).into(),
                    map.as_deref(),
                    *sphere,
                    rotation(to_world),
                    rotation(&to_world.inverse()),
                ))
            }
        });
    }

    fn add_shape(&mut self, index: u32, shape: &Shape) {
        let first = self.count();
        if shape.area_light.is_none() {
            self.of_shape.push(None);
            return;
        }
        let whole = match shape.surface {
            Surface::Sphere { center, radius } => {
                let center = Vec3::from(center);
                // Which way it faces is asked of a triangle.
                let weights = [1.0 / 3.0; 3];
                let triangle = shape.triangles.start;
                let normal = self.light_normal(shape, triangle, weights);
                let p = self.corners(triangle);
                let side = normal.map_or(1.0, |n| n.dot(p[0] - center).signum());
                Some(Source::Sphere {
                    center,
                    radius,
                    side,
                    shape: index,
                })
            }
            Surface::Disk { center, axes } => {
                let triangle = shape.triangles.start;
                self.light_normal(shape, triangle, [1.0 / 3.0; 3])
                    .map(|normal| Source::Disk {
                        center: center.into(),
                        axes: axes.map(Vec3::from),
                        normal,
                        shape: index,
                    })
            }
            Surface::Flat | Surface::Curved => None,
        };
        self.of_shape.push(Some(ShapeLight {
            first,
            whole: whole.is_some(),
        }));
        match whole {
            Some(whole) => self.sources.push(whole),
            None => {
                let triangle = |triangle| Source::Triangle {
                    triangle,
                    shape: index,
                };
                self.sources.extend(shape.triangles.clone().map(triangle));
            }
        }
    }

    pub(super) fn count(&self) -> u32 {
        self.sources.len() as u32
    }

    /// Whether no ray can meet the light by chance.
    pub(super) fn is_delta(&self, light: u32) -> bool {
        matches!(
            self.sources.get(light as usize),
            Some(Source::Point { .. } | Source::Distant { .. })
        )
    }

    /// What a ray that leaves the scene along `w` finds.
    pub(super) fn radiance_from_infinity(&self, w: Vec3) -> Vec3 {
        self.infinite
            .iter()
            .map(|&light| self.radiance_of_miss(light, w))
            .sum()
    }

    /// What a ray that leaves the scene along `w` finds of one light.
    pub(super) fn radiance_of_miss(&self, light: u32, w: Vec3) -> Vec3 {
        match self.sources.get(light as usize) {
            Some(Source::Infinite(environment)) => environment.radiance(w),
            _ => Vec3::ZERO,
        }
    }

    /// The light that a hit triangle is, if any.
    pub(super) fn light_of(&self, shape_index: u32, triangle: u32) -> Option<u32> {
        let ShapeLight { first, whole } = self.of_shape[shape_index as usize]?;
        let shape = &self.scene.shapes[shape_index as usize];
        Some(if whole {
            first
        } else {
            first + triangle - shape.triangles.start
        })
    }

    fn shape(&self, shape: u32) -> (&'s Shape, Option<&'s AreaLight>) {
        let shape = &self.scene.shapes[shape as usize];
        (shape, shape.area_light.as_ref())
    }

    /// The luminance of what the light gives off in all.
    pub(super) fn power(&self, light: u32) -> f32 {
        let disk = PI * self.world_radius * self.world_radius;
        let of_area = |shape: u32, area: f32| {
            let Some(light) = self.shape(shape).1 else {
                return Vec3::ZERO;
            };
            let sides = if light.two_sided { 2.0 } else { 1.0 };
            sides * PI * area * Vec3::from(light.radiance)
        };
        luminance(match &self.sources[light as usize] {
            Source::Point {
                intensity, shade, ..
            } => *intensity * shade.integral(),
            Source::Distant { radiance, .. } => disk * *radiance,
            Source::Infinite(environment) => disk * environment.mean(),
            Source::Triangle { triangle, shape } => of_area(*shape, area(self.corners(*triangle))),
            Source::Sphere { radius, shape, .. } => of_area(*shape, 4.0 * PI * radius * radius),
            Source::Disk { axes, shape, .. } => of_area(*shape, disk_area(axes)),
        })
    }

    /// Draws light that may arrive at `at`; `None` where there is none.
    pub(super) fn sample(&self, light: u32, at: &Place, u: Vec2) -> Option<LightSample> {
        let far = |wi: Vec3| Place::free(at.p + wi * (2.0 * self.world_radius));
        let sample = match self.sources.get(light as usize)? {
            Source::Point {
                position,
                intensity,
                shade,
            } => {
                let to_light = *position - at.p;
                let wi = to_light.try_normalize()?;
                LightSample {
                    radiance: *intensity * shade.towards(-wi) / to_light.length_squared(),
                    wi,
                    pdf: 1.0,
                    source: Place::free(*position),
                }
            }
            Source::Distant { towards, radiance } => LightSample {
                radiance: *radiance,
                wi: *towards,
                pdf: 1.0,
                source: far(*towards),
            },
            Source::Infinite(environment) => {
                let (wi, radiance, pdf) = environment.sample(u)?;
                LightSample {
                    radiance,
                    wi,
                    pdf,
                    source: far(wi),
                }
            }
            &Source::Triangle { triangle, shape } => {
                let p = self.corners(triangle);
                let (b0, b1) = uniform_triangle(u);
                let weights = [b0, b1, 1.0 - b0 - b1];
                let source = Place {
                    p: b0 * p[0] + b1 * p[1] + weights[2] * p[2],
                    error: gamma(6) * absolute_sum(weights, p),
                    normal: self.light_normal(self.shape(shape).0, triangle, weights)?,
                };
                self.sample_of_area(shape, at, source, area(p))?
            }
            &Source::Disk {
                center,
                axes,
                normal,
                shape,
            } => {
                let d = concentric_disk(u);
                let p = center + d.x * axes[0] + d.y * axes[1];
                let source = Place {
                    p,
                    error: gamma(8) * p.abs(),
                    normal,
                };
                self.sample_of_area(shape, at, source, disk_area(&axes))?
            }
            &Source::Sphere {
                center,
                radius,
                side,
                shape,
            } => {
                let sphere = Sphere {
                    center,
                    radius,
                    side,
                };
                let (source, cone_pdf) = sphere.sample(at, u);
                match cone_pdf {
                    None => self.sample_of_area(shape, at, source, 4.0 * PI * radius * radius)?,
                    Some(pdf) => {
                        let wi = (source.p - at.p).try_normalize()?;
                        LightSample {
                            radiance: emitted(self.shape(shape).1?, source.normal, -wi),
                            wi,
                            pdf,
                            source,
                        }
                    }
                }
            }
        };
        (sample.pdf > 0.0 && sample.radiance != Vec3::ZERO).then_some(sample)
    }

    /// Light from a place on a shape that was drawn uniformly over an area.
    fn sample_of_area(
        &self,
        shape: u32,
        at: &Place,
        source: Place,
        area: f32,
    ) -> Option<LightSample> {
        let wi = (source.p - at.p).try_normalize()?;
        Some(LightSample {
            radiance: emitted(self.shape(shape).1?, source.normal, -wi),
            wi,
            pdf: solid_angle_pdf(at.p, &source, wi, area)?,
            source,
        })
    }

    /// The density with which [`Lights::sample`] draws `wi`, for lights that are not delta.
    pub(super) fn pdf(&self, light: u32, at: &Place, wi: Vec3) -> f32 {
        let pdf = match self.sources.get(light as usize) {
            Some(Source::Infinite(environment)) => Some(environment.pdf(wi)),
            Some(&Source::Triangle { triangle, shape }) => {
                let p = self.corners(triangle);
                meet_triangle(&at.ray(wi), p).and_then(|weights| {
                    let source = Place {
                        p: weights[0] * p[0] + weights[1] * p[1] + weights[2] * p[2],
                        error: Vec3::ZERO,
                        normal: self.light_normal(self.shape(shape).0, triangle, weights)?,
                    };
                    solid_angle_pdf(at.p, &source, wi, area(p))
                })
            }
            Some(Source::Disk {
                center,
                axes,
                normal,
                ..
            }) => {
                let t = normal.dot(*center - at.p) / normal.dot(wi);
                let p = at.p + t * wi;
                // In coordinates of the axes, which need not be orthogonal.
                let (d, n) = (p - *center, axes[0].cross(axes[1]));
                let x = d.cross(axes[1]).dot(n) / n.length_squared();
                let y = axes[0].cross(d).dot(n) / n.length_squared();
                let source = Place {
                    p,
                    error: Vec3::ZERO,
                    normal: *normal,
                };
                (t > 0.0 && x * x + y * y <= 1.0)
                    .then(|| solid_angle_pdf(at.p, &source, wi, disk_area(axes)))
                    .flatten()
            }
            Some(&Source::Sphere {
                center,
                radius,
                side,
                ..
            }) => {
                let sphere = Sphere {
                    center,
                    radius,
                    side,
                };
                sphere.pdf(at, wi)
            }
            Some(Source::Point { .. } | Source::Distant { .. }) | None => None,
        };
        pdf.unwrap_or(0.0)
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
        let found = InstanceHit { hit, instance: 0 };
        let own = InPlace {
            part: &Part::own(self.scene),
            to_world: None,
        };
        Some(Interaction::new(own, shape, &ray, &found).place.normal)
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

fn disk_area(axes: &[Vec3; 2]) -> f32 {
    PI * axes[0].cross(axes[1]).length()
}

impl Shade<'_> {
    /// The part of the intensity that goes along `w`, away from the light.
    fn towards(&self, w: Vec3) -> Vec3 {
        match self {
            Shade::None => Vec3::ONE,
            Shade::Cone {
                direction,
                cos_inner,
                cos_outer,
            } => {
                let cosine = w.dot(*direction);
                if cosine < *cos_outer {
                    return Vec3::ZERO;
                }
                if cosine >= *cos_inner {
                    return Vec3::ONE;
                }
                let part = (cosine - cos_outer) / (cos_inner - cos_outer);
                Vec3::splat((part * part) * (part * part))
            }
            Shade::Projection {
                to_light,
                window,
                map,
            } => {
                /// Nearer than this the light does not shine.
                const NEAR: f32 = 1e-3;
                let w = *to_light * w;
                if w.z < NEAR {
                    return Vec3::ZERO;
                }
                let st = (Vec2::new(w.x, w.y) / (w.z * *window) + Vec2::ONE) / 2.0;
                if st.min_element() < 0.0 || st.max_element() > 1.0 {
                    return Vec3::ZERO;
                }
                // The picture's first row is at t = 0.
                map.map_or(Vec3::ONE, |map| {
                    map.pyramid().lookup(Vec2::new(st.x, 1.0 - st.y), 0.0)
                })
            }
            Shade::Goniometric {
                to_light,
                map,
                sphere,
            } => map.map_or(Vec3::ONE, |map| {
                let w = (*to_light * w).normalize_or_zero();
                let w = match sphere {
                    // This one has its pole along y.
                    SphereMap::LongitudeLatitude => Vec3::new(w.x, w.z, w.y),
                    SphereMap::EqualArea => w,
                };
                let place = sphere.place(w);
                map.pyramid().lookup(Vec2::new(place.x, 1.0 - place.y), 0.0)
            }),
        }
    }

    /// The integral over all directions.
    fn integral(&self) -> Vec3 {
        let mean = |map: &Option<&Image>| {
            map.map_or(Vec3::ONE, |map| map.pyramid().lookup(Vec2::splat(0.5), 0.5))
        };
        match self {
            Shade::None => Vec3::splat(4.0 * PI),
            Shade::Cone {
                cos_inner,
                cos_outer,
                ..
            } => Vec3::splat(2.0 * PI * (1.0 - 0.5 * (cos_inner + cos_outer))),
            Shade::Projection { window, map, .. } => {
                let cos_total = 1.0 / (1.0 + window.length_squared()).sqrt();
                2.0 * PI * (1.0 - cos_total) * mean(map)
            }
            Shade::Goniometric { map, .. } => 4.0 * PI * mean(map),
        }
    }
}

/// A sphere that shines.
struct Sphere {
    center: Vec3,
    radius: f32,
    side: f32,
}

/// Below the square of this sine, the cosine of a cone's angle is too inexact.
const SMALL_SIN2: f32 = 0.000_685_23;

/// A sphere is made of triangles, which lie inside of it; from within, a place just inside of the
/// triangles is what can be seen.
const WITHIN_TRIANGLES: f32 = 1.0 - 2e-3;

impl Sphere {
    /// The largest angle of the cone that the sphere fills, as its sine squared; `None` from
    /// within.
    fn cone(&self, at: &Place) -> Option<f32> {
        let from = Vec3::from(at.ray(self.center - at.p).origin);
        let square = self.radius * self.radius;
        (from.distance_squared(self.center) > square)
            .then(|| square / at.p.distance_squared(self.center))
    }

    /// A place on the sphere and the density in solid angle; within the sphere, where all of it is
    /// sampled alike, `None`.
    fn sample(&self, at: &Place, u: Vec2) -> (Place, Option<f32>) {
        let place = |normal: Vec3, radius: f32| {
            let p = self.center + radius * normal;
            Place {
                p,
                error: gamma(5) * p.abs(),
                normal: self.side * normal,
            }
        };
        let Some(sin2_max) = self.cone(at) else {
            let z = 1.0 - 2.0 * u.x;
            let r = (1.0 - z * z).max(0.0).sqrt();
            let (sin, cos) = (2.0 * PI * u.y).sin_cos();
            let normal = Vec3::new(r * cos, r * sin, z);
            return (place(normal, self.radius * WITHIN_TRIANGLES), None);
        };
        let axis = (self.center - at.p).normalize_or(Vec3::Z);
        let (x, y) = frame_around(axis);
        let sin_max = sin2_max.sqrt();
        let cos_max = (1.0 - sin2_max).max(0.0).sqrt();
        let (mut cos_theta, mut sin2_theta);
        cos_theta = (cos_max - 1.0) * u.x + 1.0;
        sin2_theta = 1.0 - cos_theta * cos_theta;
        if sin2_max < SMALL_SIN2 {
            sin2_theta = sin2_max * u.x;
            cos_theta = (1.0 - sin2_theta).sqrt();
        }
        // From the angle at the place that is lit to the one at the sphere's centre.
        let cos_alpha =
            sin2_theta / sin_max + cos_theta * (1.0 - sin2_theta / sin2_max).max(0.0).sqrt();
        let sin_alpha = (1.0 - cos_alpha * cos_alpha).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (2.0 * PI * u.y).sin_cos();
        let normal = -(sin_alpha * cos_phi * x + sin_alpha * sin_phi * y + cos_alpha * axis);
        (
            place(normal, self.radius),
            Some(1.0 / (2.0 * PI * cone_part(sin2_max))),
        )
    }

    fn pdf(&self, at: &Place, wi: Vec3) -> Option<f32> {
        if let Some(sin2_max) = self.cone(at) {
            return Some(1.0 / (2.0 * PI * cone_part(sin2_max)));
        }
        // From within, the far side.
        let from = at.p - self.center;
        let b = from.dot(wi);
        let t = -b
            + (b * b - from.length_squared() + self.radius * self.radius)
                .max(0.0)
                .sqrt();
        let p = at.p + t * wi;
        let source = Place {
            p,
            error: Vec3::ZERO,
            normal: (p - self.center).try_normalize()?,
        };
        solid_angle_pdf(at.p, &source, wi, 4.0 * PI * self.radius * self.radius)
    }
}

/// 1 - cos of the angle whose sine squared is given.
fn cone_part(sin2: f32) -> f32 {
    if sin2 < SMALL_SIN2 {
        0.5 * sin2
    } else {
        1.0 - (1.0 - sin2).max(0.0).sqrt()
    }
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
}
