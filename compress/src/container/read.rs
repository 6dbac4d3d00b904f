//! Opens and checks a series, and hands out its chunks.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use thiserror::Error;

use super::VERSION;
use super::codec::StepCodec;
use super::fields::crc;
use super::footer::{Entry, Figures, Footer, TRAILER_BYTES, Trailer};
use super::header::{HEADER_BYTES, Header};
use crate::lossless::{Form, Shape, UnpackError, Unpacker};
use crate::{ExtentError, Limits};

/// Payloads and footers that a reader may have in memory at once: see the format page, "Limits".
const PAYLOADS: u64 = 3;
const FOOTERS: u64 = 4;

/// Why a series cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file does not begin as a series does.
    #[error("this is not a series file: its first 8 bytes are not the identifier of one")]
    Identifier,
    /// The file is of another version.
    #[error(
        "the series file is of version {found}, and this program reads version {VERSION}: update the program, or copy the file again if it was made by this one"
    )]
    Version {
        /// The version found.
        found: u32,
    },
    /// The file is shorter than any series.
    #[error(
        "the series file is cut off after {file_len} bytes, before its header and trailer: copy it again from its source"
    )]
    Short {
        /// Bytes of the file.
        file_len: u64,
    },
    /// The file does not end as a series does.
    #[error(
        "the series file was cut off, or never finished: it ends after {file_len} bytes without its end mark"
    )]
    Unfinished {
        /// Bytes of the file.
        file_len: u64,
    },
    /// The file is longer or shorter than it was when it was written.
    #[error(
        "the series file has {found} bytes, but had {stated} when it was written: copy it again from its source"
    )]
    FileLength {
        /// Bytes that it was written with.
        stated: u64,
        /// Bytes that it has.
        found: u64,
    },
    /// The checksum of a part other than a chunk differs.
    #[error("the checksum of the {part} differs: the series file is damaged, copy it again from its source")]
    Checksum {
        /// The part.
        part: &'static str,
    },
    /// The checksum of a chunk differs.
    #[error(
        "the checksum of chunk {chunk} differs: its {len} bytes from byte {offset} on are damaged, copy the series file again from its source"
    )]
    ChunkChecksum {
        /// The chunk, counted from 0.
        chunk: u32,
        /// Where it begins in the file.
        offset: u64,
        /// Its packed bytes.
        len: u64,
    },
    /// A field has a value that the format forbids, although its checksum is right.
    #[error("the {field} in the {part} cannot be: the series file was written by a faulty program")]
    Invalid {
        /// The part of the file.
        part: &'static str,
        /// The field in it.
        field: &'static str,
    },
    /// The entry of a chunk in the index has such a value.
    #[error(
        "the {fault} of chunk {chunk} in the index cannot be: the series file was written by a faulty program"
    )]
    Index {
        /// The chunk, counted from 0.
        chunk: u32,
        /// The field in its entry.
        fault: &'static str,
    },
    /// The volume's size cannot be.
    #[error("the size of the volume that the series file states cannot be")]
    Extent(#[source] ExtentError),
    /// The step is not in the series.
    #[error("step {step} was asked of a series of {steps}: count from 0")]
    Step {
        /// The step asked for.
        step: u32,
        /// Steps of the series.
        steps: u32,
    },
    /// The chunk is not in the series.
    #[error("chunk {chunk} was asked of a series of {chunks}: count from 0")]
    Chunk {
        /// The chunk asked for.
        chunk: u32,
        /// Chunks of the series.
        chunks: u32,
    },
    /// Reading takes more memory than the limit.
    #[error(
        "reading the series takes {bytes} bytes of memory, more than the limit of {limit}: raise the limit if the file is trusted"
    )]
    TooLarge {
        /// Bytes needed.
        bytes: u64,
        /// [`Limits::decoded_bytes`].
        limit: u64,
    },
    /// There is no memory.
    #[error("no memory for {bytes} bytes of the series: close others first")]
    OutOfMemory {
        /// Bytes needed.
        bytes: u64,
    },
    /// The packed bytes of a chunk do not unpack, although their checksum is right.
    #[error("chunk {chunk} does not unpack: the series file was written by a faulty program")]
    Unpack {
        /// The chunk, counted from 0.
        chunk: u32,
        /// Why.
        #[source]
        source: UnpackError,
    },
    /// The source cannot be read.
    #[error("the series file cannot be read")]
    Input(#[from] io::Error),
}

/// An open series. Header and index are in memory and checked; chunks are read when they are asked for.
#[derive(Debug)]
pub struct Reader<R> {
    source: R,
    header: Header,
    shape: Shape,
    footer: Footer,
    figures: Figures,
}

impl Reader<File> {
    /// Opens the series at `path`. `limits` bounds what this reader and the buffers that it fills take together.
    ///
    /// # Errors
    /// Those of [`Reader::new`].
    pub fn open(path: &Path, limits: &Limits) -> Result<Self, ReadError> {
        Self::new(File::open(path)?, limits)
    }
}

impl<R: Read + Seek> Reader<R> {
    /// Opens the series that is all of `source`.
    ///
    /// # Errors
    /// [`ReadError::Identifier`] and [`ReadError::Version`] for what is no series known here; [`ReadError::Short`],
    /// [`ReadError::Unfinished`], [`ReadError::FileLength`] and [`ReadError::Checksum`] for one that was cut off or
    /// damaged; [`ReadError::Invalid`], [`ReadError::Index`] and [`ReadError::Extent`] for one whose fields cannot be;
    /// [`ReadError::TooLarge`] before memory above the limit is taken; [`ReadError::OutOfMemory`];
    /// [`ReadError::Input`].
    pub fn new(mut source: R, limits: &Limits) -> Result<Self, ReadError> {
        let file_len = source.seek(SeekFrom::End(0))?;
        let mut head = [0; HEADER_BYTES];
        let known = usize::try_from(file_len).unwrap_or(usize::MAX).min(HEADER_BYTES);
        source.seek(SeekFrom::Start(0))?;
        source.read_exact(head.get_mut(..known).unwrap_or_default())?;
        if file_len < (HEADER_BYTES as u64).saturating_add(TRAILER_BYTES as u64) {
            // A short file of another kind is not called cut off.
            return Err(match Header::from_bytes(&head) {
                Err(ReadError::Identifier) => ReadError::Identifier,
                _ => ReadError::Short { file_len },
            });
        }
        let header = Header::from_bytes(&head)?;
        let mut tail = [0; TRAILER_BYTES];
        source.seek(SeekFrom::Start(file_len.saturating_sub(TRAILER_BYTES as u64)))?;
        source.read_exact(&mut tail)?;
        let trailer = Trailer::from_bytes(&tail, file_len)?;

        let shape = header.codec.shape(header.extent);
        let payload_bytes = shape.bytes() as u64;
        let footers = trailer.footer_len.saturating_mul(FOOTERS);
        let needed = payload_bytes.saturating_mul(PAYLOADS).saturating_add(footers);
        if needed > limits.decoded_bytes {
            return Err(ReadError::TooLarge { bytes: needed, limit: limits.decoded_bytes });
        }
        let mut bytes = Vec::new();
        read_range(&mut source, trailer.footer_offset, trailer.footer_len, &mut bytes)?;
        let footer = Footer::from_bytes(&bytes, &trailer, header.codec, payload_bytes)?;
        Ok(Self { source, header, shape, footer, figures: trailer.figures })
    }

    /// What the series is.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// What the chunks decode to.
    pub fn codec(&self) -> StepCodec {
        self.header.codec
    }

    /// What the writer stated about losses.
    pub fn figures(&self) -> Figures {
        self.figures
    }

    /// Steps of the series, at least 1.
    pub fn steps(&self) -> u32 {
        count(self.footer.times_secs.len())
    }

    /// The time of each step, in s: finite and rising.
    pub fn times_secs(&self) -> &[f64] {
        &self.footer.times_secs
    }

    /// Chunks of the series, at least 1.
    pub fn chunks(&self) -> u32 {
        count(self.footer.entries.len())
    }

    /// The elements of every chunk's payload; [`Shape::bytes`] is its length.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// The chunk that holds `step`, and which of its steps that is.
    ///
    /// # Errors
    /// [`ReadError::Step`] if the series has no such step.
    pub fn chunk_of(&self, step: u32) -> Result<(u32, u8), ReadError> {
        let steps = self.steps();
        let full = self.header.codec.steps_per_chunk();
        match (step.checked_div(full.into()), step.checked_rem(full.into()).map(u8::try_from)) {
            (Some(chunk), Some(Ok(within))) if step < steps => Ok((chunk, within)),
            _ => Err(ReadError::Step { step, steps }),
        }
    }

    /// The steps that `chunk` holds.
    ///
    /// # Errors
    /// [`ReadError::Chunk`] if the series has no such chunk.
    pub fn steps_of(&self, chunk: u32) -> Result<Range<u32>, ReadError> {
        let entry = self.entry(chunk)?;
        let start = chunk.saturating_mul(self.header.codec.steps_per_chunk().into());
        Ok(start..start.saturating_add(entry.steps.into()))
    }

    /// How `chunk` is packed.
    ///
    /// # Errors
    /// [`ReadError::Chunk`] if the series has no such chunk.
    pub fn form(&self, chunk: u32) -> Result<Form, ReadError> {
        Ok(self.entry(chunk)?.form)
    }

    /// The bytes that `chunk` takes in the file.
    ///
    /// # Errors
    /// [`ReadError::Chunk`] if the series has no such chunk.
    pub fn packed_len(&self, chunk: u32) -> Result<u64, ReadError> {
        Ok(self.entry(chunk)?.len)
    }

    /// Reads the packed bytes of `chunk` into `packed`, whose memory is used again, and checks them. Unpack them as
    /// [`Reader::form`] and [`Reader::shape`] say.
    ///
    /// # Errors
    /// [`ReadError::Chunk`] if the series has no such chunk; [`ReadError::ChunkChecksum`] if its bytes are damaged;
    /// [`ReadError::OutOfMemory`]; [`ReadError::Input`].
    pub fn read_packed(&mut self, chunk: u32, packed: &mut Vec<u8>) -> Result<(), ReadError> {
        let Entry { offset, len, checksum, .. } = self.entry(chunk)?;
        read_range(&mut self.source, offset, len, packed)?;
        if crc(packed) != checksum {
            return Err(ReadError::ChunkChecksum { chunk, offset, len });
        }
        Ok(())
    }

    /// Reads and unpacks `chunk`: its payload.
    ///
    /// # Errors
    /// Those of [`Reader::read_packed`]; [`ReadError::Unpack`].
    pub fn read_chunk(&mut self, chunk: u32) -> Result<Vec<u8>, ReadError> {
        let mut payload = Vec::new();
        resize(&mut payload, self.shape.bytes() as u64)?;
        self.chunk_into(chunk, &mut Vec::new(), &mut Unpacker::new(), &mut payload)?;
        Ok(payload)
    }

    /// Reads, checks and unpacks every chunk.
    ///
    /// # Errors
    /// The first fault found: those of [`Reader::read_packed`], and [`ReadError::Unpack`].
    pub fn verify(&mut self) -> Result<(), ReadError> {
        let (mut packed, mut payload, mut unpacker) = (Vec::new(), Vec::new(), Unpacker::new());
        resize(&mut payload, self.shape.bytes() as u64)?;
        (0..self.chunks())
            .try_for_each(|chunk| self.chunk_into(chunk, &mut packed, &mut unpacker, &mut payload))
    }

    /// Reads and unpacks `chunk` into `payload`.
    fn chunk_into(
        &mut self,
        chunk: u32,
        packed: &mut Vec<u8>,
        unpacker: &mut Unpacker,
        payload: &mut [u8],
    ) -> Result<(), ReadError> {
        self.read_packed(chunk, packed)?;
        let unpacked = unpacker.unpack_into(self.form(chunk)?, self.shape, packed, payload);
        unpacked.map_err(|source| ReadError::Unpack { chunk, source })
    }

    fn entry(&self, chunk: u32) -> Result<Entry, ReadError> {
        let entry = usize::try_from(chunk).ok().and_then(|chunk| self.footer.entries.get(chunk));
        entry.copied().ok_or(ReadError::Chunk { chunk, chunks: self.chunks() })
    }
}

/// A count that the trailer holds in 32 bits.
fn count(len: usize) -> u32 {
    u32::try_from(len).unwrap_or(u32::MAX)
}

/// Gives `bytes` the length `len`. What is in it then is of no meaning.
fn resize(bytes: &mut Vec<u8>, len: u64) -> Result<(), ReadError> {
    let no_memory = ReadError::OutOfMemory { bytes: len };
    let Ok(len) = usize::try_from(len) else { return Err(no_memory) };
    if bytes.try_reserve_exact(len.saturating_sub(bytes.len())).is_err() {
        return Err(no_memory);
    }
    bytes.resize(len, 0);
    Ok(())
}

/// Reads `len` bytes from `offset` on into `bytes`, which has that length afterwards.
fn read_range(
    source: &mut (impl Read + Seek),
    offset: u64,
    len: u64,
    bytes: &mut Vec<u8>,
) -> Result<(), ReadError> {
    resize(bytes, len)?;
    source.seek(SeekFrom::Start(offset))?;
    source.read_exact(bytes)?;
    Ok(())
}
