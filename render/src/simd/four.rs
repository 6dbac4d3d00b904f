//! Four double numbers at once.

use std::ops::{Add, Mul, Sub};

use super::{PACKED, plain};

/// Four numbers, each rounded as one alone is: all kinds give the same bits.
pub(crate) trait Four: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// The same four times.
    fn all(v: f64) -> Self;
    fn from_array(v: [f64; 4]) -> Self;
    fn to_array(self) -> [f64; 4];
    /// What one over each is.
    fn inverse(self) -> Self;
    fn abs(self) -> Self;
    /// The less of each two; the other's where either is not a number.
    fn least(self, other: Self) -> Self;
    /// The greater of each two; the other's where either is not a number.
    fn most(self, other: Self) -> Self;
    /// Which are less than the other's, a bit each.
    fn below(self, other: Self) -> u32;
    /// Each two bits of `ORDER` say which comes there, the lowest first.
    fn picked<const ORDER: i32>(self) -> Self;
    /// Writes those of which a bit is set one behind the other; what comes after them there is no matter.
    fn put(self, which: u32, into: &mut [f64; 4]);
    /// The same, rounded to half as many digits.
    fn put_f32(self, which: u32, into: &mut [f32; 4]);
}

/// By whatever instructions there are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain([f64; 4]);

plain!(Plain, f64);

impl Four for Plain {
    #[inline(always)]
    fn all(v: f64) -> Self {
        Self([v; 4])
    }

    #[inline(always)]
    fn from_array(v: [f64; 4]) -> Self {
        Self(v)
    }

    #[inline(always)]
    fn to_array(self) -> [f64; 4] {
        self.0
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        self.with(self, |v, _| 1.0 / v)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.with(self, |v, _| v.abs())
    }

    #[inline(always)]
    fn least(self, other: Self) -> Self {
        self.with(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn most(self, other: Self) -> Self {
        self.with(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn below(self, other: Self) -> u32 {
        (0..4).fold(0, |bits, n| bits | u32::from(self.0[n] < other.0[n]) << n)
    }

    #[inline(always)]
    fn picked<const ORDER: i32>(self) -> Self {
        Self(std::array::from_fn(|n| self.0[(ORDER >> (2 * n) & 3) as usize]))
    }

    #[inline(always)]
    fn put(self, which: u32, into: &mut [f64; 4]) {
        for (place, n) in into.iter_mut().zip(PACKED[(which & 15) as usize]) {
            *place = self.0[n as usize];
        }
    }

    #[inline(always)]
    fn put_f32(self, which: u32, into: &mut [f32; 4]) {
        for (place, n) in into.iter_mut().zip(PACKED[(which & 15) as usize]) {
            *place = self.0[n as usize] as f32;
        }
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use wide::Wide;

#[cfg(target_arch = "x86_64")]
#[expect(
    unsafe_code,
    clippy::undocumented_unsafe_blocks,
    reason = "instructions that the machine has to be asked for; one comment is about all of it"
)]
mod wide {
    use std::arch::x86_64::{
        __m256d, _CMP_LT_OQ, _mm_loadu_si128, _mm_permutevar_ps, _mm_storeu_ps, _mm256_add_pd, _mm256_and_pd,
        _mm256_castpd_ps, _mm256_castps_pd, _mm256_castsi256_pd, _mm256_cmp_pd, _mm256_cvtpd_ps,
        _mm256_div_pd, _mm256_loadu_pd, _mm256_loadu_si256, _mm256_max_pd, _mm256_min_pd, _mm256_movemask_pd,
        _mm256_mul_pd, _mm256_permute4x64_pd, _mm256_permutevar8x32_ps, _mm256_set1_epi64x, _mm256_set1_pd,
        _mm256_storeu_pd, _mm256_sub_pd,
    };
    use std::ops::{Add, Mul, Sub};

    use super::super::wide;
    use super::{Four, PACKED};

    /// By AVX2. Only code that is called where `has_wide` says yes names this type.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Wide(__m256d);

    /// [`PACKED`] for halves of numbers.
    const PAIRS: [[u32; 8]; 16] = pairs();

    const fn pairs() -> [[u32; 8]; 16] {
        let mut pairs = [[0; 8]; 16];
        let mut which = 0;
        while which < 16 {
            let mut n = 0;
            while n < 8 {
                pairs[which][n] = 2 * PACKED[which][n / 2] + n as u32 % 2;
                n += 1;
            }
            which += 1;
        }
        pairs
    }

    // SAFETY, of all below: this type is only named where the instructions were detected; loads and stores are of arrays as
    // long as a register.

    wide!(Wide, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd);

    impl Four for Wide {
        #[inline(always)]
        fn all(v: f64) -> Self {
            Self(unsafe { _mm256_set1_pd(v) })
        }

        #[inline(always)]
        fn from_array(v: [f64; 4]) -> Self {
            Self(unsafe { _mm256_loadu_pd(v.as_ptr()) })
        }

        #[inline(always)]
        fn to_array(self) -> [f64; 4] {
            let mut v = [0.0; 4];
            unsafe { _mm256_storeu_pd(v.as_mut_ptr(), self.0) };
            v
        }

        #[inline(always)]
        fn inverse(self) -> Self {
            Self(unsafe { _mm256_div_pd(_mm256_set1_pd(1.0), self.0) })
        }

        #[inline(always)]
        fn abs(self) -> Self {
            Self(unsafe { _mm256_and_pd(self.0, _mm256_castsi256_pd(_mm256_set1_epi64x(i64::MAX))) })
        }

        #[inline(always)]
        fn least(self, other: Self) -> Self {
            Self(unsafe { _mm256_min_pd(self.0, other.0) })
        }

        #[inline(always)]
        fn most(self, other: Self) -> Self {
            Self(unsafe { _mm256_max_pd(self.0, other.0) })
        }

        #[inline(always)]
        fn below(self, other: Self) -> u32 {
            unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0)) as u32 }
        }

        #[inline(always)]
        fn picked<const ORDER: i32>(self) -> Self {
            Self(unsafe { _mm256_permute4x64_pd::<ORDER>(self.0) })
        }

        #[inline(always)]
        fn put(self, which: u32, into: &mut [f64; 4]) {
            let order = &PAIRS[(which & 15) as usize];
            unsafe {
                let order = _mm256_loadu_si256(order.as_ptr().cast());
                let packed = _mm256_permutevar8x32_ps(_mm256_castpd_ps(self.0), order);
                _mm256_storeu_pd(into.as_mut_ptr(), _mm256_castps_pd(packed));
            }
        }

        #[inline(always)]
        fn put_f32(self, which: u32, into: &mut [f32; 4]) {
            let order = &PACKED[(which & 15) as usize];
            unsafe {
                let order = _mm_loadu_si128(order.as_ptr().cast());
                _mm_storeu_ps(into.as_mut_ptr(), _mm_permutevar_ps(_mm256_cvtpd_ps(self.0), order));
            }
        }
    }
}
