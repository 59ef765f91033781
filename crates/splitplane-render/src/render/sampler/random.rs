//! Independent random numbers, the same for a pixel whoever renders it.

use rand::Rng;
use rand_pcg::Pcg32;

use crate::render::sampling::ONE_MINUS_EPSILON;

pub(super) struct PixelRandom(Pcg32);

impl PixelRandom {
    pub(super) fn new(seed: u64, x: i32, y: i32) -> Self {
        let pixel = u64::from(y as u32) << 32 | u64::from(x as u32);
        // Neighbouring states and streams of PCG are correlated: both are mixed first.
        PixelRandom(Pcg32::new(mix(seed ^ mix(pixel)), mix(pixel)))
    }

    pub(super) fn next(&mut self) -> f32 {
        unit(self.0.next_u32())
    }
}

/// A number in `[0, 1)`, as pbrt-v3 makes it of 32 bits.
pub(super) fn unit(bits: u32) -> f32 {
    (bits as f32 * (-32.0f32).exp2()).min(ONE_MINUS_EPSILON)
}

/// SplitMix64's finalizer [Steele2014].
pub(super) fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_below_one_and_average_to_a_half() {
        assert!(unit(u32::MAX) < 1.0);
        let mut random = PixelRandom::new(7, -3, 12);
        let mean = (0..10_000).map(|_| f64::from(random.next())).sum::<f64>() / 10_000.0;
        assert!((mean - 0.5).abs() < 0.015, "{mean}");
    }

    #[test]
    fn seeds_and_pixels_give_different_numbers() {
        let first = |seed, x, y| PixelRandom::new(seed, x, y).next();
        assert_eq!(first(1, 2, 3), first(1, 2, 3));
        assert_ne!(first(1, 2, 3), first(2, 2, 3));
        assert_ne!(first(1, 2, 3), first(1, 3, 3));
        assert_ne!(first(1, 2, 3), first(1, 2, 4));
    }
}
