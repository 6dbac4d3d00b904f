//! The decoder: rows of sub-volumes along x, many at a time.

use rayon::prelude::*;

use super::ends::Field;
use super::{EDGE, HEAD_BYTES, Layout, MOST_SLICES};
use crate::Extent3;

/// Sub-volumes that are decoded together: their values stay in the nearest cache.
const BATCH: usize = 64;

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
    let rows = rows.par_iter_mut().with_min_len(SAMPLES_PER_TASK.div_ceil(samples_per_row));
    rows.for_each_init(Work::default, |work, row| {
        decode_row(layout.s.into(), field, extent.x(), row, work);
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

/// What is decoded of a batch of sub-volumes before its voxels are: for each sub-volume a word, so that every loop over
/// them is one that the compiler vectorises.
struct Work {
    /// The value of index 0 in each byte, and what makes that of index 1 of it.
    low: [u32; BATCH],
    low_change: [u32; BATCH],
    /// The value of index 2 in each byte, and what makes that of index 3 of it.
    high: [u32; BATCH],
    high_change: [u32; BATCH],
    /// The table of one slice.
    table: [u32; BATCH],
}

impl Default for Work {
    fn default() -> Self {
        let zero = [0; BATCH];
        Self { low: zero, low_change: zero, high: zero, high_change: zero, table: zero }
    }
}

/// Decodes a row of sub-volumes with the widest registers there are.
fn decode_row(s: usize, field: Field, width: usize, row: &mut Row<'_>, work: &mut Work) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        #[expect(unsafe_code, reason = "the one door to code for a processor that was asked first")]
        // SAFETY: the processor has AVX2, see above.
        unsafe {
            decode_row_avx2(s, field, width, row, work);
        }
        return;
    }
    decode_row_portable(s, field, width, row, work);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn decode_row_avx2(s: usize, field: Field, width: usize, row: &mut Row<'_>, work: &mut Work) {
    decode_row_portable(s, field, width, row, work);
}

/// Decodes a row of sub-volumes. Divisions are by constants, so that they can be vectorised.
#[inline(always)]
fn decode_row_portable(s: usize, field: Field, width: usize, row: &mut Row<'_>, work: &mut Work) {
    match field.most {
        0xF => decode_batches(s, Field { most: 0xF, ..field }, width, row, work),
        0x1F => decode_batches(s, Field { most: 0x1F, ..field }, width, row, work),
        0x3F => decode_batches(s, Field { most: 0x3F, ..field }, width, row, work),
        0xFF => decode_batches(s, Field { most: 0xFF, ..field }, width, row, work),
        _ => decode_batches(s, Field { most: 0xFFFF, ..field }, width, row, work),
    }
}

#[inline(always)]
fn decode_batches(s: usize, field: Field, width: usize, row: &mut Row<'_>, work: &mut Work) {
    let (heads, _) = row.heads.as_chunks::<HEAD_BYTES>();
    let (words, _) = row.tables.as_chunks::<4>();
    for (batch, (heads, words)) in heads.chunks(BATCH).zip(words.chunks(BATCH * s)).enumerate() {
        let low = work.low.iter_mut().zip(&mut work.low_change);
        let high = work.high.iter_mut().zip(&mut work.high_change);
        for (((low, low_change), (high, high_change)), head) in low.zip(high).zip(heads) {
            let levels = field.levels(field.unpack(u32::from_le_bytes(*head)));
            *low = levels[0] * EVERY_BYTE;
            *low_change = (levels[0] ^ levels[1]) * EVERY_BYTE;
            *high = levels[2] * EVERY_BYTE;
            *high_change = (levels[2] ^ levels[3]) * EVERY_BYTE;
        }
        for (z, slice) in row.slices.iter_mut().enumerate().take(s) {
            for (table, words) in work.table.iter_mut().zip(words.chunks_exact(s)) {
                *table = u32::from_le_bytes(words[z]);
            }
            for (j, line) in slice.chunks_mut(width).enumerate() {
                let (whole, rest) = line[batch * BATCH * EDGE..].as_chunks_mut::<EDGE>();
                let low = work.low.iter().zip(&work.low_change);
                let high = work.high.iter().zip(&work.high_change);
                let sub_volumes = low.zip(high).zip(&work.table);
                for (voxels, ((low, high), table)) in whole.iter_mut().zip(sub_volumes.clone()) {
                    *voxels = four_voxels(low, high, table >> (8 * j) & 0xFF);
                }
                if let (false, Some(((low, high), table))) =
                    (rest.is_empty(), sub_volumes.clone().nth(whole.len()))
                {
                    let voxels = four_voxels(low, high, table >> (8 * j) & 0xFF);
                    rest.copy_from_slice(&voxels[..rest.len()]);
                }
            }
        }
    }
}

/// The voxels of a row of a sub-volume, by its byte of the table. Each pair is a value in every byte, and what makes the
/// next of it.
#[inline(always)]
fn four_voxels(
    (&low, &low_change): (&u32, &u32),
    (&high, &high_change): (&u32, &u32),
    indices: u32,
) -> [u8; EDGE] {
    // The two bits of voxel x go to the lowest of byte x.
    let indices = indices | indices << 12;
    let indices = indices | indices << 6;
    let (odd, upper) = (mask(indices), mask(indices >> 1));
    let low = low ^ low_change & odd;
    let high = high ^ high_change & odd;
    (low ^ (low ^ high) & upper).to_le_bytes()
}

/// A word of four bytes 1.
const EVERY_BYTE: u32 = 0x0101_0101;

/// 255 in each byte whose lowest bit is set, 0 in the others.
#[inline(always)]
fn mask(bits: u32) -> u32 {
    let bits = bits & EVERY_BYTE;
    (bits << 8).wrapping_sub(bits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vector_registers_change_nothing() {
        let extent = Extent3::new([4 * 150 + 3, 7, 11]).unwrap();
        for layout in Layout::ALL {
            let bytes: Vec<u8> =
                (0..layout.encoded_len(extent) as u64).map(|i| ((i * i * 0x9E37_79B9) >> 13) as u8).collect();
            let (heads, tables) = bytes.split_at(layout.head_len(extent));
            for at in 0..layout.t().into() {
                let mut dispatched = vec![0; extent.voxels()];
                step(layout, heads, tables, extent, at, &mut dispatched);
                let mut portable = vec![0; extent.voxels()];
                for mut row in rows(layout, heads, tables, extent, &mut portable) {
                    let field = Field::new(layout.t().into(), at);
                    decode_row_portable(layout.s.into(), field, extent.x(), &mut row, &mut Work::default());
                }
                assert!(dispatched == portable, "{layout} step {at}");
            }
        }
    }
}
