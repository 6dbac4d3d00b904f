//! Two planes of BC4 for one scalar: what 12-bit CT needs and 8-bit end points cannot give.
//!
//! The blocks are BC5's, 16 bytes: red holds the value coarsely, green what red leaves. Both are read by one fetch,
//! and a value is
//!
//! > value = offset + coarse · R + residual · (G - ½)
//!
//! with R and G in [0, 1] *after* interpolation. The three numbers are constants of the volume: a weighted sum of two
//! planes that the hardware interpolates linearly is the interpolated sum, across blocks too.
//!
//! A block's two palettes of eight make 64 values. Spread evenly they are a 63rd of the block's range apart, so that
//! no error need exceed a 126th of it; `residual` is just wide enough for that in the block of the widest range. The
//! encoder begins there and at the two palettes one after the other, and keeps the best least squares of both.
//!
//! **Errors** are those of the palette in real numbers, as hardware interpolates it. A decoder that rounds R and G to
//! 8 bits may add [`Scales::rounding`] to them; both are stated.
//!
//! Source: KDFS, "RGTC Compressed Texture Image Formats", for the blocks. The sum of planes is our own.
#![expect(clippy::needless_range_loop, reason = "texels are indexed alike in all planes")]

use rayon::prelude::*;
use thiserror::Error;

use super::{BlockFormat, DecodeError, block, zeroed};
use crate::Extent3;
use crate::bc::endpoints::TEXELS;
use crate::bc::lanes::{LANES, Lanes, Plane, least_squares};
use crate::quality::{Quality, compare};

/// Steps of a palette, from its lowest to its highest value.
const STEPS: f32 = 7.0;
const LEVELS: usize = 8;

/// Rounds of least squares.
const ROUNDS: usize = 3;

/// Bytes of a block, and of a plane of it.
const BLOCK_BYTES: usize = 16;
const PLANE_BYTES: usize = 8;

/// The largest number of an end point.
const TOP: f32 = 255.0;

/// The least width of the residual plane that spreads 64 values evenly over a block: seven 63rds of its range.
const LEAST_RESIDUAL: f32 = 7.0 / 63.0;

/// The residual code that stands for nothing.
const MIDDLE: f32 = 127.5;

/// Why a volume cannot be put into two planes.
#[derive(Debug, Error, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum TwoPlaneError {
    /// There are not as many values as voxels.
    #[error("{found} values were given, but the extent has {expected} voxels: give one value a voxel")]
    Length {
        /// Voxels of the extent.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// The range is not one.
    #[error("a range from {low} to {high} is none: give two finite numbers, the lower first")]
    Range {
        /// The lower end given.
        low: f64,
        /// The upper end given.
        high: f64,
    },
    /// A value is NaN or infinite.
    #[error("value {index} is not finite: replace such values by the padding value first")]
    NotFinite {
        /// Where it is.
        index: usize,
    },
    /// There is no memory.
    #[error("no memory for {bytes} bytes: close other volumes or encode a part")]
    OutOfMemory {
        /// Bytes needed.
        bytes: usize,
    },
}

/// What the two planes stand for, in units of the values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// The value of R = 0 and G = ½.
    pub offset: f64,
    /// What R = 1 adds.
    pub coarse: f64,
    /// What G = 1 adds over G = 0.
    pub residual: f64,
}

impl Scales {
    /// The value that red and green, both in [0, 1], stand for.
    pub fn value(&self, red: f64, green: f64) -> f64 {
        self.offset + self.coarse * red + self.residual * (green - 0.5)
    }

    /// What a decoder that rounds R and G to 8 bits may add to an error.
    pub fn rounding(&self) -> f64 {
        (self.coarse + self.residual) / 510.0
    }
}

/// A volume in two planes.
#[derive(Debug, Clone, PartialEq)]
pub struct TwoPlanes {
    /// The blocks, as those of [`BlockFormat::Bc5`].
    pub blocks: Vec<u8>,
    /// How to read them.
    pub scales: Scales,
    /// What was lost of the values within the range, measured on every voxel; the peak is the width of the range.
    pub quality: Quality,
}

/// Encodes a volume of scalars, `[x, y, z]`, x fastest.
///
/// `range` is the lowest and the highest value that matter: values outside are taken as its ends, which is right only
/// where they are drawn alike. The bytes are the same for any number of threads.
///
/// # Errors
/// [`TwoPlaneError::Length`] if there are not as many values as voxels; [`TwoPlaneError::Range`] if `range` is not two
/// finite numbers in order; [`TwoPlaneError::NotFinite`] if a value is NaN or infinite;
/// [`TwoPlaneError::OutOfMemory`].
pub fn encode_two_planes<T>(
    values: &[T],
    extent: Extent3,
    range: [f64; 2],
) -> Result<TwoPlanes, TwoPlaneError>
where
    T: Copy + Into<f64> + Sync,
{
    let [low, high] = range;
    if values.len() != extent.voxels() {
        return Err(TwoPlaneError::Length { expected: extent.voxels(), found: values.len() });
    }
    if !(low.is_finite() && high.is_finite() && low < high && (high - low).is_finite()) {
        return Err(TwoPlaneError::Range { low, high });
    }
    if let Some(index) = values.par_iter().position_first(|&value| !value.into().is_finite()) {
        return Err(TwoPlaneError::NotFinite { index });
    }
    let bytes = BlockFormat::Bc5.encoded_len(extent);
    let mut blocks = zeroed(bytes).ok_or(TwoPlaneError::OutOfMemory { bytes })?;
    let [blocks_x, blocks_y, slices] = extent.blocks();
    let to_codes = f64::from(TOP) / (high - low);
    let codes = |rows: [&[T]; 4], x: usize| {
        block::texels(rows, x).map(|value| ((value.into().clamp(low, high) - low) * to_codes) as f32)
    };
    let widest = (0..blocks_y * slices)
        .into_par_iter()
        .map(|row| {
            let rows = block::rows(values, extent, row);
            (0..blocks_x).map(|x| span(&codes(rows, x))).fold(0.0, f32::max)
        })
        .reduce(|| 0.0, f32::max);
    let per_code = (widest * LEAST_RESIDUAL + 1.0) / TOP;
    block::encode_rows(values, extent, &mut blocks, BLOCK_BYTES, |rows, blocks| {
        encode_row(blocks, per_code, |x| codes(rows, x));
    });
    let coarse = high - low;
    let scales = Scales { offset: low, coarse, residual: coarse * f64::from(per_code) };
    let decoded = decode(&blocks, extent, scales)?;
    let mut original = Vec::new();
    original
        .try_reserve_exact(values.len())
        .map_err(|_full| TwoPlaneError::OutOfMemory { bytes: 4 * values.len() })?;
    original.extend(values.iter().map(|&value| value.into().clamp(low, high) as f32));
    // Neither empty nor of two lengths nor infinite: all three were looked at above.
    let quality =
        compare(&original, &decoded, coarse).map_err(|_unmeasured| TwoPlaneError::Range { low, high })?;
    Ok(TwoPlanes { blocks, scales, quality })
}

/// Decodes a volume of two planes, `[x, y, z]`, x fastest, with palettes in real numbers.
///
/// # Errors
/// [`DecodeError::Length`] if `blocks` has not [`BlockFormat::encoded_len`] bytes; [`DecodeError::OutOfMemory`].
pub fn decode_two_planes(blocks: &[u8], extent: Extent3, scales: Scales) -> Result<Vec<f32>, DecodeError> {
    let format = BlockFormat::Bc5;
    let expected = format.encoded_len(extent);
    if blocks.len() != expected {
        return Err(DecodeError::Length { format, expected, found: blocks.len() });
    }
    decode(blocks, extent, scales).map_err(|_full| DecodeError::OutOfMemory { bytes: 4 * extent.voxels() })
}

/// [`decode_two_planes`] of blocks that are as many as the extent has.
fn decode(blocks: &[u8], extent: Extent3, scales: Scales) -> Result<Vec<f32>, TwoPlaneError> {
    let mut values = Vec::new();
    values
        .try_reserve_exact(extent.voxels())
        .map_err(|_full| TwoPlaneError::OutOfMemory { bytes: 4 * extent.voxels() })?;
    values.resize(extent.voxels(), 0.0_f32);
    block::decode_to(blocks, extent, &mut values, |block: [u8; BLOCK_BYTES]| {
        let [red, green] = [0, PLANE_BYTES].map(|at| plane(&block, at));
        std::array::from_fn(|i| scales.value(red[i], green[i]) as f32)
    });
    Ok(values)
}

/// The sixteen values, in [0, 1], of one plane of a block.
fn plane(block: &[u8; BLOCK_BYTES], at: usize) -> [f64; TEXELS] {
    let mut bytes = [0; PLANE_BYTES];
    bytes.copy_from_slice(&block[at..at + PLANE_BYTES]);
    let [e0, e1] = [bytes[0], bytes[1]].map(f64::from);
    let bits = u64::from_le_bytes(bytes) >> 16;
    std::array::from_fn(|i| {
        let value = match (bits >> (3 * i) & 7, e0 > e1) {
            (0, _) => e0,
            (1, _) => e1,
            (n, true) => ((8 - n) as f64 * e0 + (n - 1) as f64 * e1) / 7.0,
            (6, false) => 0.0,
            (7, false) => 255.0,
            (n, false) => ((6 - n) as f64 * e0 + (n - 1) as f64 * e1) / 5.0,
        };
        value / 255.0
    })
}

/// A row of blocks, encoded: `codes` gives the values of each in coarse codes, [0, 255]; one residual code is
/// `per_code` of them.
fn encode_row(blocks: &mut [u8], per_code: f32, codes: impl Fn(usize) -> [f32; TEXELS]) {
    let (blocks, _) = blocks.as_chunks_mut::<BLOCK_BYTES>();
    let mut values = [Lanes::ZERO; TEXELS];
    let mut places = [0; LANES];
    let mut len = 0;
    for x in 0..blocks.len() {
        let texels = codes(x);
        if span(&texels) == 0.0 {
            blocks[x] = constant(texels[0], per_code);
        } else {
            for (plane, texel) in values.iter_mut().zip(texels) {
                plane.0[len] = texel;
            }
            places[len] = x;
            len += 1;
        }
        if len == LANES || (x + 1 == blocks.len() && len > 0) {
            let fit = encode(&values, per_code);
            for (lane, &x) in places[..len].iter().enumerate() {
                blocks[x] = fit.block(lane);
            }
            len = 0;
        }
    }
}

/// A block of one value, to a fourteenth of a residual code.
fn constant(value: f32, per_code: f32) -> [u8; BLOCK_BYTES] {
    let low = value.round().min(TOP - 1.0);
    // At the very top the coarse value is the higher end.
    let coarse_place = if value - low > 0.5 { STEPS } else { 0.0 };
    let exact = (value - low - coarse_place / STEPS) / per_code + MIDDLE;
    let residual_low = exact.floor().clamp(0.0, TOP - 1.0);
    let residual_place = ((exact - residual_low) * STEPS).round().clamp(0.0, STEPS);
    pack([
        ([low as u8, low as u8 + 1], [coarse_place as u8; TEXELS]),
        ([residual_low as u8, residual_low as u8 + 1], [residual_place as u8; TEXELS]),
    ])
}

/// A block of two palettes: of each the lowest and the highest value, and the places of the texels between them.
fn pack(planes: [([u8; 2], [u8; TEXELS]); 2]) -> [u8; BLOCK_BYTES] {
    // By place from the lowest value: the index in a palette whose first end point is the highest.
    const INDICES: [u64; LEVELS] = [1, 7, 6, 5, 4, 3, 2, 0];
    let mut block = [0; BLOCK_BYTES];
    for (bytes, ([low, high], places)) in block.chunks_exact_mut(PLANE_BYTES).zip(planes) {
        let mut bits = u64::from(high) | u64::from(low) << 8;
        for (i, place) in places.into_iter().enumerate() {
            bits |= INDICES[usize::from(place & 7)] << (16 + 3 * i);
        }
        bytes.copy_from_slice(&bits.to_le_bytes());
    }
    block
}

/// Two palettes of each block and the place of each texel in both.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Fit {
    /// Lowest and highest value of the coarse palette, whole numbers in 0..=255, the second larger.
    coarse: [Lanes; 2],
    /// The same of the residual palette, in its own codes.
    residual: [Lanes; 2],
    coarse_places: Plane,
    residual_places: Plane,
    /// Sum of squared errors, in coarse codes.
    error: Lanes,
}

/// Fits eight blocks.
fn encode(values: &Plane, per_code: f32) -> Fit {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        #[expect(unsafe_code, reason = "the same code with wider vectors, where the machine has them")]
        // SAFETY: the machine has AVX2, as was just asked.
        return unsafe { encode_avx2(values, per_code) };
    }
    encode_plain(values, per_code)
}

/// [`encode_plain`] compiled for AVX2.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn encode_avx2(values: &Plane, per_code: f32) -> Fit {
    encode_plain(values, per_code)
}

/// [`encode`] on any machine.
#[inline(always)]
fn encode_plain(values: &Plane, per_code: f32) -> Fit {
    let (low, high) = range(values);
    let middle = Lanes::all(MIDDLE);
    // Eight coarse values, each in the midst of its eight residuals: all 64 evenly spread.
    let margin = (high - low) * (3.5 / 63.0);
    let half = margin * (1.0 / per_code);
    let even = (ends(low + margin, high - margin), ends(middle - half, middle + half));
    // The coarse palette over all values, the residual palette over what it leaves.
    let over_all = ends(low, high);
    let step = (over_all[1] - over_all[0]) * (1.0 / STEPS);
    let per_step = Lanes::ONE.over(step);
    let mut left = [Lanes::ZERO; TEXELS];
    for i in 0..TEXELS {
        let place = ((values[i] - over_all[0]) * per_step).clamped(STEPS).rounded();
        left[i] = values[i] - over_all[0] - place * step;
    }
    let (left_low, left_high) = range(&left);
    let to_residual = 1.0 / per_code;
    let nested = (over_all, ends(left_low * to_residual + middle, left_high * to_residual + middle));
    let mut best: Option<Fit> = None;
    for (coarse, residual) in [even, nested] {
        let mut last = Fit::new(values, per_code, coarse, residual);
        best = Some(best.map_or(last, |best| best.or_better(&last)));
        for _ in 0..ROUNDS {
            let (coarse, residual) = last.least_squares(values, per_code);
            last = Fit::new(values, per_code, coarse, residual);
            best = Some(best.map_or(last, |best| best.or_better(&last)));
        }
    }
    best.unwrap_or_else(|| Fit::new(values, per_code, even.0, even.1))
}

impl Fit {
    /// Puts each value at the best of the 64 places of two palettes.
    #[inline(always)]
    fn new(values: &Plane, per_code: f32, coarse: [Lanes; 2], residual: [Lanes; 2]) -> Self {
        let coarse_step = (coarse[1] - coarse[0]) * (1.0 / STEPS);
        let residual_step = (residual[1] - residual[0]) * (per_code / STEPS);
        let first = coarse[0] + (residual[0] - Lanes::all(MIDDLE)) * per_code;
        let per_step = Lanes::ONE.over(residual_step);
        let zero = [Lanes::ZERO; TEXELS];
        let mut fit =
            Self { coarse, residual, coarse_places: zero, residual_places: zero, error: Lanes::ZERO };
        for i in 0..TEXELS {
            let mut least = Lanes::all(f32::MAX);
            let mut value = values[i] - first;
            for level in 0..LEVELS {
                let place = (value * per_step).clamped(STEPS).rounded();
                let off = place * residual_step - value;
                let error = off * off;
                fit.coarse_places[i] = error.less(least, Lanes::all(level as f32), fit.coarse_places[i]);
                fit.residual_places[i] = error.less(least, place, fit.residual_places[i]);
                least = error.min(least);
                value = value - coarse_step;
            }
            fit.error += least;
        }
        fit
    }

    /// The palettes of least squares where the texels are placed now: of one palette given the other, then the other.
    #[inline(always)]
    fn least_squares(&self, values: &Plane, per_code: f32) -> ([Lanes; 2], [Lanes; 2]) {
        let weights = [Lanes::ONE; TEXELS];
        let mut rest = [Lanes::ZERO; TEXELS];
        let step = (self.residual[1] - self.residual[0]) * (1.0 / STEPS);
        for i in 0..TEXELS {
            let residual = self.residual[0] + step * self.residual_places[i] - Lanes::all(MIDDLE);
            rest[i] = values[i] - residual * per_code;
        }
        let [low, high] = least_squares(&rest, &weights, &self.coarse_places, STEPS, self.coarse);
        let coarse = ends(low, high);
        let step = (coarse[1] - coarse[0]) * (1.0 / STEPS);
        for i in 0..TEXELS {
            let left = values[i] - coarse[0] - step * self.coarse_places[i];
            rest[i] = left * (1.0 / per_code) + Lanes::all(MIDDLE);
        }
        let [low, high] = least_squares(&rest, &weights, &self.residual_places, STEPS, self.residual);
        (coarse, ends(low, high))
    }

    /// In each lane the fit of the smaller error.
    #[inline(always)]
    fn or_better(&self, other: &Self) -> Self {
        let pick = |theirs: Lanes, ours: Lanes| other.error.less(self.error, theirs, ours);
        let mut best = *self;
        for end in 0..2 {
            best.coarse[end] = pick(other.coarse[end], self.coarse[end]);
            best.residual[end] = pick(other.residual[end], self.residual[end]);
        }
        for i in 0..TEXELS {
            best.coarse_places[i] = pick(other.coarse_places[i], self.coarse_places[i]);
            best.residual_places[i] = pick(other.residual_places[i], self.residual_places[i]);
        }
        best.error = other.error.min(self.error);
        best
    }

    /// The bytes of one block.
    fn block(&self, lane: usize) -> [u8; BLOCK_BYTES] {
        let bytes = |ends: [Lanes; 2]| ends.map(|end| end.byte(lane));
        let places = |plane: &Plane| plane.map(|place| place.byte(lane));
        pack([
            (bytes(self.coarse), places(&self.coarse_places)),
            (bytes(self.residual), places(&self.residual_places)),
        ])
    }
}

/// Whole end points near two values, the first the smaller.
#[inline(always)]
fn ends(low: Lanes, high: Lanes) -> [Lanes; 2] {
    let low = low.clamped(TOP - 1.0).rounded();
    [low, high.max(low + Lanes::ONE).clamped(TOP).rounded()]
}

/// The lowest and the highest value of each block.
#[inline(always)]
fn range(values: &Plane) -> (Lanes, Lanes) {
    let (mut low, mut high) = (values[0], values[0]);
    for &value in values {
        low = low.min(value);
        high = high.max(value);
    }
    (low, high)
}

/// The width of the range of the values of a block.
fn span(values: &[f32; TEXELS]) -> f32 {
    let (low, high) =
        values.iter().fold((f32::MAX, f32::MIN), |(low, high), &value| (low.min(value), high.max(value)));
    high - low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest error, in coarse codes, of a block that is encoded and decoded.
    fn largest(values: &[f32; TEXELS], per_code: f32) -> f32 {
        let mut block = [0; BLOCK_BYTES];
        encode_row(&mut block, per_code, |_| *values);
        let [red, green] = [0, PLANE_BYTES].map(|at| plane(&block, at));
        (0..TEXELS)
            .map(|i| (255.0 * (red[i] + f64::from(per_code) * (green[i] - 0.5)) - f64::from(values[i])).abs())
            .fold(0.0, f64::max) as f32
    }

    #[test]
    fn no_error_of_evenly_spread_values_is_much_more_than_half_a_63rd_of_the_range() {
        for span in [40.0, 100.0, 255.0_f32] {
            let values: [f32; TEXELS] =
                std::array::from_fn(|i| (255.0 - span) / 2.0 + span * i as f32 / 15.0);
            let per_code = (span * LEAST_RESIDUAL + 1.0) / TOP;
            let off = largest(&values, per_code);
            // Half a step, and half a code of each palette for the rounding of its ends.
            let bound = span / 126.0 + 0.5 + per_code / 2.0;
            assert!(off <= bound, "span {span}: {off} of {bound}");
        }
    }

    #[test]
    fn wider_vectors_make_the_same_fits() {
        let mut state = 1_u32;
        for span in 0..=255_u16 {
            let mut values = [Lanes::ZERO; TEXELS];
            for value in values.iter_mut().flat_map(|lanes| &mut lanes.0) {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *value = (state >> 8) as f32 / 16_777_216.0 * f32::from(span);
            }
            let per_code = (255.0 * LEAST_RESIDUAL + 1.0) / TOP;
            assert_eq!(encode(&values, per_code), encode_plain(&values, per_code), "{values:?}");
        }
    }

    #[test]
    fn a_block_of_one_value_is_kept_to_a_fourteenth_of_a_residual_code() {
        for per_code in [1.0 / TOP, (255.0 * LEAST_RESIDUAL + 1.0) / TOP] {
            for value in 0..=2550 {
                let value = value as f32 / 10.0;
                let off = largest(&[value; TEXELS], per_code);
                assert!(off <= per_code / 14.0 + 1e-4, "{value}: {off} of {per_code}");
            }
        }
    }
}
