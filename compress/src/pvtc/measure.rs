//! What layouts and packings make of a series, measured on a sample of it.
//!
//! [`similarity`] says how alike neighbours are in space and time, the two on which all these codecs live.
//! [`measure()`] then does not guess from it but encodes a sample with every [`Scheme`]. What a lossless second stage
//! makes of the bytes is asked of the caller, who has it, and so is the choice.
//!
//! Source: *Yamada*, section 3 (a frame's time is that of its bytes, and a fixed rest) and table 4; *Nagayasu*,
//! section 4 (where a second stage pays, and where TE or SE is better).

use rayon::prelude::*;
use thiserror::Error;

use super::packed::{Packing, decode_packed_step, encode_packed};
use super::{DecodeError, EncodeError, Encoder, Layout, check_steps, decode_step, encode};
use crate::Extent3;
use crate::bc::EncodeOptions;

/// Size of a box of the sample: a whole number of sub-volumes of every scheme.
const BOX: [usize; 3] = [32, 8, 24];

/// Boxes of the sample.
const BOXES: usize = 24;

/// How alike neighbours are: 1 − ⟨(v − v′)²⟩ / (2·variance), the correlation of a voxel and its neighbour.
///
/// 1 where neighbours are equal, 0 where they know nothing of each other, down to −1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Of neighbours along x, y and z in one step; 1 for a single voxel.
    pub spatial: f64,
    /// Of a voxel and itself one step later; 1 for a single step.
    pub temporal: f64,
}

/// How a series is encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Scheme {
    /// PVTC <S, T>, decoded by a compute shader or the CPU.
    Layout(Layout),
    /// PVTC-TE or PVTC-SE, decoded by texture hardware.
    Packed(Packing),
}

impl Scheme {
    /// Every scheme: the layouts, TE and SE.
    pub fn all() -> impl Iterator<Item = Self> {
        Layout::ALL.into_iter().map(Self::Layout).chain(Packing::ALL.into_iter().map(Self::Packed))
    }

    /// Steps of a group.
    pub fn steps(self) -> usize {
        match self {
            Self::Layout(layout) => layout.t().into(),
            Self::Packed(packing) => packing.steps(),
        }
    }

    /// Bytes of one group.
    pub fn encoded_len(self, extent: Extent3) -> usize {
        match self {
            Self::Layout(layout) => layout.encoded_len(extent),
            Self::Packed(packing) => packing.encoded_len(extent),
        }
    }
}

/// What a scheme costs and gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// The scheme.
    pub scheme: Scheme,
    /// Bytes of a step, after the second stage.
    pub bytes_per_step: f64,
    /// Peak signal-to-noise ratio on the sample, 255 to RMSE, in dB; infinite where nothing is lost.
    pub psnr_db: f64,
}

/// Why a sample cannot be measured.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeasureError {
    /// The steps cannot be encoded.
    #[error("the sample cannot be encoded")]
    Encode {
        /// Why.
        #[from]
        source: EncodeError,
    },
    /// What was encoded cannot be decoded.
    #[error("the sample cannot be decoded")]
    Decode {
        /// Why.
        #[from]
        source: DecodeError,
    },
}

/// How alike neighbours are in `steps`, 1 or more successive volumes, each `[x, y, z]`, x fastest, 1 byte a voxel.
///
/// # Errors
/// [`EncodeError::Steps`] if there are no steps; [`EncodeError::Length`] if one has not x·y·z bytes.
pub fn similarity(steps: &[&[u8]], extent: Extent3) -> Result<Similarity, EncodeError> {
    check_steps(steps, extent, usize::MAX)?;
    let line = extent.x();
    let slice = line * extent.y();
    // Whole numbers: no order of summation changes the result.
    let square = |a: u8, b: u8| u64::from(a.abs_diff(b)).pow(2);
    let differences = |a: &[u8], b: &[u8]| a.iter().zip(b).map(|(&a, &b)| square(a, b)).sum::<u64>();
    let [mut count, mut sum, mut squares, mut pairs, mut near] = [0; 5];
    for step in steps {
        let lines = step.par_chunks(line);
        let along_x = lines.map(|line| differences(line, line.split_first().map_or(&[], |(_, rest)| rest)));
        let along_y = step.par_chunks(slice).map(|slice| differences(slice, &slice[line..]));
        let along_z =
            step.par_chunks(slice).zip(step.par_chunks(slice).skip(1)).map(|(a, b)| differences(a, b));
        near += along_x.sum::<u64>() + along_y.sum::<u64>() + along_z.sum::<u64>();
        let [x, y, z] = [extent.x(), extent.y(), extent.z()];
        pairs += ((x - 1) * y * z + x * (y - 1) * z + x * y * (z - 1)) as u64;
        count += step.len() as u64;
        sum +=
            step.par_chunks(slice).map(|slice| slice.iter().map(|&v| u64::from(v)).sum::<u64>()).sum::<u64>();
        squares +=
            step.par_chunks(slice).map(|slice| slice.iter().map(|&v| square(v, 0)).sum::<u64>()).sum::<u64>();
    }
    let later: u64 = steps
        .windows(2)
        .map(|pair| {
            let slices = pair[0].par_chunks(slice).zip(pair[1].par_chunks(slice));
            slices.map(|(a, b)| differences(a, b)).sum::<u64>()
        })
        .sum();
    let mean = sum as f64 / count as f64;
    let variance = squares as f64 / count as f64 - mean * mean;
    let correlation = |differences: u64, pairs: u64| {
        if differences == 0 { 1.0 } else { 1.0 - differences as f64 / pairs as f64 / (2.0 * variance) }
    };
    Ok(Similarity {
        spatial: correlation(near, pairs),
        temporal: correlation(later, count / steps.len() as u64 * (steps.len() as u64 - 1)),
    })
}

/// Measures `schemes` on a sample of `steps`.
///
/// The steps are successive volumes, each `[x, y, z]`, x fastest, 1 byte a voxel; 12 are a whole number of groups of
/// every scheme. Schemes whose groups are longer than the steps given are left out.
///
/// `second_stage` is given the encoded bytes of the sample, a group at a time, and says how many they become; without
/// such a stage, `|_, bytes| bytes.len()`. The sizes of the first stage are exact, what the second makes of them and the
/// quality are those of the sample. Runs on the current rayon pool.
///
/// # Errors
/// [`MeasureError::Encode`] if there are no steps, one has not x·y·z bytes, or there is no memory;
/// [`MeasureError::Decode`] if there is none to decode in.
pub fn measure(
    steps: &[&[u8]],
    extent: Extent3,
    schemes: impl IntoIterator<Item = Scheme>,
    encoder: Encoder,
    second_stage: impl Fn(Scheme, &[u8]) -> usize,
) -> Result<Vec<Candidate>, MeasureError> {
    check_steps(steps, extent, usize::MAX)?;
    let sample = Sample::new(steps, extent);
    let schemes = schemes.into_iter().filter(|scheme| scheme.steps() <= steps.len());
    schemes.map(|scheme| sample.measure(scheme, extent, encoder, &second_stage)).collect()
}

/// Boxes from all over a series, one behind the other along y, as a small series.
struct Sample {
    extent: Extent3,
    steps: Vec<Vec<u8>>,
}

impl Sample {
    fn new(steps: &[&[u8]], extent: Extent3) -> Self {
        let sizes = [extent.x(), extent.y(), extent.z()];
        let counts: [usize; 3] = std::array::from_fn(|axis| sizes[axis].div_ceil(BOX[axis]));
        let boxes: usize = counts.iter().product();
        let taken = boxes.min(BOXES);
        let [across, deep] = [0, 2].map(|axis| sizes[axis].min(BOX[axis]));
        let down = BOX[1] * taken;
        // At most 32 by 192 by 24.
        let sampled = Extent3::small([across, down, deep].map(|size| size as u8));
        let origin = |i: usize| {
            // Evenly spread, past any period of the volume: multiples of the golden ratio.
            let turn = (i as u64 * 0x9E37_79B9) % (1 << 32);
            let index = if taken == boxes { i } else { ((turn * boxes as u64) >> 32) as usize };
            [index % counts[0], index / counts[0] % counts[1], index / counts[0] / counts[1]]
        };
        let sample = |step: &&[u8]| {
            let mut voxels = Vec::with_capacity(sampled.voxels());
            for z in 0..deep {
                for y in 0..down {
                    let origin = origin(y / BOX[1]);
                    // Boxes lie inside, or as far as they can: repeated voxels are easier than those of the volume.
                    let at = |axis: usize, i: usize| {
                        let first = (origin[axis] * BOX[axis]).min(sizes[axis].saturating_sub(BOX[axis]));
                        (first + i).min(sizes[axis] - 1)
                    };
                    let line = (at(2, z) * sizes[1] + at(1, y % BOX[1])) * sizes[0];
                    voxels.extend((0..across).map(|x| step[line + at(0, x)]));
                }
            }
            voxels
        };
        Self { extent: sampled, steps: steps.iter().map(sample).collect() }
    }

    fn measure(
        &self,
        scheme: Scheme,
        extent: Extent3,
        encoder: Encoder,
        second_stage: &impl Fn(Scheme, &[u8]) -> usize,
    ) -> Result<Candidate, MeasureError> {
        let [mut before, mut after, mut squares, mut count] = [0; 4];
        let mut decoded = vec![0; self.extent.voxels()];
        // Whole groups only: a short one would be paid for in full.
        for group in self.steps.chunks_exact(scheme.steps()) {
            let group: Vec<&[u8]> = group.iter().map(Vec::as_slice).collect();
            let bytes = match scheme {
                Scheme::Layout(layout) => encode(layout, &group, self.extent, encoder)?,
                Scheme::Packed(packing) => {
                    encode_packed(packing, &group, self.extent, EncodeOptions::default())?
                }
            };
            before += bytes.len();
            after += second_stage(scheme, &bytes);
            for (step, samples) in group.iter().enumerate() {
                match scheme {
                    Scheme::Layout(layout) => decode_step(layout, &bytes, self.extent, step, &mut decoded)?,
                    Scheme::Packed(packing) => {
                        decode_packed_step(packing, &bytes, self.extent, step, &mut decoded)?;
                    }
                }
                squares += samples
                    .iter()
                    .zip(&decoded)
                    .map(|(a, b)| usize::from(a.abs_diff(*b)).pow(2))
                    .sum::<usize>();
                count += samples.len();
            }
        }
        let exact = scheme.encoded_len(extent) as f64 / scheme.steps() as f64;
        Ok(Candidate {
            scheme,
            bytes_per_step: exact * after as f64 / before as f64,
            psnr_db: 10.0 * (255.0 * 255.0 * count as f64 / squares as f64).log10(),
        })
    }
}
