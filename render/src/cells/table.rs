//! A transfer function for segments on which the scalar runs linearly.
//!
//! The mean of extinction, and of extinction times colour, between two values is the difference of their antiderivatives
//! over that of the values (pre-integration with tables of one dimension, Engel 2001). The function is cut at its control
//! points, and towards full opacity wherever what comes through halves, so that no bend and no jump lies within a piece; each piece has nodes of its own, and the sums at the nodes are
//! worked out from -ln(1 - a) itself.
//!
//! A mean says nothing about which colour lies in front. Where that would show, a segment is cut at the control points and
//! as often as needed in between; each part has its mean, and how much nearer the colour at its begin is than that at its end
//! follows in closed form for an even extinction and a colour that runs linearly.

use crate::volume::Transfer;

/// Nodes in a piece along which extinction changes.
const NODES: usize = 256;
/// Of a segment taken by its means: optical depth times change of colour at most. Its error is a twelfth of that, weighted by
/// the share of the pixel that it makes, an eighth at most; so is the sum over a ray: 0.16 of 1/255.
const EVEN_COLOR: f32 = 0.005;
/// The same for parts, of the change of optical depth times that of colour.
const EVEN_DEPTH: f32 = 0.02;
/// In how many parts a piece goes at most; such a one is opaque long before its end.
const PARTS: f32 = 1024.0;
/// Segments that go at once.
pub(super) const BATCH: usize = 8;
/// Optical depth below which a series is as good as the exponential.
const THIN: f32 = 0.25;
/// What lets less through ends a segment.
const DARK: f32 = 1e-6;
/// Differences below this part of a node have lost their digits.
const STILL: f32 = 1e-2;

/// Extinction from one node to the next: (τ·red, τ·green, τ·blue, τ), 1/mm.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Node {
    /// Antiderivative at the node.
    sum: [f64; 4],
    from: [f32; 4],
    /// Half of the rise to the next node, such that the sum there is met.
    half_rise: [f32; 4],
}

impl Node {
    /// The antiderivative so many nodes behind it.
    #[inline(always)]
    fn sum(&self, part: f32, width: f32) -> [f64; 4] {
        let mut sum = self.sum;
        for (c, sum) in sum.iter_mut().enumerate() {
            *sum += f64::from(part * (self.from[c] + part * self.half_rise[c]) * width);
        }
        sum
    }
}

/// Values between two control points, the first of them with it.
#[derive(Debug, Clone, Copy)]
struct Piece {
    from: f32,
    origin: f32,
    /// Nodes for one of position, and its inverse.
    scale: f32,
    width: f32,
    first: u32,
    last: u32,
    /// Colour at the origin and its slope.
    color: [f32; 3],
    slope: [f32; 3],
    /// How much colour has varied up to the origin, and goes on to.
    varied: f32,
    varies: f32,
    /// The most that extinction changes for one of position, times how much colour does.
    rough: f32,
}

/// A place in the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    position: f32,
    piece: usize,
    sum: [f64; 4],
    varied: f32,
}

/// One of each of several segments, where no access of memory straddles two lines of a cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(super) struct Batch<T>(pub(super) [T; BATCH]);

impl<T: Copy> Batch<T> {
    /// The same for all.
    #[inline(always)]
    pub(super) fn of(all: T) -> Self {
        Self([all; BATCH])
    }
}

/// Several places.
#[derive(Debug)]
struct Places {
    piece: Batch<u32>,
    node: Batch<u32>,
    /// How many nodes behind its node.
    part: Batch<f32>,
    varied: Batch<f32>,
}

/// A transfer function; a *position* is a value counted from the first control point, the span of all being 1.
#[derive(Debug)]
pub(super) struct Table {
    pieces: Vec<Piece>,
    nodes: Vec<Node>,
    first: f64,
    per_value: f64,
    /// Ranges of values in which nothing absorbs.
    clear: Vec<[f64; 2]>,
    /// To begin a search with.
    start: Place,
}

impl Table {
    pub(super) fn new(transfer: &Transfer) -> Self {
        let points = transfer.points();
        let [low, high] = [&points[0], &points[points.len() - 1]];
        let span = high.value - low.value;
        // A span past the largest number ends at the values that there are.
        let per_value = if span > 0.0 && (1.0 / span) > 0.0 { 1.0 / span } else { 1.0 };
        let start = Place { position: f32::NAN, piece: 0, sum: [0.0; 4], varied: 0.0 };
        let mut table = Self {
            pieces: Vec::new(),
            nodes: Vec::new(),
            first: low.value,
            per_value,
            clear: Vec::new(),
            start,
        };
        let mut clear_from = (low.rgba[3] == 0.0).then_some(f64::NEG_INFINITY);
        let mut sum = [0.0; 4];
        table.push(transfer, [f64::NEG_INFINITY, 0.0], [low.rgba; 2], &mut sum);
        for pair in points.windows(2) {
            let [a, b] = [&pair[0], &pair[1]];
            if clear_from.is_some() && b.rgba[3] > 0.0 {
                // The value of a jump belongs to what comes after it.
                let to = if a.value == b.value { a.value.next_down() } else { a.value };
                table.clear.extend(clear_from.take().map(|from| [from, to]));
            } else if clear_from.is_none() && b.rgba[3] == 0.0 {
                clear_from = Some(b.value);
            }
            if a.value < b.value {
                let ends = [a.value, b.value].map(|v| table.position(v));
                let mut begin = (ends[0], a.rgba);
                for part in opaque_cuts([a.rgba[3], b.rgba[3]]).chain([1.0]) {
                    let mix = |c: usize| a.rgba[c] + (b.rgba[c] - a.rgba[c]) * part;
                    let end = if part == 1.0 {
                        (ends[1], b.rgba)
                    } else {
                        (ends[0] + (ends[1] - ends[0]) * part, std::array::from_fn(mix))
                    };
                    if begin.0 < end.0 {
                        table.push(transfer, [begin.0, end.0], [begin.1, end.1], &mut sum);
                        begin = end;
                    }
                }
            }
        }
        table.clear.extend(clear_from.map(|from| [from, f64::INFINITY]));
        let last = table.position(high.value);
        table.push(transfer, [last, f64::INFINITY], [high.rgba; 2], &mut sum);
        table
    }

    /// Adds a piece between two positions, and to `sum` what it holds.
    fn push(&mut self, transfer: &Transfer, [a, b]: [f64; 2], ends: [[f64; 4]; 2], sum: &mut [f64; 4]) {
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
                sum: *sum,
                from: begin.map(|v| v as f32),
                half_rise: std::array::from_fn(|c| (mean[c] - begin[c]) as f32),
            });
            if bounded {
                *sum = std::array::from_fn(|c| sum[c] + mean[c] * width);
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
        self.pieces.push(Piece {
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

    /// The position of a value.
    #[inline(always)]
    pub(super) fn position(&self, value: f64) -> f64 {
        (value - self.first) * self.per_value
    }

    /// Whether nothing absorbs between two values.
    #[inline(always)]
    pub(super) fn is_clear(&self, [low, high]: [f64; 2]) -> bool {
        self.clear.iter().any(|range| low >= range[0] && high <= range[1])
    }

    /// The node of a position within a piece, and how far behind it the position lies.
    #[inline(always)]
    fn node(&self, piece: &Piece, position: f32) -> (&Node, f32) {
        let part = (position - piece.origin) * piece.scale;
        let index = (part.max(0.0) as u32).min(piece.last - piece.first);
        (&self.nodes[(piece.first + index) as usize], part - index as f32)
    }

    #[inline(always)]
    fn sum(&self, piece: &Piece, position: f32) -> [f64; 4] {
        let (node, part) = self.node(piece, position);
        node.sum(part, piece.width)
    }

    #[inline(always)]
    fn rate(&self, piece: &Piece, position: f32) -> [f32; 4] {
        let (node, part) = self.node(piece, position);
        std::array::from_fn(|c| node.from[c] + 2.0 * part * node.half_rise[c])
    }

    /// Looks a position up, beginning with the piece of another near by.
    #[inline(always)]
    pub(super) fn find(&self, position: f32, near: usize) -> Place {
        let mut piece = near;
        while piece + 1 < self.pieces.len() && position >= self.pieces[piece + 1].from {
            piece += 1;
        }
        while piece > 0 && position < self.pieces[piece].from {
            piece -= 1;
        }
        let p = &self.pieces[piece];
        let ahead = if p.varies > 0.0 { p.varies * (position - p.origin) } else { 0.0 };
        Place { position, piece, sum: self.sum(p, position), varied: p.varied + ahead }
    }

    /// The place of a position that may be, or is near, another.
    #[inline(always)]
    pub(super) fn at(&self, position: f32, near: &Place) -> Place {
        if position == near.position { *near } else { self.find(position, near.piece) }
    }

    /// Looks positions up.
    #[inline(always)]
    fn places(&self, positions: &Batch<f32>) -> Places {
        let mut piece = Batch::of(0_u32);
        for next in self.pieces.iter().skip(1) {
            for n in 0..BATCH {
                piece.0[n] += u32::from(positions.0[n] >= next.from);
            }
        }
        let mut node = Batch::of(0_u32);
        let mut part = Batch::of(0.0);
        let mut varied = Batch::of(0.0);
        let (mut last, mut first) = (Batch::of(0.0), Batch::of(0));
        for n in 0..BATCH {
            let p = &self.pieces[piece.0[n] as usize];
            part.0[n] = (positions.0[n] - p.origin) * p.scale;
            (first.0[n], last.0[n]) = (p.first, (p.last - p.first) as f32);
            varied.0[n] =
                p.varied + if p.varies > 0.0 { p.varies * (positions.0[n] - p.origin) } else { 0.0 };
        }
        for n in 0..BATCH {
            let index = part.0[n].max(0.0).min(last.0[n]) as u32;
            part.0[n] -= index as f32;
            node.0[n] = first.0[n] + index;
        }
        Places { piece, node, part, varied }
    }

    /// As [`Self::segment`], of several at once.
    #[inline(always)]
    pub(super) fn segments(&self, [from, to]: [&Batch<f32>; 2], mm: &Batch<f32>, seen: &mut Batch<[f32; 4]>) {
        let (a, b) = (self.places(from), self.places(to));
        let mut tau = Batch::of(0.0);
        let mut rise = Batch::of(0.0);
        let mut by = Batch::of(0.0);
        let mut still = Batch::of(0_u32);
        for n in 0..BATCH {
            rise.0[n] = to.0[n] - from.0[n];
            by.0[n] = mm.0[n] / rise.0[n];
        }
        for n in 0..BATCH {
            let [p, q] = [&a, &b].map(|places| &self.pieces[places.piece.0[n] as usize]);
            if rise.0[n].abs() * p.scale.min(q.scale) > STILL {
                let near = self.nodes[a.node.0[n] as usize].sum(a.part.0[n], p.width);
                let far = self.nodes[b.node.0[n] as usize].sum(b.part.0[n], q.width);
                for c in 0..4 {
                    seen.0[n][c] = (far[c] - near[c]) as f32 * by.0[n];
                }
            } else {
                seen.0[n] = self.rate(p, from.0[n] + 0.5 * rise.0[n]).map(|v| v * mm.0[n]);
                still.0[n] = u32::MAX;
            }
            tau.0[n] = seen.0[n][3];
        }
        let mut rough = Batch::of(0.0);
        let mut across = Batch::of(0);
        for n in 0..BATCH {
            rough.0[n] = self.pieces[a.piece.0[n] as usize].rough * mm.0[n];
            across.0[n] = a.piece.0[n] ^ b.piece.0[n];
        }
        let mut alone = Batch::of(0_u32);
        let mut part = Batch::of(0.0);
        let mut lags = Batch::of(0.0);
        for n in 0..BATCH {
            let t = tau.0[n];
            let opacity = opacity(t);
            let uneven = t * (b.varied.0[n] - a.varied.0[n]).abs() > EVEN_COLOR;
            let smooth = rough.0[n] * (rise.0[n] * rise.0[n]) <= EVEN_DEPTH;
            // What changes too much, or passes between pieces where they are near, is seen to by itself.
            let much = if smooth { across.0[n] } else { 1 };
            alone.0[n] = if uneven { much } else { across.0[n] & still.0[n] };
            part.0[n] = if t > 0.0 { opacity / t } else { 0.0 };
            lags.0[n] = if uneven { rise.0[n] * behind(t, opacity) } else { 0.0 };
            tau.0[n] = if t > 0.0 { opacity } else { 0.0 };
        }
        for n in 0..BATCH {
            let slope = &self.pieces[a.piece.0[n] as usize].slope;
            let depth = seen.0[n];
            for c in 0..3 {
                seen.0[n][c] = depth[c] * part.0[n] + slope[c] * lags.0[n];
            }
            seen.0[n][3] = tau.0[n];
        }
        for n in (0..BATCH).filter(|&n| alone.0[n] != 0) {
            let [a, b] = [(from, &a), (to, &b)].map(|(x, p)| self.find(x.0[n], p.piece.0[n] as usize));
            seen.0[n] = self.segment(&a, &b, mm.0[n]);
        }
    }

    /// A place to begin a search with.
    pub(super) fn start(&self) -> &Place {
        &self.start
    }

    /// Colour, premultiplied, and opacity of `mm` along which the scalar runs from one place to another.
    #[inline(always)]
    pub(super) fn segment(&self, from: &Place, to: &Place, mm: f32) -> [f32; 4] {
        let rise = to.position - from.position;
        let depth = self.depth(from, to, mm);
        let tau = depth[3];
        if tau <= 0.0 || tau.is_nan() {
            return [0.0; 4];
        }
        let opacity = opacity(tau);
        let part = opacity / tau;
        let mut seen = [depth[0] * part, depth[1] * part, depth[2] * part, opacity];
        if tau * (to.varied - from.varied).abs() > EVEN_COLOR && rise != 0.0 {
            let piece = &self.pieces[from.piece];
            let smooth = piece.rough * mm * (rise * rise) <= EVEN_DEPTH;
            if from.piece != to.piece || !smooth {
                return self.in_parts(from, to, mm);
            }
            let behind = behind(tau, opacity);
            for (seen, slope) in seen.iter_mut().zip(piece.slope) {
                *seen += slope * rise * behind;
            }
        }
        seen
    }

    /// Optical depth times colour, and optical depth.
    #[inline(always)]
    pub(super) fn depth(&self, from: &Place, to: &Place, mm: f32) -> [f32; 4] {
        let rise = to.position - from.position;
        let [piece, other] = [from, to].map(|place| &self.pieces[place.piece]);
        if rise.abs() * piece.scale.min(other.scale) > STILL {
            let by = mm / rise;
            return std::array::from_fn(|c| (to.sum[c] - from.sum[c]) as f32 * by);
        }
        if from.piece != to.piece {
            return self.depth_across(from, to, mm);
        }
        self.rate(piece, from.position + 0.5 * rise).map(|v| v * mm)
    }

    /// The same for places of different pieces that are near for the nodes of one of them.
    #[cold]
    #[inline(never)]
    fn depth_across(&self, from: &Place, to: &Place, mm: f32) -> [f32; 4] {
        let [low, high] = if from.position < to.position { [from, to] } else { [to, from] };
        let mut sum = [0.0_f64; 4];
        let mut at = low.position;
        for index in low.piece..=high.piece {
            let piece = &self.pieces[index];
            let end = if index == high.piece { high.position } else { self.pieces[index + 1].from };
            let width = end - at;
            let part = if width * piece.scale > STILL {
                let [a, b] = [at, end].map(|position| self.sum(piece, position));
                std::array::from_fn(|c| b[c] - a[c])
            } else {
                self.rate(piece, at + 0.5 * width).map(|v| f64::from(v) * f64::from(width))
            };
            sum = std::array::from_fn(|c| sum[c] + part[c]);
            at = end;
        }
        let by = f64::from(mm) / f64::from(high.position - low.position);
        sum.map(|v| (v * by) as f32)
    }

    /// The same as [`Self::segment`] where it matters which colour is in front.
    #[cold]
    #[inline(never)]
    fn in_parts(&self, from: &Place, to: &Place, mm: f32) -> [f32; 4] {
        let rises = to.position > from.position;
        let per_position = mm / (to.position - from.position);
        let mut got = [0.0_f32; 4];
        let mut at = from.position;
        let mut index = from.piece;
        loop {
            let piece = &self.pieces[index];
            let last = index == to.piece;
            let end = match (last, rises) {
                (true, _) => to.position,
                (false, true) => self.pieces[index + 1].from,
                (false, false) => piece.from,
            };
            self.part(piece, [at, end], per_position, &mut got);
            if last || 1.0 - got[3] < DARK {
                return got;
            }
            at = end;
            index = if rises { index + 1 } else { index - 1 };
        }
    }

    /// Adds what lies between two positions of one piece.
    fn part(&self, piece: &Piece, [from, to]: [f32; 2], per_position: f32, got: &mut [f32; 4]) {
        let mm = per_position * (to - from);
        let change = (self.rate(piece, to)[3] - self.rate(piece, from)[3]).abs() * mm;
        let rough = change * piece.varies * (to - from).abs() / EVEN_DEPTH;
        let parts = rough.sqrt().ceil().clamp(1.0, PARTS);
        let mut at = from;
        let index = self.pieces.partition_point(|p| p.first < piece.first);
        let place = |position| Place { position, piece: index, sum: self.sum(piece, position), varied: 0.0 };
        let mut begin = place(from);
        for n in 1..=parts as u32 {
            let end = if n as f32 == parts { to } else { from + (to - from) * (n as f32 / parts) };
            let finish = place(end);
            let depth = self.depth(&begin, &finish, per_position * (end - at));
            let tau = depth[3];
            if tau > 0.0 {
                let opacity = opacity(tau);
                let behind = behind(tau, opacity);
                let through = 1.0 - got[3];
                let rise = end - at;
                for c in 0..3 {
                    let mean = depth[c] / tau * opacity;
                    got[c] += through * (mean + piece.slope[c] * rise * behind);
                }
                got[3] += through * opacity;
            }
            if 1.0 - got[3] < DARK {
                return;
            }
            (at, begin) = (end, finish);
        }
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

/// By how much the share of the colour at the end of a stretch falls behind that at its begin.
#[inline(always)]
fn behind(tau: f32, opacity: f32) -> f32 {
    if tau < 0.05 {
        tau * tau * (tau * (1.0 / 24.0) - 1.0 / 12.0)
    } else {
        opacity / tau - 1.0 + 0.5 * opacity
    }
}

/// 1 - e^-τ, without loss where τ is small.
#[inline(always)]
pub(super) fn opacity(tau: f32) -> f32 {
    let series = 1.0 - tau * (1.0 / 3.0 - tau * (1.0 / 12.0 - tau * (1.0 / 60.0 - tau * (1.0 / 360.0))));
    let thin = tau - 0.5 * tau * tau * series;
    let thick = 1.0 - exp_minus(tau);
    if tau < THIN { thin } else { thick }
}

/// e^-τ for τ ≥ 0, by arithmetic alone: several go at once.
#[inline(always)]
fn exp_minus(tau: f32) -> f32 {
    // ln 2 in two parts, the first of few digits, so that its multiples are exact.
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    let tau = if tau < 87.0 { tau } else { 87.0 };
    let halvings = (tau * std::f32::consts::LOG2_E + 0.5) as i32;
    let count = halvings as f32;
    let rest = (count * LN_2[0] - tau) + count * LN_2[1];
    let series = rest * (1.0 / 6.0 + rest * (1.0 / 24.0 + rest * (1.0 / 120.0 + rest * (1.0 / 720.0))));
    let power = 1.0 + rest * (1.0 + rest * (0.5 + series));
    power * f32::from_bits(((127 - halvings) as u32) << 23)
}
