//! The laboratory: trees built and rendered under the same conditions, what they did as records,
//! and how they compare. It prints nothing.

#![forbid(unsafe_code)]

mod compare;
pub mod experiment;
mod machine;
pub mod numbers;
mod objects;
mod params;
mod pictures;
mod published;
mod record;
mod report;
mod reproduce;
mod run;
mod slice;
mod stats;
mod timeline;
pub mod verify;
mod window;

use std::path::PathBuf;

pub use compare::{
    ComparedTree, Comparison, Difference, Row, Step, Task, Unit, Watch, compare, rows,
};
pub use machine::{Machine, OthersLoad, forget_peak_memory, peak_memory_bytes};
pub use objects::{Objects, build_scene};
pub use params::{
    ParamsRecord, Preset, UnknownName, ties_name, ties_named, traversal_name, traversal_named,
};
pub use pictures::{Quantity, shared_scale};
pub use published::QUANTITIES;
pub use record::{CardRecord, NodeRecord, PerRay, Record, WideRecord, write_records};
pub use report::Report;
pub use reproduce::{
    Figure, FigureLine, FigureTable, Measured, figure_tables, reproduce, reproduction_steps,
    trees_of_the_thesis,
};
pub use run::{
    Built, Layouts, LeafSizeRecord, RenderTime, Run, Settings, Timing, build, load_tree, measure,
    record, render_timed, render_with, save_tree,
};
pub use slice::{Slice, SliceSettings};
pub use splitplane::write_whole;
pub use stats::{CONFIDENCE, Estimate, estimate, median};
pub use timeline::Timeline;
pub use window::{MAX_SIDE, MOST_SAMPLES, Resolution, crop_named};

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
    /// The wide layout answers exactly, and not as published.
    #[error(
        "the wide layout has the exact traversal only; take the binary layout with the traversal \
         as published"
    )]
    WideAsPublished,
    /// The scene could not be rendered.
    #[error(transparent)]
    Render(#[from] splitplane_render::render::RenderError),
    /// No threads to work with.
    #[error("cannot start the threads: {source}")]
    Threads {
        /// Why not.
        source: rayon::ThreadPoolBuildError,
    },
    /// The scene could not be read.
    #[error(transparent)]
    Scene(#[from] splitplane_render::SceneError),
    /// A picture could not be written.
    #[error(transparent)]
    Picture(#[from] splitplane_render::output::OutputError),
    /// An experiment's file says what cannot be.
    #[error(transparent)]
    Experiment(Box<experiment::ExperimentError>),
    /// Conditions that do not suit a scene, or mean nothing.
    #[error("{scene}: {message}")]
    Conditions {
        /// The scene, by its label.
        scene: String,
        /// What is wrong, and what would be accepted.
        message: String,
    },
    /// A scene is not the one that an experiment was planned with.
    #[error(
        "the scene {scene} is not the one that was planned: its geometry, camera or film is \
         another; plan the experiment again"
    )]
    OtherScene {
        /// The scene, by its label.
        scene: String,
    },
    /// A plan is another program's.
    #[error(
        "the plan was made by Splitplane {planned}, this is {this}; plan the experiment again, or \
         use that version"
    )]
    OtherProgram {
        /// Version and commit that the plan was made with.
        planned: String,
        /// Version and commit of this program.
        this: String,
    },
    /// Something is not part of a plan.
    #[error("the plan has no {what}; {planned}")]
    NotPlanned {
        /// What.
        what: String,
        /// What there is.
        planned: String,
    },
    /// A folder without a plan.
    #[error("{} holds no experiment; `splitplane plan` or `splitplane experiment` makes one", path.display())]
    NoPlan {
        /// The folder.
        path: PathBuf,
    },
    /// A folder is in use.
    #[error("another process runs the experiment in {}", path.display())]
    InUse {
        /// The folder.
        path: PathBuf,
    },
    /// A cell's process cannot do its work, through no fault of the cell.
    #[error("{reason}")]
    Worker {
        /// Why.
        reason: String,
    },
    /// A file could not be read.
    #[error("{} cannot be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A saved tree was not loaded.
    #[error("{} {source}", path.display())]
    LoadTree {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: splitplane::LoadError,
    },
    /// A file does not hold what it should.
    #[error("{} is damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Something could not be put into words.
    #[error("results cannot be written: {source}")]
    Format {
        /// Why.
        source: serde_json::Error,
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

impl LabError {
    pub(crate) fn json(source: serde_json::Error) -> LabError {
        LabError::Format { source }
    }
}
