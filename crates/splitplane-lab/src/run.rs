//! One tree: built, rendered with, and recorded.

use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use splitplane::{
    BuildError, BuildParams, Counts, Layout, LoadError, Mesh, Progress, Traversal, Tree, TreeCard,
    TreeChoice,
};
use splitplane_render::render::{self, LeafSizes, RenderSettings, Rendered, SceneTree, render};
use splitplane_render::scene::{Scene, settings::Integrator};

use crate::LabError;
use crate::experiment::digest;
use crate::machine::{Machine, OthersLoad, peak_memory_bytes};
use crate::objects::{Objects, build_scene};
use crate::params::{ParamsRecord, Preset, traversal_name};
use crate::record::{CardRecord, PerRay, Record, WideRecord, version_and_commit};

/// The conditions that all trees of an experiment share.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The name of the build parameters.
    pub preset: Preset,
    /// The build parameters; those of the preset, where single ones are not set otherwise.
    pub params: BuildParams,
    /// How queries decide which cells a ray passes.
    pub traversal: Traversal,
    /// In which layouts the tree answers rays.
    pub layouts: Layouts,
    /// How to render. Its number of threads is also that of the build; the laboratory decides
    /// what is counted.
    pub render: RenderSettings,
}

/// The layouts of a tree: that of renderings for their time, and that of renderings that count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Layouts {
    /// Where times are taken.
    pub timed: Layout,
    /// Where tests and visits are counted; papers count in the binary layout.
    pub counted: Layout,
}

impl Layouts {
    /// The same for both.
    pub fn both(layout: Layout) -> Layouts {
        Layouts {
            timed: layout,
            counted: layout,
        }
    }

    fn has(self, layout: Layout) -> bool {
        self.timed == layout || self.counted == layout
    }

    /// # Errors
    /// A traversal that there is not in one of the layouts.
    pub(crate) fn check(self, traversal: Traversal) -> Result<(), LabError> {
        match traversal == Traversal::AsPublished && self.has(Layout::Wide) {
            true => Err(LabError::WideAsPublished),
            false => Ok(()),
        }
    }
}

impl Settings {
    /// The preset's parameters, and everything else as the scene says.
    pub fn of_preset(preset: Preset) -> Settings {
        Settings {
            preset,
            params: preset.params(),
            traversal: Traversal::default(),
            layouts: Layouts::default(),
            render: RenderSettings::default(),
        }
    }
}

/// A tree that was built or loaded, and how that went.
#[derive(Clone, Debug)]
pub struct Built {
    /// The tree; in the wide layout only where nothing else was asked for.
    pub tree: Arc<Tree>,
    /// The same tree in the wide layout, where both layouts were asked for.
    pub wide: Option<Arc<Tree>>,
    /// The trees of the scene's objects, where it has instances. What else is known is then of all
    /// trees together.
    pub objects: Option<Box<Objects>>,
    /// What is known of it in the wide layout, where it was brought into that.
    pub wide_card: Option<WideRecord>,
    /// What is known of it.
    pub card: TreeCard,
    /// Time to build it, or to load it, in seconds.
    pub seconds: f64,
    /// Threads that built or loaded it.
    pub threads: usize,
    /// The machine, and its load when the build began.
    pub machine: Machine,
    /// Processors that others kept busy during the build; `None` where that is not known.
    pub others_load: Option<f64>,
}

impl Built {
    /// What rays are cast against in this layout, if the settings that it was built with asked for
    /// it; else in the one that they did ask for.
    pub fn in_layout(&self, layout: Layout) -> SceneTree<'_> {
        match (&self.objects, layout, &self.wide) {
            (Some(objects), Layout::Wide, Some(_)) => (&objects.wide).into(),
            (Some(objects), ..) => (&objects.placed).into(),
            (None, Layout::Wide, Some(wide)) => (&**wide).into(),
            (None, ..) => (&*self.tree).into(),
        }
    }

    /// The meshes that the trees are over.
    pub fn meshes(&self) -> impl Iterator<Item = &Mesh> {
        let objects = self.objects.iter().flat_map(|objects| &objects.trees);
        std::iter::once(&self.tree)
            .chain(objects)
            .map(|tree| tree.mesh())
    }
}

/// All that is known of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// What was measured.
    pub record: Record,
    /// The tree.
    pub card: CardRecord,
    /// Triangle tests by the size of the leaf.
    pub tests_by_leaf_size: LeafSizeRecord,
    /// SHA-256 of the picture with counters.
    pub picture: String,
    /// SHA-256 of the picture without, where there is one.
    pub picture_timed: Option<String>,
    /// How long all of it took, the loading of the scene apart, in seconds.
    pub seconds: f64,
}

/// Triangle tests by the size of the leaf that they were made in: `[[triangles, tests]]`, ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeafSizeRecord {
    /// Of camera and bounce rays.
    pub closest: Vec<(u32, u64)>,
    /// Of shadow rays.
    pub shadow: Vec<(u32, u64)>,
}

impl LeafSizeRecord {
    pub(crate) fn of(rendered: &Rendered) -> LeafSizeRecord {
        let sizes = &rendered.tests_by_leaf_size;
        let mut closest = sizes.camera.clone();
        closest += &sizes.bounce;
        let pairs = |sizes: &LeafSizes| {
            (sizes.0.iter().enumerate())
                .filter(|(_, tests)| **tests > 0)
                .map(|(size, &tests)| (size as u32, tests))
                .collect()
        };
        LeafSizeRecord {
            closest: pairs(&closest),
            shadow: pairs(&sizes.shadow),
        }
    }
}

/// How a run is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Timing {
    /// By a rendering of its own, without counters.
    Alone,
    /// By the rendering that counts: for those that are after the counts.
    WhileCounting,
}

/// Builds a tree and renders the scene with it: once without counters, for the time, where
/// `timing` asks for it, and once with.
///
/// # Errors
/// As [`build`] and [`render_with`].
pub fn measure(
    scene: &Scene,
    tree: TreeChoice,
    settings: &Settings,
    repetition: u32,
    timing: Timing,
) -> Result<(Run, Rendered), LabError> {
    let start = Instant::now();
    let built = build_scene(scene, tree, settings, &())?;
    let timed = match timing {
        Timing::Alone => Some(render_timed(scene, &built, settings, &())?),
        Timing::WhileCounting => None,
    };
    let counted = render_with(scene, &built, settings, true, &())?;
    let time = match &timed {
        Some((timed, load)) => RenderTime {
            seconds: timed.seconds,
            counted: false,
            others_load: *load,
        },
        None => RenderTime {
            seconds: counted.seconds,
            counted: true,
            others_load: None,
        },
    };
    let run = Run {
        record: record(scene, &built, settings, repetition, &counted, time),
        card: CardRecord::new(&built, &scene.name, settings),
        tests_by_leaf_size: LeafSizeRecord::of(&counted),
        picture: digest([bytemuck::cast_slice(&counted.radiance)]),
        picture_timed: timed.map(|(timed, _)| digest([bytemuck::cast_slice(&timed.radiance)])),
        seconds: start.elapsed().as_secs_f64(),
    };
    Ok((run, counted))
}

/// The time of a rendering, and how it was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderTime {
    /// The time, in seconds.
    pub seconds: f64,
    /// Counters ran meanwhile.
    pub counted: bool,
    /// Processors that others kept busy meanwhile; `None` where that is not known.
    pub others_load: Option<f64>,
}

/// Builds a tree, watched, on as many threads as the settings say, and brings it into the layouts
/// that they ask for.
///
/// # Errors
/// Parameters out of range, a tree too large for its nodes, no threads, a traversal that there is
/// not in a layout, or cancelled by `progress`.
pub fn build(
    mesh: &Mesh,
    choice: TreeChoice,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Built, LabError> {
    settings.layouts.check(settings.traversal)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.render.threads)
        .build()
        .map_err(|source| LabError::Threads { source })?;
    let machine = Machine::now();
    let load = OthersLoad::start();
    let start = Instant::now();
    let tree = pool.install(|| Tree::build_watched(mesh, choice, &settings.params, progress));
    let seconds = start.elapsed().as_secs_f64();
    let others_load = load.stop();
    let tree = tree.map_err(|source| failed(choice, source))?;
    let (card, tree, wide, wide_card) = pool.install(|| arrange(tree, settings))?;
    Ok(Built {
        card,
        tree: Arc::new(tree),
        wide: wide.map(Arc::new),
        objects: None,
        wide_card,
        seconds,
        threads: pool.current_num_threads(),
        machine,
        others_load,
    })
}

/// A tree in the layouts that the settings ask for: its card, itself, and in the wide layout with
/// what is known of it there.
type Arranged = (TreeCard, Tree, Option<Tree>, Option<WideRecord>);

fn arrange(tree: Tree, settings: &Settings) -> Result<Arranged, LabError> {
    let choice = tree.choice();
    let card = tree.card();
    let tree = tree.with_traversal(settings.traversal);
    let to_wide = |tree: Tree| {
        tree.with_layout(Layout::Wide)
            .map_err(|source| failed(choice, source))
    };
    let start = Instant::now();
    let layouts = settings.layouts;
    let (tree, wide) = match (layouts.has(Layout::Binary), layouts.has(Layout::Wide)) {
        (_, false) => (tree, None),
        (false, true) => (to_wide(tree)?, None),
        (true, true) => {
            let wide = to_wide(tree.clone())?;
            (tree, Some(wide))
        }
    };
    let seconds = start.elapsed().as_secs_f64();
    let wide_card = wide.as_ref().unwrap_or(&tree).card();
    let record =
        (wide_card.wide.as_ref()).map(|wide| WideRecord::new(wide, wide_card.bytes, seconds));
    Ok((card, tree, wide, record))
}

fn failed(tree: TreeChoice, source: BuildError) -> LabError {
    LabError::Build {
        tree: tree.to_string(),
        source,
    }
}

/// Saves a tree, whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn save_tree(path: &Path, tree: &Tree) -> Result<(), LabError> {
    tree.save(path).map_err(|source| LabError::Write {
        path: path.to_owned(),
        source,
    })
}

/// Loads a tree that was saved, over its mesh, by `load`, which is [`Tree::load`] or what maps the
/// file; the settings then have the parameters that the tree was built with.
///
/// # Errors
/// The file cannot be read, is no saved tree, is damaged, or is that of another mesh; or a
/// traversal that there is not in a layout.
pub fn load_tree(
    path: &Path,
    mesh: &Mesh,
    settings: &mut Settings,
    load: impl FnOnce(&Path, &Mesh) -> Result<Tree, LoadError>,
) -> Result<Built, LabError> {
    let machine = Machine::now();
    let others = OthersLoad::start();
    let start = Instant::now();
    let tree = load(path, mesh).map_err(|source| LabError::LoadTree {
        path: path.to_owned(),
        source,
    })?;
    let seconds = start.elapsed().as_secs_f64();
    settings.params = tree.params().clone();
    settings.preset = Preset::of(tree.params());
    if tree.layout() == Layout::Wide {
        settings.layouts = Layouts::both(Layout::Wide);
    }
    settings.layouts.check(settings.traversal)?;
    let (card, tree, wide, wide_card) = arrange(tree, settings)?;
    Ok(Built {
        card,
        tree: Arc::new(tree),
        wide: wide.map(Arc::new),
        objects: None,
        wide_card,
        seconds,
        threads: 1,
        machine,
        others_load: others.stop(),
    })
}

/// Renders a scene without counters, for its time; with the processors that others kept busy
/// meanwhile, where that is known.
///
/// # Errors
/// As [`render()`].
pub fn render_timed(
    scene: &Scene,
    built: &Built,
    settings: &Settings,
    progress: &dyn render::Progress,
) -> Result<(Rendered, Option<f64>), LabError> {
    let load = OthersLoad::start();
    let rendered = render_with(scene, built, settings, false, progress)?;
    Ok((rendered, load.stop()))
}

/// Renders a scene with a tree that was built over its mesh, counting or not, in the layout that the
/// settings have for that.
///
/// # Errors
/// As [`render()`].
pub fn render_with(
    scene: &Scene,
    built: &Built,
    settings: &Settings,
    count: bool,
    progress: &dyn render::Progress,
) -> Result<Rendered, LabError> {
    let Layouts { timed, counted } = settings.layouts;
    let tree = built.in_layout(if count { counted } else { timed });
    let settings = RenderSettings {
        count,
        ..settings.render.clone()
    };
    Ok(render(scene, tree, &settings, progress)?)
}

/// The record of a run.
///
/// `counted` is a rendering with counters; `time` is that of the rendering whose time counts.
pub fn record(
    scene: &Scene,
    built: &Built,
    settings: &Settings,
    repetition: u32,
    counted: &Rendered,
    time: RenderTime,
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
    let name_of = |layout: Layout| layout.name().to_owned();
    Record {
        tree: card.choice.spec.name.to_owned(),
        k: card.choice.direction_count,
        scene: scene.name.clone(),
        triangles: scene.triangles(),
        triangles_skipped: scene
            .meshes()
            .map(|mesh| mesh.skipped().total() as u64)
            .sum(),
        instances: scene.contents.instances,
        instances_kept: !scene.instances.is_empty(),
        unique_triangles: scene.contents.unique_triangles,
        scene_notes: (scene.notes.iter())
            .map(|note| format!("{}: {}", note.place, note.text))
            .collect(),
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
        render_s: time.seconds,
        layout: name_of(match time.counted {
            true => settings.layouts.counted,
            false => settings.layouts.timed,
        }),
        layout_s: built.wide_card.as_ref().map(|wide| wide.seconds),
        counted_while_timed: time.counted,
        others_load: match (built.others_load, time.others_load) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        },
        nodes: card.nodes.into(),
        references: card.references,
        depth: card.depth,
        bad_refines: card.build.bad_refines,
        sah_cost: card.sah_cost,
        tree_bytes: card.bytes,
        wide_bytes: built.wide_card.as_ref().map(|wide| wide.bytes),
        rays: PerRay::from(counted.rays),
        counts_layout: name_of(settings.layouts.counted),
        triangle_tests: counts(|c| c.triangle_tests),
        kd_visits: counts(|c| c.kd_visits),
        oblique_visits: counts(|c| c.oblique_visits),
        leaf_visits: counts(|c| c.leaf_visits),
        wide_visits: counts(|c| c.wide_visits),
        peak_memory_bytes: peak_memory_bytes(),
        machine: built.machine.clone(),
        version,
        commit,
    }
}
