//! The folder of an experiment: the plan, a file for each cell that is done, and the reports.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::cell::{Cell, Program};
use super::plan::Plan;
use crate::run::Run;
use crate::{LabError, write_whole};

/// A folder with `plan.json`, and `cells/ID.json` (and `cells/ID.exr`, what each pixel cost) for
/// each cell that is done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folder {
    path: PathBuf,
}

/// What came of a cell: a line in the experiment's table, whatever happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellResult {
    /// The cell.
    pub cell: Cell,
    /// The program that ran it.
    pub program: Program,
    /// What came of it.
    pub outcome: Outcome,
}

/// What came of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It was run to its end.
    Done(Box<Run>),
    /// It was not.
    Failed {
        /// Why.
        reason: String,
        /// After how many seconds.
        seconds: f64,
    },
}

impl Outcome {
    /// The run, if it came to its end.
    pub fn run(&self) -> Option<&Run> {
        match self {
            Outcome::Done(run) => Some(run),
            Outcome::Failed { .. } => None,
        }
    }
}

/// Holds a folder for one process; given back when dropped.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

impl Folder {
    /// The folder at `path`, which need not be there.
    pub fn new(path: impl Into<PathBuf>) -> Folder {
        Folder { path: path.into() }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file of the plan.
    pub fn plan(&self) -> PathBuf {
        self.path.join("plan.json")
    }

    /// The file of a cell's result.
    pub fn result(&self, id: &str) -> PathBuf {
        self.cells().join(format!("{id}.json"))
    }

    /// The file of what each pixel of a cell cost.
    pub fn pixels(&self, id: &str) -> PathBuf {
        self.cells().join(format!("{id}.exr"))
    }

    fn cells(&self) -> PathBuf {
        self.path.join("cells")
    }

    /// Makes the folder.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn create(&self) -> Result<(), LabError> {
        let cells = self.cells();
        fs::create_dir_all(&cells).map_err(|source| LabError::Write {
            path: cells,
            source,
        })
    }

    /// Holds the folder against other processes that would run all its cells, and clears away what
    /// a process left unfinished that was killed.
    ///
    /// # Errors
    /// Another process holds it.
    pub fn lock(&self) -> Result<Lock, LabError> {
        let path = self.path.join(".lock");
        let failed = |source| LabError::Write {
            path: path.clone(),
            source,
        };
        let file = File::create(&path).map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(fs::TryLockError::WouldBlock) => {
                return Err(LabError::InUse {
                    path: self.path.clone(),
                });
            }
            Err(fs::TryLockError::Error(source)) => return Err(failed(source)),
        }
        for entry in fs::read_dir(self.cells()).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with('.') {
                // If it stays it does no harm.
                let _ = fs::remove_file(entry.path());
            }
        }
        Ok(Lock { _file: file })
    }

    /// Reads the plan.
    ///
    /// # Errors
    /// There is none, or it is damaged.
    pub fn read_plan(&self) -> Result<Plan, LabError> {
        match self.plan().exists() {
            true => read_json(&self.plan()),
            false => Err(LabError::NoPlan {
                path: self.path.clone(),
            }),
        }
    }

    /// The result of a cell, if there is one.
    ///
    /// # Errors
    /// Its file cannot be read, or is not that of the cell.
    pub fn read_result(&self, cell: &Cell) -> Result<Option<CellResult>, LabError> {
        let path = self.result(&cell.id);
        if !path.exists() {
            return Ok(None);
        }
        let result: CellResult = read_json(&path)?;
        if result.cell.id == cell.id {
            Ok(Some(result))
        } else {
            Err(LabError::Damaged {
                path,
                reason: format!("it is of the cell {}", result.cell.id),
            })
        }
    }

    /// Writes a cell's result, whole or not at all.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write_result(&self, result: &CellResult) -> Result<(), LabError> {
        let path = self.result(&result.cell.id);
        let json = serde_json::to_vec(result).map_err(LabError::json)?;
        write_whole(&path, |file| file.write_all(&json))
            .map_err(|source| LabError::Write { path, source })
    }

    /// Copies the results that this folder lacks from another; returns how many. `None`: the other
    /// folder has no result of this plan at all.
    ///
    /// # Errors
    /// A file cannot be read or written.
    pub fn gather(&self, plan: &Plan, from: &Folder) -> Result<Option<usize>, LabError> {
        let is_there = |cell: &Cell| from.result(&cell.id).exists();
        if !plan.cells.iter().any(is_there) {
            return Ok(None);
        }
        let mut gathered = 0;
        for cell in &plan.cells {
            let failed_here = match self.read_result(cell)? {
                Some(result) if result.outcome.run().is_some() => continue,
                result => result.is_some(),
            };
            let Some(result) = from.read_result(cell)? else {
                continue;
            };
            if failed_here && result.outcome.run().is_none() {
                continue;
            }
            let (pixels, here) = (from.pixels(&cell.id), self.pixels(&cell.id));
            if pixels.exists() {
                let bytes = fs::read(&pixels).map_err(|source| LabError::Read {
                    path: pixels,
                    source,
                })?;
                write_whole(&here, |file| file.write_all(&bytes))
                    .map_err(|source| LabError::Write { path: here, source })?;
            }
            self.write_result(&result)?;
            gathered += 1;
        }
        Ok(Some(gathered))
    }
}

fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, LabError> {
    let bytes = fs::read(path).map_err(|source| LabError::Read {
        path: path.to_owned(),
        source,
    })?;
    serde_json::from_slice(&bytes).map_err(|error| LabError::Damaged {
        path: path.to_owned(),
        reason: error.to_string(),
    })
}
