//! One row of pixels through one piece: places advance by a constant step, so bounds are found once a row and
//! the loop over pixels asks nothing but the samples.

use std::ops::Range;

use super::Section;
use super::layer::Prepared;
use crate::volume::{Body, Face, Grid, Point, Samples, Vector};

/// A row of places in some space: the pixel `i` is at `from + i·step`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    pub(super) from: Point,
    pub(super) step: Vector,
}

impl Row {
    /// Row `j` of a section's pixel centres, `offset_mm` behind its plane; world mm.
    pub(super) fn of(section: &Section, j: usize, offset_mm: f64) -> Self {
        let from = section.point(0.5, j as f64 + 0.5) + section.forward() * offset_mm;
        Self { from, step: section.right * section.mm_per_pixel }
    }

    /// The same row in another space.
    pub(super) fn in_space(&self, to: &crate::volume::Affine) -> Self {
        Self { from: to.point(&self.from), step: to.vector(&self.step) }
    }

    /// The place of a pixel.
    pub(super) fn at(&self, i: usize) -> Point {
        self.from + self.step * i as f64
    }
}

/// Whether a place in voxel space is within a grid.
fn is_inside(at: &Point, extent: [usize; 3]) -> bool {
    (0..3).all(|a| at[a] >= -0.5 && at[a] <= extent[a] as f64 - 0.5)
}

/// The pixels of a row, of `width`, that are inside a grid: one range, since a box is convex.
fn inside(row: &Row, extent: [usize; 3], width: usize) -> Range<usize> {
    let (mut from, mut to) = (0.0_f64, width as f64 - 1.0);
    for (axis, n) in extent.into_iter().enumerate() {
        let (c, d) = (row.from[axis], row.step[axis]);
        if d == 0.0 {
            continue;
        }
        let (a, b) = ((-0.5 - c) / d, (n as f64 - 0.5 - c) / d);
        from = from.max(a.min(b));
        to = to.min(a.max(b));
    }
    // By rounding the ends may be off by one: the places themselves decide.
    let mut first = (from.ceil() - 1.0).max(0.0) as usize;
    let mut end = (to.floor() + 2.0).clamp(0.0, width as f64) as usize;
    while first < end && !is_inside(&row.at(first), extent) {
        first += 1;
        if first as f64 > from + 2.0 {
            return 0..0;
        }
    }
    while end > first && !is_inside(&row.at(end - 1), extent) {
        end -= 1;
    }
    first..end
}

/// Which pixels of a range lie on the kept sides; all where nothing cuts. `kept` is scratch of the row's width.
fn keep(piece: &Prepared, row_in_world: &Row, range: Range<usize>, kept: &mut [bool]) {
    kept[range.clone()].fill(true);
    let row = row_in_world.in_space(&piece.unmoved_from_world);
    for (body, inside) in &piece.keep {
        // Far from a plane its height says the side; near it, and for all else, the body is asked itself.
        let (first, rise, near) = match body {
            Body::HalfSpace(Face { point, normal }) => {
                let size = row.from.coords.amax() + point.coords.amax() + row.step.amax() * range.end as f64;
                let height = normal.dot(&(row.from - point));
                (height, normal.dot(&row.step), 1e-9 * normal.amax() * (1.0 + size))
            }
            _ => (0.0, 0.0, f64::INFINITY),
        };
        for i in range.clone().filter(|&i| kept[i]).collect::<Vec<_>>() {
            let rough = first + rise * i as f64;
            let held = if rough.abs() > near { rough < 0.0 } else { body.holds(&row.at(i)) };
            kept[i] = held == *inside;
        }
    }
}

/// Calls `take` with every pixel of a row that is in a piece, and the value there. `row` is in world space.
pub(super) fn sweep(
    grid: &Grid,
    piece: &Prepared,
    row: &Row,
    kept: &mut [bool],
    take: impl FnMut(usize, f64),
) {
    let in_voxels = row.in_space(&piece.voxel_from_world);
    let range = inside(&in_voxels, grid.extent(), kept.len());
    if range.is_empty() {
        return;
    }
    keep(piece, row, range.clone(), kept);
    match grid.samples() {
        Samples::U8(v) => along(v, grid, &in_voxels, range, kept, take),
        Samples::I8(v) => along(v, grid, &in_voxels, range, kept, take),
        Samples::U16(v) => along(v, grid, &in_voxels, range, kept, take),
        Samples::I16(v) => along(v, grid, &in_voxels, range, kept, take),
        Samples::U32(v) => along(v, grid, &in_voxels, range, kept, take),
        Samples::I32(v) => along(v, grid, &in_voxels, range, kept, take),
        Samples::F32(v) => along(v, grid, &in_voxels, range, kept, take),
        Samples::F64(v) => along(v, grid, &in_voxels, range, kept, take),
    }
}

fn along<T: Copy + Into<f64>>(
    stored: &[T],
    grid: &Grid,
    row: &Row,
    range: Range<usize>,
    kept: &[bool],
    mut take: impl FnMut(usize, f64),
) {
    let [nx, ny, nz] = grid.extent();
    let most = [nx, ny, nz].map(|n| (n - 1) as f64);
    let strides = [1, nx, nx * ny];
    let (rescale, padding) = (grid.rescale(), grid.padding());
    let value = |index: usize| {
        let v: f64 = stored[index].into();
        if v.is_finite() { v * rescale.slope + rescale.intercept } else { padding }
    };
    for i in range {
        if !kept[i] {
            continue;
        }
        let (mut index, mut next, mut part) = (0, [0; 3], [0.0; 3]);
        for axis in 0..3 {
            let c = (row.from[axis] + row.step[axis] * i as f64).clamp(0.0, most[axis]);
            let low = c as usize;
            index += low * strides[axis];
            next[axis] = if (low as f64) < most[axis] { strides[axis] } else { 0 };
            part[axis] = c - low as f64;
        }
        let [dx, dy, dz] = next;
        let line = |at: usize| {
            let a = value(at);
            a + (value(at + dx) - a) * part[0]
        };
        let sheet = |at: usize| {
            let a = line(at);
            a + (line(at + dy) - a) * part[1]
        };
        let a = sheet(index);
        take(i, a + (sheet(index + dz) - a) * part[2]);
    }
}
