//! PVTC-TE and PVTC-SE: three scalars in the red, green and blue of a BC1 texture, which the texture hardware decodes.
//!
//! [`Packing::Te`], temporal encoding, packs three successive steps of a voxel; [`Packing::Se`], spatial encoding,
//! three successive z of one step. The result is a sliced-3D BC1 texture of [`Packing::texture_extent`], as
//! [`crate::bc::encode_volume`] writes it; a shader samples it and picks the channel: the step for TE, z modulo 3 for
//! SE. Blocks of 48 samples take 8 bytes: 1/6.
//!
//! **Edges.** A last group of fewer than three steps repeats its last step, a volume whose z is no multiple of 3 its
//! last slice.
//!
//! Source: *Nagayasu*, sections 3.2.1 and 3.2.2.

use rayon::prelude::*;

use super::{DecodeError, EncodeError, check_room, check_steps, zeroed};
use crate::bc::{EncodeOptions, decode_volume, encode_volume_with};
use crate::{BlockFormat, Extent3};

/// Scalars of a texel.
const PACKED: usize = 3;

/// Bytes of an uncompressed texel.
const TEXEL_BYTES: usize = 4;

/// Slices of the texture that are in memory uncompressed at a time: whole work units of [`crate::bc`].
const SLICES: usize = 16;

/// What the three channels of a texel are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Packing {
    /// Temporal encoding: three successive steps of one voxel.
    Te,
    /// Spatial encoding: three successive z of one step.
    Se,
}

impl Packing {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Te, Self::Se];

    /// The packing's short name: `"te"`, `"se"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Te => "te",
            Self::Se => "se",
        }
    }

    /// Steps of a group, which one texture holds: 3 or 1.
    pub fn steps(self) -> usize {
        match self {
            Self::Te => PACKED,
            Self::Se => 1,
        }
    }

    /// The texture's extent: that of the volume for TE, with ⌈z/3⌉ slices for SE.
    pub fn texture_extent(self, extent: Extent3) -> Extent3 {
        match self {
            Self::Te => extent,
            Self::Se => extent.with_slices(extent.z().div_ceil(PACKED)),
        }
    }

    /// Bytes of one group: 8 for each 4×4×1 block of the texture.
    pub fn encoded_len(self, extent: Extent3) -> usize {
        BlockFormat::Bc1.encoded_len(self.texture_extent(extent))
    }

    /// Where channel `channel` of slice `z` of the texture comes from: a step and a slice of it.
    fn source(self, z: usize, channel: usize, steps: usize, extent: Extent3) -> (usize, usize) {
        match self {
            Self::Te => (channel.min(steps - 1), z),
            Self::Se => (0, (z * PACKED + channel).min(extent.z() - 1)),
        }
    }
}

/// Encodes one group: `steps` are 1 to [`Packing::steps`] successive volumes, each `[x, y, z]`, x fastest, 1 byte a
/// voxel. The result has [`Packing::encoded_len`] bytes. Runs on the current rayon pool.
///
/// # Errors
/// [`EncodeError::Steps`] if there are no steps or too many; [`EncodeError::Length`] if one has not x·y·z bytes;
/// [`EncodeError::OutOfMemory`] and [`EncodeError::Texture`] if there is no memory.
pub fn encode_packed(
    packing: Packing,
    steps: &[&[u8]],
    extent: Extent3,
    options: EncodeOptions,
) -> Result<Vec<u8>, EncodeError> {
    check_steps(steps, extent, packing.steps())?;
    let texture = packing.texture_extent(extent);
    let bytes = packing.encoded_len(extent);
    let mut encoded = zeroed(bytes).ok_or(EncodeError::OutOfMemory { bytes })?;
    let slice = extent.x() * extent.y();
    let work = BlockFormat::Bc1.decoded_len(texture.with_slices(SLICES));
    let mut texels = zeroed(work).ok_or(EncodeError::OutOfMemory { bytes: work })?;
    let slice_blocks = bytes / texture.z();
    for (part, encoded) in encoded.chunks_mut(SLICES * slice_blocks).enumerate() {
        let (first, count) = (part * SLICES, encoded.len() / slice_blocks);
        let part = &mut texels[..count * slice * TEXEL_BYTES];
        part.par_chunks_mut(slice * TEXEL_BYTES).enumerate().for_each(|(z, texels)| {
            let channels: [&[u8]; PACKED] = std::array::from_fn(|channel| {
                let (step, z) = packing.source(first + z, channel, steps.len(), extent);
                &steps[step][z * slice..][..slice]
            });
            let voxels = channels[0].iter().zip(channels[1]).zip(channels[2]);
            for (texel, ((&red, &green), &blue)) in texels.as_chunks_mut().0.iter_mut().zip(voxels) {
                *texel = [red, green, blue, u8::MAX];
            }
        });
        encoded.copy_from_slice(&encode_volume_with(
            BlockFormat::Bc1,
            part,
            texture.with_slices(count),
            options,
        )?);
    }
    Ok(encoded)
}

/// Decodes step `step`, counted from 0, of one group into `out`, `[x, y, z]`, x fastest, by the CPU: for tests, and
/// for machines whose texture hardware knows no BC1. Runs on the current rayon pool.
///
/// # Errors
/// [`DecodeError::Length`] and [`DecodeError::Room`] if `blocks` has not [`Packing::encoded_len`] bytes or `out` not
/// x·y·z; [`DecodeError::Step`] if `step` is not below [`Packing::steps`]; [`DecodeError::Texture`] if
/// there is no memory to decode in.
pub fn decode_packed_step(
    packing: Packing,
    blocks: &[u8],
    extent: Extent3,
    step: usize,
    out: &mut [u8],
) -> Result<(), DecodeError> {
    let expected = packing.encoded_len(extent);
    if blocks.len() != expected {
        return Err(DecodeError::Length { expected, found: blocks.len() });
    }
    check_room(step, packing.steps(), extent, out)?;
    let texture = packing.texture_extent(extent);
    let slice = extent.x() * extent.y();
    // Slices of the volume in one of the texture.
    let depth = PACKED / packing.steps();
    let slice_blocks = expected / texture.z();
    let parts = blocks.chunks(SLICES * slice_blocks).zip(out.chunks_mut(SLICES * slice * depth));
    for (blocks, voxels) in parts {
        let part = texture.with_slices(blocks.len() / slice_blocks);
        let texels = decode_volume(BlockFormat::Bc1, blocks, part)?;
        voxels.par_chunks_mut(slice).enumerate().for_each(|(z, voxels)| {
            let texels = &texels[z / depth * slice * TEXEL_BYTES..];
            let channel = step + z % depth;
            for (voxel, texel) in voxels.iter_mut().zip(texels.as_chunks::<TEXEL_BYTES>().0) {
                *voxel = texel[channel];
            }
        });
    }
    Ok(())
}
