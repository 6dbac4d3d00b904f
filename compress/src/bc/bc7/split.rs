//! Which patterns of two subsets suit eight blocks.
//!
//! Each of the 64 patterns is judged by what two lines without rounding would leave: the trace of each subset's
//! covariance less its largest eigenvalue.

use super::fit::{Plane, principal_axis, sum};
use super::lanes::{LANES, Lanes};
use super::partitions::TWO;
use crate::bc::endpoints::TEXELS;

/// Sums of a subset: of the weights, of the four channels, and of the ten products of two channels.
const SUMS: usize = 15;

/// The products' channels, in the order of the sums.
const PRODUCTS: [(usize, usize); 10] =
    [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];

/// The `K` best patterns of each block, the best first.
#[inline(always)]
pub(super) fn patterns<const K: usize>(values: &[Plane; 4], weights: &Plane) -> [[usize; LANES]; K] {
    let share = Lanes::ONE.over(sum(weights) + Lanes::all(1e-6));
    let mut terms = [[Lanes::ZERO; TEXELS]; SUMS];
    terms[0] = *weights;
    let mut centred = *values;
    for (c, plane) in centred.iter_mut().enumerate() {
        let mut mean = Lanes::ZERO;
        for i in 0..TEXELS {
            mean += weights[i] * plane[i];
        }
        mean = mean * share;
        for i in 0..TEXELS {
            plane[i] = plane[i] - mean;
            terms[1 + c][i] = weights[i] * plane[i];
        }
    }
    for (term, (a, b)) in terms[5..].iter_mut().zip(PRODUCTS) {
        for i in 0..TEXELS {
            term[i] = weights[i] * centred[a][i] * centred[b][i];
        }
    }
    let mut total = [Lanes::ZERO; SUMS];
    for (total, term) in total.iter_mut().zip(&terms) {
        *total = sum(term);
    }
    let mut best = [[0; LANES]; K];
    let mut errors = [[f32::INFINITY; LANES]; K];
    for (pattern, &texels) in TWO.iter().enumerate() {
        let mut part = [Lanes::ZERO; SUMS];
        for i in (0..TEXELS).filter(|i| texels >> i & 1 == 1) {
            for (part, term) in part.iter_mut().zip(&terms) {
                *part += term[i];
            }
        }
        let mut rest = total;
        for (rest, part) in rest.iter_mut().zip(part) {
            *rest = *rest - part;
        }
        let error = off_line(&part) + off_line(&rest);
        for lane in 0..LANES {
            let (mut error, mut pattern) = (error.0[lane], pattern);
            for k in 0..K {
                if error < errors[k][lane] {
                    std::mem::swap(&mut error, &mut errors[k][lane]);
                    std::mem::swap(&mut pattern, &mut best[k][lane]);
                }
            }
        }
    }
    best
}

/// The squared distances of a subset's colours from their own principal axis.
#[inline(always)]
fn off_line(sums: &[Lanes; SUMS]) -> Lanes {
    let share = Lanes::ONE.over(sums[0] + Lanes::all(1e-6));
    let mut covariance = [[Lanes::ZERO; 4]; 4];
    let mut trace = Lanes::ZERO;
    for (&product, (a, b)) in sums[5..].iter().zip(PRODUCTS) {
        covariance[a][b] = product - sums[1 + a] * sums[1 + b] * share;
        covariance[b][a] = covariance[a][b];
        if a == b {
            trace += covariance[a][b];
        }
    }
    let axis = principal_axis(covariance);
    let (mut along, mut length) = (Lanes::ZERO, Lanes::all(1e-6));
    for a in 0..4 {
        let mut row = Lanes::ZERO;
        for b in 0..4 {
            row += covariance[a][b] * axis[b];
        }
        along += axis[a] * row;
        length += axis[a] * axis[a];
    }
    trace - along.over(length)
}
