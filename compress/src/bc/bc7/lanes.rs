//! Eight numbers side by side, one for each of eight blocks.
//!
//! Every operation is done in each lane alone, in `f32`, never fused: so a block's result depends neither on its
//! neighbours in the batch nor on the width of the machine's vectors. The loops are plain; the compiler makes vector
//! instructions of them.

use std::ops::{Add, AddAssign, Mul, Sub};

/// Blocks of a batch.
pub(super) const LANES: usize = 8;

/// 1.5·2²³: adding and subtracting it rounds a small `f32` to the nearest whole number, ties to even.
const ROUND: f32 = 12_582_912.0;

/// One number for each block of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(super) struct Lanes(pub(super) [f32; LANES]);

impl Lanes {
    pub(super) const ZERO: Self = Self([0.0; LANES]);
    pub(super) const ONE: Self = Self([1.0; LANES]);

    #[inline(always)]
    pub(super) fn all(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn zip(self, other: Self, operation: impl Fn(f32, f32) -> f32) -> Self {
        let mut lanes = self.0;
        for (lane, other) in lanes.iter_mut().zip(other.0) {
            *lane = operation(*lane, other);
        }
        Self(lanes)
    }

    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    /// Within `0..=most`.
    #[inline(always)]
    pub(super) fn clamped(self, most: f32) -> Self {
        self.max(Self::ZERO).min(Self::all(most))
    }

    /// To the nearest whole number, ties to even; for magnitudes up to 2²².
    #[inline(always)]
    pub(super) fn rounded(self) -> Self {
        Self(self.0.map(|lane| (lane + ROUND) - ROUND))
    }

    /// `self / other`, lane by lane; `other` > 0.
    #[inline(always)]
    pub(super) fn over(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }

    /// `yes` where `self < other`, else `no`.
    #[inline(always)]
    pub(super) fn less(self, other: Self, yes: Self, no: Self) -> Self {
        let mut lanes = no.0;
        for lane in 0..LANES {
            lanes[lane] = if self.0[lane] < other.0[lane] { yes.0[lane] } else { no.0[lane] };
        }
        Self(lanes)
    }

    /// The whole number, from 0 to 255, in one lane.
    #[inline(always)]
    pub(super) fn byte(&self, lane: usize) -> u8 {
        (self.0[lane] + ROUND).to_bits() as u8
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Mul<f32> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f32) -> Self {
        Self(self.0.map(|lane| lane * factor))
    }
}
