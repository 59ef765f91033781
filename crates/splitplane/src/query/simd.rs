//! Eight numbers at a time, on whatever the machine has.
//!
//! Every operation gives the same bits everywhere, but for [`Lanes::mul_add`], which may round once
//! or twice. Boxes are met by it, so what is visited may differ from machine to machine by a box
//! that a ray grazes. Hits never do.
#![allow(unsafe_code)]

use std::sync::atomic::{AtomicU8, Ordering};

/// Eight f32.
pub(super) trait Lanes: Copy {
    fn splat(value: f32) -> Self;
    fn load(from: &[f32; 8]) -> Self;
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
    fn to_array(self) -> [f32; 8];
    /// Of eight rows, the columns.
    fn columns(rows: &[[f32; 8]; 8]) -> [Self; 8];
    /// Asks for 320 bytes of memory, as many as a leaf has at most, since they will be needed soon;
    /// any address will do.
    fn prefetch(address: *const u8);
}

/// The bit of the sign.
const SIGN: u32 = 1 << 31;

/// Eight f32 for any machine.
#[derive(Clone, Copy)]
pub(super) struct Portable([f32; 8]);

impl Portable {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Portable(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    fn mask(self, other: Self, f: impl Fn(f32, f32) -> bool) -> u32 {
        (0..8).fold(0, |mask, i| mask | u32::from(f(self.0[i], other.0[i])) << i)
    }
}

impl Lanes for Portable {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Portable([value; 8])
    }
    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        Portable(*from)
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.zip(self, |a, _| a.abs())
    }
    #[inline(always)]
    fn times_sign(self, other: Self) -> Self {
        self.zip(other, |a, b| {
            f32::from_bits(a.to_bits() ^ b.to_bits() & SIGN)
        })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self.mul(factor).add(term)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        self.mask(other, |a, b| a <= b)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        self.mask(other, |a, b| a < b)
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 8] {
        self.0
    }
    #[inline(always)]
    fn columns(rows: &[[f32; 8]; 8]) -> [Self; 8] {
        std::array::from_fn(|column| Portable(rows.map(|row| row[column])))
    }
    #[inline(always)]
    fn prefetch(_: *const u8) {}
}

/// Runs a generic function on the lanes of the machine.
pub(super) trait Task {
    type Output;
    fn run<L: Lanes>(self) -> Self::Output;
}

/// Which instructions queries may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Instructions {
    Portable = 1,
    #[cfg(target_arch = "x86_64")]
    Avx2 = 2,
    /// The same eight numbers at a time, with twice as many registers for them.
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
            Instructions::Avx2 => unsafe { avx2::run(task) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as with `Avx2`.
            Instructions::Avx512 => unsafe { avx2::run_with_more(task) },
        }
    }
}

/// Apart, so that the memory it needs is not asked for where better instructions are used.
#[inline(never)]
fn portable<T: Task>(task: T) -> T::Output {
    task.run::<Portable>()
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{Lanes, Task};
    use std::arch::x86_64::*;

    /// # Safety
    /// The machine must have AVX2, FMA, BMI1, BMI2, LZCNT and POPCNT.
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    pub(super) unsafe fn run<T: Task>(task: T) -> T::Output {
        task.run::<Avx2>()
    }

    /// # Safety
    /// The machine must have, besides, AVX-512 F, VL and DQ.
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq")]
    pub(super) unsafe fn run_with_more<T: Task>(task: T) -> T::Output {
        task.run::<Avx2>()
    }

    /// Eight f32 in a register. Made only by code that the above have started, so only on machines
    /// that have AVX2; this is what makes each `unsafe` below sound.
    #[derive(Clone, Copy)]
    struct Avx2(__m256);

    impl Lanes for Avx2 {
        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: see `Avx2`.
            Avx2(unsafe { _mm256_set1_ps(value) })
        }
        #[inline(always)]
        fn load(from: &[f32; 8]) -> Self {
            // SAFETY: see `Avx2`; there are eight numbers.
            Avx2(unsafe { _mm256_loadu_ps(from.as_ptr()) })
        }
        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: see `Avx2`.
            Avx2(unsafe { _mm256_add_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: see `Avx2`.
            Avx2(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
        }
        #[inline(always)]
        fn times_sign(self, other: Self) -> Self {
            // SAFETY: see `Avx2`.
            Avx2(unsafe { _mm256_xor_ps(self.0, _mm256_and_ps(_mm256_set1_ps(-0.0), other.0)) })
        }
        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            // SAFETY: see `Avx2`.
            Avx2(unsafe { _mm256_sub_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            // SAFETY: see `Avx2`.
            Avx2(unsafe { _mm256_mul_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn div(self, other: Self) -> Self {
            // SAFETY: see `Avx2`.
            Avx2(unsafe { _mm256_div_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn mul_add(self, factor: Self, term: Self) -> Self {
            // SAFETY: see `Avx2`.
            Avx2(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: see `Avx2`.
            Avx2(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: see `Avx2`.
            Avx2(unsafe { _mm256_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn le(self, other: Self) -> u32 {
            // SAFETY: see `Avx2`.
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) as u32 }
        }
        #[inline(always)]
        fn lt(self, other: Self) -> u32 {
            // SAFETY: see `Avx2`.
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)) as u32 }
        }
        #[inline(always)]
        fn to_array(self) -> [f32; 8] {
            let mut array = [0.0; 8];
            // SAFETY: see `Avx2`; there is room for eight numbers.
            unsafe { _mm256_storeu_ps(array.as_mut_ptr(), self.0) };
            array
        }
        #[inline(always)]
        fn columns([a, b, c, d, e, f, g, h]: &[[f32; 8]; 8]) -> [Self; 8] {
            // SAFETY: see `Avx2`; 0 and 4 are where halves of eight numbers begin.
            unsafe {
                let [x, y, z, w] =
                    four_columns([half(a, e, 0), half(b, f, 0), half(c, g, 0), half(d, h, 0)]);
                let [s, t, u, v] =
                    four_columns([half(a, e, 4), half(b, f, 4), half(c, g, 4), half(d, h, 4)]);
                [x, y, z, w, s, t, u, v]
            }
        }
        #[inline(always)]
        fn prefetch(address: *const u8) {
            for line in 0..5 {
                // SAFETY: see `Avx2`; a prefetch reads nothing that the program sees.
                unsafe { _mm_prefetch::<_MM_HINT_T0>(address.wrapping_add(64 * line).cast()) };
            }
        }
    }

    /// Half of each of two rows, the half that begins at 0 or 4.
    ///
    /// # Safety
    /// Where there is an [`Avx2`]; `at` is 0 or 4.
    #[inline(always)]
    unsafe fn half(row: &[f32; 8], other: &[f32; 8], at: usize) -> __m256 {
        // SAFETY: from there on there are four numbers more.
        unsafe {
            let low = _mm256_castps128_ps256(_mm_loadu_ps(row.as_ptr().add(at)));
            _mm256_insertf128_ps::<1>(low, _mm_loadu_ps(other.as_ptr().add(at)))
        }
    }

    /// Of four rows of four, and of four more beside them, the columns.
    ///
    /// # Safety
    /// Where there is an [`Avx2`].
    #[inline(always)]
    unsafe fn four_columns([a, b, c, d]: [__m256; 4]) -> [Avx2; 4] {
        // SAFETY: the caller's word.
        unsafe {
            let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
            let (more_ab, more_cd) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
            [
                Avx2(_mm256_shuffle_ps::<0x44>(ab, cd)),
                Avx2(_mm256_shuffle_ps::<0xee>(ab, cd)),
                Avx2(_mm256_shuffle_ps::<0x44>(more_ab, more_cd)),
                Avx2(_mm256_shuffle_ps::<0xee>(more_ab, more_cd)),
            ]
        }
    }
}
