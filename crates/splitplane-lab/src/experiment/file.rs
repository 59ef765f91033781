//! An experiment as a TOML file: a grid of runs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use splitplane::TreeChoice;
use toml::{Spanned, Table, Value};

use super::cell::Conditions;
use crate::LabError;

/// An experiment: what is run, as a file says it.
///
/// ```
/// use splitplane_lab::experiment::Experiment;
///
/// let text = r#"
/// title = "Two trees"
/// scenes = ["truck"]
/// trees = ["kd", "wn+kd"]
///
/// [grid]
/// k = [4, 6]
/// ties = ["published", "tolerant"]
/// "#;
/// let experiment = Experiment::parse("two.toml".as_ref(), text, false)?;
/// assert_eq!(experiment.trees.len(), 3);
/// assert_eq!(experiment.conditions.len(), 2);
/// # Ok::<(), splitplane_lab::LabError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// What it is called.
    pub title: String,
    /// What it shows.
    pub description: String,
    /// Whether times count.
    pub timed: bool,
    /// Whether what each pixel cost is kept.
    pub pictures: bool,
    /// How often each cell of the grid is run.
    pub repetitions: u32,
    /// A run is ended after so many seconds.
    pub time_limit_s: f64,
    /// The scenes.
    pub scenes: Vec<SceneEntry>,
    /// The trees with their numbers of directions; the first is the measure of the others.
    pub trees: Vec<TreeChoice>,
    /// All combinations of the other axes.
    pub conditions: Vec<Table>,
    /// What was left out, and why.
    pub notes: Vec<String>,
}

/// A scene of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneEntry {
    /// A scene by name, or a file; relative to the experiment's folder where there is such a file.
    pub name: String,
    /// The name in tables; that of the scene where it is left out.
    pub label: Option<String>,
    /// It is left out where it is not found.
    pub if_found: bool,
    /// Subdivision level of its surfaces.
    pub subdivide: Option<u32>,
    /// Copies of objects become a part of the mesh, so that one tree has all of the scene.
    pub flatten: bool,
    /// Values of `$name` in its file.
    pub define: BTreeMap<String, String>,
    /// Conditions that hold for this scene in place of the grid's.
    pub conditions: Table,
    /// Line and column in the experiment's file, from 1.
    pub place: (u32, u32),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    title: String,
    #[serde(default)]
    description: String,
    timed: Option<bool>,
    pictures: Option<bool>,
    repetitions: Option<Spanned<i64>>,
    time_limit_s: Option<Spanned<f64>>,
    scenes: Spanned<Vec<Spanned<Value>>>,
    trees: Spanned<Vec<Spanned<String>>>,
    #[serde(default)]
    grid: BTreeMap<String, Spanned<Value>>,
    #[serde(default)]
    quick: Quick,
}

/// What `--quick` puts in place of the rest.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Quick {
    timed: Option<bool>,
    pictures: Option<bool>,
    repetitions: Option<Spanned<i64>>,
    time_limit_s: Option<Spanned<f64>>,
    scenes: Option<Spanned<Vec<Spanned<Value>>>>,
    trees: Option<Spanned<Vec<Spanned<String>>>>,
    #[serde(default)]
    grid: BTreeMap<String, Spanned<Value>>,
}

#[derive(Deserialize)]
struct SceneTable {
    name: String,
    label: Option<String>,
    #[serde(default)]
    if_found: bool,
    subdivide: Option<u32>,
    #[serde(default)]
    flatten: bool,
    #[serde(default)]
    define: BTreeMap<String, String>,
}

/// The keys of a scene's table that are no conditions.
const SCENE_KEYS: [&str; 6] = [
    "name",
    "label",
    "if_found",
    "subdivide",
    "flatten",
    "define",
];
/// The axis of the numbers of directions.
const K: &str = "k";
const MOST_REPETITIONS: u32 = 1000;

impl Experiment {
    /// Reads an experiment's file; `quick`: with what its table `quick` puts in place of the rest.
    ///
    /// # Errors
    /// The file cannot be read, or says what cannot be; the error has the place.
    pub fn read(path: &Path, quick: bool) -> Result<Experiment, LabError> {
        let text = std::fs::read_to_string(path).map_err(|source| LabError::Read {
            path: path.to_owned(),
            source,
        })?;
        Experiment::parse(path, &text, quick)
    }

    /// As [`Experiment::read`], from the text of the file at `path`.
    ///
    /// # Errors
    /// The text says what cannot be.
    pub fn parse(path: &Path, text: &str, quick: bool) -> Result<Experiment, LabError> {
        let place = Place { path, text };
        let mut file: File =
            toml::from_str(text).map_err(|error| place.error(error.span(), error.message()))?;
        if quick {
            file = file.quick();
        }
        let span = |range: std::ops::Range<usize>| Some(range);
        let repetitions = match file.repetitions {
            None => 1,
            Some(given) => match u32::try_from(*given.get_ref()) {
                Ok(n @ 1..=MOST_REPETITIONS) => n,
                _ => {
                    let accepted = format!("repetitions are from 1 to {MOST_REPETITIONS}");
                    return Err(place.error(span(given.span()), &accepted));
                }
            },
        };
        let time_limit_s = match file.time_limit_s {
            None => 3600.0,
            Some(given) if *given.get_ref() > 0.0 => *given.get_ref(),
            Some(given) => {
                let accepted = "a limit is a number of seconds above 0";
                return Err(place.error(span(given.span()), accepted));
            }
        };
        let mut notes = Vec::new();
        let ks = place.numbers_of_directions(file.grid.remove(K))?;
        let trees = place.trees(&file.trees, &ks, &mut notes)?;
        let conditions = place.combinations(&file.grid)?;
        let scenes: Vec<SceneEntry> = (file.scenes.get_ref().iter())
            .map(|scene| place.scene(scene))
            .collect::<Result<_, _>>()?;
        if scenes.is_empty() {
            return Err(place.error(span(file.scenes.span()), "there must be a scene"));
        }
        Ok(Experiment {
            title: file.title,
            description: file.description.trim().to_owned(),
            timed: file.timed.unwrap_or(false),
            pictures: file.pictures.unwrap_or(true),
            repetitions,
            time_limit_s,
            scenes,
            trees,
            conditions,
            notes,
        })
    }
}

impl File {
    fn quick(self) -> File {
        let File {
            mut grid, quick, ..
        } = self;
        grid.extend(quick.grid);
        File {
            timed: quick.timed.or(self.timed),
            pictures: quick.pictures.or(self.pictures),
            repetitions: quick.repetitions.or(self.repetitions),
            time_limit_s: quick.time_limit_s.or(self.time_limit_s),
            scenes: quick.scenes.unwrap_or(self.scenes),
            trees: quick.trees.unwrap_or(self.trees),
            grid,
            quick: Quick::default(),
            ..self
        }
    }
}

/// The file that is read, for errors.
struct Place<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Place<'_> {
    fn error(&self, span: Option<std::ops::Range<usize>>, message: &str) -> LabError {
        let (line, column) = span.map_or((0, 0), |span| self.line_and_column(span.start));
        LabError::Experiment(Box::new(ExperimentError {
            file: self.path.to_owned(),
            line,
            column,
            message: in_words(&message.trim().replace('\n', "; ")),
        }))
    }

    fn line_and_column(&self, offset: usize) -> (u32, u32) {
        let before = self.text.get(..offset).unwrap_or_default();
        let line = before.rsplit('\n').next().unwrap_or_default();
        (
            1 + before.matches('\n').count() as u32,
            1 + line.chars().count() as u32,
        )
    }

    /// The values of an axis: those of an array, or the one.
    fn values(&self, axis: &Spanned<Value>) -> Result<Vec<Value>, LabError> {
        match axis.get_ref() {
            Value::Array(values) if values.is_empty() => {
                Err(self.error(Some(axis.span()), "an axis has at least one value"))
            }
            Value::Array(values) => Ok(values.clone()),
            value => Ok(vec![value.clone()]),
        }
    }

    fn numbers_of_directions(&self, axis: Option<Spanned<Value>>) -> Result<Vec<u32>, LabError> {
        let Some(axis) = axis else {
            return Ok(Vec::new());
        };
        let number = |value: Value| {
            let number = value.as_integer().and_then(|k| u32::try_from(k).ok());
            number.ok_or_else(|| {
                let accepted = "k is a number of directions, or several: [3, 6]";
                self.error(Some(axis.span()), accepted)
            })
        };
        let values = self.values(&axis)?;
        values.into_iter().map(number).collect()
    }

    /// The trees; those that take a number of directions and are given without it, once for each
    /// of `ks`.
    fn trees(
        &self,
        given: &Spanned<Vec<Spanned<String>>>,
        ks: &[u32],
        notes: &mut Vec<String>,
    ) -> Result<Vec<TreeChoice>, LabError> {
        let mut trees: Vec<TreeChoice> = Vec::new();
        for name in given.get_ref() {
            let choice: TreeChoice = (name.get_ref().parse())
                .map_err(|error| self.error(Some(name.span()), &format!("{error}")))?;
            let takes_k = choice.spec.takes_direction_count() && !name.get_ref().contains(':');
            if !takes_k || ks.is_empty() {
                trees.push(choice);
                continue;
            }
            for &k in ks {
                match TreeChoice::new(choice.spec.name, Some(k)) {
                    Ok(choice) => trees.push(choice),
                    Err(error) => notes.push(format!("k = {k} is left out: {error}")),
                }
            }
        }
        if trees.is_empty() {
            // Where there are trees, none takes any of the numbers.
            let reasons = match notes.is_empty() {
                true => String::new(),
                false => format!(": {}", notes.join("; ")),
            };
            let message = format!("there must be a tree{reasons}");
            return Err(self.error(Some(given.span()), &message));
        }
        let mut once = Vec::new();
        for tree in trees {
            if !once.contains(&tree) {
                once.push(tree);
            }
        }
        Ok(once)
    }

    /// All combinations of the axes' values.
    fn combinations(
        &self,
        axes: &BTreeMap<String, Spanned<Value>>,
    ) -> Result<Vec<Table>, LabError> {
        let mut all = vec![Table::new()];
        for (name, axis) in axes {
            let values = self.values(axis)?;
            for value in &values {
                let alone = Table::from_iter([(name.clone(), value.clone())]);
                self.check(&alone, axis.span())?;
            }
            all = (all.iter())
                .flat_map(|table| {
                    values.iter().map(move |value| {
                        let mut table = table.clone();
                        table.insert(name.clone(), value.clone());
                        table
                    })
                })
                .collect();
        }
        Ok(all)
    }

    /// That these are conditions.
    fn check(&self, table: &Table, span: std::ops::Range<usize>) -> Result<(), LabError> {
        let conditions = conditions(table);
        let checked = conditions.and_then(|conditions| conditions.settings((1, 1)).map(|_| ()));
        checked.map_err(|message| self.error(Some(span), &message))
    }

    fn scene(&self, given: &Spanned<Value>) -> Result<SceneEntry, LabError> {
        let failed = |message: &str| self.error(Some(given.span()), message);
        let (own, conditions) = match given.get_ref() {
            Value::String(name) => {
                let name = Table::from_iter([("name".to_owned(), Value::String(name.clone()))]);
                (name, Table::new())
            }
            Value::Table(table) => {
                (table.clone().into_iter()).partition(|(key, _)| SCENE_KEYS.contains(&key.as_str()))
            }
            _ => {
                return Err(failed(
                    "a scene is a name, or a table like { name = \"truck\", spp = 4 }",
                ));
            }
        };
        self.check(&conditions, given.span())?;
        let own: SceneTable = Value::Table(own)
            .try_into()
            .map_err(|error: toml::de::Error| failed(error.message()))?;
        let beside: PathBuf = self.path.parent().unwrap_or(Path::new("")).join(&own.name);
        let name = match beside.is_file() {
            true => beside.to_string_lossy().into_owned(),
            false => own.name,
        };
        Ok(SceneEntry {
            name,
            label: own.label,
            if_found: own.if_found,
            subdivide: own.subdivide,
            flatten: own.flatten,
            define: own.define,
            conditions,
            place: self.line_and_column(given.span().start),
        })
    }
}

/// A table as conditions.
pub(super) fn conditions(table: &Table) -> Result<Conditions, String> {
    let read = |table: Table| Value::Table(table).try_into::<Conditions>();
    for (name, value) in table {
        // Alone, so that the one that is wrong can be named.
        if let Err(error) = read(Table::from_iter([(name.clone(), value.clone())])) {
            let message = error.message();
            return Err(match message.starts_with("unknown") {
                true => message.to_owned(),
                false => format!("{name}: {message}"),
            });
        }
    }
    read(table.clone()).map_err(|error| error.message().to_owned())
}

/// What serde says of a value, without the names of Rust's types.
fn in_words(message: &str) -> String {
    for (name, words) in [
        ("u16", "a whole number from 0 to 65535"),
        ("u32", "a whole number from 0 to 4294967295"),
        ("u64", "a whole number, not below 0"),
        ("i64", "a whole number"),
        ("f64", "a number"),
        ("a boolean", "true or false"),
        ("a string", "a text in quotes"),
        ("a sequence", "an array, in [ ]"),
    ] {
        if let Some(start) = message.strip_suffix(&format!("expected {name}")) {
            return format!("{start}expected {words}");
        }
    }
    message.replace(
        "data did not match any variant of untagged enum Size",
        "a size is a width, or a text like \"800x600\"",
    )
}

/// What is wrong with an experiment's file, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {message}", at(file, *line, *column))]
pub struct ExperimentError {
    /// The file.
    pub file: PathBuf,
    /// The line, from 1; 0 where the whole file is meant.
    pub line: u32,
    /// The column in characters, from 1; 0 where no column is known.
    pub column: u32,
    /// What is wrong, and what would be accepted.
    pub message: String,
}

fn at(file: &Path, line: u32, column: u32) -> String {
    match line {
        0 => file.display().to_string(),
        _ => format!("{}:{line}:{column}", file.display()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"
title = "All"
repetitions = 3
scenes = ["truck", { name = "grove", label = "leaves", spp = 4, if_found = true }]
trees = ["kd", "wn+kd:4", "wn+kd", "cn"]

[grid]
k = [2, 6]
ties = ["published", "tolerant"]
max_prims = [1, 4]

[quick]
repetitions = 1
scenes = ["truck"]
[quick.grid]
max_prims = 1
spp = 1
"#;

    fn parse(text: &str, quick: bool) -> Result<Experiment, LabError> {
        Experiment::parse(Path::new("nowhere/e.toml"), text, quick)
    }

    #[test]
    fn a_grid_is_all_combinations_and_quick_puts_its_own_in_their_place() {
        let all = parse(GOOD, false).unwrap();
        let names: Vec<String> = all.trees.iter().map(|tree| tree.to_string()).collect();
        assert_eq!(names, ["kd", "wn+kd:4", "wn+kd:6", "cn:2", "cn:6"]);
        assert_eq!(all.notes.len(), 1, "{:?}", all.notes);
        assert!(all.notes[0].contains("k = 2"), "{:?}", all.notes);
        assert_eq!(all.conditions.len(), 4);
        assert_eq!(all.scenes.len(), 2);
        let leaves = &all.scenes[1];
        assert_eq!(leaves.label.as_deref(), Some("leaves"));
        assert!(leaves.if_found && leaves.conditions["spp"].as_integer() == Some(4));
        let quick = parse(GOOD, true).unwrap();
        assert_eq!((quick.repetitions, quick.scenes.len()), (1, 1));
        assert_eq!(quick.conditions.len(), 2);
        assert_eq!(quick.conditions[0]["spp"].as_integer(), Some(1));
    }

    #[test]
    fn trees_that_take_none_of_the_numbers_of_directions_are_no_trees() {
        let text = (GOOD.replace("[2, 6]", "[2, 99]"))
            .replace("\"kd\", \"wn+kd:4\", \"wn+kd\", \"cn\"", "\"wn+kd\"");
        let error = parse(&text, false).unwrap_err().to_string();
        for part in [
            "e.toml:5:9",
            "there must be a tree",
            "k = 2",
            "k = 99",
            "from 3 to 64",
        ] {
            assert!(error.contains(part), "{part}: {error}");
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        for (from, to, place, says) in [
            ("\"wn+kd:4\"", "\"wn+kd:99\"", "5:16", "wn+kd"),
            ("\"cn\"]", "\"oak\"]", "5:36", "no tree is called"),
            ("tolerant", "loose", "9:8", "published, tolerant"),
            ("max_prims = [", "max_prim = [", "10:12", "max_prims"),
            ("spp = 4", "spp = 0", "4:20", "spp"),
            ("repetitions = 3", "repetitions = 0", "3:15", "from 1"),
            (
                "repetitions = 3",
                "repetitions = 99999999999",
                "3:15",
                "repetitions are from 1 to 1000",
            ),
            (
                "repetitions = 3",
                "repetitions = -1",
                "3:15",
                "from 1 to 1000",
            ),
            (
                "spp = 4",
                "spp = 4000000000",
                "4:20",
                "spp is from 1 to 1000000",
            ),
            (
                "max_prims = [1, 4]",
                "max_prims = 99999999999",
                "10:13",
                "expected a whole number from 0 to 4294967295",
            ),
            ("k = [2, 6]", "k = [\"two\"]", "8:5", "number of directions"),
            (
                "max_prims = [1, 4]",
                "max_prims = []",
                "10:13",
                "at least one",
            ),
            ("k = [2, 6]", "k = []", "8:5", "at least one"),
            (
                "max_prims = [1, 4]",
                "max_prims = \"one\"",
                "10:13",
                "max_prims: invalid type: string \"one\", expected a whole number",
            ),
            ("max_prims = [1, 4]", "alpha = -1.0", "10:9", "alpha"),
            (
                "max_prims = [1, 4]",
                "resolution = true",
                "10:14",
                "800x600",
            ),
            ("title = ", "titel = ", "2:1", "title"),
            ("[\"truck\", {", "[7, {", "4:11", "a scene is"),
            ("[grid]", "[grid", "7:", ""),
        ] {
            assert!(GOOD.contains(from), "{from}");
            let error = parse(&GOOD.replacen(from, to, 1), false).unwrap_err();
            let text = error.to_string();
            assert!(
                text.contains(&format!("e.toml:{place}")) && text.contains(says),
                "{to}: {text}"
            );
        }
    }
}
