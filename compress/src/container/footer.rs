//! The end of a series file: the chunk index, the times of the steps, and the trailer that leads to them.

use super::codec::StepCodec;
use super::fields::{Fields, crc};
use super::header::HEADER_BYTES;
use super::read::ReadError;
use crate::lossless::{ByteCodec, Form, Planes};

/// Bytes of the trailer, and of it before its own checksum.
pub(super) const TRAILER_BYTES: usize = 64;
const CHECKED_BYTES: usize = 52;

/// The last 8 bytes of every series file.
const END_MARK: [u8; 8] = *b"OSTEND\r\n";

/// Bytes that a chunk and a step take in the footer.
const CHUNK_BYTES: usize = 16;
const STEP_BYTES: u64 = 8;

/// What a writer states at the end about what was lost.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Figures {
    /// The largest absolute error of a value, in the header's unit; finite, ≥ 0. None if it was not measured.
    pub largest_error: Option<f64>,
    /// Peak signal-to-noise ratio in dB; infinite where nothing was lost. None if it was not measured.
    pub psnr_db: Option<f64>,
}

impl Figures {
    /// Whether the figures can be.
    pub(super) fn are_valid(&self) -> bool {
        self.largest_error.is_none_or(|error| error.is_finite() && error >= 0.0)
            && self.psnr_db.is_none_or(|psnr| !psnr.is_nan() && psnr != f64::NEG_INFINITY)
    }
}

/// What the index says of a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Entry {
    /// Where it begins in the file. Not written: it follows from the lengths.
    pub(super) offset: u64,
    pub(super) len: u64,
    pub(super) checksum: u32,
    pub(super) form: Form,
    pub(super) steps: u8,
}

impl Entry {
    pub(super) fn to_bytes(self) -> [u8; CHUNK_BYTES] {
        let mut bytes = [0; CHUNK_BYTES];
        let (len, rest) = bytes.split_at_mut(8);
        let (checksum, rest) = rest.split_at_mut(4);
        len.copy_from_slice(&self.len.to_le_bytes());
        checksum.copy_from_slice(&self.checksum.to_le_bytes());
        rest.copy_from_slice(&[self.form.codec.id(), self.form.planes.id(), self.steps, 0]);
        bytes
    }
}

/// Index and times.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Footer {
    pub(super) entries: Vec<Entry>,
    pub(super) times_secs: Vec<f64>,
}

/// The trailer's statements that a reader goes on from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Trailer {
    pub(super) footer_offset: u64,
    pub(super) footer_len: u64,
    chunks: u32,
    steps: u32,
    footer_checksum: u32,
    pub(super) figures: Figures,
}

/// The trailer's bytes for such a footer, which begins at `footer_offset`.
pub(super) fn trailer(
    footer: &[u8],
    footer_offset: u64,
    chunks: u32,
    steps: u32,
    figures: &Figures,
) -> Vec<u8> {
    let file_len = footer_offset.saturating_add(footer.len() as u64).saturating_add(TRAILER_BYTES as u64);
    let mut bytes = Vec::with_capacity(TRAILER_BYTES);
    bytes.extend(footer_offset.to_le_bytes());
    bytes.extend((footer.len() as u64).to_le_bytes());
    bytes.extend(chunks.to_le_bytes());
    bytes.extend(steps.to_le_bytes());
    bytes.extend(figures.largest_error.unwrap_or(f64::NAN).to_le_bytes());
    bytes.extend(figures.psnr_db.unwrap_or(f64::NAN).to_le_bytes());
    bytes.extend(file_len.to_le_bytes());
    bytes.extend(crc(footer).to_le_bytes());
    let checksum = crc(&bytes);
    bytes.extend(checksum.to_le_bytes());
    bytes.extend(END_MARK);
    bytes
}

impl Trailer {
    /// Checks and reads the last bytes of a file of `file_len` bytes.
    pub(super) fn from_bytes(bytes: &[u8; TRAILER_BYTES], file_len: u64) -> Result<Self, ReadError> {
        if !bytes.ends_with(&END_MARK) {
            return Err(ReadError::Unfinished { file_len });
        }
        let mut fields = Fields(bytes);
        let (footer_offset, footer_len) = (fields.u64(), fields.u64());
        let (chunks, steps) = (fields.u32(), fields.u32());
        let stated = |number: f64| (!number.is_nan()).then_some(number);
        let figures = Figures { largest_error: stated(fields.f64()), psnr_db: stated(fields.f64()) };
        let stated_len = fields.u64();
        let footer_checksum = fields.u32();
        let (checked, _) = bytes.split_at(CHECKED_BYTES);
        if fields.u32() != crc(checked) {
            return Err(ReadError::Checksum { part: "trailer" });
        }
        if stated_len != file_len {
            return Err(ReadError::FileLength { stated: stated_len, found: file_len });
        }
        let invalid = |field| ReadError::Invalid { part: "trailer", field };
        let index_len = u64::from(chunks).saturating_mul(CHUNK_BYTES as u64);
        if footer_len != index_len.saturating_add(u64::from(steps).saturating_mul(STEP_BYTES)) {
            return Err(invalid("footer length"));
        }
        let end = footer_offset.saturating_add(footer_len).saturating_add(TRAILER_BYTES as u64);
        if end != file_len || footer_offset < HEADER_BYTES as u64 {
            return Err(invalid("footer offset"));
        }
        if chunks == 0 || steps == 0 {
            return Err(invalid("number of chunks or steps"));
        }
        if !figures.are_valid() {
            return Err(invalid("largest error or PSNR"));
        }
        Ok(Self { footer_offset, footer_len, chunks, steps, footer_checksum, figures })
    }
}

impl Footer {
    /// Checks and reads the footer that `trailer` leads to, of chunks of `codec` with `payload_bytes` bytes.
    pub(super) fn from_bytes(
        bytes: &[u8],
        trailer: &Trailer,
        codec: StepCodec,
        payload_bytes: u64,
    ) -> Result<Self, ReadError> {
        if crc(bytes) != trailer.footer_checksum {
            return Err(ReadError::Checksum { part: "footer" });
        }
        let no_memory = |_| ReadError::OutOfMemory { bytes: trailer.footer_len };
        let (mut entries, mut times_secs) = (Vec::new(), Vec::new());
        entries.try_reserve_exact(trailer.chunks as usize).map_err(no_memory)?;
        times_secs.try_reserve_exact(trailer.steps as usize).map_err(no_memory)?;

        let mut fields = Fields(bytes);
        let mut offset = HEADER_BYTES as u64;
        let mut steps = 0_u64;
        for chunk in 0..trailer.chunks {
            let fault = |fault| ReadError::Index { chunk, fault };
            let (len, checksum) = (fields.u64(), fields.u32());
            let [byte_codec, planes, steps_here, reserved] = fields.bytes();
            let form = Form {
                codec: ByteCodec::from_id(byte_codec).ok_or(fault("byte codec"))?,
                planes: Planes::from_id(planes).ok_or(fault("planes"))?,
            };
            if len == 0 || len > payload_bytes {
                return Err(fault("length"));
            }
            let last = chunk.saturating_add(1) == trailer.chunks;
            let full = codec.steps_per_chunk();
            if steps_here > full || steps_here == 0 || (steps_here < full && !last) {
                return Err(fault("number of steps"));
            }
            if reserved != 0 {
                return Err(fault("reserved byte"));
            }
            entries.push(Entry { offset, len, checksum, form, steps: steps_here });
            offset = offset.saturating_add(len);
            steps = steps.saturating_add(steps_here.into());
        }
        if offset != trailer.footer_offset {
            return Err(ReadError::Invalid { part: "footer", field: "sum of the chunks' lengths" });
        }
        if steps != u64::from(trailer.steps) {
            return Err(ReadError::Invalid { part: "footer", field: "sum of the chunks' steps" });
        }
        let mut before = f64::NEG_INFINITY;
        for _ in 0..trailer.steps {
            let time = fields.f64();
            if !time.is_finite() || time <= before {
                return Err(ReadError::Invalid { part: "footer", field: "times of the steps" });
            }
            times_secs.push(time);
            before = time;
        }
        Ok(Self { entries, times_secs })
    }
}
