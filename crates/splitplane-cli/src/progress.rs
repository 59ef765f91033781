//! The progress bar: on standard error, on a terminal only.

use std::io::IsTerminal;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use splitplane_lab::experiment::{Cell, CellResult, Events, Remaining};
use splitplane_lab::{Step, Task, Watch};
use splitplane_render::render::Progress;

use crate::print;

/// The bar on the screen, if any: what else is printed must not run into it.
static SHOWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

fn shown() -> std::sync::MutexGuard<'static, Option<ProgressBar>> {
    SHOWN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Takes the bar off the screen.
pub fn clear() {
    if let Some(bar) = shown().take() {
        bar.finish_and_clear();
    }
}

/// What somebody should know who interrupts us now.
static ADVICE: Mutex<Option<String>> = Mutex::new(None);

/// Sets what is said on an interruption.
pub fn advise(text: String) {
    *ADVICE.lock().unwrap_or_else(PoisonError::into_inner) = Some(text);
}

/// Takes the bar off the screen and says what there is to say, once.
pub fn interrupted() {
    clear();
    let advice = ADVICE.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(text) = advice {
        print::note(&format!("interrupted; {text}"));
    }
}

/// Does `work` with the bar off the screen meanwhile.
pub fn suspend(work: impl FnOnce()) {
    match &*shown() {
        Some(bar) => bar.suspend(work),
        None => work(),
    }
}

/// A progress bar that follows a comparison, a rendering or a build.
pub struct Bar {
    bar: ProgressBar,
    steps: usize,
    done: Mutex<usize>,
}

impl Bar {
    /// A bar for that many steps; `quiet`: none is shown.
    pub fn new(quiet: bool, steps: usize) -> Bar {
        let bar = if quiet || !std::io::stderr().is_terminal() {
            ProgressBar::hidden()
        } else {
            let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::stderr());
            bar.set_style(style(SPIN, &SPINNER));
            bar.enable_steady_tick(Duration::from_millis(120));
            *shown() = Some(bar.clone());
            bar
        };
        Bar {
            bar,
            steps,
            done: Mutex::new(0),
        }
    }

    /// Something of unknown length begins.
    pub fn spin(&self, message: String) {
        self.bar
            .set_style(style("{spinner} {msg} ({elapsed})", &SPINNER));
        self.bar.set_message(message);
    }
}

impl Events for Bar {
    fn started(&self, cell: &Cell, remaining: Remaining) {
        self.grid(remaining);
        let repetition = match cell.repetition {
            0 => String::new(),
            n => format!(", repetition {}", n + 1),
        };
        self.bar.set_message(format!(
            "{}, {}{repetition}",
            cell.scene,
            cell.tree_with_k()
        ));
    }

    fn finished(&self, _result: &CellResult, remaining: Remaining) {
        self.grid(remaining);
    }
}

impl Bar {
    /// Cells that are done, and the time left for the others.
    fn grid(&self, remaining: Remaining) {
        let left = match remaining.time {
            Some(time) => format!("about {} left", HumanDuration(time)),
            None => "time left unknown".to_owned(),
        };
        self.bar.set_style(style(
            "{spinner} {pos}/{len} {wide_bar} {prefix} {msg} ({elapsed})",
            &GRID,
        ));
        self.bar.set_length(remaining.total as u64);
        self.bar.set_position(remaining.done as u64);
        self.bar.set_prefix(left);
    }
}

const SPIN: &str = "{spinner} {msg} ({elapsed})";
static SPINNER: OnceLock<ProgressStyle> = OnceLock::new();
static GRID: OnceLock<ProgressStyle> = OnceLock::new();
static RAYS: OnceLock<ProgressStyle> = OnceLock::new();

fn style(template: &str, cell: &OnceLock<ProgressStyle>) -> ProgressStyle {
    cell.get_or_init(|| {
        ProgressStyle::with_template(template)
            .unwrap_or_else(|_| ProgressStyle::default_bar())
            .with_key("left", left)
            .progress_chars("━╸─")
    })
    .clone()
}

/// The time left if all goes on as it did on the whole. The bar's own figure goes by how fast it went
/// last, and grows without bounds where one step takes long.
fn left(state: &ProgressState, to: &mut dyn std::fmt::Write) {
    let done = state.pos() as f64 / state.len().unwrap_or_default() as f64;
    let seconds = state.elapsed().as_secs_f64() * (1.0 / done - 1.0);
    // Nobody can write to a bar and fail in a way that we could tell.
    let _ = match Duration::try_from_secs_f64(seconds) {
        Ok(left) => write!(to, "{}", HumanDuration(left)),
        Err(_) => write!(to, "unknown time"),
    };
}

impl Progress for Bar {}

impl splitplane::Progress for Bar {
    fn advanced(&self, done: u64, total: u64) {
        if self.bar.is_hidden() {
            return;
        }
        self.bar.set_length(total);
        self.bar.set_style(style(
            "{spinner} {msg} {wide_bar} {percent:>3} % ({left} left)",
            &RAYS,
        ));
        self.bar.set_position(done);
    }
}

impl Watch for Bar {
    fn step(&self, step: Step) {
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        *done += 1;
        let task = match step.task {
            Task::Build => "building the tree",
            Task::Time => "rendering, timed",
            Task::Count => "rendering, counting",
        };
        self.spin(format!("[{}/{}] {}: {task}", *done, self.steps, step.tree));
    }
}
