//! All cells that are missing, on this machine.

use std::collections::VecDeque;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use super::cell::Cell;
use super::folder::{CellResult, Folder, Outcome};
use super::plan::Plan;
use super::supervise::{Ended, run_cell};
use crate::LabError;
use crate::stats::median;

/// How cells are run on this machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Cells that only count run side by side, at most so many; timed ones run alone.
    pub jobs: usize,
    /// Run cells again that failed.
    pub retry_failed: bool,
}

/// What is left to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remaining {
    /// Cells that are done, of this run and of earlier ones.
    pub done: usize,
    /// All cells.
    pub total: usize,
    /// The time that the others will take, as far as those that are done tell.
    pub time: Option<Duration>,
}

/// Watches an experiment, from several threads, and may stop it.
pub trait Events: Sync {
    /// A cell begins.
    fn started(&self, _cell: &Cell, _remaining: Remaining) {}
    /// A cell is done.
    fn finished(&self, _result: &CellResult, _remaining: Remaining) {}
    /// Asked often; once it says yes, no cell begins and those that run are given up.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Watches nothing.
impl Events for () {}

/// The seconds that a cell of this scene and tree took.
struct Took {
    scene: String,
    tree: String,
    seconds: f64,
}

impl Took {
    fn by(result: &CellResult) -> Took {
        Took {
            scene: result.cell.scene.clone(),
            tree: result.cell.tree_with_k(),
            seconds: match &result.outcome {
                Outcome::Done(run) => run.seconds,
                Outcome::Failed { seconds, .. } => *seconds,
            },
        }
    }
}

struct State<'a> {
    queue: VecDeque<&'a Cell>,
    running: Vec<&'a Cell>,
    took: Vec<Took>,
    failure: Option<LabError>,
    interrupted: bool,
}

impl State<'_> {
    fn remaining(&self, total: usize, jobs: usize) -> Remaining {
        let waiting = || self.queue.iter().chain(&self.running);
        let seconds: Option<f64> = (!self.took.is_empty())
            .then(|| waiting().map(|cell| self.expected(cell)).sum::<f64>() / jobs as f64);
        Remaining {
            done: total - waiting().count(),
            total,
            time: seconds.and_then(|s| Duration::try_from_secs_f64(s).ok()),
        }
    }

    /// How long a cell will take: as those of the same scene and tree, else of the same tree, else
    /// as any.
    fn expected(&self, cell: &Cell) -> f64 {
        let tree = cell.tree_with_k();
        let of = |pick: &dyn Fn(&Took) -> bool| {
            median(
                self.took
                    .iter()
                    .filter(|took| pick(took))
                    .map(|took| took.seconds),
            )
        };
        of(&|took| took.tree == tree && took.scene == cell.scene)
            .or_else(|| of(&|took| took.tree == tree))
            .or_else(|| of(&|_| true))
            .unwrap_or(0.0)
    }
}

/// Runs all cells that the folder has no result for, in the order of the plan, each in a process of
/// its own that `worker` gives the command of. Returns whether all are done; `false`: it was
/// stopped.
///
/// # Errors
/// A worker cannot be started, or a file not be read or written. Nothing that was done is lost.
pub fn run_all(
    plan: &Plan,
    folder: &Folder,
    worker: &(dyn Fn(&Cell) -> Command + Sync),
    schedule: Schedule,
    events: &dyn Events,
) -> Result<bool, LabError> {
    let mut state = State {
        queue: VecDeque::new(),
        running: Vec::new(),
        took: Vec::new(),
        failure: None,
        interrupted: false,
    };
    for cell in &plan.cells {
        match folder.read_result(cell)? {
            Some(result) if result.outcome.run().is_some() || !schedule.retry_failed => {
                state.took.push(Took::by(&result));
            }
            _ => state.queue.push_back(cell),
        }
    }
    let timed = plan.cells.iter().any(|cell| cell.timed);
    let jobs = if timed { 1 } else { schedule.jobs.max(1) };
    let total = plan.cells.len();
    let state = Mutex::new(state);
    let ended = AtomicBool::new(false);
    let lock = || {
        state
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
    };
    let stop = || ended.load(Ordering::Relaxed) || events.cancelled();
    let next = || {
        let mut state = lock();
        if stop() {
            return None;
        }
        let cell = state.queue.pop_front()?;
        state.running.push(cell);
        let remaining = state.remaining(total, jobs);
        Some((cell, remaining))
    };
    let run = || {
        while let Some((cell, remaining)) = next() {
            events.started(cell, remaining);
            let ran = run_cell(folder, cell, worker(cell), &stop);
            let mut state = lock();
            state.running.retain(|other| other.id != cell.id);
            match ran {
                Ok(Ended::Written(result)) => {
                    state.took.push(Took::by(&result));
                    let remaining = state.remaining(total, jobs);
                    drop(state);
                    events.finished(&result, remaining);
                }
                Ok(Ended::Interrupted) => {
                    state.interrupted = true;
                    ended.store(true, Ordering::Relaxed);
                }
                Err(error) => {
                    // The first error is the one to tell.
                    state.failure.get_or_insert(error);
                    ended.store(true, Ordering::Relaxed);
                }
            }
        }
    };
    thread::scope(|scope| {
        for _ in 1..jobs {
            scope.spawn(run);
        }
        run();
    });
    let state = state
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    match state.failure {
        Some(error) => Err(error),
        None => Ok(!state.interrupted && state.queue.is_empty()),
    }
}
