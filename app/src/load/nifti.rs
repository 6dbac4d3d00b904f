//! NIfTI-1 and NIfTI-2: `.nii`, `.nii.gz`, and pairs of `.hdr` and `.img`.
//!
//! The header is parsed here and not by the `nifti` crate, which takes the memory that a header claims
//! before it has seen the data. NIfTI's frame is RAS; it is turned to LPS at once. The fourth dimension
//! is time.
//!
//! Source: Cox et al., *A (sort of) new image data format standard: NIfTI-1*, and `nifti1.h`, `nifti2.h`
//! of the NIfTI DFWG.
#![expect(clippy::arithmetic_side_effects, reason = "f64 vectors of nalgebra")]

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::read::MultiGzDecoder;
use render::volume::{Affine, Rescale, Vector};

use super::bytes::{self, Endian, Fault, Scalar};
use super::voxels::{self, Plan};
use super::{Item, Limits, LoadError, Note, Progress, Severity};

const FORMAT: &str = "NIfTI";
/// RAS to LPS.
const RAS: [f64; 3] = [-1.0, -1.0, 1.0];

/// Whether unpacked bytes begin with a NIfTI header.
pub(super) fn begins_as_nifti(head: &[u8]) -> bool {
    matches!(head.get(344..348), Some(b"n+1\0" | b"ni1\0"))
        || matches!(head.get(4..8), Some(b"n+2\0" | b"ni2\0"))
}

/// The volume or series in the file at `path`.
///
/// # Errors
/// [`LoadError`] for a file that cannot be read, contradicts itself or holds less than it says.
pub(super) fn read(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    load(path, limits, progress).map_err(|fault| fault.at(FORMAT, path, limits))
}

fn load(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, Fault> {
    let mut stream = open(path)?;
    let mut raw = Vec::new();
    stream
        .by_ref()
        .take(540)
        .read_to_end(&mut raw)
        .map_err(|e| format!("its header cannot be read ({e})"))?;
    let mut notes = Vec::new();
    let header = Header::parse(&raw)?;
    let plan = header.plan(&mut notes)?;
    plan.count(limits)?;
    let data = if header.detached {
        let image = image_beside(path).ok_or("its image file (.img) is not beside it")?;
        let mut stream = open(&image)?;
        skip(&mut stream, header.offset)?;
        plan.read(stream, limits, progress)?
    } else {
        // What was read of the data with the header comes first.
        let offset = usize::try_from(header.offset).unwrap_or(usize::MAX);
        let start = raw.get(offset.min(raw.len())..).unwrap_or_default();
        skip(&mut stream, header.offset.saturating_sub(raw.len() as u64))?;
        plan.read(start.chain(stream), limits, progress)?
    };
    let content = plan.content(&data, &mut notes)?;
    Ok(vec![Item { name: bytes::file_name(path), format: FORMAT, modality: None, content, notes }])
}

fn open(path: &Path) -> Result<Box<dyn Read>, Fault> {
    let io = |source| Fault::Elsewhere(LoadError::Io { path: path.to_owned(), source });
    let mut head = Vec::new();
    let file = File::open(path).map_err(io)?;
    file.take(2).read_to_end(&mut head).map_err(io)?;
    let file = BufReader::with_capacity(1 << 20, File::open(path).map_err(io)?);
    Ok(if head == [0x1F, 0x8B] { Box::new(MultiGzDecoder::new(file)) } else { Box::new(file) })
}

fn skip(stream: &mut impl Read, count: u64) -> Result<(), Fault> {
    let skipped = std::io::copy(&mut stream.take(count), &mut std::io::sink());
    match skipped {
        Ok(n) if n == count => Ok(()),
        Ok(_) => Err("it ends before its data begin".into()),
        Err(e) => Err(Fault::Broken(format!("its data cannot be read ({e})"))),
    }
}

fn image_beside(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let stem = name.strip_suffix(".gz").unwrap_or(name);
    let stem = stem.strip_suffix(".hdr").unwrap_or(stem);
    ["img", "img.gz"].iter().map(|end| path.with_file_name(format!("{stem}.{end}"))).find(|p| p.is_file())
}

/// What is used of the 348 or 540 bytes.
#[derive(Debug, Clone)]
struct Header {
    endian: Endian,
    detached: bool,
    offset: u64,
    dim: [i64; 8],
    pixdim: [f64; 8],
    datatype: i64,
    slope: f64,
    intercept: f64,
    units: u32,
    start: f64,
    qform: i64,
    sform: i64,
    quatern: [f64; 3],
    qoffset: [f64; 3],
    srow: [[f64; 4]; 3],
}

/// Numbers at fixed places; reading beyond the end gives 0, which the checks refuse.
struct Fields<'a> {
    bytes: &'a [u8],
    endian: Endian,
}

impl Fields<'_> {
    fn one(&self, scalar: Scalar, at: usize) -> f64 {
        self.bytes.get(at..).and_then(|b| scalar.one(b, self.endian)).unwrap_or(0.0)
    }

    fn many<const N: usize>(&self, scalar: Scalar, at: usize) -> [f64; N] {
        std::array::from_fn(|i| self.one(scalar, at + i * scalar.size()))
    }

    fn int(&self, scalar: Scalar, at: usize) -> i64 {
        let bytes = self.bytes.get(at..at + scalar.size()).unwrap_or_default();
        scalar.positions(bytes, self.endian).first().copied().unwrap_or(0)
    }
}

impl Header {
    fn parse(raw: &[u8]) -> Result<Self, Fault> {
        let first = raw.first_chunk::<4>().ok_or("it is empty")?;
        let (endian, size) = match (u32::from_le_bytes(*first), u32::from_be_bytes(*first)) {
            (size @ (348 | 540), _) => (Endian::Little, size),
            (_, size @ (348 | 540)) => (Endian::Big, size),
            _ => return Err("it does not begin with the length of a NIfTI header".into()),
        };
        if raw.len() < usize::try_from(size).unwrap_or(usize::MAX) {
            return Err("it ends in the middle of its header".into());
        }
        let f = Fields { bytes: raw, endian };
        let (short, long, float, double, int) =
            (Scalar::I16, Scalar::I64, Scalar::F32, Scalar::F64, Scalar::I32);
        let one = size == 348;
        let (real, wide) = if one { (float, short) } else { (double, int) };
        let pick = |first: usize, second: usize| if one { first } else { second };
        let dims = if one { short } else { long };
        let magic = raw.get(pick(344, 4)..).and_then(|m| m.get(..3)).unwrap_or_default();
        if !matches!(magic, b"n+1" | b"ni1" | b"n+2" | b"ni2") {
            return Err(Fault::Unsupported("the Analyze header of old".to_owned(), "convert it to NIfTI"));
        }
        let offset = f.one(if one { float } else { long }, pick(108, 168));
        if !(0.0..9e15).contains(&offset) {
            return Err(Fault::Broken(format!("its data begin at {offset}")));
        }
        #[expect(clippy::cast_possible_truncation, reason = "checked to be in range")]
        let offset = offset as u64;
        let row = pick(16, 32);
        let srow = pick(280, 400);
        Ok(Self {
            endian,
            detached: magic.starts_with(b"ni"),
            offset: if magic.starts_with(b"ni") { offset } else { offset.max(u64::from(size)) },
            dim: std::array::from_fn(|i| f.int(dims, pick(40, 16) + i * dims.size())),
            pixdim: f.many(real, pick(76, 104)),
            datatype: f.int(short, pick(70, 12)),
            slope: f.one(real, pick(112, 176)),
            intercept: f.one(real, pick(116, 184)),
            units: u32::try_from(f.int(if one { Scalar::U8 } else { int }, pick(123, 500))).unwrap_or(0),
            start: f.one(real, pick(136, 216)),
            qform: f.int(wide, pick(252, 344)),
            sform: f.int(wide, pick(254, 348)),
            quatern: f.many(real, pick(256, 352)),
            qoffset: f.many(real, pick(268, 376)),
            srow: [0, 1, 2].map(|i| f.many(real, srow + i * row)),
        })
    }

    fn plan(&self, notes: &mut Vec<Note>) -> Result<Plan, Fault> {
        let scalar = match self.datatype {
            2 => Scalar::U8,
            4 => Scalar::I16,
            8 => Scalar::I32,
            16 => Scalar::F32,
            64 => Scalar::F64,
            256 => Scalar::I8,
            512 => Scalar::U16,
            768 => Scalar::U32,
            1024 => Scalar::I64,
            1280 => Scalar::U64,
            code @ (1 | 32 | 128 | 1536 | 1792 | 2048 | 2304) => {
                return Err(Fault::Unsupported(
                    format!("samples that are bits, complex, colours or 128-bit floats (datatype {code})"),
                    "convert it to one real number a voxel",
                ));
            }
            code => return Err(Fault::Broken(format!("it has the unknown datatype {code}"))),
        };
        let count = usize::try_from(self.dim[0]).ok().filter(|n| (1..=7).contains(n));
        let count = count.ok_or_else(|| format!("it has {} dimensions", self.dim[0]))?;
        let mut sizes = [1_usize; 7];
        for (axis, (size, dim)) in sizes.iter_mut().zip(&self.dim[1..]).take(count).enumerate() {
            let whole = usize::try_from(*dim).ok().filter(|n| *n > 0);
            *size = whole.ok_or_else(|| format!("its size along axis {} is {dim}", axis + 1))?;
        }
        let [x, y, z, steps, further @ ..] = sizes;
        if further.iter().any(|n| *n > 1) {
            return Err(Fault::Unsupported(
                "more than one value a voxel".to_owned(),
                "split it into one file a channel",
            ));
        }
        // One look at the claim before times are made for it; the exact check comes with the limit.
        if steps > 1 << 24 {
            return Err(Fault::Broken(format!("it claims {steps} steps in time")));
        }
        let rescale = if self.slope == 0.0 || !self.slope.is_finite() || !self.intercept.is_finite() {
            Rescale::default()
        } else {
            Rescale { slope: self.slope, intercept: self.intercept }
        };
        let world_from_voxel = self.place(notes)?;
        Ok(Plan {
            extent: [x, y, z],
            times_secs: self.times(steps, notes),
            scalar,
            endian: self.endian,
            rescale,
            world_from_voxel,
        })
    }

    fn times(&self, steps: usize, notes: &mut Vec<Note>) -> Vec<f64> {
        let unit_secs = match self.units & 0x38 {
            16 => 1e-3,
            24 => 1e-6,
            _ => 1.0,
        };
        // 0.2 stored as a 32-bit float is meant as 0.2, not as its nearest float.
        let written = self.pixdim.get(4).copied().unwrap_or(0.0);
        #[expect(clippy::cast_possible_truncation, reason = "asked whether it was a 32-bit float")]
        let short = written as f32;
        let meant =
            if f64::from(short) == written { short.to_string().parse().unwrap_or(written) } else { written };
        let period = meant * unit_secs;
        if steps > 1 && period >= 100.0 {
            notes.push(Note {
                severity: Severity::Caution,
                code: "nifti.time-unit",
                text: format!("The steps are {period} s apart as the file says; it may mean milliseconds."),
            });
        }
        voxels::times(steps, self.start * unit_secs, period, notes)
    }

    /// `sform` before `qform` before the spacing alone (`nifti1.h`, methods 3, 2, 1).
    fn place(&self, notes: &mut Vec<Note>) -> Result<Affine, Fault> {
        let mut note = |severity, code, text: String| notes.push(Note { severity, code, text });
        let unit_mm = match self.units & 7 {
            1 => 1000.0,
            3 => 0.001,
            _ => 1.0,
        };
        if unit_mm != 1.0 {
            note(
                Severity::Fact,
                "nifti.unit",
                format!("The file counts in units of {unit_mm} mm; they were converted."),
            );
        }
        let made = |(columns, origin)| voxels::placed(columns, origin, RAS, unit_mm);
        let sform = (self.sform > 0).then(|| made(self.by_rows()));
        let qform = (self.qform > 0).then(|| made(self.by_quaternion()));
        match (sform, qform) {
            (Some(Ok(s)), Some(Ok(q))) => {
                let far = self.farthest(&s, &q);
                if far > 0.5 * s.column_lengths().into_iter().fold(f64::INFINITY, f64::min) {
                    note(
                        Severity::Caution,
                        "nifti.forms-differ",
                        format!(
                            "The two placements in the file (sform, qform) differ by up to {far:.2} mm; sform was taken."
                        ),
                    );
                }
                Ok(s)
            }
            (Some(Ok(s)), _) => Ok(s),
            (Some(Err(_)), Some(Ok(q))) => {
                let text = "The file's sform spans no space; qform was taken.".to_owned();
                note(Severity::Caution, "nifti.sform-singular", text);
                Ok(q)
            }
            (None, Some(Ok(q))) => Ok(q),
            (Some(Err(error)), _) | (None, Some(Err(error))) => Err(error),
            (None, None) => {
                let text =
                    "The file does not say how it lies; its axes were taken as right, anterior, superior."
                        .to_owned();
                note(Severity::Caution, "nifti.no-orientation", text);
                let [x, y, z] = self.spacing();
                made(([Vector::x() * x, Vector::y() * y, Vector::z() * z], Vector::zeros()))
            }
        }
    }

    /// The largest distance between the same corner of the volume in two placements; mm.
    fn farthest(&self, a: &Affine, b: &Affine) -> f64 {
        (0..8_u32).fold(0.0, |far, corner| {
            let at = |axis: usize| {
                let size = self.dim.get(axis + 1).map_or(0.0, |n| *n as f64 - 1.0);
                if corner >> axis & 1 == 1 { size } else { 0.0 }
            };
            let p = render::volume::Point::new(at(0), at(1), at(2));
            far.max((a.point(&p) - b.point(&p)).norm())
        })
    }

    /// Zero and what is no number count as 1, as nibabel has it.
    fn spacing(&self) -> [f64; 3] {
        [1, 2, 3].map(|i| {
            let s = self.pixdim.get(i).map_or(0.0, |s| s.abs());
            if s > 0.0 && s.is_finite() { s } else { 1.0 }
        })
    }

    fn by_rows(&self) -> ([Vector; 3], Vector) {
        let column = |c: usize| Vector::from(self.srow.map(|row| row.get(c).copied().unwrap_or(0.0)));
        ([column(0), column(1), column(2)], column(3))
    }

    fn by_quaternion(&self) -> ([Vector; 3], Vector) {
        let [b, c, d] = self.quatern;
        let rest = 1.0 - (b * b + c * c + d * d);
        // Below zero by rounding: a turn by half a circle.
        let a = rest.max(0.0).sqrt();
        let turn = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(a, b, c, d));
        let [x, y, z] = self.spacing();
        let flip = if self.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
        let columns = [turn * Vector::x() * x, turn * Vector::y() * y, turn * Vector::z() * (z * flip)];
        (columns, Vector::from(self.qoffset))
    }
}
