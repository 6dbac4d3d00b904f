//! A transfer function for segments on which the scalar runs linearly.
//!
//! The function is cut at its control points, and where opacity rises much also in between, such that in each piece colour runs
//! linearly and extinction, the logarithm -ln(1 - a), is a cubic to within 3e-4 of itself. Means of extinction and of its
//! product with colour follow in closed form between any two places of a piece, without a difference that would lose digits.
//!
//! A mean says nothing about which colour lies in front: how much nearer the colour at the begin is than that at the end follows
//! in closed form for an even extinction. A segment is cut where pieces meet; where extinction and colour change much along a
//! part it is cut as often as needed. Of several pieces that it passes whole, sums are known (pre-integration with tables of one
//! dimension, Engel 2001), which do where colour or optical depth is little.
//!
//! Many segments go at once (`batch`), what few it has no way for by themselves (`parts`). Of either, what is seen of a segment
//! is within 0.2 of 1/255 of the truth: 0.09 of 2.4 million at and about control points.

mod batch;
mod lanes;
mod make;
mod opacity;
mod parts;
#[cfg(test)]
mod tests;

pub(super) use batch::{BATCH, Batch, Stretches};
pub(super) use opacity::opacity;

use lanes::Lanes;

/// Of whole pieces taken by their mean: optical depth times change of colour at most. Its error is a twelfth of that, weighted by
/// the share of the pixel that it makes, an eighth at most; so is the sum over a ray: 0.16 of 1/255.
const EVEN_COLOR: f32 = 0.005;
/// The same for parts of one piece, of the change of optical depth times that of colour.
const EVEN_DEPTH: f32 = 0.02;

/// Values between two cuts, the first of them with it. A *part* is how far between them, 0 to 1.
#[derive(Debug, Clone, Copy)]
struct Piece {
    begin: f32,
    end: f32,
    /// Where parts are counted from, and parts for one of position; none where nothing changes.
    origin: f32,
    scale: f32,
    /// 1/mm: coefficients of part, of its square and of its cube come after the first.
    extinction: [f32; 4],
    /// Red, green, blue at the begin, and how much they change up to the end.
    color: [f32; 3],
    turn: [f32; 3],
    /// The most of these changes; and how much colour has varied up to the begin.
    varies: f32,
    varied: f32,
    /// What the pieces before hold: antiderivative of (τ·red, τ·green, τ·blue, τ) with position.
    sum: [f64; 4],
}

/// A place in the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    position: f32,
    piece: usize,
}

impl Place {
    /// None.
    pub(super) const NOWHERE: Self = Self { position: f32::NAN, piece: 0 };
}

/// A transfer function; a *position* is a value counted from the first control point, the span of all being 1.
#[derive(Debug)]
pub(super) struct Table {
    pieces: Vec<Piece>,
    /// For positions from 0 to 1 in even steps, a piece that does not lie behind them, from which on no more than so many
    /// come before that of any position up to the next step.
    steps: Vec<u32>,
    most: u32,
    /// Where each piece ends; no number for the last.
    ends: Vec<f32>,
    lanes: Lanes,
    first: f64,
    per_value: f64,
    /// Ranges of values in which nothing absorbs.
    clear: Vec<[f64; 2]>,
}

/// What a stretch within one piece comes to.
#[derive(Debug, Clone, Copy)]
struct Mean {
    /// Means of (τ·red, τ·green, τ·blue, τ), 1/mm.
    rates: [f32; 4],
    /// How much colour changes, how much extinction does, 1/mm, and the most that a colour does.
    turn: [f32; 3],
    rise: f32,
    varies: f32,
}

impl Piece {
    /// From one position within it, or at an end of it, to another.
    #[inline(always)]
    fn mean(&self, from: f32, to: f32) -> Mean {
        let (begin, end) = ((from - self.origin) * self.scale, (to - self.origin) * self.scale);
        let (middle, way) = (0.5 * (begin + end), end - begin);
        let [a, b, c, d] = self.extinction;
        let at = a + middle * (b + middle * (c + middle * d));
        let slope = b + middle * (2.0 * c + middle * (3.0 * d));
        let bend = c + middle * (3.0 * d);
        // Means of the square and of the fourth power of the way from the middle.
        let square = way * way * (1.0 / 12.0);
        let mean = at + square * bend;
        let slanted = square * (slope + 1.8 * square * d);
        Mean {
            rates: std::array::from_fn(|c| match c {
                3 => mean,
                _ => (self.color[c] + middle * self.turn[c]) * mean + self.turn[c] * slanted,
            }),
            turn: self.turn.map(|turn| turn * way),
            rise: way * (slope + 3.0 * square * d),
            varies: self.varies * way.abs(),
        }
    }
}

impl Table {
    /// The position of a value.
    #[inline(always)]
    pub(super) fn position(&self, value: f64) -> f64 {
        (value - self.first) * self.per_value
    }

    /// The most that its colours have: red, green, blue.
    pub(super) fn most(&self) -> [f32; 3] {
        self.pieces.iter().fold([0.0; 3], |most, piece| {
            std::array::from_fn(|c| piece.color[c].max(piece.color[c] + piece.turn[c]).max(most[c]))
        })
    }

    /// Whether there may be values between two at which nothing absorbs.
    pub(super) fn has_clear(&self, [low, high]: [f64; 2]) -> bool {
        self.clear.iter().any(|range| low <= range[1] && high >= range[0])
    }

    /// Whether nothing absorbs between two values.
    #[inline(always)]
    pub(super) fn is_clear(&self, [low, high]: [f64; 2]) -> bool {
        // Without a branch for each: there are few, and which it is cannot be foreseen.
        let within = |range: &[f64; 2]| u32::from(low >= range[0]) & u32::from(high <= range[1]);
        self.clear.iter().map(within).sum::<u32>() > 0
    }

    /// The piece of a position.
    #[inline(always)]
    fn piece(&self, position: f32) -> usize {
        let last = self.steps.len() - 1;
        // `as` saturates, and takes what is no number for 0.
        let step = ((position * last as f32) as usize).min(last);
        let mut piece = if position < 0.0 { 0 } else { self.steps[step] as usize };
        for _ in 0..self.most {
            piece += usize::from(self.ends[piece] <= position);
        }
        piece
    }

    /// The place of a position that may be another's.
    #[inline(always)]
    pub(super) fn at(&self, position: f32, other: &Place) -> Place {
        if position == other.position { *other } else { Place { position, piece: self.piece(position) } }
    }

    /// Optical depth times colour, and optical depth, of `mm` along which the scalar runs from one place to another.
    #[inline(always)]
    pub(super) fn depth(&self, from: &Place, to: &Place, mm: f32) -> [f32; 4] {
        if from.piece == to.piece {
            return self.pieces[from.piece].mean(from.position, to.position).rates.map(|rate| rate * mm);
        }
        let Cut { near, between, far, mm } = self.cut(from, to, mm);
        let mut depth = [0.0; 4];
        for (piece, [from, to], mm) in [(from.piece, near, mm[0]), (to.piece, far, mm[2])] {
            let rates = self.pieces[piece].mean(from, to).rates;
            depth = std::array::from_fn(|c| depth[c] + rates[c] * mm);
        }
        if let Some([low, high]) = between {
            let rates = self.whole(low, high);
            depth = std::array::from_fn(|c| depth[c] + rates[c] * mm[1]);
        }
        depth
    }

    /// Means of (τ·red, τ·green, τ·blue, τ) over pieces from `low` up to but not with `high`.
    #[inline(always)]
    fn whole(&self, low: usize, high: usize) -> [f32; 4] {
        let [low, high] = [low, high].map(|piece| &self.pieces[piece]);
        let by = 1.0 / f64::from(high.begin - low.begin);
        std::array::from_fn(|c| ((high.sum[c] - low.sum[c]) * by) as f32)
    }

    /// How much colour varies over pieces from `low` up to but not with `high`.
    #[inline(always)]
    fn varies(&self, low: usize, high: usize) -> f32 {
        let [first, last] = [low, high - 1].map(|piece| &self.pieces[piece]);
        (last.varied - first.varied) + last.varies
    }

    /// Cuts a segment whose ends lie in two pieces.
    #[inline(always)]
    fn cut(&self, from: &Place, to: &Place, mm: f32) -> Cut {
        let (begin, end) = (&self.pieces[from.piece], &self.pieces[to.piece]);
        let rises = from.piece < to.piece;
        let (out, into) = if rises { (begin.end, end.begin) } else { (begin.begin, end.end) };
        let [low, high] = if rises { [from.piece + 1, to.piece] } else { [to.piece + 1, from.piece] };
        let by = mm / (to.position - from.position);
        Cut {
            near: [from.position, out],
            between: (low < high).then_some([low, high]),
            far: [into, to.position],
            mm: [out - from.position, into - out, to.position - into].map(|rise| rise * by),
        }
    }
}

/// A segment cut where it leaves the piece that it begins in, and where it enters the one that it ends in.
struct Cut {
    /// Positions.
    near: [f32; 2],
    far: [f32; 2],
    /// Pieces between these: from one up to but not with another.
    between: Option<[usize; 2]>,
    /// Millimetres of each, from near to far.
    mm: [f32; 3],
}
