//! `cells`: what early ray termination, sharing and balancing save in drawing an unstructured grid, for 1 to 8 workers.
//!
//! Source: Takayama, tables 1 and 2: each of the six levels there, of a view along the grid's longest side in 300×300 pixels,
//! and of one across it in 900×300. Times are of threads, work is of workers with clocks of their own, since a machine may
//! have fewer cores than workers.

use std::path::Path;
use std::sync::Arc;

use ::render::cells::{Breaks, CellPicture, CellRenderer, Counts, Early, Engine, Options, Spread};
use ::render::reference;
use ::render::scene::{Camera, CellItem, Projection, Scene};
use ::render::volume::cells::{CellGrid, CellKind, Field, Step, Values};
use ::render::volume::{Affine, ControlPoint, Point, Transfer, Vector};
use serde_json::json;

use super::{Bench, Row, number, series};
use crate::headless::plot::{Chart, Scale};
use crate::headless::{Failure, Terminal};
use crate::load::{self, Content, Limits};

/// Turns that count.
const TURNS: usize = 3;
/// Workers.
const WORKERS: [usize; 4] = [1, 2, 4, 8];
/// One pixel in so many is compared with the reference.
const COMPARED: usize = 97;

/// Early termination as in the paper, but for subscreens as large as cells are in the picture.
const EARLY: Early = Early { subscreens: None, ..Early::TAKAYAMA };

/// Takayama's levels: name, early termination, sharing, balancing.
const LEVELS: [(&str, Option<Early>, bool, bool); 6] = [
    ("base", None, false, false),
    ("DLB", None, false, true),
    ("ERT", Some(EARLY), false, false),
    ("ERT+share", Some(EARLY), true, false),
    ("ERT+DLB", Some(EARLY), false, true),
    ("ERT+DLB+share", Some(EARLY), true, true),
];

/// Measures on the first grid of a file, or on a made one.
pub(super) fn run(data: Option<&Path>, bench: &mut Bench) -> Result<(), Failure> {
    let grid = match data {
        Some(path) => read(path)?,
        None => ball(41)?,
    };
    let scalar = grid.first_scalar();
    let scalar =
        scalar.ok_or_else(|| Failure::Unfit("the grid has no field; choose another file".to_owned()))?;
    let range = scalar.range(&grid).unwrap_or([0.0, 1.0]);
    let mut renderer = CellRenderer::new();
    for (opacity, dense) in [("thin", false), ("dense", true)] {
        let item = CellItem {
            grid: Arc::clone(&grid),
            step: 0,
            scalar: scalar.clone(),
            pose: Affine::identity(),
            transfer: Arc::new(transfer(range, dense)?),
        };
        for (view, along, size) in
            [("A", false, [900, 300]), ("B", true, [300, 300]), ("B", true, [512, 512])]
        {
            let camera = camera(&grid, along, size);
            levels(&mut renderer, &item, &camera, size, [opacity, view], bench)?;
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
        let drawn = renderer.render(item, camera, size, options, Breaks::default(), &|_, _| true);
        drawn.map_err(|e| Failure::Other(e.to_string()))
    };
    for workers in WORKERS {
        let options = LEVELS.map(|(_, early, share, balance)| {
            let workers = Some(workers);
            Options { early, share, balance, workers, spread: Spread::Blocks, ..Options::default() }
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
                "bench": "cells", "opacity": opacity, "view": view, "size": size, "level": level, "workers": workers,
                "tetrahedra": stats.tetrahedra, "threads_ms": least, "largest_work": work,
                "imbalance": stats.imbalance(), "scanned": stats.total.scanned, "hidden": stats.total.hidden,
                "clear": stats.total.clear, "outside": stats.total.outside, "segments": stats.total.segments,
                "bytes_sent": stats.total.bytes, "taken": stats.total.taken, "apart_from_base_255": apart,
                "max_error_255": is_base.then(|| error(item, camera, &picture)).transpose()?,
                "line": format!("{level}, {opacity} {view} {}", size[0]),
            }))?;
        }
    }
    Ok(())
}

/// Largest work of a worker against how many there are.
pub(super) fn chart(rows: &[Row]) -> Chart {
    Chart {
        title: "Cells: the busiest worker's work".to_owned(),
        x: "workers".to_owned(),
        y: "segments, and 4 a cell".to_owned(),
        y_scale: Scale::Log,
        joined: true,
        series: series(rows, "line", &|row| {
            (number(row, "workers"), number(row, "largest_work"), String::new())
        }),
    }
}

/// The largest error of some pixels against the reference; 1/255.
fn error(item: &CellItem, camera: &Camera, picture: &CellPicture) -> Result<f64, Failure> {
    let size = [picture.image.width, picture.image.height];
    let pixels: Vec<(u32, u32)> =
        (0..size[0] * size[1]).step_by(COMPARED).map(|i| (i % size[0], i / size[0])).collect();
    let scene = Scene {
        volumes: Vec::new(),
        meshes: Vec::new(),
        grids: vec![item.clone()],
        camera: *camera,
        background: [0.0; 3],
    };
    let known = reference::draw_pixels(&scene, size, &reference::Options::default(), &pixels)?;
    let apart = pixels.iter().zip(known).flat_map(|(&(x, y), known)| {
        let found = picture.image.pixels[(y * size[0] + x) as usize];
        [0, 1, 2, 3].map(|c| (f64::from(found[c]) - known[c]).abs() * 255.0)
    });
    Ok(apart.fold(0.0, f64::max))
}

fn read(path: &Path) -> Result<Arc<CellGrid>, Failure> {
    let items = load::open(path, &Limits::default(), &Terminal::default())?;
    let grid = items.into_iter().find_map(|item| match item.content {
        Content::Cells(grid) => Some(Arc::new(grid)),
        _ => None,
    });
    let fault = "there is no unstructured grid in it; choose a VTU, VTK or Exodus file";
    grid.ok_or_else(|| Failure::Unfit(format!("{fault}: {}", path.display())))
}

/// Along the longest side of the grid, or across it with that side lying.
fn camera(grid: &CellGrid, along: bool, size: [u32; 2]) -> Camera {
    let [low, high] = grid.bounds();
    let extent = high - low;
    let middle = low + extent * 0.5;
    let axis = |a: usize| Vector::from_fn(|i, _| f64::from(u8::from(i == a)));
    let longest = extent.imax();
    let [long, other, third] = [axis(longest), axis((longest + 1) % 3), axis((longest + 2) % 3)];
    let (forward, up, across) = if along {
        (long + 0.2 * other, third, extent.dot(&other).max(extent.dot(&third)))
    } else {
        (third + 0.1 * other, other, extent[longest] * f64::from(size[1]) / f64::from(size[0]))
    };
    let height_mm = 1.1 * across.max(extent.dot(&up)) + 0.2 * extent.dot(&long) * f64::from(u8::from(along));
    let eye = middle - forward.normalize() * extent.norm() * 1.5;
    Camera { eye, target: middle, up, projection: Projection::Parallel { height_mm } }
}

/// Colours over a range; a mean opacity of 0.3 a millimetre where `dense`.
fn transfer([from, to]: [f64; 2], dense: bool) -> Result<Transfer, Failure> {
    let point = |part: f64, rgba: [f64; 4]| ControlPoint { value: from + (to - from) * part, rgba };
    let [a, b, c] = if dense { [0.3, 0.32, 0.4] } else { [0.0, 0.02, 0.2] };
    let points = vec![
        point(0.0, [0.1, 0.2, 0.9, a]),
        point(0.05, [0.2, 0.8, 0.6, b]),
        point(0.3, [0.9, 0.8, 0.2, b]),
        point(1.0, [1.0, 0.2, 0.1, c]),
    ];
    Transfer::new(points, 1.0).map_err(|e| Failure::Other(e.to_string()))
}

/// Cubes of a ball, six tetrahedra each, with a smooth scalar; `cells` millimetres across.
fn ball(cells: usize) -> Result<Arc<CellGrid>, Failure> {
    let side = cells + 1;
    let number = |p: [usize; 3]| (p[0] + side * (p[1] + side * p[2])) as u32;
    let middle = cells as f64 / 2.0;
    let (mut points, mut corners, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for z in 0..side {
        for y in 0..side {
            for x in 0..side {
                let p = Point::new(x as f64, y as f64, z as f64);
                let wave = (p.x * 0.9).sin() + (p.y * 0.7).cos() + (p.z * 0.8).sin();
                points.push(p + Vector::new(0.2, 0.1, -0.1) * wave);
                values.push(wave as f32);
            }
        }
    }
    // The six orders in which a walk from corner to corner may go along the axes.
    for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
        for cell in 0..cells * cells * cells {
            let mut at = [cell % cells, cell / cells % cells, cell / cells / cells];
            let off = at.map(|v| (v as f64 + 0.5 - middle).powi(2)).iter().sum::<f64>();
            if off > middle * middle * 1.32 {
                continue;
            }
            corners.push(number(at));
            for axis in order {
                at[axis] += 1;
                corners.push(number(at));
            }
        }
    }
    let field = Field::new("wave".to_owned(), 1, Values::F32(values));
    let steps = vec![Step { time: 0.0, point_fields: vec![field], cell_fields: Vec::new() }];
    let kinds = vec![CellKind::Tetra; corners.len() / 4];
    let grid = CellGrid::new(points, kinds, corners, steps);
    grid.map(Arc::new).map_err(|e| Failure::Other(e.to_string()))
}
