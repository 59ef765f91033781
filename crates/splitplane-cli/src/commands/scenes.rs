//! `splitplane scenes`.

use crate::args::ScenesCommand;
use crate::failure::Failure;

pub fn run(_command: &ScenesCommand) -> Result<(), Failure> {
    Ok(())
}
