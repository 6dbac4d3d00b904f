//! Blocks of colours that lie on one curve, encoded from the places on that curve alone.
//!
//! A transfer function of one variable is a curve through colours and opacity, so a voxel is known by its place: the
//! way along the curve of colours, and the opacity there. Where the curve between the least and the greatest sample
//! of a block is nearly straight, its ends are the block's end points and the way along is the index: no colour
//! is looked up, no axis is sought. Opacity is the block of BC4 in BC3, from its own range.
//!
//! Plain loops over arrays of whole numbers, one operation of one width at a time, so that they are vectorised where
//! this is inlined; the results are exact, so the bytes do not depend on the instructions used.

use super::rows::{EDGE, Group, VOXELS};
use super::table::ColourTable;
use crate::simd::Simd;

/// Blocks encoded together.
pub(super) const BATCH: usize = 64;

/// Blocks that loops are rounded up to, so that no instruction is narrower than it could be.
const LANES: usize = 32;

/// A number for each block.
type PerBlock<T> = [T; BATCH];

/// Blocks that wait to be encoded. Voxel by voxel, so that a loop over the blocks does the same in each.
#[derive(Debug)]
pub(super) struct Batch {
    /// The place of each voxel: opacity in the low half, the way along in the high half.
    places: [PerBlock<u32>; VOXELS],
    /// The ways along of the ends of the block's part of the curve, and the colours there.
    from: PerBlock<u16>,
    to: PerBlock<u16>,
    ends: PerBlock<[[u8; 4]; 2]>,
    /// Which block of the output each is.
    at: PerBlock<u32>,
    /// How many wait.
    len: usize,
}

impl Batch {
    pub(super) fn new() -> Self {
        Self {
            places: [[0; BATCH]; VOXELS],
            from: [0; BATCH],
            to: [0; BATCH],
            ends: [[[0; 4]; 2]; BATCH],
            at: [0; BATCH],
            len: 0,
        }
    }

    /// Adds block `i` of a group, whose indices are in `[low, high]`, as block `at` of the output; says whether the
    /// batch is full.
    #[inline(always)]
    pub(super) fn push(
        &mut self,
        group: Group<'_>,
        i: usize,
        [low, high]: [u16; 2],
        table: &ColourTable,
        at: usize,
    ) -> bool {
        let (places, b) = (table.places(), self.len & (BATCH - 1));
        for (j, places_of_row) in self.places.as_chunks_mut::<EDGE>().0.iter_mut().enumerate() {
            for (index, place) in group.block_row(i, j).iter().zip(places_of_row) {
                place[b] = places[usize::from(*index)];
            }
        }
        self.from[b] = (places[usize::from(low)] >> 16) as u16;
        self.to[b] = (places[usize::from(high)] >> 16) as u16;
        self.ends[b] = [table.colours()[usize::from(low)], table.colours()[usize::from(high)]];
        self.at[b] = at as u32;
        self.len = b + 1;
        self.len == BATCH
    }

    /// Encodes what waits into its places in `blocks`: BC3, or BC1 if a block has 8 bytes.
    pub(super) fn flush<const BYTES: usize>(&mut self, blocks: &mut [[u8; BYTES]], simd: Simd) {
        match simd {
            Simd::Plain => self.encode(blocks),
            #[cfg(target_arch = "x86_64")]
            Simd::Avx2(_) => {
                #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
                // SAFETY: a value of that variant exists only where AVX2, BMI1, BMI2 and LZCNT were detected.
                unsafe {
                    self.encode_avx2(blocks);
                }
            }
        }
        self.len = 0;
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn encode_avx2<const BYTES: usize>(&self, blocks: &mut [[u8; BYTES]]) {
        self.encode(blocks);
    }

    #[inline(always)]
    fn encode<const BYTES: usize>(&self, blocks: &mut [[u8; BYTES]]) {
        if self.len == 0 {
            return;
        }
        let lanes = self.len.next_multiple_of(LANES).min(BATCH);
        let colours = self.colours(lanes);
        for (block, at) in colours[..self.len].iter().zip(self.at) {
            blocks[at as usize][BYTES - 8..].copy_from_slice(&block.to_le_bytes());
        }
        if BYTES == 16 {
            let opacities = self.opacities(lanes);
            for (block, at) in opacities[..self.len].iter().zip(self.at) {
                blocks[at as usize][..8].copy_from_slice(&block.to_le_bytes());
            }
        }
    }

    /// The blocks of colours between the ends.
    #[inline(always)]
    fn colours(&self, lanes: usize) -> PerBlock<u64> {
        // The ways from the first end, that of the greatest sample, halfway between the thirds.
        let mut halfway = [[0_u16; BATCH]; 3];
        for (halfway, sixths) in halfway.iter_mut().zip([1, 3, 5]) {
            for (halfway, (from, to)) in halfway.iter_mut().zip(self.from.iter().zip(&self.to)) {
                *halfway = (u32::from(to.wrapping_sub(*from)) * sixths / 6) as u16;
            }
        }
        // Two bits a voxel, eight voxels a number.
        let mut thirds = [[0_u16; BATCH]; 2];
        for (i, places) in self.places.iter().enumerate() {
            let (thirds, shift) = (&mut thirds[i / 8], 2 * (i as u16 % 8));
            for b in 0..lanes {
                let way = self.to[b].wrapping_sub((places[b] >> 16) as u16);
                let third = u16::from(way > halfway[0][b])
                    + u16::from(way > halfway[1][b])
                    + u16::from(way > halfway[2][b]);
                thirds[b] |= third << shift;
            }
        }
        let mut blocks = [0; BATCH];
        for b in 0..lanes {
            let [low, high] = self.ends[b];
            let (c0, c1) = (packed(high), packed(low));
            let thirds = u64::from(thirds[0][b]) | u64::from(thirds[1][b]) << 16;
            // Thirds of the way from the first colour have the indices 0, 2, 3, 1.
            let (ones, twos) = (thirds & 0x5555_5555, thirds >> 1 & 0x5555_5555);
            let indices = (ones ^ twos) << 1 | twos;
            // The greater end first, else it would be another mode in BC1; 0 and 1 change places then, 2 and 3 too.
            let indices = indices ^ if c0 < c1 { 0x5555_5555 } else { 0 };
            let indices = if c0 == c1 { 0 } else { indices };
            blocks[b] = c0.max(c1) | c0.min(c1) << 16 | indices << 32;
        }
        blocks
    }

    /// The blocks of opacities.
    #[inline(always)]
    fn opacities(&self, lanes: usize) -> PerBlock<u64> {
        let mut opacities = [[0; BATCH]; VOXELS];
        let (mut low, mut high) = ([u16::MAX; BATCH], [0; BATCH]);
        for (places, opacities) in self.places.iter().zip(&mut opacities) {
            for b in 0..lanes {
                let opacity = places[b] as u16;
                opacities[b] = opacity;
                low[b] = low[b].min(opacity);
                high[b] = high[b].max(opacity);
            }
        }
        let mut scales = [[0_u16; BATCH]; 4];
        for b in 0..lanes {
            let [first, last] = [high[b], low[b]].map(|end| (u32::from(end) + 128) / 257);
            let Sevenths { unit, factor } = SEVENTHS[(first - last) as usize & 255];
            (high[b], low[b]) = (first as u16, last as u16);
            let [top, span, unit, factor] = [first as u16 * 257, (first - last) as u16 * 257, unit, factor];
            for (scale, value) in scales.iter_mut().zip([top, span, unit, factor]) {
                scale[b] = value;
            }
        }
        let [top, span, unit, factor] = &scales;
        // Three bits a voxel, four voxels a number.
        let mut sevenths = [[0_u16; BATCH]; 4];
        for (i, opacities) in opacities.iter().enumerate() {
            let (sevenths, shift) = (&mut sevenths[i / 4], 3 * (i as u16 % 4));
            for b in 0..lanes {
                let from_top = top[b].saturating_sub(opacities[b]).min(span[b]).wrapping_mul(unit[b]);
                let place = ((u32::from(from_top) * u32::from(factor[b])) >> 16) as u16;
                // Sevenths from the first end have the indices 0, then 2 to 7, then 1.
                let next = ((place + 0x1800) >> 12) & 7;
                let index = next ^ u16::from(next < 2);
                sevenths[b] |= index << shift;
            }
        }
        let mut blocks = [0; BATCH];
        for b in 0..lanes {
            let indices = (0..4).fold(0, |sum, i| sum | u64::from(sevenths[i][b]) << (12 * i));
            // Ends alike are another mode, where 0 is the first end, too.
            let indices = if high[b] == low[b] { 0 } else { indices };
            blocks[b] = u64::from(high[b] | low[b] << 8) | indices << 16;
        }
        blocks
    }
}

/// How a distance from the first end becomes sevenths of a span, in whole numbers of 16 bits: times `unit`, which
/// makes the span as long as 16 bits hold, times `factor` / 2¹⁶, it is 2¹² for each.
#[derive(Clone, Copy)]
struct Sevenths {
    unit: u16,
    factor: u16,
}

/// By the span in 1/255.
static SEVENTHS: [Sevenths; 256] = {
    let mut table = [Sevenths { unit: 0, factor: 0 }; 256];
    let mut span = 1;
    while span < 256 {
        let wide = span as u16 * 257;
        let shift = wide.leading_zeros();
        let longest = (wide as u32) << shift;
        let factor = ((7 << 28) + longest / 2) / longest;
        table[span] = Sevenths { unit: 1 << shift, factor: factor as u16 };
        span += 1;
    }
    table
};

/// A colour in 5:6:5 bits, rounded to the nearest.
#[inline(always)]
fn packed([red, green, blue, _]: [u8; 4]) -> u64 {
    let [red, green, blue] = [red, green, blue].map(u64::from);
    // Exact for all of 8 bits: (31·v + 127)/255 and (63·v + 127)/255.
    ((red * 249 + 1014) >> 11) << 11 | ((green * 253 + 505) >> 10) << 5 | ((blue * 249 + 1014) >> 11)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_8_bits_are_rounded_to_the_nearest_of_5_and_6() {
        for v in 0..=255_u8 {
            let nearest = |most: f64| (f64::from(v) * most / 255.0).round() as u64;
            assert_eq!(packed([v, 0, 0, 0]) >> 11, nearest(31.0), "red {v}");
            assert_eq!(packed([0, v, 0, 0]) >> 5, nearest(63.0), "green {v}");
            assert_eq!(packed([0, 0, v, 0]), nearest(31.0), "blue {v}");
        }
    }

    #[test]
    fn sevenths_are_the_nearest_for_every_span_and_distance() {
        for span in 1..256_u32 {
            let Sevenths { unit, factor } = SEVENTHS[span as usize];
            for distance in (0..=span * 257).step_by(13) {
                let place = (((distance * u32::from(unit) * u32::from(factor)) >> 16) + 0x800) >> 12;
                let exact = f64::from(distance) * 7.0 / f64::from(span * 257);
                assert!(
                    (f64::from(place) - exact).abs() < 0.501,
                    "{distance} of {span}: {place}, not {exact}"
                );
            }
        }
    }
}
