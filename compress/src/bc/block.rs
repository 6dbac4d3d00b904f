//! Rows of 4×4 blocks in the slices of a volume, the rule at edges, and the spread over threads.

use rayon::prelude::*;

use crate::Extent3;

/// Voxels of a block, in x and in y.
const EDGE: usize = 4;

/// The 16 voxels of one block, `[x, y]`, x fastest; `N` bytes a voxel.
pub(super) type Texels<const N: usize> = [[u8; N]; EDGE * EDGE];

/// Encodes all blocks of a volume, `block_bytes` each. `samples` and `blocks` have the lengths of the extent.
///
/// `encode_row` is given four rows of voxels, whole blocks long, and the bytes of their row of blocks.
pub(super) fn encode<const N: usize>(
    samples: &[u8],
    extent: Extent3,
    blocks: &mut [u8],
    block_bytes: usize,
    encode_row: impl Fn([&[[u8; N]]; EDGE], &mut [u8]) + Sync,
) {
    let (voxels, _) = samples.as_chunks::<N>();
    let [blocks_x, blocks_y, _] = extent.blocks();
    let padded = blocks_x * EDGE;
    blocks.par_chunks_mut(blocks_x * block_bytes).enumerate().for_each_init(
        || vec![[0; N]; if padded == extent.x() { 0 } else { EDGE * padded }],
        |scratch, (row, bytes)| {
            let (z, y) = (row / blocks_y, row % blocks_y * EDGE);
            // Past the far edges the last row, and the last voxel, are repeated.
            let line = |j: usize| {
                let y = (y + j).min(extent.y() - 1);
                &voxels[(z * extent.y() + y) * extent.x()..][..extent.x()]
            };
            if padded == extent.x() {
                return encode_row(std::array::from_fn(line), bytes);
            }
            for (j, row) in scratch.chunks_exact_mut(padded).enumerate() {
                let line = line(j);
                row[..line.len()].copy_from_slice(line);
                row[line.len()..].fill(line[line.len() - 1]);
            }
            encode_row(std::array::from_fn(|j| &scratch[j * padded..][..padded]), bytes);
        },
    );
}

/// Decodes all blocks of a volume. `blocks` and `samples` have the lengths of the extent.
pub(super) fn decode<const N: usize, const BYTES: usize>(
    blocks: &[u8],
    extent: Extent3,
    samples: &mut [u8],
    decode_block: impl Fn([u8; BYTES]) -> Texels<N> + Sync,
) {
    let [blocks_x, blocks_y, _] = extent.blocks();
    let (blocks, _) = blocks.as_chunks::<BYTES>();
    let (voxels, _) = samples.as_chunks_mut::<N>();
    voxels.par_chunks_mut(extent.x() * extent.y()).enumerate().for_each(|(z, slice)| {
        let blocks = &blocks[z * blocks_x * blocks_y..];
        for (block_y, rows) in slice.chunks_mut(extent.x() * EDGE).enumerate() {
            for block_x in 0..blocks_x {
                let texels = decode_block(blocks[block_y * blocks_x + block_x]);
                scatter(&texels, rows, extent.x(), block_x);
            }
        }
    });
}

/// Writes the voxels of a block that lie inside the volume; `rows` begins at the block's first row.
fn scatter<const N: usize>(texels: &Texels<N>, rows: &mut [[u8; N]], row_len: usize, block_x: usize) {
    let x = block_x * EDGE;
    let width = EDGE.min(row_len - x);
    for (row, texels) in rows.chunks_mut(row_len).zip(texels.chunks_exact(EDGE)) {
        row[x..x + width].copy_from_slice(&texels[..width]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A "codec" that keeps the 16 bytes of a block, to see the order of blocks and voxels alone.
    fn keep(rows: [&[[u8; 1]]; EDGE], blocks: &mut [u8]) {
        for (x, block) in blocks.chunks_exact_mut(EDGE * EDGE).enumerate() {
            for (row, line) in rows.iter().zip(block.chunks_exact_mut(EDGE)) {
                line.copy_from_slice(row[x * EDGE..][..EDGE].as_flattened());
            }
        }
    }

    #[test]
    fn blocks_come_x_first_then_y_then_z_and_edges_repeat_the_last_voxel() {
        let extent = Extent3::new([5, 6, 5]).unwrap();
        let samples: Vec<u8> = (0..150).collect();
        let mut blocks = vec![0; extent.block_count() * 16];
        encode(&samples, extent, &mut blocks, 16, keep);
        for z in 0..5 {
            for block_y in 0..2 {
                for block_x in 0..2 {
                    let block = &blocks[((z * 2 + block_y) * 2 + block_x) * 16..][..16];
                    for j in 0..4 {
                        for i in 0..4 {
                            let (x, y) = ((block_x * 4 + i).min(4), (block_y * 4 + j).min(5));
                            let expected = (z * 30 + y * 5 + x) as u8;
                            assert_eq!(block[j * 4 + i], expected, "voxel {x} {y} {z}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn scattering_undoes_gathering_for_every_edge() {
        for sizes in [[1, 1, 1], [4, 4, 4], [5, 7, 3], [3, 9, 6], [16, 1, 2]] {
            let extent = Extent3::new(sizes).unwrap();
            let samples: Vec<u8> = (0..extent.voxels()).map(|i| (i * 7 + i / 251) as u8).collect();
            let mut blocks = vec![0; extent.block_count() * 16];
            encode(&samples, extent, &mut blocks, 16, keep);
            let mut back = vec![0; samples.len()];
            decode(&blocks, extent, &mut back, |block: [u8; 16]| block.map(|byte| [byte]));
            assert_eq!(back, samples, "{sizes:?}");
        }
    }
}
