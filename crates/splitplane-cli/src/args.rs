//! What the command line says.

use std::path::{Path, PathBuf};

use clap::builder::{
    BoolishValueParser, PathBufValueParser, PossibleValue, PossibleValuesParser, TypedValueParser,
};
use clap::{Args, Parser, Subcommand, ValueEnum, value_parser};
use splitplane::{Axis, Layout, ObliquePricing, ParseTreeError, Ties, Traversal, TreeChoice};
use splitplane_lab::{
    MOST_SAMPLES, Preset, Resolution, Settings, crop_named, ties_named, traversal_named,
};
use splitplane_render::render::RenderSettings;
use splitplane_render::scene::Instancing;

/// Ray queries on triangle meshes with BSP trees whose split planes come from triangle normals:
/// render a scene, build a tree, compare trees.
#[derive(Debug, Parser)]
#[command(
    name = "splitplane",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = "Examples:
  splitplane compare truck --trees kd,wn+kd:6
  splitplane render scene.pbrt --tree wn+kd:6 --spp 16
  splitplane build model.ply --tree kd
  splitplane cast model.ply --rays rays.npy --out hits.npz
  splitplane slice arcade --tree wn+kd:6 --axis y --at 0.2 -o slice.svg

Exit codes: 0 done, 1 results differ that must not, 2 bad input, 130 interrupted."
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    Render(RenderCommand),
    Check(CheckCommand),
    Build(BuildCommand),
    Compare(CompareCommand),
    Reproduce(ReproduceCommand),
    Experiment(ExperimentCommand),
    Plan(PlanCommand),
    RunCell(RunCellCommand),
    Merge(MergeCommand),
    Report(ReportCommand),
    Cast(CastCommand),
    Slice(SliceCommand),
    Verify(VerifyCommand),
    Trees(TreesCommand),
    Scenes(ScenesCommand),
}

/// Render a scene to PNG and EXR.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane render truck
  splitplane render killeroo-legs --tree wn+kd:6 --spp 64 --out pictures
  splitplane render room.pbrt --crop 0.4,0.6,0.4,0.6 --max-depth 3
  splitplane render room.pbrt --time 10m

While it renders, the picture so far is written every ten seconds, tile by tile, with a file from
which --resume goes on.")]
pub struct RenderCommand {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub instances: InstanceArgs,
    /// The tree that answers the rays, e.g. kd or wn+kd:6, or a saved one, tree.spt [default: the
    /// one that the scene names, or else the first of `splitplane trees`]
    #[arg(long)]
    pub tree: Option<TreeSource>,
    #[command(flatten)]
    pub build: BuildArgs,
    /// How the tree is stored: wide, for speed, or binary, whose counters are those of papers
    /// [default: wide, but binary with --traversal published]
    #[arg(long, value_name = "LAYOUT", help_heading = "How trees are built")]
    pub layout: Option<Layout>,
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Go on taking samples until so much time is over, e.g. 60s, 5m or 1h; those of --spp are taken
    /// in any case
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub time: Option<f64>,
    /// Go on with the unfinished picture that an interrupted run of the same left in the folder
    /// for output
    #[arg(long)]
    pub resume: bool,
    /// Write the record of the run to this file [default: none]
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    #[command(flatten)]
    pub out: OutArgs,
    #[command(flatten)]
    pub general: GeneralArgs,
}

/// Read a scene and say what is in it and what of it will be approximated, without rendering.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane check room.pbrt
  splitplane check room.glb --json")]
pub struct CheckCommand {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Print JSON instead of text
    #[arg(long)]
    pub json: bool,
}

/// Build a tree over a scene's triangles and print its card: nodes, leaves, expected cost.
///
/// Several trees, or several builds of them, give a table of their build times, interleaved.
/// With --out, the tree is saved, for the --tree of other commands on the same scene.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane build truck --tree wn+kd:6
  splitplane build truck --tree kd,wn+kd:6,ize-kd --repeat 5 --threads 1
  splitplane build truck --tree wn+kd:6 --timeline build.json
  splitplane build model.ply --tree kd --preset thesis --json
  splitplane build model.ply --tree wn+kd:6 --layout wide -o model.spt
  splitplane cast model.ply --tree model.spt --rays rays.npy --out hits.npz")]
pub struct BuildCommand {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The tree, e.g. kd or wn+kd:6; several, separated by commas, are compared with the first; or
    /// a saved one, tree.spt
    #[arg(long, required = true, value_delimiter = ',', value_name = "TREE,...")]
    pub tree: Vec<TreeSource>,
    /// Save the tree to this file
    #[arg(long, short, value_name = "FILE.spt")]
    pub out: Option<PathBuf>,
    /// Build each tree this many times, interleaved; times are medians
    #[arg(long, default_value_t = 1, value_name = "N", allow_negative_numbers = true, value_parser = value_parser!(u32).range(1..=1000))]
    pub repeat: u32,
    #[command(flatten)]
    pub build: BuildArgs,
    /// Bring the tree into this layout, binary or wide, after it is built: the wide one answers
    /// several times as fast [default: binary, but a saved tree stays as it is]
    #[arg(long, value_name = "LAYOUT", help_heading = "How trees are built")]
    pub layout: Option<Layout>,
    /// Write what each thread did and when, as trace events for Perfetto or chrome://tracing
    #[arg(long, value_name = "FILE.json")]
    pub timeline: Option<PathBuf>,
    /// Print the card as JSON; the cards of all builds where there are several
    #[arg(long)]
    pub json: bool,
    /// Print the table as Markdown
    #[arg(long)]
    pub markdown: bool,
    #[command(flatten)]
    pub general: GeneralArgs,
}

/// Render a scene with several trees and compare what each costs.
///
/// Each tree is built, renders the scene without counters for its time, and once more with
/// counters. All pictures must be the same, bit by bit; but with --traversal published each tree
/// may have its own, and it is told in how many pixels they differ.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane compare truck --trees kd,wn+kd:6
  splitplane compare killeroo-legs --trees kd,wn+kd:3,wn+kd:6 --repeat 7 --threads 1
  splitplane compare arcade:200000 --trees kd,wn+kd:6 --ties tolerant --spp 4")]
pub struct CompareCommand {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub instances: InstanceArgs,
    /// The trees, separated by commas; the first is the measure of the others
    #[arg(
        long,
        required = true,
        value_delimiter = ',',
        value_name = "TREE,TREE,..."
    )]
    pub trees: Vec<TreeChoice>,
    /// Build and render with each tree this many times, interleaved; times are medians
    #[arg(long, default_value_t = 1, value_name = "N", allow_negative_numbers = true, value_parser = value_parser!(u32).range(1..=1000))]
    pub repeat: u32,
    #[command(flatten)]
    pub build: BuildArgs,
    /// How trees are stored: wide or binary [default: wide where time is taken, binary where tests
    /// and visits are counted, as papers count them; binary alone with --traversal published]
    #[arg(long, value_name = "LAYOUT", help_heading = "How trees are built")]
    pub layout: Option<Layout>,
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Write the records to this file [default: SCENE.json in the folder for output]
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Write a report as well, with tables, plots and pictures: report.html
    #[arg(long)]
    pub report: bool,
    #[command(flatten)]
    pub out: OutArgs,
    #[command(flatten)]
    pub general: GeneralArgs,
}

/// Measure the thesis's trees on one of its scenes, beside the figures that were published.
///
/// Every tree is built with the thesis's parameters, with either way to treat ties, and renders
/// the scene with either traversal, counting. Counts are exact and do not depend on the machine.
/// Deviations from the published figures by more than a tenth are marked.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane reproduce
  splitplane reproduce --subdivide 0 --out control-mesh.md
  splitplane reproduce truck --trees kd,wn+kd:6 --resolution 300")]
pub struct ReproduceCommand {
    /// A scene by name (see `splitplane scenes`), or a file
    #[arg(default_value = "killeroo-legs")]
    pub scene: String,
    #[command(flatten)]
    pub load: LoadArgs,
    /// The trees, separated by commas; the first is the measure of the others [default: those of
    /// the thesis, with its numbers of directions, and the others of `splitplane trees`]
    #[arg(long, value_delimiter = ',', value_name = "TREE,TREE,...")]
    pub trees: Vec<TreeChoice>,
    /// Seed of the directions that are drawn at random
    #[arg(
        long,
        default_value_t = 0,
        value_name = "N",
        allow_negative_numbers = true
    )]
    pub seed: u64,
    /// Samples per pixel
    #[arg(long, default_value_t = 8, value_name = "N", allow_negative_numbers = true, value_parser = samples())]
    pub spp: u32,
    /// Size of the full picture in pixels; a width alone keeps the scene's proportions
    #[arg(long, default_value = "1000", value_name = "WxH or W", allow_negative_numbers = true, value_parser = str::parse::<Resolution>)]
    pub resolution: Resolution,
    /// Print the tables as Markdown
    #[arg(long)]
    pub markdown: bool,
    /// Write the tables to this file, as Markdown [default: none]
    #[arg(long, value_name = "FILE.md")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub general: GeneralArgs,
}

/// Run a grid of trees, scenes and parameters, and report.
///
/// Each run is a process of its own and is written once it is done, so nothing is lost when the
/// experiment is interrupted: --resume goes on where it stopped. Timed runs are single-threaded and
/// take turns (A B C A B C); runs that only count go side by side. A run that crashes or takes too
/// long is a line with its reason. Ends with report.html, tables as CSV and JSON, plots as SVG.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane experiment experiments/thesis-comparison.toml --quick
  splitplane experiment experiments/thesis-k-sweep.toml --out sweep
  splitplane experiment experiments/thesis-k-sweep.toml --out sweep --resume

A file of an experiment:
  title = \"Ties\"
  timed = true
  repetitions = 7
  scenes = [\"truck\", { name = \"grove\", spp = 4 }]
  trees = [\"kd\", \"wn+kd\"]       # the first is the measure of the others
  [grid]                         # all combinations; any of --help's names below
  k = [4, 6]
  ties = [\"published\", \"tolerant\"]
  [quick]                        # what --quick puts in place of the above
  repetitions = 1

Axes: k, preset, ties, clip, oblique_up_to, oblique_pricing, traversal, layout, intersection_cost,
kd_traversal_cost, oblique_traversal_cost, alpha, empty_bonus, max_prims, seed, sample_seed,
threads, spp, resolution, crop, max_depth.")]
pub struct ExperimentCommand {
    #[command(flatten)]
    pub file: ExperimentArgs,
    /// Go on with the experiment in the folder: run what is missing
    #[arg(long)]
    pub resume: bool,
    /// With --resume, run again what failed
    #[arg(long, requires = "resume")]
    pub retry_failed: bool,
    /// Counting runs at a time [default: one per core]; timed runs are always alone
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
}

/// Which experiment, and where its results go.
#[derive(Debug, Args)]
pub struct ExperimentArgs {
    /// The file of the experiment
    #[arg(value_name = "GRID.toml")]
    pub file: PathBuf,
    /// Take what the file's table `quick` says in place of the rest
    #[arg(long)]
    pub quick: bool,
    /// The folder of the results [default: out/ and the file's name]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub search: SearchArgs,
    /// No progress, notes or warnings
    #[arg(long, short)]
    pub quiet: bool,
}

/// Plan an experiment without running it: for engines that run its cells on many machines.
///
/// Writes plan.json, which lists the cells with their ids. `splitplane run-cell DIR ID` runs one,
/// on any machine that sees the folder; `splitplane merge DIR` gathers what they gave.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane plan experiments/thesis-comparison.toml --out DIR --adapter hyperqueue
  python DIR/hyperqueue-cells.py --local-workers 2
  splitplane plan experiments/thesis-comparison.toml --out DIR --adapter slurm
  cd DIR && mkdir -p logs && sbatch slurm-cells.sh
  splitplane merge DIR")]
pub struct PlanCommand {
    #[command(flatten)]
    pub file: ExperimentArgs,
    /// Write the script that has this engine run the cells
    #[arg(long, value_enum, ignore_case = true)]
    pub adapter: Option<Engine>,
}

/// An engine that runs jobs on many machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Engine {
    /// HyperQueue (`pip install hyperqueue`)
    Hyperqueue,
    /// A job array of SLURM
    Slurm,
}

/// Run one cell of a plan, unless it is done, and write its result.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane run-cell DIR 3f2a90c417d8be65
  splitplane run-cell DIR \"$SLURM_ARRAY_TASK_ID\"")]
pub struct RunCellCommand {
    /// The folder of the plan
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// The cell's id; or its place in the plan, from 0
    #[arg(value_name = "CELL")]
    pub cell: String,
    #[command(flatten)]
    pub search: SearchArgs,
    /// Run it again if it failed
    #[arg(long)]
    pub retry_failed: bool,
    /// Run it in this process, print the result, and end when the standard input does
    #[arg(long, hide = true)]
    pub worker: bool,
}

/// Gather the results of a plan's cells, check them, and report.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane merge DIR
  splitplane merge DIR --from OTHER_DIR --from ANOTHER_DIR")]
pub struct MergeCommand {
    /// The folder of the plan
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// A folder that results of the same plan were written to; may be repeated
    #[arg(long, value_name = "DIR", value_parser = PathBufValueParser::new().try_map(folder))]
    pub from: Vec<PathBuf>,
}

/// Write the report of an experiment: report.html, tables as CSV and JSON, plots as SVG.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  splitplane report DIR")]
pub struct ReportCommand {
    /// The folder of the experiment
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// Cast rays from a NumPy file at a mesh and write the hits as NumPy arrays.
///
/// RAYS.npy is an array of numbers (N,6): origin and direction, or (N,8): origin, direction,
/// tnear, tfar; float32 (float64 is rounded to it). Hits count where tnear < t <= tfar, t in
/// multiples of the direction's length. A ray with a NaN or an infinite number (tfar apart), or
/// without a direction, misses.
///
/// HITS.npz holds, for `closest`: t (float32, inf: a miss), triangle (uint32, 0xFFFFFFFF: a miss;
/// in the order of the file, after triangulation), u and v (float32, the weights of the
/// triangle's second and third vertex); for `any`: occluded (bool).
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane cast model.ply --rays rays.npy --out hits.npz
  splitplane cast truck --rays rays.npy --query any --tree wn+kd:6 --out hits.npz

In Python:
  np.save('rays.npy', np.hstack([origins, directions]).astype(np.float32))
  hits = np.load('hits.npz'); hits['t'], hits['triangle']")]
pub struct CastCommand {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The rays
    #[arg(long, value_name = "RAYS.npy")]
    pub rays: PathBuf,
    /// What to look for along each ray
    #[arg(long, value_enum, default_value_t = Query::Closest, ignore_case = true)]
    pub query: Query,
    /// The tree that answers, e.g. kd or wn+kd:6, or a saved one, tree.spt [default: the first of
    /// `splitplane trees`]
    #[arg(long)]
    pub tree: Option<TreeSource>,
    #[command(flatten)]
    pub build: BuildArgs,
    /// How the tree is stored, wide or binary; hits are the same [default: wide, but binary with
    /// --traversal published]
    #[arg(long, value_name = "LAYOUT", help_heading = "How trees are built")]
    pub layout: Option<Layout>,
    /// Where the hits go
    #[arg(long, value_name = "HITS.npz")]
    pub out: PathBuf,
    #[command(flatten)]
    pub general: GeneralArgs,
}

/// What to look for along a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Query {
    /// The nearest hit
    Closest,
    /// Whether anything is hit
    Any,
}

/// Draw the cells of a tree, cut by a plane across an axis, as SVG.
///
/// Lines show where the plane meets split planes, each in its node's cell: kd planes and oblique
/// ones in two colours, the finer the deeper. On top is the cross-section of the triangles; cells
/// are shaded by how many triangles they have. For a bounding volume hierarchy its boxes are drawn.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane slice arcade --tree kd --axis y --at 0.2 -o kd.svg
  splitplane slice arcade --tree wn+kd:6 --axis y --at 0.2 -o wn+kd.svg
  splitplane slice truck --tree wn+kd:6 --depth 12 -o top.svg
  splitplane slice truck --tree wn+kd:6 --zoom 0.1,0.3,0.2,0.6 -o detail.svg")]
pub struct SliceCommand {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The tree, e.g. kd or wn+kd:6, or a saved one in the binary layout, tree.spt
    #[arg(long)]
    pub tree: TreeSource,
    /// The axis that the plane lies across
    #[arg(long, value_enum, default_value_t = AxisName::Z, ignore_case = true)]
    pub axis: AxisName,
    /// Where along the axis: a fraction of the scene's box, from 0 to 1
    #[arg(long, default_value_t = 0.5, value_name = "FRACTION", value_parser = fraction, allow_hyphen_values = true)]
    pub at: f64,
    /// Divide cells down to this depth [default: to the leaves]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = value_parser!(u32).range(0..=10_000))]
    pub depth: Option<u32>,
    /// The part to draw, in fractions of the picture from its left and top
    #[arg(long, default_value = "0,1,0,1", value_name = "X0,X1,Y0,Y1", value_parser = crop_named, allow_hyphen_values = true)]
    pub zoom: [f32; 4],
    /// Width of the picture in pixels
    #[arg(long, default_value_t = 1000, value_name = "PIXELS", allow_negative_numbers = true, value_parser = value_parser!(u32).range(100..=65_536))]
    pub width: u32,
    #[command(flatten)]
    pub build: BuildArgs,
    /// Where the picture goes
    #[arg(long, short, value_name = "FILE.svg")]
    pub out: PathBuf,
    #[command(flatten)]
    pub general: GeneralArgs,
}

/// An axis, by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum AxisName {
    X,
    Y,
    Z,
}

impl From<AxisName> for Axis {
    fn from(name: AxisName) -> Axis {
        match name {
            AxisName::X => Axis::X,
            AxisName::Y => Axis::Y,
            AxisName::Z => Axis::Z,
        }
    }
}

/// Cast rays that are lost easily, and count wrong answers.
///
/// Sets of rays, the same in every run: from inside closed surfaces, at vertices and edges, in and
/// along planes where trees split, grazing, from far away, with zero components, leaving surfaces.
/// Every answer of every tree must be that of testing all triangles, bit for bit, and any-hit must
/// agree. Without a scene the rays are cast at small meshes that are made for them. In a large scene
/// not all rays can be tested that way: the others are held to the nearest hit of all trees.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane verify
  splitplane verify --rays 1e7 --trees wn+kd:6
  splitplane verify truck --rays 1e6

Exit code 1 where any answer is wrong.")]
pub struct VerifyCommand {
    /// A scene by name (see `splitplane scenes`), or a file [default: meshes made for this]
    pub scene: Option<String>,
    #[command(flatten)]
    pub load: LoadArgs,
    /// Rays of each set, such as 1000000 or 1e6; of a large scene begin with 1e3, since rays from far
    /// away visit most of it
    #[arg(long, default_value = "1e5", value_name = "N", value_parser = rays, allow_hyphen_values = true)]
    pub rays: u64,
    /// The trees, separated by commas [default: all]
    #[arg(long, value_delimiter = ',', value_name = "TREE,TREE,...")]
    pub trees: Vec<TreeChoice>,
    #[command(flatten)]
    pub build: BuildArgs,
    /// Print the table as Markdown
    #[arg(long)]
    pub markdown: bool,
    #[command(flatten)]
    pub general: GeneralArgs,
}

/// List the trees that can be built, or explain one.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane trees
  splitplane trees wn+kd

Names are taken in upper or lower case; the thesis's and its pbrt fork's names are taken too. A
tree with :k takes a number of directions, as in wn+kd:6.")]
pub struct TreesCommand {
    /// The tree to explain: where its planes come from, its nodes, its price, its paper
    pub tree: Option<TreeChoice>,
}

/// List the scenes that are known by name, with their triangles and where they were found.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  splitplane scenes
  splitplane scenes --scenes ~/scenes --uncounted")]
pub struct ScenesCommand {
    #[command(flatten)]
    pub search: SearchArgs,
    /// Do not read the scenes that were found to count their triangles
    #[arg(long)]
    pub uncounted: bool,
}

/// A tree that is to be built, or a file that one was saved to.
#[derive(Clone, Debug, PartialEq)]
pub enum TreeSource {
    Built(TreeChoice),
    Saved(PathBuf),
}

impl std::str::FromStr for TreeSource {
    type Err = ParseTreeError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let path = PathBuf::from(text.trim());
        let is_spt = (path.extension()).is_some_and(|end| end.eq_ignore_ascii_case("spt"));
        match text.parse() {
            Err(_) if is_spt || path.is_file() => Ok(TreeSource::Saved(path)),
            choice => choice.map(TreeSource::Built),
        }
    }
}

impl TreeSource {
    /// The file that is read.
    pub fn file(&self) -> Option<&Path> {
        match self {
            TreeSource::Built(_) => None,
            TreeSource::Saved(path) => Some(path),
        }
    }
}

impl std::fmt::Display for TreeSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            TreeSource::Built(choice) => choice.fmt(f),
            TreeSource::Saved(path) => path.display().fmt(f),
        }
    }
}

/// Which scene, and where to find it.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// A scene by name (see `splitplane scenes`), or a file: .pbrt, .pbrt.gz, .gltf, .glb, .ply,
    /// .obj, .stl
    pub scene: String,
    #[command(flatten)]
    pub load: LoadArgs,
}

impl SceneArgs {
    /// The file that is read, where it is one.
    pub fn file(&self) -> &Path {
        Path::new(&self.scene)
    }
}

/// How a scene is read.
#[derive(Debug, Args)]
pub struct LoadArgs {
    /// Put VALUE in place of $NAME in a .pbrt file; may be repeated
    #[arg(long = "define", value_name = "NAME=VALUE", value_parser = definition)]
    pub definitions: Vec<(String, String)>,
    /// Subdivide loopsubdiv surfaces to this level, whatever the file says; 0: the control mesh
    #[arg(long, value_name = "LEVEL", allow_negative_numbers = true, value_parser = value_parser!(u32).range(0..=16))]
    pub subdivide: Option<u32>,
    #[command(flatten)]
    pub search: SearchArgs,
}

/// What becomes of copies of objects.
#[derive(Debug, Args)]
pub struct InstanceArgs {
    /// Copy the instances of objects into one mesh with one tree; else each object has a tree of
    /// its own, which its instances share
    #[arg(long)]
    pub flatten: bool,
}

impl InstanceArgs {
    pub fn how(&self) -> Instancing {
        match self.flatten {
            true => Instancing::Flattened,
            false => Instancing::Kept,
        }
    }
}

/// Where scenes are looked for.
#[derive(Debug, Args)]
pub struct SearchArgs {
    /// Look for scenes in this folder first; may be repeated. After it come those of
    /// SPLITPLANE_SCENES
    #[arg(long, value_name = "DIR", value_parser = PathBufValueParser::new().try_map(folder))]
    pub scenes: Vec<PathBuf>,
}

/// A folder that is there: one that is not would be passed over, and a scene not found.
fn folder(path: PathBuf) -> Result<PathBuf, &'static str> {
    match path.is_dir() {
        true => Ok(path),
        false => Err("there is no such folder"),
    }
}

/// How trees are built.
#[derive(Debug, Args)]
#[command(next_help_heading = "How trees are built")]
pub struct BuildArgs {
    /// Build parameters by name [default: thesis in compare, else default]
    #[arg(long, value_parser = presets(), ignore_case = true)]
    preset: Option<Preset>,
    /// Triangles that touch a split plane: published (as in the thesis) or tolerant [default: as
    /// the preset says]
    #[arg(long, value_parser = ties_named)]
    ties: Option<Ties>,
    /// Perfect splits: of a triangle, only what lies in a node's cell counts there; on or off
    /// [default: as the preset says]
    #[arg(long, value_name = "ON|OFF", value_parser = BoolishValueParser::new(), hide_possible_values = true)]
    clip: Option<bool>,
    /// How oblique nodes are priced in trees with kd nodes [default: as the preset says]
    #[arg(long, value_enum, ignore_case = true)]
    pricing: Option<Pricing>,
    /// Which cells a ray passes: exact (with margins for rounding; the hits are those of brute
    /// force) or published (without, as in the thesis: its counts; hits in split planes may be
    /// missed)
    #[arg(long, default_value = "exact", value_parser = traversal_named)]
    traversal: Traversal,
    /// Seed of the directions that are drawn at random
    #[arg(
        long,
        default_value_t = 0,
        value_name = "N",
        allow_negative_numbers = true
    )]
    seed: u64,
}

fn presets() -> impl TypedValueParser<Value = Preset> {
    let value = |preset: Preset| PossibleValue::new(preset.name()).help(preset.summary());
    PossibleValuesParser::new(Preset::ALL.map(value)).try_map(|name| name.parse::<Preset>())
}

/// How oblique nodes are priced in trees with kd nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Pricing {
    /// As the thesis's text says
    Published,
    /// As the thesis's code does
    Fork,
}

/// What the picture is like; what is not said is as in the scene.
#[derive(Debug, Args)]
#[command(next_help_heading = "The picture [default: as the scene says]")]
pub struct PictureArgs {
    /// Samples per pixel
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = samples())]
    spp: Option<u32>,
    /// Size of the full picture in pixels; a width alone keeps the scene's proportions
    #[arg(long, value_name = "WxH or W", allow_negative_numbers = true, value_parser = str::parse::<Resolution>)]
    resolution: Option<Resolution>,
    /// The part to render, in fractions of the picture from its left and top
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = crop_named, allow_hyphen_values = true)]
    crop: Option<[f32; 4]>,
    /// The most bounces of a path
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = value_parser!(u32).range(0..=10_000))]
    max_depth: Option<u32>,
    /// Seed of the samples; 0 gives those of pbrt-v3
    #[arg(
        long,
        default_value_t = 0,
        value_name = "N",
        allow_negative_numbers = true
    )]
    sample_seed: u64,
}

/// Where output goes.
#[derive(Debug, Args)]
pub struct OutArgs {
    /// The folder for output; it is created
    #[arg(long, default_value = "out", value_name = "DIR")]
    pub out: PathBuf,
}

/// What all commands have.
#[derive(Debug, Args)]
pub struct GeneralArgs {
    /// Threads [default: one per core]; results are the same for any number
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// No progress, notes or warnings
    #[arg(long, short)]
    pub quiet: bool,
}

fn samples() -> impl TypedValueParser<Value = u32> {
    value_parser!(u32).range(1..=i64::from(MOST_SAMPLES))
}

/// A time with its unit, in seconds.
fn duration(text: &str) -> Result<f64, String> {
    let number = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match &text[number.len()..] {
        "s" | "" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => f64::NAN,
    };
    let seconds = number.parse::<f64>().map_or(f64::NAN, |n| n * unit);
    if seconds > 0.0 && seconds.is_finite() {
        Ok(seconds)
    } else {
        Err("takes a time above 0 such as 60s, 5m or 1h".to_owned())
    }
}

/// A number of rays, in digits or as 1e6.
fn rays(text: &str) -> Result<u64, String> {
    let text = text.trim().replace('_', "");
    let number = text.parse::<f64>().ok();
    number
        .filter(|n| (1.0..=1e15).contains(n) && n.fract() == 0.0)
        .map(|n| n as u64)
        .ok_or_else(|| {
            "a number of rays is a whole number up to 1e15, such as 100000 or 1e5".to_owned()
        })
}

fn fraction(text: &str) -> Result<f64, String> {
    let number = text.trim().parse().ok();
    number
        .filter(|number| (0.0..=1.0).contains(number))
        .ok_or_else(|| "a fraction is a number from 0 to 1, such as 0.5".to_owned())
}

fn definition(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((
            name.trim().trim_start_matches('$').to_owned(),
            value.to_owned(),
        )),
        _ => Err("a definition is like NAME=VALUE".to_owned()),
    }
}

impl GeneralArgs {
    /// Threads; 0: one per core.
    pub fn threads(&self) -> usize {
        self.threads.map_or(0, usize::from)
    }
}

impl BuildArgs {
    /// Whether they say how to build, so that they cannot be meant for a tree that is built.
    pub fn say_how(&self) -> bool {
        self.preset.is_some()
            || self.ties.is_some()
            || self.clip.is_some()
            || self.pricing.is_some()
            || self.seed != 0
    }

    /// The settings that the arguments ask for, all of rendering but the threads as in the scene.
    pub fn settings(&self, default: Preset, general: &GeneralArgs) -> Settings {
        let mut settings = Settings::of_preset(self.preset.unwrap_or(default));
        let params = &mut settings.params;
        params.ties = self.ties.unwrap_or(params.ties);
        params.clip = self.clip.unwrap_or(params.clip);
        if let Some(pricing) = self.pricing {
            let (ObliquePricing::Published { alpha } | ObliquePricing::Fork { alpha }) =
                params.oblique_pricing;
            params.oblique_pricing = match pricing {
                Pricing::Published => ObliquePricing::Published { alpha },
                Pricing::Fork => ObliquePricing::Fork { alpha },
            };
        }
        params.seed = self.seed;
        settings.traversal = self.traversal;
        settings.render.threads = general.threads();
        settings
    }
}

/// The layout that was asked for; else the fast one, if it has the traversal.
pub fn layout(given: Option<Layout>, traversal: Traversal) -> Layout {
    given.unwrap_or(match traversal {
        Traversal::Exact => Layout::Wide,
        Traversal::AsPublished => Layout::Binary,
    })
}

impl PictureArgs {
    /// Puts what the arguments ask for into `settings`; the scene's picture is `scene_size`.
    pub fn apply(&self, settings: &mut RenderSettings, scene_size: (u32, u32)) {
        settings.seed = self.sample_seed;
        settings.samples_per_pixel = self.spp;
        settings.resolution = self.resolution.map(|size| size.of(scene_size));
        settings.crop = self.crop;
        settings.max_depth = self.max_depth;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn a_tree_is_a_name_or_a_file() {
        assert_eq!("kd".parse(), Ok(TreeSource::Built("kd".parse().unwrap())));
        let saved = |path: &str| Ok(TreeSource::Saved(PathBuf::from(path)));
        assert_eq!("folder/tree.spt".parse(), saved("folder/tree.spt"));
        assert_eq!(" T.SPT".parse(), saved("T.SPT"));
        assert!("oak".parse::<TreeSource>().is_err());
    }

    #[test]
    fn times_have_units() {
        assert_eq!(duration("90"), Ok(90.0));
        assert_eq!(duration("1.5m"), Ok(90.0));
        assert_eq!(duration("2h"), Ok(7200.0));
        for wrong in ["", "s", "5 d", "-3s", "0", "infs"] {
            assert!(duration(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_number_of_rays_may_be_written_with_an_exponent() {
        assert_eq!(rays("1e8"), Ok(100_000_000));
        assert_eq!(rays("20_000"), Ok(20_000));
        for wrong in ["", "0", "-1", "1.5", "many", "nan", "inf", "1e99"] {
            assert!(rays(wrong).is_err(), "{wrong}");
        }
    }
}
