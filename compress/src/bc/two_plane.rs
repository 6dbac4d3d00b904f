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

use rayon::prelude::*;
use thiserror::Error;

use super::{BlockFormat, DecodeError, block, zeroed};
use crate::Extent3;
use crate::bc::endpoints::{LineFit, TEXELS, sum};
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

/// 1.5·2²³: adding and subtracting it rounds a small `f32` to the nearest whole number.
const ROUND: f32 = 12_582_912.0;

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
        for (x, block) in blocks.as_chunks_mut::<BLOCK_BYTES>().0.iter_mut().enumerate() {
            *block = encode(&codes(rows, x), per_code);
        }
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

/// Two palettes of a block and the place of each texel in both.
#[derive(Debug, Clone, Copy)]
struct Fit {
    /// Lowest and highest value of the coarse palette, whole numbers in 0..=255, the second larger.
    coarse: [f32; 2],
    /// The same of the residual palette, in its own codes.
    residual: [f32; 2],
    coarse_places: [f32; TEXELS],
    residual_places: [f32; TEXELS],
    /// Sum of squared errors, in coarse codes.
    error: f32,
}

/// Encodes one block: values in coarse codes, [0, 255]; one residual code is `per_code` of them.
fn encode(values: &[f32; TEXELS], per_code: f32) -> [u8; BLOCK_BYTES] {
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
fn encode_avx2(values: &[f32; TEXELS], per_code: f32) -> [u8; BLOCK_BYTES] {
    encode_plain(values, per_code)
}

/// [`encode`] on any machine.
#[inline(always)]
fn encode_plain(values: &[f32; TEXELS], per_code: f32) -> [u8; BLOCK_BYTES] {
    let (low, high) = range(values);
    if low == high {
        let coarse = ends(low, high);
        let left = (low - if low - coarse[0] > 0.5 { coarse[1] } else { coarse[0] }) / per_code + 127.5;
        return Fit::new(values, per_code, coarse, ends(left.floor(), left.ceil())).block();
    }
    let step = (high - low) / 63.0;
    // Eight coarse values, each in the midst of its eight residuals: all 64 evenly spread.
    let even_coarse = ends(low + 3.5 * step, high - 3.5 * step);
    let even = Fit::new(
        values,
        per_code,
        even_coarse,
        ends(127.5 - 3.5 * step / per_code, 127.5 + 3.5 * step / per_code),
    );
    // The coarse palette over all values, the residual palette over what it leaves.
    let over_all = ends(low, high);
    let left = Fit::nearest(values, over_all);
    let (left_low, left_high) = range(&left);
    let nested =
        Fit::new(values, per_code, over_all, ends(left_low / per_code + 127.5, left_high / per_code + 127.5));
    let [even, nested] = [even, nested].map(|start| start.refined(values, per_code));
    if nested.error < even.error { nested.block() } else { even.block() }
}

impl Fit {
    /// What the nearest coarse values leave.
    #[inline(always)]
    fn nearest(values: &[f32; TEXELS], [low, high]: [f32; 2]) -> [f32; TEXELS] {
        let step = (high - low) / STEPS;
        values.map(|value| value - (low + step * rounded(((value - low) / step).clamp(0.0, STEPS))))
    }

    /// Puts each value at the best of the 64 places of two palettes.
    #[inline(always)]
    fn new(values: &[f32; TEXELS], per_code: f32, coarse: [f32; 2], residual: [f32; 2]) -> Self {
        let coarse_step = (coarse[1] - coarse[0]) / STEPS;
        let residual_step = (residual[1] - residual[0]) / STEPS * per_code;
        let first = coarse[0] + (residual[0] - 127.5) * per_code;
        let per_step = 1.0 / residual_step;
        let mut errors = [f32::MAX; TEXELS];
        let (mut coarse_places, mut residual_places) = ([0.0; TEXELS], [0.0; TEXELS]);
        for level in 0..LEVELS {
            let base = first + coarse_step * level as f32;
            for i in 0..TEXELS {
                let exact = ((values[i] - base) * per_step).clamp(0.0, STEPS);
                let place = rounded(exact);
                let off = base + place * residual_step - values[i];
                let error = off * off;
                let better = error < errors[i];
                errors[i] = if better { error } else { errors[i] };
                coarse_places[i] = if better { level as f32 } else { coarse_places[i] };
                residual_places[i] = if better { place } else { residual_places[i] };
            }
        }
        Self { coarse, residual, coarse_places, residual_places, error: sum(&errors) }
    }

    /// The best of this fit and of rounds of least squares, of one palette given the other, then the other.
    #[inline(always)]
    fn refined(self, values: &[f32; TEXELS], per_code: f32) -> Self {
        let (mut best, mut last) = (self, self);
        for _ in 0..ROUNDS {
            let residual_step = (last.residual[1] - last.residual[0]) / STEPS;
            let without_residual: [f32; TEXELS] = std::array::from_fn(|i| {
                values[i] - (last.residual[0] + residual_step * last.residual_places[i] - 127.5) * per_code
            });
            let coarse = fitted(&without_residual, &last.coarse_places).unwrap_or(last.coarse);
            let coarse_step = (coarse[1] - coarse[0]) / STEPS;
            let without_coarse: [f32; TEXELS] = std::array::from_fn(|i| {
                (values[i] - coarse[0] - coarse_step * last.coarse_places[i]) / per_code + 127.5
            });
            let residual = fitted(&without_coarse, &last.residual_places).unwrap_or(last.residual);
            if (coarse, residual) == (last.coarse, last.residual) {
                break;
            }
            last = Self::new(values, per_code, coarse, residual);
            if last.error < best.error {
                best = last;
            }
        }
        best
    }

    /// The bytes of the block.
    #[inline(always)]
    fn block(&self) -> [u8; BLOCK_BYTES] {
        // By place from the lowest value: the index in a palette whose first end point is the highest.
        const INDICES: [u64; LEVELS] = [1, 7, 6, 5, 4, 3, 2, 0];
        let mut block = [0; BLOCK_BYTES];
        let planes = [(self.coarse, self.coarse_places), (self.residual, self.residual_places)];
        for (bytes, ([low, high], places)) in block.chunks_exact_mut(PLANE_BYTES).zip(planes) {
            let mut bits = high as u64 | (low as u64) << 8;
            for (i, place) in places.into_iter().enumerate() {
                bits |= INDICES[place as usize & 7] << (16 + 3 * i);
            }
            bytes.copy_from_slice(&bits.to_le_bytes());
        }
        block
    }
}

/// The ends, in steps of [`STEPS`], that fit the values best where they are placed now; `None` if that defines none.
#[inline(always)]
fn fitted(values: &[f32; TEXELS], places: &[f32; TEXELS]) -> Option<[f32; 2]> {
    let (low, high) = LineFit::new(&places.map(|place| place / STEPS), &[1.0; TEXELS])?.ends(values);
    Some(ends(low, high))
}

/// Whole end points near two values, the first the smaller.
#[inline(always)]
fn ends(low: f32, high: f32) -> [f32; 2] {
    let low = rounded(low.clamp(0.0, TOP - 1.0));
    [low, rounded(high.clamp(low + 1.0, TOP))]
}

/// To the nearest whole number, ties to even, without a call.
#[inline(always)]
fn rounded(value: f32) -> f32 {
    (value + ROUND) - ROUND
}

/// The lowest and the highest value.
#[inline(always)]
fn range(values: &[f32; TEXELS]) -> (f32, f32) {
    values.iter().fold((f32::MAX, f32::MIN), |(low, high), &value| (low.min(value), high.max(value)))
}

/// The width of the range of the values.
fn span(values: &[f32; TEXELS]) -> f32 {
    let (low, high) = range(values);
    high - low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest error, in coarse codes, of a block that is encoded and decoded.
    fn largest(values: &[f32; TEXELS], per_code: f32) -> f32 {
        let block = encode(values, per_code);
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
            // Besides the place: the coarse step is off by up to an eighth of its share of a code, and G's ends by half.
            let bound = span / 126.0 + 0.5 + per_code;
            assert!(off <= bound, "span {span}: {off} of {bound}");
        }
    }

    #[test]
    fn wider_vectors_make_the_same_bytes() {
        let mut state = 1_u32;
        for span in 0..=255_u16 {
            let values: [f32; TEXELS] = std::array::from_fn(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) as f32 / 16_777_216.0 * f32::from(span)
            });
            let per_code = (255.0 * LEAST_RESIDUAL + 1.0) / TOP;
            assert_eq!(encode(&values, per_code), encode_plain(&values, per_code), "{values:?}");
        }
    }

    #[test]
    fn a_block_of_one_value_is_kept_to_half_a_residual_code() {
        let per_code = (255.0 * LEAST_RESIDUAL + 1.0) / TOP;
        for value in 0..=2550 {
            let value = value as f32 / 10.0;
            let off = largest(&[value; TEXELS], per_code);
            assert!(off <= per_code / 2.0 + 1e-4, "{value}: {off}");
        }
    }
}
