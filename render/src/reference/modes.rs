//! Volumes that are not integrated: the greatest value on the ray, and the surface of one value.
//!
//! Both walk the cells of each piece and know the scalar there as a cubic, so they find what they seek
//! exactly. What they find is a layer at a depth, composited as a surface is.

use super::field::{Field, along};
use super::intervals::Intervals;
use super::labels::painted;
use super::light;
use super::surface::Hit;
use super::walk::{Line, Part};
use crate::scene::{VolumeItem, VolumeMode};
use crate::volume::{Point, Transfer, Vector};

/// A volume in one of these modes, ready for rays.
#[derive(Debug)]
pub(super) struct Layered<'a> {
    parts: Vec<Part<'a>>,
    mode: VolumeMode,
    transfer: &'a Transfer,
}

/// One cell on a ray's way: where it is entered and how long the way through it is; mm.
struct Passage {
    cell: [i64; 3],
    entry: f64,
    length: f64,
}

impl<'a> Layered<'a> {
    /// A volume as it lies in the world, seen from `eye`.
    pub(super) fn of(field: &'a Field<'a>, item: &'a VolumeItem, eye: &Point) -> Self {
        let parts = item.pieces.iter().map(|piece| Part::new(field, item, piece, eye)).collect();
        Self { parts, mode: item.mode, transfer: &item.transfer }
    }

    /// Appends the volume's layers on a ray.
    pub(super) fn hits(
        &self,
        offset: &Vector,
        direction: &Vector,
        intervals: &mut Intervals,
        into: &mut Vec<Hit>,
    ) {
        let mut most: Option<Most<'_, 'a>> = None;
        for part in &self.parts {
            let line = part.line(offset, direction);
            part.stretches(&line, offset, direction, intervals);
            for &stretch in intervals.stretches() {
                if let VolumeMode::Isosurface { value, opacity } = self.mode {
                    surface(part, &line, stretch, value, |at, u| {
                        let t = at.entry + u;
                        let color = self.color(part, value, offset, direction, t);
                        let color = match facing(part, &line, at, u, direction) {
                            Some(facing) => light::lit(color, facing),
                            None => color,
                        };
                        into.push(Hit::layer(t, color, opacity));
                    });
                    continue;
                }
                let entry = most.as_ref().map_or(stretch[0], |m| m.entry.min(stretch[0]));
                let before = most.as_ref().map_or(f64::NEG_INFINITY, |m| m.value);
                let found = greatest(part, &line, stretch, before);
                most = match (found, most) {
                    (Some((value, at)), _) => Some(Most { part, value, at, entry }),
                    (None, Some(m)) => Some(Most { entry, ..m }),
                    (None, None) => None,
                };
            }
        }
        if let Some(Most { part, value, at, entry }) = most {
            let color = self.color(part, value, offset, direction, at);
            into.push(Hit::layer(entry, color, self.transfer.rgba(value)[3]));
        }
    }

    /// The colour of a value, with the label at `t` mm.
    fn color(&self, part: &Part<'_>, value: f64, offset: &Vector, direction: &Vector, t: f64) -> [f64; 3] {
        let [r, g, b, _] = self.transfer.rgba(value);
        let paint = part.painting.as_ref().and_then(|p| p.color_at(&p.line(offset, direction), t));
        painted([r, g, b], paint)
    }
}

/// The greatest value so far and where it is, and where the volume is entered first.
struct Most<'p, 'a> {
    part: &'p Part<'a>,
    value: f64,
    at: f64,
    entry: f64,
}

/// Visits the cells of a stretch in order.
fn each_cell(field: &Field<'_>, line: &Line, [from, to]: [f64; 2], mut visit: impl FnMut(&Passage)) {
    let mut cell: [i64; 3] =
        std::array::from_fn(|a| (line.at(a, from).floor() as i64).clamp(-1, field.extent[a] - 1));
    let mut entry = from;
    loop {
        let (mut exit, mut exit_axis) = (f64::INFINITY, 0);
        for (axis, &first) in cell.iter().enumerate() {
            let wall = if line.step[axis] >= 0.0 { first + 1 } else { first };
            let at = line.reaches(axis, wall as f64);
            if at < exit {
                (exit, exit_axis) = (at, axis);
            }
        }
        let exit = exit.max(entry);
        visit(&Passage { cell, entry, length: exit.min(to) - entry });
        cell[exit_axis] += if line.step[exit_axis] >= 0.0 { 1 } else { -1 };
        if exit >= to || cell[exit_axis] < -1 || cell[exit_axis] >= field.extent[exit_axis] {
            return;
        }
        entry = exit;
    }
}

fn start(line: &Line, at: &Passage) -> [f64; 3] {
    std::array::from_fn(|a| line.at(a, at.entry) - at.cell[a] as f64)
}

/// Calls `found` with the cell and the way into it for every crossing of the scalar with `level`. The side is
/// carried from cell to cell, so that a crossing in a wall is found once.
fn surface(
    part: &Part<'_>,
    line: &Line,
    stretch: [f64; 2],
    level: f64,
    mut found: impl FnMut(&Passage, f64),
) {
    let mut below: Option<bool> = None;
    let mut roots = Vec::new();
    each_cell(part.field, line, stretch, |at| {
        let corners = part.field.corners(at.cell);
        let under = corners.iter().filter(|&&v| v < level).count();
        let value = along(&corners, start(line, at), line.step);
        let side = |u: f64| match under {
            0 => false,
            8 => true,
            _ => value.at(u) < level,
        };
        if below.is_some_and(|b| b != side(0.0)) {
            found(at, 0.0);
        }
        if under % 8 != 0 {
            roots.clear();
            value.crossings(at.length, &[level], &mut roots);
            for &u in &roots {
                found(at, u);
            }
        }
        below = Some(side(at.length));
    });
}

/// |n·v| of the gradient; none where it is too flat to light.
fn facing(part: &Part<'_>, line: &Line, at: &Passage, u: f64, direction: &Vector) -> Option<f64> {
    let from = start(line, at);
    let per_voxel = part.field.gradients(at.cell).map(|g| along(&g, from, line.step).at(u));
    let gradient = part.gradient_to_world * Vector::from(per_voxel);
    let length = gradient.norm();
    let lights = length > 0.0 && length >= part.field.flat_per_mm;
    lights.then(|| (gradient.dot(direction).abs() / length).min(1.0))
}

/// The greatest value of a stretch, and where, if it is more than `before`.
fn greatest(part: &Part<'_>, line: &Line, stretch: [f64; 2], before: f64) -> Option<(f64, f64)> {
    let (mut most, mut place) = (before, None);
    each_cell(part.field, line, stretch, |at| {
        let corners = part.field.corners(at.cell);
        if corners.iter().all(|&v| v <= most) {
            return;
        }
        let (value, u) = along(&corners, start(line, at), line.step).most(at.length);
        if value > most {
            (most, place) = (value, Some(at.entry + u));
        }
    });
    place.map(|t| (most, t))
}
