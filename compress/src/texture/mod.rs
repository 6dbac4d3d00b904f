//! Textures from the samples of a volume: a transfer function or a window, then texels or blocks, in one pass.
//!
//! A [`Source`] is a [`Volume`] (a box of a grid, samples as stored) with a [`Mapping`]: a [`ColourTable`] makes
//! colours of them ahead of drawing, a [`Window`] keeps them scalars. It gives the uncompressed texture, or its
//! blocks. Blocks are made row of blocks by row of blocks in the first cache; the volume of texels, four bytes a
//! voxel of colour, is never written.
//!
//! Most blocks of a CT are of one look, and those of nothing seen are known from their least and greatest sample
//! alone: they are constants. With [`Bricks`] their samples are not even read. Blocks whose part of the transfer
//! function is nearly straight are encoded from their places on it ([`crate::bc::Level::Fast`]); the rest go through the
//! kernels of [`crate::bc`], many at a time.
//!
//! Each block depends on its own 16 voxels only. So the bytes are the same for any number of threads, with SIMD
//! instructions and without, with bricks and without, and for a part of the blocks ([`Source::blocks_of`]) as for
//! all.
//!
//! Order, padding and formats are those of [`crate::bc`]: blocks of 4×4×1 voxels, x fastest, the last voxel repeated
//! past the far edges. Differs from Doi: slices are cut into rows of blocks, not units of 4×4×4, since a row reads
//! whole cache lines.
//!
//! Parts: `volume` and `domain` read samples, `table` and `window` say what they become, `texels` writes the
//! uncompressed texture, `encode` the blocks, `curve` is the kernel of straight colours, `bricks` skips, `loss`
//! measures.

mod bricks;
mod curve;
mod domain;
mod encode;
mod loss;
mod rows;
mod table;
mod texels;
mod volume;
mod window;

use std::ops::Range;

use thiserror::Error;

pub use bricks::Bricks;
pub use domain::{Domain, SampleKind};
pub use loss::Loss;
pub use table::{ColourPoint, ColourTable};
pub use volume::{Samples, Volume};
pub use window::Window;

use crate::bc::EncodeOptions;
use crate::simd::Simd;
use crate::{BlockFormat, bc};
use bricks::SkipMap;
use encode::Job;

/// Why a texture cannot be made.
#[derive(Debug, Error, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum TextureError {
    /// The samples are not those of the grid.
    #[error("{found} samples were given for a grid of {expected}: give one a voxel")]
    Samples {
        /// Voxels of the grid.
        expected: usize,
        /// Samples given.
        found: usize,
    },
    /// A box reaches past its volume, or is empty.
    #[error("a box of {extent:?} voxels from {low:?} on is not in a volume of {volume:?}: choose one inside")]
    Outside {
        /// First voxel, `[x, y, z]`.
        low: [u32; 3],
        /// Size of the box.
        extent: [u32; 3],
        /// Size of the volume.
        volume: [u32; 3],
    },
    /// The points are no transfer function.
    #[error(
        "point {index} of the transfer function is missing, lies below the one before, is not finite or has a \
         component outside 0 to 1: give at least one point, by rising value"
    )]
    Points {
        /// Which point.
        index: usize,
    },
    /// The window has no order.
    #[error("a window from {low} to {high} is no range: give two finite values, the lower first")]
    Window {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// The mapping was made for samples of another type.
    #[error(
        "the samples are {samples:?}, but their mapping was made for {mapping:?}: make it for their type"
    )]
    Kind {
        /// Type of the samples.
        samples: SampleKind,
        /// Type that the mapping is of.
        mapping: SampleKind,
    },
    /// The mapping does not make what the format holds.
    #[error(
        "the mapping does not suit the format: colours need a table, opaque for BC1, and scalars a window"
    )]
    Mapping,
    /// The bricks are not those of the grid.
    #[error("{found} bricks were given for a grid of {expected}: give the range of each brick")]
    Bricks {
        /// Bricks of the grid.
        expected: usize,
        /// Bricks given.
        found: usize,
    },
    /// The place for the result, or what is to be measured, is not of its size.
    #[error("{found} bytes were given where the texture has {expected}: give as many")]
    Length {
        /// Bytes of the texture.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
    /// There is no memory for the texture.
    #[error("no memory for a texture of {bytes} bytes: close other volumes or take a part")]
    OutOfMemory {
        /// Bytes needed.
        bytes: usize,
    },
}

/// What samples become.
#[derive(Debug, Clone, Copy)]
pub enum Mapping<'a> {
    /// Colours and opacities: for [`TexelFormat::Rgba8`], [`BlockFormat::Bc1`] (opaque tables only),
    /// [`BlockFormat::Bc3`], [`BlockFormat::Bc7`].
    Colours(&'a ColourTable),
    /// Scalars: for [`TexelFormat::R8`], [`TexelFormat::R16`], [`BlockFormat::Bc4`].
    Scalars(&'a Window),
}

/// A format of uncompressed texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TexelFormat {
    /// Red, green, blue and opacity, 8 bits each.
    Rgba8,
    /// A scalar of 8 bits.
    R8,
    /// A scalar of 16 bits, little-endian.
    R16,
}

impl TexelFormat {
    /// Bytes of a texel.
    pub fn bytes(self) -> usize {
        match self {
            Self::Rgba8 => 4,
            Self::R8 => 1,
            Self::R16 => 2,
        }
    }
}

/// How the blocks of a texture came to be. The kernels of [`crate::bc`] made what is none of these.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EncodeStats {
    /// All blocks.
    pub blocks: u64,
    /// Constants of bricks whose samples were not read.
    pub skipped: u64,
    /// Constants of which nothing is seen.
    pub clear: u64,
    /// Constants of one visible look.
    pub solid: u64,
    /// Encoded from the places of their voxels on the transfer function.
    pub curve: u64,
}

impl EncodeStats {
    fn plus(self, other: Self) -> Self {
        Self {
            blocks: self.blocks + other.blocks,
            skipped: self.skipped + other.skipped,
            clear: self.clear + other.clear,
            solid: self.solid + other.solid,
            curve: self.curve + other.curve,
        }
    }
}

/// A box of blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Part {
    low: [usize; 3],
    count: [usize; 3],
}

impl Part {
    fn blocks(self) -> usize {
        self.count.iter().product()
    }
}

/// Blocks of a part of a texture, to be written over those that are there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Patch {
    /// The first texel, `[x, y, z]`; x and y are multiples of 4.
    pub low: [u32; 3],
    /// The texels covered, `[x, y, z]`; x and y are multiples of 4, padding included.
    pub size: [u32; 3],
    /// The blocks, in the order of [`crate::bc`].
    pub blocks: Vec<u8>,
}

/// What a texture is made of.
#[derive(Debug)]
pub struct Source<'a> {
    volume: Volume<'a>,
    mapping: Mapping<'a>,
    skip: Option<SkipMap>,
    simd: Simd,
}

impl<'a> Source<'a> {
    /// A volume, and what its samples become.
    ///
    /// # Errors
    /// [`TextureError::Kind`] if `mapping` was made for another type of samples.
    pub fn new(volume: Volume<'a>, mapping: Mapping<'a>) -> Result<Self, TextureError> {
        let made_for = match mapping {
            Mapping::Colours(table) => table.domain().kind(),
            Mapping::Scalars(window) => window.domain().kind(),
        };
        if made_for != volume.kind() {
            return Err(TextureError::Kind { samples: volume.kind(), mapping: made_for });
        }
        Ok(Self { volume, mapping, skip: None, simd: Simd::best() })
    }

    /// The same with known ranges of the grid's bricks. The blocks stay the same.
    ///
    /// # Errors
    /// [`TextureError::Bricks`] if they are not those of the volume's grid.
    pub fn with_bricks(mut self, bricks: Bricks<'_>) -> Result<Self, TextureError> {
        let grid = self.volume.grid();
        self.skip = Some(match self.mapping {
            Mapping::Colours(table) => {
                SkipMap::new(bricks, grid, |range| table.run(range.map(|value| table.domain().index(value))))
            }
            Mapping::Scalars(window) => SkipMap::new(bricks, grid, |range| {
                let [low, high] = range.map(|value| window.texel(window.domain().index(value)));
                (low == high).then_some(low.into())
            }),
        }?);
        Ok(self)
    }

    /// The volume.
    pub fn volume(&self) -> &Volume<'a> {
        &self.volume
    }

    /// The uncompressed texture, `[x, y, z]`, x fastest. Runs on the current rayon pool.
    ///
    /// # Errors
    /// [`TextureError::Mapping`] if the format does not suit; [`TextureError::OutOfMemory`].
    pub fn texels(&self, format: TexelFormat) -> Result<Vec<u8>, TextureError> {
        let mut out = allocated(self.volume.extent().voxels() * format.bytes())?;
        self.texels_into(format, &mut out)?;
        Ok(out)
    }

    /// Writes the uncompressed texture into `out`, of `format.bytes()`·x·y·z bytes, see [`Source::texels`].
    ///
    /// # Errors
    /// [`TextureError::Mapping`] if the format does not suit; [`TextureError::Length`] if `out` has another length.
    pub fn texels_into(&self, format: TexelFormat, out: &mut [u8]) -> Result<(), TextureError> {
        check_len(out, self.volume.extent().voxels() * format.bytes())?;
        match (format, self.mapping) {
            (TexelFormat::Rgba8, Mapping::Colours(table)) => {
                texels::rgba8(&self.volume, table, self.simd, out);
            }
            (TexelFormat::R8, Mapping::Scalars(window)) => texels::r8(&self.volume, window, self.simd, out),
            (TexelFormat::R16, Mapping::Scalars(window)) => texels::r16(&self.volume, window, self.simd, out),
            _ => return Err(TextureError::Mapping),
        }
        Ok(())
    }

    /// The blocks of the whole texture, [`BlockFormat::encoded_len`] bytes. Runs on the current rayon pool.
    ///
    /// # Errors
    /// [`TextureError::Mapping`] if the format does not suit; [`TextureError::OutOfMemory`].
    pub fn blocks(
        &self,
        format: BlockFormat,
        options: EncodeOptions,
    ) -> Result<(Vec<u8>, EncodeStats), TextureError> {
        let mut out = allocated(format.encoded_len(self.volume.extent()))?;
        let stats = self.blocks_into(format, options, &mut out)?;
        Ok((out, stats))
    }

    /// Writes the blocks of the whole texture into `out`, see [`Source::blocks`].
    ///
    /// # Errors
    /// [`TextureError::Mapping`] if the format does not suit; [`TextureError::Length`] if `out` has another length.
    pub fn blocks_into(
        &self,
        format: BlockFormat,
        options: EncodeOptions,
        out: &mut [u8],
    ) -> Result<EncodeStats, TextureError> {
        let part = Part { low: [0; 3], count: self.volume.extent().blocks() };
        self.encode(format, options, part, out)
    }

    /// The blocks that hold any of the voxels from `low` to before `end`, after these have changed. What is outside
    /// the volume is left out. The bytes are those that [`Source::blocks`] gives there.
    ///
    /// # Errors
    /// [`TextureError::Outside`] if no voxel of the volume is touched; [`TextureError::Mapping`] if the format does
    /// not suit; [`TextureError::OutOfMemory`].
    pub fn blocks_of(
        &self,
        format: BlockFormat,
        options: EncodeOptions,
        touched: Range<[u32; 3]>,
    ) -> Result<Patch, TextureError> {
        let sizes = self.volume.extent().sizes();
        let Range { start, end } = touched;
        if (0..3).any(|axis| start[axis] >= end[axis].min(sizes[axis])) {
            let extent = std::array::from_fn(|axis| end[axis].saturating_sub(start[axis]));
            return Err(TextureError::Outside { low: start, extent, volume: sizes });
        }
        let edges = [4, 4, 1];
        let low: [u32; 3] = std::array::from_fn(|axis| start[axis] / edges[axis]);
        let count: [u32; 3] =
            std::array::from_fn(|axis| end[axis].min(sizes[axis]).div_ceil(edges[axis]) - low[axis]);
        let part = Part { low: low.map(|n| n as usize), count: count.map(|n| n as usize) };
        let mut blocks = allocated(part.blocks() * format.block_bytes())?;
        self.encode(format, options, part, &mut blocks)?;
        let texels = |blocks: [u32; 3]| std::array::from_fn(|axis| blocks[axis] * edges[axis]);
        Ok(Patch { low: texels(low), size: texels(count), blocks })
    }

    /// How far the texture of `blocks` is from what the samples say, see [`Loss`]. Runs on the current rayon pool.
    ///
    /// # Errors
    /// [`TextureError::Mapping`] if the format does not suit; [`TextureError::Length`] if these are not the blocks of
    /// the whole texture.
    pub fn loss_of_blocks(&self, format: BlockFormat, blocks: &[u8]) -> Result<Loss, TextureError> {
        check_len(blocks, format.encoded_len(self.volume.extent()))?;
        self.check_mapping(format)?;
        Ok(loss::of_blocks(&self.volume, self.mapping, format, self.simd, blocks))
    }

    /// How far the uncompressed texture is from what the samples say: rounding alone, see [`Loss`]. Runs on the
    /// current rayon pool.
    ///
    /// # Errors
    /// [`TextureError::Mapping`] if the format does not suit.
    pub fn loss_of_texels(&self, format: TexelFormat) -> Result<Loss, TextureError> {
        match (format, self.mapping) {
            (TexelFormat::Rgba8, Mapping::Colours(_)) | (TexelFormat::R8, Mapping::Scalars(_)) => {
                Ok(loss::of_texels(&self.volume, self.mapping, true))
            }
            (TexelFormat::R16, Mapping::Scalars(_)) => Ok(loss::of_texels(&self.volume, self.mapping, false)),
            _ => Err(TextureError::Mapping),
        }
    }

    fn encode(
        &self,
        format: BlockFormat,
        options: EncodeOptions,
        part: Part,
        out: &mut [u8],
    ) -> Result<EncodeStats, TextureError> {
        check_len(out, part.blocks() * format.block_bytes())?;
        self.check_mapping(format)?;
        let job = Job { volume: self.volume, part, skip: self.skip.as_ref(), options, simd: self.simd };
        Ok(match (format, self.mapping) {
            (BlockFormat::Bc1, Mapping::Colours(table)) => encode::colours::<8>(&job, table, format, out),
            (BlockFormat::Bc3 | BlockFormat::Bc7, Mapping::Colours(table)) => {
                encode::colours::<16>(&job, table, format, out)
            }
            (BlockFormat::Bc4, Mapping::Scalars(window)) => encode::scalars(&job, window, out),
            _ => return Err(TextureError::Mapping),
        })
    }

    fn check_mapping(&self, format: BlockFormat) -> Result<(), TextureError> {
        let suits = match (format, self.mapping) {
            (BlockFormat::Bc1, Mapping::Colours(table)) => table.is_opaque(),
            (BlockFormat::Bc3 | BlockFormat::Bc7, Mapping::Colours(_))
            | (BlockFormat::Bc4, Mapping::Scalars(_)) => true,
            _ => false,
        };
        if suits { Ok(()) } else { Err(TextureError::Mapping) }
    }
}

fn check_len(bytes: &[u8], expected: usize) -> Result<(), TextureError> {
    if bytes.len() == expected { Ok(()) } else { Err(TextureError::Length { expected, found: bytes.len() }) }
}

fn allocated(bytes: usize) -> Result<Vec<u8>, TextureError> {
    bc::zeroed(bytes).ok_or(TextureError::OutOfMemory { bytes })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Extent3;
    use crate::bc::Level;

    #[test]
    fn the_bytes_are_the_same_with_instructions_of_this_machine_and_without() {
        let extent = Extent3::new([150, 37, 5]).unwrap();
        let mut state = 1_u32;
        let samples: Vec<i16> = (0..extent.voxels())
            .map(|i| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                ((i % 150 * 17 + i / 150 * 5) % 3000) as i16 - 1000 + (state >> 26) as i16
            })
            .collect();
        let points = [(-200.0, 0.1, 0.0), (0.0, 0.9, 0.4), (300.0, 0.2, 0.1), (1500.0, 1.0, 1.0)];
        let points = points.map(|(value, c, a)| ColourPoint { value, rgba: [c, c * c, 1.0 - c, a] });
        let table = ColourTable::new(&points, SampleKind::I16, 0.0).unwrap();
        let window = Window::new([-500.0, 1000.0], SampleKind::I16, 0.0).unwrap();
        let volume = Volume::new(Samples::I16(&samples), extent).unwrap();
        let (colours, scalars) = (Mapping::Colours(&table), Mapping::Scalars(&window));
        let with = |simd, mapping| Source { simd, ..Source::new(volume, mapping).unwrap() };
        for simd in Simd::all() {
            let (plain, wide) = (with(Simd::Plain, colours), with(simd, colours));
            for (format, level) in [
                (BlockFormat::Bc3, Level::Fast),
                (BlockFormat::Bc3, Level::Best),
                (BlockFormat::Bc7, Level::Fast),
            ] {
                let options = EncodeOptions::default().with_level(level);
                let blocks = |source: &Source<'_>| source.blocks(format, options).unwrap();
                assert!(blocks(&plain) == blocks(&wide), "{format:?} {level:?} {simd:?}");
            }
            assert!(plain.texels(TexelFormat::Rgba8) == wide.texels(TexelFormat::Rgba8), "colours {simd:?}");
            let (plain, wide) = (with(Simd::Plain, scalars), with(simd, scalars));
            for level in [Level::Fast, Level::Best] {
                let options = EncodeOptions::default().with_level(level);
                let blocks = |source: &Source<'_>| source.blocks(BlockFormat::Bc4, options).unwrap();
                assert!(blocks(&plain) == blocks(&wide), "BC4 {level:?} {simd:?}");
            }
            for format in [TexelFormat::R8, TexelFormat::R16] {
                assert!(plain.texels(format) == wide.texels(format), "{format:?} {simd:?}");
            }
        }
    }
}
