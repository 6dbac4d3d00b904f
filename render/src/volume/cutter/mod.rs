//! Osteotomy cutters and the exact question on which side a point lies.
//!
//! A cutter is a convex set: inside is "-", outside or on the surface is "+". A saw takes material away:
//! with a kerf, "+" begins half of it outside the surface, "-" lies more than half of it inside, and what is
//! between belongs to neither. So each side of any cutter is the inside or the outside of one convex
//! [`Body`], [`Cutter::solid`], and a renderer needs to know nothing else. Without a kerf both sides ask the
//! same body, so that every point is on exactly one.

mod body;
mod exact;

pub use body::{Body, Face};
pub(super) use exact::{plane_sign, sign_of_sum};
use thiserror::Error;

use super::{Affine, Point, Vector};

/// A side of a cutter. "+" of a plane is where its normal points; of the others, outside. A point exactly
/// on the surface is on "+".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Side {
    /// The "+" side, the surface included.
    Plus,
    /// The "-" side.
    Minus,
}

/// Why numbers are not a cutter.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CutterError {
    /// A number is NaN or infinite.
    #[error("a cutter has a number that is not finite")]
    NotFinite,
    /// A normal, axis or blade's direction to the right has no length.
    #[error("a direction of a cutter has no length")]
    NoDirection,
    /// A blade's direction to the right has no part across its normal.
    #[error("the direction to the right of a blade lies along its normal; choose one across it")]
    NoRight,
    /// The radius is not positive.
    #[error("the radius of a cylinder or dome must be positive, not {radius_mm} mm")]
    Radius {
        /// As given.
        radius_mm: f64,
    },
    /// The blade has no extent.
    #[error("a blade must be wider and higher than 0, not {width_mm} x {height_mm} mm")]
    Extent {
        /// As given.
        width_mm: f64,
        /// As given.
        height_mm: f64,
    },
    /// The kerf is negative.
    #[error("the kerf of a saw must be 0 mm or more, not {kerf_mm} mm")]
    Kerf {
        /// As given.
        kerf_mm: f64,
    },
    /// The saw leaves nothing within the cylinder or dome.
    #[error("a kerf of {kerf_mm} mm leaves nothing inside a radius of {radius_mm} mm; make it thinner")]
    NothingInside {
        /// As given.
        kerf_mm: f64,
        /// As given.
        radius_mm: f64,
    },
}

/// The surface of a cutter; world millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// An infinite plane; inside is behind it.
    Plane {
        /// Any point of it.
        point: Point,
        /// Towards "+"; any length but zero.
        normal: Vector,
    },
    /// An infinite round cylinder.
    Cylinder {
        /// Any point of its axis.
        point: Point,
        /// Along it; any length but zero.
        axis: Vector,
        /// > 0.
        radius_mm: f64,
    },
    /// A ball, for dome osteotomies.
    Dome {
        /// Its middle.
        centre: Point,
        /// > 0.
        radius_mm: f64,
    },
    /// A rectangle of a plane. Inside is what it has passed: all behind it within its outline, so a blade
    /// that is shorter than the bone cuts a block out of it.
    Blade {
        /// The middle of the rectangle.
        point: Point,
        /// Towards "+"; any length but zero.
        normal: Vector,
        /// Along its width; any length, and not along the normal. Its part across the normal counts.
        right: Vector,
        /// Along `right`; > 0.
        width_mm: f64,
        /// Across it; > 0.
        height_mm: f64,
    },
}

/// A surface that divides space in two, and how much of it the saw removes. Its numbers are checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cutter {
    shape: Shape,
    kerf_mm: f64,
}

impl Cutter {
    /// A cutter of a shape, by a saw that takes `kerf_mm` away: 0 takes nothing. A blade's kerf is that of
    /// its face; the sides of what it has passed have none.
    ///
    /// # Errors
    /// All of [`CutterError`].
    pub fn new(shape: Shape, kerf_mm: f64) -> Result<Self, CutterError> {
        match shape {
            Shape::Plane { point, normal } => check(&point, &[normal])?,
            Shape::Cylinder { point, axis, radius_mm } => {
                check(&point, &[axis])?;
                check_radius(radius_mm, kerf_mm)?;
            }
            Shape::Dome { centre, radius_mm } => {
                check(&centre, &[])?;
                check_radius(radius_mm, kerf_mm)?;
            }
            Shape::Blade { point, normal, right, width_mm, height_mm } => {
                check(&point, &[normal, right])?;
                if !(width_mm.is_finite() && height_mm.is_finite()) {
                    return Err(CutterError::NotFinite);
                }
                if width_mm <= 0.0 || height_mm <= 0.0 {
                    return Err(CutterError::Extent { width_mm, height_mm });
                }
                if across(&unit(&normal), &unit(&right)).norm() < 1e-6 {
                    return Err(CutterError::NoRight);
                }
            }
        }
        if !kerf_mm.is_finite() {
            return Err(CutterError::NotFinite);
        }
        if kerf_mm < 0.0 {
            return Err(CutterError::Kerf { kerf_mm });
        }
        Ok(Self { shape, kerf_mm })
    }

    /// A plane through `point`, without kerf.
    ///
    /// # Errors
    /// [`CutterError::NotFinite`], [`CutterError::NoDirection`].
    pub fn plane(point: Point, normal: Vector) -> Result<Self, CutterError> {
        Self::new(Shape::Plane { point, normal }, 0.0)
    }

    /// A cylinder about the line through `point` along `axis`, without kerf.
    ///
    /// # Errors
    /// [`CutterError::NotFinite`], [`CutterError::NoDirection`], [`CutterError::Radius`].
    pub fn cylinder(point: Point, axis: Vector, radius_mm: f64) -> Result<Self, CutterError> {
        Self::new(Shape::Cylinder { point, axis, radius_mm }, 0.0)
    }

    /// A ball about `centre`, without kerf.
    ///
    /// # Errors
    /// [`CutterError::NotFinite`], [`CutterError::Radius`].
    pub fn dome(centre: Point, radius_mm: f64) -> Result<Self, CutterError> {
        Self::new(Shape::Dome { centre, radius_mm }, 0.0)
    }

    /// A blade of `size_mm`, `[width, height]`, about `point`, without kerf.
    ///
    /// # Errors
    /// [`CutterError::NotFinite`], [`CutterError::NoDirection`], [`CutterError::NoRight`],
    /// [`CutterError::Extent`].
    pub fn blade(
        point: Point,
        normal: Vector,
        right: Vector,
        [width_mm, height_mm]: [f64; 2],
    ) -> Result<Self, CutterError> {
        Self::new(Shape::Blade { point, normal, right, width_mm, height_mm }, 0.0)
    }

    /// The same surface, cut by a saw of another thickness.
    ///
    /// # Errors
    /// [`CutterError::NotFinite`], [`CutterError::Kerf`], [`CutterError::NothingInside`].
    pub fn with_kerf(self, kerf_mm: f64) -> Result<Self, CutterError> {
        Self::new(self.shape, kerf_mm)
    }

    /// The surface.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// The thickness that the saw takes, half on either side of the surface; mm, 0 or more.
    pub fn kerf_mm(&self) -> f64 {
        self.kerf_mm
    }

    /// What a side keeps: the inside of a convex body (`true`), or all that is not in it (`false`).
    pub fn solid(&self, side: Side) -> (Body, bool) {
        let (out_mm, inside) = match side {
            Side::Plus => (self.kerf_mm / 2.0, false),
            Side::Minus => (-self.kerf_mm / 2.0, true),
        };
        // A point moved along a normal moves no coordinate against it, rounded or not, so "-" and "+" of
        // a flat face never hold the same point.
        let moved = |point: &Point, normal: &Vector| {
            if out_mm == 0.0 { *point } else { point + unit(normal) * out_mm }
        };
        let body = match self.shape {
            Shape::Plane { point, normal } => Body::HalfSpace(Face { point: moved(&point, &normal), normal }),
            Shape::Cylinder { point, axis, radius_mm } => {
                Body::Cylinder { point, axis, radius_mm: radius_mm + out_mm }
            }
            Shape::Dome { centre, radius_mm } => Body::Ball { centre, radius_mm: radius_mm + out_mm },
            Shape::Blade { point, normal, right, width_mm, height_mm } => {
                let right = unit(&across(&unit(&normal), &unit(&right)));
                let up = unit(&normal.cross(&right));
                let side = |normal: Vector, half_mm: f64| Face { point: point + normal * half_mm, normal };
                Body::Prism([
                    Face { point: moved(&point, &normal), normal },
                    side(right, width_mm / 2.0),
                    side(-right, width_mm / 2.0),
                    side(up, height_mm / 2.0),
                    side(-up, height_mm / 2.0),
                ])
            }
        };
        (body, inside)
    }

    /// Whether a side keeps a point.
    pub fn keeps(&self, side: Side, p: &Point) -> bool {
        let (body, inside) = self.solid(side);
        body.holds(p) == inside
    }

    /// The side of `p`; `None` in what the saw takes. See [`Body::holds`] for what is exact.
    pub fn side(&self, p: &Point) -> Option<Side> {
        if self.keeps(Side::Plus, p) {
            Some(Side::Plus)
        } else if self.kerf_mm == 0.0 || self.keeps(Side::Minus, p) {
            Some(Side::Minus)
        } else {
            None
        }
    }

    /// The cutter where a rigid pose takes it.
    #[must_use]
    pub fn moved(&self, pose: &Affine) -> Self {
        let shape = match self.shape {
            Shape::Plane { point, normal } => {
                Shape::Plane { point: pose.point(&point), normal: pose.vector(&normal) }
            }
            Shape::Cylinder { point, axis, radius_mm } => {
                Shape::Cylinder { point: pose.point(&point), axis: pose.vector(&axis), radius_mm }
            }
            Shape::Dome { centre, radius_mm } => Shape::Dome { centre: pose.point(&centre), radius_mm },
            Shape::Blade { point, normal, right, width_mm, height_mm } => Shape::Blade {
                point: pose.point(&point),
                normal: pose.vector(&normal),
                right: pose.vector(&right),
                width_mm,
                height_mm,
            },
        };
        Self { shape, kerf_mm: self.kerf_mm }
    }
}

/// A direction of length 1. Directions were checked, so there is one.
fn unit(direction: &Vector) -> Vector {
    direction.try_normalize(0.0).unwrap_or_else(Vector::z)
}

/// The part of `v` across a unit vector.
fn across(unit: &Vector, v: &Vector) -> Vector {
    v - unit * unit.dot(v)
}

fn check(point: &Point, directions: &[Vector]) -> Result<(), CutterError> {
    let numbers = point.iter().chain(directions.iter().flat_map(|d| d.iter()));
    if numbers.copied().any(|v| !v.is_finite()) {
        return Err(CutterError::NotFinite);
    }
    // A subnormal length would underflow in every product that follows.
    if directions.iter().any(|d| d.amax() < 1e-100) {
        return Err(CutterError::NoDirection);
    }
    Ok(())
}

fn check_radius(radius_mm: f64, kerf_mm: f64) -> Result<(), CutterError> {
    if !radius_mm.is_finite() {
        return Err(CutterError::NotFinite);
    }
    if radius_mm <= 0.0 {
        return Err(CutterError::Radius { radius_mm });
    }
    if radius_mm <= kerf_mm / 2.0 {
        return Err(CutterError::NothingInside { kerf_mm, radius_mm });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
