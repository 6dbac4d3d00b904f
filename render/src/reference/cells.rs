//! Unstructured grids: each ray against each tetrahedron that it may meet.

use nalgebra::Matrix3;

use super::class::Classes;
use super::hierarchy::{Bounded, Hierarchy};
use crate::scene::CellItem;
use crate::volume::cells::{CellKind, Place};
use crate::volume::{Point, Vector};

/// A grid about the eye.
#[derive(Debug)]
pub(super) struct Cells {
    tetrahedra: Hierarchy<Tetra>,
    classes: Classes,
}

#[derive(Debug)]
struct Tetra {
    corners: [Vector; 4],
    /// From a place to the weights of the other three corners.
    weights: Matrix3<f64>,
    /// Values of the corners.
    values: [f64; 4],
}

/// A stretch of a ray in one tetrahedron and in one piece of the transfer function.
#[derive(Debug, Clone, Copy)]
pub(super) struct Linear<'a> {
    /// mm along the ray.
    pub(super) from: f64,
    pub(super) to: f64,
    /// The scalar is `value + slope · t`.
    value: f64,
    slope: f64,
    class: usize,
    classes: &'a Classes,
}

/// Corners of faces, around.
const TETRA: &[&[usize]] = &[&[0, 1, 2], &[0, 1, 3], &[0, 2, 3], &[1, 2, 3]];
const PYRAMID: &[&[usize]] = &[&[0, 1, 2, 3], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[0, 3, 4]];
const WEDGE: &[&[usize]] = &[&[0, 1, 2], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[0, 2, 5, 3]];
const HEXAHEDRON: &[&[usize]] =
    &[&[0, 1, 2, 3], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[0, 3, 7, 4]];

/// Corners of the tetrahedra of a cell, as numbers of points.
pub(crate) fn tetrahedra(kind: CellKind, corners: &[u32]) -> Vec<[u32; 4]> {
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

impl Bounded for Tetra {
    fn corners(&self) -> &[Vector] {
        &self.corners
    }
}

impl Cells {
    /// A grid as it lies in the world, seen from `eye`; nothing where it has no such step or scalar.
    pub(super) fn of(item: &CellItem, eye: &Point) -> Option<Self> {
        let field = item.scalar.field(item.grid.steps().get(item.step)?)?;
        let linear = item.pose.linear();
        let origin = item.pose.point(&Point::origin()) - eye;
        let points: Vec<Vector> = item.grid.points().iter().map(|p| linear * p.coords + origin).collect();
        let mut placed = Vec::new();
        for cell in 0..item.grid.len() {
            let (kind, corners) = item.grid.cell(cell);
            for numbers in tetrahedra(kind, corners) {
                let [a, b, c, d] = numbers.map(|n| points[n as usize]);
                let values = match item.scalar.place {
                    Place::Points => numbers.map(|n| item.scalar.part.of(field, n as usize)),
                    Place::Cells => [item.scalar.part.of(field, cell); 4],
                };
                let weights = Matrix3::from_columns(&[b - a, c - a, d - a]).try_inverse();
                if let Some(weights) = weights.filter(|_| values.iter().all(|v| v.is_finite())) {
                    placed.push(Tetra { corners: [a, b, c, d], weights, values });
                }
            }
        }
        Some(Self { tetrahedra: Hierarchy::new(placed), classes: Classes::of(&item.transfer) })
    }

    /// Appends where a ray is in the grid and meets something; `offset` is its start relative to the eye, `direction` a
    /// unit vector.
    pub(super) fn stretches<'a>(&'a self, offset: &Vector, direction: &Vector, into: &mut Vec<Linear<'a>>) {
        for tetra in self.tetrahedra.near(offset, direction) {
            tetra.stretch(offset, direction, &self.classes, into);
        }
    }
}

impl Tetra {
    fn stretch<'a>(
        &self,
        offset: &Vector,
        direction: &Vector,
        classes: &'a Classes,
        into: &mut Vec<Linear<'a>>,
    ) {
        let (base, slope) = (self.weights * (offset - self.corners[0]), self.weights * direction);
        let base = [1.0 - base.sum(), base.x, base.y, base.z];
        let slope = [-slope.sum(), slope.x, slope.y, slope.z];
        let (mut from, mut to) = (0.0_f64, f64::INFINITY);
        for (b, s) in base.into_iter().zip(slope) {
            if s > 0.0 {
                from = from.max(-b / s);
            } else if s < 0.0 {
                to = to.min(-b / s);
            } else if b < 0.0 {
                return;
            }
        }
        if !(from < to && to.is_finite()) {
            return;
        }
        let sum = |weights: [f64; 4]| weights.iter().zip(&self.values).map(|(w, v)| w * v).sum::<f64>();
        let (value, slope) = (sum(base), sum(slope));
        let ends = [value + slope * from, value + slope * to];
        let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let mut cuts: Vec<f64> =
            classes.knots_between([low, high]).iter().map(|k| (k - value) / slope).collect();
        cuts.retain(|t| *t > from && *t < to);
        cuts.push(to);
        cuts.sort_unstable_by(f64::total_cmp);
        for end in cuts {
            // Its middle tells the piece even where the ends lie on knots.
            let class = classes.find(value + slope * 0.5 * (from + end));
            if from < end && !classes.is_clear(class) {
                into.push(Linear { from, to: end, value, slope, class, classes });
            }
            from = end;
        }
    }
}

impl Linear<'_> {
    /// Colour and extinction (1/mm) at `t`.
    pub(super) fn classify(&self, t: f64) -> ([f64; 3], f64) {
        self.classes.classify(self.class, self.value + self.slope * t)
    }

    /// The greatest extinction (1/mm) between two places, or `None` where it varies by more than one panel of the rule follows.
    pub(super) fn smooth(&self, from: f64, to: f64) -> Option<f64> {
        let [a, b] = [from, to].map(|t| self.value + self.slope * t);
        self.classes.smooth(self.class, [a.min(b), a.max(b)], to - from)
    }
}
