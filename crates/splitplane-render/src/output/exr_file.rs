//! Everything that is known of the pixels, in one EXR file.

use std::path::Path;

use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec,
    WritableImage,
};

use super::{OutputError, check_size, replace};
use crate::render::{PixelCounts, Rendered};

/// Writes radiance (`R`, `G`, `B`, linear), depth (`depth.Z`), the normal (`normal.X`, `.Y`, `.Z`)
/// and the counters per pixel (`counters.triangle_tests.closest`, `….shadow`, and so on for
/// `kd_visits`, `oblique_visits`, `leaf_visits`, `wide_visits`) as channels of one EXR file. Counters
/// are 32-bit unsigned integers, all else 32-bit floats. The header says `samplesPerPixel` and
/// `renderTime` (in seconds).
///
/// # Errors
/// The file cannot be written, or the picture has not as many values as pixels.
pub fn write_exr(path: &Path, picture: &Rendered) -> Result<(), OutputError> {
    let (width, height) = (picture.width, picture.height);
    let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
    let float = |name: &str, values: Vec<f32>| AnyChannel::new(name, FlatSamples::F32(values));
    for (axis, name) in ["R", "G", "B"].into_iter().enumerate() {
        check_size(picture.radiance.len(), width, height)?;
        channels.push(float(
            name,
            picture.radiance.iter().map(|p| p[axis]).collect(),
        ));
    }
    for (axis, name) in ["normal.X", "normal.Y", "normal.Z"].into_iter().enumerate() {
        check_size(picture.normal.len(), width, height)?;
        channels.push(float(
            name,
            picture.normal.iter().map(|p| p[axis]).collect(),
        ));
    }
    check_size(picture.depth.len(), width, height)?;
    channels.push(float("depth.Z", picture.depth.clone()));
    if let Some(counters) = &picture.pixel_counts {
        for (kind, counts) in [("closest", &counters.closest), ("shadow", &counters.shadow)] {
            check_size(counts.len(), width, height)?;
            for (name, value) in PixelCounts::NAMED {
                let values = counts.iter().map(value).collect();
                let name = format!("counters.{name}.{kind}");
                channels.push(AnyChannel::new(name.as_str(), FlatSamples::U32(values)));
            }
        }
    }
    let mut attributes = LayerAttributes::default();
    let mut tell = |name: &str, value: AttributeValue| {
        attributes.other.insert(Text::from(name), value);
    };
    tell(
        "samplesPerPixel",
        AttributeValue::I32(i32::try_from(picture.samples_per_pixel).unwrap_or(i32::MAX)),
    );
    tell("renderTime", AttributeValue::F64(picture.seconds));
    let layer = Layer::new(
        (width as usize, height as usize),
        attributes,
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels),
    );
    let image = Image::from_layer(layer);
    replace(path, |file| {
        image
            .write()
            .to_buffered(file)
            .map_err(|error| error.to_string())
    })
}
