//! What was painted, as files beside the case. A file that is there is never written over.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use thiserror::Error;

use super::nrrd::nrrd;
use crate::case::labels::Bricks;
use crate::case::{Assets, Case, LabelSet, Source};

/// Why labels were not saved.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LabelsError {
    /// Their source or volume is not loaded, so what lies under the paint is not known.
    #[error("the labels \"{id}\" cannot be saved before they are loaded; show them, then save again")]
    NotLoaded {
        /// The set.
        id: String,
    },
    /// The file system said no.
    #[error(
        "the labels were not saved ({source}), the case is as it was; check the disk's space and rights: {}",
        path.display()
    )]
    Unwritable {
        /// The folder or file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// What was last saved of each set: its paint and the file that holds it.
pub type Saved = BTreeMap<String, (Arc<Bricks>, PathBuf)>;

/// Writes every painted set into a new NRRD file beside `path`, the case's file, and gives the case that names them.
///
/// A set whose paint is as it was saved last, in this folder, keeps its file.
///
/// # Errors
/// [`LabelsError`]; then nothing names the files that were written.
pub fn beside(case: &Case, assets: &Assets, path: &Path, saved: &mut Saved) -> Result<Case, LabelsError> {
    let mut written = case.clone();
    for set in written.labels.iter_mut().filter(|set| !set.painted.is_empty()) {
        let folder = path.parent().unwrap_or(Path::new("."));
        let known = saved.get(&set.id).filter(|(painted, file)| {
            Arc::ptr_eq(painted, &set.painted) && file.parent() == Some(folder) && file.exists()
        });
        let file = match known {
            Some((_, file)) => file.clone(),
            None => write(case, assets, set, path)?,
        };
        saved.insert(set.id.clone(), (Arc::clone(&set.painted), file.clone()));
        (set.source, set.item) = (Some(Source::path(&file)), 0);
        set.painted = Arc::default();
    }
    Ok(written)
}

/// Writes a set into a file that was not there.
fn write(case: &Case, assets: &Assets, set: &LabelSet, path: &Path) -> Result<PathBuf, LabelsError> {
    let found = assets.labels(case, set).ok_or_else(|| LabelsError::NotLoaded { id: set.id.clone() })?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let unwritable = |source| LabelsError::Unwritable { path: folder.to_owned(), source };
    let mut file = tempfile::Builder::new()
        .prefix(".osteotome-")
        .suffix(".tmp")
        .tempfile_in(folder)
        .map_err(unwritable)?;
    let bytes = nrrd(&found.grid).map_err(unwritable)?;
    file.write_all(&bytes).and_then(|()| file.as_file().sync_all()).map_err(unwritable)?;
    let stem = path.file_stem().map_or_else(|| "case".to_owned(), |s| s.to_string_lossy().into_owned());
    let name: String =
        set.id.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect();
    for number in 1_u32.. {
        let tail = if number == 1 { String::new() } else { format!("-{number}") };
        let target = folder.join(format!("{stem}.{name}{tail}.nrrd"));
        match file.persist_noclobber(&target) {
            Ok(_) => return Ok(target),
            Err(taken) if taken.error.kind() == std::io::ErrorKind::AlreadyExists => file = taken.file,
            Err(fault) => return Err(unwritable(fault.error)),
        }
    }
    Err(unwritable(std::io::Error::from(std::io::ErrorKind::AlreadyExists)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::assets::{Asset, Data, Key};
    use crate::case::labels::EDGE;
    use crate::case::{Volume, file};
    use crate::load::{Limits, Silent};
    use crate::presets;
    use render::volume::{Affine, Grid, Rescale, Samples};

    #[test]
    fn paint_goes_into_new_files_and_the_source_stays_as_it_is() {
        let folder = tempfile::tempdir().expect("folder");
        let samples = Samples::U8(vec![3; 4 * 4 * 4]);
        let grid = Grid::new([4; 3], samples, Rescale::default(), Affine::identity()).expect("grid");
        let source = folder.path().join("hip.l.nrrd");
        std::fs::write(&source, nrrd(&grid).expect("nrrd")).expect("written");
        let before = std::fs::read(&source).expect("read");
        let transfer = Arc::new(presets::default_for(Some("CT"), [0.0, 1.0]));
        let mut case = Case::default();
        case.volumes.push(Volume::new("ct", Source::path(&source), transfer));
        case.labels.push(LabelSet::new("l", "ct", Some(Source::path(&source))));
        let mut assets = Assets::default();
        let data = Data::Grid(Arc::new(grid));
        let key = Key::of_volume(&case.volumes[0]);
        let name = String::new();
        assets.insert(Arc::new(Asset { key, name, format: "test", modality: None, data, notes: vec![] }));
        let mut brick = vec![3_u16; EDGE * EDGE * EDGE];
        brick[2] = 9;
        case.labels[0].painted = Arc::new([([0; 3], Arc::from(brick))].into());

        let path = folder.path().join("hip.json");
        let mut saved = Saved::default();
        let written = beside(&case, &assets, &path, &mut saved).expect("saved");
        file::save(&written, &path).expect("the case");
        assert_eq!(std::fs::read(&source).expect("read"), before, "a file of that very name is left alone");
        let again = beside(&case, &assets, &path, &mut saved).expect("saved");
        assert_eq!(again.labels[0].source, written.labels[0].source, "the same paint is written once");

        let read = file::load(&path).expect("the case again");
        let mut loaded = Assets::default();
        loaded.load_missing(&read, &Limits::default(), &Silent).expect("loaded");
        let labels = loaded.labels(&read, &read.labels[0]).expect("labels");
        assert_eq!(labels.grid.value(2, 0, 0), 9.0, "what was painted");
        assert_eq!(*labels.counts, [(3, 63), (9, 1)].into(), "and what was there");
    }
}
