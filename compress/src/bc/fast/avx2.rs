//! The same in AVX2. Four rows of four texels are two registers: rows 0 and 2, and rows 1 and 3, so that packing both
//! gives rows 0 to 3 in order.

use std::arch::x86_64::{
    __m128i, __m256i, _mm_add_epi16, _mm_cvtsi128_si32, _mm_cvtsi128_si64, _mm_setr_epi16, _mm_srai_epi16,
    _mm_srli_si128, _mm_unpacklo_epi32, _mm_unpacklo_epi64, _mm256_abs_epi8, _mm256_add_epi16,
    _mm256_and_si256, _mm256_andnot_si256, _mm256_avg_epu8, _mm256_blendv_epi8, _mm256_broadcastsi128_si256,
    _mm256_castsi256_si128, _mm256_cmpeq_epi8, _mm256_cmpgt_epi16, _mm256_extracti128_si256,
    _mm256_i32gather_epi32, _mm256_madd_epi16, _mm256_maddubs_epi16, _mm256_max_epu8, _mm256_min_epu8,
    _mm256_mulhrs_epi16, _mm256_or_si256, _mm256_packs_epi16, _mm256_packs_epi32, _mm256_packus_epi16,
    _mm256_packus_epi32, _mm256_permute2x128_si256, _mm256_set_m128i, _mm256_set1_epi8, _mm256_set1_epi16,
    _mm256_set1_epi32, _mm256_setzero_si256, _mm256_shuffle_epi8, _mm256_shuffle_epi32, _mm256_sign_epi8,
    _mm256_slli_epi32, _mm256_srli_epi32, _mm256_sub_epi8, _mm256_sub_epi16, _mm256_sub_epi32,
    _mm256_subs_epu8, _mm256_unpackhi_epi8, _mm256_unpackhi_epi32, _mm256_unpacklo_epi8,
    _mm256_unpacklo_epi32, _mm256_xor_si256,
};

use super::group::{Centre, Lines, Ranges, Rows};
use super::{Four, SCALES, STRIP};
use crate::bc::batch::EDGE;

/// The blocks of a strip of scalars.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(super) fn strip(strip: [&[u8; STRIP * EDGE]; EDGE]) -> [[u8; 8]; STRIP] {
    let rows: [__m256i; 4] = strip.map(|row| bytemuck::cast(*row));
    let [a, b, c, d] = rows;
    let least = _mm256_min_epu8(_mm256_min_epu8(a, b), _mm256_min_epu8(c, d));
    let least = _mm256_min_epu8(least, _mm256_srli_epi32::<16>(least));
    let least = _mm256_min_epu8(least, _mm256_srli_epi32::<8>(least));
    let most = _mm256_max_epu8(_mm256_max_epu8(a, b), _mm256_max_epu8(c, d));
    let most = _mm256_max_epu8(most, _mm256_srli_epi32::<16>(most));
    let most = _mm256_max_epu8(most, _mm256_srli_epi32::<8>(most));
    let to_all = pattern([0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12]);
    let (low, high) = (_mm256_shuffle_epi8(least, to_all), _mm256_shuffle_epi8(most, to_all));
    let single = _mm256_cmpeq_epi8(low, high);
    let range = _mm256_sub_epi8(high, low);
    let narrow = _mm256_cmpeq_epi8(_mm256_min_epu8(range, _mm256_set1_epi8(6)), range);
    let lowered = _mm256_min_epu8(low, _mm256_set1_epi8(248_u8 as i8));
    let low = _mm256_blendv_epi8(low, lowered, narrow);
    let high = _mm256_blendv_epi8(high, _mm256_sub_epi8(lowered, _mm256_set1_epi8(-7)), narrow);
    let range = _mm256_srli_epi32::<24>(_mm256_sub_epi8(high, low));
    #[expect(unsafe_code, reason = "look-ups in a table")]
    // SAFETY: the table has 256 entries, and the indices 8 bits.
    let scale = unsafe { _mm256_i32gather_epi32::<4>(WIDE_SCALES.as_ptr().cast(), range) };
    let (scale_low, scale_high) = (_mm256_unpacklo_epi32(scale, scale), _mm256_unpackhi_epi32(scale, scale));
    let zero = _mm256_setzero_si256();
    let order = pattern([0, 2, 3, 4, 5, 6, 7, 1, 0, 0, 0, 0, 0, 0, 0, 0]);
    let twelve_bits = rows.map(|row| {
        let down = _mm256_subs_epu8(high, row);
        let first = _mm256_mulhrs_epi16(_mm256_unpacklo_epi8(down, zero), scale_low);
        let second = _mm256_mulhrs_epi16(_mm256_unpackhi_epi8(down, zero), scale_high);
        let indices = _mm256_shuffle_epi8(order, _mm256_packus_epi16(first, second));
        let pairs = _mm256_maddubs_epi16(indices, _mm256_set1_epi16(0x0801));
        _mm256_madd_epi16(pairs, _mm256_set1_epi32(0x0040_0001))
    });
    let [a, b, c, d] = twelve_bits;
    let byte = _mm256_set1_epi32(255);
    let ends =
        _mm256_or_si256(_mm256_and_si256(high, byte), _mm256_slli_epi32::<8>(_mm256_and_si256(low, byte)));
    let first =
        _mm256_or_si256(_mm256_or_si256(ends, _mm256_slli_epi32::<16>(a)), _mm256_slli_epi32::<28>(b));
    let second = _mm256_or_si256(
        _mm256_or_si256(_mm256_srli_epi32::<4>(b), _mm256_slli_epi32::<8>(c)),
        _mm256_slli_epi32::<20>(d),
    );
    // Of one value: it is both ends, and all indices are 0.
    let twice = _mm256_srli_epi32::<16>(_mm256_shuffle_epi8(least, to_all));
    let first = _mm256_blendv_epi8(first, twice, single);
    let second = _mm256_andnot_si256(single, second);
    let (low, high) = (_mm256_unpacklo_epi32(first, second), _mm256_unpackhi_epi32(first, second));
    bytemuck::cast([
        _mm256_permute2x128_si256::<0x20>(low, high),
        _mm256_permute2x128_si256::<0x31>(low, high),
    ])
}

/// [`SCALES`], in both halves of a number.
static WIDE_SCALES: [u32; 256] = {
    let mut wide = [0; 256];
    let mut i = 0;
    while i < 256 {
        wide[i] = SCALES[i] as u32 * 0x1_0001;
        i += 1;
    }
    wide
};

/// The same 16 bytes in both halves.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn pattern(bytes: [i8; 16]) -> __m256i {
    _mm256_broadcastsi128_si256(bytemuck::cast(bytes))
}

/// Rows 0 and 2, and rows 1 and 3.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn texels(rows: Rows<'_>) -> [__m256i; 2] {
    let [a, b, c, d] = rows.map(|four| bytemuck::cast::<Four, __m128i>(*four));
    [_mm256_set_m128i(c, a), _mm256_set_m128i(d, b)]
}

#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(super) fn ranges(rows: [&[Four]; EDGE], ranges: &mut Ranges) {
    let [(a, last_a), (b, last_b), (c, last_c), (d, last_d)] = rows.map(|row| row.as_chunks::<2>());
    let (low, high) = (ranges.low.as_chunks_mut::<2>().0, ranges.high.as_chunks_mut::<2>().0);
    for (((((a, b), c), d), low), high) in a.iter().zip(b).zip(c).zip(d).zip(low).zip(high) {
        (*low, *high) = pair_of_ranges([a, b, c, d]);
    }
    if let ([a], [b], [c], [d]) = (last_a, last_b, last_c, last_d) {
        let ([low, _], [high, _]) = pair_of_ranges([&[*a; 2], &[*b; 2], &[*c; 2], &[*d; 2]]);
        let l = rows[0].len() - 1;
        (ranges.low[l], ranges.high[l]) = (low, high);
    }
}

/// The ranges of two blocks side by side.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn pair_of_ranges(rows: [&[Four; 2]; EDGE]) -> ([[u8; 4]; 2], [[u8; 4]; 2]) {
    let [a, b, c, d] = rows.map(|row| bytemuck::cast::<[Four; 2], __m256i>(*row));
    let least = _mm256_min_epu8(_mm256_min_epu8(a, b), _mm256_min_epu8(c, d));
    let least = _mm256_min_epu8(least, _mm256_shuffle_epi32::<0x4E>(least));
    let least = _mm256_min_epu8(least, _mm256_shuffle_epi32::<0xB1>(least));
    let most = _mm256_max_epu8(_mm256_max_epu8(a, b), _mm256_max_epu8(c, d));
    let most = _mm256_max_epu8(most, _mm256_shuffle_epi32::<0x4E>(most));
    let most = _mm256_max_epu8(most, _mm256_shuffle_epi32::<0xB1>(most));
    // The least and the greatest of the first block, then those of the second.
    let both = _mm256_unpacklo_epi32(least, most);
    let (first, second) = (_mm256_castsi256_si128(both), _mm256_extracti128_si256::<1>(both));
    let (low, high) = (
        _mm_unpacklo_epi32(first, second),
        _mm_unpacklo_epi32(_mm_srli_si128::<4>(first), _mm_srli_si128::<4>(second)),
    );
    (bytemuck::cast(_mm_cvtsi128_si64(low)), bytemuck::cast(_mm_cvtsi128_si64(high)))
}

#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(super) fn sums([first, _, _, last]: Rows<'_>, centre: Centre) -> [i16; 2] {
    let texels = _mm256_set_m128i(bytemuck::cast(*last), bytemuck::cast(*first));
    let below = _mm256_set1_epi32(i32::from_le_bytes(centre.below));
    // Half of what a value is above the middle, rounded down.
    let off = _mm256_xor_si256(_mm256_avg_epu8(texels, below), _mm256_set1_epi8(-128));
    let lead = (centre.lead as usize).min(2);
    let others = _mm256_shuffle_epi8(off, bytemuck::cast(OTHERS_OF[lead]));
    let leading = _mm256_shuffle_epi8(off, bytemuck::cast(LEADING_OF[lead]));
    let columns = _mm256_maddubs_epi16(_mm256_abs_epi8(others), _mm256_sign_epi8(leading, others));
    let columns = _mm_add_epi16(_mm256_castsi256_si128(columns), _mm256_extracti128_si256::<1>(columns));
    let sums = _mm_srai_epi16::<1>(columns);
    let sums = _mm_add_epi16(sums, _mm_srli_si128::<8>(sums));
    let sums = _mm_add_epi16(sums, _mm_srli_si128::<4>(sums));
    bytemuck::cast(_mm_cvtsi128_si32(sums))
}

#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(super) fn indices<const BYTES: usize>(rows: Rows<'_>, lines: &Lines, l: usize) -> [[u32; 2]; 2] {
    let texels = texels(rows);
    let direction = _mm256_set1_epi32(i32::from_le_bytes(lines.direction[l]));
    let from = _mm256_set1_epi32(lines.from[l]);
    let [even, odd] = texels.map(|texels| {
        let pairs = _mm256_maddubs_epi16(texels, direction);
        _mm256_sub_epi32(from, _mm256_madd_epi16(pairs, _mm256_set1_epi16(1)))
    });
    let way = _mm256_packs_epi32(even, odd);
    let passed = |i: usize| _mm256_cmpgt_epi16(way, _mm256_set1_epi16(lines.halfway[i][l]));
    let thirds = _mm256_add_epi16(_mm256_add_epi16(passed(0), passed(1)), passed(2));
    let thirds = _mm256_sub_epi16(_mm256_setzero_si256(), thirds);
    if BYTES == 8 {
        return packed_indices(thirds, thirds);
    }
    let [even, odd] = texels.map(|texels| _mm256_srli_epi32::<24>(texels));
    let down = _mm256_sub_epi16(_mm256_set1_epi16(lines.top[l] as i16), _mm256_packs_epi32(even, odd));
    packed_indices(thirds, _mm256_mulhrs_epi16(down, _mm256_set1_epi16(lines.scale[l] as i16)))
}

/// From four texels to the two channels that do not lead, each with a zero behind it, by the one that leads; twice.
static OTHERS_OF: [[u8; 32]; 3] = {
    let mut of = [[0x80; 32]; 3];
    let mut i = 0;
    while i < 3 * 8 {
        let (lead, texel) = (i / 8, i % 8);
        let others = super::OTHERS[lead];
        of[lead][4 * texel] = (4 * (texel % 4) + others[0]) as u8;
        of[lead][4 * texel + 2] = (4 * (texel % 4) + others[1]) as u8;
        i += 1;
    }
    of
};

/// From four texels to the leading channel in all four places; twice.
static LEADING_OF: [[u8; 32]; 3] = {
    let mut of = [[0; 32]; 3];
    let mut i = 0;
    while i < 3 * 32 {
        let (lead, byte) = (i / 32, i % 32);
        of[lead][byte] = (byte % 16 / 4 * 4 + lead) as u8;
        i += 1;
    }
    of
};

/// The index bits of thirds, two a texel, and of sevenths, three a texel, both counted from the first end, of rows 0 and
/// 1, and of rows 2 and 3. 16 numbers in order each.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(crate) fn packed_indices(thirds: __m256i, sevenths: __m256i) -> [[u32; 2]; 2] {
    // Thirds are looked up in the first half of a table, sevenths in the second.
    let places = _mm256_packs_epi16(thirds, _mm256_add_epi16(sevenths, _mm256_set1_epi16(8)));
    let order = pattern([0, 2, 3, 1, 0, 0, 0, 0, 0, 2, 3, 4, 5, 6, 7, 1]);
    let indices = _mm256_shuffle_epi8(order, places);
    let pairs = _mm256_maddubs_epi16(indices, pattern([1, 4, 1, 4, 1, 4, 1, 4, 1, 8, 1, 8, 1, 8, 1, 8]));
    let weights = _mm256_broadcastsi128_si256(_mm_setr_epi16(1, 16, 1, 16, 1, 64, 1, 64));
    let rows = _mm256_madd_epi16(pairs, weights);
    let rows = _mm256_packus_epi32(rows, rows);
    let weights = _mm256_broadcastsi128_si256(_mm_setr_epi16(1, 256, 1, 4096, 1, 256, 1, 4096));
    let halves = _mm256_madd_epi16(rows, weights);
    // The second 64 bits of each half are the first again.
    let halves = _mm_unpacklo_epi64(_mm256_castsi256_si128(halves), _mm256_extracti128_si256::<1>(halves));
    bytemuck::cast(halves)
}
