//! `cells`: what early ray termination, sharing and balancing save in drawing an unstructured grid, for 1 to 8 workers.
//!
//! Source: Takayama, tables 1 and 2: each of the six levels there, and two as the program spreads cells, of a view along the
//! grid's longest side in 300×300 pixels, and of one across it in 900×300. Times are of threads, work is of workers with clocks
//! of their own, since a machine may have fewer cores than workers.

mod beside;
mod figures;
mod scenes;

use std::path::Path;
use std::sync::Arc;

use ::render::cells::{CellRenderer, Counts, Early, Engine, Options, Spread};
use ::render::image::FloatImage;
use ::render::reference;
use ::render::scene::{Camera, CellItem, Scene};
use ::render::volume::Affine;
use serde_json::json;

use super::{Bench, Row, number, series};
use crate::headless::Failure;
use crate::headless::plot::{Chart, Scale};

/// Turns that count.
const TURNS: usize = 3;
/// Workers.
const WORKERS: [usize; 4] = [1, 2, 4, 8];
/// One pixel in so many is compared with the reference.
const COMPARED: usize = 97;

/// Cubes across the made grid: 305,046 tetrahedra.
const MADE: usize = 41;

/// Whether the transfer function is the dense one.
const OPACITIES: [(&str, bool); 2] = [("thin", false), ("dense", true)];

/// Names, whether along the longest side, and pixels.
const VIEWS: [(&str, bool, [u32; 2]); 3] =
    [("A", false, [900, 300]), ("B", true, [300, 300]), ("B", true, [512, 512])];

/// Early termination as in the paper, but for subscreens as large as cells are in the picture.
const EARLY: Early = Early { subscreens: None, ..Early::TAKAYAMA };

/// Takayama's levels, of workers with a part of the grid each, and two of them of workers with a band of the picture each, as
/// the program spreads cells: name, early termination, sharing, balancing, spread.
const LEVELS: [(&str, Option<Early>, bool, bool, Spread); 8] = [
    ("base", None, false, false, Spread::Blocks),
    ("DLB", None, false, true, Spread::Blocks),
    ("ERT", Some(EARLY), false, false, Spread::Blocks),
    ("ERT+share", Some(EARLY), true, false, Spread::Blocks),
    ("ERT+DLB", Some(EARLY), false, true, Spread::Blocks),
    ("ERT+DLB+share", Some(EARLY), true, true, Spread::Blocks),
    ("DLB, bands", None, false, true, Spread::Columns),
    ("ERT+DLB+share, bands", Some(EARLY), true, true, Spread::Columns),
];

/// Measures on the first grid of a file, or on a made one; beside a peer where one is given.
pub(super) fn run(data: Option<&Path>, peer: Option<&str>, bench: &mut Bench) -> Result<(), Failure> {
    let grid = data.map_or_else(|| scenes::ball(MADE), scenes::read)?;
    let scalar = grid.first_scalar();
    let scalar =
        scalar.ok_or_else(|| Failure::Unfit("the grid has no field; choose another file".to_owned()))?;
    let range = scalar.range(&grid).unwrap_or([0.0, 1.0]);
    let mut renderer = CellRenderer::new();
    for (opacity, dense) in OPACITIES {
        let transfer = Arc::new(scenes::transfer(range, dense)?);
        let (grid, scalar, pose) = (Arc::clone(&grid), scalar.clone(), Affine::identity());
        let item = CellItem { grid, step: 0, scalar, pose, transfer };
        if let Some(command) = peer {
            beside::run(&mut renderer, &item, opacity, data, command, bench)?;
            continue;
        }
        for (view, along, size) in VIEWS {
            let camera = scenes::camera(&item.grid, along, size);
            levels(&mut renderer, &item, &camera, size, [opacity, view], bench)?;
        }
        if dense {
            figures::run(&mut renderer, &item, bench)?;
        }
    }
    Ok(())
}

fn levels(
    renderer: &mut CellRenderer,
    item: &CellItem,
    camera: &Camera,
    size: [u32; 2],
    [opacity, view]: [&str; 2],
    bench: &mut Bench,
) -> Result<(), Failure> {
    let mut draw = |options: &Options| {
        let drawn = renderer.render(item, camera, size, options, &|_, _| true);
        drawn.map_err(|e| Failure::Other(e.to_string()))
    };
    let truth = known(item, camera, size, COMPARED)?;
    for workers in WORKERS {
        let options = LEVELS.map(|(_, early, share, balance, spread)| {
            let (workers, engine) = (Some(workers), Engine::Threads);
            Options { early, share, balance, workers, engine, spread, ..Options::default() }
        });
        let mut least = [f64::INFINITY; LEVELS.len()];
        for turn in 0..=TURNS {
            for (least, options) in least.iter_mut().zip(&options) {
                let took = draw(options)?.stats.frame_ms;
                if turn > 0 {
                    *least = least.min(took);
                }
            }
        }
        let base = draw(&options[0])?;
        for (((level, ..), options), least) in LEVELS.iter().zip(options).zip(least) {
            let picture = draw(&Options { engine: Engine::Simulated, ..options })?;
            let apart = picture.image.difference(&base.image, [0.0; 3]);
            let apart = apart.map_err(|e| Failure::Other(e.to_string()))?.max;
            let is_base = options.early.is_none() && workers == 1;
            let stats = &picture.stats;
            let work = stats.workers.iter().map(Counts::work).max().unwrap_or(0);
            bench.report(json!({
                "bench": "cells", "figure": "tables", "opacity": opacity, "view": view, "size": size, "level": level, "workers": workers,
                "tetrahedra": stats.tetrahedra, "threads_ms": least, "largest_work": work,
                "imbalance": stats.imbalance(), "scanned": stats.total.scanned, "hidden": stats.total.hidden,
                "clear": stats.total.clear, "outside": stats.total.outside, "segments": stats.total.segments,
                "bytes_sent": stats.total.bytes, "taken": stats.total.taken, "apart_from_base_255": apart,
                "max_error_255": is_base.then(|| error(&picture.image, &truth)),
                "line": format!("{level}, {opacity} {view} {}", size[0]),
            }))?;
        }
    }
    Ok(())
}

/// What was measured, beside a peer or of ours alone.
pub(super) fn charts(rows: &[Row], peer: bool) -> Vec<(&'static str, Chart)> {
    if peer {
        return vec![("cells_peer.svg", beside::chart(rows))];
    }
    // Of the dense scene along the grid, where termination has most to do.
    let shown = |row: &&Row| {
        [("figure", "tables"), ("opacity", "dense"), ("view", "B")]
            .iter()
            .all(|&(key, value)| row.get(key).is_some_and(|v| v == value))
    };
    let shown: Vec<Row> = rows.iter().filter(shown).cloned().collect();
    let work = Chart {
        title: "Cells: the busiest worker's work".to_owned(),
        x: "workers".to_owned(),
        y: "segments, and 4 a cell".to_owned(),
        y_scale: Scale::Log,
        joined: true,
        series: series(&shown, "line", &|row| {
            (number(row, "workers"), number(row, "largest_work"), String::new())
        }),
    };
    let mut charts = vec![("cells.svg", work)];
    charts.extend(figures::charts(rows));
    charts
}

/// Some pixels as the reference has them: one in so many.
fn known(
    item: &CellItem,
    camera: &Camera,
    size: [u32; 2],
    every: usize,
) -> Result<Vec<(usize, [f64; 4])>, Failure> {
    let indices = (0..(size[0] * size[1]) as usize).step_by(every);
    let pixels: Vec<(u32, u32)> = indices.clone().map(|i| (i as u32 % size[0], i as u32 / size[0])).collect();
    let (volumes, meshes, grids) = (Vec::new(), Vec::new(), vec![item.clone()]);
    let scene = Scene { volumes, meshes, grids, camera: *camera, background: [0.0; 3] };
    let known = reference::draw_pixels(&scene, size, &reference::Options::default(), &pixels)?;
    Ok(indices.zip(known).collect())
}

/// The largest difference of a picture from pixels of the reference; 1/255.
fn error(picture: &FloatImage, known: &[(usize, [f64; 4])]) -> f64 {
    let apart = known.iter().flat_map(|&(pixel, known)| {
        let found = picture.pixels[pixel];
        [0, 1, 2, 3].map(|c| (f64::from(found[c]) - known[c]).abs() * 255.0)
    });
    apart.fold(0.0, f64::max)
}
