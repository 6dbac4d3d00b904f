//! Cuts through a volume, from ordinary ones to those that a careful hand would not make.

use render::scene::Piece;
use render::volume::{Affine, Cutter, Point, Side, Vector};

use super::random::Random;

/// The corners of a box in world space, in the order of their bits.
pub(super) type Corners = [Point; 8];

/// One to three pieces of the box, each of one to four cutters and with a pose.
pub(super) fn any(random: &mut Random, corners: &Corners, size: f64) -> Vec<Piece> {
    (0..=random.below(3)).map(|_| piece(random, corners, size)).collect()
}

fn piece(random: &mut Random, corners: &Corners, size: f64) -> Piece {
    let mut keep = Vec::new();
    for _ in 0..=random.below(2) {
        keep.extend(cutters(random, corners, size));
    }
    let pose = match random.below(3) {
        0 => Affine::identity(),
        1 => Affine::translation(random.shift(size * 0.3)),
        _ => Affine::translation(random.shift(size * 0.2)) * random.turn(),
    };
    Piece { keep, pose }
}

/// One cut, or two that belong together, with the sides to keep.
pub(super) fn cutters(random: &mut Random, corners: &Corners, size: f64) -> Vec<(Cutter, Side)> {
    let middle = corners[0] + (corners[7] - corners[0]) / 2.0;
    let inside = middle + random.shift(size * 0.2);
    let normal = random.direction() * random.power(-3.0, 3.0);
    let side = random.one(&[Side::Plus, Side::Minus]);
    let other = if side == Side::Plus { Side::Minus } else { Side::Plus };
    let edge = corners[1] - corners[0];
    let plane = |point: Point, normal: Vector| Cutter::plane(point, normal).expect("finite numbers");
    match random.below(11) {
        // Through a corner.
        0 => vec![(plane(corners[random.below(8)], normal), side)],
        // Through an edge, turned about it; where the turn is nought, grazing a face.
        1 => {
            let across = edge.cross(&normal);
            vec![(plane(corners[0], across), side)]
        }
        // In a face.
        2 => vec![(plane(corners[random.below(8)], edge), side)],
        // Twice the same plane, told differently: all of one half, or nothing but the plane.
        3 => {
            let along = normal.cross(&edge);
            let same = (plane(inside + along, normal * -2.5), if random.chance(0.5) { other } else { side });
            vec![(plane(inside, normal), side), same]
        }
        // Nearly parallel, crossing in the box.
        4 => {
            let turned = normal + edge.normalize() * (normal.norm() * random.power(-12.0, -4.0));
            vec![(plane(inside, normal), side), (plane(inside, turned), other)]
        }
        // A sliver between two planes.
        5 => {
            let apart = normal.normalize() * (size * random.power(-9.0, -2.0));
            let up = (plane(inside, normal), Side::Plus);
            vec![up, (plane(inside + apart, normal), Side::Minus)]
        }
        6 => {
            let radius = size * random.power(-2.0, 0.5);
            let tube = Cutter::cylinder(inside, normal, radius).expect("a radius");
            vec![(tube, side)]
        }
        7 => {
            let dome = Cutter::dome(inside, size * random.power(-2.0, 0.3)).expect("a radius");
            vec![(dome, side)]
        }
        8 => {
            let right = normal.cross(&(edge + random.direction() * size));
            let extent = [0, 1].map(|_| size * random.power(-2.0, 0.3));
            // A direction along the normal gives no blade.
            Cutter::blade(inside, normal, right, extent).map(|blade| vec![(blade, side)]).unwrap_or_default()
        }
        _ => vec![(plane(inside, normal), side)],
    }
}
