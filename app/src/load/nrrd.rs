//! NRRD: `.nrrd` with its data behind the header, `.nhdr` with its data in another file; raw, gzip, text.
//!
//! Up to three axes in space and one of time or a list, in any place. Source: *Definition of NRRD File
//! Format* (teem.sourceforge.net/nrrd/format.html), sections 3 to 7; the spaces are those of section 4.7.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read as _};
use std::path::Path;

use flate2::read::MultiGzDecoder;
use render::volume::{Affine, Rescale, Vector};

use super::bytes::{self, Endian, Fault, Scalar};
use super::voxels::{self, Plan};
use super::{Item, Limits, LoadError, Note, Progress, Severity};

const FORMAT: &str = "NRRD";
/// A header longer than this is none.
const LONGEST_HEADER: u64 = 1 << 20;

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
    let axes = header.axes()?;
    let (plan, time_axis) = header.plan(&axes, &mut notes)?;
    plan.count(limits)?;
    let data: Box<dyn BufRead> = match header.get("data file").or_else(|| header.get("datafile")) {
        None => Box::new(file),
        Some(name) if name.starts_with("LIST") || name.contains('%') => {
            return Err(Fault::Unsupported("data in many files".to_owned(), "save it as a single .nrrd"));
        }
        Some(name) => Box::new(BufReader::with_capacity(1 << 20, open(&path.with_file_name(name))?)),
    };
    let data = header.decoded(data, &plan, limits, progress)?;
    let data = if time_axis { steps_last(&data, &plan) } else { data };
    let content = plan.content(&data, &mut notes)?;
    let name =
        header.get("content").filter(|c| !c.is_empty()).map_or_else(|| bytes::file_name(path), str::to_owned);
    Ok(vec![Item { name, format: FORMAT, modality: None, content, notes }])
}

fn open(path: &Path) -> Result<File, Fault> {
    File::open(path).map_err(|source| Fault::Elsewhere(LoadError::Io { path: path.to_owned(), source }))
}

/// Samples whose fastest axis is the step, with the step made the slowest.
fn steps_last(data: &[u8], plan: &Plan) -> Vec<u8> {
    let (size, steps) = (plan.scalar.size(), plan.times_secs.len());
    let mut out = Vec::with_capacity(data.len());
    for step in 0..steps {
        for voxel in data.chunks_exact(size.saturating_mul(steps).max(1)) {
            let start = step.saturating_mul(size);
            out.extend_from_slice(voxel.get(start..start.saturating_add(size)).unwrap_or_default());
        }
    }
    out
}

/// One axis of the array.
#[derive(Debug, Clone, Default)]
struct Axis {
    size: usize,
    direction: Option<Vector>,
    spacing: Option<f64>,
    kind: String,
}

struct Header {
    fields: BTreeMap<String, String>,
}

impl Header {
    /// Lines up to the first empty one, or the end of a detached header.
    fn read(file: &mut impl BufRead) -> Result<Self, Fault> {
        let mut fields = BTreeMap::new();
        let mut left = LONGEST_HEADER;
        let mut first = true;
        loop {
            let mut line = Vec::new();
            let got = file.by_ref().take(left).read_until(b'\n', &mut line);
            let got = got.map_err(|e| format!("its header cannot be read ({e})"))?;
            left = left.saturating_sub(got as u64);
            if left == 0 {
                return Err("its header has no end".into());
            }
            let line = String::from_utf8_lossy(&line);
            let line = line.trim_end_matches(['\n', '\r']);
            if first && !line.starts_with("NRRD") {
                return Err("it does not begin with NRRD".into());
            }
            if line.is_empty() {
                return Ok(Self { fields });
            }
            // `key:=value` lines are anybody's; comments begin with a hash.
            if let Some((key, value)) = line.split_once(": ").filter(|_| !line.starts_with('#')) {
                fields.insert(key.trim().to_ascii_lowercase(), value.trim().to_owned());
            }
            first = false;
        }
    }

    fn get(&self, key: &str) -> Option<&str> {
        self.fields.get(key).map(String::as_str)
    }

    fn required(&self, key: &str) -> Result<&str, Fault> {
        self.get(key).ok_or_else(|| Fault::Broken(format!("its header has no \"{key}\"")))
    }

    fn axes(&self) -> Result<Vec<Axis>, Fault> {
        let dimension: usize =
            self.required("dimension")?.parse().ok().ok_or("its dimension is no number")?;
        if !(1..=4).contains(&dimension) {
            return Err(Fault::Unsupported(
                format!("{dimension} axes"),
                "save a single volume or a series of volumes",
            ));
        }
        let sizes: Vec<&str> = self.required("sizes")?.split_whitespace().collect();
        if sizes.len() != dimension {
            return Err(Fault::Broken(format!("it has {dimension} axes but {} sizes", sizes.len())));
        }
        let directions = self.get("space directions").map(vectors);
        let words =
            |key: &str| self.get(key).map(|v| v.split_whitespace().collect::<Vec<_>>()).unwrap_or_default();
        let (spacings, kinds) = (words("spacings"), words("kinds"));
        let mut axes = Vec::new();
        for (i, size) in sizes.iter().enumerate() {
            let size = size.parse().ok().filter(|n| *n > 0);
            axes.push(Axis {
                size: size.ok_or_else(|| {
                    format!("its size along axis {} is no positive number", i.saturating_add(1))
                })?,
                direction: directions.as_ref().and_then(|d| d.get(i).copied().flatten()),
                spacing: spacings
                    .get(i)
                    .and_then(|s| s.parse().ok())
                    .filter(|s: &f64| s.is_finite() && *s != 0.0),
                kind: kinds.get(i).map_or_else(String::new, |k| k.to_ascii_lowercase()),
            });
        }
        Ok(axes)
    }

    /// The plan, and whether the steps are the fastest axis.
    fn plan(&self, axes: &[Axis], notes: &mut Vec<Note>) -> Result<(Plan, bool), Fault> {
        let has_directions = axes.iter().any(|a| a.direction.is_some());
        let in_space = |axis: &Axis| {
            if has_directions {
                axis.direction.is_some()
            } else {
                matches!(axis.kind.as_str(), "" | "domain" | "space" | "???")
            }
        };
        let mut space: Vec<&Axis> = axes.iter().filter(|a| in_space(a)).collect();
        let mut other: Vec<(usize, &Axis)> = axes.iter().enumerate().filter(|(_, a)| !in_space(a)).collect();
        if space.len() == 4 {
            let last = axes.len().saturating_sub(1);
            other.extend(space.pop().map(|a| (last, a)));
        }
        if space.is_empty() || other.len() > 1 {
            return Err("its axes are not those of a volume".into());
        }
        let (steps, first) = match other.first() {
            None => (None, false),
            Some((at, axis))
                if axis.size == 1
                    || ["time", "list", "domain", "space", "", "none", "???"]
                        .contains(&axis.kind.as_str()) =>
            {
                if *at != 0 && at.saturating_add(1) != axes.len() {
                    return Err(Fault::Unsupported(
                        "a time axis between those of space".to_owned(),
                        "put it first or last",
                    ));
                }
                (Some(*axis), *at == 0)
            }
            Some((_, axis)) => {
                let feature = format!("more than one value a voxel (an axis of kind {})", axis.kind);
                return Err(Fault::Unsupported(feature, "split it into one file a channel"));
            }
        };
        let count = steps.map_or(1, |a| a.size);
        if count > 1 << 24 {
            return Err(Fault::Broken(format!("it claims {count} steps in time")));
        }
        let mut extent = [1; 3];
        for (slot, axis) in extent.iter_mut().zip(&space) {
            *slot = axis.size;
        }
        let period = steps.and_then(|a| a.spacing).unwrap_or(0.0);
        let plan = Plan {
            extent,
            times_secs: voxels::times(count, 0.0, period, notes),
            scalar: self.scalar()?,
            endian: self.endian()?,
            rescale: Rescale::default(),
            world_from_voxel: self.place(&space, notes)?,
        };
        Ok((plan, first && count > 1))
    }

    fn place(&self, space: &[&Axis], notes: &mut Vec<Note>) -> Result<Affine, Fault> {
        let mut note = |code, text: &str| {
            notes.push(Note { severity: Severity::Caution, code, text: text.to_owned() });
        };
        let name = self.get("space").unwrap_or_default().to_ascii_lowercase();
        let name = name.strip_suffix("-time").or_else(|| name.strip_suffix('t')).unwrap_or(&name);
        let signs = match name {
            "left-posterior-superior" | "lps" => [1.0, 1.0, 1.0],
            "left-anterior-superior" | "las" => [1.0, -1.0, 1.0],
            "right-anterior-superior" | "ras" => [-1.0, -1.0, 1.0],
            _ => {
                note(
                    "nrrd.no-orientation",
                    "The file does not say how it lies in the patient; its axes were taken as left, posterior, superior.",
                );
                [1.0, 1.0, 1.0]
            }
        };
        if space.iter().all(|a| a.direction.is_none() && a.spacing.is_none()) {
            note("nrrd.no-spacing", "The file gives no spacing; 1 mm was taken, so nothing can be measured.");
        }
        let mut columns = [Vector::x(), Vector::y(), Vector::z()];
        for (column, axis) in columns.iter_mut().zip(space) {
            *column = match (axis.direction, axis.spacing) {
                (Some(direction), _) => direction,
                (None, Some(mm)) => column.scale(mm),
                (None, None) => *column,
            };
        }
        if let ([x, y, z], true) =
            (&mut columns, space.len() == 2 && space.iter().all(|a| a.direction.is_some()))
        {
            *z = x.cross(y).try_normalize(1e-12).unwrap_or(*z);
        }
        let origin = self.get("space origin").map(vectors).and_then(|v| v.first().copied().flatten());
        let units = self.get("space units").unwrap_or_default().to_ascii_lowercase();
        let unit_mm = match units.split('"').nth(1).unwrap_or_default() {
            "m" | "meter" | "meters" => 1000.0,
            "cm" => 10.0,
            "um" | "micron" | "microns" => 0.001,
            _ => 1.0,
        };
        voxels::placed(columns, origin.unwrap_or_else(Vector::zeros), signs, unit_mm)
    }

    fn scalar(&self) -> Result<Scalar, Fault> {
        Ok(match self.required("type")? {
            "signed char" | "int8" | "int8_t" => Scalar::I8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => Scalar::U8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Scalar::I16,
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Scalar::U16,
            "int" | "signed int" | "int32" | "int32_t" => Scalar::I32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" => Scalar::U32,
            "longlong"
            | "long long"
            | "long long int"
            | "signed long long"
            | "signed long long int"
            | "int64"
            | "int64_t" => Scalar::I64,
            "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
                Scalar::U64
            }
            "float" => Scalar::F32,
            "double" => Scalar::F64,
            other => {
                return Err(Fault::Unsupported(format!("samples of type {other}"), "convert it to numbers"));
            }
        })
    }

    fn endian(&self) -> Result<Endian, Fault> {
        match self.get("endian") {
            Some("big") => Ok(Endian::Big),
            Some("little") => Ok(Endian::Little),
            None if self.scalar()?.size() == 1 || self.is_text() => Ok(Endian::Little),
            _ => Err("it does not say which byte comes first (endian)".into()),
        }
    }

    fn is_text(&self) -> bool {
        matches!(self.get("encoding"), Some("ascii" | "text" | "txt"))
    }

    /// The samples' bytes, out of their encoding.
    fn decoded(
        &self,
        mut data: impl BufRead,
        plan: &Plan,
        limits: &Limits,
        progress: &dyn Progress,
    ) -> Result<Vec<u8>, Fault> {
        let number = |key: &str, other: &str| {
            let text = self.get(key).or_else(|| self.get(other)).unwrap_or("0");
            text.parse::<i64>().map_err(|e| Fault::Broken(format!("its \"{key}\" is no number ({e})")))
        };
        let lines = number("line skip", "lineskip")?;
        let skip = number("byte skip", "byteskip")?;
        let damaged = |e| Fault::Broken(format!("its samples cannot be read ({e})"));
        for _ in 0..lines {
            if data.skip_until(b'\n').map_err(damaged)? == 0 {
                return Err("it ends before its samples begin".into());
            }
        }
        let encoding = self.required("encoding")?;
        if skip < 0 && encoding == "raw" {
            // The samples are the last bytes of the file.
            let mut all = Vec::new();
            data.take(limits.decoded_bytes).read_to_end(&mut all).map_err(damaged)?;
            let needed = plan.count(limits)?.saturating_mul(plan.scalar.size());
            let start = all.len().checked_sub(needed).ok_or("it holds fewer samples than it says")?;
            return plan.read(Cursor::new(all.get(start..).unwrap_or_default()), limits, progress);
        }
        let skip = u64::try_from(skip).unwrap_or(0);
        match encoding {
            "raw" => {
                std::io::copy(&mut data.by_ref().take(skip), &mut std::io::sink()).map_err(damaged)?;
                plan.read(data, limits, progress)
            }
            "gzip" | "gz" => {
                let mut data = MultiGzDecoder::new(data);
                std::io::copy(&mut data.by_ref().take(skip), &mut std::io::sink()).map_err(damaged)?;
                plan.read(data, limits, progress)
            }
            "ascii" | "text" | "txt" => {
                let mut text = Vec::new();
                data.take(limits.decoded_bytes).read_to_end(&mut text).map_err(damaged)?;
                voxels::numbers(&text, plan, limits)
            }
            other => Err(Fault::Unsupported(format!("the encoding {other}"), "save it raw or with gzip")),
        }
    }
}

/// `(1,0,0) none (0,0.5,0)`: a vector or nothing, for each axis.
fn vectors(text: &str) -> Vec<Option<Vector>> {
    let mut found = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(inner) = rest.strip_prefix('(') {
            let (inside, after) = inner.split_once(')').unwrap_or((inner, ""));
            let numbers: Vec<f64> = inside.split(',').filter_map(|n| n.trim().parse().ok()).collect();
            found.push(match numbers.as_slice() {
                [x, y, z] if numbers.iter().all(|n| n.is_finite()) => Some(Vector::new(*x, *y, *z)),
                [x, y] if numbers.iter().all(|n| n.is_finite()) => Some(Vector::new(*x, *y, 0.0)),
                _ => None,
            });
            rest = after.trim_start();
        } else {
            found.push(None);
            rest = rest.split_once(char::is_whitespace).map_or("", |(_, after)| after).trim_start();
        }
    }
    found
}
