//! `splitplane reproduce`.

use std::io::Write;
use std::path::Path;

use splitplane::{Ties, Traversal};
use splitplane_lab::{
    Figure, FigureLine, FigureTable, LabError, Measured, Preset, QUANTITIES, Record, Settings,
    figure_tables, reproduce, reproduction_steps, ties_name, traversal_name, trees_of_the_thesis,
    write_whole,
};

use crate::args::ReproduceCommand;
use crate::failure::{Failure, writable_place, writable_places};
use crate::numbers::{count, grouped, measured};
use crate::progress::{self, Bar};
use crate::{print, scene};

/// A deviation from a published figure that is worth a mark.
const NOTABLE: f64 = 0.1;

pub fn run(command: &ReproduceCommand) -> Result<(), Failure> {
    if let Some(out) = &command.out {
        writable_place(out, [Path::new(&command.scene)])?;
    }
    let trees = match command.trees.as_slice() {
        [] => trees_of_the_thesis(),
        trees => trees.to_vec(),
    };
    let quiet = command.general.quiet;
    let bar = Bar::new(quiet, reproduction_steps(trees.len()));
    bar.spin(format!("reading {}", command.scene));
    let scene = scene::load_named(&command.scene, &command.load, quiet)?;
    writable_places(&command.out, &scene)?;
    let mut settings = Settings::of_preset(Preset::Thesis);
    settings.params.seed = command.seed;
    settings.render.threads = command.general.threads();
    settings.render.samples_per_pixel = Some(command.spp);
    let size = (scene.film.width, scene.film.height);
    settings.render.resolution = Some(command.resolution.of(size));

    let found = reproduce(&scene, &trees, &settings, &bar)?;
    progress::clear();
    let Some(first) = found.first() else {
        return Err(Failure::input("--trees names no tree"));
    };
    let tables = figure_tables(&found);
    let markdown = || {
        let mut text = format!("{}\n", conditions(&first.record));
        for table in &tables {
            text.push_str(&format!("\n### {}\n\n{}\n", title(table), markdown(table)));
        }
        text
    };
    if command.markdown {
        print::line(markdown().trim_end())?;
    } else {
        print::line(&conditions(&first.record))?;
        for table in &tables {
            let rows = table_rows(table);
            let text = print::table(header(table), rows).trim_fmt();
            print::line(&format!("\n{}\n{text}", title(table)))?;
        }
    }
    if let Some(out) = &command.out {
        let written = write_whole(out, |file| file.write_all(markdown().as_bytes()));
        written.map_err(|source| LabError::Write {
            path: out.clone(),
            source,
        })?;
        print::line(&format!("wrote {}", out.display()))?;
    }
    check_pictures(&found)
}

/// What was measured, and how to read the tables.
fn conditions(record: &Record) -> String {
    format!(
        "{}, {}: {} x {} pixels, {} of them rendered, {} per pixel; {} camera, {} bounce and {} \
         shadow rays. The thesis's parameters, seed {}. The line of counts holds absolute figures; \
         all others are per cent of it. Closest: camera and bounce rays. Visits: interior nodes \
         and leaves. ▲ ▼: more than {} % above or below the first figure that was published. \
         Wrong: pixels that differ from those of the exact traversal.",
        record.scene,
        count(record.triangles, "triangle"),
        record.width,
        record.height,
        grouped(record.pixels),
        count(record.spp.into(), "sample"),
        grouped(record.rays.camera),
        grouped(record.rays.bounce),
        grouped(record.rays.shadow),
        record.seed,
        100.0 * NOTABLE,
    )
}

fn title(table: &FigureTable) -> String {
    let ties = match table.ties {
        Ties::AsPublished => "Ties as published",
        Ties::Tolerant => "Tolerant ties",
    };
    let mut title = format!(
        "{ties}, {} traversal: ours",
        traversal_name(table.traversal)
    );
    for source in &table.sources {
        title.push_str(&format!(" / {source}"));
    }
    title
}

fn header(table: &FigureTable) -> Vec<String> {
    let mut header = vec!["tree".to_owned()];
    header.extend(QUANTITIES.map(str::to_owned));
    if table.traversal != Traversal::Exact {
        header.push("wrong".to_owned());
    }
    header
}

fn table_rows(table: &FigureTable) -> Vec<Vec<String>> {
    let row = |line: &FigureLine, name: String, number: fn(f64) -> String| {
        let mut row = vec![name];
        row.extend(line.figures.iter().map(|figure| cell(figure, number)));
        if table.traversal != Traversal::Exact {
            row.push(grouped(line.wrong_pixels as u64));
        }
        row
    };
    let measure = format!("{}, counts", table.measure.tree);
    let mut rows = vec![row(&table.measure, measure, large)];
    let percent = |line: &FigureLine| row(line, line.tree.to_string(), |p| format!("{p:.1}"));
    rows.extend(table.lines.iter().map(percent));
    rows
}

/// Ours, and what was published.
fn cell(figure: &Figure, number: fn(f64) -> String) -> String {
    let mark = match figure.deviation {
        Some(deviation) if deviation > NOTABLE => " ▲",
        Some(deviation) if deviation < -NOTABLE => " ▼",
        _ => "",
    };
    let mut text = format!("{}{mark}", number(figure.ours));
    for published in &figure.published {
        text.push_str(" / ");
        text.push_str(&published.map_or("–".to_owned(), number));
    }
    text
}

/// A count or a cost; millions from ten of them.
fn large(number: f64) -> String {
    match number {
        n if n >= 1e6 => format!("{:.2} M", n / 1e6),
        n if n >= 1e4 => grouped(n.round() as u64),
        n => measured(n),
    }
}

fn markdown(table: &FigureTable) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let header = header(table);
    let rules = vec!["---".to_owned(); header.len()];
    let mut text = line(header) + &line(rules).replacen("---", ":--", 1);
    text.extend(table_rows(table).into_iter().map(line));
    text
}

/// With the exact traversal all trees must give the same picture.
fn check_pictures(found: &[Measured]) -> Result<(), Failure> {
    let exact = |m: &&Measured| m.traversal == Traversal::Exact && m.wrong_pixels > 0;
    let told: Vec<String> = (found.iter().filter(exact))
        .map(|m| {
            format!(
                "the picture with {} (ties {}, exact traversal) differs in {} pixels from the first",
                m.tree,
                ties_name(m.ties),
                m.wrong_pixels
            )
        })
        .collect();
    if told.is_empty() {
        return Ok(());
    }
    Err(Failure::Difference(miette::miette!("{}", told.join("\n"))))
}
