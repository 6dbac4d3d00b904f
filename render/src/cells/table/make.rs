//! From a transfer function to its table.

use super::bins::{Bins, Exact};
use super::{Node, Piece, Place, Table};
use crate::volume::Transfer;

/// Nodes in a piece along which extinction changes.
const NODES: usize = 256;

/// What is known of a table while it is made.
#[derive(Debug)]
struct Made {
    pieces: Vec<Piece>,
    nodes: Vec<Node>,
    /// What the pieces so far hold.
    sum: [f64; 4],
    /// Where each piece begins.
    starts: Vec<f64>,
    /// The number of the ramp that pieces are of.
    ramp: u32,
}

impl Table {
    pub(in super::super) fn new(transfer: &Transfer) -> Self {
        let points = transfer.points();
        let [low, high] = [&points[0], &points[points.len() - 1]];
        let span = high.value - low.value;
        // A span past the largest number ends at the values that there are.
        let per_value = if span > 0.0 && (1.0 / span) > 0.0 { 1.0 / span } else { 1.0 };
        let position = |value: f64| (value - low.value) * per_value;
        let mut made =
            Made { pieces: Vec::new(), nodes: Vec::new(), sum: [0.0; 4], starts: Vec::new(), ramp: 0 };
        let mut clear = Vec::new();
        let mut clear_from = (low.rgba[3] == 0.0).then_some(f64::NEG_INFINITY);
        made.push(transfer, [f64::NEG_INFINITY, 0.0], [low.rgba; 2]);
        for pair in points.windows(2) {
            let [a, b] = [&pair[0], &pair[1]];
            if clear_from.is_some() && b.rgba[3] > 0.0 {
                // The value of a jump belongs to what comes after it.
                let to = if a.value == b.value { a.value.next_down() } else { a.value };
                clear.extend(clear_from.take().map(|from| [from, to]));
            } else if clear_from.is_none() && b.rgba[3] == 0.0 {
                clear_from = Some(b.value);
            }
            if a.value < b.value {
                let ends = [a.value, b.value].map(position);
                let mut begin = (ends[0], a.rgba);
                made.ramp += 1;
                for part in opaque_cuts([a.rgba[3], b.rgba[3]]).chain([1.0]) {
                    let end = if part == 1.0 {
                        (ends[1], b.rgba)
                    } else {
                        // A place that positions, which are of single precision, can tell.
                        let at = f64::from((ends[0] + (ends[1] - ends[0]) * part) as f32).min(ends[1]);
                        let part = (at - ends[0]) / (ends[1] - ends[0]);
                        let mix = |c: usize| a.rgba[c] + (b.rgba[c] - a.rgba[c]) * part;
                        (at, std::array::from_fn(mix))
                    };
                    if begin.0 < end.0 {
                        made.push(transfer, [begin.0, end.0], [begin.1, end.1]);
                        begin = end;
                    }
                }
            }
        }
        clear.extend(clear_from.map(|from| [from, f64::INFINITY]));
        made.ramp += 1;
        made.push(transfer, [position(high.value), f64::INFINITY], [high.rgba; 2]);
        let Made { pieces, nodes, starts, .. } = made;
        let bins = Bins::new(&Exact { pieces: &pieces, nodes: &nodes, starts: &starts });
        let start = Place { position: f32::NAN, piece: 0, sum: [0.0; 4], varied: 0.0 };
        Self { pieces, nodes, bins, first: low.value, per_value, clear, start }
    }
}

impl Made {
    /// Adds a piece between two positions.
    fn push(&mut self, transfer: &Transfer, [a, b]: [f64; 2], ends: [[f64; 4]; 2]) {
        let bounded = a.is_finite() && b.is_finite();
        let changes = bounded && ends[0] != ends[1];
        let count = if changes { NODES } else { 1 };
        let origin = if a.is_finite() { a } else { b };
        let width = if bounded { (b - a) / count as f64 } else { 1.0 };
        let rgba = |part: f64| -> [f64; 4] {
            std::array::from_fn(|c| ends[0][c] + (ends[1][c] - ends[0][c]) * part.clamp(0.0, 1.0))
        };
        let rate = |part: f64| {
            let [r, g, b, a] = rgba(part);
            let tau = transfer.extinction_of(a);
            [r * tau, g * tau, b * tau, tau]
        };
        let first = self.nodes.len() as u32;
        let mut steepest = 0.0_f64;
        for node in 0..count {
            let [from, to] = [node, node + 1].map(|n| n as f64 / count as f64);
            let mean = if changes { mean(&rate, [from, to]) } else { rate(0.0) };
            let begin = rate(from);
            steepest = steepest.max(2.0 * (mean[3] - begin[3]).abs() / width);
            self.nodes.push(Node {
                sum: self.sum,
                from: begin.map(|v| v as f32),
                half_rise: std::array::from_fn(|c| (mean[c] - begin[c]) as f32),
            });
            if bounded {
                self.sum = std::array::from_fn(|c| self.sum[c] + mean[c] * width);
            }
        }
        let length = if bounded { b - a } else { 1.0 };
        let slope = std::array::from_fn(|c| ((ends[1][c] - ends[0][c]) / length) as f32);
        let most = |v: [f32; 3]| v.into_iter().fold(0.0, |most: f32, v| most.max(v.abs()));
        let before = self.pieces.last();
        let color: [f32; 3] = std::array::from_fn(|c| ends[0][c] as f32);
        let varied = before.map_or(0.0, |p| {
            let length = if p.from.is_finite() { origin as f32 - p.origin } else { 0.0 };
            let jump = std::array::from_fn(|c| color[c] - (p.color[c] + p.slope[c] * length));
            p.varied + p.varies * length + most(jump)
        });
        self.starts.push(a);
        self.pieces.push(Piece {
            ramp: self.ramp,
            from: a as f32,
            origin: origin as f32,
            scale: (1.0 / width) as f32,
            width: width as f32,
            first,
            last: first + count as u32 - 1,
            color,
            slope,
            varied,
            varies: most(slope),
            rough: steepest as f32 * most(slope),
        });
    }
}

/// Where opacity comes so near to 1 that its extinction grows without bound, a ramp is cut wherever what comes through has
/// halved, and where opacity counts as no more: parts of the way, rising.
fn opaque_cuts([from, to]: [f64; 2]) -> impl Iterator<Item = f64> {
    let halves = (3..20).map(|k| 1.0 - 0.5_f64.powi(k)).chain([Transfer::MAX_OPACITY]);
    let mut parts: Vec<f64> =
        halves.map(|a| (a - from) / (to - from)).filter(|p| *p > 0.0 && *p < 1.0).collect();
    parts.sort_unstable_by(f64::total_cmp);
    parts.into_iter()
}

/// The mean of a rate over a part of a piece, by five nodes of Gauss and Legendre.
fn mean(rate: &impl Fn(f64) -> [f64; 4], [from, to]: [f64; 2]) -> [f64; 4] {
    let nodes = [
        (-0.906_179_845_938_664, 0.118_463_442_528_094_54),
        (-0.538_469_310_105_683_1, 0.239_314_335_249_683_23),
        (0.0, 0.284_444_444_444_444_44),
        (0.538_469_310_105_683_1, 0.239_314_335_249_683_23),
        (0.906_179_845_938_664, 0.118_463_442_528_094_54),
    ];
    nodes.into_iter().fold([0.0; 4], |sum, (node, weight)| {
        let at = rate(from + (to - from) * 0.5 * (node + 1.0));
        std::array::from_fn(|c| sum[c] + weight * at[c])
    })
}
