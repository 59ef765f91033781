//! Textures, as data.

use std::sync::Arc;

/// A value that varies over a surface: a linear RGB colour, or a number held in all three
/// channels.
#[derive(Clone, Debug)]
pub enum Texture {
    /// The same everywhere.
    Constant([f32; 3]),
    /// The product of two textures.
    Scale(Arc<Texture>, Arc<Texture>),
    /// An image.
    Image {
        /// The pixels, linear.
        image: Arc<Image>,
        /// From the surface's `(u, v)` to the image's: `[su, sv, du, dv]`,
        /// `(su · u + du, sv · v + dv)`.
        mapping: [f32; 4],
        /// What lies beyond the image.
        wrap: Wrap,
    },
}

/// What an image texture holds outside `[0, 1]²`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    Repeat,
    /// Black.
    Black,
    /// The nearest edge.
    Clamp,
}

/// Pixels, row by row from the top, linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels.
    pub pixels: Vec<[f32; 3]>,
}
