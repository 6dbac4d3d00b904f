//! A line of colours through some texels of eight blocks at once: end points as a mode can store them, and where each
//! texel is put between them.
//!
//! The first line is the principal axis; each round moves the ends to the least squares of the places found, which is
//! `endpoints::LineFit` for many blocks. Errors are those of the values that a decoder gives back, to the last bit.

use super::lanes::Lanes;
use super::modes::LowBits;
use crate::bc::endpoints::TEXELS;

/// One number for each texel of each block.
pub(super) type Plane = [Lanes; TEXELS];

/// A positive number that no sum of weights is below, unless nothing is in it.
const TINY: f32 = 1e-6;

/// Some channels of eight blocks, and how much an error in each counts: 0 for texels that are not in the subset.
#[derive(Debug, Clone, Copy)]
pub(super) struct Colours<'a, const C: usize> {
    pub(super) values: [&'a Plane; C],
    pub(super) weights: [&'a Plane; C],
}

/// How a mode stores a line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Storage {
    /// Bits of an end point in each channel, without its lowest.
    pub(super) bits: u32,
    pub(super) low_bits: LowBits,
    /// Steps from end to end: 3, 7 or 15.
    pub(super) steps: f32,
}

/// A line as a block stores it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line<const C: usize> {
    /// The stored end points, without their lowest bits.
    pub(super) codes: [[Lanes; C]; 2],
    /// The lowest bits of the end points.
    pub(super) low: [Lanes; 2],
    /// What a decoder makes of them.
    values: [[Lanes; C]; 2],
    /// Each texel's steps from the first end.
    pub(super) places: Plane,
    /// Σ weight·(decoded - value)².
    pub(super) error: Lanes,
}

impl<const C: usize> Colours<'_, C> {
    /// The best of the lines of the principal axis and of `rounds` rounds of least squares.
    #[inline(always)]
    pub(super) fn line(&self, storage: Storage, rounds: usize) -> Line<C> {
        let importance = self.importance();
        let mut best = self.placed(storage, self.stored(self.principal_ends(), storage, &importance));
        let mut last = best;
        for _ in 0..rounds {
            let ends = self.least_squares(&last, storage);
            last = self.placed(storage, self.stored(ends, storage, &importance));
            best = best.or_better(&last);
        }
        best
    }

    /// The sum of weights of each channel.
    #[inline(always)]
    fn importance(&self) -> [Lanes; C] {
        self.weights.map(|weights| sum(weights) + Lanes::all(TINY))
    }

    /// The ends of the stretch of the principal axis that the texels fill.
    #[inline(always)]
    fn principal_ends(&self) -> [[Lanes; C]; 2] {
        let weights = self.weights[0];
        let share = Lanes::ONE.over(sum(weights) + Lanes::all(TINY));
        let mut mean = [Lanes::ZERO; C];
        let mut centred = [[Lanes::ZERO; TEXELS]; C];
        for c in 0..C {
            for i in 0..TEXELS {
                mean[c] += weights[i] * self.values[c][i];
            }
            mean[c] = mean[c] * share;
            for i in 0..TEXELS {
                centred[c][i] = self.values[c][i] - mean[c];
            }
        }
        let mut covariance = [[Lanes::ZERO; C]; C];
        for row in 0..C {
            for i in 0..TEXELS {
                let weighted = weights[i] * centred[row][i];
                for column in row..C {
                    covariance[row][column] += weighted * centred[column][i];
                }
            }
        }
        let axis = principal_axis(covariance);
        let length = axis.iter().fold(Lanes::all(TINY), |length, &part| length + part * part);
        let share = Lanes::ONE.over(length);
        let (mut low, mut high) = (Lanes::ZERO, Lanes::ZERO);
        for i in 0..TEXELS {
            let mut place = Lanes::ZERO;
            for c in 0..C {
                place += centred[c][i] * axis[c];
            }
            // A texel of another subset counts as the mean.
            let place = Lanes::ZERO.less(weights[i], place * share, Lanes::ZERO);
            low = low.min(place);
            high = high.max(place);
        }
        [low, high].map(|place| {
            let mut end = mean;
            for c in 0..C {
                end[c] += axis[c] * place;
            }
            end
        })
    }

    /// The ends that fit the values best where the texels are placed now.
    #[inline(always)]
    fn least_squares(&self, line: &Line<C>, storage: Storage) -> [[Lanes; C]; 2] {
        let per_step = 1.0 / storage.steps;
        let mut ends = line.values;
        for c in 0..C {
            let (mut aa, mut ab, mut bb) = (Lanes::ZERO, Lanes::ZERO, Lanes::ZERO);
            let (mut a, mut b) = (Lanes::ZERO, Lanes::ZERO);
            for i in 0..TEXELS {
                let far = line.places[i] * per_step;
                let near = Lanes::ONE - far;
                let (near_weight, far_weight) = (self.weights[c][i] * near, self.weights[c][i] * far);
                aa += near_weight * near;
                ab += near_weight * far;
                bb += far_weight * far;
                a += near_weight * self.values[c][i];
                b += far_weight * self.values[c][i];
            }
            let determinant = aa * bb - ab * ab;
            // Below this the two ends are not told apart by the data: they stay.
            let least = aa.max(bb) * aa.max(bb) * 1e-4 + Lanes::all(TINY * TINY);
            let share = Lanes::ONE.over(determinant.max(least));
            let fitted = [(bb * a - ab * b) * share, (aa * b - ab * a) * share];
            for (end, fitted) in ends.iter_mut().zip(fitted) {
                end[c] = least.less(determinant, fitted.clamped(255.0), end[c]);
            }
        }
        ends
    }

    /// The nearest ends that can be stored: codes, lowest bits and decoded values.
    #[inline(always)]
    fn stored(&self, ends: [[Lanes; C]; 2], storage: Storage, importance: &[Lanes; C]) -> Line<C> {
        let zero = [[Lanes::ZERO; C]; 2];
        let mut line = Line {
            codes: zero,
            low: [Lanes::ZERO; 2],
            values: zero,
            places: [Lanes::ZERO; TEXELS],
            error: Lanes::ZERO,
        };
        if storage.low_bits == LowBits::None {
            for (end, at) in ends.iter().zip(0..) {
                for c in 0..C {
                    let code = (end[c].clamped(255.0) * (top(storage.bits) / 255.0)).rounded();
                    line.codes[at][c] = code;
                    line.values[at][c] = widened(code, storage.bits);
                }
            }
            return line;
        }
        let mut off = [[Lanes::ZERO; 2]; 2];
        let mut tried = [(zero, zero); 2];
        for (low, (codes, values)) in tried.iter_mut().enumerate() {
            for at in 0..2 {
                for c in 0..C {
                    let exact = ends[at][c].clamped(255.0) * (top(storage.bits + 1) / 255.0);
                    let code = ((exact - Lanes::all(low as f32)) * 0.5).rounded().clamped(top(storage.bits));
                    codes[at][c] = code;
                    values[at][c] = widened(code * 2.0 + Lanes::all(low as f32), storage.bits + 1);
                    let error = values[at][c] - ends[at][c];
                    off[low][at] += error * error * importance[c];
                }
            }
        }
        if storage.low_bits == LowBits::EachSubset {
            for off in &mut off {
                *off = [off[0] + off[1]; 2];
            }
        }
        let [(codes_0, values_0), (codes_1, values_1)] = tried;
        for at in 0..2 {
            let pick = |one: Lanes, zero: Lanes| off[1][at].less(off[0][at], one, zero);
            line.low[at] = pick(Lanes::ONE, Lanes::ZERO);
            for c in 0..C {
                line.codes[at][c] = pick(codes_1[at][c], codes_0[at][c]);
                line.values[at][c] = pick(values_1[at][c], values_0[at][c]);
            }
        }
        line
    }

    /// The line with each texel at the better of the two places beside it.
    #[inline(always)]
    fn placed(&self, storage: Storage, mut line: Line<C>) -> Line<C> {
        let [from, to] = line.values;
        let mut span = [Lanes::ZERO; C];
        let mut per_weight = [Lanes::ZERO; C];
        for c in 0..C {
            span[c] = to[c] - from[c];
            per_weight[c] = span[c] * (1.0 / 64.0);
        }
        line.error = Lanes::ZERO;
        for i in 0..TEXELS {
            let (mut along, mut length) = (Lanes::ZERO, Lanes::all(TINY));
            for c in 0..C {
                let weighted = self.weights[c][i] * span[c];
                along += weighted * (self.values[c][i] - from[c]);
                length += weighted * span[c];
            }
            let exact = along.over(length) * storage.steps;
            let below = (exact - Lanes::all(0.5)).rounded().clamped(storage.steps - 1.0);
            let mut candidates = [(below, Lanes::ZERO), (below + Lanes::ONE, Lanes::ZERO)];
            for (place, error) in &mut candidates {
                let weight = (*place * (64.0 / storage.steps)).rounded();
                for c in 0..C {
                    // ⌊(64·from + weight·span + 32) / 64⌋: all of it is exact, and 1/128 keeps ties away.
                    let value = (weight * per_weight[c] + (from[c] + Lanes::all(1.0 / 128.0))).rounded();
                    let off = value - self.values[c][i];
                    *error += off * off * self.weights[c][i];
                }
            }
            let [(near, near_error), (far, far_error)] = candidates;
            line.places[i] = far_error.less(near_error, far, near);
            line.error += far_error.min(near_error);
        }
        line
    }
}

impl<const C: usize> Line<C> {
    /// In each lane the line of the smaller error.
    #[inline(always)]
    fn or_better(&self, other: &Self) -> Self {
        let pick = |theirs: Lanes, ours: Lanes| other.error.less(self.error, theirs, ours);
        let mut best = *self;
        for at in 0..2 {
            best.low[at] = pick(other.low[at], self.low[at]);
            for c in 0..C {
                best.codes[at][c] = pick(other.codes[at][c], self.codes[at][c]);
                best.values[at][c] = pick(other.values[at][c], self.values[at][c]);
            }
        }
        for i in 0..TEXELS {
            best.places[i] = pick(other.places[i], self.places[i]);
        }
        best.error = other.error.min(self.error);
        best
    }
}

/// The largest number of so many bits.
#[inline(always)]
fn top(bits: u32) -> f32 {
    ((1 << bits) - 1) as f32
}

/// `modes::widen` of whole numbers: the highest bits repeated below the lowest.
#[inline(always)]
fn widened(code: Lanes, bits: u32) -> Lanes {
    let unit = (1 << (2 * bits - 8)) as f32;
    // ⌊code / unit⌋, ties kept away.
    let repeated = (code * (1.0 / unit) - Lanes::all(0.5 - 0.5 / unit)).rounded();
    code * (1 << (8 - bits)) as f32 + repeated
}

/// The sum of a plane.
#[inline(always)]
pub(super) fn sum(plane: &Plane) -> Lanes {
    plane.iter().fold(Lanes::ZERO, |sum, &lanes| sum + lanes)
}

/// The direction of the largest eigenvalue of a symmetric matrix, of any length; only the upper half is read. The
/// eighth power of the matrix is nearly that eigenvector times itself, and its column of the largest diagonal is not
/// orthogonal to it.
#[inline(always)]
pub(super) fn principal_axis<const C: usize>(mut matrix: [[Lanes; C]; C]) -> [Lanes; C] {
    for _ in 0..3 {
        let mut trace = Lanes::all(TINY);
        for c in 0..C {
            trace += matrix[c][c];
        }
        let share = Lanes::ONE.over(trace);
        for row in 0..C {
            for column in row..C {
                matrix[row][column] = matrix[row][column] * share;
                matrix[column][row] = matrix[row][column];
            }
        }
        let last = matrix;
        for row in 0..C {
            for column in row..C {
                let mut value = Lanes::ZERO;
                for k in 0..C {
                    value += last[row][k] * last[k][column];
                }
                matrix[row][column] = value;
                matrix[column][row] = value;
            }
        }
    }
    let (mut axis, mut largest) = (matrix[0], matrix[0][0]);
    for row in 1..C {
        let diagonal = matrix[row][row];
        for column in 0..C {
            axis[column] = largest.less(diagonal, matrix[row][column], axis[column]);
        }
        largest = largest.max(diagonal);
    }
    let scale = Lanes::ONE.over(largest + Lanes::all(1e-30));
    for part in &mut axis {
        *part = *part * scale;
    }
    axis
}
