//! Jobs without a display. Each has a file with `run(&Args)`; what they share is here.
//!
//! `input` opens what they work on, `plot` draws what `bench` measures. Results go to standard output, the
//! rest to standard error.

use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use ::render::cpu::CpuError;
use ::render::gpu::GpuError;
use ::render::reference::ReferenceError;
use thiserror::Error;

use crate::case::assets::AssetError;
use crate::case::{FileError, file};
use crate::load::{LoadError, Progress};
use crate::sample::SampleError;

pub mod bench;
pub mod compress;
pub mod demo;
pub mod info;
pub mod input;
mod play;
pub mod plot;
pub mod ranks;
pub mod render;
pub mod section;
mod series;

/// Why a job was not done: one sentence, and the program's exit code.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Failure {
    /// The arguments make no sense together.
    #[error("{0}")]
    Usage(String),
    /// A case file cannot be used.
    #[error("{0}")]
    Case(FileError),
    /// A case could not be written.
    #[error("{0}")]
    Save(FileError),
    /// Data cannot be used.
    #[error("{}", about_data(.0))]
    Data(#[from] LoadError),
    /// The input is readable, but not what the job needs; a sentence with the path last.
    #[error("{0}")]
    Unfit(String),
    /// The built-in sample could not be made.
    #[error("{0}")]
    Sample(#[from] SampleError),
    /// The GPU drew nothing.
    #[error("{0}")]
    Gpu(#[from] GpuError),
    /// The processor drew nothing.
    #[error("{0}")]
    Cpu(#[from] CpuError),
    /// The reference drew nothing.
    #[error("{0}")]
    Reference(#[from] ReferenceError),
    /// Something cannot be written.
    #[error("the result cannot be written ({source}); check the folder, its rights and the disk's space: {}", path.display())]
    Output {
        /// What was to be written.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A defect of the program, or the system refused something it always gives.
    #[error("{0}")]
    Other(String),
}

impl Failure {
    /// 2 wrong usage, 3 unusable input, 4 no usable GPU, 1 anything else.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::Case(_)
            | Self::Data(_)
            | Self::Unfit(_)
            | Self::Gpu(GpuError::Camera(_))
            | Self::Cpu(CpuError::Camera(_))
            | Self::Reference(ReferenceError::Camera(_)) => 3,
            Self::Gpu(GpuError::NoAdapter { .. } | GpuError::NoDevice { .. }) => 4,
            _ => 1,
        }
    }
}

impl From<AssetError> for Failure {
    fn from(error: AssetError) -> Self {
        match error {
            AssetError::Load(error) => Self::Data(error),
            AssetError::Sample(error) => Self::Sample(error),
            AssetError::NoItem { .. } => Self::Unfit(format!("the source {error}")),
            other => Self::Unfit(other.to_string()),
        }
    }
}

/// A loader's complaint as a sentence: some of them begin with their verb.
fn about_data(error: &LoadError) -> String {
    match error {
        LoadError::Io { .. } | LoadError::Unknown { .. } => format!("the data file {error}"),
        LoadError::Cancelled => error.to_string(),
        _ => format!("the {error}"),
    }
}

/// Puts a whole file in its place.
///
/// # Errors
/// [`Failure::Output`].
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    file::write_whole(path, bytes).map_err(|source| Failure::Output { path: path.to_owned(), source })
}

/// Refuses a result whose folder is not there, before the work rather than after it.
///
/// # Errors
/// [`Failure::Output`].
pub fn check_folder(path: &Path) -> Result<(), Failure> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match std::fs::metadata(folder) {
        Ok(found) if found.is_dir() => Ok(()),
        Ok(_) => Err(Failure::Output {
            path: path.to_owned(),
            source: std::io::Error::from(std::io::ErrorKind::NotADirectory),
        }),
        Err(source) => Err(Failure::Output { path: path.to_owned(), source }),
    }
}

/// A line on standard output.
///
/// # Errors
/// [`Failure::Output`], where nobody reads it.
pub fn say(line: &str) -> Result<(), Failure> {
    let output = |source| Failure::Output { path: PathBuf::from("standard output"), source };
    writeln!(std::io::stdout().lock(), "{line}").map_err(output)
}

/// Progress on standard error, one line that is written over; nothing where that is no terminal.
#[derive(Debug, Default)]
pub struct Terminal {
    last_per_cent: AtomicUsize,
}

impl Progress for Terminal {
    fn step(&self, doing: &str, done: usize, total: usize) -> bool {
        let per_cent = done.saturating_mul(100).checked_div(total).unwrap_or(0);
        let changed = self.last_per_cent.swap(per_cent, Ordering::Relaxed) != per_cent;
        if changed && std::io::stderr().is_terminal() {
            let end = if done >= total { "\r\x1b[K" } else { "" };
            // Progress that cannot be shown is not missed.
            drop(write!(std::io::stderr(), "\r\x1b[K{doing}: {per_cent} %{end}"));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exit_codes_are_those_of_the_contract() {
        let io = || std::io::Error::other("full");
        let path = PathBuf::from("x.png");
        let no_gpu = GpuError::NoAdapter { reason: String::new() };
        for (failure, code) in [
            (Failure::Usage("use".to_owned()), 2),
            (Failure::Data(LoadError::Unknown { path: path.clone() }), 3),
            (Failure::Case(FileError::NotACase { path: path.clone() }), 3),
            (Failure::Gpu(no_gpu), 4),
            (Failure::Gpu(GpuError::OutOfMemory { what: "a picture" }), 1),
            (Failure::Output { path, source: io() }, 1),
        ] {
            assert_eq!(failure.exit_code(), code, "{failure}");
        }
    }

    #[test]
    fn a_loaders_complaint_is_a_sentence() {
        let error = Failure::Data(LoadError::Unknown { path: PathBuf::from("a.xyz") });
        assert!(error.to_string().starts_with("the data file is not a format"), "{error}");
    }
}
