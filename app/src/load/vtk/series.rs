//! Files that name others: the pieces of a parallel data set, the steps of a collection.

use std::path::{Component, Path};

use super::super::bytes::{self, Fault};
use super::super::{Item, Limits, Note, Progress, Severity};
use super::dataset::{Array, Dataset};
use super::{FORMAT, Parsed, parse};

/// The file that `from` names, which must lie in its folder or below.
fn beside(from: &Path, name: &str, limits: &Limits) -> Result<Parsed, Fault> {
    let relative = Path::new(name);
    if relative.components().any(|part| !matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Err(Fault::Unsupported(
            "a file outside its own folder".to_owned(),
            "put the files it names beside it and name them so",
        ));
    }
    let path = from.parent().unwrap_or(Path::new(".")).join(relative);
    let file = bytes::whole(&path, FORMAT, limits)?;
    parse(&file, limits).map_err(|fault| fault.at(FORMAT, &path, limits).into())
}

/// All pieces as one data set.
pub(super) fn pieces(from: &Path, sources: &[String], limits: &Limits) -> Result<Dataset, Fault> {
    few(sources.len(), limits)?;
    let mut all = Dataset::empty();
    for source in sources {
        match beside(from, source, limits)? {
            Parsed::Dataset(piece) => all.append(piece),
            _ => return Err("one of its pieces is a list of files itself".into()),
        }
        bytes::afford(all.connectivity.len() as u64, 24, limits)?;
        bytes::afford(all.points.len() as u64, 24, limits)?;
    }
    if sources.len() > 1 {
        all.notes.push(Note {
            severity: Severity::Fact,
            code: "vtk.pieces",
            text: format!("{} pieces were put together; points on their borders are double.", sources.len()),
        });
    }
    Ok(all)
}

/// All steps of a collection as one item.
pub(super) fn steps(
    from: &Path,
    entries: &[(f64, String)],
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<Item, Fault> {
    few(entries.len(), limits)?;
    let mut entries = entries.to_vec();
    entries.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut first: Option<(f64, Dataset)> = None;
    let mut later: Vec<(f64, Vec<Array>, Vec<Array>)> = Vec::new();
    let mut numbers = 0_u64;
    // Entries of the same time are parts of one data set.
    for (done, parts) in entries.chunk_by(|(a, _), (b, _)| a == b).enumerate() {
        bytes::step(progress, "reading steps", done, entries.len())?;
        let mut dataset = Dataset::empty();
        for (_, source) in parts {
            dataset.append(match beside(from, source, limits)? {
                Parsed::Dataset(part) => part,
                Parsed::Pieces(sources) => pieces(&from.with_file_name(source), &sources, limits)?,
                Parsed::Steps(_) => return Err("one of its steps is a collection itself".into()),
            });
        }
        let own =
            dataset.point_arrays.iter().chain(&dataset.cell_arrays).map(|array| array.values.len() as u64);
        numbers = numbers.saturating_add(own.sum());
        bytes::afford(numbers, 8, limits)?;
        let time = parts.first().map_or(0.0, |(time, _)| *time);
        match &mut first {
            None => first = Some((time, dataset)),
            Some((_, geometry)) if geometry.same_geometry(&dataset) => {
                geometry.tell(dataset.notes);
                later.push((time, dataset.point_arrays, dataset.cell_arrays));
            }
            Some(_) => {
                return Err(Fault::Unsupported(
                    "points or cells that change over time".to_owned(),
                    "open its files one by one",
                ));
            }
        }
    }
    let (time, dataset) = first.ok_or("it names no file")?;
    dataset.into_item_over_time(bytes::file_name(from), time, later, limits)
}

fn few(count: usize, limits: &Limits) -> Result<(), Fault> {
    if count > limits.files {
        return Err(format!("it names {count} files, more than the {} looked at", limits.files).into());
    }
    Ok(())
}
