//! How engines that run jobs on many machines run the cells of a plan.
//!
//! The contract is the command `splitplane run-cell FOLDER CELL`: it may be called for any cell, at
//! any time, in any order and more than once, on any machine that sees the folder; it runs the cell
//! unless that is done, and writes its result. What is here tells engines to call it.

use std::path::PathBuf;

use super::folder::Folder;
use super::plan::Plan;
use super::results::write_file;
use crate::LabError;

/// An engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Adapter {
    /// HyperQueue, by its Python package; its workers come from its local cluster, or allocate
    /// themselves through SLURM or PBS.
    HyperQueue,
    /// A job array of SLURM.
    Slurm,
}

const HYPERQUEUE: &str = include_str!("adapters/hyperqueue.py");
const SLURM: &str = include_str!("adapters/slurm.sh");

impl Adapter {
    /// The name of the script that is written for it.
    pub fn file_name(self) -> &'static str {
        match self {
            Adapter::HyperQueue => "hyperqueue-cells.py",
            Adapter::Slurm => "slurm-cells.sh",
        }
    }
}

/// Writes the script that has an engine run the cells, into the folder; returns where.
///
/// # Errors
/// It cannot be written.
pub fn write_adapter(adapter: Adapter, plan: &Plan, folder: &Folder) -> Result<PathBuf, LabError> {
    let path = folder.path().join(adapter.file_name());
    let text = match adapter {
        Adapter::HyperQueue => HYPERQUEUE.to_owned(),
        Adapter::Slurm => {
            let timed = plan.cells.iter().any(|cell| cell.timed);
            // Counting cells may have many threads, if the experiment says so.
            let threads = (plan.cells.iter())
                .map(|cell| cell.conditions.threads.unwrap_or(1))
                .max()
                .unwrap_or(1);
            let resources = match timed {
                true => "--exclusive".to_owned(),
                false => format!("--cpus-per-task={threads}"),
            };
            let limit = plan
                .cells
                .iter()
                .map(|cell| cell.limit_s)
                .fold(0.0, f64::max);
            // Reading the scene and writing come on top.
            let minutes = (limit / 60.0).ceil() as u64 + 5;
            SLURM
                .replace("@RESOURCES@", &resources)
                .replace("@LAST@", &plan.cells.len().saturating_sub(1).to_string())
                .replace("@MINUTES@", &minutes.to_string())
        }
    };
    write_file(&path, text.as_bytes())?;
    Ok(path)
}
