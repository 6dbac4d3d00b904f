//! Transfer functions as both renderers integrate them: antiderivatives over the value.
//!
//! Between two places of a ray on which the scalar runs linearly from `a` to `b`, the mean of extinction is
//! (F(b) - F(a)) / (b - a), with F its antiderivative over the scalar: pre-integration with a table of one
//! dimension (Engel 2001; Lum 2004). So is that of extinction times colour.

use crate::volume::Transfer;

/// A jump takes effect this much of all nodes before its value: a position is rounded to single precision, and what lies
/// exactly on a jump belongs to its later side.
const EARLY: f64 = 1.5e-7;

/// What a line's mean may be off by; of the greatest extinction on it.
const NEARLY: f64 = 1e-3;

/// The shortest part that a stretch is halved into; of a node. A position in single precision says hardly more.
const SHORTEST: f64 = 1e-4;

/// What is integrated: (τ·red, τ·green, τ·blue, τ), 1/mm.
pub(crate) type Extinction = [f64; 4];

/// A part of a node in which nothing jumps, and extinction is nearly a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Part {
    /// Where it ends, 0 to 1 of the node.
    pub(crate) end: f64,
    /// Extinction at its begin and end, linear between.
    pub(crate) ends: [Extinction; 2],
}

/// From one node to the next.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node {
    /// Antiderivative at its begin, over positions.
    pub(crate) sum: Extinction,
    /// By rising end; one but for nodes in which the function jumps or bends.
    pub(crate) parts: Parts,
}

/// The parts of a node.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Parts {
    /// Nearly a line: extinction at begin and end.
    Whole([Extinction; 2]),
    /// No jump, but no line either: a control point, or opacity near 1.
    Bends(Vec<Part>),
    /// What the jumps leave.
    Jumps(Vec<Part>),
}

/// A transfer function over evenly spaced values. A *position* is a place in it: node 0 lies one step before the
/// first value, node 1 at it, the last node at the last value; the first and the last go on without end.
///
/// Error: within a node, and each part of it, extinction is taken as linear, with the function's mean (Gauss, three points,
/// between control points). Where that departs from the mean of its ends by more than a thousandth of the greatest
/// extinction there, at a control point or near opacity 1, a node is cut into parts: the scalar may stay in one node for
/// as long as a ray runs along a face of a volume.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Table {
    /// Value of node 1.
    from: f64,
    /// Value from one node to the next.
    pub(crate) step: f64,
    pub(crate) nodes: Vec<Node>,
}

impl Table {
    /// A table of `count` nodes (>= 2) beside node 0, of a function over the values between `least` and `greatest`
    /// that a grid has.
    pub(crate) fn new(transfer: &Transfer, [least, greatest]: [f64; 2], count: usize) -> Self {
        let points = transfer.points();
        // Outside its points the function is constant: nodes are only needed where both, points and values, are.
        let from = points[0].value.max(least).min(greatest);
        let to = points[points.len() - 1].value.min(greatest).max(from);
        // Where there is but one value to tell from the rest, a step is as small as where there are many.
        let span = if to > from { to - from } else { greatest - least };
        let step = if span > 0.0 { span / (count - 1) as f64 } else { 1.0 };
        let early = EARLY * count as f64;
        // The last value is met without rounding: a jump may lie there.
        let value = |node: usize| if node == count { to } else { from + step * (node as f64 - 1.0) };
        let mut sum = [0.0; 4];
        let mut nodes = Vec::with_capacity(count + 1);
        for i in 0..=count {
            let parts = if i == count || (i > 0 && to == from) {
                Parts::Whole([extinction(transfer, to); 2])
            } else if i == 0 && least >= from {
                Parts::Whole([extinction(transfer, from); 2])
            } else {
                parts(transfer, [value(i), value(i + 1)], early)
            };
            let total = parts.mean([0.0, 1.0]);
            nodes.push(Node { sum, parts });
            sum = std::array::from_fn(|c| sum[c] + total[c]);
        }
        Self { from, step, nodes }
    }

    /// Where a value lies.
    pub(crate) fn position(&self, value: f64) -> f64 {
        (value - self.from) / self.step + 1.0
    }
}

impl Parts {
    /// Mean of extinction between two places of the node, 0 to 1, `low` < `high`.
    pub(crate) fn mean(&self, [low, high]: [f64; 2]) -> Extinction {
        let whole;
        let parts = match self {
            Self::Bends(parts) | Self::Jumps(parts) => &parts[..],
            Self::Whole(ends) => {
                whole = [Part { end: 1.0, ends: *ends }];
                &whole
            }
        };
        let (mut sum, mut begin) = ([0.0; 4], 0.0);
        for part in parts {
            let (a, b) = (low.max(begin), high.min(part.end));
            if b > a {
                let middle = (0.5 * (a + b) - begin) / (part.end - begin);
                let [from, to] = part.ends;
                sum = std::array::from_fn(|c| sum[c] + (from[c] + (to[c] - from[c]) * middle) * (b - a));
            }
            begin = part.end;
        }
        sum.map(|s| s / (high - low))
    }
}

fn of_rgba(transfer: &Transfer, [r, g, b, a]: [f64; 4]) -> Extinction {
    let tau = transfer.extinction_of(a);
    [r * tau, g * tau, b * tau, tau]
}

fn extinction(transfer: &Transfer, value: f64) -> Extinction {
    of_rgba(transfer, transfer.rgba(value))
}

/// Where the function is known.
#[derive(Debug, Clone, Copy)]
struct Knot {
    value: f64,
    /// 0 to 1 of the node.
    place: f64,
    extinction: Extinction,
}

/// Extinction from one value to another, by parts between jumps, which take effect `early` of it before their value, and
/// bends.
fn parts(transfer: &Transfer, [from, to]: [f64; 2], early: f64) -> Parts {
    let points = transfer.points();
    let mut begin = Knot { value: from, place: 0.0, extinction: extinction(transfer, from) };
    if to <= from {
        return Parts::Whole([begin.extinction; 2]);
    }
    let (mut parts, mut jumps) = (Vec::new(), false);
    let first = points.partition_point(|p| p.value < from);
    for (i, point) in points.iter().enumerate().skip(first) {
        let place = (point.value - from) / (to - from);
        if place - early > 1.0 {
            break;
        }
        // The first of the points of one value, which the next one shares.
        let is_first = i == 0 || points[i - 1].value < point.value;
        let is_jump = points.get(i + 1).is_some_and(|next| next.value == point.value);
        let place = if is_jump { place - early } else { place };
        if !is_first || place > 1.0 {
            continue;
        }
        if place > begin.place {
            let end = Knot { value: point.value, place, extinction: of_rgba(transfer, point.rgba) };
            lines(transfer, [begin, end], &mut parts);
            (begin.place, jumps) = (place, jumps || is_jump);
        }
        (begin.value, begin.extinction) = (point.value, extinction(transfer, point.value));
    }
    if begin.place < 1.0 {
        let after = if begin.value < to { extinction(transfer, to) } else { begin.extinction };
        lines(transfer, [begin, Knot { value: to, place: 1.0, extinction: after }], &mut parts);
    }
    if let [part] = &parts[..] {
        Parts::Whole(part.ends)
    } else if jumps {
        Parts::Jumps(parts)
    } else {
        joined(&parts).map_or(Parts::Bends(parts), Parts::Whole)
    }
}

/// Appends lines between two places between which the function has no control point: as many as it takes that each is
/// nearly it.
fn lines(transfer: &Transfer, [from, to]: [Knot; 2], into: &mut Vec<Part>) {
    let ends = [from.extinction, to.extinction];
    let mean = mean(transfer, [from.value, to.value]);
    let greatest = ends[0][3].max(ends[1][3]);
    let is_bent = (0..4).any(|c| (mean[c] - 0.5 * (ends[0][c] + ends[1][c])).abs() > NEARLY * greatest);
    if !is_bent {
        into.push(Part { end: to.place, ends: line(ends[0], mean) });
    } else if to.place - from.place <= SHORTEST {
        into.push(Part { end: to.place, ends });
    } else {
        let value = f64::midpoint(from.value, to.value);
        let place = f64::midpoint(from.place, to.place);
        let middle = Knot { value, place, extinction: extinction(transfer, value) };
        lines(transfer, [from, middle], into);
        lines(transfer, [middle, to], into);
    }
}

/// The ends of the line of a node without jumps, where all its parts are nearly on one.
fn joined(parts: &[Part]) -> Option<[Extinction; 2]> {
    let (mut begin, mut mean, mut greatest) = (0.0, [0.0; 4], 0.0_f64);
    for part in parts {
        let [from, to] = part.ends;
        mean = std::array::from_fn(|c| mean[c] + 0.5 * (from[c] + to[c]) * (part.end - begin));
        (begin, greatest) = (part.end, greatest.max(from[3]).max(to[3]));
    }
    let [from, to] = line(parts[0].ends[0], mean);
    let is_near = |part: &Part| {
        (0..4).all(|c| {
            let off = from[c] + (to[c] - from[c]) * part.end - part.ends[1][c];
            off.abs() <= 2.0 * NEARLY * greatest
        })
    };
    parts.iter().all(is_near).then_some([from, to])
}

/// Mean of extinction over values between which there is no control point; at the first where there is nothing between.
fn mean(transfer: &Transfer, [from, to]: [f64; 2]) -> Extinction {
    if to <= from {
        return extinction(transfer, from);
    }
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let root = (0.6_f64).sqrt();
    let [low, centre, high] = [-root, 0.0, root].map(|x| extinction(transfer, middle + half * x));
    std::array::from_fn(|c| (5.0 * (low[c] + high[c]) + 8.0 * centre[c]) / 18.0)
}

/// The ends of a line that begins as the function does, and has its mean.
fn line(begin: Extinction, mean: Extinction) -> [Extinction; 2] {
    [begin, std::array::from_fn(|c| (2.0 * mean[c] - begin[c]).max(0.0))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::ControlPoint;

    fn point(value: f64, a: f64) -> ControlPoint {
        ControlPoint { value, rgba: [1.0, 0.25, 0.0, a] }
    }

    #[test]
    fn values_that_do_not_occur_take_no_nodes() {
        let points = vec![point(-1e6, 0.0), point(0.0, 0.0), point(1.0, 0.5), point(1e6, 0.5)];
        let table = Table::new(&Transfer::new(points, 1.0).expect("transfer"), [-2.0, 2.0], 4096);
        assert!(table.step < 0.01, "one unit of the ramp has hundreds of nodes: {}", table.step);
    }

    #[test]
    fn a_jump_at_the_end_of_the_range_belongs_to_its_later_point() {
        let known = -(0.5_f64).ln();
        for (at, range) in [(0.1, [0.1, 0.1]), (-7.3, [-7.3, 4.0]), (0.7, [-3.0, 0.7])] {
            let points = vec![point(-1e3, 0.9), point(at, 0.9), point(at, 0.5), point(1e3, 0.5)];
            let table = Table::new(&Transfer::new(points, 1.0).expect("transfer"), range, 4096);
            // As single precision rounds it, down or up.
            let place = table.position(at);
            for place in [place, place - 5e-4, place + 5e-4] {
                let node = (place as usize).min(table.nodes.len() - 1);
                let part = place - node as f64;
                let found = table.nodes[node].parts.mean([part, part + 1e-9])[3];
                assert!((found - known).abs() < 1e-3, "{found} at {place} of {at}");
            }
        }
    }

    #[test]
    fn sums_are_the_integral_across_jumps_and_ramps() {
        let points = vec![
            point(-1000.0, 0.9),
            point(-3.0, 0.01),
            point(500.0, 0.99),
            point(500.03, 0.99),
            point(500.03, 0.1),
            point(3000.0, 0.001),
            point(3000.0, 0.2),
        ];
        let transfer = Transfer::new(points, 1.0).expect("transfer");
        let table = Table::new(&transfer, [-1e9, 1e9], 4096);
        let value = |position: usize| (position as f64 - 1.0) * table.step + table.from;
        for [a, b] in [[2, 4096], [1000, 1024], [1500, 1538], [3000, 3005]] {
            let ends = [-1000.0, -3.0, 500.0, 500.03, 3000.0].map(|v: f64| v.clamp(value(a), value(b)));
            let known: f64 = ends.windows(2).map(|pair| midpoints(&transfer, [pair[0], pair[1]])).sum();
            let found = (table.nodes[b].sum[3] - table.nodes[a].sum[3]) * table.step;
            // A jump that takes effect early, and the bends at control points.
            let early = 5.0 * EARLY * 4096.0 * table.step;
            let bends = 5e-3 * table.step;
            assert!(
                (found - known).abs() < early + bends + 1e-7 * known,
                "{a} to {b}: {found} is not {known}"
            );
        }
    }

    #[test]
    fn a_volume_of_one_value_has_what_the_function_is_there() {
        for v in [-3.0, 0.2, 7.0] {
            let points =
                vec![point(-1.0, 0.7), point(0.2, 0.0), point(0.2001, 0.9), point(1.0, 1.0), point(1.0, 0.0)];
            let transfer = Transfer::new(points, 1.0).expect("transfer");
            let table = Table::new(&transfer, [v, v], 64);
            let known = extinction(&transfer, v);
            for node in &table.nodes {
                assert_eq!(node.parts, Parts::Whole([known; 2]), "at {v}");
            }
        }
    }

    #[test]
    fn extinction_in_a_node_is_the_function_s_at_control_points_and_near_opacity_1() {
        // Nodes are one unit long, their ends at whole values.
        let points = vec![
            point(-1000.0, 0.0),
            point(-900.3, 0.0),
            point(-880.7, 0.6),
            point(-500.25, 0.1),
            point(100.4, 1.0),
            point(700.0, 0.0),
            point(1000.8, 0.0),
            point(1001.3, 1.0),
            point(1003.0, 1.0),
            point(1003.0, 0.9),
            point(3000.0, 0.5),
        ];
        let transfer = Transfer::new(points, 2.0).expect("transfer");
        let table = Table::new(&transfer, [-1000.0, 3000.0], 4001);
        for (i, node) in table.nodes[1..4001].iter().enumerate() {
            let value = |place: f64| i as f64 - 1000.0 + place;
            let ends = [0.0, 1.0].map(|place| extinction(&transfer, value(place))[3]);
            for k in 0..50 {
                let place = (f64::from(k) + 0.5) / 50.0;
                let known = extinction(&transfer, value(place));
                let found = node.parts.mean([place - 1e-7, place + 1e-7]);
                let most = 5e-3 * ends[0].max(ends[1]).max(known[3]);
                let is_right = (0..4).all(|c| (found[c] - known[c]).abs() <= most);
                assert!(is_right, "{found:?} is not {known:?} at {}", value(place));
            }
            let steps = 20_000;
            let all = (0..steps).map(|k| {
                extinction(&transfer, value((f64::from(k) + 0.5) / f64::from(steps)))[3] / f64::from(steps)
            });
            let known: f64 = if i % 50 == 0 || i.abs_diff(1100) < 3 { all.sum() } else { continue };
            let found = node.parts.mean([0.0, 1.0])[3];
            assert!(
                (found - known).abs() <= 1e-3 * known,
                "{found} is not {known}, the mean from {}",
                value(0.0)
            );
        }
        let many = table.nodes.iter().filter(|n| !matches!(n.parts, Parts::Whole(_))).count();
        assert!(many < 100, "{many} nodes are cut");
    }

    fn midpoints(transfer: &Transfer, [low, high]: [f64; 2]) -> f64 {
        let width = (high - low) / 1e6;
        (0..1_000_000).map(|i| extinction(transfer, low + width * (f64::from(i) + 0.5))[3] * width).sum()
    }
}
