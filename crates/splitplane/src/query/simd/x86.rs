//! AVX2 and AVX-512.
#![allow(unsafe_code)]

use std::arch::x86_64::*;
use std::marker::PhantomData;

use super::{Eight, Lanes, Part, SIXTEEN, Task};

/// # Safety
/// The machine must have AVX2, FMA, BMI1, BMI2, LZCNT and POPCNT.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) unsafe fn run<T: Task>(task: T) -> T::Output {
    task.run::<Avx2<Plain>>()
}

/// # Safety
/// The machine must have, besides, AVX-512 F, VL and DQ.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq")]
pub(super) unsafe fn run_wider<T: Task>(task: T) -> T::Output {
    task.run::<Avx2<Wider>>()
}

/// What a machine has besides AVX2.
pub(super) trait Machine: Copy {
    type Part: Part;
}

/// Nothing.
#[derive(Clone, Copy)]
struct Plain;

/// AVX-512.
#[derive(Clone, Copy)]
struct Wider;

impl Machine for Plain {
    type Part = Avx2<Plain>;
}

impl Machine for Wider {
    type Part = Avx512;
}

/// Eight f32 in a register. Made only by code that the above have started, so only on machines
/// that have AVX2; this is what makes each `unsafe` below sound.
#[derive(Clone, Copy)]
struct Avx2<M>(__m256, PhantomData<M>);

impl<M> Avx2<M> {
    #[inline(always)]
    fn of(numbers: __m256) -> Self {
        Avx2(numbers, PhantomData)
    }
}

impl<M: Machine> Lanes for Avx2<M> {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: see `Avx2`.
        Avx2::of(unsafe { _mm256_set1_ps(value) })
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: see `Avx2`.
        Avx2::of(unsafe { _mm256_add_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: see `Avx2`.
        Avx2::of(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
    }
    #[inline(always)]
    fn times_sign(self, other: Self) -> Self {
        // SAFETY: see `Avx2`.
        Avx2::of(unsafe { _mm256_xor_ps(self.0, _mm256_and_ps(_mm256_set1_ps(-0.0), other.0)) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: see `Avx2`.
        Avx2::of(unsafe { _mm256_sub_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: see `Avx2`.
        Avx2::of(unsafe { _mm256_mul_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: see `Avx2`.
        Avx2::of(unsafe { _mm256_div_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: see `Avx2`.
        Avx2::of(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: see `Avx2`.
        Avx2::of(unsafe { _mm256_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: see `Avx2`.
        Avx2::of(unsafe { _mm256_min_ps(self.0, other.0) })
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
    fn highest(self) -> f32 {
        // SAFETY: see `Avx2`.
        unsafe {
            let upper = _mm256_extractf128_ps::<1>(self.0);
            let four = _mm_max_ps(_mm256_castps256_ps128(self.0), upper);
            let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_max_ss(two, _mm_movehdup_ps(two)))
        }
    }
}

impl<M: Machine> Eight for Avx2<M> {
    type Part = M::Part;

    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        // SAFETY: see `Avx2`; there are eight numbers.
        Avx2::of(unsafe { _mm256_loadu_ps(from.as_ptr()) })
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
unsafe fn four_columns<M: Machine>([a, b, c, d]: [__m256; 4]) -> [Avx2<M>; 4] {
    // SAFETY: the caller's word.
    unsafe {
        let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
        let (more_ab, more_cd) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
        [
            Avx2::of(_mm256_shuffle_ps::<0x44>(ab, cd)),
            Avx2::of(_mm256_shuffle_ps::<0xee>(ab, cd)),
            Avx2::of(_mm256_shuffle_ps::<0x44>(more_ab, more_cd)),
            Avx2::of(_mm256_shuffle_ps::<0xee>(more_ab, more_cd)),
        ]
    }
}

/// Sixteen f32 in a register. Made only by code that [`run_wider`] has started, so only on machines
/// that have AVX-512; this is what makes each `unsafe` below sound.
#[derive(Clone, Copy)]
struct Avx512(__m512);

impl Lanes for Avx512 {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_set1_ps(value) })
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_add_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_sub_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_mul_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_div_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_fmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_abs_ps(self.0) })
    }
    #[inline(always)]
    fn times_sign(self, other: Self) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_xor_ps(self.0, _mm512_and_ps(_mm512_set1_ps(-0.0), other.0)) })
    }
    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        // SAFETY: see `Avx512`.
        u32::from(unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        // SAFETY: see `Avx512`.
        u32::from(unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn highest(self) -> f32 {
        // SAFETY: see `Avx512`.
        unsafe { _mm512_reduce_max_ps(self.0) }
    }
}

impl Part for Avx512 {
    type Parts<T: Copy> = [T; 1];
    const COUNT: usize = SIXTEEN;

    #[inline(always)]
    fn parts<T: Copy>(value: T) -> [T; 1] {
        [value]
    }
    #[inline(always)]
    fn load_part(from: &[f32; SIXTEEN], _: usize) -> Self {
        // SAFETY: see `Avx512`; there are sixteen numbers.
        Avx512(unsafe { _mm512_loadu_ps(from.as_ptr()) })
    }
    #[inline(always)]
    fn store_part(self, to: &mut [f32; SIXTEEN], _: usize) {
        // SAFETY: see `Avx512`; there is room for sixteen numbers.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }
}
