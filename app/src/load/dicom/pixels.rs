//! The samples of one frame, whatever they are packed in.

use std::borrow::Cow;

use render::volume::Samples;

use super::header::{Image, PixelFormat};
use super::walk::{Anatomy, Fault, PixelKind, Pixels};
use super::{codecs, jpegls, rle};

/// Why a frame has no samples.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Trouble {
    /// The data are damaged.
    Broken(Fault),
    /// The file uses what this program cannot read.
    Unsupported(String),
}

impl From<Fault> for Trouble {
    fn from(fault: Fault) -> Self {
        Self::Broken(fault)
    }
}

/// A type that samples are kept in.
pub(super) trait Sample: Copy + Default + PartialEq + PartialOrd + Send + Sync + 'static {
    /// From the file's bits, already masked and sign-extended for whole numbers, raw for floats.
    fn from_bits(bits: i64) -> Self;
    /// As a number.
    fn to_f64(self) -> f64;
    /// The nearest value of the type.
    fn nearest(value: f64) -> Self;
    /// Many of them.
    fn samples(values: Vec<Self>) -> Samples;
}

macro_rules! whole {
    ($($type:ty => $kind:ident),*) => {$(
        impl Sample for $type {
            #[expect(clippy::cast_possible_truncation, reason = "masked to the type's own width")]
            fn from_bits(bits: i64) -> Self {
                bits as Self
            }
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[expect(clippy::cast_possible_truncation, reason = "`as` from a float stays in range")]
            fn nearest(value: f64) -> Self {
                value.round() as Self
            }
            fn samples(values: Vec<Self>) -> Samples {
                Samples::$kind(values)
            }
        }
    )*};
}

whole!(u8 => U8, i8 => I8, u16 => U16, i16 => I16, u32 => U32, i32 => I32);

impl Sample for f32 {
    #[expect(clippy::cast_possible_truncation, reason = "the low half holds the bits")]
    fn from_bits(bits: i64) -> Self {
        Self::from_bits(bits as u32)
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    #[expect(clippy::cast_possible_truncation, reason = "rounding is what it is for")]
    fn nearest(value: f64) -> Self {
        value as Self
    }
    fn samples(values: Vec<Self>) -> Samples {
        Samples::F32(values)
    }
}

impl Sample for f64 {
    fn from_bits(bits: i64) -> Self {
        Self::from_bits(bits.cast_unsigned())
    }
    fn to_f64(self) -> f64 {
        self
    }
    fn nearest(value: f64) -> Self {
        value
    }
    fn samples(values: Vec<Self>) -> Samples {
        Samples::F64(values)
    }
}

/// Decodes frame `index` of a file into `out`, which has its columns × rows.
///
/// # Errors
/// [`Trouble`]: pixel data that are too short, damaged or of another size than the header says, or a
/// transfer syntax that is not read.
pub(super) fn decode<T: Sample>(
    bytes: &[u8],
    anatomy: &Anatomy,
    image: &Image,
    index: usize,
    out: &mut [T],
) -> Result<(), Trouble> {
    let width = usize::try_from(image.format.allocated / 8).unwrap_or(8);
    let needed = out.len().saturating_mul(width);
    let big = anatomy.encoding.big_endian;
    match &anatomy.pixels {
        None => Err(Trouble::Broken("it has no pixel data".to_owned())),
        Some(Pixels::Native(_, range)) => {
            let start = range.start.saturating_add(index.saturating_mul(needed));
            let frame = bytes
                .get(start..start.saturating_add(needed))
                .filter(|_| index.saturating_add(1).saturating_mul(needed) <= range.len());
            let frame = frame.ok_or_else(|| {
                format!(
                    "its {}x{} picture needs {needed} bytes, but the pixel data have {}",
                    image.columns,
                    image.rows,
                    range.len()
                )
            })?;
            unpack(frame, image.format, big, out);
            Ok(())
        }
        Some(Pixels::Encapsulated { offsets, fragments }) => {
            let ranges = frame_fragments(bytes, offsets, fragments, image.frames.len(), index)?;
            let coded = match ranges {
                [one] => Cow::Borrowed(bytes.get(one.clone()).unwrap_or_default()),
                many => Cow::Owned(
                    many.iter().flat_map(|r| bytes.get(r.clone()).unwrap_or_default()).copied().collect(),
                ),
            };
            expand(&coded, image, out)
        }
    }
}

/// The fragments that make up one frame (PS3.5 A.4): all where there is one frame, one each where there
/// are as many as frames, and else those from its offset to the next frame's.
fn frame_fragments<'a>(
    bytes: &[u8],
    offsets: &[u32],
    fragments: &'a [std::ops::Range<usize>],
    frames: usize,
    index: usize,
) -> Result<&'a [std::ops::Range<usize>], Fault> {
    let lost = || format!("the fragments of frame {} cannot be told apart", index.saturating_add(1));
    let next = index.saturating_add(1);
    if frames <= 1 && !fragments.is_empty() {
        return Ok(fragments);
    }
    if fragments.len() == frames {
        return fragments.get(index..next).ok_or_else(lost);
    }
    let starts: Vec<usize> = if offsets.len() == frames {
        // Offsets count from the first fragment's item header, which is 8 bytes long.
        let first = fragments.first().map_or(0, |f| f.start);
        offsets
            .iter()
            .filter_map(|o| {
                let at = first.checked_add(usize::try_from(*o).ok()?)?;
                fragments.iter().position(|f| f.start == at)
            })
            .collect()
    } else {
        // Each codec's stream begins with a marker of its own.
        let begins = |f: &std::ops::Range<usize>| {
            matches!(bytes.get(f.clone()), Some([0xFF, 0xD8, ..] | [0xFF, 0x4F, 0xFF, 0x51, ..]))
        };
        (0..fragments.len()).filter(|i| fragments.get(*i).is_some_and(begins)).collect()
    };
    if starts.len() != frames {
        return Err(lost());
    }
    let start = starts.get(index).copied().ok_or_else(lost)?;
    let end = starts.get(next).copied().unwrap_or(fragments.len());
    fragments.get(start..end).filter(|f| !f.is_empty()).ok_or_else(lost)
}

/// Decompresses one frame.
fn expand<T: Sample>(coded: &[u8], image: &Image, out: &mut [T]) -> Result<(), Trouble> {
    let (columns, rows) = (image.columns, image.rows);
    let format = image.format;
    // Even an empty picture takes some bytes; what asks for more than this is no picture but a claim.
    if out.len() > coded.len().saturating_mul(20_000).saturating_add(1 << 20) {
        let fault = format!("its {columns}x{rows} picture cannot come out of {} bytes", coded.len());
        return Err(Trouble::Broken(fault));
    }
    match image.transfer_syntax.as_str() {
        "1.2.840.10008.1.2.5" => {
            let width = usize::try_from(format.allocated / 8).unwrap_or(4);
            unpack(&rle::decode(coded, out.len(), width)?, format, false, out);
        }
        "1.2.840.10008.1.2.4.50"
        | "1.2.840.10008.1.2.4.51"
        | "1.2.840.10008.1.2.4.57"
        | "1.2.840.10008.1.2.4.70" => place(&codecs::jpeg(coded, columns, rows)?, format, out),
        "1.2.840.10008.1.2.4.80" | "1.2.840.10008.1.2.4.81" => {
            place(&jpegls::decode(coded, columns, rows)?, format, out);
        }
        "1.2.840.10008.1.2.4.90" | "1.2.840.10008.1.2.4.91" => {
            place(&codecs::jpeg2000(coded, columns, rows)?, format, out);
        }
        other => {
            return Err(Trouble::Unsupported(format!("the transfer syntax {other}")));
        }
    }
    Ok(())
}

/// Samples from a codec: the low bits are what counts, whatever sign the codec gave them.
fn place<S: Copy + Into<i64>, T: Sample>(samples: &[S], format: PixelFormat, out: &mut [T]) {
    // Codecs right-align what they code, so the high bit of the uncompressed form does not matter.
    let aligned = PixelFormat { high_bit: format.stored.saturating_sub(1), ..format };
    let meaning = Meaning::of(aligned);
    for (slot, &sample) in out.iter_mut().zip(samples) {
        *slot = T::from_bits(meaning.apply(sample.into()));
    }
}

/// Uncompressed samples.
fn unpack<T: Sample>(bytes: &[u8], format: PixelFormat, big_endian: bool, out: &mut [T]) {
    fn words<const N: usize, T: Sample>(bytes: &[u8], out: &mut [T], value: impl Fn([u8; N]) -> i64 + Sync) {
        for (slot, word) in out.iter_mut().zip(bytes.as_chunks::<N>().0) {
            *slot = T::from_bits(value(*word));
        }
    }
    let meaning = Meaning::of(format);
    let whole = format.kind == PixelKind::Integer;
    match (format.allocated, big_endian) {
        (8, _) => words(bytes, out, |[b]: [u8; 1]| meaning.apply(i64::from(b))),
        (16, false) => words(bytes, out, |w| meaning.apply(i64::from(u16::from_le_bytes(w)))),
        (16, true) => words(bytes, out, |w| meaning.apply(i64::from(u16::from_be_bytes(w)))),
        (32, false) if whole => words(bytes, out, |w| meaning.apply(i64::from(u32::from_le_bytes(w)))),
        (32, true) if whole => words(bytes, out, |w| meaning.apply(i64::from(u32::from_be_bytes(w)))),
        (32, false) => words(bytes, out, |w| i64::from(u32::from_le_bytes(w))),
        (32, true) => words(bytes, out, |w| i64::from(u32::from_be_bytes(w))),
        (_, false) => words(bytes, out, i64::from_le_bytes),
        (_, true) => words(bytes, out, i64::from_be_bytes),
    }
}

/// Which bits of a stored word are the sample (PS3.5 section 8.1.1): the others may hold overlays.
struct Meaning {
    shift: u32,
    mask: i64,
    sign: i64,
}

impl Meaning {
    fn of(format: PixelFormat) -> Self {
        let stored = format.stored.clamp(1, 32);
        let one = 1_i64;
        Self {
            shift: format.high_bit.saturating_add(1).saturating_sub(stored).min(31),
            mask: one.wrapping_shl(stored).wrapping_sub(1),
            sign: if format.signed { one.wrapping_shl(stored.saturating_sub(1)) } else { 0 },
        }
    }

    fn apply(&self, word: i64) -> i64 {
        let low = word.wrapping_shr(self.shift) & self.mask;
        // Flipping the sign bit and taking it off again extends it.
        (low ^ self.sign).wrapping_sub(self.sign)
    }
}

#[cfg(test)]
#[expect(clippy::indexing_slicing, reason = "a test may fail loudly")]
mod tests {
    use super::*;

    #[test]
    fn bits_above_the_sample_are_masked_and_the_sign_is_extended() {
        let format = |high_bit, signed| PixelFormat {
            allocated: 16,
            stored: 12,
            high_bit,
            signed,
            kind: PixelKind::Integer,
        };
        let read = |word: u16, format| {
            let mut out = [0_i16];
            unpack(&word.to_le_bytes(), format, false, &mut out);
            out[0]
        };
        assert_eq!(read(0xF123, format(11, false)), 0x123, "overlay bits above");
        assert_eq!(read(0x1FFF, format(11, true)), -1, "twelve bits, signed");
        assert_eq!(read(0x1234, format(15, false)), 0x123, "left-aligned");
    }

    #[test]
    fn fragments_are_dealt_to_frames_by_the_offset_table() {
        let fragments = vec![8..10, 18..20, 28..30];
        let of = |offsets: &[u32], frames, index| {
            frame_fragments(&[0; 40], offsets, &fragments, frames, index).map(<[_]>::to_vec)
        };
        assert_eq!(of(&[], 1, 0), Ok(fragments.clone()), "one frame takes all");
        assert_eq!(of(&[], 3, 1), Ok(fragments[1..2].to_vec()), "one each");
        assert_eq!(of(&[0, 20], 2, 0), Ok(vec![8..10, 18..20]), "up to the next offset");
        assert_eq!(of(&[0, 20], 2, 1), Ok(fragments[2..].to_vec()), "the rest");
        assert!(of(&[], 2, 0).is_err(), "neither table nor marker");
    }
}
