//! From a scene and a tree to a picture, and to what every ray cost.
//!
//! [`render()`] follows pbrt-v3 \[PBRT3\] in everything that decides which rays are cast: samples,
//! camera, filters, scattering functions, lights, integrators. So the number of rays of each kind
//! can be compared with pbrt-v3's, and not only the picture.

mod bsdf;
mod camera;
mod checkpoint;
mod environment;
mod film;
mod filter;
mod integrator;
mod interaction;
mod light;
mod light_choice;
mod part;
mod sampler;
mod sampling;
mod sphere_map;
mod texture;
mod tiles;
mod tracer;

use std::ops::AddAssign;

use splitplane::{Counts, Mesh, Tree};

use crate::scene::Scene;
use crate::scene::settings::Integrator;
use camera::CameraRays;
pub use checkpoint::{Checkpoint, Partial};
use film::FilmPlan;
use integrator::World;
pub use interaction::leave;
use light::Lights;
use part::Part;
pub use part::{SceneTree, place};
use sampler::Sequence;

/// What to render otherwise than the scene says, and with which means.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderSettings {
    /// Threads; 0: one per core. The result is the same for any number.
    pub threads: usize,
    /// 0: the very sequences of pbrt-v3. Any other seed gives another sequence of the same quality,
    /// with which a crop shows the same as the whole picture.
    pub seed: u64,
    /// Samples per pixel in place of the scene's; at least 1.
    pub samples_per_pixel: Option<u32>,
    /// Width and height of the full picture, in pixels, in place of the scene's.
    pub resolution: Option<(u32, u32)>,
    /// `[x_min, x_max, y_min, y_max]` of the part to render, in fractions of the full picture, in
    /// place of the scene's.
    pub crop: Option<[f32; 4]>,
    /// The most bounces, in place of the scene's; ambient occlusion has none.
    pub max_depth: Option<u32>,
    /// Takes further samples until so many seconds are over; `samples_per_pixel` are taken in any
    /// case, or one where that is not set.
    /// Where this is set, how many samples a picture has depends on the machine.
    pub time: Option<f64>,
    /// Count triangle tests and node visits, in all and per pixel. Without, the queries run
    /// without counters, as a rendering for its time should.
    pub count: bool,
}

impl Default for RenderSettings {
    /// All as in the scene, all cores, seed 0, counted.
    fn default() -> Self {
        RenderSettings {
            threads: 0,
            seed: 0,
            samples_per_pixel: None,
            resolution: None,
            crop: None,
            max_depth: None,
            time: None,
            count: true,
        }
    }
}

/// Something apart for each kind of ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayKinds<T> {
    /// Closest-hit rays from the camera.
    pub camera: T,
    /// All other closest-hit rays: paths that go on, and the rays towards lights that the
    /// surface's scattering chose.
    pub bounce: T,
    /// Any-hit rays.
    pub shadow: T,
}

impl<T: AddAssign> AddAssign for RayKinds<T> {
    fn add_assign(&mut self, other: Self) {
        self.camera += other.camera;
        self.bounce += other.bounce;
        self.shadow += other.shadow;
    }
}

/// Triangle tests by the size of the leaf that they were made in: the entry at `n` holds those in
/// leaves of `n` triangles. A shadow ray that finds a hit leaves the rest of its leaf untested.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LeafSizes(pub Vec<u64>);

impl AddAssign<&LeafSizes> for LeafSizes {
    fn add_assign(&mut self, other: &LeafSizes) {
        if self.0.len() < other.0.len() {
            self.0.resize(other.0.len(), 0);
        }
        for (sum, &tests) in self.0.iter_mut().zip(&other.0) {
            *sum += tests;
        }
    }
}

/// What the rays of one pixel's samples did; sums, which stop at the largest `u32`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelCounts {
    /// Triangles tested.
    pub triangle_tests: u32,
    /// Axis-aligned interior nodes visited.
    pub kd_visits: u32,
    /// Interior nodes with an oblique plane visited.
    pub oblique_visits: u32,
    /// Leaves visited.
    pub leaf_visits: u32,
    /// Interior nodes visited of a tree in the wide layout, which has no others.
    pub wide_visits: u32,
}

/// One of the counters of a pixel.
pub type PixelCounter = fn(&PixelCounts) -> u32;

impl PixelCounts {
    /// Each counter by its name, as it is in files and in Python.
    pub const NAMED: [(&'static str, PixelCounter); 5] = [
        ("triangle_tests", |c| c.triangle_tests),
        ("kd_visits", |c| c.kd_visits),
        ("oblique_visits", |c| c.oblique_visits),
        ("leaf_visits", |c| c.leaf_visits),
        ("wide_visits", |c| c.wide_visits),
    ];
}

/// [`PixelCounts`] of all pixels, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PixelCounters {
    /// Of closest-hit rays (camera and bounce).
    pub closest: Vec<PixelCounts>,
    /// Of shadow rays.
    pub shadow: Vec<PixelCounts>,
}

/// A picture, and what it cost. All pictures are row by row from the top, of the cropped part.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Column and row of the first pixel in the full picture.
    pub origin: (u32, u32),
    /// Samples per pixel that were taken.
    pub samples_per_pixel: u32,
    /// Linear RGB (sRGB primaries).
    pub radiance: Vec<[f32; 3]>,
    /// Distance from the camera to the first hit, in scene units: the mean over the pixel's samples
    /// that hit anything; infinite where none does.
    pub depth: Vec<f32>,
    /// Shading normal at the first hit, in world space: the mean over the pixel's samples that hit
    /// anything (so no longer than 1); zero where none does.
    pub normal: Vec<[f32; 3]>,
    /// Rays cast.
    pub rays: RayKinds<u64>,
    /// What the rays did; zero unless [`RenderSettings::count`].
    pub counts: RayKinds<Counts>,
    /// The triangle tests of [`Rendered::counts`] by the size of the leaf; empty unless
    /// [`RenderSettings::count`].
    pub tests_by_leaf_size: RayKinds<LeafSizes>,
    /// The counts per pixel, by the pixel that the camera ray went through. A wide filter also takes
    /// samples from just outside the picture; they are in the totals only. `None` unless
    /// [`RenderSettings::count`].
    pub pixel_counts: Option<PixelCounters>,
    /// Wall-clock time of the rendering, without any preparation, in seconds.
    pub seconds: f64,
}

/// Watches a rendering, and may stop it: `done` of `total` camera rays have been traced to their
/// end.
pub trait Progress: splitplane::Progress {
    /// Asked now and then: whether [`Progress::partial`] should be called with what is done.
    fn wants_partial(&self) -> bool {
        false
    }
    /// The picture so far.
    fn partial(&self, _partial: &Partial) {}
}

/// Watches nothing, never stops.
impl Progress for () {}

/// Why a scene could not be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// A number of the film, sampler or settings is out of range.
    #[error("{what} is {value}; {accepted}")]
    OutOfRange {
        /// What it is.
        what: &'static str,
        /// What was given.
        value: String,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// The parts of the scene do not fit each other.
    #[error("the scene is not consistent: {0}")]
    Inconsistent(String),
    /// The tree was built over another mesh.
    #[error(
        "the tree was built over a mesh of {tree} triangles, the scene has {scene}; build the tree \
         over the scene's mesh"
    )]
    OtherMesh {
        /// Triangles of the tree's mesh.
        tree: usize,
        /// Triangles of the scene's mesh.
        scene: usize,
    },
    /// A tree alone, or other instances, for a scene with instances.
    #[error(
        "the scene has {instances} instances, and there is no tree for each where it is placed"
    )]
    OtherInstances {
        /// Instances of the scene.
        instances: usize,
    },
    /// No threads to work with.
    #[error("cannot start {threads} threads: {reason}")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// Why not.
        reason: String,
    },
    /// A checkpoint of another scene, tree or settings.
    #[error(
        "the unfinished picture is of another scene, tree or settings; go on with the same, or \
         begin anew"
    )]
    OtherCheckpoint,
    /// [`splitplane::Progress::cancelled`] said so.
    #[error("the rendering was cancelled")]
    Cancelled,
}

/// Renders `scene` with `tree` for its rays: a [`Tree`] over [`Scene::mesh`], or
/// [`splitplane::Instances`] where the scene has some; see [`SceneTree`].
///
/// The result, counters included, depends on neither the number of threads nor on `progress`.
///
/// # Errors
/// Settings out of range, an inconsistent scene, another mesh's tree, or cancelled by `progress`.
pub fn render<'t>(
    scene: &Scene,
    tree: impl Into<SceneTree<'t>>,
    settings: &RenderSettings,
    progress: &dyn Progress,
) -> Result<Rendered, RenderError> {
    render_from(scene, tree, settings, None, progress)
}

/// As [`render()`], going on from where another rendering of the same was interrupted: the result
/// is that of one that was not.
///
/// # Errors
/// As [`render()`]; or the checkpoint is of another rendering.
pub fn render_from<'t>(
    scene: &Scene,
    tree: impl Into<SceneTree<'t>>,
    settings: &RenderSettings,
    from: Option<Checkpoint>,
    progress: &dyn Progress,
) -> Result<Rendered, RenderError> {
    let tree = tree.into();
    check(scene, tree)?;
    let plan = Plan::new(scene, settings)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .build()
        .map_err(|error| RenderError::Threads {
            threads: settings.threads,
            reason: error.to_string(),
        })?;
    let fingerprint = fingerprint_of(scene, tree, settings);
    let pixels = plan.film.crop.pixels();
    let state = match from {
        Some(from) if from.fingerprint != fingerprint || from.first_hits.len() != pixels => {
            return Err(RenderError::OtherCheckpoint);
        }
        Some(from) => from,
        None => {
            // Within a limit of time, a scene's own number of samples may be far too many.
            let first = match (settings.time, settings.samples_per_pixel) {
                (Some(_), None) => 1,
                _ => plan.samples_per_pixel,
            };
            Checkpoint::new(fingerprint, first, pixels, settings.count)
        }
    };
    let lights = Lights::new(scene);
    let world = World::new(scene, &lights, plan.integrator);
    let job = tiles::Job {
        plan: &plan.film,
        camera: &plan.camera,
        world: &world,
        tree,
        sequence: &plan.sequence,
        samples_per_pixel: plan.samples_per_pixel,
        progress,
    };
    pool.install(|| {
        if settings.count {
            job.run::<true>(state, settings.time)
        } else {
            job.run::<false>(state, settings.time)
        }
    })
}

/// What a picture and its counters depend on, apart from the time that they may take.
fn fingerprint_of(scene: &Scene, tree: SceneTree<'_>, settings: &RenderSettings) -> u64 {
    let settings = RenderSettings {
        threads: 0,
        time: None,
        ..settings.clone()
    };
    let mesh = &scene.mesh;
    let tree = tree.own();
    checkpoint::fingerprint(&format!(
        "{:?}",
        (
            settings,
            (mesh.triangles().len(), mesh.bounds(), &scene.name),
            &scene.instances,
            (
                &scene.film,
                &scene.filter,
                &scene.sampler,
                &scene.integrator
            ),
            (&scene.camera, tree.choice(), tree.params(), tree.layout()),
        )
    ))
}

/// A scene's settings with those of the caller in their place.
struct Plan {
    film: FilmPlan,
    camera: CameraRays,
    sequence: Sequence,
    samples_per_pixel: u32,
    integrator: Integrator,
}

impl Plan {
    fn new(scene: &Scene, settings: &RenderSettings) -> Result<Self, RenderError> {
        let mut film = scene.film.clone();
        if let Some((width, height)) = settings.resolution {
            (film.width, film.height) = (width, height);
        }
        if let Some(crop) = settings.crop {
            film.crop = crop;
        }
        let samples_per_pixel = settings
            .samples_per_pixel
            .unwrap_or(scene.sampler.samples_per_pixel);
        if samples_per_pixel == 0 {
            return Err(RenderError::OutOfRange {
                what: "the number of samples per pixel",
                value: "0".into(),
                accepted: "1 or more are accepted",
            });
        }
        let mut integrator = scene.integrator;
        if let Some(depth) = settings.max_depth {
            match &mut integrator {
                Integrator::Path { max_depth, .. }
                | Integrator::Direct { max_depth, .. }
                | Integrator::Whitted { max_depth } => *max_depth = depth,
                Integrator::AmbientOcclusion { .. } => {}
            }
        }
        let plan = FilmPlan::new(&film, &scene.filter)?;
        let sampled = plan.samples();
        Ok(Plan {
            camera: CameraRays::new(&scene.camera, film.width, film.height),
            sequence: Sequence::new(
                scene.sampler.kind,
                &sampled,
                samples_per_pixel,
                settings.seed,
            ),
            samples_per_pixel,
            integrator,
            film: plan,
        })
    }
}

/// That the parts of a scene fit each other, so that nothing is out of range later.
fn check(scene: &Scene, tree: SceneTree<'_>) -> Result<(), RenderError> {
    let objects = scene.objects.len();
    if let Some(i) = (scene.instances.iter()).position(|i| i.object as usize >= objects) {
        return Err(RenderError::Inconsistent(format!(
            "instance {i} is of object {} of {objects}",
            scene.instances[i].object
        )));
    }
    let instances = scene.instances.len();
    match tree {
        SceneTree::Tree(tree) if instances == 0 => fits(tree, &scene.mesh)?,
        SceneTree::Instances(placed) if placed.len() == 1 + instances => {
            fits(placed.tree(0), &scene.mesh)?;
            for (number, instance) in (1..).zip(&scene.instances) {
                let object = &scene.objects[instance.object as usize];
                fits(placed.tree(number), &object.mesh)?;
            }
        }
        _ => return Err(RenderError::OtherInstances { instances }),
    }
    if scene
        .objects
        .iter()
        .flat_map(|object| &object.shapes)
        .any(|shape| shape.area_light.is_some())
    {
        return Err(RenderError::Inconsistent(
            "a shape of an object gives off light".to_owned(),
        ));
    }
    Part::all(scene).try_for_each(|part| check_part(&part, scene.materials.len()))
}

/// That the tree was built over this mesh.
fn fits(tree: &Tree, mesh: &Mesh) -> Result<(), RenderError> {
    let (triangles, others) = (mesh.triangles().len(), tree.mesh().triangles().len());
    if others == triangles && tree.mesh().bounds() == mesh.bounds() {
        return Ok(());
    }
    Err(RenderError::OtherMesh {
        tree: others,
        scene: triangles,
    })
}

fn check_part(part: &Part<'_>, materials: usize) -> Result<(), RenderError> {
    let triangles = part.mesh.triangles().len();
    let wrong = |what: String| Err(RenderError::Inconsistent(what));
    let vertices = part.mesh.positions().len();
    if !part.colors.is_empty() && part.colors.len() != vertices {
        return wrong(format!(
            "there are colours for {} of {vertices} vertices",
            part.colors.len()
        ));
    }
    let mut next = 0;
    for (number, shape) in part.shapes.iter().enumerate() {
        if shape.triangles.start != next || shape.triangles.end < next {
            return wrong(format!(
                "shape {number} begins at triangle {}, not at {next}",
                shape.triangles.start
            ));
        }
        next = shape.triangles.end;
        if shape.material as usize >= materials {
            return wrong(format!(
                "shape {number} has material {} of {materials}",
                shape.material
            ));
        }
        for (has, given, what) in [
            (shape.has_normals, part.normals.len(), "normals"),
            (shape.has_uvs, part.uvs.len(), "texture coordinates"),
        ] {
            if has && given != vertices {
                return wrong(format!(
                    "shape {number} needs {what}: {given} for {vertices} vertices"
                ));
            }
        }
    }
    if next as usize != triangles {
        return wrong(format!(
            "the shapes have {next} triangles, the mesh has {triangles}"
        ));
    }
    Ok(())
}
