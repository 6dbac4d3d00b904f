//! A volume over time as a series file (`.series`, see [`compress::container`]): steps in, a chunk at a time.
//!
//! Samples become 8-bit numbers over the range of all steps, or 16-bit ones where nothing may be lost; what the
//! codec makes of them is decoded again and compared with the values, so that the file states its error.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use compress::container::{Figures, FileWriter, Header, StepCodec, WriteError};
use compress::lossless::{ByteCodec, PackOptions};
use compress::pvtc::packed::{decode_packed_step, encode_packed};
use compress::pvtc::{self, Encoder, Layout};
use compress::{Extent3, bc};
use rayon::prelude::*;
use render::volume::Grid;
use thiserror::Error;

use crate::load::Progress;
use crate::steps::Steps;

/// How a series is compressed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeriesOptions {
    /// The first stage.
    pub codec: StepCodec,
    /// How PVTC chooses; and TE and SE: the papers' way is [`bc::Level::Fast`].
    pub encoder: Encoder,
    /// The second stage.
    pub byte_codec: ByteCodec,
}

impl Default for SeriesOptions {
    /// PVTC <4,2>, fitted, with zstd.
    fn default() -> Self {
        let codec = Layout::new(4, 2).map_or(StepCodec::Raw8, StepCodec::Pvtc);
        Self { codec, encoder: Encoder::Fitted, byte_codec: ByteCodec::Zstd }
    }
}

/// What was made and what it cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// Steps.
    pub steps: usize,
    /// Samples of all steps.
    pub samples: u64,
    /// Bytes after the first stage.
    pub payload_bytes: u64,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// Time in the first stage.
    pub encode: Duration,
    /// Time in the second stage and on the disk.
    pub pack: Duration,
    /// Largest distance of a decoded value from the given one.
    pub largest_error: f64,
    /// Over the range of the values; infinite where nothing is lost.
    pub psnr_db: f64,
}

/// Why a series was not written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SeriesError {
    /// A step cannot be read.
    #[error("step {step} cannot be read: {fault}")]
    Step {
        /// The step, from 0.
        step: usize,
        /// Why.
        fault: String,
    },
    /// An encoder's complaint.
    #[error("the steps cannot be compressed: {0}")]
    Encode(String),
    /// The file's complaint.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The user said so.
    #[error("compressing was cancelled; no file was written")]
    Cancelled,
}

/// What stored numbers stand for: `value = offset + scale · stored`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantiser {
    /// Value of one unit.
    pub scale: f64,
    /// Value of a stored 0.
    pub offset: f64,
    /// The greatest stored number.
    top: f64,
}

impl Quantiser {
    /// Over `[low, high]` in 8 or 16 bits. Whole units of `unit` where they suffice, so that nothing is lost.
    pub fn new([low, high]: [f64; 2], unit: f64, wide: bool) -> Self {
        let top = if wide { 65535.0 } else { 255.0 };
        let span = high - low;
        let scale = if unit > 0.0 && span <= unit * top {
            unit
        } else if span > 0.0 {
            span / top
        } else {
            1.0
        };
        Self { scale, offset: low, top }
    }

    /// The number that is nearest to a value.
    pub fn stored(&self, value: f64) -> f64 {
        ((value - self.offset) / self.scale).round().clamp(0.0, self.top)
    }

    /// All samples of a grid in 8 bits, in parallel.
    pub fn bytes(&self, grid: &Grid) -> Vec<u8> {
        let voxels = (0..grid.samples().len()).into_par_iter().with_min_len(1 << 14);
        voxels.map(|i| self.stored(grid.value_at(i)) as u8).collect()
    }

    /// All samples of a grid in 16 bits, little-endian.
    pub fn words(&self, grid: &Grid) -> Vec<u8> {
        let voxels = (0..grid.samples().len()).into_par_iter().with_min_len(1 << 14);
        voxels.flat_map_iter(|i| (self.stored(grid.value_at(i)) as u16).to_le_bytes()).collect()
    }
}

/// The unit that all samples of a series are whole multiples of, apart from a common offset; 0 if there is none.
pub fn unit(grid: &Grid) -> f64 {
    if grid.samples().is_integer() { grid.rescale().slope.abs() } else { 0.0 }
}

/// One group of steps through the first stage. `steps` are 8-bit samples, or 16-bit ones for [`StepCodec::Raw16`].
///
/// # Errors
/// [`SeriesError::Encode`].
pub fn encode_group(
    codec: StepCodec,
    encoder: Encoder,
    steps: &[Vec<u8>],
    extent: Extent3,
) -> Result<Vec<u8>, SeriesError> {
    let slices: Vec<&[u8]> = steps.iter().map(Vec::as_slice).collect();
    let failed = |e: &dyn std::error::Error| SeriesError::Encode(e.to_string());
    match codec {
        StepCodec::Raw8 | StepCodec::Raw16 => Ok(steps.concat()),
        StepCodec::Pvtc(layout) => pvtc::encode(layout, &slices, extent, encoder).map_err(|e| failed(&e)),
        StepCodec::Packed(packing) => {
            let level = if encoder == Encoder::MinMax { bc::Level::Fast } else { bc::Level::Best };
            let options = bc::EncodeOptions::default().with_level(level);
            encode_packed(packing, &slices, extent, options).map_err(|e| failed(&e))
        }
    }
}

/// Step `step` of a group, decoded: 8-bit samples, or 16-bit ones for [`StepCodec::Raw16`].
///
/// # Errors
/// [`SeriesError::Encode`] where the bytes are not those of the group.
pub fn decode_step(
    codec: StepCodec,
    payload: &[u8],
    extent: Extent3,
    step: usize,
    out: &mut Vec<u8>,
) -> Result<(), SeriesError> {
    let failed = |e: &dyn std::error::Error| SeriesError::Encode(e.to_string());
    match codec {
        StepCodec::Raw8 | StepCodec::Raw16 => {
            payload.clone_into(out);
            Ok(())
        }
        StepCodec::Pvtc(layout) => {
            out.resize(extent.voxels(), 0);
            pvtc::decode_step(layout, payload, extent, step, out).map_err(|e| failed(&e))
        }
        StepCodec::Packed(packing) => {
            out.resize(extent.voxels(), 0);
            decode_packed_step(packing, payload, extent, step, out).map_err(|e| failed(&e))
        }
    }
}

/// Writes `steps` to `path`. One group of steps is in memory at a time beside what `steps` hold themselves.
///
/// # Errors
/// [`SeriesError`]; no file is there then that was not there before.
pub fn write(
    path: &Path,
    steps: &Steps,
    name: &str,
    modality: &str,
    options: SeriesOptions,
    progress: &dyn Progress,
) -> Result<Written, SeriesError> {
    let grid = |step: usize| -> Result<Arc<Grid>, SeriesError> {
        steps.grid(step).ok_or_else(|| SeriesError::Step { step, fault: steps.fault().unwrap_or_default() })
    };
    let first = grid(0)?;
    let sizes = first.extent().map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    let extent = Extent3::new(sizes).map_err(|e| SeriesError::Encode(e.to_string()))?;
    let wide = options.codec == StepCodec::Raw16;
    let range = steps.range();
    let quantiser = Quantiser::new(range, unit(&first), wide);
    let mut header = Header::new(extent, options.codec, options.byte_codec);
    header.value_scale = quantiser.scale;
    header.value_offset = quantiser.offset;
    header.world_from_voxel = first.world_from_voxel().to_row_major();
    header.steps_per_sec = rate(steps.times_secs());
    header.name = fitting(name, 128);
    header.kind = fitting(modality, 32);
    header.unit = if modality == "CT" { "HU".to_owned() } else { String::new() };
    let mut file = FileWriter::create(path, &header, PackOptions::default())?;
    let times = steps.times_secs();
    let mut written = Written {
        steps: times.len(),
        samples: extent.voxels() as u64 * times.len() as u64,
        payload_bytes: 0,
        file_bytes: 0,
        encode: Duration::ZERO,
        pack: Duration::ZERO,
        largest_error: 0.0,
        psnr_db: f64::INFINITY,
    };
    let (mut squares, mut decoded) = (0.0, Vec::new());
    let group = usize::from(options.codec.steps_per_chunk());
    for (chunk, times) in times.chunks(group).enumerate() {
        if !progress.step("compressing steps", chunk * group, written.steps) {
            return Err(SeriesError::Cancelled);
        }
        let grids: Vec<Arc<Grid>> = (0..times.len()).map(|i| grid(chunk * group + i)).collect::<Result<_, _>>()?;
        let samples: Vec<Vec<u8>> =
            grids.iter().map(|g| if wide { quantiser.words(g) } else { quantiser.bytes(g) }).collect();
        let begin = Instant::now();
        let payload = encode_group(options.codec, options.encoder, &samples, extent)?;
        written.encode += begin.elapsed();
        written.payload_bytes += payload.len() as u64;
        for (step, grid) in grids.iter().enumerate() {
            decode_step(options.codec, &payload, extent, step, &mut decoded)?;
            let (largest, sum) = error(grid, &quantiser, &decoded, wide);
            written.largest_error = written.largest_error.max(largest);
            squares += sum;
        }
        let begin = Instant::now();
        file.push(&payload, times)?;
        written.pack += begin.elapsed();
    }
    // Rounding of the comparison itself does not count.
    if written.largest_error <= 1e-9 * (range[1] - range[0]) {
        (written.largest_error, squares) = (0.0, 0.0);
    }
    if squares > 0.0 {
        let peak = range[1] - range[0];
        written.psnr_db = 10.0 * (peak * peak * written.samples as f64 / squares).log10();
    }
    let figures = Figures { largest_error: Some(written.largest_error), psnr_db: Some(written.psnr_db) };
    let begin = Instant::now();
    written.file_bytes = file.finish(figures)?;
    written.pack += begin.elapsed();
    Ok(written)
}

/// Largest error and sum of squares of decoded numbers against a grid's values.
fn error(grid: &Grid, quantiser: &Quantiser, decoded: &[u8], wide: bool) -> (f64, f64) {
    let stored = |i: usize| {
        if wide {
            f64::from(u16::from_le_bytes([decoded[2 * i], decoded[2 * i + 1]]))
        } else {
            f64::from(decoded[i])
        }
    };
    const PART: usize = 1 << 14;
    let count = grid.samples().len();
    // Summed in order, so that the last bits do not depend on the threads.
    let parts: Vec<(f64, f64)> = (0..count.div_ceil(PART))
        .into_par_iter()
        .map(|part| {
            (part * PART..((part + 1) * PART).min(count)).fold((0.0, 0.0), |(largest, sum): (f64, f64), i| {
                let e = (quantiser.offset + quantiser.scale * stored(i) - grid.value_at(i)).abs();
                (largest.max(e), sum + e * e)
            })
        })
        .collect();
    parts.iter().fold((0.0, 0.0), |(largest, sum), part| (largest.max(part.0), sum + part.1))
}

/// Steps a second that play in the time that they took; 1 where there is one step only.
fn rate(times: &[f64]) -> f64 {
    let span = times.last().copied().unwrap_or_default() - times.first().copied().unwrap_or_default();
    if span > 0.0 { (times.len() - 1) as f64 / span } else { 1.0 }
}

/// The beginning of a text that has at most `bytes` bytes and no zero ones.
fn fitting(text: &str, bytes: usize) -> String {
    let mut fitting = text.replace('\0', " ");
    while fitting.len() > bytes {
        fitting.pop();
    }
    fitting
}
