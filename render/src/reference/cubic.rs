//! Cubic polynomials: what a trilinear scalar is along a ray inside one cell.

/// `c0 + c1·u + c2·u² + c3·u³`; u is a length along the ray, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cubic(pub(super) [f64; 4]);

impl Cubic {
    /// The polynomial that is 0 everywhere.
    pub(super) const ZERO: Self = Self([0.0; 4]);

    /// Its value.
    pub(super) fn at(&self, u: f64) -> f64 {
        let [c0, c1, c2, c3] = self.0;
        c0 + u * (c1 + u * (c2 + u * c3))
    }

    /// Its derivative.
    fn slope(&self, u: f64) -> f64 {
        let [_, c1, c2, c3] = self.0;
        c1 + u * (2.0 * c2 + u * 3.0 * c3)
    }

    /// `weights[0]·parts[0] + …`.
    pub(super) fn sum(parts: &[Self; 3], weights: [f64; 3]) -> Self {
        Self(std::array::from_fn(|i| (0..3).map(|a| parts[a].0[i] * weights[a]).sum()))
    }

    /// Its Bézier points on `[from, to]`: every value there is a mean of theirs.
    pub(super) fn bezier(&self, from: f64, to: f64) -> [f64; 4] {
        let third = (to - from) / 3.0;
        let (a, d) = (self.at(from), self.at(to));
        [a, a + third * self.slope(from), d - third * self.slope(to), d]
    }

    /// A range that holds every value on `[from, to]`.
    pub(super) fn bounds(&self, from: f64, to: f64) -> [f64; 2] {
        let [a, b, c, d] = self.bezier(from, to);
        [a.min(b).min(c.min(d)), a.max(b).max(c.max(d))]
    }

    /// Appends every place in the open interval `(0, to)` where the polynomial passes through one of
    /// `levels`. Where it only touches a level there may or may not be an entry.
    pub(super) fn crossings(&self, to: f64, levels: &[f64], into: &mut Vec<f64>) {
        let turns = self.turns(to);
        let mut from = 0.0;
        for next in turns.into_iter().chain([to]) {
            let (a, b) = (self.at(from), self.at(next));
            for &level in levels {
                if (a < level) != (b < level) {
                    into.push(self.root(level, [from, next], a < level));
                }
            }
            from = next;
        }
    }

    /// Its greatest value on `[0, to]`, and where.
    pub(super) fn most(&self, to: f64) -> (f64, f64) {
        let places = self.turns(to).into_iter().chain([to]);
        places.fold((self.at(0.0), 0.0), |best, u| {
            let value = self.at(u);
            if value > best.0 { (value, u) } else { best }
        })
    }

    /// Where the slope changes sign inside `(0, to)`, rising; `to` stands for "no such place".
    fn turns(&self, to: f64) -> [f64; 2] {
        let [_, c1, c2, c3] = self.0;
        // 3·c3·u² + 2·c2·u + c1 = 0, by the form that does not cancel.
        let (a, half_b, c) = (3.0 * c3, c2, c1);
        let disc = half_b * half_b - a * c;
        if disc <= 0.0 {
            return [to; 2];
        }
        let q = -(half_b + disc.sqrt().copysign(half_b));
        let inside = |u: f64| if u > 0.0 && u < to { u } else { to };
        let (p, r) = (inside(q / a), inside(c / q));
        [p.min(r), p.max(r)]
    }

    /// The place of `level` within `[low, high]`, where the polynomial is monotone and passes it.
    fn root(&self, level: f64, [mut low, mut high]: [f64; 2], rising: bool) -> f64 {
        let mut u = 0.5 * (low + high);
        for _ in 0..100 {
            let over = self.at(u) - level;
            if over == 0.0 {
                return u;
            }
            if (over < 0.0) == rising {
                low = u;
            } else {
                high = u;
            }
            let newton = u - over / self.slope(u);
            let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
            if (next - u).abs() <= 4.0 * f64::EPSILON * high {
                return next;
            }
            u = next;
        }
        u
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_roots_of_a_product_are_found() {
        // (u - 0.2)(u - 0.5)(u - 0.9)
        let cubic = Cubic([-0.09, 0.73, -1.6, 1.0]);
        let mut roots = Vec::new();
        cubic.crossings(1.0, &[0.0], &mut roots);
        assert_eq!(roots.len(), 3, "{roots:?}");
        for (found, known) in roots.iter().zip([0.2, 0.5, 0.9]) {
            assert!((found - known).abs() < 1e-14, "{found} is not {known}");
        }
        let (most, at) = cubic.most(0.7);
        assert!((most - cubic.at(at)).abs() < 1e-15 && cubic.slope(at).abs() < 1e-12, "its hill, at {at}");
        let [low, high] = cubic.bounds(0.0, 1.0);
        for i in 0..=100 {
            let v = cubic.at(f64::from(i) / 100.0);
            assert!(low <= v && v <= high, "{v} outside {low} to {high}");
        }
    }

    #[test]
    fn lines_and_parabolas_are_cubics_too() {
        let mut roots = Vec::new();
        Cubic([-1.0, 4.0, 0.0, 0.0]).crossings(1.0, &[0.0, 2.0, 7.0], &mut roots);
        assert_eq!(roots, [0.25, 0.75], "a line passes two of three levels");
        roots.clear();
        // Newton's step from the middle lands on the root itself.
        Cubic([1.0, -3.0, 0.0, 0.0]).crossings(1.0, &[0.25], &mut roots);
        assert_eq!(roots, [0.25], "a root met exactly");
        roots.clear();
        // 4u(1 - u) rises to 1 and falls again.
        Cubic([0.0, 4.0, -4.0, 0.0]).crossings(1.0, &[0.75], &mut roots);
        assert!((roots[0] - 0.25).abs() + (roots[1] - 0.75).abs() < 1e-14, "both flanks, {roots:?}");
        roots.clear();
        Cubic([3.0, 0.0, 0.0, 0.0]).crossings(1.0, &[3.0], &mut roots);
        assert_eq!(roots, [], "a constant passes nothing");
    }
}
