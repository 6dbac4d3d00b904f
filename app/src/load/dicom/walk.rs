//! The first look at a DICOM file: where its data set lies and where its pixels are.
//!
//! `dicom-object` trusts the lengths that a file claims: an element of 4 GiB in a file of 1 KiB makes
//! it take 4 GiB. So every length is walked here first, down to the last nested item, and only a data
//! set that fits its file is handed on. Pixels are found here too, as ranges of the file's bytes, so
//! that they need not be copied. Source: DICOM PS3.5 sections 7.1, 7.5, A.4; PS3.10 section 7.1.

use std::ops::Range;

use dicom_core::dictionary::{DataDictionary as _, DataDictionaryEntry as _};
use dicom_core::header::{Tag, VR};
use dicom_dictionary_std::StandardDataDictionary;

/// Nesting that no honest file reaches; `dicom-object` recurses as deep as the file says.
const MAX_DEPTH: usize = 32;
const UNDEFINED: u32 = u32::MAX;
const PIXEL_GROUP: u16 = 0x7FE0;

/// How elements are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Encoding {
    /// Each element names its VR.
    pub(super) explicit: bool,
    /// The most significant byte comes first.
    pub(super) big_endian: bool,
}

impl Encoding {
    const EXPLICIT: Self = Self { explicit: true, big_endian: false };
    const IMPLICIT: Self = Self { explicit: false, big_endian: false };
    const BIG: Self = Self { explicit: true, big_endian: true };
}

/// What kind of numbers the pixel element holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PixelKind {
    /// (7FE0,0010): whole numbers.
    Integer,
    /// (7FE0,0008).
    Float,
    /// (7FE0,0009).
    Double,
}

/// Where the pixels lie in the file's bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Pixels {
    /// One run of samples.
    Native(PixelKind, Range<usize>),
    /// Encoded fragments, the basic offset table first taken off.
    Encapsulated {
        /// Byte offsets of frames, counted from the first fragment's item tag; may be empty.
        offsets: Vec<u32>,
        /// The fragments, without their item headers.
        fragments: Vec<Range<usize>>,
    },
}

/// The anatomy of one file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Anatomy {
    /// Transfer syntax UID, empty where the file does not say.
    pub(super) transfer_syntax: String,
    /// How the data set is written; told by its first element where no syntax is named.
    pub(super) encoding: Encoding,
    /// The elements before the pixels.
    pub(super) elements: Range<usize>,
    /// `None` for an object without pixels: a plan, a report.
    pub(super) pixels: Option<Pixels>,
}

/// Why a file cannot be walked; a clause for people.
pub(super) type Fault = String;

/// Transfer syntax whose data set is deflated as a whole.
pub(super) const DEFLATED: &str = "1.2.840.10008.1.2.1.99";

/// Whether the bytes begin as a DICOM file does: with the preamble, or, in files of old, at once with
/// an element of group 2 or 8.
pub(in crate::load) fn begins_as_dicom(head: &[u8]) -> bool {
    head.get(128..132) == Some(b"DICM".as_slice()) || starts_with_element(head)
}

fn starts_with_element(head: &[u8]) -> bool {
    let Some(&[a, b, c, d, e, f, g, h]) = head.get(..8) else { return false };
    let explicit = VR::from_binary([e, f]).is_some();
    match (a, b) {
        (2 | 8, 0) if d == 0 => explicit || (u32::from_le_bytes([e, f, g, h]) < 1 << 12 && c < 0x70),
        (0, 8) if c == 0 => explicit,
        _ => false,
    }
}

/// The transfer syntax and where the data set starts: all that must be known before it may have to be
/// inflated.
pub(super) fn meta(bytes: &[u8]) -> Result<(String, usize), Fault> {
    let start = if bytes.get(128..132) == Some(b"DICM".as_slice()) {
        132
    } else if starts_with_element(bytes) {
        0
    } else {
        return Err("it does not begin with a DICOM header".to_owned());
    };
    let mut walker = Walker { bytes, at: start };
    let mut transfer_syntax = String::new();
    while walker.peek_group(false) == Some(2) {
        let element = walker.header(Encoding::EXPLICIT)?;
        let value = walker.take(element.tag, element.len)?;
        if element.tag == Tag(2, 0x10) {
            let text = bytes.get(value).unwrap_or_default();
            let text = String::from_utf8_lossy(text);
            text.trim_end_matches(['\0', ' ']).clone_into(&mut transfer_syntax);
        }
    }
    Ok((transfer_syntax, walker.at))
}

/// Walks the data set that starts at `start`, up to its pixels.
///
/// # Errors
/// A [`Fault`]: a length reaches beyond the file or its sequence, or nesting is too deep.
pub(super) fn walk(bytes: &[u8], transfer_syntax: String, start: usize) -> Result<Anatomy, Fault> {
    let encoding = match transfer_syntax.as_str() {
        "1.2.840.10008.1.2" => Encoding::IMPLICIT,
        "1.2.840.10008.1.2.2" => Encoding::BIG,
        "" => guess(bytes.get(start..).unwrap_or_default()),
        // PS3.5 A.4: whatever the pixels are, the rest is explicit little endian.
        _ => Encoding::EXPLICIT,
    };
    let mut walker = Walker { bytes, at: start };
    let (end, pixels) = walker.top(encoding)?;
    Ok(Anatomy { transfer_syntax, encoding, elements: start..end, pixels })
}

fn guess(head: &[u8]) -> Encoding {
    let vr = |at: Range<usize>| {
        head.get(at).and_then(|v| v.try_into().ok()).is_some_and(|v| VR::from_binary(v).is_some())
    };
    match (vr(4..6), head.first()) {
        (true, Some(0)) => Encoding::BIG,
        (true, _) => Encoding::EXPLICIT,
        _ => Encoding::IMPLICIT,
    }
}

#[derive(Debug, Clone, Copy)]
struct Element {
    tag: Tag,
    vr: VR,
    len: u32,
}

struct Walker<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Walker<'_> {
    fn array<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let value = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk::<N>());
        let value = *value.ok_or_else(|| "it ends in the middle of an element".to_owned())?;
        self.at = self.at.saturating_add(N);
        Ok(value)
    }

    fn u16(&mut self, big_endian: bool) -> Result<u16, Fault> {
        let b = self.array::<2>()?;
        Ok(if big_endian { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) })
    }

    fn u32(&mut self, big_endian: bool) -> Result<u32, Fault> {
        let b = self.array::<4>()?;
        Ok(if big_endian { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) })
    }

    fn peek_group(&self, big_endian: bool) -> Option<u16> {
        let b = *self.bytes.get(self.at..)?.first_chunk::<2>()?;
        Some(if big_endian { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) })
    }

    fn header(&mut self, encoding: Encoding) -> Result<Element, Fault> {
        let big = encoding.big_endian;
        let tag = Tag(self.u16(big)?, self.u16(big)?);
        if tag.group() == 0xFFFE {
            return Ok(Element { tag, vr: VR::UN, len: self.u32(big)? });
        }
        if !encoding.explicit {
            let entry = StandardDataDictionary.by_tag(tag);
            let vr = entry.map_or(VR::UN, |e| e.vr().relaxed());
            return Ok(Element { tag, vr, len: self.u32(big)? });
        }
        // An unknown VR is written in the long form (PS3.5 section 6.2), as dicom-encoding reads it.
        let vr = VR::from_binary(self.array::<2>()?).unwrap_or(VR::UN);
        let long = matches!(
            vr,
            VR::OB
                | VR::OD
                | VR::OF
                | VR::OL
                | VR::OV
                | VR::OW
                | VR::SQ
                | VR::SV
                | VR::UC
                | VR::UN
                | VR::UR
                | VR::UT
                | VR::UV
        );
        let len = if long {
            self.array::<2>()?;
            self.u32(big)?
        } else {
            u32::from(self.u16(big)?)
        };
        Ok(Element { tag, vr, len })
    }

    /// Steps over a value that must lie in the file; its range.
    fn take(&mut self, tag: Tag, len: u32) -> Result<Range<usize>, Fault> {
        let end = usize::try_from(len).ok().and_then(|n| self.at.checked_add(n));
        let end = end
            .filter(|&end| end <= self.bytes.len())
            .ok_or_else(|| format!("element {tag} claims {len} bytes, but the file ends before that"))?;
        let range = self.at..end;
        self.at = end;
        Ok(range)
    }

    /// The top level, up to the pixels or the end: where the elements end, and the pixels.
    fn top(&mut self, encoding: Encoding) -> Result<(usize, Option<Pixels>), Fault> {
        while self.at < self.bytes.len() {
            let before = self.at;
            let element = self.header(encoding)?;
            let kind = match element.tag {
                Tag(PIXEL_GROUP, 0x0008) => Some(PixelKind::Float),
                Tag(PIXEL_GROUP, 0x0009) => Some(PixelKind::Double),
                Tag(PIXEL_GROUP, 0x0010) => Some(PixelKind::Integer),
                _ => None,
            };
            match kind {
                Some(_) if element.len == UNDEFINED => return Ok((before, Some(self.fragments()?))),
                Some(kind) => {
                    // Pixels cut short are judged where the number that is needed is known.
                    let end = usize::try_from(element.len).unwrap_or(usize::MAX);
                    let end = self.at.saturating_add(end).min(self.bytes.len());
                    return Ok((before, Some(Pixels::Native(kind, self.at..end))));
                }
                None => self.value(element, encoding, 0)?,
            }
        }
        Ok((self.at, None))
    }

    fn value(&mut self, element: Element, encoding: Encoding, depth: usize) -> Result<(), Fault> {
        let inner = match (element.vr, element.len) {
            // PS3.5 section 6.2.2: UN of undefined length is a sequence in implicit little endian.
            (VR::UN, UNDEFINED) if encoding.explicit => Encoding::IMPLICIT,
            (VR::SQ, _) | (VR::UN, UNDEFINED) => encoding,
            (_, UNDEFINED) => {
                return Err(format!("element {} has no length, though it is no sequence", element.tag));
            }
            _ => return self.take(element.tag, element.len).map(|_| ()),
        };
        if depth >= MAX_DEPTH {
            return Err(format!("its sequences are nested more than {MAX_DEPTH} deep"));
        }
        let end = self.end_of(element)?;
        while end.is_none_or(|end| self.at < end) {
            let item = self.header(inner)?;
            match item.tag {
                Tag(0xFFFE, 0xE0DD) if end.is_none() => return Ok(()),
                Tag(0xFFFE, 0xE000) => self.item(item, inner, depth)?,
                tag => return Err(format!("sequence {} holds {tag} instead of items", element.tag)),
            }
        }
        self.closed(element.tag, end)
    }

    fn item(&mut self, item: Element, encoding: Encoding, depth: usize) -> Result<(), Fault> {
        let end = self.end_of(item)?;
        while end.is_none_or(|end| self.at < end) {
            let element = self.header(encoding)?;
            if element.tag == Tag(0xFFFE, 0xE00D) && end.is_none() {
                return Ok(());
            }
            self.value(element, encoding, depth.saturating_add(1))?;
        }
        self.closed(item.tag, end)
    }

    fn end_of(&self, element: Element) -> Result<Option<usize>, Fault> {
        if element.len == UNDEFINED {
            return Ok(None);
        }
        let mut ahead = Self { bytes: self.bytes, at: self.at };
        Ok(Some(ahead.take(element.tag, element.len)?.end))
    }

    fn closed(&self, tag: Tag, end: Option<usize>) -> Result<(), Fault> {
        match end {
            Some(end) if self.at > end => Err(format!("what {tag} holds is longer than it says")),
            _ => Ok(()),
        }
    }

    fn fragments(&mut self) -> Result<Pixels, Fault> {
        let mut items = Vec::new();
        loop {
            // PS3.5 A.4: item headers of fragments are little endian; the delimiter ends them.
            let item = self.header(Encoding::EXPLICIT)?;
            match item.tag {
                Tag(0xFFFE, 0xE000) => items.push(self.take(item.tag, item.len)?),
                Tag(0xFFFE, 0xE0DD) => break,
                tag => return Err(format!("the pixel data holds {tag} instead of fragments")),
            }
        }
        let mut items = items.into_iter();
        let table = items.next().ok_or_else(|| "the pixel data has no offset table".to_owned())?;
        let (words, _) = self.bytes.get(table).unwrap_or_default().as_chunks::<4>();
        let offsets = words.iter().map(|w| u32::from_le_bytes(*w)).collect();
        Ok(Pixels::Encapsulated { offsets, fragments: items.collect() })
    }
}
