//! The picture, tile by tile: many threads, one result.

use std::collections::BTreeMap;
use std::ops::{AddAssign, Range};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use glam::{Vec2, Vec3};
use splitplane::Counts;

use super::camera::CameraRays;
use super::checkpoint::{Checkpoint, FirstHits, Partial};
use super::film::{FilmPlan, FilmTile, Window};
use super::integrator::{Gathered, Gatherer, World};
use super::part::SceneTree;
use super::sampler::Sequence;
use super::sampling::luminance;
use super::{LeafSizes, PixelCounts, Progress, RayKinds, RenderError, Rendered};

/// Edge of a tile, in pixels.
const TILE: i32 = 16;

/// Samples of a pixel after which it is asked whether to go on.
const ASKED_EVERY: u32 = 64;

/// Samples of a pixel in one pass at most, where time is limited.
const LONGEST_PASS: u32 = 64;

/// All that a rendering needs.
pub(super) struct Job<'j> {
    pub(super) plan: &'j FilmPlan,
    pub(super) camera: &'j CameraRays,
    pub(super) world: &'j World<'j>,
    pub(super) tree: SceneTree<'j>,
    pub(super) sequence: &'j Sequence,
    /// Without a limit of time.
    pub(super) samples_per_pixel: u32,
    pub(super) progress: &'j dyn Progress,
}

/// What tiles gave so far. They are added in their order, since sums of floats depend on it.
struct Merged<'m> {
    film: &'m mut FilmTile,
    state: &'m mut Checkpoint,
    /// Tiles that are done before one that comes before them, by their numbers.
    waiting: BTreeMap<u64, Tile>,
}

/// What a tile gave. The sums per pixel are those of its own pixels; its film reaches further.
struct Tile {
    pixels: Window,
    film: FilmTile,
    rays: RayKinds<u64>,
    counts: RayKinds<Counts>,
    tests_by_leaf_size: RayKinds<LeafSizes>,
    first_hits: Vec<FirstHits>,
    closest: Vec<PixelCounts>,
    shadow: Vec<PixelCounts>,
}

impl Job<'_> {
    /// Renders on from `state`. With a limit of time, further passes follow the first one.
    pub(super) fn run<const COUNT: bool>(
        &self,
        mut state: Checkpoint,
        time: Option<f64>,
    ) -> Result<Rendered, RenderError> {
        let start = Instant::now();
        let before = state.seconds;
        let tiles = self.plan.samples().tiles(TILE);
        let mut film = FilmTile::new(self.plan.crop);
        state.film_into(&mut film);
        loop {
            self.pass::<COUNT>(&tiles, &mut film, &mut state, start, before)?;
            state.seconds = before + start.elapsed().as_secs_f64();
            let done = state.first_sample + state.samples;
            let next = match time {
                Some(time) => (time - state.seconds) / state.seconds * f64::from(done),
                // What was begun with a limit may have had fewer samples.
                None => f64::from(self.samples_per_pixel.saturating_sub(done)),
            };
            if next < 1.0 {
                return Ok(self.picture(&film, &state, done));
            }
            state.first_sample = done;
            state.samples = (next as u32).min(done).min(LONGEST_PASS);
            state.tiles_done = 0;
        }
    }

    /// Takes the samples of one pass, from the tile on that the state has come to.
    fn pass<const COUNT: bool>(
        &self,
        tiles: &[Window],
        film: &mut FilmTile,
        state: &mut Checkpoint,
        start: Instant,
        before: f64,
    ) -> Result<(), RenderError> {
        let sampled: u64 = tiles.iter().map(|tile| tile.pixels() as u64).sum();
        let total = sampled * u64::from(state.samples);
        let skip = (state.tiles_done as usize).min(tiles.len());
        let done = tiles[..skip].iter().map(|tile| tile.pixels() as u64);
        let done = AtomicU64::new(done.sum::<u64>() * u64::from(state.samples));
        let samples = state.first_sample..state.first_sample + state.samples;
        let next = AtomicUsize::new(skip);
        let merged = Mutex::new(Merged {
            film,
            state,
            waiting: BTreeMap::new(),
        });
        let work = || {
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                let Some(&pixels) = tiles.get(number) else {
                    return Ok(());
                };
                let number = number as u64;
                let tile = self.tile::<COUNT>(number, pixels, samples.clone())?;
                let rays = tile.rays.camera;
                let before_it = done.fetch_add(rays, Ordering::Relaxed);
                self.progress.advanced(before_it + rays, total);
                let mut merged = merged.lock().unwrap_or_else(PoisonError::into_inner);
                merged.waiting.insert(number, tile);
                self.merge(&mut merged);
                if self.progress.wants_partial() {
                    merged.state.seconds = before + start.elapsed().as_secs_f64();
                    self.progress.partial(&self.partial(&merged));
                }
            }
        };
        rayon::broadcast(|_| work()).into_iter().collect()
    }

    /// Adds the tiles that are next.
    fn merge(
        &self,
        Merged {
            film,
            state,
            waiting,
        }: &mut Merged,
    ) {
        while let Some(tile) = waiting.remove(&state.tiles_done) {
            film.merge(&tile.film);
            state.rays += tile.rays;
            state.counts += tile.counts;
            let sizes = &mut state.tests_by_leaf_size;
            sizes.camera += &tile.tests_by_leaf_size.camera;
            sizes.bounce += &tile.tests_by_leaf_size.bounce;
            sizes.shadow += &tile.tests_by_leaf_size.shadow;
            self.place(state, &tile);
            state.tiles_done += 1;
        }
    }

    fn partial(&self, Merged { film, state, .. }: &Merged) -> Partial {
        let samples = state.first_sample + state.samples;
        Partial {
            picture: self.picture(film, state, samples),
            checkpoint: Checkpoint {
                sums: film.sums().to_vec(),
                ..Checkpoint::clone(state)
            },
        }
    }

    /// The picture so far.
    fn picture(&self, film: &FilmTile, state: &Checkpoint, samples: u32) -> Rendered {
        let crop = &self.plan.crop;
        let mean = |hits: &FirstHits| match hits.count {
            0 => (f32::INFINITY, [0.0; 3]),
            count => (
                hits.distance / count as f32,
                (hits.normal / count as f32).into(),
            ),
        };
        let (depth, normal) = state.first_hits.iter().map(mean).unzip();
        Rendered {
            width: crop.width() as u32,
            height: crop.height() as u32,
            origin: (crop.min[0] as u32, crop.min[1] as u32),
            samples_per_pixel: samples,
            radiance: film.develop(self.plan),
            depth,
            normal,
            rays: state.rays,
            counts: state.counts,
            tests_by_leaf_size: state.tests_by_leaf_size.clone(),
            pixel_counts: state.pixel_counts.clone(),
            seconds: state.seconds,
        }
    }

    /// Adds what a tile knows of its own pixels.
    fn place(&self, state: &mut Checkpoint, tile: &Tile) {
        let width = tile.pixels.width();
        for (i, hits) in tile.first_hits.iter().enumerate() {
            let x = tile.pixels.min[0] + (i % width) as i32;
            let y = tile.pixels.min[1] + (i / width) as i32;
            let Some(pixel) = self.plan.crop.index(x, y) else {
                continue;
            };
            state.first_hits[pixel].merge(hits);
            if let Some(counters) = &mut state.pixel_counts {
                counters.closest[pixel] += tile.closest[i];
                counters.shadow[pixel] += tile.shadow[i];
            }
        }
    }

    fn tile<const COUNT: bool>(
        &self,
        number: u64,
        pixels: Window,
        samples: Range<u32>,
    ) -> Result<Tile, RenderError> {
        let mut gatherer = Gatherer::<COUNT>::new(self.world, self.tree, self.sequence);
        gatherer.sampler.start_tile(number, samples.start);
        // Between samples, in pixels.
        let spacing = 1.0 / (self.samples_per_pixel as f32).sqrt();
        let count = pixels.pixels();
        let mut film = FilmTile::new(self.plan.reach(&pixels));
        let mut first_hits = Vec::with_capacity(count);
        let mut closest = Vec::with_capacity(if COUNT { count } else { 0 });
        let mut shadow = Vec::with_capacity(if COUNT { count } else { 0 });
        for y in pixels.min[1]..pixels.max[1] {
            for x in pixels.min[0]..pixels.max[0] {
                let before = gatherer.tracer.counts;
                let mut hits = FirstHits::default();
                gatherer
                    .sampler
                    .start_pixel(x, y, samples.end - samples.start);
                for number in samples.clone() {
                    let taken = number - samples.start;
                    if taken.is_multiple_of(ASKED_EVERY) && self.progress.cancelled() {
                        return Err(RenderError::Cancelled);
                    }
                    gatherer.sampler.start_sample(number);
                    let place = Vec2::new(x as f32, y as f32) + gatherer.sampler.next_2d();
                    // pbrt's time; here nothing moves.
                    let _time = gatherer.sampler.next_1d();
                    let beam = self.camera.beam(place, gatherer.sampler.next_2d(), spacing);
                    let Gathered { radiance, first } = gatherer.gather(&beam);
                    first.into_iter().for_each(|hit| hits.add(hit));
                    film.add(self.plan, place, sound(radiance));
                }
                first_hits.push(hits);
                if COUNT {
                    let after = gatherer.tracer.counts;
                    let mut both = after.camera - before.camera;
                    both += after.bounce - before.bounce;
                    closest.push(both.into());
                    shadow.push((after.shadow - before.shadow).into());
                }
            }
        }
        Ok(Tile {
            pixels,
            film,
            rays: gatherer.tracer.rays,
            counts: gatherer.tracer.counts,
            tests_by_leaf_size: gatherer.tracer.tests_by_leaf_size,
            first_hits,
            closest,
            shadow,
        })
    }
}

/// Black instead of a radiance that cannot be, as pbrt-v3 does: one NaN would spoil all pixels
/// that its sample reaches.
fn sound(radiance: Vec3) -> Vec3 {
    let y = luminance(radiance);
    if !radiance.is_nan() && y >= -1e-5 && y.is_finite() {
        radiance
    } else {
        Vec3::ZERO
    }
}

impl AddAssign for PixelCounts {
    fn add_assign(&mut self, other: Self) {
        let add = |sum: &mut u32, n: u32| *sum = sum.saturating_add(n);
        add(&mut self.triangle_tests, other.triangle_tests);
        add(&mut self.kd_visits, other.kd_visits);
        add(&mut self.oblique_visits, other.oblique_visits);
        add(&mut self.leaf_visits, other.leaf_visits);
        add(&mut self.wide_visits, other.wide_visits);
    }
}

impl From<Counts> for PixelCounts {
    fn from(counts: Counts) -> Self {
        let short = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
        PixelCounts {
            triangle_tests: short(counts.triangle_tests),
            kd_visits: short(counts.kd_visits),
            oblique_visits: short(counts.oblique_visits),
            leaf_visits: short(counts.leaf_visits),
            wide_visits: short(counts.wide_visits),
        }
    }
}
