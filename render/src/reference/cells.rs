//! What a picture of an unstructured grid is: each ray against each tetrahedron.
//!
//! A cell is the tetrahedra of its corner of the smallest number with every triangle of the faces that lack it, where a face
//! of four corners is cut from its own smallest. In a tetrahedron the scalar is linear; a field of cells is the same
//! throughout each cell. Tetrahedra of no volume, and those with a value that is not a number, are nothing. Where several
//! overlap, extinctions add up and colours are weighted by them. Rays start at the eye's plane.
//!
//! A ray is cut wherever it enters or leaves a tetrahedron and wherever a scalar passes a control point; in between the
//! midpoint rule is halved until it holds, and the last two are extrapolated.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::{MAX_PIXELS, ReferenceError};
use crate::scene::{Camera, Projection};
use crate::volume::cells::{CellGrid, CellKind, Place};
use crate::volume::{Affine, Transfer, Vector};

/// Transmittance below which the rest of a ray cannot be seen.
const DARK: f64 = 1e-9;
/// By how much halving may still change a stretch.
const HOLDS: f64 = 1e-8;
/// How often a stretch is halved at most.
const HALVINGS: u32 = 40;

/// A grid with the scalar to show.
#[derive(Debug, Clone, Copy)]
pub struct CellField<'a> {
    /// Points and cells.
    pub grid: &'a CellGrid,
    /// `world_from_grid`.
    pub pose: Affine,
    /// Where the values sit.
    pub place: Place,
    /// One for each point or cell; a missing one counts as no number.
    pub values: &'a [f64],
    /// Colour and opacity.
    pub transfer: &'a Transfer,
}

/// A tetrahedron about the eye.
#[derive(Debug)]
struct Tetra {
    corner: Vector,
    /// From a place to the weights of the other three corners.
    weights: Matrix3<f64>,
    /// Values of the corners.
    values: [f64; 4],
    middle: Vector,
    radius: f64,
}

/// A stretch of a ray in one tetrahedron.
#[derive(Debug, Clone, Copy)]
struct Inside {
    from: f64,
    to: f64,
    /// The scalar is `value + slope · t`.
    value: f64,
    slope: f64,
}

/// Corners of faces, around.
const TETRA: &[&[usize]] = &[&[0, 1, 2], &[0, 1, 3], &[0, 2, 3], &[1, 2, 3]];
const PYRAMID: &[&[usize]] = &[&[0, 1, 2, 3], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[0, 3, 4]];
const WEDGE: &[&[usize]] = &[&[0, 1, 2], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[0, 2, 5, 3]];
const HEXAHEDRON: &[&[usize]] =
    &[&[0, 1, 2, 3], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[0, 3, 7, 4]];

/// Corners of the tetrahedra of a cell, as numbers of points.
fn tetrahedra(kind: CellKind, corners: &[u32]) -> Vec<[u32; 4]> {
    let faces = match kind {
        CellKind::Tetra => TETRA,
        CellKind::Pyramid => PYRAMID,
        CellKind::Wedge => WEDGE,
        CellKind::Hexahedron => HEXAHEDRON,
    };
    let smallest = |list: &[u32]| list.iter().copied().min().unwrap_or(0);
    let apex = smallest(corners);
    let mut found = Vec::new();
    for face in faces {
        let around: Vec<u32> = face.iter().map(|&f| corners[f]).collect();
        let low = smallest(&around);
        for (i, &a) in around.iter().enumerate() {
            let b = around[(i + 1) % around.len()];
            if !around.contains(&apex) && a != low && b != low {
                found.push([apex, low, a, b]);
            }
        }
    }
    found
}

fn place(field: &CellField<'_>, camera: &Camera) -> Vec<Tetra> {
    let points: Vec<Vector> = field.grid.points().iter().map(|p| field.pose.point(p) - camera.eye).collect();
    let at = |n: usize| field.values.get(n).copied().unwrap_or(f64::NAN);
    let mut placed = Vec::new();
    for cell in 0..field.grid.len() {
        let (kind, corners) = field.grid.cell(cell);
        for numbers in tetrahedra(kind, corners) {
            let [a, b, c, d] = numbers.map(|n| points[n as usize]);
            let values = match field.place {
                Place::Points => numbers.map(|n| at(n as usize)),
                Place::Cells => [at(cell); 4],
            };
            let Some(weights) = Matrix3::from_columns(&[b - a, c - a, d - a]).try_inverse() else { continue };
            if values.iter().any(|v| !v.is_finite()) {
                continue;
            }
            let middle = (a + b + c + d) * 0.25;
            let radius = [a, b, c, d].iter().map(|p| (p - middle).norm()).fold(0.0, f64::max);
            placed.push(Tetra { corner: a, weights, values, middle, radius });
        }
    }
    placed
}

impl Tetra {
    /// Where a ray is inside, if anywhere.
    fn inside(&self, start: &Vector, direction: &Vector) -> Option<Inside> {
        let to_middle = self.middle - start;
        let off = to_middle - direction * to_middle.dot(direction);
        if off.norm() > self.radius * (1.0 + 1e-9) {
            return None;
        }
        let (base, slope) = (self.weights * (start - self.corner), self.weights * direction);
        let base = [1.0 - base.sum(), base.x, base.y, base.z];
        let slope = [-slope.sum(), slope.x, slope.y, slope.z];
        let (mut from, mut to) = (0.0_f64, f64::INFINITY);
        for (b, s) in base.into_iter().zip(slope) {
            if s > 0.0 {
                from = from.max(-b / s);
            } else if s < 0.0 {
                to = to.min(-b / s);
            } else if b < 0.0 {
                return None;
            }
        }
        let sum = |weights: [f64; 4]| weights.iter().zip(&self.values).map(|(w, v)| w * v).sum::<f64>();
        (from < to && to.is_finite()).then(|| Inside { from, to, value: sum(base), slope: sum(slope) })
    }
}

/// What a ray has gathered: premultiplied colour, and what comes through.
type Gathered = [f64; 4];

fn step(inside: &[Inside], transfer: &Transfer, [from, to]: [f64; 2], before: Gathered) -> Gathered {
    let middle = 0.5 * (from + to);
    let (mut tau, mut glow) = (0.0, [0.0; 3]);
    for cell in inside {
        let (color, extinction) = transfer.classify(cell.value + cell.slope * middle);
        tau += extinction;
        for c in 0..3 {
            glow[c] += extinction * color[c];
        }
    }
    let depth = tau * (to - from);
    if depth <= 0.0 {
        return before;
    }
    let part = before[3] * -(-depth).exp_m1() / tau;
    [
        before[0] + part * glow[0],
        before[1] + part * glow[1],
        before[2] + part * glow[2],
        before[3] * (-depth).exp(),
    ]
}

fn stretch(
    inside: &[Inside],
    transfer: &Transfer,
    [from, to]: [f64; 2],
    before: Gathered,
    left: u32,
) -> Gathered {
    if before[3] < DARK {
        return before;
    }
    let middle = 0.5 * (from + to);
    let once = step(inside, transfer, [from, to], before);
    let half = step(inside, transfer, [from, middle], before);
    let twice = step(inside, transfer, [middle, to], half);
    let change = (0..4).map(|c| (once[c] - twice[c]).abs()).fold(0.0, f64::max);
    if change > HOLDS && left > 0 {
        let half = stretch(inside, transfer, [from, middle], before, left - 1);
        return stretch(inside, transfer, [middle, to], half, left - 1);
    }
    std::array::from_fn(|c| twice[c] + (twice[c] - once[c]) / 3.0)
}

fn gather(inside: &[Inside], transfer: &Transfer) -> [f64; 4] {
    let mut cuts: Vec<f64> = inside.iter().flat_map(|cell| [cell.from, cell.to]).collect();
    for cell in inside {
        let knots = transfer.points().iter().map(|p| (p.value - cell.value) / cell.slope);
        cuts.extend(knots.filter(|&t| t > cell.from && t < cell.to));
    }
    cuts.sort_unstable_by(f64::total_cmp);
    let mut seen = [0.0, 0.0, 0.0, 1.0];
    let mut active = Vec::new();
    for pair in cuts.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let middle = 0.5 * (from + to);
        active.clear();
        active.extend(inside.iter().filter(|cell| cell.from <= middle && middle <= cell.to).copied());
        if from < to && !active.is_empty() {
            seen = stretch(&active, transfer, [from, to], seen, HALVINGS);
        }
    }
    [seen[0], seen[1], seen[2], 1.0 - seen[3]]
}

/// Draws single pixels, `(column, row)`, of a picture of a grid: premultiplied red, green, blue and opacity.
///
/// # Errors
/// [`ReferenceError::Camera`], [`ReferenceError::Size`] and [`ReferenceError::Pixel`].
pub fn draw_pixels(
    field: &CellField<'_>,
    camera: &Camera,
    size: [u32; 2],
    pixels: &[(u32, u32)],
) -> Result<Vec<[f64; 4]>, ReferenceError> {
    let [width, height] = size;
    let count = u64::from(width) * u64::from(height);
    if count == 0 || count > MAX_PIXELS {
        return Err(ReferenceError::Size { width, height });
    }
    if let Some(&(x, y)) = pixels.iter().find(|p| p.0 >= width || p.1 >= height) {
        return Err(ReferenceError::Pixel { x, y });
    }
    let frame = camera.frame()?;
    let placed = place(field, camera);
    let draw = |&(x, y): &(u32, u32)| {
        let tall = f64::from(height);
        let across = frame.right * ((2.0 * f64::from(x) + 1.0 - f64::from(width)) / tall);
        let up = frame.up * ((tall - 2.0 * f64::from(y) - 1.0) / tall);
        let (start, direction) = match camera.projection {
            Projection::Perspective { fov_rad } => {
                let slope = (0.5 * fov_rad).tan();
                let direction = frame.forward + (across + up) * slope;
                (Vector::zeros(), direction / direction.norm())
            }
            Projection::Parallel { height_mm } => ((across + up) * (0.5 * height_mm), frame.forward),
        };
        let inside: Vec<Inside> = placed.iter().filter_map(|t| t.inside(&start, &direction)).collect();
        gather(&inside, field.transfer)
    };
    Ok(pixels.par_iter().map(draw).collect())
}
