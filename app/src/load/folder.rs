//! A folder: its DICOM files together, every other file on its own.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::detect::{self, Format};
use super::{Item, Limits, LoadError, Note, Progress, Severity, dicom};

/// Folders nested deeper are not looked into.
const MAX_DEPTH: usize = 8;

/// Everything in a folder.
///
/// # Errors
/// [`LoadError`] of the first file that failed, where nothing could be read.
pub(super) fn open(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    let mut files = Vec::new();
    list(path, 0, limits, &mut files)?;
    files.sort();
    let (mut slices, mut others) = (Vec::new(), Vec::new());
    for (done, file) in files.iter().enumerate() {
        if !progress.step("looking at files", done, files.len()) {
            return Err(LoadError::Cancelled);
        }
        match detect::detect(file)? {
            Some(Format::Dicom) => slices.push(file.clone()),
            Some(format) => others.push((format, file.clone())),
            None => {}
        }
    }
    let listed = listed_by_others(&others);
    others.retain(|(_, file)| !listed.contains(file));
    let mut items = Vec::new();
    let mut failures: Vec<LoadError> = Vec::new();
    let mut keep = |result: Result<Vec<Item>, LoadError>| match result {
        Ok(found) => {
            items.extend(found);
            Ok(())
        }
        Err(LoadError::Cancelled) => Err(LoadError::Cancelled),
        Err(error) => {
            failures.push(error);
            Ok(())
        }
    };
    if !slices.is_empty() {
        keep(dicom::read(&dicom::Sources::files(path, slices, limits), limits, progress))?;
    }
    for (format, file) in others {
        keep(format.read(&file, limits, progress))?;
    }
    let count = failures.len();
    match (items.first_mut(), failures.into_iter().next()) {
        (None, Some(error)) => return Err(error),
        (None, None) => return Err(LoadError::Unknown { path: path.to_owned() }),
        (Some(item), Some(error)) => item.notes.push(Note {
            severity: Severity::Loss,
            code: "folder.left-out",
            text: format!("{count} other files of the folder could not be read; the first one {error}."),
        }),
        (Some(_), None) => {}
    }
    Ok(items)
}

fn list(folder: &Path, depth: usize, limits: &Limits, files: &mut Vec<PathBuf>) -> Result<(), LoadError> {
    let io = |source| LoadError::Io { path: folder.to_owned(), source };
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        // A link to a folder may lead back here; links to files are followed.
        let kind = entry.file_type().map_err(io)?;
        if kind.is_dir() {
            if depth < MAX_DEPTH {
                list(&entry.path(), depth.saturating_add(1), limits, files)?;
            }
        } else if entry.path().is_file() {
            files.push(entry.path());
        }
        if files.len() > limits.files {
            let path = folder.to_owned();
            let fault = format!("it holds more than the {} files allowed", limits.files);
            return Err(LoadError::Broken { format: "folder", fault, path });
        }
    }
    Ok(())
}

/// Files that an index file names: its steps or pieces, which are not to be read a second time.
fn listed_by_others(files: &[(Format, PathBuf)]) -> BTreeSet<PathBuf> {
    let mut listed = BTreeSet::new();
    for (_, index) in files {
        let ending = index.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        if !["pvd", "pvtu"].contains(&ending.as_str()) {
            continue;
        }
        let Ok(text) = std::fs::read_to_string(index) else { continue };
        for (attribute, quote) in [("file=\"", '"'), ("Source=\"", '"'), ("file='", '\''), ("Source='", '\'')]
        {
            for part in text.split(attribute).skip(1) {
                if let (Some(name), Some(folder)) = (part.split(quote).next(), index.parent()) {
                    listed.insert(folder.join(name));
                }
            }
        }
    }
    // Plot3D: the solution belongs to the mesh of the same name.
    for (format, file) in files {
        let name = file.file_name().map(|n| n.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        if *format == Format::Plot3d && ["q.bin", ".q"].iter().any(|end| name.ends_with(end)) {
            listed.insert(file.clone());
        }
    }
    listed
}
