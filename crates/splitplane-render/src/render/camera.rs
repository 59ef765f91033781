//! Camera rays [PBRT3, 6.2].

use glam::{Vec2, Vec3};
use splitplane::Ray;

use super::sampling::concentric_disk;
use crate::scene::camera::Camera;

/// A camera for a picture of given size.
pub(super) struct CameraRays {
    /// From a place on the film, in pixels, to the plane z = 1 in camera space.
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
        let tangent = (f64::from(camera.fov).to_radians() / 2.0).tan();
        let to_world = &camera.camera_to_world;
        CameraRays {
            scale: Vec2::new(
                ((x1 - x0) * tangent / width) as f32,
                ((y0 - y1) * tangent / height) as f32,
            ),
            offset: Vec2::new((x0 * tangent) as f32, (y1 * tangent) as f32),
            lens_radius: camera.lens_radius,
            focal_distance: camera.focal_distance,
            axes: [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| to_world.vector(axis.into()).into()),
            origin: to_world.point([0.0; 3]).into(),
        }
    }

    /// The ray through a place on the film, in pixels from the top left corner of the full
    /// picture; `lens` in the unit square says where on the lens it begins.
    pub(super) fn ray(&self, film: Vec2, lens: Vec2) -> Ray {
        let mut direction = (film * self.scale + self.offset).extend(1.0).normalize();
        let mut origin = self.origin;
        if self.lens_radius > 0.0 {
            let focus = direction * (self.focal_distance / direction.z);
            let start = (self.lens_radius * concentric_disk(lens)).extend(0.0);
            direction = (focus - start).normalize();
            origin += self.turned(start);
        }
        Ray::new(origin.into(), self.turned(direction).into())
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
}
