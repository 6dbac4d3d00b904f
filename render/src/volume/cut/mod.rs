//! Cutting triangle meshes by planes and convex solids into closed halves.
//!
//! [`by_plane`] and [`by_solid`] divide a mesh into what lies on "+" and on "-". Where the mesh is closed, so
//! are both parts: the opening is covered by a cap of triangles over exactly the vertices of its rim, the same
//! in both parts but turned round, so every edge is used as often in one direction as in the other.
//!
//! # How
//! `divide` asks for the side of every vertex, exactly, and cuts the triangles that lie across; an edge that
//! is cut gets one vertex, whichever triangle asks. A vertex in the plane belongs to both parts and is never
//! doubled. A triangle in the plane bounds the part that lies behind it. `lines` finds the edges in the plane
//! where the two parts meet, counted with their direction, and joins them to closed lines. `cap` sorts those
//! into outlines and holes, `ears` covers them. `solid` repeats this for each plane of a convex solid and puts
//! the remaining caps, turned round, on what was cut away.
//!
//! # What is exact
//! The side of a vertex, and with it which triangles are cut and which edges meet. The vertices that a cut
//! makes are rounded to `f64`. That parts are closed does not depend on any of these numbers: a cap is made
//! by leaving out one vertex of its rim after the other, which is right as a list of edges even where
//! rounding, or a mesh that passes through itself, makes it overlap.
//!
//! # What is not closed
//! Where a mesh is open, or its triangles disagree about inside, the cut can leave lines that do not close.
//! They get no cap and are counted in [`Notes::open`]. The rim of an opening that lies in the plane is no cut
//! and stays open.

mod cap;
mod divide;
mod ears;
mod exact;
mod lines;
mod part;
mod plane;
mod solid;
#[cfg(test)]
mod tests;

use rayon::prelude::*;
use thiserror::Error;

pub use plane::Plane;
pub use solid::{DEFAULT_SAGITTA_MM, Solid, SolidError, by_solid};

use super::TriangleMesh;
use divide::{Crossings, Points, divide};

/// Why a mesh cannot be cut.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum CutError {
    /// The vertices of the parts could not be counted in 32 bits.
    #[error("a mesh of {triangles} triangles is too large to be cut; simplify it first")]
    TooLarge {
        /// How many it has.
        triangles: usize,
    },
}

/// What the cut met.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Notes {
    /// Closed lines in the cutting planes, each covered.
    pub closed: usize,
    /// Lines that do not close, since the mesh is open there or contradicts itself; not covered.
    pub open: usize,
}

/// A mesh in two parts. A part without triangles is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// What lies on "+": of a plane, where its normal points; of a solid, outside.
    pub plus: Option<TriangleMesh>,
    /// What lies on "-".
    pub minus: Option<TriangleMesh>,
    /// What the cut met.
    pub notes: Notes,
}

/// Divides a mesh by a plane.
///
/// Triangles keep their order, followed by the parts of those that were cut and by the cap; the result is the
/// same for any number of threads. Vertices that no triangle uses are dropped.
///
/// # Errors
/// [`CutError::TooLarge`].
pub fn by_plane(mesh: &TriangleMesh, plane: &Plane) -> Result<Parts, CutError> {
    let mut points = Points::of(mesh);
    points.check_room(mesh.triangles().len())?;
    let signs: Vec<i8> = mesh.positions().par_iter().with_min_len(8192).map(|p| plane.sign(p)).collect();
    let divided = divide(&mut points, plane, &signs, mesh.triangles(), &mut Crossings::default(), || {
        mesh.volume_mm3() < 0.0
    });
    let cap = cap::of(divided.rim, &points, plane);
    let turned: Vec<[u32; 3]> = cap.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let (plus, minus) = rayon::join(
        || part::gather(&points, &[&divided.plus, &turned]),
        || part::gather(&points, &[&divided.minus, &cap.triangles]),
    );
    Ok(Parts { plus, minus, notes: cap.notes })
}
