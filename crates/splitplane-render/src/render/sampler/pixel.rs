//! Samples that are spread within each pixel: stratified, or by a (0, 2)-sequence
//! [PBRT3, 7.3 and 7.5].

use glam::Vec2;
use rand::Rng;
use rand_pcg::Pcg32;

use super::random::{below, unit};
use crate::render::sampling::ONE_MINUS_EPSILON;

/// How the samples of a pixel are spread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) enum Spread {
    /// One in each of `x` by `y` cells.
    Stratified { x: u32, y: u32, jitter: bool },
    /// Van der Corput's and Sobol's sequence, shifted and in random order.
    ZeroTwo,
}

/// The first numbers of all samples of one pixel.
#[derive(Debug, Default)]
pub(super) struct PixelSamples {
    ones: Vec<Vec<f32>>,
    pairs: Vec<Vec<Vec2>>,
    /// How many of each have been given to the sample at hand.
    used: [usize; 2],
}

impl PixelSamples {
    /// Draws `count` samples of as many `dimensions`, of single numbers and of pairs.
    pub(super) fn draw(
        &mut self,
        spread: Spread,
        dimensions: usize,
        count: usize,
        random: &mut Pcg32,
    ) {
        self.ones.resize(dimensions, vec![]);
        self.pairs.resize(dimensions, vec![]);
        for ones in &mut self.ones {
            ones.clear();
            match spread {
                Spread::Stratified { jitter, .. } => ones.extend((0..count).map(|i| {
                    let part = if jitter { unit(random.next_u32()) } else { 0.5 };
                    ((i as f32 + part) * (1.0 / count as f32)).min(ONE_MINUS_EPSILON)
                })),
                Spread::ZeroTwo => {
                    let mut bits = random.next_u32();
                    ones.extend((0..count).map(|i| {
                        let value = unit(bits);
                        bits ^= reversed(i);
                        value
                    }));
                    // pbrt-v3 also shuffles each sample alone, which draws as many numbers.
                    (0..count).for_each(|_| _ = random.next_u32());
                }
            }
            shuffle(ones, random);
        }
        for pairs in &mut self.pairs {
            pairs.clear();
            match spread {
                Spread::Stratified { x, y, jitter } => {
                    let (dx, dy) = (1.0 / x as f32, 1.0 / y as f32);
                    for i in 0..count {
                        let mut part = || match jitter {
                            true => unit(random.next_u32()),
                            false => 0.5,
                        };
                        let (px, py) = (part(), part());
                        let (column, row) = (i as u32 % x, i as u32 / x);
                        pairs.push(Vec2::new(
                            ((column as f32 + px) * dx).min(ONE_MINUS_EPSILON),
                            ((row as f32 + py) * dy).min(ONE_MINUS_EPSILON),
                        ));
                    }
                }
                Spread::ZeroTwo => {
                    let mut bits = [random.next_u32(), random.next_u32()];
                    for i in 0..count {
                        pairs.push(Vec2::from(bits.map(unit)));
                        bits[0] ^= reversed(i);
                        bits[1] ^= sobol(i);
                    }
                    (0..count).for_each(|_| _ = random.next_u32());
                }
            }
            shuffle(pairs, random);
        }
        self.start();
    }

    /// Starts a sample.
    pub(super) fn start(&mut self) {
        self.used = [0; 2];
    }

    pub(super) fn next_1d(&mut self, number: usize, random: &mut Pcg32) -> f32 {
        let dimension = self.used[0];
        self.used[0] += 1;
        match self.ones.get(dimension) {
            Some(ones) => ones[number],
            None => unit(random.next_u32()),
        }
    }

    pub(super) fn next_2d(&mut self, number: usize, random: &mut Pcg32) -> Vec2 {
        let dimension = self.used[1];
        self.used[1] += 1;
        match self.pairs.get(dimension) {
            Some(pairs) => pairs[number],
            None => {
                let x = unit(random.next_u32());
                Vec2::new(x, unit(random.next_u32()))
            }
        }
    }
}

/// What Gray's code changes from number `i` of van der Corput's sequence to the next.
fn reversed(i: usize) -> u32 {
    0x8000_0000_u32 >> (i + 1).trailing_zeros().min(31)
}

/// The same for the second dimension of Sobol's: rows of Pascal's triangle modulo 2.
fn sobol(i: usize) -> u32 {
    (0..(i + 1).trailing_zeros().min(31)).fold(0x8000_0000, |v: u32, _| v ^ (v >> 1))
}

fn shuffle<T>(values: &mut [T], random: &mut Pcg32) {
    let count = values.len();
    for i in 0..count {
        let other = i + below(random, (count - i) as u32) as usize;
        values.swap(i, other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spread_has_a_sample_in_each_cell() {
        let jittered = Spread::Stratified {
            x: 4,
            y: 4,
            jitter: true,
        };
        for spread in [jittered, Spread::ZeroTwo] {
            let mut random = Pcg32::new(1, 2);
            let mut samples = PixelSamples::default();
            samples.draw(spread, 3, 16, &mut random);
            for dimension in 0..3 {
                let (mut ones, mut pairs) = ([false; 16], [false; 16]);
                for number in 0..16 {
                    samples.used = [dimension; 2];
                    ones[(16.0 * samples.next_1d(number, &mut random)) as usize] = true;
                    let p = 4.0 * samples.next_2d(number, &mut random);
                    pairs[p.x as usize * 4 + p.y as usize] = true;
                }
                assert!(ones.iter().chain(&pairs).all(|&s| s), "{spread:?}");
            }
        }
    }
}
