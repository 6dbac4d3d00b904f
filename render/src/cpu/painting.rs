//! Labels painted on a piece, along a ray.

use super::line::{Form, Rays};
use crate::scene::{Labels, Piece};
use crate::view::View;
use crate::volume::{Grid, Point, label_at};

/// The labels of a piece before the camera.
#[derive(Debug)]
pub(super) struct Painting<'a> {
    labels: &'a Labels,
    /// Voxel coordinates of the labels.
    voxel: [Form; 3],
}

/// A ray in the labels' voxels: start and growth by zeta.
#[derive(Debug, Clone, Copy)]
pub(super) struct PaintLine {
    start: [f64; 3],
    growth: [f64; 3],
}

impl<'a> Painting<'a> {
    pub(super) fn new(labels: &'a Labels, piece: &Piece, view: &View, rays: &Rays) -> Self {
        let view_from_voxel =
            view.view_from_world * piece.pose * labels.pose * *labels.grid.world_from_voxel();
        let voxel_from_view = view_from_voxel.inverse();
        Self { labels, voxel: [0, 1, 2].map(|row| rays.row(&voxel_from_view, row)) }
    }

    pub(super) fn line(&self, lens: [f64; 2]) -> PaintLine {
        let [x, y, z] = [self.voxel[0].on(lens), self.voxel[1].on(lens), self.voxel[2].on(lens)];
        PaintLine { start: [x[0], y[0], z[0]], growth: [x[1], y[1], z[1]] }
    }

    /// Red, green, blue and share of the nearest label.
    pub(super) fn color_at(&self, line: &PaintLine, zeta: f32) -> Option<[f32; 4]> {
        let at: [f64; 3] = std::array::from_fn(|a| line.start[a] + line.growth[a] * f64::from(zeta));
        let grid: &Grid = &self.labels.grid;
        self.labels.color(label_at(grid, &Point::from(at))).map(|c| c.map(|v| v as f32))
    }
}

impl PaintLine {
    /// The first place after `zeta` where another label may be the nearest: half way between two samples.
    pub(super) fn next_wall(&self, zeta: f32) -> f32 {
        let mut next = f32::INFINITY;
        for axis in 0..3 {
            let (start, growth) = (self.start[axis] + 0.5, self.growth[axis]);
            if growth == 0.0 {
                continue;
            }
            let at = start + growth * f64::from(zeta);
            let mut wall = if growth > 0.0 { at.floor() + 1.0 } else { at.ceil() - 1.0 };
            let mut met = ((wall - start) / growth) as f32;
            if met <= zeta {
                // By rounding it is the wall that the ray is at.
                wall += growth.signum();
                met = ((wall - start) / growth) as f32;
            }
            if met > zeta {
                next = next.min(met);
            }
        }
        next
    }
}

/// A colour, weighted by `weight`, under the paint of a label.
pub(super) fn paint(color: &mut [f32; 4], weight: f32, [r, g, b, share]: [f32; 4]) {
    for (c, over) in color.iter_mut().zip([r, g, b]) {
        *c = (1.0 - share) * *c + share * weight * over;
    }
}
