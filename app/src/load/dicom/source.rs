//! Where DICOM files come from: single files, or the members of a zip archive, which is read in memory; no
//! name in it ever reaches the file system.

use std::fs;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use flate2::read::DeflateDecoder;
use zip::ZipArchive;

use super::walk::{self, Anatomy, Fault};
use super::{Limits, LoadError};

/// Files that may be DICOM.
pub(in crate::load) struct Sources {
    path: PathBuf,
    kind: Kind,
    limit: u64,
}

enum Kind {
    Files(Vec<PathBuf>),
    Zip { archive: ZipArchive<Cursor<Arc<[u8]>>>, members: Vec<usize> },
}

/// One file in memory, walked.
pub(super) struct Opened {
    pub(super) bytes: Vec<u8>,
    pub(super) anatomy: Anatomy,
}

/// Why a file of many was not opened.
pub(super) enum Refusal {
    /// It is over for all.
    Load(LoadError),
    /// This one is no good.
    Fault(Fault),
}

impl From<Fault> for Refusal {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

impl Sources {
    /// Files on disk; `path` is what the user named.
    pub(in crate::load) fn files(path: &Path, files: Vec<PathBuf>, limits: &Limits) -> Self {
        Self { path: path.to_owned(), kind: Kind::Files(files), limit: limits.decoded_bytes }
    }

    /// The files in a zip archive.
    ///
    /// # Errors
    /// [`LoadError::Io`], [`LoadError::Broken`] for no archive or a cut one, [`LoadError::TooLarge`].
    pub(in crate::load) fn zip(path: &Path, limits: &Limits) -> Result<Self, LoadError> {
        let io = |source| LoadError::Io { path: path.to_owned(), source };
        let length = fs::metadata(path).map_err(io)?.len();
        let limit = limits.decoded_bytes;
        if length > limit {
            return Err(LoadError::TooLarge {
                format: "zip",
                bytes: length.into(),
                limit,
                path: path.to_owned(),
            });
        }
        let bytes: Arc<[u8]> = fs::read(path).map_err(io)?.into();
        let broken = |fault: String| LoadError::Broken { format: "zip", fault, path: path.to_owned() };
        let mut archive =
            ZipArchive::new(Cursor::new(bytes)).map_err(|e| broken(format!("no zip archive ({e})")))?;
        if archive.len() > limits.files {
            return Err(broken(format!(
                "it holds {} files, more than the {} allowed",
                archive.len(),
                limits.files
            )));
        }
        let mut members = Vec::new();
        let mut claimed = 0_u128;
        for index in 0..archive.len() {
            let entry = archive.by_index_raw(index).map_err(|e| broken(format!("member {index}: {e}")))?;
            if entry.encrypted() {
                return Err(LoadError::Unsupported {
                    format: "zip",
                    feature: "encryption".to_owned(),
                    remedy: "unpack it with its password first",
                    path: path.to_owned(),
                });
            }
            if entry.is_file() {
                claimed = claimed.saturating_add(entry.size().into());
                members.push(index);
            }
        }
        // A bomb that is honest about its size stops here; one that lies stops in `read`.
        if claimed > u128::from(limit) {
            return Err(LoadError::TooLarge { format: "zip", bytes: claimed, limit, path: path.to_owned() });
        }
        Ok(Self { path: path.to_owned(), kind: Kind::Zip { archive, members }, limit })
    }

    /// What the user named.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether what is read was packed: its size is not known beforehand.
    pub(super) fn is_archive(&self) -> bool {
        matches!(self.kind, Kind::Zip { .. })
    }

    /// How many files there are.
    pub(super) fn len(&self) -> usize {
        match &self.kind {
            Kind::Files(files) => files.len(),
            Kind::Zip { members, .. } => members.len(),
        }
    }

    /// Reads and walks one file.
    pub(super) fn open(&self, index: usize) -> Result<Opened, Refusal> {
        let bytes = self.read(index)?;
        let (transfer_syntax, start) = walk::meta(&bytes)?;
        if transfer_syntax == walk::DEFLATED {
            let deflated = bytes.get(start..).unwrap_or_default();
            let bytes = self.bounded(DeflateDecoder::new(deflated), None)?;
            let anatomy = walk::walk(&bytes, transfer_syntax, 0)?;
            return Ok(Opened { bytes, anatomy });
        }
        let anatomy = walk::walk(&bytes, transfer_syntax, start)?;
        Ok(Opened { bytes, anatomy })
    }

    fn read(&self, index: usize) -> Result<Vec<u8>, Refusal> {
        match &self.kind {
            Kind::Files(files) => {
                let path = files.get(index).map_or(self.path.as_path(), PathBuf::as_path);
                let io = |source| Refusal::Load(LoadError::Io { path: path.to_owned(), source });
                let file = fs::File::open(path).map_err(io)?;
                let length = file.metadata().map_err(io)?.len();
                self.bounded(file, Some(length))
            }
            Kind::Zip { archive, members } => {
                let member = members.get(index).copied().unwrap_or(usize::MAX);
                // A clone shares the bytes and the directory, and has a position of its own.
                let mut archive = archive.clone();
                let entry =
                    archive.by_index(member).map_err(|e| format!("member {member} of the archive: {e}"))?;
                self.bounded(entry, None)
            }
        }
    }

    fn bounded(&self, reader: impl Read, length: Option<u64>) -> Result<Vec<u8>, Refusal> {
        let too_large = |bytes: u64| {
            let path = self.path.clone();
            Refusal::Load(LoadError::TooLarge {
                format: super::FORMAT,
                bytes: bytes.into(),
                limit: self.limit,
                path,
            })
        };
        if let Some(length) = length.filter(|l| *l > self.limit) {
            return Err(too_large(length));
        }
        let mut bytes = Vec::with_capacity(length.and_then(|l| usize::try_from(l).ok()).unwrap_or(0));
        let most = self.limit.saturating_add(1);
        reader.take(most).read_to_end(&mut bytes).map_err(|e| format!("its bytes cannot be read ({e})"))?;
        if u64::try_from(bytes.len()).unwrap_or(u64::MAX) > self.limit {
            return Err(too_large(most));
        }
        Ok(bytes)
    }
}
