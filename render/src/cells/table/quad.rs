//! Four numbers that go together: on x86-64 in one register, which the compiler does not do by itself; elsewhere in an array.
//! What comes of them has the same bits.

use std::ops::{Add, Mul, Sub};

/// Red, green, blue and another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quad(of::Four);

impl Quad {
    #[inline(always)]
    pub(super) fn new(values: [f32; 4]) -> Self {
        Self(of::new(values))
    }

    /// The same for all.
    #[inline(always)]
    pub(super) fn all(value: f32) -> Self {
        Self(of::new([value; 4]))
    }

    #[inline(always)]
    pub(super) fn array(self) -> [f32; 4] {
        of::array(self.0)
    }
}

impl Add for Quad {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(of::add(self.0, other.0))
    }
}

impl Sub for Quad {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(of::sub(self.0, other.0))
    }
}

impl Mul for Quad {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(of::mul(self.0, other.0))
    }
}

#[cfg(target_arch = "x86_64")]
#[expect(unsafe_code, reason = "instructions that every x86-64 has")]
mod of {
    use std::arch::x86_64::{__m128, _mm_add_ps, _mm_loadu_ps, _mm_mul_ps, _mm_storeu_ps, _mm_sub_ps};

    pub(super) type Four = __m128;

    #[inline(always)]
    pub(super) fn new(values: [f32; 4]) -> Four {
        // SAFETY: every x86-64 has it, and four numbers are read.
        unsafe { _mm_loadu_ps(values.as_ptr()) }
    }

    #[inline(always)]
    pub(super) fn array(four: Four) -> [f32; 4] {
        let mut values = [0.0; 4];
        // SAFETY: every x86-64 has it, and four numbers are written.
        unsafe { _mm_storeu_ps(values.as_mut_ptr(), four) };
        values
    }

    #[inline(always)]
    pub(super) fn add(a: Four, b: Four) -> Four {
        // SAFETY: every x86-64 has it.
        unsafe { _mm_add_ps(a, b) }
    }

    #[inline(always)]
    pub(super) fn sub(a: Four, b: Four) -> Four {
        // SAFETY: every x86-64 has it.
        unsafe { _mm_sub_ps(a, b) }
    }

    #[inline(always)]
    pub(super) fn mul(a: Four, b: Four) -> Four {
        // SAFETY: every x86-64 has it.
        unsafe { _mm_mul_ps(a, b) }
    }
}

#[cfg(not(target_arch = "x86_64"))]
mod of {
    use std::array::from_fn;

    pub(super) type Four = [f32; 4];

    #[inline(always)]
    pub(super) fn new(values: [f32; 4]) -> Four {
        values
    }

    #[inline(always)]
    pub(super) fn array(four: Four) -> [f32; 4] {
        four
    }

    #[inline(always)]
    pub(super) fn add(a: Four, b: Four) -> Four {
        from_fn(|c| a[c] + b[c])
    }

    #[inline(always)]
    pub(super) fn sub(a: Four, b: Four) -> Four {
        from_fn(|c| a[c] - b[c])
    }

    #[inline(always)]
    pub(super) fn mul(a: Four, b: Four) -> Four {
        from_fn(|c| a[c] * b[c])
    }
}
