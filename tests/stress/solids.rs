//! The solids that cuts make of a box: none of it is lost and none is there twice.

use std::collections::HashMap;

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

/// Whether every edge is there as often one way as the other, bit by bit: no hole, and no face there twice.
fn is_closed(solid: &ConvexSolid) -> bool {
    let mut open = HashMap::new();
    for (a, b) in solid.edges() {
        let [from, to] = [a, b].map(|p| [p.x, p.y, p.z].map(f64::to_bits));
        *open.entry([from.min(to), from.max(to)]).or_insert(0) += from.cmp(&to) as i32;
    }
    open.values().all(|&count| count == 0)
}

/// Whether no corner of a part lies over its cut by more than rounding puts it there: 17 roundings of the form's terms
/// in the solid before. The form here has six, that at the ends of the cut edge six, the corner's place on the edge
/// three a coordinate, and its share of the edge two.
fn is_within(before: &ConvexSolid, part: &ConvexSolid, half: &HalfSpace) -> bool {
    let Some([low, high]) = before.bounds() else { return part.is_empty() };
    let reach = low.coords.abs().sup(&high.coords.abs());
    let terms = half.normal.abs().dot(&reach) + half.offset.abs();
    part.edges().all(|(p, _)| half.value(p) >= -17.0 * f64::EPSILON / 2.0 * terms)
}

/// The most that rounding may change the sum of the fragments' volumes. They have the faces between them in common, so
/// that where rounding puts a corner changes no sum; what is left is the arithmetic. Each triangle's determinant is of
/// six products, each at most the fragment's box, with eight roundings one on the other; all triangles of a fragment add
/// up without cancelling, as the point they are seen from is a corner of it; and so do the fragments. The box has five.
fn rounding(fragments: &[ConvexSolid], volume: f64) -> f64 {
    let unit = f64::EPSILON / 2.0;
    let of = |fragment: &ConvexSolid| {
        let span = fragment.bounds().map_or(0.0, |[low, high]| (high - low).product());
        // More edges than triangles.
        (8 + 1) as f64 * fragment.edges().count() as f64 * span
    };
    unit * (fragments.iter().map(of).sum::<f64>() + (fragments.len() + 5) as f64 * volume)
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
                let parts = |f: &ConvexSolid| halves.map(|half| f.clipped(&half));
                let fits = |f: &ConvexSolid| parts(f).iter().zip(&halves).all(|(p, h)| is_within(f, p, h));
                if !fragments.iter().all(fits) {
                    return Err(format!("a part reaches over its cut {halves:?}"));
                }
                fragments = fragments.iter().flat_map(parts).collect();
            }
        }
        if !fragments.iter().all(is_closed) {
            return Err(format!("one of {} fragments is not closed", fragments.len()));
        }
        let sum: f64 = fragments.iter().map(ConvexSolid::volume).sum();
        let off = (sum - volume).abs() / volume;
        let most = rounding(&fragments, volume) / volume;
        if off > most { Err(format!("{} fragments sum to {off:e} off", fragments.len())) } else { Ok(()) }
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
