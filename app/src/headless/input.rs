//! What a job works on: a case with its data, from a case file, or made of a data file or folder.

use std::path::Path;

use super::{Failure, Terminal};
use crate::case::assets;
use crate::case::{Assets, Case, Source, Volume, edit, file};
use crate::load::Limits;
use crate::{added, sample, scene};

/// A case whose visible data are loaded.
#[derive(Debug)]
pub struct Input {
    /// The plan.
    pub case: Case,
    /// Its data.
    pub assets: Assets,
}

/// Whether a path is to be read as a case: by its content, or by its name where the content is broken.
pub fn is_case(path: &Path) -> bool {
    let json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    !path.is_dir() && (json || file::looks_like_case(path))
}

/// The case in a file with its data; or the data of a file, folder or archive as a case of their own.
///
/// # Errors
/// [`Failure`]: a case or data that cannot be used, or nothing in them that can be drawn.
pub fn open(path: &Path) -> Result<Input, Failure> {
    if is_case(path) {
        let case = file::load(path).map_err(Failure::Case)?;
        return load(case);
    }
    let input = of_source(&Source::path(path))?;
    let Case { volumes, implants, grids, .. } = &input.case;
    if volumes.is_empty() && implants.is_empty() && grids.is_empty() {
        let fault = "the data hold no volume, no surface and no unstructured grid; choose a file that does";
        return Err(Failure::Unfit(format!("{fault}: {}", path.display())));
    }
    Ok(input)
}

/// The data of a source as a case of their own.
///
/// # Errors
/// [`Failure`]: data that cannot be used.
pub fn of_source(source: &Source) -> Result<Input, Failure> {
    let found = assets::open(source, &Limits::default(), &Terminal::default())?;
    let mut assets = Assets::default();
    let mut case = Case { name: source.short_name(), ..Case::default() };
    for asset in found {
        let edit = added::edit(&case, &asset);
        edit::apply(&mut case, edit).map_err(|e| Failure::Other(e.to_string()))?;
        assets.insert(asset);
    }
    // Several series of one folder lie over each other: the largest is shown.
    let size = |v: &Volume| assets.grid(v).map_or(0, |g| g.samples().len());
    let mut largest: Option<usize> = None;
    for (i, volume) in case.volumes.iter().enumerate() {
        if largest.is_none_or(|best| size(volume) > size(&case.volumes[best])) {
            largest = Some(i);
        }
    }
    for (i, volume) in case.volumes.iter_mut().enumerate() {
        volume.visible = Some(i) == largest;
    }
    check(&case, &assets)?;
    Ok(Input { case, assets })
}

/// A step that cannot be read, or a field that is not there, would be left out of the picture: that is no picture of the case.
fn check(case: &Case, assets: &Assets) -> Result<(), Failure> {
    for volume in case.volumes.iter().filter(|v| v.visible) {
        if let Some(steps) = assets.steps(volume)
            && assets.grid(volume).is_none()
        {
            let fault = steps.fault().unwrap_or_else(|| "a step cannot be read".to_owned());
            return Err(Failure::Unfit(format!("step {} of \"{}\": {fault}", volume.step, volume.id)));
        }
    }
    for grid in case.grids.iter().filter(|g| g.visible) {
        if let Some(fault) = scene::grid_fault(grid, assets) {
            return Err(Failure::Unfit(fault));
        }
    }
    Ok(())
}

/// The built-in sample case.
///
/// # Errors
/// [`Failure::Sample`].
pub fn builtin() -> Result<Input, Failure> {
    load(sample::case())
}

fn load(case: Case) -> Result<Input, Failure> {
    let mut assets = Assets::default();
    assets.load_missing(&case, &Limits::default(), &Terminal::default())?;
    check(&case, &assets)?;
    Ok(Input { case, assets })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::presets;
    use crate::save;
    use ::render::volume::{Affine, Grid, Rescale, Samples};

    fn nrrd(folder: &Path, name: &str, samples: Vec<i16>) {
        let extent = [samples.len(), 1, 1];
        let grid = Grid::new(extent, Samples::I16(samples), Rescale::default(), Affine::identity());
        let bytes = save::nrrd::nrrd(&grid.expect("grid")).expect("written");
        std::fs::write(folder.join(name), bytes).expect("saved");
    }

    #[test]
    fn a_data_file_becomes_a_case_of_its_own() {
        let folder = tempfile::tempdir().expect("folder");
        nrrd(folder.path(), "hip.nrrd", vec![-1000, 0, 900]);
        let input = open(&folder.path().join("hip.nrrd")).expect("a case");
        assert_eq!(input.case.volumes[0].id, "hip", "named by its file");
        assert!(input.assets.grid(&input.case.volumes[0]).is_some(), "loaded");
        let ct = presets::default_for(Some("CT"), [-1000.0, 900.0]);
        assert_eq!(*input.case.volumes[0].transfer, ct, "it has air, so it is CT");
    }

    #[test]
    fn of_several_volumes_the_largest_is_shown() {
        let folder = tempfile::tempdir().expect("folder");
        nrrd(folder.path(), "a.nrrd", vec![0, 1]);
        nrrd(folder.path(), "b.nrrd", vec![0, 1, 2, 3]);
        nrrd(folder.path(), "c.nrrd", vec![0, 1, 2]);
        let case = open(folder.path()).expect("a case").case;
        let visible: Vec<bool> = case.volumes.iter().map(|v| v.visible).collect();
        assert_eq!((visible.len(), visible.iter().filter(|v| **v).count()), (3, 1), "one of three");
        assert_eq!(case.volumes.iter().find(|v| v.visible).map(|v| v.item), Some(1), "the largest");
    }

    #[test]
    fn a_missing_source_of_a_case_is_unusable_input() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("case.json");
        let text = r#"{"osteotome": 1, "volumes": [{"id": "a", "source": "gone.nrrd",
            "transfer": {"points": [[0, 0, 0, 0, 0]]}}]}"#;
        std::fs::write(&path, text).expect("saved");
        let failure = open(&path).expect_err("there is no gone.nrrd");
        assert_eq!(failure.exit_code(), 3, "{failure}");
        assert!(failure.to_string().contains("gone.nrrd"), "{failure}");
    }
}
