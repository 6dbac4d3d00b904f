//! From a transfer function to its table.

use super::lanes::Lanes;
use super::{Piece, Table};
use crate::volume::Transfer;

/// By how much of it extinction may be off in a piece, which is looked at in so many places.
const SAME: f64 = 3e-4;
const TRIED: u32 = 16;
/// Widths below this have no inverse.
const NARROW: f32 = 1e-37;
/// Places for looking positions up, for each piece.
const STEPS: usize = 8;

/// What is known of a table while it is made.
#[derive(Debug, Default)]
struct Made {
    pieces: Vec<Piece>,
    /// What the pieces so far hold.
    sum: [f64; 4],
    /// Where the next begins.
    begin: f32,
}

/// Single precision is all that positions have: control points between two of them are at the nearest.
fn single(position: f64) -> f32 {
    position as f32
}

impl Table {
    pub(in super::super) fn new(transfer: &Transfer) -> Self {
        let points = transfer.points();
        let [low, high] = [&points[0], &points[points.len() - 1]];
        let span = high.value - low.value;
        // A span past the largest number ends at the values that there are.
        let per_value = if span > 0.0 && (1.0 / span) > 0.0 { 1.0 / span } else { 1.0 };
        let position = |value: f64| (value - low.value) * per_value;
        let mut made = Made::default();
        let mut clear = Vec::new();
        let mut clear_from = (low.rgba[3] == 0.0).then_some(f64::NEG_INFINITY);
        made.push_even(transfer, f32::NEG_INFINITY, low.rgba);
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
                let mut begin = a.rgba;
                for part in cuts([a.rgba[3], b.rgba[3]]) {
                    // A place that positions can tell.
                    let at = single(ends[0] + (ends[1] - ends[0]) * part);
                    let part = ((f64::from(at) - ends[0]) / (ends[1] - ends[0])).clamp(0.0, 1.0);
                    let end = std::array::from_fn(|c| a.rgba[c] + (b.rgba[c] - a.rgba[c]) * part);
                    if made.push(transfer, at, [begin, end]) {
                        begin = end;
                    }
                }
                made.push(transfer, single(ends[1]), [begin, b.rgba]);
            }
        }
        clear.extend(clear_from.map(|from| [from, f64::INFINITY]));
        made.push_even(transfer, made.begin, high.rgba);
        let Made { mut pieces, .. } = made;
        for number in 1..pieces.len() {
            pieces[number - 1].end = pieces[number].begin;
        }
        let last = pieces.len() - 1;
        // Not even what is infinite lies behind the last.
        let ends = pieces.iter().enumerate().map(|(n, piece)| if n < last { piece.end } else { f32::NAN });
        let ends: Vec<f32> = ends.collect();
        let count = (STEPS * pieces.len()).next_power_of_two();
        // What rounds to a step may lie a little before it, and a little behind the next.
        let piece = |step: usize, off: f32| {
            let position = step as f32 / count as f32 * (1.0 + off);
            ends.partition_point(|end| *end <= position) as u32
        };
        let steps: Vec<u32> = (0..=count).map(|step| piece(step, -f32::EPSILON)).collect();
        let beyond = (1..=count).map(|step| piece(step, f32::EPSILON)).chain([last as u32]);
        let most = steps.iter().zip(beyond).fold(0, |most, (from, to)| most.max(to - from));
        let lanes = Lanes::new(&pieces);
        Self { pieces, steps, most, ends, lanes, first: low.value, per_value, clear }
    }
}

impl Made {
    /// Adds one along which nothing changes.
    fn push_even(&mut self, transfer: &Transfer, begin: f32, rgba: [f64; 4]) {
        let tau = transfer.extinction_of(rgba[3]);
        self.add(Piece {
            begin,
            end: f32::INFINITY,
            origin: self.begin,
            scale: 0.0,
            extinction: [tau as f32, 0.0, 0.0, 0.0],
            color: color(rgba),
            turn: [0.0; 3],
            varies: 0.0,
            varied: 0.0,
            sum: self.sum,
        });
    }

    /// Adds one up to a position, unless that is hardly any way off.
    fn push(&mut self, transfer: &Transfer, end: f32, [from, to]: [[f64; 4]; 2]) -> bool {
        let width = end - self.begin;
        if width.is_nan() || width < NARROW {
            return false;
        }
        let turn: [f64; 4] = std::array::from_fn(|c| to[c] - from[c]);
        let cubic = cubic(|part| transfer.extinction_of(from[3] + turn[3] * part));
        let [a, b, c, d] = cubic;
        // The mean of the cubic, and of its product with the way along it.
        let mean = a + b / 2.0 + c / 3.0 + d / 4.0;
        let slanted = a / 2.0 + b / 3.0 + c / 4.0 + d / 5.0;
        let turns = color(turn);
        self.add(Piece {
            begin: self.begin,
            end,
            origin: self.begin,
            scale: 1.0 / width,
            extinction: cubic.map(|v| v as f32),
            color: color(from),
            turn: turns,
            varies: turns.into_iter().fold(0.0, |most, v| most.max(v.abs())),
            varied: 0.0,
            sum: self.sum,
        });
        for c in 0..4 {
            let mean = if c < 3 { from[c] * mean + turn[c] * slanted } else { mean };
            self.sum[c] += mean * f64::from(width);
        }
        self.begin = end;
        true
    }

    fn add(&mut self, mut piece: Piece) {
        if let Some(before) = self.pieces.last() {
            let jumps = (0..3).map(|c| (piece.color[c] - (before.color[c] + before.turn[c])).abs());
            piece.varied = before.varied + before.varies + jumps.fold(0.0, f32::max);
        }
        self.pieces.push(piece);
    }
}

fn color([r, g, b, _]: [f64; 4]) -> [f32; 3] {
    [r, g, b].map(|v| v as f32)
}

/// Where a ramp of opacity is cut, parts of the way, rising: such that a cubic is as good as the logarithm that extinction is
/// of it, and where opacity counts as no more.
fn cuts([from, to]: [f64; 2]) -> Vec<f64> {
    let part_of = |opacity: f64| (opacity - from) / (to - from);
    let cap = part_of(Transfer::MAX_OPACITY);
    let mut parts: Vec<f64> = [cap].into_iter().filter(|part| *part > 0.0 && *part < 1.0).collect();
    let mut left = vec![[from, to].map(|opacity| opacity.min(Transfer::MAX_OPACITY))];
    while let Some([from, to]) = left.pop() {
        let middle = 1.0 - ((1.0 - from) * (1.0 - to)).sqrt();
        let is_between = (middle - from) * (to - middle) > 0.0;
        // Next to nothing there is no opacity between some.
        if is_between && !is_cubic([from, to]) {
            parts.push(part_of(middle));
            left.extend([[from, middle], [middle, to]]);
        }
    }
    parts.sort_unstable_by(f64::total_cmp);
    parts
}

/// Whether extinction between two opacities is all but a cubic.
fn is_cubic([from, to]: [f64; 2]) -> bool {
    let extinction = |part: f64| -(-(from + (to - from) * part)).ln_1p();
    let [a, b, c, d] = cubic(extinction);
    (1..2 * TRIED).step_by(2).all(|n| {
        let part = f64::from(n) / f64::from(2 * TRIED);
        let [is, should] = [a + part * (b + part * (c + part * d)), extinction(part)];
        (is - should).abs() <= SAME * should
    })
}

/// The cubic that is what a function is at 0, at 1 and twice between (where Lobatto has them).
fn cubic(of: impl Fn(f64) -> f64) -> [f64; 4] {
    let near = 0.5 - 0.05_f64.sqrt();
    let [a, b, c, d] = [0.0, near, 1.0 - near, 1.0].map(of);
    // By the middle and half the difference of each pair, about the middle of the way; then about its begin.
    let (outer, inner) = (f64::midpoint(a, d), f64::midpoint(b, c));
    let (outer_rise, inner_rise) = (d - a, (c - b) / (1.0 - 2.0 * near));
    let (far, nigh) = (0.25, 0.05);
    let square = (outer - inner) / (far - nigh);
    let cube = (outer_rise - inner_rise) / (far - nigh);
    let slope = inner_rise - cube * nigh;
    let h = -0.5;
    [a, slope + h * (2.0 * square + h * 3.0 * cube), square + 3.0 * h * cube, cube]
}
