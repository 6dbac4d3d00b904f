//! Where along a ray a piece of a volume is: its box less what cutters take away.

use nalgebra::Matrix3;

use crate::volume::{Affine, Cutter, Point, Shape, Side, Vector};

/// Disjoint stretches of a ray, rising; mm from its start.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Intervals(Vec<[f64; 2]>);

impl Intervals {
    /// Makes it one stretch.
    pub(super) fn reset(&mut self, from: f64, to: f64) {
        self.0.clear();
        if from < to {
            self.0.push([from, to]);
        }
    }

    /// The stretches.
    pub(super) fn stretches(&self) -> &[[f64; 2]] {
        &self.0
    }

    /// Keeps what lies between `from` and `to`.
    fn keep(&mut self, from: f64, to: f64) {
        self.0.retain_mut(|s| {
            *s = [s[0].max(from), s[1].min(to)];
            s[0] < s[1]
        });
    }

    /// Removes what lies between `from` and `to`.
    fn remove(&mut self, from: f64, to: f64) {
        let mut i = 0;
        while i < self.0.len() {
            let [a, b] = self.0[i];
            let parts = [[a, b.min(from)], [a.max(to), b]];
            let mut left = parts.into_iter().filter(|s| s[0] < s[1]);
            match (left.next(), left.next()) {
                (None, _) => {
                    self.0.remove(i);
                    continue;
                }
                (Some(one), None) => self.0[i] = one,
                (Some(one), Some(two)) => {
                    self.0[i] = one;
                    i += 1;
                    self.0.insert(i, two);
                }
            }
            i += 1;
        }
    }
}

/// A cutter of a piece, ready for rays.
#[derive(Debug, Clone)]
pub(super) struct Cut {
    shape: Shape,
    side: Side,
    /// How far the side's border is outside the surface; mm, negative for inside.
    out_mm: f64,
    /// Takes world directions to the volume's unmoved place.
    unmoved_from_world: Matrix3<f64>,
    /// The cutter's point where the piece's pose takes it, relative to the eye. Subtracting the eye
    /// first keeps the digits of a scene far from the origin.
    point: Vector,
}

impl Cut {
    /// `pose` is the piece's, `world_from_unmoved`.
    pub(super) fn new(cutter: &Cutter, side: Side, pose: &Affine, eye: &Point) -> Self {
        let (Shape::Plane { point, .. }
        | Shape::Cylinder { point, .. }
        | Shape::Dome { centre: point, .. }
        | Shape::Blade { point, .. }) = cutter.shape();
        let out_mm = match side {
            Side::Plus => cutter.kerf_mm() / 2.0,
            Side::Minus => cutter.kerf_mm() / -2.0,
        };
        let unmoved_from_world = pose.inverse().linear();
        Self { shape: *cutter.shape(), side, out_mm, unmoved_from_world, point: pose.point(point) - eye }
    }

    /// Takes away what is not on the kept side. `offset` is the ray's start relative to the eye.
    pub(super) fn apply(&self, offset: &Vector, direction: &Vector, intervals: &mut Intervals) {
        let from = self.unmoved_from_world * (offset - self.point);
        let along = self.unmoved_from_world * direction;
        let (low, high) = match self.shape {
            Shape::Plane { normal, .. } => below(&from, &along, &normal.normalize(), self.out_mm),
            Shape::Cylinder { axis, radius_mm, .. } => {
                let axis = axis.normalize();
                let across = |v: Vector| v - axis * axis.dot(&v);
                inside_ball(&across(from), &across(along), radius_mm + self.out_mm)
            }
            Shape::Dome { radius_mm, .. } => inside_ball(&from, &along, radius_mm + self.out_mm),
            Shape::Blade { normal, right, width_mm, height_mm, .. } => {
                let normal = normal.normalize();
                let up = normal.cross(&right).normalize();
                let right = up.cross(&normal);
                let walls = [
                    (normal, self.out_mm),
                    (right, width_mm / 2.0),
                    (-right, width_mm / 2.0),
                    (up, height_mm / 2.0),
                    (-up, height_mm / 2.0),
                ];
                walls.iter().fold((f64::NEG_INFINITY, f64::INFINITY), |(low, high), (outward, at)| {
                    let (from, to) = below(&from, &along, outward, *at);
                    (low.max(from), high.min(to))
                })
            }
        };
        match self.side {
            Side::Plus if low < high => intervals.remove(low, high),
            Side::Plus => {}
            Side::Minus => intervals.keep(low, high),
        }
    }
}

/// The stretch of `from + t·along` that is less than `at` high along the unit vector `outward`.
fn below(from: &Vector, along: &Vector, outward: &Vector, at: f64) -> (f64, f64) {
    let (height, rise) = (outward.dot(from) - at, outward.dot(along));
    if rise == 0.0 {
        let end = if height < 0.0 { f64::NEG_INFINITY } else { f64::INFINITY };
        return (end, f64::INFINITY);
    }
    let crossing = -height / rise;
    if rise > 0.0 { (f64::NEG_INFINITY, crossing) } else { (crossing, f64::INFINITY) }
}

/// The stretch of `m + t·w` inside a ball about the origin; empty where low is not below high. A cylinder
/// is a ball to what is across its axis.
fn inside_ball(m: &Vector, w: &Vector, radius: f64) -> (f64, f64) {
    let a = w.norm_squared();
    // Directions are unit vectors: below this the ray runs along the axis to all digits.
    if a < 1e-30 {
        let inside = m.norm_squared() < radius * radius;
        return if inside { (f64::NEG_INFINITY, f64::INFINITY) } else { (f64::INFINITY, f64::INFINITY) };
    }
    // The discriminant by the distance of closest approach: no cancellation for a far eye.
    let disc = a * radius * radius - m.cross(w).norm_squared();
    if disc <= 0.0 {
        return (f64::INFINITY, f64::INFINITY);
    }
    let (middle, half) = (-m.dot(w) / a, disc.sqrt() / a);
    (middle - half, middle + half)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn removing_the_middle_leaves_two_ends() {
        let mut i = Intervals::default();
        i.reset(0.0, 10.0);
        i.remove(4.0, 6.0);
        assert_eq!(i.stretches(), [[0.0, 4.0], [6.0, 10.0]], "a gap");
        i.remove(5.0, 7.0);
        i.keep(1.0, f64::INFINITY);
        assert_eq!(i.stretches(), [[1.0, 4.0], [7.0, 10.0]], "both ends trimmed");
        i.remove(f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!(i.stretches(), [] as [[f64; 2]; 0], "nothing left");
    }

    /// Every stretch agrees with asking the cutter itself, point by point.
    #[test]
    fn kept_stretches_agree_with_the_side_test() {
        let cutters = [
            Cutter::plane(Point::new(1.0, 2.0, -1.0), Vector::new(1.0, -2.0, 0.5)).expect("plane"),
            Cutter::cylinder(Point::new(0.5, 0.0, 3.0), Vector::new(2.0, 1.0, 1.0), 2.5).expect("cylinder"),
            Cutter::dome(Point::new(0.5, -1.0, 2.0), 2.7).expect("dome"),
            Cutter::blade(Point::new(1.0, 0.0, 1.0), Vector::new(-1.0, 2.0, 0.5), Vector::x(), [5.0, 3.0])
                .expect("blade"),
        ];
        let thick = cutters.map(|c| c.with_kerf(0.8).expect("kerf"));
        let pose = Affine::rotation_about(Point::new(3.0, 1.0, 2.0), Vector::new(1.0, 1.0, 0.2), 0.8)
            * Affine::translation(Vector::new(0.5, -1.0, 2.0));
        let eye = Point::new(-9.0, 4.0, 7.0);
        let mut checked = 0;
        for (n, cutter) in cutters.iter().chain(&thick).enumerate() {
            for side in [Side::Plus, Side::Minus] {
                let cut = Cut::new(cutter, side, &pose, &eye);
                for k in 0..40 {
                    let target = Point::new(f64::from(k % 7) - 3.0, f64::from(k % 5) - 2.0, f64::from(k % 3));
                    let direction = (target - eye).normalize();
                    let mut kept = Intervals::default();
                    kept.reset(0.0, 40.0);
                    cut.apply(&Vector::zeros(), &direction, &mut kept);
                    for step in 0..400 {
                        let t = f64::from(step) * 0.1 + 0.0371;
                        let at = pose.inverse().point(&(eye + direction * t));
                        let inside = kept.stretches().iter().any(|s| s[0] <= t && t <= s[1]);
                        assert_eq!(
                            inside,
                            cutter.side(&at) == Some(side),
                            "cutter {n}, {side:?}, ray {k}, {t} mm"
                        );
                        checked += usize::from(inside);
                    }
                }
            }
        }
        assert!(checked > 1000, "only {checked} points were kept");
    }
}
