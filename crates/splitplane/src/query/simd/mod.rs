//! Numbers side by side, on whatever the machine has.
//!
//! Every operation gives the same bits everywhere, but for [`Lanes::mul_add`], which may round once
//! or twice. Boxes are met by it, so what is visited may differ from machine to machine by a box
//! that a ray grazes. Hits never do.
#![allow(unsafe_code)]

mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::sync::atomic::{AtomicU8, Ordering};

/// f32 side by side, at most 32 of them.
pub(super) trait Lanes: Copy {
    fn splat(value: f32) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// self · factor + term, rounded once or twice.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// The larger one of each pair; `other` where either is NaN.
    fn max(self, other: Self) -> Self;
    /// The smaller one of each pair; `other` where either is NaN.
    fn min(self, other: Self) -> Self;
    /// Without their signs.
    fn abs(self) -> Self;
    /// Negative where one of both is, not both, by their bits.
    fn times_sign(self, other: Self) -> Self;
    /// A bit for each pair that is ordered so.
    fn le(self, other: Self) -> u32;
    /// A bit for each pair that is ordered so.
    fn lt(self, other: Self) -> u32;
    /// The largest one; there are no NaNs.
    fn highest(self) -> f32;
}

/// Eight of them: the boxes of a node, the triangles of a leaf.
pub(super) trait Eight: Lanes {
    /// As many as the machine takes at once of [`SIXTEEN`].
    type Part: Part;
    fn load(from: &[f32; 8]) -> Self;
    fn to_array(self) -> [f32; 8];
    /// Of eight rows, the columns.
    fn columns(rows: &[[f32; 8]; 8]) -> [Self; 8];
    /// Asks for 320 bytes of memory, as many as a leaf has at most, since they will be needed soon;
    /// any address will do.
    fn prefetch(address: *const u8);
}

/// How many a [`Part`] is a part of: the rays of a packet.
pub(super) const SIXTEEN: usize = 16;

/// All of sixteen numbers, or the first or second half.
pub(super) trait Part: Lanes {
    /// Something for each part.
    type Parts<T: Copy>: Copy + AsRef<[T]> + AsMut<[T]>;
    /// How many are in a part.
    const COUNT: usize;
    /// How many parts there are.
    const PARTS: usize = SIXTEEN / Self::COUNT;
    /// A bit for each in a part.
    const ALL: u32 = u32::MAX >> (32 - Self::COUNT);
    /// The same for each part.
    fn parts<T: Copy>(value: T) -> Self::Parts<T>;
    fn load_part(from: &[f32; SIXTEEN], part: usize) -> Self;
    fn store_part(self, to: &mut [f32; SIXTEEN], part: usize);
}

impl<L: Eight> Part for L {
    type Parts<T: Copy> = [T; 2];
    const COUNT: usize = 8;

    #[inline(always)]
    fn parts<T: Copy>(value: T) -> [T; 2] {
        [value; 2]
    }
    #[inline(always)]
    fn load_part(from: &[f32; SIXTEEN], part: usize) -> Self {
        L::load(&from.as_chunks().0[part])
    }
    #[inline(always)]
    fn store_part(self, to: &mut [f32; SIXTEEN], part: usize) {
        to.as_chunks_mut().0[part] = self.to_array();
    }
}

/// The bit of the sign.
const SIGN: u32 = 1 << 31;

/// Runs a generic function on the lanes of the machine.
pub(super) trait Task {
    type Output;
    fn run<L: Eight>(self) -> Self::Output;
}

/// Which instructions queries may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Instructions {
    Portable = 1,
    #[cfg(target_arch = "x86_64")]
    Avx2 = 2,
    /// With twice as many registers for eight numbers, and sixteen at a time where they are rays.
    #[cfg(target_arch = "x86_64")]
    Avx512 = 3,
}

impl Instructions {
    /// The best that the machine has.
    #[inline(always)]
    pub(crate) fn best() -> Self {
        // Known after the first query; asking four times per query takes longer than a short one.
        static KNOWN: AtomicU8 = AtomicU8::new(0);
        match KNOWN.load(Ordering::Relaxed) {
            #[cfg(target_arch = "x86_64")]
            3 => Instructions::Avx512,
            #[cfg(target_arch = "x86_64")]
            2 => Instructions::Avx2,
            1 => Instructions::Portable,
            _ => {
                let best = Self::look_up();
                KNOWN.store(best as u8, Ordering::Relaxed);
                best
            }
        }
    }

    /// All that the machine has.
    #[cfg(test)]
    pub(super) fn available() -> Vec<Self> {
        let mut all = vec![Instructions::Portable];
        #[cfg(target_arch = "x86_64")]
        all.extend([Instructions::Avx2, Instructions::Avx512]);
        all.retain(|&instructions| instructions as u8 <= Self::best() as u8);
        all
    }

    #[cold]
    fn look_up() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("fma")
            && std::arch::is_x86_feature_detected!("bmi1")
            && std::arch::is_x86_feature_detected!("bmi2")
            && std::arch::is_x86_feature_detected!("lzcnt")
            && std::arch::is_x86_feature_detected!("popcnt")
        {
            let more = std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512vl")
                && std::arch::is_x86_feature_detected!("avx512dq");
            return match more {
                true => Instructions::Avx512,
                false => Instructions::Avx2,
            };
        }
        Instructions::Portable
    }

    #[inline(always)]
    pub(super) fn run<T: Task>(self, task: T) -> T::Output {
        match self {
            Instructions::Portable => portable(task),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `look_up` has found these instructions, and nothing else makes an `Avx2`.
            Instructions::Avx2 => unsafe { x86::run(task) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as with `Avx2`.
            Instructions::Avx512 => unsafe { x86::run_wider(task) },
        }
    }
}

/// Apart, so that the memory it needs is not asked for where better instructions are used.
#[inline(never)]
fn portable<T: Task>(task: T) -> T::Output {
    task.run::<portable::Portable>()
}
