//! Unpacks payloads, of files that may be hostile.
//!
//! The caller states how many bytes must come out; no codec's own statement of it is believed, and none is asked
//! for room before that.
#![warn(clippy::arithmetic_side_effects, clippy::cast_possible_truncation, clippy::indexing_slicing)]

use std::fmt;
use std::io;

use thiserror::Error;
use zstd::bulk::Decompressor;

use super::{ByteCodec, Form, Planes, Shape, lzo};
use crate::Limits;

/// What is wrong with a stream of LZO or LZ4.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// It ends in the middle of an instruction.
    #[error("the stream ends in the middle of an instruction")]
    End,
    /// It unpacks to more or to fewer bytes than it should.
    #[error("the stream unpacks to another number of bytes than the payload has")]
    Length,
    /// It refers to bytes before the first.
    #[error("the stream refers to bytes before its first")]
    Distance,
}

/// Why packed bytes cannot be unpacked.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum UnpackError {
    /// The stream is not one of its codec.
    #[error("the {} stream is damaged: copy the file again from its source", .codec.name())]
    Damaged {
        /// The codec.
        codec: ByteCodec,
        /// What is wrong.
        #[source]
        source: Fault,
    },
    /// The Zstandard frame does not unpack.
    #[error("the zstd frame is damaged: copy the file again from its source")]
    Zstd(#[source] io::Error),
    /// The packed bytes unpack to another number of bytes.
    #[error(
        "{found} bytes come out of the packed bytes, but the payload has {expected}: the file is damaged"
    )]
    Length {
        /// Bytes of the payload.
        expected: usize,
        /// Bytes that came out.
        found: usize,
    },
    /// The place for the payload is not of the shape.
    #[error("there is room for {found} bytes, but the payload has {expected}")]
    Room {
        /// Bytes of the payload.
        expected: usize,
        /// Bytes given to unpack into.
        found: usize,
    },
    /// The payload is larger than the limit.
    #[error(
        "the payload takes {bytes} bytes, more than the limit of {limit}: raise the limit if the file is trusted"
    )]
    TooLarge {
        /// Bytes of the payload.
        bytes: u64,
        /// [`Limits::decoded_bytes`].
        limit: u64,
    },
    /// There is no memory for the payload.
    #[error("no memory for {bytes} bytes of a payload: close others first")]
    OutOfMemory {
        /// Bytes needed.
        bytes: usize,
    },
}

/// Unpacks payloads one after the other, and keeps its working memory between them: one payload where planes are to
/// be joined, and what zstd takes.
#[derive(Default)]
pub struct Unpacker {
    planar: Vec<u8>,
    zstd: Option<Decompressor<'static>>,
}

impl fmt::Debug for Unpacker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Unpacker").field("planar", &self.planar.capacity()).finish_non_exhaustive()
    }
}

impl Unpacker {
    /// An unpacker without working memory yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Unpacks `packed` into `payload`, which has [`Shape::bytes`] bytes. What `payload` holds after an error is of
    /// no meaning.
    ///
    /// # Errors
    /// [`UnpackError::Room`] if `payload` has another length; [`UnpackError::OutOfMemory`] if there is no working
    /// memory of a payload's size; the others for bytes that are not what `form` says.
    pub fn unpack_into(
        &mut self,
        form: Form,
        shape: Shape,
        packed: &[u8],
        payload: &mut [u8],
    ) -> Result<(), UnpackError> {
        if payload.len() != shape.bytes() {
            return Err(UnpackError::Room { expected: shape.bytes(), found: payload.len() });
        }
        if form.planes.leaves(shape) {
            return decode(&mut self.zstd, form.codec, packed, payload);
        }
        if self.planar.len() < payload.len() {
            let more = payload.len().saturating_sub(self.planar.len());
            if self.planar.try_reserve_exact(more).is_err() {
                return Err(UnpackError::OutOfMemory { bytes: payload.len() });
            }
            self.planar.resize(payload.len(), 0);
        }
        let planar = self.planar.get_mut(..payload.len()).unwrap_or_default();
        decode(&mut self.zstd, form.codec, packed, planar)?;
        form.planes.join(shape, planar, payload);
        Ok(())
    }
}

/// Undoes the byte codec: all of `output` is filled, or it is an error.
fn decode(
    zstd: &mut Option<Decompressor<'static>>,
    codec: ByteCodec,
    packed: &[u8],
    output: &mut [u8],
) -> Result<(), UnpackError> {
    let found = match codec {
        ByteCodec::Store => {
            if packed.len() == output.len() {
                output.copy_from_slice(packed);
            }
            packed.len()
        }
        ByteCodec::Lzo => {
            lzo::decompress(packed, output).map_err(|source| UnpackError::Damaged { codec, source })?;
            output.len()
        }
        ByteCodec::Lz4 => lz4_flex::block::decompress_into(packed, output)
            .map_err(|fault| UnpackError::Damaged { codec, source: lz4_fault(&fault) })?,
        ByteCodec::Zstd => {
            let decompressor = match zstd {
                Some(decompressor) => decompressor,
                None => zstd.insert(Decompressor::new().map_err(UnpackError::Zstd)?),
            };
            decompressor.decompress_to_buffer(packed, output).map_err(UnpackError::Zstd)?
        }
    };
    if found == output.len() { Ok(()) } else { Err(UnpackError::Length { expected: output.len(), found }) }
}

/// The same fault in our terms.
fn lz4_fault(fault: &lz4_flex::block::DecompressError) -> Fault {
    match fault {
        lz4_flex::block::DecompressError::OutputTooSmall { .. } => Fault::Length,
        lz4_flex::block::DecompressError::OffsetOutOfBounds => Fault::Distance,
        _ => Fault::End,
    }
}

/// Unpacks one payload into memory of its own, if `limits` allow it.
///
/// # Errors
/// [`UnpackError::TooLarge`] before anything is allocated; else those of [`Unpacker::unpack_into`].
pub fn unpack(form: Form, shape: Shape, packed: &[u8], limits: &Limits) -> Result<Vec<u8>, UnpackError> {
    let bytes = shape.bytes();
    // Where planes are joined, the payload is there twice.
    let copies = if form.planes == Planes::AsIs { 1 } else { 2 };
    let needed = (bytes as u64).saturating_mul(copies);
    if needed > limits.decoded_bytes {
        return Err(UnpackError::TooLarge { bytes: needed, limit: limits.decoded_bytes });
    }
    let mut payload = Vec::new();
    if payload.try_reserve_exact(bytes).is_err() {
        return Err(UnpackError::OutOfMemory { bytes });
    }
    payload.resize(bytes, 0);
    Unpacker::new().unpack_into(form, shape, packed, &mut payload)?;
    Ok(payload)
}

#[cfg(test)]
#[expect(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    clippy::indexing_slicing,
    reason = "a test's own numbers"
)]
mod tests {
    use super::*;
    use crate::lossless::{PackOptions, Packer};

    fn payload(shape: Shape) -> Vec<u8> {
        (0..shape.bytes()).map(|i| (i / 50 * 3 + i % 4) as u8).collect()
    }

    #[test]
    fn every_codec_and_planes_lead_back_to_the_payload() {
        let shape = Shape::new(300, 4).then(300, 16);
        let payload = payload(shape);
        let mut unpacker = Unpacker::new();
        for codec in ByteCodec::ALL {
            for planes in Planes::ALL.map(Some).into_iter().chain([None]) {
                let options = PackOptions { codec, planes, ..Default::default() };
                let packed = Packer::new(options).unwrap().pack(&payload, shape).unwrap();
                assert_eq!(packed.form.codec, codec, "compressible bytes are packed by what was asked for");
                let mut out = vec![0xAA; payload.len()];
                unpacker.unpack_into(packed.form, shape, &packed.bytes, &mut out).unwrap();
                assert!(out == payload, "{codec:?} {planes:?}");
                let own = unpack(packed.form, shape, &packed.bytes, &Limits::default()).unwrap();
                assert!(own == payload, "{codec:?} {planes:?} into memory of its own");
            }
        }
    }

    #[test]
    fn bytes_that_do_not_become_smaller_are_stored() {
        let mut state = 1_u64;
        let noise: Vec<u8> = std::iter::repeat_with(|| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 56) as u8
        })
        .take(4096)
        .collect();
        for codec in ByteCodec::ALL {
            let mut packer = Packer::new(PackOptions { codec, ..Default::default() }).unwrap();
            let packed = packer.pack(&noise, Shape::new(512, 8)).unwrap();
            assert_eq!((packed.form, packed.bytes == noise), (Form::STORED, true), "{codec:?}");
        }
    }

    #[test]
    fn a_payload_above_the_limit_is_refused_before_memory_is_taken() {
        let shape = Shape::new(usize::MAX / 8, 8);
        let limits = Limits { decoded_bytes: 1 << 20 };
        let refused = unpack(Form::STORED, shape, &[], &limits);
        assert!(matches!(refused, Err(UnpackError::TooLarge { limit: 1_048_576, .. })), "{refused:?}");
    }

    #[test]
    fn packed_bytes_of_another_length_are_refused_by_every_codec() {
        let shape = Shape::new(1000, 4);
        let payload = payload(shape);
        for codec in ByteCodec::ALL {
            let options = PackOptions { codec, planes: Some(Planes::AsIs), ..Default::default() };
            let packed = Packer::new(options).unwrap().pack(&payload, shape).unwrap();
            for other in [Shape::new(999, 4), Shape::new(1001, 4)] {
                let refused = unpack(packed.form, other, &packed.bytes, &Limits::default());
                assert!(refused.is_err(), "{codec:?} into {other:?}");
            }
            let cut = unpack(packed.form, shape, &packed.bytes[..packed.bytes.len() - 1], &Limits::default());
            assert!(cut.is_err(), "{codec:?} cut by a byte");
        }
    }
}
