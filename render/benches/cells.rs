//! How long a grid of tetrahedra takes to be drawn, by the renderer of cells.
//!
//! ```text
//! cargo bench -p render --bench cells             a ball of 311 000 tetrahedra of its own
//! cargo bench -p render --bench cells -- FILE     a grid to be compared
//! ```
//! FILE is the count of points and of tetrahedra as u64, then f64 coordinates, u32 corners and an f32 scalar a point, little
//! endian. Lines are JSON: size, what was asked for, milliseconds (best of several), the largest error of a sample of pixels
//! against the reference (1/255; for one worker), and counters.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may fail loudly, and prints")]

use std::sync::Arc;
use std::time::Instant;

use render::cells::{
    Breaks, CellItem, CellPicture, CellRenderer, Early, Engine, Options, Part, Scalar, Spread,
};
use render::reference::cells::{CellField, draw_pixels};
use render::scene::{Camera, Projection};
use render::volume::cells::{CellGrid, CellKind, Field, Place, Step, Values};
use render::volume::{Affine, ControlPoint, Point, Transfer, Vector};

fn main() {
    let file = std::env::args().skip(1).find(|argument| !argument.starts_with("--"));
    let (points, corners, values) = file.map_or_else(|| ball(37), |file| read(&std::fs::read(file).unwrap()));
    let field = Field::new("s".to_owned(), 1, Values::F32(values));
    let steps = vec![Step { time: 0.0, point_fields: vec![field], cell_fields: Vec::new() }];
    let kinds = vec![CellKind::Tetra; corners.len() / 4];
    let grid = Arc::new(CellGrid::new(points, kinds, corners, steps).unwrap());
    let mut renderer = CellRenderer::new();
    for dense in [false, true] {
        for side in [300, 512] {
            measure(&mut renderer, &grid, dense, side);
        }
    }
}

fn measure(renderer: &mut CellRenderer, grid: &Arc<CellGrid>, dense: bool, side: u32) {
    let [low, high] = grid.bounds();
    let middle = low + (high - low) * 0.5;
    let height = (high - low).max() * 1.05;
    let camera = Camera {
        eye: middle + Vector::new(0.3, -1.0, 0.1) * height * 2.0,
        target: middle,
        up: Vector::new(0.0, 0.0, 1.0),
        projection: Projection::Parallel { height_mm: height },
    };
    let scalar = Scalar { place: Place::Points, name: "s".to_owned(), part: Part::Component(0) };
    let [from, to] = grid.range(Place::Points, "s", 0).unwrap();
    let item = CellItem {
        grid: Arc::clone(grid),
        step: 0,
        scalar,
        pose: Affine::identity(),
        transfer: Arc::new(transfer([from, to], dense)),
    };
    let early = Some(Early::default());
    let paper = Some(Early::TAKAYAMA);
    let fine = Some(Early { subscreens: None, ..Early::TAKAYAMA });
    let base = Options::default();
    let eight = Options { workers: Some(8), engine: Engine::Simulated, spread: Spread::Blocks, ..base };
    let columns = Options { spread: Spread::Columns, ..eight };
    for (name, options) in [
        ("one", Options { workers: Some(1), ..base }),
        ("two", Options { workers: Some(2), ..base }),
        ("two plain", Options { workers: Some(2), wide: false, ..base }),
        ("one early", Options { workers: Some(1), early, ..base }),
        ("two early", Options { workers: Some(2), early, ..base }),
        ("one paper", Options { workers: Some(1), early: paper, ..base }),
        ("one paper, own subscreens", Options { workers: Some(1), early: fine, ..base }),
        ("two paper, own subscreens", Options { workers: Some(2), early: fine, ..base }),
        ("eight base", Options { balance: false, ..eight }),
        ("eight balance", eight),
        ("eight early", Options { early: fine, balance: false, share: false, ..eight }),
        ("eight early share", Options { early: fine, balance: false, ..eight }),
        ("eight early balance", Options { early: fine, share: false, ..eight }),
        ("eight early balance share", Options { early: fine, ..eight }),
        ("eight columns base", Options { balance: false, ..columns }),
        ("eight columns balance", columns),
        ("eight columns early balance share", Options { early: fine, ..columns }),
    ] {
        let mut best = f64::INFINITY;
        let mut last = None;
        for _ in 0..3 {
            let begin = Instant::now();
            let picture =
                renderer.render(&item, &camera, [side; 2], &options, Breaks::default(), &|_, _| true);
            best = best.min(begin.elapsed().as_secs_f64() * 1e3);
            last = Some(picture.unwrap());
        }
        let picture = last.unwrap();
        let off = if name == "one" { off(&item, &camera, &picture) } else { 0.0 };
        let stats = picture.stats;
        let work: Vec<u64> = stats.workers.iter().map(|w| w.work()).collect();
        println!(
            "{{\"dense\":{dense},\"side\":{side},\"run\":\"{name}\",\"ms\":{best:.1},\"off\":{off:.4},\"imbalance\":{:.3},\"most\":{},\"subscreens\":{},\"total\":{:?}}}",
            stats.imbalance(),
            work.iter().max().unwrap(),
            stats.subscreens,
            stats.total,
        );
    }
}

/// The largest error of one in so many pixels against the reference; of 1/255.
fn off(item: &CellItem, camera: &Camera, picture: &CellPicture) -> f64 {
    let size = [picture.image.width, picture.image.height];
    let pixels: Vec<(u32, u32)> =
        (0..size[0] * size[1]).step_by(97).map(|i| (i % size[0], i / size[0])).collect();
    let values: Vec<f64> = item.grid.steps()[0].point_fields[0].values().iter().collect();
    let (pose, place, transfer) = (item.pose, Place::Points, &*item.transfer);
    let field = CellField { grid: &item.grid, pose, place, values: &values, transfer };
    let known = draw_pixels(&field, camera, size, &pixels).unwrap();
    let apart = pixels.iter().zip(known).flat_map(|(&(x, y), known)| {
        let found = picture.image.pixels[(y * size[0] + x) as usize];
        [0, 1, 2, 3].map(|c| (f64::from(found[c]) - known[c]).abs() * 255.0)
    });
    apart.fold(0.0, f64::max)
}

/// Colours over a range; a mean opacity of 0.3 a millimetre where `dense`.
fn transfer([from, to]: [f64; 2], dense: bool) -> Transfer {
    let point = |part: f64, rgba: [f64; 4]| ControlPoint { value: from + (to - from) * part, rgba };
    let [a, b, c] = if dense { [0.3, 0.32, 0.4] } else { [0.0, 0.02, 0.2] };
    let points = vec![
        point(0.0, [0.1, 0.2, 0.9, a]),
        point(0.05, [0.2, 0.8, 0.6, b]),
        point(0.3, [0.9, 0.8, 0.2, b]),
        point(1.0, [1.0, 0.2, 0.1, c]),
    ];
    Transfer::new(points, 1.0).unwrap()
}

/// Cubes of a ball, six tetrahedra each, with a smooth scalar.
fn ball(cells: usize) -> (Vec<Point>, Vec<u32>, Vec<f32>) {
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
    (points, corners, values)
}

fn read(bytes: &[u8]) -> (Vec<Point>, Vec<u32>, Vec<f32>) {
    let long = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let [points, tetrahedra] = [long(0) as usize, long(8) as usize];
    let float = |i: usize| f64::from_bits(long(16 + 8 * i));
    let after = 16 + 24 * points;
    let scalars = after + 16 * tetrahedra;
    (
        (0..points).map(|p| Point::new(float(3 * p), float(3 * p + 1), float(3 * p + 2))).collect(),
        (0..4 * tetrahedra).map(|i| word(after + 4 * i)).collect(),
        (0..points).map(|i| f32::from_bits(word(scalars + 4 * i))).collect(),
    )
}
