//! Writes a series in one pass.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;
use thiserror::Error;

use super::fields::crc;
use super::footer::{Entry, Figures, trailer};
use super::header::{HEADER_BYTES, Header};
use crate::lossless::{PackError, PackOptions, Packed, Packer, Shape};

/// Why a series cannot be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WriteError {
    /// A field of the header cannot be written.
    #[error("the {field} cannot be written: numbers are finite, and texts short and without zero bytes")]
    Header {
        /// The field.
        field: &'static str,
    },
    /// A payload cannot be packed.
    #[error("chunk {chunk} cannot be packed")]
    Pack {
        /// The chunk, counted from 0.
        chunk: u32,
        /// Why.
        #[source]
        source: PackError,
    },
    /// The packed bytes are none, or more than the payload.
    #[error(
        "chunk {chunk} was packed to {found} bytes, but it must be 1 to {most}: store what does not become smaller"
    )]
    Packed {
        /// The chunk, counted from 0.
        chunk: u32,
        /// Bytes given.
        found: usize,
        /// Bytes of the payload.
        most: usize,
    },
    /// A chunk has no steps, too many, or follows one that was not full.
    #[error("chunk {chunk} has {found} steps: give {full}, or 1 to {full} in the last chunk")]
    Steps {
        /// The chunk, counted from 0.
        chunk: u32,
        /// Steps given.
        found: usize,
        /// Steps of a full chunk.
        full: u8,
    },
    /// A time is not finite, or not later than the one before.
    #[error("the time of step {step} is {secs} s, but each must be finite and later than the one before")]
    Time {
        /// The step, counted from 0.
        step: u32,
        /// The time given, in s.
        secs: f64,
    },
    /// The figures at the end cannot be.
    #[error("the largest error or the PSNR is not a number that can be: {figures:?}")]
    Figures {
        /// The figures given.
        figures: Figures,
    },
    /// There are no steps.
    #[error("a series without steps cannot be written: push at least one chunk")]
    Empty,
    /// There are more chunks or steps than the file can count.
    #[error("a series file holds at most {} steps: write several files", u32::MAX)]
    TooMany,
    /// The output takes no more.
    #[error("the series cannot be written")]
    Output(#[from] io::Error),
    /// The file cannot be made, or not be put under its name.
    #[error("the series cannot be written to its file: is there room, and is the folder writable? {}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
}

/// Writes a series to any output, chunk by chunk. Its memory is that of one chunk's packing, and 24 bytes a step.
#[derive(Debug)]
pub struct Writer<W: Write> {
    output: W,
    shape: Shape,
    full: u8,
    packer: Packer,
    /// Index and times, as they will stand in the footer.
    index: Vec<u8>,
    times_secs: Vec<f64>,
    offset: u64,
    chunks: u32,
    steps: u32,
    /// Whether the last chunk had fewer steps than a full one.
    ended: bool,
}

impl<W: Write> Writer<W> {
    /// Begins a series: writes the header.
    ///
    /// `options.codec` is replaced by the header's [`byte_codec`](Header::byte_codec).
    ///
    /// # Errors
    /// [`WriteError::Header`] for a field that cannot be; [`WriteError::Pack`] for a level that zstd has not;
    /// [`WriteError::Output`].
    pub fn new(mut output: W, header: &Header, options: PackOptions) -> Result<Self, WriteError> {
        let options = PackOptions { codec: header.byte_codec, ..options };
        let packer = Packer::new(options).map_err(|source| WriteError::Pack { chunk: 0, source })?;
        output.write_all(&header.to_bytes()?)?;
        Ok(Self {
            output,
            shape: header.codec.shape(header.extent),
            full: header.codec.steps_per_chunk(),
            packer,
            index: Vec::new(),
            times_secs: Vec::new(),
            offset: HEADER_BYTES as u64,
            chunks: 0,
            steps: 0,
            ended: false,
        })
    }

    /// Packs and writes the next chunk. `payload` has the bytes of a full chunk, also where the chunk has fewer steps;
    /// `times_secs` is the time of each of its steps.
    ///
    /// # Errors
    /// [`WriteError::Steps`], [`WriteError::Time`] and [`WriteError::TooMany`] for steps that do not follow;
    /// [`WriteError::Pack`] for a payload of another length or without memory; [`WriteError::Output`].
    pub fn push(&mut self, payload: &[u8], times_secs: &[f64]) -> Result<(), WriteError> {
        let chunk = self.chunks;
        let packed = self.packer.pack(payload, self.shape);
        self.push_packed(&packed.map_err(|source| WriteError::Pack { chunk, source })?, times_secs)
    }

    /// Writes the next chunk, packed by a [`Packer`] of the caller: so that several threads can pack.
    ///
    /// # Errors
    /// Those of [`Writer::push`]; [`WriteError::Packed`] for no bytes, or more than the payload has.
    pub fn push_packed(&mut self, packed: &Packed, times_secs: &[f64]) -> Result<(), WriteError> {
        let chunk = self.chunks;
        let full = self.full;
        let steps = u8::try_from(times_secs.len()).ok().filter(|&steps| (1..=full).contains(&steps));
        let Some(steps) = steps.filter(|_| !self.ended) else {
            return Err(WriteError::Steps { chunk, found: times_secs.len(), full });
        };
        let mut before = self.times_secs.last().copied().unwrap_or(f64::NEG_INFINITY);
        for (&secs, step) in times_secs.iter().zip(self.steps..) {
            if !secs.is_finite() || secs <= before {
                return Err(WriteError::Time { step, secs });
            }
            before = secs;
        }
        let bytes = &packed.bytes;
        if bytes.is_empty() || bytes.len() > self.shape.bytes() {
            return Err(WriteError::Packed { chunk, found: bytes.len(), most: self.shape.bytes() });
        }
        let chunks = self.chunks.checked_add(1).ok_or(WriteError::TooMany)?;
        let all_steps = self.steps.checked_add(steps.into()).ok_or(WriteError::TooMany)?;

        self.output.write_all(bytes)?;
        let len = bytes.len() as u64;
        let entry = Entry { offset: self.offset, len, checksum: crc(bytes), form: packed.form, steps };
        self.index.extend(entry.to_bytes());
        self.times_secs.extend(times_secs);
        self.offset = self.offset.saturating_add(len);
        (self.chunks, self.steps, self.ended) = (chunks, all_steps, steps < full);
        Ok(())
    }

    /// Ends the series: writes index, times and trailer, and gives the output back, not flushed.
    ///
    /// # Errors
    /// [`WriteError::Empty`] without steps; [`WriteError::Figures`] for figures that cannot be;
    /// [`WriteError::Output`].
    pub fn finish(mut self, figures: Figures) -> Result<W, WriteError> {
        if self.steps == 0 {
            return Err(WriteError::Empty);
        }
        if !figures.are_valid() {
            return Err(WriteError::Figures { figures });
        }
        let mut footer = self.index;
        footer.extend(self.times_secs.iter().flat_map(|secs| secs.to_le_bytes()));
        let trailer = trailer(&footer, self.offset, self.chunks, self.steps, &figures);
        self.output.write_all(&footer)?;
        self.output.write_all(&trailer)?;
        Ok(self.output)
    }
}

/// Writes a series to a file that appears under its name only when it is whole.
///
/// The steps go to a temporary file in the same folder, which [`FileWriter::finish`] syncs and renames; a file that
/// stood under the name before is replaced then. Dropping the writer without `finish` leaves nothing behind.
#[derive(Debug)]
pub struct FileWriter {
    writer: Writer<BufWriter<NamedTempFile>>,
    path: PathBuf,
}

impl FileWriter {
    /// Begins a series that will stand at `path`.
    ///
    /// # Errors
    /// [`WriteError::File`] if no file can be made in the folder; else those of [`Writer::new`].
    pub fn create(path: &Path, header: &Header, options: PackOptions) -> Result<Self, WriteError> {
        let file =
            temporary(folder(path)).map_err(|source| WriteError::File { path: path.to_owned(), source })?;
        let writer = Writer::new(BufWriter::new(file), header, options)?;
        Ok(Self { writer, path: path.to_owned() })
    }

    /// Packs and writes the next chunk: see [`Writer::push`].
    ///
    /// # Errors
    /// Those of [`Writer::push`].
    pub fn push(&mut self, payload: &[u8], times_secs: &[f64]) -> Result<(), WriteError> {
        self.writer.push(payload, times_secs)
    }

    /// Writes the next chunk, packed: see [`Writer::push_packed`].
    ///
    /// # Errors
    /// Those of [`Writer::push_packed`].
    pub fn push_packed(&mut self, packed: &Packed, times_secs: &[f64]) -> Result<(), WriteError> {
        self.writer.push_packed(packed, times_secs)
    }

    /// Ends the series and puts it under its name. Returns the file's bytes.
    ///
    /// # Errors
    /// [`WriteError::File`] if the file cannot be synced or renamed; else those of [`Writer::finish`].
    pub fn finish(self, figures: Figures) -> Result<u64, WriteError> {
        let Self { writer, path } = self;
        let output = writer.finish(figures)?;
        match put(output, &path) {
            Ok(bytes) => Ok(bytes),
            Err(source) => Err(WriteError::File { path, source }),
        }
    }
}

/// The folder of a path; `.` for a name alone.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A temporary file in `folder` that others may read once it has its name, as far as the user's mask allows.
fn temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".writing-").suffix(".series");
    #[cfg(unix)]
    {
        use std::fs::Permissions;
        use std::os::unix::fs::PermissionsExt as _;
        builder.permissions(Permissions::from_mode(0o666)).tempfile_in(folder)
    }
    #[cfg(not(unix))]
    builder.tempfile_in(folder)
}

/// Syncs the file, renames it to `path`, and syncs the folder so that the name lasts too.
fn put(output: BufWriter<NamedTempFile>, path: &Path) -> io::Result<u64> {
    let file = output.into_inner().map_err(io::IntoInnerError::into_error)?;
    file.as_file().sync_all()?;
    let bytes = file.as_file().metadata()?.len();
    file.persist(path).map_err(|error| error.error)?;
    if cfg!(unix) {
        File::open(folder(path))?.sync_all()?;
    }
    Ok(bytes)
}
