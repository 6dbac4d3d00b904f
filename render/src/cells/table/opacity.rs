//! What is seen of an optical depth.

/// Optical depth below which series are as good as the exponential.
pub(super) const THIN: f32 = 0.25;

/// By how much the share of the colour at the end of a stretch falls behind that at its begin.
#[inline(always)]
pub(super) fn behind(tau: f32, opacity: f32) -> f32 {
    if tau < THIN { thin(tau)[1] } else { opacity / tau - 1.0 + 0.5 * opacity }
}

/// 1 - e^-τ, without loss where τ is small.
#[inline(always)]
pub(in super::super) fn opacity(tau: f32) -> f32 {
    if tau < THIN { thin(tau)[2] } else { 1.0 - exp_minus(tau) }
}

/// Of a small τ of at least 0: opacity for one of τ, by how much colours fall [`behind`], and opacity.
#[inline(always)]
pub(super) fn thin(tau: f32) -> [f32; 3] {
    let part = 1.0
        - tau
            * (1.0 / 2.0
                - tau * (1.0 / 6.0 - tau * (1.0 / 24.0 - tau * (1.0 / 120.0 - tau * (1.0 / 720.0)))));
    let lag = tau * tau * (tau * (1.0 / 24.0 - tau * (1.0 / 80.0 - tau * (1.0 / 360.0))) - 1.0 / 12.0);
    [part, lag, tau * part]
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
