//! Cameras, as data.

use crate::transform::Transform;

/// A camera with a thin lens, as pbrt-v3 defines it.
#[derive(Clone, Debug)]
pub struct Camera {
    /// From camera space (looking along +z, y up) to world space.
    pub camera_to_world: Transform,
    /// How space becomes a picture.
    pub projection: Projection,
    /// Field of view of a perspective along the shorter side of the picture, in degrees.
    pub fov: f32,
    /// `[x_min, x_max, y_min, y_max]` of the picture: of a perspective in the plane z = 1 scaled by
    /// tan(fov / 2), of an orthographic view in scene units; `None`: -1 to 1 along the shorter
    /// side, the longer by the aspect ratio.
    pub screen_window: Option<[f32; 4]>,
    /// Width over height; `None`: that of the film.
    pub frame_aspect_ratio: Option<f32>,
    /// Radius of the lens, in scene units; 0 is a pinhole.
    pub lens_radius: f32,
    /// Distance of the plane in focus, in scene units.
    pub focal_distance: f32,
}

/// How space becomes a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// All rays through one point.
    Perspective,
    /// All rays along +z.
    Orthographic,
    /// All directions around a point: longitude to the right, latitude from +y downwards. There is
    /// no lens and no window.
    Environment,
}
