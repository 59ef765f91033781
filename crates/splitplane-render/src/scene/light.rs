//! Lights, as data. Colours are linear RGB (sRGB primaries).

use std::sync::Arc;

use super::texture::Image;
use crate::transform::Transform;

/// A light that is not a shape.
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// Equal intensity in all directions from a point.
    Point {
        /// Where, in world space.
        position: [f32; 3],
        /// Radiant intensity.
        intensity: [f32; 3],
    },
    /// A cone of light from a point, that falls off towards its edge.
    Spot {
        /// Where, in world space.
        position: [f32; 3],
        /// Unit vector along the cone's axis.
        direction: [f32; 3],
        /// Radiant intensity within the inner cone.
        intensity: [f32; 3],
        /// Cosine of the angle between axis and the inner cone.
        cos_inner: f32,
        /// Cosine of the angle between axis and the outer cone, beyond which there is no light.
        cos_outer: f32,
    },
    /// A picture that is projected from a point.
    Projection {
        /// From the light's space, where it shines along +z, to the world.
        to_world: Transform,
        /// Radiant intensity where the picture is white.
        intensity: [f32; 3],
        /// Field of view along the shorter side of the picture, in degrees.
        fov: f32,
        /// The picture; `None`: a white square.
        map: Option<Arc<Image>>,
    },
    /// Light from a point, by directions as a picture says.
    Goniometric {
        /// From the light's space to the world.
        to_world: Transform,
        /// Radiant intensity where the picture is white.
        intensity: [f32; 3],
        /// The picture; `None`: white.
        map: Option<Arc<Image>>,
        /// How it covers all directions; longitudes are around the y axis here.
        sphere: SphereMap,
    },
    /// Parallel light from infinitely far.
    Distant {
        /// Unit vector towards the light, in world space.
        towards: [f32; 3],
        /// Radiance.
        radiance: [f32; 3],
    },
    /// Light from all directions.
    Infinite {
        /// Radiance; where the map is white, if there is one.
        radiance: [f32; 3],
        /// What it looks like.
        map: Option<Arc<Image>>,
        /// How it covers all directions.
        sphere: SphereMap,
        /// From the space of the map to the world.
        to_world: Transform,
    },
}

/// How a picture covers all directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SphereMap {
    /// Longitude to the right around the z axis, latitude downwards from it: pbrt-v3's.
    LongitudeLatitude,
    /// A square, each part of which has the same solid angle \[Clarberg2008\]: z in its middle, x
    /// to the right, y downwards, -z in all corners: pbrt-v4's.
    EqualArea,
}

impl Light {
    /// The same light from all directions.
    pub fn sky(radiance: [f32; 3]) -> Light {
        Light::Infinite {
            radiance,
            map: None,
            sphere: SphereMap::LongitudeLatitude,
            to_world: Transform::IDENTITY,
        }
    }
}

/// The light that a shape gives off.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaLight {
    /// Emitted radiance, the same in all directions.
    pub radiance: [f32; 3],
    /// Both sides shine, not only the one that the normal points to.
    pub two_sided: bool,
    /// How many of [`super::Scene::lights`] come before it. Lights are sampled in the order of the
    /// file.
    pub after: u32,
}
