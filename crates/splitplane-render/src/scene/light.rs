//! Lights, as data. Colours are linear RGB (sRGB primaries).

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
    /// Parallel light from infinitely far.
    Distant {
        /// Unit vector towards the light, in world space.
        towards: [f32; 3],
        /// Radiance.
        radiance: [f32; 3],
    },
    /// Constant light from all directions.
    Infinite {
        /// Radiance.
        radiance: [f32; 3],
    },
}

/// The light that a shape gives off.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaLight {
    /// Emitted radiance, the same in all directions.
    pub radiance: [f32; 3],
    /// Both sides shine, not only the one that the normal points to.
    pub two_sided: bool,
}
