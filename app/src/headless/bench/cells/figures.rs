//! Takayama's figures 10 to 13, on the dense scene: what a worker does, and how the table's size and refreshing matter.
//!
//! Workers have clocks of their own. What the paper shows of lists without partial composition has no counterpart: ours are
//! always merged.

use ::render::cells::{CellPicture, CellRenderer, Counts, Early, Engine, Options, Spread};
use ::render::scene::{Camera, CellItem, Projection};
use ::render::volume::Vector;
use serde_json::json;

use super::super::{Bench, Row, number, series};
use super::{TURNS, VIEWS, scenes};
use crate::headless::Failure;
use crate::headless::plot::{Chart, Scale};

/// Workers of figures 10 and 13.
const WORKERS: usize = 8;
/// Subscreens across the picture, of figure 11.
const SUBSCREENS: [u32; 8] = [2, 5, 10, 20, 40, 75, 150, 300];
/// Refreshes of the table, of figure 12.
const REFRESHES: [u32; 6] = [1, 10, 100, 1_000, 10_000, 100_000];

/// Measures the dense item.
pub(super) fn run(renderer: &mut CellRenderer, item: &CellItem, bench: &mut Bench) -> Result<(), Failure> {
    for (view, along, size) in VIEWS.into_iter().filter(|(.., size)| size[1] == 300) {
        let camera = scenes::camera(&item.grid, along, size);
        workers(renderer, item, &camera, size, view, bench)?;
        if along {
            tables(renderer, item, &camera, size, bench)?;
            sizes(item, &camera, size, bench)?;
        }
    }
    Ok(())
}

fn draw(
    renderer: &mut CellRenderer,
    item: &CellItem,
    camera: &Camera,
    size: [u32; 2],
    options: &Options,
) -> Result<CellPicture, Failure> {
    let drawn = renderer.render(item, camera, size, options, &|_, _| true);
    drawn.map_err(|e| Failure::Other(e.to_string()))
}

/// Figures 10 and 13: the work of each of eight workers, none of which takes from another.
fn workers(
    renderer: &mut CellRenderer,
    item: &CellItem,
    camera: &Camera,
    size: [u32; 2],
    view: &str,
    bench: &mut Bench,
) -> Result<(), Failure> {
    let early = Some(Early::TAKAYAMA);
    for (level, early, share) in [("base", None, false), ("ERT", early, false), ("ERT+share", early, true)] {
        let (workers, engine, spread) = (Some(WORKERS), Engine::Simulated, Spread::Blocks);
        let options = Options { early, share, workers, engine, spread, balance: false, ..Options::default() };
        let picture = draw(renderer, item, camera, size, &options)?;
        for (worker, counts) in (1..).zip(&picture.stats.workers) {
            bench.report(json!({
                "bench": "cells", "figure": "10, 13", "line": format!("{view} {level}"), "at": worker,
                "value": Counts::work(counts),
            }))?;
        }
    }
    Ok(())
}

/// Figures 11 and 12: cells scan-converted and time by one worker, as shares of those without termination.
fn tables(
    renderer: &mut CellRenderer,
    item: &CellItem,
    camera: &Camera,
    size: [u32; 2],
    bench: &mut Bench,
) -> Result<(), Failure> {
    let by_size =
        SUBSCREENS.map(|n| ("11", n, Some(Early { subscreens: Some(n), refreshes: 10, ..Early::TAKAYAMA })));
    let by_refreshes = REFRESHES.map(|n| ("12", n, Some(Early { refreshes: n, ..Early::TAKAYAMA })));
    let mut all = vec![("", 0, None)];
    all.extend(by_size);
    all.extend(by_refreshes);
    let mut least = vec![(f64::INFINITY, 0.0); all.len()];
    for turn in 0..=TURNS {
        for ((_, _, early), (least, scanned)) in all.iter().zip(&mut least) {
            let (workers, engine) = (Some(1), Engine::Threads);
            let options = Options { early: *early, workers, engine, ..Options::default() };
            let stats = draw(renderer, item, camera, size, &options)?.stats;
            if turn > 0 {
                *least = least.min(stats.frame_ms);
            }
            *scanned = stats.total.scanned as f64;
        }
    }
    let (base_ms, base_scanned) = least[0];
    for ((figure, at, _), (ms, scanned)) in all.iter().zip(&least).skip(1) {
        for (line, value) in [("cells scan-converted", scanned / base_scanned), ("time", ms / base_ms)] {
            bench.report(json!({
                "bench": "cells", "figure": figure, "line": line, "at": at, "value": value,
            }))?;
        }
    }
    Ok(())
}

/// Figure 11 (3): how many cells are how large in the picture; pixels, the longer of width and height.
fn sizes(item: &CellItem, camera: &Camera, size: [u32; 2], bench: &mut Bench) -> Result<(), Failure> {
    let Projection::Parallel { height_mm } = camera.projection else { return Ok(()) };
    let frame = camera.frame().map_err(|e| Failure::Other(e.to_string()))?;
    let mut counts = Vec::new();
    for cell in 0..item.grid.len() {
        let (_, corners) = item.grid.cell(cell);
        let extent = |axis: &Vector| {
            let along = corners.iter().map(|&n| item.grid.points()[n as usize].coords.dot(axis));
            let (low, high) =
                along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            high - low
        };
        let pixels = extent(&frame.right).max(extent(&frame.up)) * f64::from(size[1]) / height_mm;
        let pixels = pixels.ceil().max(1.0) as usize;
        if counts.len() < pixels {
            counts.resize(pixels, 0_u64);
        }
        counts[pixels - 1] += 1;
    }
    for (pixels, &count) in (1..).zip(&counts).filter(|(_, count)| **count > 0) {
        bench.report(json!({
            "bench": "cells", "figure": "11 (3)", "line": "cells", "at": pixels, "value": count,
        }))?;
    }
    Ok(())
}

/// One for each figure that is measured.
pub(super) fn charts(rows: &[Row]) -> Vec<(&'static str, Chart)> {
    let chart = |figure: &str, title: &str, x: &str, y: &str, joined: bool| {
        let rows: Vec<Row> =
            rows.iter().filter(|row| row.get("figure").is_some_and(|f| f == figure)).cloned().collect();
        let point = |row: &Row| (number(row, "at"), number(row, "value"), String::new());
        Chart {
            title: title.to_owned(),
            x: x.to_owned(),
            y: y.to_owned(),
            y_scale: Scale::Linear,
            joined,
            series: series(&rows, "line", &point),
        }
    };
    let share = "share of that without termination";
    vec![
        (
            "cells_workers.svg",
            chart(
                "10, 13",
                "Work of each of 8 workers, none helped",
                "worker",
                "segments, and 4 a cell",
                true,
            ),
        ),
        (
            "cells_subscreens.svg",
            chart(
                "11",
                "Early termination by the size of its table",
                "subscreens across the picture",
                share,
                true,
            ),
        ),
        (
            "cells_sizes.svg",
            chart("11 (3)", "Cells by their size in the picture", "pixels, the longer side", "cells", true),
        ),
        (
            "cells_refreshes.svg",
            chart("12", "Early termination by how often its table is refreshed", "refreshes", share, true),
        ),
    ]
}
