//! Runs of the same scene under the same conditions, tree by tree.

use serde_json::{Map, Value};
use splitplane::TreeChoice;

use super::measures::{MEASURES, Measure};
use crate::published::Thesis;
use crate::run::Run;
use crate::stats::{Estimate, estimate};

/// A run, and where it belongs.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) scene: String,
    pub(crate) conditions: Map<String, Value>,
    pub(crate) tree: TreeChoice,
    pub(crate) timed: bool,
    /// The id of its cell, where there is one.
    pub(crate) id: String,
    pub(crate) run: Run,
}

/// The runs of a tree.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    pub(crate) tree: TreeChoice,
    /// The cell whose pixels are kept.
    pub(crate) id: String,
    /// By repetition; at least one.
    pub(crate) runs: Vec<Run>,
}

/// A scene under the same conditions.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    pub(crate) scene: String,
    /// The conditions that are not the same in all groups, for people; empty where all are.
    pub(crate) conditions: String,
    pub(crate) timed: bool,
    /// In the order of the plan; the first tree is the measure.
    pub(crate) points: Vec<Point>,
    /// What the thesis has of a scene of this name.
    pub(crate) thesis: Thesis,
}

/// A value of a tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Told {
    pub(crate) value: Estimate,
    /// In per cent of the measure's, repetition by repetition; the value itself where it is a
    /// share.
    pub(crate) percent: Option<Estimate>,
    /// The thesis's, in per cent.
    pub(crate) thesis: Option<f64>,
}

impl Group {
    /// The groups of all runs, in the order of the first run of each.
    pub(crate) fn all(entries: Vec<Entry>) -> Vec<Group> {
        let mut groups: Vec<(Map<String, Value>, Group)> = Vec::new();
        for entry in entries {
            let found = groups.iter().position(|(conditions, group)| {
                group.scene == entry.scene && *conditions == entry.conditions
            });
            let at = found.unwrap_or_else(|| {
                let scene_name = entry.run.record.scene.as_str();
                groups.push((
                    entry.conditions.clone(),
                    Group {
                        scene: entry.scene.clone(),
                        conditions: String::new(),
                        timed: entry.timed,
                        points: Vec::new(),
                        thesis: Thesis::of(scene_name),
                    },
                ));
                groups.len() - 1
            });
            let points = &mut groups[at].1.points;
            match points.iter_mut().find(|point| point.tree == entry.tree) {
                Some(point) => point.runs.push(entry.run),
                None => points.push(Point {
                    tree: entry.tree,
                    id: entry.id,
                    runs: vec![entry.run],
                }),
            }
        }
        let names: Vec<Map<String, Value>> = groups.iter().map(|(c, _)| c.clone()).collect();
        let varies = |scene: &str, name: &str, value: &Value| {
            (groups.iter().zip(&names))
                .filter(|((_, group), _)| group.scene == scene)
                .any(|(_, other)| other.get(name) != Some(value))
        };
        let labels: Vec<String> = (groups.iter())
            .map(|(conditions, group)| {
                let told = |(name, value): (&String, &Value)| {
                    let text = value.as_str().map_or(value.to_string(), str::to_owned);
                    varies(&group.scene, name, value).then(|| format!("{name} {text}"))
                };
                conditions
                    .iter()
                    .filter_map(told)
                    .collect::<Vec<_>>()
                    .join(", ")
            })
            .collect();
        (groups.into_iter().zip(labels))
            .map(|((_, group), conditions)| Group {
                conditions,
                ..group
            })
            .collect()
    }

    /// Its name.
    pub(crate) fn title(&self) -> String {
        match self.conditions.as_str() {
            "" => self.scene.clone(),
            conditions => format!("{}, {conditions}", self.scene),
        }
    }

    /// Its name as part of a file's or an element's.
    pub(crate) fn slug(&self) -> String {
        slug(&self.title())
    }

    /// The measures that mean something here.
    pub(crate) fn measures(&self) -> impl Iterator<Item = &'static Measure> {
        let timed = self.timed;
        MEASURES
            .iter()
            .filter(move |measure| timed || !measure.time)
    }

    /// What a measure says of a tree.
    pub(crate) fn told(&self, measure: &Measure, point: &Point) -> Option<Told> {
        let values = point
            .runs
            .iter()
            .filter_map(|run| (measure.of)(&run.record));
        let value = estimate(values)?;
        let first = &self.points[0];
        let percent = match measure.relative {
            true => estimate(ratios(measure, point, first)),
            false => Some(value),
        };
        let thesis = measure.thesis.and_then(|of| {
            let of_tree = of(self.thesis.line(point.tree)?);
            let percent = match measure.relative {
                true => 100.0 * of_tree / of(self.thesis.line(first.tree)?),
                false => of_tree,
            };
            percent.is_finite().then_some(percent)
        });
        Some(Told {
            value,
            percent,
            thesis,
        })
    }

    /// The best of the trees' per cent in a measure, to a tenth; `None` where there is no better
    /// and worse.
    pub(crate) fn best(&self, measure: &Measure) -> Option<f64> {
        let percents = self.points.iter().filter_map(|point| {
            let told = self.told(measure, point)?;
            Some(tenth(told.percent?.median))
        });
        (measure.relative && self.points.len() > 1)
            .then(|| percents.min_by(f64::total_cmp))
            .flatten()
    }

    /// Whether trees are here with three or more numbers of directions.
    pub(crate) fn sweeps_k(&self) -> bool {
        self.points.iter().any(|point| {
            let same = |other: &&Point| other.tree.spec.name == point.tree.spec.name;
            self.points.iter().filter(same).count() >= 3
        })
    }
}

/// A text as part of a file's or an element's name.
pub(crate) fn slug(text: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let slug: String = text.to_lowercase().chars().map(plain).collect();
    slug.split('-')
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join("-")
}

pub(crate) fn tenth(percent: f64) -> f64 {
    (10.0 * percent).round() / 10.0
}

/// A tree's values in per cent of another's in the same repetition: what disturbed the machine then
/// disturbed both.
fn ratios(measure: &Measure, point: &Point, first: &Point) -> Vec<f64> {
    (point.runs.iter())
        .filter_map(|run| {
            let repetition = run.record.repetition;
            let beside = first
                .runs
                .iter()
                .find(|first| first.record.repetition == repetition)?;
            let (value, of) = ((measure.of)(&run.record)?, (measure.of)(&beside.record)?);
            // So that a tree is exactly 100 % of itself.
            (of != 0.0).then(|| 100.0 * (value / of))
        })
        .collect()
}
