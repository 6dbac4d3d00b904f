//! A transfer function for rays: [`transfer::Table`] as lines of cache.
//!
//! Sums are kept in `f64`, so that their differences keep their digits however near two places are.

use crate::scene::light;
use crate::transfer::{self, Part, Parts};
use crate::volume::{Grid, Transfer};

/// Nodes over the values that occur.
const NODES: usize = 2048;

/// Positions nearer than this count as one: their quotient would have lost its digits.
pub(super) const EVEN: f32 = 1e-2;

/// Extinction from one node to the next, where it is linear: (τ·red, τ·green, τ·blue, τ), 1/mm. One line of cache.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub(super) struct Node {
    /// Antiderivative at the node.
    pub(super) sum: [f64; 4],
    pub(super) from: [f32; 4],
    /// Half of the rise to the next node. Where extinction jumps or bends before that, the last is not a number, and
    /// the first the position among those nodes.
    pub(super) half_rise: [f32; 4],
}

/// A part of a node within which extinction jumps or bends.
#[derive(Debug, Clone, Copy)]
struct Inner {
    /// 0 to 1 of the node.
    begin: f64,
    /// Antiderivative from the node to there.
    sum: [f64; 4],
    /// Extinction there, and half of what it rises by over a whole node.
    from: [f64; 4],
    half_rise: [f64; 4],
}

/// The parts of a node, by rising begin.
fn inner(parts: &[Part]) -> Vec<Inner> {
    let (mut begin, mut sum) = (0.0, [0.0; 4]);
    let mut made = Vec::with_capacity(parts.len());
    for Part { end, ends: [a, b] } in parts {
        let width = end - begin;
        let half_rise = std::array::from_fn(|c| 0.5 * (b[c] - a[c]) / width);
        made.push(Inner { begin, sum, from: *a, half_rise });
        sum = std::array::from_fn(|c| sum[c] + 0.5 * (a[c] + b[c]) * width);
        begin = *end;
    }
    made
}

/// A transfer function over the values of a grid; a *position* is a place in the table.
///
/// Error: that of [`transfer::Table`] with 2048 nodes over the span of values between its first and last point.
#[derive(Debug)]
pub(super) struct Table {
    nodes: Vec<Node>,
    /// The parts of each of the few nodes within which extinction jumps or bends.
    cut: Vec<Vec<Inner>>,
    /// Position of a stored number v: v·scale + offset.
    pub(super) scale: f32,
    pub(super) offset: f32,
    /// Positions below and above which nothing absorbs.
    clear_below: f32,
    clear_above: f32,
    /// Gradients below this do not light; positions a mm.
    pub(super) flat: f32,
}

impl Table {
    pub(super) fn new(transfer: &Transfer, grid: &Grid) -> Self {
        let table = transfer::Table::new(transfer, grid.range(), NODES);
        let mut cut: Vec<Vec<Inner>> = Vec::new();
        let mut nodes = Vec::with_capacity(table.nodes.len());
        for transfer::Node { sum, parts } in &table.nodes {
            let (from, half_rise) = match parts {
                Parts::Whole([from, to]) => {
                    let rises = [0, 1, 2, 3].map(|c: usize| (0.5 * (to[c] - from[c])) as f32);
                    // None where both are infinite.
                    (from, rises.map(|rise| if rise.is_nan() { 0.0 } else { rise }))
                }
                Parts::Bends(parts) | Parts::Jumps(parts) => {
                    cut.push(inner(parts));
                    (&parts[0].ends[0], [(cut.len() - 1) as f32, 0.0, 0.0, f32::NAN])
                }
            };
            nodes.push(Node { sum: *sum, from: from.map(|v| v as f32), half_rise });
        }
        let points = transfer.points();
        let rescale = grid.rescale();
        let position = |value: f64| table.position(value);
        let shown = points.iter().position(|p| p.rgba[3] > 0.0);
        let last_shown = points.iter().rposition(|p| p.rgba[3] > 0.0);
        let clear_below = match shown {
            None => f64::INFINITY,
            Some(0) => f64::NEG_INFINITY,
            Some(i) => position(points[i - 1].value),
        };
        let clear_above = match last_shown {
            Some(i) if i + 1 < points.len() => position(points[i + 1].value),
            _ => f64::INFINITY,
        };
        let span = light::value_span(transfer, grid.range());
        Self {
            nodes,
            cut,
            scale: (rescale.slope / table.step) as f32,
            offset: position(rescale.intercept) as f32,
            // The table's own rounding stays on the safe side.
            clear_below: clear_below as f32 - 1.0,
            clear_above: clear_above as f32 + 1.0,
            flat: (light::FLAT * span / table.step) as f32,
        }
    }

    /// Whether nothing absorbs between two positions, by a quick look.
    #[inline(always)]
    pub(super) fn is_clear(&self, a: f32, b: f32) -> bool {
        (a < self.clear_below && b < self.clear_below) || (a > self.clear_above && b > self.clear_above)
    }

    /// Positions below and above which nothing absorbs.
    #[inline(always)]
    pub(super) fn clear_limits(&self) -> [f32; 2] {
        [self.clear_below, self.clear_above]
    }

    #[inline(always)]
    fn node(&self, position: f32) -> (&Node, f32) {
        let i = (position.max(0.0) as usize).min(self.nodes.len() - 1);
        (&self.nodes[i], position - i as f32)
    }

    /// The antiderivative from the begin of a node within which extinction jumps or bends, and extinction there. Before the
    /// first node, `part` is negative: its first part goes on without end.
    #[cold]
    fn within(&self, node: &Node, part: f32) -> ([f64; 4], [f64; 4]) {
        let part = f64::from(part);
        let parts = &self.cut[node.half_rise[0] as usize];
        let Inner { begin, sum, from, half_rise } =
            &parts[parts.partition_point(|p| p.begin <= part).saturating_sub(1)];
        let more = part - begin;
        let rate = |c: usize| from[c] + more * half_rise[c];
        (
            std::array::from_fn(|c| sum[c] + more * rate(c)),
            std::array::from_fn(|c| rate(c) + more * half_rise[c]),
        )
    }

    /// The antiderivative at a position.
    #[inline(always)]
    pub(super) fn sum(&self, position: f32) -> [f64; 4] {
        let (node, part) = self.node(position);
        let mut sum = node.sum;
        if node.half_rise[3].is_nan() {
            let (inner, _) = self.within(node, part);
            return std::array::from_fn(|c| sum[c] + inner[c]);
        }
        for (c, sum) in sum.iter_mut().enumerate() {
            *sum += f64::from(part * (node.from[c] + part * node.half_rise[c]));
        }
        sum
    }

    /// Extinction times colour, and extinction, at a position; 1/mm.
    #[inline(always)]
    fn rate(&self, position: f32) -> [f32; 4] {
        let (node, part) = self.node(position);
        let mut rate = node.from;
        if node.half_rise[3].is_nan() {
            return self.within(node, part).1.map(|v| v as f32);
        }
        for (rate, half_rise) in rate.iter_mut().zip(node.half_rise) {
            *rate += 2.0 * part * half_rise;
        }
        rate
    }

    /// Optical depth times colour, and optical depth, of `mm` along which the position runs from `a` to `b`; the
    /// sums are those at its ends.
    #[inline(always)]
    pub(super) fn depth(&self, [a, b]: [f32; 2], [sum_a, sum_b]: [&[f64; 4]; 2], mm: f32) -> [f32; 4] {
        let rise = b - a;
        if rise.abs() > EVEN {
            let by = mm / rise;
            let mut depth = [0.0; 4];
            for c in 0..4 {
                depth[c] = (sum_b[c] - sum_a[c]) as f32 * by;
            }
            return depth;
        }
        self.even(0.5 * (a + b), mm)
    }

    /// The same where the position stays.
    pub(super) fn even(&self, position: f32, mm: f32) -> [f32; 4] {
        let mut depth = self.rate(position);
        for d in &mut depth {
            *d *= mm;
        }
        depth
    }

    pub(super) fn nodes(&self) -> &[Node] {
        &self.nodes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Affine, ControlPoint, Rescale, Samples};

    #[test]
    fn sums_are_those_of_the_function_across_jumps() {
        let point = |value: f64, a: f64| ControlPoint { value, rgba: [a, 0.5, 1.0 - a, a] };
        let points = vec![
            point(0.0, 0.0),
            point(10.03, 0.2),
            point(10.03, 0.9),
            point(10.04, 0.9),
            point(10.04, 0.1),
            point(10.04, 0.3),
            point(60.0, 0.6),
            point(100.0, 0.6),
            point(100.0, 0.0),
        ];
        let transfer = Transfer::new(points, 2.0).expect("a function");
        let samples = Samples::F32(vec![-20.0, 120.0]);
        let grid = Grid::new([2, 1, 1], samples, Rescale::default(), Affine::identity()).expect("a grid");
        let table = Table::new(&transfer, &grid);
        let place = |value: f64| value as f32 * table.scale + table.offset;
        let step = 1.0 / f64::from(table.scale);
        for [a, b] in
            [[-20.0, 120.0], [5.0, 10.02], [10.0, 10.035], [10.031, 10.039], [10.02, 55.0], [99.0, 101.0]]
        {
            let sums = [a, b].map(|v| table.sum(place(v)));
            let steps = 400_000;
            let mut known = [0.0; 4];
            for i in 0..steps {
                let ([r, g, bl], tau) =
                    transfer.classify(a + (b - a) * (f64::from(i) + 0.5) / f64::from(steps));
                for (known, v) in known.iter_mut().zip([r * tau, g * tau, bl * tau, tau]) {
                    *known += v * (b - a) / f64::from(steps);
                }
            }
            for c in 0..4 {
                let found = (sums[1][c] - sums[0][c]) * step;
                // Positions are rounded to 1e-4 of a node, where extinction is at most 1.2.
                assert!(
                    (found - known[c]).abs() < 4e-5 + 1e-4 * known[c],
                    "{a} to {b}: {found} is not {}",
                    known[c]
                );
            }
        }
    }

    #[test]
    fn what_lies_before_a_jump_at_the_first_point_goes_on_without_end() {
        let point = |value: f64, a: f64| ControlPoint { value, rgba: [1.0, 1.0, 1.0, a] };
        let points = vec![point(0.0, 0.9), point(0.0, 0.1), point(10.0, 0.3)];
        let transfer = Transfer::new(points, 1.0).expect("a function");
        let samples = Samples::F32(vec![-500.0, 20.0]);
        let grid = Grid::new([2, 1, 1], samples, Rescale::default(), Affine::identity()).expect("a grid");
        let table = Table::new(&transfer, &grid);
        let sum = |value: f64| table.sum(value as f32 * table.scale + table.offset)[3];
        let known = transfer.extinction_of(0.9);
        for [a, b] in [[-500.0, -499.0], [-30.0, -1.0], [-0.01, -0.001]] {
            let found = (sum(b) - sum(a)) / ((b - a) * f64::from(table.scale));
            assert!((found / known - 1.0).abs() < 1e-2, "{a} to {b}: {found} is not {known}");
        }
    }
}
