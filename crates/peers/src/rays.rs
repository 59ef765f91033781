//! The sets of rays that all contenders answer.

use glam::{DVec3, Vec3};
use rand::RngExt;
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};
use splitplane::{Hit, Mesh, Ray, Tree};
use splitplane_render::scene::camera::Camera;

/// What the rays of a set are like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Camera rays of a pinhole, through the centres of 1024² pixels.
    Primary,
    /// Shadow rays of ambient occlusion: from where camera rays hit, into the cosine-weighted
    /// hemisphere, three tenths of the scene's diagonal long. Any hit.
    Ao,
    /// One diffuse bounce: from where camera rays hit, into the cosine-weighted hemisphere.
    Bounce,
    /// Chords of the sphere around the scene's box, between two random points of it.
    Random,
}

impl Kind {
    /// All kinds, in the order of the tables.
    pub const ALL: [Kind; 4] = [Kind::Primary, Kind::Ao, Kind::Bounce, Kind::Random];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Primary => "primary",
            Kind::Ao => "ao",
            Kind::Bounce => "bounce",
            Kind::Random => "random",
        }
    }

    /// Whether any hit answers a ray.
    pub fn any_hit(self) -> bool {
        self == Kind::Ao
    }

    /// Whether neighbouring rays take the same way.
    pub fn coherent(self) -> bool {
        self == Kind::Primary
    }
}

/// Pixels along a side of the picture.
const WIDTH: u32 = 1024;
/// Pixels along a side of a block: the picture is cast block by block, so that fewer rays than
/// pixels are whole blocks.
const BLOCK: u32 = 32;
/// Pixels along a side of a tile: the rays of a packet.
const TILE: u32 = 4;

/// The rays of a scene.
pub struct Rays {
    seed: u64,
    count: usize,
    diagonal: f32,
    center: Vec3,
    primary: Vec<Ray>,
    /// Where the camera rays hit: a point just off the surface, on the side that the ray came from,
    /// and the unit normal to that side.
    surface: Vec<(Vec3, Vec3)>,
}

impl Rays {
    /// The camera rays and where they hit, by `tree`; about `count` rays a set.
    pub fn new(camera: &Camera, tree: &Tree, count: usize, seed: u64) -> Self {
        let mesh = tree.mesh();
        let bounds = mesh.bounds();
        let primary = primary(camera, count);
        let scale = bounds.diagonal().max(Vec3::from(bounds.center()).length());
        let surface = primary
            .iter()
            .filter_map(|ray| Some(leave(ray, &tree.closest_hit(ray, &mut ())?, mesh, scale)))
            .collect();
        Rays {
            seed,
            count,
            diagonal: bounds.diagonal(),
            center: bounds.center().into(),
            primary,
            surface,
        }
    }

    /// The rays of a kind. Empty for those that begin on a surface where the camera sees none.
    pub fn of(&self, kind: Kind) -> Vec<Ray> {
        let mut random = Pcg32::new(self.seed, kind as u64);
        match kind {
            Kind::Primary => self.primary.clone(),
            Kind::Ao => self.hemisphere(&mut random, 0.3 * self.diagonal),
            Kind::Bounce => self.hemisphere(&mut random, f32::INFINITY),
            Kind::Random => {
                let mut point = || self.center + 0.5 * self.diagonal * sphere(&mut random);
                (0..self.count)
                    .map(|_| {
                        loop {
                            let (from, to) = (point(), point());
                            if let Some(direction) = (to - from).try_normalize() {
                                break Ray::new(from.into(), direction.into());
                            }
                        }
                    })
                    .collect()
            }
        }
    }

    /// Rays from the surface, in the order of the pixels.
    fn hemisphere(&self, random: &mut Pcg32, t_max: f32) -> Vec<Ray> {
        if self.surface.is_empty() {
            return Vec::new();
        }
        (0..self.count)
            .map(|i| {
                let (origin, normal) = self.surface[i * self.surface.len() / self.count];
                // A point of the sphere that rests on the surface: cosine-weighted.
                let direction = loop {
                    if let Some(direction) = (normal + 0.999 * sphere(random)).try_normalize() {
                        break direction;
                    }
                };
                Ray {
                    t_max,
                    ..Ray::new(origin.into(), direction.into())
                }
            })
            .collect()
    }
}

/// A point of the unit sphere.
fn sphere(random: &mut Pcg32) -> Vec3 {
    let z = 1.0 - 2.0 * random.random::<f32>();
    let angle = std::f32::consts::TAU * random.random::<f32>();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
}

/// Where a ray that was answered leaves the surface again, and the normal there.
fn leave(ray: &Ray, hit: &Hit, mesh: &Mesh, scale: f32) -> (Vec3, Vec3) {
    let normal = Vec3::from(mesh.normal(hit.triangle));
    let normal = if normal.dot(ray.direction.into()) > 0.0 {
        -normal
    } else {
        normal
    };
    (Vec3::from(ray.at(hit.t)) + 1e-5 * scale * normal, normal)
}

/// Camera rays by blocks of pixels, tile by tile; where fewer than all are wanted, of blocks spread
/// evenly over the picture.
fn primary(camera: &Camera, count: usize) -> Vec<Ray> {
    let blocks_a_side = WIDTH / BLOCK;
    let blocks = (blocks_a_side * blocks_a_side) as usize;
    let wanted = count.div_ceil((BLOCK * BLOCK) as usize).clamp(1, blocks);
    let mut rays = Vec::with_capacity(wanted * (BLOCK * BLOCK) as usize);
    let origin = camera.camera_to_world.point([0.0; 3]);
    let tangent = (f64::from(camera.fov).to_radians() / 2.0).tan();
    let pixel = |x: u32, y: u32| {
        let place = |i: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(WIDTH) - 1.0;
        let direction = [place(x) * tangent, -place(y) * tangent, 1.0].map(|c| c as f32);
        let world = camera.camera_to_world.vector(direction).map(f64::from);
        let unit = DVec3::from(world).normalize().as_vec3();
        Ray::new(origin, unit.into())
    };
    // Numbers that share no divisor with that of the blocks visit each once, far from the last.
    const STRIDE: usize = 389;
    let mut chosen: Vec<usize> = (0..wanted).map(|i| i * STRIDE % blocks).collect();
    chosen.sort_unstable();
    for block in chosen {
        let (left, top) = (
            block as u32 % blocks_a_side * BLOCK,
            block as u32 / blocks_a_side * BLOCK,
        );
        for tile in 0..(BLOCK / TILE).pow(2) {
            let (x, y) = (tile % (BLOCK / TILE) * TILE, tile / (BLOCK / TILE) * TILE);
            for i in 0..TILE * TILE {
                rays.push(pixel(left + x + i % TILE, top + y + i / TILE));
            }
        }
    }
    rays
}
