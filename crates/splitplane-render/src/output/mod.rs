//! Pictures as files: EXR with everything, PNG to look at, false colour for any quantity.
//!
//! Every file is written beside its place and then moved there, so that nobody ever sees half a
//! picture; missing folders are created.

mod exr_file;
mod false_colour;
mod font;

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

pub use exr_file::write_exr;
pub use false_colour::{false_colours, write_false_colour};

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

/// Writes radiance as a PNG of 8 bits in sRGB, clamped.
///
/// # Errors
/// The file cannot be written, or the picture has not as many values as pixels.
pub fn write_png(path: &Path, picture: &Rendered) -> Result<(), OutputError> {
    let (width, height) = (picture.width, picture.height);
    check_size(picture.radiance.len(), width, height)?;
    let bytes: Vec<u8> = picture
        .radiance
        .iter()
        .flatten()
        .map(|&c| srgb(c))
        .collect();
    write_rgb(path, &bytes, width, height)
}

/// Writes any bytes as a file.
///
/// # Errors
/// The file cannot be written.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    replace(path, |file| {
        file.write_all(bytes).map_err(|error| error.to_string())
    })
}

/// The sRGB transfer function, to 8 bits; what is not a number is black.
fn srgb(linear: f32) -> u8 {
    let encoded = if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    };
    (255.0 * encoded.clamp(0.0, 1.0) + 0.5) as u8
}

fn write_rgb(path: &Path, bytes: &[u8], width: u32, height: u32) -> Result<(), OutputError> {
    replace(path, |file| {
        PngEncoder::new(file)
            .write_image(bytes, width, height, ExtendedColorType::Rgb8)
            .map_err(|error| error.to_string())
    })
}

fn check_size(given: usize, width: u32, height: u32) -> Result<(), OutputError> {
    if given == width as usize * height as usize {
        Ok(())
    } else {
        Err(OutputError::Size {
            given,
            width,
            height,
        })
    }
}

/// Writes a file under another name in the same folder, then gives it its own.
fn replace(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), OutputError> {
    let failed = |reason: String| OutputError::Write {
        path: path.into(),
        reason,
    };
    let name = path
        .file_name()
        .ok_or_else(|| failed("this is not the name of a file".into()))?;
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)
            .map_err(|error| failed(format!("cannot create {}: {error}", folder.display())))?;
    }
    // Two writers at a time, of this process or another, must not share the name.
    static WRITTEN: AtomicU32 = AtomicU32::new(0);
    let number = WRITTEN.fetch_add(1, Ordering::Relaxed);
    let mut beside = std::ffi::OsString::from(".");
    beside.push(name);
    beside.push(format!(".{}-{number}.part", std::process::id()));
    let beside = path.with_file_name(beside);
    let write_beside = || -> Result<(), String> {
        let text = |error: std::io::Error| error.to_string();
        let mut file = BufWriter::new(File::create(&beside).map_err(text)?);
        write(&mut file)?;
        file.flush().map_err(text)?;
        fs::rename(&beside, path).map_err(text)
    };
    write_beside().map_err(|reason| {
        // The reason matters more than whether the remains could be removed.
        let _ = fs::remove_file(&beside);
        failed(reason)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_has_its_known_values() {
        let encoded = [0.0, 0.001, 0.215_861, 1.0, 7.0, -1.0, f32::NAN].map(srgb);
        assert_eq!(encoded, [0, 3, 128, 255, 255, 0, 0]);
    }

    #[test]
    fn a_failed_write_leaves_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/c.txt");
        replace(&path, |file| {
            file.write_all(b"first").map_err(|e| e.to_string())
        })
        .unwrap();
        let error = replace(&path, |file| {
            file.write_all(b"sec").map_err(|e| e.to_string())?;
            Err("out of ink".into())
        });
        assert!(
            error
                .unwrap_err()
                .to_string()
                .ends_with("c.txt: out of ink")
        );
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
        assert!(replace(Path::new("/"), |_| Ok(())).is_err());
    }
}
