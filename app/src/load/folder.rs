//! A folder: its DICOM files together, volumes with numbered names as one series, every other file on its own.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use render::volume::{Grid, Series};

use super::detect::{self, Format};
use super::{Content, Item, Limits, LoadError, Note, Progress, Severity, dicom};

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
    let mut items = numbered(items);
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

/// Volumes whose names differ in a number only, and that lie in one frame, are the steps of one series.
fn numbered(items: Vec<Item>) -> Vec<Item> {
    let mut rest = Vec::new();
    let mut groups: BTreeMap<(String, String), Vec<(u64, Item)>> = BTreeMap::new();
    for item in items {
        match (number_in(&item.name), &item.content) {
            (Some((before, number, after)), Content::Volume(_)) => {
                groups.entry((before, after)).or_default().push((number, item));
            }
            _ => rest.push(item),
        }
    }
    for mut group in groups.into_values() {
        group.sort_by_key(|(number, _)| *number);
        let follows = |(a, b): (&(u64, Item), &(u64, Item))| match (grid_of(&a.1), grid_of(&b.1)) {
            (Some(one), Some(next)) => {
                a.0 < b.0
                    && one.extent() == next.extent()
                    && one.world_from_voxel() == next.world_from_voxel()
                    && one.samples().kind() == next.samples().kind()
            }
            _ => false,
        };
        let is_series = group.len() > 2 && group.iter().zip(group.iter().skip(1)).all(follows);
        if !is_series {
            rest.extend(group.into_iter().map(|(_, item)| item));
            continue;
        }
        let times = group.iter().map(|(number, _)| *number as f64).collect();
        let (mut steps, mut first) = (Vec::new(), None);
        let mut notes = Vec::new();
        for (_, item) in group {
            let Item { name, format, modality, content, notes: its } = item;
            first.get_or_insert((name, format, modality));
            notes.extend(its);
            if let Content::Volume(grid) = content {
                steps.push(Arc::new(grid));
            }
        }
        notes.dedup();
        let text = format!(
            "{} volumes of one frame, whose names differ in a number only, were taken as the steps of one series; \
             the numbers as seconds.",
            steps.len()
        );
        notes.insert(0, Note { severity: Severity::Caution, code: "folder.series", text });
        // Checked above: one frame, and numbers that rise.
        if let (Ok(series), Some((name, format, modality))) = (Series::new(steps, times), first) {
            rest.push(Item { name, format, modality, content: Content::Series(series), notes });
        }
    }
    rest
}

fn grid_of(item: &Item) -> Option<&Grid> {
    match &item.content {
        Content::Volume(grid) => Some(grid),
        _ => None,
    }
}

/// The last number in a name, and what stands before and after it.
fn number_in(name: &str) -> Option<(String, u64, String)> {
    let end = name.rfind(|c: char| c.is_ascii_digit())?.checked_add(1)?;
    let head = name.get(..end)?;
    let start = head.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |i| i.saturating_add(1));
    let start = (start..end).find(|i| head.is_char_boundary(*i))?;
    let number = head.get(start..)?.parse().ok()?;
    Some((head.get(..start)?.to_owned(), number, name.get(end..)?.to_owned()))
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

#[cfg(test)]
mod tests {
    use render::volume::{Affine, Rescale, Samples};

    use super::*;

    fn item(name: &str, sizes: [usize; 3]) -> Item {
        let samples = Samples::U8(vec![0; sizes.iter().product()]);
        let grid = Grid::new(sizes, samples, Rescale::default(), Affine::identity()).expect("a grid");
        let (name, modality, notes) = (name.to_owned(), None, Vec::new());
        Item { name, format: "NRRD", modality, content: Content::Volume(grid), notes }
    }

    #[test]
    fn numbered_volumes_of_one_frame_are_one_series_in_the_order_of_their_numbers() {
        let names = ["beat_10", "beat_2", "beat_1"];
        let mut items: Vec<Item> = names.map(|name| item(name, [2, 1, 1])).into();
        items.push(item("mask", [2, 1, 1]));
        let found = numbered(items);
        let [mask, found] = found.as_slice() else { panic!("a series and the mask, not {found:?}") };
        assert_eq!(mask.name, "mask", "what has no number stays");
        let Content::Series(series) = &found.content else { panic!("a series, not {:?}", found.content) };
        assert_eq!(series.times_secs(), [1.0, 2.0, 10.0], "by number, not by letter");
        assert_eq!(found.notes.first().map(|n| n.code), Some("folder.series"), "and it is said");
    }

    #[test]
    fn two_volumes_or_those_of_different_frames_stay_apart() {
        let two = numbered(vec![item("a1", [2, 1, 1]), item("a2", [2, 1, 1])]);
        assert_eq!(two.len(), 2, "a pair is as likely before and after");
        let odd = numbered(vec![item("a1", [2, 1, 1]), item("a2", [2, 1, 1]), item("a3", [3, 1, 1])]);
        assert_eq!(odd.len(), 3, "another size");
    }

    #[test]
    fn the_last_number_of_a_name_counts() {
        let parts = |name| number_in(name).map(|(a, n, b)| format!("{a}|{n}|{b}"));
        assert_eq!(parts("t2_step007_x"), Some("t2_step|7|_x".to_owned()), "the last");
        assert_eq!(parts("42"), Some("|42|".to_owned()), "nothing else");
        assert_eq!(parts("größe"), None, "none");
        assert_eq!(parts("é9"), Some("é|9|".to_owned()), "after a letter of two bytes");
    }
}
