//! Cross-sections: flat pictures sampled on the CPU from the original data, never from a texture.
//!
//! A [`Section`] is a rectangle of square pixels in world space, as thin as a plane or as thick as its
//! [`Slab`]. Each [`Layer`] is a volume with its pieces, so a fragment shows where it was moved to. Outlines of
//! meshes and cutters in the plane come as lines in world millimetres.
//!
//! **Thin**: a pixel takes the value at its centre, interpolated as [`Grid::sample`] does, through the inverse of
//! the piece's pose; where two pieces overlap, the later one is seen.
//!
//! **Thick**: a pixel takes the mean, the greatest or the least value along the normal over the slab's thickness,
//! half of it to either side, of all pieces; outside a piece nothing counts. Where a voxel axis of the grid is
//! the normal and the other two are in the plane, the scalar along it is linear between voxel centres: it is taken
//! there and at the ends of the slab, weighted by trapezoids, and the result is exact. Otherwise it is taken in the
//! middle of equal steps of at most half the finest spacing, so that no voxel is passed over. The mean is
//! then of second order in the step: a linear field is exact, a bend of the scalar by a slope of J per mm errs by
//! at most J·step²/8 of the integral, an end at a face or a cutter by half a step of the value there.
//!
//! **Unstructured grids**: a pixel takes the scalar of the cell that its centre lies in, linear between the corners of
//! the cell's tetrahedra (the same ones as in a picture), or the cell's own. Thick sections show the middle plane of them,
//! since a mean or a greatest value of another unit than the volumes' would not be told apart.
//!
//! **Together**: a pixel's colour is the mean of the layers that have a value there, by their weights. Labels are
//! painted on their own layer first: the nearest label in the middle plane, by the rule of
//! [`crate::scene::Labels`]. A grid counts as one more layer, of weight 1, in the colour of its transfer function; where that
//! is clear it has no value. Its opacity, which is that of a length, does not matter otherwise.
//!
//! No GPU and no window here: what a section shows is what a measurement reads.

mod cells;
mod layer;
mod outline;
mod picture;
mod stations;
mod sweep;

#[cfg(test)]
mod tests;

use thiserror::Error;

pub use cells::{CellSpan, cell_spans, cell_value, cell_values};
pub use layer::Layer;
pub use outline::{PieceLine, cutter_outline, mesh_outline, piece_outlines};
pub use picture::{picture, values};

#[cfg(doc)]
use crate::volume::Grid;
use crate::volume::{Affine, Point, Vector};

/// Most pixels of one section: beyond this a window size is a mistake.
const MAX_PIXELS: usize = 1 << 26;

/// Why numbers are not a section.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SectionError {
    /// A number is NaN or infinite, or the scale is not positive.
    #[error("a section has a number that is not finite, or a scale that is not positive")]
    NotFinite,
    /// The two directions have no length or are parallel.
    #[error("the directions of a section do not span a plane")]
    Flat,
    /// A slab's thickness is negative, not a number or beyond [`Slab::MAX_MM`].
    #[error("a slab cannot be {thickness_mm} mm thick: take 0 to {} mm", Slab::MAX_MM)]
    Thickness {
        /// As given.
        thickness_mm: f64,
    },
    /// No pixel, or more than can be meant.
    #[error("a section of {width} by {height} pixels cannot be drawn")]
    Size {
        /// As given.
        width: usize,
        /// As given.
        height: usize,
    },
}

/// What a pixel of a thick section shows of the values along its normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum SlabMode {
    /// Their mean: the integral over the thickness by the length inside the data.
    #[default]
    Mean,
    /// The greatest: a maximum intensity projection.
    Mip,
    /// The least.
    MinIp,
}

/// How thick a section is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Slab {
    /// Half of it lies to either side of the plane; mm. 0 is the plane alone.
    pub thickness_mm: f64,
    /// What is shown of it.
    pub mode: SlabMode,
}

impl Slab {
    /// The thickest slab; mm.
    pub const MAX_MM: f64 = 10_000.0;
}

/// A rectangle of square pixels in world space; rows from the top.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    centre: Point,
    right: Vector,
    down: Vector,
    mm_per_pixel: f64,
    size: [usize; 2],
    slab: Slab,
}

impl Section {
    /// A section whose middle is at `centre` (world mm), with the picture's `right` and `down` as world
    /// directions of any length (`down` is made perpendicular to `right`), `mm_per_pixel` > 0 along
    /// both, and `size` pixels `[width, height]`.
    ///
    /// # Errors
    /// [`SectionError`] for what its variants name.
    pub fn new(
        centre: Point,
        right: Vector,
        down: Vector,
        mm_per_pixel: f64,
        size: [usize; 2],
    ) -> Result<Self, SectionError> {
        let [width, height] = size;
        if width == 0 || height == 0 || width.checked_mul(height).is_none_or(|n| n > MAX_PIXELS) {
            return Err(SectionError::Size { width, height });
        }
        let numbers = centre.iter().chain(right.iter()).chain(down.iter());
        let finite = numbers.copied().all(f64::is_finite);
        if !(finite && mm_per_pixel > 0.0 && mm_per_pixel.is_finite()) {
            return Err(SectionError::NotFinite);
        }
        let right = right.try_normalize(1e-100).ok_or(SectionError::Flat)?;
        let unit_down = down.try_normalize(1e-100).ok_or(SectionError::Flat)?;
        let down =
            (unit_down - right * right.dot(&unit_down)).try_normalize(1e-9).ok_or(SectionError::Flat)?;
        Ok(Self { centre, right, down, mm_per_pixel, size, slab: Slab::default() })
    }

    /// The same section as a slab.
    ///
    /// # Errors
    /// [`SectionError::Thickness`].
    pub fn with_slab(self, slab: Slab) -> Result<Self, SectionError> {
        if (0.0..=Slab::MAX_MM).contains(&slab.thickness_mm) {
            Ok(Self { slab, ..self })
        } else {
            Err(SectionError::Thickness { thickness_mm: slab.thickness_mm })
        }
    }

    /// How thick it is.
    pub fn slab(&self) -> Slab {
        self.slab
    }

    /// The world place in its middle.
    pub fn centre(&self) -> Point {
        self.centre
    }

    /// Pixels, `[width, height]`.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Length of a pixel's side; mm.
    pub fn mm_per_pixel(&self) -> f64 {
        self.mm_per_pixel
    }

    /// Unit vector towards the picture's right.
    pub fn right(&self) -> Vector {
        self.right
    }

    /// Unit vector towards the picture's lower edge.
    pub fn down(&self) -> Vector {
        self.down
    }

    /// Unit vector away from the viewer.
    pub fn forward(&self) -> Vector {
        self.right.cross(&self.down)
    }

    /// World place of a position in pixels; the centre of pixel (i, j) is at (i + 0.5, j + 0.5).
    pub fn point(&self, x: f64, y: f64) -> Point {
        let [width, height] = self.size;
        self.centre
            + self.right * ((x - width as f64 / 2.0) * self.mm_per_pixel)
            + self.down * ((y - height as f64 / 2.0) * self.mm_per_pixel)
    }

    /// Position in pixels of a world place, projected onto the plane; the inverse of
    /// [`Section::point`] for points of the plane.
    pub fn pixel(&self, p: &Point) -> [f64; 2] {
        let from_centre = p - self.centre;
        let along =
            |axis: &Vector, size: usize| axis.dot(&from_centre) / self.mm_per_pixel + size as f64 / 2.0;
        [along(&self.right, self.size[0]), along(&self.down, self.size[1])]
    }

    /// The same section where a transform takes it; `to` is rigid.
    pub(crate) fn moved(&self, to: &Affine) -> Self {
        Self {
            centre: to.point(&self.centre),
            right: to.vector(&self.right),
            down: to.vector(&self.down),
            ..*self
        }
    }

    /// Distance of a world place from the plane, positive behind it as seen by the viewer; mm.
    pub fn depth_mm(&self, p: &Point) -> f64 {
        self.forward().dot(&(p - self.centre))
    }
}

/// Values from black to white: what radiology calls window and level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Value of middle grey ("level").
    pub level: f64,
    /// Values from black to white, > 0.
    pub width: f64,
}

impl Window {
    /// Grey of a value, clamped to 0 (black) … 1 (white). A width that is not positive is a step.
    pub fn grey(&self, value: f64) -> f64 {
        if self.width > 0.0 {
            ((value - self.level) / self.width + 0.5).clamp(0.0, 1.0)
        } else {
            f64::from(u8::from(value >= self.level))
        }
    }
}
