//! A volume as the ray sees it: the samples about a cell, and the cubics they make along a line.
//!
//! Cell `i` of an axis lies between samples `i` and `i + 1`; samples are numbered from 0, and one that
//! would lie outside is the nearest one inside. Cells -1 and `n - 1` are the outer half voxels, where
//! both samples are the same.

use rayon::prelude::*;

use super::class::Classes;
use super::cubic::Cubic;
use crate::scene::light::{FLAT, value_span};
use crate::scene::{Shading, VolumeItem};
use crate::volume::{Grid, Samples};

/// Cells along the edge of a brick that is skipped as one.
const BRICK: i64 = 8;

/// A volume ready for rays.
#[derive(Debug)]
pub(super) struct Field<'a> {
    grid: &'a Grid,
    pub(super) extent: [i64; 3],
    pub(super) classes: Classes,
    pub(super) lit: bool,
    /// Gradients below this do not light; values per mm.
    pub(super) flat_per_mm: f64,
    bricks: [usize; 3],
    /// For every brick of cells whether all of it is fully transparent; empty where none is skipped.
    clear: Vec<bool>,
}

impl<'a> Field<'a> {
    /// Prepares a volume; looks for clear bricks only if they are to be skipped.
    pub(super) fn of(item: &'a VolumeItem, skip_empty: bool) -> Self {
        let grid = item.grid.as_ref();
        let extent = grid.extent().map(|n| n as i64);
        let bricks = extent.map(|n| (n / BRICK + 1) as usize);
        let mut field = Self {
            grid,
            extent,
            classes: Classes::of(&item.transfer),
            lit: item.shading == Shading::Lit,
            flat_per_mm: FLAT * value_span(&item.transfer, grid.range()),
            bricks,
            clear: Vec::new(),
        };
        if skip_empty {
            let count = bricks.iter().product::<usize>();
            field.clear = (0..count).into_par_iter().map(|b| field.brick_is_clear(b)).collect();
        }
        field
    }

    fn brick_is_clear(&self, brick: usize) -> bool {
        let [nx, ny, _] = self.bricks;
        let at = [brick % nx, brick / nx % ny, brick / (nx * ny)];
        let low = at.map(|b| b as i64 * BRICK - 1);
        let samples = |axis: usize| {
            let n = self.extent[axis];
            low[axis].clamp(0, n - 1) as usize..=(low[axis] + BRICK).clamp(0, n - 1) as usize
        };
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for z in samples(2) {
            for y in samples(1) {
                for x in samples(0) {
                    let v = self.grid.value(x, y, z);
                    range = [range[0].min(v), range[1].max(v)];
                }
            }
        }
        self.classes.range_is_clear(range)
    }

    /// The cells, first and last of each axis, of the brick about a cell, if all of it is clear.
    pub(super) fn clear_brick(&self, cell: [i64; 3]) -> Option<[[i64; 2]; 3]> {
        if self.clear.is_empty() {
            return None;
        }
        let at = cell.map(|i| (i + 1) / BRICK);
        let [nx, ny, _] = self.bricks;
        let clear = self.clear[at[0] as usize + nx * (at[1] as usize + ny * at[2] as usize)];
        clear.then(|| at.map(|b| [b * BRICK - 1, b * BRICK + BRICK - 2]))
    }

    /// Position of a sample in the array, the nearest one where it would lie outside.
    fn index(&self, at: [i64; 3]) -> usize {
        let [x, y, z] = std::array::from_fn(|a| at[a].clamp(0, self.extent[a] - 1) as usize);
        self.grid.index(x, y, z)
    }

    /// Values at the corners of a cell; corner bits are x, y, z.
    pub(super) fn corners(&self, cell: [i64; 3]) -> [f64; 8] {
        self.values(std::array::from_fn(|c| {
            self.index(std::array::from_fn(|axis| cell[axis] + (c as i64 >> axis & 1)))
        }))
    }

    /// Gradients at the corners of a cell, per voxel along each voxel axis: central differences of the
    /// samples. Interpolated they are the central differences, one voxel to either side, of the
    /// trilinear scalar, which is how a gradient is defined here.
    pub(super) fn gradients(&self, cell: [i64; 3]) -> [[f64; 8]; 3] {
        let around: [f64; 64] = self.values(std::array::from_fn(|i| {
            let local = [i & 3, i >> 2 & 3, i >> 4].map(|k| k as i64 - 1);
            self.index(std::array::from_fn(|axis| cell[axis] + local[axis]))
        }));
        std::array::from_fn(|axis| {
            let stride = 1 << (2 * axis);
            std::array::from_fn(|c| {
                let middle = (1 + (c & 1)) + 4 * (1 + (c >> 1 & 1)) + 16 * (1 + (c >> 2));
                (around[middle + stride] - around[middle - stride]) * 0.5
            })
        })
    }

    /// Values at positions in the array, with one look at the kind of samples for all of them.
    fn values<const N: usize>(&self, at: [usize; N]) -> [f64; N] {
        fn pick<T: Copy + Into<f64>, const N: usize>(from: &[T], at: [usize; N]) -> [f64; N] {
            at.map(|i| from[i].into())
        }
        let stored = match self.grid.samples() {
            Samples::U8(v) => pick(v, at),
            Samples::I8(v) => pick(v, at),
            Samples::U16(v) => pick(v, at),
            Samples::I16(v) => pick(v, at),
            Samples::U32(v) => pick(v, at),
            Samples::I32(v) => pick(v, at),
            Samples::F32(v) => pick(v, at),
            Samples::F64(v) => pick(v, at),
        };
        let (rescale, padding) = (self.grid.rescale(), self.grid.padding());
        stored.map(|v| if v.is_finite() { v * rescale.slope + rescale.intercept } else { padding })
    }
}

/// The trilinear interpolation of a cell's corners along the line `from + u·step`, which is in cells
/// from the cell's first corner.
pub(super) fn along(corners: &[f64; 8], from: [f64; 3], step: [f64; 3]) -> Cubic {
    let [v0, v1, v2, v3, v4, v5, v6, v7] = *corners;
    let [x, y, z] = from;
    let [dx, dy, dz] = step;
    let (cx, cy, cz) = (v1 - v0, v2 - v0, v4 - v0);
    let (cxy, cxz, cyz) = (v3 - v2 - v1 + v0, v5 - v4 - v1 + v0, v6 - v4 - v2 + v0);
    let cxyz = v7 - v6 - v5 - v3 + v4 + v2 + v1 - v0;
    Cubic([
        v0 + cx * x + cy * y + cz * z + cxy * x * y + cxz * x * z + cyz * y * z + cxyz * x * y * z,
        cx * dx
            + cy * dy
            + cz * dz
            + cxy * (x * dy + y * dx)
            + cxz * (x * dz + z * dx)
            + cyz * (y * dz + z * dy)
            + cxyz * (x * y * dz + x * z * dy + y * z * dx),
        cxy * dx * dy + cxz * dx * dz + cyz * dy * dz + cxyz * (x * dy * dz + y * dx * dz + z * dx * dy),
        cxyz * dx * dy * dz,
    ])
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::scene::{Piece, TextureFormat};
    use crate::volume::{Affine, ControlPoint, Point, Rescale, Transfer};

    fn noisy() -> VolumeItem {
        let samples = (0..5 * 4 * 3).map(|i| (i * 7919 % 101) as i16).collect();
        let grid = Grid::new([5, 4, 3], Samples::I16(samples), Rescale::default(), Affine::identity());
        let points = vec![ControlPoint { value: 0.0, rgba: [1.0; 4] }];
        VolumeItem {
            packed: None,
            grid: Arc::new(grid.expect("a grid")),
            pose: Affine::identity(),
            transfer: Arc::new(Transfer::new(points, 1.0).expect("a constant")),
            shading: Shading::Lit,
            texture: TextureFormat::Auto,
            pieces: vec![Piece::whole()],
            labels: None,
            mode: Default::default(),
        }
    }

    #[test]
    fn cubics_follow_the_grid_and_its_differences() {
        let item = noisy();
        let (field, grid) = (Field::of(&item, true), &item.grid);
        let mut compared = 0;
        for cell in [[-1, -1, -1], [0, 0, 0], [2, 1, 1], [4, 3, 2], [3, -1, 2], [1, 2, 0]] {
            let (from, step) = ([0.6, 0.7, 0.8], [0.3, -0.2, 0.1]);
            let value = along(&field.corners(cell), from, step);
            let slopes = field.gradients(cell).map(|g| along(&g, from, step));
            for u in [-0.2, 0.0, 0.5, 0.9] {
                let at =
                    Point::from(std::array::from_fn::<f64, 3, _>(|a| cell[a] as f64 + from[a] + u * step[a]));
                // The scalar held at the edge for as far as the differences reach.
                let held = |p: Point| {
                    let inside =
                        std::array::from_fn::<f64, 3, _>(|a| p[a].clamp(0.0, grid.extent()[a] as f64 - 1.0));
                    grid.sample(&Point::from(inside)).expect("inside")
                };
                assert!((value.at(u) - held(at)).abs() < 1e-12, "value in cell {cell:?} at {u}");
                for axis in 0..3 {
                    let mut ends = [at, at];
                    ends[0][axis] -= 1.0;
                    ends[1][axis] += 1.0;
                    let slope = (held(ends[1]) - held(ends[0])) / 2.0;
                    assert!((slopes[axis].at(u) - slope).abs() < 1e-12, "slope {axis} in {cell:?} at {u}");
                    compared += 1;
                }
            }
        }
        assert_eq!(compared, 72, "all were compared");
    }
}
