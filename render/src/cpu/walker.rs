//! A ray's way through the voxels of one piece: from wall to wall of its cells, and over clear bricks at once.
//!
//! Between two walls the trilinear scalar is a cubic without a bend, so walls are where it is sampled: a step never
//! straddles a bend, as steps of one length do, and takes as few samples where the ray runs along an axis as it can.

use super::field::{EDGE, Values, trilinear};
use super::painting::{PaintLine, paint};
use super::piece::Placed;

/// A ray as its walkers know it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ray {
    /// Length of a mm of zeta.
    pub(super) mm_per_zeta: f32,
    /// Unit direction in view space.
    pub(super) direction: [f32; 3],
}

/// A place on the way through a piece; zeta in mm.
#[derive(Debug, Clone)]
pub(super) struct Walker<'a> {
    piece: &'a Placed<'a>,
    values: Values<'a>,
    start: [f32; 3],
    growth: [f32; 3],
    /// 1 over growth.
    inverse: [f32; 3],
    extent: [i32; 3],
    cell: [i32; 3],
    /// The walls ahead, of the cell or of the clear box.
    wall: [i32; 3],
    /// Where the cell or the clear box ends.
    pub(super) exit: f32,
    exit_axis: usize,
    /// Whether nothing absorbs up to `exit`.
    pub(super) clear: bool,
    /// First corner of the cell, held inside the samples, and the samples at its corners; bits are x, y, z.
    low: [f32; 3],
    corners: [f32; 8],
    /// The last sampled table position and the antiderivative there.
    position: f32,
    sum: [f64; 4],
    sum_known: bool,
    position_known: bool,
    /// The ray in the labels' voxels, where there are any.
    paint_line: Option<PaintLine>,
    /// Cells sampled.
    pub(super) cells: u32,
}

impl<'a> Walker<'a> {
    /// On a ray at `zeta`, which lies inside the piece's box.
    #[inline(always)]
    pub(super) fn new(piece: &'a Placed<'a>, lens: [f64; 2], zeta: f32) -> Self {
        let (start, growth) = piece.voxel_line(lens);
        let growth = narrow(growth);
        let mut walker = Self {
            piece,
            values: piece.volume.field.values(),
            start: narrow(start),
            growth,
            inverse: [1.0 / growth[0], 1.0 / growth[1], 1.0 / growth[2]],
            extent: piece.volume.field.extent,
            cell: [0; 3],
            wall: [0; 3],
            exit: zeta,
            exit_axis: 0,
            clear: true,
            low: [0.0; 3],
            corners: [0.0; 8],
            position: 0.0,
            sum: [0.0; 4],
            sum_known: false,
            position_known: false,
            paint_line: piece.painting.as_ref().map(|p| p.line(lens)),
            cells: 0,
        };
        for axis in 0..3 {
            walker.cell[axis] = walker.cell_at(axis, zeta).clamp(-1, walker.extent[axis] - 1);
        }
        walker.enter();
        walker
    }

    /// The cell of an axis at `zeta`; on a wall, the one ahead.
    #[inline(always)]
    fn cell_at(&self, axis: usize, zeta: f32) -> i32 {
        let at = self.start[axis] + self.growth[axis] * zeta;
        if self.growth[axis] < 0.0 { at.ceil() as i32 - 1 } else { at.floor() as i32 }
    }

    /// When the ray comes to the wall of an axis; never, if it runs along it.
    #[inline(always)]
    fn reaches(&self, axis: usize) -> f32 {
        if self.growth[axis] == 0.0 {
            f32::INFINITY
        } else {
            (self.wall[axis] as f32 - self.start[axis]) * self.inverse[axis]
        }
    }

    /// On past `exit`.
    #[inline(always)]
    pub(super) fn advance(&mut self) {
        let axis = self.exit_axis;
        let forward = self.growth[axis] >= 0.0;
        if self.clear {
            for other in 0..3 {
                if other != axis {
                    // From where it was to the far side of the box, whatever rounding says.
                    let [mut low, mut high] = [self.cell[other], self.wall[other] - 1];
                    if self.growth[other] < 0.0 {
                        [low, high] = [self.wall[other], self.cell[other]];
                    }
                    self.cell[other] = self.cell_at(other, self.exit).clamp(low, high);
                }
            }
        }
        self.cell[axis] = if forward { self.wall[axis] } else { self.wall[axis] - 1 };
        self.enter();
    }

    #[inline(always)]
    fn enter(&mut self) {
        for axis in 0..3 {
            if self.cell[axis] < -1 || self.cell[axis] >= self.extent[axis] {
                // Only by rounding: the stretch ends with the box.
                (self.clear, self.exit, self.position_known) = (true, f32::INFINITY, false);
                return;
            }
        }
        let [nx, ny, _] = self.piece.volume.field.bricks;
        let [x, y, z] = self.cell;
        let brick = [(x + 1) / EDGE, (y + 1) / EDGE, (z + 1) / EDGE];
        let index = (brick[2] as usize * ny + brick[1] as usize) * nx + brick[0] as usize;
        let distance = i32::from(self.piece.volume.occupancy.distance[index]);
        self.clear = distance > 0;
        let mut next = [0.0; 3];
        for axis in 0..3 {
            let forward = self.growth[axis] >= 0.0;
            self.wall[axis] = match (self.clear, forward) {
                (false, _) => self.cell[axis] + i32::from(forward),
                (true, true) => ((brick[axis] + distance) * EDGE - 1).min(self.extent[axis]),
                (true, false) => ((brick[axis] - distance + 1) * EDGE - 1).max(-1),
            };
            next[axis] = self.reaches(axis);
        }
        if self.clear {
            self.position_known = false;
        } else {
            self.load();
        }
        let [x, y, z] = next;
        self.exit_axis = if x <= y && x <= z {
            0
        } else if y <= z {
            1
        } else {
            2
        };
        self.exit = x.min(y).min(z);
    }

    #[inline(always)]
    fn load(&mut self) {
        self.cells += 1;
        let field = self.piece.volume.field;
        let low = field.low(self.cell);
        self.low = [low[0] as f32, low[1] as f32, low[2] as f32];
        self.corners = field.corners(self.values, low);
    }

    pub(super) fn piece(&self) -> &'a Placed<'a> {
        self.piece
    }

    /// Least and greatest stored number at the cell's corners.
    pub(super) fn corner_range(&self) -> [f32; 2] {
        let first = [self.corners[0]; 2];
        self.corners.iter().fold(first, |[low, high], &v| [low.min(v), high.max(v)])
    }

    /// |n·v| of the gradient at a zeta; none where the field is flat.
    pub(super) fn facing(&self, zeta: f32, ray: &Ray) -> Option<f32> {
        self.piece.facing(self.place(zeta), ray.direction)
    }

    /// Voxel coordinates at a zeta.
    #[inline(always)]
    fn place(&self, zeta: f32) -> [f32; 3] {
        let mut at = [0.0_f32; 3];
        for (axis, at) in at.iter_mut().enumerate() {
            *at = self.start[axis] + self.growth[axis] * zeta;
        }
        at
    }

    /// The scalar inside the cell at a zeta; as a stored number.
    #[inline(always)]
    pub(super) fn number_at(&self, zeta: f32) -> f32 {
        let mut part = [0.0_f32; 3];
        for (axis, part) in part.iter_mut().enumerate() {
            *part = (self.start[axis] + self.growth[axis] * zeta - self.low[axis]).clamp(0.0, 1.0);
        }
        trilinear(&self.corners, part)
    }

    /// The same as a table position.
    #[inline(always)]
    fn position_at(&self, zeta: f32) -> f32 {
        let table = self.piece.volume.table;
        self.number_at(zeta) * table.scale + table.offset
    }

    /// The end of the cell or of the clear box, or the first place after `zeta` where what is painted may change.
    #[inline(always)]
    pub(super) fn next_bend(&self, zeta: f32) -> f32 {
        match self.paint_line {
            Some(line) if !self.clear => self.exit.min(line.next_wall(zeta)),
            _ => self.exit,
        }
    }

    /// Optical depth times colour, and optical depth, from `a`, where the last step ended or the cell begins, to `b`,
    /// both within the cell; `None` where nothing absorbs.
    #[inline(always)]
    pub(super) fn step(&mut self, a: f32, b: f32, ray: &Ray) -> Option<[f32; 4]> {
        let table = self.piece.volume.table;
        if !self.position_known {
            self.position = self.position_at(a);
            (self.position_known, self.sum_known) = (true, false);
        }
        let (before, here) = (self.position, self.position_at(b));
        self.position = here;
        if table.is_clear(before, here) {
            self.sum_known = false;
            return None;
        }
        let sum_before = if self.sum_known { self.sum } else { table.sum(before) };
        self.sum = table.sum(here);
        self.sum_known = true;
        let mut depth = table.depth([before, here], [&sum_before, &self.sum], (b - a) * ray.mm_per_zeta);
        if depth[3] <= 0.0 {
            return None;
        }
        let middle = 0.5 * (a + b);
        if let (Some(painting), Some(line)) = (&self.piece.painting, &self.paint_line)
            && let Some(over) = painting.color_at(line, middle)
        {
            let weight = depth[3];
            paint(&mut depth, weight, over);
        }
        if self.piece.lit {
            self.piece.light(&mut depth, self.place(middle), ray.direction);
        }
        Some(depth)
    }
}

#[inline(always)]
fn narrow([x, y, z]: [f64; 3]) -> [f32; 3] {
    [x as f32, y as f32, z as f32]
}
