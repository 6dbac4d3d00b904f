//! DICOM against files that the tests write themselves ([`made`], [`hostile`]) and against the sample data
//! ([`facts`]).
#![expect(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "a test may fail loudly")]

mod codes;
mod facts;
mod hostile;
mod made;

use std::path::{Path, PathBuf};

use render::volume::{Grid, Point};

use super::super::tests::{codes, only, series, volume};
use super::super::{Silent, open};
use super::walk::Encoding;
use super::*;

/// Explicit little endian, uncompressed.
const EXPLICIT: &str = "1.2.840.10008.1.2.1";

const PLAIN: Encoding = Encoding { explicit: true, big_endian: false };
const IMPLICIT: Encoding = Encoding { explicit: false, big_endian: false };
const BIG: Encoding = Encoding { explicit: true, big_endian: true };

/// One element of a data set under construction.
enum Value {
    Text(String),
    Short(Vec<u16>),
    Bytes(Vec<u8>),
    Items(Vec<Vec<(u32, &'static str, Self)>>),
}

type Element = (u32, &'static str, Value);

fn text(tag: u32, vr: &'static str, value: impl Into<String>) -> Element {
    (tag, vr, Value::Text(value.into()))
}

fn short(tag: u32, value: u16) -> Element {
    (tag, "US", Value::Short(vec![value]))
}

fn joined(values: &[f64]) -> String {
    values.iter().map(ToString::to_string).collect::<Vec<_>>().join("\\")
}

fn encode(elements: &[Element], encoding: Encoding) -> Vec<u8> {
    let Encoding { explicit, big_endian: big } = encoding;
    let u16_bytes = |v: u16| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let u32_bytes = |v: u32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let mut out = Vec::new();
    for (tag, vr, value) in elements {
        out.extend(u16_bytes(u16::try_from(tag >> 16).expect("a group")));
        out.extend(u16_bytes(u16::try_from(tag & 0xFFFF).expect("an element")));
        let mut body = match value {
            Value::Text(text) => text.clone().into_bytes(),
            Value::Short(values) => values.iter().flat_map(|v| u16_bytes(*v)).collect(),
            Value::Bytes(bytes) => bytes.clone(),
            Value::Items(items) => items
                .iter()
                .flat_map(|item| {
                    let inner = encode(item, encoding);
                    let length = u32::try_from(inner.len()).expect("short");
                    let head = [u16_bytes(0xFFFE), u16_bytes(0xE000)].concat();
                    [head, u32_bytes(length).to_vec(), inner].concat()
                })
                .collect(),
        };
        if body.len() % 2 == 1 {
            body.push(if *vr == "UI" { 0 } else { b' ' });
        }
        let length = u32::try_from(body.len()).expect("short");
        if explicit {
            out.extend(vr.as_bytes());
            if ["OB", "OW", "OF", "OD", "SQ", "UN", "UT"].contains(vr) {
                out.extend([0, 0]);
                out.extend(u32_bytes(length));
            } else {
                out.extend(u16_bytes(u16::try_from(length).expect("short")));
            }
        } else {
            out.extend(u32_bytes(length));
        }
        out.extend(body);
    }
    out
}

/// A file with preamble and meta group around a data set.
fn wrapped(transfer_syntax: &str, data_set: &[u8]) -> Vec<u8> {
    let mut file = vec![0; 128];
    file.extend(b"DICM");
    file.extend(encode(&[text(0x0002_0010, "UI", transfer_syntax)], PLAIN));
    file.extend(data_set);
    file
}

/// One slice of a small CT, to be changed by the test before it is written.
struct Slice {
    elements: Vec<Element>,
    transfer_syntax: &'static str,
}

impl Slice {
    /// 4 columns by 3 rows of signed 16-bit samples, 0.5 mm between columns, 0.75 mm between rows, lying
    /// flat with its first pixel at `position`.
    fn new(position: [f64; 3], samples: &[i16; 12]) -> Self {
        let uid = format!("1.2.3.{}", joined(&position).replace(['\\', '-'], "9").replace('.', "8"));
        let pixels = samples.iter().flat_map(|s| s.to_le_bytes()).collect();
        Self {
            elements: vec![
                text(0x0008_0018, "UI", uid),
                text(0x0008_0060, "CS", "CT"),
                text(0x0018_0050, "DS", "9.5"),
                text(0x0020_000E, "UI", "1.2.3"),
                text(0x0020_0032, "DS", joined(&position)),
                text(0x0020_0037, "DS", "1\\0\\0\\0\\1\\0"),
                short(0x0028_0002, 1),
                text(0x0028_0004, "CS", "MONOCHROME2"),
                short(0x0028_0010, 3),
                short(0x0028_0011, 4),
                text(0x0028_0030, "DS", "0.75\\0.5"),
                short(0x0028_0100, 16),
                short(0x0028_0101, 16),
                short(0x0028_0102, 15),
                short(0x0028_0103, 1),
                (0x7FE0_0010, "OW", Value::Bytes(pixels)),
            ],
            transfer_syntax: EXPLICIT,
        }
    }

    /// The same slice with an element set, added or replaced.
    fn with(mut self, element: Element) -> Self {
        self.elements.retain(|e| e.0 != element.0);
        self.elements.push(element);
        self.elements.sort_by_key(|e| e.0);
        self
    }

    /// The same slice without an element.
    fn without(mut self, tag: u32) -> Self {
        self.elements.retain(|e| e.0 != tag);
        self
    }

    /// Its pixels as one encoded fragment.
    fn coded(mut self, transfer_syntax: &'static str, fragment: &[u8]) -> Self {
        let mut body = vec![0xFE, 0xFF, 0x00, 0xE0, 0, 0, 0, 0, 0xFE, 0xFF, 0x00, 0xE0];
        let mut fragment = fragment.to_vec();
        if fragment.len() % 2 == 1 {
            fragment.push(0);
        }
        body.extend(u32::try_from(fragment.len()).expect("short").to_le_bytes());
        body.extend(fragment);
        body.extend([0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0]);
        self.transfer_syntax = transfer_syntax;
        self.with((0x7FE0_0010, "OB", Value::Bytes(body)))
    }

    fn file(&self) -> Vec<u8> {
        let mut data_set = encode(&self.elements, PLAIN);
        if self.transfer_syntax != EXPLICIT {
            // Encapsulated pixels have no length.
            let at = data_set.windows(6).rposition(|w| w == b"\xE0\x7F\x10\x00OB").expect("pixels");
            data_set[at + 8..at + 12].fill(0xFF);
        }
        wrapped(self.transfer_syntax, &data_set)
    }
}

/// Samples that name their slice and pixel: `1000 · slice + 10 · row + column`.
fn numbered(slice: i16) -> [i16; 12] {
    std::array::from_fn(|i| {
        let i = i16::try_from(i).expect("small");
        1000 * slice + 10 * (i / 4) + i % 4
    })
}

/// Writes files into a folder, named in the order given.
fn folder(files: &[Vec<u8>]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (i, bytes) in files.iter().enumerate() {
        std::fs::write(folder.path().join(format!("{i:03}.dcm")), bytes).expect("written");
    }
    folder
}

fn load(path: &Path) -> Result<Vec<Item>, LoadError> {
    open(path, &Limits::default(), &Silent)
}

fn load_slices(slices: &[Slice]) -> Result<Vec<Item>, LoadError> {
    let files: Vec<_> = slices.iter().map(Slice::file).collect();
    load(folder(&files).path())
}

/// Where a voxel lies; mm.
fn world(grid: &Grid, x: f64, y: f64, z: f64) -> [f64; 3] {
    grid.world_from_voxel().point(&Point::new(x, y, z)).coords.into()
}

fn assert_near(found: [f64; 3], expected: [f64; 3], what: &str) {
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-9, "{what}: {found:?} instead of {expected:?}");
    }
}

fn sample(name: &str) -> Option<PathBuf> {
    super::super::bytes::trial::sample(name)
}
