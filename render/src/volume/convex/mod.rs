//! Convex solids: a grid's box, clipped by half-spaces. The proxy geometry of a fragment.
//!
//! A solid is its corners and its faces, each a closed loop of corners, counter-clockwise from outside.
//! Clipping keeps what lies where n·p + d ≥ 0 and closes the hole with a cap.
//!
//! The side of a corner is decided once for all its faces, without rounding, and what becomes of the faces
//! follows from the sides alone: an edge whose ends lie on two sides has one new corner, and the cap runs
//! along those edges in the plane that one face only has. So a clipped solid is closed like the one before,
//! whatever the planes: nearly parallel, through a corner, or the same plane again with other rounding. Only
//! the places of new corners are rounded. The side of a *point* of the volume is [`super::Cutter::side`]'s.

use std::collections::BTreeMap;

use super::cutter::sign_of_sum;
use super::{Affine, Point, Vector};

/// The half-space n·p + d ≥ 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace {
    /// Into the half-space; any length but zero.
    pub normal: Vector,
    /// Value of the form at the origin.
    pub offset: f64,
}

impl HalfSpace {
    /// The side of the plane through `point` that `normal` points to.
    pub fn new(point: &Point, normal: Vector) -> Self {
        Self { normal, offset: -normal.dot(&point.coords) }
    }

    /// n·p + d: the signed distance times the normal's length; its sign is exact, and that of the half-space
    /// turned about is the other one.
    pub fn value(&self, p: &Point) -> f64 {
        let n = &self.normal;
        sign_of_sum([(n.x, p.x), (n.y, p.y), (n.z, p.z), (self.offset, 1.0), (0.0, 0.0), (0.0, 0.0)])
    }

    /// The half-space where `b_from_a` moves this one.
    #[must_use]
    pub fn transformed(&self, b_from_a: &Affine) -> Self {
        let normal = b_from_a.normal(&self.normal);
        // n·A⁻¹q + d with A⁻¹q = Lq + t: the offset gains n·t.
        let shift = b_from_a.inverse().point(&Point::origin()).coords;
        Self { normal, offset: self.offset + self.normal.dot(&shift) }
    }
}

/// A bounded convex solid; possibly empty.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ConvexSolid {
    corners: Vec<Point>,
    /// Loops of at least three corners. Each edge is there as often one way as the other.
    faces: Vec<Vec<usize>>,
}

impl ConvexSolid {
    /// The axis-parallel box between two corners.
    pub fn from_box(low: Point, high: Point) -> Self {
        let corner = |bits: usize| {
            let at = |axis: usize| if bits >> axis & 1 == 1 { high[axis] } else { low[axis] };
            Point::new(at(0), at(1), at(2))
        };
        let loops = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        Self { corners: (0..8).map(corner).collect(), faces: loops.map(|face| face.to_vec()).to_vec() }
    }

    /// Whether nothing is left.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Both ends of every edge; each edge comes twice, once from either end.
    pub fn edges(&self) -> impl Iterator<Item = (&Point, &Point)> {
        self.faces.iter().flat_map(|face| ring(face)).map(|(a, b)| (&self.corners[a], &self.corners[b]))
    }

    /// The solid where an affine transform takes it. A mirror turns the faces round.
    #[must_use]
    pub fn transformed(&self, b_from_a: &Affine) -> Self {
        let mut faces = self.faces.clone();
        if b_from_a.linear().determinant() < 0.0 {
            for face in &mut faces {
                face.reverse();
            }
        }
        Self { corners: self.corners.iter().map(|p| b_from_a.point(p)).collect(), faces }
    }

    /// What of the solid lies in a half-space, closed with a cap. Touching in a face, an edge or a
    /// corner only leaves nothing.
    #[must_use]
    pub fn clipped(&self, keep: &HalfSpace) -> Self {
        let values: Vec<f64> = self.corners.iter().map(|p| keep.value(p)).collect();
        if !values.iter().any(|&v| v > 0.0) {
            return Self::default();
        }
        if values.iter().all(|&v| v >= 0.0) {
            return self.clone();
        }
        let mut corners = self.corners.clone();
        let mut cuts = BTreeMap::new();
        let mut faces = Vec::with_capacity(self.faces.len() + 1);
        let mut rim = Rim::default();
        for face in &self.faces {
            // A face that lies in the plane is the cap's business.
            if !face.iter().any(|&c| values[c] > 0.0) {
                continue;
            }
            let mut kept = Vec::with_capacity(face.len() + 1);
            for (a, b) in ring(face) {
                if values[a] >= 0.0 {
                    kept.push(a);
                }
                let (least, most) = (values[a].min(values[b]), values[a].max(values[b]));
                if least < 0.0 && most > 0.0 {
                    // One corner for both faces of the edge.
                    kept.push(*cuts.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                        corners.push(crossing((&self.corners[a], values[a]), (&self.corners[b], values[b])));
                        corners.len() - 1
                    }));
                }
            }
            let in_plane = |c: usize| values.get(c).is_none_or(|&v| v == 0.0);
            for (a, b) in ring(&kept).filter(|&(a, b)| in_plane(a) && in_plane(b)) {
                rim.add(a, b);
            }
            faces.push(kept);
        }
        faces.extend(rim.into_caps());
        Self { corners, faces }.without_unused_corners()
    }

    /// The same faces, with those corners only that they have.
    fn without_unused_corners(mut self) -> Self {
        let mut place = vec![None; self.corners.len()];
        let mut corners = Vec::with_capacity(self.corners.len());
        for corner in self.faces.iter_mut().flatten() {
            let old = *corner;
            *corner = *place[old].get_or_insert_with(|| {
                corners.push(self.corners[old]);
                corners.len() - 1
            });
        }
        self.corners = corners;
        self
    }

    /// Enclosed volume, in the cube of the points' unit.
    ///
    /// A face is taken as triangles about its least corner: two solids with a face in common then divide it
    /// alike, and what the rounding of its corners gives to the one it takes from the other.
    pub fn volume(&self) -> f64 {
        let Some(origin) = self.corners.first() else { return 0.0 };
        let order =
            |a: &Point, b: &Point| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z));
        let fan = |face: &Vec<usize>| {
            let points = || face.iter().map(|&c| &self.corners[c]);
            let Some((start, least)) = points().enumerate().min_by(|a, b| order(a.1, b.1)) else {
                return 0.0;
            };
            let others: Vec<Vector> =
                points().cycle().skip(start + 1).take(face.len() - 1).map(|p| p - origin).collect();
            let least = least - origin;
            others.windows(2).map(|w| least.dot(&w[0].cross(&w[1]))).sum::<f64>()
        };
        self.faces.iter().map(fan).sum::<f64>() / 6.0
    }

    /// Least and greatest coordinates; `None` where nothing is left.
    pub fn bounds(&self) -> Option<[Point; 2]> {
        let first = *self.corners.first()?;
        Some(self.corners.iter().fold([first; 2], |[low, high], p| [low.inf(p), high.sup(p)]))
    }
}

/// The edges of a loop.
fn ring(face: &[usize]) -> impl Iterator<Item = (usize, usize)> {
    face.iter().copied().zip(face.iter().copied().cycle().skip(1))
}

/// Where a form is 0 on an edge at whose ends it has other signs: the same from either end and for either
/// side of the plane, bit by bit.
fn crossing(a: (&Point, f64), b: (&Point, f64)) -> Point {
    let order = |(p, v): (&Point, f64)| (v.abs(), p.x, p.y, p.z);
    let ((p, vp), (q, vq)) = if order(a) <= order(b) { (a, b) } else { (b, a) };
    p + (q - p) * (vp / (vp - vq))
}

/// The edges in the cutting plane that the kept faces have one way only: where the caps meet them.
#[derive(Debug, Default)]
struct Rim {
    /// By the corner a cap's edge comes from: where it goes.
    next: BTreeMap<usize, Vec<usize>>,
}

impl Rim {
    /// Adds an edge of a face. With that of another face the other way there is no hole.
    fn add(&mut self, a: usize, b: usize) {
        if let Some(ends) = self.next.get_mut(&a)
            && let Some(at) = ends.iter().position(|&end| end == b)
        {
            ends.swap_remove(at);
        } else {
            self.next.entry(b).or_default().push(a);
        }
    }

    /// The caps: mostly one, but rounding may have bent a face that the plane grazes.
    fn into_caps(mut self) -> Vec<Vec<usize>> {
        let mut caps = Vec::new();
        while let Some((first, _)) = self.next.first_key_value() {
            // As many edges come to a corner as go from it: the way ends where it began.
            let mut way = vec![*first];
            while let Some(next) = way.last().and_then(|last| self.next.get_mut(last)).and_then(Vec::pop) {
                match way.iter().position(|&corner| corner == next) {
                    Some(at) => {
                        caps.push(way[at..].to_vec());
                        way.truncate(at + 1);
                    }
                    None => way.push(next),
                }
            }
            self.next.pop_first();
        }
        caps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> ConvexSolid {
        ConvexSolid::from_box(Point::origin(), Point::new(1.0, 1.0, 1.0))
    }

    /// Every edge is there as often one way as the other, bit by bit.
    fn assert_closed(solid: &ConvexSolid) {
        let mut open = BTreeMap::new();
        for (a, b) in solid.edges() {
            let [from, to] = [a, b].map(|p| [p.x, p.y, p.z].map(f64::to_bits));
            *open.entry([from.min(to), from.max(to)]).or_insert(0) += if from < to { 1 } else { -1 };
        }
        open.retain(|[from, to], count| from != to && *count != 0);
        assert!(open.is_empty(), "{} edges of {solid:?} are one way only", open.len());
    }

    /// The parts of a solid on both sides of a plane; closed, and together of its volume.
    fn assert_halved(solid: &ConvexSolid, plane: &HalfSpace) -> [ConvexSolid; 2] {
        let other = HalfSpace { normal: -plane.normal, offset: -plane.offset };
        let parts = [solid.clipped(plane), solid.clipped(&other)];
        parts.iter().for_each(assert_closed);
        let off = parts[0].volume() + parts[1].volume() - solid.volume();
        assert!(off.abs() < 1e-15, "{off:e} lost or twice there at {plane:?}");
        parts
    }

    #[test]
    fn a_plane_through_the_centre_halves_the_volume() {
        let centre = Point::new(0.5, 0.5, 0.5);
        for normal in [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [0.3, -0.7, 0.2]] {
            let half = unit().clipped(&HalfSpace::new(&centre, Vector::from(normal)));
            assert!((half.volume() - 0.5).abs() < 1e-14, "{normal:?}: {}", half.volume());
        }
    }

    #[test]
    fn parts_of_random_cuts_add_up_and_keep_euler_s_formula() {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
        };
        for _ in 0..2000 {
            let mut parts = vec![unit()];
            for _ in 0..4 {
                let point = Point::new(next(), next(), next()) * 0.5 + Vector::repeat(0.5);
                let plane = HalfSpace::new(&point, Vector::new(next(), next(), next()));
                let other = HalfSpace { normal: -plane.normal, offset: -plane.offset };
                parts = parts.iter().flat_map(|s| [s.clipped(&plane), s.clipped(&other)]).collect();
                parts.retain(|s| !s.is_empty());
            }
            let sum: f64 = parts.iter().map(ConvexSolid::volume).sum();
            assert!((sum - 1.0).abs() < 1e-12, "the parts hold {sum}");
            for part in &parts {
                assert_closed(part);
                let euler = part.corners.len() + part.faces.len() - part.edges().count() / 2;
                assert_eq!(euler, 2, "V - E + F of {part:?}");
            }
        }
    }

    #[test]
    fn touching_planes_leave_all_or_nothing() {
        let face = HalfSpace::new(&Point::new(1.0, 0.0, 0.0), Vector::x());
        assert!(unit().clipped(&face).is_empty(), "touching from outside");
        let face = HalfSpace::new(&Point::new(1.0, 0.0, 0.0), -Vector::x());
        assert_eq!(unit().clipped(&face), unit(), "touching from inside");
        let corner = HalfSpace::new(&Point::new(1.0, 1.0, 1.0), Vector::repeat(1.0));
        assert!(unit().clipped(&corner).is_empty(), "a corner only");
    }

    /// The top of the solid is a pentagon, and the plane tilts out of it by the rounding of its form: corners
    /// of it lie off the plane on either side by more than a rounding, and three by less.
    #[test]
    fn a_plane_that_grazes_a_face_has_no_part_of_it_twice() {
        let bevel = HalfSpace { normal: Vector::new(-1.0, -1.0, 0.0), offset: 1.5 };
        let block = unit().clipped(&bevel);
        for exponent in -60..0 {
            let tilt = 2.0_f64.powi(exponent);
            let normal = Vector::new(tilt, 2.0 * tilt, 1.0);
            let [above, below] = assert_halved(&block, &HalfSpace { normal, offset: -1.0 - 1.6 * tilt });
            assert!(above.volume() <= tilt, "{} above a tilt of {tilt:e}", above.volume());
            assert!(below.volume() >= 0.875 - tilt, "{} below a tilt of {tilt:e}", below.volume());
        }
    }

    /// A plane in the cap of another, but for rounding, and turned in it about any axis.
    #[test]
    fn a_cut_again_in_nearly_the_same_plane_loses_nothing() {
        let centre = Point::new(0.5, 0.4, 0.6);
        for (i, exponent) in (0..400).zip((-56..0).cycle()) {
            let angle = f64::from(i);
            let normal = Vector::new(1.0 + angle.sin(), 0.3 + angle.cos(), 0.7);
            let turned = normal + Vector::new((2.0 * angle).cos(), angle.sin(), 0.1) * 2.0_f64.powi(exponent);
            for part in assert_halved(&unit(), &HalfSpace::new(&centre, normal)) {
                assert_halved(&part, &HalfSpace::new(&(centre + normal.cross(&turned)), turned));
                assert_halved(&part, &HalfSpace::new(&centre, turned * 3.0));
            }
        }
    }

    /// Through corners and edges exactly: no corner is made where there is one.
    #[test]
    fn a_plane_through_corners_makes_no_new_ones() {
        for normal in [[1.0, -1.0, 0.0], [1.0, 1.0, -1.0], [1.0, 1.0, -2.0]] {
            let plane = HalfSpace { normal: Vector::from(normal), offset: 0.0 };
            for part in assert_halved(&unit(), &plane) {
                let is_known = |p: &Point| p.iter().all(|&v| v == 0.0 || v == 1.0 || v == 0.5);
                assert!(part.edges().all(|(p, _)| is_known(p)), "{part:?}");
                let euler = part.corners.len() + part.faces.len() - part.edges().count() / 2;
                assert_eq!(euler, 2, "{part:?}");
            }
        }
    }

    #[test]
    fn a_half_space_moves_with_its_points() {
        let turn = Affine::rotation_about(Point::new(1.0, 2.0, 3.0), Vector::new(0.2, 0.5, -1.0), 0.9)
            * Affine::translation(Vector::new(5.0, -6.0, 7.0));
        let plane = HalfSpace::new(&Point::new(0.1, 0.2, 0.3), Vector::new(1.0, -2.0, 0.5));
        let p = Point::new(3.0, -1.0, 2.0);
        let moved = plane.transformed(&turn).value(&turn.point(&p));
        assert!((moved - plane.value(&p)).abs() < 1e-12, "{moved} is not {}", plane.value(&p));
    }
}
