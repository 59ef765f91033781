//! `splitplane verify`.

use splitplane::{TREES, TreeChoice, TreeSpec};
use splitplane_lab::verify::{LeakTable, probe_sets, probe_sets_of, verify};
use splitplane_lab::{ParamsRecord, Preset, traversal_name};

use crate::args::VerifyCommand;
use crate::failure::Failure;
use crate::numbers::{count, grouped};
use crate::progress::{self, Bar};
use crate::{print, scene};

pub fn run(command: &VerifyCommand) -> Result<(), Failure> {
    let quiet = command.general.quiet;
    let bar = Bar::new(quiet, 1);
    let sets = match &command.scene {
        None => probe_sets(),
        Some(name) => {
            bar.spin(format!("reading {name}"));
            probe_sets_of(&scene::load_named(name, &command.load, quiet)?.mesh)
        }
    };
    let trees = match command.trees.as_slice() {
        [] => all_trees(),
        trees => trees.to_vec(),
    };
    let settings = command.build.settings(Preset::Default, &command.general);
    bar.spin("casting rays".to_owned());
    let table = verify(sets, &trees, command.rays, &settings, &bar)?;
    progress::clear();

    let mut header = vec!["tree".to_owned()];
    header.extend(table.sets.iter().map(|set| set.name().to_owned()));
    let rows: Vec<Vec<String>> = table
        .rows
        .iter()
        .map(|row| {
            let cells = row.leaks.iter().map(ToString::to_string);
            std::iter::once(row.name.clone()).chain(cells).collect()
        })
        .collect();
    let conditions = format!(
        "{} of each set; {}, {} traversal, seed {}.",
        count(table.rays, "ray"),
        ParamsRecord::from(&settings.params).ways(),
        traversal_name(settings.traversal),
        settings.params.seed,
    );
    print::line(&conditions)?;
    for text in partly(&table) {
        print::line(&text)?;
    }
    print::line("")?;
    if command.markdown {
        print::line(markdown(header, rows).trim_end())?;
    } else {
        print::line(&print::table(header, rows).trim_fmt())?;
    }
    print::line("")?;
    for set in &table.sets {
        let item = if command.markdown { "* " } else { "" };
        print::line(&format!("{item}{}: {}", set.name(), set.summary()))?;
    }
    if table.is_tight() {
        return Ok(());
    }
    Err(Failure::Difference(miette::miette!(
        "answers are wrong; each would be a hole in a picture"
    )))
}

fn all_trees() -> Vec<TreeChoice> {
    let choice = |spec: &TreeSpec| TreeChoice::new(spec.name, None).ok();
    TREES.iter().filter_map(choice).collect()
}

/// Which sets were not wholly tested by brute force.
fn partly(table: &LeakTable) -> Vec<String> {
    let sets = table.sets.iter().zip(&table.by_brute_force);
    sets.filter(|(_, tested)| **tested < table.rays)
        .map(|(set, &tested)| {
            format!(
                "{}: {} of them by brute force, the others by the nearest hit of all trees.",
                set.name(),
                grouped(tested)
            )
        })
        .collect()
}

fn markdown(header: Vec<String>, rows: Vec<Vec<String>>) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let mut rules = vec!["--:".to_owned(); header.len()];
    rules[0] = ":--".to_owned();
    let mut text = line(header) + &line(rules);
    text.extend(rows.into_iter().map(line));
    text
}
