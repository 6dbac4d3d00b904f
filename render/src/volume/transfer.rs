//! From a value to colour and opacity.

use std::sync::Arc;

use thiserror::Error;

/// One point of a transfer function. Components are display values in `[0, 1]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlPoint {
    /// Value (HU for CT).
    pub value: f64,
    /// Red, green, blue, and opacity per [`Transfer::unit_mm`].
    pub rgba: [f64; 4],
}

/// Why control points are not a transfer function.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum TransferError {
    /// There is no point.
    #[error("a transfer function needs at least one control point")]
    Empty,
    /// Values go down.
    #[error("control point {index} lies below the one before it")]
    Order {
        /// Position of the lower one.
        index: usize,
    },
    /// A number is not finite, or a component is outside `[0, 1]`.
    #[error("control point {index} has a number that is not finite or a component outside 0 to 1")]
    Range {
        /// Position of the point.
        index: usize,
    },
    /// The unit length is not positive and finite.
    #[error("unit_mm must be positive and finite, not {unit_mm}")]
    Unit {
        /// As given.
        unit_mm: f64,
    },
}

/// A piecewise-linear map from value to colour and opacity, held constant outside its points.
///
/// Two points of one value make a jump; the value itself belongs to the later one.
#[derive(Debug, Clone, PartialEq)]
pub struct Transfer {
    points: Vec<ControlPoint>,
    unit_mm: f64,
}

impl Transfer {
    /// Opacity counts as at most this, so that extinction stays finite.
    pub const MAX_OPACITY: f64 = 0.999_999;

    /// A function through `points`, whose opacity is that of `unit_mm` of material.
    ///
    /// # Errors
    /// [`TransferError`] for what its variants name.
    pub fn new(points: Vec<ControlPoint>, unit_mm: f64) -> Result<Self, TransferError> {
        if points.is_empty() {
            return Err(TransferError::Empty);
        }
        if !(unit_mm > 0.0 && unit_mm.is_finite()) {
            return Err(TransferError::Unit { unit_mm });
        }
        for (index, point) in points.iter().enumerate() {
            if !point.value.is_finite() || point.rgba.iter().any(|c| !(0.0..=1.0).contains(c)) {
                return Err(TransferError::Range { index });
            }
            if index > 0 && point.value < points[index - 1].value {
                return Err(TransferError::Order { index });
            }
        }
        Ok(Self { points, unit_mm })
    }

    /// Whether two are equal, at once where they are one.
    pub fn same(a: &Arc<Self>, b: &Arc<Self>) -> bool {
        Arc::ptr_eq(a, b) || a == b
    }

    /// The control points, by rising value.
    pub fn points(&self) -> &[ControlPoint] {
        &self.points
    }

    /// The thickness of material that the opacity is of; mm, > 0.
    pub fn unit_mm(&self) -> f64 {
        self.unit_mm
    }

    /// Red, green, blue and opacity at a value. NaN gives the first point's.
    pub fn rgba(&self, value: f64) -> [f64; 4] {
        let after = self.points.partition_point(|p| p.value <= value);
        let Some(below) = after.checked_sub(1).map(|i| self.points[i]) else {
            return self.points[0].rgba;
        };
        let Some(above) = self.points.get(after) else {
            return below.rgba;
        };
        let part = (value - below.value) / (above.value - below.value);
        std::array::from_fn(|c| below.rgba[c] + (above.rgba[c] - below.rgba[c]) * part)
    }

    /// Extinction of an opacity per `unit_mm`: −ln(1 − min(a, [`Self::MAX_OPACITY`])) / unit; 1/mm.
    pub fn extinction_of(&self, opacity: f64) -> f64 {
        -(-opacity.min(Self::MAX_OPACITY)).ln_1p() / self.unit_mm
    }

    /// Colour and extinction (1/mm) at a value.
    pub fn classify(&self, value: f64) -> ([f64; 3], f64) {
        let [r, g, b, a] = self.rgba(value);
        ([r, g, b], self.extinction_of(a))
    }

    /// Whether every value of the closed range `[low, high]` is fully transparent.
    pub fn is_clear(&self, low: f64, high: f64) -> bool {
        self.rgba(low)[3] == 0.0
            && self.rgba(high)[3] == 0.0
            && self.points.iter().all(|p| p.rgba[3] == 0.0 || p.value < low || p.value > high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Transfer {
        let point = |value, a| ControlPoint { value, rgba: [1.0, 0.5, 0.0, a] };
        Transfer::new(vec![point(0.0, 0.0), point(10.0, 0.5), point(10.0, 1.0)], 2.0).expect("ramp")
    }

    #[test]
    fn it_is_linear_between_points_and_constant_outside() {
        let t = ramp();
        assert_eq!(t.rgba(-5.0)[3], 0.0, "below");
        assert_eq!(t.rgba(5.0)[3], 0.25, "between");
        assert_eq!(t.rgba(10.0)[3], 1.0, "a jump belongs to the later point");
        assert_eq!(t.rgba(99.0)[3], 1.0, "above");
    }

    #[test]
    fn extinction_is_that_of_the_unit_length() {
        let t = ramp();
        let tau = t.extinction_of(0.5);
        assert!(((-tau * 2.0).exp() - 0.5).abs() < 1e-15, "2 mm let half through");
        assert!(t.extinction_of(1.0).is_finite(), "opacity 1 is capped");
    }

    #[test]
    fn a_clear_range_is_known_exactly() {
        let t = ramp();
        assert!(t.is_clear(-100.0, 0.0), "up to the foot of the ramp");
        assert!(!t.is_clear(-100.0, 0.001), "just above it");
    }
}
