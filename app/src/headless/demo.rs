//! `demo`: the built-in sample case as files, for trying and for other programs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{Failure, say, write_file};
use crate::case::assets::{self, Data, Key};
use crate::case::{Source, file};
use crate::load::{Limits, Silent};
use crate::save::series::{self, SeriesOptions};
use crate::{sample, save};

/// Writes `case.json` with its data beside it into a folder, which is made if it is not there.
///
/// # Errors
/// [`Failure`].
pub fn run(args: &crate::cli::DemoArgs) -> Result<(), Failure> {
    let folder = &args.folder;
    std::fs::create_dir_all(folder).map_err(|source| Failure::Output { path: folder.clone(), source })?;
    let mut case = sample::case();
    let mut written: BTreeMap<Key, Source> = BTreeMap::new();
    let mut move_out = |key: Key| -> Result<Source, Failure> {
        if let Some(done) = written.get(&key) {
            return Ok(done.clone());
        }
        let path = write(&key, folder)?;
        say(&path.display().to_string())?;
        let source = Source::path(&path);
        written.insert(key, source.clone());
        Ok(source)
    };
    for volume in &mut case.volumes {
        volume.source = move_out(Key::of_volume(volume))?;
        volume.item = 0;
    }
    for implant in &mut case.implants {
        implant.source = move_out(Key::of_implant(implant))?;
        implant.item = 0;
    }
    let path = folder.join("case.json");
    file::save(&case, &path).map_err(Failure::Save)?;
    say(&path.display().to_string())
}

/// One source as a file of its kind, named as the source is.
fn write(key: &Key, folder: &Path) -> Result<PathBuf, Failure> {
    let name = key.source.short_name();
    let loaded = assets::load_keys(std::slice::from_ref(key), &Limits::default(), &Silent)?;
    let Some(asset) = loaded.first() else {
        return Err(Failure::Other(format!("the built-in {name} gave nothing; please report this")));
    };
    let (path, bytes) = match &asset.data {
        Data::Grid(grid) => {
            let path = folder.join(format!("{name}.nrrd"));
            let bytes =
                save::nrrd::nrrd(grid).map_err(|source| Failure::Output { path: path.clone(), source })?;
            (path, bytes)
        }
        Data::Mesh(mesh) => (folder.join(format!("{name}.stl")), save::stl::stl(mesh)),
        Data::Steps(steps) => {
            let path = folder.join(format!("{name}.series"));
            series::write(&path, steps, &name, "", SeriesOptions::default(), &Silent)?;
            return Ok(path);
        }
        Data::Cells(_) => {
            return Err(Failure::Other(format!(
                "the built-in {name} is an unstructured grid; please report this"
            )));
        }
    };
    write_file(&path, &bytes)?;
    Ok(path)
}
