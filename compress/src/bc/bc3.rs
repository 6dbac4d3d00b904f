//! BC3: the alpha block of BC4, then the colour block of BC1. 16 bytes.
//!
//! | bytes | holds |
//! |---|---|
//! | 0..8 | alpha, as the whole block of BC4 |
//! | 8..16 | colour, as the block of BC1, always in its mode of four colours |
//!
//! Source: KDFS, "S3TC Compressed Texture Image Formats", section "BC3 with linear (straight) alpha".

use super::bc1::{self, Mode};
use super::bc4;
use super::block::Texels;
use super::endpoints::TEXELS;
use super::{ColourWeight, EncodeOptions};

/// Weight of a voxel of alpha 0, in units of alpha: 1/32 of an opaque voxel. Measured on a CT: seen colour is
/// within 0.03 dB of what no weight at all gives it, and unseen colour, which linear filtering mixes into seen
/// voxels beside it, is 2 dB better. A block without any seen voxel still gets its own colours.
const UNSEEN_WEIGHT: f32 = 8.0;

/// Encodes a row of blocks: `rows` are four rows of 4·n voxels, `blocks` takes 16·n bytes.
pub(super) fn encode_row(rows: [&[[u8; 4]]; 4], blocks: &mut [u8], options: EncodeOptions) {
    for (x, block) in blocks.chunks_exact_mut(16).enumerate() {
        let texels = std::array::from_fn(|i| rows[i / 4][4 * x + i % 4]);
        block.copy_from_slice(&encode(&texels, options.colour_weight));
    }
}

/// Encodes one block.
pub(super) fn encode(texels: &Texels<4>, colour_weight: ColourWeight) -> [u8; 16] {
    let mut block = [0; 16];
    block[..8].copy_from_slice(&bc4::encode(&texels.map(|texel| [texel[3]])));
    let weights = match colour_weight {
        ColourWeight::Equal => [1.0; TEXELS],
        ColourWeight::Alpha => texels.map(|texel| f32::from(texel[3]) + UNSEEN_WEIGHT),
    };
    block[8..].copy_from_slice(&bc1::encode_weighted(texels, &weights));
    block
}

/// Decodes one block.
pub(super) fn decode(block: [u8; 16]) -> Texels<4> {
    let mut halves = [[0; 8]; 2];
    halves.as_flattened_mut().copy_from_slice(&block);
    let [alpha, colour] = halves;
    let mut texels = bc1::decode_mode(colour, Mode::FourColours);
    for (texel, [alpha]) in texels.iter_mut().zip(bc4::decode(alpha)) {
        texel[3] = alpha;
    }
    texels
}
