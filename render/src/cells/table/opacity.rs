//! What is seen of an optical depth.

use std::ops::{Add, Mul, Sub};

/// Optical depth below which series do for the exponential: to 2e-5 of opacity, and 6e-5 of a change of colour.
pub(super) const THIN: f32 = 0.7;

/// 1 - e^-τ, without loss where τ is small.
#[inline(always)]
pub(in super::super) fn opacity(tau: f32) -> f32 {
    shares(tau)[2]
}

/// Of any τ above 0: opacity for one of τ; by how much the share of the colour at the end of a stretch falls behind that at
/// its begin, less than nothing; and opacity.
#[inline(always)]
pub(super) fn shares(tau: f32) -> [f32; 3] {
    if tau < THIN { thin(tau, |v| v) } else { thick(tau) }
}

/// The [`shares`] of a τ that is not small.
#[inline(always)]
pub(super) fn thick(tau: f32) -> [f32; 3] {
    let opacity = 1.0 - exp_minus(tau);
    [opacity / tau, opacity / tau - 1.0 + 0.5 * opacity, opacity]
}

/// The [`shares`] of a small τ, 0 or more. One number or several at once; `all` makes the same one of all.
#[inline(always)]
pub(super) fn thin<N>(tau: N, all: impl Fn(f32) -> N) -> [N; 3]
where
    N: Copy + Add<Output = N> + Sub<Output = N> + Mul<Output = N>,
{
    let square = tau * tau;
    let rest =
        (all(1.0 / 6.0) - tau * all(1.0 / 24.0)) + square * (all(1.0 / 120.0) - tau * all(1.0 / 720.0));
    let part = (all(1.0) - tau * all(0.5)) + square * rest;
    let rest =
        (tau * all(1.0 / 24.0) - all(1.0 / 12.0)) - square * (all(1.0 / 80.0) - tau * all(1.0 / 360.0));
    [part, square * rest, tau * part]
}

/// e^-τ for τ ≥ 0, by arithmetic alone: several go at once.
#[inline(always)]
fn exp_minus(tau: f32) -> f32 {
    // ln 2 in two parts, the first of few digits, so that its multiples are exact.
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    // Added, it leaves the nearest whole number in the lowest digits.
    const WHOLE: f32 = 12_582_912.0;
    let tau = if tau < 87.0 { tau } else { 87.0 };
    let halvings = tau * std::f32::consts::LOG2_E + WHOLE;
    let count = halvings - WHOLE;
    let rest = (count * LN_2[0] - tau) + count * LN_2[1];
    let series = rest * (1.0 / 6.0 + rest * (1.0 / 24.0 + rest * (1.0 / 120.0 + rest * (1.0 / 720.0))));
    let power = 1.0 + rest * (1.0 + rest * (0.5 + series));
    power * f32::from_bits((127_u32 << 23).wrapping_sub(halvings.to_bits() << 23))
}
