//! `cells --peer`: ours beside another program's renderers of the same grid, from the same view, frame by frame in turn.
//!
//! The peer reads the file itself; the made grid is written for it as VTK's legacy format.

use std::path::Path;
use std::time::{Duration, Instant};

use ::render::cells::{CellRenderer, Early, Options};
use ::render::image::FloatImage;
use ::render::scene::{Camera, CellItem, Projection};
use ::render::volume::cells::{CellGrid, Part, Place};
use serde_json::{Value, json};

use super::super::peer::Peer;
use super::super::{Bench, Row, number, series};
use super::{EARLY, VIEWS, error, known, scenes};
use crate::headless::plot::{Chart, Scale};
use crate::headless::{Failure, write_file};

/// What a peer is asked for.
const PEERS: [&str; 2] = ["rays", "tetrahedra"];
/// Turns that count, unless they take longer than [`ENOUGH`].
const TURNS: usize = 9;
const ENOUGH: Duration = Duration::from_mins(1);
/// One pixel in so many is compared with the reference.
const COMPARED: usize = 29;

/// One way to make the picture, the least time that it took, and its picture.
struct Entry {
    name: String,
    way: Way,
    frame_ms: f64,
    picture: FloatImage,
    /// Tetrahedra scan-converted, in each block that they reach into; unknown of a peer.
    scanned: Option<u64>,
}

enum Way {
    Ours(Options),
    Theirs(Peer),
}

/// Measures one item in the view along it.
pub(super) fn run(
    renderer: &mut CellRenderer,
    item: &CellItem,
    opacity: &str,
    data: Option<&Path>,
    command: &str,
    bench: &mut Bench,
) -> Result<(), Failure> {
    let fault = |e: std::io::Error| Failure::Other(format!("the peer's files cannot be placed ({e})"));
    let folder = tempfile::tempdir().map_err(fault)?;
    let grid = if let Some(path) = data {
        std::path::absolute(path).map_err(fault)?
    } else {
        let path = folder.path().join("made.vtk");
        write_file(&path, &legacy(&item.grid))?;
        path
    };
    for (view, _, size) in VIEWS.into_iter().filter(|(_, along, _)| *along) {
        let camera = scenes::camera(&item.grid, true, size);
        let scene = folder.path().join("scene.json");
        write_file(&scene, scene_of(item, &camera, &grid).to_string().as_bytes())?;
        // To the end of each ray, and with early termination: as the program has it, to less than a step of 8 bits, and as in
        // the paper.
        let step = Early { threshold: 1.0 - 1.0 / 128.0, ..Early::default() };
        let ours = [
            ("exact", None),
            ("to 1/512", Some(Early::default())),
            ("to 1/256", Some(step)),
            ("to 1/20", Some(EARLY)),
        ];
        let ours = ours.into_iter().map(|(name, early)| {
            Entry::new(format!("ours, {name}"), Way::Ours(Options { early, ..Options::default() }), size)
        });
        let mut entries: Vec<Entry> = ours.collect();
        for mapper in PEERS {
            let peer = Peer::start(command, &scene, mapper, None, size)?;
            entries.push(Entry::new(format!("peer {mapper}"), Way::Theirs(peer), size));
        }
        let turns = take_turns(&mut entries, renderer, item, &camera, size)?;
        let truth = known(item, &camera, size, COMPARED)?;
        let exact_ms = entries[0].frame_ms;
        for entry in &entries {
            let apart = entry.picture.difference(&entries[0].picture, [0.0; 3]);
            let apart = apart.map_err(|e| Failure::Other(e.to_string()))?;
            bench.report(json!({
                "bench": "cells beside a peer", "renderer": entry.name, "opacity": opacity, "view": view, "size": size,
                "cells": item.grid.len(), "turns": turns, "frame_ms": entry.frame_ms,
                "times_ours": entry.frame_ms / exact_ms, "scanned": entry.scanned, "max_error_255": error(&entry.picture, &truth),
                "psnr_from_exact_db": apart.psnr_db, "mean_from_exact_255": apart.mean,
                "line": format!("{opacity} {}", size[0]),
            }))?;
        }
    }
    Ok(())
}

impl Entry {
    fn new(name: String, way: Way, [width, height]: [u32; 2]) -> Self {
        Self { name, way, frame_ms: f64::INFINITY, picture: FloatImage::clear(width, height), scanned: None }
    }
}

/// Draws with all in turn; how often each. The first turn makes ready what is kept, and is not counted.
fn take_turns(
    entries: &mut [Entry],
    renderer: &mut CellRenderer,
    item: &CellItem,
    camera: &Camera,
    size: [u32; 2],
) -> Result<usize, Failure> {
    let begin = Instant::now();
    for turn in 0..=TURNS {
        if turn > 1 && begin.elapsed() > ENOUGH {
            return Ok(turn - 1);
        }
        for entry in &mut *entries {
            let took = match &mut entry.way {
                Way::Ours(options) => {
                    let begin = Instant::now();
                    let drawn = renderer.render(item, camera, size, options, &|_, _| true);
                    let took = begin.elapsed().as_secs_f64() * 1e3;
                    let drawn = drawn.map_err(|e| Failure::Other(e.to_string()))?;
                    (entry.scanned, entry.picture) = (Some(drawn.stats.total.scanned), drawn.image);
                    took
                }
                Way::Theirs(peer) => {
                    let took = peer.frame_ms()?;
                    if turn == 0 {
                        entry.picture = peer.picture(size)?;
                    }
                    took
                }
            };
            if turn > 0 {
                entry.frame_ms = entry.frame_ms.min(took);
            }
        }
    }
    Ok(TURNS)
}

/// Time against error.
pub(super) fn chart(rows: &[Row]) -> Chart {
    Chart {
        title: "Unstructured grids: a frame's time against its largest error".to_owned(),
        x: "frame, ms".to_owned(),
        y: "largest error, 1/255".to_owned(),
        y_scale: Scale::Log,
        joined: false,
        series: series(rows, "renderer", &|row| {
            let label = row.get("line").and_then(Value::as_str).unwrap_or_default();
            (number(row, "frame_ms"), number(row, "max_error_255"), label.to_owned())
        }),
    }
}

/// What is drawn, as a peer reads it.
fn scene_of(item: &CellItem, camera: &Camera, grid: &Path) -> Value {
    let list = |v: [f64; 3]| json!(v);
    let mut view = json!({
        "eye": list(camera.eye.coords.into()), "target": list(camera.target.coords.into()), "up": list(camera.up.into()),
    });
    match camera.projection {
        Projection::Parallel { height_mm } => view["parallel_mm"] = json!(height_mm),
        Projection::Perspective { fov_rad } => view["fov_deg"] = json!(fov_rad.to_degrees()),
    }
    let points: Vec<Value> = item
        .transfer
        .points()
        .iter()
        .map(|p| json!([p.value, p.rgba[0], p.rgba[1], p.rgba[2], p.rgba[3]]))
        .collect();
    let place = match item.scalar.place {
        Place::Points => "points",
        Place::Cells => "cells",
    };
    let component = match item.scalar.part {
        Part::Component(component) => json!(component),
        Part::Magnitude => Value::Null,
    };
    json!({
        "grid": grid, "place": place, "field": item.scalar.name, "component": component, "camera": view,
        "transfer": { "unit_mm": item.transfer.unit_mm(), "points": points },
    })
}

/// A grid of tetrahedra with its points' fields, as a file of VTK's legacy format, which is big endian.
fn legacy(grid: &CellGrid) -> Vec<u8> {
    let mut file = b"# vtk DataFile Version 3.0\nmade\nBINARY\nDATASET UNSTRUCTURED_GRID\n".to_vec();
    let title = |file: &mut Vec<u8>, line: String| {
        file.push(b'\n');
        file.extend(line.bytes());
        file.push(b'\n');
    };
    title(&mut file, format!("POINTS {} double", grid.points().len()));
    file.extend(grid.points().iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(f64::to_be_bytes));
    title(&mut file, format!("CELLS {} {}", grid.len(), 5 * grid.len()));
    for cell in 0..grid.len() {
        let (_, corners) = grid.cell(cell);
        file.extend([corners.len() as u32].iter().chain(corners).flat_map(|n| n.to_be_bytes()));
    }
    title(&mut file, format!("CELL_TYPES {}", grid.len()));
    file.extend((0..grid.len()).flat_map(|_| TETRA.to_be_bytes()));
    title(&mut file, format!("POINT_DATA {}", grid.points().len()));
    for field in grid.steps().iter().take(1).flat_map(|step| step.fields(Place::Points)) {
        title(&mut file, format!("SCALARS {} double\nLOOKUP_TABLE default", field.name()));
        file.extend((0..grid.points().len()).flat_map(|i| field.value(i, 0).to_be_bytes()));
    }
    file
}

/// VTK's number of the tetrahedron.
const TETRA: u32 = 10;
