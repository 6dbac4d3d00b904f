//! Signed distances of simple solids: negative inside, mm, about one mm per mm near the surface.
//!
//! They are evaluated some ten million times for one scan, so they work on plain arrays, which stay
//! fast in an unoptimised build; poses and planes elsewhere are nalgebra. Source of the formulas:
//! I. Quilez, "Distance functions" (round cone, ellipsoid bound, polynomial smooth minimum).

/// A place or a direction; mm.
pub(super) type V = [f64; 3];

pub(super) fn add(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn scale(a: V, by: f64) -> V {
    [a[0] * by, a[1] * by, a[2] * by]
}

pub(super) fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn norm(a: V) -> f64 {
    dot(a, a).sqrt()
}

/// Unit vector along `a`, which has a length.
pub(super) fn unit(a: V) -> V {
    scale(a, 1.0 / norm(a))
}

/// 0 at or below `low`, 1 at or above `high`, smooth between.
pub(super) fn smooth_step(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The union of two solids, rounded within `blend` mm of their crease; exactly the nearer one beyond.
pub(super) fn join(a: f64, b: f64, blend: f64) -> f64 {
    let h = (blend - (a - b).abs()).max(0.0) / blend;
    a.min(b) - h * h * blend * 0.25
}

/// The intersection of two solids, its edge rounded within `blend` mm.
pub(super) fn meet(a: f64, b: f64, blend: f64) -> f64 {
    -join(-a, -b, blend)
}

/// A straight solid with round ends of different radii.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoundCone {
    start: V,
    along: V,
    radii: [f64; 2],
    length2: f64,
    fall: f64,
    slant2: f64,
}

impl RoundCone {
    /// From a ball at `start` to a ball at `end`, neither of which holds the other.
    pub(super) fn new(start: V, radius_start: f64, end: V, radius_end: f64) -> Self {
        let along = sub(end, start);
        let length2 = dot(along, along);
        let fall = radius_start - radius_end;
        Self { start, along, radii: [radius_start, radius_end], length2, fall, slant2: length2 - fall * fall }
    }

    pub(super) fn distance(&self, p: V) -> f64 {
        let from = sub(p, self.start);
        let y = dot(from, self.along);
        let z = y - self.length2;
        let across = sub(scale(from, self.length2), scale(self.along, y));
        let x2 = dot(across, across);
        let (y2, z2) = (y * y * self.length2, z * z * self.length2);
        let k = self.fall.signum() * self.fall * self.fall * x2;
        if z.signum() * self.slant2 * z2 > k {
            (x2 + z2).sqrt() / self.length2 - self.radii[1]
        } else if y.signum() * self.slant2 * y2 < k {
            (x2 + y2).sqrt() / self.length2 - self.radii[0]
        } else {
            ((x2 * self.slant2 / self.length2).sqrt() + y * self.fall) / self.length2 - self.radii[0]
        }
    }
}

/// An ellipsoid with axes along x, y, z. The distance is a bound away from the surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ellipsoid {
    pub(super) centre: V,
    pub(super) radii: V,
}

impl Ellipsoid {
    pub(super) fn distance(&self, p: V) -> f64 {
        let from = sub(p, self.centre);
        let once = [from[0] / self.radii[0], from[1] / self.radii[1], from[2] / self.radii[2]];
        let twice = [once[0] / self.radii[0], once[1] / self.radii[1], once[2] / self.radii[2]];
        let (k0, k1) = (norm(once), norm(twice));
        if k1 < 1e-9 {
            return -self.radii[0].min(self.radii[1]).min(self.radii[2]);
        }
        k0 * (k0 - 1.0) / k1
    }
}

/// `p` stretched along the unit direction `axis`, about `centre`: a solid evaluated there is squashed.
pub(super) fn stretch(p: V, centre: V, axis: V, by: f64) -> V {
    add(p, scale(axis, dot(sub(p, centre), axis) * (by - 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brute force: the solid is the union of balls along the axis.
    #[test]
    fn a_round_cone_is_the_union_of_its_balls() {
        let (a, b) = ([1.0, -2.0, 3.0], [4.0, 6.0, -5.0]);
        for (ra, rb) in [(4.0, 1.5), (1.5, 4.0), (2.0, 2.0)] {
            let cone = RoundCone::new(a, ra, b, rb);
            for k in 0..200 {
                let f = f64::from(k);
                let p = [(f * 0.71).sin() * 12.0, (f * 1.13).cos() * 12.0, (f * 0.37).sin() * 12.0];
                let ball = |i: i32| {
                    let t = f64::from(i) / 4000.0;
                    norm(sub(p, add(a, scale(sub(b, a), t)))) - (ra + (rb - ra) * t)
                };
                let slow = (0..=4000).map(ball).fold(f64::INFINITY, f64::min);
                let fast = cone.distance(p);
                assert!((fast - slow).abs() < 2e-5, "{fast} against {slow} at {p:?}");
            }
        }
    }

    #[test]
    fn blending_changes_nothing_away_from_the_crease() {
        assert_eq!(join(1.0, 5.0, 4.0), 1.0, "the nearer solid alone");
        assert_eq!(join(1.0, 1.0, 4.0), 0.0, "a quarter of the blend at the crease");
        assert_eq!(meet(1.0, 5.0, 4.0), 5.0, "the farther solid alone");
    }
}
