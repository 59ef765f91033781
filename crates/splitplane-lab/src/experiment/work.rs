//! One cell, run in this process.

use std::path::PathBuf;

use splitplane_render::output::write_exr;

use super::cell::{Cell, Program};
use super::folder::Folder;
use super::plan::Plan;
use crate::LabError;
use crate::run::{Run, Timing, measure};

/// Runs a cell of the plan in this process. What each pixel cost goes into the folder, where the
/// cell asks for it; the result does not.
///
/// # Errors
/// The plan is another program's, the scene is another, or the run fails.
pub fn work(
    plan: &Plan,
    cell: &Cell,
    folder: &Folder,
    search: &[PathBuf],
) -> Result<Run, LabError> {
    let program = Program::this();
    if plan.program != program {
        return Err(LabError::OtherProgram {
            planned: format!("{} ({})", plan.program.version, plan.program.commit),
            this: format!("{} ({})", program.version, program.commit),
        });
    }
    let planned = plan.scene(&cell.scene)?;
    let scene = planned.load(&[search, &plan.search].concat())?;
    let conditions = |message| LabError::Conditions {
        scene: cell.scene.clone(),
        message,
    };
    let settings = (cell.conditions)
        .settings((scene.film.width, scene.film.height))
        .map_err(conditions)?;
    let tree = cell
        .choice()
        .map_err(|error| conditions(error.to_string()))?;
    let timing = match cell.timed {
        true => Timing::Alone,
        false => Timing::WhileCounting,
    };
    let (run, picture) = measure(&scene, tree, &settings, cell.repetition, timing)?;
    if cell.picture {
        write_exr(&folder.pixels(&cell.id), &picture)?;
    }
    Ok(run)
}
