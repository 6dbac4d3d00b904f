//! Several segments at once.

use super::bins::{Bins, MARKED};
use super::opacity::{behind, opacity};
use super::{EVEN_COLOR, EVEN_DEPTH, Table};

/// Segments that go at once.
pub(in super::super) const BATCH: usize = 8;
/// Bins apart from which on sums have kept their digits.
const APART: f32 = 1.0 / 32.0;

/// One of each of several segments, where no access of memory straddles two lines of a cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(in super::super) struct Batch<T>(pub(in super::super) [T; BATCH]);

impl<T: Copy> Batch<T> {
    /// The same for all.
    #[inline(always)]
    pub(in super::super) fn of(all: T) -> Self {
        Self([all; BATCH])
    }
}

/// Several places.
#[derive(Debug)]
struct Places {
    /// In bins.
    at: Batch<f64>,
    bin: Batch<i32>,
    /// How many bins behind its begin.
    part: Batch<f32>,
}

impl Bins {
    /// Looks positions up.
    #[inline(always)]
    fn places(&self, positions: &Batch<f32>) -> Places {
        let mut places = Places { at: Batch::of(0.0), bin: Batch::of(0), part: Batch::of(0.0) };
        let [first, last] = self.range;
        for n in 0..BATCH {
            let at = f64::from(positions.0[n]) * self.scale;
            let kept = at.max(first).min(last);
            let whole = kept as i32;
            let bin = whole - i32::from(kept < f64::from(whole));
            places.at.0[n] = at;
            places.bin.0[n] = bin;
            places.part.0[n] = (at - f64::from(bin)) as f32;
        }
        places
    }
}

impl Table {
    /// As [`Self::segment`], of several at once.
    #[inline(always)]
    pub(in super::super) fn segments(
        &self,
        [from, to]: [&Batch<f32>; 2],
        mm: &Batch<f32>,
        seen: &mut Batch<[f32; 4]>,
    ) {
        let (a, b) = (self.bins.places(from), self.bins.places(to));
        let (mut by, mut near) = (Batch::of(0.0), Batch::of(0.0));
        for n in 0..BATCH {
            let rise = (b.at.0[n] - a.at.0[n]) as f32;
            // Between places of one bin, or all but one, the mean is that of the rates at them.
            let is_near = (a.bin.0[n] == b.bin.0[n]) | (rise.abs() < APART);
            by.0[n] = if is_near { 0.0 } else { mm.0[n] / rise };
            near.0[n] = if is_near { 0.5 * mm.0[n] } else { 0.0 };
        }
        let mut turn = Batch::of([0.0; 4]);
        let (mut tau, mut change, mut varies) = (Batch::of(0.0), Batch::of(0.0), Batch::of(0.0));
        let (mut marks, mut across) = (Batch::of(0_u32), Batch::of(0_u32));
        for n in 0..BATCH {
            let [p, q] = [&a, &b].map(|places| self.bins.pair(places.bin.0[n]));
            let (p, q) = (&p[0], &q[0]);
            let begin = self.bins.pair(a.bin.0[n]);
            let finish = self.bins.pair(b.bin.0[n]);
            let begin = begin[0].within(&begin[1], a.part.0[n]);
            let finish = finish[0].within(&finish[1], b.part.0[n]);
            let mut depth = [0.0; 4];
            for c in 0..4 {
                let sum = (finish.sum[c] - begin.sum[c]) as f32 + (finish.ahead[c] - begin.ahead[c]);
                depth[c] = sum * by.0[n] + (begin.rate[c] + finish.rate[c]) * near.0[n];
                turn.0[n][c] = finish.light[c] - begin.light[c];
            }
            seen.0[n] = depth;
            tau.0[n] = depth[3];
            change.0[n] = turn.0[n][3];
            varies.0[n] = finish.varied - begin.varied;
            marks.0[n] = p.ramp | q.ramp;
            across.0[n] = p.ramp ^ q.ramp;
        }
        let mut alone = Batch::of(0_u32);
        let (mut part, mut lag) = (Batch::of(0.0), Batch::of(0.0));
        for n in 0..BATCH {
            let t = tau.0[n];
            let opacity = opacity(t);
            let varies = varies.0[n].abs();
            let uneven = t * varies > EVEN_COLOR;
            let rough = change.0[n].abs() * mm.0[n] * varies > EVEN_DEPTH;
            // What is marked or no number, or changes too much, is seen to by itself.
            let much = uneven & (rough | (across.0[n] != 0));
            alone.0[n] = u32::from(much | t.is_nan() | (marks.0[n] >= MARKED));
            part.0[n] = if t > 0.0 { opacity / t } else { 0.0 };
            lag.0[n] = if t > 0.0 { behind(t, opacity) } else { 0.0 };
            tau.0[n] = if t > 0.0 { opacity } else { 0.0 };
        }
        for n in 0..BATCH {
            for c in 0..4 {
                seen.0[n][c] = seen.0[n][c] * part.0[n] + turn.0[n][c] * lag.0[n];
            }
            seen.0[n][3] = tau.0[n];
        }
        for n in (0..BATCH).filter(|&n| alone.0[n] != 0) {
            let [a, b] = [(from, &a), (to, &b)]
                .map(|(x, places)| self.find(x.0[n], self.bins.pair(places.bin.0[n])[0].piece as usize));
            seen.0[n] = self.segment(&a, &b, mm.0[n]);
        }
    }
}
