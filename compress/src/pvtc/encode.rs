//! Sub-volumes of a volume, the end points of the papers, and the indices for given end points.

use rayon::prelude::*;

use super::ends::Field;
use super::fit::fitted;
use super::{EDGE, Encoder, HEAD_BYTES, Layout};
use crate::Extent3;

/// The values of T steps of a sub-volume of N voxels, x fastest, then y, then z.
pub(super) type Samples<const N: usize, const T: usize> = [[u8; N]; T];

/// Encodes one group. There are 1 to T steps, and all lengths are those of the layout and the extent.
pub(super) fn group(layout: Layout, steps: &[&[u8]], extent: Extent3, encoder: Encoder, encoded: &mut [u8]) {
    match (layout.s, layout.t) {
        (1, 1) => rows::<16, 1>(layout, steps, extent, encoder, encoded),
        (1, 2) => rows::<16, 2>(layout, steps, extent, encoder, encoded),
        (1, 3) => rows::<16, 3>(layout, steps, extent, encoder, encoded),
        (1, _) => rows::<16, 4>(layout, steps, extent, encoder, encoded),
        (2, 1) => rows::<32, 1>(layout, steps, extent, encoder, encoded),
        (2, 2) => rows::<32, 2>(layout, steps, extent, encoder, encoded),
        (2, 3) => rows::<32, 3>(layout, steps, extent, encoder, encoded),
        (2, _) => rows::<32, 4>(layout, steps, extent, encoder, encoded),
        (4, 1) => rows::<64, 1>(layout, steps, extent, encoder, encoded),
        (4, 2) => rows::<64, 2>(layout, steps, extent, encoder, encoded),
        (4, 3) => rows::<64, 3>(layout, steps, extent, encoder, encoded),
        (4, _) => rows::<64, 4>(layout, steps, extent, encoder, encoded),
        (_, 1) => rows::<128, 1>(layout, steps, extent, encoder, encoded),
        (_, 2) => rows::<128, 2>(layout, steps, extent, encoder, encoded),
        (_, 3) => rows::<128, 3>(layout, steps, extent, encoder, encoded),
        (_, _) => rows::<128, 4>(layout, steps, extent, encoder, encoded),
    }
}

/// Encodes rows of sub-volumes of N voxels in parallel.
fn rows<const N: usize, const T: usize>(
    layout: Layout,
    steps: &[&[u8]],
    extent: Extent3,
    encoder: Encoder,
    encoded: &mut [u8],
) {
    let [along_x, along_y, _] = layout.sub_volumes(extent);
    // A short group repeats its last step.
    let steps: [&[u8]; T] = std::array::from_fn(|t| steps[t.min(steps.len() - 1)]);
    let (heads, tables) = encoded.split_at_mut(layout.head_len(extent));
    let heads = heads.par_chunks_mut(along_x * HEAD_BYTES);
    let tables = tables.par_chunks_mut(along_x * layout.table_bytes());
    heads.zip(tables).enumerate().for_each(|(row, (heads, tables))| {
        let [y, z] = [row % along_y * EDGE, row / along_y * usize::from(layout.s)];
        encode_row::<N, T>(&Row { steps, extent, y, z, encoder }, heads, tables);
    });
}

/// What a row of sub-volumes along x is made of.
struct Row<'a, const T: usize> {
    steps: [&'a [u8]; T],
    extent: Extent3,
    y: usize,
    z: usize,
    encoder: Encoder,
}

/// Encodes a row of sub-volumes with the widest registers there are.
fn encode_row<const N: usize, const T: usize>(row: &Row<'_, T>, heads: &mut [u8], tables: &mut [u8]) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        #[expect(unsafe_code, reason = "the one door to code for a processor that was asked first")]
        // SAFETY: the processor has AVX2, see above.
        unsafe {
            encode_row_avx2::<N, T>(row, heads, tables);
        }
        return;
    }
    encode_row_portable::<N, T>(row, heads, tables);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn encode_row_avx2<const N: usize, const T: usize>(row: &Row<'_, T>, heads: &mut [u8], tables: &mut [u8]) {
    encode_row_portable::<N, T>(row, heads, tables);
}

#[inline(always)]
fn encode_row_portable<const N: usize, const T: usize>(
    row: &Row<'_, T>,
    heads: &mut [u8],
    tables: &mut [u8],
) {
    let (heads, _) = heads.as_chunks_mut::<HEAD_BYTES>();
    for (i, (head, table)) in heads.iter_mut().zip(tables.chunks_exact_mut(N / 4)).enumerate() {
        let samples: Samples<N, T> = row.steps.map(|step| gather(step, row.extent, [i * EDGE, row.y, row.z]));
        let block = Block::new(&samples);
        let extremes = extremes(&samples);
        let ends = match row.encoder {
            Encoder::MinMax => extremes,
            Encoder::Fitted => fitted(&block, extremes),
        };
        let (indices, _) = assign(&block, &ends);
        *head = pack::<T>(&ends).to_le_bytes();
        for (byte, indices) in table.iter_mut().zip(indices.as_chunks::<4>().0) {
            *byte = (indices[0] | indices[1] << 2 | indices[2] << 4 | indices[3] << 6) as u8;
        }
    }
}

/// The voxels of the sub-volume that begins at `[x, y, z]`. Past the far edges the last voxel is repeated.
#[inline(always)]
fn gather<const N: usize>(step: &[u8], extent: Extent3, [x, y, z]: [usize; 3]) -> [u8; N] {
    let mut voxels = [0; N];
    for (row, part) in voxels.as_chunks_mut::<EDGE>().0.iter_mut().enumerate() {
        let y = (y + row % EDGE).min(extent.y() - 1);
        let z = (z + row / EDGE).min(extent.z() - 1);
        let line = &step[(z * extent.y() + y) * extent.x()..][..extent.x()];
        match line[x..].first_chunk::<EDGE>() {
            Some(whole) => *part = *whole,
            None => *part = std::array::from_fn(|i| line[(x + i).min(extent.x() - 1)]),
        }
    }
    voxels
}

/// The head of end points.
#[inline(always)]
fn pack<const T: usize>(ends: &[[u32; 2]; T]) -> u32 {
    ends.iter().enumerate().fold(0, |head, (t, &ends)| head | Field::new(T, t).pack(ends))
}

/// Largest and smallest value of each step, to the nearest that its field holds.
#[inline(always)]
pub(super) fn extremes<const N: usize, const T: usize>(samples: &Samples<N, T>) -> [[u32; 2]; T] {
    let mut ends = [[0; 2]; T];
    for (t, (ends, step)) in ends.iter_mut().zip(samples).enumerate() {
        let (mut most, mut least) = (0, u8::MAX);
        for &value in step {
            most = value.max(most);
            least = value.min(least);
        }
        *ends = [most, least].map(|value| Field::new(T, t).nearest(value.into()));
    }
    ends
}

/// A sub-volume as numbers to calculate with.
pub(super) struct Block<const N: usize, const T: usize> {
    pub(super) values: [[i32; N]; T],
    /// Sum of the values of each step.
    pub(super) sums: [i32; T],
    /// Sum of all squares.
    squares: i32,
}

impl<const N: usize, const T: usize> Block<N, T> {
    #[inline(always)]
    fn new(samples: &Samples<N, T>) -> Self {
        let (mut values, mut sums, mut squares) = ([[0; N]; T], [0; T], 0);
        for t in 0..T {
            for (value, sample) in values[t].iter_mut().zip(&samples[t]) {
                *value = i32::from(*sample);
                sums[t] += *value;
                squares += *value * *value;
            }
        }
        Self { values, sums, squares }
    }
}

/// The nearest index of each voxel, the first of several, and the sum of squared errors.
#[inline(always)]
pub(super) fn assign<const N: usize, const T: usize>(
    block: &Block<N, T>,
    ends: &[[u32; 2]; T],
) -> ([i32; N], i32) {
    let mut from_first = block.squares;
    // How much farther a voxel v is from level k than from level 0: constant[k] - slope[k]·v.
    let (mut constants, mut slopes) = ([0; 4], [[0; T]; 4]);
    for t in 0..T {
        let levels = Field::new(T, t).levels(ends[t]);
        let first = levels[0] as i32;
        from_first += first * (first * N as i32 - 2 * block.sums[t]);
        for k in 1..4 {
            let level = levels[k] as i32;
            constants[k] += level * level - first * first;
            slopes[k][t] = 2 * (level - first);
        }
    }
    let mut indices = [0; N];
    let mut farther = 0;
    for (i, index) in indices.iter_mut().enumerate() {
        let mut least = 0;
        for k in 1..4 {
            let mut other = constants[k];
            for (slope, values) in slopes[k].iter().zip(&block.values) {
                other -= slope * values[i];
            }
            *index = if other < least { k as i32 } else { *index };
            least = least.min(other);
        }
        farther += least;
    }
    (indices, from_first + farther)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn compare<const N: usize, const T: usize>() {
        let extent = Extent3::new([67, 4, (N / 16) as u32]).unwrap();
        for noise in [0, 7, 255] {
            let samples: Vec<u8> = (0..4 * extent.voxels() as u64)
                .map(|i| 90 + ((i * i * 0x9E37_79B9) >> 17 & noise) as u8 / 2)
                .collect();
            let steps = std::array::from_fn(|t| &samples[t * extent.voxels()..][..extent.voxels()]);
            for encoder in [Encoder::MinMax, Encoder::Fitted] {
                let row = Row { steps, extent, y: 0, z: 0, encoder };
                let [mut dispatched, mut portable] = [(); 2].map(|()| ([0; 4 * 17], vec![0; N / 4 * 17]));
                encode_row::<N, T>(&row, &mut dispatched.0, &mut dispatched.1);
                encode_row_portable::<N, T>(&row, &mut portable.0, &mut portable.1);
                assert!(dispatched == portable, "{N} voxels, {T} steps, {encoder:?}, noise {noise}");
            }
        }
    }

    #[test]
    fn vector_registers_change_nothing() {
        compare::<16, 1>();
        compare::<16, 2>();
        compare::<16, 3>();
        compare::<32, 4>();
        compare::<64, 2>();
        compare::<64, 3>();
        compare::<128, 1>();
        compare::<128, 4>();
    }
}
