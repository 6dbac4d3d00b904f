//! What the attributes of one file say: its pixels' format, and for each frame where it lies, what its
//! values mean and when it was taken.
//!
//! A frame's attributes are looked for in its own functional groups, then in the shared ones, then at
//! the top level (DICOM PS3.3 C.7.6.16), so that plain and enhanced files are read by one code.
#![expect(clippy::arithmetic_side_effects, reason = "f64 vectors of nalgebra")]

use dicom_core::header::Tag;
use dicom_dictionary_std::tags;
use dicom_object::mem::{InMemDicomObject as Object, InMemElement};
use dicom_transfer_syntax_registry::entries;
use render::volume::{Point, Rescale, Vector};

use super::super::{Note, Severity};
use super::walk::{Anatomy, Encoding, Fault, PixelKind, Pixels};

/// How a sample is stored (PS3.5 section 8.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PixelFormat {
    /// Bits that a sample takes: 8, 16, 32; 64 for doubles.
    pub(super) allocated: u32,
    /// Bits that mean something.
    pub(super) stored: u32,
    /// Position of the highest of them.
    pub(super) high_bit: u32,
    pub(super) signed: bool,
    pub(super) kind: PixelKind,
}

/// One file with pixels.
#[derive(Debug)]
pub(super) struct Image {
    /// Where it came from: its position among the sources.
    pub(super) source: usize,
    pub(super) transfer_syntax: String,
    pub(super) series_uid: String,
    pub(super) instance_uid: String,
    pub(super) series_number: Option<i64>,
    /// Series description, or empty.
    pub(super) description: String,
    pub(super) modality: Option<String>,
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Whether a sample is a quantity, not a colour or an index of one.
    pub(super) grey: bool,
    pub(super) monochrome1: bool,
    pub(super) format: PixelFormat,
    /// Closed range of stored values that mean "no sample" (C.7.5.1.1.2).
    pub(super) padding: Option<[i64; 2]>,
    pub(super) thickness_mm: Option<f64>,
    pub(super) between_mm: Option<f64>,
    pub(super) repetition_secs: Option<f64>,
    pub(super) lossy: bool,
    pub(super) frames: Vec<Frame>,
    pub(super) notes: Vec<Note>,
}

/// One picture of a file.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    /// Centre of the first pixel; mm.
    pub(super) position: Option<Point>,
    /// Unit directions in which the column index and the row index rise.
    pub(super) directions: Option<[Vector; 2]>,
    /// Distance between columns and between rows; mm.
    pub(super) spacing_mm: Option<[f64; 2]>,
    pub(super) rescale: Rescale,
    pub(super) instance: i64,
    /// Position in time by the file's own count.
    pub(super) temporal_index: Option<i64>,
    pub(super) acquisition: Option<i64>,
    /// Time since an epoch that is the same within a series.
    pub(super) clock_secs: Option<f64>,
    pub(super) trigger_secs: Option<f64>,
    /// What tells pictures of one place and time apart: image type, echo, diffusion weight.
    pub(super) variant: String,
}

struct Lookup<'a> {
    root: &'a Object,
    groups: [Option<&'a Object>; 2],
}

impl<'a> Lookup<'a> {
    fn element(&self, group: Tag, tag: Tag) -> Option<&'a InMemElement> {
        self.groups
            .iter()
            .flatten()
            .find_map(|g| first_item(g, group)?.get(tag))
            .or_else(|| self.root.get(tag))
            .or_else(|| first_item(self.root, tags::DETECTOR_INFORMATION_SEQUENCE)?.get(tag))
    }

    fn floats<const N: usize>(&self, group: Tag, tag: Tag) -> Option<[f64; N]> {
        let values = self.element(group, tag)?.to_multi_float64().ok()?;
        let values: [f64; N] = values.get(..N)?.try_into().ok()?;
        values.iter().all(|v| v.is_finite()).then_some(values)
    }

    fn float(&self, group: Tag, tag: Tag) -> Option<f64> {
        self.floats::<1>(group, tag).map(|[v]| v)
    }

    fn int(&self, group: Tag, tag: Tag) -> Option<i64> {
        self.element(group, tag)?.to_int().ok()
    }

    fn text(&self, group: Tag, tag: Tag) -> Option<String> {
        let text = self.element(group, tag)?.to_str().ok()?;
        Some(text.trim_matches(['\0', ' ']).to_owned()).filter(|t| !t.is_empty())
    }
}

fn first_item(object: &Object, sequence: Tag) -> Option<&Object> {
    object.get(sequence)?.items()?.first()
}

fn int(object: &Object, tag: Tag) -> Option<i64> {
    object.get(tag)?.to_int().ok()
}

fn text(object: &Object, tag: Tag) -> Option<String> {
    let text = object.get(tag)?.to_str().ok()?;
    Some(text.trim_matches(['\0', ' ']).to_owned()).filter(|t| !t.is_empty())
}

/// The attributes before the pixels.
pub(super) fn parse(bytes: &[u8], anatomy: &Anatomy) -> Result<Object, Fault> {
    let syntax = match anatomy.encoding {
        Encoding { explicit: false, .. } => entries::IMPLICIT_VR_LITTLE_ENDIAN.erased(),
        Encoding { big_endian: true, .. } => entries::EXPLICIT_VR_BIG_ENDIAN.erased(),
        Encoding { .. } => entries::EXPLICIT_VR_LITTLE_ENDIAN.erased(),
    };
    let elements = bytes.get(anatomy.elements.clone()).unwrap_or_default();
    // The parser's own message may quote values, and these may be a patient's.
    Object::read_dataset_with_ts(elements, &syntax)
        .ok()
        .ok_or_else(|| "its attributes cannot be parsed".to_owned())
}

/// Reads the attributes of a file with pixels.
///
/// # Errors
/// A [`Fault`]: no or impossible rows, columns or bits.
pub(super) fn read(source: usize, bytes: &[u8], anatomy: &Anatomy) -> Result<Image, Fault> {
    let root = parse(bytes, anatomy)?;
    let size = |tag: Tag, name: &str| {
        let n = int(&root, tag).and_then(|n| usize::try_from(n).ok()).filter(|n| (1..=65535).contains(n));
        n.ok_or_else(|| format!("it has pixel data but no usable {name}"))
    };
    let (rows, columns) = (size(tags::ROWS, "Rows")?, size(tags::COLUMNS, "Columns")?);
    let kind = match &anatomy.pixels {
        Some(Pixels::Native(kind, _)) => *kind,
        _ => PixelKind::Integer,
    };
    let format = pixel_format(&root, kind)?;
    let samples_per_pixel =
        int(&root, tags::SAMPLES_PER_PIXEL).and_then(|n| usize::try_from(n).ok()).unwrap_or(1).clamp(1, 4);
    let mut notes = Vec::new();
    let frame_bytes = rows
        .saturating_mul(columns)
        .saturating_mul(samples_per_pixel)
        .saturating_mul(usize::try_from(format.allocated / 8).unwrap_or(8));
    let count = frame_count(&root, anatomy, frame_bytes, &mut notes)?;
    let frames = frames(&root, count, &mut notes);
    let photometric = text(&root, tags::PHOTOMETRIC_INTERPRETATION).unwrap_or_default();
    if text(&root, tags::IMAGE_TYPE).is_some_and(|t| t.contains("MOSAIC")) {
        notes.push(Note {
            severity: Severity::Caution,
            code: "dicom.mosaic",
            text: "The picture is a mosaic of many slices, which is not taken apart; export the slices one by one."
                .to_owned(),
        });
    }
    let at_root = Lookup { root: &root, groups: [None, None] };
    let none = Tag(0, 0);
    let padding = int(&root, tags::PIXEL_PADDING_VALUE).map(|value| {
        let limit = int(&root, tags::PIXEL_PADDING_RANGE_LIMIT).unwrap_or(value);
        // A value may be written unsigned for signed pixels, as its VR is the reader's guess.
        [value.min(limit), value.max(limit)].map(|v| as_stored(v, format))
    });
    if root.get(tags::MODALITY_LUT_SEQUENCE).is_some() {
        notes.push(Note {
            severity: Severity::Caution,
            code: "dicom.modality-lut",
            text: "The file has a modality table, which is not applied; values are as stored.".to_owned(),
        });
    }
    if anatomy.transfer_syntax.is_empty() {
        notes.push(Note {
            severity: Severity::Caution,
            code: "dicom.no-transfer-syntax",
            text: "The file does not name its transfer syntax; it was told from the first element."
                .to_owned(),
        });
    }
    let mut image = Image {
        source,
        transfer_syntax: anatomy.transfer_syntax.clone(),
        series_uid: text(&root, tags::SERIES_INSTANCE_UID).unwrap_or_default(),
        instance_uid: text(&root, tags::SOP_INSTANCE_UID).unwrap_or_default(),
        series_number: int(&root, tags::SERIES_NUMBER),
        description: text(&root, tags::SERIES_DESCRIPTION).unwrap_or_default(),
        modality: text(&root, tags::MODALITY),
        columns,
        rows,
        grey: samples_per_pixel == 1 && photometric != "PALETTE COLOR",
        monochrome1: photometric == "MONOCHROME1",
        format,
        padding,
        thickness_mm: at_root.float(none, tags::SLICE_THICKNESS).filter(|t| *t > 0.0),
        between_mm: at_root.float(none, tags::SPACING_BETWEEN_SLICES).filter(|t| *t > 0.0),
        repetition_secs: at_root.float(none, tags::REPETITION_TIME).map(|ms| ms / 1000.0),
        lossy: text(&root, tags::LOSSY_IMAGE_COMPRESSION).is_some_and(|l| l == "01"),
        frames,
        notes,
    };
    place_frames(&root, &mut image);
    Ok(image)
}

/// A value's low bits read the way the pixels are.
fn as_stored(value: i64, format: PixelFormat) -> i64 {
    let bits = format.stored.clamp(1, 32);
    let low = value & (1_i64 << bits).wrapping_sub(1);
    let negative = format.signed && low >> (bits - 1) & 1 == 1;
    if negative { low - (1_i64 << bits) } else { low }
}

fn pixel_format(root: &Object, kind: PixelKind) -> Result<PixelFormat, Fault> {
    match kind {
        PixelKind::Float | PixelKind::Double => {
            let bits = if kind == PixelKind::Float { 32 } else { 64 };
            return Ok(PixelFormat { allocated: bits, stored: bits, high_bit: bits - 1, signed: true, kind });
        }
        PixelKind::Integer => {}
    }
    let bits = |tag: Tag| int(root, tag).and_then(|n| u32::try_from(n).ok());
    let allocated = bits(tags::BITS_ALLOCATED).unwrap_or(16);
    if ![8, 16, 32].contains(&allocated) {
        return Err(format!("its samples take {allocated} bits, and only 8, 16 and 32 are read"));
    }
    let stored = bits(tags::BITS_STORED).filter(|b| *b >= 1 && *b <= allocated).unwrap_or(allocated);
    let high_bit = bits(tags::HIGH_BIT).filter(|h| *h < allocated && *h + 1 >= stored).unwrap_or(stored - 1);
    let signed = int(root, tags::PIXEL_REPRESENTATION) == Some(1);
    Ok(PixelFormat { allocated, stored, high_bit, signed, kind })
}

/// How many frames there are: never more than the pixel data can hold, since each costs memory.
fn frame_count(
    root: &Object,
    anatomy: &Anatomy,
    frame_bytes: usize,
    notes: &mut Vec<Note>,
) -> Result<usize, Fault> {
    let held = match &anatomy.pixels {
        Some(Pixels::Native(_, range)) => range.len().checked_div(frame_bytes).unwrap_or(1),
        Some(Pixels::Encapsulated { fragments, .. }) => fragments.len(),
        None => 0,
    };
    if root.get(tags::NUMBER_OF_FRAMES).is_none() {
        return Ok(1);
    }
    let said = int(root, tags::NUMBER_OF_FRAMES).and_then(|n| usize::try_from(n).ok()).filter(|n| *n > 0);
    match said {
        Some(said) if said > held.max(1) => {
            Err(format!("it claims {said} frames, but its pixel data hold {held}"))
        }
        Some(said) => Ok(said),
        None => {
            notes.push(Note {
                severity: Severity::Caution,
                code: "dicom.frame-count",
                text: format!("The number of frames cannot be read; the pixel data hold {held}."),
            });
            Ok(held.max(1))
        }
    }
}

fn frames(root: &Object, count: usize, notes: &mut Vec<Note>) -> Vec<Frame> {
    let shared = first_item(root, tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE);
    let own =
        root.get(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).and_then(|e| e.items()).unwrap_or_default();
    let mut ignored_rescale = false;
    let frames = (0..count)
        .map(|index| {
            let lookup = Lookup { root, groups: [own.get(index), shared] };
            frame(&lookup, index, &mut ignored_rescale)
        })
        .collect();
    if ignored_rescale {
        notes.push(Note {
            severity: Severity::Caution,
            code: "dicom.rescale-ignored",
            text: "A rescale slope that is zero or no number was ignored; values are as stored.".to_owned(),
        });
    }
    frames
}

fn frame(of: &Lookup<'_>, index: usize, ignored_rescale: &mut bool) -> Frame {
    let none = Tag(0, 0);
    let directions = of
        .floats::<6>(tags::PLANE_ORIENTATION_SEQUENCE, tags::IMAGE_ORIENTATION_PATIENT)
        .and_then(|[a, b, c, d, e, f]| unit_directions(Vector::new(a, b, c), Vector::new(d, e, f)));
    let measures = tags::PIXEL_MEASURES_SEQUENCE;
    let spacing = of
        .floats::<2>(measures, tags::PIXEL_SPACING)
        .or_else(|| of.floats::<2>(none, tags::IMAGER_PIXEL_SPACING))
        .filter(|s| s.iter().all(|v| *v > 0.0));
    let values = tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE;
    let slope = of.float(values, tags::RESCALE_SLOPE);
    let dose = of.float(none, tags::DOSE_GRID_SCALING);
    let rescale = Rescale {
        slope: slope.or(dose).unwrap_or(1.0),
        intercept: of.float(values, tags::RESCALE_INTERCEPT).unwrap_or(0.0),
    };
    let unusable =
        rescale.slope == 0.0 || (slope.is_none() && of.element(values, tags::RESCALE_SLOPE).is_some());
    *ignored_rescale |= unusable;
    let content = tags::FRAME_CONTENT_SEQUENCE;
    let mut variant = of.text(tags::MR_IMAGE_FRAME_TYPE_SEQUENCE, tags::FRAME_TYPE).unwrap_or_default();
    if variant.is_empty() {
        variant = of.text(none, tags::IMAGE_TYPE).unwrap_or_default();
    }
    let echo = of.float(tags::MR_ECHO_SEQUENCE, tags::EFFECTIVE_ECHO_TIME);
    let echo = echo.or_else(|| of.float(none, tags::ECHO_TIME)).unwrap_or(0.0);
    let weight = of.float(tags::MR_DIFFUSION_SEQUENCE, tags::DIFFUSION_B_VALUE).unwrap_or(0.0);
    let clock = of
        .text(content, tags::FRAME_ACQUISITION_DATE_TIME)
        .or_else(|| of.text(none, tags::ACQUISITION_DATE_TIME))
        .or_else(|| Some(of.text(none, tags::ACQUISITION_DATE)? + &of.text(none, tags::ACQUISITION_TIME)?));
    Frame {
        position: of
            .floats::<3>(tags::PLANE_POSITION_SEQUENCE, tags::IMAGE_POSITION_PATIENT)
            .map(|p| Point::from(Vector::from(p))),
        directions,
        // PixelSpacing names the distance between rows first (PS3.3 10.7.1.3).
        spacing_mm: spacing.map(|[between_rows, between_columns]| [between_columns, between_rows]),
        rescale: if unusable { Rescale::default() } else { rescale },
        instance: of
            .int(none, tags::INSTANCE_NUMBER)
            .unwrap_or(0)
            .saturating_add(i64::try_from(index).unwrap_or(0)),
        temporal_index: of
            .int(content, tags::TEMPORAL_POSITION_INDEX)
            .or_else(|| of.int(none, tags::TEMPORAL_POSITION_IDENTIFIER)),
        acquisition: of.int(none, tags::ACQUISITION_NUMBER),
        clock_secs: clock.as_deref().and_then(clock_secs),
        trigger_secs: of
            .float(tags::CARDIAC_SYNCHRONIZATION_SEQUENCE, tags::NOMINAL_CARDIAC_TRIGGER_DELAY_TIME)
            .or_else(|| of.float(none, tags::TRIGGER_TIME))
            .map(|ms| ms / 1000.0),
        variant: format!("{variant} {echo} {weight}"),
    }
}

/// Two directions made exactly square and of unit length; `None` where they are no plane.
fn unit_directions(row: Vector, column: Vector) -> Option<[Vector; 2]> {
    let row = row.try_normalize(1e-6)?;
    let column = (column - row * row.dot(&column)).try_normalize(1e-3)?;
    Some([row, column])
}

/// Frames of plain multi-frame files, which share one position: along the normal by the dose grid's
/// offsets (C.8.8.3.2) or by the distance between slices; or over time by the frame time.
fn place_frames(root: &Object, image: &mut Image) {
    let has_own = root.get(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE).is_some();
    let [first, _, ..] = image.frames.as_slice() else { return };
    if has_own {
        return;
    }
    let (position, directions) = (first.position, first.directions);
    let offsets =
        root.get(tags::GRID_FRAME_OFFSET_VECTOR).and_then(|e| e.to_multi_float64().ok()).unwrap_or_default();
    let frame_secs = root.get(tags::FRAME_TIME).and_then(|e| e.to_float64().ok()).map(|ms| ms / 1000.0);
    if let Some(period) = frame_secs.filter(|t| *t > 0.0 && offsets.is_empty() && image.between_mm.is_none())
    {
        for (index, frame) in image.frames.iter_mut().enumerate() {
            frame.temporal_index = i64::try_from(index).ok();
            frame.clock_secs = Some(index as f64 * period);
        }
        return;
    }
    let (Some(position), Some([row, column])) = (position, directions) else { return };
    let normal = row.cross(&column);
    if offsets.len() >= image.frames.len() {
        // Offsets that do not begin with 0 are coordinates along the patient's axis (C.8.8.3.2 b).
        let start = offsets.first().copied().unwrap_or(0.0);
        for (frame, offset) in image.frames.iter_mut().zip(offsets) {
            frame.position = Some(position + normal * if start == 0.0 { offset } else { offset - start });
        }
        return;
    }
    let step_mm = image.between_mm.unwrap_or(1.0);
    for (index, frame) in image.frames.iter_mut().enumerate() {
        frame.position = Some(position + normal * (index as f64 * step_mm));
    }
    image.notes.push(Note {
        severity: Severity::Caution,
        code: "dicom.no-positions",
        text: format!(
            "Only the first of {} frames has a position; the others follow at {step_mm} mm along the normal{}.",
            image.frames.len(),
            if image.between_mm.is_some() { ", as the file says" } else { ", which is a guess" }
        ),
    });
}

/// Seconds of `YYYYMMDDHHMMSS.FFFFFF` since a day long ago.
fn clock_secs(text: &str) -> Option<f64> {
    let digits = |range: std::ops::Range<usize>| text.get(range)?.parse::<i64>().ok();
    let (year, month, day) = (digits(0..4)?, digits(4..6)?, digits(6..8)?);
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    // Days of the proleptic Gregorian calendar, the year beginning in March (Hinnant,
    // "chrono-Compatible Low-Level Date Algorithms").
    let y = if month <= 2 { year - 1 } else { year };
    let days = 365 * y + y / 4 - y / 100 + y / 400 + (153 * ((month + 9) % 12) + 2) / 5 + day;
    let (hour, minute) = (digits(8..10)?, digits(10..12).unwrap_or(0));
    let zone = text.get(14..).and_then(|t| t.find(['+', '-'])).map_or(text.len(), |at| at + 14);
    let second = text.get(12..zone).and_then(|s| s.parse::<f64>().ok()).unwrap_or(0.0);
    Some((days * 86400 + hour * 3600 + minute * 60) as f64 + second)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_run_over_midnight_and_month_ends() {
        let at = |t: &str| clock_secs(t).expect("a time");
        assert_eq!(at("20240301000001.5") - at("20240229235959.25"), 2.25, "a leap day");
        assert_eq!(at("20231001120000") - at("202309301200"), 86400.0, "without seconds");
        assert_eq!(at("20231001120000.5+0200") - at("20231001120000"), 0.5, "zone left out");
        assert_eq!(clock_secs("garbage"), None, "no time");
    }

    #[test]
    fn padding_is_read_as_the_pixels_are() {
        let format =
            PixelFormat { allocated: 16, stored: 16, high_bit: 15, signed: true, kind: PixelKind::Integer };
        assert_eq!(as_stored(63536, format), -2000, "unsigned spelling of -2000");
        assert_eq!(as_stored(-2000, format), -2000, "itself");
    }
}
