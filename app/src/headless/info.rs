//! `info`: what is in files, folders, archives and cases.

use std::path::Path;

use ::compress::container::Reader;
use ::render::volume::cells::{CellKind, Field, Place};
use ::render::volume::{Affine, CellGrid, Grid, TriangleMesh};
use serde_json::{Value, json};

use super::{Failure, Terminal, input, say};
use crate::case::assets::AssetError;
use crate::case::{Case, file};
use crate::cli::InfoArgs;
use crate::load::{self, Content, Item, Limits, Note, Severity};
use crate::steps::{self, SeriesFileError};

/// Says what is in each path.
///
/// With `--json`, one document: `{"items": [...]}`, an item being a volume, a series, a surface, a cell
/// grid or a case, each with its path and notes.
///
/// # Errors
/// [`Failure`] of the first path that gives nothing; what was found before it is not printed in JSON.
pub fn run(args: &InfoArgs) -> Result<(), Failure> {
    let mut all = Vec::new();
    for path in &args.paths {
        let items = items(path)?;
        if !args.json {
            say(&format!("{}: {}", path.display(), counted(items.len(), "item")))?;
            for item in &items {
                say(&text(item))?;
            }
        }
        all.extend(items);
    }
    if args.json { say(&json!({ "items": all }).to_string()) } else { Ok(()) }
}

/// What is in one path, an object a thing.
fn items(path: &Path) -> Result<Vec<Value>, Failure> {
    if input::is_case(path) {
        let case = file::load(path).map_err(Failure::Case)?;
        return Ok(vec![case_json(&case, path)]);
    }
    if steps::is_series(path) {
        return Ok(vec![series_json(path)?]);
    }
    let items = load::open(path, &Limits::default(), &Terminal::default())?;
    Ok(items.iter().map(|item| item_json(item, path)).collect())
}

/// A series file: what its header and its end say. No step is read.
fn series_json(path: &Path) -> Result<Value, Failure> {
    let limits = ::compress::Limits { decoded_bytes: Limits::default().decoded_bytes };
    let reader = Reader::open(path, &limits)
        .map_err(|source| AssetError::from(SeriesFileError::Read { source, path: path.to_owned() }))?;
    let (header, figures) = (reader.header(), reader.figures());
    let samples = header.extent.voxels() as f64 * f64::from(reader.steps());
    let bytes = std::fs::metadata(path).map_or(0, |m| m.len());
    let place = Affine::from_row_major(&header.world_from_voxel);
    let place =
        place.map_err(|_singular| AssetError::from(SeriesFileError::Place { path: path.to_owned() }))?;
    let notes: Vec<Value> = if figures.largest_error == Some(0.0) {
        Vec::new()
    } else {
        vec![
            json!({"severity": "caution", "code": "series.lossy", "text": "The steps are lossy: values differ from the original's."}),
        ]
    };
    Ok(json!({
        "kind": "series",
        "path": path.display().to_string(),
        "name": header.name,
        "format": "Osteotome series",
        "modality": Some(&header.kind).filter(|kind| !kind.is_empty()),
        "unit": Some(&header.unit).filter(|unit| !unit.is_empty()),
        "extent": header.extent.sizes(),
        "spacing_mm": place.column_lengths(),
        "orientation": orientation(&place),
        "world_from_voxel": header.world_from_voxel,
        "rescale": {"slope": header.value_scale, "intercept": header.value_offset},
        "steps": reader.steps(),
        "times_secs": reader.times_secs(),
        "codec": header.codec.to_string(),
        "second": header.byte_codec.name(),
        "chunks": reader.chunks(),
        "bytes": bytes,
        "ratio": samples / bytes as f64,
        "largest_error": figures.largest_error,
        "psnr_db": figures.psnr_db.filter(|psnr| psnr.is_finite()),
        "notes": notes,
    }))
}

fn case_json(case: &Case, path: &Path) -> Value {
    let source = |id: &String, source: &crate::case::Source| json!({"id": id, "source": source.to_string()});
    json!({
        "path": path.display().to_string(),
        "kind": "case",
        "format": "Osteotome case",
        "name": case.name,
        "volumes": case.volumes.iter().map(|v| source(&v.id, &v.source)).collect::<Vec<_>>(),
        "cutters": case.cutters.iter().map(|c| c.id.clone()).collect::<Vec<_>>(),
        "fragments": case.fragments.iter().map(|f| f.id.clone()).collect::<Vec<_>>(),
        "implants": case.implants.iter().map(|i| source(&i.id, &i.source)).collect::<Vec<_>>(),
        "grids": case.grids.iter().map(|g| source(&g.id, &g.source)).collect::<Vec<_>>(),
        "notes": [],
    })
}

fn item_json(item: &Item, path: &Path) -> Value {
    let mut value = match &item.content {
        Content::Volume(grid) => grid_json(grid),
        Content::Series(series) => {
            let mut value = series.steps().first().map_or_else(|| json!({}), |g| grid_json(g));
            value["kind"] = json!("series");
            value["steps"] = json!(series.len());
            value["times_secs"] = json!(series.times_secs());
            value["range"] = json!(series.range());
            value
        }
        Content::Mesh(mesh) => mesh_json(mesh),
        Content::Cells(cells) => cells_json(cells),
    };
    value["path"] = json!(path.display().to_string());
    value["name"] = json!(item.name);
    value["format"] = json!(item.format);
    value["modality"] = json!(item.modality);
    value["notes"] = item.notes.iter().map(note_json).collect();
    value
}

fn note_json(note: &Note) -> Value {
    let severity = match note.severity {
        Severity::Fact => "fact",
        Severity::Caution => "caution",
        Severity::Loss => "loss",
    };
    json!({"severity": severity, "code": note.code, "text": note.text})
}

fn grid_json(grid: &Grid) -> Value {
    json!({
        "kind": "volume",
        "extent": grid.extent(),
        "spacing_mm": grid.spacing_mm(),
        "orientation": orientation(grid.world_from_voxel()),
        "world_from_voxel": grid.world_from_voxel().to_row_major(),
        "samples": grid.samples().kind(),
        "range": grid.range(),
        "rescale": {"slope": grid.rescale().slope, "intercept": grid.rescale().intercept},
        "padding": grid.padding(),
        "non_finite": grid.non_finite(),
    })
}

fn mesh_json(mesh: &TriangleMesh) -> Value {
    let [low, high] = mesh.bounds();
    json!({
        "kind": "surface",
        "vertices": mesh.positions().len(),
        "triangles": mesh.triangles().len(),
        "bounds_mm": [low.coords.as_slice(), high.coords.as_slice()],
        "size_mm": (high - low).as_slice(),
    })
}

fn cells_json(cells: &CellGrid) -> Value {
    let [low, high] = cells.bounds();
    let kinds: serde_json::Map<String, Value> = CellKind::ALL
        .iter()
        .filter(|kind| cells.count(**kind) > 0)
        .map(|kind| (kind.name().to_owned(), json!(cells.count(*kind))))
        .collect();
    let fields = |place: Place| -> Vec<Value> {
        let first = cells.steps().first();
        first.map_or_else(Vec::new, |s| s.fields(place).iter().map(|f| field_json(cells, place, f)).collect())
    };
    json!({
        "kind": "cells",
        "points": cells.points().len(),
        "cells": cells.len(),
        "cells_by_kind": kinds,
        "steps": cells.steps().len(),
        "times": cells.steps().iter().map(|s| s.time).collect::<Vec<_>>(),
        "bounds_mm": [low.coords.as_slice(), high.coords.as_slice()],
        "point_fields": fields(Place::Points),
        "cell_fields": fields(Place::Cells),
    })
}

fn field_json(cells: &CellGrid, place: Place, field: &Field) -> Value {
    let range = |component| cells.range(place, field.name(), component);
    let ranges: Vec<Option<[f64; 2]>> = (0..field.components()).map(range).collect();
    json!({"name": field.name(), "components": field.components(), "ranges": ranges})
}

/// Towards where each array axis runs, by its greatest part: `"LPS"`; `"LPS, oblique"` where an axis
/// leaves its world axis by more than half a degree.
fn orientation(world_from_voxel: &Affine) -> String {
    let linear = world_from_voxel.linear();
    let mut letters = String::new();
    let mut oblique = false;
    for column in linear.column_iter() {
        let axis = column.iamax();
        let (towards, away) = [('L', 'R'), ('P', 'A'), ('S', 'I')][axis];
        letters.push(if column[axis] >= 0.0 { towards } else { away });
        oblique |= column[axis].abs() < column.norm() * 0.5_f64.to_radians().cos();
    }
    if oblique {
        letters.push_str(", oblique");
    }
    letters
}

/// An item for people: a line of what it is, and indented lines of its figures and notes.
fn text(item: &Value) -> String {
    let word = |key: &str| item[key].as_str().unwrap_or_default();
    let modality = item["modality"].as_str().map_or_else(String::new, |m| format!(", {m}"));
    let mut lines = vec![format!("  {} \"{}\", {}{modality}", word("kind"), word("name"), word("format"))];
    let said = ["kind", "name", "format", "modality", "path", "notes"];
    let figures = item.as_object().into_iter().flatten().filter(|(key, _)| !said.contains(&key.as_str()));
    for (key, value) in figures {
        let value = match value {
            Value::String(text) => text.clone(),
            Value::Array(list) if list.len() > 16 => format!("{} of them", list.len()),
            other => other.to_string(),
        };
        lines.push(format!("    {key}: {value}"));
    }
    for note in item["notes"].as_array().into_iter().flatten() {
        let part = |key: &str| note[key].as_str().unwrap_or_default();
        lines.push(format!("    {}: {} [{}]", part("severity"), part("text"), part("code")));
    }
    lines.join("\n")
}

fn counted(count: usize, thing: &str) -> String {
    if count == 1 { format!("1 {thing}") } else { format!("{count} {thing}s") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::render::volume::{Point, Rescale, Samples, Vector};

    fn grid(x: [f64; 3], y: [f64; 3], z: [f64; 3]) -> Grid {
        let columns = [x, y, z].map(Vector::from);
        let affine = Affine::from_columns(columns[0], columns[1], columns[2], Point::origin());
        let samples = Samples::I16(vec![-5, 7]);
        Grid::new([2, 1, 1], samples, Rescale::default(), affine.expect("affine")).expect("grid")
    }

    #[test]
    fn the_orientation_is_where_the_axes_run() {
        let of = |x, y, z| orientation(grid(x, y, z).world_from_voxel());
        assert_eq!(of([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]), "LPS", "world's own");
        assert_eq!(of([-1.0, 0.0, 0.0], [0.0, 0.0, -2.0], [0.0, 3.0, 0.0]), "RIP", "turned");
        assert_eq!(of([1.0, 0.1, 0.0], [-0.1, 1.0, 0.0], [0.0, 0.0, 1.0]), "LPS, oblique", "6 degrees");
    }

    #[test]
    fn a_volume_has_its_figures_and_notes_in_both_forms() {
        let item = Item {
            name: "chest".to_owned(),
            format: "NRRD",
            modality: Some("CT".to_owned()),
            content: Content::Volume(grid([0.5, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, 0.0, 2.0])),
            notes: vec![Note { severity: Severity::Caution, code: "nrrd.units", text: "no unit".to_owned() }],
        };
        let value = item_json(&item, Path::new("a.nrrd"));
        assert_eq!(value["extent"], json!([2, 1, 1]), "extent");
        assert_eq!(value["spacing_mm"], json!([0.5, 0.7, 2.0]), "spacing");
        assert_eq!(value["range"], json!([-5.0, 7.0]), "range");
        assert_eq!(value["notes"][0]["code"], "nrrd.units", "note");
        let text = text(&value);
        for part in ["volume \"chest\", NRRD, CT", "range: [-5.0,7.0]", "caution: no unit [nrrd.units]"] {
            assert!(text.contains(part), "{part} is in {text}");
        }
    }
}
