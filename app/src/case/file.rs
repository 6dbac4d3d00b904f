//! Reading and saving a case. A save leaves the old file or the new one, whatever happens in between.

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};
use thiserror::Error;

use super::{Case, read, write};

/// The version this program writes, and the newest it reads.
pub const VERSION: u64 = 1;
/// Largest case file read; bytes. A case holds no samples, so a bigger file is not one.
pub const MAX_BYTES: u64 = 64 << 20;

/// Why a case was not read or not saved. The path stands last.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FileError {
    /// The file system said no.
    #[error("the case cannot be read ({source}); check that it exists and may be read: {}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// More than [`MAX_BYTES`].
    #[error("the file is larger than any case ({MAX_BYTES} bytes); choose a case file: {}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// Not JSON.
    #[error("the case is not JSON ({source}); correct that place or restore the file: {}", path.display())]
    NotJson {
        /// The file.
        path: PathBuf,
        /// What is wrong, with line and column.
        source: serde_json::Error,
    },
    /// JSON, but no case.
    #[error("the file is not an Osteotome case: it has no \"osteotome\": {VERSION}; choose a case file: {}", path.display())]
    NotACase {
        /// The file.
        path: PathBuf,
    },
    /// Written by a later version.
    #[error(
        "the case has format version {version}, but this program reads up to {VERSION}; \
         update the program: {}", path.display()
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// What it says.
        version: String,
    },
    /// A field cannot be used.
    #[error("the case's field {at} {fault}; {remedy}: {}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// `fragments[2].keep.c9`.
        at: String,
        /// What is wrong, in a clause.
        fault: String,
        /// What to do, in a clause.
        remedy: &'static str,
    },
    /// The new file could not be written; the old one is as it was.
    #[error(
        "the case was not saved ({source}), what was there is unchanged; \
         check the disk's space and rights: {}", path.display()
    )]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A source's name is not Unicode.
    #[error("the case was not saved: a source's name is not Unicode; rename the data: {}", path.display())]
    NotUnicode {
        /// The source.
        path: PathBuf,
    },
}

/// The case in a file, every field checked. Sources are not opened.
///
/// # Errors
/// All of [`FileError`] but those of saving.
pub fn load(path: &Path) -> Result<Case, FileError> {
    let unreadable = |source| FileError::Unreadable { path: path.to_owned(), source };
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(unreadable)?;
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(FileError::TooLarge { path: path.to_owned() });
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes);
    let value: Value = serde_json::from_slice(bytes)
        .map_err(|source| FileError::NotJson { path: path.to_owned(), source })?;
    let Value::Object(document) = value else {
        return Err(FileError::NotACase { path: path.to_owned() });
    };
    check_version(&document, path)?;
    read::case(document, &folder_of(path)).map_err(|fault| FileError::Field {
        path: path.to_owned(),
        at: fault.at,
        fault: fault.what,
        remedy: fault.remedy,
    })
}

fn check_version(document: &Map<String, Value>, path: &Path) -> Result<(), FileError> {
    match document.get("osteotome") {
        Some(Value::Number(n)) if n.as_u64() == Some(VERSION) => Ok(()),
        Some(Value::Number(n)) if n.as_f64().is_some_and(|n| n > VERSION as f64) => {
            Err(FileError::Newer { path: path.to_owned(), version: n.to_string() })
        }
        _ => Err(FileError::NotACase { path: path.to_owned() }),
    }
}

/// Whether a file looks like a case: the first bytes hold `"osteotome"` in an object. Other JSON, such
/// as glTF, is not one.
pub fn looks_like_case(path: &Path) -> bool {
    let mut head = Vec::new();
    let Ok(file) = std::fs::File::open(path) else { return false };
    let ok = path.is_file() && file.take(4096).read_to_end(&mut head).is_ok();
    let text = String::from_utf8_lossy(&head);
    ok && text.trim_start_matches('\u{feff}').trim_start().starts_with('{') && text.contains("\"osteotome\"")
}

/// Saves a case: written beside the target, flushed to the disk, then put in its place in one step.
///
/// # Errors
/// [`FileError::Unwritable`], [`FileError::NotUnicode`]; the old file is then as it was.
pub fn save(case: &Case, path: &Path) -> Result<(), FileError> {
    // A link stays a link: what it points to is replaced.
    let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let folder = folder_of(&target);
    let text = write::case(case, &folder).map_err(|source| FileError::NotUnicode { path: source.0 })?;
    write_whole(&target, text.as_bytes())
        .map_err(|source| FileError::Unwritable { path: path.to_owned(), source })
}

/// Puts a whole file in the place of `target`, or leaves what is there.
///
/// # Errors
/// What the file system said.
pub fn write_whole(target: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = folder_of(target);
    let mut builder = tempfile::Builder::new();
    builder.prefix(".osteotome-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = std::fs::metadata(target).map_or(0o666, |m| m.permissions().mode());
        builder.permissions(std::fs::Permissions::from_mode(mode));
    }
    let mut file = builder.tempfile_in(&folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(target)?;
    // The rename itself must reach the disk too. Windows has no such call for folders.
    #[cfg(unix)]
    std::fs::File::open(&folder)?.sync_all()?;
    Ok(())
}

/// The folder of a file, absolute.
fn folder_of(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    path.parent().map_or_else(|| PathBuf::from("."), Path::to_owned)
}

#[cfg(test)]
mod tests;
