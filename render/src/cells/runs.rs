//! What pixels have of a cluster while its cells are gone through: runs of stretches, integrated and merged as they come.

use super::fold::{Segment, length, under};
use super::lens::Lens;
use super::project::Frame;
use super::scan::{Found, Rect};
use super::table::{BATCH, Batch, Stretches};
#[cfg(target_arch = "x86_64")]
use crate::simd::WideEight;
use crate::simd::{Eight, PlainEight};

/// What pixels have of a cluster while its tetrahedra are gone through.
#[derive(Debug, Default)]
pub(super) struct Open {
    /// The run that was last gone on with.
    pub(super) runs: Vec<Run>,
    /// The last of those put aside, or [`NONE`], or [`MIXED`].
    pub(super) last: Vec<u32>,
    /// Runs put aside, each with the one before it.
    pub(super) aside: Vec<(Segment, u32)>,
    /// Millimetres for one of depth, where that is not one everywhere.
    stretches: Vec<f64>,
    /// Millimetres of what goes at once.
    mm: Vec<f32>,
}

/// A run of a pixel, within a line of a cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(super) struct Run(pub(super) Segment);

impl Run {
    /// Where there is none: nothing, that begins after all and ends at no depth.
    pub(super) const NONE: Self = Self(Segment { front: f64::INFINITY, back: f64::NAN, rgba: [0.0; 4] });

    /// Whether there is none.
    #[inline(always)]
    pub(super) fn is_none(&self) -> bool {
        self.0.back.is_nan()
    }
}

impl Open {
    /// For the pixels of a tile, with nothing in them.
    pub(super) fn begin(&mut self, lens: &Lens, tile: &Rect) {
        if self.runs.len() < tile.area() {
            self.runs.resize(tile.area(), Run::NONE);
            self.last.resize(tile.area(), NONE);
        }
        self.mm.resize(BATCH, 0.0);
        self.aside.clear();
        self.stretches.clear();
        if lens.perspective() {
            for y in tile.low[1]..tile.high[1] {
                self.stretches.extend((tile.low[0]..tile.high[0]).map(|x| lens.stretch([x, y])));
            }
        }
    }
}

pub(super) const NONE: u32 = u32::MAX;
/// Cells overlap here: their stretches are needed one by one.
pub(super) const MIXED: u32 = u32::MAX - 1;

/// Integrates stretches and goes on with the runs of their pixels.
pub(super) fn go_on(frame: &Frame<'_>, raws: Found<'_>, batch: &mut Batch, open: &mut Open) {
    if !frame.wide {
        go_on_by::<PlainEight>(frame, raws, batch, open);
        return;
    }
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        fn wide(frame: &Frame<'_>, raws: Found<'_>, batch: &mut Batch, open: &mut Open) {
            go_on_by::<WideEight>(frame, raws, batch, open);
        }
        #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
        // SAFETY: `wide` is set only where these instructions were detected.
        unsafe {
            wide(frame, raws, batch, open);
        }
    }
}

#[inline(always)]
fn go_on_by<E: Eight>(frame: &Frame<'_>, raws: Found<'_>, batch: &mut Batch, open: &mut Open) {
    for first in (0..raws.len()).step_by(BATCH) {
        let raws = raws.part(first, BATCH);
        let mm = &mut open.mm[..raws.len()];
        let spans = raws.fronts.iter().zip(raws.backs).map(|(front, back)| back - front);
        if frame.lens.perspective() {
            for ((mm, span), &pixel) in mm.iter_mut().zip(spans).zip(raws.pixels) {
                *mm = length(span, open.stretches[pixel as usize]);
            }
        } else {
            for (mm, span) in mm.iter_mut().zip(spans) {
                *mm = length(span, 1.0);
            }
        }
        frame.table.segments::<E>(batch, Stretches { from: raws.from, to: raws.to, mm });
        open.put(raws, batch.seen());
    }
}

impl Open {
    /// Goes on with the runs of pixels by stretches, of which `seen` is seen.
    #[inline(never)]
    #[expect(
        clippy::double_comparisons,
        reason = "a depth that is no number is neither less nor more, but not the same"
    )]
    fn put(&mut self, raws: Found<'_>, seen: &[[f32; 4]]) {
        let Self { runs, last, aside, .. } = self;
        let runs = &mut runs[..];
        let depths = raws.fronts.iter().zip(raws.backs);
        for ((&pixel, &rgba), (&front, &back)) in raws.pixels.iter().zip(seen).zip(depths) {
            let Run(run) = &mut runs[pixel as usize];
            // It ends where this begins, or there is none: one question, since which of the two cannot be foreseen.
            if !(front < run.back || front > run.back) {
                run.front = if front < run.front { front } else { run.front };
                run.back = back;
                under(&mut run.rgba, rgba);
                continue;
            }
            let mut new = Segment { front, back, rgba };
            if back == run.front {
                under(&mut new.rgba, run.rgba);
                new.back = run.back;
            } else {
                put_aside(*run, &mut last[pixel as usize], aside);
            }
            *run = new;
        }
    }
}

#[inline(never)]
fn put_aside(run: Segment, last: &mut u32, aside: &mut Vec<(Segment, u32)>) {
    aside.push((run, *last));
    *last = (aside.len() - 1) as u32;
}
