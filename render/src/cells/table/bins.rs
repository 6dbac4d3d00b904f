//! The function in bins of one width, for looking up without a search.
//!
//! A bin is a line of a cache. Extinction is taken as linear in it, such that what the bin holds is met; so only the parts
//! of bins at the ends of a segment are not exact, and bins in which these would be off by more than [`SAME`] are marked.
//! The width is such that control points fall between bins if any width near by has it so.

use super::quad::Quad;
use super::{Node, Piece};

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
#[repr(C, align(64))]
pub(super) struct Bin {
    /// Antiderivative at its begin, for one of bins: (τ·red, τ·green, τ·blue, τ), and what rounding has left of it.
    sum: Quad,
    rest: Quad,
    /// (red, green, blue, 1) there.
    light: Quad,
    tau: f32,
    /// How much colour has varied up to there, and goes on to in the bin.
    varied: f32,
    varies: f32,
    /// The ramp, with [`MARKED`].
    pub(super) ramp: u32,
}

/// The function at a place in a bin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Within {
    /// Antiderivative at the begin of the bin, and from there on.
    sum: Quad,
    ahead: Quad,
    pub(super) rate: Quad,
    pub(super) light: Quad,
    pub(super) varied: f32,
}

impl Within {
    /// The antiderivative less that at another place.
    #[inline(always)]
    pub(super) fn since(&self, from: &Self) -> Quad {
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
                bin.varies = (here.varied - before.varied) as f32;
                if !exact.is_even(&before, &here, [first, piece], [begin - 1.0, begin].map(|at| at / scale)) {
                    bin.ramp |= MARKED;
                }
            }
            let sum = here.sum.map(|sum| (sum * scale) as f32);
            list.push(Bin {
                sum: Quad::new(sum),
                rest: Quad::new(std::array::from_fn(|c| (here.sum[c] * scale - f64::from(sum[c])) as f32)),
                light: Quad::new(here.light.map(|v| v as f32)),
                tau: here.rate[3] as f32,
                varied: here.varied as f32,
                varies: 0.0,
                ramp: exact.pieces[piece].ramp,
            });
            before = Some(here);
        }
        Self { list, scale, range: [f64::from(-BELOW), count as f64] }
    }

    /// A bin and the next.
    #[inline(always)]
    pub(super) fn pair(&self, bin: u32) -> &[Bin] {
        &self.list[bin as usize..bin as usize + 2]
    }
}

impl Bin {
    /// So many bins behind its begin.
    #[inline(always)]
    pub(super) fn within(&self, next: &Self, part: f32) -> Within {
        let behind = Quad::all(part);
        let begin = self.light * Quad::all(self.tau);
        let mean = (next.sum - self.sum) + (next.rest - self.rest);
        let rise = behind * (mean - begin);
        Within {
            sum: self.sum,
            ahead: self.rest + behind * (begin + rise),
            rate: begin + (rise + rise),
            light: self.light + behind * (next.light - self.light),
            varied: self.varied + part * self.varies,
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
    /// (red, green, blue, 1).
    light: [f64; 4],
    varied: f64,
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
                3 => 1.0,
                _ => f64::from(piece.color[c]) + f64::from(piece.slope[c]) * ahead,
            }),
            varied: f64::from(piece.varied) + f64::from(piece.varies) * ahead,
        }
    }

    /// Whether a bin between two positions, which begins in one piece and after which another one begins, is all but what
    /// lines between its ends make it.
    fn is_even(&self, from: &At, to: &At, [first, after]: [usize; 2], [begin, end]: [f64; 2]) -> bool {
        if self.pieces[first].ramp == self.pieces[after].ramp
            && self.pieces[first].first == self.pieces[first].last
        {
            return true;
        }
        let width = end - begin;
        let mean: [f64; 4] = std::array::from_fn(|c| (to.sum[c] - from.sum[c]) / width);
        let holds = |at: &At, part: f64, peak: f64| {
            (0..4).all(|c| {
                let rate = from.rate[c] + 2.0 * part * (mean[c] - from.rate[c]);
                let light = from.light[c] + part * (to.light[c] - from.light[c]);
                let same = (at.rate[c] - rate).abs() <= SAME * peak;
                same && (peak == 0.0 || (at.light[c] - light).abs() <= SAME)
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
