//! The scalar along a ray within one cell: a cubic, by its values at four places.

/// Coefficients over 0 to 1, lowest first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cubic([f64; 4]);

impl Cubic {
    /// The cubic with these values at 0, 1/3, 2/3 and 1.
    pub(super) fn through([a, b, c, d]: [f64; 4]) -> Self {
        Self([
            a,
            -5.5 * a + 9.0 * b - 4.5 * c + d,
            9.0 * a - 22.5 * b + 18.0 * c - 4.5 * d,
            -4.5 * a + 13.5 * b - 13.5 * c + 4.5 * d,
        ])
    }

    /// Less a level: its crossings are then those with it.
    pub(super) fn above(self, level: f64) -> Self {
        let [a, b, c, d] = self.0;
        Self([a - level, b, c, d])
    }

    pub(super) fn at(&self, u: f64) -> f64 {
        let [a, b, c, d] = self.0;
        a + u * (b + u * (c + u * d))
    }

    /// 0, where the slope changes its sign between 0 and 1, rising, and 1; how many those are.
    fn turns(&self) -> ([f64; 4], usize) {
        let [_, b, c, d] = self.0;
        let (half, product) = (c, 3.0 * d * b);
        let discriminant = half * half - product;
        let mut turns = [0.0; 4];
        let mut count = 1;
        if discriminant > 0.0 {
            // The root whose terms do not cancel, and the other by the product of both.
            let q = -(half + half.signum() * discriminant.sqrt());
            let mut roots = [q / (3.0 * d), b / q];
            if roots[0] > roots[1] {
                roots.swap(0, 1);
            }
            for root in roots {
                if root > 0.0 && root < 1.0 {
                    turns[count] = root;
                    count += 1;
                }
            }
        }
        turns[count] = 1.0;
        (turns, count + 1)
    }

    /// The greatest value between 0 and 1, and where.
    pub(super) fn most(&self) -> (f64, f64) {
        let (turns, count) = self.turns();
        let mut most = (f64::NEG_INFINITY, 0.0);
        for &u in &turns[..count] {
            let value = self.at(u);
            if value > most.0 {
                most = (value, u);
            }
        }
        most
    }

    /// Calls `found` for every place between 0 and 1 where the sign changes, rising.
    pub(super) fn crossings(&self, mut found: impl FnMut(f64)) {
        let (turns, count) = self.turns();
        for pair in turns[..count].windows(2) {
            let (mut low, mut high) = (pair[0], pair[1]);
            let below = self.at(low) < 0.0;
            if below == (self.at(high) < 0.0) {
                continue;
            }
            // It runs one way between two turns: halving never fails, and 40 halvings are 1e-12 of the cell.
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if (self.at(middle) < 0.0) == below { low = middle } else { high = middle }
            }
            found(high);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_and_greatest_values_are_those_that_were_built_in() {
        let value = |u: f64| (u - 0.2) * (u - 0.5) * (u - 0.9);
        let cubic = Cubic::through([value(0.0), value(1.0 / 3.0), value(2.0 / 3.0), value(1.0)]);
        let mut found = Vec::new();
        cubic.crossings(|u| found.push(u));
        assert_eq!(found.len(), 3, "{found:?}");
        for (u, known) in found.iter().zip([0.2, 0.5, 0.9]) {
            assert!((u - known).abs() < 1e-9, "{found:?}");
        }
        let (most, at) = cubic.most();
        let best = (0..=10_000).map(|i| value(f64::from(i) / 1e4)).fold(f64::NEG_INFINITY, f64::max);
        assert!((most - best).abs() < 1e-7 && (value(at) - best).abs() < 1e-7, "{most} at {at}, not {best}");
        let line = Cubic::through([1.0, 1.0, 1.0, 1.0]);
        assert_eq!(line.most().0, 1.0, "constant");
        line.crossings(|u| assert!(u.is_nan(), "no crossing of a constant"));
    }
}
