//! Packs payloads.

use std::fmt;
use std::io;

use thiserror::Error;
use zstd::bulk::Compressor;
use zstd::zstd_safe;

use super::{ByteCodec, Form, Planes, Shape, lzo};

/// How payloads are packed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PackOptions {
    /// The codec of the bytes.
    pub codec: ByteCodec,
    /// The planes to separate; none tries all of them and keeps the smallest result.
    pub planes: Option<Planes>,
    /// The level of zstd, 1 to 22; the other codecs have none.
    pub zstd_level: i32,
    /// The part of a payload, 0 to 1, that packing must save; otherwise it is stored.
    pub least_saving: f64,
}

impl Default for PackOptions {
    /// zstd at level 3, the best planes, stored where less than 3 % is saved.
    fn default() -> Self {
        Self { codec: ByteCodec::Zstd, planes: None, zstd_level: 3, least_saving: 0.03 }
    }
}

/// A payload as it was packed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Packed {
    /// How to unpack it.
    pub form: Form,
    /// The packed bytes: never more than the payload has.
    pub bytes: Vec<u8>,
}

/// Why a payload cannot be packed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PackError {
    /// The payload is not of the shape.
    #[error("a payload of {found} bytes was given for a shape of {expected}")]
    Length {
        /// Bytes of the shape.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
    /// The level is none of zstd's.
    #[error("zstd has no level {level}: choose one from 1 to 22")]
    Level {
        /// The level asked for.
        level: i32,
    },
    /// The codec failed.
    #[error("the payload cannot be packed with zstd")]
    Zstd(#[source] io::Error),
    /// There is no memory for the packed bytes.
    #[error("no memory for {bytes} bytes to pack a payload into: close others first")]
    OutOfMemory {
        /// Bytes needed.
        bytes: usize,
    },
}

/// Packs payloads one after the other, and keeps its working memory between them.
///
/// The same payload gives the same bytes. Its working memory is at most about four payloads.
pub struct Packer {
    options: PackOptions,
    lzo: lzo::Compressor,
    zstd: Compressor<'static>,
    planar: Vec<u8>,
    trial: Vec<u8>,
}

impl fmt::Debug for Packer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Packer").field("options", &self.options).finish_non_exhaustive()
    }
}

impl Packer {
    /// A packer.
    ///
    /// # Errors
    /// [`PackError::Level`] if zstd has no such level; [`PackError::Zstd`] if it cannot be set up.
    pub fn new(options: PackOptions) -> Result<Self, PackError> {
        if !(1..=22).contains(&options.zstd_level) {
            return Err(PackError::Level { level: options.zstd_level });
        }
        let zstd = Compressor::new(options.zstd_level).map_err(PackError::Zstd)?;
        Ok(Self { options, lzo: lzo::Compressor::new(), zstd, planar: Vec::new(), trial: Vec::new() })
    }

    /// Packs one payload of [`Shape::bytes`] bytes.
    ///
    /// # Errors
    /// [`PackError::Length`] if it has another length; [`PackError::OutOfMemory`]; [`PackError::Zstd`] if that fails.
    pub fn pack(&mut self, payload: &[u8], shape: Shape) -> Result<Packed, PackError> {
        if payload.len() != shape.bytes() {
            return Err(PackError::Length { expected: shape.bytes(), found: payload.len() });
        }
        let most = payload.len() as f64 * (1.0 - self.options.least_saving);
        let mut best: Option<Packed> = None;
        if self.options.codec != ByteCodec::Store {
            for planes in Planes::ALL {
                let wanted = self.options.planes.is_none_or(|wanted| {
                    if wanted.leaves(shape) { planes == Planes::AsIs } else { planes == wanted }
                });
                if !wanted || (planes != Planes::AsIs && planes.leaves(shape)) {
                    continue;
                }
                self.pack_planes(payload, shape, planes)?;
                if best.as_ref().is_none_or(|best| self.trial.len() < best.bytes.len()) {
                    let form = Form { codec: self.options.codec, planes };
                    best = Some(Packed { form, bytes: copy(&self.trial)? });
                }
            }
        }
        match best.filter(|best| best.bytes.len() as f64 <= most) {
            Some(best) if best.bytes.len() <= payload.len() => Ok(best),
            _ => Ok(Packed { form: Form::STORED, bytes: copy(payload)? }),
        }
    }

    /// Packs one choice of planes into `trial`.
    fn pack_planes(&mut self, payload: &[u8], shape: Shape, planes: Planes) -> Result<(), PackError> {
        let planar = if planes == Planes::AsIs {
            payload
        } else {
            self.planar.clear();
            reserve(&mut self.planar, payload.len())?;
            self.planar.resize(payload.len(), 0);
            planes.separate(shape, payload, &mut self.planar);
            &self.planar
        };
        let trial = &mut self.trial;
        trial.clear();
        match self.options.codec {
            ByteCodec::Store => {
                reserve(trial, planar.len())?;
                trial.extend_from_slice(planar);
            }
            ByteCodec::Lzo => {
                reserve(trial, lzo::worst_len(planar.len()))?;
                self.lzo.compress(planar, trial);
            }
            ByteCodec::Lz4 => {
                let worst = lz4_flex::block::get_maximum_output_size(planar.len());
                reserve(trial, worst)?;
                trial.resize(worst, 0);
                // Only a buffer that is too small is an error; this one holds the worst case.
                let len = lz4_flex::block::compress_into(planar, trial).unwrap_or(worst);
                trial.truncate(len);
            }
            ByteCodec::Zstd => {
                reserve(trial, zstd_safe::compress_bound(planar.len()))?;
                self.zstd.compress_to_buffer(planar, trial).map_err(PackError::Zstd)?;
            }
        }
        Ok(())
    }
}

/// Makes room for `bytes` in an empty vector.
fn reserve(buffer: &mut Vec<u8>, bytes: usize) -> Result<(), PackError> {
    match buffer.try_reserve_exact(bytes) {
        Ok(()) => Ok(()),
        Err(_) => Err(PackError::OutOfMemory { bytes }),
    }
}

fn copy(bytes: &[u8]) -> Result<Vec<u8>, PackError> {
    let mut copy = Vec::new();
    reserve(&mut copy, bytes.len())?;
    copy.extend_from_slice(bytes);
    Ok(copy)
}
