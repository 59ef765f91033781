//! A camera and light for geometry that comes without.

use glam::{DMat4, DVec3, Vec3};
use splitplane::Aabb;

use super::camera::{Camera, Projection};
use super::geometry::{Placed, assemble};
use super::light::Light;
use super::material::{Material, TextureRef};
use super::settings::{Film, Filter, Integrator, LightStrategy, Sampler, SamplerKind};
use super::texture::Texture;
use super::{Contents, Note, Scene};
use crate::transform::Transform;

/// Which way is up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Up {
    Y,
    Z,
}

impl Up {
    pub(crate) fn vector(self) -> DVec3 {
        match self {
            Up::Y => DVec3::Y,
            Up::Z => DVec3::Z,
        }
    }

    /// The usual direction of a file's format, unless the geometry is a sheet that lies flat the
    /// other way.
    pub(crate) fn guessed(usual: Up, bounds: &Aabb) -> Up {
        let [x, y, z] = bounds.extent();
        let flat = |thickness: f32, width: f32| 4.0 * thickness < x.min(width);
        match usual {
            Up::Y if flat(z, y) => Up::Z,
            Up::Z if flat(y, z) => Up::Y,
            usual => usual,
        }
    }
}

/// Pictures of geometry without a film of its own.
pub(crate) const WIDTH: u32 = 960;
pub(crate) const HEIGHT: u32 = 720;

/// A camera at `eye` that looks at `target`, in a right-handed world; `fov` in degrees along the
/// shorter side of the picture.
pub(crate) fn look(eye: DVec3, target: DVec3, up: DVec3, fov: f32) -> Camera {
    let forward = (target - eye).try_normalize().unwrap_or(DVec3::Z);
    let right = forward
        .cross(up)
        .try_normalize()
        .unwrap_or(forward.any_orthonormal_vector());
    let upwards = right.cross(forward);
    let matrix = DMat4::from_cols(
        right.extend(0.0),
        upwards.extend(0.0),
        forward.extend(0.0),
        eye.extend(1.0),
    );
    Camera {
        camera_to_world: Transform::from_matrix(matrix).unwrap_or(Transform::IDENTITY),
        projection: Projection::Perspective,
        fov,
        screen_window: None,
        frame_aspect_ratio: None,
        lens_radius: 0.0,
        focal_distance: 1e6,
    }
}

/// A camera that sees all of `points`, which lie within `bounds`, from the direction
/// `towards_eye`, with a small margin.
pub(crate) fn fitted(bounds: &Aabb, points: &[[f32; 3]], towards_eye: DVec3, up: Up) -> Camera {
    const FOV: f32 = 30.0;
    const MARGIN: f64 = 0.94;
    let center = Vec3::from(bounds.center()).as_dvec3();
    let back = towards_eye.try_normalize().unwrap_or(DVec3::Z);
    let right = up
        .vector()
        .cross(back)
        .try_normalize()
        .unwrap_or(back.any_orthonormal_vector());
    let upwards = back.cross(right);
    let tan = (f64::from(FOV) / 2.0).to_radians().tan();
    let (tan_x, tan_y) = (
        tan * f64::from(WIDTH) / f64::from(HEIGHT) * MARGIN,
        tan * MARGIN,
    );
    // The pyramid of view that touches the geometry on all four sides: each side is the supporting
    // plane of the points in its direction; where opposite sides meet is the eye's line.
    let most = |direction: DVec3| {
        points
            .iter()
            .map(|&p| Vec3::from(p).as_dvec3())
            .filter(|p| p.is_finite())
            .map(|p| (p - center).dot(direction))
            .fold(f64::NEG_INFINITY, f64::max)
    };
    // A point at (x, y, z), z towards the eye, is seen where |x - ex| <= (d - z) tan.
    let sides = |axis: DVec3, tan: f64| -> (f64, f64) {
        let (high, low) = (most(axis + tan * back), most(-axis + tan * back));
        ((high - low) / 2.0, (high + low) / (2.0 * tan))
    };
    let ((x, dx), (y, dy)) = (sides(right, tan_x), sides(upwards, tan_y));
    let distance = dx.max(dy);
    if !(distance.is_finite() && distance > 0.0) {
        return look(center + back, center, up.vector(), FOV);
    }
    let eye = center + x * right + y * upwards + distance * back;
    look(eye, eye - back, up.vector(), FOV)
}

/// A clear sky and a sun; `towards_sun` need not have unit length.
pub(crate) fn daylight(towards_sun: DVec3) -> Vec<Light> {
    vec![
        Light::sky([0.55, 0.64, 0.78]),
        Light::Distant {
            towards: towards_sun.normalize_or(DVec3::Y).as_vec3().into(),
            radiance: [2.9, 2.6, 2.2],
        },
    ]
}

/// The same colour everywhere.
pub(crate) fn color(value: [f32; 3]) -> TextureRef {
    TextureRef::new(Texture::Constant(value))
}

/// A diffuse surface.
pub(crate) fn matte(value: [f32; 3]) -> Material {
    Material::Matte {
        kd: color(value),
        sigma: color([0.0; 3]),
    }
}

/// A scene of `pieces`, with the settings that scenes without a file have.
///
/// # Errors
/// A message, where the pieces do not fit into a mesh.
pub(crate) fn scene(
    name: &str,
    pieces: Vec<Placed>,
    materials: Vec<Material>,
    view: impl FnOnce(&splitplane::Mesh) -> (Camera, Vec<Light>),
    notes: Vec<Note>,
) -> Result<Scene, String> {
    let assembled = assemble(pieces)?;
    let (camera, lights) = view(&assembled.mesh);
    let contents = Contents {
        unique_triangles: assembled.mesh.triangles().len() as u64,
        ..Contents::default()
    };
    Ok(Scene {
        name: name.to_owned(),
        mesh: assembled.mesh,
        normals: assembled.normals,
        uvs: assembled.uvs,
        colors: vec![],
        shapes: assembled.shapes,
        objects: vec![],
        instances: vec![],
        materials,
        lights,
        camera,
        film: Film {
            width: WIDTH,
            height: HEIGHT,
            crop: [0.0, 1.0, 0.0, 1.0],
            scale: 1.0,
            max_sample_luminance: f32::INFINITY,
        },
        filter: Filter::Box { radius: [0.5; 2] },
        sampler: Sampler {
            kind: SamplerKind::Halton {
                sample_at_center: false,
            },
            samples_per_pixel: 16,
        },
        integrator: Integrator::Path {
            max_depth: 5,
            rr_threshold: 1.0,
            light_strategy: LightStrategy::Spatial,
        },
        accelerator: None,
        contents,
        notes,
    })
}
