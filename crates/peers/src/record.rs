//! What is kept of a measurement.

use serde::{Deserialize, Serialize};
use splitplane_lab::median;

use crate::measure::{Built, Found};
use crate::rays::Kind;

/// A contender on a set of rays of a scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// The scene's name.
    pub scene: String,
    /// Its triangles that can be hit.
    pub triangles: usize,
    /// The set of rays.
    pub set: Kind,
    /// How many rays.
    pub rays: usize,
    /// The contender's name.
    pub contender: String,
    /// Repetitions.
    pub reps: usize,
    /// Million rays a second of the thread's time, the median.
    pub mrays_cpu: f64,
    /// Million rays a second of the wall's time, the median.
    pub mrays_wall: f64,
    /// Whose speed the ratios are to.
    pub baseline: String,
    /// Speed as a multiple of the baseline's in the same repetition, by the thread's time: median.
    pub ratio: f64,
    /// The smallest such ratio.
    pub ratio_min: f64,
    /// The largest such ratio.
    pub ratio_max: f64,
    /// Rays that hit, answered with a miss.
    pub missed: usize,
    /// Rays that miss, answered with a hit.
    pub extra: usize,
    /// Closest hits elsewhere by more than rounding.
    pub elsewhere: usize,
    /// Answers that differ by a bit, of contenders that promise none.
    pub inexact: usize,
    /// Interior nodes visited a ray, where it can be told.
    pub visits_per_ray: Option<f64>,
    /// Leaves or blocks of triangles visited a ray, where it can be told.
    pub blocks_per_ray: Option<f64>,
    /// Triangles tested a ray, where it can be told.
    pub tests_per_ray: Option<f64>,
    /// Bytes a triangle of the structure, with its own triangles.
    pub bytes_per_triangle: f64,
    /// Threads of the build.
    pub build_threads: usize,
    /// Seconds of all processors for the build.
    pub build_cpu: f64,
    /// Seconds of the wall's clock for the build.
    pub build_wall: f64,
    /// Seed of the rays.
    pub seed: u64,
    /// The processor.
    pub cpu: String,
    /// Load of the machine before, where the system tells.
    pub load: Option<f64>,
    /// What the Rust crates are compiled for.
    pub target: String,
    /// The version of Embree, where it takes part.
    pub embree: Option<String>,
}

/// What all rows of a run share.
pub struct Run {
    pub scene: String,
    pub triangles: usize,
    pub build_threads: usize,
    pub seed: u64,
    pub cpu: String,
    pub load: Option<f64>,
    pub embree: Option<String>,
}

/// What the compiler was allowed to use in the Rust crates.
pub fn target() -> String {
    let features = [
        (cfg!(target_feature = "avx512f"), "avx512"),
        (cfg!(target_feature = "avx2"), "avx2"),
        (cfg!(target_feature = "fma"), "fma"),
    ];
    let on = features.iter().filter(|(on, _)| *on).map(|(_, name)| *name);
    let list: Vec<&str> = std::iter::once(std::env::consts::ARCH).chain(on).collect();
    list.join("+")
}

/// A row for each contender; ratios are to that at `baseline`.
pub fn rows(
    run: &Run,
    set: Kind,
    rays: usize,
    contenders: &[Built],
    found: &[Found],
    baseline: usize,
) -> Vec<Row> {
    let per_ray = |count: Option<u64>| count.map(|count| count as f64 / rays as f64);
    let speed = |seconds: &[f64]| {
        let median = median(seconds.iter().copied()).unwrap_or(f64::NAN);
        rays as f64 / median / 1e6
    };
    contenders
        .iter()
        .zip(found)
        .map(|(built, one)| {
            let base = found[baseline].cpu.iter();
            let ratios: Vec<f64> = base.zip(&one.cpu).map(|(base, own)| base / own).collect();
            Row {
                scene: run.scene.clone(),
                triangles: run.triangles,
                set,
                rays,
                contender: built.name.clone(),
                reps: one.cpu.len(),
                mrays_cpu: speed(&one.cpu),
                mrays_wall: speed(&one.wall),
                baseline: contenders[baseline].name.clone(),
                ratio: median(ratios.iter().copied()).unwrap_or(f64::NAN),
                ratio_min: ratios.iter().copied().fold(f64::INFINITY, f64::min),
                ratio_max: ratios.iter().copied().fold(0.0, f64::max),
                missed: one.wrong.missed,
                extra: one.wrong.extra,
                elsewhere: one.wrong.elsewhere,
                inexact: one.wrong.inexact,
                visits_per_ray: per_ray(one.work.visits),
                blocks_per_ray: per_ray(one.work.blocks),
                tests_per_ray: per_ray(one.work.tests),
                bytes_per_triangle: built.contender.bytes() as f64 / run.triangles.max(1) as f64,
                build_threads: run.build_threads,
                build_cpu: built.build_cpu,
                build_wall: built.build_wall,
                seed: run.seed,
                cpu: run.cpu.clone(),
                load: run.load,
                target: target(),
                embree: run.embree.clone(),
            }
        })
        .collect()
}
