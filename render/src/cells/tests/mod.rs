//! The renderer of cells against closed forms and against the reference.

mod agree;
mod exact;
mod hard;
mod same;

use std::sync::Arc;

use super::*;
use crate::reference::{self, draw_pixels};
use crate::scene::{Projection, Scene};
use crate::volume::cells::{CellKind, Field, Part, Place, Step, Values};
use crate::volume::{Affine, ControlPoint, Point, Transfer, Vector};

/// Numbers from 0 to 1 without order.
pub(super) struct Dice(u64);

impl Dice {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub(super) fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Points, tetrahedra.
pub(super) type Mesh = (Vec<Point>, Vec<[u32; 4]>);

/// A box of `n` cubes a side from 0 to `n`, six tetrahedra each; inner points are moved by up to `shake`, and so are those of
/// the outside within it, so that the hull stays the box.
pub(super) fn lattice(n: usize, shake: f64, seed: u64) -> Mesh {
    let mut dice = Dice::new(seed);
    let side = n + 1;
    let mut points = Vec::new();
    for z in 0..side {
        for y in 0..side {
            for x in 0..side {
                let moved = [x, y, z].map(|v| {
                    let by = (dice.next() - 0.5) * 2.0 * shake;
                    if v == 0 || v == n { v as f64 } else { v as f64 + by }
                });
                points.push(Point::from(moved));
            }
        }
    }
    let number = |p: [usize; 3]| (p[0] + side * (p[1] + side * p[2])) as u32;
    let mut cells = Vec::new();
    for cell in 0..n * n * n {
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut at = [cell % n, cell / n % n, cell / n / n];
            let mut corners = [number(at); 4];
            for (corner, axis) in corners[1..].iter_mut().zip(order) {
                at[axis] += 1;
                *corner = number(at);
            }
            cells.push(corners);
        }
    }
    (points, cells)
}

pub(super) fn point_field(name: &str, values: Vec<f64>) -> Step {
    let field = Field::new(name.to_owned(), 1, Values::F64(values));
    Step { time: 0.0, point_fields: vec![field], cell_fields: Vec::new() }
}

/// A grid of tetrahedra with a scalar at its points.
pub(super) fn grid((points, cells): &Mesh, scalar: impl Fn(usize, &Point) -> f64) -> Arc<CellGrid> {
    let values = points.iter().enumerate().map(|(i, p)| scalar(i, p)).collect();
    let kinds = vec![CellKind::Tetra; cells.len()];
    let steps = vec![point_field("s", values)];
    Arc::new(CellGrid::new(points.clone(), kinds, cells.concat(), steps).expect("a grid"))
}

pub(super) fn on(place: Place) -> Scalar {
    Scalar { place, name: "s".to_owned(), part: Part::Component(0) }
}

pub(super) fn item(grid: &Arc<CellGrid>, transfer: Transfer) -> CellItem {
    CellItem {
        grid: Arc::clone(grid),
        step: 0,
        scalar: on(Place::Points),
        pose: Affine::identity(),
        transfer: Arc::new(transfer),
    }
}

/// Points of (value, red, green, blue, opacity).
pub(super) fn transfer(points: &[[f64; 5]], unit_mm: f64) -> Transfer {
    let point = |&[value, r, g, b, a]: &[f64; 5]| ControlPoint { value, rgba: [r, g, b, a] };
    Transfer::new(points.iter().map(point).collect(), unit_mm).expect("a transfer function")
}

/// Bends, jumps and clear stretches over values from 0 to 1.
pub(super) fn varied(strength: f64) -> Transfer {
    let points = [
        [0.05, 0.0, 0.1, 0.9, 0.0],
        [0.2, 0.1, 0.9, 0.3, 0.5 * strength],
        [0.3, 0.9, 0.9, 0.1, 0.0],
        [0.4, 0.9, 0.2, 0.1, 0.0],
        [0.4, 0.3, 0.2, 0.8, 0.7 * strength],
        [0.6, 1.0, 0.2, 0.0, 0.2 * strength],
        [0.6, 0.0, 0.7, 0.2, strength],
        [0.95, 1.0, 1.0, 0.9, 0.9 * strength],
    ];
    transfer(&points, 1.0)
}

pub(super) fn looks(eye: [f64; 3], target: [f64; 3], projection: Projection) -> Camera {
    let up = Vector::new(0.1, 0.2, 1.0);
    Camera { eye: Point::from(eye), target: Point::from(target), up, projection }
}

pub(super) fn draw(item: &CellItem, camera: &Camera, size: [u32; 2], options: &Options) -> CellPicture {
    CellRenderer::new().render(item, camera, size, options, &|_, _| true).expect("a picture")
}

/// Every so many pixels of a picture.
pub(super) fn some_pixels(size: [u32; 2], every: u32) -> Vec<(u32, u32)> {
    (0..size[0] * size[1]).step_by(every as usize).map(|i| (i % size[0], i / size[0])).collect()
}

/// The largest difference from the reference, of 1/255, and how many of the pixels show anything.
pub(super) fn off(
    item: &CellItem,
    camera: &Camera,
    size: [u32; 2],
    every: u32,
    picture: &CellPicture,
) -> (f64, usize) {
    let scene = Scene {
        volumes: Vec::new(),
        meshes: Vec::new(),
        grids: vec![item.clone()],
        camera: *camera,
        background: [0.0; 3],
    };
    let pixels = some_pixels(size, every);
    let known = draw_pixels(&scene, size, &reference::Options::default(), &pixels).expect("pixels");
    let mut most = 0.0_f64;
    for (&(x, y), known) in pixels.iter().zip(&known) {
        let found = picture.image.pixels[(y * size[0] + x) as usize];
        for c in 0..4 {
            let off = (f64::from(found[c]) - known[c]).abs() * 255.0;
            most = if off.is_nan() { f64::INFINITY } else { most.max(off) };
        }
    }
    (most, known.iter().filter(|k| k[3] > 0.0).count())
}
