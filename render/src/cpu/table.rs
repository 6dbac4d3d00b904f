//! A transfer function for rays: the antiderivatives of extinction and of extinction times colour.
//!
//! Between two places of a ray on which the scalar runs linearly from `a` to `b`, the mean of extinction is
//! (F(b) - F(a)) / (b - a), with F its antiderivative over the scalar: pre-integration with a table of one
//! dimension (Engel 2001; Lum 2004). F is kept in `f64`, so that the difference keeps its digits however near
//! `a` and `b` are.

use crate::volume::{Grid, Transfer};

/// Nodes over the values that occur.
const NODES: usize = 2048;

/// Extinction from one node to the next, where it is linear: (τ·red, τ·green, τ·blue, τ), 1/mm. One line of cache.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
struct Node {
    /// Antiderivative at the node.
    sum: [f64; 4],
    from: [f32; 4],
    /// Half of the rise to the next node.
    half_rise: [f32; 4],
}

/// A transfer function over the values of a grid; a *position* is a place in the table.
///
/// Error: between two nodes extinction is taken as linear, which departs from −ln(1 − a) and at control points by
/// at most the function's curvature over 1/2000 of the span of values between its first and last point.
#[derive(Debug)]
pub(super) struct Table {
    nodes: Vec<Node>,
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
        let points = transfer.points();
        let [low, high] = grid.range();
        let [first, last] = [points[0].value, points[points.len() - 1].value];
        // Outside its points the function is constant: nodes are only needed where both, points and values, are.
        let from = low.max(first).min(high);
        let to = high.min(last).max(from);
        let step = if to > from { (to - from) / (NODES - 1) as f64 } else { 1.0 };
        let at = |value: f64| {
            let ([r, g, b], tau) = transfer.classify(value);
            [r * tau, g * tau, b * tau, tau]
        };
        // The last value is met without rounding: a jump may lie there.
        let value =
            |node: usize| if node == NODES { to } else { from + step * node.saturating_sub(1) as f64 };
        // Node 0 lies one step before the first value and node NODES at the last: both go on without end.
        let mut sum = [0.0; 4];
        let mut nodes = Vec::with_capacity(NODES + 1);
        for i in 0..=NODES {
            let here = at(value(i));
            let next = if i == 0 || i == NODES { here } else { at(value(i + 1)) };
            // A jump at the very first value lies within node 0.
            let here = if i == 0 && low < from { at(low) } else { here };
            let next = if i == 0 { here } else { next };
            nodes.push(Node {
                sum,
                from: here.map(|v| v as f32),
                half_rise: std::array::from_fn(|c| (0.5 * (next[c] - here[c])) as f32),
            });
            sum = std::array::from_fn(|c| sum[c] + 0.5 * (here[c] + next[c]));
        }
        let rescale = grid.rescale();
        let position = |value: f64| (value - from) / step + 1.0;
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
        let span = last - first;
        Self {
            nodes,
            scale: (rescale.slope / step) as f32,
            offset: position(rescale.intercept) as f32,
            // The table's own rounding stays on the safe side.
            clear_below: clear_below as f32 - 1.0,
            clear_above: clear_above as f32 + 1.0,
            flat: (crate::scene::light::FLAT * span / step) as f32,
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

    /// The antiderivative at a position.
    #[inline(always)]
    pub(super) fn sum(&self, position: f32) -> [f64; 4] {
        let (node, part) = self.node(position);
        let mut sum = node.sum;
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
        // Nearer than this the quotient has lost its digits, and extinction is one all along.
        if rise.abs() > 1e-2 {
            let by = mm / rise;
            let mut depth = [0.0; 4];
            for c in 0..4 {
                depth[c] = (sum_b[c] - sum_a[c]) as f32 * by;
            }
            return depth;
        }
        let mut depth = self.rate(0.5 * (a + b));
        for d in &mut depth {
            *d *= mm;
        }
        depth
    }
}
