//! Eight single numbers at once: twice red, green, blue and another, or one of each of eight things.

use std::ops::{Add, Mul, Sub};

use super::plain;

/// Eight numbers, each rounded as one alone is: all kinds give the same bits.
pub(crate) trait Eight: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    fn from_array(v: [f32; 8]) -> Self;
    fn to_array(self) -> [f32; 8];
    /// Of two halves.
    fn of(low: &[f32; 4], high: &[f32; 4]) -> Self;
    /// Writes the halves.
    fn put(self, low: &mut [f32; 4], high: &mut [f32; 4]);
    fn over(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// One number or another, by whether these are less than those of a limit.
    fn below(self, limit: Self, yes: Self, no: Self) -> Self;
    /// In each half: each two bits of `ORDER` say which comes there, the lowest first.
    fn picked<const ORDER: i32>(self) -> Self;
    /// The last of each half of all: those of the lower halves, then those of the upper.
    fn lasts(all: [Self; 4]) -> Self;
    /// With nothing for the last of each half.
    fn without_lasts(self) -> Self;

    /// In each half its first everywhere, then its second and so on.
    #[inline(always)]
    fn spread(self) -> [Self; 4] {
        [self.picked::<0x00>(), self.picked::<0x55>(), self.picked::<0xaa>(), self.picked::<0xff>()]
    }
}

/// By whatever instructions there are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain([f32; 8]);

plain!(Plain, f32);

impl Eight for Plain {
    #[inline(always)]
    fn from_array(v: [f32; 8]) -> Self {
        Self(v)
    }

    #[inline(always)]
    fn to_array(self) -> [f32; 8] {
        self.0
    }

    #[inline(always)]
    fn of(low: &[f32; 4], high: &[f32; 4]) -> Self {
        Self(std::array::from_fn(|n| if n < 4 { low[n] } else { high[n - 4] }))
    }

    #[inline(always)]
    fn put(self, low: &mut [f32; 4], high: &mut [f32; 4]) {
        low.copy_from_slice(&self.0[..4]);
        high.copy_from_slice(&self.0[4..]);
    }

    #[inline(always)]
    fn over(self, other: Self) -> Self {
        self.with(other, |a, b| a / b)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.with(self, |v, _| v.abs())
    }

    #[inline(always)]
    fn below(self, limit: Self, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|n| if self.0[n] < limit.0[n] { yes.0[n] } else { no.0[n] }))
    }

    #[inline(always)]
    fn picked<const ORDER: i32>(self) -> Self {
        Self(std::array::from_fn(|n| self.0[(n & 4) + (ORDER >> (2 * (n & 3)) & 3) as usize]))
    }

    #[inline(always)]
    fn lasts(all: [Self; 4]) -> Self {
        Self(std::array::from_fn(|n| all[n & 3].0[n | 3]))
    }

    #[inline(always)]
    fn without_lasts(self) -> Self {
        Self(std::array::from_fn(|n| if n & 3 == 3 { 0.0 } else { self.0[n] }))
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use wide::Wide;

#[cfg(target_arch = "x86_64")]
#[expect(
    unsafe_code,
    clippy::undocumented_unsafe_blocks,
    reason = "instructions that the machine has to be asked for; why they may be used is said once"
)]
mod wide {
    use std::arch::x86_64::{
        __m256, _CMP_LT_OQ, _mm_loadu_ps, _mm_storeu_ps, _mm256_add_ps, _mm256_andnot_ps, _mm256_blend_ps,
        _mm256_blendv_ps, _mm256_castpd_ps, _mm256_castps_pd, _mm256_castps256_ps128, _mm256_cmp_ps,
        _mm256_div_ps, _mm256_extractf128_ps, _mm256_loadu_ps, _mm256_mul_ps, _mm256_permute_ps,
        _mm256_set_m128, _mm256_set1_ps, _mm256_setzero_ps, _mm256_storeu_ps, _mm256_sub_ps,
        _mm256_unpackhi_pd, _mm256_unpackhi_ps,
    };
    use std::ops::{Add, Mul, Sub};

    use super::super::wide;
    use super::Eight;

    /// By AVX2. Only code that is called where `has_wide` says yes names this type.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Wide(__m256);

    // SAFETY, of all below: this type is only named where the instructions were detected; loads and stores are of arrays as
    // long as a register.

    wide!(Wide, _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps);

    impl Eight for Wide {
        #[inline(always)]
        fn from_array(v: [f32; 8]) -> Self {
            Self(unsafe { _mm256_loadu_ps(v.as_ptr()) })
        }

        #[inline(always)]
        fn to_array(self) -> [f32; 8] {
            let mut v = [0.0; 8];
            unsafe { _mm256_storeu_ps(v.as_mut_ptr(), self.0) };
            v
        }

        #[inline(always)]
        fn of(low: &[f32; 4], high: &[f32; 4]) -> Self {
            Self(unsafe { _mm256_set_m128(_mm_loadu_ps(high.as_ptr()), _mm_loadu_ps(low.as_ptr())) })
        }

        #[inline(always)]
        fn put(self, low: &mut [f32; 4], high: &mut [f32; 4]) {
            unsafe {
                _mm_storeu_ps(low.as_mut_ptr(), _mm256_castps256_ps128(self.0));
                _mm_storeu_ps(high.as_mut_ptr(), _mm256_extractf128_ps::<1>(self.0));
            }
        }

        #[inline(always)]
        fn over(self, other: Self) -> Self {
            Self(unsafe { _mm256_div_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn abs(self) -> Self {
            Self(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
        }

        #[inline(always)]
        fn below(self, limit: Self, yes: Self, no: Self) -> Self {
            Self(unsafe { _mm256_blendv_ps(no.0, yes.0, _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, limit.0)) })
        }

        #[inline(always)]
        fn picked<const ORDER: i32>(self) -> Self {
            Self(unsafe { _mm256_permute_ps::<ORDER>(self.0) })
        }

        #[inline(always)]
        fn lasts([a, b, c, d]: [Self; 4]) -> Self {
            unsafe {
                let ab = _mm256_castps_pd(_mm256_unpackhi_ps(a.0, b.0));
                let cd = _mm256_castps_pd(_mm256_unpackhi_ps(c.0, d.0));
                Self(_mm256_castpd_ps(_mm256_unpackhi_pd(ab, cd)))
            }
        }

        #[inline(always)]
        fn without_lasts(self) -> Self {
            Self(unsafe { _mm256_blend_ps::<0x88>(self.0, _mm256_setzero_ps()) })
        }
    }
}
