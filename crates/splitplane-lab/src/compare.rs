//! Trees on the same scene, side by side.

use splitplane::{Traversal, TreeChoice};
use splitplane_render::render::{Progress, Rendered};
use splitplane_render::scene::Scene;

use crate::LabError;
use crate::numbers::{bytes, grouped, measured, percent, seconds};
use crate::objects::build_scene;
use crate::record::{CardRecord, PerRay, Record};
use crate::run::{RenderTime, Settings, record, render_timed, render_with};
use crate::stats::median;

/// What a comparison is about to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// With which tree.
    pub tree: TreeChoice,
    /// What.
    pub task: Task,
    /// Which repetition, from 0.
    pub repetition: u32,
}

/// A part of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// The tree is built.
    Build,
    /// The scene is rendered without counters, for its time.
    Time,
    /// The scene is rendered with counters.
    Count,
}

/// Watches a comparison, its builds and its renderings, and may stop them.
pub trait Watch: Progress {
    /// The next step begins.
    fn step(&self, _step: Step) {}
}

/// Watches nothing.
impl Watch for () {}

/// What a comparison found.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// One record per repetition and tree: all trees of the first repetition, then all of the
    /// next.
    pub records: Vec<Record>,
    /// The trees, as they were built first.
    pub trees: Vec<ComparedTree>,
    /// Where results differ that must not; empty if all is well.
    pub differences: Vec<Difference>,
    /// Where pictures differ from the first tree's although they may: with
    /// [`Traversal::AsPublished`], hits in or near split planes may be missed.
    pub deviations: Vec<Difference>,
}

/// A tree of a comparison.
#[derive(Clone, Debug)]
pub struct ComparedTree {
    /// The tree.
    pub choice: TreeChoice,
    /// What is known of it.
    pub card: CardRecord,
    /// The rendering with counters.
    pub rendered: Rendered,
}

/// Results that differ although they must be the same.
#[derive(Clone, Debug, PartialEq)]
pub enum Difference {
    /// A picture is not, bit by bit, that of the first rendering of the first tree; or of the same
    /// tree, where trees may give different ones.
    Picture {
        /// The tree.
        tree: TreeChoice,
        /// Which repetition, from 0.
        repetition: u32,
        /// With counters.
        counted: bool,
        /// How many pixels differ.
        pixels: usize,
        /// Column and row of the first of them.
        first: (u32, u32),
    },
    /// The same tree, built again, is another.
    Tree {
        /// The tree.
        tree: TreeChoice,
        /// Which repetition, from 0.
        repetition: u32,
    },
}

/// Builds and renders the scene with all trees, `repeat` times, interleaved (A B A B): what
/// disturbs the machine disturbs all trees alike. Times are taken without counters; each tree is
/// rendered once more with them. For either, the tree is in the layout that the settings have for it.
///
/// With [`Traversal::Exact`], all trees must give the same picture; otherwise each its own.
///
/// # Errors
/// A tree cannot be built, the scene cannot be rendered, or `watch` stopped it.
pub fn compare(
    scene: &Scene,
    trees: &[TreeChoice],
    settings: &Settings,
    repeat: u32,
    watch: &dyn Watch,
) -> Result<Comparison, LabError> {
    let mut found = Comparison {
        records: Vec::new(),
        trees: Vec::new(),
        differences: Vec::new(),
        deviations: Vec::new(),
    };
    // The first picture of each tree that has one of its own.
    let mut references: Vec<Vec<[f32; 3]>> = Vec::new();
    for repetition in 0..repeat {
        for (i, &tree) in trees.iter().enumerate() {
            let step = |task| {
                watch.step(Step {
                    tree,
                    task,
                    repetition,
                });
            };
            step(Task::Build);
            let built = build_scene(scene, tree, settings, watch)?;
            step(Task::Time);
            let (timed, others_load) = render_timed(scene, &built, settings, watch)?;
            if let Some(first) = references.first()
                && settings.traversal == Traversal::AsPublished
                && repetition == 0
            {
                let deviation = difference(first, &timed, (tree, repetition, false));
                found.deviations.extend(deviation);
                references.push(timed.radiance.clone());
            }
            if references.is_empty() {
                references.push(timed.radiance.clone());
            }
            let reference = match settings.traversal {
                Traversal::Exact => &references[0],
                Traversal::AsPublished => &references[i],
            };
            let mut check = |picture: &Rendered, counted| {
                found.differences.extend(difference(
                    reference,
                    picture,
                    (tree, repetition, counted),
                ));
            };
            check(&timed, false);
            if repetition == 0 {
                step(Task::Count);
                let counted = render_with(scene, &built, settings, true, watch)?;
                check(&counted, true);
                found.trees.push(ComparedTree {
                    choice: tree,
                    card: CardRecord::new(&built, &scene.name, settings),
                    rendered: counted,
                });
            }
            let counted = &found.trees[i].rendered;
            let time = RenderTime {
                seconds: timed.seconds,
                counted: false,
                others_load,
            };
            let record = record(scene, &built, settings, repetition, counted, time);
            if repetition > 0 && !record.counts_like(&found.records[i]) {
                found
                    .differences
                    .push(Difference::Tree { tree, repetition });
            }
            found.records.push(record);
        }
    }
    Ok(found)
}

fn difference(
    reference: &[[f32; 3]],
    picture: &Rendered,
    (tree, repetition, counted): (TreeChoice, u32, bool),
) -> Option<Difference> {
    let mut differing = differing_pixels(reference, &picture.radiance);
    let first = differing.next()?;
    Some(Difference::Picture {
        tree,
        repetition,
        counted,
        pixels: 1 + differing.count(),
        first: (
            picture.origin.0 + first % picture.width,
            picture.origin.1 + first / picture.width,
        ),
    })
}

/// The places of the pixels that are not the same in both pictures, bit by bit.
pub(crate) fn differing_pixels(a: &[[f32; 3]], b: &[[f32; 3]]) -> impl Iterator<Item = u32> {
    let bits = |pixel: &[f32; 3]| pixel.map(f32::to_bits);
    (a.iter().zip(b).enumerate())
        .filter(move |(_, (a, b))| bits(a) != bits(b))
        .map(|(i, _)| i as u32)
}

/// A line of a comparison's table: a quantity, one value per tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What it is.
    pub label: &'static str,
    /// Whether it is a part of the row above that is not.
    pub part: bool,
    /// Its unit.
    pub unit: Unit,
    /// The trees' values, in their order.
    pub values: Vec<f64>,
}

/// What a number counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Seconds.
    Seconds,
    /// Things.
    Count,
    /// A cost, in the unit of the build parameters.
    Cost,
    /// Bytes.
    Bytes,
    /// Parts of a hundred.
    Percent,
}

impl Unit {
    /// A number in this unit, as people read it.
    pub fn text(self, value: f64) -> String {
        match self {
            Unit::Seconds => seconds(value),
            Unit::Count => grouped(value as u64),
            Unit::Cost => measured(value),
            Unit::Bytes => bytes(value as u64),
            Unit::Percent => percent(value),
        }
    }
}

impl Row {
    /// A tree's value in per cent of the first tree's; `None` where that is 0.
    pub fn percent(&self, tree: usize) -> Option<f64> {
        let first = *self.values.first()?;
        (first != 0.0).then(|| 100.0 * self.values.get(tree).copied().unwrap_or(f64::NAN) / first)
    }
}

/// The trees of the records, in their order, and the table that compares them: medians of times
/// over the repetitions, and counts, which do not vary.
pub fn rows(records: &[Record]) -> (Vec<String>, Vec<Row>) {
    let mut trees: Vec<(String, Vec<&Record>)> = Vec::new();
    for record in records {
        let name = record.tree_with_k();
        match trees.iter_mut().find(|(tree, _)| *tree == name) {
            Some((_, of_tree)) => of_tree.push(record),
            None => trees.push((name, vec![record])),
        }
    }
    let mut rows = Vec::new();
    let mut add = |label, part, unit, value: &dyn Fn(&Record) -> f64| {
        let of_tree = |(_, records): &(String, Vec<&Record>)| {
            median(records.iter().map(|record| value(record))).unwrap_or(f64::NAN)
        };
        let values = trees.iter().map(of_tree).collect();
        rows.push(Row {
            label,
            part,
            unit,
            values,
        });
    };
    add("render time", false, Unit::Seconds, &|r| r.render_s);
    add("build time", false, Unit::Seconds, &|r| r.build_s);
    let in_wide = |r: &Record| r.layout_s.unwrap_or(f64::NAN);
    if records.iter().all(|r| r.layout_s.is_some()) {
        add("to the wide layout", true, Unit::Seconds, &in_wide);
    }
    add("nodes", false, Unit::Count, &|r| r.nodes.total() as f64);
    add("kd", true, Unit::Count, &|r| r.nodes.kd as f64);
    add("oblique", true, Unit::Count, &|r| r.nodes.oblique as f64);
    add("leaves", true, Unit::Count, &|r| r.nodes.leaf as f64);
    add("empty leaves", true, Unit::Count, &|r| {
        r.nodes.empty_leaf as f64
    });
    add("references", false, Unit::Count, &|r| r.references as f64);
    add("size of the tree", false, Unit::Bytes, &|r| {
        r.tree_bytes as f64
    });
    if records.iter().all(|r| r.wide_bytes.is_some()) {
        add("in the wide layout", true, Unit::Bytes, &|r| {
            r.wide_bytes.map_or(f64::NAN, |bytes| bytes as f64)
        });
    }
    add("SAH cost", false, Unit::Cost, &|r| r.sah_cost);
    type Counted = (&'static str, fn(&Record) -> PerRay);
    let counted: [Counted; 3] = [
        ("triangle tests", |r| r.triangle_tests),
        ("interior node visits", Record::interior_visits),
        ("leaf visits", |r| r.leaf_visits),
    ];
    for (label, count) in counted {
        add(label, false, Unit::Count, &|r| count(r).total() as f64);
        add("camera rays", true, Unit::Count, &|r| {
            count(r).camera as f64
        });
        add("bounce rays", true, Unit::Count, &|r| {
            count(r).bounce as f64
        });
        add("shadow rays", true, Unit::Count, &|r| {
            count(r).shadow as f64
        });
    }
    (trees.into_iter().map(|(tree, _)| tree).collect(), rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_differs_in_one_bit_is_found_with_its_pixel() {
        let tree: TreeChoice = splitplane::TREES[0].name.parse().unwrap();
        let mut picture = Rendered {
            width: 3,
            height: 2,
            origin: (10, 20),
            samples_per_pixel: 1,
            radiance: vec![[0.5; 3]; 6],
            depth: vec![],
            normal: vec![],
            rays: Default::default(),
            counts: Default::default(),
            tests_by_leaf_size: Default::default(),
            pixel_counts: None,
            seconds: 0.0,
        };
        let reference = picture.radiance.clone();
        assert_eq!(difference(&reference, &picture, (tree, 0, false)), None);
        picture.radiance[4][1] = 0.5_f32.next_up();
        picture.radiance[5][2] = -0.5;
        let expected = Difference::Picture {
            tree,
            repetition: 1,
            counted: true,
            pixels: 2,
            first: (11, 21),
        };
        let found = difference(&reference, &picture, (tree, 1, true));
        assert_eq!(found, Some(expected));
    }
}
