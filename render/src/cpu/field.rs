//! A volume ready for rays: its samples as plain numbers, the range of each brick of cells, and how far from
//! each the nearest brick is that a transfer function does not make clear.
//!
//! Cell `i` of an axis lies between samples `i` and `i + 1`. Cells `-1` and `n - 1` are the outer half voxels,
//! where the edge sample is held. Bricks are [`EDGE`]³ cells, the first of which is cell `-1`.

use std::sync::Arc;

use rayon::prelude::*;

use crate::scene::VolumeMode;
use crate::volume::{Grid, Samples, Transfer};

/// Cells along the edge of a brick.
pub(super) const EDGE: i32 = 4;
/// Bricks along the edge of a group, the unit in which a picture's tiles are asked what lies in them.
const GROUP: usize = 4;

/// Samples in one of the two types that rays read.
#[derive(Debug)]
enum Numbers {
    /// As the grid stores them.
    Stored(Arc<Grid>),
    /// 8-bit samples.
    Short(Vec<i16>),
    /// All others, NaN and infinity replaced by the padding's stored number.
    Float(Vec<f32>),
}

/// Samples, borrowed for a picture.
#[derive(Debug, Clone, Copy)]
pub(super) enum Values<'a> {
    Short(&'a [i16]),
    Float(&'a [f32]),
}

/// A grid with the range of its bricks. Of no transfer function.
#[derive(Debug)]
pub(super) struct Field {
    grid: Arc<Grid>,
    numbers: Numbers,
    pub(super) extent: [i32; 3],
    /// From a sample to the next along each axis; 0 where there is but one.
    strides: [usize; 3],
    pub(super) bricks: [usize; 3],
    /// Least and greatest stored number that interpolation in the brick can give.
    ranges: Vec<[f32; 2]>,
}

impl Field {
    pub(super) fn new(grid: &Arc<Grid>) -> Self {
        let rescale = grid.rescale();
        let padding = ((grid.padding() - rescale.intercept) / rescale.slope) as f32;
        let finite = |v: f32| if v.is_finite() { v } else { padding };
        let floats = |v: Vec<f32>| Numbers::Float(v);
        let numbers = match grid.samples() {
            Samples::I16(_) => Numbers::Stored(Arc::clone(grid)),
            Samples::U8(v) => Numbers::Short(v.par_iter().map(|&v| i16::from(v)).collect()),
            Samples::I8(v) => Numbers::Short(v.par_iter().map(|&v| i16::from(v)).collect()),
            Samples::U16(v) => floats(v.par_iter().map(|&v| f32::from(v)).collect()),
            Samples::U32(v) => floats(v.par_iter().map(|&v| v as f32).collect()),
            Samples::I32(v) => floats(v.par_iter().map(|&v| v as f32).collect()),
            Samples::F32(_) if grid.non_finite() == 0 => Numbers::Stored(Arc::clone(grid)),
            Samples::F32(v) => floats(v.par_iter().map(|&v| finite(v)).collect()),
            Samples::F64(v) => floats(v.par_iter().map(|&v| finite(v as f32)).collect()),
        };
        let bricks = grid.extent().map(|n| (n + 1).div_ceil(EDGE as usize));
        let extent = grid.extent().map(|n| n as i32);
        let [nx, ny, nz] = grid.extent();
        let stride = |n: usize, stride: usize| if n > 1 { stride } else { 0 };
        let strides = [stride(nx, 1), stride(ny, nx), stride(nz, nx * ny)];
        let mut field = Self { grid: Arc::clone(grid), numbers, extent, strides, bricks, ranges: Vec::new() };
        field.ranges = match field.values() {
            Values::Short(v) => field.ranges_of(v, f32::from),
            Values::Float(v) => field.ranges_of(v, |v| v),
        };
        field
    }

    fn ranges_of<T: Copy + PartialOrd + Sync>(
        &self,
        samples: &[T],
        number: impl Fn(T) -> f32 + Sync,
    ) -> Vec<[f32; 2]> {
        let extent = self.grid.extent();
        let [nx, ny, _] = self.bricks;
        (0..self.bricks.iter().product::<usize>())
            .into_par_iter()
            .with_min_len(256)
            .map(|b| {
                let at = [b % nx, b / nx % ny, b / (nx * ny)];
                let edge = EDGE as usize;
                let [x, y, z]: [std::ops::Range<usize>; 3] = std::array::from_fn(|a| {
                    (at[a] * edge).saturating_sub(1).min(extent[a] - 1)..((at[a] + 1) * edge).min(extent[a])
                });
                let first = samples[(z.start * extent[1] + y.start) * extent[0] + x.start];
                let (mut low, mut high) = (first, first);
                for z in z {
                    for y in y.clone() {
                        let row = (z * extent[1] + y) * extent[0];
                        for &v in &samples[row + x.start..row + x.end] {
                            low = if v < low { v } else { low };
                            high = if v > high { v } else { high };
                        }
                    }
                }
                [number(low), number(high)]
            })
            .collect()
    }

    pub(super) fn grid(&self) -> &Arc<Grid> {
        &self.grid
    }

    pub(super) fn values(&self) -> Values<'_> {
        match &self.numbers {
            Numbers::Short(v) => Values::Short(v),
            Numbers::Float(v) => Values::Float(v),
            Numbers::Stored(grid) => match grid.samples() {
                Samples::I16(v) => Values::Short(v),
                Samples::F32(v) => Values::Float(v),
                // Only these two are kept as they are stored.
                _ => Values::Float(&[]),
            },
        }
    }
}

/// Interpolates between the corners of a cell; bits are x, y, z.
#[inline(always)]
pub(super) fn trilinear(corners: &[f32; 8], [x, y, z]: [f32; 3]) -> f32 {
    let mut row = [0.0; 4];
    for i in 0..4 {
        row[i] = corners[2 * i] + (corners[2 * i + 1] - corners[2 * i]) * x;
    }
    let (low, high) = (row[0] + (row[1] - row[0]) * y, row[2] + (row[3] - row[2]) * y);
    low + (high - low) * z
}

impl Values<'_> {
    /// Samples of a cell: the first at `base`, the others by strides.
    #[inline(always)]
    fn corners(&self, base: usize, [x, y, z]: [usize; 3]) -> [f32; 8] {
        let at = [0, x, y, y + x, z, z + x, z + y, z + y + x];
        let mut corners = [0.0; 8];
        match self {
            Self::Short(v) => {
                let v = &v[base..=base + at[7]];
                for (corner, i) in corners.iter_mut().zip(at) {
                    *corner = f32::from(v[i]);
                }
            }
            Self::Float(v) => {
                let v = &v[base..=base + at[7]];
                for (corner, i) in corners.iter_mut().zip(at) {
                    *corner = v[i];
                }
            }
        }
        corners
    }
}

impl Field {
    /// The first sample of a cell, where the cell is held inside the samples.
    #[inline(always)]
    pub(super) fn low(&self, cell: [i32; 3]) -> [i32; 3] {
        let mut low = cell;
        for (low, n) in low.iter_mut().zip(self.extent) {
            *low = (*low).clamp(0, (n - 2).max(0));
        }
        low
    }

    /// The samples at the corners of a cell whose first sample is `low`; bits are x, y, z.
    #[inline(always)]
    pub(super) fn corners(&self, values: Values<'_>, [x, y, z]: [i32; 3]) -> [f32; 8] {
        let [sx, sy, sz] = self.strides;
        values.corners(x as usize * sx + y as usize * sy + z as usize * sz, self.strides)
    }

    /// The trilinear scalar at a place, which is held inside the samples.
    pub(super) fn sample(&self, values: Values<'_>, at: [f32; 3]) -> f32 {
        let (mut place, mut cell) = (at, [0; 3]);
        for axis in 0..3 {
            place[axis] = at[axis].clamp(0.0, (self.extent[axis] - 1) as f32);
            cell[axis] = place[axis] as i32;
        }
        let low = self.low(cell);
        let part = [place[0] - low[0] as f32, place[1] - low[1] as f32, place[2] - low[2] as f32];
        trilinear(&self.corners(values, low), part)
    }
}

/// Which bricks of a field a transfer function shows.
#[derive(Debug)]
pub(super) struct Occupancy {
    /// For each brick 0 where it may show something; else how many bricks away, along the axis that is furthest,
    /// the nearest such brick is, up to 255.
    /// Three more bytes follow, so that any can be read as the first of four.
    pub(super) distance: Vec<u8>,
    /// Boxes of cells, first and end, that together hold all bricks that may show something.
    pub(super) groups: Vec<[[i32; 3]; 2]>,
    pub(super) occupied: usize,
}

impl Occupancy {
    /// Of what a transfer function shows in a mode.
    pub(super) fn new(field: &Field, transfer: &Transfer, mode: VolumeMode) -> Self {
        let rescale = field.grid.rescale();
        let value = |v: f32| rescale.slope * f64::from(v) + rescale.intercept;
        let is_clear = |low: f64, high: f64| match mode {
            VolumeMode::Composite => transfer.is_clear(low, high),
            VolumeMode::Isosurface { value, .. } => high < value || low >= value,
            VolumeMode::Mip => false,
        };
        let mut distance: Vec<u8> = field
            .ranges
            .par_iter()
            .with_min_len(4096)
            .map(|r| {
                let [a, b] = r.map(value);
                if is_clear(a.min(b), a.max(b)) { u8::MAX } else { 0 }
            })
            .collect();
        let occupied = distance.iter().map(|&d| usize::from(d == 0)).sum();
        let groups = groups(&distance, field.bricks);
        spread(&mut distance, field.bricks);
        distance.extend([0; 3]);
        Self { distance, groups, occupied }
    }

    /// Everything counts as occupied: nothing is skipped.
    pub(super) fn full(field: &Field) -> Self {
        let count = field.ranges.len();
        let end = field.bricks.map(|n| n as i32 * EDGE - 1);
        Self { distance: vec![0; count + 3], groups: vec![[[-1; 3], end]], occupied: count }
    }
}

/// The tight boxes of groups of bricks with something in them.
fn groups(distance: &[u8], bricks: [usize; 3]) -> Vec<[[i32; 3]; 2]> {
    let count = bricks.map(|n| n.div_ceil(GROUP));
    let mut boxes = vec![[[i32::MAX; 3], [i32::MIN; 3]]; count.iter().product()];
    for (row, line) in distance.chunks_exact(bricks[0]).enumerate() {
        let (y, z) = (row % bricks[1], row / bricks[1]);
        let first = (z / GROUP * count[1] + y / GROUP) * count[0];
        for (x, _) in line.iter().enumerate().filter(|(_, d)| **d == 0) {
            let group = &mut boxes[first + x / GROUP];
            for (axis, at) in [x, y, z].into_iter().enumerate() {
                let cell = at as i32 * EDGE - 1;
                group[0][axis] = group[0][axis].min(cell);
                group[1][axis] = group[1][axis].max(cell + EDGE);
            }
        }
    }
    boxes.retain(|b| b[0][0] <= b[1][0]);
    boxes
}

/// Chessboard distances by two passes over the 13 neighbours that come before and after in memory; the least over
/// all paths of steps to neighbours is exactly that distance (Rosenfeld, Pfaltz 1966).
fn spread(distance: &mut [u8], [nx, ny, nz]: [usize; 3]) {
    // Rows before this one that touch it, and the row itself.
    let near = |i: usize, n: usize| i.saturating_sub(1)..=(i + 1).min(n - 1);
    for z in 0..nz {
        for y in 0..ny {
            let row = (z * ny + y) * nx;
            for zz in z.saturating_sub(1)..=z {
                for yy in near(y, ny) {
                    let other = (zz * ny + yy) * nx;
                    if other < row {
                        lower_by(distance, row, other, nx);
                    }
                }
            }
            for x in 1..nx {
                distance[row + x] = distance[row + x].min(distance[row + x - 1].saturating_add(1));
            }
        }
    }
    for z in (0..nz).rev() {
        for y in (0..ny).rev() {
            let row = (z * ny + y) * nx;
            for zz in z..=(z + 1).min(nz - 1) {
                for yy in near(y, ny) {
                    let other = (zz * ny + yy) * nx;
                    if other > row {
                        lower_by(distance, row, other, nx);
                    }
                }
            }
            for x in (1..nx).rev() {
                distance[row + x - 1] = distance[row + x - 1].min(distance[row + x].saturating_add(1));
            }
        }
    }
}

/// Lowers a row to one more than the least of the three nearest of another.
fn lower_by(distance: &mut [u8], row: usize, other: usize, nx: usize) {
    let (first, second) = distance.split_at_mut(row.max(other));
    let (row, other) = if row > other {
        (&mut second[..nx], &first[other..other + nx])
    } else {
        (&mut first[row..row + nx], &second[..nx])
    };
    for (x, d) in row.iter_mut().enumerate() {
        let least = other[x.saturating_sub(1)..(x + 2).min(nx)].iter().copied().min().unwrap_or(u8::MAX);
        *d = (*d).min(least.saturating_add(1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Affine, ControlPoint, Rescale};

    #[test]
    fn distances_are_those_of_the_chessboard() {
        let bricks = [13, 9, 7];
        let seeds = [[2, 3, 1], [12, 8, 6], [7, 0, 5]];
        let mut distance = vec![u8::MAX; 13 * 9 * 7];
        for [x, y, z] in seeds {
            distance[(z * 9 + y) * 13 + x] = 0;
        }
        spread(&mut distance, bricks);
        for (i, &found) in distance.iter().enumerate() {
            let at = [i % 13, i / 13 % 9, i / (13 * 9)];
            let known = seeds.iter().map(|s| (0..3).map(|a| s[a].abs_diff(at[a])).max().unwrap_or(0)).min();
            assert_eq!(Some(usize::from(found)), known, "brick {at:?}");
        }
    }

    #[test]
    fn an_occupied_brick_holds_every_cell_that_shows_something() {
        let extent = [11, 6, 5];
        let samples: Vec<u8> =
            (0..11 * 6 * 5).map(|i| if i == 4 + 11 * (5 + 6 * 3) { 200 } else { 10 }).collect();
        let grid = Grid::new(extent, Samples::U8(samples), Rescale::default(), Affine::identity());
        let field = Field::new(&Arc::new(grid.expect("a grid")));
        let point = |value: f64, a: f64| ControlPoint { value, rgba: [1.0, 1.0, 1.0, a] };
        let transfer = Transfer::new(vec![point(50.0, 0.0), point(100.0, 1.0)], 1.0).expect("a ramp");
        let occupancy = Occupancy::new(&field, &transfer, VolumeMode::Composite);
        // Sample 4, 5, 3 is a corner of cells 3 and 4, 4 and 5, 2 and 3.
        for (cell, shows) in [([3, 4, 2], true), ([4, 5, 3], true), ([6, 4, 2], true), ([7, 4, 2], false)] {
            let [x, y, z] = cell.map(|c: usize| (c + 1) / EDGE as usize);
            let d = occupancy.distance[(z * field.bricks[1] + y) * field.bricks[0] + x];
            assert_eq!(d == 0, shows, "cell {cell:?}");
        }
        assert_eq!(occupancy.occupied, 2, "the bricks of cells 3 to 6 and of cells -1 to 2 ... 3");
        let [low, end] = occupancy.groups[0];
        assert!((0..3).all(|a| low[a] <= [3, 4, 2][a] && end[a] > [4, 5, 3][a]), "{:?}", occupancy.groups);
    }
}
