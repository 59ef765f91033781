//! The command `splitplane`: parses what is asked, has it done, prints what came of it.

#![forbid(unsafe_code)]
#![expect(unreachable_pub, reason = "a binary has no outside")]

mod args;
mod commands;
mod failure;
mod print;
mod progress;
mod scene;

use std::process::ExitCode;

use clap::Parser;
use splitplane_lab::experiment::NOT_ABLE;
use splitplane_lab::numbers;

use args::{Cli, Command};
use failure::Failure;

fn main() -> ExitCode {
    // Ends the process at once: files are moved to their place when they are whole, so nothing
    // half done stays.
    let handled = ctrlc::set_handler(|| {
        progress::interrupted();
        std::process::exit(130);
    });
    if let Err(error) = handled {
        print::warning(&format!("Ctrl-C is not handled: {error}"));
    }
    // clap prints help and its own errors, and exits with 0 and 2.
    let done = match Cli::parse().command {
        Command::Render(command) => commands::render::run(&command),
        Command::Check(command) => commands::check::run(&command),
        Command::Build(command) => commands::build::run(&command),
        Command::Compare(command) => commands::compare::run(&command),
        Command::Reproduce(command) => commands::reproduce::run(&command),
        Command::Experiment(command) => commands::experiment::run(&command),
        Command::Plan(command) => commands::experiment::plan(&command),
        Command::RunCell(command) => commands::experiment::run_cell(&command),
        Command::Merge(command) => commands::experiment::merge(&command),
        Command::Report(command) => commands::experiment::report(&command),
        Command::Cast(command) => commands::cast::run(&command),
        Command::Slice(command) => commands::slice::run(&command),
        Command::Verify(command) => commands::verify::run(&command),
        Command::Trees(command) => commands::trees::run(&command),
        Command::Scenes(command) => commands::scenes::run(&command),
    };
    progress::clear();
    match done {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read our output has read enough.
        Err(Failure::BrokenPipe) => ExitCode::SUCCESS,
        Err(Failure::Difference(report)) => {
            print::error(report);
            ExitCode::from(1)
        }
        Err(Failure::Input(report)) => {
            print::error(report);
            ExitCode::from(2)
        }
        Err(Failure::NotAble(report)) => {
            print::error(report);
            ExitCode::from(NOT_ABLE)
        }
        Err(Failure::Interrupted) => {
            progress::interrupted();
            ExitCode::from(130)
        }
    }
}
