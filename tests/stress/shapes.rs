//! Surfaces to draw: whole, open, inside out, degenerate, flat.

use std::sync::Arc;

use render::scene::{MeshItem, Shading};
use render::volume::{Affine, Point, TriangleMesh, Vector};

use super::random::Random;

/// The corners and triangles of a box of half sides `half`, facing outwards.
pub(super) fn block(half: Vector) -> (Vec<Point>, Vec<[u32; 3]>) {
    let corner = |i: usize| {
        let side = |axis: usize| if i >> axis & 1 == 1 { half[axis] } else { -half[axis] };
        Point::new(side(0), side(1), side(2))
    };
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = sides.iter().flat_map(|s| [[s[0], s[1], s[2]], [s[0], s[2], s[3]]]).collect();
    ((0..8).map(corner).collect(), triangles)
}

/// A square sheet about `point`, across `normal`.
pub(super) fn sheet(point: Point, normal: Vector, half: f64) -> (Vec<Point>, Vec<[u32; 3]>) {
    let mut side = Vector::zeros();
    side[normal.iamin()] = 1.0;
    let a = normal.cross(&side).normalize() * half;
    let b = normal.cross(&a).normalize() * half;
    (vec![point - a - b, point + a - b, point + a + b, point - a + b], vec![[0, 1, 2], [0, 2, 3]])
}

/// A surface about the origin, of about `size`, of any kind but one with coplanar parts.
pub(super) fn any(random: &mut Random, size: f64) -> MeshItem {
    let half = Vector::from_fn(|_, _| size * random.between(0.1, 0.8));
    let (mut positions, mut triangles) = match random.below(4) {
        0 => sheet(Point::from(random.shift(size / 2.0)), random.direction(), size * random.power(-1.0, 1.0)),
        1 => {
            let corners = (0..4).map(|_| Point::from(random.shift(size))).collect();
            (corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        }
        _ => block(half),
    };
    match random.below(5) {
        // Inside out.
        0 => triangles.iter_mut().for_each(|t| t.swap(1, 2)),
        // Open.
        1 => triangles.truncate(triangles.len().div_ceil(2)),
        // Triangles without an area beside good ones: a point, a line, three corners on a line.
        2 => {
            let middle = positions[0] + (positions[1] - positions[0]) / 2.0;
            positions.push(middle);
            let last = positions.len() as u32 - 1;
            triangles.extend([[0, 0, 0], [0, 1, 1], [0, 1, last]]);
        }
        _ => {}
    }
    item(random, positions, triangles)
}

/// Some colour and opacity, and a pose about the origin.
pub(super) fn item(random: &mut Random, positions: Vec<Point>, triangles: Vec<[u32; 3]>) -> MeshItem {
    let opacity = random.one(&[0.0, 0.002, 0.3, 0.5, 0.9, 1.0, 1.0]);
    MeshItem {
        mesh: Arc::new(TriangleMesh::new(positions, triangles).expect("corners that are there")),
        pose: if random.chance(0.5) { random.turn() } else { Affine::identity() },
        color: [random.part(), random.part(), random.part()],
        opacity,
        shading: if random.chance(0.2) { Shading::Lit } else { Shading::None },
    }
}
