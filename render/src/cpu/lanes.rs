//! Eight numbers at once, by AVX2: what packets of rays are made of.

use std::arch::x86_64::{
    __m128, __m256, __m256d, __m256i, _CMP_LT_OQ, _MM_FROUND_NO_EXC, _MM_FROUND_TO_NEAREST_INT, _mm_setr_ps,
    _mm_storeu_ps, _mm256_add_epi32, _mm256_add_ps, _mm256_and_si256, _mm256_blendv_epi8, _mm256_blendv_ps,
    _mm256_castps_si256, _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cvtepi32_ps, _mm256_cvttps_epi32,
    _mm256_div_ps, _mm256_mask_i32gather_epi32, _mm256_mask_i32gather_ps, _mm256_max_epi32, _mm256_min_epi32,
    _mm256_min_epu32, _mm256_min_ps, _mm256_mul_ps, _mm256_round_ps, _mm256_set1_epi32, _mm256_set1_ps,
    _mm256_setr_pd, _mm256_setr_ps, _mm256_setzero_ps, _mm256_setzero_si256, _mm256_slli_epi32,
    _mm256_srai_epi32, _mm256_storeu_ps, _mm256_storeu_si256, _mm256_sub_epi32, _mm256_sub_ps,
};

use super::field::Values;
use super::packet::LANES;

/// A float or whole number in each lane.
pub(super) type Floats = __m256;
pub(super) type Wholes = __m256i;

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn load(v: &[f32; LANES]) -> Floats {
    let [a, b, c, d, e, f, g, h] = *v;
    _mm256_setr_ps(a, b, c, d, e, f, g, h)
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn store(v: Floats) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    #[expect(unsafe_code, reason = "a store of eight lanes")]
    // SAFETY: the array has room for exactly eight floats, and the store asks for no alignment.
    unsafe {
        _mm256_storeu_ps(out.as_mut_ptr(), v);
    }
    out
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn store_whole(v: Wholes) -> [i32; LANES] {
    let mut out = [0; LANES];
    #[expect(unsafe_code, reason = "a store of eight lanes")]
    // SAFETY: the array has room for exactly eight numbers, and the store asks for no alignment.
    unsafe {
        _mm256_storeu_si256(out.as_mut_ptr().cast(), v);
    }
    out
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn store_four(v: __m128) -> [f32; 4] {
    let mut out = [0.0; 4];
    #[expect(unsafe_code, reason = "a store of four lanes")]
    // SAFETY: the array has room for exactly four floats, and the store asks for no alignment.
    unsafe {
        _mm_storeu_ps(out.as_mut_ptr(), v);
    }
    out
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn four(v: &[f32; 4]) -> __m128 {
    _mm_setr_ps(v[0], v[1], v[2], v[3])
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn four_wide(v: &[f64; 4]) -> __m256d {
    _mm256_setr_pd(v[0], v[1], v[2], v[3])
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn select(mask: Floats, yes: Floats, no: Floats) -> Floats {
    _mm256_blendv_ps(no, yes, mask)
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn select_whole(mask: Floats, yes: Wholes, no: Wholes) -> Wholes {
    _mm256_blendv_epi8(no, yes, _mm256_castps_si256(mask))
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn as_mask(v: Wholes) -> Floats {
    _mm256_castsi256_ps(v)
}

#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn clamp_whole(v: Wholes, low: Wholes, high: Wholes) -> Wholes {
    _mm256_min_epi32(_mm256_max_epi32(v, low), high)
}

/// Bytes of a table at `index` in each lane where `mask` is set.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn bytes_at(table: &[u8], index: Wholes, mask: Floats) -> Wholes {
    // Four bytes are read for one: the table ends with three more than are asked for.
    let last = _mm256_set1_epi32(table.len() as i32 - 4);
    let index = _mm256_min_epu32(index, last);
    #[expect(unsafe_code, reason = "a gather")]
    // SAFETY: the index is at most four bytes before the end of the table, and not below 0, being the lesser of two
    // unsigned numbers one of which fits; tables have at least four bytes.
    let words = unsafe {
        _mm256_mask_i32gather_epi32::<1>(
            _mm256_setzero_si256(),
            table.as_ptr().cast(),
            index,
            _mm256_castps_si256(mask),
        )
    };
    _mm256_and_si256(words, _mm256_set1_epi32(255))
}

/// Pairs of samples that follow each other, at `index` in each lane where `mask` is set.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn pairs_at(values: Values<'_>, index: Wholes, mask: Floats) -> [Floats; 2] {
    let mask = _mm256_castps_si256(mask);
    match values {
        Values::Short(v) => {
            let index = _mm256_min_epu32(index, _mm256_set1_epi32(v.len() as i32 - 2));
            #[expect(unsafe_code, reason = "a gather")]
            // SAFETY: two samples of 16 bits are read, and the index is at most two before the end of the slice, which
            // has at least two.
            let words = unsafe {
                _mm256_mask_i32gather_epi32::<2>(_mm256_setzero_si256(), v.as_ptr().cast(), index, mask)
            };
            let first = _mm256_srai_epi32::<16>(_mm256_slli_epi32::<16>(words));
            [_mm256_cvtepi32_ps(first), _mm256_cvtepi32_ps(_mm256_srai_epi32::<16>(words))]
        }
        Values::Float(v) => {
            let index = _mm256_min_epu32(index, _mm256_set1_epi32(v.len() as i32 - 2));
            let next = _mm256_add_epi32(index, _mm256_set1_epi32(1));
            let (zero, mask) = (_mm256_setzero_ps(), _mm256_castsi256_ps(mask));
            #[expect(unsafe_code, reason = "a gather")]
            // SAFETY: the index and the one after it are within the slice, which has at least two samples.
            unsafe {
                [
                    _mm256_mask_i32gather_ps::<4>(zero, v.as_ptr(), index, mask),
                    _mm256_mask_i32gather_ps::<4>(zero, v.as_ptr(), next, mask),
                ]
            }
        }
    }
}

/// [`super::march::absorbed`] in each lane, by the same operations.
#[inline]
#[target_feature(enable = "avx2")]
pub(super) fn absorbed(t: Floats) -> (Floats, Floats) {
    let set = |v: f32| _mm256_set1_ps(v);
    let one = set(1.0);
    let minus = |a: f32, b: Floats| _mm256_sub_ps(set(a), _mm256_mul_ps(t, b));
    let faint = minus(1.0, minus(0.5, minus(1.0 / 6.0, minus(1.0 / 24.0, set(1.0 / 120.0)))));
    let faint_left = _mm256_sub_ps(one, _mm256_mul_ps(t, faint));
    let left = exp_minus(t);
    let weight = _mm256_div_ps(_mm256_sub_ps(one, left), t);
    let is_faint = _mm256_cmp_ps::<_CMP_LT_OQ>(t, set(0.05));
    (select(is_faint, faint_left, left), select(is_faint, faint, weight))
}

/// [`super::march::exp_minus`] in each lane, by the same operations.
#[inline]
#[target_feature(enable = "avx2")]
fn exp_minus(t: Floats) -> Floats {
    let set = |v: f32| _mm256_set1_ps(v);
    let t = _mm256_min_ps(t, set(87.0));
    let whole = _mm256_round_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(_mm256_mul_ps(
        t,
        set(std::f32::consts::LOG2_E),
    ));
    let rest = _mm256_sub_ps(_mm256_mul_ps(whole, set(super::march::LN_2_HIGH)), t);
    let rest = _mm256_add_ps(rest, _mm256_mul_ps(whole, set(super::march::LN_2_LOW)));
    let mut power = set(1.0 / 5040.0);
    for k in super::march::EXP_TERMS {
        power = _mm256_add_ps(_mm256_mul_ps(power, rest), set(k));
    }
    let exponent = _mm256_sub_epi32(_mm256_set1_epi32(127), _mm256_cvttps_epi32(whole));
    _mm256_mul_ps(power, _mm256_castsi256_ps(_mm256_slli_epi32::<23>(exponent)))
}
