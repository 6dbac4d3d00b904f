//! The function in bins of one width, for looking up without a search.
//!
//! A bin is two lines of a cache. Extinction is taken as linear in it, such that what the bin holds is met; so only the parts
//! of bins at the ends of a segment are not exact, and bins in which these would be off by more than [`SAME`] are marked.
//! The width is such that control points fall between bins if any width near by has it so.

use super::{Node, Piece};
use crate::simd::Eight;

/// Bins below the first control point: a constant one, and one that ends there.
const BELOW: i32 = 2;
/// Fewest bins, and most; and of the narrowest ramp, if that is not too many.
const COUNT: [usize; 2] = [1024, 4096];
const OF_A_RAMP: f64 = 64.0;
/// Control points this near to where a bin begins are there.
const SNAP: f64 = 1e-9;
/// How much a rate may be off in a bin, for one of the most in it; and a colour, for one of 1.
const SAME: f64 = 3e-4;
/// For a ramp: that of a bin which is not to be relied on.
pub(super) const MARKED: u32 = 1 << 31;

/// The function from one place on.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(128))]
pub(super) struct Bin {
    /// Antiderivative at its begin, for one of bins: (τ·red, τ·green, τ·blue, τ), and what rounding has left of it.
    sum: [f32; 4],
    rest: [f32; 4],
    /// Extinction there, and half of its rise up to the next bin.
    rate: [f32; 4],
    half_rise: [f32; 4],
    /// (red, green, blue, how much colour has varied) there, and their rise up to the next bin.
    light: [f32; 4],
    turn: [f32; 4],
    /// The ramp, with [`MARKED`].
    pub(super) ramp: u32,
    /// The piece at its begin.
    pub(super) piece: u32,
}

/// The function at places in two bins.
#[derive(Debug, Clone, Copy)]
pub(super) struct Within<E> {
    /// Antiderivative at the begin of the bin, and from there on.
    sum: E,
    ahead: E,
    pub(super) rate: E,
    pub(super) light: E,
}

impl<E: Eight> Within<E> {
    /// The antiderivative less that at another place.
    #[inline(always)]
    pub(super) fn since(&self, from: &Self) -> E {
        (self.sum - from.sum) + (self.ahead - from.ahead)
    }
}

/// All bins.
#[derive(Debug)]
pub(super) struct Bins {
    list: Vec<Bin>,
    /// Bins for one of position.
    pub(super) scale: f64,
    /// Where the first bin begins and the last but one, in bins from the first control point.
    pub(super) range: [f64; 2],
}

impl Bins {
    pub(super) fn new(exact: &Exact<'_>) -> Self {
        let last = exact.pieces.len() - 1;
        let top = exact.starts[last];
        let top = if top > 0.0 { top } else { 1.0 };
        let bends: Vec<f64> = (2..=last)
            .filter(|&piece| exact.pieces[piece].ramp != exact.pieces[piece - 1].ramp)
            .map(|piece| exact.starts[piece] / top)
            .collect();
        let count = count(&bends);
        let scale = count as f64 / top;
        let mut list: Vec<Bin> = Vec::with_capacity(count + 4);
        let mut piece = 0;
        let mut before: Option<At> = None;
        for number in -BELOW..=count as i32 + 1 {
            let begin = f64::from(number);
            let first = piece;
            while piece < last && exact.starts[piece + 1] * scale <= begin + SNAP {
                piece += 1;
            }
            let here = exact.at(piece, begin / scale);
            if let (Some(before), Some(bin)) = (before, list.last_mut()) {
                // What is the same for ever has no rise at all, which would count far out.
                if !exact.is_constant([first, piece]) {
                    bin.half_rise = std::array::from_fn(|c| {
                        ((here.sum[c] - before.sum[c]) * scale - f64::from(bin.rate[c])) as f32
                    });
                    bin.turn = std::array::from_fn(|c| (here.light[c] - before.light[c]) as f32);
                    if !exact.is_even(
                        &before,
                        &here,
                        [first, piece],
                        [begin - 1.0, begin].map(|at| at / scale),
                    ) {
                        bin.ramp |= MARKED;
                    }
                }
            }
            let sum = here.sum.map(|sum| (sum * scale) as f32);
            list.push(Bin {
                sum,
                rest: std::array::from_fn(|c| (here.sum[c] * scale - f64::from(sum[c])) as f32),
                rate: here.rate.map(|v| v as f32),
                half_rise: [0.0; 4],
                light: here.light.map(|v| v as f32),
                turn: [0.0; 4],
                ramp: exact.pieces[piece].ramp,
                piece: piece as u32,
            });
            before = Some(here);
        }
        Self { list, scale, range: [f64::from(-BELOW), count as f64] }
    }

    #[inline(always)]
    pub(super) fn bin(&self, number: u32) -> &Bin {
        &self.list[number as usize]
    }
}

impl Bin {
    /// So many bins behind its begin, and behind that of another.
    #[inline(always)]
    pub(super) fn within<E: Eight>(&self, other: &Self, part: E) -> Within<E> {
        let rate = E::of(&self.rate, &other.rate);
        let rise = part * E::of(&self.half_rise, &other.half_rise);
        Within {
            sum: E::of(&self.sum, &other.sum),
            ahead: E::of(&self.rest, &other.rest) + part * (rate + rise),
            rate: rate + (rise + rise),
            light: E::of(&self.light, &other.light) + part * E::of(&self.turn, &other.turn),
        }
    }
}

/// How many bins, for control points at parts of the way from the first to the last.
fn count(bends: &[f64]) -> usize {
    let ends = bends.iter().copied().chain([1.0]);
    let (narrowest, _) = ends.fold((1.0_f64, 0.0), |(least, from), to| (least.min(to - from), to));
    let few = ((OF_A_RAMP / narrowest).ceil() as usize).clamp(COUNT[0], COUNT[1]);
    let mut best = (few, usize::MAX);
    for count in few..2 * few {
        let between = |bend: f64| {
            let at = bend * count as f64;
            (at - at.round()).abs() > SNAP
        };
        let mut within = 0;
        for &bend in bends {
            within += usize::from(between(bend));
            if within >= best.1 {
                break;
            }
        }
        if within < best.1 {
            best = (count, within);
        }
        if within == 0 {
            break;
        }
    }
    best.0
}

/// The function in pieces, in double precision.
#[derive(Debug)]
pub(super) struct Exact<'a> {
    pub(super) pieces: &'a [Piece],
    pub(super) nodes: &'a [Node],
    /// Where each piece begins; the first at minus infinity.
    pub(super) starts: &'a [f64],
}

/// The function at a place.
#[derive(Debug, Clone, Copy)]
struct At {
    sum: [f64; 4],
    /// (τ·red, τ·green, τ·blue, τ).
    rate: [f64; 4],
    /// (red, green, blue, how much colour has varied up to there).
    light: [f64; 4],
}

impl Exact<'_> {
    /// As a piece has it at a position in it or at its ends.
    fn at(&self, index: usize, position: f64) -> At {
        let piece = &self.pieces[index];
        let origin = self.starts[index.max(1)];
        let count = piece.last - piece.first + 1;
        let end = self.starts.get(index + 1).filter(|_| count > 1);
        let width = end.map_or(1.0, |end| (end - origin) / f64::from(count));
        let part = (position - origin) / width;
        let node = (part.max(0.0) as u32).min(count - 1);
        let part = part - f64::from(node);
        let node = &self.nodes[(piece.first + node) as usize];
        let [from, half_rise] = [node.from, node.half_rise].map(|rates| rates.map(f64::from));
        let ahead = position - origin;
        let rate: [f64; 4] = std::array::from_fn(|c| from[c] + 2.0 * part * half_rise[c]);
        At {
            sum: std::array::from_fn(|c| node.sum[c] + part * (from[c] + part * half_rise[c]) * width),
            rate,
            light: std::array::from_fn(|c| match c {
                3 => f64::from(piece.varied) + f64::from(piece.varies) * ahead,
                _ => f64::from(piece.color[c]) + f64::from(piece.slope[c]) * ahead,
            }),
        }
    }

    /// Whether nothing changes between the begins of two bins that lie in these pieces.
    fn is_constant(&self, [first, after]: [usize; 2]) -> bool {
        let [first, after] = [first, after].map(|piece| &self.pieces[piece]);
        first.ramp == after.ramp && first.first == first.last
    }

    /// Whether a bin between two positions, which begins in one piece and after which another one begins, is all but what
    /// lines between its ends make it.
    fn is_even(&self, from: &At, to: &At, [first, after]: [usize; 2], [begin, end]: [f64; 2]) -> bool {
        let width = end - begin;
        let mean: [f64; 4] = std::array::from_fn(|c| (to.sum[c] - from.sum[c]) / width);
        let holds = |at: &At, part: f64, peak: f64| {
            (0..4).all(|c| {
                let rate = from.rate[c] + 2.0 * part * (mean[c] - from.rate[c]);
                let light = from.light[c] + part * (to.light[c] - from.light[c]);
                let same = (at.rate[c] - rate).abs() <= SAME * peak;
                same && (c == 3 || peak == 0.0 || (at.light[c] - light).abs() <= SAME)
            })
        };
        let mut even = true;
        for piece in first..=after {
            let [low, high] = [self.starts[piece], *self.starts.get(piece + 1).unwrap_or(&end)]
                .map(|at| at.clamp(begin, end));
            if piece > first && (end - low) <= width * SNAP {
                break;
            }
            let starts = (piece > first).then(|| (self.at(piece, low), low));
            let ends = if piece == after { *to } else { self.at(piece, high) };
            for (at, position) in starts.into_iter().chain([(ends, high)]) {
                let peak = from.rate[3].max(to.rate[3]).max(at.rate[3]);
                even &= holds(&at, (position - begin) / width, peak);
            }
        }
        even
    }
}
