//! What came of an experiment, and whether it holds together.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use serde_json::Value;

use super::cell::Cell;
use super::folder::{CellResult, Folder, Outcome};
use super::plan::Plan;
use crate::run::Run;
use crate::{LabError, write_whole};

/// The results of an experiment, each cell once.
#[derive(Clone, Debug)]
pub struct Results {
    /// The plan.
    pub plan: Plan,
    /// The results that there are, in the plan's order.
    pub results: Vec<CellResult>,
}

/// Results that differ although they must be the same.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variance {
    /// The scene, by its label.
    pub scene: String,
    /// The tree with its number of directions.
    pub tree: String,
    /// Which repetition, from 0.
    pub repetition: u32,
    /// What differs, and from what.
    pub what: String,
}

impl std::fmt::Display for Variance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}, {}, repetition {}: {}",
            self.scene,
            self.tree,
            self.repetition + 1,
            self.what
        )
    }
}

impl Results {
    /// Reads what there is in the folder.
    ///
    /// # Errors
    /// A file is damaged or cannot be read.
    pub fn read(folder: &Folder) -> Result<Results, LabError> {
        let plan = folder.read_plan()?;
        let read = |cell| folder.read_result(cell).transpose();
        let results = plan
            .cells
            .iter()
            .filter_map(read)
            .collect::<Result<_, _>>()?;
        Ok(Results { plan, results })
    }

    /// The runs that came to their end, with their cells.
    pub fn runs(&self) -> impl Iterator<Item = (&Cell, &Run)> {
        let run = |result: &'_ CellResult| -> Option<()> { result.outcome.run().map(|_| ()) };
        self.results
            .iter()
            .filter(move |result| run(result).is_some())
            .filter_map(|result| Some((&result.cell, result.outcome.run()?)))
    }

    /// The cells that failed, with the reasons.
    pub fn failed(&self) -> impl Iterator<Item = (&Cell, &str)> {
        self.results
            .iter()
            .filter_map(|result| match &result.outcome {
                Outcome::Failed { reason, .. } => Some((&result.cell, reason.as_str())),
                Outcome::Done(_) => None,
            })
    }

    /// How many cells have no result yet.
    pub fn missing(&self) -> usize {
        self.plan.cells.len() - self.results.len()
    }

    /// Where results differ that must not: repetitions that counted otherwise, trees with other
    /// pictures.
    pub fn variances(&self) -> Vec<Variance> {
        variances(
            self.runs()
                .map(|(cell, run)| (cell.scene.as_str(), cell.conditions.fields(), run)),
        )
    }

    /// Writes `results.json`, all results, and `results.csv`, a line for each, into the folder.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), LabError> {
        let json = serde_json::to_vec_pretty(&self.results).map_err(LabError::json)?;
        write_file(&folder.join("results.json"), &json)?;
        write_file(&folder.join("results.csv"), &self.csv()?)
    }

    /// A line for each result. Columns are the fields of the record; those of a part have its name
    /// before a dot.
    fn csv(&self) -> Result<Vec<u8>, LabError> {
        let mut lines: Vec<BTreeMap<String, String>> = Vec::new();
        let mut columns: Vec<String> = Vec::new();
        for result in &self.results {
            let cell = &result.cell;
            let head = serde_json::json!({
                "cell": cell.id, "label": cell.scene, "tree": cell.tree, "k": cell.k,
                "repetition": cell.repetition, "timed": cell.timed,
            });
            let (outcome, record) = match &result.outcome {
                Outcome::Done(run) => (
                    serde_json::json!({ "outcome": "done", "reason": null }),
                    serde_json::to_value(&run.record).map_err(LabError::json)?,
                ),
                Outcome::Failed { reason, .. } => (
                    serde_json::json!({ "outcome": "failed", "reason": reason }),
                    Value::Null,
                ),
            };
            let mut line = BTreeMap::new();
            for part in [&head, &outcome, &record] {
                flatten("", part, &mut |name, value| {
                    if !columns.contains(&name) {
                        columns.push(name.clone());
                    }
                    line.insert(name, value);
                });
            }
            lines.push(line);
        }
        let mut writer = csv::Writer::from_writer(Vec::new());
        let failed = |error: csv::Error| LabError::json(serde_json::Error::io(error.into()));
        writer.write_record(&columns).map_err(failed)?;
        for line in &lines {
            let cells = columns
                .iter()
                .map(|column| line.get(column).map_or("", String::as_str));
            writer.write_record(cells).map_err(failed)?;
        }
        writer
            .into_inner()
            .map_err(|error| LabError::json(serde_json::Error::io(error.into_error())))
    }
}

pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), LabError> {
    write_whole(path, |file| file.write_all(bytes)).map_err(|source| LabError::Write {
        path: path.to_owned(),
        source,
    })
}

fn flatten(before: &str, value: &Value, put: &mut impl FnMut(String, String)) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let name = match before {
                    "" => name.clone(),
                    before => format!("{before}.{name}"),
                };
                flatten(&name, value, put);
            }
        }
        Value::Array(values) => {
            let all: Vec<String> = values.iter().map(Value::to_string).collect();
            put(before.to_owned(), all.join(" "));
        }
        Value::Null if before.is_empty() => {}
        Value::Null => put(before.to_owned(), String::new()),
        Value::String(text) => put(before.to_owned(), text.clone()),
        value => put(before.to_owned(), value.to_string()),
    }
}

/// What the picture depends on, of the conditions.
const OF_THE_PICTURE: [&str; 5] = ["spp", "resolution", "crop", "max_depth", "sample_seed"];
/// The condition that nothing but time depends on.
const THREADS: &str = "threads";

/// Where runs, given with their scenes and conditions, differ that must not.
pub(crate) fn variances<'a>(
    runs: impl Iterator<Item = (&'a str, serde_json::Map<String, Value>, &'a Run)>,
) -> Vec<Variance> {
    let mut found = Vec::new();
    // The first run of a tree with its conditions; the first picture of a scene.
    let mut first_runs: BTreeMap<String, &Run> = BTreeMap::new();
    let mut pictures: BTreeMap<String, &Run> = BTreeMap::new();
    for (scene, mut conditions, run) in runs {
        let tree = run.record.tree_with_k();
        let mut differs = |what: String| {
            found.push(Variance {
                scene: scene.to_owned(),
                tree: tree.clone(),
                repetition: run.record.repetition,
                what,
            });
        };
        conditions.remove(THREADS);
        let all = serde_json::json!([scene, tree, conditions]).to_string();
        let first = *first_runs.entry(all.clone()).or_insert(run);
        if !run.record.counts_like(&first.record)
            || run.tests_by_leaf_size != first.tests_by_leaf_size
        {
            differs(format!(
                "its counts are not those of repetition {}",
                first.record.repetition + 1
            ));
        }
        // Without margins, each tree may have its own picture.
        let exact = run.record.traversal == "exact";
        conditions.retain(|name, _| OF_THE_PICTURE.contains(&name.as_str()));
        let of_the_picture = match exact {
            true => serde_json::json!([scene, conditions]).to_string(),
            false => all,
        };
        let first = *pictures.entry(of_the_picture).or_insert(run);
        if run.picture != first.picture {
            differs(format!(
                "its picture is not that of {}",
                first.record.tree_with_k()
            ));
        }
        if run
            .picture_timed
            .as_ref()
            .is_some_and(|timed| *timed != run.picture)
        {
            differs("its picture with counters is not that without".to_owned());
        }
    }
    found
}
