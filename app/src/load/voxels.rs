//! What the loaders of plain image formats share: samples out of bytes, volumes and series out of samples.

use std::io::Read;
use std::sync::Arc;

use rayon::prelude::*;
use render::volume::{Affine, Grid, Rescale, Samples, Series, Vector};

use super::bytes::{Endian, Fault, Scalar};
use super::{Content, Limits, Note, Progress, Severity};

/// How much is read between two looks at the progress.
const PIECE: u64 = 8 << 20;

/// What a header says of the samples that follow.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    /// Samples along x, y, z; x fastest.
    pub(super) extent: [usize; 3],
    /// When each step was, seconds, rising; one step for a plain volume.
    pub(super) times_secs: Vec<f64>,
    pub(super) scalar: Scalar,
    pub(super) endian: Endian,
    pub(super) rescale: Rescale,
    /// LPS mm.
    pub(super) world_from_voxel: Affine,
}

impl Plan {
    /// How many samples there are in all steps; refuses more than the limit allows.
    ///
    /// # Errors
    /// [`Fault::TooLarge`].
    pub(super) fn count(&self, limits: &Limits) -> Result<usize, Fault> {
        let sizes = self.extent.iter().copied().chain([self.times_secs.len()]);
        let count = sizes.fold(1_u128, |all, n| all.saturating_mul(n as u128));
        let bytes = count.saturating_mul(self.scalar.size() as u128);
        if bytes > u128::from(limits.decoded_bytes) {
            return Err(Fault::TooLarge(bytes));
        }
        usize::try_from(count).ok().ok_or(Fault::TooLarge(bytes))
    }

    /// The bytes of all samples. Memory is taken as they come, not as the header claims them.
    ///
    /// # Errors
    /// [`Fault`]: more than allowed, fewer than the header says, damaged compression, cancelled.
    pub(super) fn read(
        &self,
        reader: impl Read,
        limits: &Limits,
        progress: &dyn Progress,
    ) -> Result<Vec<u8>, Fault> {
        let needed = self.count(limits)?.saturating_mul(self.scalar.size());
        let total = needed as u64;
        let mut reader = reader.take(total);
        let mut bytes = Vec::new();
        while bytes.len() < needed {
            let steps = |n: usize| n.checked_div(1 << 20).unwrap_or(0);
            super::bytes::step(progress, "reading samples (MiB)", steps(bytes.len()), steps(needed))?;
            let piece = reader.by_ref().take(PIECE).read_to_end(&mut bytes);
            let got =
                piece.map_err(|e| Fault::Broken(format!("its samples are cut short or damaged ({e})")))?;
            if got == 0 {
                return Err(Fault::Broken(format!(
                    "its header asks for {needed} bytes of samples, but only {} are there",
                    bytes.len()
                )));
            }
        }
        Ok(bytes)
    }

    /// The volume or series that the bytes are.
    ///
    /// # Errors
    /// [`Fault::Broken`] where sizes or numbers make no grid.
    pub(super) fn content(&self, bytes: &[u8], notes: &mut Vec<Note>) -> Result<Content, Fault> {
        let step = self.extent.iter().fold(self.scalar.size(), |all, &n| all.saturating_mul(n));
        let mut grids = Vec::new();
        for part in bytes.chunks_exact(step.max(1)) {
            let samples = samples(part, self.scalar, self.endian, notes);
            let grid = Grid::new(self.extent, samples, self.rescale, self.world_from_voxel);
            grids.push(Arc::new(grid.map_err(|e| Fault::Broken(e.to_string()))?));
        }
        notes.extend(not_finite(&grids));
        match (self.times_secs.len(), grids.pop()) {
            (1, Some(grid)) => Ok(Content::Volume(Arc::unwrap_or_clone(grid))),
            (_, Some(last)) => {
                grids.push(last);
                let series = Series::new(grids, self.times_secs.clone());
                Ok(Content::Series(series.map_err(|e| Fault::Broken(e.to_string()))?))
            }
            (_, None) => Err("it holds no samples".into()),
        }
    }
}

/// A note where samples are NaN or infinite, with their number.
pub(super) fn not_finite(grids: &[Arc<Grid>]) -> Option<Note> {
    let lost: usize = grids.iter().map(|g| g.non_finite()).sum();
    (lost > 0).then(|| Note {
        severity: Severity::Caution,
        code: "volume.not-finite",
        text: format!("{lost} samples are not numbers or infinite; they count as the lowest value."),
    })
}

/// Times of `count` steps of `period_secs`; a period that is none is taken as 1 s and noted.
pub(super) fn times(count: usize, start_secs: f64, period_secs: f64, notes: &mut Vec<Note>) -> Vec<f64> {
    let known = period_secs.is_finite() && period_secs > 0.0;
    if count > 1 && !known {
        notes.push(Note {
            severity: Severity::Caution,
            code: "volume.time-guessed",
            text: format!("The file does not say how far apart its {count} steps are; 1 s was taken."),
        });
    }
    let start = if start_secs.is_finite() { start_secs } else { 0.0 };
    (0..count).map(|t| start + t as f64 * if known { period_secs } else { 1.0 }).collect()
}

/// LPS mm from a file's own frame: `signs` says which of its axes run against L, P and S, `unit_mm` how
/// long its unit is.
///
/// # Errors
/// [`Fault::Broken`] where the columns span no space.
pub(super) fn placed(
    columns: [Vector; 3],
    origin: Vector,
    signs: [f64; 3],
    unit_mm: f64,
) -> Result<Affine, Fault> {
    let turn = Vector::from(signs.map(|s| s * unit_mm));
    let [x, y, z] = columns.map(|c| c.component_mul(&turn));
    Affine::from_columns(x, y, z, origin.component_mul(&turn).into())
        .map_err(|e| Fault::Broken(format!("its axes span no space ({e})")))
}

/// Samples in the type that the file has; 64-bit whole numbers, which a grid does not keep, as `i32` where
/// all fit and as `f64` otherwise.
fn samples(bytes: &[u8], scalar: Scalar, endian: Endian, notes: &mut Vec<Note>) -> Samples {
    macro_rules! of {
        ($kind:ident, $type:ty) => {{
            let (words, _) = bytes.as_chunks();
            let one = |w: &_| match endian {
                Endian::Little => <$type>::from_le_bytes(*w),
                Endian::Big => <$type>::from_be_bytes(*w),
            };
            Samples::$kind(words.par_iter().with_min_len(1 << 16).map(one).collect())
        }};
    }
    match scalar {
        Scalar::U8 => Samples::U8(bytes.to_vec()),
        Scalar::I8 => of!(I8, i8),
        Scalar::U16 => of!(U16, u16),
        Scalar::I16 => of!(I16, i16),
        Scalar::U32 => of!(U32, u32),
        Scalar::I32 => of!(I32, i32),
        Scalar::F32 => of!(F32, f32),
        Scalar::F64 => of!(F64, f64),
        Scalar::I64 | Scalar::U64 => {
            let reals = scalar.reals(bytes, endian);
            let fits = reals.iter().all(|v| f64::from(i32::MIN) <= *v && *v <= f64::from(i32::MAX));
            let code = "volume.wide-integers";
            let (kind, severity) = if fits {
                ("32-bit whole numbers", Severity::Fact)
            } else {
                ("64-bit floats", Severity::Caution)
            };
            if notes.iter().all(|n| n.code != code) {
                let text = format!("The samples are 64-bit whole numbers; they are kept as {kind}.");
                notes.push(Note { severity, code, text });
            }
            #[expect(clippy::cast_possible_truncation, reason = "all fit")]
            if fits {
                Samples::I32(reals.par_iter().map(|v| *v as i32).collect())
            } else {
                Samples::F64(reals)
            }
        }
    }
}

/// Samples written as text, put into the bytes that [`Plan::content`] takes.
///
/// # Errors
/// [`Fault`]: a word that is no number, fewer numbers than the header says.
pub(super) fn numbers(text: &[u8], plan: &Plan, limits: &Limits) -> Result<Vec<u8>, Fault> {
    let count = plan.count(limits)?;
    let text = String::from_utf8_lossy(text);
    let mut bytes = Vec::new();
    let mut found = 0_usize;
    for word in text.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty()).take(count) {
        let written = plan.scalar.parse(word, plan.endian, &mut bytes);
        written.ok_or_else(|| Fault::Broken(format!("\"{word:.20}\" is no number of its type")))?;
        found = found.saturating_add(1);
    }
    if found < count {
        return Err(Fault::Broken(format!(
            "its header asks for {count} samples, but only {found} are there"
        )));
    }
    Ok(bytes)
}

impl Scalar {
    /// Appends a number written as text.
    fn parse(self, word: &str, endian: Endian, out: &mut Vec<u8>) -> Option<()> {
        macro_rules! of {
            ($type:ty) => {{
                let value: $type = word.parse().ok()?;
                match endian {
                    Endian::Little => out.extend(value.to_le_bytes()),
                    Endian::Big => out.extend(value.to_be_bytes()),
                }
            }};
        }
        match self {
            Self::I8 => of!(i8),
            Self::U8 => of!(u8),
            Self::I16 => of!(i16),
            Self::U16 => of!(u16),
            Self::I32 => of!(i32),
            Self::U32 => of!(u32),
            Self::I64 => of!(i64),
            Self::U64 => of!(u64),
            Self::F32 => of!(f32),
            Self::F64 => of!(f64),
        }
        Some(())
    }
}
