//! Bytes that nobody vouches for: whole files within limits, numbers out of them, and what is wrong.
//!
//! Parsers here work on bytes and know no path, so that tests can feed them anything; they say what is
//! wrong as a [`Fault`], and [`Fault::at`] adds the format and the path at the door.

use std::io::Read as _;
use std::path::Path;

use render::volume::MeshError;
use render::volume::cells::{CellGridError, Values};

use super::{Limits, LoadError, Progress};

/// What is wrong with some bytes, before it is known which file they are.
#[derive(Debug)]
pub(super) enum Fault {
    /// They are broken, in a clause.
    Broken(String),
    /// They are right, but use what is not read here, and the remedy.
    Unsupported(String, &'static str),
    /// They ask for that many bytes.
    TooLarge(u128),
    /// The user asked to stop.
    Cancelled,
    /// Another file, which these bytes name, was at fault.
    Elsewhere(LoadError),
}

impl Fault {
    /// The error that a loader of `format` returns for `path`.
    pub(super) fn at(self, format: &'static str, path: &Path, limits: &Limits) -> LoadError {
        let path = path.to_owned();
        match self {
            Self::Broken(fault) => LoadError::Broken { format, fault, path },
            Self::Unsupported(feature, remedy) => LoadError::Unsupported { format, feature, remedy, path },
            Self::TooLarge(bytes) => LoadError::TooLarge { format, bytes, limit: limits.decoded_bytes, path },
            Self::Cancelled => LoadError::Cancelled,
            Self::Elsewhere(error) => error,
        }
    }
}

impl From<String> for Fault {
    fn from(clause: String) -> Self {
        Self::Broken(clause)
    }
}

impl From<&str> for Fault {
    fn from(clause: &str) -> Self {
        Self::Broken(clause.to_owned())
    }
}

impl From<MeshError> for Fault {
    fn from(error: MeshError) -> Self {
        Self::Broken(error.to_string())
    }
}

impl From<CellGridError> for Fault {
    fn from(error: CellGridError) -> Self {
        Self::Broken(error.to_string())
    }
}

impl From<LoadError> for Fault {
    fn from(error: LoadError) -> Self {
        Self::Elsewhere(error)
    }
}

/// The whole of a file, if it is no longer than the limit.
pub(super) fn whole(path: &Path, format: &'static str, limits: &Limits) -> Result<Vec<u8>, LoadError> {
    let io = |source| LoadError::Io { path: path.to_owned(), source };
    let file = std::fs::File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    // One byte past the limit is enough to know, whatever the length in the folder says.
    file.take(limits.decoded_bytes.saturating_add(1)).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > limits.decoded_bytes {
        return Err(Fault::TooLarge(bytes.len() as u128).at(format, path, limits));
    }
    Ok(bytes)
}

/// The file's name, for an item that has none of its own.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Says how far a load has come.
///
/// # Errors
/// [`Fault::Cancelled`] when asked to stop.
pub(super) fn step(progress: &dyn Progress, doing: &str, done: usize, total: usize) -> Result<(), Fault> {
    if progress.step(doing, done, total) { Ok(()) } else { Err(Fault::Cancelled) }
}

/// `count` things of `size` bytes as a length, if the limit allows them.
///
/// # Errors
/// [`Fault::TooLarge`].
pub(super) fn afford(count: u64, size: usize, limits: &Limits) -> Result<usize, Fault> {
    let bytes = u128::from(count).saturating_mul(size as u128);
    match usize::try_from(count) {
        Ok(count) if bytes <= u128::from(limits.decoded_bytes) => Ok(count),
        _ => Err(Fault::TooLarge(bytes)),
    }
}

/// The first `count` bytes, and the rest, if there are so many.
pub(super) fn split(bytes: &[u8], count: u64) -> Option<(&[u8], &[u8])> {
    bytes.split_at_checked(usize::try_from(count).ok()?)
}

/// A name with `%20` and the like as the characters they stand for; `None` where they stand for none.
pub(super) fn unescaped(name: &str) -> Option<String> {
    let mut parts = name.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let (digits, rest) = part.split_at_checked(2)?;
        bytes.push(u8::from_str_radix(digits, 16).ok()?);
        bytes.extend(rest.bytes());
    }
    String::from_utf8(bytes).ok()
}

/// Which byte of a number comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Endian {
    /// The least.
    Little,
    /// The greatest.
    Big,
}

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// `$one` of each number in `$bytes`, whose type is what `$scalar` says, as what `$finish` makes of an
/// iterator.
macro_rules! each_number {
    ($bytes:expr, $scalar:expr, $endian:expr, $x:ident => $one:expr, $finish:ident) => {{
        macro_rules! of {
            ($t:ty) => {
                $bytes
                    .as_chunks()
                    .0
                    .iter()
                    .map(|&chunk| {
                        let $x = match $endian {
                            Endian::Little => <$t>::from_le_bytes(chunk),
                            Endian::Big => <$t>::from_be_bytes(chunk),
                        };
                        $one
                    })
                    .$finish()
            };
        }
        match $scalar {
            Scalar::I8 => of!(i8),
            Scalar::U8 => of!(u8),
            Scalar::I16 => of!(i16),
            Scalar::U16 => of!(u16),
            Scalar::I32 => of!(i32),
            Scalar::U32 => of!(u32),
            Scalar::I64 => of!(i64),
            Scalar::U64 => of!(u64),
            Scalar::F32 => of!(f32),
            Scalar::F64 => of!(f64),
        }
    }};
}

impl Scalar {
    /// Bytes of one.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Whether `f32` holds every such number.
    pub(super) fn fits_f32(self) -> bool {
        matches!(self, Self::I8 | Self::U8 | Self::I16 | Self::U16 | Self::F32)
    }

    /// All numbers in `bytes` as field values; an incomplete last one is left out.
    #[expect(
        clippy::cast_possible_truncation,
        trivial_numeric_casts,
        reason = "only what f32 holds is cast to it; one macro arm is f32 itself"
    )]
    pub(super) fn values(self, bytes: &[u8], endian: Endian) -> Values {
        if self.fits_f32() {
            Values::F32(each_number!(bytes, self, endian, x => x as f32, collect))
        } else {
            Values::F64(self.reals(bytes, endian))
        }
    }

    /// All numbers in `bytes`; an incomplete last one is left out.
    #[expect(trivial_numeric_casts, reason = "one macro arm is f64 itself")]
    pub(super) fn reals(self, bytes: &[u8], endian: Endian) -> Vec<f64> {
        each_number!(bytes, self, endian, x => x as f64, collect)
    }

    /// The first number in `bytes`.
    #[expect(trivial_numeric_casts, reason = "one macro arm is f64 itself")]
    pub(super) fn one(self, bytes: &[u8], endian: Endian) -> Option<f64> {
        each_number!(bytes, self, endian, x => x as f64, next)
    }

    /// All numbers in `bytes` as positions; what `i64` does not hold becomes its nearest, which no
    /// file is long enough for.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        trivial_numeric_casts,
        reason = "a position above 2^63 becomes negative and is refused like any that is not there"
    )]
    pub(super) fn positions(self, bytes: &[u8], endian: Endian) -> Vec<i64> {
        each_number!(bytes, self, endian, x => x as i64, collect)
    }
}

/// Values of one component each as tuples of all of them; as long as the shortest.
pub(super) fn interleaved(parts: &[Values]) -> Values {
    let tuples = parts.iter().map(Values::len).min().unwrap_or(0);
    let numbers = || (0..tuples).flat_map(|tuple| parts.iter().map(move |part| part.at(tuple)));
    if parts.iter().all(|part| matches!(part, Values::F32(_))) {
        #[expect(clippy::cast_possible_truncation, reason = "all parts are f32 already")]
        Values::F32(numbers().map(|number| number as f32).collect())
    } else {
        Values::F64(numbers().collect())
    }
}

/// Base64 text as bytes, read on demand. Each group of four characters stands for itself, so padded
/// pieces may follow one another (VTK encodes a header and its data apart); white space is skipped.
#[derive(Debug)]
pub(super) struct Base64<'a> {
    text: &'a [u8],
    ready: Vec<u8>,
}

impl<'a> Base64<'a> {
    /// Bytes that `text` stands for.
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { text, ready: Vec::new() }
    }

    /// The next group's bytes, `None` at the end.
    fn group(&mut self) -> std::io::Result<Option<([u8; 3], usize)>> {
        let broken = |what: &str| std::io::Error::new(std::io::ErrorKind::InvalidData, what.to_owned());
        let (mut bits, mut digits, mut padding) = (0_u32, 0_usize, 0_usize);
        while digits < 4 {
            let Some((&character, rest)) = self.text.split_first() else {
                if digits == 0 {
                    return Ok(None);
                }
                return Err(broken("the base64 text stops inside a group of four"));
            };
            self.text = rest;
            let letter = u32::from(character);
            let value = match character {
                b'A'..=b'Z' => letter.wrapping_sub(65),
                b'a'..=b'z' => letter.wrapping_sub(71),
                b'0'..=b'9' => letter.wrapping_add(4),
                b'+' => 62,
                b'/' => 63,
                b'=' => 0,
                b' ' | b'\n' | b'\r' | b'\t' => continue,
                _ => return Err(broken("the base64 text has a character that is not base64")),
            };
            if character == b'=' {
                padding = padding.saturating_add(1);
            } else if padding > 0 {
                return Err(broken("the base64 text has padding inside a group of four"));
            }
            bits = (bits << 6) | value;
            digits = digits.saturating_add(1);
        }
        if padding > 2 {
            return Err(broken("the base64 text has a group of padding only"));
        }
        let [_, a, b, c] = bits.to_be_bytes();
        Ok(Some(([a, b, c], 3_usize.saturating_sub(padding))))
    }
}

impl std::io::Read for Base64<'_> {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        while self.ready.len() < out.len() {
            let Some((group, valid)) = self.group()? else { break };
            self.ready.extend(group.iter().take(valid));
        }
        let count = self.ready.len().min(out.len());
        for (slot, byte) in out.iter_mut().zip(self.ready.drain(..count)) {
            *slot = byte;
        }
        Ok(count)
    }
}

/// What tests of these loaders share.
#[cfg(test)]
#[expect(clippy::indexing_slicing, reason = "a test may fail loudly")]
pub(super) mod trial {
    use std::path::{Path, PathBuf};

    /// A file of the sample data, or nothing, said so, where there is no such folder.
    pub(in crate::load) fn sample(name: &str) -> Option<PathBuf> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
        if root.is_dir() {
            return Some(root.join(name));
        }
        println!("skipped: the sample data are not at {}", root.display());
        None
    }

    /// Parses each beginning of `good`, and `good` with each byte set to three others, one at a time; which
    /// three goes round with the position. What comes out does not matter: a panic fails the test that calls this.
    pub(in crate::load) fn survives<T>(good: &[u8], parse: impl Fn(&[u8]) -> T) {
        for length in 0..good.len() {
            drop(parse(&good[..length]));
        }
        let mut bytes = good.to_vec();
        for position in 0..good.len() {
            let was = good[position];
            let others = [0, 0x7f, 0x80, 0xff, was ^ 1, was ^ 0x10, was.wrapping_add(7), b'9', b' ', b'-'];
            for other in others.iter().cycle().skip(position % 10).step_by(3).take(3) {
                bytes[position] = *other;
                drop(parse(&bytes));
            }
            bytes[position] = was;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(text: &str) -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        Base64::new(text.as_bytes()).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    #[test]
    fn base64_agrees_with_the_standards_examples() {
        // RFC 4648, section 10.
        for (text, plain) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYmFy", "foobar")]
        {
            assert_eq!(decoded(text).expect("legal"), plain.as_bytes(), "{text}");
        }
        assert_eq!(decoded("+/+/").expect("legal"), [0xfb, 0xff, 0xbf], "the last two letters");
        assert_eq!(decoded(" Zg==\nZm9v\t").expect("legal"), b"ffoo", "pieces one after the other");
        for text in ["Z", "Zg=", "Z=9v", "Zm9v!AAA", "===="] {
            assert!(decoded(text).is_err(), "{text} is not base64");
        }
    }

    #[test]
    fn numbers_are_read_in_both_byte_orders() {
        assert_eq!(Scalar::I16.positions(&[0xff, 0xfe, 1], Endian::Big), [-2], "big, cut one left out");
        assert_eq!(Scalar::I16.positions(&[0xff, 0xfe], Endian::Little), [-257], "little");
        let values = Scalar::F32.values(&1.5_f32.to_be_bytes(), Endian::Big);
        assert_eq!(values, Values::F32(vec![1.5]), "float");
        let values = Scalar::I32.values(&16_777_217_i32.to_le_bytes(), Endian::Little);
        assert_eq!(values, Values::F64(vec![16_777_217.0]), "what f32 does not hold stays exact");
    }

    #[test]
    fn what_the_limit_does_not_allow_is_refused_before_it_is_taken() {
        let limits = Limits { decoded_bytes: 100, files: 1 };
        assert_eq!(afford(25, 4, &limits).ok(), Some(25), "just allowed");
        assert!(matches!(afford(26, 4, &limits), Err(Fault::TooLarge(104))), "one more");
        assert!(matches!(afford(u64::MAX, 24, &limits), Err(Fault::TooLarge(_))), "no overflow");
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), [0; 101]).expect("written");
        assert!(matches!(whole(file.path(), "X", &limits), Err(LoadError::TooLarge { .. })), "long file");
    }
}
