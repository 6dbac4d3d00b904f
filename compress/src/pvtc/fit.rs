//! The fitted encoder: end points and indices together, for the least squared error in the T dimensions of a group.
//!
//! 1. The voxels are projected on the principal axis of their T values. Its signs are free, so a step that falls while
//!    another rises has its U below its D.
//! 2. From several places of the two ends along that axis, each voxel gets an index.
//! 3. Given indices, the end points of each step are a least squares problem of two unknowns, solved on the grid that
//!    the step's field can hold. Given end points, each voxel takes the nearest of the four decoded points. The two
//!    alternate until the error falls no more.
//!
//! Errors are measured against what decodes, in whole numbers: no order of summation, thus no width of registers,
//! changes a bit.

use super::encode::{Block, assign};
use super::ends::Field;

/// Places of the two ends along the principal axis that are tried: how far each is drawn in, in 32nds of the range.
/// Nine more places gain less than 0.03 dB.
const STARTS: [[i32; 2]; 4] = [[0, 0], [4, 4], [0, 8], [8, 0]];

/// Rounds of end points and indices from each start. A fourth gains less than 0.03 dB.
const ROUNDS: usize = 3;

/// Scale of a principal axis in whole numbers.
const AXIS_SCALE: f32 = 1024.0;

/// Rounds of the power iteration.
const POWER_ROUNDS: usize = 8;

/// The end points of the least error found; never worse than `extremes`, those of the papers' encoder.
#[inline(always)]
pub(super) fn fitted<const N: usize, const T: usize>(
    block: &Block<N, T>,
    extremes: [[u32; 2]; T],
) -> [[u32; 2]; T] {
    let mut best = solid(block);
    let (_, mut error) = assign(block, &best);
    if error == 0 {
        return best;
    }
    let (_, found) = assign(block, &extremes);
    best = if found < error { extremes } else { best };
    error = error.min(found);
    let axis = principal_axis(block);
    let mut places = [0; N];
    for (axis, values) in axis.iter().zip(&block.values) {
        for (place, value) in places.iter_mut().zip(values) {
            *place += axis * value;
        }
    }
    let low = places.iter().fold(i32::MAX, |low, &place| low.min(place));
    let high = places.iter().fold(i32::MIN, |high, &place| high.max(place));
    let mut indices = [[0; N]; STARTS.len()];
    for (indices, [from_low, from_high]) in indices.iter_mut().zip(STARTS) {
        let part = (high - low) / 32;
        let (low, high) = (low + part * from_low, high - part * from_high);
        // Half way between neighbouring levels.
        let sixth = (high - low) / 6;
        for (index, place) in indices.iter_mut().zip(&places) {
            *index = i32::from(*place < high - sixth)
                + i32::from(*place < high - 3 * sixth)
                + i32::from(*place < high - 5 * sixth);
        }
    }
    // All starts side by side and without a branch: one alone waits for itself most of the time.
    for _ in 0..ROUNDS {
        for indices in &mut indices {
            let ends = solve(block, indices);
            let found;
            (*indices, found) = assign(block, &ends);
            best = if found < error { ends } else { best };
            error = error.min(found);
        }
    }
    best
}

/// The direction in which the steps vary most together, scaled to whole numbers.
#[inline(always)]
fn principal_axis<const N: usize, const T: usize>(block: &Block<N, T>) -> [i32; T] {
    if T == 1 {
        return [AXIS_SCALE as i32; T];
    }
    let mut covariance = [[0.0; T]; T];
    for ((row, values), sum) in covariance.iter_mut().zip(&block.values).zip(block.sums) {
        for ((covariance, others), other_sum) in row.iter_mut().zip(&block.values).zip(block.sums) {
            let mut products = 0;
            for (a, b) in values.iter().zip(others) {
                products += a * b;
            }
            // Less than 2^31: 128·128·255².
            *covariance = (products * N as i32 - sum * other_sum) as f32;
        }
    }
    let mut axis = covariance[0];
    for row in &covariance[1..] {
        // The row of the step that varies most is never perpendicular to the axis.
        axis = if largest(row) > largest(&axis) { *row } else { axis };
    }
    for _ in 0..POWER_ROUNDS {
        let scale = 1.0 / largest(&axis).max(1.0);
        let mut next = [0.0; T];
        for (next, row) in next.iter_mut().zip(&covariance) {
            for (a, b) in row.iter().zip(&axis) {
                *next += a * (b * scale);
            }
        }
        axis = next;
    }
    let scale = AXIS_SCALE / largest(&axis).max(1.0);
    let mut whole = [0; T];
    for (whole, a) in whole.iter_mut().zip(&axis) {
        *whole = (a * scale) as i32;
    }
    whole
}

/// The largest absolute value.
#[inline(always)]
fn largest<const T: usize>(axis: &[f32; T]) -> f32 {
    let mut most = 0.0_f32;
    for a in axis {
        most = most.max(a.abs());
    }
    most
}

/// The end points whose index 1 is nearest to the mean of each step.
#[inline(always)]
fn solid<const N: usize, const T: usize>(block: &Block<N, T>) -> [[u32; 2]; T] {
    let mut ends = [[0; 2]; T];
    for (t, ends) in ends.iter_mut().enumerate() {
        // 2·u + d: the mean in thirds of the field, to the nearest.
        let scale = u64::from(255 * N as u32);
        let most = u64::from(3 * Field::new(T, t).most);
        let thirds = ((most * block.sums[t] as u64 + scale / 2) / scale) as u32;
        let u = (thirds + 1) / 3;
        *ends = [u, thirds - 2 * u];
    }
    ends
}

/// The best end points for given indices, on the grid of each step's field. Where all indices are alike, any.
#[inline(always)]
fn solve<const N: usize, const T: usize>(block: &Block<N, T>, indices: &[i32; N]) -> [[u32; 2]; T] {
    let (mut k, mut kk) = (0, 0);
    for index in indices {
        k += index;
        kk += index * index;
    }
    // Weights 3 - k of U and k of D.
    let (uu, ud, dd) = (9 * N as i32 - 6 * k + kk, 3 * k - kk, kk.max(1));
    let inverse = 1.0 / (uu * dd - ud * ud).max(1) as f32;
    let (uu, ud, dd) = (uu as f32, ud as f32, dd as f32);
    let dd_inverse = 1.0 / dd;
    let mut ends = [[0; 2]; T];
    for (t, ends) in ends.iter_mut().enumerate() {
        let mut kv = 0;
        for (index, value) in indices.iter().zip(&block.values[t]) {
            kv += index * value;
        }
        // In units of the field.
        let most = Field::new(T, t).most as f32;
        let scale = most / 85.0;
        let (us, ds) = ((3 * block.sums[t] - kv) as f32 * scale, kv as f32 * scale);
        let nearest = on_grid((dd * us - ud * ds) * inverse, most);
        let (mut least, mut best) = (f32::INFINITY, [0.0; 2]);
        for offset in [-1.0, 0.0, 1.0] {
            let u = on_grid(nearest + offset, most);
            // The best d for that u.
            let d = on_grid((ds - ud * u) * dd_inverse, most);
            let error = u * (uu * u + 2.0 * (ud * d - us)) + d * (dd * d - 2.0 * ds);
            best = if error < least { [u, d] } else { best };
            least = least.min(error);
        }
        *ends = [best[0] as u32, best[1] as u32];
    }
    ends
}

/// The nearest whole number from 0 to `most`, at most 2^16.
#[inline(always)]
fn on_grid(x: f32, most: f32) -> f32 {
    // Beyond 2^23 there are whole numbers only: no call to a library where a processor cannot round.
    const WHOLE: f32 = 8_388_608.0;
    (x.max(0.0).min(most) + WHOLE) - WHOLE
}
