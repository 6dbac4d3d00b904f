//! Blocks of colours that lie on one curve, encoded from the places on that curve alone.
//!
//! A transfer function of one variable is a curve through colours and opacity, so a voxel is known by its place: the
//! way along the curve of colours, and the opacity there. Where the curve between the least and the greatest sample
//! of a block is nearly straight, its ends are the block's end points and the way along is the index: no colour
//! is looked up, no axis is sought. Opacity is the block of BC4 in BC3, from its own range.
//!
//! All is done in whole numbers, so the bytes do not depend on the instructions used.

#![expect(clippy::needless_range_loop, reason = "loops over lanes, the same in all arrays, must vectorise")]

use super::rows::{Block, EDGE, VOXELS};
use super::table::ColourTable;
use crate::bc::fast::group::{GROUP, Parts, PerBlock, stored};
use crate::simd::{Simd, in_each_kind};

/// The places of a block's voxels, opacity in the low half, the way along in the high half; rows 0, 2, 1 and 3.
type Places = [u32; VOXELS];

/// Where a row of a block stands in [`Places`].
const ROWS: [usize; EDGE] = [0, 2, 1, 3];

/// Blocks that wait to be encoded.
#[derive(Debug, Default)]
pub(super) struct Batch {
    places: PerBlock<Places>,
    /// The ways along of the ends of the block's part of the curve, and the colours there in 5:6:5 bits.
    from: PerBlock<u16>,
    to: PerBlock<u16>,
    first: PerBlock<u32>,
    second: PerBlock<u32>,
    /// Which block of the output each is.
    at: PerBlock<u32>,
    /// How many wait.
    len: usize,
}

/// What the indices of blocks are found with.
#[derive(Debug, Default)]
struct Scales {
    /// The greatest way along, and where the indices change in the way down from it; both less 2¹⁵.
    to: PerBlock<u16>,
    halfway: [PerBlock<i16>; 3],
    /// The greater end of opacity, how far the other is below it, and how that becomes sevenths, see [`Sevenths`].
    top: PerBlock<u16>,
    span: PerBlock<u16>,
    unit: PerBlock<u16>,
    factor: PerBlock<u16>,
}

impl Batch {
    /// Adds a block, whose indices are in `[low, high]`, as block `at` of the output; says whether the batch is full.
    #[inline(always)]
    pub(super) fn push(
        &mut self,
        block: Block<'_>,
        [low, high]: [u16; 2],
        table: &ColourTable,
        at: usize,
    ) -> bool {
        let (places, b) = (table.places(), self.len & (GROUP - 1));
        let own = self.places[b].as_chunks_mut::<EDGE>().0;
        for (row, indices) in ROWS.into_iter().zip(block) {
            for (index, place) in indices.iter().zip(&mut own[row]) {
                *place = places[usize::from(*index)];
            }
        }
        self.from[b] = (places[usize::from(low)] >> 16) as u16;
        self.to[b] = (places[usize::from(high)] >> 16) as u16;
        self.first[b] = table.packed()[usize::from(high)].into();
        self.second[b] = table.packed()[usize::from(low)].into();
        self.at[b] = at as u32;
        self.len = b + 1;
        self.len == GROUP
    }

    /// Encodes what waits into its places in `blocks`: BC3, or BC1 if a block has 8 bytes.
    pub(super) fn flush<const BYTES: usize>(&mut self, blocks: &mut [[u8; BYTES]], simd: Simd) {
        if self.len > 0 {
            encode(self, blocks, simd);
            self.len = 0;
        }
    }

    #[inline(always)]
    fn encode<const BYTES: usize>(
        &self,
        blocks: &mut [[u8; BYTES]],
        opacities: impl Fn(&Places) -> [u16; 2],
        indices: impl Fn(&Places, &Scales, usize) -> [[u32; 2]; 2],
    ) {
        let (mut parts, mut scales) = (Parts::default(), Scales::default());
        parts.order_ends(&self.first, &self.second);
        for l in 0..GROUP {
            let way = u32::from(self.to[l].wrapping_sub(self.from[l]));
            scales.to[l] = self.to[l] ^ 0x8000;
            for (halfway, sixths) in scales.halfway.iter_mut().zip([1, 3, 5]) {
                halfway[l] = ((way * sixths / 6) as u16 ^ 0x8000) as i16;
            }
        }
        if BYTES == 16 {
            let mut ranges = [[0; GROUP]; 2];
            for l in 0..self.len.min(GROUP) {
                [ranges[0][l], ranges[1][l]] = opacities(&self.places[l]);
            }
            let [lows, highs] = ranges.map(|row| row.map(|end| ((u32::from(end) + 128) / 257) as u16));
            for l in 0..GROUP {
                let Sevenths { unit, factor } = SEVENTHS[usize::from(highs[l] - lows[l]) & 255];
                scales.top[l] = highs[l] * 257;
                scales.span[l] = (highs[l] - lows[l]) * 257;
                (scales.unit[l], scales.factor[l]) = (unit, factor);
            }
            parts.take_alphas(&highs, &lows);
        }
        for l in 0..self.len.min(GROUP) {
            parts.indices[l] = indices(&self.places[l], &scales, l);
        }
        let all = parts.blocks();
        for l in 0..self.len.min(GROUP) {
            let mut block = all[l];
            if self.first[l] == self.second[l] {
                // Index 3 of ends that are alike is no colour in BC1.
                block[1] &= 0xFFFF_FFFF;
            }
            stored(block, &mut blocks[self.at[l] as usize]);
        }
    }
}

in_each_kind! {
    fn encode<const BYTES: usize>(batch: &Batch, blocks: &mut [[u8; BYTES]]),
    plain batch.encode(blocks, plain::opacities, plain::indices),
    wide batch.encode(
        blocks,
        |places| avx2::opacities(places),
        |places, scales, l| avx2::indices::<BYTES>(places, scales, l),
    )
}

/// What is found block by block, in plain arithmetic.
mod plain {
    use super::{Places, ROWS, Scales, VOXELS};
    use crate::bc::fast::{INDICES_2, INDICES_3};
    use crate::texture::rows::EDGE;

    /// The least and the greatest opacity.
    pub(super) fn opacities(places: &Places) -> [u16; 2] {
        let opacities = places.map(|place| place as u16);
        [opacities.into_iter().fold(u16::MAX, u16::min), opacities.into_iter().fold(0, u16::max)]
    }

    /// The index bits of colour and of opacity, of rows 0 and 1, and of rows 2 and 3.
    pub(super) fn indices(places: &Places, scales: &Scales, l: usize) -> [[u32; 2]; 2] {
        let (mut colour, mut opacity) = (0_u32, 0_u64);
        for i in 0..VOXELS {
            let place = places[ROWS[i / EDGE] * EDGE + i % EDGE];
            let way = scales.to[l].wrapping_sub((place >> 16) as u16) as i16;
            let thirds = scales.halfway.iter().filter(|halfway| way > halfway[l]).count();
            colour |= u32::from(INDICES_2[thirds]) << (2 * i);
            let down = scales.top[l].saturating_sub(place as u16).min(scales.span[l]);
            let down = u32::from(down.wrapping_mul(scales.unit[l]));
            let sevenths = (((down * u32::from(scales.factor[l])) >> 16) + 0x800) >> 12;
            opacity |= u64::from(INDICES_3[sevenths as usize & 7]) << (3 * i);
        }
        [[colour & 0xFFFF, (opacity & 0xFF_FFFF) as u32], [colour >> 16, (opacity >> 24) as u32]]
    }
}

/// The same in AVX2.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::{
        __m256i, _mm_cvtsi128_si32, _mm_max_epu16, _mm_min_epu16, _mm_minpos_epu16, _mm_set1_epi16,
        _mm_xor_si128, _mm256_add_epi16, _mm256_blend_epi16, _mm256_castsi256_si128, _mm256_cmpgt_epi16,
        _mm256_extracti128_si256, _mm256_min_epu16, _mm256_mulhi_epu16, _mm256_mullo_epi16,
        _mm256_packus_epi32, _mm256_set1_epi16, _mm256_setzero_si256, _mm256_srli_epi16, _mm256_srli_epi32,
        _mm256_sub_epi16, _mm256_subs_epu16,
    };

    use super::{Places, Scales};
    use crate::bc::fast::avx2::packed_indices;

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn halves(places: &Places) -> [__m256i; 2] {
        bytemuck::cast(*places)
    }

    /// The opacities, rows 0 to 3 in order.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn opacity(places: &Places) -> __m256i {
        let [even, odd] = halves(places).map(|half| _mm256_blend_epi16::<0xAA>(half, _mm256_setzero_si256()));
        _mm256_packus_epi32(even, odd)
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    pub(super) fn opacities(places: &Places) -> [u16; 2] {
        let all = opacity(places);
        let (first, second) = (_mm256_castsi256_si128(all), _mm256_extracti128_si256::<1>(all));
        let low = _mm_cvtsi128_si32(_mm_minpos_epu16(_mm_min_epu16(first, second)));
        let ones = _mm_set1_epi16(-1);
        let high = _mm_cvtsi128_si32(_mm_minpos_epu16(_mm_xor_si128(_mm_max_epu16(first, second), ones)));
        [low as u16, !(high as u16)]
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    pub(super) fn indices<const BYTES: usize>(places: &Places, scales: &Scales, l: usize) -> [[u32; 2]; 2] {
        let all = |value: u16| _mm256_set1_epi16(value as i16);
        let [even, odd] = halves(places).map(|half| _mm256_srli_epi32::<16>(half));
        let way = _mm256_sub_epi16(all(scales.to[l]), _mm256_packus_epi32(even, odd));
        let passed = |i: usize| _mm256_cmpgt_epi16(way, _mm256_set1_epi16(scales.halfway[i][l]));
        let thirds = _mm256_add_epi16(_mm256_add_epi16(passed(0), passed(1)), passed(2));
        let thirds = _mm256_sub_epi16(_mm256_setzero_si256(), thirds);
        if BYTES == 8 {
            return packed_indices(thirds, thirds);
        }
        let down =
            _mm256_min_epu16(_mm256_subs_epu16(all(scales.top[l]), opacity(places)), all(scales.span[l]));
        let down = _mm256_mullo_epi16(down, all(scales.unit[l]));
        let sevenths = _mm256_add_epi16(_mm256_mulhi_epu16(down, all(scales.factor[l])), all(0x800));
        packed_indices(thirds, _mm256_srli_epi16::<12>(sevenths))
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

#[cfg(test)]
mod tests {
    use super::*;

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
