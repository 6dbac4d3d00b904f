//! A transfer function for segments on which the scalar runs linearly.
//!
//! The mean of extinction, and of extinction times colour, between two values is the difference of their antiderivatives
//! over that of the values (pre-integration with tables of one dimension, Engel 2001). The function is cut at its control
//! points, and towards full opacity wherever what comes through halves, so that no bend and no jump lies within a piece; each
//! piece has nodes of its own, and the sums at the nodes are worked out from -ln(1 - a) itself.
//!
//! A mean says nothing about which colour lies in front. Where that would show, a segment is cut at the control points and
//! as often as needed in between; each part has its mean, and how much nearer the colour at its begin is than that at its end
//! follows in closed form for an even extinction and a colour that runs linearly.
//!
//! Many segments at once are looked up without a search, in bins of one width made of the pieces; the few for which these do
//! not do are seen to by themselves. Of either, what is seen of a segment is within 0.2 of 1/255 of the truth.

mod batch;
mod bins;
mod make;
mod opacity;
mod parts;
#[cfg(test)]
mod tests;

pub(super) use batch::{BATCH, Batch, Stretches};
pub(super) use opacity::opacity;

use bins::Bins;
use opacity::behind;

/// Of a segment taken by its means: optical depth times change of colour at most. Its error is a twelfth of that, weighted by
/// the share of the pixel that it makes, an eighth at most; so is the sum over a ray: 0.16 of 1/255.
const EVEN_COLOR: f32 = 0.005;
/// The same for parts, of the change of optical depth times that of colour.
const EVEN_DEPTH: f32 = 0.02;
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
    /// The same for all pieces between two control points.
    ramp: u32,
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

/// A transfer function; a *position* is a value counted from the first control point, the span of all being 1.
#[derive(Debug)]
pub(super) struct Table {
    pieces: Vec<Piece>,
    nodes: Vec<Node>,
    bins: Bins,
    first: f64,
    per_value: f64,
    /// Ranges of values in which nothing absorbs.
    clear: Vec<[f64; 2]>,
    /// To begin a search with.
    start: Place,
}

impl Table {
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
        let (piece, other) = (&self.pieces[from.piece], &self.pieces[to.piece]);
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
}
