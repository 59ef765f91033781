//! One tree: built, rendered with, and recorded.

use std::time::Instant;

use splitplane::{BuildParams, Counts, Mesh, Traversal, Tree, TreeCard, TreeChoice};
use splitplane_render::render::{Progress, RenderSettings, Rendered, render};
use splitplane_render::scene::{Scene, settings::Integrator};

use crate::LabError;
use crate::machine::{Machine, peak_memory_bytes};
use crate::params::{ParamsRecord, Preset, traversal_name};
use crate::record::{PerRay, Record, version_and_commit};

/// The conditions that all trees of an experiment share.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The name of the build parameters.
    pub preset: Preset,
    /// The build parameters; those of the preset, where single ones are not set otherwise.
    pub params: BuildParams,
    /// How queries decide which cells a ray passes.
    pub traversal: Traversal,
    /// How to render. Its number of threads is also that of the build; the laboratory decides
    /// what is counted.
    pub render: RenderSettings,
}

impl Settings {
    /// The preset's parameters, and everything else as the scene says.
    pub fn of_preset(preset: Preset) -> Settings {
        Settings {
            preset,
            params: preset.params(),
            traversal: Traversal::default(),
            render: RenderSettings::default(),
        }
    }
}

/// A tree that was built, and how that went.
#[derive(Clone, Debug)]
pub struct Built {
    /// The tree.
    pub tree: Tree,
    /// What is known of it.
    pub card: TreeCard,
    /// Time to build it, in seconds.
    pub seconds: f64,
    /// Threads that built it.
    pub threads: usize,
    /// The machine, and its load when the build began.
    pub machine: Machine,
}

/// Builds a tree, on as many threads as the settings say.
///
/// # Errors
/// Parameters out of range, a tree too large for its nodes, or no threads.
pub fn build(mesh: &Mesh, choice: TreeChoice, settings: &Settings) -> Result<Built, LabError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.render.threads)
        .build()
        .map_err(|source| LabError::Threads { source })?;
    let machine = Machine::now();
    let start = Instant::now();
    let tree = pool.install(|| Tree::build(mesh, choice, &settings.params));
    let seconds = start.elapsed().as_secs_f64();
    let tree = tree.map_err(|source| LabError::Build {
        tree: choice.to_string(),
        source,
    })?;
    Ok(Built {
        card: tree.card(),
        tree: tree.with_traversal(settings.traversal),
        seconds,
        threads: pool.current_num_threads(),
        machine,
    })
}

/// Renders a scene with a tree that was built over its mesh, counting or not.
///
/// # Errors
/// As [`render`].
pub fn render_with(
    scene: &Scene,
    built: &Built,
    settings: &Settings,
    count: bool,
    progress: &dyn Progress,
) -> Result<Rendered, LabError> {
    let settings = RenderSettings {
        count,
        ..settings.render.clone()
    };
    Ok(render(scene, &built.tree, &settings, progress)?)
}

/// The record of a run.
///
/// `counted` is a rendering with counters; `timed` is the one whose time counts, with or without
/// counters, as `counted_while_timed` says.
pub fn record(
    scene: &Scene,
    built: &Built,
    settings: &Settings,
    repetition: u32,
    counted: &Rendered,
    (render_s, counted_while_timed): (f64, bool),
) -> Record {
    let card = &built.card;
    let (version, commit) = version_and_commit();
    let film = &scene.film;
    let (width, height) = settings
        .render
        .resolution
        .unwrap_or((film.width, film.height));
    let (integrator, max_depth) = match scene.integrator {
        Integrator::Path { max_depth, .. } => ("path", Some(max_depth)),
        Integrator::Direct { max_depth, .. } => ("directlighting", Some(max_depth)),
        Integrator::Whitted { max_depth } => ("whitted", Some(max_depth)),
        Integrator::AmbientOcclusion { .. } => ("ambientocclusion", None),
    };
    let counts = |pick: fn(&Counts) -> u64| PerRay {
        camera: pick(&counted.counts.camera),
        bounce: pick(&counted.counts.bounce),
        shadow: pick(&counted.counts.shadow),
    };
    Record {
        tree: card.choice.spec.name.to_owned(),
        k: card.choice.direction_count,
        scene: scene.name.clone(),
        triangles: scene.mesh.triangles().len() as u64,
        triangles_skipped: scene.mesh.skipped().total() as u64,
        repetition,
        seed: settings.params.seed,
        sample_seed: settings.render.seed,
        threads: built.threads,
        spp: counted.samples_per_pixel,
        width,
        height,
        crop: settings.render.crop.unwrap_or(film.crop),
        pixels: u64::from(counted.width) * u64::from(counted.height),
        integrator: integrator.to_owned(),
        max_depth: max_depth.map(|scenes| settings.render.max_depth.unwrap_or(scenes)),
        preset: settings.preset.name().to_owned(),
        build_params: ParamsRecord::from(&settings.params),
        traversal: traversal_name(settings.traversal).to_owned(),
        build_s: built.seconds,
        render_s,
        counted_while_timed,
        nodes: card.nodes.into(),
        references: card.references,
        depth: card.depth,
        bad_refines: card.build.bad_refines,
        sah_cost: card.sah_cost,
        tree_bytes: card.bytes,
        rays: PerRay::from(counted.rays),
        triangle_tests: counts(|c| c.triangle_tests),
        kd_visits: counts(|c| c.kd_visits),
        oblique_visits: counts(|c| c.oblique_visits),
        leaf_visits: counts(|c| c.leaf_visits),
        peak_memory_bytes: peak_memory_bytes(),
        machine: built.machine.clone(),
        version,
        commit,
    }
}
