//! From triangles over the vertices of a cut to a mesh of its own.

use rayon::prelude::*;

use super::divide::{Points, Triangle};
use crate::volume::{Point, TriangleMesh};

/// The mesh of some triangles, with the vertices that they use, in their order; none where there is no triangle.
pub(super) fn gather(points: &Points<'_>, lists: &[&[Triangle]]) -> Option<TriangleMesh> {
    const UNUSED: u32 = u32::MAX;
    let mut place = vec![UNUSED; points.count()];
    for vertex in lists.iter().flat_map(|list| list.iter()).flatten() {
        place[*vertex as usize] = 0;
    }
    let mut positions: Vec<Point> = Vec::with_capacity(place.iter().filter(|&&p| p != UNUSED).count());
    for (vertex, place) in place.iter_mut().enumerate() {
        if *place != UNUSED {
            *place = positions.len() as u32;
            positions.push(points.at(vertex as u32));
        }
    }
    let mut triangles = Vec::with_capacity(lists.iter().map(|list| list.len()).sum());
    for list in lists {
        triangles.par_extend(list.par_iter().with_min_len(8192).map(|t| t.map(|v| place[v as usize])));
    }
    // Every vertex is finite: the mesh's own are, and a new one lies between two of them.
    TriangleMesh::new(positions, triangles).ok()
}
