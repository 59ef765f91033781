//! Textures, as data.

use std::sync::{Arc, OnceLock};

use super::pyramid::Pyramid;
use crate::transform::Transform;

/// A texture that may be shared.
pub type TextureRef = Arc<Texture>;

/// A value that varies over a surface: a linear RGB colour, or a number held in all three
/// channels. What each class looks like is pbrt-v3's \[PBRT3, chapter 10\].
#[derive(Clone, Debug)]
pub enum Texture {
    /// The same everywhere.
    Constant([f32; 3]),
    /// The product of two textures.
    Scale(TextureRef, TextureRef),
    /// `(1 - amount) · from + amount · to`.
    Mix {
        /// Where the amount is 0.
        from: TextureRef,
        /// Where the amount is 1.
        to: TextureRef,
        /// From 0 to 1, usually.
        amount: TextureRef,
    },
    /// An image.
    Image {
        /// The image.
        image: Arc<Image>,
        /// From the surface to the image; (0, 0) is its lower left corner.
        mapping: Mapping,
        /// How it is looked up where a pixel of the picture covers many of the image.
        filter: ImageFilter,
        /// Factor on its values.
        scale: f32,
    },
    /// Four values at the corners of the unit square, and between them.
    Bilerp {
        /// At (0, 0), (0, 1), (1, 0) and (1, 1).
        corners: [[f32; 3]; 4],
        /// From the surface to the unit square.
        mapping: Mapping,
    },
    /// The coordinates themselves as red and green, modulo 1.
    Uv {
        /// From the surface to the coordinates.
        mapping: Mapping,
    },
    /// 1 where a texture's red channel is at least so large, else 0.
    AtLeast {
        /// The texture.
        texture: TextureRef,
        /// From where on it is 1.
        threshold: f32,
    },
    /// The colours of the shape's vertices, interpolated ([`super::Scene::colors`]).
    VertexColor,
    /// Two textures in turn, in squares of edge 1.
    Checkerboard {
        /// In the square at (0, 0), and in every second one.
        even: TextureRef,
        /// In the others.
        odd: TextureRef,
        /// From the surface to the squares.
        mapping: Mapping,
        /// Averaged over the pixel's footprint, where that is known.
        filtered: bool,
    },
    /// Two textures in turn, in cubes of edge 1.
    Checkerboard3 {
        /// In the cube at (0, 0, 0), and in every second one.
        even: TextureRef,
        /// In the others.
        odd: TextureRef,
        /// From world space to the space of the cubes.
        to_texture: Transform,
    },
    /// Dots at random places, at most one a unit square.
    Dots {
        /// In the dots.
        inside: TextureRef,
        /// Between them.
        outside: TextureRef,
        /// From the surface to the squares.
        mapping: Mapping,
    },
    /// Noise of many frequencies, or a pattern made of it.
    Noise {
        /// Which.
        pattern: Pattern,
        /// From world space to the space of the noise.
        to_texture: Transform,
    },
}

/// What noise is made into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pattern {
    /// Fractional Brownian motion.
    Fbm {
        /// Sum of at most so many frequencies, each about twice the last.
        octaves: u32,
        /// The weight of each over that of the last.
        roughness: f32,
    },
    /// The same of absolute values: creases.
    Wrinkled {
        /// As [`Pattern::Fbm`].
        octaves: u32,
        /// As [`Pattern::Fbm`].
        roughness: f32,
    },
    /// Waves in gusts of wind.
    Windy,
    /// Bands of colours along y, shifted by noise.
    Marble {
        /// As [`Pattern::Fbm`].
        octaves: u32,
        /// As [`Pattern::Fbm`].
        roughness: f32,
        /// Factor on all coordinates.
        scale: f32,
        /// How far the bands are shifted.
        variation: f32,
    },
}

/// From a point of a surface to a texture's two coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mapping {
    /// By the surface's `(u, v)`: `(scale[0] · u + shift[0], scale[1] · v + shift[1])`.
    Uv {
        /// Factors.
        scale: [f32; 2],
        /// Offsets.
        shift: [f32; 2],
    },
    /// By latitude and longitude around the origin: `(θ / π, φ / 2π)`.
    Spherical {
        /// From world space to the space of the sphere.
        to_texture: Transform,
    },
    /// By the angle around the z axis and the height.
    Cylindrical {
        /// From world space to the space of the cylinder.
        to_texture: Transform,
    },
    /// By two vectors in world space: `(p · axes[0] + shift[0], p · axes[1] + shift[1])`.
    Planar {
        /// The vectors.
        axes: [[f32; 3]; 2],
        /// Offsets.
        shift: [f32; 2],
    },
}

impl Mapping {
    /// The surface's own coordinates.
    pub const IDENTITY: Mapping = Mapping::Uv {
        scale: [1.0; 2],
        shift: [0.0; 2],
    };
}

/// What an image texture holds outside `[0, 1]²`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The image again.
    Repeat,
    /// Black.
    Black,
    /// The nearest edge.
    Clamp,
}

/// How an image is averaged over the footprint of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImageFilter {
    /// Over a square as large as the footprint's longest extent.
    Trilinear,
    /// Over the footprint's ellipse \[Heckbert1989\].
    Elliptic {
        /// The longest ellipse, in multiples of its width.
        max_anisotropy: f32,
    },
}

impl ImageFilter {
    /// pbrt-v3's default.
    pub const DEFAULT: ImageFilter = ImageFilter::Elliptic {
        max_anisotropy: 8.0,
    };
}

/// An image, at all its resolutions, linear RGB.
#[derive(Debug, Default)]
pub struct Image {
    pyramid: OnceLock<Pyramid>,
}

impl Image {
    /// An image of `pixels`, row by row from the top. Where a side is no power of two the image is
    /// resampled to the next one, as pbrt-v3 does. Pixels that are absent are black.
    pub fn new(width: u32, height: u32, pixels: Vec<[f32; 3]>, wrap: Wrap) -> Self {
        let image = Image::default();
        image.set(Pyramid::new(width, height, pixels, wrap));
        image
    }

    /// An image that is still to be read.
    pub(crate) fn set(&self, pyramid: Pyramid) {
        // The first one stays.
        let _ = self.pyramid.set(pyramid);
    }

    /// Its resolutions; white until it has been read.
    pub(crate) fn pyramid(&self) -> &Pyramid {
        self.pyramid.get_or_init(Pyramid::white)
    }

    /// A pixel as it was read, or resampled; columns from the left, rows from the top.
    pub fn pixel(&self, column: u32, row: u32) -> [f32; 3] {
        self.pyramid().pixel(column, row)
    }

    /// Width and height as they were read, in pixels.
    pub fn size(&self) -> (u32, u32) {
        let pyramid = self.pyramid();
        (pyramid.width(), pyramid.height())
    }
}

impl PartialEq for Image {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other) || self.pyramid() == other.pyramid()
    }
}
