//! MetaImage: `.mha` with its samples behind the header, `.mhd` with them in another file; raw, zlib, text.
//!
//! The frame is ITK's, which is LPS in mm. Source: the documentation of `MetaIO` (itk.org/Wiki/ITK/MetaIO) and
//! ITK's `itkMetaImageIO.cxx`: nine numbers of `TransformMatrix` are three directions, one an axis.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek as _, SeekFrom};
use std::path::Path;

use flate2::read::ZlibDecoder;
use render::volume::{Rescale, Vector};

use super::bytes::{self, Endian, Fault, Scalar};
use super::voxels::{self, Plan};
use super::{Item, Limits, LoadError, Note, Progress, Severity};

const FORMAT: &str = "MetaImage";
/// A header with more lines, or a longer line, is none.
const MOST_LINES: usize = 10_000;
const LONGEST_LINE: u64 = 1 << 20;

/// The volume or series in the file at `path`.
///
/// # Errors
/// [`LoadError`] for a file that cannot be read, contradicts itself or holds less than it says.
pub(super) fn read(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    load(path, limits, progress).map_err(|fault| fault.at(FORMAT, path, limits))
}

fn load(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, Fault> {
    let mut file = BufReader::with_capacity(1 << 20, open(path)?);
    let header = Header::read(&mut file)?;
    let mut notes = Vec::new();
    let plan = header.plan(&mut notes)?;
    plan.count(limits)?;
    let name = header.required("elementdatafile")?;
    let data = match name {
        "LOCAL" | "Local" | "local" => header.decoded(file, &plan, limits, progress)?,
        _ if name.starts_with("LIST") || name.contains('%') => {
            return Err(Fault::Unsupported("samples in many files".to_owned(), "save it as a single .mha"));
        }
        _ => {
            let mut file = open(&path.with_file_name(name))?;
            header.skip(&mut file, &plan, limits)?;
            header.decoded(BufReader::with_capacity(1 << 20, file), &plan, limits, progress)?
        }
    };
    let content = plan.content(&data, &mut notes)?;
    let modality =
        header.get("modality").and_then(|m| m.strip_prefix("MET_MOD_")).filter(|m| *m != "UNKNOWN");
    Ok(vec![Item {
        name: bytes::file_name(path),
        format: FORMAT,
        modality: modality.map(str::to_owned),
        content,
        notes,
    }])
}

fn open(path: &Path) -> Result<File, Fault> {
    File::open(path).map_err(|source| Fault::Elsewhere(LoadError::Io { path: path.to_owned(), source }))
}

struct Header {
    fields: BTreeMap<String, String>,
}

impl Header {
    /// Lines `Key = Value`; the last one is `ElementDataFile`.
    fn read(file: &mut impl BufRead) -> Result<Self, Fault> {
        let mut fields = BTreeMap::new();
        for _ in 0..MOST_LINES {
            let mut line = Vec::new();
            let got = file.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line);
            if got.map_err(|e| format!("its header cannot be read ({e})"))? == 0 {
                break;
            }
            let line = String::from_utf8_lossy(&line);
            let Some((key, value)) = line.split_once('=') else { continue };
            let key = key.trim().to_ascii_lowercase();
            let last = key == "elementdatafile";
            fields.insert(key, value.trim().to_owned());
            if last {
                return Ok(Self { fields });
            }
        }
        Err("its header names no data (ElementDataFile)".into())
    }

    fn get(&self, key: &str) -> Option<&str> {
        self.fields.get(key).map(String::as_str)
    }

    fn required(&self, key: &str) -> Result<&str, Fault> {
        self.get(key).ok_or_else(|| Fault::Broken(format!("its header has no \"{key}\"")))
    }

    /// The numbers of the first of `keys` that is there.
    fn numbers(&self, keys: &[&str]) -> Result<Option<Vec<f64>>, Fault> {
        let Some((key, text)) = keys.iter().find_map(|k| Some((k, self.get(k)?))) else { return Ok(None) };
        let numbers: Option<Vec<f64>> =
            text.split_whitespace().map(|w| w.parse().ok().filter(|n: &f64| n.is_finite())).collect();
        numbers.map(Some).ok_or_else(|| Fault::Broken(format!("its \"{key}\" is not all numbers")))
    }

    fn is_true(&self, keys: &[&str]) -> bool {
        keys.iter().find_map(|k| self.get(k)).is_some_and(|v| matches!(v, "True" | "true" | "TRUE" | "1"))
    }

    fn plan(&self, notes: &mut Vec<Note>) -> Result<Plan, Fault> {
        if self.get("elementnumberofchannels").is_some_and(|n| n != "1") {
            return Err(Fault::Unsupported(
                "more than one value a voxel".to_owned(),
                "split it into one file a channel",
            ));
        }
        let sizes: Option<Vec<usize>> =
            self.required("dimsize")?.split_whitespace().map(|w| w.parse().ok().filter(|n| *n > 0)).collect();
        let sizes = sizes.ok_or("its DimSize is not all positive numbers")?;
        let axes = sizes.len();
        let (extent, steps) = match sizes.as_slice() {
            [x, y] => ([*x, *y, 1], 1),
            [x, y, z] => ([*x, *y, *z], 1),
            [x, y, z, t] => ([*x, *y, *z], *t),
            _ => {
                return Err(Fault::Unsupported(
                    format!("{axes} axes"),
                    "save a volume or a series of volumes",
                ));
            }
        };
        if steps > 1 << 24 {
            return Err(Fault::Broken(format!("it claims {steps} steps in time")));
        }
        let spacing = self.numbers(&["elementspacing", "elementsize"])?;
        if spacing.is_none() {
            let text = "The file gives no spacing; 1 mm was taken, so nothing can be measured.".to_owned();
            notes.push(Note { severity: Severity::Caution, code: "metaimage.no-spacing", text });
        }
        let spacing = spacing.unwrap_or_default();
        let origin = self.numbers(&["offset", "position", "origin"])?.unwrap_or_default();
        let matrix = self.numbers(&["transformmatrix", "rotation", "orientation"])?.unwrap_or_default();
        let at = |numbers: &[f64], i: usize, other: f64| numbers.get(i).copied().unwrap_or(other);
        let column = |axis: usize| {
            let entry = |way: usize| {
                let same = if axis == way { 1.0 } else { 0.0 };
                if axis.max(way) >= axes {
                    return same;
                }
                at(&matrix, axis.saturating_mul(axes).saturating_add(way), same)
            };
            Vector::new(entry(0), entry(1), entry(2)).scale(at(&spacing, axis, 1.0))
        };
        let columns = [column(0), column(1), column(2)];
        let origin = Vector::new(at(&origin, 0, 0.0), at(&origin, 1, 0.0), at(&origin, 2, 0.0));
        let big = self.is_true(&["binarydatabyteordermsb", "elementbyteordermsb"]);
        Ok(Plan {
            extent,
            times_secs: voxels::times(steps, 0.0, at(&spacing, 3, 0.0), notes),
            scalar: self.scalar()?,
            endian: if big { Endian::Big } else { Endian::Little },
            rescale: Rescale::default(),
            world_from_voxel: voxels::placed(columns, origin, [1.0; 3], 1.0)?,
        })
    }

    fn scalar(&self) -> Result<Scalar, Fault> {
        Ok(match self.required("elementtype")? {
            "MET_CHAR" => Scalar::I8,
            "MET_UCHAR" => Scalar::U8,
            "MET_SHORT" => Scalar::I16,
            "MET_USHORT" => Scalar::U16,
            "MET_INT" | "MET_LONG" => Scalar::I32,
            "MET_UINT" | "MET_ULONG" => Scalar::U32,
            "MET_LONG_LONG" => Scalar::I64,
            "MET_ULONG_LONG" => Scalar::U64,
            "MET_FLOAT" => Scalar::F32,
            "MET_DOUBLE" => Scalar::F64,
            other => {
                return Err(Fault::Unsupported(format!("samples of type {other}"), "convert it to numbers"));
            }
        })
    }

    /// `HeaderSize` bytes of a foreign header; −1: the samples are the last bytes of the file.
    fn skip(&self, file: &mut File, plan: &Plan, limits: &Limits) -> Result<(), Fault> {
        let Some(size) = self.get("headersize") else { return Ok(()) };
        let size: i64 = size.parse().ok().ok_or("its HeaderSize is no number")?;
        let moved = if size < 0 {
            let needed = plan.count(limits)?.saturating_mul(plan.scalar.size());
            let back = i64::try_from(needed).unwrap_or(i64::MAX);
            file.seek(SeekFrom::End(back.saturating_neg()))
        } else {
            file.seek(SeekFrom::Start(size.unsigned_abs()))
        };
        moved.map(|_| ()).map_err(|e| Fault::Broken(format!("it holds fewer samples than it says ({e})")))
    }

    fn decoded(
        &self,
        data: impl Read,
        plan: &Plan,
        limits: &Limits,
        progress: &dyn Progress,
    ) -> Result<Vec<u8>, Fault> {
        if self.get("binarydata").is_some_and(|b| matches!(b, "False" | "false" | "FALSE" | "0")) {
            let mut text = Vec::new();
            let got = data.take(limits.decoded_bytes).read_to_end(&mut text);
            got.map_err(|e| format!("its samples cannot be read ({e})"))?;
            return voxels::numbers(&text, plan, limits);
        }
        if self.is_true(&["compresseddata"]) {
            return plan.read(ZlibDecoder::new(data), limits, progress);
        }
        plan.read(data, limits, progress)
    }
}
