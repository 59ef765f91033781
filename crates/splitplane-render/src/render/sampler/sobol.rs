//! Sobol's sequence [Sobol1967] with Joe and Kuo's directions [Joe2008], spread over the picture as
//! pbrt-v3 does it [PBRT3, 7.7; Gruenschloss2012].
//!
//! The first two dimensions, scaled up to a power of two pixels, are positions in the picture; so
//! the first digits of a sample's index follow from its pixel.

use super::random::{mix, unit};

/// Digits of an index that count.
const COLUMNS: usize = 52;

/// Polynomials (degree and inner coefficients) and first directions of dimensions from the second
/// on; further dimensions are independent random numbers.
const DIRECTIONS: [(u32, u32, [u64; 7]); 20] = [
    (1, 0, [1, 0, 0, 0, 0, 0, 0]),
    (2, 1, [1, 3, 0, 0, 0, 0, 0]),
    (3, 1, [1, 3, 1, 0, 0, 0, 0]),
    (3, 2, [1, 1, 1, 0, 0, 0, 0]),
    (4, 1, [1, 1, 3, 3, 0, 0, 0]),
    (4, 4, [1, 3, 5, 13, 0, 0, 0]),
    (5, 2, [1, 1, 5, 5, 17, 0, 0]),
    (5, 4, [1, 1, 5, 5, 5, 0, 0]),
    (5, 7, [1, 1, 7, 11, 19, 0, 0]),
    (5, 11, [1, 1, 5, 1, 1, 0, 0]),
    (5, 13, [1, 1, 1, 3, 11, 0, 0]),
    (5, 14, [1, 3, 5, 5, 31, 0, 0]),
    (6, 1, [1, 3, 3, 9, 7, 49, 0]),
    (6, 13, [1, 1, 1, 15, 21, 21, 0]),
    (6, 16, [1, 3, 1, 13, 27, 49, 0]),
    (6, 19, [1, 1, 1, 15, 7, 5, 0]),
    (6, 22, [1, 3, 1, 15, 13, 25, 0]),
    (6, 25, [1, 1, 5, 5, 19, 61, 0]),
    (7, 1, [1, 3, 7, 11, 23, 15, 103]),
    (7, 4, [1, 3, 7, 13, 13, 15, 69]),
];

pub(in crate::render) struct SobolSequence {
    /// Of each dimension, what each digit of the index adds (without carry), in 32 bits.
    matrices: Vec<[u32; COLUMNS]>,
    /// The picture is `2^log2` pixels wide and high.
    log2: u32,
    min: [i32; 2],
    /// What each digit of a row's number adds to the index.
    of_row: Vec<u64>,
    seed: u64,
}

impl SobolSequence {
    /// For pixels from `min` on, `extent` in x and y. Seed 0 is the sequence itself; others shift
    /// all its digits.
    pub(super) fn new(min: [i32; 2], extent: [i32; 2], seed: u64) -> Self {
        let longest = extent
            .map(|c| c.max(1) as u32)
            .into_iter()
            .max()
            .unwrap_or(1);
        let log2 = longest.next_power_of_two().trailing_zeros();
        let mut matrices = vec![std::array::from_fn(
            |i| {
                if i < 32 { 1 << (31 - i) } else { 0 }
            },
        )];
        matrices.extend(DIRECTIONS.iter().map(|&(degree, inner, first)| {
            let s = degree as usize;
            let mut v = [0_u64; COLUMNS];
            for i in 0..COLUMNS {
                v[i] = if i < s {
                    first[i] << (63 - i)
                } else {
                    (1..s)
                        .filter(|k| inner >> (s - 1 - k) & 1 == 1)
                        .fold(v[i - s] ^ (v[i - s] >> s), |sum, k| sum ^ v[i - k])
                };
            }
            v.map(|v| (v >> 32) as u32)
        }));
        let mut sequence = SobolSequence {
            matrices,
            log2,
            min,
            of_row: vec![],
            seed,
        };
        sequence.of_row = sequence.rows();
        sequence
    }

    /// The inverse of what digits `log2` to `2 log2` of the index do to the first digits of the
    /// second dimension, by Gauss's elimination.
    fn rows(&self) -> Vec<u64> {
        let m = self.log2 as usize;
        // Row by row: the digits of y that index digit `m + i` flips, and which digit that is.
        let mut rows: Vec<(u64, u64)> = (0..m)
            .map(|i| (self.row_digits(1 << (m + i)), 1 << (m + i)))
            .collect();
        for digit in 0..m {
            let Some(pivot) = (digit..m).find(|&i| rows[i].0 >> digit & 1 == 1) else {
                // The matrix has full rank.
                continue;
            };
            rows.swap(digit, pivot);
            let chosen = rows[digit];
            for (i, row) in rows.iter_mut().enumerate() {
                if i != digit && row.0 >> digit & 1 == 1 {
                    *row = (row.0 ^ chosen.0, row.1 ^ chosen.1);
                }
            }
        }
        rows.into_iter().map(|row| row.1).collect()
    }

    /// The row of the picture that a sample lies in.
    fn row_digits(&self, index: u64) -> u64 {
        match self.log2 {
            0 => 0,
            log2 => u64::from(self.bits(index, 1) >> (32 - log2)),
        }
    }

    /// The index of sample `number` of a pixel.
    pub(super) fn index(&self, pixel: [i32; 2], number: u64) -> u64 {
        let m = self.log2;
        if m == 0 {
            return number;
        }
        let place: [u64; 2] = std::array::from_fn(|i| (pixel[i] - self.min[i]).max(0) as u64);
        // Digits of the column, mirrored.
        let column = place[0].reverse_bits() >> (64 - m);
        let known = number << (2 * m) | column;
        let row = place[1] ^ self.row_digits(known);
        (0..m as usize)
            .filter(|i| row >> i & 1 == 1)
            .fold(known, |index, i| index ^ self.of_row[i])
    }

    fn bits(&self, index: u64, dimension: usize) -> u32 {
        let (mut rest, mut bits) = (index, 0);
        for column in &self.matrices[dimension] {
            if rest == 0 {
                break;
            }
            if rest & 1 == 1 {
                bits ^= column;
            }
            rest >>= 1;
        }
        bits
    }

    /// A coordinate of a pixel's sample, in `[0, 1)`; the first two are the position in the pixel.
    pub(super) fn value(&self, pixel: [i32; 2], index: u64, dimension: usize) -> f32 {
        let shift = |d: usize| match self.seed {
            0 => 0,
            seed => (mix(seed ^ mix(d as u64)) >> 32) as u32,
        };
        if dimension >= self.matrices.len() {
            return unit((mix(index ^ mix(self.seed ^ dimension as u64)) >> 32) as u32);
        }
        let bits = self.bits(index, dimension);
        if dimension < 2 {
            // The digits that tell the pixel are left out; those after them are shifted.
            let in_pixel = if self.log2 == 0 {
                bits
            } else {
                bits << self.log2
            };
            let _ = pixel;
            return unit(in_pixel ^ shift(dimension));
        }
        unit(bits ^ shift(dimension))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_a_pixel_lie_in_that_pixel() {
        let sobol = SobolSequence::new([-2, -2], [100, 60], 0);
        assert_eq!(sobol.log2, 7);
        for pixel in [[-2, -2], [0, 0], [97, 57], [31, 12]] {
            for number in 0..9 {
                let index = sobol.index(pixel, number);
                let place = [0, 1].map(|d| sobol.bits(index, d) >> (32 - 7));
                assert_eq!(place, pixel.map(|c| (c + 2) as u32));
                assert_eq!(index >> 14, number);
            }
        }
    }

    #[test]
    fn every_dimension_has_one_point_in_each_interval() {
        let sobol = SobolSequence::new([0, 0], [1, 1], 0);
        for dimension in 0..=DIRECTIONS.len() {
            let mut seen = [false; 256];
            for index in 0..256 {
                seen[(sobol.value([0, 0], index, dimension) * 256.0) as usize] = true;
            }
            assert!(seen.iter().all(|&s| s), "dimension {dimension}");
        }
    }

    #[test]
    fn the_first_two_dimensions_are_a_net() {
        let sobol = SobolSequence::new([0, 0], [1, 1], 5);
        let mut seen = [false; 64];
        for index in 0..64 {
            let [x, y] = [0, 1].map(|d| sobol.value([0, 0], index, d));
            seen[(x * 8.0) as usize * 8 + (y * 8.0) as usize] = true;
        }
        assert!(seen.iter().all(|&s| s));
    }
}
