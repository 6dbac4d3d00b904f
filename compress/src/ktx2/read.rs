//! Reads and checks a KTX2 file.
//!
//! Nothing in a file is believed: every offset and length is checked against the file's own length, every size
//! against the limits, before it is used.
#![warn(clippy::arithmetic_side_effects, clippy::cast_possible_truncation, clippy::indexing_slicing)]

use std::collections::BTreeMap;
use std::io;

use thiserror::Error;
use zstd::bulk::Decompressor;
use zstd::zstd_safe;

use super::{HEADER_BYTES, IDENTIFIER, LEVEL_BYTES, SCHEME_NONE, SCHEME_ZSTD, Texture, TextureFormat, dfd};
use crate::{Extent3, ExtentError, Limits};

/// Why a file cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file does not begin as a KTX2 file does.
    #[error("this is not a KTX2 file: its first 12 bytes are not the KTX2 identifier")]
    Identifier,
    /// A part reaches past the end of the file.
    #[error("the file is cut off: its {part} should end at byte {end}, but the file has {file_len}")]
    Truncated {
        /// The part.
        part: &'static str,
        /// Where it should end.
        end: u64,
        /// Bytes of the file.
        file_len: u64,
    },
    /// A field says something that is valid in KTX2, but is not a volume in one of the formats known here.
    #[error(
        "{field} is {value}, which is not supported: convert the file to a 3D texture of BC1, BC3, BC4, BC7, R8, R16 or RGBA8, plain or with zstd"
    )]
    Unsupported {
        /// The header's field.
        field: &'static str,
        /// Its value.
        value: u64,
    },
    /// A field has a value that the standard forbids.
    #[error("{field} is {value}, which no valid KTX2 file says: the file is damaged")]
    Invalid {
        /// The field.
        field: &'static str,
        /// Its value.
        value: u64,
    },
    /// The volume's size cannot be.
    #[error("the size of the volume that the file states cannot be: the file is damaged")]
    Extent(#[source] ExtentError),
    /// The file would unpack to more than the limit.
    #[error(
        "the volume takes {bytes} bytes, more than the limit of {limit}: raise the limit if the file is trusted"
    )]
    TooLarge {
        /// Bytes of the volume.
        bytes: u64,
        /// [`Limits::decoded_bytes`].
        limit: u64,
    },
    /// The descriptor does not describe the format that the header names.
    #[error(
        "the data format descriptor does not describe {format:?}, which the header names: the file is damaged"
    )]
    Descriptor {
        /// The format of the header.
        format: TextureFormat,
    },
    /// An entry is not a key, a zero byte and a value.
    #[error("the entry at byte {offset} {fault}: the file is damaged")]
    Entry {
        /// Where it begins in the file.
        offset: u64,
        /// What is wrong with it.
        fault: &'static str,
    },
    /// The level has not the bytes that format and extent need.
    #[error("the level has {found} bytes, but its format and extent need {expected}: the file is damaged")]
    LevelLength {
        /// Bytes that format and extent need.
        expected: u64,
        /// Bytes that the file says or its data unpack to.
        found: u64,
    },
    /// The packed data do not unpack.
    #[error("the data do not unpack with zstd: the file is damaged")]
    Zstd(#[source] io::Error),
    /// There is no memory for the volume.
    #[error("no memory for {bytes} bytes of the volume: close others first")]
    OutOfMemory {
        /// Bytes needed.
        bytes: u64,
    },
}

/// Reads the volume of a KTX2 file; of several levels, the first.
///
/// # Errors
/// A [`ReadError`] that names the fault: [`ReadError::Identifier`] and [`ReadError::Truncated`] for what is no
/// whole KTX2 file, [`ReadError::Unsupported`] for a KTX2 file of another kind, [`ReadError::TooLarge`] and
/// [`ReadError::OutOfMemory`] for one too large, the others for a damaged one.
///
/// Source: KTX2, sections "Field Descriptions" and "Index".
pub fn read(file: &[u8], limits: &Limits) -> Result<Texture, ReadError> {
    let header = Header::read(file)?;
    let expected = header.format.data_len(header.extent);
    if expected as u64 > limits.decoded_bytes {
        return Err(ReadError::TooLarge { bytes: expected as u64, limit: limits.decoded_bytes });
    }
    let [offset, len] = header.descriptor.map(u64::from);
    if !dfd::says(part(file, "data format descriptor", offset, len)?, header.format) {
        return Err(ReadError::Descriptor { format: header.format });
    }
    let [offset, len] = header.entries.map(u64::from);
    let entries = entries(part(file, "key/value data", offset, len)?, offset)?;

    let [offset, len, unpacked] = header.level;
    if unpacked != expected as u64 {
        return Err(ReadError::LevelLength { expected: expected as u64, found: unpacked });
    }
    let level = part(file, "level", offset, len)?;
    let data = if header.zstd { unpack(level, expected)? } else { copy(level, expected)? };
    Ok(Texture { format: header.format, extent: header.extent, data, entries })
}

/// The header's fields as far as they are used.
struct Header {
    format: TextureFormat,
    extent: Extent3,
    zstd: bool,
    /// Offset and length.
    descriptor: [u32; 2],
    entries: [u32; 2],
    /// Offset, length, and length when unpacked, of the first level.
    level: [u64; 3],
}

impl Header {
    /// Reads and checks the first bytes of a file.
    fn read(file: &[u8]) -> Result<Self, ReadError> {
        if !file.starts_with(&IDENTIFIER) {
            return Err(ReadError::Identifier);
        }
        let head = part(file, "header", 0, HEADER_BYTES as u64)?;
        let mut words = head.get(IDENTIFIER.len()..).unwrap_or_default().as_chunks::<4>().0.iter();
        let mut word = || words.next().map_or(0, |bytes| u32::from_le_bytes(*bytes));

        let vk_format = word();
        let format = TextureFormat::ALL.into_iter().find(|format| format.vk_format() == vk_format);
        let format = format.ok_or(unsupported("vkFormat", vk_format))?;
        let type_size = word();
        if type_size != format.type_size() {
            return Err(invalid("typeSize", type_size));
        }
        let sizes = [word(), word(), word()];
        // A texture of fewer dimensions is valid, but no volume.
        match sizes {
            [0, ..] => return Err(invalid("pixelWidth", 0)),
            [_, 0, _] => return Err(unsupported("pixelHeight", 0)),
            [_, _, 0] => return Err(unsupported("pixelDepth", 0)),
            _ => {}
        }
        let extent = Extent3::new(sizes).map_err(ReadError::Extent)?;
        let layers = word();
        if layers != 0 {
            return Err(unsupported("layerCount", layers));
        }
        let faces = word();
        if faces != 1 {
            return Err(invalid("faceCount", faces));
        }
        let levels = word();
        let most_levels = sizes.into_iter().max().map_or(1, |size| size.ilog2()).saturating_add(1);
        let blocks = matches!(format, TextureFormat::Block(_));
        if levels > most_levels || (levels == 0 && blocks) {
            return Err(invalid("levelCount", levels));
        }
        let scheme = word();
        if ![SCHEME_NONE, SCHEME_ZSTD].contains(&scheme) {
            return Err(unsupported("supercompressionScheme", scheme));
        }
        let (descriptor, entries) = ([word(), word()], [word(), word()]);
        let global = [long(word(), word()), long(word(), word())];
        if let Some(&value) = global.iter().find(|&&value| value != 0) {
            return Err(ReadError::Invalid { field: "sgdByteOffset or sgdByteLength", value });
        }
        let index_len = u64::from(levels.max(1)).saturating_mul(LEVEL_BYTES as u64);
        let index = part(file, "level index", HEADER_BYTES as u64, index_len)?;
        let mut longs = index.as_chunks::<8>().0.iter();
        let level = [(); 3].map(|()| longs.next().map_or(0, |bytes| u64::from_le_bytes(*bytes)));
        Ok(Self { format, extent, zstd: scheme == SCHEME_ZSTD, descriptor, entries, level })
    }
}

/// The bytes `offset..offset + len` of the file.
fn part<'a>(file: &'a [u8], part: &'static str, offset: u64, len: u64) -> Result<&'a [u8], ReadError> {
    let end = offset.saturating_add(len);
    let range = usize::try_from(offset).ok().zip(usize::try_from(end).ok());
    range.and_then(|(offset, end)| file.get(offset..end)).ok_or(ReadError::Truncated {
        part,
        end,
        file_len: file.len() as u64,
    })
}

/// All entries; `at` is where they begin in the file.
fn entries(mut bytes: &[u8], mut at: u64) -> Result<BTreeMap<String, Vec<u8>>, ReadError> {
    let mut entries = BTreeMap::new();
    while !bytes.is_empty() {
        let fault = |fault| ReadError::Entry { offset: at, fault };
        let (len, rest) = bytes.split_first_chunk::<4>().ok_or(fault("has no room for its length"))?;
        let len = u32::from_le_bytes(*len) as usize;
        let entry = rest.get(..len).ok_or(fault("is longer than the entries together"))?;
        let end = entry.iter().position(|&byte| byte == 0).ok_or(fault("has no zero byte after its key"))?;
        let (key, value) = entry.split_at_checked(end).ok_or(fault("has no key"))?;
        let key = std::str::from_utf8(key).ok().filter(|key| !key.is_empty());
        let key = key.ok_or(fault("has a key that is empty or not UTF-8"))?;
        let value = value.get(1..).unwrap_or_default();
        if entries.insert(key.to_owned(), value.to_vec()).is_some() {
            return Err(fault("has a key that was there before"));
        }
        let padded = len.checked_next_multiple_of(4).ok_or(fault("is too long"))?;
        bytes = rest.get(padded..).ok_or(fault("is not padded to 4 bytes"))?;
        at = at.saturating_add(4).saturating_add(padded as u64);
    }
    Ok(entries)
}

/// The level as it is.
fn copy(level: &[u8], expected: usize) -> Result<Vec<u8>, ReadError> {
    if level.len() != expected {
        return Err(ReadError::LevelLength { expected: expected as u64, found: level.len() as u64 });
    }
    let mut data = reserved(expected)?;
    data.extend_from_slice(level);
    Ok(data)
}

/// The level unpacked. A level that says that it unpacks to more is refused before memory is taken.
fn unpack(level: &[u8], expected: usize) -> Result<Vec<u8>, ReadError> {
    let wrong = |found| ReadError::LevelLength { expected: expected as u64, found };
    if let Ok(Some(found)) = zstd_safe::get_frame_content_size(level)
        && found > expected as u64
    {
        return Err(wrong(found));
    }
    let mut data = reserved(expected)?;
    Decompressor::new()
        .and_then(|mut decompressor| decompressor.decompress_to_buffer(level, &mut data))
        .map_err(ReadError::Zstd)?;
    if data.len() == expected { Ok(data) } else { Err(wrong(data.len() as u64)) }
}

/// An empty vector with room for `len` bytes.
fn reserved(len: usize) -> Result<Vec<u8>, ReadError> {
    let mut bytes = Vec::new();
    match bytes.try_reserve_exact(len) {
        Ok(()) => Ok(bytes),
        Err(_) => Err(ReadError::OutOfMemory { bytes: len as u64 }),
    }
}

/// The low word comes first.
fn long(low: u32, high: u32) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

fn unsupported(field: &'static str, value: u32) -> ReadError {
    ReadError::Unsupported { field, value: value.into() }
}

fn invalid(field: &'static str, value: u32) -> ReadError {
    ReadError::Invalid { field, value: value.into() }
}
