//! Which byte codec suits a disk: measured on a payload, chosen for a reading speed.
//!
//! Reading and unpacking run side by side, so a chunk takes as long as the slower of the two: `packed bytes / disk
//! speed` or `unpacking time / threads`. The codec with the shortest such time wins. Where several are as short, to
//! [`AS_SHORT`], the disk is not what they wait for, and the smallest wins: it leaves the disk to others.
//!
//! A choice stands on time measured on this machine and may differ on the next run. A file is therefore written with
//! a codec that is named; this module names it.

use std::time::Instant;

use super::{ByteCodec, Form, PackError, PackOptions, Packer, Shape, UnpackError, Unpacker};

/// Times that differ by less than this factor count as the same.
pub const AS_SHORT: f64 = 1.02;

/// Times a payload is unpacked; the shortest counts.
const ROUNDS: usize = 5;

/// What one codec made of a payload.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// The codec, and the planes that suited it best.
    pub form: Form,
    /// Bytes of the payload.
    pub payload_bytes: usize,
    /// Bytes after packing.
    pub packed_bytes: usize,
    /// The shortest time to unpack it on one thread, in s.
    pub unpack_secs: f64,
}

impl Trial {
    /// The time in s that a chunk takes when it comes from a disk of `disk_bytes_per_sec` and is unpacked on
    /// `threads` threads, all busy with other chunks.
    pub fn secs(&self, disk_bytes_per_sec: f64, threads: usize) -> f64 {
        (self.packed_bytes as f64 / disk_bytes_per_sec).max(self.unpack_secs / threads.max(1) as f64)
    }
}

/// Why a payload cannot be tried.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrialError {
    /// It cannot be packed.
    #[error("the payload cannot be packed")]
    Pack(#[from] PackError),
    /// What was packed cannot be unpacked.
    #[error("what was packed cannot be unpacked")]
    Unpack(#[from] UnpackError),
}

/// Packs and unpacks `payload` with every codec, one trial each, in the order of [`ByteCodec::ALL`].
///
/// # Errors
/// [`TrialError::Pack`] if the payload is not of the shape, zstd has no such level or there is no memory;
/// [`TrialError::Unpack`] if there is no memory to unpack into.
pub fn trials(payload: &[u8], shape: Shape, zstd_level: i32) -> Result<Vec<Trial>, TrialError> {
    let mut unpacker = Unpacker::new();
    let mut out = payload.to_vec();
    let mut trials = Vec::new();
    for codec in ByteCodec::ALL {
        let options = PackOptions { codec, zstd_level, ..Default::default() };
        let packed = Packer::new(options)?.pack(payload, shape)?;
        let mut unpack_secs = f64::INFINITY;
        for _ in 0..ROUNDS {
            let start = Instant::now();
            unpacker.unpack_into(packed.form, shape, &packed.bytes, &mut out)?;
            unpack_secs = unpack_secs.min(start.elapsed().as_secs_f64());
        }
        let (payload_bytes, packed_bytes) = (payload.len(), packed.bytes.len());
        trials.push(Trial { form: packed.form, payload_bytes, packed_bytes, unpack_secs });
    }
    Ok(trials)
}

/// The trial that plays fastest from such a disk: see the module. None if there are no trials.
pub fn choose(trials: &[Trial], disk_bytes_per_sec: f64, threads: usize) -> Option<Trial> {
    let secs = |trial: &Trial| trial.secs(disk_bytes_per_sec, threads);
    let shortest = trials.iter().map(secs).fold(f64::INFINITY, f64::min);
    let as_short = trials.iter().filter(|trial| secs(trial) <= shortest * AS_SHORT);
    as_short.min_by_key(|trial| trial.packed_bytes).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lossless::Planes;

    fn trial(codec: ByteCodec, packed_bytes: usize, unpack_secs: f64) -> Trial {
        let form = Form { codec, planes: Planes::AsIs };
        Trial { form, payload_bytes: 1_000_000, packed_bytes, unpack_secs }
    }

    #[test]
    fn a_slow_disk_wants_the_smallest_and_a_fast_one_the_quickest() {
        let trials = [
            trial(ByteCodec::Store, 1_000_000, 1e-4),
            trial(ByteCodec::Lz4, 600_000, 5e-4),
            trial(ByteCodec::Zstd, 400_000, 2e-3),
        ];
        let chosen = |disk, threads| choose(&trials, disk, threads).map(|trial| trial.form.codec);
        assert_eq!(chosen(100e6, 1), Some(ByteCodec::Zstd), "100 MB/s: 4 ms of reading");
        assert_eq!(chosen(1e9, 1), Some(ByteCodec::Lz4), "1 GB/s: zstd would take 2 ms, LZ4 takes 0.6 ms");
        assert_eq!(chosen(1e9, 8), Some(ByteCodec::Zstd), "1 GB/s on 8 threads: zstd takes 0.4 ms");
        assert_eq!(chosen(10e9, 1), Some(ByteCodec::Store), "10 GB/s: stored takes 0.1 ms, LZ4 0.5 ms");
        assert_eq!(choose(&[], 1.0, 1), None, "nothing to choose from");
    }

    #[test]
    fn where_times_are_the_same_the_smallest_is_chosen() {
        let trials = [trial(ByteCodec::Lz4, 600_000, 0.1), trial(ByteCodec::Zstd, 400_000, 0.101)];
        assert_eq!(
            choose(&trials, 1e9, 1).map(|trial| trial.form.codec),
            Some(ByteCodec::Zstd),
            "within 2 %"
        );
    }

    #[test]
    fn a_payload_is_tried_with_every_codec() {
        let shape = Shape::new(1000, 8);
        let payload: Vec<u8> = (0..8000).map(|i| (i / 64) as u8).collect();
        let trials = trials(&payload, shape, 3).unwrap();
        assert_eq!(trials.iter().map(|trial| trial.form.codec).collect::<Vec<_>>(), ByteCodec::ALL, "codecs");
        assert!(trials[1..].iter().all(|trial| trial.packed_bytes < 4000), "{trials:?}");
    }
}
