//! Independent random numbers, the same for a pixel whoever renders it.

use rand::Rng;
use rand_pcg::Pcg32;

use crate::render::sampling::ONE_MINUS_EPSILON;

/// PCG's own state at the start.
const STATE: u64 = 0x853c_49e6_748f_ea9b;

/// pbrt-v3's numbers of a tile of the picture.
pub(super) fn of_tile(tile: u64) -> Pcg32 {
    Pcg32::new(STATE, tile)
}

/// The numbers of a pixel, from sample `first` on.
pub(super) fn of_pixel(seed: u64, [x, y]: [i32; 2], first: u32) -> Pcg32 {
    let pixel = u64::from(y as u32) << 32 | u64::from(x as u32);
    // Neighbouring states and streams of PCG are correlated: both are mixed first.
    let mixed = mix(pixel ^ mix(first.into()));
    Pcg32::new(mix(seed ^ mixed), mixed)
}

/// A number in `[0, 1)`, as pbrt-v3 makes it of 32 bits.
pub(super) fn unit(bits: u32) -> f32 {
    (bits as f32 * (-32.0f32).exp2()).min(ONE_MINUS_EPSILON)
}

/// A number below `bound`, all alike: bits that would favour small numbers are drawn again.
pub(super) fn below(random: &mut Pcg32, bound: u32) -> u32 {
    let threshold = bound.wrapping_neg() % bound;
    loop {
        let bits = random.next_u32();
        if bits >= threshold {
            return bits % bound;
        }
    }
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
        let mut random = of_pixel(7, [-3, 12], 0);
        let mean = (0..10_000)
            .map(|_| f64::from(unit(random.next_u32())))
            .sum::<f64>()
            / 10_000.0;
        assert!((mean - 0.5).abs() < 0.015, "{mean}");
    }

    #[test]
    fn seeds_pixels_and_passes_give_different_numbers() {
        let first = |seed, x, y, pass| of_pixel(seed, [x, y], pass).next_u32();
        assert_eq!(first(1, 2, 3, 4), first(1, 2, 3, 4));
        let all = [
            first(0, 0, 0, 0),
            first(1, 0, 0, 0),
            first(0, 1, 0, 0),
            first(0, 0, 1, 0),
            first(0, 0, 0, 1),
            of_tile(0).next_u32(),
            of_tile(1).next_u32(),
        ];
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b));
        }
    }
}
