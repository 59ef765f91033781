//! What each pixel cost, from the file of a cell or from a rendering.

use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use splitplane_render::render::Rendered;

use crate::LabError;
use crate::pictures::Quantity;

/// A picture, and the quantities of its pixels per sample, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pixels {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) radiance: Vec<[f32; 3]>,
    /// In the order of [`Quantity::ALL`].
    pub(crate) quantities: Vec<Vec<f32>>,
}

impl Pixels {
    /// Those of a rendering with counters.
    pub(crate) fn of(rendered: &Rendered) -> Pixels {
        Pixels {
            width: rendered.width,
            height: rendered.height,
            radiance: rendered.radiance.clone(),
            quantities: Quantity::ALL
                .iter()
                .map(|quantity| quantity.per_sample(rendered))
                .collect(),
        }
    }

    /// Those in an EXR file that a rendering was written to, of so many samples per pixel.
    pub(crate) fn read(path: &Path, samples: u32) -> Result<Pixels, LabError> {
        let damaged = |reason: String| LabError::Damaged {
            path: path.to_owned(),
            reason,
        };
        let image =
            read_first_flat_layer_from_file(path).map_err(|error| damaged(error.to_string()))?;
        let layer = &image.layer_data;
        let channel = |name: &str| -> Result<Vec<f32>, LabError> {
            let found = (layer.channel_data.list.iter()).find(|c| c.name.to_string() == name);
            match found.map(|c| &c.sample_data) {
                Some(FlatSamples::F32(values)) => Ok(values.clone()),
                Some(FlatSamples::U32(values)) => Ok(values.iter().map(|&v| v as f32).collect()),
                _ => Err(damaged(format!("it has no channel {name}"))),
            }
        };
        let (r, g, b) = (channel("R")?, channel("G")?, channel("B")?);
        let mut quantities = Vec::new();
        for quantity in Quantity::ALL {
            let mut sum = vec![0.0_f32; r.len()];
            for counter in quantity.counters() {
                for kind in ["closest", "shadow"] {
                    let values = channel(&format!("counters.{counter}.{kind}"))?;
                    (sum.iter_mut().zip(values)).for_each(|(sum, value)| *sum += value);
                }
            }
            let per_sample = sum.into_iter().map(|sum| sum / samples.max(1) as f32);
            quantities.push(per_sample.collect());
        }
        Ok(Pixels {
            width: layer.size.0 as u32,
            height: layer.size.1 as u32,
            radiance: (r.into_iter().zip(g).zip(b))
                .map(|((r, g), b)| [r, g, b])
                .collect(),
            quantities,
        })
    }

    /// By how much the picture is made smaller for the page.
    fn factor(&self) -> usize {
        (self.width.max(self.height) as usize).div_ceil(MOST)
    }

    /// Width and height on the page.
    pub(crate) fn page_size(&self) -> (u32, u32) {
        let factor = self.factor();
        let size = |side: u32| (side as usize / factor).max(1) as u32;
        (size(self.width), size(self.height))
    }

    /// A quantity as a picture of one channel for the page, as a data URI: grey is
    /// `255 sqrt(value / end)`, so that small values keep their differences.
    pub(crate) fn grey(&self, quantity: usize, end: f32) -> Result<String, LabError> {
        let (width, height) = self.page_size();
        let values = self.shrunk(|i| [self.quantities[quantity][i]]);
        let bytes: Vec<u8> = (values.iter())
            .map(|[v]| (255.0 * (v / end).clamp(0.0, 1.0).sqrt()).round() as u8)
            .collect();
        png(&bytes, width, height, ExtendedColorType::L8)
    }

    /// The picture for the page, as a data URI, in sRGB.
    pub(crate) fn picture(&self) -> Result<String, LabError> {
        let (width, height) = self.page_size();
        let srgb = |linear: f32| {
            let encoded = match linear {
                v if v <= 0.003_130_8 => 12.92 * v,
                v => 1.055 * v.powf(1.0 / 2.4) - 0.055,
            };
            (255.0 * encoded.clamp(0.0, 1.0) + 0.5) as u8
        };
        let bytes: Vec<u8> = (self.shrunk(|i| self.radiance[i]).iter().flatten())
            .map(|&c| srgb(c))
            .collect();
        png(&bytes, width, height, ExtendedColorType::Rgb8)
    }

    /// Means over squares of pixels.
    fn shrunk<const N: usize>(&self, at: impl Fn(usize) -> [f32; N]) -> Vec<[f32; N]> {
        let (factor, (width, height)) = (self.factor(), self.page_size());
        let mut values = Vec::with_capacity((width * height) as usize);
        for y in 0..height as usize {
            for x in 0..width as usize {
                let mut sum = [0.0; N];
                for i in 0..factor * factor {
                    let (column, row) = (x * factor + i % factor, y * factor + i / factor);
                    let (column, row) = (
                        column.min(self.width as usize - 1),
                        row.min(self.height as usize - 1),
                    );
                    let value = at(row * self.width as usize + column);
                    (sum.iter_mut().zip(value)).for_each(|(sum, value)| *sum += value);
                }
                values.push(sum.map(|sum| sum / (factor * factor) as f32));
            }
        }
        values
    }
}

/// The longest side of a picture on the page, in pixels.
const MOST: usize = 800;

fn png(bytes: &[u8], width: u32, height: u32, kind: ExtendedColorType) -> Result<String, LabError> {
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Best, FilterType::Adaptive)
        .write_image(bytes, width, height, kind)
        .map_err(|error| LabError::Worker {
            reason: format!("a picture of {width} x {height} pixels cannot be encoded: {error}"),
        })?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(file)))
}
