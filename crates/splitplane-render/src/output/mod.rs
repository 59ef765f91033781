//! Pictures as files: EXR with everything, PNG to look at, false colour for any quantity.
//!
//! Every file is written beside its place and then moved there, so that nobody ever sees half a
//! picture; missing folders are created.

use std::path::{Path, PathBuf};

use crate::render::Rendered;

/// Why a picture could not be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The file system or the format's library said no.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// Values and size do not fit.
    #[error("{given} values for a picture of {width} x {height} pixels")]
    Size {
        /// How many values.
        given: usize,
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
}

/// Writes radiance (`R`, `G`, `B`, linear) and, as further layers, depth, normal and the counters
/// per pixel (`counters.triangle_tests.closest`, …) as one EXR file of 32-bit floats.
///
/// # Errors
/// The file cannot be written.
pub fn write_exr(path: &Path, picture: &Rendered) -> Result<(), OutputError> {
    let _ = picture;
    Err(OutputError::Write {
        path: path.into(),
        reason: "not written yet".into(),
    })
}

/// Writes radiance as a PNG of 8 bits in sRGB, clamped.
///
/// # Errors
/// The file cannot be written.
pub fn write_png(path: &Path, picture: &Rendered) -> Result<(), OutputError> {
    let _ = picture;
    Err(OutputError::Write {
        path: path.into(),
        reason: "not written yet".into(),
    })
}

/// Writes `values` (row by row from the top) in false colour as a PNG, with a bar that shows what
/// the colours mean. Colours run from 0 to `scale_max`, or to the largest value where that is
/// `None`; larger values get the last colour. Returns the end of the scale, for other pictures to
/// share it.
///
/// # Errors
/// `values` are not `width * height`, or the file cannot be written.
pub fn write_false_colour(
    path: &Path,
    values: &[f32],
    (width, height): (u32, u32),
    scale_max: Option<f32>,
    label: &str,
) -> Result<f32, OutputError> {
    let _ = (values, width, height, scale_max, label);
    Err(OutputError::Write {
        path: path.into(),
        reason: "not written yet".into(),
    })
}
