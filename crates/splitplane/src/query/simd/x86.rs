//! AVX2 and AVX-512.
#![allow(unsafe_code)]

use std::arch::x86_64::*;
use std::marker::PhantomData;
use std::ops::{Add, Div, Mul, Sub};

use super::{Double, Eight, Lanes, Part, RAYS, Task};

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
    type Double = Four;

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
    fn negative(self) -> u32 {
        // SAFETY: see `Avx2`.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
    #[inline(always)]
    fn lt_bits(self, other: Self) -> u32 {
        // SAFETY: see `Avx2`. There is an instruction for signed numbers.
        unsafe {
            let first = _mm256_set1_epi32(i32::MIN);
            let a = _mm256_xor_si256(_mm256_castps_si256(self.0), first);
            let b = _mm256_xor_si256(_mm256_castps_si256(other.0), first);
            _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(b, a))) as u32
        }
    }
    #[inline(always)]
    fn select(self, bits: u32, other: Self) -> Self {
        // SAFETY: see `Avx2`.
        unsafe {
            let each = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let given = _mm256_and_si256(_mm256_set1_epi32(bits as i32), each);
            let mask = _mm256_castsi256_ps(_mm256_cmpeq_epi32(given, each));
            Avx2::of(_mm256_blendv_ps(self.0, other.0, mask))
        }
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
    #[inline(always)]
    fn halves(self) -> [Four; 2] {
        // SAFETY: see `Avx2`.
        unsafe {
            [
                Four(_mm256_cvtps_pd(_mm256_castps256_ps128(self.0))),
                Four(_mm256_cvtps_pd(_mm256_extractf128_ps::<1>(self.0))),
            ]
        }
    }
    #[inline(always)]
    fn of_halves([first, second]: [Four; 2]) -> Self {
        // SAFETY: see `Avx2`.
        unsafe {
            let (first, second) = (_mm256_cvtpd_ps(first.0), _mm256_cvtpd_ps(second.0));
            Avx2::of(_mm256_set_m128(second, first))
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
    type Double = EightWide;

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
    fn negative(self) -> u32 {
        // SAFETY: see `Avx512`.
        u32::from(unsafe { _mm512_movepi32_mask(_mm512_castps_si512(self.0)) })
    }
    #[inline(always)]
    fn lt_bits(self, other: Self) -> u32 {
        // SAFETY: see `Avx512`.
        u32::from(unsafe {
            _mm512_cmplt_epu32_mask(_mm512_castps_si512(self.0), _mm512_castps_si512(other.0))
        })
    }
    #[inline(always)]
    fn select(self, bits: u32, other: Self) -> Self {
        // SAFETY: see `Avx512`.
        Avx512(unsafe { _mm512_mask_blend_ps(bits as u16, self.0, other.0) })
    }
    #[inline(always)]
    fn highest(self) -> f32 {
        // SAFETY: see `Avx512`.
        unsafe { _mm512_reduce_max_ps(self.0) }
    }
    #[inline(always)]
    fn halves(self) -> [EightWide; 2] {
        // SAFETY: see `Avx512`.
        unsafe {
            [
                EightWide(_mm512_cvtps_pd(_mm512_castps512_ps256(self.0))),
                EightWide(_mm512_cvtps_pd(_mm512_extractf32x8_ps::<1>(self.0))),
            ]
        }
    }
    #[inline(always)]
    fn of_halves([first, second]: [EightWide; 2]) -> Self {
        // SAFETY: see `Avx512`.
        unsafe { joined(_mm512_cvtpd_ps(first.0), _mm512_cvtpd_ps(second.0)) }
    }
}

/// # Safety
/// Where there is an [`Avx512`].
#[inline(always)]
unsafe fn joined(first: __m256, second: __m256) -> Avx512 {
    // SAFETY: the caller's word.
    Avx512(unsafe { _mm512_insertf32x8::<1>(_mm512_castps256_ps512(first), second) })
}

impl Part for Avx512 {
    type Parts<T: Copy> = [T; RAYS / 16];
    const COUNT: usize = 16;

    #[inline(always)]
    fn parts<T: Copy>(value: T) -> Self::Parts<T> {
        [value; RAYS / 16]
    }
    #[inline(always)]
    fn columns_of(rows: &[[f32; 8]]) -> [Self; 8] {
        let [first, second, ..] = rows.as_chunks().0 else {
            unreachable!("sixteen rows");
        };
        let [a, b, c, d, e, f, g, h] = Avx2::<Wider>::columns(first);
        let [i, j, k, l, m, n, o, p] = Avx2::<Wider>::columns(second);
        // SAFETY: see `Avx512`.
        unsafe {
            [
                joined(a.0, i.0),
                joined(b.0, j.0),
                joined(c.0, k.0),
                joined(d.0, l.0),
                joined(e.0, m.0),
                joined(f.0, n.0),
                joined(g.0, o.0),
                joined(h.0, p.0),
            ]
        }
    }
    #[inline(always)]
    fn load_from(from: &[f32]) -> Self {
        let from: &[f32; 16] = &from.as_chunks().0[0];
        // SAFETY: see `Avx512`; there are sixteen numbers.
        Avx512(unsafe { _mm512_loadu_ps(from.as_ptr()) })
    }
    #[inline(always)]
    fn store_to(self, to: &mut [f32]) {
        let to: &mut [f32; 16] = &mut to.as_chunks_mut().0[0];
        // SAFETY: see `Avx512`; there is room for sixteen numbers.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }
}

/// f64 in a register. Made only of the f32 above, where there are the instructions for them; this is
/// what makes each `unsafe` in it sound.
macro_rules! doubles {
    ($name:ident, $register:ty, $lt:ident, $($operator:ident $method:ident $function:ident),*) => {
        #[derive(Clone, Copy)]
        pub(super) struct $name($register);

        $(impl $operator for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: see `doubles`.
                $name(unsafe { $function(self.0, other.0) })
            }
        })*

        impl Double for $name {
            const COUNT: u32 = (size_of::<$register>() / size_of::<f64>()) as u32;

            #[inline(always)]
            fn negative(self) -> u32 {
                // SAFETY: see `doubles`; zeros are numbers.
                unsafe { $lt(self.0, std::mem::zeroed()) }
            }
            #[inline(always)]
            fn positive(self) -> u32 {
                // SAFETY: see `doubles`; zeros are numbers.
                unsafe { $lt(std::mem::zeroed(), self.0) }
            }
        }
    };
}

doubles!(
    Four, __m256d, lt_of_four,
    Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd
);
doubles!(
    EightWide, __m512d, lt_of_eight,
    Add add _mm512_add_pd, Sub sub _mm512_sub_pd, Mul mul _mm512_mul_pd, Div div _mm512_div_pd
);

/// # Safety
/// Where there is an [`Avx2`].
#[inline(always)]
unsafe fn lt_of_four(a: __m256d, b: __m256d) -> u32 {
    // SAFETY: the caller's word.
    unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(a, b)) as u32 }
}

/// # Safety
/// Where there is an [`Avx512`].
#[inline(always)]
unsafe fn lt_of_eight(a: __m512d, b: __m512d) -> u32 {
    // SAFETY: the caller's word.
    u32::from(unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b) })
}
