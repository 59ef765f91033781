//! Where the numbers come from that choose a path.

mod halton;
mod random;

use glam::Vec2;

pub(super) use halton::{HaltonSequence, radical_inverse_of};
use random::PixelRandom;

use crate::scene::settings::SamplerKind;

/// What all threads share of a sampler.
pub(super) enum Sequence {
    Halton(HaltonSequence),
    Random { seed: u64 },
}

impl Sequence {
    /// `extent`: width and height of all pixels that are sampled.
    pub(super) fn new(kind: SamplerKind, extent: [i32; 2], seed: u64) -> Self {
        match kind {
            SamplerKind::Halton { sample_at_center } => {
                Sequence::Halton(HaltonSequence::new(extent, sample_at_center, seed))
            }
            SamplerKind::Random => Sequence::Random { seed },
        }
    }
}

/// The place in the sequence of one sample of one pixel.
pub(super) struct Sampler<'s> {
    sequence: &'s Sequence,
    /// Halton: index of the pixel's first sample.
    offset: u64,
    /// Halton: index of this sample.
    index: u64,
    /// This sample's number within the pixel.
    number: u32,
    dimension: usize,
    random: PixelRandom,
}

/// Dimensions that are drawn at once for an integrator that needs many begin here, after those of
/// the camera.
const FIRST_ARRAY_DIMENSION: usize = 5;

impl<'s> Sampler<'s> {
    pub(super) fn new(sequence: &'s Sequence) -> Self {
        Sampler {
            sequence,
            offset: 0,
            index: 0,
            number: 0,
            dimension: 0,
            random: PixelRandom::new(0, 0, 0),
        }
    }

    pub(super) fn start_pixel(&mut self, x: i32, y: i32) {
        match self.sequence {
            Sequence::Halton(halton) => self.offset = halton.first_index(x, y),
            Sequence::Random { seed } => self.random = PixelRandom::new(*seed, x, y),
        }
    }

    pub(super) fn start_sample(&mut self, number: u32) {
        self.number = number;
        self.dimension = 0;
        if let Sequence::Halton(halton) = self.sequence {
            self.index = halton.index(self.offset, u64::from(number));
        }
    }

    pub(super) fn next_1d(&mut self) -> f32 {
        match self.sequence {
            Sequence::Halton(halton) => {
                let value = halton.value(self.index, self.dimension);
                self.dimension += 1;
                value
            }
            Sequence::Random { .. } => self.random.next(),
        }
    }

    pub(super) fn next_2d(&mut self) -> Vec2 {
        let x = self.next_1d();
        Vec2::new(x, self.next_1d())
    }

    /// Number `i` of `count` points that are well spread among each other. They use the same two
    /// dimensions of as many points of the sequence; [`Sampler::end_array`] goes on after those.
    pub(super) fn array_2d(&mut self, count: u32, i: u32) -> Vec2 {
        match self.sequence {
            Sequence::Halton(halton) => {
                let number = u64::from(self.number) * u64::from(count) + u64::from(i);
                let index = halton.index(self.offset, number);
                Vec2::new(
                    halton.value(index, FIRST_ARRAY_DIMENSION),
                    halton.value(index, FIRST_ARRAY_DIMENSION + 1),
                )
            }
            Sequence::Random { .. } => self.next_2d(),
        }
    }

    /// Skips the dimensions of [`Sampler::array_2d`].
    pub(super) fn end_array(&mut self) {
        self.dimension = self.dimension.max(FIRST_ARRAY_DIMENSION + 2);
    }
}
