//! For any machine.

use std::ops::{Add, Div, Mul, Sub};

use super::{Double, Eight, Lanes, SIGN};

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
    type Double = Four;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Portable([value; 8])
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
    fn negative(self) -> u32 {
        self.mask(self, |a, _| a.is_sign_negative())
    }
    #[inline(always)]
    fn lt_bits(self, other: Self) -> u32 {
        self.mask(other, |a, b| a.to_bits() < b.to_bits())
    }
    #[inline(always)]
    fn select(self, bits: u32, other: Self) -> Self {
        Portable(std::array::from_fn(|i| match bits >> i & 1 {
            0 => self.0[i],
            _ => other.0[i],
        }))
    }
    #[inline(always)]
    fn highest(self) -> f32 {
        (self.0.into_iter()).fold(f32::NEG_INFINITY, f32::max)
    }
    #[inline(always)]
    fn halves(self) -> [Four; 2] {
        let [a, b, c, d, e, f, g, h] = self.0.map(f64::from);
        [Four([a, b, c, d]), Four([e, f, g, h])]
    }
    #[inline(always)]
    fn of_halves([Four([a, b, c, d]), Four([e, f, g, h])]: [Four; 2]) -> Self {
        Portable([a, b, c, d, e, f, g, h].map(|number| number as f32))
    }
}

/// Four f64 for any machine.
#[derive(Clone, Copy)]
pub(super) struct Four([f64; 4]);

impl Four {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Four(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }

    #[inline(always)]
    fn mask(self, f: impl Fn(f64) -> bool) -> u32 {
        (0..4).fold(0, |mask, i| mask | u32::from(f(self.0[i])) << i)
    }
}

impl Add for Four {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Four {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Four {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Div for Four {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

impl Double for Four {
    const COUNT: u32 = 4;

    #[inline(always)]
    fn negative(self) -> u32 {
        self.mask(|number| number < 0.0)
    }
    #[inline(always)]
    fn positive(self) -> u32 {
        self.mask(|number| number > 0.0)
    }
}

impl Eight for Portable {
    type Part = Self;

    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        Portable(*from)
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
