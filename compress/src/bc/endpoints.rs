//! The fits that the encoders share: the principal axis of a block's colours, and least squares for end points.
//!
//! All sums are in `f32` and in a fixed order without fused operations, so that the bytes are the same on every
//! machine.

/// Voxels of a block.
pub(super) const TEXELS: usize = 16;

/// Rounds of the power method. The ratio of the two largest eigenvalues of a block is seldom near 1, and where it
/// is, any axis between the two serves as well; the least squares that follow mend the rest.
const POWER_ROUNDS: usize = 6;

/// Least squares for the two ends of a line on which each texel has a known place.
///
/// Minimises Σ w·((1 - t)·a + t·b - v)² over `a` and `b`, for one channel at a time.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineFit {
    /// w·(1 - t) and w·t of each texel.
    near: [f32; TEXELS],
    far: [f32; TEXELS],
    /// The normal matrix [[aa, ab], [ab, bb]], and 1 / its determinant.
    aa: f32,
    ab: f32,
    bb: f32,
    inverse_determinant: f32,
}

impl LineFit {
    /// The fit for texels at `places` in [0, 1] with `weights` ≥ 0; `None` if all lie at one place, where no line
    /// is defined.
    pub(super) fn new(places: &[f32; TEXELS], weights: &[f32; TEXELS]) -> Option<Self> {
        let near: [f32; TEXELS] = std::array::from_fn(|i| weights[i] * (1.0 - places[i]));
        let far: [f32; TEXELS] = std::array::from_fn(|i| weights[i] * places[i]);
        let (ab, bb) = (dot(&near, places), dot(&far, places));
        let aa = sum(&near) - ab;
        let determinant = aa * bb - ab * ab;
        // Relative to the matrix's own size: below this the two ends are not told apart by the data.
        (determinant > 1e-4 * aa.max(bb) * aa.max(bb)).then(|| Self {
            near,
            far,
            aa,
            ab,
            bb,
            inverse_determinant: 1.0 / determinant,
        })
    }

    /// The values `(a, b)` of the two ends in one channel.
    pub(super) fn ends(&self, values: &[f32; TEXELS]) -> (f32, f32) {
        let (a, b) = (dot(&self.near, values), dot(&self.far, values));
        (
            (self.bb * a - self.ab * b) * self.inverse_determinant,
            (self.aa * b - self.ab * a) * self.inverse_determinant,
        )
    }
}

/// The two ends of the stretch of the principal axis that the colours of a block fill.
///
/// `channels` are the values of three channels; weights are > 0.
pub(super) fn principal_ends(channels: &[[f32; TEXELS]; 3], weights: &[f32; TEXELS]) -> ([f32; 3], [f32; 3]) {
    let total = sum(weights);
    let mean = channels.map(|values| dot(&values, weights) / total);
    let mut centred = *channels;
    for (values, mean) in centred.iter_mut().zip(mean) {
        *values = values.map(|value| value - mean);
    }
    let axis = principal_axis(&centred, weights);
    let [x, y, z] = axis;
    let places: [f32; TEXELS] =
        std::array::from_fn(|i| centred[0][i] * x + centred[1][i] * y + centred[2][i] * z);
    let low = places.iter().fold(f32::MAX, |low, &place| if place < low { place } else { low });
    let high = places.iter().fold(f32::MIN, |high, &place| if place > high { place } else { high });
    let end = |place: f32| [0, 1, 2].map(|channel: usize| mean[channel] + axis[channel] * place);
    (end(high), end(low))
}

/// The direction of largest weighted variance of colours whose mean is zero, of length 1.
fn principal_axis(centred: &[[f32; TEXELS]; 3], weights: &[f32; TEXELS]) -> [f32; 3] {
    let mut covariance = [[0.0_f32; 3]; 3];
    for row in 0..3 {
        let weighted: [f32; TEXELS] = std::array::from_fn(|i| weights[i] * centred[row][i]);
        for column in row..3 {
            covariance[row][column] = dot(&weighted, &centred[column]);
            covariance[column][row] = covariance[row][column];
        }
    }
    // The column of the largest variance is never orthogonal to the axis unless it is the axis's own zero.
    let widest = (1..3).fold(0, |best, i| if covariance[i][i] > covariance[best][best] { i } else { best });
    let mut axis = unit(covariance[widest]);
    for _ in 0..POWER_ROUNDS {
        let [x, y, z] = axis;
        axis = unit(covariance.map(|row| row[0] * x + row[1] * y + row[2] * z));
    }
    axis
}

/// `v` of length 1; the grey axis where `v` has no direction.
fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if length > 0.0 && length.is_finite() { v.map(|value| value / length) } else { [0.577_350_26; 3] }
}

/// Σ aᵢ·bᵢ.
fn dot(a: &[f32; TEXELS], b: &[f32; TEXELS]) -> f32 {
    sum(&std::array::from_fn(|i| a[i] * b[i]))
}

/// The sum of all values, in four lanes: an order that the compiler may vectorise and may not change.
pub(super) fn sum(values: &[f32; TEXELS]) -> f32 {
    let lanes: [f32; 4] =
        std::array::from_fn(|i| (values[i] + values[4 + i]) + (values[8 + i] + values[12 + i]));
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3])
}

/// `value` in [0, `most`] rounded to the nearest whole number; NaN becomes 0.
pub(super) fn round_to(value: f32, most: f32) -> u32 {
    (value.clamp(0.0, most) + 0.5) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_finds_the_line_that_the_values_lie_on() {
        let places: [f32; TEXELS] = std::array::from_fn(|i| (i % 4) as f32 / 3.0);
        let weights: [f32; TEXELS] = std::array::from_fn(|i| 0.25 + i as f32);
        let values = places.map(|t| 20.0 * (1.0 - t) + 230.0 * t);
        let (a, b) = LineFit::new(&places, &weights).unwrap().ends(&values);
        assert!((a - 20.0).abs() < 0.01 && (b - 230.0).abs() < 0.01, "{a} {b}");
    }

    #[test]
    fn texels_at_one_place_define_no_line() {
        for place in [0.0, 1.0 / 3.0, 1.0] {
            assert!(LineFit::new(&[place; TEXELS], &[1.0; TEXELS]).is_none(), "place {place}");
        }
    }

    #[test]
    fn the_principal_ends_are_the_ends_of_a_line_of_colours() {
        let (from, to) = ([10.0, 200.0, 50.0], [110.0, 40.0, 90.0_f32]);
        let channels = [0, 1, 2].map(|c: usize| {
            std::array::from_fn(|i| from[c] + (to[c] - from[c]) * i as f32 / (TEXELS - 1) as f32)
        });
        let (a, b) = principal_ends(&channels, &[1.0; TEXELS]);
        let (a, b) = if a[0] < b[0] { (a, b) } else { (b, a) };
        for c in 0..3 {
            assert!((a[c] - from[c]).abs() < 0.01 && (b[c] - to[c]).abs() < 0.01, "{a:?} {b:?}");
        }
    }
}
