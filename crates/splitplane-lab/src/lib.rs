//! The laboratory: trees built and rendered under the same conditions, what they did as records,
//! and how they compare. It prints nothing.

#![forbid(unsafe_code)]

mod compare;
mod machine;
pub mod numbers;
mod params;
mod pictures;
mod published;
mod record;
mod reproduce;
mod run;
mod slice;
mod stats;
pub mod verify;
mod write;

use std::path::PathBuf;

pub use compare::{Comparison, Difference, Row, Step, Task, Unit, Watch, compare, rows};
pub use machine::{Machine, peak_memory_bytes};
pub use params::{
    ParamsRecord, Preset, UnknownName, ties_name, ties_named, traversal_name, traversal_named,
};
pub use pictures::{Quantity, shared_scale};
pub use published::QUANTITIES;
pub use record::{CardRecord, NodeRecord, PerRay, Record, write_records};
pub use reproduce::{
    Figure, FigureLine, FigureTable, Measured, figure_tables, reproduce, reproduction_steps,
    trees_of_the_thesis,
};
pub use run::{Built, Settings, build, record, render_with};
pub use slice::{Slice, SliceSettings};
pub use stats::median;
pub use write::write_whole;

/// What can go wrong in the laboratory.
#[derive(Debug, thiserror::Error)]
pub enum LabError {
    /// A tree could not be built.
    #[error("the tree {tree} cannot be built: {source}")]
    Build {
        /// The tree.
        tree: String,
        /// Why.
        source: splitplane::BuildError,
    },
    /// The scene could not be rendered.
    #[error(transparent)]
    Render(#[from] splitplane_render::render::RenderError),
    /// No threads to work with.
    #[error("cannot start the threads: {source}")]
    Threads {
        /// Why not.
        source: rayon::ThreadPoolBuildError,
    },
    /// A file could not be written.
    #[error("{} cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}
