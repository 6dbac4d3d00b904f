//! A transfer function for rays: the antiderivatives of extinction and of extinction times colour.
//!
//! Between two places of a ray on which the scalar runs linearly from `a` to `b`, the mean of extinction is
//! (F(b) - F(a)) / (b - a), with F its antiderivative over the scalar: pre-integration with a table of one
//! dimension (Engel 2001; Lum 2004). F is kept in `f64`, so that the difference keeps its digits however near
//! `a` and `b` are.

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
    /// Half of the rise to the next node; not a number where there are jumps before that.
    pub(super) half_rise: [f32; 4],
}

/// A node within which extinction jumps: what it is between the jumps, linear in each part.
#[derive(Debug)]
struct Jumps {
    node: usize,
    /// Where each part ends, 0 to 1, and extinction at its begin and end.
    parts: Vec<(f64, [[f64; 4]; 2])>,
}

/// A transfer function over the values of a grid; a *position* is a place in the table.
///
/// Error: between two nodes extinction is taken as linear, which departs from −ln(1 − a) and at control points by
/// at most the function's curvature over 1/2000 of the span of values between its first and last point.
#[derive(Debug)]
pub(super) struct Table {
    nodes: Vec<Node>,
    /// By node; most functions have none. Such a node's `half_rise` is not a number.
    jumps: Vec<Jumps>,
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
        let mut jumps: Vec<Jumps> = Vec::new();
        // Node 0 lies one step before the first value and node NODES at the last: both go on without end.
        let mut sum = [0.0; 4];
        let mut nodes = Vec::with_capacity(NODES + 1);
        for i in 0..=NODES {
            let here = at(value(i));
            // A jump at the very first value lies within node 0.
            let here = if i == 0 && low < from { at(low) } else { here };
            let inner =
                if i == 0 || i == NODES { Vec::new() } else { parts(transfer, [value(i), value(i + 1)]) };
            let ends = match &inner[..] {
                [] => [here; 2],
                [(_, ends)] => *ends,
                _ => [here, [f64::NAN; 4]],
            };
            nodes.push(Node {
                sum,
                from: ends[0].map(|v| v as f32),
                half_rise: std::array::from_fn(|c| (0.5 * (ends[1][c] - ends[0][c])) as f32),
            });
            let mut begin = 0.0;
            for (end, [a, b]) in &inner {
                sum = std::array::from_fn(|c| sum[c] + 0.5 * (a[c] + b[c]) * (end - begin));
                begin = *end;
            }
            if i == 0 {
                sum = std::array::from_fn(|c| sum[c] + here[c]);
            }
            if inner.len() > 1 {
                jumps.push(Jumps { node: i, parts: inner });
            }
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
            jumps,
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
    fn node(&self, position: f32) -> (&Node, usize, f32) {
        let i = (position.max(0.0) as usize).min(self.nodes.len() - 1);
        (&self.nodes[i], i, position - i as f32)
    }

    /// The antiderivative from the begin of a node in which there are jumps, and extinction there.
    #[cold]
    fn among_jumps(&self, node: usize, part: f32) -> ([f64; 4], [f64; 4]) {
        let (mut sum, mut rate, mut begin) = ([0.0; 4], [0.0; 4], 0.0);
        let part = f64::from(part);
        let known = self.jumps.iter().find(|j| j.node == node);
        for (end, [a, b]) in known.into_iter().flat_map(|j| &j.parts) {
            let width = end - begin;
            let inside = (part.min(*end) - begin).max(0.0);
            let share = inside / width;
            for c in 0..4 {
                let here = a[c] + (b[c] - a[c]) * share;
                sum[c] += 0.5 * (a[c] + here) * inside;
                rate[c] = here;
            }
            if part < *end {
                break;
            }
            begin = *end;
        }
        (sum, rate)
    }

    /// The antiderivative at a position.
    #[inline(always)]
    pub(super) fn sum(&self, position: f32) -> [f64; 4] {
        let (node, index, part) = self.node(position);
        let mut sum = node.sum;
        if node.half_rise[3].is_nan() {
            let (inner, _) = self.among_jumps(index, part);
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
        let (node, index, part) = self.node(position);
        let mut rate = node.from;
        if node.half_rise[3].is_nan() {
            return self.among_jumps(index, part).1.map(|v| v as f32);
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

/// Extinction (times colour, and alone) from one value to another, by parts between jumps: where each ends, 0 to 1, and
/// its extinction at both ends. One part where there is no jump between them.
fn parts(transfer: &Transfer, [from, to]: [f64; 2]) -> Vec<(f64, [[f64; 4]; 2])> {
    let tau = |rgba: [f64; 4]| {
        let tau = transfer.extinction_of(rgba[3]);
        [rgba[0] * tau, rgba[1] * tau, rgba[2] * tau, tau]
    };
    let points = transfer.points();
    let mut parts = Vec::new();
    let mut begin = tau(transfer.rgba(from));
    for (i, point) in points.iter().enumerate() {
        // The first of the points of one value, and the last.
        let jumps = points.get(i + 1).is_some_and(|next| next.value == point.value)
            && (i == 0 || points[i - 1].value < point.value);
        if jumps && point.value > from && point.value <= to {
            parts.push(((point.value - from) / (to - from), [begin, tau(point.rgba)]));
            begin = tau(transfer.rgba(point.value));
        }
    }
    if parts.last().is_none_or(|(end, _)| *end < 1.0) {
        parts.push((1.0, [begin, tau(transfer.rgba(to))]));
    }
    parts
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
}
