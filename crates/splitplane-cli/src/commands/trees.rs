//! `splitplane trees`.

use comfy_table::{CellAlignment, Table};
use splitplane::{TREES, TreeChoice, TreeSpec};

use super::tree_page;
use crate::args::TreesCommand;
use crate::failure::Failure;
use crate::print;

pub fn run(command: &TreesCommand) -> Result<(), Failure> {
    let text = match command.tree {
        Some(choice) => page(choice),
        None => list(),
    };
    print::line(&text)?;
    Ok(())
}

fn list() -> String {
    let header = ["tree", "in the thesis", "in .pbrt files", "k", "what it is"];
    let rows = TREES.iter().map(row).collect();
    let mut table = print::table(header.map(str::to_owned).to_vec(), rows);
    left(&mut table);
    table.trim_fmt()
}

fn left(table: &mut Table) {
    for column in table.column_iter_mut() {
        column.set_cell_alignment(CellAlignment::Left);
    }
}

fn row(spec: &TreeSpec) -> Vec<String> {
    let range = match spec.direction_counts() {
        Some((min, max)) => format!("{min} to {max}"),
        None => String::new(),
    };
    [
        tree_page::name_with_k(spec),
        spec.thesis_name.to_owned(),
        spec.pbrt_name.to_owned(),
        range,
        spec.summary.to_owned(),
    ]
    .to_vec()
}

/// Lines of prose are no wider, whatever the terminal.
const WIDEST: u16 = 100;

fn page(choice: TreeChoice) -> String {
    let spec = choice.spec;
    let header = vec![tree_page::name_with_k(spec), spec.summary.to_owned()];
    let rows = tree_page::sections(choice).into_iter();
    let rows = rows.map(|(heading, text)| vec![heading.to_owned(), text]);
    let mut table = print::table(header, rows.collect());
    left(&mut table);
    let width = table.width().map_or(WIDEST, |width| width.min(WIDEST));
    table.set_width(width);
    let mut text = table.trim_fmt();
    text.push_str("\n\nTo use it:");
    for command in tree_page::commands(choice) {
        text.push_str("\n  ");
        text.push_str(&command);
    }
    text.push_str("\n  In a .pbrt file: ");
    text.push_str(&tree_page::directive(choice));
    text
}
