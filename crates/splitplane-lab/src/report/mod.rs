//! The report: one page that holds all, and its tables, plots and pictures as files beside it.

mod group;
mod measures;
mod page;
mod pixels;
mod plot;
mod plots;

use std::path::{Path, PathBuf};

use serde_json::Map;
use splitplane_render::output::write_false_colour;

use crate::LabError;
use crate::compare::Comparison;
use crate::experiment::{Folder, Program, Results, SceneFacts, write_file};
use crate::pictures::{Quantity, shared_scale};
use crate::run::{LeafSizeRecord, Run};
use group::{Entry, Group};
use pixels::Pixels;

/// What a page and its files are made of.
#[derive(Debug)]
pub struct Report {
    title: String,
    description: String,
    groups: Vec<Group>,
    scenes: Vec<(String, SceneFacts)>,
    galleries: Vec<Gallery>,
    status: Status,
    method: Method,
}

/// Whether all went well.
#[derive(Debug, Default)]
struct Status {
    planned: usize,
    done: usize,
    /// What failed, and why.
    failed: Vec<(String, String)>,
    variances: Vec<String>,
    notes: Vec<String>,
}

/// What it takes to do it again.
#[derive(Debug)]
struct Method {
    program: Program,
    command: String,
    /// The file of the experiment, and its text.
    source: Option<(String, String)>,
}

/// The pictures of a group's trees.
#[derive(Debug)]
struct Gallery {
    /// Which group.
    group: usize,
    /// Trees and what their pixels cost.
    trees: Vec<(String, Pixels)>,
    /// For each of [`Quantity::ALL`], the end of the trees' common scale.
    ends: Vec<f32>,
}

impl Gallery {
    fn new(group: usize, trees: Vec<(String, Pixels)>) -> Gallery {
        let end = |quantity: usize| {
            let values: Vec<Vec<f32>> = (trees.iter())
                .map(|(_, pixels)| pixels.quantities[quantity].clone())
                .collect();
            shared_scale(&values)
        };
        Gallery {
            group,
            ends: (0..Quantity::ALL.len()).map(end).collect(),
            trees,
        }
    }

    /// The end of a tree's own scale.
    fn own_end(pixels: &Pixels, quantity: usize) -> f32 {
        shared_scale(&pixels.quantities[quantity..=quantity])
    }
}

impl Report {
    /// The report of an experiment's results; what pixels cost is read from its folder.
    ///
    /// # Errors
    /// A file of the folder is damaged or cannot be read.
    pub fn of_experiment(results: &Results, folder: &Folder) -> Result<Report, LabError> {
        let plan = &results.plan;
        let mut entries = Vec::new();
        for (cell, run) in results.runs() {
            let Ok(tree) = cell.choice() else { continue };
            entries.push(Entry {
                scene: cell.scene.clone(),
                conditions: cell.conditions.fields(),
                tree,
                timed: cell.timed,
                id: cell.id.clone(),
                run: run.clone(),
            });
        }
        let mut groups = Group::all(entries);
        for group in &mut groups {
            let place = |tree: &str| plan.trees.iter().position(|other| other == tree);
            (group.points).sort_by_key(|point| place(&point.tree.to_string()));
        }
        let mut galleries = Vec::new();
        for (i, group) in groups.iter().enumerate() {
            let mut trees = Vec::new();
            for point in &group.points {
                let path = folder.pixels(&point.id);
                if path.exists() {
                    let samples = point.runs[0].record.spp;
                    trees.push((point.tree.to_string(), Pixels::read(&path, samples)?));
                }
            }
            if !trees.is_empty() {
                galleries.push(Gallery::new(i, trees));
            }
        }
        let told = |cell: &crate::experiment::Cell| {
            let tree = cell.tree_with_k();
            format!("{}, {tree}, repetition {}", cell.scene, cell.repetition + 1)
        };
        let quick = if plan.quick { " --quick" } else { "" };
        let file = plan.file.display().to_string();
        let quick_note = plan.quick.then(|| {
            "This is the quick run of the experiment, with what the table [quick] of its file puts in \
             place of the rest: it shows what the experiment measures. Figures for a text come from \
             the full one."
                .to_owned()
        });
        Ok(Report {
            title: match plan.quick {
                true => format!("{}, in short", plan.title),
                false => plan.title.clone(),
            },
            description: plan.description.clone(),
            groups,
            scenes: (plan.scenes.iter())
                .map(|scene| (scene.label.clone(), scene.facts.clone()))
                .collect(),
            galleries,
            status: Status {
                planned: plan.cells.len(),
                done: results.runs().count(),
                failed: results
                    .failed()
                    .map(|(cell, reason)| (told(cell), reason.to_owned()))
                    .collect(),
                variances: results.variances().iter().map(|v| v.to_string()).collect(),
                notes: (quick_note.iter().cloned().chain(plan.notes.iter().cloned())).collect(),
            },
            method: Method {
                program: plan.program.clone(),
                command: format!("splitplane experiment {file}{quick}"),
                source: Some((file, plan.source.clone())),
            },
        })
    }

    /// The report of a comparison, which `command` does again. `differences` are what it found, in
    /// words.
    pub fn of_comparison(
        found: &Comparison,
        facts: SceneFacts,
        command: String,
        differences: Vec<String>,
    ) -> Report {
        let mut entries = Vec::new();
        for record in &found.records {
            let of_tree = found
                .trees
                .iter()
                .find(|tree| tree.choice.to_string() == record.tree_with_k());
            let Some(tree) = of_tree else { continue };
            entries.push(Entry {
                scene: record.scene.clone(),
                conditions: Map::new(),
                tree: tree.choice,
                timed: true,
                id: String::new(),
                run: Run {
                    record: record.clone(),
                    card: tree.card.clone(),
                    tests_by_leaf_size: LeafSizeRecord::of(&tree.rendered),
                    picture: String::new(),
                    picture_timed: None,
                    seconds: 0.0,
                },
            });
        }
        let groups = Group::all(entries);
        let trees = (found.trees.iter())
            .map(|tree| (tree.choice.to_string(), Pixels::of(&tree.rendered)))
            .collect();
        let runs = found.records.len();
        Report {
            title: format!("Trees on {}", facts.name),
            description: String::new(),
            groups,
            scenes: vec![(facts.name.clone(), facts)],
            galleries: vec![Gallery::new(0, trees)],
            status: Status {
                planned: runs,
                done: runs,
                variances: differences,
                ..Status::default()
            },
            method: Method {
                program: Program::this(),
                command,
                source: None,
            },
        }
    }

    /// Writes `report.html` into the folder, `plots/*.svg`, `tables/*.csv` and `pictures/*.png`;
    /// returns what was written, folders as one.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, LabError> {
        let made = |name: &str| {
            let path = folder.join(name);
            std::fs::create_dir_all(&path).map_err(|source| LabError::Write {
                path: path.clone(),
                source,
            })?;
            Ok::<_, LabError>(path)
        };
        let mut written = Vec::new();
        let plots = made("plots")?;
        let of_groups = self.groups.iter().flat_map(plots::of_group);
        for plot in of_groups.chain(plots::over_sizes(&self.groups)) {
            if let Some(svg) = plot.svg() {
                write_file(&plots.join(format!("{}.svg", plot.key)), svg.as_bytes())?;
            }
        }
        let tables = made("tables")?;
        for group in &self.groups {
            let csv = page::table_csv(group)?;
            write_file(&tables.join(format!("{}.csv", group.slug())), &csv)?;
        }
        if !self.galleries.is_empty() {
            let pictures = made("pictures")?;
            for gallery in &self.galleries {
                self.write_pictures(gallery, &pictures)?;
            }
            written.push(pictures);
        }
        let page = folder.join("report.html");
        write_file(&page, page::html(self)?.as_bytes())?;
        written.extend([plots, tables, page]);
        Ok(written)
    }

    /// False colour with the trees' common scale, and with each tree's own.
    fn write_pictures(&self, gallery: &Gallery, folder: &Path) -> Result<(), LabError> {
        let scene = self.groups[gallery.group].slug();
        for (tree, pixels) in &gallery.trees {
            for (i, quantity) in Quantity::ALL.iter().enumerate() {
                let scales = [
                    ("common-scale", gallery.ends[i]),
                    ("own-scale", Gallery::own_end(pixels, i)),
                ];
                for (scale, end) in scales {
                    let name = format!(
                        "{scene}-{}-{}-{scale}.png",
                        tree.replace(':', "-"),
                        quantity.file_label()
                    );
                    let label = format!("{} per sample, {tree}", quantity.label());
                    let size = (pixels.width, pixels.height);
                    let values = &pixels.quantities[i];
                    write_false_colour(&folder.join(name), values, size, Some(end), &label)?;
                }
            }
        }
        Ok(())
    }
}
