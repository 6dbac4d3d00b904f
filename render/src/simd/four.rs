//! Four double numbers at once.

use std::ops::{Add, Mul, Sub};

use super::plain;

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
    fn bits_below(self, other: Self) -> u32;
    /// One number or another, by whether these are less than those of a limit.
    fn below(self, limit: Self, yes: Self, no: Self) -> Self;
    fn from_whole(v: [i32; 4]) -> Self;
    /// Without what comes after the point.
    fn to_whole(self) -> [i32; 4];
    /// Writes eight whole numbers from `first` on.
    fn put_rising(first: u32, into: &mut [u32; 8]);
    /// Rounded to half as many digits.
    fn to_f32(self) -> [f32; 4];
    /// Each two bits of `ORDER` say which comes there, the lowest first.
    fn picked<const ORDER: i32>(self) -> Self;
    /// In an order that is not known before.
    fn ordered(self, order: &Order) -> Self;
    /// From rows, the first of each, and so on.
    fn columns(rows: [[f64; 4]; 4]) -> [Self; 4];
    /// The sum of each: that of its first two and that of its last two, added.
    fn sums(of: [Self; 4]) -> Self;
}

/// Which of four come first, second, and so on: halves of numbers, as the machine has it.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(crate) struct Order([u32; 8]);

impl Order {
    pub(crate) const fn new(of: [u8; 4]) -> Self {
        let mut halves = [0; 8];
        let mut n = 0;
        while n < 8 {
            halves[n] = 2 * (of[n / 2] & 3) as u32 + (n % 2) as u32;
            n += 1;
        }
        Self(halves)
    }
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
    fn bits_below(self, other: Self) -> u32 {
        (0..4).fold(0, |bits, n| bits | u32::from(self.0[n] < other.0[n]) << n)
    }

    #[inline(always)]
    fn below(self, limit: Self, yes: Self, no: Self) -> Self {
        Self(std::array::from_fn(|n| if self.0[n] < limit.0[n] { yes.0[n] } else { no.0[n] }))
    }

    #[inline(always)]
    fn from_whole(v: [i32; 4]) -> Self {
        Self(v.map(f64::from))
    }

    #[inline(always)]
    fn to_whole(self) -> [i32; 4] {
        self.0.map(|v| v as i32)
    }

    #[inline(always)]
    fn put_rising(first: u32, into: &mut [u32; 8]) {
        for (n, into) in (0..).zip(into) {
            *into = first.wrapping_add(n);
        }
    }

    #[inline(always)]
    fn to_f32(self) -> [f32; 4] {
        self.0.map(|v| v as f32)
    }

    #[inline(always)]
    fn picked<const ORDER: i32>(self) -> Self {
        Self(std::array::from_fn(|n| self.0[(ORDER >> (2 * n) & 3) as usize]))
    }

    #[inline(always)]
    fn ordered(self, order: &Order) -> Self {
        Self(std::array::from_fn(|n| self.0[((order.0[2 * n] / 2) & 3) as usize]))
    }

    #[inline(always)]
    fn columns(rows: [[f64; 4]; 4]) -> [Self; 4] {
        std::array::from_fn(|n| Self(rows.map(|row| row[n])))
    }

    #[inline(always)]
    fn sums(of: [Self; 4]) -> Self {
        Self(of.map(|Self([a, b, c, d])| (a + b) + (c + d)))
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
        __m256d, _CMP_LT_OQ, _mm_loadu_si128, _mm_storeu_ps, _mm_storeu_si128, _mm256_add_epi32,
        _mm256_add_pd, _mm256_and_pd, _mm256_blendv_pd, _mm256_castpd_ps, _mm256_castps_pd,
        _mm256_castsi256_pd, _mm256_cmp_pd, _mm256_cvtepi32_pd, _mm256_cvtpd_ps, _mm256_cvttpd_epi32,
        _mm256_div_pd, _mm256_hadd_pd, _mm256_loadu_pd, _mm256_loadu_si256, _mm256_max_pd, _mm256_min_pd,
        _mm256_movemask_pd, _mm256_mul_pd, _mm256_permute2f128_pd, _mm256_permute4x64_pd,
        _mm256_permutevar8x32_ps, _mm256_set1_epi32, _mm256_set1_epi64x, _mm256_set1_pd, _mm256_storeu_pd,
        _mm256_storeu_si256, _mm256_sub_pd, _mm256_unpackhi_pd, _mm256_unpacklo_pd,
    };
    use std::ops::{Add, Mul, Sub};

    use super::super::wide;
    use super::{Four, Order};

    /// By AVX2. Only code that is called where `has_wide` says yes names this type.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Wide(__m256d);

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
        fn bits_below(self, other: Self) -> u32 {
            unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0)) as u32 }
        }

        #[inline(always)]
        fn below(self, limit: Self, yes: Self, no: Self) -> Self {
            Self(unsafe { _mm256_blendv_pd(no.0, yes.0, _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, limit.0)) })
        }

        #[inline(always)]
        fn from_whole(v: [i32; 4]) -> Self {
            Self(unsafe { _mm256_cvtepi32_pd(_mm_loadu_si128(v.as_ptr().cast())) })
        }

        #[inline(always)]
        fn to_whole(self) -> [i32; 4] {
            let mut v = [0; 4];
            unsafe { _mm_storeu_si128(v.as_mut_ptr().cast(), _mm256_cvttpd_epi32(self.0)) };
            v
        }

        #[inline(always)]
        fn put_rising(first: u32, into: &mut [u32; 8]) {
            const STEPS: [i32; 8] = [0, 1, 2, 3, 4, 5, 6, 7];
            unsafe {
                let first = _mm256_set1_epi32(first as i32);
                let all = _mm256_add_epi32(first, _mm256_loadu_si256(STEPS.as_ptr().cast()));
                _mm256_storeu_si256(into.as_mut_ptr().cast(), all);
            }
        }

        #[inline(always)]
        fn to_f32(self) -> [f32; 4] {
            let mut v = [0.0; 4];
            unsafe { _mm_storeu_ps(v.as_mut_ptr(), _mm256_cvtpd_ps(self.0)) };
            v
        }

        #[inline(always)]
        fn picked<const ORDER: i32>(self) -> Self {
            Self(unsafe { _mm256_permute4x64_pd::<ORDER>(self.0) })
        }

        #[inline(always)]
        fn ordered(self, order: &Order) -> Self {
            Self(unsafe {
                let halves = _mm256_loadu_si256(order.0.as_ptr().cast());
                _mm256_castps_pd(_mm256_permutevar8x32_ps(_mm256_castpd_ps(self.0), halves))
            })
        }

        #[inline(always)]
        fn columns([a, b, c, d]: [[f64; 4]; 4]) -> [Self; 4] {
            let [Self(a), Self(b), Self(c), Self(d)] =
                [Self::from_array(a), Self::from_array(b), Self::from_array(c), Self::from_array(d)];
            unsafe {
                let (even, more_even) = (_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d));
                let (odd, more_odd) = (_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d));
                [
                    Self(_mm256_permute2f128_pd::<0x20>(even, more_even)),
                    Self(_mm256_permute2f128_pd::<0x20>(odd, more_odd)),
                    Self(_mm256_permute2f128_pd::<0x31>(even, more_even)),
                    Self(_mm256_permute2f128_pd::<0x31>(odd, more_odd)),
                ]
            }
        }

        #[inline(always)]
        fn sums([a, b, c, d]: [Self; 4]) -> Self {
            unsafe {
                // Of a and b in turn, of their first two and their last two; the same of c and d.
                let (ab, cd) = (_mm256_hadd_pd(a.0, b.0), _mm256_hadd_pd(c.0, d.0));
                let first = _mm256_permute2f128_pd::<0x20>(ab, cd);
                let last = _mm256_permute2f128_pd::<0x31>(ab, cd);
                Self(_mm256_add_pd(first, last))
            }
        }
    }
}

#[cfg(test)]
#[cfg(target_arch = "x86_64")]
mod tests {
    use super::{Four, Order, Plain, Wide};

    /// What each has of rows that all give the same of.
    fn all<F: Four>(rows: [[f64; 4]; 4], order: [u8; 4]) -> Vec<[u64; 4]> {
        let [a, b, c, d] = rows.map(F::from_array);
        let [p, q, r, s] = F::columns(rows);
        let results =
            [p, q, r, s, F::sums([a, b, c, d]), a.ordered(&Order::new(order)), a.picked::<0b01_11_00_10>()];
        results.map(|of| of.to_array().map(f64::to_bits)).to_vec()
    }

    #[test]
    fn numbers_are_put_in_order_and_added_alike() {
        if !crate::simd::has_wide() {
            return;
        }
        let row = |from: f64| [from, -1.0 / from, from * 1e300, from * 1e-320];
        for n in 0..256_u32 {
            let order = [0, 2, 4, 6].map(|bit| (n >> bit) as u8 & 3);
            let rows = [1.1, 2.3, 3.7, f64::from(n) + 0.1].map(row);
            let plain = all::<Plain>(rows, order);
            assert_eq!(plain, all::<Wide>(rows, order));
            assert_eq!(plain[5], order.map(|n| rows[0][usize::from(n)].to_bits()));
            assert_eq!(plain[1], rows.map(|row| row[1].to_bits()));
            assert_eq!(f64::from_bits(plain[4][0]), (rows[0][0] + rows[0][1]) + (rows[0][2] + rows[0][3]));
        }
    }
}
