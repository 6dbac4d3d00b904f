//! The decoder: rows of sub-volumes along x, many at a time.

use rayon::prelude::*;

use super::ends::Field;
use super::{EDGE, HEAD_BYTES, Layout, MOST_SLICES};
use crate::Extent3;

/// Samples that are worth a task of their own.
const SAMPLES_PER_TASK: usize = 1 << 15;

/// A row of sub-volumes along x, and where its voxels go: up to four rows of voxels in each of up to S slices.
struct Row<'a> {
    heads: &'a [u8],
    tables: &'a [u8],
    slices: [&'a mut [u8]; MOST_SLICES],
}

/// Decodes one step. All lengths are those of the layout and the extent, `step` is below T.
pub(super) fn step(
    layout: Layout,
    heads: &[u8],
    tables: &[u8],
    extent: Extent3,
    step: usize,
    out: &mut [u8],
) {
    let field = Field::new(layout.t.into(), step);
    let mut rows = rows(layout, heads, tables, extent, out);
    let samples_per_row = EDGE * extent.x() * usize::from(layout.s);
    rows.par_iter_mut().with_min_len(SAMPLES_PER_TASK.div_ceil(samples_per_row)).for_each(|row| {
        decode_row(layout.s.into(), field, extent.x(), row);
    });
}

/// Splits a group into its rows of sub-volumes.
fn rows<'a>(
    layout: Layout,
    heads: &'a [u8],
    tables: &'a [u8],
    extent: Extent3,
    out: &'a mut [u8],
) -> Vec<Row<'a>> {
    let [along_x, along_y, along_z] = layout.sub_volumes(extent);
    let mut rows = Vec::with_capacity(along_y * along_z);
    rows.extend(
        heads
            .chunks(along_x * HEAD_BYTES)
            .zip(tables.chunks(along_x * layout.table_bytes()))
            .map(|(heads, tables)| Row { heads, tables, slices: Default::default() }),
    );
    let slice_len = extent.x() * extent.y();
    for (z, slice) in out.chunks_mut(slice_len).enumerate() {
        let (slab, s) = (z / usize::from(layout.s), z % usize::from(layout.s));
        for (row, part) in rows[slab * along_y..].iter_mut().zip(slice.chunks_mut(extent.x() * EDGE)) {
            row.slices[s] = part;
        }
    }
    rows
}

fn decode_row(s: usize, field: Field, width: usize, row: &mut Row<'_>) {
    let (heads, _) = row.heads.as_chunks::<HEAD_BYTES>();
    let (words, _) = row.tables.as_chunks::<4>();
    for (i, head) in heads.iter().enumerate() {
        let levels = field.levels(field.unpack(u32::from_le_bytes(*head)));
        for (slice, table) in row.slices.iter_mut().zip(&words[i * s..][..s]) {
            for (j, line) in slice.chunks_mut(width).enumerate() {
                for (x, voxel) in line[i * EDGE..].iter_mut().take(EDGE).enumerate() {
                    *voxel = levels[usize::from(table[j] >> (2 * x) & 3)] as u8;
                }
            }
        }
    }
}
