//! BC1, BC3 and BC4: block textures that graphics hardware samples directly, here for volumes.
//!
//! **Order** is that of a *sliced* 3D texture, which Vulkan and WebGPU read: blocks of 4×4×1 voxels, block x
//! fastest, then block y, then z. A volume of any extent is covered; where a block reaches over the far edge in x
//! or y, the last voxel is repeated, which costs the encoder nothing and never bleeds another colour into the
//! edge. **Work** is gathered in units of 4×4×4 voxels as Doi does, four blocks one behind the other, since
//! neighbours in z are alike; rows of units are spread over threads, and the bytes are the same for any number of
//! threads.
//!
//! **Samples** are 4 bytes a voxel, R G B A, for [`BlockFormat::Bc1`] and [`BlockFormat::Bc3`], and 1 byte for
//! [`BlockFormat::Bc4`]; `[x, y, z]`, x fastest. BC1 is written in its opaque mode of four colours, alpha is not
//! kept; its decoder knows the other mode too, where index 3 is transparent black.
//!
//! **Rounding.** The standard gives the interpolated values as fractions; the decoders here round them to the
//! nearest 8-bit value once, at the end. Hardware may differ by 1 or 2.
//!
//! Parts: `block` gathers and scatters, `endpoints` holds the fits, `bc1`, `bc3`, `bc4` the bits of each format.
//!
//! Source: KDFS, chapters "S3TC Compressed Texture Image Formats" and "RGTC Compressed Texture Image Formats".

mod batch;
mod bc1;
mod bc3;
mod bc4;
mod bc7;
mod block;
mod colour;
mod endpoints;
mod rows;
mod scalar;

use thiserror::Error;

use crate::Extent3;
use crate::simd::Simd;

/// A block format. The set is closed: its members stand in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BlockFormat {
    /// Colour of 5:6:5 bits at two end points, 2-bit indices; opaque.
    Bc1,
    /// Colour as in BC1, alpha as in BC4.
    Bc3,
    /// One channel: two 8-bit end points, 3-bit indices; unsigned.
    Bc4,
    /// Colour and alpha together in one of eight modes, end points of up to 8 bits, indices of up to 4: the accurate
    /// tier for colour, of the same size as BC3.
    Bc7,
}

impl BlockFormat {
    /// Every format.
    pub const ALL: [Self; 4] = [Self::Bc1, Self::Bc3, Self::Bc4, Self::Bc7];

    /// The format's short name: `"bc3"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bc1 => "bc1",
            Self::Bc3 => "bc3",
            Self::Bc4 => "bc4",
            Self::Bc7 => "bc7",
        }
    }

    /// Bytes of one block of 4×4×1 voxels.
    pub fn block_bytes(self) -> usize {
        match self {
            Self::Bc1 | Self::Bc4 => 8,
            Self::Bc3 | Self::Bc7 => 16,
        }
    }

    /// Bits of a block for each of its 16 voxels.
    pub fn bits_per_voxel(self) -> usize {
        self.block_bytes() / 2
    }

    /// Bytes of one voxel on the uncompressed side: 4 for colour, 1 for a scalar.
    pub fn channels(self) -> usize {
        match self {
            Self::Bc1 | Self::Bc3 | Self::Bc7 => 4,
            Self::Bc4 => 1,
        }
    }

    /// Bytes of a volume of `extent` in this format: `block_bytes · ⌈x/4⌉ · ⌈y/4⌉ · z`.
    pub fn encoded_len(self, extent: Extent3) -> usize {
        extent.block_count() * self.block_bytes()
    }

    /// Bytes of the uncompressed samples of a volume of `extent`: `channels · x · y · z`.
    pub fn decoded_len(self, extent: Extent3) -> usize {
        extent.voxels() * self.channels()
    }
}

/// How the voxels of a BC3 block share in the choice of its colours.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ColourWeight {
    /// By their alpha: a voxel that is not seen costs the seen ones nothing. For straight (not premultiplied)
    /// colour. Voxels of alpha 0 keep the least weight that still defines their colour.
    #[default]
    Alpha,
    /// All alike: for colour that is premultiplied, and so weighted already.
    Equal,
}

/// How much an encoder tries.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Level {
    /// For a transfer function that is being changed: what costs little.
    Fast,
    /// For a volume that stays: all that is known to help.
    #[default]
    Best,
}

/// Choices of an encoder.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct EncodeOptions {
    /// How voxels share in the colours of a BC3 block; of no effect in BC1, which is opaque, and BC4.
    pub colour_weight: ColourWeight,
    /// How much the encoder tries.
    pub level: Level,
}

impl EncodeOptions {
    /// These options with another weight of colours.
    pub fn with_colour_weight(mut self, colour_weight: ColourWeight) -> Self {
        self.colour_weight = colour_weight;
        self
    }

    /// These options with another level.
    pub fn with_level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }
}

/// Why samples cannot be encoded.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum EncodeError {
    /// The samples are not those of the extent.
    #[error(
        "{found} bytes of samples were given, but {} of this extent needs {expected}: give {} byte(s) a voxel",
        .format.name(), .format.channels()
    )]
    Length {
        /// The format.
        format: BlockFormat,
        /// Bytes that the extent needs.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
    /// The place for the blocks is not of their size.
    #[error("a place of {found} bytes was given, but the blocks of this extent as {} have {expected}: give as many", .format.name())]
    Place {
        /// The format.
        format: BlockFormat,
        /// Bytes of the blocks.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
    /// There is no memory for the blocks.
    #[error("no memory for {bytes} bytes of blocks: close other volumes or encode a part")]
    OutOfMemory {
        /// Bytes needed.
        bytes: usize,
    },
}

/// Why blocks cannot be decoded. Every bit pattern of a block is valid; only sizes can be wrong.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DecodeError {
    /// The blocks are not those of the extent.
    #[error("{found} bytes of blocks were given, but {} of this extent needs {expected}: the data are cut off or of another format", .format.name())]
    Length {
        /// The format.
        format: BlockFormat,
        /// Bytes that the extent needs.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
    /// There is no memory for the samples.
    #[error("no memory for {bytes} bytes of samples: close other volumes or decode a part")]
    OutOfMemory {
        /// Bytes needed.
        bytes: usize,
    },
}

/// Encodes a volume with the default [`EncodeOptions`].
///
/// `samples` has [`BlockFormat::decoded_len`] bytes, `[x, y, z]`, x fastest; the result has
/// [`BlockFormat::encoded_len`] bytes in sliced-3D order. Runs on the current rayon pool.
///
/// # Errors
/// [`EncodeError::Length`] if `samples` has another length; [`EncodeError::OutOfMemory`].
pub fn encode_volume(format: BlockFormat, samples: &[u8], extent: Extent3) -> Result<Vec<u8>, EncodeError> {
    encode_volume_with(format, samples, extent, EncodeOptions::default())
}

/// Encodes a volume, see [`encode_volume`].
///
/// # Errors
/// Those of [`encode_volume`].
pub fn encode_volume_with(
    format: BlockFormat,
    samples: &[u8],
    extent: Extent3,
    options: EncodeOptions,
) -> Result<Vec<u8>, EncodeError> {
    let (expected, bytes) = (format.decoded_len(extent), format.encoded_len(extent));
    if samples.len() != expected {
        return Err(EncodeError::Length { format, expected, found: samples.len() });
    }
    let mut blocks = zeroed(bytes).ok_or(EncodeError::OutOfMemory { bytes })?;
    encode_volume_into(format, samples, extent, options, &mut blocks)?;
    Ok(blocks)
}

/// Encodes a volume over the blocks of an old one, see [`encode_volume`].
///
/// # Errors
/// [`EncodeError::Length`] as there; [`EncodeError::Place`] if `blocks` has not [`BlockFormat::encoded_len`] bytes.
pub fn encode_volume_into(
    format: BlockFormat,
    samples: &[u8],
    extent: Extent3,
    options: EncodeOptions,
    blocks: &mut [u8],
) -> Result<(), EncodeError> {
    let expected = format.decoded_len(extent);
    if samples.len() != expected {
        return Err(EncodeError::Length { format, expected, found: samples.len() });
    }
    let expected = format.encoded_len(extent);
    if blocks.len() != expected {
        return Err(EncodeError::Place { format, expected, found: blocks.len() });
    }
    encode_into(format, samples, extent, options, blocks, Simd::best());
    Ok(())
}

fn encode_into(
    format: BlockFormat,
    samples: &[u8],
    extent: Extent3,
    options: EncodeOptions,
    blocks: &mut [u8],
    simd: Simd,
) {
    if format == BlockFormat::Bc4 {
        let (voxels, _) = samples.as_chunks::<1>();
        block::encode_rows(voxels, extent, blocks, 8, |rows, blocks| {
            for (rows, blocks) in rows.zip(blocks.chunks_mut(extent.blocks()[0] * 8)) {
                encode_scalar_row(rows.map(|row| row.as_flattened()), blocks, options, simd);
            }
        });
    } else {
        let (voxels, _) = samples.as_chunks::<4>();
        block::encode_rows(voxels, extent, blocks, format.block_bytes(), |rows, blocks| {
            encode_rows(format, rows, extent.blocks()[0], blocks, options, simd);
        });
    }
}

/// Decodes a volume: the inverse of [`encode_volume`], for blocks of any encoder.
///
/// `blocks` has [`BlockFormat::encoded_len`] bytes in sliced-3D order; the result has
/// [`BlockFormat::decoded_len`] bytes, `[x, y, z]`, x fastest: at most 8 times as many, so a hostile extent
/// cannot ask for memory that its blocks do not pay for. BC1 gives alpha 255, or 0 where a block of its other
/// mode says transparent.
///
/// # Errors
/// [`DecodeError::Length`] if `blocks` has another length; [`DecodeError::OutOfMemory`].
pub fn decode_volume(format: BlockFormat, blocks: &[u8], extent: Extent3) -> Result<Vec<u8>, DecodeError> {
    let expected = format.encoded_len(extent);
    if blocks.len() != expected {
        return Err(DecodeError::Length { format, expected, found: blocks.len() });
    }
    let bytes = format.decoded_len(extent);
    let mut samples = zeroed(bytes).ok_or(DecodeError::OutOfMemory { bytes })?;
    match format {
        BlockFormat::Bc1 => block::decode(blocks, extent, &mut samples, bc1::decode),
        BlockFormat::Bc3 => block::decode(blocks, extent, &mut samples, bc3::decode),
        BlockFormat::Bc4 => block::decode(blocks, extent, &mut samples, bc4::decode),
        BlockFormat::Bc7 => block::decode(blocks, extent, &mut samples, bc7::decode),
    }
    Ok(samples)
}

/// The block of BC3 of one colour; its last 8 bytes are BC1.
pub(crate) fn constant(texel: [u8; 4]) -> [u8; 16] {
    rows::constant(texel)
}

/// The texels of one block of colours, x fastest; nothing if its bytes are not those of the format.
pub(crate) fn decode_colours(format: BlockFormat, block: &[u8]) -> [[u8; 4]; 16] {
    let whole = || block.first_chunk().copied().unwrap_or_default();
    match format {
        BlockFormat::Bc1 => bc1::decode(block.first_chunk().copied().unwrap_or_default()),
        BlockFormat::Bc7 => bc7::decode(whole()),
        BlockFormat::Bc3 | BlockFormat::Bc4 => bc3::decode(whole()),
    }
}

/// The texels of one block of BC4, x fastest.
pub(crate) fn decode_scalars(block: &[u8]) -> [u8; 16] {
    bc4::decode(block.first_chunk().copied().unwrap_or_default()).map(|[v]| v)
}

/// Encodes one row of blocks of colours: `rows` are its four rows of voxels, of one length each, `out` a block for
/// each four voxels begun. Past the end of a row its last voxel is repeated.
pub(crate) fn encode_row(
    format: BlockFormat,
    rows: [&[[u8; 4]]; 4],
    out: &mut [u8],
    options: EncodeOptions,
    simd: Simd,
) {
    let across = out.len() / format.block_bytes();
    encode_rows(format, std::iter::once(rows), across, out, options, simd);
}

/// Encodes rows of blocks of colours, `across` blocks each, see [`encode_row`].
fn encode_rows<'a>(
    format: BlockFormat,
    rows: impl Iterator<Item = [&'a [[u8; 4]]; 4]>,
    across: usize,
    out: &mut [u8],
    options: EncodeOptions,
    simd: Simd,
) {
    match format {
        BlockFormat::Bc1 => rows::encode_colours::<8>(rows, across, out.as_chunks_mut().0, options, simd),
        BlockFormat::Bc7 => {
            for (rows, out) in rows.zip(out.chunks_mut(across.max(1) * format.block_bytes())) {
                bc7::encode_row(rows, out, options);
            }
        }
        BlockFormat::Bc3 | BlockFormat::Bc4 => {
            rows::encode_colours::<16>(rows, across, out.as_chunks_mut().0, options, simd);
        }
    }
}

/// Encodes one row of blocks of BC4, see [`encode_row`].
pub(crate) fn encode_scalar_row(rows: [&[u8]; 4], out: &mut [u8], options: EncodeOptions, simd: Simd) {
    rows::encode_scalars(rows, out.as_chunks_mut().0, options, simd);
}

/// `len` zero bytes, or none where there is no memory for them.
pub(crate) fn zeroed(len: usize) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(len).ok()?;
    bytes.resize(len, 0);
    Some(bytes)
}
