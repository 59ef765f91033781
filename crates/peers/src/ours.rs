//! Our own trees: NAME, NAME/PRESET, each also with @LAYOUT.

use anyhow::{Result, bail};
use splitplane::{Coherence, Counts, Hit, Layout, Mesh, Ray, Tree, TreeChoice};
use splitplane_lab::Preset;

use crate::contender::{Contender, Work, each};
use crate::rays::Kind;

/// Rays of a call: so few that the calling thread, whose time is measured, answers them itself.
const BATCH: usize = 1024;

/// How a tree is asked.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Asked {
    /// Stored as a binary tree, one ray after the other.
    Binary,
    /// Stored in wide nodes, one ray after the other.
    Wide,
    /// Stored in wide nodes, [`BATCH`] rays in one call.
    Batch(Coherence),
}

/// A tree.
pub struct Ours {
    tree: Tree,
    asked: Asked,
}

impl Ours {
    /// A tree that is built.
    pub fn of(tree: Tree) -> Self {
        Ours {
            tree,
            asked: Asked::Binary,
        }
    }

    /// Builds `wn+kd:6@binary`, `wn+kd:6/fast@wide` or the like.
    pub fn build(name: &str, mesh: &Mesh, threads: usize) -> Result<Self> {
        let (tree, layout) = name.split_once('@').unwrap_or((name, "binary"));
        let (tree, preset) = tree
            .split_once('/')
            .unwrap_or((tree, Preset::Default.name()));
        let choice: TreeChoice = tree.parse()?;
        let params = preset.parse::<Preset>()?.params();
        let asked = match layout {
            "binary" => Asked::Binary,
            "wide" => Asked::Wide,
            "batch" => Asked::Batch(Coherence::Unknown),
            "packets" => Asked::Batch(Coherence::Coherent),
            "alone" => Asked::Batch(Coherence::Incoherent),
            _ => bail!(
                "there is no layout \"{layout}\"; there are binary, wide, batch, and batches of \
                 packets or of rays that go alone"
            ),
        };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()?;
        let layout = match asked {
            Asked::Binary => Layout::Binary,
            Asked::Wide | Asked::Batch(_) => Layout::Wide,
        };
        let tree = pool.install(|| Tree::build(mesh, choice, &params)?.with_layout(layout))?;
        Ok(Ours { tree, asked })
    }
}

impl Contender for Ours {
    fn closest(&self, _: Kind, rays: &[Ray], hits: &mut [Option<Hit>]) {
        match self.asked {
            Asked::Binary | Asked::Wide => {
                each(rays, hits, |ray| self.tree.closest_hit(ray, &mut ()))
            }
            Asked::Batch(how) => {
                for (rays, hits) in rays.chunks(BATCH).zip(hits.chunks_mut(BATCH)) {
                    self.tree.closest_hits_as(how, rays, hits);
                }
            }
        }
    }

    fn any(&self, _: Kind, rays: &[Ray], hits: &mut [bool]) {
        match self.asked {
            Asked::Binary | Asked::Wide => each(rays, hits, |ray| self.tree.any_hit(ray, &mut ())),
            Asked::Batch(how) => {
                for (rays, hits) in rays.chunks(BATCH).zip(hits.chunks_mut(BATCH)) {
                    self.tree.any_hits_as(how, rays, hits);
                }
            }
        }
    }

    fn bytes(&self) -> u64 {
        self.tree.card().bytes
    }

    fn work(&self, kind: Kind, rays: &[Ray]) -> Work {
        let mut counts = Counts::default();
        for ray in rays {
            if kind.any_hit() {
                self.tree.any_hit(ray, &mut counts);
            } else {
                self.tree.closest_hit(ray, &mut counts);
            }
        }
        Work {
            visits: Some(counts.kd_visits + counts.oblique_visits + counts.wide_visits),
            blocks: Some(counts.leaf_visits),
            tests: Some(counts.triangle_tests),
        }
    }

    fn move_elsewhere(&mut self) {
        // The old place is free only once the new one is taken.
        self.tree = self.tree.clone();
    }

    fn is_exact(&self) -> bool {
        true
    }
}
