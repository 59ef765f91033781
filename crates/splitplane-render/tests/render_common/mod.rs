//! Scenes of known radiance, built by hand.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::sync::Arc;

use splitplane::{BuildParams, Mesh, Tree};
use splitplane_render::render::{RenderSettings, Rendered, render};
use splitplane_render::scene::camera::{Camera, Projection};
use splitplane_render::scene::light::{AreaLight, Light};
use splitplane_render::scene::material::{Material, TextureRef};
use splitplane_render::scene::settings::{
    Film, Filter, Integrator, LightStrategy, Sampler, SamplerKind,
};
use splitplane_render::scene::texture::Texture;
use splitplane_render::scene::{Contents, Scene, Shape, Surface};
use splitplane_render::transform::Transform;

pub(crate) fn grey(value: f32) -> TextureRef {
    Arc::new(Texture::Constant([value; 3]))
}

pub(crate) fn matte(value: f32) -> Material {
    Material::Matte {
        kd: grey(value),
        sigma: grey(0.0),
    }
}

/// A shape to be: vertices, triangles, and what they are made of.
pub(crate) struct Part {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) material: Material,
    pub(crate) area_light: Option<AreaLight>,
    pub(crate) flip_normals: bool,
}

impl Part {
    /// A square in the plane z = `z` with |x|, |y| up to `half`; its normal is up.
    pub(crate) fn square(half: f32, z: f32, material: Material) -> Part {
        let h = half;
        Part {
            positions: vec![[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material,
            area_light: None,
            flip_normals: false,
        }
    }

    /// The surface of the cube that reaches `half` from its centre (0, 0, `z`); normals point
    /// outwards.
    pub(crate) fn cube(half: f32, z: f32, material: Material) -> Part {
        let sign = |i: u32, axis: usize| if i >> axis & 1 == 1 { half } else { -half };
        let positions = (0..8)
            .map(|i| [sign(i, 0), sign(i, 1), z + sign(i, 2)])
            .collect();
        let quads: [[u32; 4]; 6] = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let triangles = quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
        Part {
            positions,
            triangles,
            material,
            area_light: None,
            flip_normals: false,
        }
    }

    pub(crate) fn shining(mut self, radiance: f32, flip_normals: bool) -> Part {
        self.area_light = Some(AreaLight {
            radiance: [radiance; 3],
            two_sided: false,
            after: 0,
        });
        self.flip_normals = flip_normals;
        self
    }
}

/// Looks from the origin along +z, with a picture of 8 x 8 pixels and a path tracer.
pub(crate) fn scene(parts: Vec<Part>, lights: Vec<Light>, fov: f32) -> Scene {
    let (mut positions, mut triangles) = (vec![], vec![]);
    let (mut shapes, mut materials) = (vec![], vec![]);
    for part in parts {
        let (first, start) = (positions.len() as u32, triangles.len() as u32);
        positions.extend(part.positions);
        triangles.extend(part.triangles.iter().map(|t| t.map(|i| i + first)));
        shapes.push(Shape {
            triangles: start..triangles.len() as u32,
            material: materials.len() as u32,
            area_light: part.area_light,
            has_normals: false,
            has_uvs: false,
            flip_normals: part.flip_normals,
            surface: Surface::Flat,
            alpha: None,
            shadow_alpha: None,
        });
        materials.push(part.material);
    }
    Scene {
        name: "test".into(),
        mesh: Mesh::new(positions, triangles).unwrap(),
        normals: vec![],
        uvs: vec![],
        colors: vec![],
        shapes,
        objects: vec![],
        instances: vec![],
        materials,
        lights,
        camera: Camera {
            camera_to_world: Transform::IDENTITY,
            projection: Projection::Perspective,
            fov,
            screen_window: None,
            frame_aspect_ratio: None,
            lens_radius: 0.0,
            focal_distance: 1e6,
        },
        film: Film {
            width: 8,
            height: 8,
            crop: [0.0, 1.0, 0.0, 1.0],
            scale: 1.0,
            max_sample_luminance: f32::INFINITY,
        },
        filter: Filter::Box { radius: [0.5, 0.5] },
        sampler: Sampler {
            kind: SamplerKind::Halton {
                sample_at_center: false,
            },
            samples_per_pixel: 16,
        },
        integrator: path(5),
        accelerator: None,
        contents: Contents::default(),
        notes: vec![],
    }
}

pub(crate) fn path(max_depth: u32) -> Integrator {
    Integrator::Path {
        max_depth,
        rr_threshold: 1.0,
        light_strategy: LightStrategy::Spatial,
    }
}

pub(crate) fn tree_of(scene: &Scene) -> Tree {
    Tree::build(&scene.mesh, "kd".parse().unwrap(), &BuildParams::default()).unwrap()
}

pub(crate) fn rendered(scene: &Scene, settings: &RenderSettings) -> Rendered {
    render(scene, &tree_of(scene), settings, &()).unwrap()
}

/// The mean of the picture's green channel.
pub(crate) fn mean(picture: &Rendered) -> f64 {
    let sum: f64 = picture.radiance.iter().map(|p| f64::from(p[1])).sum();
    sum / picture.radiance.len() as f64
}
