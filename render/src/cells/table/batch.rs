//! Many segments at once, in steps that each go through all of them: what one step waits for is there by the next.

use super::bins::{Bins, MARKED};
use super::eight::Eight;
use super::opacity::{behind, opacity};
use super::{EVEN_COLOR, EVEN_DEPTH, Table};

/// Numbers that go through arithmetic together.
const WIDE: usize = 8;
/// Segments that go at once.
pub(in super::super) const BATCH: usize = 88;
/// Bins apart from which on sums have kept their digits.
const APART: f32 = 1.0 / 32.0;

/// One of each of several segments, where no access of memory straddles two lines of a cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Each<T>([[T; WIDE]; BATCH / WIDE]);

/// Where an end of each of several segments lies: its bin, and how many bins behind the begin of that.
#[derive(Debug)]
struct Ends {
    bin: Each<u32>,
    part: Each<f32>,
}

impl Ends {
    fn new() -> Self {
        Self { bin: Each([[0; WIDE]; BATCH / WIDE]), part: Each([[0.0; WIDE]; BATCH / WIDE]) }
    }

    /// Looks positions up; where they are in bins.
    #[inline(always)]
    fn look_up(&mut self, bins: &Bins, positions: &[f32; WIDE], k: usize) -> [f64; WIDE] {
        // Added and taken away again, it leaves the nearest whole number, which then is in its lowest digits.
        const WHOLE: f64 = 6_755_399_441_055_744.0;
        let [first, last] = bins.range;
        let (mut at, mut begin) = ([0.0; WIDE], [0.0; WIDE]);
        for n in 0..WIDE {
            let x = f64::from(positions[n]) * bins.scale;
            let low = if x > first { x } else { first };
            let kept = if low < last { low } else { last };
            let nearest = (kept + WHOLE) - WHOLE;
            begin[n] = if nearest > kept { nearest - 1.0 } else { nearest };
            at[n] = x;
        }
        for n in 0..WIDE {
            self.part.0[k][n] = (at[n] - begin[n]) as f32;
            self.bin.0[k][n] = ((begin[n] - first) + WHOLE).to_bits() as u32;
        }
        at
    }
}

/// Several segments, and what is seen of them.
#[derive(Debug)]
pub(in super::super) struct Batch {
    from: Ends,
    to: Ends,
    /// What the difference of sums counts, and the sum of rates.
    apart: Each<f32>,
    near: Each<f32>,
    /// Colour, premultiplied, and opacity.
    seen: [[f32; 4]; BATCH],
}

/// Segments to integrate, one of each in a list, [`BATCH`] at most: positions and millimetres from begin to end.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Stretches<'a> {
    pub(in super::super) from: &'a [f32],
    pub(in super::super) to: &'a [f32],
    pub(in super::super) mm: &'a [f32],
}

/// What [`WIDE`] segments have, the nth with the fourth after it.
struct Sums<E> {
    /// Optical depth times colour, and optical depth.
    depth: [E; 4],
    /// The colour at the end less that at the begin, and how much it varies all along.
    turn: [E; 4],
    /// How much more extinction there is at the end than at the begin.
    rise: [f32; WIDE],
    /// Differences of the ramps, and marks.
    ramps: [u32; WIDE],
}

/// So many of a list, with nothing for what it lacks.
#[inline(always)]
fn eight(of: &[f32], k: usize) -> [f32; WIDE] {
    let of = &of[k * WIDE..];
    match of.first_chunk() {
        Some(all) => *all,
        None => std::array::from_fn(|n| of.get(n).copied().unwrap_or(0.0)),
    }
}

impl Batch {
    /// With nothing in it.
    pub(in super::super) fn new() -> Self {
        let each = Each([[0.0; WIDE]; BATCH / WIDE]);
        Self { from: Ends::new(), to: Ends::new(), apart: each, near: each, seen: [[0.0; 4]; BATCH] }
    }

    /// Colour, premultiplied, and opacity of what was last integrated.
    #[inline(always)]
    pub(in super::super) fn seen(&self) -> &[[f32; 4]; BATCH] {
        &self.seen
    }

    #[inline(always)]
    fn look_up(&mut self, bins: &Bins, of: Stretches<'_>, k: usize) {
        let a = self.from.look_up(bins, &eight(of.from, k), k);
        let b = self.to.look_up(bins, &eight(of.to, k), k);
        let mm = eight(of.mm, k);
        for n in 0..WIDE {
            let rise = (b[n] - a[n]) as f32;
            // Between places of one bin, or all but one, the mean is that of the rates at them.
            let is_near = (self.from.bin.0[k][n] == self.to.bin.0[k][n]) | (rise.abs() < APART);
            self.apart.0[k][n] = if is_near { 0.0 } else { mm[n] / rise };
            self.near.0[k][n] = if is_near { 0.5 * mm[n] } else { 0.0 };
        }
    }

    #[inline(always)]
    fn add_up<E: Eight>(&self, bins: &Bins, k: usize) -> Sums<E> {
        let [starts, stops] = [&self.from.bin.0[k], &self.to.bin.0[k]];
        let begin_parts = E::from_array(self.from.part.0[k]).spread();
        let end_parts = E::from_array(self.to.part.0[k]).spread();
        let apart = E::from_array(self.apart.0[k]).spread();
        let near = E::from_array(self.near.0[k]).spread();
        let (mut depth, mut turn, mut rise) = (apart, apart, apart);
        let (mut from, mut to) = ([0; WIDE], [0; WIDE]);
        for n in 0..4 {
            let [p, other_p] = [bins.bin(starts[n]), bins.bin(starts[n + 4])];
            let [q, other_q] = [bins.bin(stops[n]), bins.bin(stops[n + 4])];
            let begin = p.within(other_p, begin_parts[n]);
            let end = q.within(other_q, end_parts[n]);
            depth[n] = end.since(&begin) * apart[n] + (begin.rate + end.rate) * near[n];
            turn[n] = end.light - begin.light;
            rise[n] = end.rate - begin.rate;
            (from[n], from[n + 4]) = (p.ramp, other_p.ramp);
            (to[n], to[n + 4]) = (q.ramp, other_q.ramp);
        }
        let mut ramps = [0; WIDE];
        for n in 0..WIDE {
            ramps[n] = (from[n] ^ to[n]) | ((from[n] | to[n]) & MARKED);
        }
        Sums { depth, turn, rise: E::lasts(rise).to_array(), ramps }
    }

    /// From optical depth to what is seen; tells which have to be seen to by themselves.
    #[inline(always)]
    fn shade<E: Eight>(&mut self, sums: &Sums<E>, mm: &[f32; WIDE], k: usize) -> [u32; WIDE] {
        let tau = E::lasts(sums.depth).to_array();
        let varies = E::lasts(sums.turn).to_array();
        let (mut parts, mut lags, mut alone) = ([0.0; WIDE], [0.0; WIDE], [0; WIDE]);
        for n in 0..WIDE {
            let t = tau[n];
            let opacity = opacity(t);
            let varies = varies[n].abs();
            let uneven = t * varies > EVEN_COLOR;
            let rough = sums.rise[n].abs() * mm[n] * varies > EVEN_DEPTH;
            let ramps = sums.ramps[n];
            // What is marked or no number, or changes too much, is seen to by itself.
            let much = if rough { 1 } else { ramps };
            let marked = if t.is_nan() { 1 } else { ramps & MARKED };
            alone[n] = if uneven { much } else { marked };
            let is_seen = t > 0.0;
            let (part, lag) = (opacity / t, behind(t, opacity));
            parts[n] = if is_seen { part } else { 0.0 };
            lags[n] = if is_seen { lag } else { 0.0 };
        }
        let parts = E::from_array(parts).spread();
        let lags = E::from_array(lags).spread();
        let (low, high) = self.seen[k * WIDE..(k + 1) * WIDE].split_at_mut(4);
        for n in 0..4 {
            let seen = sums.depth[n] * parts[n] + sums.turn[n].without_lasts() * lags[n];
            seen.put(&mut low[n], &mut high[n]);
        }
        alone
    }
}

impl Table {
    /// As [`Self::segment`], of several; what is seen of them is in the batch then.
    #[inline(always)]
    pub(in super::super) fn segments<E: Eight>(&self, batch: &mut Batch, of: Stretches<'_>) {
        let wide = of.mm.len().div_ceil(WIDE).min(BATCH / WIDE);
        for k in 0..wide {
            batch.look_up(&self.bins, of, k);
        }
        for k in 0..wide {
            let sums = batch.add_up::<E>(&self.bins, k);
            let alone = batch.shade(&sums, &eight(of.mm, k), k);
            if alone.iter().fold(0, |any, alone| any | alone) != 0 {
                self.alone(batch, of, alone, k);
            }
        }
    }

    /// Sees to those by themselves that have to be.
    #[inline(never)]
    fn alone(&self, batch: &mut Batch, of: Stretches<'_>, alone: [u32; WIDE], k: usize) {
        for (n, _) in alone.iter().enumerate().filter(|(_, alone)| **alone != 0) {
            let each = k * WIDE + n;
            // There may be nothing at the end of the last.
            let (Some(&from), Some(&to), Some(&mm)) = (of.from.get(each), of.to.get(each), of.mm.get(each)) else {
                return;
            };
            let [from, to] = [(from, &batch.from), (to, &batch.to)]
                .map(|(position, ends)| self.find(position, self.bins.bin(ends.bin.0[k][n]).piece as usize));
            batch.seen[each] = self.segment(&from, &to, mm);
        }
    }
}
