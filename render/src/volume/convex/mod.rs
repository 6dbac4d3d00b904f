//! Convex solids: a grid's box, clipped by half-spaces. The proxy geometry of a fragment.
//!
//! A solid is its faces, each a closed loop of points, counter-clockwise from outside. Clipping keeps
//! what lies where n·p + d ≥ 0 and closes the hole with a cap. Plain `f64`; the exact question of which
//! side a *point* lies on is [`super::Cutter::side`]'s.

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

    /// n·p + d: the signed distance times the normal's length.
    pub fn value(&self, p: &Point) -> f64 {
        self.normal.dot(&p.coords) + self.offset
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
    faces: Vec<Vec<Point>>,
}

impl ConvexSolid {
    /// The axis-parallel box between two corners.
    pub fn from_box(low: Point, high: Point) -> Self {
        let corner = |bits: usize| {
            let at = |axis: usize| if bits >> axis & 1 == 1 { high[axis] } else { low[axis] };
            Point::new(at(0), at(1), at(2))
        };
        let loops = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        Self { faces: loops.map(|face| face.map(corner).to_vec()).to_vec() }
    }

    /// Whether nothing is left.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// The faces: loops of points, counter-clockwise from outside.
    pub fn faces(&self) -> &[Vec<Point>] {
        &self.faces
    }

    /// Every corner; those of several faces come several times.
    pub fn points(&self) -> impl Iterator<Item = &Point> {
        self.faces.iter().flatten()
    }

    /// Both ends of every edge; each edge comes twice.
    pub fn edges(&self) -> impl Iterator<Item = (&Point, &Point)> {
        self.faces.iter().flat_map(|f| f.iter().zip(f.iter().cycle().skip(1)).take(f.len()))
    }

    /// The solid where an affine transform takes it. A mirror turns the faces round.
    #[must_use]
    pub fn transformed(&self, b_from_a: &Affine) -> Self {
        let mut faces: Vec<Vec<Point>> =
            self.faces.iter().map(|f| f.iter().map(|p| b_from_a.point(p)).collect()).collect();
        if b_from_a.linear().determinant() < 0.0 {
            for face in &mut faces {
                face.reverse();
            }
        }
        Self { faces }
    }

    /// What of the solid lies in a half-space, closed with a cap. Touching in a face, an edge or a
    /// corner only leaves nothing.
    #[must_use]
    pub fn clipped(&self, keep: &HalfSpace) -> Self {
        let size = self.points().map(|p| p.coords.amax()).fold(0.0, f64::max);
        // Rounding of the form itself: a corner this near the plane counts as in it.
        let slack = 1e-13 * (keep.normal.amax() * size * 3.0 + keep.offset.abs());
        let value = |p: &Point| {
            let v = keep.value(p);
            if v.abs() <= slack { 0.0 } else { v }
        };
        if self.points().all(|p| value(p) >= 0.0) {
            return self.clone();
        }
        if self.points().all(|p| value(p) <= 0.0) {
            return Self::default();
        }
        let mut faces = Vec::with_capacity(self.faces.len() + 1);
        let mut rim: Vec<Point> = Vec::new();
        for face in &self.faces {
            let mut kept = Vec::with_capacity(face.len() + 1);
            for (a, b) in face.iter().zip(face.iter().cycle().skip(1)) {
                let (va, vb) = (value(a), value(b));
                if va >= 0.0 {
                    kept.push(*a);
                    if va == 0.0 {
                        rim.push(*a);
                    }
                }
                if (va > 0.0 && vb < 0.0) || (va < 0.0 && vb > 0.0) {
                    // The same arithmetic from either end, so that both faces of an edge get one point.
                    let (p, q, vp, vq) = if va > 0.0 { (a, b, va, vb) } else { (b, a, vb, va) };
                    let cut = p + (q - p) * (vp / (vp - vq));
                    kept.push(cut);
                    rim.push(cut);
                }
            }
            if kept.len() >= 3 && kept.iter().any(|p| value_is_inside(keep, p, slack)) {
                faces.push(kept);
            }
        }
        if let Some(cap) = cap(rim, &keep.normal) {
            faces.push(cap);
        }
        Self { faces }
    }

    /// Enclosed volume, in the cube of the points' unit.
    pub fn volume(&self) -> f64 {
        let Some(origin) = self.points().next() else { return 0.0 };
        let fan = |f: &Vec<Point>| {
            let first = f[0] - origin;
            f[1..].windows(2).map(|w| first.dot(&(w[0] - origin).cross(&(w[1] - origin)))).sum::<f64>()
        };
        self.faces.iter().map(fan).sum::<f64>() / 6.0
    }

    /// Least and greatest coordinates; `None` where nothing is left.
    pub fn bounds(&self) -> Option<[Point; 2]> {
        let first = *self.points().next()?;
        Some(self.points().fold([first; 2], |[low, high], p| [low.inf(p), high.sup(p)]))
    }
}

/// Whether a point of a clipped face lies off the plane: a face that lies in it is the cap's business.
fn value_is_inside(keep: &HalfSpace, p: &Point, slack: f64) -> bool {
    keep.value(p) > slack
}

/// The rim's points once each, in a loop seen from outside (against the kept side's normal).
fn cap(mut rim: Vec<Point>, normal: &Vector) -> Option<Vec<Point>> {
    let count = rim.len() as f64;
    let centre = Point::from(rim.iter().map(|p| p.coords).sum::<Vector>() / count);
    let outward = -normal.try_normalize(0.0)?;
    let mut axis = Vector::zeros();
    axis[outward.iamin()] = 1.0;
    let u = axis.cross(&outward).try_normalize(0.0)?;
    let v = outward.cross(&u);
    let angle = |p: &Point| (p - centre).dot(&v).atan2((p - centre).dot(&u));
    rim.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    let size = rim.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
    rim.dedup_by(|a, b| (*a - *b).norm() <= 1e-12 * size);
    if rim.len() > 1 && (rim[0] - rim[rim.len() - 1]).norm() <= 1e-12 * size {
        rim.pop();
    }
    (rim.len() >= 3).then_some(rim)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> ConvexSolid {
        ConvexSolid::from_box(Point::origin(), Point::new(1.0, 1.0, 1.0))
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
                let edges = part.edges().count();
                assert_eq!(edges % 2, 0, "every edge has two faces");
                let mut corners: Vec<Point> = Vec::new();
                for p in part.points() {
                    if corners.iter().all(|q| (p - q).norm() > 1e-9) {
                        corners.push(*p);
                    }
                }
                let euler = corners.len() as i64 - edges as i64 / 2 + part.faces().len() as i64;
                // Slivers may have corners nearer than the comparison above tells apart.
                if part.volume() > 1e-6 {
                    assert_eq!(euler, 2, "V - E + F of {part:?}");
                }
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
