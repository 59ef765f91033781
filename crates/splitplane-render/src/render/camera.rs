//! Camera rays [PBRT3, 6.2].

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use splitplane::Ray;

use super::sampling::concentric_disk;
use crate::scene::camera::{Camera, Projection};

/// A ray, and what it would be one pixel to the right and one pixel down, where that is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beam {
    pub(super) ray: Ray,
    pub(super) beside: Option<[Beside; 2]>,
}

/// Origin and direction of a ray beside another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beside {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
}

/// A camera for a picture of given size.
pub(super) struct CameraRays {
    projection: Projection,
    /// From a place on the film, in pixels, to the plane z = 1 in camera space (of an orthographic
    /// view z = 0, of all directions to longitude and latitude).
    scale: Vec2,
    offset: Vec2,
    lens_radius: f32,
    focal_distance: f32,
    /// The axes of camera space and its origin, in world space.
    axes: [Vec3; 3],
    origin: Vec3,
}

impl CameraRays {
    /// `width`, `height`: of the full picture, in pixels.
    pub(super) fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let (width, height) = (f64::from(width), f64::from(height));
        let aspect = camera.frame_aspect_ratio.map_or(width / height, f64::from);
        let [x0, x1, y0, y1] = match camera.screen_window {
            Some(window) => window.map(f64::from),
            None if aspect > 1.0 => [-aspect, aspect, -1.0, 1.0],
            None => [-1.0, 1.0, -1.0 / aspect, 1.0 / aspect],
        };
        let size = match camera.projection {
            Projection::Perspective => (f64::from(camera.fov).to_radians() / 2.0).tan(),
            Projection::Orthographic | Projection::Environment => 1.0,
        };
        let to_world = &camera.camera_to_world;
        let (scale, offset) = match camera.projection {
            Projection::Environment => (
                Vec2::new(2.0 * PI / width as f32, PI / height as f32),
                Vec2::ZERO,
            ),
            _ => (
                Vec2::new(
                    ((x1 - x0) * size / width) as f32,
                    ((y0 - y1) * size / height) as f32,
                ),
                Vec2::new((x0 * size) as f32, (y1 * size) as f32),
            ),
        };
        CameraRays {
            projection: camera.projection,
            scale,
            offset,
            lens_radius: camera.lens_radius,
            focal_distance: camera.focal_distance,
            axes: [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| to_world.vector(axis.into()).into()),
            origin: to_world.point([0.0; 3]).into(),
        }
    }

    /// The ray through a place on the film, in pixels from the top left corner of the full
    /// picture; `lens` in the unit square says where on the lens it begins.
    pub(super) fn ray(&self, film: Vec2, lens: Vec2) -> Ray {
        let Beside { origin, direction } = self.through(film, lens);
        Ray::new(origin.into(), direction.into())
    }

    /// The same with its neighbours at `spacing` pixels.
    pub(super) fn beam(&self, film: Vec2, lens: Vec2, spacing: f32) -> Beam {
        /// In pixels; directions are not linear in places.
        const STEP_OF_ANGLES: f32 = 0.05;
        let ray = self.ray(film, lens);
        let (origin, direction) = (Vec3::from(ray.origin), Vec3::from(ray.direction));
        let step = match self.projection {
            Projection::Environment => STEP_OF_ANGLES,
            _ => 1.0,
        };
        let beside = [Vec2::X, Vec2::Y].map(|axis| {
            let next = self.through(film + step * axis, lens);
            Beside {
                origin: origin + (next.origin - origin) * (spacing / step),
                direction: direction + (next.direction - direction) * (spacing / step),
            }
        });
        Beam {
            ray,
            beside: Some(beside),
        }
    }

    fn through(&self, film: Vec2, lens: Vec2) -> Beside {
        let place = film * self.scale + self.offset;
        let (mut start, mut direction) = match self.projection {
            Projection::Perspective => (Vec3::ZERO, place.extend(1.0).normalize()),
            Projection::Orthographic => (place.extend(0.0), Vec3::Z),
            Projection::Environment => {
                let (sin_theta, cos_theta) = place.y.sin_cos();
                let (sin_phi, cos_phi) = place.x.sin_cos();
                let direction = Vec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi);
                return Beside {
                    origin: self.origin,
                    direction: self.turned(direction),
                };
            }
        };
        if self.lens_radius > 0.0 {
            let focus = start + direction * (self.focal_distance / direction.z);
            start += (self.lens_radius * concentric_disk(lens)).extend(0.0);
            direction = (focus - start).normalize();
        }
        let origin = if start == Vec3::ZERO {
            self.origin
        } else {
            self.origin + self.turned(start)
        };
        Beside {
            origin,
            direction: self.turned(direction),
        }
    }

    fn turned(&self, v: Vec3) -> Vec3 {
        v.x * self.axes[0] + v.y * self.axes[1] + v.z * self.axes[2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transform::Transform;

    fn camera() -> Camera {
        Camera {
            camera_to_world: Transform::IDENTITY,
            projection: Projection::Perspective,
            fov: 90.0,
            screen_window: None,
            frame_aspect_ratio: None,
            lens_radius: 0.0,
            focal_distance: 1e6,
        }
    }

    fn at_plane(ray: &Ray, z: f32) -> Vec3 {
        let (o, d) = (Vec3::from(ray.origin), Vec3::from(ray.direction));
        o + d * ((z - o.z) / d.z)
    }

    #[test]
    fn the_field_of_view_spans_the_shorter_side() {
        let rays = CameraRays::new(&camera(), 200, 100);
        let corner = at_plane(&rays.ray(Vec2::ZERO, Vec2::ZERO), 1.0);
        assert!(
            (corner - Vec3::new(-2.0, 1.0, 1.0)).length() < 1e-6,
            "{corner}"
        );
        let middle = rays.ray(Vec2::new(100.0, 50.0), Vec2::ZERO);
        assert_eq!(middle.direction, [0.0, 0.0, 1.0]);
        let tall = CameraRays::new(&camera(), 100, 200);
        let corner = at_plane(&tall.ray(Vec2::new(100.0, 200.0), Vec2::ZERO), 1.0);
        assert!(
            (corner - Vec3::new(1.0, -2.0, 1.0)).length() < 1e-6,
            "{corner}"
        );
    }

    #[test]
    fn a_screen_window_says_what_is_seen() {
        let camera = Camera {
            screen_window: Some([0.0, 1.0, -0.5, 0.0]),
            ..camera()
        };
        let rays = CameraRays::new(&camera, 10, 10);
        let corner = at_plane(&rays.ray(Vec2::ZERO, Vec2::ZERO), 1.0);
        assert!(
            (corner - Vec3::new(0.0, 0.0, 1.0)).length() < 1e-6,
            "{corner}"
        );
        let corner = at_plane(&rays.ray(Vec2::splat(10.0), Vec2::ZERO), 1.0);
        assert!(
            (corner - Vec3::new(1.0, -0.5, 1.0)).length() < 1e-6,
            "{corner}"
        );
    }

    #[test]
    fn rays_from_all_over_the_lens_meet_in_the_plane_of_focus() {
        let camera = Camera {
            lens_radius: 0.5,
            focal_distance: 4.0,
            ..camera()
        };
        let rays = CameraRays::new(&camera, 100, 100);
        let film = Vec2::new(80.0, 30.0);
        let focus = at_plane(&rays.ray(film, Vec2::splat(0.5)), 4.0);
        for lens in [Vec2::ZERO, Vec2::new(0.9, 0.2), Vec2::new(0.1, 0.8)] {
            let ray = rays.ray(film, lens);
            assert!(Vec3::from(ray.origin).length() <= 0.5 + 1e-6);
            assert!((at_plane(&ray, 4.0) - focus).length() < 1e-5);
        }
    }

    #[test]
    fn orthographic_rays_are_parallel_and_fill_the_window() {
        let camera = Camera {
            projection: Projection::Orthographic,
            ..camera()
        };
        let rays = CameraRays::new(&camera, 200, 100);
        let ray = rays.ray(Vec2::ZERO, Vec2::ZERO);
        assert_eq!(
            (ray.origin, ray.direction),
            ([-2.0, 1.0, 0.0], [0.0, 0.0, 1.0])
        );
        let [right, _] = rays.beam(Vec2::ZERO, Vec2::ZERO, 0.5).beside.unwrap();
        assert!((right.origin - Vec3::new(-1.99, 1.0, 0.0)).length() < 1e-6);
        assert_eq!(right.direction, Vec3::Z);
    }

    #[test]
    fn an_environment_camera_sees_all_around() {
        let camera = Camera {
            projection: Projection::Environment,
            ..camera()
        };
        let rays = CameraRays::new(&camera, 400, 200);
        let at = |x, y| Vec3::from(rays.ray(Vec2::new(x, y), Vec2::ZERO).direction);
        assert!((at(0.0, 100.0) - Vec3::X).length() < 1e-6);
        assert!((at(100.0, 100.0) - Vec3::Z).length() < 1e-6);
        assert!((at(70.0, 0.0) - Vec3::Y).length() < 1e-6);
    }

    #[test]
    fn neighbours_are_the_rays_of_the_next_pixels() {
        let rays = CameraRays::new(&camera(), 200, 100);
        let film = Vec2::new(60.5, 20.5);
        let [right, below] = rays.beam(film, Vec2::ZERO, 1.0).beside.unwrap();
        let next = |step| Vec3::from(rays.ray(film + step, Vec2::ZERO).direction);
        assert!((right.direction - next(Vec2::X)).length() < 1e-6);
        assert!((below.direction - next(Vec2::Y)).length() < 1e-6);
    }
}
