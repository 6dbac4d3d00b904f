//! zfp in fixed-rate mode, serial, on 8-bit samples.
//!
//! zfp has no 8-bit type. Its manual promotes such samples to 31-bit integers ("Using Integers"); as floats they cost an
//! exponent a block. Both are here.

use std::ffi::c_void;

use zfp_sys as sys;

/// What the samples become for zfp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    Int32,
    Float32,
}

/// An array of up to four dimensions in zfp's hands.
#[derive(Debug)]
pub struct Array {
    scalar: Scalar,
    sizes: Vec<usize>,
    values: Vec<u32>,
}

impl Array {
    /// `samples` are those of 3 or 4 `sizes`, the first the fastest.
    pub fn new(scalar: Scalar, samples: &[u8], sizes: &[usize]) -> Self {
        assert_eq!(samples.len(), sizes.iter().product::<usize>(), "samples of the sizes");
        let value = |&sample: &u8| match scalar {
            // zfp_promote_uint8_to_int32, which works on whole blocks only.
            Scalar::Int32 => ((i32::from(sample) - 0x80) << 23) as u32,
            Scalar::Float32 => f32::from(sample).to_bits(),
        };
        Self { scalar, sizes: sizes.to_vec(), values: samples.iter().map(value).collect() }
    }

    /// The samples, to the nearest 8-bit value. (zfp_demote_int32_to_uint8 rounds down, which is worse for zfp.)
    pub fn samples(&self) -> Vec<u8> {
        let sample = |&value: &u32| match self.scalar {
            Scalar::Int32 => (((value as i32).saturating_add(1 << 22) >> 23) + 0x80).clamp(0, 255) as u8,
            Scalar::Float32 => f32::from_bits(value).round().clamp(0.0, 255.0) as u8,
        };
        self.values.iter().map(sample).collect()
    }

    /// Compresses at `rate` bits a sample.
    pub fn compress(&mut self, rate: f64) -> Vec<u8> {
        let mut bytes = vec![0; (self.values.len() as f64 * rate / 8.0) as usize + (1 << 16)];
        // The field says how much zfp needs at most; blocks that are not whole cost as whole ones.
        let len = self.with_stream(rate, &mut bytes, |stream, field| {
            // SAFETY: both are open.
            unsafe { sys::zfp_stream_maximum_size(stream, field) }
        });
        bytes.resize(len, 0);
        let len = self.with_stream(rate, &mut bytes, |stream, field| {
            // SAFETY: both are open, and the stream has room for the field.
            unsafe { sys::zfp_compress(stream, field) }
        });
        assert_ne!(len, 0, "zfp compresses");
        bytes.truncate(len);
        bytes
    }

    /// Overwrites the array with what `bytes`, made by [`Self::compress`] at the same rate, hold.
    pub fn decompress(&mut self, bytes: &mut [u8], rate: f64) {
        let len = self.with_stream(rate, bytes, |stream, field| {
            // SAFETY: both are open, and the field has the sizes that were compressed.
            unsafe { sys::zfp_decompress(stream, field) }
        });
        assert_ne!(len, 0, "zfp decompresses");
    }

    fn with_stream<R>(
        &mut self,
        rate: f64,
        bytes: &mut [u8],
        use_it: impl FnOnce(*mut sys::zfp_stream, *mut sys::zfp_field) -> R,
    ) -> R {
        let kind = match self.scalar {
            Scalar::Int32 => sys::zfp_type_zfp_type_int32,
            Scalar::Float32 => sys::zfp_type_zfp_type_float,
        };
        let values = self.values.as_mut_ptr().cast::<c_void>();
        // SAFETY: `values` and `bytes` outlive the field and the stream, which are closed here.
        unsafe {
            let field = match *self.sizes.as_slice() {
                [x, y, z] => sys::zfp_field_3d(values, kind, x, y, z),
                [x, y, z, w] => sys::zfp_field_4d(values, kind, x, y, z, w),
                _ => unreachable!("3 or 4 dimensions"),
            };
            let bits = sys::stream_open(bytes.as_mut_ptr().cast(), bytes.len());
            let stream = sys::zfp_stream_open(bits);
            sys::zfp_stream_set_rate(stream, rate, kind, self.sizes.len() as u32, 0);
            sys::zfp_stream_rewind(stream);
            let result = use_it(stream, field);
            sys::zfp_stream_close(stream);
            sys::stream_close(bits);
            sys::zfp_field_free(field);
            result
        }
    }
}
