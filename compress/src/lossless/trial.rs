//! What the byte codecs make of a payload: bytes and time, measured, for whoever chooses between them.
//!
//! Time is measured on this machine and may differ on the next run: a choice that stands on it is made once, and the
//! file is written with a codec that is named.

use std::time::Instant;

use super::{ByteCodec, Form, PackError, PackOptions, Packer, Shape, UnpackError, Unpacker};

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_payload_is_tried_with_every_codec() {
        let shape = Shape::new(1000, 8);
        let payload: Vec<u8> = (0..8000).map(|i| (i / 64) as u8).collect();
        let trials = trials(&payload, shape, 3).unwrap();
        assert_eq!(trials.iter().map(|trial| trial.form.codec).collect::<Vec<_>>(), ByteCodec::ALL, "codecs");
        assert!(trials[1..].iter().all(|trial| trial.packed_bytes < 4000), "{trials:?}");
    }
}
