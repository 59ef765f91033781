//! What a scene file says of how to render it.

/// The size of the picture, and the part of it to render.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Pixels in a full row.
    pub width: u32,
    /// Full rows.
    pub height: u32,
    /// `[x_min, x_max, y_min, y_max]` of the part to render, in fractions of the picture.
    pub crop: [f32; 4],
    /// Factor on all pixel values.
    pub scale: f32,
    /// Samples of larger luminance are scaled down to it.
    pub max_sample_luminance: f32,
}

/// How samples are weighted into pixels; `radius` is `[x, y]` in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// Equal weight.
    Box {
        /// Half the width.
        radius: [f32; 2],
    },
    /// Weight that falls linearly.
    Triangle {
        /// Half the width.
        radius: [f32; 2],
    },
    /// A Gaussian, lowered to end at zero.
    Gaussian {
        /// Half the width.
        radius: [f32; 2],
        /// Rate of falloff.
        alpha: f32,
    },
    /// Mitchell and Netravali's cubic.
    Mitchell {
        /// Half the width.
        radius: [f32; 2],
        /// Its parameter B.
        b: f32,
        /// Its parameter C.
        c: f32,
    },
    /// A sinc, windowed by another.
    Sinc {
        /// Half the width.
        radius: [f32; 2],
        /// Lobes within half the width.
        tau: f32,
    },
}

impl Filter {
    /// The largest radius along an axis, in pixels.
    pub const MAX_RADIUS: f32 = 64.0;
}

/// Where samples come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampler {
    /// The sequence.
    pub kind: SamplerKind,
    /// Samples per pixel.
    pub samples_per_pixel: u32,
}

/// A sample sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SamplerKind {
    /// The Halton sequence as pbrt-v3 spreads it over the picture.
    Halton {
        /// The samples of every pixel lie at its centre.
        sample_at_center: bool,
    },
    /// Sobol's sequence, spread over the picture.
    Sobol,
    /// A sample in each cell of a grid over the pixel, and of further dimensions.
    Stratified {
        /// Cells in x; as many samples as cells make the rows.
        columns: u32,
        /// At random in the cell; otherwise in its middle.
        jitter: bool,
        /// How many dimensions, of single numbers and of pairs, are stratified.
        dimensions: u32,
    },
    /// A (0, 2)-sequence in each pixel.
    ZeroTwo {
        /// As for [`SamplerKind::Stratified`].
        dimensions: u32,
    },
    /// Independent random numbers.
    Random,
}

/// How light is gathered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Integrator {
    /// pbrt-v3's path tracer.
    Path {
        /// The most bounces.
        max_depth: u32,
        /// Below this throughput Russian roulette may end the path, after the third bounce.
        rr_threshold: f32,
        /// Which light is sampled at each vertex.
        light_strategy: LightStrategy,
    },
    /// Direct light, with perfect reflection and transmission followed.
    Direct {
        /// The most specular bounces.
        max_depth: u32,
        /// Every light is sampled; otherwise one, at random.
        all_lights: bool,
    },
    /// Whitted's: direct light from directions that the lights choose, with perfect reflection and
    /// transmission followed.
    Whitted {
        /// The most specular bounces.
        max_depth: u32,
    },
    /// Ambient occlusion.
    AmbientOcclusion {
        /// Directions are drawn by cosine, not uniformly.
        cosine: bool,
        /// Directions per camera ray.
        samples: u32,
    },
}

/// How the path tracer picks a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightStrategy {
    /// All lights alike.
    Uniform,
    /// In proportion to the lights' power.
    Power,
    /// pbrt-v3's default, by place: in proportion to what the lights would contribute if nothing
    /// were in their way. Rendered as `Power` where there are more than 64 lights.
    Spatial,
}
