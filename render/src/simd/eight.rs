//! Eight single numbers at once, one of each of eight things.

use std::ops::{Add, Mul, Sub};

use super::plain;

/// Eight numbers, each rounded as one alone is: all kinds give the same bits.
pub(crate) trait Eight: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Eight whole numbers.
    type Numbers: Copy;

    fn from_array(v: [f32; 8]) -> Self;
    fn to_array(self) -> [f32; 8];
    fn all(v: f32) -> Self;
    fn over(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// One number or another, by whether these are less than those of a limit.
    fn below(self, limit: Self, yes: Self, no: Self) -> Self;
    /// Which are less than those of a limit, a bit each.
    fn bits_below(self, limit: Self) -> u32;
    /// Writes four of each, together for each of eight.
    fn put_rows(of: [Self; 4], into: &mut [[f32; 4]; 8]);

    fn numbers(v: [u32; 8]) -> Self::Numbers;
    fn numbers_to_array(numbers: Self::Numbers) -> [u32; 8];
    /// How many of a rising list each has reached.
    fn reached(self, rising: &[f32]) -> Self::Numbers;
    /// Looked up by numbers below eight.
    fn of_table(table: &[f32; 8], numbers: Self::Numbers) -> Self;
    /// The same of twice eight, by numbers below sixteen.
    fn of_tables(halves: &[[f32; 8]; 2], numbers: Self::Numbers) -> Self;
    /// The first of all rows, then the second of all, and so on.
    fn columns(rows: [&[f32; 8]; 8]) -> [Self; 8];
}

/// By whatever instructions there are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain([f32; 8]);

plain!(Plain, f32);

impl Eight for Plain {
    type Numbers = [u32; 8];

    #[inline(always)]
    fn from_array(v: [f32; 8]) -> Self {
        Self(v)
    }

    #[inline(always)]
    fn to_array(self) -> [f32; 8] {
        self.0
    }

    #[inline(always)]
    fn all(v: f32) -> Self {
        Self([v; 8])
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
    fn bits_below(self, limit: Self) -> u32 {
        (0..8).fold(0, |bits, n| bits | u32::from(self.0[n] < limit.0[n]) << n)
    }

    #[inline(always)]
    fn put_rows(of: [Self; 4], into: &mut [[f32; 4]; 8]) {
        for (n, row) in into.iter_mut().enumerate() {
            *row = of.map(|of| of.0[n]);
        }
    }

    #[inline(always)]
    fn numbers(v: [u32; 8]) -> [u32; 8] {
        v
    }

    #[inline(always)]
    fn numbers_to_array(numbers: [u32; 8]) -> [u32; 8] {
        numbers
    }

    #[inline(always)]
    fn reached(self, rising: &[f32]) -> [u32; 8] {
        self.0.map(|v| rising.iter().fold(0, |count, begin| count + u32::from(*begin <= v)))
    }

    #[inline(always)]
    fn of_table(table: &[f32; 8], numbers: [u32; 8]) -> Self {
        Self(numbers.map(|number| table[number as usize & 7]))
    }

    #[inline(always)]
    fn of_tables(halves: &[[f32; 8]; 2], numbers: [u32; 8]) -> Self {
        Self(numbers.map(|number| halves[number as usize >> 3 & 1][number as usize & 7]))
    }

    #[inline(always)]
    fn columns(rows: [&[f32; 8]; 8]) -> [Self; 8] {
        std::array::from_fn(|column| Self(rows.map(|row| row[column])))
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
        __m256, __m256i, _CMP_LE_OQ, _CMP_LT_OQ, _mm256_add_ps, _mm256_andnot_ps, _mm256_blendv_ps,
        _mm256_castpd_ps, _mm256_castps_pd, _mm256_castps_si256, _mm256_castsi256_ps, _mm256_cmp_ps,
        _mm256_div_ps, _mm256_loadu_ps, _mm256_loadu_si256, _mm256_movemask_ps, _mm256_mul_ps,
        _mm256_permute2f128_ps, _mm256_permutevar8x32_ps, _mm256_set1_ps, _mm256_setzero_si256,
        _mm256_slli_epi32, _mm256_storeu_ps, _mm256_storeu_si256, _mm256_sub_epi32, _mm256_sub_ps,
        _mm256_unpackhi_pd, _mm256_unpackhi_ps, _mm256_unpacklo_pd, _mm256_unpacklo_ps,
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

    /// In each half, the first two of `a` and `b` by turns, and the last two.
    #[inline(always)]
    fn by_turns(a: Wide, b: Wide) -> [Wide; 2] {
        unsafe { [Wide(_mm256_unpacklo_ps(a.0, b.0)), Wide(_mm256_unpackhi_ps(a.0, b.0))] }
    }

    /// The same by twos.
    #[inline(always)]
    fn twos_by_turns(a: Wide, b: Wide) -> [Wide; 2] {
        unsafe {
            let (a, b) = (_mm256_castps_pd(a.0), _mm256_castps_pd(b.0));
            let [low, high] = [_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b)];
            [Wide(_mm256_castpd_ps(low)), Wide(_mm256_castpd_ps(high))]
        }
    }

    /// In each half, of four that each have one of each row: the rows.
    #[inline(always)]
    fn transposed([a, b, c, d]: [Wide; 4]) -> [Wide; 4] {
        let ([ab, ab_high], [cd, cd_high]) = (by_turns(a, b), by_turns(c, d));
        let ([first, second], [third, last]) = (twos_by_turns(ab, cd), twos_by_turns(ab_high, cd_high));
        [first, second, third, last]
    }

    /// The first halves of two, and the second.
    #[inline(always)]
    fn halves(a: Wide, b: Wide) -> [Wide; 2] {
        unsafe {
            [Wide(_mm256_permute2f128_ps::<0x20>(a.0, b.0)), Wide(_mm256_permute2f128_ps::<0x31>(a.0, b.0))]
        }
    }

    #[inline(always)]
    fn load(row: &[f32; 8]) -> Wide {
        Wide(unsafe { _mm256_loadu_ps(row.as_ptr()) })
    }

    impl Eight for Wide {
        type Numbers = __m256i;

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
        fn all(v: f32) -> Self {
            Self(unsafe { _mm256_set1_ps(v) })
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
        fn bits_below(self, limit: Self) -> u32 {
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, limit.0)) as u32 }
        }

        #[inline(always)]
        fn put_rows(of: [Self; 4], into: &mut [[f32; 4]; 8]) {
            let [a, b, c, d] = transposed(of);
            let ([ab, ab_high], [cd, cd_high]) = (halves(a, b), halves(c, d));
            let into = into.as_flattened_mut().as_mut_ptr();
            unsafe {
                _mm256_storeu_ps(into, ab.0);
                _mm256_storeu_ps(into.add(8), cd.0);
                _mm256_storeu_ps(into.add(16), ab_high.0);
                _mm256_storeu_ps(into.add(24), cd_high.0);
            }
        }

        #[inline(always)]
        fn numbers(v: [u32; 8]) -> __m256i {
            unsafe { _mm256_loadu_si256(v.as_ptr().cast()) }
        }

        #[inline(always)]
        fn numbers_to_array(numbers: __m256i) -> [u32; 8] {
            let mut v = [0; 8];
            unsafe { _mm256_storeu_si256(v.as_mut_ptr().cast(), numbers) };
            v
        }

        #[inline(always)]
        fn reached(self, rising: &[f32]) -> __m256i {
            unsafe {
                let mut count = _mm256_setzero_si256();
                for begin in rising {
                    // What is so is all ones, which is one less than nothing.
                    let reached = _mm256_cmp_ps::<_CMP_LE_OQ>(_mm256_set1_ps(*begin), self.0);
                    count = _mm256_sub_epi32(count, _mm256_castps_si256(reached));
                }
                count
            }
        }

        #[inline(always)]
        fn of_table(table: &[f32; 8], numbers: __m256i) -> Self {
            Self(unsafe { _mm256_permutevar8x32_ps(_mm256_loadu_ps(table.as_ptr()), numbers) })
        }

        #[inline(always)]
        fn of_tables([low, high]: &[[f32; 8]; 2], numbers: __m256i) -> Self {
            let [low, high] = [Self::of_table(low, numbers), Self::of_table(high, numbers)];
            unsafe {
                // What tells the halves apart becomes the sign.
                let which = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(numbers));
                Self(_mm256_blendv_ps(low.0, high.0, which))
            }
        }

        #[inline(always)]
        fn columns(rows: [&[f32; 8]; 8]) -> [Self; 8] {
            let [a, b, c, d, e, f, g, h] = rows;
            let low = transposed([load(a), load(b), load(c), load(d)]);
            let high = transposed([load(e), load(f), load(g), load(h)]);
            let ([a, e], [b, f]) = (halves(low[0], high[0]), halves(low[1], high[1]));
            let ([c, g], [d, h]) = (halves(low[2], high[2]), halves(low[3], high[3]));
            [a, b, c, d, e, f, g, h]
        }
    }
}
