//! Osteotomy cutters and the exact question on which side a point lies.

use thiserror::Error;

use super::{Point, Vector};

/// A side of a cutter. "+" of a plane is where its normal points; of a cylinder, outside. A point
/// exactly on the surface is on "+".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Side {
    /// The "+" side, the surface included.
    Plus,
    /// The "-" side.
    Minus,
}

/// Why numbers are not a cutter.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CutterError {
    /// A number is NaN or infinite.
    #[error("a cutter has a number that is not finite")]
    NotFinite,
    /// The normal or axis has no length.
    #[error("the normal or axis of a cutter has no length")]
    NoDirection,
    /// The radius is not positive.
    #[error("the radius of a cylinder must be positive, not {radius_mm} mm")]
    Radius {
        /// As given.
        radius_mm: f64,
    },
}

/// A surface that divides space in two; world millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Cutter {
    /// An infinite plane.
    Plane {
        /// Any point of it.
        point: Point,
        /// Towards "+"; any length but zero.
        normal: Vector,
    },
    /// An infinite round cylinder.
    Cylinder {
        /// Any point of its axis.
        point: Point,
        /// Along it; any length but zero.
        axis: Vector,
        /// > 0.
        radius_mm: f64,
    },
}

impl Cutter {
    /// A plane through `point`.
    ///
    /// # Errors
    /// [`CutterError::NotFinite`], [`CutterError::NoDirection`].
    pub fn plane(point: Point, normal: Vector) -> Result<Self, CutterError> {
        check(&point, &normal)?;
        Ok(Self::Plane { point, normal })
    }

    /// A cylinder about the line through `point` along `axis`.
    ///
    /// # Errors
    /// All of [`CutterError`].
    pub fn cylinder(point: Point, axis: Vector, radius_mm: f64) -> Result<Self, CutterError> {
        check(&point, &axis)?;
        if !radius_mm.is_finite() {
            return Err(CutterError::NotFinite);
        }
        if radius_mm <= 0.0 {
            return Err(CutterError::Radius { radius_mm });
        }
        Ok(Self::Cylinder { point, axis, radius_mm })
    }

    /// The side of `p`. For a plane the sign of n·(p − q) is exact for any finite input whose products
    /// neither overflow nor underflow; for a cylinder it is that of the `f64` evaluation.
    pub fn side(&self, p: &Point) -> Side {
        let plus = match self {
            Self::Plane { point, normal } => plane_sign(normal, p, point) >= 0.0,
            Self::Cylinder { point, axis, radius_mm } => {
                let across = (p - point).cross(axis).norm_squared();
                across >= radius_mm * radius_mm * axis.norm_squared()
            }
        };
        if plus { Side::Plus } else { Side::Minus }
    }
}

fn check(point: &Point, direction: &Vector) -> Result<(), CutterError> {
    if point.iter().chain(direction.iter()).any(|v| !v.is_finite()) {
        return Err(CutterError::NotFinite);
    }
    // A subnormal length would underflow in every product that follows.
    if direction.amax() < 1e-100 {
        return Err(CutterError::NoDirection);
    }
    Ok(())
}

/// A number with the sign of n·p − n·q, exactly.
#[inline]
pub(super) fn plane_sign(n: &Vector, p: &Point, q: &Point) -> f64 {
    sign_of_sum([(n.x, p.x), (n.y, p.y), (n.z, p.z), (-n.x, q.x), (-n.y, q.y), (-n.z, q.z)])
}

/// A number with the sign of the sum of six products, exactly, where none overflows or underflows.
///
/// A plain evaluation decides where its error bound allows; otherwise the six products are added as an
/// expansion without rounding. Source: Shewchuk 1997, "Adaptive Precision Floating-Point Arithmetic",
/// sections 2.2 to 2.5 (`TWO-PRODUCT`, `GROW-EXPANSION`); the product's error here comes from a fused
/// multiply-add.
#[inline]
pub(super) fn sign_of_sum(products: [(f64, f64); 6]) -> f64 {
    let (mut sum, mut size) = (0.0_f64, 0.0_f64);
    for (a, b) in products {
        sum += a * b;
        size += (a * b).abs();
    }
    if sum.abs() > 1e-14 * size {
        return sum;
    }
    let mut expansion = [0.0_f64; 12];
    for (count, (a, b)) in products.into_iter().enumerate() {
        let product = a * b;
        let tail = a.mul_add(b, -product);
        grow(&mut expansion[..=2 * count], tail);
        grow(&mut expansion[..2 * count + 2], product);
    }
    // Components do not overlap and rise in size: the last that is not zero has the sign.
    expansion.iter().rev().copied().find(|&c| c != 0.0).unwrap_or(0.0)
}

/// Adds `value` to an expansion whose last slot is free.
fn grow(expansion: &mut [f64], value: f64) {
    let Some((last, components)) = expansion.split_last_mut() else { return };
    let mut carry = value;
    for component in components {
        let sum = carry + *component;
        let virtual_part = sum - carry;
        *component = (carry - (sum - virtual_part)) + (*component - virtual_part);
        carry = sum;
    }
    *last = carry;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_on_the_surface_is_on_the_plus_side() {
        let plane = Cutter::plane(Point::new(0.1, 0.2, 0.3), Vector::new(0.3, -0.7, 0.9)).expect("plane");
        assert_eq!(plane.side(&Point::new(0.1, 0.2, 0.3)), Side::Plus, "its own point");
        let tube = Cutter::cylinder(Point::origin(), Vector::z(), 2.0).expect("tube");
        assert_eq!(tube.side(&Point::new(2.0, 0.0, 9.0)), Side::Plus, "on the wall");
        assert_eq!(tube.side(&Point::new(1.9, 0.0, 9.0)), Side::Minus, "inside");
    }

    /// Whole numbers of up to 40 bits make products that `i128` adds exactly.
    #[test]
    fn the_plane_test_agrees_with_integer_arithmetic() {
        let mut state = 0x9E37_79B9_7F4A_7C15_u64;
        let mut next = |bits: u32| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> (64 - bits)) as i64 - (1_i64 << (bits - 1))
        };
        let mut near = 0;
        for _ in 0..200_000 {
            let n = [next(24), next(24), next(24)];
            let q = [next(40), next(40), next(40)];
            // A point that lies in the plane up to a few units, so that rounding would decide wrongly.
            let u = [n[1], -n[0], 0];
            let k = next(14);
            let p = [q[0] + k * u[0] + next(2), q[1] + k * u[1], q[2]];
            let exact: i128 = (0..3).map(|i| i128::from(n[i]) * (i128::from(p[i]) - i128::from(q[i]))).sum();
            near += usize::from(exact == 0);
            let f = |v: [i64; 3]| Vector::new(v[0] as f64, v[1] as f64, v[2] as f64);
            if n == [0; 3] {
                continue;
            }
            let plane = Cutter::plane(Point::from(f(q)), f(n)).expect("plane");
            let expected = if exact >= 0 { Side::Plus } else { Side::Minus };
            assert_eq!(plane.side(&Point::from(f(p))), expected, "n {n:?} p {p:?} q {q:?}");
        }
        assert!(near > 10_000, "only {near} points lay in their plane");
    }
}
