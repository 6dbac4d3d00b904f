//! Many segments at once, in steps that each go through all of them: what one step waits for is there by the next.

use super::bins::{Bins, MARKED};
use super::opacity::{behind, opacity};
use super::quad::Quad;
use super::{EVEN_COLOR, EVEN_DEPTH, Place, Table};

/// Numbers that go through arithmetic together.
const WIDE: usize = 8;
/// Segments that go at once.
pub(in super::super) const BATCH: usize = 64;
/// Bins apart from which on sums have kept their digits.
const APART: f32 = 1.0 / 32.0;

/// One of each of several segments, where no access of memory straddles two lines of a cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Each<T>([[T; WIDE]; BATCH / WIDE]);

impl<T: Copy> Each<T> {
    fn of(all: T) -> Self {
        Self([[all; WIDE]; BATCH / WIDE])
    }

    #[inline(always)]
    fn set(&mut self, n: usize, value: T) {
        self.0.as_flattened_mut()[n] = value;
    }
}

/// An end of each of several segments.
#[derive(Debug)]
struct Ends {
    position: Each<f32>,
    /// The bin that it lies in, and how many bins behind its begin.
    bin: Each<u32>,
    part: Each<f32>,
}

impl Ends {
    fn new() -> Self {
        Self { position: Each::of(0.0), bin: Each::of(0), part: Each::of(0.0) }
    }

    /// Looks positions up; where they are in bins.
    #[inline(always)]
    fn look_up(&mut self, bins: &Bins, k: usize) -> [f64; WIDE] {
        // Added and taken away again, it leaves the nearest whole number, which then is in its lowest digits.
        const WHOLE: f64 = 6_755_399_441_055_744.0;
        let [first, last] = bins.range;
        let (mut at, mut begin) = ([0.0; WIDE], [0.0; WIDE]);
        for n in 0..WIDE {
            let x = f64::from(self.position.0[k][n]) * bins.scale;
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
    mm: Each<f32>,
    /// What the difference of sums counts, and the sum of rates.
    apart: Each<f32>,
    near: Each<f32>,
    /// Opacity, and how much colour varies all along.
    opacity: Each<f32>,
    varies: Each<f32>,
    /// Differences of the ramps, and marks.
    ramps: Each<u32>,
    alone: Each<u32>,
    /// How much is seen for one of optical depth, and by how much the colour of the end falls behind.
    part: Each<f32>,
    lag: Each<f32>,
    /// Optical depth times colour, and optical depth; then what is seen.
    seen: Each<Quad>,
    /// The colour at the end less that at the begin.
    turn: Each<Quad>,
    /// How much more extinction there is at the end than at the begin.
    rise: Each<f32>,
}

impl Batch {
    /// With nothing in it.
    pub(in super::super) fn new() -> Self {
        Self {
            from: Ends::new(),
            to: Ends::new(),
            mm: Each::of(0.0),
            apart: Each::of(0.0),
            near: Each::of(0.0),
            opacity: Each::of(0.0),
            varies: Each::of(0.0),
            ramps: Each::of(0),
            alone: Each::of(0),
            part: Each::of(0.0),
            lag: Each::of(0.0),
            seen: Each::of(Quad::all(0.0)),
            turn: Each::of(Quad::all(0.0)),
            rise: Each::of(0.0),
        }
    }

    /// Puts a segment in: `mm` along which the scalar runs from one position to another.
    #[inline(always)]
    pub(in super::super) fn set(&mut self, n: usize, [from, to]: [f32; 2], mm: f32) {
        self.from.position.set(n, from);
        self.to.position.set(n, to);
        self.mm.set(n, mm);
    }

    /// Colour, premultiplied, and opacity.
    #[inline(always)]
    pub(in super::super) fn seen(&self, n: usize) -> [f32; 4] {
        let [r, g, b, _] = self.seen.0.as_flattened()[n].array();
        [r, g, b, self.opacity.0.as_flattened()[n]]
    }

    #[inline(always)]
    fn look_up(&mut self, bins: &Bins, k: usize) {
        let (a, b) = (self.from.look_up(bins, k), self.to.look_up(bins, k));
        for n in 0..WIDE {
            let rise = (b[n] - a[n]) as f32;
            let mm = self.mm.0[k][n];
            // Between places of one bin, or all but one, the mean is that of the rates at them.
            let is_near = (self.from.bin.0[k][n] == self.to.bin.0[k][n]) | (rise.abs() < APART);
            self.apart.0[k][n] = if is_near { 0.0 } else { mm / rise };
            self.near.0[k][n] = if is_near { 0.5 * mm } else { 0.0 };
        }
    }

    /// Optical depth times colour, and optical depth.
    #[inline(always)]
    fn add_up(&mut self, bins: &Bins, k: usize) {
        for n in 0..WIDE {
            let p = bins.pair(self.from.bin.0[k][n]);
            let q = bins.pair(self.to.bin.0[k][n]);
            let begin = p[0].within(&p[1], self.from.part.0[k][n]);
            let end = q[0].within(&q[1], self.to.part.0[k][n]);
            let [apart, near] = [self.apart.0[k][n], self.near.0[k][n]].map(Quad::all);
            self.seen.0[k][n] = end.since(&begin) * apart + (begin.rate + end.rate) * near;
            self.turn.0[k][n] = end.light - begin.light;
            self.rise.0[k][n] = (end.rate - begin.rate).array()[3];
            self.varies.0[k][n] = end.varied - begin.varied;
            self.ramps.0[k][n] = (p[0].ramp ^ q[0].ramp) | ((p[0].ramp | q[0].ramp) & MARKED);
        }
    }

    /// From optical depth to what is seen.
    #[inline(always)]
    fn shade(&mut self, k: usize) {
        let mut tau = [0.0; WIDE];
        for (n, tau) in tau.iter_mut().enumerate() {
            *tau = self.seen.0[k][n].array()[3];
        }
        for (n, t) in tau.into_iter().enumerate() {
            let opacity = opacity(t);
            let varies = self.varies.0[k][n].abs();
            let uneven = t * varies > EVEN_COLOR;
            let rough = self.rise.0[k][n].abs() * self.mm.0[k][n] * varies > EVEN_DEPTH;
            let ramps = self.ramps.0[k][n];
            // What is marked or no number, or changes too much, is seen to by itself.
            let much = if rough { 1 } else { ramps };
            let marked = if t.is_nan() { 1 } else { ramps & MARKED };
            self.alone.0[k][n] = if uneven { much } else { marked };
            let is_seen = t > 0.0;
            let (part, lag) = (opacity / t, behind(t, opacity));
            self.part.0[k][n] = if is_seen { part } else { 0.0 };
            self.lag.0[k][n] = if is_seen { lag } else { 0.0 };
            self.opacity.0[k][n] = if is_seen { opacity } else { 0.0 };
        }
        for n in 0..WIDE {
            let (part, lag) = (self.part.0[k][n], self.lag.0[k][n]);
            let (depth, turn) = (self.seen.0[k][n], self.turn.0[k][n]);
            self.seen.0[k][n] = depth * Quad::all(part) + turn * Quad::all(lag);
        }
    }
}

impl Table {
    /// As [`Self::segment`], of the first `count` of a batch.
    #[inline(always)]
    pub(in super::super) fn segments(&self, batch: &mut Batch, count: usize) {
        let wide = count.div_ceil(WIDE).min(BATCH / WIDE);
        for k in 0..wide {
            batch.look_up(&self.bins, k);
        }
        for k in 0..wide {
            batch.add_up(&self.bins, k);
        }
        for k in 0..wide {
            batch.shade(k);
        }
        for k in 0..wide {
            if batch.alone.0[k].iter().fold(0, |any, alone| any | alone) != 0 {
                self.alone(batch, k);
            }
        }
    }

    /// Looks a position up that need not be near another.
    fn search(&self, position: f32) -> Place {
        let after = self.pieces.partition_point(|piece| piece.from <= position);
        self.find(position, after.saturating_sub(1))
    }

    /// Sees to those by themselves that have to be.
    #[inline(never)]
    fn alone(&self, batch: &mut Batch, k: usize) {
        for n in 0..WIDE {
            if batch.alone.0[k][n] != 0 {
                let [from, to] = [&batch.from, &batch.to].map(|ends| self.search(ends.position.0[k][n]));
                let seen = self.segment(&from, &to, batch.mm.0[k][n]);
                batch.seen.0[k][n] = Quad::new(seen);
                batch.opacity.0[k][n] = seen[3];
            }
        }
    }
}
