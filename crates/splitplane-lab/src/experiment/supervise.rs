//! One cell in a process of its own: whatever becomes of it, there is a line that says so.

use std::io::Read;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::cell::{Cell, Program};
use super::folder::{CellResult, Folder, Outcome};
use crate::LabError;
use crate::run::Run;

/// The exit code of a process that lacked what it takes to run the cell (its scene is not there, the
/// plan is another program's, nothing can be written): not the cell's fault, so it has no result,
/// and nothing that the next cell would do better.
pub const NOT_ABLE: u8 = 74;
/// The exit code of a process that was interrupted.
const INTERRUPTED: i32 = 130;
/// How often a process is looked at.
const LOOK: Duration = Duration::from_millis(5);

/// How a cell ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ended {
    /// Its result is written.
    Written(Box<CellResult>),
    /// It was interrupted, and is as if it had never begun.
    Interrupted,
}

/// Runs `worker`, which runs the cell by [`super::work`] and prints the [`Run`] as JSON to its
/// standard output, and writes the result into the folder. The worker ends itself when its standard
/// input ends: so none is left behind when this process is killed.
///
/// A worker that crashes, fails or runs past the cell's limit gives a result with the reason. Once
/// `stop` says so the worker is ended, and there is no result.
///
/// # Errors
/// The worker cannot be started, or the result not be written.
pub fn run_cell(
    folder: &Folder,
    cell: &Cell,
    mut worker: Command,
    stop: &dyn Fn() -> bool,
) -> Result<Ended, LabError> {
    let start = Instant::now();
    let mut child = worker
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|source| LabError::Worker {
            reason: format!("the process of a cell cannot be started: {source}"),
        })?;
    // Pipes that nobody reads fill up, and the worker would wait.
    let out = read_all(child.stdout.take());
    let err = read_all(child.stderr.take());
    let ended = wait(&mut child, cell.limit_s, stop);
    let seconds = start.elapsed().as_secs_f64();
    let collect = |reader: JoinHandle<Vec<u8>>| reader.join().unwrap_or_default();
    let (out, err) = (collect(out), collect(err));
    let failed = |reason: String| Outcome::Failed { reason, seconds };
    let outcome = match ended {
        Wait::Stopped => return Ok(Ended::Interrupted),
        Wait::Failed(source) => failed(format!("the system lost it: {source}")),
        Wait::PastLimit => failed(format!("it ran past its limit of {} s", cell.limit_s)),
        Wait::Exited(status) if status.success() => {
            match serde_json::from_slice::<Box<Run>>(&out) {
                Ok(run) => Outcome::Done(run),
                Err(error) => failed(format!("it gave no result: {error}")),
            }
        }
        Wait::Exited(status) if was_interrupted(status) => return Ok(Ended::Interrupted),
        Wait::Exited(status) => {
            let said = last_words(&err);
            if status.code() == Some(i32::from(NOT_ABLE)) {
                return Err(LabError::Worker { reason: said });
            }
            failed(reason(status, &said))
        }
    };
    let result = CellResult {
        cell: cell.clone(),
        program: Program::this(),
        outcome,
    };
    folder.write_result(&result)?;
    Ok(Ended::Written(Box::new(result)))
}

enum Wait {
    Exited(ExitStatus),
    PastLimit,
    Stopped,
    Failed(std::io::Error),
}

fn wait(child: &mut Child, limit_s: f64, stop: &dyn Fn() -> bool) -> Wait {
    let start = Instant::now();
    let ended = loop {
        match child.try_wait() {
            Ok(Some(status)) => return Wait::Exited(status),
            Ok(None) => {}
            Err(error) => break Wait::Failed(error),
        }
        if stop() {
            break Wait::Stopped;
        }
        if start.elapsed().as_secs_f64() > limit_s {
            break Wait::PastLimit;
        }
        thread::sleep(LOOK);
    };
    // It may have ended meanwhile, which is as well.
    let _ = child.kill();
    let _ = child.wait();
    ended
}

fn read_all(pipe: Option<impl Read + Send + 'static>) -> JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            // What was read before an error is what there is.
            let _ = pipe.read_to_end(&mut bytes);
        }
        bytes
    })
}

#[cfg(unix)]
fn signal(status: ExitStatus) -> Option<i32> {
    std::os::unix::process::ExitStatusExt::signal(&status)
}

#[cfg(not(unix))]
fn signal(_status: ExitStatus) -> Option<i32> {
    None
}

/// Whether somebody asked the process to end (the signals HUP, INT and TERM), as opposed to the
/// system, or the process itself.
fn was_interrupted(status: ExitStatus) -> bool {
    status.code() == Some(INTERRUPTED) || matches!(signal(status), Some(1 | 2 | 15))
}

fn reason(status: ExitStatus, said: &str) -> String {
    let how = match (status.code(), signal(status)) {
        (_, Some(9)) => "it was killed (signal 9; systems do that when memory runs out)".to_owned(),
        (_, Some(signal)) => format!("it crashed (signal {signal})"),
        (Some(101), _) => "it crashed".to_owned(),
        (Some(_), _) if !said.is_empty() => return said.to_owned(),
        (code, _) => format!("it ended with code {}", code.unwrap_or(-1)),
    };
    match said {
        "" => how,
        said => format!("{how}: {said}"),
    }
}

/// The last lines of what a process said, without the names of streams.
fn last_words(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let lines: Vec<&str> = (text.lines().map(str::trim))
        .filter(|line| !line.is_empty() && !line.starts_with("note: run with `RUST_BACKTRACE"))
        .collect();
    let last = &lines[lines.len().saturating_sub(2)..];
    let text = last.join(" ");
    text.strip_prefix("error: ").unwrap_or(&text).to_owned()
}
