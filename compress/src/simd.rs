//! Which instructions the kernels are built for: the same source, inlined into functions of each kind.

/// A set of instructions that this machine has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Simd {
    /// What every machine of the architecture has.
    Plain,
    /// AVX2, BMI1, BMI2 and LZCNT.
    #[cfg(target_arch = "x86_64")]
    Avx2(Detected),
    /// These, and AVX-512 with F, BW, DQ and VL: half as many instructions where there are enough lanes.
    #[cfg(target_arch = "x86_64")]
    Avx512(Detected),
}

/// Proof that the instructions were looked for, and are there.
#[cfg(target_arch = "x86_64")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Detected(());

impl Simd {
    /// The best set that this machine has.
    pub(crate) fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
        {
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
            {
                return Self::Avx512(Detected(()));
            }
            return Self::Avx2(Detected(()));
        }
        Self::Plain
    }

    /// Every set that this machine has, the plainest first.
    #[cfg(test)]
    pub(crate) fn all() -> Vec<Self> {
        match Self::best() {
            Self::Plain => vec![Self::Plain],
            #[cfg(target_arch = "x86_64")]
            avx2 @ Self::Avx2(_) => vec![Self::Plain, avx2],
            #[cfg(target_arch = "x86_64")]
            avx512 @ Self::Avx512(proof) => vec![Self::Plain, Self::Avx2(proof), avx512],
        }
    }
}

/// A function in each kind of instructions, which it is told as its last argument: `plain` as it is, and `wide` built
/// for the wider ones; where that is left out, `plain` is built for all. `wide` may call functions of the features
/// `avx2,bmi1,bmi2,lzcnt`, which are then built for AVX-512, too, where they are inlined.
macro_rules! in_each_kind {
    (
        $(#[$meta:meta])*
        $vis:vis fn $name:ident $(<const $size:ident: usize>)? ($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)?,
        plain $plain:expr, wide $wide:expr
    ) => {
        $(#[$meta])*
        $vis fn $name $(<const $size: usize>)? ($($argument: $type,)* simd: $crate::simd::Simd) $(-> $result)? {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
            fn avx2 $(<const $size: usize>)? ($($argument: $type),*) $(-> $result)? {
                $wide
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,avx512f,avx512bw,avx512dq,avx512vl")]
            fn avx512 $(<const $size: usize>)? ($($argument: $type),*) $(-> $result)? {
                $wide
            }
            match simd {
                $crate::simd::Simd::Plain => $plain,
                #[cfg(target_arch = "x86_64")]
                $crate::simd::Simd::Avx2(_) => {
                    #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
                    // SAFETY: a value of that variant exists only where these instructions were detected.
                    unsafe {
                        avx2 $(::<$size>)? ($($argument),*)
                    }
                }
                #[cfg(target_arch = "x86_64")]
                $crate::simd::Simd::Avx512(_) => {
                    #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
                    // SAFETY: a value of that variant exists only where these instructions were detected.
                    unsafe {
                        avx512 $(::<$size>)? ($($argument),*)
                    }
                }
            }
        }
    };
    (
        $(#[$meta:meta])*
        $vis:vis fn $name:ident $(<const $size:ident: usize>)? ($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)?,
        $plain:expr
    ) => {
        $crate::simd::in_each_kind! {
            $(#[$meta])*
            $vis fn $name $(<const $size: usize>)? ($($argument: $type),*) $(-> $result)?, plain $plain, wide $plain
        }
    };
}
pub(crate) use in_each_kind;

/// Bytes that memory is fetched by.
pub(crate) const LINE_BYTES: usize = 64;

/// Asks for the memory that lies `ahead` elements after the first of `here` to be fetched.
#[inline(always)]
pub(crate) fn fetch_ahead<T>(here: &[T], ahead: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        #[expect(unsafe_code, reason = "a hint to the machine")]
        // SAFETY: a hint reads nothing and may name any address.
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(here.as_ptr().wrapping_add(ahead).cast());
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (here, ahead);
}
