//! The record of a run: what was measured, and what it takes to measure it again.

use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};
use splitplane::{Layout, Mesh, TreeCard, WideCard, Wins};
use splitplane_render::render::RayKinds;

use crate::machine::Machine;
use crate::params::ParamsRecord;
use crate::{Built, LabError, Settings, write_whole};

/// One run: one tree, built and rendered. As JSON, its fields have these names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The tree, without its number of directions: `wn+kd`.
    pub tree: String,
    /// The number of directions tested in a node; null for trees that take none.
    pub k: Option<u32>,
    /// The scene, by its short name.
    pub scene: String,
    /// Triangles of the scene.
    pub triangles: u64,
    /// Triangles among them that no ray can hit (not finite, or without area), and that the tree
    /// leaves out.
    pub triangles_skipped: u64,
    /// Copies of the scene's objects; `triangles` has the triangles of all of them.
    #[serde(default)]
    pub instances: u64,
    /// Whether each object has a tree of its own, which all its copies share; else they were copied
    /// into the scene's mesh. Nodes, references and bytes are sums over these trees, expected costs
    /// are weighted by how probably a ray meets a copy's box, and visits of the hierarchy over the
    /// copies count as kd visits.
    #[serde(default)]
    pub instances_kept: bool,
    /// Triangles of the scene where those of an object count once.
    #[serde(default)]
    pub unique_triangles: u64,
    /// What a reader of the figures should know of the scene: how it was approximated, into how many
    /// triangles its curved shapes were divided, what was absent; each with its place.
    #[serde(default)]
    pub scene_notes: Vec<String>,
    /// Which of several runs of the same tree, from 0.
    pub repetition: u32,
    /// Seed of the build's random draws.
    pub seed: u64,
    /// Seed of the samples.
    pub sample_seed: u64,
    /// Threads that built and rendered.
    pub threads: usize,
    /// Samples per pixel.
    pub spp: u32,
    /// Pixels in a full row of the picture.
    pub width: u32,
    /// Full rows of the picture.
    pub height: u32,
    /// The part of the picture that was rendered, `[x_min, x_max, y_min, y_max]` in fractions.
    pub crop: [f32; 4],
    /// Pixels that were rendered.
    pub pixels: u64,
    /// How light was gathered: `path`, `directlighting`, `ambientocclusion`.
    pub integrator: String,
    /// The most bounces; null for an integrator without bounces.
    pub max_depth: Option<u32>,
    /// The name of the build parameters; single ones may differ, see `build_params`.
    pub preset: String,
    /// The build parameters.
    pub build_params: ParamsRecord,
    /// How queries decided which cells a ray passes: "exact" or "published".
    pub traversal: String,
    /// Time to build the tree, in seconds.
    pub build_s: f64,
    /// Time to render the picture, in seconds.
    pub render_s: f64,
    /// The layout of the tree that the picture was rendered with for its time: "binary" or "wide".
    #[serde(default = "binary")]
    pub layout: String,
    /// Time to bring the tree from the binary layout, in which it is built, into the wide one, in
    /// seconds; null where it was not.
    #[serde(default)]
    pub layout_s: Option<f64>,
    /// Whether counters ran while `render_s` was taken.
    pub counted_while_timed: bool,
    /// Processors that other processes kept busy while the tree was built or the picture rendered,
    /// whichever was more; null where the system does not say, or it was too short to tell.
    #[serde(default)]
    pub others_load: Option<f64>,
    /// Nodes by kind.
    pub nodes: NodeRecord,
    /// Triangle references in all leaves.
    pub references: u64,
    /// Depth of the deepest leaf; the root's is 0.
    pub depth: u32,
    /// Times a node was split although no split beat the leaf.
    pub bad_refines: u64,
    /// SAH cost, normalised by the root's area.
    pub sah_cost: f64,
    /// Bytes of nodes and references, in the binary layout.
    pub tree_bytes: u64,
    /// Bytes in the wide layout; null where the tree was not brought into it.
    #[serde(default)]
    pub wide_bytes: Option<u64>,
    /// Rays that were cast.
    pub rays: PerRay,
    /// The layout of the tree whose tests and visits were counted: "binary" or "wide".
    #[serde(default = "binary")]
    pub counts_layout: String,
    /// Triangles tested.
    pub triangle_tests: PerRay,
    /// Axis-aligned interior nodes visited.
    pub kd_visits: PerRay,
    /// Interior nodes with an oblique plane visited.
    pub oblique_visits: PerRay,
    /// Leaves visited.
    pub leaf_visits: PerRay,
    /// Interior nodes visited in the wide layout, which has no others.
    #[serde(default)]
    pub wide_visits: PerRay,
    /// The most memory that the process had held by the end of the run, in bytes; null where the
    /// system does not say.
    pub peak_memory_bytes: Option<u64>,
    /// The machine, and its load when the run began.
    pub machine: Machine,
    /// Version of Splitplane.
    pub version: String,
    /// Commit of Splitplane; "unknown" where it was built outside its repository.
    pub commit: String,
}

fn binary() -> String {
    Layout::Binary.name().to_owned()
}

/// Nodes by kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NodeRecord {
    /// Axis-aligned interior nodes.
    pub kd: u64,
    /// Interior nodes with an oblique plane.
    pub oblique: u64,
    /// Leaves, the empty ones included.
    pub leaf: u64,
    /// Leaves without a triangle.
    pub empty_leaf: u64,
}

impl NodeRecord {
    /// All nodes.
    pub fn total(&self) -> u64 {
        self.kd + self.oblique + self.leaf
    }
}

impl From<splitplane::NodeCounts> for NodeRecord {
    fn from(nodes: splitplane::NodeCounts) -> Self {
        NodeRecord {
            kd: nodes.kd,
            oblique: nodes.oblique,
            leaf: nodes.leaf,
            empty_leaf: nodes.empty_leaf,
        }
    }
}

impl From<RayKinds<u64>> for PerRay {
    fn from(kinds: RayKinds<u64>) -> Self {
        PerRay {
            camera: kinds.camera,
            bounce: kinds.bounce,
            shadow: kinds.shadow,
        }
    }
}

/// A number for each kind of ray. Camera and bounce rays look for the closest hit, shadow rays
/// for any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PerRay {
    /// Rays from the camera.
    pub camera: u64,
    /// Rays from surfaces onward.
    pub bounce: u64,
    /// Rays from surfaces to lights.
    pub shadow: u64,
}

impl PerRay {
    /// All kinds of rays together.
    pub fn total(&self) -> u64 {
        self.camera + self.bounce + self.shadow
    }

    /// Rays that look for the closest hit.
    pub(crate) fn closest(&self) -> u64 {
        self.camera + self.bounce
    }
}

impl Record {
    /// The tree with its number of directions: `wn+kd:6`.
    pub fn tree_with_k(&self) -> String {
        match self.k {
            Some(k) => format!("{}:{k}", self.tree),
            None => self.tree.clone(),
        }
    }

    /// Whether others kept the machine busy while times were taken, so that they mean little: more
    /// than a tenth of a processor. Where the system does not tell that, whether the machine was
    /// busy before.
    pub fn was_disturbed(&self) -> bool {
        match self.others_load {
            Some(load) => load > 0.1,
            None => self.machine.is_busy(),
        }
    }

    /// Visits of interior nodes, whatever their kind.
    pub fn interior_visits(&self) -> PerRay {
        let sum = |pick: fn(&PerRay) -> u64| {
            pick(&self.kd_visits) + pick(&self.oblique_visits) + pick(&self.wide_visits)
        };
        PerRay {
            camera: sum(|r| r.camera),
            bounce: sum(|r| r.bounce),
            shadow: sum(|r| r.shadow),
        }
    }

    /// Whether two runs counted the same: nodes, rays, tests and visits.
    pub fn counts_like(&self, other: &Record) -> bool {
        let counts = |r: &Record| {
            (
                (r.nodes, r.references, r.depth, r.bad_refines),
                (r.rays, r.triangle_tests),
                (r.kd_visits, r.oblique_visits, r.leaf_visits, r.wide_visits),
            )
        };
        counts(self) == counts(other)
    }
}

/// Version and commit of Splitplane.
pub(crate) fn version_and_commit() -> (String, String) {
    (
        env!("CARGO_PKG_VERSION").to_owned(),
        env!("SPLITPLANE_COMMIT").to_owned(),
    )
}

/// A tree card as JSON holds it: [`TreeCard`], and how the tree came to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CardRecord {
    /// The tree, without its number of directions.
    pub tree: String,
    /// The number of directions tested in a node; null for trees that take none.
    pub k: Option<u32>,
    /// The scene, by its short name.
    pub scene: String,
    /// Triangles of the scene.
    pub triangles: u64,
    /// Triangles among them that no ray can hit because a coordinate is not finite or too large.
    pub skipped_not_finite: u64,
    /// Triangles among them that no ray can hit because they have no area.
    pub skipped_degenerate: u64,
    /// Seed of the build's random draws.
    pub seed: u64,
    /// Threads that built.
    pub threads: usize,
    /// The name of the build parameters.
    pub preset: String,
    /// The build parameters.
    pub build_params: ParamsRecord,
    /// Time to build the tree, in seconds.
    pub build_s: f64,
    /// Nodes by kind.
    pub nodes: NodeRecord,
    /// Triangle references in all leaves.
    pub references: u64,
    /// Depth of the deepest leaf; the root's is 0.
    pub depth: u32,
    /// Times a node was split although no split beat the leaf.
    pub bad_refines: u64,
    /// Split candidates whose cost was computed.
    pub candidates: u64,
    /// Splits whose cells kept their parent's shape because it was too thin to be cut.
    pub uncut_cells: u64,
    /// Leaves that are leaves because the tree would have too many references.
    pub limited_leaves: u64,
    /// Triangles in the largest leaf.
    pub largest_leaf: u64,
    /// Leaves by their number of triangles: `[triangles, leaves]`, ascending.
    pub leaf_sizes: Vec<(u32, u64)>,
    /// Interior nodes by depth, `[kd, oblique]`, from the root's.
    pub interior_by_depth: Vec<(u64, u64)>,
    /// Expected interior node visits of a random line through the scene's box.
    pub expected_visits: f64,
    /// Expected triangle tests of such a line, all leaves on it tested.
    pub expected_tests: f64,
    /// Shares of the expected tests by the size of the leaf: `[[triangles, share]]`.
    pub tests_by_leaf_size: Vec<(u32, f64)>,
    /// Interior nodes by what their plane came from.
    pub wins: WinsRecord,
    /// SAH cost, normalised by the root's area.
    pub sah_cost: f64,
    /// Bytes of nodes and references.
    pub tree_bytes: u64,
    /// The tree in the wide layout; null where it was not brought into it. All else is of the tree
    /// as it was built.
    #[serde(default)]
    pub wide: Option<WideRecord>,
    /// The machine, and its load when the build began.
    pub machine: Machine,
    /// Version of Splitplane.
    pub version: String,
    /// Commit of Splitplane.
    pub commit: String,
}

/// Interior nodes by what their plane came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WinsRecord {
    /// Planes across an axis.
    pub axis: u64,
    /// Planes across another direction: fixed, random, a normal, a cluster's centre.
    pub direction: u64,
    /// Planes of triangles.
    pub triangle: u64,
    /// Planes through a triangle's edge, perpendicular to it.
    pub edge: u64,
}

/// A tree in the wide layout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WideRecord {
    /// Nodes with up to eight children.
    pub nodes: u64,
    /// Leaves, each of up to eight triangles.
    pub leaves: u64,
    /// Triangles in all leaves.
    pub references: u64,
    /// Depth of the deepest node; the root's is 0.
    pub depth: u32,
    /// Nodes by the frame of their boxes, the world's axes first.
    pub frames: Vec<u64>,
    /// Bytes of all of it.
    pub bytes: u64,
    /// Time to bring the tree into this layout, in seconds.
    pub seconds: f64,
}

impl WideRecord {
    /// Together with another tree's.
    pub(crate) fn add(&mut self, other: &WideRecord) {
        self.nodes += other.nodes;
        self.leaves += other.leaves;
        self.references += other.references;
        self.depth = self.depth.max(other.depth);
        if self.frames.len() < other.frames.len() {
            self.frames.resize(other.frames.len(), 0);
        }
        for (sum, nodes) in self.frames.iter_mut().zip(&other.frames) {
            *sum += nodes;
        }
        self.bytes += other.bytes;
        self.seconds += other.seconds;
    }

    pub(crate) fn new(card: &WideCard, bytes: u64, seconds: f64) -> WideRecord {
        WideRecord {
            nodes: card.nodes,
            leaves: card.leaves,
            references: card.references,
            depth: card.depth,
            frames: card.frames.clone(),
            bytes,
            seconds,
        }
    }
}

impl From<Wins> for WinsRecord {
    fn from(wins: Wins) -> Self {
        let Wins {
            axis,
            direction,
            triangle,
            edge,
        } = wins;
        WinsRecord {
            axis,
            direction,
            triangle,
            edge,
        }
    }
}

impl CardRecord {
    /// The record of a tree that [`crate::build`] built.
    pub fn new(built: &Built, scene: &str, settings: &Settings) -> CardRecord {
        let (version, commit) = version_and_commit();
        let TreeCard {
            choice,
            triangles: _,
            nodes,
            references,
            depth,
            largest_leaf,
            leaf_sizes,
            depths,
            expected_visits,
            expected_tests,
            tests_by_leaf_size,
            sah_cost,
            bytes,
            wide: _,
            build,
        } = built.card.clone();
        let sum = |count: fn(&Mesh) -> usize| built.meshes().map(|mesh| count(mesh) as u64).sum();
        CardRecord {
            tree: choice.spec.name.to_owned(),
            k: choice.direction_count,
            scene: scene.to_owned(),
            triangles: sum(|mesh| mesh.triangles().len()),
            skipped_not_finite: sum(|mesh| mesh.skipped().not_finite),
            skipped_degenerate: sum(|mesh| mesh.skipped().degenerate),
            seed: settings.params.seed,
            threads: built.threads,
            preset: settings.preset.name().to_owned(),
            build_params: ParamsRecord::from(&settings.params),
            build_s: built.seconds,
            nodes: nodes.into(),
            references,
            depth,
            bad_refines: build.bad_refines,
            candidates: build.candidates,
            uncut_cells: build.uncut_cells,
            limited_leaves: build.limited_leaves,
            largest_leaf,
            leaf_sizes,
            interior_by_depth: depths,
            expected_visits,
            expected_tests,
            tests_by_leaf_size,
            wins: build.wins.into(),
            sah_cost,
            tree_bytes: bytes,
            wide: built.wide_card.clone(),
            machine: built.machine.clone(),
            version,
            commit,
        }
    }
}

/// Writes records to a file as one JSON array; the file is there whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn write_records(path: &Path, records: &[Record]) -> Result<(), LabError> {
    write_whole(path, |file| {
        serde_json::to_writer_pretty(&mut *file, records)?;
        file.write_all(b"\n")
    })
    .map_err(|source| LabError::Write {
        path: path.to_owned(),
        source,
    })
}
