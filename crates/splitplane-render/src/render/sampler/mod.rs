//! Where the numbers come from that choose a path.

mod halton;
mod pixel;
mod random;
mod sobol;

use glam::Vec2;
use rand::Rng;
use rand_pcg::Pcg32;

pub(super) use halton::{HaltonSequence, radical_inverse_of};
use pixel::{PixelSamples, Spread};
use random::{of_pixel, of_tile, unit};
use sobol::SobolSequence;

use super::film::Window;
use crate::scene::settings::SamplerKind;

/// What all threads share of a sampler.
pub(super) enum Sequence {
    Halton(HaltonSequence),
    Sobol(SobolSequence),
    /// Random numbers, the first of each sample spread over the pixel or not. With seed 0 those of a
    /// tile of the picture are one sequence, as in pbrt-v3; else those of a pixel.
    Random {
        spread: Option<(Spread, usize)>,
        seed: u64,
    },
}

impl Sequence {
    /// `sampled`: all pixels that are sampled, `count` times each.
    pub(super) fn new(kind: SamplerKind, sampled: &Window, count: u32, seed: u64) -> Self {
        let extent = [sampled.width() as i32, sampled.height() as i32];
        let spread = |spread, dimensions: u32| Sequence::Random {
            spread: Some((spread, dimensions.min(64) as usize)),
            seed,
        };
        match kind {
            SamplerKind::Halton { sample_at_center } => {
                Sequence::Halton(HaltonSequence::new(extent, sample_at_center, seed))
            }
            SamplerKind::Sobol => Sequence::Sobol(SobolSequence::new(sampled.min, extent, seed)),
            SamplerKind::Random => Sequence::Random { spread: None, seed },
            SamplerKind::Stratified {
                columns,
                jitter,
                dimensions,
            } => {
                // Another number of samples than the scene's may not fit its columns.
                let columns = if columns > 0 && count.is_multiple_of(columns) {
                    columns
                } else {
                    let most = count.isqrt().max(1);
                    (1..=most)
                        .rev()
                        .find(|c| count.is_multiple_of(*c))
                        .unwrap_or(1)
                };
                let cells = Spread::Stratified {
                    x: columns,
                    y: (count / columns).max(1),
                    jitter,
                };
                spread(cells, dimensions)
            }
            SamplerKind::ZeroTwo { dimensions } => spread(Spread::ZeroTwo, dimensions),
        }
    }
}

/// The place in the sequence of one sample of one pixel.
pub(super) struct Sampler<'s> {
    sequence: &'s Sequence,
    pixel: [i32; 2],
    /// Halton: index of the pixel's first sample.
    offset: u64,
    /// Halton, Sobol: index of this sample.
    index: u64,
    /// This sample's number within the pixel.
    number: u32,
    /// The number of the first sample of this pass.
    first: u32,
    dimension: usize,
    random: Pcg32,
    samples: PixelSamples,
}

/// Dimensions that are drawn at once for an integrator that needs many begin here, after those of
/// the camera.
const FIRST_ARRAY_DIMENSION: usize = 5;

impl<'s> Sampler<'s> {
    pub(super) fn new(sequence: &'s Sequence) -> Self {
        Sampler {
            sequence,
            pixel: [0; 2],
            offset: 0,
            index: 0,
            number: 0,
            first: 0,
            dimension: 0,
            random: of_tile(0),
            samples: PixelSamples::default(),
        }
    }

    /// Starts a tile of the picture, whose samples from number `first` on come next.
    pub(super) fn start_tile(&mut self, tile: u64, first: u32) {
        self.first = first;
        self.random = of_tile(tile);
    }

    /// Starts a pixel, of which `count` samples come next.
    pub(super) fn start_pixel(&mut self, x: i32, y: i32, count: u32) {
        self.pixel = [x, y];
        if let Sequence::Random { seed, .. } = self.sequence
            && (*seed, self.first) != (0, 0)
        {
            self.random = of_pixel(*seed, self.pixel, self.first);
        }
        match self.sequence {
            Sequence::Halton(halton) => self.offset = halton.first_index(x, y),
            Sequence::Random {
                spread: Some((spread, dimensions)),
                ..
            } => {
                self.samples
                    .draw(*spread, *dimensions, count as usize, &mut self.random);
            }
            Sequence::Random { spread: None, .. } | Sequence::Sobol(_) => {}
        }
    }

    pub(super) fn start_sample(&mut self, number: u32) {
        self.number = number;
        self.dimension = 0;
        self.samples.start();
        match self.sequence {
            Sequence::Halton(halton) => {
                self.index = halton.index(self.offset, u64::from(number));
            }
            Sequence::Sobol(sobol) => self.index = sobol.index(self.pixel, u64::from(number)),
            Sequence::Random { .. } => {}
        }
    }

    pub(super) fn next_1d(&mut self) -> f32 {
        match self.sequence {
            Sequence::Halton(halton) => {
                let value = halton.value(self.index, self.dimension);
                self.dimension += 1;
                value
            }
            Sequence::Sobol(sobol) => {
                let value = sobol.value(self.pixel, self.index, self.dimension);
                self.dimension += 1;
                value
            }
            Sequence::Random { .. } => {
                let number = (self.number - self.first) as usize;
                self.samples.next_1d(number, &mut self.random)
            }
        }
    }

    pub(super) fn next_2d(&mut self) -> Vec2 {
        if let Sequence::Random { .. } = self.sequence {
            let number = (self.number - self.first) as usize;
            return self.samples.next_2d(number, &mut self.random);
        }
        let x = self.next_1d();
        Vec2::new(x, self.next_1d())
    }

    /// Number `i` of `count` points that are well spread among each other. They use the same two
    /// dimensions of as many points of the sequence; [`Sampler::end_array`] goes on after those.
    pub(super) fn array_2d(&mut self, count: u32, i: u32) -> Vec2 {
        let number = u64::from(self.number) * u64::from(count) + u64::from(i);
        let [d, e] = [FIRST_ARRAY_DIMENSION, FIRST_ARRAY_DIMENSION + 1];
        match self.sequence {
            Sequence::Halton(halton) => {
                let index = halton.index(self.offset, number);
                Vec2::new(halton.value(index, d), halton.value(index, e))
            }
            Sequence::Sobol(sobol) => {
                let index = sobol.index(self.pixel, number);
                let value = |d| sobol.value(self.pixel, index, d);
                Vec2::new(value(d), value(e))
            }
            Sequence::Random { .. } => {
                let x = unit(self.random.next_u32());
                Vec2::new(x, unit(self.random.next_u32()))
            }
        }
    }

    /// Skips the dimensions of [`Sampler::array_2d`].
    pub(super) fn end_array(&mut self) {
        self.dimension = self.dimension.max(FIRST_ARRAY_DIMENSION + 2);
    }
}
