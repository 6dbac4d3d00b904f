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
