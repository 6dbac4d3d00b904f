//! Which instructions the machine has, and several numbers at once by them.

mod eight;
mod four;

pub(crate) use eight::{Eight, Plain as PlainEight};
pub(crate) use four::{Four, Order, Plain as PlainFour};
#[cfg(target_arch = "x86_64")]
pub(crate) use {eight::Wide as WideEight, four::Wide as WideFour};

/// Whether it has AVX2 and what goes with it.
pub(crate) fn has_wide() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt")
    }
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Has what will be read soon brought near, where the machine can.
#[inline(always)]
pub(crate) fn fetch<T>(of: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let (first, last) = (std::ptr::from_ref(of).cast::<i8>(), size_of::<T>() - 1);
        #[expect(unsafe_code, reason = "an instruction that has no safe name; it reads nothing")]
        // SAFETY: every processor of this kind has it, and it is a hint that may be given for any address.
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(first);
            // Where it lies across two lines of a cache.
            _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(last));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = of;
}

/// Arithmetic of an array, number by number, by whatever instructions there are.
macro_rules! plain {
    ($name:ident, $number:ty) => {
        impl $name {
            #[inline(always)]
            fn with(self, other: Self, of: impl Fn($number, $number) -> $number) -> Self {
                Self(std::array::from_fn(|n| of(self.0[n], other.0[n])))
            }
        }

        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                self.with(other, |a, b| a + b)
            }
        }

        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                self.with(other, |a, b| a - b)
            }
        }

        impl Mul for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                self.with(other, |a, b| a * b)
            }
        }
    };
}
use plain;

/// Arithmetic of a register, by its instructions for sum, difference and product. The caller says why they may be used.
#[cfg(target_arch = "x86_64")]
macro_rules! wide {
    ($name:ident, $add:ident, $sub:ident, $mul:ident) => {
        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self(unsafe { $add(self.0, other.0) })
            }
        }

        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self(unsafe { $sub(self.0, other.0) })
            }
        }

        impl Mul for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                Self(unsafe { $mul(self.0, other.0) })
            }
        }
    };
}
#[cfg(target_arch = "x86_64")]
use wide;

/// Writes whole numbers from `first` on of which a bit is set one behind the other; what comes after them there is no matter.
#[inline(always)]
pub(crate) fn put_from(first: u32, which: u32, into: &mut [u32; 4]) {
    for (place, n) in into.iter_mut().zip(PACKED[(which & 15) as usize]) {
        *place = first + n;
    }
}

/// By the bits set, their numbers.
const PACKED: [[u32; 4]; 16] = packed();

const fn packed() -> [[u32; 4]; 16] {
    let mut packed = [[0; 4]; 16];
    let mut which = 0;
    while which < 16 {
        let (mut bit, mut count) = (0, 0);
        while bit < 4 {
            if which >> bit & 1 == 1 {
                packed[which][count] = bit as u32;
                count += 1;
            }
            bit += 1;
        }
        which += 1;
    }
    packed
}
