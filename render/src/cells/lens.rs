//! A camera over a picture, as corners of cells see it.

use super::scan::Corner;
use crate::view::View;
use crate::volume::{Affine, Point};

/// From a grid's frame to depth and pixels; the middle of the first pixel is (0, 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lens {
    view_from_grid: [[f64; 4]; 3],
    /// Pixels a mm, or a unit of slope.
    scale: [f64; 2],
    middle: [f64; 2],
    perspective: bool,
}

impl Lens {
    pub(super) fn new(view: &View, world_from_grid: &Affine) -> Self {
        let m = (view.view_from_world * *world_from_grid).to_row_major();
        let rows = std::array::from_fn(|r| std::array::from_fn(|c| m[4 * r + c]));
        let half = view.size.map(|n| f64::from(n) / 2.0);
        Self {
            view_from_grid: rows,
            scale: [half[0] / view.lens[0], -half[1] / view.lens[1]],
            middle: half.map(|h| h - 0.5),
            perspective: view.perspective,
        }
    }

    /// Whether rays come from one eye.
    pub(super) fn perspective(&self) -> bool {
        self.perspective
    }

    /// Numbers that make one up.
    pub(super) const NUMBERS: usize = 17;

    /// As a message has it.
    pub(super) fn to_list(self) -> [f64; Self::NUMBERS] {
        let [x, y, z] = self.view_from_grid;
        let mut list = [0.0; Self::NUMBERS];
        let flag = [f64::from(u8::from(self.perspective))];
        for (place, v) in list.iter_mut().zip([&x[..], &y, &z, &self.scale, &self.middle, &flag].concat()) {
            *place = v;
        }
        list
    }

    /// From a message.
    pub(super) fn from_list(list: [f64; Self::NUMBERS]) -> Self {
        Self {
            view_from_grid: std::array::from_fn(|r| std::array::from_fn(|c| list[4 * r + c])),
            scale: [list[12], list[13]],
            middle: [list[14], list[15]],
            perspective: list[16] != 0.0,
        }
    }

    /// A point with its scalar before the camera.
    #[inline(always)]
    pub(super) fn corner(&self, p: &[f64; 3], scalar: f64) -> Corner {
        let [x, y, z] = self.view_from_grid.map(|m| m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3]);
        // A point at the eye itself is on no ray and all: it counts as just before it.
        let z = if x == 0.0 && y == 0.0 && z == 0.0 { 1e-30 } else { z };
        let [x, y] = [x * self.scale[0], y * self.scale[1]];
        let [mx, my] = self.middle;
        if !self.perspective {
            return Corner { x: x + mx, y: y + my, w: 1.0, z, rank: z, scalar };
        }
        // Nearer to the eye's plane a quotient would grow without bound.
        if z > 1e-6 && z * 1e6 > x.abs().max(y.abs()) {
            let weight = 1.0 / z;
            let [x, y] = [x * weight + mx, y * weight + my];
            return Corner { x, y, w: 1.0, z, rank: -weight, scalar };
        }
        // One would say that it was divided.
        let w = if z == 1.0 { z.next_up() } else { z };
        Corner { x: x + mx * w, y: y + my * w, w, z, rank: f64::NAN, scalar }
    }

    /// Millimetres along a pixel's ray for one of depth.
    #[inline(always)]
    pub(super) fn stretch(&self, [i, j]: [i32; 2]) -> f64 {
        if !self.perspective {
            return 1.0;
        }
        let x = (f64::from(i) - self.middle[0]) / self.scale[0];
        let y = (f64::from(j) - self.middle[1]) / self.scale[1];
        (1.0 + x * x + y * y).sqrt()
    }

    /// Pixels that a mm takes at a depth, at most.
    pub(super) fn pixels_per_mm(&self, depth: f64) -> f64 {
        let scale = self.scale[0].abs().max(self.scale[1].abs());
        if self.perspective { scale / depth.max(1e-6) } else { scale }
    }

    /// Place of a point of the grid's frame in the picture and in depth, with no regard to its value.
    pub(super) fn place(&self, point: &Point) -> Corner {
        self.corner(&[point.x, point.y, point.z], 0.0)
    }
}
