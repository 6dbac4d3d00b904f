//! BC5, unsigned: two blocks of BC4, red first. 16 bytes.
//!
//! Source: KDFS, "RGTC Compressed Texture Image Formats", section "BC5 unsigned".

use super::bc4;
use super::block::{Texels, texels};

/// Encodes a row of blocks: `rows` are its four rows of voxels.
pub(super) fn encode_row(rows: [&[[u8; 2]]; 4], blocks: &mut [u8]) {
    for (x, block) in blocks.chunks_exact_mut(16).enumerate() {
        let texels = texels(rows, x);
        for (channel, half) in block.chunks_exact_mut(8).enumerate() {
            half.copy_from_slice(&bc4::encode(&texels.map(|texel| [texel[channel]])));
        }
    }
}

/// Decodes one block.
pub(super) fn decode(block: [u8; 16]) -> Texels<2> {
    let mut halves = [[0; 8]; 2];
    halves.as_flattened_mut().copy_from_slice(&block);
    let [red, green] = halves.map(bc4::decode);
    std::array::from_fn(|i| [red[i][0], green[i][0]])
}
