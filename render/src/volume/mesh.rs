//! Triangle meshes: implants, bones from a segmentation.

use thiserror::Error;

use super::Point;

/// Why vertices and triangles are not a mesh.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// There is no triangle.
    #[error("the mesh has no triangle")]
    Empty,
    /// A vertex has a coordinate that is not finite.
    #[error("vertex {vertex} has a coordinate that is not finite")]
    NotFinite {
        /// Position of the vertex.
        vertex: usize,
    },
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} names vertex {vertex}, but there are only {count}")]
    Index {
        /// Position of the triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many there are.
        count: usize,
    },
}

/// Triangles over shared vertices; millimetres in the mesh's own frame.
#[derive(Debug, Clone, PartialEq)]
pub struct TriangleMesh {
    positions: Vec<Point>,
    triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// A mesh of `triangles`, each three positions in `positions`.
    ///
    /// # Errors
    /// [`MeshError`] for what its variants name.
    pub fn new(positions: Vec<Point>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        if triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        if let Some(vertex) = positions.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
            return Err(MeshError::NotFinite { vertex });
        }
        let count = positions.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= count) {
                return Err(MeshError::Index { triangle, vertex, count });
            }
        }
        Ok(Self { positions, triangles })
    }

    /// The vertices.
    pub fn positions(&self) -> &[Point] {
        &self.positions
    }

    /// Three positions in [`TriangleMesh::positions`] each.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The corners of one triangle.
    pub fn corners(&self, triangle: usize) -> [Point; 3] {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }

    /// Least and greatest coordinates of the vertices; never empty.
    pub fn bounds(&self) -> [Point; 2] {
        let mut low = Point::from([f64::INFINITY; 3]);
        let mut high = Point::from([f64::NEG_INFINITY; 3]);
        for p in &self.positions {
            low = low.inf(p);
            high = high.sup(p);
        }
        [low, high]
    }

    /// Enclosed volume by the divergence theorem; mm³, meaningful for a closed mesh only.
    pub fn volume_mm3(&self) -> f64 {
        let centre = self.bounds()[0];
        let sixth = |t: usize| {
            let [a, b, c] = self.corners(t).map(|p| p - centre);
            a.dot(&b.cross(&c)) / 6.0
        };
        (0..self.triangles.len()).map(sixth).sum()
    }
}
