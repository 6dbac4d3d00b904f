//! Which texture serves a bound on the error, or on the bytes: measured on a part of the volume, not guessed.
//!
//! Each candidate encodes and decodes the same sample. The sample is of rows of blocks: one of every n, which
//! gives the mean error as the whole would, and those with the widest blocks, which give the largest error. The
//! same volume gives the same sample, and the same choice, on every machine.
//!
//! What is returned is an estimate. Of the mean it is within a few tenths of a decibel; the largest error of the whole
//! may be above it. The whole is measured when it is encoded: by [`quality`](crate::quality) or in
//! [`TwoPlanes`](super::two_plane::TwoPlanes).
//!
//! | scalar | bits per voxel | good for |
//! |---|---|---|
//! | [`ScalarTexture::Bc4`] | 4 | a narrow range, or pictures rather than values |
//! | [`ScalarTexture::R8`] | 8 | the least largest error of 8 bits: half a 255th of the range |
//! | [`ScalarTexture::TwoPlanes`] | 8 | the least mean error of 8 bits over a wide range |
//! | [`ScalarTexture::R16`] | 16 | values as they are |
//!
//! | colour | bits per voxel | good for |
//! |---|---|---|
//! | [`ColourTexture::Bc1`] | 4 | opaque colour |
//! | [`ColourTexture::Bc3`] | 8 | encoding while the transfer function changes |
//! | [`ColourTexture::Bc7`] | 8 | the same bytes, 6 to 9 dB better |
//! | [`ColourTexture::Rgba8`] | 32 | colours as they are |

use rayon::prelude::*;
use thiserror::Error;

use super::block::{rows, texels};
use super::two_plane::{TwoPlaneError, decode_two_planes, encode_two_planes};
use super::{BlockFormat, DecodeError, EncodeError, EncodeOptions, decode_volume, encode_volume_with};
use crate::{Extent3, ExtentError};

/// Voxels of the regular sample, and of the sample of the widest blocks, about.
const REGULAR_VOXELS: usize = 1 << 18;
const WIDEST_VOXELS: usize = 1 << 16;

/// Rows of voxels of a row of blocks.
const EDGE: usize = 4;

/// What a texture must keep to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// No error above this, in units of the values (HU of a CT), or of 255 for colour.
    MaxError(f64),
    /// At least this ratio of the range to the root of the mean squared error, in dB; for colour in each channel.
    Psnr(f64),
    /// No more than this many bytes, and as accurate as they allow.
    Bytes(u64),
}

/// A texture for one scalar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ScalarTexture {
    /// 16 bits over the range; whole numbers of up to 16 bits as they are.
    R16,
    /// 8 bits over the range.
    R8,
    /// [`BlockFormat::Bc4`] of 8 bits over the range.
    Bc4,
    /// [`BlockFormat::Bc5`] as [`encode_two_planes`] makes it.
    TwoPlanes,
}

/// A texture for colour and opacity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ColourTexture {
    /// 8 bits a channel.
    Rgba8,
    /// [`BlockFormat::Bc7`]
    Bc7,
    /// [`BlockFormat::Bc3`]
    Bc3,
    /// [`BlockFormat::Bc1`], for opaque colour.
    Bc1,
}

impl ScalarTexture {
    /// Every texture, the smallest first, of equal size the one that is faster to make first.
    pub const ALL: [Self; 4] = [Self::Bc4, Self::R8, Self::TwoPlanes, Self::R16];

    /// Bytes of a volume of `extent`.
    pub fn bytes(self, extent: Extent3) -> u64 {
        let bytes = match self {
            Self::R16 => 2 * extent.voxels(),
            Self::R8 => extent.voxels(),
            Self::Bc4 => BlockFormat::Bc4.encoded_len(extent),
            Self::TwoPlanes => BlockFormat::Bc5.encoded_len(extent),
        };
        bytes as u64
    }
}

impl ColourTexture {
    /// Every texture, the smallest first, of equal size the one that is faster to make first.
    pub const ALL: [Self; 4] = [Self::Bc1, Self::Bc3, Self::Bc7, Self::Rgba8];

    /// Bytes of a volume of `extent`.
    pub fn bytes(self, extent: Extent3) -> u64 {
        let bytes = match self.blocks() {
            Some(format) => format.encoded_len(extent),
            None => 4 * extent.voxels(),
        };
        bytes as u64
    }

    /// The block format, if it is one.
    pub fn blocks(self) -> Option<BlockFormat> {
        match self {
            Self::Rgba8 => None,
            Self::Bc7 => Some(BlockFormat::Bc7),
            Self::Bc3 => Some(BlockFormat::Bc3),
            Self::Bc1 => Some(BlockFormat::Bc1),
        }
    }
}

/// What a texture was found to lose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate<Texture> {
    /// The texture.
    pub texture: Texture,
    /// Its bytes for the whole volume.
    pub bytes: u64,
    /// The largest error of the sample, in units of the values, or of 255 for colour.
    pub largest: f64,
    /// The root of the mean squared error; for colour of the worst channel.
    pub rmse: f64,
    /// The same as a ratio to the range, in dB; infinite where nothing is lost.
    pub psnr_db: f64,
}

/// A texture, and what it was chosen from.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice<Texture> {
    /// The smallest texture that keeps to the goal; if there is none, the one that comes nearest.
    pub chosen: Estimate<Texture>,
    /// Whether it keeps to the goal, by its estimate.
    pub meets_goal: bool,
    /// All textures, in the order of `ALL`.
    pub candidates: Vec<Estimate<Texture>>,
}

/// Why no texture can be chosen.
#[derive(Debug, Error, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ChooseError {
    /// There are not as many samples as the extent needs.
    #[error(
        "{found} samples were given, but the extent needs {expected}: give one scalar or four bytes a voxel"
    )]
    Length {
        /// Samples that the extent needs.
        expected: usize,
        /// Samples given.
        found: usize,
    },
    /// The bound is none.
    #[error("a bound of {bound} is none: give a finite number, and an error of 0 or more")]
    Goal {
        /// The bound given.
        bound: f64,
    },
    /// The sample has no extent.
    #[error("the volume is too wide for a sample of it")]
    Extent(#[source] ExtentError),
    /// Range or values are not usable, or there is no memory.
    #[error("the sample cannot be put into two planes")]
    TwoPlanes(#[source] TwoPlaneError),
    /// There is no memory to encode the sample.
    #[error("the sample cannot be encoded")]
    Encode(#[source] EncodeError),
    /// There is no memory to decode the sample.
    #[error("the sample cannot be decoded")]
    Decode(#[source] DecodeError),
}

/// Chooses a texture for scalars, `[x, y, z]`, x fastest.
///
/// `range` is the lowest and the highest value that matter, as for [`encode_two_planes`]; errors are those of values
/// within it, and it is what [`Goal::Psnr`] stands on.
///
/// # Errors
/// [`ChooseError::Length`], [`ChooseError::Goal`]; [`ChooseError::TwoPlanes`] if `range` is none or a value is not
/// finite; the others if there is no memory for the sample.
pub fn choose_scalar<T>(
    values: &[T],
    extent: Extent3,
    range: [f64; 2],
    goal: Goal,
) -> Result<Choice<ScalarTexture>, ChooseError>
where
    T: Copy + Into<f64> + Sync,
{
    check(values.len(), extent.voxels(), goal)?;
    let [low, high] = range;
    let width = high - low;
    let sample = Sample::new(values, extent, |voxels| {
        let (least, most) = voxels.iter().fold((f64::MAX, f64::MIN), |(least, most), &value| {
            let value = value.into().clamp(low.min(high), high.max(low));
            (least.min(value), most.max(value))
        });
        most - least
    })?;
    // First, since it looks at range and values.
    let planes = encode_two_planes(&sample.voxels, sample.extent, range).map_err(ChooseError::TwoPlanes)?;
    let decoded =
        decode_two_planes(&planes.blocks, sample.extent, planes.scales).map_err(ChooseError::Decode)?;
    let original: Vec<f64> = sample.voxels.iter().map(|&value| value.into().clamp(low, high)).collect();
    let eighths: Vec<u8> =
        original.iter().map(|value| ((value - low) / width * 255.0).round() as u8).collect();
    let from_byte = |byte: u8| low + f64::from(byte) / 255.0 * width;
    let whole = width <= 65_535.0 && sample.voxels.iter().all(|&value| value.into().fract() == 0.0);
    let candidates = ScalarTexture::ALL
        .into_iter()
        .map(|texture| {
            let error = match texture {
                ScalarTexture::R16 if whole => Errors::default(),
                ScalarTexture::R16 => sample.errors(|i| {
                    let stored = ((original[i] - low) / width * 65_535.0).round();
                    low + stored / 65_535.0 * width - original[i]
                }),
                ScalarTexture::R8 => sample.errors(|i| from_byte(eighths[i]) - original[i]),
                ScalarTexture::TwoPlanes => sample.errors(|i| f64::from(decoded[i]) - original[i]),
                ScalarTexture::Bc4 => {
                    let decoded =
                        there_and_back(BlockFormat::Bc4, &eighths, &sample, EncodeOptions::default())?;
                    sample.errors(|i| from_byte(decoded[i]) - original[i])
                }
            };
            Ok(error.estimate(texture, texture.bytes(extent), width))
        })
        .collect::<Result<Vec<_>, ChooseError>>()?;
    choose(candidates, goal)
}

/// Chooses a texture for colours of 4 bytes a voxel, R G B A, straight, `[x, y, z]`, x fastest.
///
/// Errors are those of what a voxel adds to a picture: its colour times its opacity, and its opacity, each in units of
/// 255, over the voxels that are seen at all. `options` are those that the volume will be encoded with.
///
/// # Errors
/// [`ChooseError::Length`], [`ChooseError::Goal`]; the others if there is no memory for the sample.
pub fn choose_colour(
    samples: &[u8],
    extent: Extent3,
    goal: Goal,
    options: EncodeOptions,
) -> Result<Choice<ColourTexture>, ChooseError> {
    check(samples.len(), 4 * extent.voxels(), goal)?;
    let (colours, _) = samples.as_chunks::<4>();
    let sample = Sample::new(colours, extent, |voxels| {
        let span = |channel: usize| {
            let (least, most) = voxels.iter().fold((f64::MAX, f64::MIN), |(least, most), &colour| {
                let value = drawn(colour)[channel];
                (least.min(value), most.max(value))
            });
            most - least
        };
        (0..4).map(span).fold(0.0, f64::max)
    })?;
    let candidates = ColourTexture::ALL
        .into_iter()
        .map(|texture| {
            let bytes = texture.bytes(extent);
            let Some(format) = texture.blocks() else {
                return Ok(Errors::default().estimate(texture, bytes, 255.0));
            };
            let decoded = there_and_back(format, sample.voxels.as_flattened(), &sample, options)?;
            let (decoded, _) = decoded.as_chunks::<4>();
            let seen = |i: usize| sample.voxels[i][3] > 0 || decoded[i][3] > 0;
            let worst = (0..4)
                .map(|channel| {
                    sample
                        .errors_where(seen, |i| drawn(decoded[i])[channel] - drawn(sample.voxels[i])[channel])
                })
                .fold(Errors::default(), |a, b| Errors {
                    largest: a.largest.max(b.largest),
                    rmse: a.rmse.max(b.rmse),
                });
            Ok(worst.estimate(texture, bytes, 255.0))
        })
        .collect::<Result<Vec<_>, ChooseError>>()?;
    choose(candidates, goal)
}

/// What a colour adds to a picture: premultiplied, and its opacity.
fn drawn([r, g, b, a]: [u8; 4]) -> [f64; 4] {
    let opacity = f64::from(a) / 255.0;
    [f64::from(r) * opacity, f64::from(g) * opacity, f64::from(b) * opacity, f64::from(a)]
}

/// Whether there are as many samples as should be, and the goal is one.
fn check(found: usize, expected: usize, goal: Goal) -> Result<(), ChooseError> {
    if found != expected {
        return Err(ChooseError::Length { expected, found });
    }
    match goal {
        Goal::MaxError(bound) if !(bound.is_finite() && bound >= 0.0) => Err(ChooseError::Goal { bound }),
        Goal::Psnr(bound) if !bound.is_finite() => Err(ChooseError::Goal { bound }),
        _ => Ok(()),
    }
}

/// The first of `candidates`, the smallest first, that keeps to the goal.
fn choose<Texture: Copy>(
    candidates: Vec<Estimate<Texture>>,
    goal: Goal,
) -> Result<Choice<Texture>, ChooseError> {
    let meets = |estimate: &Estimate<Texture>| match goal {
        Goal::MaxError(bound) => estimate.largest <= bound,
        Goal::Psnr(bound) => estimate.psnr_db >= bound,
        Goal::Bytes(bytes) => estimate.bytes <= bytes,
    };
    let fitting = || candidates.iter().filter(|estimate| meets(estimate));
    // What is better comes last; of equals the first in order is kept.
    let most_accurate = |a: &&Estimate<Texture>, b: &&Estimate<Texture>| b.rmse.total_cmp(&a.rmse);
    let found = match goal {
        Goal::MaxError(_) | Goal::Psnr(_) => fitting().next(),
        Goal::Bytes(_) => fitting().rev().max_by(most_accurate),
    };
    let nearest = || match goal {
        Goal::MaxError(_) => candidates.iter().rev().max_by(|a, b| b.largest.total_cmp(&a.largest)),
        Goal::Psnr(_) => candidates.iter().rev().max_by(most_accurate),
        Goal::Bytes(_) => candidates.first(),
    };
    let meets_goal = found.is_some();
    match found.or_else(nearest).copied() {
        Some(chosen) => Ok(Choice { chosen, meets_goal, candidates }),
        None => Err(ChooseError::Length { expected: 1, found: 0 }),
    }
}

/// The sample encoded and decoded.
fn there_and_back<V>(
    format: BlockFormat,
    samples: &[u8],
    sample: &Sample<V>,
    options: EncodeOptions,
) -> Result<Vec<u8>, ChooseError> {
    let blocks = encode_volume_with(format, samples, sample.extent, options).map_err(ChooseError::Encode)?;
    decode_volume(format, &blocks, sample.extent).map_err(ChooseError::Decode)
}

/// Some rows of blocks of a volume, one below the other: first the regular ones, then those of the widest blocks.
struct Sample<V> {
    voxels: Vec<V>,
    extent: Extent3,
    /// Voxels of the regular rows.
    regular: usize,
}

/// The errors of a sample.
#[derive(Debug, Clone, Copy, Default)]
struct Errors {
    largest: f64,
    rmse: f64,
}

impl<V: Copy + Sync> Sample<V> {
    /// The sample of a volume; `width` says how far the voxels of a block are apart.
    fn new(
        voxels: &[V],
        extent: Extent3,
        width: impl Fn(&[V; EDGE * EDGE]) -> f64 + Sync,
    ) -> Result<Self, ChooseError> {
        let [blocks_x, blocks_y, slices] = extent.blocks();
        let all = blocks_y * slices;
        let row_voxels = EDGE * extent.x();
        let step = (all * row_voxels).div_ceil(REGULAR_VOXELS).max(1);
        // One row of every `step`, at a place in it that does not keep time with the rows of a slice.
        let place = |first: usize| ((first as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize % step;
        let regular: Vec<usize> =
            (0..all).step_by(step).map(|first| (first + place(first)).min(all - 1)).collect();
        let widths: Vec<f64> = (0..all)
            .into_par_iter()
            .map(|row| {
                let rows = rows(voxels, extent, row);
                (0..blocks_x).map(|x| width(&texels(rows, x))).fold(0.0, f64::max)
            })
            .collect();
        let mut widest: Vec<usize> = (0..all).filter(|row| regular.binary_search(row).is_err()).collect();
        widest.sort_by(|&a, &b| widths[b].total_cmp(&widths[a]).then(a.cmp(&b)));
        widest.truncate((WIDEST_VOXELS / row_voxels).max(1));
        let chosen = regular.iter().chain(&widest);
        let voxels: Vec<V> = chosen.flat_map(|&row| rows(voxels, extent, row).concat()).collect();
        let sizes = [extent.sizes()[0], (voxels.len() / extent.x()) as u32, 1];
        let extent = Extent3::new(sizes).map_err(ChooseError::Extent)?;
        Ok(Self { voxels, extent, regular: regular.len() * row_voxels })
    }

    /// The errors of all voxels.
    fn errors(&self, error: impl Fn(usize) -> f64) -> Errors {
        self.errors_where(|_| true, error)
    }

    /// The errors of some voxels: the largest of both parts, the mean of the regular part.
    fn errors_where(&self, counts: impl Fn(usize) -> bool, error: impl Fn(usize) -> f64) -> Errors {
        let (mut largest, mut squares, mut count) = (0.0_f64, 0.0, 0_usize);
        for i in (0..self.voxels.len()).filter(|&i| counts(i)) {
            let error = error(i);
            largest = largest.max(error.abs());
            if i < self.regular {
                squares += error * error;
                count += 1;
            }
        }
        Errors { largest, rmse: (squares / count.max(1) as f64).sqrt() }
    }
}

impl Errors {
    fn estimate<Texture>(self, texture: Texture, bytes: u64, peak: f64) -> Estimate<Texture> {
        let Self { largest, rmse } = self;
        Estimate { texture, bytes, largest, rmse, psnr_db: 20.0 * (peak / rmse).log10() }
    }
}
