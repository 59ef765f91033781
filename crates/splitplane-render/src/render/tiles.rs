//! The picture, tile by tile: many threads, one result.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use splitplane::{Counts, Tree};

use super::camera::CameraRays;
use super::film::{FilmPlan, FilmTile, Window};
use super::integrator::{FirstHit, Gathered, Gatherer, World};
use super::sampler::Sequence;
use super::sampling::luminance;
use super::{PixelCounters, PixelCounts, Progress, RayKinds, RenderError, Rendered};

/// Edge of a tile, in pixels.
const TILE: i32 = 16;

/// Tiles that wait to be merged at most; the threads meet after so many.
const BATCH: usize = 1024;

/// All that a rendering needs.
pub(super) struct Job<'j> {
    pub(super) plan: &'j FilmPlan,
    pub(super) camera: &'j CameraRays,
    pub(super) world: &'j World<'j>,
    pub(super) tree: &'j Tree,
    pub(super) sequence: &'j Sequence,
    pub(super) samples_per_pixel: u32,
    /// Between samples, in pixels.
    pub(super) spacing: f32,
    pub(super) progress: &'j dyn Progress,
}

/// What a tile gave. The sums per pixel are those of its own pixels; its film reaches further.
struct Tile {
    pixels: Window,
    film: FilmTile,
    rays: RayKinds<u64>,
    counts: RayKinds<Counts>,
    first_hits: Vec<FirstHits>,
    closest: Vec<PixelCounts>,
    shadow: Vec<PixelCounts>,
}

/// Sums over the samples of a pixel that hit anything.
#[derive(Clone, Copy, Default)]
struct FirstHits {
    distance: f32,
    normal: Vec3,
    count: u32,
}

impl FirstHits {
    fn add(&mut self, hit: FirstHit) {
        self.distance += hit.distance;
        self.normal += hit.normal;
        self.count += 1;
    }
}

impl Job<'_> {
    pub(super) fn run<const COUNT: bool>(&self) -> Result<Rendered, RenderError> {
        let start = Instant::now();
        let sampled = self.plan.samples();
        let total = sampled.pixels() as u64 * u64::from(self.samples_per_pixel);
        let done = AtomicU64::new(0);
        let mut film = FilmTile::new(self.plan.crop);
        let mut picture = self.blank(COUNT);
        for batch in sampled.tiles(TILE).chunks(BATCH) {
            let tiles: Vec<Tile> = batch
                .par_iter()
                .with_max_len(1)
                .map(|tile| {
                    let tile = self.tile::<COUNT>(*tile)?;
                    let rays = tile.rays.camera;
                    let before = done.fetch_add(rays, Ordering::Relaxed);
                    self.progress.advanced(before + rays, total);
                    Ok(tile)
                })
                .collect::<Result<_, RenderError>>()?;
            // In order: sums of floats depend on it.
            for tile in &tiles {
                film.merge(&tile.film);
                picture.rays += tile.rays;
                picture.counts += tile.counts;
                self.place(&mut picture, tile);
            }
        }
        picture.radiance = film.develop(self.plan);
        picture.seconds = start.elapsed().as_secs_f64();
        Ok(picture)
    }

    fn blank(&self, count: bool) -> Rendered {
        let crop = &self.plan.crop;
        let pixels = crop.pixels();
        let none = vec![PixelCounts::default(); if count { pixels } else { 0 }];
        Rendered {
            width: crop.width() as u32,
            height: crop.height() as u32,
            origin: (crop.min[0] as u32, crop.min[1] as u32),
            samples_per_pixel: self.samples_per_pixel,
            radiance: vec![],
            depth: vec![f32::INFINITY; pixels],
            normal: vec![[0.0; 3]; pixels],
            rays: RayKinds::default(),
            counts: RayKinds::default(),
            pixel_counts: count.then(|| PixelCounters {
                closest: none.clone(),
                shadow: none,
            }),
            seconds: 0.0,
        }
    }

    /// Copies what a tile knows of its own pixels.
    fn place(&self, picture: &mut Rendered, tile: &Tile) {
        let width = tile.pixels.width();
        for (i, hits) in tile.first_hits.iter().enumerate() {
            let x = tile.pixels.min[0] + (i % width) as i32;
            let y = tile.pixels.min[1] + (i / width) as i32;
            let Some(pixel) = self.plan.crop.index(x, y) else {
                continue;
            };
            if hits.count > 0 {
                picture.depth[pixel] = hits.distance / hits.count as f32;
                picture.normal[pixel] = (hits.normal / hits.count as f32).into();
            }
            if let Some(counters) = &mut picture.pixel_counts {
                counters.closest[pixel] = tile.closest[i];
                counters.shadow[pixel] = tile.shadow[i];
            }
        }
    }

    fn tile<const COUNT: bool>(&self, pixels: Window) -> Result<Tile, RenderError> {
        let mut gatherer = Gatherer::<COUNT>::new(self.world, self.tree, self.sequence);
        let count = pixels.pixels();
        let mut film = FilmTile::new(self.plan.reach(&pixels));
        let mut first_hits = Vec::with_capacity(count);
        let mut closest = Vec::with_capacity(if COUNT { count } else { 0 });
        let mut shadow = Vec::with_capacity(if COUNT { count } else { 0 });
        for y in pixels.min[1]..pixels.max[1] {
            if self.progress.cancelled() {
                return Err(RenderError::Cancelled);
            }
            for x in pixels.min[0]..pixels.max[0] {
                let before = gatherer.tracer.counts;
                let mut hits = FirstHits::default();
                gatherer.sampler.start_pixel(x, y);
                for number in 0..self.samples_per_pixel {
                    gatherer.sampler.start_sample(number);
                    let place = Vec2::new(x as f32, y as f32) + gatherer.sampler.next_2d();
                    // pbrt's time; here nothing moves.
                    let _time = gatherer.sampler.next_1d();
                    let beam = self
                        .camera
                        .beam(place, gatherer.sampler.next_2d(), self.spacing);
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

impl From<Counts> for PixelCounts {
    fn from(counts: Counts) -> Self {
        let short = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
        PixelCounts {
            triangle_tests: short(counts.triangle_tests),
            kd_visits: short(counts.kd_visits),
            oblique_visits: short(counts.oblique_visits),
            leaf_visits: short(counts.leaf_visits),
        }
    }
}
