//! Many segments at once, in steps that each go through all of them: what one step waits for is there by the next.

use super::bins::{Bin, Bins, MARKED};
use super::opacity::{behind, opacity};
use super::{EVEN_COLOR, EVEN_DEPTH, Table};
use crate::simd::Eight;

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

    /// Looks positions up; where they are in bins, and the numbers of the bins.
    #[inline(always)]
    fn look_up(&mut self, bins: &Bins, positions: &[f32; WIDE], k: usize) -> ([f64; WIDE], [f32; WIDE]) {
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
        let mut number = [0.0; WIDE];
        for n in 0..WIDE {
            self.part.0[k][n] = (at[n] - begin[n]) as f32;
            number[n] = (begin[n] - first) as f32;
            self.bin.0[k][n] = ((begin[n] - first) + WHOLE).to_bits() as u32;
        }
        (at, number)
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
    sums: [Sums; BATCH / WIDE],
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

/// What [`WIDE`] segments have.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Sums {
    /// Optical depth times colour, and optical depth; those of the nth segment with those of the fourth after it.
    depth: [[f32; WIDE]; 4],
    /// The colour at the end less that at the begin, and how much it varies all along.
    turn: [[f32; WIDE]; 4],
    /// How much more extinction there is at the end than at the begin.
    rise: [f32; WIDE],
    /// Differences of the ramps, and marks.
    ramps: [u32; WIDE],
}

/// What two segments have.
struct Two<E> {
    depth: E,
    turn: E,
    rise: E,
}

impl<E: Eight> Two<E> {
    /// From the bins of their begins and of their ends, how far behind these they are, and what differences of sums and the
    /// sums of rates count.
    #[inline(always)]
    fn new([p, q]: [[&Bin; 2]; 2], parts: [E; 2], [apart, near]: [E; 2]) -> Self {
        let begin = p[0].within(p[1], parts[0]);
        let end = q[0].within(q[1], parts[1]);
        Self {
            depth: end.since(&begin) * apart + (begin.rate + end.rate) * near,
            turn: end.light - begin.light,
            rise: end.rate - begin.rate,
        }
    }
}

/// [`WIDE`] of a list, with nothing for what it lacks.
#[inline(always)]
fn eight<'a>(of: &'a [f32], k: usize, padded: &'a mut [f32; WIDE]) -> &'a [f32; WIDE] {
    let of = &of[k * WIDE..];
    if let Some(all) = of.first_chunk() {
        return all;
    }
    pad(of, padded);
    padded
}

#[cold]
#[inline(never)]
fn pad(of: &[f32], padded: &mut [f32; WIDE]) {
    padded[..of.len()].copy_from_slice(of);
}

impl Batch {
    /// With nothing in it.
    pub(in super::super) fn new() -> Self {
        let each = Each([[0.0; WIDE]; BATCH / WIDE]);
        let eights = [[0.0; WIDE]; 4];
        let sums = Sums { depth: eights, turn: eights, rise: [0.0; WIDE], ramps: [0; WIDE] };
        Self {
            from: Ends::new(),
            to: Ends::new(),
            apart: each,
            near: each,
            sums: [sums; BATCH / WIDE],
            seen: [[0.0; 4]; BATCH],
        }
    }

    /// Colour, premultiplied, and opacity of what was last integrated.
    #[inline(always)]
    pub(in super::super) fn seen(&self) -> &[[f32; 4]; BATCH] {
        &self.seen
    }

    #[inline(always)]
    fn look_up<E: Eight>(&mut self, bins: &Bins, of: Stretches<'_>, k: usize) {
        let mut padded = [[0.0; WIDE]; 3];
        let [pad_from, pad_to, pad_mm] = &mut padded;
        let (a, first) = self.from.look_up(bins, eight(of.from, k, pad_from), k);
        let (b, last) = self.to.look_up(bins, eight(of.to, k, pad_to), k);
        let mut rise = [0.0; WIDE];
        for n in 0..WIDE {
            rise[n] = (b[n] - a[n]) as f32;
        }
        let [none, half] = [E::from_array([0.0; WIDE]), E::from_array([0.5; WIDE])];
        let mm = E::from_array(*eight(of.mm, k, pad_mm));
        let rise = E::from_array(rise);
        // Between places of one bin, or all but one, the mean is that of the rates at them.
        let bins = (E::from_array(last) - E::from_array(first)).abs();
        let apart =
            rise.abs().below(E::from_array([APART; WIDE]), none, bins.below(half, none, mm.over(rise)));
        let near =
            rise.abs().below(E::from_array([APART; WIDE]), mm * half, bins.below(half, mm * half, none));
        self.apart.0[k] = apart.to_array();
        self.near.0[k] = near.to_array();
    }

    #[inline(always)]
    fn add_up<E: Eight>(&mut self, bins: &Bins, k: usize) {
        let [from, to] = [&self.from, &self.to];
        let begin_parts = E::from_array(from.part.0[k]).spread();
        let end_parts = E::from_array(to.part.0[k]).spread();
        let apart = E::from_array(self.apart.0[k]).spread();
        let near = E::from_array(self.near.0[k]).spread();
        let of = |n: usize| {
            [[n, n + 4].map(|n| bins.bin(from.bin.0[k][n])), [n, n + 4].map(|n| bins.bin(to.bin.0[k][n]))]
        };
        let two = [of(0), of(1), of(2), of(3)];
        let a = Two::new(two[0], [begin_parts[0], end_parts[0]], [apart[0], near[0]]);
        let b = Two::new(two[1], [begin_parts[1], end_parts[1]], [apart[1], near[1]]);
        let c = Two::new(two[2], [begin_parts[2], end_parts[2]], [apart[2], near[2]]);
        let d = Two::new(two[3], [begin_parts[3], end_parts[3]], [apart[3], near[3]]);
        let mut ramps = [0; WIDE];
        for n in 0..4 {
            let [p, q] = two[n];
            for half in 0..2 {
                let [p, q] = [p[half].ramp, q[half].ramp];
                ramps[n + 4 * half] = (p ^ q) | ((p | q) & MARKED);
            }
        }
        self.sums[k] = Sums {
            depth: [a.depth.to_array(), b.depth.to_array(), c.depth.to_array(), d.depth.to_array()],
            turn: [a.turn.to_array(), b.turn.to_array(), c.turn.to_array(), d.turn.to_array()],
            rise: E::lasts([a.rise, b.rise, c.rise, d.rise]).to_array(),
            ramps,
        };
    }

    /// From optical depth to what is seen; tells which have to be seen to by themselves.
    #[inline(always)]
    fn shade<E: Eight>(&mut self, mm: &[f32; WIDE], k: usize) -> [u32; WIDE] {
        let sums = &self.sums[k];
        let [a, b, c, d] = sums.depth;
        let depth = [E::from_array(a), E::from_array(b), E::from_array(c), E::from_array(d)];
        let [a, b, c, d] = sums.turn;
        let turn = [E::from_array(a), E::from_array(b), E::from_array(c), E::from_array(d)];
        let tau = E::lasts(depth).to_array();
        let varies = E::lasts(turn).to_array();
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
            let seen = depth[n] * parts[n] + turn[n].without_lasts() * lags[n];
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
            batch.look_up::<E>(&self.bins, of, k);
        }
        for k in 0..wide {
            batch.add_up::<E>(&self.bins, k);
        }
        for k in 0..wide {
            let alone = batch.shade::<E>(eight(of.mm, k, &mut [0.0; WIDE]), k);
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
            let (Some(&from), Some(&to), Some(&mm)) = (of.from.get(each), of.to.get(each), of.mm.get(each))
            else {
                return;
            };
            let from = self.find(from, self.bins.bin(batch.from.bin.0[k][n]).piece as usize);
            let to = self.find(to, self.bins.bin(batch.to.bin.0[k][n]).piece as usize);
            batch.seen[each] = self.segment(&from, &to, mm);
        }
    }
}
