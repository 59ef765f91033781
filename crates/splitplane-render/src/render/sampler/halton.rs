//! The Halton sequence, spread over the picture as pbrt-v3 does it [PBRT3, 7.4].
//!
//! One sequence serves all pixels. Its first two dimensions, scaled up by a power of 2 and a power
//! of 3, are positions in a block of pixels; so the samples of one pixel are every `stride`-th
//! point, from a first one that follows from the Chinese remainder theorem. Further dimensions
//! have their digits permuted at random, against the correlations of large bases.

use rand::Rng;
use rand_pcg::Pcg32;

use super::random::{below, mix, unit};
use crate::render::sampling::ONE_MINUS_EPSILON;

/// As many dimensions as pbrt-v3 has; further ones are independent random numbers.
const DIMENSIONS: usize = 1000;

/// The block of pixels that the sequence covers has at least this many in x and in y, or else all
/// of the picture's.
const MAX_BLOCK: u64 = 128;

pub(in crate::render) struct HaltonSequence {
    primes: Vec<u32>,
    /// Where a prime's permutation begins in `permutations`.
    first: Vec<u32>,
    permutations: Vec<u16>,
    /// The block is `2^exponents[0]` wide and `3^exponents[1]` high.
    exponents: [u32; 2],
    scales: [u64; 2],
    /// `inverses[0] * scales[1] = 1` modulo `scales[0]`, and the other way round.
    inverses: [u64; 2],
    sample_at_center: bool,
    /// Added to the position in the pixel, modulo 1; zero for seed 0.
    rotation: [f32; 2],
    seed: u64,
}

impl HaltonSequence {
    pub(in crate::render) fn new(extent: [i32; 2], sample_at_center: bool, seed: u64) -> Self {
        let mut exponents = [0; 2];
        let scales = std::array::from_fn(|axis| {
            let (base, mut scale) = ([2, 3][axis], 1);
            while scale < MAX_BLOCK.min(extent[axis].max(0) as u64) {
                scale *= base;
                exponents[axis] += 1;
            }
            scale
        });
        // Seed 0 is pbrt-v3's generator in its initial state (PCG's own default).
        let mut random = match seed {
            0 => Pcg32::new(0xcafe_f00d_d15e_a5e5, 0x6d1f_1ce5_ca5c_aded),
            seed => Pcg32::new(mix(seed), mix(!seed)),
        };
        let primes = first_primes();
        let mut first = Vec::with_capacity(DIMENSIONS);
        let mut permutations: Vec<u16> = Vec::new();
        for &prime in &primes {
            let start = permutations.len();
            first.push(start as u32);
            permutations.extend(0..prime as u16);
            let digits = &mut permutations[start..];
            for i in 0..prime {
                let other = i + below(&mut random, prime - i);
                digits.swap(i as usize, other as usize);
            }
        }
        HaltonSequence {
            primes,
            first,
            permutations,
            exponents,
            scales,
            inverses: [
                inverse_modulo(scales[1], scales[0]),
                inverse_modulo(scales[0], scales[1]),
            ],
            sample_at_center,
            rotation: match seed {
                0 => [0.0; 2],
                _ => [unit(random.next_u32()), unit(random.next_u32())],
            },
            seed,
        }
    }

    fn stride(&self) -> u64 {
        self.scales[0] * self.scales[1]
    }

    /// The index of a pixel's first sample.
    pub(super) fn first_index(&self, x: i32, y: i32) -> u64 {
        let stride = self.stride();
        let place = [x, y].map(|c| c.rem_euclid(MAX_BLOCK as i32) as u64);
        let sum: u64 = (0..2)
            .map(|axis| {
                let digits = mirrored(place[axis], [2, 3][axis], self.exponents[axis]);
                digits * (stride / self.scales[axis]) * self.inverses[axis]
            })
            .sum();
        sum % stride
    }

    /// The index of sample `number` of the pixel whose first sample is `first`.
    pub(super) fn index(&self, first: u64, number: u64) -> u64 {
        first.wrapping_add(number.wrapping_mul(self.stride()))
    }

    /// A coordinate of the point with this index, in `[0, 1)`; the first two are the position
    /// within the pixel.
    pub(super) fn value(&self, index: u64, dimension: usize) -> f32 {
        match dimension {
            0 | 1 if self.sample_at_center => 0.5,
            0 => self.rotated(
                0,
                (index >> self.exponents[0]).reverse_bits() as f32 * (-64f32).exp2(),
            ),
            1 => self.rotated(1, radical_inverse_of(3, index / self.scales[1])),
            d if d < DIMENSIONS => {
                let (prime, first) = (self.primes[d], self.first[d] as usize);
                let digits = &self.permutations[first..first + prime as usize];
                radical_inverse(prime, digits, index)
            }
            d => unit((mix(index ^ mix(self.seed ^ d as u64)) >> 32) as u32),
        }
    }

    fn rotated(&self, axis: usize, value: f32) -> f32 {
        let turned = value + self.rotation[axis];
        let turned = if turned >= 1.0 { turned - 1.0 } else { turned };
        turned.min(ONE_MINUS_EPSILON)
    }
}

/// The digits of `a` in `base`, permuted and mirrored at the point; the infinitely many leading
/// zeros become as many times `digits[0]` at the end.
fn radical_inverse(base: u32, digits: &[u16], mut a: u64) -> f32 {
    let inverse = 1.0 / base as f32;
    let mut scale = 1.0f32;
    let mut reversed = 0u64;
    let mut push = |digit: u16| {
        reversed = reversed.wrapping_mul(u64::from(base)) + u64::from(digit);
        scale *= inverse;
    };
    // Divisions of 64 bits are several times slower.
    while a > u64::from(u32::MAX) {
        push(digits[(a % u64::from(base)) as usize]);
        a /= u64::from(base);
    }
    let mut a = a as u32;
    while a != 0 {
        push(digits[(a % base) as usize]);
        a /= base;
    }
    let rest = inverse * f32::from(digits[0]) / (1.0 - inverse);
    (scale * (reversed as f32 + rest)).min(ONE_MINUS_EPSILON)
}

/// The radical inverse in a base of at most 11, digits as they are.
pub(in crate::render) fn radical_inverse_of(base: u32, a: u64) -> f32 {
    radical_inverse(base, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10], a)
}

/// The lowest `count` digits of `a` in `base`, in reverse order.
fn mirrored(mut a: u64, base: u64, count: u32) -> u64 {
    (0..count).fold(0, |index, _| {
        let digit = a % base;
        a /= base;
        index * base + digit
    })
}

/// `x` with `a * x = 1` modulo `n`, for coprime `a` and `n`, by Euclid's extended algorithm.
fn inverse_modulo(a: u64, n: u64) -> u64 {
    let (mut r, mut next_r) = (n as i64, (a % n.max(1)) as i64);
    let (mut x, mut next_x) = (0i64, 1i64);
    while next_r != 0 {
        let quotient = r / next_r;
        (r, next_r) = (next_r, r - quotient * next_r);
        (x, next_x) = (next_x, x - quotient * next_x);
    }
    x.rem_euclid(n.max(1) as i64) as u64
}

fn first_primes() -> Vec<u32> {
    let mut primes: Vec<u32> = Vec::with_capacity(DIMENSIONS);
    let mut candidate = 2;
    while primes.len() < DIMENSIONS {
        let mut divisors = primes.iter().take_while(|&&p| p * p <= candidate);
        if divisors.all(|p| candidate % p != 0) {
            primes.push(candidate);
        }
        candidate += 1;
    }
    primes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generator_of_seed_0_starts_like_pcg_by_default() {
        // The first outputs of PCG32 from state 0x853c49e6748fea9b, increment 0xda3e39cb94b95bdb.
        let (mut state, increment) = (0x853c_49e6_748f_ea9b_u64, 0xda3e_39cb_94b9_5bdb_u64);
        let mut random = Pcg32::new(0xcafe_f00d_d15e_a5e5, 0x6d1f_1ce5_ca5c_aded);
        for _ in 0..10 {
            let old = state;
            state = old
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(increment);
            let shifted = (((old >> 18) ^ old) >> 27) as u32;
            assert_eq!(random.next_u32(), shifted.rotate_right((old >> 59) as u32));
        }
    }

    #[test]
    fn radical_inverses_mirror_digits() {
        let identity: Vec<u16> = (0..7).collect();
        assert!((radical_inverse(3, &identity, 5) - 7.0 / 9.0).abs() < 1e-6);
        assert!((radical_inverse(5, &identity, 7) - 11.0 / 25.0).abs() < 1e-6);
        assert_eq!(radical_inverse(7, &identity, 0), 0.0);
        // All digits 0 become 1: 0.111… in base 3.
        assert!((radical_inverse(3, &[1, 2, 0], 0) - 0.5).abs() < 1e-7);
    }

    #[test]
    fn samples_of_a_pixel_lie_in_that_pixel() {
        let halton = HaltonSequence::new([200, 400], false, 0);
        assert_eq!((halton.scales, halton.stride()), ([128, 243], 31_104));
        for (x, y) in [(300, 400), (0, 0), (-1, -2), (499, 799), (127, 128)] {
            let first = halton.first_index(x, y);
            for number in 0..20 {
                let index = halton.index(first, number);
                // The whole sequence's point, in a block of 128 x 243 pixels.
                let px = index.reverse_bits() as f64 * (-64f64).exp2() * 128.0;
                let py = f64::from(radical_inverse_of(3, index)) * 243.0;
                assert_eq!(px.floor() as i32, x.rem_euclid(128));
                assert_eq!((py + 1e-4).floor() as i32, y.rem_euclid(128));
                let inside = f64::from(halton.value(index, 0));
                assert!((px.fract() - inside).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn small_pictures_have_small_blocks() {
        let halton = HaltonSequence::new([1, 10], false, 0);
        assert_eq!((halton.scales, halton.stride()), ([1, 27], 27));
        let mut seen = vec![];
        for y in 0..10 {
            seen.push(halton.first_index(0, y));
        }
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 10);
        assert_eq!(HaltonSequence::new([1, 1], false, 0).first_index(5, 5), 0);
    }

    #[test]
    fn inverses_are_inverses() {
        assert_eq!(243 * inverse_modulo(243, 128) % 128, 1);
        assert_eq!(128 * inverse_modulo(128, 243) % 243, 1);
        assert_eq!(inverse_modulo(3, 1), 0);
    }

    #[test]
    fn every_dimension_is_stratified_in_its_own_base() {
        let halton = HaltonSequence::new([64, 64], false, 3);
        for (dimension, base) in [(2, 5), (3, 7), (10, 31), (999, 7919)] {
            let mut seen = vec![false; base];
            for index in 0..base as u64 {
                let value = halton.value(index, dimension);
                seen[(value * base as f32 + 1e-3) as usize % base] = true;
            }
            assert!(
                seen.iter().filter(|s| **s).count() >= base - base / 100,
                "{base}"
            );
        }
        assert!((0..1.0 as u64 + 9).all(|i| (0.0..1.0).contains(&halton.value(i, 5000))));
    }

    #[test]
    fn another_seed_is_another_sequence_and_the_centre_stays_the_centre() {
        let values = |seed, d| HaltonSequence::new([64, 64], false, seed).value(12_345, d);
        for d in [0, 1, 2, 40] {
            assert_ne!(values(0, d), values(1, d));
            assert_eq!(values(1, d), values(1, d));
        }
        let centred = HaltonSequence::new([64, 64], true, 9);
        assert_eq!((centred.value(77, 0), centred.value(77, 1)), (0.5, 0.5));
    }
}
