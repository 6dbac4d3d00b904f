//! The one exact question in the plane.

use crate::volume::cutter::sign_of_sum;

/// A number with the sign of twice the area of a triangle: positive where it is counter-clockwise. Exact
/// where no product overflows or underflows.
///
/// Source: Shewchuk 1997, section 4.3, bound A of ORIENT2D; what that does not decide is added as an expansion.
pub(super) fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    /// (3 + 16 ε) ε, with ε = 2⁻⁵³.
    const BOUND: f64 = 3.330_669_073_875_471_6e-16;
    let left = (a[0] - c[0]) * (b[1] - c[1]);
    let right = (a[1] - c[1]) * (b[0] - c[0]);
    let area = left - right;
    if area.abs() > BOUND * (left.abs() + right.abs()) {
        return area;
    }
    sign_of_sum([(a[0], b[1]), (-a[0], c[1]), (-c[0], b[1]), (-a[1], b[0]), (a[1], c[0]), (c[1], b[0])])
}
