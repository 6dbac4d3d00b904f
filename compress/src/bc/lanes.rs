//! Eight numbers side by side, one for each of eight blocks.
//!
//! Every operation is done in each lane alone, in `f32`, never fused: so a block's result depends neither on its
//! neighbours in the batch nor on the width of the machine's vectors. The loops are plain; the compiler makes vector
//! instructions of them.
#![expect(clippy::needless_range_loop, reason = "lanes are indexed alike in all operands")]

use std::ops::{Add, AddAssign, Mul, Sub};

use super::endpoints::TEXELS;

/// Blocks of a batch.
pub(in crate::bc) const LANES: usize = 8;

/// 1.5·2²³: adding and subtracting it rounds a small `f32` to the nearest whole number, ties to even.
const ROUND: f32 = 12_582_912.0;

/// One number for each texel of each block.
pub(in crate::bc) type Plane = [Lanes; TEXELS];

/// One number for each block of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(in crate::bc) struct Lanes(pub(in crate::bc) [f32; LANES]);

impl Lanes {
    pub(in crate::bc) const ZERO: Self = Self([0.0; LANES]);
    pub(in crate::bc) const ONE: Self = Self([1.0; LANES]);

    #[inline(always)]
    pub(in crate::bc) fn all(value: f32) -> Self {
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
    pub(in crate::bc) fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    pub(in crate::bc) fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    /// Within `0..=most`.
    #[inline(always)]
    pub(in crate::bc) fn clamped(self, most: f32) -> Self {
        self.max(Self::ZERO).min(Self::all(most))
    }

    /// To the nearest whole number, ties to even; for magnitudes up to 2²².
    #[inline(always)]
    pub(in crate::bc) fn rounded(self) -> Self {
        Self(self.0.map(|lane| (lane + ROUND) - ROUND))
    }

    /// `self / other`, lane by lane; `other` > 0.
    #[inline(always)]
    pub(in crate::bc) fn over(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }

    /// `yes` where `self < other`, else `no`.
    #[inline(always)]
    pub(in crate::bc) fn less(self, other: Self, yes: Self, no: Self) -> Self {
        let mut lanes = no.0;
        for lane in 0..LANES {
            lanes[lane] = if self.0[lane] < other.0[lane] { yes.0[lane] } else { no.0[lane] };
        }
        Self(lanes)
    }

    /// The whole number, from 0 to 255, in one lane.
    #[inline(always)]
    pub(in crate::bc) fn byte(&self, lane: usize) -> u8 {
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

/// The sum of a plane.
#[inline(always)]
pub(in crate::bc) fn sum(plane: &Plane) -> Lanes {
    plane.iter().fold(Lanes::ZERO, |sum, &lanes| sum + lanes)
}

/// The ends of the line that fits the values best where they are placed, `steps` from end to end; `last` where the
/// places do not tell the two ends apart. `endpoints::LineFit` for many blocks.
#[inline(always)]
pub(in crate::bc) fn least_squares(
    values: &Plane,
    weights: &Plane,
    places: &Plane,
    steps: f32,
    last: [Lanes; 2],
) -> [Lanes; 2] {
    let per_step = 1.0 / steps;
    let (mut aa, mut ab, mut bb) = (Lanes::ZERO, Lanes::ZERO, Lanes::ZERO);
    let (mut a, mut b) = (Lanes::ZERO, Lanes::ZERO);
    for i in 0..TEXELS {
        let far = places[i] * per_step;
        let near = Lanes::ONE - far;
        let (near_weight, far_weight) = (weights[i] * near, weights[i] * far);
        aa += near_weight * near;
        ab += near_weight * far;
        bb += far_weight * far;
        a += near_weight * values[i];
        b += far_weight * values[i];
    }
    let determinant = aa * bb - ab * ab;
    let least = aa.max(bb) * aa.max(bb) * 1e-4 + Lanes::all(1e-12);
    let share = Lanes::ONE.over(determinant.max(least));
    [
        least.less(determinant, (bb * a - ab * b) * share, last[0]),
        least.less(determinant, (aa * b - ab * a) * share, last[1]),
    ]
}
