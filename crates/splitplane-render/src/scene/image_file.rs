//! Images as textures: each file is read once.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::texture::Image;

/// How an image's pixels become numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Decoding {
    /// Pixels of 8 or 16 bits hold sRGB values, to be made linear.
    pub(crate) srgb: bool,
    /// All three channels hold the luminance.
    pub(crate) gray: bool,
}

/// The images that were read.
#[derive(Debug, Default)]
pub(crate) struct Images(HashMap<(PathBuf, Decoding), Result<Arc<Image>, String>>);

/// The weights of red, green and blue in the luminance, as in pbrt-v3.
const LUMINANCE: [f32; 3] = [0.212_671, 0.715_160, 0.072_169];

impl Images {
    /// The image at `path`.
    ///
    /// # Errors
    /// A message, where it cannot be read.
    pub(crate) fn get(&mut self, path: &Path, decoding: Decoding) -> Result<Arc<Image>, String> {
        self.0
            .entry((path.to_owned(), decoding))
            .or_insert_with(|| read(path, decoding).map(Arc::new))
            .clone()
    }
}

fn read(path: &Path, decoding: Decoding) -> Result<Image, String> {
    let image = image::ImageReader::open(path)
        .map_err(|error| error.to_string())?
        .with_guessed_format()
        .map_err(|error| error.to_string())?
        .decode()
        .map_err(|error| error.to_string())?;
    let eight_bits = matches!(
        image.color().bytes_per_pixel() / image.color().channel_count(),
        1
    );
    let (width, height) = (image.width(), image.height());
    // Eight bits have only 256 values: a table is exact and quick.
    let mut pixels: Vec<[f32; 3]> = if eight_bits {
        let table: Vec<f32> = (0..=255_u8)
            .map(|byte| {
                let value = f32::from(byte) / 255.0;
                if decoding.srgb { linear(value) } else { value }
            })
            .collect();
        let image = image.into_rgb8();
        image
            .pixels()
            .map(|pixel| pixel.0.map(|byte| table[usize::from(byte)]))
            .collect()
    } else {
        let integers = matches!(
            image,
            image::DynamicImage::ImageLuma16(_)
                | image::DynamicImage::ImageLumaA16(_)
                | image::DynamicImage::ImageRgb16(_)
                | image::DynamicImage::ImageRgba16(_)
        );
        let image = image.into_rgb32f();
        let decode = |value: f32| {
            if decoding.srgb && integers {
                linear(value)
            } else {
                value
            }
        };
        image.pixels().map(|pixel| pixel.0.map(decode)).collect()
    };
    if decoding.gray {
        for pixel in &mut pixels {
            *pixel = [pixel
                .iter()
                .zip(LUMINANCE)
                .map(|(c, weight)| c * weight)
                .sum(); 3];
        }
    }
    Ok(Image {
        width,
        height,
        pixels,
    })
}

/// From an sRGB value to a linear one, both from 0 to 1.
fn linear(value: f32) -> f32 {
    if value <= 0.04045 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}
