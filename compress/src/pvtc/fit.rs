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

use super::encode::{Choice, Samples};
use super::ends::Field;

/// Places of the two ends along the principal axis that are tried: how far each is drawn in, in 32nds of the range.
const STARTS: [[i32; 2]; 4] = [[0, 0], [4, 4], [0, 8], [8, 0]];

/// Most rounds of indices and end points from one start.
const ROUNDS: usize = 6;

/// Scale of a principal axis in whole numbers.
const AXIS_SCALE: f32 = 1024.0;

/// Rounds of the power iteration.
const POWER_ROUNDS: usize = 8;

/// Sums over the voxels of a sub-volume, given their indices k: all that least squares need.
struct Moments<const T: usize> {
    k: i32,
    kk: i32,
    kv: [i32; T],
}

/// The choice of the least error found.
#[inline(always)]
pub(super) fn fitted<const N: usize, const T: usize>(samples: &Samples<N, T>) -> Choice<N, T> {
    let values: [[i32; N]; T] = samples.map(|step| step.map(i32::from));
    let sums: [i32; T] = std::array::from_fn(|t| values[t].iter().sum());
    let axis = principal_axis(&values, &sums);
    let places: [i32; N] = std::array::from_fn(|i| (0..T).map(|t| axis[t] * values[t][i]).sum());
    let (low, high) = places.iter().fold((i32::MAX, i32::MIN), |(low, high), &p| (low.min(p), high.max(p)));
    let mut best = solid(&values, &sums);
    if low == high {
        return best.1;
    }
    for [from_low, from_high] in STARTS {
        let range = high - low;
        let (low, high) = (low + range / 32 * from_low, high - range / 32 * from_high);
        // Half way between neighbouring levels.
        let bound = |sixths: i32| high - (high - low) / 6 * sixths;
        let bounds = [bound(1), bound(3), bound(5)];
        let mut indices: [i32; N] =
            std::array::from_fn(|i| bounds.iter().map(|bound| i32::from(places[i] < *bound)).sum());
        let mut last = i32::MAX;
        for _ in 0..ROUNDS {
            let moments = moments(&values, &indices);
            let Some(ends) = solve::<N, T>(&moments, &sums) else { break };
            let error;
            (indices, error) = assign(&values, &ends);
            if error < best.0 {
                best = (error, Choice { ends, indices: indices.map(|k| k as u8) });
            }
            if error >= last {
                break;
            }
            last = error;
        }
    }
    best.1
}

/// The direction in which the steps vary most together, scaled to whole numbers.
#[inline(always)]
fn principal_axis<const N: usize, const T: usize>(values: &[[i32; N]; T], sums: &[i32; T]) -> [i32; T] {
    if T == 1 {
        return [AXIS_SCALE as i32; T];
    }
    let covariance: [[f32; T]; T] = std::array::from_fn(|s| {
        std::array::from_fn(|t| {
            let product: i32 = values[s].iter().zip(&values[t]).map(|(a, b)| a * b).sum();
            // Less than 2^31: 128·128·255².
            (product * N as i32 - sums[s] * sums[t]) as f32
        })
    });
    let widest = (0..T).fold(0, |w, t| if covariance[t][t] > covariance[w][w] { t } else { w });
    let mut axis = covariance[widest];
    for _ in 0..POWER_ROUNDS {
        let most = axis.iter().fold(0.0_f32, |most, a| most.max(a.abs()));
        if most == 0.0 {
            return [0; T];
        }
        axis = axis.map(|a| a / most);
        axis = covariance.map(|row| (0..T).map(|t| row[t] * axis[t]).sum());
    }
    let most = axis.iter().fold(0.0_f32, |most, a| most.max(a.abs()));
    axis.map(|a| (a / most * AXIS_SCALE).round() as i32)
}

/// Every voxel at index 1 of the pairs of end points that are nearest to the means there, and what that costs.
#[inline(always)]
fn solid<const N: usize, const T: usize>(values: &[[i32; N]; T], sums: &[i32; T]) -> (i32, Choice<N, T>) {
    let ends = std::array::from_fn(|t| {
        let field = Field::new(T, t);
        // 2·u + d: the mean in thirds of the field, to the nearest.
        let scale = u64::from(255 * N as u32);
        let thirds = ((u64::from(3 * field.most) * sums[t] as u64 + scale / 2) / scale) as u32;
        let u = (thirds + 1) / 3;
        let d = thirds - 2 * u;
        [u, d]
    });
    let (indices, error) = assign(values, &ends);
    (error, Choice { ends, indices: indices.map(|k| k as u8) })
}

#[inline(always)]
fn moments<const N: usize, const T: usize>(values: &[[i32; N]; T], indices: &[i32; N]) -> Moments<T> {
    Moments {
        k: indices.iter().sum(),
        kk: indices.iter().map(|k| k * k).sum(),
        kv: std::array::from_fn(|t| indices.iter().zip(&values[t]).map(|(k, v)| k * v).sum()),
    }
}

/// The best end points for given indices, on the grid of each step's field; none if all indices are alike.
#[inline(always)]
fn solve<const N: usize, const T: usize>(moments: &Moments<T>, sums: &[i32; T]) -> Option<[[u32; 2]; T]> {
    // Weights 3 - k of U and k of D.
    let n = N as i32;
    let (uu, ud, dd) = (9 * n - 6 * moments.k + moments.kk, 3 * moments.k - moments.kk, moments.kk);
    let determinant = uu * dd - ud * ud;
    if determinant == 0 {
        return None;
    }
    let (uu, ud, dd) = (uu as f32, ud as f32, dd as f32);
    let inverse = 1.0 / determinant as f32;
    Some(std::array::from_fn(|t| {
        let field = Field::new(T, t);
        let most = field.most as f32;
        // In units of the field.
        let scale = most / 85.0;
        let (us, ds) = ((3 * sums[t] - moments.kv[t]) as f32 * scale, moments.kv[t] as f32 * scale);
        let u = (dd * us - ud * ds) * inverse;
        let clamp = |x: f32| x.max(0.0).min(most);
        let mut best = (f32::INFINITY, [0.0; 2]);
        for offset in [-1.0, 0.0, 1.0, 2.0] {
            let u = clamp(u.floor() + offset);
            // The best d for that u.
            let d = clamp(((ds - ud * u) / dd).round());
            let error = u * (uu * u + 2.0 * (ud * d - us)) + d * (dd * d - 2.0 * ds);
            if error < best.0 {
                best = (error, [u, d]);
            }
        }
        best.1.map(|end| end as u32)
    }))
}

/// The nearest index of each voxel, and the sum of squared errors.
#[inline(always)]
fn assign<const N: usize, const T: usize>(values: &[[i32; N]; T], ends: &[[u32; 2]; T]) -> ([i32; N], i32) {
    let levels: [[i32; 4]; T] =
        std::array::from_fn(|t| Field::new(T, t).levels(ends[t]).map(|level| level as i32));
    let mut indices = [0; N];
    let mut error = 0;
    for (i, index) in indices.iter_mut().enumerate() {
        let distance = |k: usize| -> i32 {
            (0..T).map(|t| (values[t][i] - levels[t][k]) * (values[t][i] - levels[t][k])).sum()
        };
        let mut least = distance(0);
        for k in 1..4 {
            let other = distance(k);
            *index = if other < least { k as i32 } else { *index };
            least = least.min(other);
        }
        error += least;
    }
    (indices, error)
}
