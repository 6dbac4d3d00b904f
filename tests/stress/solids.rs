//! The solids that cuts make of a box: none of it is lost and none is there twice.

use render::volume::convex::{ConvexSolid, HalfSpace};
use render::volume::{Cutter, Point, Shape, Side};

use super::random::Random;
use super::{each, parts};

/// A box of any proportions, its corners, and its volume.
fn block(random: &mut Random) -> (ConvexSolid, parts::Corners, f64) {
    let low = Point::from(random.shift(10.0));
    let mut high = low;
    for axis in 0..3 {
        high[axis] += random.power(-1.0, 1.0);
    }
    let corner = |bits: usize| {
        let end = |axis: usize| if bits >> axis & 1 == 1 { high[axis] } else { low[axis] };
        Point::new(end(0), end(1), end(2))
    };
    let volume = (0..3).map(|axis| high[axis] - low[axis]).product();
    (ConvexSolid::from_box(low, high), std::array::from_fn(corner), volume)
}

/// Both sides of a plane; cylinders make no convex solids.
fn halves(cutter: &Cutter) -> Option<[HalfSpace; 2]> {
    match cutter.shape() {
        Shape::Plane { point, normal } => {
            Some([HalfSpace::new(point, *normal), HalfSpace::new(point, -*normal)])
        }
        _ => None,
    }
}

#[test]
fn the_fragments_of_any_cuts_sum_to_the_whole() {
    each("sum of fragments", 2000, |random| {
        let (whole, corners, volume) = block(random);
        let size = (corners[7] - corners[0]).norm();
        let mut fragments = vec![whole];
        for _ in 0..=random.below(6) {
            for (cutter, _) in parts::cutters(random, &corners, size) {
                let Some(halves) = halves(&cutter) else { continue };
                fragments = fragments.iter().flat_map(|f| halves.map(|half| f.clipped(&half))).collect();
            }
        }
        let sum: f64 = fragments.iter().map(ConvexSolid::volume).sum();
        let off = (sum - volume).abs() / volume;
        if off > 1e-12 { Err(format!("{} fragments sum to {off:e} off", fragments.len())) } else { Ok(()) }
    });
}

#[test]
fn ten_thousand_cuts_one_after_the_other_lose_nothing() {
    each("many cuts", 1, |random| {
        let (whole, corners, volume) = block(random);
        let size = (corners[7] - corners[0]).norm();
        let (mut rest, mut taken) = (whole, 0.0);
        for _ in 0..10_000 {
            let (cutter, _) = parts::cutters(random, &corners, size)[0];
            let Some([plus, minus]) = halves(&cutter) else { continue };
            // The larger part is cut on.
            let [a, b] = [rest.clipped(&plus), rest.clipped(&minus)];
            let (keep, lose) = if a.volume() > b.volume() { (a, b) } else { (b, a) };
            taken += lose.volume();
            rest = keep;
        }
        let off = (taken + rest.volume() - volume).abs() / volume;
        if off > 1e-12 { Err(format!("{off:e} of the whole is lost or twice there")) } else { Ok(()) }
    });
}

#[test]
fn a_plane_told_the_other_way_round_keeps_the_other_side() {
    each("planes turned about", 2000, |random| {
        let (_, corners, _) = block(random);
        let scale = 2.0_f64.powi(random.below(20) as i32 - 10);
        let first = parts::cutters(random, &corners, 10.0).first().map(|(cutter, _)| *cutter.shape());
        let Some(Shape::Plane { point, normal }) = first else {
            return Ok(());
        };
        let plane = Cutter::plane(point, normal).expect("a plane");
        let scaled = Cutter::plane(point, normal * scale).expect("a plane");
        let turned = Cutter::plane(point, -normal).expect("a plane");
        for corner in corners {
            let (side, other) = (plane.side(&corner), turned.side(&corner));
            if side != scaled.side(&corner) {
                return Err(format!("a longer normal moves {corner}"));
            }
            // Both are "+" where the point lies in the plane, exactly.
            if side == other && side == Some(Side::Minus) {
                return Err(format!("{corner} is on no side"));
            }
        }
        if plane.side(&point) == Some(Side::Plus) {
            Ok(())
        } else {
            Err("its own point is not on it".to_owned())
        }
    });
}
