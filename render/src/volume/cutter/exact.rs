//! The sign of a plane's form at a point, without rounding.
//!
//! The crate `robust` decides for planes through three points; a plane given by a point and a normal has no
//! such three without rounding, so the sum is made here.

use super::super::{Point, Vector};

/// A number with the sign of n·p − n·q, exactly.
#[inline]
pub(in super::super) fn plane_sign(n: &Vector, p: &Point, q: &Point) -> f64 {
    sign_of_sum([(n.x, p.x), (n.y, p.y), (n.z, p.z), (-n.x, q.x), (-n.y, q.y), (-n.z, q.z)])
}

/// A number with the sign of the sum of six products, exactly, where none overflows or underflows; its size is
/// the sum's, as far as a plain evaluation goes. With all signs of one factor turned the number's sign turns.
///
/// A plain evaluation decides where its error bound allows; otherwise the six products are added as an
/// expansion without rounding. Source: Shewchuk 1997, "Adaptive Precision Floating-Point Arithmetic",
/// sections 2.2 to 2.5 (`TWO-PRODUCT`, `GROW-EXPANSION`); the product's error here comes from a fused
/// multiply-add.
#[inline]
pub(in super::super) fn sign_of_sum(products: [(f64, f64); 6]) -> f64 {
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
            let sign = plane_sign(&f(n), &Point::from(f(p)), &Point::from(f(q)));
            assert_eq!(sign.partial_cmp(&0.0), Some(exact.cmp(&0)), "n {n:?} p {p:?} q {q:?}");
        }
        assert!(near > 10_000, "only {near} points lay in their plane");
    }
}
