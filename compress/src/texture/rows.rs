//! The four rows of voxels of a row of blocks, as table indices in the first cache.

use super::domain::Domain;
use super::volume::Volume;
use crate::simd::{Simd, in_each_kind};

/// Voxels of a block along x, and along y.
pub(super) const EDGE: usize = 4;

/// Voxels of a block.
pub(super) const VOXELS: usize = EDGE * EDGE;

/// Blocks that are looked at together.
pub(super) const GROUP: usize = 8;

/// Voxels of a row of a group.
pub(super) const WIDE: usize = GROUP * EDGE;

/// The four rows of some blocks, as table indices, and the range of each block.
///
/// Voxels are read row by row, since that is what hardware reads ahead in; to look at a line of each of four rows at
/// once is half as fast.
#[derive(Debug)]
pub(super) struct Rows {
    indices: [Vec<[u16; WIDE]>; EDGE],
    ranges: Vec<Ranges>,
}

/// The four rows of a block.
pub(super) type Block<'a> = [&'a [u16; EDGE]; EDGE];

/// The least and the greatest index of each block of a group, and of all.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Ranges {
    pub(super) low: [u16; GROUP],
    pub(super) high: [u16; GROUP],
    pub(super) all: [u16; 2],
}

impl Rows {
    /// Room for rows of at most `blocks` blocks.
    pub(super) fn new(blocks: usize) -> Self {
        let groups = blocks.div_ceil(GROUP);
        let row = || vec![[0; WIDE]; groups];
        Self { indices: [row(), row(), row(), row()], ranges: vec![Ranges::default(); groups] }
    }

    /// Reads `count` blocks from block `[x, y, z]` of the volume on. Past the volume's edges, and past the blocks in the
    /// last group, the last voxel is repeated.
    pub(super) fn read(
        &mut self,
        volume: &Volume<'_>,
        domain: &Domain,
        at: [usize; 3],
        count: usize,
        simd: Simd,
    ) {
        read(self, volume, domain, at, count, simd);
    }

    #[inline(always)]
    fn read_indices(&mut self, volume: &Volume<'_>, domain: &Domain, [x, y, z]: [usize; 3], count: usize) {
        let (extent, first) = (volume.extent(), x * EDGE);
        let inside = (count * EDGE).min(extent.x() - first);
        for (j, row) in self.indices.iter_mut().enumerate() {
            let row = row[..count.div_ceil(GROUP)].as_flattened_mut();
            let (row, past) = row.split_at_mut(inside);
            let at = [first, (y * EDGE + j).min(extent.y() - 1), z];
            volume.indices(domain, at, row);
            past.fill(row.last().copied().unwrap_or_default());
            // What is read next, while these are encoded.
            volume.fetch_ahead(at, inside, EDGE);
        }
    }

    #[inline(always)]
    fn find_ranges(&mut self, count: usize, of: impl Fn([&[u16; WIDE]; EDGE]) -> Ranges) {
        let [a, b, c, d] = &self.indices;
        for (i, out) in self.ranges.iter_mut().enumerate().take(count.div_ceil(GROUP)) {
            *out = of([&a[i], &b[i], &c[i], &d[i]]);
        }
    }

    /// The least and the greatest index of block `i` of what was read.
    #[inline(always)]
    pub(super) fn range(&self, i: usize) -> [u16; 2] {
        let Ranges { low, high, .. } = &self.ranges[i / GROUP];
        [low[i % GROUP], high[i % GROUP]]
    }

    /// The ranges of group `i` of what was read.
    #[inline(always)]
    pub(super) fn ranges(&self, i: usize) -> &Ranges {
        &self.ranges[i]
    }

    /// Block `i` of what was read.
    #[inline(always)]
    pub(super) fn block(&self, i: usize) -> Block<'_> {
        let [a, b, c, d] = &self.indices;
        let (group, i) = (i / GROUP, i % GROUP);
        [
            &a[group].as_chunks().0[i],
            &b[group].as_chunks().0[i],
            &c[group].as_chunks().0[i],
            &d[group].as_chunks().0[i],
        ]
    }
}

in_each_kind! {
    fn read(rows: &mut Rows, volume: &Volume<'_>, domain: &Domain, at: [usize; 3], count: usize),
    plain {
        rows.read_indices(volume, domain, at, count);
        rows.find_ranges(count, ranges);
    },
    wide {
        rows.read_indices(volume, domain, at, count);
        rows.find_ranges(count, |rows| ranges_avx2(rows));
    }
}

/// The ranges of a group.
fn ranges(rows: [&[u16; WIDE]; EDGE]) -> Ranges {
    let mut ranges = Ranges { low: [u16::MAX; GROUP], high: [0; GROUP], all: [u16::MAX, 0] };
    for row in rows {
        for (i, index) in row.iter().enumerate() {
            let (low, high) = (&mut ranges.low[i / EDGE], &mut ranges.high[i / EDGE]);
            (*low, *high) = ((*low).min(*index), (*high).max(*index));
        }
    }
    let (low, high) = (ranges.low.iter(), ranges.high.iter());
    ranges.all = [low.fold(u16::MAX, |a, b| a.min(*b)), high.fold(0, |a, b| a.max(*b))];
    ranges
}

/// The same with the instructions for it: the compiler finds the minima of neighbours in no loop reliably.
#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx2")]
fn ranges_avx2(rows: [&[u16; WIDE]; EDGE]) -> Ranges {
    use std::arch::x86_64::{
        __m256i, _mm_extract_epi16, _mm_minpos_epu16, _mm_packus_epi32, _mm_set1_epi8, _mm_setr_epi8,
        _mm_shuffle_epi8, _mm_xor_si128, _mm256_and_si256, _mm256_castsi256_si128, _mm256_extracti128_si256,
        _mm256_max_epu16, _mm256_min_epu16, _mm256_or_si256, _mm256_set1_epi64x, _mm256_slli_epi64,
        _mm256_srli_epi32, _mm256_srli_epi64,
    };

    let row = |j: usize| -> [__m256i; 2] { bytemuck::cast(*rows[j]) };
    let [a, b, c, d] = [row(0), row(1), row(2), row(3)];
    let (mut least, mut most) = (a, a);
    for i in 0..2 {
        least[i] = _mm256_min_epu16(_mm256_min_epu16(a[i], b[i]), _mm256_min_epu16(c[i], d[i]));
        most[i] = _mm256_max_epu16(_mm256_max_epu16(a[i], b[i]), _mm256_max_epu16(c[i], d[i]));
        // The upper half of each pair onto the lower, then of each four, a block.
        least[i] = _mm256_min_epu16(least[i], _mm256_srli_epi32::<16>(least[i]));
        least[i] = _mm256_min_epu16(least[i], _mm256_srli_epi64::<32>(least[i]));
        most[i] = _mm256_max_epu16(most[i], _mm256_srli_epi32::<16>(most[i]));
        most[i] = _mm256_max_epu16(most[i], _mm256_srli_epi64::<32>(most[i]));
    }
    // Lanes of 64 bits that end in a block's value, to eight of 16 in order.
    let in_order = _mm_setr_epi8(0, 1, 4, 5, 8, 9, 12, 13, 2, 3, 6, 7, 10, 11, 14, 15);
    let [low, high] = [least, most].map(|[first, second]| {
        let ends = _mm256_set1_epi64x(0xFFFF);
        let both = _mm256_or_si256(
            _mm256_and_si256(first, ends),
            _mm256_slli_epi64::<32>(_mm256_and_si256(second, ends)),
        );
        let both = _mm_packus_epi32(_mm256_castsi256_si128(both), _mm256_extracti128_si256::<1>(both));
        _mm_shuffle_epi8(both, in_order)
    });
    let all_ones = _mm_set1_epi8(-1);
    let least_of_all = _mm_extract_epi16::<0>(_mm_minpos_epu16(low)) as u16;
    let most_of_all = !_mm_extract_epi16::<0>(_mm_minpos_epu16(_mm_xor_si128(high, all_ones))) as u16;
    Ranges { low: bytemuck::cast(low), high: bytemuck::cast(high), all: [least_of_all, most_of_all] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_groups_are_the_same_with_instructions_for_them() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) as u16
        };
        for _ in 0..1000 {
            let rows: [[u16; WIDE]; EDGE] = std::array::from_fn(|_| std::array::from_fn(|_| random()));
            let plain = ranges(rows.each_ref());
            for i in 0..GROUP {
                let block = rows.iter().flat_map(|row| &row[i * EDGE..][..EDGE]);
                assert_eq!(Some(&plain.low[i]), block.clone().min(), "least of block {i}");
                assert_eq!(Some(&plain.high[i]), block.max(), "greatest of block {i}");
            }
            #[cfg(target_arch = "x86_64")]
            if Simd::best() != Simd::Plain {
                // SAFETY: AVX2 was detected.
                #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
                let ranges = unsafe { ranges_avx2(rows.each_ref()) };
                assert_eq!(ranges, plain, "{rows:?}");
            }
        }
    }
}
