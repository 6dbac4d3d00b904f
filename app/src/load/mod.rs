//! Reading files into the world's frame: [`open`] detects the format and returns data with notes.
//!
//! A loader converts at the door: whatever the file's frame (RAS, scanner axes, metres where the
//! format's own standard says so), what comes out is LPS millimetres. Nothing is repaired in
//! silence: each departure from what the file plainly says is a [`Note`]. Every size that a file
//! claims is checked against [`Limits`] and against the file's real length before memory is taken.
#![warn(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects
)]

mod bytes;
mod detect;
mod dicom;
mod exodus;
mod folder;
mod gltf;
mod metaimage;
mod nifti;
mod nrrd;
mod obj;
mod plot3d;
mod ply;
mod stl;
mod surface;
#[cfg(test)]
mod tests;
mod voxels;
mod vtk;

use std::path::{Path, PathBuf};

use render::volume::{Affine, Grid, TriangleMesh};
use thiserror::Error;

/// What a loader may take from a file it does not trust.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Largest memory for the decoded samples or triangles of one item; bytes.
    pub decoded_bytes: u64,
    /// Most files looked at in a folder or an archive.
    pub files: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { decoded_bytes: 8 << 30, files: 100_000 }
    }
}

/// How far a load has come, and whether it should stop. Called from any thread.
pub trait Progress: Sync {
    /// `done` of `total` steps of what `doing` names; `false` asks the loader to stop with
    /// [`LoadError::Cancelled`].
    fn step(&self, doing: &str, done: usize, total: usize) -> bool;
}

/// Progress that nobody looks at.
#[derive(Debug, Clone, Copy)]
pub struct Silent;

impl Progress for Silent {
    fn step(&self, _doing: &str, _done: usize, _total: usize) -> bool {
        true
    }
}

/// How much a note matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Good to know: a tilt was found, an intercept applied.
    Fact,
    /// Something was decided that the user may want to check: uneven slices, a guessed unit.
    Caution,
    /// Part of the data is missing or was not used.
    Loss,
}

/// A departure from what the file plainly says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// How much it matters.
    pub severity: Severity,
    /// Stable short name, for tests and programs: `"dicom.gantry-tilt"`.
    pub code: &'static str,
    /// One sentence for people, with numbers and units, without patient data.
    pub text: String,
}

/// What one item of a file is.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Content {
    /// One volume.
    Volume(Grid),
    /// Volumes of one frame over time.
    Series(render::volume::Series),
    /// A surface.
    Mesh(TriangleMesh),
    /// An unstructured grid.
    Cells(render::volume::CellGrid),
}

/// One thing found in a file or folder.
#[derive(Debug, Clone)]
pub struct Item {
    /// What it calls itself, or the file's name; no patient data.
    pub name: String,
    /// Format it was read as: `"DICOM"`, `"NIfTI"`, `"STL"`.
    pub format: &'static str,
    /// `"CT"`, `"MR"`, ... where the file says so.
    pub modality: Option<String>,
    /// The data, in LPS mm.
    pub content: Content,
    /// What departs from the plain reading.
    pub notes: Vec<Note>,
}

/// Why a path gave nothing. Messages name the fault and the remedy; the path stands last.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The file system said no.
    #[error("cannot be read ({source}); check that it exists and may be read: {}", path.display())]
    Io {
        /// What was opened.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// No loader knows it.
    #[error(
        "is not a format this program reads (DICOM, NIfTI, NRRD, MetaImage, STL, OBJ, PLY, glTF, VTK); \
         convert it to one of these: {}", path.display()
    )]
    Unknown {
        /// What was opened.
        path: PathBuf,
    },
    /// The file is broken or contradicts itself.
    #[error("{format} file is broken: {fault}; get a fresh copy or export it again: {}", path.display())]
    Broken {
        /// The format it was read as.
        format: &'static str,
        /// What is wrong, in a clause.
        fault: String,
        /// What was opened.
        path: PathBuf,
    },
    /// The file is right, but uses what this program cannot read.
    #[error("{format} file uses {feature}, which is not supported; {remedy}: {}", path.display())]
    Unsupported {
        /// The format it was read as.
        format: &'static str,
        /// What it uses.
        feature: String,
        /// What the user can do.
        remedy: &'static str,
        /// What was opened.
        path: PathBuf,
    },
    /// The file claims more than [`Limits`] allow.
    #[error("{format} file asks for {bytes} bytes, more than the {limit} allowed; crop or downsample it: {}", path.display())]
    TooLarge {
        /// The format it was read as.
        format: &'static str,
        /// What it claims.
        bytes: u128,
        /// What is allowed.
        limit: u64,
        /// What was opened.
        path: PathBuf,
    },
    /// [`Progress::step`] said so.
    #[error("loading was cancelled")]
    Cancelled,
}

/// Everything found at `path`: a file, a folder or a zip archive.
///
/// All DICOM files of a folder and the folders in it are read together, as one or more series; every
/// other file in it is read on its own if some loader knows it, unless another file there lists it (the
/// steps of a `.pvd`, the pieces of a `.pvtu`).
///
/// # Errors
/// [`LoadError`] where nothing could be read; what was read only in part comes with notes instead.
pub fn open(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    let io = |source| LoadError::Io { path: path.to_owned(), source };
    if std::fs::metadata(path).map_err(io)?.is_dir() {
        return folder::open(path, limits, progress);
    }
    match detect::detect(path)? {
        Some(format) => format.read(path, limits, progress),
        None => Err(LoadError::Unknown { path: path.to_owned() }),
    }
}

/// The patient's directions in which the axes of an array run, a letter each.
///
/// `"LPS"` is an array whose first index rises to the left, the second to the back, the third to the head.
/// An oblique axis has the letter that it is nearest to; no letter pair (R/L, A/P, I/S) is used twice.
pub fn axis_codes(world_from_voxel: &Affine) -> String {
    let linear = world_from_voxel.linear();
    let mut free = [true; 3];
    let mut letters = [' '; 3];
    let mut open = [true; 3];
    // The clearest axis chooses first.
    for _ in 0..3 {
        let mut best: Option<(f64, usize, usize)> = None;
        for axis in (0..3).filter(|a| open.get(*a) == Some(&true)) {
            let column = linear.column(axis);
            let length = column.norm();
            for way in (0..3).filter(|w| free.get(*w) == Some(&true)) {
                let share = column.get(way).map_or(0.0, |c| c.abs() / length);
                if best.is_none_or(|b| share > b.0) {
                    best = Some((share, axis, way));
                }
            }
        }
        let Some((_, axis, way)) = best else { break };
        let rising = linear.get((way, axis)).is_some_and(|c| *c >= 0.0);
        let pair = [['R', 'L'], ['A', 'P'], ['I', 'S']].get(way).copied().unwrap_or([' '; 2]);
        if let (Some(letter), Some(open), Some(free)) =
            (letters.get_mut(axis), open.get_mut(axis), free.get_mut(way))
        {
            *letter = if rising { pair[1] } else { pair[0] };
            *open = false;
            *free = false;
        }
    }
    letters.iter().collect()
}
