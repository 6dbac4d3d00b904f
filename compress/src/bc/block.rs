//! Rows of 4×4 blocks in the slices of a volume, the rule at edges, and the spread over threads.

use rayon::prelude::*;

use crate::Extent3;

/// Voxels of a block, in x and in y.
const EDGE: usize = 4;

/// Blocks of one task, about: enough that starting it costs nothing, few enough to share out evenly.
const TASK_BLOCKS: usize = 2048;

/// The 16 voxels of one block, `[x, y]`, x fastest; `N` bytes a voxel.
pub(super) type Texels<const N: usize> = [[u8; N]; EDGE * EDGE];

/// Encodes all blocks of a volume in tasks of some rows of blocks. `encode_rows` gets the four rows of voxels of each of
/// them, the last repeated past the far edge in y, and the bytes of all their blocks.
pub(super) fn encode_tasks<'a, V: Sync>(
    voxels: &'a [V],
    extent: Extent3,
    blocks: &mut [u8],
    block_bytes: usize,
    encode_rows: impl Fn(&mut dyn Iterator<Item = [&'a [V]; EDGE]>, &mut [u8]) + Sync,
) {
    let row_bytes = extent.blocks()[0] * block_bytes;
    let task_rows = (TASK_BLOCKS / extent.blocks()[0]).max(1);
    blocks.par_chunks_mut(task_rows * row_bytes).enumerate().for_each(|(task, blocks)| {
        let first = task * task_rows;
        let mut lines = (first..first + blocks.len() / row_bytes).map(|row| rows(voxels, extent, row));
        encode_rows(&mut lines, blocks);
    });
}

/// Encodes all blocks of a volume row by row: each has four rows of voxels, the last repeated past the far edge in y.
pub(super) fn encode_rows<V: Sync>(
    voxels: &[V],
    extent: Extent3,
    blocks: &mut [u8],
    block_bytes: usize,
    encode_row: impl Fn([&[V]; EDGE], &mut [u8]) + Sync,
) {
    let row_bytes = extent.blocks()[0] * block_bytes;
    encode_tasks(voxels, extent, blocks, block_bytes, |rows, blocks| {
        for (rows, blocks) in rows.zip(blocks.chunks_mut(row_bytes)) {
            encode_row(rows, blocks);
        }
    });
}

/// The four rows of voxels of a row of blocks, counted over all slices. Past the far edge in y the last is repeated.
pub(super) fn rows<V>(voxels: &[V], extent: Extent3, row: usize) -> [&[V]; EDGE] {
    let [_, blocks_y, _] = extent.blocks();
    let (z, block_y) = (row / blocks_y, row % blocks_y);
    [0, 1, 2, 3].map(|j| {
        let line = z * extent.y() + (block_y * EDGE + j).min(extent.y() - 1);
        &voxels[line * extent.x()..][..extent.x()]
    })
}

/// The voxels of block `x` of a row of blocks. Past the far edge in x the last is repeated.
#[inline(always)]
pub(super) fn texels<V: Copy>(rows: [&[V]; EDGE], x: usize) -> [V; EDGE * EDGE] {
    let mut texels = [rows[0][0]; EDGE * EDGE];
    for (texels, row) in texels.chunks_exact_mut(EDGE).zip(rows) {
        let rest = &row[EDGE * x..];
        if let Some(whole) = rest.first_chunk::<EDGE>() {
            texels.copy_from_slice(whole);
        } else {
            for (i, texel) in texels.iter_mut().enumerate() {
                *texel = rest[i.min(rest.len() - 1)];
            }
        }
    }
    texels
}

/// Decodes all blocks of a volume. `blocks` and `samples` have the lengths of the extent.
pub(super) fn decode<const N: usize, const BYTES: usize>(
    blocks: &[u8],
    extent: Extent3,
    samples: &mut [u8],
    decode_block: impl Fn([u8; BYTES]) -> Texels<N> + Sync,
) {
    decode_to(blocks, extent, samples.as_chunks_mut::<N>().0, decode_block);
}

/// [`decode`] to voxels of any type.
pub(super) fn decode_to<V: Copy + Send, const BYTES: usize>(
    blocks: &[u8],
    extent: Extent3,
    voxels: &mut [V],
    decode_block: impl Fn([u8; BYTES]) -> [V; EDGE * EDGE] + Sync,
) {
    let [blocks_x, blocks_y, _] = extent.blocks();
    let (blocks, _) = blocks.as_chunks::<BYTES>();
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
fn scatter<V: Copy>(texels: &[V; EDGE * EDGE], rows: &mut [V], row_len: usize, block_x: usize) {
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
    fn keep(rows: [&[u8]; EDGE], blocks: &mut [u8]) {
        for (x, block) in blocks.chunks_exact_mut(EDGE * EDGE).enumerate() {
            block.copy_from_slice(&texels(rows, x));
        }
    }

    #[test]
    fn blocks_come_x_first_then_y_then_z_and_edges_repeat_the_last_voxel() {
        let extent = Extent3::new([5, 6, 5]).unwrap();
        let samples: Vec<u8> = (0..150).collect();
        let mut blocks = vec![0; extent.block_count() * 16];
        encode_rows(&samples, extent, &mut blocks, 16, keep);
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
            encode_rows(&samples, extent, &mut blocks, 16, keep);
            let mut back = vec![0; samples.len()];
            decode(&blocks, extent, &mut back, |block: [u8; 16]| block.map(|byte| [byte]));
            assert_eq!(back, samples, "{sizes:?}");
        }
    }
}
