//! Gather and scatter of 4×4 blocks in slices of a volume, the rule at edges, and the spread over threads.

use rayon::prelude::*;

use crate::Extent3;

/// Voxels of a block, in x and in y.
const EDGE: usize = 4;

/// The 16 voxels of one block, `[x, y]`, x fastest; `N` bytes a voxel.
pub(super) type Texels<const N: usize> = [[u8; N]; EDGE * EDGE];

/// Blocks of one task, about: enough that starting it costs nothing, few enough to share out evenly.
const TASK_BLOCKS: usize = 2048;

/// Encodes all blocks of a volume in tasks of some rows of blocks. For each row `encode_rows` gets its four rows of
/// voxels, the last repeated past the far edge in y, and it gets the blocks of all rows of the task.
pub(super) fn encode_rows<'a, const N: usize>(
    voxels: &'a [[u8; N]],
    extent: Extent3,
    blocks: &mut [u8],
    block_bytes: usize,
    encode_rows: impl Fn(&mut dyn Iterator<Item = [&'a [[u8; N]]; EDGE]>, &mut [u8]) + Sync,
) {
    let [blocks_x, blocks_y, _] = extent.blocks();
    let rows = (TASK_BLOCKS / blocks_x).max(1);
    blocks.par_chunks_mut(rows * blocks_x * block_bytes).enumerate().for_each(|(task, blocks)| {
        let first = task * rows;
        let mut lines = (first..first + blocks.len() / (blocks_x * block_bytes)).map(|row| {
            let (z, block_y) = (row / blocks_y, row % blocks_y);
            let line = |j: usize| z * extent.y() + (block_y * EDGE + j).min(extent.y() - 1);
            [0, 1, 2, 3].map(|j| &voxels[line(j) * extent.x()..][..extent.x()])
        });
        encode_rows(&mut lines, blocks);
    });
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
    fn encode(samples: &[u8], extent: Extent3, blocks: &mut [u8]) {
        let (voxels, _) = samples.as_chunks::<1>();
        encode_rows(voxels, extent, blocks, 16, |rows, blocks| {
            let places = rows.flat_map(|lines| (0..extent.blocks()[0]).map(move |x| (lines, x)));
            for ((lines, x), block) in places.zip(blocks.as_chunks_mut::<16>().0) {
                for (i, byte) in block.iter_mut().enumerate() {
                    *byte = lines[i / 4][(4 * x + i % 4).min(extent.x() - 1)][0];
                }
            }
        });
    }

    #[test]
    fn blocks_come_x_first_then_y_then_z_and_edges_repeat_the_last_voxel() {
        let extent = Extent3::new([5, 6, 5]).unwrap();
        let samples: Vec<u8> = (0..150).collect();
        let mut blocks = vec![0; extent.block_count() * 16];
        encode(&samples, extent, &mut blocks);
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
            encode(&samples, extent, &mut blocks);
            let mut back = vec![0; samples.len()];
            decode(&blocks, extent, &mut back, |block: [u8; 16]| block.map(|byte| [byte]));
            assert_eq!(back, samples, "{sizes:?}");
        }
    }
}
