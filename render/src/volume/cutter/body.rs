//! The convex bodies that cutters are made of.

use super::super::{Point, Vector};
use super::exact::plane_sign;

/// A flat wall of a body; world millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Any point of it.
    pub point: Point,
    /// Out of the body; any length but zero.
    pub normal: Vector,
}

impl Face {
    /// Whether a point lies behind the face, not on it. The sign of n·(p − q) is exact for any finite
    /// input whose products neither overflow nor underflow.
    pub fn is_behind(&self, p: &Point) -> bool {
        plane_sign(&self.normal, p, &self.point) < 0.0
    }
}

/// A convex body without its surface, possibly endless: what every side of a cutter is the inside or the
/// outside of. World millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Body {
    /// All that is behind a plane.
    HalfSpace(Face),
    /// A round cylinder without ends.
    Cylinder {
        /// Any point of its axis.
        point: Point,
        /// Along it; any length but zero.
        axis: Vector,
        /// > 0.
        radius_mm: f64,
    },
    /// A ball.
    Ball {
        /// Its middle.
        centre: Point,
        /// > 0.
        radius_mm: f64,
    },
    /// What is behind five faces: the blade's own first, then the four sides that run back from its edges.
    Prism([Face; 5]),
}

impl Body {
    /// Whether a point is in the body; one on the surface is not. Exact for flat faces, see
    /// [`Face::is_behind`]; for round ones the sign of the `f64` evaluation. That one grows with the radius,
    /// so a point in a body is in every larger one about the same axis or centre.
    pub fn holds(&self, p: &Point) -> bool {
        match self {
            Self::HalfSpace(face) => face.is_behind(p),
            Self::Cylinder { point, axis, radius_mm } => {
                let across = (p - point).cross(axis).norm_squared();
                across < radius_mm * radius_mm * axis.norm_squared()
            }
            Self::Ball { centre, radius_mm } => (p - centre).norm_squared() < radius_mm * radius_mm,
            Self::Prism(faces) => faces.iter().all(|face| face.is_behind(p)),
        }
    }

    /// The flat walls; none of a round body.
    pub fn faces(&self) -> &[Face] {
        match self {
            Self::HalfSpace(face) => std::slice::from_ref(face),
            Self::Prism(faces) => faces,
            Self::Cylinder { .. } | Self::Ball { .. } => &[],
        }
    }
}
