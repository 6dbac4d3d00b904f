//! Emission and absorption along a ray.
//!
//! Between two places where the integrand is not smooth the optical depth and the colour are integrated
//! by the four nodes of Gauss and Legendre. The depth up to each node, which the colour needs, comes from
//! the matrix of the implicit Runge-Kutta method on the same nodes (Butcher 1964, "Implicit Runge-Kutta
//! processes"; Hairer, Nørsett, Wanner, "Solving ODE I", II.7): the integral up to the node of the cubic
//! through the four values.

use super::cells::Linear;
use super::walk::Walker;

/// Transmittance below which the rest of a ray cannot be seen: 2.6e-5 of 1/255.
pub(super) const DARK: f64 = 1e-7;
/// Optical depth of one panel at most.
const DEPTH: f64 = 0.5;
/// How often a panel is halved at most.
const HALVINGS: u32 = 40;
/// How often where it is for the light's sake, so that a gradient that spins does not hold up the ray.
const HALVINGS_FOR_LIGHT: u32 = 10;

/// Nodes on `[0, 1]`.
const NODES: [f64; 4] =
    [0.069_431_844_202_973_71, 0.330_009_478_207_571_87, 0.669_990_521_792_428_1, 0.930_568_155_797_026_3];
/// Weights of the nodes.
const WEIGHTS: [f64; 4] =
    [0.173_927_422_568_726_93, 0.326_072_577_431_273_07, 0.326_072_577_431_273_07, 0.173_927_422_568_726_93];
/// `UP_TO[i][j]`: weight of node j in the integral from 0 to node i.
const UP_TO: [[f64; 4]; 4] = [
    [
        0.086_963_711_284_363_46,
        -0.026_604_180_084_998_793,
        0.012_627_462_689_404_725,
        -0.003_555_149_685_795_683,
    ],
    [
        0.188_118_117_499_868_07,
        0.163_036_288_715_636_54,
        -0.027_880_428_602_470_895,
        0.006_735_500_594_538_156,
    ],
    [
        0.167_191_921_974_188_77,
        0.353_953_006_033_743_97,
        0.163_036_288_715_636_54,
        -0.014_190_694_931_141_143,
    ],
    [0.177_482_572_254_522_6, 0.313_445_114_741_868_35, 0.352_676_757_516_271_86, 0.086_963_711_284_363_46],
];

/// What a ray is in.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meets<'a> {
    pub(super) walkers: &'a [Walker<'a>],
    pub(super) cells: &'a [Linear<'a>],
}

impl Meets<'_> {
    /// Colour and extinction (1/mm) of each at `t`.
    fn classify(&self, t: f64) -> impl Iterator<Item = ([f64; 3], f64)> {
        let in_pieces = self.walkers.iter().filter(|w| !w.clear).map(move |w| w.classify(t));
        in_pieces.chain(self.cells.iter().map(move |cell| cell.classify(t)))
    }
}

/// What a ray has gathered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gathered {
    /// Premultiplied.
    pub(super) color: [f64; 3],
    /// What comes through from behind.
    pub(super) through: f64,
}

impl Gathered {
    /// Nothing yet.
    pub(super) const START: Self = Self { color: [0.0; 3], through: 1.0 };

    /// Adds a surface.
    pub(super) fn surface(&mut self, color: [f64; 3], opacity: f64) {
        for (sum, c) in self.color.iter_mut().zip(color) {
            *sum += self.through * opacity * c;
        }
        self.through *= 1.0 - opacity;
    }

    /// Adds a stretch in which no walker leaves its span and no cell ends, in `parts` equal parts.
    pub(super) fn stretch(&mut self, meets: Meets<'_>, from: f64, to: f64, parts: u32) {
        let at = |i: u32| from + (to - from) * f64::from(i) / f64::from(parts);
        for i in 0..parts {
            self.panel(meets, at(i), if i + 1 == parts { to } else { at(i + 1) }, 0);
        }
    }

    fn panel(&mut self, meets: Meets<'_>, from: f64, to: f64, halvings: u32) {
        let length = to - from;
        if length <= 0.0 || self.through < DARK {
            return;
        }
        if halvings < HALVINGS && rough(meets, from, to, halvings) {
            let middle = 0.5 * (from + to);
            self.panel(meets, from, middle, halvings + 1);
            self.panel(meets, middle, to, halvings + 1);
            return;
        }
        let mut tau = [0.0; 4];
        let mut glow = [[0.0; 3]; 4];
        for node in 0..4 {
            let t = from + length * NODES[node];
            for (color, extinction) in meets.classify(t) {
                tau[node] += extinction;
                for c in 0..3 {
                    glow[node][c] += extinction * color[c];
                }
            }
        }
        let depth = |weights: &[f64; 4]| length * (0..4).map(|j| weights[j] * tau[j]).sum::<f64>();
        let mut seen = [0.0; 3];
        let mut all = 0.0;
        for node in 0..4 {
            let weight = WEIGHTS[node] * (-depth(&UP_TO[node])).exp();
            all += weight * tau[node];
            for c in 0..3 {
                seen[c] += weight * glow[node][c];
            }
        }
        let all_depth = depth(&WEIGHTS);
        if all_depth <= 0.0 {
            return;
        }
        if all <= 0.0 {
            // Opaque before the first node: its colour is all there is to see.
            (seen, all) = (glow[0], tau[0]);
        }
        // The rule gives the mean colour; how much of it there is follows from the depth alone, so
        // that a homogeneous stretch is exact.
        let part = self.through * -(-all_depth).exp_m1() / all;
        for (sum, c) in self.color.iter_mut().zip(seen) {
            *sum += part * c;
        }
        self.through *= (-all_depth).exp();
    }
}

/// Whether a panel must be halved.
fn rough(meets: Meets<'_>, from: f64, to: f64, halvings: u32) -> bool {
    let heed_light = halvings < HALVINGS_FOR_LIGHT;
    let in_pieces = meets.walkers.iter().filter(|w| !w.clear).map(|w| w.smooth(from, to, heed_light));
    let mut tau = 0.0;
    for most in in_pieces.chain(meets.cells.iter().map(|cell| cell.smooth(from, to))) {
        let Some(most) = most else { return true };
        tau += most;
    }
    tau * (to - from) > DEPTH
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_is_exact_for_the_powers_it_should_be() {
        for power in 0..8 {
            let all: f64 = (0..4).map(|i| WEIGHTS[i] * NODES[i].powi(power)).sum();
            assert!((all - 1.0 / f64::from(power + 1)).abs() < 1e-15, "power {power} over all");
            for (i, node) in NODES.iter().enumerate().filter(|_| power < 4) {
                let part: f64 = (0..4).map(|j| UP_TO[i][j] * NODES[j].powi(power)).sum();
                let known = node.powi(power + 1) / f64::from(power + 1);
                assert!((part - known).abs() < 1e-15, "power {power} up to node {i}");
            }
        }
    }
}
