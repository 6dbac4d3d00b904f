//! The gradient along a ray inside one cell, and where light by it is not smooth.

use nalgebra::Matrix3;

use super::cubic::Cubic;
use crate::volume::Vector;

/// How often a cell is halved in search of where the gradient becomes too flat to light.
const HALVINGS: u32 = 5;
/// Least cosine between the directions within one panel and their mean.
const SPREAD: f64 = 0.98;
/// The same where the direction counts as constant, whatever the lengths.
const SAME: f64 = 0.999_95;
/// Ratio of the longest to the shortest within one panel at most.
const TAPER: f64 = 4.0;

/// A gradient as three cubics; per mm, along world axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slope {
    axes: [Cubic; 3],
    /// Its part along the ray.
    towards: Cubic,
}

/// Where the vectors of a stretch of a [`Slope`] are: in the hull of four.
struct Hull {
    least_cosine: f64,
    /// No vector is shorter.
    shortest: f64,
    /// None is longer.
    longest: f64,
}

impl Slope {
    /// None at all.
    pub(super) const ZERO: Self = Self { axes: [Cubic::ZERO; 3], towards: Cubic::ZERO };

    /// From the gradient per voxel.
    pub(super) fn new(per_voxel: &[Cubic; 3], to_world: &Matrix3<f64>, direction: &Vector) -> Self {
        let axes = std::array::from_fn(|i| {
            Cubic::sum(per_voxel, [to_world[(i, 0)], to_world[(i, 1)], to_world[(i, 2)]])
        });
        Self { axes, towards: Cubic::sum(&axes, (*direction).into()) }
    }

    /// Appends the places inside `(0, to)` where the gradient turns away from the eye, or becomes
    /// shorter or longer than `flat`.
    pub(super) fn breaks(&self, to: f64, flat: f64, into: &mut Vec<f64>) {
        if self.hull(0.0, to).longest < flat {
            return;
        }
        self.towards.crossings(to, &[0.0], into);
        self.flat_breaks([0.0, to], flat, HALVINGS, into);
    }

    /// Appends where the length passes `flat`: by halves, until a half is all above or all below, or
    /// small enough to be taken as monotone.
    fn flat_breaks(&self, [mut low, mut high]: [f64; 2], flat: f64, halvings: u32, into: &mut Vec<f64>) {
        let hull = self.hull(low, high);
        if hull.shortest >= flat || hull.longest < flat {
            return;
        }
        if halvings > 0 {
            let middle = 0.5 * (low + high);
            self.flat_breaks([low, middle], flat, halvings - 1, into);
            self.flat_breaks([middle, high], flat, halvings - 1, into);
            return;
        }
        let before = self.lights(low, flat);
        if before == self.lights(high, flat) {
            return;
        }
        for _ in 0..48 {
            let middle = 0.5 * (low + high);
            if self.lights(middle, flat) == before { low = middle } else { high = middle }
        }
        into.push(high);
    }

    /// Its length; per mm.
    fn length(&self, u: f64) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|i| self.axes[i].at(u));
        (x * x + y * y + z * z).sqrt()
    }

    /// Whether it is long enough to light; `flat` per mm.
    pub(super) fn lights(&self, u: f64, flat: f64) -> bool {
        let length = self.length(u);
        length > 0.0 && length >= flat
    }

    /// |n·v|.
    pub(super) fn facing(&self, u: f64) -> f64 {
        let length = self.length(u);
        if length > 0.0 { (self.towards.at(u).abs() / length).min(1.0) } else { 0.0 }
    }

    /// Whether light by it is smooth over `[from, to]`: its direction turns little, and it is nowhere so
    /// much shorter than elsewhere that most of the turn happens there; or its direction stays the same.
    pub(super) fn is_steady(&self, from: f64, to: f64) -> bool {
        let hull = self.hull(from, to);
        hull.least_cosine >= SAME || (hull.least_cosine >= SPREAD && hull.shortest * TAPER >= hull.longest)
    }

    fn hull(&self, from: f64, to: f64) -> Hull {
        let points = self.axes.map(|axis| axis.bezier(from, to));
        let point = |i: usize| Vector::new(points[0][i], points[1][i], points[2][i]);
        let all = [point(0), point(1), point(2), point(3)];
        let mean = all.iter().sum::<Vector>();
        let norm = mean.norm();
        if norm == 0.0 {
            let longest = all.iter().map(|p| p.norm()).fold(0.0, f64::max);
            return Hull { least_cosine: if longest > 0.0 { -1.0 } else { 1.0 }, shortest: 0.0, longest };
        }
        let mut hull = Hull { least_cosine: f64::INFINITY, shortest: f64::INFINITY, longest: 0.0 };
        for p in all {
            let (length, along) = (p.norm(), p.dot(&mean) / norm);
            // A vector of no length has every direction: its NaN is passed over.
            hull.least_cosine = hull.least_cosine.min(along / length);
            hull.shortest = hull.shortest.min(along);
            hull.longest = hull.longest.max(length);
        }
        hull
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slope(axes: [[f64; 4]; 3]) -> Slope {
        Slope::new(&axes.map(Cubic), &Matrix3::identity(), &Vector::z())
    }

    #[test]
    fn a_gradient_that_flips_has_a_break_where_it_does_and_two_where_it_is_flat() {
        // (0, 0, u - 0.4): no length at 0.4, below 0.1 from 0.3 to 0.5.
        let s = slope([[0.0; 4], [0.0; 4], [-0.4, 1.0, 0.0, 0.0]]);
        let mut breaks = Vec::new();
        s.breaks(1.0, 0.1, &mut breaks);
        breaks.sort_unstable_by(f64::total_cmp);
        for (found, known) in breaks.iter().zip([0.3, 0.4, 0.5]) {
            assert!((found - known).abs() < 1e-12, "{found} is not {known}");
        }
        assert_eq!(breaks.len(), 3, "{breaks:?}");
        assert!(!s.lights(0.45, 0.1) && s.lights(0.55, 0.1), "flat near the turn only");
        assert_eq!(s.facing(0.1), 1.0, "straight at the eye on either side");
        assert!(!s.is_steady(0.3, 0.6), "it flips");
        assert!(s.is_steady(0.401, 1.0), "it keeps its direction");
    }

    #[test]
    fn a_steady_gradient_is_steady_everywhere_between() {
        let s = slope([[1.0, 0.3, -0.2, 0.1], [0.2, 0.3, 0.1, 0.0], [0.5, -0.2, 0.4, 0.1]]);
        assert!(s.is_steady(0.0, 1.0), "its hull is narrow");
        let middle = s.facing(0.5);
        for i in 0..=50 {
            assert!((s.facing(f64::from(i) / 50.0) - middle).abs() < 0.3, "facing at {i}/50");
        }
    }
}
