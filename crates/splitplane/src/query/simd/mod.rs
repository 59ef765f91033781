//! Numbers side by side, on whatever the machine has.
//!
//! Every operation gives the same bits everywhere, but for [`Lanes::mul_add`], which may round once
//! or twice. Boxes are met by it, so what is visited may differ from machine to machine by a box
//! that a ray grazes. Hits never do.
#![allow(unsafe_code)]

mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::ops::{Add, Div, Mul, Sub};
use std::sync::atomic::{AtomicU8, Ordering};

/// f32 side by side, at most 32 of them.
pub(super) trait Lanes: Copy {
    /// Half as many f64.
    type Double: Double;
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
    /// A bit for each that has the sign.
    fn negative(self) -> u32;
    /// A bit for each pair whose bits are ordered so, as unsigned numbers.
    fn lt_bits(self, other: Self) -> u32;
    /// Those of `other` where there is a bit.
    fn select(self, bits: u32, other: Self) -> Self;
    /// The largest one; there are no NaNs.
    fn highest(self) -> f32;
    /// As f64, the first and the second half of them.
    fn halves(self) -> [Self::Double; 2];
    /// Rounded to the nearest f32.
    fn of_halves(halves: [Self::Double; 2]) -> Self;
}

/// f64 side by side.
pub(super) trait Double:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// How many there are.
    const COUNT: u32;
    /// A bit for each that is below 0.
    fn negative(self) -> u32;
    /// A bit for each that is above 0.
    fn positive(self) -> u32;
}

/// Eight of them: the boxes of a node, the triangles of a leaf.
pub(super) trait Eight: Lanes {
    /// As many as the machine takes at once, of rays.
    type Part: Part;
    fn load(from: &[f32; 8]) -> Self;
    fn to_array(self) -> [f32; 8];
    /// Of eight rows, the columns.
    fn columns(rows: &[[f32; 8]; 8]) -> [Self; 8];
    /// Asks for [`PREFETCH`] bytes of memory, since they will be needed soon; any address will do.
    fn prefetch(address: *const u8);
}

/// As many bytes as a leaf has at most.
pub(super) const PREFETCH: usize = 320;

/// The rays of a packet, at most: how many a [`Part`] is a part of.
pub(super) const RAYS: usize = 64;

/// No [`Part`] has more.
pub(super) const LARGEST_PART: usize = 16;

/// As many f32 as the machine takes at once.
pub(super) trait Part: Lanes {
    /// Something for each part of a packet.
    type Parts<T: Copy>: Copy + AsRef<[T]> + AsMut<[T]>;
    /// How many are in a part.
    const COUNT: usize;
    /// A bit for each in a part.
    const ALL: u32 = u32::MAX >> (32 - Self::COUNT);
    /// The same for each part.
    fn parts<T: Copy>(value: T) -> Self::Parts<T>;
    /// Of as many rows of eight as are in a part, the columns.
    fn columns_of(rows: &[[f32; 8]]) -> [Self; 8];
    /// As many as are in a part.
    fn load_from(from: &[f32]) -> Self;
    fn store_to(self, to: &mut [f32]);
}

impl<L: Eight> Part for L {
    type Parts<T: Copy> = [T; RAYS / 8];
    const COUNT: usize = 8;

    #[inline(always)]
    fn parts<T: Copy>(value: T) -> Self::Parts<T> {
        [value; RAYS / 8]
    }
    #[inline(always)]
    fn columns_of(rows: &[[f32; 8]]) -> [Self; 8] {
        L::columns(&rows.as_chunks().0[0])
    }
    #[inline(always)]
    fn load_from(from: &[f32]) -> Self {
        L::load(&from.as_chunks().0[0])
    }
    #[inline(always)]
    fn store_to(self, to: &mut [f32]) {
        to.as_chunks_mut().0[0] = self.to_array();
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
