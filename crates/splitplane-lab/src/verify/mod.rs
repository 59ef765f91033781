//! Whether queries are right: rays that others lose, against testing every triangle.

mod meshes;
mod probes;

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use splitplane::{Coherence, Hit, Layout, Mesh, Progress, Ray, Tree, TreeChoice, brute_force};

use crate::LabError;
use crate::run::{Settings, build};

pub use probes::{Expect, Probe, ProbeSet};

/// Rays that are asked at once.
const CHUNK: u64 = 256;

/// The most triangles that are tested for the truth of one set of rays: some seconds of work.
const MOST_TESTS: u64 = 4_000_000_000;

/// How often answers were wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Leaks {
    /// Rays that were answered with a miss although they hit.
    pub missed: u64,
    /// Rays that were answered with another hit than the right one, or with a hit where there is
    /// none, or for which `any_hit`, `all_hits` or a batch of rays that go together said otherwise.
    pub wrong: u64,
}

impl Leaks {
    /// Whether nothing was wrong.
    pub fn is_tight(self) -> bool {
        self == Leaks::default()
    }

    /// What is wrong with an answer, if anything. `same`: whether a hit counts as the right one.
    pub fn of(
        answer: Option<Hit>,
        truth: Option<Hit>,
        expect: Expect,
        same: impl Fn(&Hit, &Hit) -> bool,
    ) -> Leaks {
        let own = |hit: &Hit| expect == Expect::NotOn(hit.triangle);
        match (answer, truth) {
            (None, Some(_)) => Leaks::MISSED,
            (None, None) if expect == Expect::Hit => Leaks::MISSED,
            (None, None) => Leaks::default(),
            (Some(_), None) => Leaks::WRONG,
            (Some(answer), Some(truth)) => match same(&answer, &truth) && !own(&answer) {
                true => Leaks::default(),
                false => Leaks::WRONG,
            },
        }
    }

    /// A ray that was answered with a miss although it hits.
    pub const MISSED: Leaks = Leaks {
        missed: 1,
        wrong: 0,
    };
    /// A ray that was answered wrongly in another way.
    pub const WRONG: Leaks = Leaks {
        missed: 0,
        wrong: 1,
    };
}

impl std::ops::AddAssign for Leaks {
    fn add_assign(&mut self, other: Leaks) {
        self.missed += other.missed;
        self.wrong += other.wrong;
    }
}

impl fmt::Display for Leaks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = crate::numbers::grouped;
        match (self.missed, self.wrong) {
            (0, 0) => f.write_str("0"),
            (missed, 0) => write!(f, "{} missed", count(missed)),
            (0, wrong) => write!(f, "{} wrong", count(wrong)),
            (missed, wrong) => write!(f, "{} missed, {} wrong", count(missed), count(wrong)),
        }
    }
}

/// What was asked, and how often each answered wrongly.
#[derive(Clone, Debug)]
pub struct LeakTable {
    /// The sets of rays.
    pub sets: Vec<ProbeSet>,
    /// Rays of each set.
    pub rays: u64,
    /// How many of them, per set, were answered by brute force. The others' truth is the nearest
    /// hit that any of the trees found.
    pub by_brute_force: Vec<u64>,
    /// One row for brute force, which is held to what rays of a set must do, and one for each tree
    /// in each layout.
    pub rows: Vec<LeakRow>,
}

/// How often one answered wrongly.
#[derive(Clone, Debug)]
pub struct LeakRow {
    /// "brute force", or the tree and its layout.
    pub name: String,
    /// Per set.
    pub leaks: Vec<Leaks>,
}

impl LeakTable {
    /// Whether every answer was right.
    pub fn is_tight(&self) -> bool {
        let mut all = self.rows.iter().flat_map(|row| &row.leaks);
        all.all(|leaks| leaks.is_tight())
    }
}

/// The sets of rays that are asked without a scene: on meshes that are made for them.
pub fn probe_sets() -> Vec<ProbeSet> {
    probes::built_in()
}

/// The sets of rays that any mesh can be asked.
pub fn probe_sets_of(mesh: &Mesh) -> Vec<ProbeSet> {
    probes::of_mesh(mesh)
}

/// Asks each tree, in each layout, all rays of all sets.
///
/// # Errors
/// A tree that cannot be built, or no threads.
pub fn verify(
    sets: Vec<ProbeSet>,
    choices: &[TreeChoice],
    rays: u64,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<LeakTable, LabError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.render.threads)
        .build()
        .map_err(|source| LabError::Threads { source })?;
    let mut table = LeakTable {
        rows: std::iter::once("brute force".to_owned())
            .chain(
                choices
                    .iter()
                    .flat_map(|choice| Layout::ALL.map(|layout| format!("{choice}, {layout}"))),
            )
            .map(|name| LeakRow {
                name,
                leaks: Vec::new(),
            })
            .collect(),
        by_brute_force: Vec::new(),
        rays,
        sets,
    };
    let mut trees = Vec::new();
    let total = rays * table.sets.len() as u64;
    let done = AtomicU64::new(0);
    for set in &table.sets {
        // Sets follow each other that share a mesh.
        let same_mesh =
            |tree: &Tree| tree.mesh().positions().as_ptr() == set.mesh().positions().as_ptr();
        if !trees.first().is_some_and(same_mesh) {
            trees = in_all_layouts(set.mesh(), choices, settings)?;
        }
        let tested = set.mesh().usable_triangles().len().max(1) as u64;
        let by_brute_force = rays.min(MOST_TESTS / tested);
        let chunk = |chunk: u64| {
            let first = chunk * CHUNK;
            let last = rays.min(first + CHUNK);
            let mut leaks = vec![Leaks::default(); table.rows.len()];
            let mut all = Vec::new();
            let probes: Vec<Probe> = (first..last).map(|i| set.probe(i)).collect();
            let batches: Vec<_> = trees.iter().map(|t| Batch::both(t, &probes)).collect();
            for (i, probe) in probes.iter().enumerate() {
                let mesh = (first + (i as u64) < by_brute_force).then_some(set.mesh());
                let asked = trees.iter().zip(&batches);
                ask(probe, i, asked, mesh, &mut all, &mut leaks);
            }
            let before = done.fetch_add(last - first, Ordering::Relaxed);
            progress.advanced(before + last - first, total);
            leaks
        };
        let add = |mut sum: Vec<Leaks>, leaks: Vec<Leaks>| {
            for (sum, leaks) in sum.iter_mut().zip(leaks) {
                *sum += leaks;
            }
            sum
        };
        let none = || vec![Leaks::default(); table.rows.len()];
        let chunks = rays.div_ceil(CHUNK);
        let leaks = pool.install(|| (0..chunks).into_par_iter().map(chunk).reduce(none, add));
        for (row, leaks) in table.rows.iter_mut().zip(leaks) {
            row.leaks.push(leaks);
        }
        table.by_brute_force.push(by_brute_force);
    }
    Ok(table)
}

/// Each tree in each layout, in the order of the table's rows.
fn in_all_layouts(
    mesh: &Mesh,
    choices: &[TreeChoice],
    settings: &Settings,
) -> Result<Vec<Tree>, LabError> {
    let mut trees = Vec::with_capacity(choices.len() * Layout::ALL.len());
    for &choice in choices {
        let binary = build(mesh, choice, settings, &())?.tree;
        for layout in Layout::ALL {
            let tree = Tree::clone(&binary).with_layout(layout);
            trees.push(tree.map_err(|source| LabError::Build {
                tree: choice.to_string(),
                source,
            })?);
        }
    }
    Ok(trees)
}

/// What a tree answered a batch of rays.
struct Batch {
    closest: Vec<Option<Hit>>,
    any: Vec<bool>,
}

impl Batch {
    /// When they went through it together, however far apart, and when each went alone.
    fn both(tree: &Tree, probes: &[Probe]) -> [Batch; 2] {
        let rays: Vec<Ray> = probes.iter().map(|probe| probe.ray).collect();
        [Coherence::Coherent, Coherence::Incoherent].map(|coherence| {
            let mut batch = Batch {
                closest: vec![None; rays.len()],
                any: vec![false; rays.len()],
            };
            tree.closest_hits_as(coherence, &rays, &mut batch.closest);
            tree.any_hits_as(coherence, &rays, &mut batch.any);
            batch
        })
    }
}

/// Asks all trees one ray, and what they answered it as the one of that index in batches. The truth
/// is that of brute force where the mesh is given; `all` is room for hits.
fn ask<'t>(
    Probe { ray, expect }: &Probe,
    index: usize,
    trees: impl Iterator<Item = (&'t Tree, &'t [Batch; 2])> + Clone,
    mesh: Option<&Mesh>,
    all: &mut Vec<Hit>,
    leaks: &mut [Leaks],
) {
    let answers: Vec<Option<Hit>> = (trees.clone())
        .map(|(tree, _)| tree.closest_hit(ray, &mut ()))
        .collect();
    let truth = if let Some(mesh) = mesh {
        brute_force(mesh, ray)
    } else {
        let hits = answers.iter().flatten().copied();
        hits.min_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)))
    };
    leaks[0] += Leaks::of(truth, truth, *expect, Hit::eq);
    for (((tree, batches), answer), leaks) in trees.zip(answers).zip(&mut leaks[1..]) {
        let mut found = Leaks::of(answer, truth, *expect, Hit::eq);
        if found.is_tight() {
            tree.all_hits(ray, all, &mut ());
            let mut right = all.first() == truth.as_ref();
            right &= tree.any_hit(ray, &mut ()) == truth.is_some();
            for batch in batches {
                right &= batch.closest[index] == truth && batch.any[index] == truth.is_some();
            }
            if !right {
                found = Leaks::WRONG;
            }
        }
        *leaks += found;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preset;
    use splitplane::{TREES, Traversal};

    fn choices() -> Vec<TreeChoice> {
        let choice = |spec: &splitplane::TreeSpec| TreeChoice::new(spec.name, None);
        TREES.iter().map(choice).collect::<Result<_, _>>().unwrap()
    }

    #[test]
    fn no_tree_leaks() {
        for preset in [Preset::Default, Preset::Thesis] {
            let settings = Settings::of_preset(preset);
            let table = verify(probe_sets(), &choices(), 500, &settings, &()).unwrap();
            assert_eq!(table.rows.len(), 1 + Layout::ALL.len() * TREES.len());
            for row in &table.rows {
                for (set, leaks) in table.sets.iter().zip(&row.leaks) {
                    assert!(leaks.is_tight(), "{}: {}: {leaks}", row.name, set.name());
                }
            }
            assert!(table.is_tight());
        }
    }

    #[test]
    fn a_traversal_without_margins_is_found_out() {
        let settings = Settings {
            traversal: Traversal::AsPublished,
            ..Settings::of_preset(Preset::Thesis)
        };
        let choices = ["wn+kd:6".parse().unwrap()];
        let table = verify(probe_sets(), &choices, 2_000, &settings, &()).unwrap();
        assert!(table.rows[0].leaks.iter().all(|leaks| leaks.is_tight()));
        assert!(!table.is_tight());
    }

    #[test]
    fn rays_do_not_depend_on_threads() {
        for set in probe_sets() {
            for i in [0, 7, 1_000_000_007] {
                assert_eq!(set.probe(i), set.probe(i), "{}", set.name());
            }
        }
    }

    #[test]
    fn a_wrong_answer_is_told_from_a_miss() {
        let hit = |t| Hit {
            t,
            u: 0.0,
            v: 0.0,
            triangle: 3,
        };
        let leaks = |answer, truth, expect| Leaks::of(answer, truth, expect, Hit::eq).to_string();
        let any = Expect::AsBruteForce;
        assert_eq!(leaks(Some(hit(1.0)), Some(hit(1.0)), any), "0");
        assert_eq!(leaks(None, None, any), "0");
        assert_eq!(leaks(None, Some(hit(1.0)), any), "1 missed");
        assert_eq!(leaks(Some(hit(2.0)), Some(hit(1.0)), any), "1 wrong");
        assert_eq!(leaks(Some(hit(2.0)), None, any), "1 wrong");
        assert_eq!(leaks(None, None, Expect::Hit), "1 missed");
        let own = Expect::NotOn(3);
        assert_eq!(leaks(Some(hit(1.0)), Some(hit(1.0)), own), "1 wrong");
    }
}
