//! What is affine in space, along the ray of a pixel.
//!
//! A place on a ray is its *zeta*, the depth in mm behind the picture's near plane. A pixel is its *lens*
//! coordinates, affine in its column and row: what the camera's half tangents or half lengths make of -1 to 1. All
//! that is affine in space is then, on one ray, `start + growth · zeta`, both affine in the lens coordinates. Worked
//! out in `f64` relative to the near plane, so that neither a far eye nor a far scene costs digits.

use crate::view::View;
use crate::volume::convex::HalfSpace;
use crate::volume::{Affine, Vector};

/// The rays of a picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rays {
    size: [f64; 2],
    lens: [f64; 2],
    perspective: bool,
    /// Depth of the near plane behind the eye; mm.
    pub(super) near_mm: f64,
}

impl Rays {
    pub(super) fn new(view: &View, near_mm: f64) -> Self {
        Self { size: view.size.map(f64::from), lens: view.lens, perspective: view.perspective, near_mm }
    }

    /// Lens coordinates of a pixel's centre.
    #[inline(always)]
    pub(super) fn lens(&self, x: usize, y: usize) -> [f64; 2] {
        let [width, height] = self.size;
        [
            ((2 * x + 1) as f64 / width - 1.0) * self.lens[0],
            (1.0 - (2 * y + 1) as f64 / height) * self.lens[1],
        ]
    }

    /// Column and row, not whole, of lens coordinates; the centre of pixel 0 is at 0.
    pub(super) fn pixel(&self, lens: [f64; 2]) -> [f64; 2] {
        [
            ((lens[0] / self.lens[0] + 1.0) * self.size[0] - 1.0) / 2.0,
            ((1.0 - lens[1] / self.lens[1]) * self.size[1] - 1.0) / 2.0,
        ]
    }

    /// Lens coordinates of a place in view space; none at or behind a perspective eye's plane.
    pub(super) fn lens_of(&self, p: &Vector) -> Option<[f64; 2]> {
        if !self.perspective {
            return Some([p.x, p.y]);
        }
        (p.z > 1e-6).then(|| [p.x / p.z, p.y / p.z])
    }

    /// Whether rays spread.
    pub(super) fn perspective(&self) -> bool {
        self.perspective
    }

    /// Length of a mm of zeta on a ray.
    #[inline(always)]
    pub(super) fn mm_per_zeta(&self, [x, y]: [f64; 2]) -> f64 {
        if self.perspective { (1.0 + x * x + y * y).sqrt() } else { 1.0 }
    }

    /// Direction of a ray in view space, one mm of depth long.
    #[inline(always)]
    pub(super) fn direction(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        if self.perspective { [x, y, 1.0] } else { [0.0, 0.0, 1.0] }
    }

    /// n·p + d, p in view space.
    pub(super) fn form(&self, value: &HalfSpace) -> Form {
        let (n, near) = (value.normal, self.near_mm);
        let constant = near * n.z + value.offset;
        if self.perspective {
            Form { start: [constant, near * n.x, near * n.y], growth: [n.z, n.x, n.y] }
        } else {
            Form { start: [constant, n.x, n.y], growth: [n.z, 0.0, 0.0] }
        }
    }

    /// A row of an affine transform from view space.
    pub(super) fn row(&self, thing_from_view: &Affine, row: usize) -> Form {
        let m = thing_from_view.matrix();
        let normal = Vector::new(m[(row, 0)], m[(row, 1)], m[(row, 2)]);
        self.form(&HalfSpace { normal, offset: m[(row, 3)] })
    }
}

/// Something affine in space: its start and its growth, each affine in (1, lens x, lens y).
#[derive(Debug, Clone, Copy)]
pub(super) struct Form {
    start: [f64; 3],
    growth: [f64; 3],
}

impl Form {
    /// Value at zeta 0, and what it grows by for each mm of zeta, on one ray.
    #[inline(always)]
    pub(super) fn on(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let at = |f: &[f64; 3]| f[0] + f[1] * x + f[2] * y;
        [at(&self.start), at(&self.growth)]
    }
}
