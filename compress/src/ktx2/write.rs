//! Writes a KTX2 file.
//!
//! Order in the file: identifier, header, index, level index, descriptor, entries, level. The descriptor and the
//! entries are multiples of 4 bytes, so only the level may need padding, and only if it is not packed.

use std::borrow::Cow;
use std::io::{self, Write};

use thiserror::Error;
use zstd::bulk::Compressor;
use zstd::zstd_safe::CParameter;

use super::{
    HEADER_BYTES, IDENTIFIER, KEY_WRITER, LEVEL_BYTES, SCHEME_NONE, SCHEME_ZSTD, Supercompression, Texture,
    TextureFormat, dfd,
};

/// Why a texture cannot be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The data are not those of the format and extent.
    #[error("the texture has {found} bytes of data, but its format and extent need {expected}")]
    Length {
        /// Bytes that format and extent need.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
    /// A key is empty, contains a zero byte, or is reserved by the standard.
    #[error(
        "the entry {key:?} cannot be written: a key is not empty, has no zero byte, and begins with KTX only if the standard defines it"
    )]
    Key {
        /// The key.
        key: String,
    },
    /// The entries take more bytes than the file can say.
    #[error(
        "the entries take {bytes} bytes, but a KTX2 file holds at most 4 GiB of them: shorten their values"
    )]
    Entries {
        /// Bytes of all entries.
        bytes: u64,
    },
    /// The data could not be packed.
    #[error("zstd cannot pack the data at level {level}: choose a level from 1 to 22, or no packing")]
    Zstd {
        /// The level asked for.
        level: i32,
        /// What zstd says.
        #[source]
        source: io::Error,
    },
    /// The output took no more.
    #[error("the texture cannot be written to its output")]
    Output(#[from] io::Error),
}

/// Writes `texture` as a KTX2 file.
///
/// The same texture gives the same bytes. If it has no entry [`KEY_WRITER`], one is written that names this crate.
///
/// # Errors
/// [`WriteError::Length`] if the data do not fit format and extent; [`WriteError::Key`] and
/// [`WriteError::Entries`] for entries that a KTX2 file cannot hold; [`WriteError::Zstd`] if packing fails;
/// [`WriteError::Output`] if `output` does.
///
/// Source: KTX2, section "File Structure".
pub fn write(
    output: &mut impl Write,
    texture: &Texture,
    supercompression: Supercompression,
) -> Result<(), WriteError> {
    let Texture { format, extent, data, .. } = texture;
    let expected = format.data_len(*extent);
    if data.len() != expected {
        return Err(WriteError::Length { expected, found: data.len() });
    }
    let descriptor = dfd::descriptor(*format);
    let entries = entries(texture)?;
    let (scheme, level) = match supercompression {
        Supercompression::None => (SCHEME_NONE, Cow::Borrowed(data.as_slice())),
        Supercompression::Zstd { level } => (
            SCHEME_ZSTD,
            Cow::Owned(packed(data, level).map_err(|source| WriteError::Zstd { level, source })?),
        ),
    };

    let descriptor_at = HEADER_BYTES + LEVEL_BYTES;
    let entries_at = descriptor_at + descriptor.len();
    let entries_end = entries_at + entries.len();
    let level_at =
        if scheme == SCHEME_NONE { entries_end.next_multiple_of(alignment(*format)) } else { entries_end };

    let mut head = Vec::with_capacity(level_at);
    head.extend(IDENTIFIER);
    let [x, y, z] = extent.sizes();
    let (layers, faces, levels) = (0, 1, 1);
    for word in [format.vk_format(), format.type_size(), x, y, z, layers, faces, levels, scheme] {
        head.extend(word.to_le_bytes());
    }
    for word in [descriptor_at, descriptor.len(), entries_at, entries.len()] {
        head.extend((word as u32).to_le_bytes());
    }
    let global = [0, 0]; // no global data of the scheme
    for word in [global[0], global[1], level_at, level.len(), data.len()] {
        head.extend((word as u64).to_le_bytes());
    }
    head.extend(descriptor);
    head.extend(entries);
    head.resize(level_at, 0);
    output.write_all(&head)?;
    output.write_all(&level)?;
    Ok(())
}

/// All entries as the file holds them: length, key, zero byte, value, padding to 4 bytes; in order of their keys.
fn entries(texture: &Texture) -> Result<Vec<u8>, WriteError> {
    let mut all = texture.entries.clone();
    all.entry(KEY_WRITER.to_owned()).or_insert_with(|| {
        concat!("osteotome compress ", env!("CARGO_PKG_VERSION"), "\0").as_bytes().to_vec()
    });
    let mut bytes = Vec::new();
    for (key, value) in &all {
        if key.is_empty() || key.contains('\0') || (is_reserved(key) && !is_defined(key)) {
            return Err(WriteError::Key { key: key.clone() });
        }
        let len = key.len() + 1 + value.len();
        let end = (bytes.len() + 4 + len).next_multiple_of(4);
        if u32::try_from(end).is_err() {
            return Err(WriteError::Entries { bytes: end as u64 });
        }
        bytes.extend((len as u32).to_le_bytes());
        bytes.extend(key.as_bytes());
        bytes.push(0);
        bytes.extend(value);
        bytes.resize(end, 0);
    }
    Ok(bytes)
}

/// Whether the standard keeps such keys to itself.
fn is_reserved(key: &str) -> bool {
    key.starts_with("KTX") || key.starts_with("ktx")
}

/// Whether the standard defines the key for a texture such as those written here.
fn is_defined(key: &str) -> bool {
    ["KTXorientation", "KTXswizzle", KEY_WRITER, "KTXwriterScParams"].contains(&key)
}

/// One Zstandard frame with its size and a checksum, so that a reader finds every damaged byte.
fn packed(data: &[u8], level: i32) -> io::Result<Vec<u8>> {
    if !(1..=22).contains(&level) {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, format!("{level} is not a level of zstd")));
    }
    let mut compressor = Compressor::new(level)?;
    compressor.set_parameter(CParameter::ChecksumFlag(true))?;
    compressor.set_parameter(CParameter::ContentSizeFlag(true))?;
    compressor.compress(data)
}

/// Where a level that is not packed may begin: at a multiple of the least common multiple of the element's bytes
/// and 4. All elements here are powers of two, so that is the larger of the two.
fn alignment(format: TextureFormat) -> usize {
    format.element_bytes().max(4)
}
