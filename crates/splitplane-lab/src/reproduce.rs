//! The thesis's figures again: all its trees on one of its scenes, beside what was published.

use std::sync::Arc;

use splitplane::{BuildParams, TREES, Ties, Traversal, TreeChoice, TreeSpec};
use splitplane_render::render::Rendered;
use splitplane_render::scene::Scene;

use crate::LabError;
use crate::compare::{Step, Task, Watch, differing_pixels};
use crate::params::Preset;
use crate::published::{Figures, OF_THE_TREE, Place, QUANTITIES, Source};
use crate::record::Record;
use crate::run::{Layouts, RenderTime, Settings, build, record, render_with};

/// One tree, built with one way to treat ties, and the scene rendered with one traversal.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The tree.
    pub tree: TreeChoice,
    /// How triangles that touch a plane were treated.
    pub ties: Ties,
    /// How queries decided which cells a ray passes.
    pub traversal: Traversal,
    /// What was counted.
    pub record: Record,
    /// Pixels that differ from those of the first tree with the exact traversal.
    pub wrong_pixels: usize,
}

/// The orders in which ways to treat ties, and traversals, are measured and tabulated; of both the
/// first is the thesis's, and its measure is that of all figures.
const TIES: [Ties; 2] = [Ties::AsPublished, Ties::Tolerant];
const TRAVERSALS: [Traversal; 2] = [Traversal::AsPublished, Traversal::Exact];

/// The trees that the thesis has figures for, with its numbers of directions, and bounding volume
/// hierarchies for comparison.
pub fn trees_of_the_thesis() -> Vec<TreeChoice> {
    let of_thesis = |spec: &&TreeSpec| !spec.thesis_name.is_empty();
    let objects = |spec: &&TreeSpec| spec.thesis_name.is_empty() && spec.objects;
    (TREES.iter().filter(of_thesis))
        .chain(TREES.iter().filter(objects))
        .filter_map(|spec| TreeChoice::new(spec.name, None).ok())
        .collect()
}

/// The number of steps of [`reproduce`] with that many trees.
pub fn reproduction_steps(trees: usize) -> usize {
    trees * TIES.len() * (1 + TRAVERSALS.len())
}

/// Builds all trees with the parameters of the thesis, with either way to treat ties, and renders
/// the scene with either traversal, counting. Of `settings`, the seed and how to render count.
///
/// # Errors
/// A tree cannot be built, the scene cannot be rendered, or `watch` stopped it.
pub fn reproduce(
    scene: &Scene,
    trees: &[TreeChoice],
    settings: &Settings,
    watch: &dyn Watch,
) -> Result<Vec<Measured>, LabError> {
    let mut measured: Vec<Measured> = Vec::new();
    let mut reference: Option<Vec<[f32; 3]>> = None;
    for ties in TIES {
        for &tree in trees {
            let step = |task| {
                watch.step(Step {
                    tree,
                    task,
                    repetition: 0,
                });
            };
            let mut settings = Settings {
                preset: Preset::Thesis,
                params: BuildParams {
                    ties,
                    seed: settings.params.seed,
                    ..Preset::Thesis.params()
                },
                layouts: Layouts::default(),
                ..settings.clone()
            };
            step(Task::Build);
            let mut built = build(&scene.mesh, tree, &settings, watch)?;
            let mut pictures: Vec<Rendered> = Vec::new();
            for traversal in TRAVERSALS {
                step(Task::Count);
                settings.traversal = traversal;
                built.tree = Arc::new(Arc::unwrap_or_clone(built.tree).with_traversal(traversal));
                pictures.push(render_with(scene, &built, &settings, true, watch)?);
                let picture = &pictures[pictures.len() - 1];
                let time = RenderTime {
                    seconds: picture.seconds,
                    counted: true,
                    others_load: None,
                };
                measured.push(Measured {
                    tree,
                    ties,
                    traversal,
                    record: record(scene, &built, &settings, 0, picture, time),
                    wrong_pixels: 0,
                });
            }
            let first = measured.len() - pictures.len();
            let exact = (measured[first..].iter().zip(&pictures))
                .find(|(measured, _)| measured.traversal == Traversal::Exact);
            if let (None, Some((_, picture))) = (&reference, exact) {
                reference = Some(picture.radiance.clone());
            }
            let reference = reference.as_deref().unwrap_or_default();
            for (measured, picture) in measured[first..].iter_mut().zip(&pictures) {
                measured.wrong_pixels = differing_pixels(reference, &picture.radiance).count();
            }
        }
    }
    Ok(measured)
}

impl Measured {
    /// The values of [`QUANTITIES`].
    fn figures(&self) -> [f64; QUANTITIES.len()] {
        let r = &self.record;
        let closest = |pick: fn(&Record) -> crate::PerRay| pick(r).camera + pick(r).bounce;
        let shadow = |pick: fn(&Record) -> crate::PerRay| pick(r).shadow;
        let kinds: [fn(&Record) -> crate::PerRay; 3] =
            [|r| r.kd_visits, |r| r.oblique_visits, |r| r.leaf_visits];
        let visits_closest: u64 = kinds.map(closest).iter().sum();
        let visits_shadow: u64 = kinds.map(shadow).iter().sum();
        [
            r.nodes.total() as f64,
            r.sah_cost,
            closest(|r| r.triangle_tests) as f64,
            shadow(|r| r.triangle_tests) as f64,
            visits_closest as f64,
            visits_shadow as f64,
        ]
    }
}

/// All trees with one way to treat ties and one traversal, beside what was published.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureTable {
    /// How triangles that touch a plane were treated.
    pub ties: Ties,
    /// How queries decided which cells a ray passes.
    pub traversal: Traversal,
    /// The publications that say something of these trees.
    pub sources: Vec<&'static str>,
    /// The absolute figures of the measure: the first tree with the thesis's ties and traversal.
    pub measure: FigureLine,
    /// All trees, in per cent of the measure.
    pub lines: Vec<FigureLine>,
}

/// A tree's line.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureLine {
    /// The tree.
    pub tree: TreeChoice,
    /// For each of [`QUANTITIES`], ours beside what was published.
    pub figures: [Figure; QUANTITIES.len()],
    /// Pixels that differ from those of the first tree with the exact traversal.
    pub wrong_pixels: usize,
}

/// A figure of ours beside what was published.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Ours.
    pub ours: f64,
    /// That of each source, where it has one.
    pub published: Vec<Option<f64>>,
    /// How much larger ours is than the first that was published, as a share of that; `None`
    /// where they cannot be compared.
    pub deviation: Option<f64>,
}

/// What [`reproduce`] measured, as tables: one for each way to treat ties and each traversal.
pub fn figure_tables(measured: &[Measured]) -> Vec<FigureTable> {
    let Some(measure) = measured.first() else {
        return Vec::new();
    };
    let sources = Source::all();
    let place = Place {
        scene: &measure.record.scene,
        triangles: measure.record.triangles,
        measure: measure.tree,
    };
    let whole = measure.figures();
    let mut tables = Vec::new();
    for ties in TIES {
        // A source that says nothing of these trees gets no place in the table.
        let speaks = |source: &&Source| {
            let says = |m: &Measured| source.percent(place, ties, m.tree) != Figures::default();
            measured.iter().any(says)
        };
        let speaking: Vec<&Source> = sources.iter().filter(speaks).collect();
        let published = |figures: &dyn Fn(&Source) -> Figures, i: usize| -> Vec<Option<f64>> {
            speaking.iter().map(|source| figures(source)[i]).collect()
        };
        for traversal in TRAVERSALS {
            let absolute = |i: usize| {
                let published = published(&|source| source.absolute(place).0, i);
                // Counts of other rays say nothing.
                let same_rays = speaking.first().is_some_and(|source| {
                    source.absolute(place).1 == Some(measure.record.rays.camera)
                });
                let comparable = i < OF_THE_TREE || same_rays;
                Figure::new(whole[i], published, comparable)
            };
            let line = |m: &Measured| {
                let figures = m.figures();
                let percent = |i: usize| {
                    let ours = 100.0 * figures[i] / whole[i];
                    let published = published(&|source| source.percent(place, ties, m.tree), i);
                    Figure::new(ours, published, true)
                };
                FigureLine {
                    tree: m.tree,
                    figures: std::array::from_fn(percent),
                    wrong_pixels: m.wrong_pixels,
                }
            };
            tables.push(FigureTable {
                ties,
                traversal,
                sources: speaking.iter().map(|source| source.name).collect(),
                measure: FigureLine {
                    tree: measure.tree,
                    figures: std::array::from_fn(absolute),
                    wrong_pixels: measure.wrong_pixels,
                },
                lines: measured
                    .iter()
                    .filter(|m| (m.ties, m.traversal) == (ties, traversal))
                    .map(line)
                    .collect(),
            });
        }
    }
    tables
}

impl Figure {
    fn new(ours: f64, published: Vec<Option<f64>>, comparable: bool) -> Figure {
        let first = published.iter().flatten().next().filter(|_| comparable);
        Figure {
            ours,
            deviation: first.map(|first| ours / first - 1.0),
            published,
        }
    }
}
