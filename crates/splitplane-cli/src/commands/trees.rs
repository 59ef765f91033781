//! `splitplane trees`.

use splitplane::{TREES, TreeSpec};

use crate::args::TreesCommand;
use crate::failure::Failure;
use crate::print;

pub fn run(_command: &TreesCommand) -> Result<(), Failure> {
    let header = ["tree", "in the thesis", "in .pbrt files", "k", "what it is"];
    let rows = TREES.iter().map(row).collect();
    let mut table = print::table(header.map(str::to_owned).to_vec(), rows);
    for column in table.column_iter_mut() {
        column.set_cell_alignment(comfy_table::CellAlignment::Left);
    }
    print::line(&table.trim_fmt())?;
    Ok(())
}

fn row(spec: &TreeSpec) -> Vec<String> {
    let (name, range) = match spec.direction_counts() {
        Some((min, max)) => (format!("{}:k", spec.name), format!("{min} to {max}")),
        None => (spec.name.to_owned(), String::new()),
    };
    [
        name,
        spec.thesis_name.to_owned(),
        spec.pbrt_name.to_owned(),
        range,
        spec.summary.to_owned(),
    ]
    .to_vec()
}
