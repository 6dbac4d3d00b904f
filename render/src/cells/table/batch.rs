//! Many segments at once: those within one piece, and after that those that pass from one into another.

use super::lanes::{Many, Means, Source};
use super::opacity::{THIN, thick, thin};
use super::{EVEN_COLOR, EVEN_DEPTH, Place, Table};
use crate::simd::{Eight, put_from};

/// Numbers that go through arithmetic together.
const WIDE: usize = 8;
/// Segments that go at once.
pub(in super::super) const BATCH: usize = 640;

/// Several segments, and what is seen of them; no two of eight lie in two lines of a cache that could lie in one.
#[derive(Debug)]
#[repr(C, align(64))]
pub(in super::super) struct Batch {
    /// Colour, premultiplied, and opacity.
    seen: [[f32; 4]; BATCH],
    /// Those that pass from one piece into another.
    across: [u32; BATCH + WIDE],
    count: usize,
}

/// Segments to integrate, one of each in a list, [`BATCH`] at most: positions and millimetres from begin to end.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Stretches<'a> {
    pub(in super::super) from: &'a [f32],
    pub(in super::super) to: &'a [f32],
    pub(in super::super) mm: &'a [f32],
}

/// [`WIDE`] of a list, with nothing for what it lacks.
#[inline(always)]
fn eight<E: Eight>(of: &[f32], k: usize) -> E {
    let of = &of[k * WIDE..];
    if let Some(all) = of.first_chunk() {
        return E::from_array(*all);
    }
    let mut padded = [0.0; WIDE];
    pad(of, &mut padded);
    E::from_array(padded)
}

#[cold]
#[inline(never)]
fn pad(of: &[f32], padded: &mut [f32; WIDE]) {
    padded[..of.len()].copy_from_slice(of);
}

/// What is seen of stretches of even extinction, red, green, blue and opacity; and which have to be seen to by themselves.
#[inline(always)]
fn shade<E: Eight>(means: &Means<E>, mm: E) -> ([E; 4], u32) {
    let [r, g, b, rate] = means.rates;
    let none = E::all(0.0);
    let tau = rate * mm;
    // Rounding may leave less than nothing.
    let tau = tau.below(none, none, tau);
    let [mut part, mut lag, mut seen] = thin(tau, E::all);
    if tau.bits_below(E::all(THIN)) != 0xff {
        let taus = tau.to_array();
        let (mut parts, mut lags, mut opacities) = ([0.0; WIDE], [0.0; WIDE], [0.0; WIDE]);
        for n in 0..WIDE {
            [parts[n], lags[n], opacities[n]] = thick(taus[n]);
        }
        part = tau.below(E::all(THIN), part, E::from_array(parts));
        lag = tau.below(E::all(THIN), lag, E::from_array(lags));
        seen = tau.below(E::all(THIN), seen, E::from_array(opacities));
    }
    let part = none.below(tau, part * mm, none);
    let [x, y, z] = means.turn;
    let seen = [r * part + x * lag, g * part + y * lag, b * part + z * lag, seen];
    // What is no number is not smooth.
    let smooth = (means.rough * mm).bits_below(E::all(EVEN_DEPTH)) & tau.bits_below(E::all(f32::INFINITY));
    (seen, !smooth & 0xff)
}

/// Puts others under what is seen.
#[inline(always)]
fn under<E: Eight>(seen: &mut [E; 4], behind: [E; 4]) {
    let through = E::all(1.0) - seen[3];
    for (seen, behind) in seen.iter_mut().zip(behind) {
        *seen = *seen + through * behind;
    }
}

impl Default for Batch {
    /// With nothing in it.
    fn default() -> Self {
        Self { across: [0; BATCH + WIDE], count: 0, seen: [[0.0; 4]; BATCH] }
    }
}

impl Batch {
    /// Colour, premultiplied, and opacity of what was last integrated.
    #[inline(always)]
    pub(in super::super) fn seen(&self) -> &[[f32; 4]; BATCH] {
        &self.seen
    }

    /// Integrates as if each were within a piece, and notes which are not.
    #[inline(always)]
    fn within<E: Eight>(&mut self, source: &impl Source<E>, of: Stretches<'_>, k: usize) -> u32 {
        let (from, to) = (eight::<E>(of.from, k), eight::<E>(of.to, k));
        let numbers = source.numbers(from);
        let across = source.beyond(numbers, to);
        for half in 0..2 {
            let which = across >> (4 * half) & 15;
            if let Some(into) = self.across[self.count..].first_chunk_mut() {
                put_from((k * WIDE + 4 * half) as u32, which, into);
            }
            self.count += which.count_ones() as usize;
        }
        if across == 0xff {
            return 0;
        }
        let means = source.pieces(numbers).means(from, to);
        let (seen, alone) = shade(&means, eight(of.mm, k));
        if let Some(rows) = self.seen[k * WIDE..].first_chunk_mut() {
            E::put_rows(seen, rows);
        }
        alone & !across
    }

    /// Integrates eight of those that are not within a piece.
    #[inline(always)]
    fn across<E: Eight>(&mut self, source: &impl Source<E>, table: &Table, of: Stretches<'_>, k: usize) {
        let which: [u32; WIDE] = std::array::from_fn(|n| self.across[k * WIDE + n]);
        let pick = |of: &[f32]| E::from_array(which.map(|n| of.get(n as usize).copied().unwrap_or(0.0)));
        let (from, to, mm) = (pick(of.from), pick(of.to), pick(of.mm));
        let (first, last) = (source.numbers(from), source.numbers(to));
        let (begin, end) = (source.pieces(first), source.pieces(last));
        // Where they leave the one and enter the other.
        let out = from.below(to, begin.end, begin.begin);
        let into = from.below(to, end.begin, end.end);
        let by = mm.over(to - from);
        let (mut seen, mut alone) = shade(&begin.means(from, out), (out - from) * by);
        let apart = into - out;
        let none = E::all(0.0);
        let whole = none.bits_below(apart * by);
        if whole != 0 {
            let (between, rough) = between::<E>(table, whole, [first, last], apart * by);
            under(&mut seen, between);
            alone |= rough;
        }
        let (far, rough) = shade(&end.means(into, to), (to - into) * by);
        under(&mut seen, far);
        alone |= rough;
        let mut rows = [[0.0; 4]; WIDE];
        E::put_rows(seen, &mut rows);
        let count = (self.count - k * WIDE).min(WIDE);
        for (row, &which) in rows.iter().zip(&which[..count]) {
            self.seen[which as usize] = *row;
        }
        if alone != 0 {
            for n in (0..count).filter(|n| alone >> n & 1 == 1) {
                self.alone(table, of, which[n] as usize);
            }
        }
    }

    /// Sees to one by itself.
    #[cold]
    #[inline(never)]
    fn alone(&mut self, table: &Table, of: Stretches<'_>, n: usize) {
        let [from, to] = [of.from[n], of.to[n]].map(|position| table.at(position, &Place::NOWHERE));
        self.seen[n] = table.segment(&from, &to, of.mm[n]);
    }

    /// Integrates all, with pieces from a source.
    #[inline(always)]
    pub(super) fn all<E: Eight>(&mut self, source: &impl Source<E>, table: &Table, of: Stretches<'_>) {
        self.count = 0;
        let count = of.mm.len().min(BATCH);
        for k in 0..count.div_ceil(WIDE) {
            let alone = self.within::<E>(source, of, k);
            if alone != 0 {
                for n in (0..WIDE).filter(|n| alone >> n & 1 == 1) {
                    if k * WIDE + n < count {
                        self.alone(table, of, k * WIDE + n);
                    }
                }
            }
        }
        self.across[self.count..self.count + WIDE].fill(0);
        for k in 0..self.count.div_ceil(WIDE) {
            self.across::<E>(source, table, of, k);
        }
    }
}

/// What is seen of the whole pieces that some pass between others, and of which that does not say enough.
#[inline(always)]
fn between<E: Eight>(table: &Table, mut which: u32, ends: [E::Numbers; 2], mm: E) -> ([E; 4], u32) {
    let [first, last] = [E::numbers_to_array(ends[0]), E::numbers_to_array(ends[1])];
    let mut rates = [[0.0; WIDE]; 4];
    let mut varies = [0.0; WIDE];
    while which != 0 {
        let n = which.trailing_zeros() as usize & (WIDE - 1);
        which &= which - 1;
        let [low, high] = [first[n].min(last[n]), first[n].max(last[n])].map(|number| number as usize);
        // Where the scalar stays, nothing lies between whatever the numbers come to.
        if low + 1 >= high {
            continue;
        }
        let whole = table.whole(low + 1, high);
        for c in 0..4 {
            rates[c][n] = whole[c];
        }
        varies[n] = table.varies(low + 1, high);
    }
    let [r, g, b, tau] = rates.map(E::from_array);
    let none = E::all(0.0);
    let (seen, _) = shade(&Means { rates: [r, g, b, tau], turn: [none; 3], rough: none }, mm);
    let uneven = E::all(EVEN_COLOR).bits_below(tau * mm * E::from_array(varies));
    (seen, uneven)
}

impl Table {
    /// As [`Self::segment`], of several; what is seen of them is in the batch then.
    #[inline(always)]
    pub(in super::super) fn segments<E: Eight>(&self, batch: &mut Batch, of: Stretches<'_>) {
        if let Some(few) = self.lanes.few::<1>() {
            batch.all::<E>(&few, self, of);
        } else if let Some(few) = self.lanes.few::<2>() {
            batch.all::<E>(&few, self, of);
        } else {
            batch.all::<E>(&Many::new(self), self, of);
        }
    }
}
