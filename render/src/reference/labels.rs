//! Labels along a ray: where the nearest one changes, and what it does to a colour.

use nalgebra::Matrix3;

use super::walk::Line;
use crate::scene::{Labels, Piece};
use crate::volume::{Point, Vector, label_at};

/// The labels of a piece, ready for rays.
#[derive(Debug)]
pub(super) struct Painting<'a> {
    labels: &'a Labels,
    voxel_from_world: Matrix3<f64>,
    /// The centre of the first label, relative to the eye; mm.
    first_voxel: Vector,
}

impl<'a> Painting<'a> {
    /// Labels as they lie with a piece, seen from `eye`.
    pub(super) fn of(labels: &'a Labels, piece: &Piece, eye: &Point) -> Self {
        let world_from_voxel = piece.pose * labels.pose * *labels.grid.world_from_voxel();
        Self {
            labels,
            voxel_from_world: world_from_voxel.inverse().linear(),
            first_voxel: world_from_voxel.point(&Point::origin()) - eye,
        }
    }

    /// A ray in the labels' voxel space. `offset` is its start relative to the eye.
    pub(super) fn line(&self, offset: &Vector, direction: &Vector) -> Line {
        let origin = self.voxel_from_world * (offset - self.first_voxel);
        Line { origin: origin.into(), step: (self.voxel_from_world * direction).into() }
    }

    /// Appends every place between `from` and `to` where another label may be the nearest; mm after `from`.
    pub(super) fn walls(&self, line: &Line, [from, to]: [f64; 2], into: &mut Vec<f64>) {
        for axis in 0..3 {
            let (a, b) = (line.at(axis, from) + 0.5, line.at(axis, to) + 0.5);
            let last = self.labels.grid.extent()[axis] as f64;
            let (low, high) = (a.min(b).ceil().max(0.0), a.max(b).floor().min(last));
            let mut wall = low;
            while wall <= high {
                let at = line.reaches(axis, wall - 0.5);
                if at > from && at < to {
                    into.push(at - from);
                }
                wall += 1.0;
            }
        }
    }

    /// The colour of the nearest label at `t` mm along a ray.
    pub(super) fn color_at(&self, line: &Line, t: f64) -> Option<[f64; 4]> {
        let at = Point::from([0, 1, 2].map(|axis| line.at(axis, t)));
        self.labels.color(label_at(&self.labels.grid, &at))
    }
}

/// A colour under the paint of a label.
pub(super) fn painted(color: [f64; 3], paint: Option<[f64; 4]>) -> [f64; 3] {
    match paint {
        None => color,
        Some([r, g, b, a]) => {
            let over = [r, g, b];
            std::array::from_fn(|c| (1.0 - a) * color[c] + a * over[c])
        }
    }
}
