//! The decoder: rows of sub-volumes along x, many at a time.

use rayon::prelude::*;

use super::ends::Field;
use super::{EDGE, HEAD_BYTES, Layout, MOST_SLICES};
use crate::Extent3;

/// Sub-volumes that are decoded together: their palettes stay in the nearest cache.
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

/// Decodes a row of sub-volumes with the widest registers there are.
fn decode_row(s: usize, field: Field, width: usize, row: &mut Row<'_>) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        #[expect(unsafe_code, reason = "the one door to code for a processor that was asked first")]
        // SAFETY: the processor has AVX2, see above.
        unsafe {
            decode_row_avx2(s, field, width, row);
        }
        return;
    }
    decode_row_portable(s, field, width, row);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn decode_row_avx2(s: usize, field: Field, width: usize, row: &mut Row<'_>) {
    decode_row_portable(s, field, width, row);
}

/// Decodes a row of sub-volumes. Divisions are by constants, so that they can be vectorised.
#[inline(always)]
fn decode_row_portable(s: usize, field: Field, width: usize, row: &mut Row<'_>) {
    match field.most {
        0xF => decode_batches(s, Field { most: 0xF, ..field }, width, row),
        0x1F => decode_batches(s, Field { most: 0x1F, ..field }, width, row),
        0x3F => decode_batches(s, Field { most: 0x3F, ..field }, width, row),
        0xFF => decode_batches(s, Field { most: 0xFF, ..field }, width, row),
        _ => decode_batches(s, Field { most: 0xFFFF, ..field }, width, row),
    }
}

/// Each loop here does the same to many sub-volumes, four voxels in a word: that is what the compiler vectorises.
#[inline(always)]
fn decode_batches(s: usize, field: Field, width: usize, row: &mut Row<'_>) {
    let (heads, _) = row.heads.as_chunks::<HEAD_BYTES>();
    let (words, _) = row.tables.as_chunks::<4>();
    for (batch, (heads, words)) in heads.chunks(BATCH).zip(words.chunks(BATCH * s)).enumerate() {
        let mut palettes = [Palette::default(); BATCH];
        for (palette, head) in palettes.iter_mut().zip(heads) {
            *palette = Palette::new(field, u32::from_le_bytes(*head));
        }
        let palettes = &palettes[..heads.len()];
        for (z, slice) in row.slices.iter_mut().enumerate().take(s) {
            let mut tables = [0; BATCH];
            for (table, words) in tables.iter_mut().zip(words.chunks_exact(s)) {
                *table = u32::from_le_bytes(words[z]);
            }
            for (j, line) in slice.chunks_mut(width).enumerate() {
                let (whole, rest) = line[batch * BATCH * EDGE..].as_chunks_mut::<EDGE>();
                for ((voxels, palette), table) in whole.iter_mut().zip(palettes).zip(tables) {
                    *voxels = palette.voxels(table >> (8 * j) & 0xFF);
                }
                if let (Some(palette), Some(table)) = (palettes.get(whole.len()), tables.get(whole.len())) {
                    let voxels = palette.voxels(table >> (8 * j) & 0xFF);
                    rest.copy_from_slice(&voxels[..rest.len()]);
                }
            }
        }
    }
}

/// The four values of a sub-volume, each in every byte of a word, in the form that a choice of two needs: one, and
/// what makes the other of it.
#[derive(Debug, Clone, Copy, Default)]
struct Palette {
    low: u32,
    low_change: u32,
    high: u32,
    high_change: u32,
}

impl Palette {
    #[inline(always)]
    fn new(field: Field, head: u32) -> Self {
        let [a, b, c, d] = field.levels(field.unpack(head)).map(|level| level * EVERY_BYTE);
        Self { low: a, low_change: a ^ b, high: c, high_change: c ^ d }
    }

    /// The voxels of a row, by its byte of the table.
    #[inline(always)]
    fn voxels(&self, indices: u32) -> [u8; EDGE] {
        // The two bits of voxel x go to the lowest of byte x.
        let indices = indices | indices << 12;
        let indices = indices | indices << 6;
        let (odd, upper) = (mask(indices), mask(indices >> 1));
        let low = self.low ^ self.low_change & odd;
        let high = self.high ^ self.high_change & odd;
        (low ^ (low ^ high) & upper).to_le_bytes()
    }
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
                    decode_row_portable(layout.s().into(), field, extent.x(), &mut row);
                }
                assert!(dispatched == portable, "{layout} step {at}");
            }
        }
    }
}
