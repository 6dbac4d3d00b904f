//! An oriented plane, and which way a triangle in it faces.

use super::exact::turn;
use crate::volume::cutter::plane_sign;
use crate::volume::{Affine, Cutter, CutterError, Point, Vector};

/// An infinite plane; "+" is where its normal points. Millimetres in the mesh's own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    point: Point,
    normal: Vector,
    /// The axis most across the plane, and whether the normal points up it.
    axis: usize,
    up: bool,
}

impl Plane {
    /// The plane through `point` across `normal`, which may have any length but zero.
    ///
    /// # Errors
    /// [`CutterError::NotFinite`], [`CutterError::NoDirection`].
    pub fn new(point: Point, normal: Vector) -> Result<Self, CutterError> {
        Cutter::plane(point, normal)?;
        let axis = normal.iamax();
        Ok(Self { point, normal, axis, up: normal[axis] > 0.0 })
    }

    /// A point of it.
    pub fn point(&self) -> &Point {
        &self.point
    }

    /// Towards "+".
    pub fn normal(&self) -> &Vector {
        &self.normal
    }

    /// The plane where a transform takes it.
    ///
    /// # Errors
    /// [`CutterError`] where the numbers overflow or vanish.
    pub fn transformed(&self, b_from_a: &Affine) -> Result<Self, CutterError> {
        Self::new(b_from_a.point(&self.point), b_from_a.normal(&self.normal))
    }

    /// 1 on "+", -1 on "-", 0 in the plane; exact, as [`Cutter::side`] is.
    pub(super) fn sign(&self, p: &Point) -> i8 {
        let value = plane_sign(&self.normal, p, &self.point);
        i8::from(value > 0.0) - i8::from(value < 0.0)
    }

    /// n·(p − q): the distance times the normal's length, rounded.
    pub(super) fn value(&self, p: &Point) -> f64 {
        self.normal.dot(&(p - self.point))
    }

    /// Coordinates in the plane, seen from "+": along the two axes that lie least across it.
    pub(super) fn flat(&self, p: &Point) -> [f64; 2] {
        let (u, v) = ((self.axis + 1) % 3, (self.axis + 2) % 3);
        if self.up { [p[u], p[v]] } else { [p[v], p[u]] }
    }

    /// Whether a triangle in the plane is counter-clockwise as seen from "+"; exact.
    pub(super) fn faces(&self, corners: &[Point; 3]) -> bool {
        let [a, b, c] = corners.each_ref().map(|p| self.flat(p));
        turn(a, b, c) > 0.0
    }
}
