//! Sub-volumes of a volume, and the encoder of the papers.

use rayon::prelude::*;

use super::ends::Field;
use super::fit::fitted;
use super::{EDGE, Encoder, HEAD_BYTES, Layout};
use crate::Extent3;

/// The values of T steps of a sub-volume of N voxels, x fastest, then y, then z.
pub(super) type Samples<const N: usize, const T: usize> = [[u8; N]; T];

/// End points, U and D of each step, and the index of each voxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Choice<const N: usize, const T: usize> {
    pub(super) ends: [[u32; 2]; T],
    pub(super) indices: [u8; N],
}

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
        let (y, z) = (row % along_y * EDGE, row / along_y * usize::from(layout.s));
        let (heads, _) = heads.as_chunks_mut::<HEAD_BYTES>();
        for ((i, head), table) in heads.iter_mut().enumerate().zip(tables.chunks_mut(layout.table_bytes())) {
            let samples: Samples<N, T> = steps.map(|step| gather(step, extent, [i * EDGE, y, z]));
            let choice = match encoder {
                Encoder::MinMax => min_max(&samples),
                Encoder::Fitted => fitted(&samples),
            };
            *head = pack::<T>(&choice.ends).to_le_bytes();
            for (byte, indices) in table.iter_mut().zip(choice.indices.as_chunks::<4>().0) {
                *byte = indices[0] | indices[1] << 2 | indices[2] << 4 | indices[3] << 6;
            }
        }
    });
}

/// The voxels of the sub-volume that begins at `[x, y, z]`. Past the far edges the last voxel is repeated.
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
fn pack<const T: usize>(ends: &[[u32; 2]; T]) -> u32 {
    ends.iter().enumerate().fold(0, |head, (t, &ends)| head | Field::new(T, t).pack(ends))
}

/// Largest and smallest value of each step, and for each voxel the first of the nearest indices.
fn min_max<const N: usize, const T: usize>(samples: &Samples<N, T>) -> Choice<N, T> {
    let ends: [[u32; 2]; T] = std::array::from_fn(|t| {
        let (most, least) = samples[t].iter().fold((0, 255), |(most, least), &v| (v.max(most), v.min(least)));
        [most, least].map(|value| Field::new(T, t).nearest(u32::from(value)))
    });
    let levels: [[u32; 4]; T] = std::array::from_fn(|t| Field::new(T, t).levels(ends[t]));
    let indices = std::array::from_fn(|i| {
        let distance = |index: &u8| -> u32 {
            (0..T).map(|t| levels[t][usize::from(*index)].abs_diff(samples[t][i].into()).pow(2)).sum()
        };
        (0..4).min_by_key(distance).unwrap_or_default()
    });
    Choice { ends, indices }
}
