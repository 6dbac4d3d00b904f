//! Which codecs suit a series: tried on a few of its steps, not guessed from what they look like.
//!
//! Every scheme of both papers and every second stage is run on a sample of steps. A step takes as long as the
//! slowest of what goes on at the same time: reading it, unpacking it, and what the caller measures of sending it to
//! the device (decoding there or on the CPU included).

use std::cell::RefCell;
use std::collections::HashMap;

use compress::Extent3;
use compress::container::StepCodec;
use compress::lossless::trial::{self, TrialError};
use compress::lossless::{ByteCodec, Shape};
use compress::pvtc::Encoder;
use compress::pvtc::measure::{Scheme, Similarity, measure, similarity};
use thiserror::Error;

use super::series::{SeriesError, encode_group};

/// Steps that are tried: whole groups of every scheme.
pub const SAMPLE_STEPS: usize = 12;
/// Level of zstd that is tried, as [`compress::lossless::PackOptions`] writes it.
const ZSTD_LEVEL: i32 = 6;
/// Raw steps whose packing is tried.
const RAW_STEPS: usize = 2;
/// Times that a payload is sent; the shortest counts.
const SENT: usize = 3;
/// Trials that differ by less than this factor in time count as equally fast: clocks are no better.
const AS_FAST: f64 = 1.05;

/// What is asked of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// At least this PSNR, dB, in as few bytes as can be.
    Psnr(f64),
    /// At most this many bytes in all, as good as can be.
    Bytes(f64),
    /// At least this many steps a second, as good as can be.
    Fps(f64),
}

/// One scheme with one second stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// The first stage.
    pub codec: StepCodec,
    /// The second.
    pub byte_codec: ByteCodec,
    /// Of the sample, peak 255; infinite where nothing is lost.
    pub psnr_db: f64,
    /// Of a step, after both stages.
    pub bytes: f64,
    /// Of a step, the slowest of reading, unpacking and sending.
    pub secs: f64,
}

/// The trial that was chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Which.
    pub trial: Trial,
    /// Whether it keeps to the goal; else it is the one that comes nearest.
    pub meets_goal: bool,
}

/// The machine that the series is to play on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Machine {
    /// Reading from its disk, bytes a second.
    pub disk_bytes_per_sec: f64,
    /// Threads that unpack.
    pub threads: usize,
}

/// Why a sample could not be tried.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ChoiceError {
    /// The first stage failed.
    #[error(transparent)]
    Series(#[from] SeriesError),
    /// The second stage failed.
    #[error(transparent)]
    Second(#[from] TrialError),
    /// Sending a step failed; in words.
    #[error("{0}")]
    Send(String),
}

/// All that a series can be compressed with.
pub fn codecs() -> Vec<StepCodec> {
    Scheme::all().map(codec_of).chain([StepCodec::Raw8]).collect()
}

/// How alike the voxels of a sample are, in space and in time; 1 is all alike.
///
/// # Errors
/// [`ChoiceError::Series`] for samples that are not of the extent.
pub fn likeness(sample: &[Vec<u8>], extent: Extent3) -> Result<Similarity, ChoiceError> {
    let slices: Vec<&[u8]> = sample.iter().map(Vec::as_slice).collect();
    similarity(&slices, extent).map_err(|e| SeriesError::Encode(e.to_string()).into())
}

/// Tries schemes with every second stage on 8-bit steps, [`SAMPLE_STEPS`] or fewer.
///
/// Quality and size are those of a sample of boxes; `send` takes a payload of whole steps and gives the seconds that one
/// of them takes on its way to the device.
///
/// # Errors
/// [`ChoiceError`].
pub fn trials(
    sample: &[Vec<u8>],
    extent: Extent3,
    codecs: &[StepCodec],
    machine: Machine,
    send: &mut dyn FnMut(StepCodec, Vec<u8>) -> Result<f64, String>,
) -> Result<Vec<Trial>, ChoiceError> {
    let slices: Vec<&[u8]> = sample.iter().map(Vec::as_slice).collect();
    let schemes = codecs.iter().filter_map(|codec| match codec {
        StepCodec::Pvtc(layout) => Some(Scheme::Layout(*layout)),
        StepCodec::Packed(packing) => Some(Scheme::Packed(*packing)),
        StepCodec::Raw8 | StepCodec::Raw16 => None,
    });
    let second: RefCell<HashMap<StepCodec, Result<Vec<Stage>, TrialError>>> = RefCell::default();
    let candidates = measure(&slices, extent, schemes, Encoder::Fitted, |scheme, bytes| {
        let codec = codec_of(scheme);
        let mut second = second.borrow_mut();
        let stages = second.entry(codec).or_insert_with(|| Ok(Vec::new()));
        match (stages, trial::trials(bytes, shape_of(codec, bytes.len()), ZSTD_LEVEL)) {
            (Ok(stages), Ok(tried)) => Stage::add(stages, &tried),
            (stages @ Ok(_), Err(error)) => *stages = Err(error),
            (Err(_), _) => {}
        }
        bytes.len()
    })
    .map_err(|e| SeriesError::Encode(e.to_string()))?;
    let mut second = second.into_inner();
    let mut all = Vec::new();
    for &codec in codecs {
        let (psnr_db, bytes, stages) = match candidates.iter().find(|c| codec_of(c.scheme) == codec) {
            Some(candidate) => {
                let stages = second.remove(&codec).unwrap_or_else(|| Ok(Vec::new()))?;
                (candidate.psnr_db, candidate.bytes_per_step, stages)
            }
            // Too long a group for the sample.
            None if codec != StepCodec::Raw8 => continue,
            None => {
                let mut stages = Vec::new();
                for step in sample.iter().take(RAW_STEPS) {
                    Stage::add(&mut stages, &trial::trials(step, codec.shape(extent), ZSTD_LEVEL)?);
                }
                (f64::INFINITY, extent.voxels() as f64, stages)
            }
        };
        let group = usize::from(codec.steps_per_chunk()).min(sample.len());
        let payload = encode_group(codec, Encoder::MinMax, &sample[..group], extent)?;
        let mut send_secs = f64::INFINITY;
        // The first warms up what sending needs.
        for _ in 0..SENT {
            send_secs = send_secs.min(send(codec, payload.clone()).map_err(ChoiceError::Send)?);
        }
        for stage in stages {
            let packed = bytes * stage.packed / stage.payload;
            let read = packed / machine.disk_bytes_per_sec;
            let unpack = bytes * stage.secs / stage.payload / machine.threads.max(1) as f64;
            let secs = read.max(unpack).max(send_secs);
            all.push(Trial { codec, byte_codec: stage.byte_codec, psnr_db, bytes: packed, secs });
        }
    }
    Ok(all)
}

/// What a second stage did with all payloads of a sample: bytes before and after, seconds to unpack.
struct Stage {
    byte_codec: ByteCodec,
    payload: f64,
    packed: f64,
    secs: f64,
}

impl Stage {
    fn add(stages: &mut Vec<Self>, tried: &[trial::Trial]) {
        for (byte_codec, trial) in ByteCodec::ALL.into_iter().zip(tried) {
            let (payload, packed) = (trial.payload_bytes as f64, trial.packed_bytes as f64);
            match stages.iter_mut().find(|stage| stage.byte_codec == byte_codec) {
                Some(stage) => {
                    stage.payload += payload;
                    stage.packed += packed;
                    stage.secs += trial.unpack_secs;
                }
                None => stages.push(Self { byte_codec, payload, packed, secs: trial.unpack_secs }),
            }
        }
    }
}

fn codec_of(scheme: Scheme) -> StepCodec {
    match scheme {
        Scheme::Layout(layout) => StepCodec::Pvtc(layout),
        Scheme::Packed(packing) => StepCodec::Packed(packing),
    }
}

/// The elements of `bytes` bytes of a codec, of whatever extent.
fn shape_of(codec: StepCodec, bytes: usize) -> Shape {
    match codec {
        StepCodec::Pvtc(layout) => {
            let table = 4 * usize::from(layout.s());
            let sub_volumes = bytes / (4 + table);
            Shape::new(sub_volumes, 4).then(sub_volumes, table)
        }
        StepCodec::Packed(_) => Shape::new(bytes / 8, 8),
        StepCodec::Raw8 => Shape::new(bytes, 1),
        StepCodec::Raw16 => Shape::new(bytes / 2, 2),
    }
}

/// The trial that keeps to a goal for a series of `steps`; none where nothing was tried.
pub fn choose(trials: &[Trial], goal: Goal, steps: usize) -> Option<Choice> {
    let better = |a: &&Trial, b: &&Trial| a.psnr_db.total_cmp(&b.psnr_db).then(b.bytes.total_cmp(&a.bytes));
    let smaller = |a: &&Trial, b: &&Trial| a.bytes.total_cmp(&b.bytes).then(b.psnr_db.total_cmp(&a.psnr_db));
    let fits = |t: &&Trial| match goal {
        Goal::Psnr(db) => t.psnr_db >= db,
        Goal::Bytes(bytes) => t.bytes * steps as f64 <= bytes,
        Goal::Fps(fps) => t.secs * fps <= 1.0,
    };
    let fitting = trials.iter().filter(fits);
    let met = match goal {
        Goal::Psnr(_) => fitting.min_by(smaller),
        Goal::Bytes(_) | Goal::Fps(_) => fitting.max_by(better),
    };
    if let Some(&trial) = met {
        return Some(Choice { trial, meets_goal: true });
    }
    let nearest = match goal {
        Goal::Psnr(_) => trials.iter().max_by(better),
        Goal::Bytes(_) => trials.iter().min_by(smaller),
        Goal::Fps(_) => {
            let shortest = trials.iter().map(|t| t.secs).fold(f64::INFINITY, f64::min);
            trials.iter().filter(|t| t.secs <= shortest * AS_FAST).min_by(smaller)
        }
    };
    nearest.map(|&trial| Choice { trial, meets_goal: false })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(byte_codec: ByteCodec, psnr_db: f64, bytes: f64, secs: f64) -> Trial {
        Trial { codec: StepCodec::Raw8, byte_codec, psnr_db, bytes, secs }
    }

    #[test]
    fn each_goal_has_its_own_best() {
        let trials = [
            trial(ByteCodec::Store, f64::INFINITY, 1000.0, 0.10),
            trial(ByteCodec::Lz4, 45.0, 250.0, 0.03),
            trial(ByteCodec::Zstd, 38.0, 80.0, 0.02),
        ];
        let chosen = |goal| choose(&trials, goal, 10).map(|c| (c.trial.byte_codec, c.meets_goal));
        assert_eq!(chosen(Goal::Psnr(40.0)), Some((ByteCodec::Lz4, true)), "the smallest of 40 dB");
        assert_eq!(chosen(Goal::Bytes(3000.0)), Some((ByteCodec::Lz4, true)), "the best of 300 bytes a step");
        assert_eq!(chosen(Goal::Fps(20.0)), Some((ByteCodec::Lz4, true)), "the best of 50 ms a step");
        assert_eq!(chosen(Goal::Fps(1000.0)), Some((ByteCodec::Zstd, false)), "the fastest, and says so");
        assert_eq!(chosen(Goal::Bytes(10.0)), Some((ByteCodec::Zstd, false)), "the smallest, and says so");
        assert_eq!(choose(&[], Goal::Psnr(1.0), 1), None, "nothing to choose from");
    }

    #[test]
    fn a_still_series_is_alike_in_time_and_noise_is_not() {
        let extent = Extent3::new([16, 16, 8]).expect("extent");
        let noise = |seed: u64| -> Vec<u8> {
            (0..2048_u64).map(|i| ((i + seed).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as u8).collect()
        };
        let still = likeness(&[noise(1), noise(1)], extent).expect("measured");
        let wild = likeness(&[noise(1), noise(7777)], extent).expect("measured");
        assert!(still.temporal > 0.99 && wild.temporal < 0.5, "{still:?} {wild:?}");
    }

    #[test]
    fn what_is_tried_is_what_would_be_written() {
        let extent = Extent3::new([8, 8, 4]).expect("extent");
        let sample: Vec<Vec<u8>> = (0..12_u8).map(|t| (0..=255).map(|i: u8| i / 4 + t).collect()).collect();
        let machine = Machine { disk_bytes_per_sec: 1e8, threads: 1 };
        let all = trials(&sample, extent, &codecs(), machine, &mut |_, _| Ok(1e-3)).expect("trials");
        assert_eq!(all.len(), 19 * ByteCodec::ALL.len(), "16 layouts, TE, SE and raw, by every second stage");
        assert!(all.iter().all(|t| t.secs >= 1e-3), "sending takes a millisecond");
        let raw = all.iter().find(|t| t.codec == StepCodec::Raw8 && t.byte_codec == ByteCodec::Store);
        let raw = raw.expect("raw");
        assert_eq!((raw.bytes, raw.psnr_db), (256.0, f64::INFINITY), "every byte, nothing lost");
    }
}
