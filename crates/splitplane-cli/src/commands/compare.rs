//! `splitplane compare`.

use std::path::PathBuf;

use splitplane::{Layout, Traversal, TreeChoice};
use splitplane_lab::experiment::SceneFacts;
use splitplane_lab::{
    Comparison, Difference, Layouts, Preset, Quantity, Record, Report, Row, compare,
    peak_memory_bytes, rows, shared_scale, write_records,
};
use splitplane_render::output::{write_exr, write_false_colour, write_png};

use crate::args::{CompareCommand, layout};
use crate::failure::{Failure, writable_folder, writable_place, writable_places};
use crate::numbers::{bytes, count, grouped, percent};
use crate::progress::{self, Bar};
use crate::{print, scene};

pub fn run(command: &CompareCommand) -> Result<(), Failure> {
    let trees = &command.trees;
    for (i, tree) in trees.iter().enumerate() {
        if trees[..i].contains(tree) {
            return Err(Failure::input(format!("--trees names {tree} twice")));
        }
    }
    writable_folder(&command.out.out)?;
    if let Some(json) = &command.json {
        writable_place(json, [command.scene.file()])?;
    }
    let quiet = command.general.quiet;
    let mut settings = command.build.settings(Preset::Thesis, &command.general);
    settings.layouts = Layouts {
        timed: layout(command.layout, settings.traversal),
        counted: command.layout.unwrap_or(Layout::Binary),
    };
    let steps = trees.len() * (2 * command.repeat as usize + 1);
    let bar = Bar::new(quiet, steps);
    bar.spin(format!("reading {}", command.scene.scene));
    let scene = scene::load(&command.scene, command.instances.how(), quiet)?;
    let places = Places {
        command,
        scene: scene::file_name(&scene.name),
    };
    writable_places(places.all(), &scene)?;
    command
        .picture
        .apply(&mut settings.render, (scene.film.width, scene.film.height));

    let found = compare(&scene, trees, &settings, command.repeat, &bar)?;
    progress::clear();
    let Some(first) = found.records.first() else {
        return Err(Failure::input("--trees names no tree"));
    };
    let disturbed = found.records.iter().filter(|r| r.was_disturbed()).count();
    if disturbed > 0 && !quiet {
        print::warning(&format!(
            "the machine was busy with other work during {disturbed} of {}: times may mislead",
            count(found.records.len() as u64, "run")
        ));
    }

    print::line(&conditions(first, command.repeat))?;
    let (names, rows) = rows(&found.records);
    print::line(&table(&names, &rows))?;

    let mut written = write(&places, &found)?;
    if command.report {
        let again = std::env::args().skip(1).collect::<Vec<_>>().join(" ");
        let told = found.differences.iter().map(told).collect();
        let facts = SceneFacts::of(&scene);
        let report = Report::of_comparison(&found, facts, format!("splitplane {again}"), told);
        let paths = report.write(&command.out.out)?;
        written.extend(paths.into_iter().map(|path| ("report", path)));
    }
    for deviation in &found.deviations {
        print::line(&told(deviation))?;
    }
    if found.differences.is_empty() && settings.traversal == Traversal::Exact {
        let renderings = found.records.len() + found.trees.len();
        print::line(&format!(
            "The pictures of all {renderings} renderings are identical, bit by bit."
        ))?;
    }
    if let Some(peak) = peak_memory_bytes() {
        print::line(&format!("Peak memory: {}", bytes(peak)))?;
    }
    for (what, path) in written {
        print::line(&format!("{what}: {}", path.display()))?;
    }
    match found.differences.as_slice() {
        [] => Ok(()),
        differences => Err(Failure::Difference(miette::miette!(
            "{}",
            differences.iter().map(told).collect::<Vec<_>>().join("\n")
        ))),
    }
}

/// What was measured, and how.
fn conditions(record: &Record, repeat: u32) -> String {
    let depth = match record.max_depth {
        Some(depth) => format!(", {} to depth {depth}", record.integrator),
        None => format!(", {}", record.integrator),
    };
    let crop = if record.crop == [0.0, 1.0, 0.0, 1.0] {
        String::new()
    } else {
        format!(", {} of them rendered", grouped(record.pixels))
    };
    let layouts = match (&*record.layout, &*record.counts_layout) {
        (timed, counted) if timed == counted => format!("timed and counted in the {timed} layout"),
        (timed, counted) => format!("timed in the {timed} layout, counted in the {counted} one"),
    };
    format!(
        "{}: {}, {} x {} pixels{crop}, {} per pixel{depth}\n\
         {} parameters, {}, traversal {}, seed {}, {}, {}\n\
         {layouts}\n\
         rays: {} camera, {} bounce, {} shadow",
        record.scene,
        count(record.triangles, "triangle"),
        record.width,
        record.height,
        count(record.spp.into(), "sample"),
        record.preset,
        record.build_params.ways(),
        record.traversal,
        record.seed,
        count(record.threads as u64, "thread"),
        if repeat == 1 {
            "one run".to_owned()
        } else {
            format!("medians of {repeat} interleaved runs")
        },
        grouped(record.rays.camera),
        grouped(record.rays.bounce),
        grouped(record.rays.shadow),
    )
}

fn table(trees: &[String], rows: &[Row]) -> String {
    let mut header = vec![String::new()];
    for tree in trees {
        header.push(tree.clone());
    }
    let cells = rows.iter().map(|row| {
        let indent = if row.part { "  " } else { "" };
        let mut cells = vec![format!("{indent}{}", row.label)];
        for (i, &value) in row.values.iter().enumerate() {
            let share = row.percent(i).map_or("–".to_owned(), percent);
            let value = row.unit.text(value);
            cells.push(format!("{value} {share:>9}"));
        }
        cells
    });
    print::table(header, cells.collect()).trim_fmt()
}

/// Where files are written.
struct Places<'a> {
    command: &'a CompareCommand,
    /// Its name, as files have it.
    scene: String,
}

impl Places<'_> {
    fn of_scene(&self, rest: &str) -> PathBuf {
        (self.command.out.out).join(format!("{}{rest}", self.scene))
    }

    fn of_tree(&self, tree: TreeChoice, rest: &str) -> PathBuf {
        self.of_scene(&format!("-{}{rest}", scene::file_name(&tree.to_string())))
    }

    fn json(&self) -> PathBuf {
        match &self.command.json {
            Some(path) => path.clone(),
            None => self.of_scene(".json"),
        }
    }

    fn picture(&self) -> PathBuf {
        self.of_scene(".png")
    }

    fn samples(&self, tree: TreeChoice) -> PathBuf {
        self.of_tree(tree, ".exr")
    }

    fn false_colour(&self, tree: TreeChoice, quantity: Quantity) -> PathBuf {
        self.of_tree(tree, &format!("-{}.png", quantity.file_label()))
    }

    fn all(&self) -> Vec<PathBuf> {
        let of_tree = |&tree: &TreeChoice| {
            let colours = Quantity::ALL.into_iter();
            let colours = colours.map(move |quantity| self.false_colour(tree, quantity));
            colours.chain([self.samples(tree)])
        };
        let trees = self.command.trees.iter().flat_map(of_tree);
        trees.chain([self.json(), self.picture()]).collect()
    }
}

/// Writes pictures and records; says what went where.
fn write(places: &Places, found: &Comparison) -> Result<Vec<(&'static str, PathBuf)>, Failure> {
    // The records first: they cannot be had again at the same price.
    let mut written = Vec::new();
    let json = places.json();
    write_records(&json, &found.records)?;
    written.push(("records", json));
    if let Some(first) = found.trees.first() {
        let path = places.picture();
        write_png(&path, &first.rendered)?;
        written.push(("picture", path));
    }
    for tree in &found.trees {
        let path = places.samples(tree.choice);
        write_exr(&path, &tree.rendered)?;
        written.push(("picture and counters", path));
    }
    for quantity in Quantity::ALL {
        let values: Vec<Vec<f32>> = found
            .trees
            .iter()
            .map(|tree| quantity.per_sample(&tree.rendered))
            .collect();
        let end = shared_scale(&values);
        for (tree, values) in found.trees.iter().zip(&values) {
            let (tree, picture) = (tree.choice, &tree.rendered);
            let path = places.false_colour(tree, quantity);
            let label = format!("{} per sample, {tree}", quantity.label());
            let size = (picture.width, picture.height);
            write_false_colour(&path, values, size, Some(end), &label)?;
            written.push((quantity.label(), path));
        }
    }
    Ok(written)
}

fn told(difference: &Difference) -> String {
    match difference {
        Difference::Picture {
            tree,
            repetition,
            counted,
            pixels,
            first: (x, y),
        } => format!(
            "the picture with {tree} (repetition {}{}) differs in {pixels} pixels from the first, \
             first at column {x}, row {y}",
            repetition + 1,
            if *counted { ", counting" } else { "" },
        ),
        Difference::Tree { tree, repetition } => format!(
            "{tree} was another tree when it was built again (repetition {})",
            repetition + 1
        ),
    }
}
