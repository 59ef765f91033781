//! How a command fails.

use std::io;
use std::path::{Path, PathBuf};

use miette::Report;
use splitplane_lab::LabError;
use splitplane_render::SceneError;
use splitplane_render::scene::Scene;

use crate::scene;

/// Why a command did not end well, by exit code.
#[derive(Debug)]
pub enum Failure {
    /// What was asked for cannot be done: bad input, or a file that cannot be written.
    Input(Report),
    /// Results differ that must not.
    Difference(Report),
    /// A cell lacks what it takes to run it, through no fault of its own.
    NotAble(Report),
    /// It was interrupted.
    Interrupted,
    /// Nobody reads our output any more.
    BrokenPipe,
}

impl Failure {
    /// Bad input, in one sentence.
    pub fn input(message: impl std::fmt::Display) -> Failure {
        Failure::Input(miette::miette!("{message}"))
    }
}

/// An error of standard output; those of files have their own.
impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Failure {
        if error.kind() == io::ErrorKind::BrokenPipe {
            Failure::BrokenPipe
        } else {
            Failure::input(format!("the output cannot be written: {error}"))
        }
    }
}

impl From<LabError> for Failure {
    fn from(error: LabError) -> Failure {
        match error {
            LabError::Scene(error) => Failure::Input(scene::report(&error)),
            LabError::Experiment(error) => {
                let place = SceneError {
                    file: error.file.display().to_string(),
                    line: error.line,
                    column: error.column,
                    message: error.message,
                };
                Failure::Input(scene::report(&place))
            }
            error => Failure::input(error),
        }
    }
}

impl From<splitplane_render::output::OutputError> for Failure {
    fn from(error: splitplane_render::output::OutputError) -> Failure {
        Failure::input(error)
    }
}

/// Creates the folder where output will go, before any work is done for it.
pub fn writable_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| {
        Failure::input(format!(
            "the folder {} cannot be made: {error}",
            folder.display()
        ))
    })
}

/// Checks that files can be where they are to be written, and are none of those that the scene is
/// in: all of these are known once it has been read.
pub fn writable_places(
    files: impl IntoIterator<Item = impl AsRef<Path>>,
    scene: &Scene,
) -> Result<(), Failure> {
    let read = &scene.contents.files;
    files
        .into_iter()
        .try_for_each(|file| writable_place(file.as_ref(), read.iter().map(PathBuf::as_path)))
}

/// Checks that a file can be where it is to be written, and is none of those that are read, before
/// any work is done for it.
pub fn writable_place<'a>(
    file: &Path,
    read: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    let refused = |why: &str| {
        let file = file.display();
        Err(Failure::input(format!("{file} cannot be written: {why}")))
    };
    if file.is_dir() {
        return refused("it is a folder");
    }
    if let Ok(place) = file.canonicalize()
        && (read.into_iter()).any(|read| read.canonicalize().is_ok_and(|read| read == place))
    {
        return refused("it is what is read; name another file");
    }
    let folder = match file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => return Ok(()),
    };
    if folder.is_dir() {
        Ok(())
    } else {
        refused(&format!("there is no folder {}", folder.display()))
    }
}
