//! BC5, unsigned: two blocks of BC4, red first. 16 bytes.
//!
//! Source: KDFS, "RGTC Compressed Texture Image Formats", section "BC5 unsigned".

use super::block::Texels;
use super::{EncodeOptions, bc4, rows};
use crate::simd::Simd;

/// Encodes a row of blocks: `rows` are its four rows of voxels.
pub(super) fn encode_row(rows: [&[[u8; 2]]; 4], blocks: &mut [u8], options: EncodeOptions, simd: Simd) {
    let (halves, _) = blocks.as_chunks_mut::<8>();
    let mut plane = vec![[0; 8]; halves.len() / 2];
    for channel in 0..2 {
        let lines = rows.map(|row| row.iter().map(|voxel| voxel[channel]).collect::<Vec<u8>>());
        rows::encode_scalars(lines.each_ref().map(Vec::as_slice), &mut plane, options, simd);
        for (half, block) in halves.iter_mut().skip(channel).step_by(2).zip(&plane) {
            *half = *block;
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
