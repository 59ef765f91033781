//! `splitplane experiment`, `plan`, `run-cell`, `merge` and `report`.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;

use splitplane_lab::experiment::{
    Adapter, Cell, CellResult, Ended, Events, Experiment, Folder, Outcome, Plan, Remaining,
    Results, Schedule, run_all, run_cell as run_in_process, work, write_adapter,
};
use splitplane_lab::{LabError, Report};

use crate::args::{
    Engine, ExperimentArgs, ExperimentCommand, MergeCommand, PlanCommand, ReportCommand,
    RunCellCommand,
};
use crate::failure::Failure;
use crate::numbers::count;
use crate::print;
use crate::progress::{self, Bar};

pub fn run(command: &ExperimentCommand) -> Result<(), Failure> {
    let args = &command.file;
    let folder = folder_of(args);
    let planned_before = folder.plan().exists();
    if planned_before && !command.resume {
        return Err(Failure::input(format!(
            "{} holds an experiment already; go on with it by --resume, or name another folder by \
             --out",
            folder.path().display()
        )));
    }
    let bar = Bar::new(args.quiet, 0);
    // Before anything is made: a file that is wrong leaves no folder behind.
    let plan = make_plan(args, &bar)?;
    folder.create()?;
    let _lock = folder.lock()?;
    plan.write(&folder)?;
    let schedule = Schedule {
        jobs: match command.jobs {
            Some(jobs) => usize::from(jobs),
            None => std::thread::available_parallelism().map_or(1, usize::from),
        },
        retry_failed: command.retry_failed,
    };
    if planned_before && !args.quiet {
        let there = Results::read(&folder)?;
        let kept = there.plan.cells.len() - there.missing();
        print::note(&format!(
            "{kept} of {} are done already",
            count(plan.cells.len() as u64, "run")
        ));
    }
    progress::advise("no run that is done is lost; --resume goes on".to_owned());
    let program = this_program()?;
    let worker = |cell: &Cell| worker(&program, &folder, cell, &args.search.scenes);
    let events = Told { bar: &bar };
    let done = run_all(&plan, &folder, &worker, schedule, &events);
    progress::clear();
    if done.is_err() {
        print::note("no run that is done is lost; --resume goes on");
    }
    if !done? {
        return Err(Failure::Interrupted);
    }
    finish(&folder, args.quiet)
}

/// The bar, and failures as they come.
struct Told<'a> {
    bar: &'a Bar,
}

impl Events for Told<'_> {
    fn started(&self, cell: &Cell, remaining: Remaining) {
        self.bar.started(cell, remaining);
    }

    fn finished(&self, result: &CellResult, remaining: Remaining) {
        if let Outcome::Failed { reason, .. } = &result.outcome {
            print::warning(&failure(&result.cell, reason));
        }
        self.bar.finished(result, remaining);
    }
}

fn failure(cell: &Cell, reason: &str) -> String {
    format!(
        "{} with {}, repetition {}, failed: {reason}",
        cell.scene,
        cell.tree_with_k(),
        cell.repetition + 1
    )
}

pub fn plan(command: &PlanCommand) -> Result<(), Failure> {
    let folder = folder_of(&command.file);
    let bar = Bar::new(command.file.quiet, 0);
    let plan = make_plan(&command.file, &bar)?;
    progress::clear();
    folder.create()?;
    plan.write(&folder)?;
    let cells = plan.cells.len() as u64;
    let kind = match plan.cells.iter().any(|cell| cell.timed) {
        true => "timed, each on a machine of its own",
        false => "that only count",
    };
    print::line(&format!(
        "{} {kind}: {} of {}",
        count(cells, "run"),
        count(plan.trees.len() as u64, "tree"),
        count(plan.scenes.len() as u64, "scene"),
    ))?;
    print::line(&format!("plan: {}", folder.plan().display()))?;
    if let Some(engine) = command.adapter {
        let adapter = match engine {
            Engine::Hyperqueue => Adapter::HyperQueue,
            Engine::Slurm => Adapter::Slurm,
        };
        let script = write_adapter(adapter, &plan, &folder)?;
        print::line(&format!("script: {}", script.display()))?;
    }
    Ok(())
}

pub fn run_cell(command: &RunCellCommand) -> Result<(), Failure> {
    let folder = Folder::new(&command.folder);
    let plan = folder.read_plan()?;
    let cell = plan.cell(&command.cell)?;
    let search = &command.search.scenes;
    if command.worker {
        end_with_standard_input();
        let run = work(&plan, cell, &folder, search).map_err(|error| match error {
            LabError::Picture(_)
            | LabError::Write { .. }
            | LabError::Scene(_)
            | LabError::OtherScene { .. }
            | LabError::OtherProgram { .. } => Failure::NotAble(miette::miette!("{error}")),
            error => Failure::from(error),
        })?;
        let json = serde_json::to_string(&run).map_err(Failure::input)?;
        print::line(&json)?;
        return Ok(());
    }
    folder.create()?;
    let before = folder.read_result(cell)?.map(|result| result.outcome);
    match before {
        Some(Outcome::Done(_)) => {
            return Ok(print::line(&format!("{} is done already", cell.id))?);
        }
        Some(Outcome::Failed { .. }) if !command.retry_failed => {
            let text = format!("{} failed already; --retry-failed runs it again", cell.id);
            return Ok(print::line(&text)?);
        }
        _ => {}
    }
    let worker = worker(&this_program()?, &folder, cell, search);
    match run_in_process(&folder, cell, worker, &|| false)? {
        Ended::Interrupted => Err(Failure::Interrupted),
        Ended::Written(result) => {
            if let Outcome::Failed { reason, .. } = &result.outcome {
                print::warning(&failure(cell, reason));
            }
            let path = folder.result(&cell.id);
            print::line(&format!("result: {}", path.display()))?;
            Ok(())
        }
    }
}

pub fn merge(command: &MergeCommand) -> Result<(), Failure> {
    let folder = Folder::new(&command.folder);
    let plan = folder.read_plan()?;
    folder.create()?;
    for from in &command.from {
        match folder.gather(&plan, &Folder::new(from))? {
            Some(gathered) => print::line(&format!(
                "{} from {}",
                count(gathered as u64, "result"),
                from.display()
            ))?,
            None => print::warning(&format!("{} holds no result of this plan", from.display())),
        }
    }
    finish(&folder, false)
}

pub fn report(command: &ReportCommand) -> Result<(), Failure> {
    finish(&Folder::new(&command.folder), false)
}

/// Writes tables and report, and tells what there is to tell.
fn finish(folder: &Folder, quiet: bool) -> Result<(), Failure> {
    let results = Results::read(folder)?;
    let runs = results.runs().count();
    if runs == 0 && results.failed().count() == 0 {
        return Err(Failure::input(format!(
            "{} holds no results; `splitplane experiment --resume` or an engine runs the cells",
            folder.path().display()
        )));
    }
    results.write(folder.path())?;
    let written = Report::of_experiment(&results, folder)?.write(folder.path())?;
    let failed = results.failed().count();
    let mut summary = format!(
        "{} of {} done",
        runs,
        count(results.plan.cells.len() as u64, "run")
    );
    if failed > 0 {
        summary.push_str(&format!(", {failed} failed"));
    }
    if results.missing() > 0 {
        summary.push_str(&format!(", {} still to be run", results.missing()));
    }
    print::line(&summary)?;
    for (cell, reason) in results.failed() {
        print::line(&failure(cell, reason))?;
    }
    let disturbed = results
        .runs()
        .filter(|(cell, run)| cell.timed && run.record.was_disturbed())
        .count();
    if disturbed > 0 && !quiet {
        print::warning(&format!(
            "the machine was busy during {disturbed} of {}: times may mislead",
            count(runs as u64, "timed run")
        ));
    }
    for path in written {
        print::line(&format!("wrote {}", path.display()))?;
    }
    let variances: Vec<String> = results.variances().iter().map(|v| v.to_string()).collect();
    if variances.is_empty() {
        return Ok(());
    }
    Err(Failure::Difference(miette::miette!(
        "results differ that must not:\n{}",
        variances.join("\n")
    )))
}

fn folder_of(args: &ExperimentArgs) -> Folder {
    Folder::new(match &args.out {
        Some(out) => out.clone(),
        None => Path::new("out").join(args.file.file_stem().unwrap_or_default()),
    })
}

fn make_plan(args: &ExperimentArgs, bar: &Bar) -> Result<Plan, Failure> {
    let experiment = Experiment::read(&args.file, args.quick)?;
    let source = std::fs::read_to_string(&args.file).unwrap_or_default();
    let plan = Plan::new(
        &experiment,
        args.file.clone(),
        source,
        args.quick,
        &args.search.scenes,
        &|scene| bar.spin(format!("reading {scene}")),
    )?;
    if !args.quiet {
        plan.notes.iter().for_each(|note| print::note(note));
    }
    if plan.cells.is_empty() {
        return Err(Failure::input(format!(
            "{}: none of its scenes was found",
            args.file.display()
        )));
    }
    Ok(plan)
}

fn this_program() -> Result<PathBuf, Failure> {
    std::env::current_exe()
        .map_err(|error| Failure::input(format!("this program does not know its file: {error}")))
}

/// The command that runs a cell in a process of its own.
fn worker(program: &Path, folder: &Folder, cell: &Cell, search: &[PathBuf]) -> Command {
    let mut command = Command::new(program);
    command.arg("run-cell").arg("--worker");
    for folder in search {
        command.arg("--scenes").arg(folder);
    }
    command.arg(folder.path()).arg(&cell.id);
    command
}

/// Ends this process once its standard input ends: when the process is gone that holds the other
/// end, nobody waits for the result.
fn end_with_standard_input() {
    std::thread::spawn(|| {
        let mut buffer = [0; 64];
        while !matches!(std::io::stdin().lock().read(&mut buffer), Ok(0) | Err(_)) {}
        std::process::exit(130);
    });
}
