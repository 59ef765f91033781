//! Files that are either there and whole, or as they were.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// For the crates of this workspace.
///
/// Writes a file by `fill`: beside its place first, then moved there, so that nobody ever sees
/// half of it and a failure leaves the file that was there. A link is followed; what is no
/// ordinary file (a pipe, a device) is written to directly.
///
/// # Errors
/// What the system or `fill` says; the unfinished file is gone then.
pub fn write_whole(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let place = match fs::metadata(path) {
        Ok(metadata) if metadata.is_file() => fs::canonicalize(path)?,
        Ok(metadata) if metadata.is_dir() => {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "is a folder"));
        }
        Ok(_) => return fill_file(path, fill),
        Err(_) => path.to_owned(),
    };
    let beside = unfinished(&place)?;
    // Moved only once it is on the disk: else its place could be that of an empty file after the
    // machine went down.
    let written = fill_file(&beside, fill)
        .and_then(|()| File::open(&beside)?.sync_all())
        .and_then(|()| fs::rename(&beside, &place));
    if written.is_err() {
        // The first error is the one to tell.
        let _ = fs::remove_file(&beside);
    }
    written
}

fn fill_file(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    fill(&mut file)?;
    file.flush()
}

/// The name of a file while it is being written; processes do not share one.
fn unfinished(place: &Path) -> io::Result<PathBuf> {
    let name = place
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "names no file"))?;
    let mut unfinished = std::ffi::OsString::from(".");
    unfinished.push(name);
    unfinished.push(format!(".{}.unfinished", std::process::id()));
    Ok(place.with_file_name(unfinished))
}
