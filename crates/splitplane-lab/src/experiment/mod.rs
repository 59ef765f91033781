//! Experiments: grids of runs, planned, run one by one in processes of their own, and gathered.
//!
//! An [`Experiment`] is a TOML file; a [`Plan`] lists its [`Cell`]s, each with an id that follows
//! from its content; [`run_cell`] runs one in a process of its own and writes a [`CellResult`]
//! into the [`Folder`], whole or not at all. So a cell can be run anywhere and at any time, but
//! counts once; what was interrupted goes on where it stopped.

mod adapters;
mod cell;
mod file;
mod folder;
mod plan;
mod results;
mod schedule;
mod supervise;
mod work;

pub use adapters::{Adapter, write_adapter};
pub(crate) use cell::digest;
pub use cell::{Cell, Conditions, Program, Size};
pub use file::{Experiment, ExperimentError, SceneEntry};
pub use folder::{CellResult, Folder, Lock, Outcome};
pub use plan::{Plan, PlannedScene, SceneFacts};
pub(crate) use results::write_file;
pub use results::{Results, Variance};
pub use schedule::{Events, Remaining, Schedule, run_all};
pub use supervise::{Ended, NOT_ABLE, run_cell};
pub use work::work;
