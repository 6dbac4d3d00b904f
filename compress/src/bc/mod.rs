//! BC1, BC3, BC4, BC5 and BC7: block textures that graphics hardware samples directly, here for volumes.
//!
//! **Order** is that of a *sliced* 3D texture, which Vulkan and WebGPU read: blocks of 4×4×1 voxels, block x
//! fastest, then block y, then z. A volume of any extent is covered; where a block reaches over the far edge in x
//! or y, the last voxel is repeated, which costs the encoder nothing and never bleeds another colour into the
//! edge. **Work** is a row of blocks; rows are spread over threads, and the bytes are the same for any number of
//! threads.
//!
//! **Samples** are 4 bytes a voxel, R G B A, for [`BlockFormat::Bc1`], [`BlockFormat::Bc3`] and [`BlockFormat::Bc7`],
//! 2 bytes for [`BlockFormat::Bc5`], and 1 byte for [`BlockFormat::Bc4`]; `[x, y, z]`, x fastest. BC1 is written in its
//! opaque mode of four colours, alpha is not kept; its decoder knows the other mode too, where index 3 is transparent black.
//!
//! **Rounding.** The standard gives the interpolated values as fractions; the decoders here round them to the
//! nearest 8-bit value once, at the end. Hardware may differ by 1 or 2; in BC7 it may not, and does not.
//!
//! Parts: `block` gathers and scatters, `fast` holds the kernels of [`Level::Fast`], `colour` and `scalar` those of
//! [`Level::Best`] on the `batch`, `lanes` eight blocks side by side in `f32`, `bc1` to `bc7` the bits of each format;
//! [`two_plane`] is the precise tier for one scalar, [`choose`] finds the format that serves a bound.
//!
//! Source: KDFS, chapters "S3TC Compressed Texture Image Formats", "RGTC Compressed Texture Image Formats" and "BPTC
//! Compressed Texture Image Formats".

mod batch;
mod bc1;
mod bc3;
mod bc4;
mod bc5;
mod bc7;
mod block;
pub mod choose;
mod colour;
mod endpoints;
pub(crate) mod fast;
mod lanes;
mod rows;
mod scalar;
pub mod two_plane;

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
    /// Two channels, each as in BC4; see [`two_plane`] for one scalar in both.
    Bc5,
    /// Colour and alpha together in one of eight modes, end points of up to 8 bits, indices of up to 4: the accurate
    /// tier for colour, of the same size as BC3.
    Bc7,
}

impl BlockFormat {
    /// Every format.
    pub const ALL: [Self; 5] = [Self::Bc1, Self::Bc3, Self::Bc4, Self::Bc5, Self::Bc7];

    /// The format's short name: `"bc3"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bc1 => "bc1",
            Self::Bc3 => "bc3",
            Self::Bc4 => "bc4",
            Self::Bc5 => "bc5",
            Self::Bc7 => "bc7",
        }
    }

    /// Bytes of one block of 4×4×1 voxels.
    pub fn block_bytes(self) -> usize {
        match self {
            Self::Bc1 | Self::Bc4 => 8,
            Self::Bc3 | Self::Bc5 | Self::Bc7 => 16,
        }
    }

    /// Bits of a block for each of its 16 voxels.
    pub fn bits_per_voxel(self) -> usize {
        self.block_bytes() / 2
    }

    /// Bytes of one voxel on the uncompressed side: 4 for colour, 2 for two channels, 1 for a scalar.
    pub fn channels(self) -> usize {
        match self {
            Self::Bc1 | Self::Bc3 | Self::Bc7 => 4,
            Self::Bc5 => 2,
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

/// How the voxels of a BC3 or BC7 block share in the choice of its colours.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ColourWeight {
    /// By their alpha: a voxel that is not seen costs the seen ones nothing. For straight (not premultiplied)
    /// colour. Voxels of alpha 0 keep the least weight that still defines their colour.
    #[default]
    Alpha,
    /// All alike: for colour that is premultiplied, and so weighted already.
    Equal,
}

/// What an encoder spends its time on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Level {
    /// End points from the range of a block, once: for volumes that change while they are looked at. About
    /// twice as fast as the best in BC1 and BC3, twenty times in BC4.
    Fast,
    /// End points that are fitted to the block; those of alpha in BC3 only where colours count by it, else they are the
    /// better of its two kinds of block.
    #[default]
    Best,
}

/// Choices of an encoder.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct EncodeOptions {
    /// How voxels share in the colours of a BC3 or BC7 block; of no effect in the other formats.
    pub colour_weight: ColourWeight,
    /// What the time is spent on.
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
    /// The place for the blocks is not that of the extent.
    #[error("there is room for {found} bytes of blocks, but {} of this extent has {expected}", .format.name())]
    Place {
        /// The format.
        format: BlockFormat,
        /// Bytes that the extent needs.
        expected: usize,
        /// Bytes given to encode into.
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
    let bytes = format.block_bytes();
    match format {
        BlockFormat::Bc1 | BlockFormat::Bc3 => {
            let across = extent.blocks()[0];
            block::encode_tasks(samples.as_chunks().0, extent, blocks, bytes, |lines, blocks| {
                if format == BlockFormat::Bc1 {
                    rows::encode_colours::<8>(lines, across, blocks.as_chunks_mut().0, options, simd);
                } else {
                    rows::encode_colours::<16>(lines, across, blocks.as_chunks_mut().0, options, simd);
                }
            });
        }
        BlockFormat::Bc4 => block::encode_rows(samples, extent, blocks, bytes, |rows, blocks| {
            encode_scalars(rows, blocks, options, simd);
        }),
        BlockFormat::Bc5 => {
            block::encode_rows(samples.as_chunks().0, extent, blocks, bytes, |rows, blocks| {
                bc5::encode_row(rows, blocks, options, simd);
            });
        }
        BlockFormat::Bc7 => {
            block::encode_rows(samples.as_chunks().0, extent, blocks, bytes, |rows, blocks| {
                bc7::encode_row(rows, blocks, options);
            });
        }
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
        BlockFormat::Bc5 => block::decode(blocks, extent, &mut samples, bc5::decode),
        BlockFormat::Bc7 => block::decode(blocks, extent, &mut samples, bc7::decode),
    }
    Ok(samples)
}

/// Encodes a row of blocks of colours, BC3 or BC7, or else BC1: `rows` are four rows of 4·n voxels.
pub(crate) fn encode_colours(
    format: BlockFormat,
    rows: [&[[u8; 4]]; 4],
    blocks: &mut [u8],
    options: EncodeOptions,
    simd: Simd,
) {
    let across = blocks.len() / format.block_bytes();
    let one = std::iter::once(rows);
    match format {
        BlockFormat::Bc3 => rows::encode_colours::<16>(one, across, blocks.as_chunks_mut().0, options, simd),
        BlockFormat::Bc7 => bc7::encode_row(rows, blocks, options),
        _ => rows::encode_colours::<8>(one, across, blocks.as_chunks_mut().0, options, simd),
    }
}

/// Encodes a row of blocks of scalars, BC4: `rows` are four rows of 4·n voxels.
pub(crate) fn encode_scalars(rows: [&[u8]; 4], blocks: &mut [u8], options: EncodeOptions, simd: Simd) {
    rows::encode_scalars(rows, blocks.as_chunks_mut().0, options, simd);
}

/// The block of BC3 of one colour; its last 8 bytes are BC1.
pub(crate) fn constant(texel: [u8; 4]) -> [u8; 16] {
    rows::constant(texel)
}

/// The block of BC7 of one colour, exactly.
pub(crate) fn bc7_constant(texel: [u8; 4]) -> [u8; 16] {
    bc7::constant(texel)
}

/// Decodes a block of colours, BC3 or BC7 if it has 16 bytes, else BC1.
pub(crate) fn decode_colours(format: BlockFormat, block: &[u8]) -> [[u8; 4]; 16] {
    match (format, block.first_chunk(), block.first_chunk()) {
        (BlockFormat::Bc7, Some(block), _) => bc7::decode(*block),
        (_, Some(block), _) => bc3::decode(*block),
        (_, None, Some(block)) => bc1::decode(*block),
        (_, None, None) => [[0; 4]; 16],
    }
}

/// Decodes a block of scalars, BC4.
pub(crate) fn decode_scalars(block: &[u8]) -> [u8; 16] {
    block.first_chunk().map_or([0; 16], |block| bc4::decode(*block).map(|[texel]| texel))
}

/// `len` zero bytes, or none where there is no memory for them.
///
/// Memory of zeroes, which the system hands out page by page when it is first written, on the thread that writes it,
/// cannot be asked for and refused. So as much is asked for before, and given back.
pub(crate) fn zeroed(len: usize) -> Option<Vec<u8>> {
    let mut asked = Vec::<u8>::new();
    asked.try_reserve_exact(len).ok()?;
    // Seen from outside, so that asking is not optimised away.
    drop(std::hint::black_box(asked));
    Some(vec![0; len])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of noise, of noise in a narrow range, of ramps, of two values, and of one; with the ends of the range.
    fn samples(extent: Extent3, channels: usize) -> Vec<u8> {
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 24
        };
        let mut samples = Vec::new();
        for i in 0..extent.voxels() {
            let (x, y) = (i % extent.x(), i / extent.x());
            for channel in 0..channels {
                let (width, base) = ((y / 4 * 7 % 9) as u32, (x / 4 * 37 + channel * 50) as u32 % 256);
                let value = match x / 4 % 5 {
                    0 => noise(),
                    1 => base + (noise() >> width),
                    2 => base + (x % 4 * 9 + y % 4 * 17 * (channel + 1)) as u32,
                    3 => {
                        if noise() > 99 {
                            255
                        } else {
                            0
                        }
                    }
                    _ => base,
                };
                samples.push(value.min(255) as u8);
            }
        }
        samples
    }

    #[test]
    fn the_bytes_are_the_same_with_and_without_wide_instructions_and_for_any_number_of_threads() {
        // 410·60·16/16 blocks and more; the width is of no whole batch and of no whole block.
        let extent = Extent3::new([1638, 239, 5]).unwrap();
        for format in [BlockFormat::Bc1, BlockFormat::Bc3, BlockFormat::Bc4] {
            let samples = samples(extent, format.channels());
            for level in [Level::Fast, Level::Best] {
                for weight in [ColourWeight::Alpha, ColourWeight::Equal] {
                    let options = EncodeOptions { colour_weight: weight, level };
                    let blocks = |simd: Simd, threads: usize| {
                        let mut blocks = vec![0; format.encoded_len(extent)];
                        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                        pool.install(|| encode_into(format, &samples, extent, options, &mut blocks, simd));
                        blocks
                    };
                    let plain = blocks(Simd::Plain, 1);
                    for simd in Simd::all() {
                        assert!(blocks(simd, 4) == plain, "{format:?} {options:?} {simd:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_place_of_another_size_is_refused() {
        let extent = Extent3::new([4, 4, 1]).unwrap();
        let refused =
            encode_volume_into(BlockFormat::Bc4, &[0; 16], extent, EncodeOptions::default(), &mut [0; 9]);
        let place = EncodeError::Place { format: BlockFormat::Bc4, expected: 8, found: 9 };
        assert_eq!(refused, Err(place), "a byte too many");
    }

    #[test]
    fn a_row_alone_gives_the_blocks_that_it_has_in_the_volume() {
        let extent = Extent3::new([70, 4, 1]).unwrap();
        for format in [BlockFormat::Bc1, BlockFormat::Bc3, BlockFormat::Bc7] {
            let samples = samples(extent, 4);
            let volume = encode_volume(format, &samples, extent).unwrap();
            let mut row = vec![0; volume.len()];
            let lines: Vec<&[[u8; 4]]> = samples.as_chunks::<4>().0.chunks(70).collect();
            encode_colours(
                format,
                lines.try_into().unwrap(),
                &mut row,
                EncodeOptions::default(),
                Simd::best(),
            );
            assert!(row == volume, "{format:?}");
        }
    }
}
