//! Images as textures: each file is read once, many at a time.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::pyramid::{Pixels, Pyramid};
use super::texture::{Image, Wrap};

/// How an image's pixels become numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Decoding {
    /// Pixels of 8 or 16 bits hold sRGB values, to be made linear.
    pub(crate) srgb: bool,
    /// What of a pixel is taken.
    pub(crate) channels: Channels,
    pub(crate) wrap: Wrap,
}

/// What of a pixel is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Channels {
    Color,
    /// All three channels hold the luminance.
    Luminance,
    /// All three channels hold the opacity; 1 where the image has none.
    Alpha,
}

/// The images that were asked for.
#[derive(Debug, Default)]
pub(crate) struct Images {
    wanted: Vec<(PathBuf, Decoding, Arc<Image>)>,
    numbers: HashMap<(PathBuf, Decoding), usize>,
    /// Images that came with the scene's own file: their bytes, in place of a file's.
    embedded: HashMap<PathBuf, Arc<[u8]>>,
}

/// The weights of red, green and blue in the luminance, as in pbrt-v3.
const LUMINANCE: [f32; 3] = [0.212_671, 0.715_160, 0.072_169];

impl Images {
    /// The image at `path`, which [`Images::read`] will read.
    pub(crate) fn get(&mut self, path: &Path, decoding: Decoding) -> Arc<Image> {
        let number = *self
            .numbers
            .entry((path.to_owned(), decoding))
            .or_insert_with(|| {
                self.wanted
                    .push((path.to_owned(), decoding, Arc::default()));
                self.wanted.len() - 1
            });
        Arc::clone(&self.wanted[number].2)
    }

    /// Makes `bytes` the content of a file that has no place of its own.
    pub(crate) fn embed(&mut self, name: &Path, bytes: Arc<[u8]>) {
        self.embedded.insert(name.to_owned(), bytes);
    }

    /// The files, each once, in the order of their first use.
    pub(crate) fn paths(&self) -> impl Iterator<Item = &Path> {
        let mut seen = HashSet::new();
        self.wanted
            .iter()
            .map(|(path, ..)| path.as_path())
            .filter(move |path| seen.insert(*path))
    }

    /// Reads all images, many at a time. Those that cannot be read stay white; gives them with
    /// the reason, in the order of their first use.
    pub(crate) fn read(&self) -> Vec<(&Path, String)> {
        let outcomes: Vec<_> = self
            .wanted
            .par_iter()
            .with_max_len(1)
            .map(|(path, decoding, image)| {
                let bytes = match self.embedded.get(path) {
                    Some(bytes) => Ok(Arc::clone(bytes)),
                    None => std::fs::read(path).map(Arc::from),
                };
                let pyramid = bytes
                    .map_err(|error| error.to_string())
                    .and_then(|bytes| decode(path, &bytes, *decoding))?;
                image.set(pyramid);
                Ok(())
            })
            .collect();
        self.wanted
            .iter()
            .zip(outcomes)
            .filter_map(|((path, ..), outcome): (_, Result<(), String>)| {
                Some((path.as_path(), outcome.err()?))
            })
            .collect()
    }
}

fn decode(path: &Path, bytes: &[u8], decoding: Decoding) -> Result<Pyramid, String> {
    if bytes.starts_with(b"PF") || bytes.starts_with(b"Pf") {
        let (width, height, pixels) = pfm(bytes)?;
        return Ok(Pyramid::new(width, height, pixels, decoding.wrap));
    }
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| error.to_string())?;
    // A TGA has no mark of its own: its name tells.
    if reader.format().is_none()
        && let Ok(format) = image::ImageFormat::from_path(path)
    {
        reader.set_format(format);
    }
    let image = reader.decode().map_err(|error| error.to_string())?;
    let channels = image.color().channel_count();
    let eight_bits = image.color().bytes_per_pixel() / channels == 1;
    let gray = image.color().channel_count() <= 2;
    let (width, height) = (image.width(), image.height());
    let decode = |value: f32, srgb: bool| if srgb { linear(value) } else { value };
    let luminance = |p: [f32; 3]| p.iter().zip(LUMINANCE).map(|(c, w)| c * w).sum::<f32>();
    let pixels = match decoding.channels {
        Channels::Alpha => {
            let image = image.into_rgba8();
            let table = Box::new(std::array::from_fn(|byte| byte as f32 / 255.0));
            Pixels::Bytes(image.pixels().map(|p| [p.0[3]; 3]).collect(), table)
        }
        Channels::Color | Channels::Luminance
            if eight_bits && (gray || decoding.channels == Channels::Color) =>
        {
            // Eight bits have only 256 values: a table is exact and quick.
            let table = Box::new(std::array::from_fn(|byte| {
                decode(byte as f32 / 255.0, decoding.srgb)
            }));
            let bytes = image.into_rgb8();
            Pixels::Bytes(bytes.pixels().map(|p| p.0).collect(), table)
        }
        Channels::Color | Channels::Luminance => {
            let integers = matches!(
                image.color(),
                image::ColorType::L8
                    | image::ColorType::La8
                    | image::ColorType::Rgb8
                    | image::ColorType::Rgba8
                    | image::ColorType::L16
                    | image::ColorType::La16
                    | image::ColorType::Rgb16
                    | image::ColorType::Rgba16
            );
            let srgb = decoding.srgb && integers;
            let image = image.into_rgb32f();
            let value = |p: &image::Rgb<f32>| match decoding.channels {
                // As pbrt-v3 does: the luminance of the values as they are in the file.
                Channels::Luminance => [decode(luminance(p.0), srgb); 3],
                _ => p.0.map(|c| decode(c, srgb)),
            };
            Pixels::Floats(image.pixels().map(value).collect())
        }
    };
    Ok(Pyramid::of(width, height, pixels, decoding.wrap))
}

type Floats = (u32, u32, Vec<[f32; 3]>);

/// A portable float map: a header of three lines, then rows from the bottom.
fn pfm(bytes: &[u8]) -> Result<Floats, String> {
    let wrong = || "its header is not that of a PFM file".to_owned();
    let mut rest = bytes;
    let mut word = || -> Option<&str> {
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace)?;
        let word = &rest[start..start + length];
        rest = &rest[start + length + 1..];
        std::str::from_utf8(word).ok()
    };
    let channels = match word() {
        Some("PF") => 3,
        _ => 1,
    };
    let mut number = || word().and_then(|w| w.parse::<f32>().ok());
    let (width, height, scale) = match (number(), number(), number()) {
        (Some(width), Some(height), Some(scale)) if width >= 1.0 && height >= 1.0 => {
            (width as usize, height as usize, scale)
        }
        _ => return Err(wrong()),
    };
    let count = width.saturating_mul(height);
    if rest.len() / (4 * channels) < count || width > 1 << 20 || height > 1 << 20 {
        return Err("the file ends within its pixels".to_owned());
    }
    let value = |i: usize| {
        let bytes = [
            rest[4 * i],
            rest[4 * i + 1],
            rest[4 * i + 2],
            rest[4 * i + 3],
        ];
        let value = if scale < 0.0 {
            f32::from_le_bytes(bytes)
        } else {
            f32::from_be_bytes(bytes)
        };
        value * scale.abs()
    };
    let mut pixels = Vec::with_capacity(count);
    for y in (0..height).rev() {
        for x in 0..width {
            let first = (y * width + x) * channels;
            pixels.push(match channels {
                3 => [value(first), value(first + 1), value(first + 2)],
                _ => [value(first); 3],
            });
        }
    }
    Ok((width as u32, height as u32, pixels))
}

/// From an sRGB value to a linear one, both from 0 to 1.
pub(crate) fn linear(value: f32) -> f32 {
    if value <= 0.04045 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}
