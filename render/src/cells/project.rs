//! One cluster of cells, from points to segments of pixels.

use super::clusters::{Clusters, Scalars};
use super::fold::{Segment, add_up, integrate, length, merge, overlap, put_in_order, sort};
use super::in_view::InView;
use super::lens::Lens;
use super::lists::{of_pixel, put_by_pixel};
use super::runs::{MIXED, NONE, Open, Run, go_on};
use super::scan::{Found, PIXELS, Raw, Rect, Scanner, Shown};
use super::stats::Counts;
use super::table::{BATCH, Batch, Stretches, Table};
use crate::simd::{Eight, Four, PlainEight, PlainFour};
#[cfg(target_arch = "x86_64")]
use crate::simd::{WideEight, WideFour};

/// Pixels that a cluster is drawn in at once, across and down: what it makes there has to be remembered.
const TILE: i32 = 128;
const _: () = assert!(TILE as usize <= PIXELS, "a tile is scan-converted at once");
/// Cells after which it is asked which of the others can still be seen.
const PART: usize = 512;

/// What is drawn, for all workers.
#[derive(Debug)]
pub(super) struct Frame<'a> {
    pub(super) clusters: &'a Clusters,
    pub(super) scalars: &'a Scalars,
    pub(super) table: &'a Table,
    pub(super) lens: Lens,
    pub(super) size: [u32; 2],
    /// Whether what the transfer function makes clear is left out.
    pub(super) skip_clear: bool,
    pub(super) wide: bool,
}

impl Frame<'_> {
    pub(super) fn rect(&self) -> Rect {
        Rect { low: [0; 2], high: self.size.map(|n| i32::try_from(n).unwrap_or(i32::MAX)) }
    }

    /// The pixels that a cluster may show in, and its nearest depth.
    pub(super) fn reach(&self, cluster: usize) -> (Rect, f64) {
        let corners = self.clusters.corners(cluster).map(|p| self.lens.place(&p));
        let nearest = corners.iter().fold(f64::INFINITY, |near, c| near.min(c.z));
        let farthest = corners.iter().fold(f64::NEG_INFINITY, |far, c| far.max(c.z));
        // Rounding must not take the outermost pixels away.
        let mut rect = Rect::around(&corners, &self.rect());
        rect = Rect { low: rect.low.map(|v| v - 1), high: rect.high.map(|v| v.saturating_add(1)) }
            .meet(&self.rect());
        if farthest <= 0.0 {
            rect.high = rect.low;
        }
        (rect, nearest)
    }

    /// The same of a cluster that may show; all cells of another are counted.
    pub(super) fn shows(&self, cluster: usize, counts: &mut Counts) -> Option<(Rect, f64)> {
        let count = self.clusters.count(cluster) as u64;
        let (reach, nearest) = self.reach(cluster);
        if reach.is_empty() {
            counts.outside += count;
            return None;
        }
        if self.skip_clear && self.table.is_clear(self.scalars.range(cluster)) {
            counts.clear += count;
            return None;
        }
        Some((reach, nearest))
    }
}

/// What the rays of a rectangle have of a grid.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    /// Where each pixel's end, row by row.
    ends: Vec<u32>,
    raws: Vec<Raw>,
    /// What is seen of each.
    seen: Vec<[f32; 4]>,
}

impl Gathered {
    /// What the ray of a pixel has, nearest first, and what is seen of each.
    #[inline(always)]
    pub(super) fn pixel(&self, pixel: usize) -> (&[Raw], &[[f32; 4]]) {
        let range = of_pixel(&self.ends, pixel);
        (&self.raws[range.clone()], &self.seen[range])
    }

    /// Integrates all that the rays of `rect` have.
    #[inline(always)]
    fn integrate<E: Eight>(&mut self, frame: &Frame<'_>, rect: &Rect) {
        let mut batch = Batch::default();
        let (mut from, mut to, mut mm) = ([0.0; BATCH], [0.0; BATCH], [0.0; BATCH]);
        let [across, _] = rect.size();
        self.seen.clear();
        self.seen.reserve(self.raws.len());
        let stretch = |pixel: u32| {
            let [x, y] = [pixel as usize % across, pixel as usize / across];
            frame.lens.stretch([rect.low[0] + x as i32, rect.low[1] + y as i32])
        };
        let mut last = (0, stretch(0));
        for raws in self.raws.chunks(BATCH) {
            for (n, raw) in raws.iter().enumerate() {
                if raw.pixel != last.0 {
                    last = (raw.pixel, stretch(raw.pixel));
                }
                [from[n], to[n]] = raw.values;
                mm[n] = length(raw.back - raw.front, last.1);
            }
            let count = raws.len();
            let all = Stretches { from: &from[..count], to: &to[..count], mm: &mm[..count] };
            frame.table.segments::<E>(&mut batch, all);
            self.seen.extend(&batch.seen()[..count]);
        }
    }
}

/// Who is handed what a projector draws.
pub(super) trait Sink {
    /// Whether some of it may not be seen.
    fn is_early(&self) -> bool {
        false
    }

    /// Whether nothing of a rectangle that lies behind a depth can be seen; then it is left out.
    fn hides(&mut self, _: &Rect, _: f64) -> bool {
        false
    }

    /// Whether it is of use to know of runs before all of a cluster is there.
    fn renews(&self) -> bool {
        false
    }

    /// What there is so far of the pixels of a tile, the second, within the rectangle that is drawn, the first.
    fn renew(&mut self, _: [&Rect; 2], _: &[Run]) {}

    /// A segment of a pixel.
    fn done(&mut self, pixel: usize, run: Segment);
}

/// What is kept from cluster to cluster.
#[derive(Debug, Default)]
pub(super) struct Projector {
    shown: Vec<Shown>,
    part: Vec<Shown>,
    scanner: Box<Scanner>,
    batch: Box<Batch>,
    open: Open,
    raws: Vec<Raw>,
    counts: Vec<u32>,
    ordered: Vec<Raw>,
    spans: Vec<Segment>,
}

impl Projector {
    /// Draws what the rays of `rect` have of a cluster: hands on segments with the pixels of `rect` that they are of.
    pub(super) fn draw(
        &mut self,
        frame: &Frame<'_>,
        of: &InView,
        rect: &Rect,
        sink: &mut impl Sink,
        counts: &mut Counts,
    ) {
        if !frame.wide {
            self.draw_by::<PlainFour>(frame, of, rect, sink, counts);
            return;
        }
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
            fn wide(
                projector: &mut Projector,
                frame: &Frame<'_>,
                of: &InView,
                rect: &Rect,
                sink: &mut impl Sink,
                counts: &mut Counts,
            ) {
                projector.draw_by::<WideFour>(frame, of, rect, sink, counts);
            }
            #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
            // SAFETY: `wide` is set only where these instructions were detected.
            unsafe {
                wide(self, frame, of, rect, sink, counts);
            }
        }
    }

    #[inline(always)]
    fn draw_by<F: Four>(
        &mut self,
        frame: &Frame<'_>,
        of: &InView,
        rect: &Rect,
        sink: &mut impl Sink,
        counts: &mut Counts,
    ) {
        let cells = &of.cells;
        if let Some(&any) = cells.first() {
            self.shown.resize(cells.len(), any);
        }
        // Each is written, and kept if it is here after all: which are cannot be foreseen.
        let mut kept = 0;
        for shown in cells {
            let reach = shown.reach.meet(rect);
            self.shown[kept] = Shown { reach, ..*shown };
            kept += usize::from(!reach.is_empty());
        }
        self.shown.truncate(kept);
        if sink.is_early() && !sink.renews() {
            self.shown.retain(|shown| !sink.hides(&shown.reach, f64::from(shown.nearest)));
        }
        counts.hidden += (kept - self.shown.len()) as u64;
        counts.scanned += self.shown.len() as u64;
        let mut reach = Rect { low: rect.high, high: rect.low };
        for shown in &self.shown {
            reach = reach.join(&shown.reach);
        }
        for top in (reach.low[1]..reach.high[1]).step_by(TILE as usize) {
            for left in (reach.low[0]..reach.high[0]).step_by(TILE as usize) {
                let high = [left.saturating_add(TILE), top.saturating_add(TILE)];
                let tile = Rect { low: [left, top], high }.meet(&reach);
                self.convert::<F>(frame, of, [rect, &tile], sink, counts);
            }
        }
    }

    /// Finds what the rays of a rectangle have of clusters, nearest first for each.
    pub(super) fn gather<'a>(
        &mut self,
        frame: &Frame<'_>,
        rect: &Rect,
        clusters: impl Iterator<Item = &'a InView>,
        gathered: &mut Gathered,
        counts: &mut Counts,
    ) {
        self.counts.clear();
        self.counts.resize(rect.area(), 0);
        self.raws.clear();
        for of in clusters {
            self.shown.clear();
            let cells = of.cells.iter().filter(|shown| !shown.reach.meet(rect).is_empty());
            self.shown.extend(cells);
            counts.scanned += self.shown.len() as u64;
            if !frame.wide {
                self.collect::<PlainFour>(frame, of, rect, None);
                continue;
            }
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
                fn wide(projector: &mut Projector, frame: &Frame<'_>, of: &InView, rect: &Rect) {
                    projector.collect::<WideFour>(frame, of, rect, None);
                }
                #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
                // SAFETY: `wide` is set only where these instructions were detected.
                unsafe {
                    wide(self, frame, of, rect);
                }
            }
        }
        counts.segments += self.raws.len() as u64;
        self.order();
        let mut from = 0;
        for &to in &self.counts {
            sort(&mut self.ordered[from..to as usize]);
            from = to as usize;
        }
        std::mem::swap(&mut self.counts, &mut gathered.ends);
        std::mem::swap(&mut self.ordered, &mut gathered.raws);
        if !frame.wide {
            gathered.integrate::<PlainEight>(frame, rect);
            return;
        }
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
            fn wide(gathered: &mut Gathered, frame: &Frame<'_>, rect: &Rect) {
                gathered.integrate::<WideEight>(frame, rect);
            }
            #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
            // SAFETY: `wide` is set only where these instructions were detected.
            unsafe {
                wide(gathered, frame, rect);
            }
        }
    }

    /// Puts what was scan-converted together by pixel; `counts` become where each pixel's end.
    #[inline(always)]
    fn order(&mut self) {
        let raws = self.raws.iter().map(|raw| (raw.pixel, raw));
        put_by_pixel(&mut self.counts, raws, &mut self.ordered);
    }

    /// Scan-converts what is chosen, in one tile, and merges it.
    #[inline(always)]
    fn convert<F: Four>(
        &mut self,
        frame: &Frame<'_>,
        of: &InView,
        [rect, tile]: [&Rect; 2],
        sink: &mut impl Sink,
        counts: &mut Counts,
    ) {
        self.open.begin(&frame.lens, tile);
        let mut segments = 0;
        let part = if sink.renews() { PART } else { self.shown.len().max(1) };
        for (n, shown) in self.shown.chunks(part).enumerate() {
            let mut shown = shown;
            if sink.renews() {
                if n > 0 {
                    sink.renew([rect, tile], &self.open.runs);
                }
                self.part.clear();
                self.part.extend(shown.iter().filter(|one| !sink.hides(&one.reach, f64::from(one.nearest))));
                counts.hidden += (shown.len() - self.part.len()) as u64;
                counts.scanned -= (shown.len() - self.part.len()) as u64;
                shown = &self.part;
            }
            let mut go_on = |raws: Found<'_>| {
                segments += raws.len() as u64;
                go_on(frame, raws, &mut self.batch, &mut self.open);
            };
            self.scanner.scan::<F>(of.cells(shown), [tile, tile], frame.lens.perspective(), &mut go_on);
            go_on(self.scanner.rest());
        }
        counts.segments += segments;
        let [across, _] = tile.size();
        let mut mixed = false;
        let (open, area) = (&mut self.open, tile.area());
        let rows = open.runs[..area].chunks_exact_mut(across).zip(open.last[..area].chunks_exact_mut(across));
        for (y, (runs, lasts)) in (tile.low[1]..).zip(rows) {
            let first = rect.number([tile.low[0], y]);
            for (x, (run, last)) in runs.iter_mut().zip(lasts).enumerate() {
                if run.is_none() {
                    continue;
                }
                let run = std::mem::replace(run, Run::NONE).0;
                let mut done = |run: Segment| {
                    if run.rgba[3] > 0.0 {
                        counts.runs += 1;
                        sink.done(first + x, run);
                    }
                };
                if *last == NONE {
                    done(run);
                    continue;
                }
                self.spans.clear();
                self.spans.push(run);
                while let Some(&(run, before)) = open.aside.get(*last as usize) {
                    self.spans.push(run);
                    *last = before;
                }
                // What came last is first.
                self.spans.reverse();
                put_in_order(&mut self.spans);
                if overlap(&self.spans) {
                    (*last, mixed) = (MIXED, true);
                } else {
                    merge(&self.spans, done);
                }
            }
        }
        if mixed {
            let open = std::mem::take(&mut self.open);
            self.one_by_one::<F>(frame, of, [rect, tile], &open.last, sink, counts);
            self.open = open;
            self.open.last[..area].fill(NONE);
        }
    }

    /// Appends the stretches of what is chosen; of the mixed pixels of `only`, if given.
    #[inline(always)]
    fn collect<F: Four>(&mut self, frame: &Frame<'_>, of: &InView, rect: &Rect, only: Option<&[u32]>) {
        let (totals, raws) = (&mut self.counts, &mut self.raws);
        let mut keep = |found: Found<'_>| {
            for raw in (0..found.len()).map(|n| found.get(n)) {
                if only.is_none_or(|last| last[raw.pixel as usize] == MIXED) {
                    totals[raw.pixel as usize] += 1;
                    raws.push(raw);
                }
            }
        };
        let cells = of.cells(&self.shown);
        self.scanner.scan::<F>(cells, [rect, rect], frame.lens.perspective(), &mut keep);
        keep(self.scanner.rest());
    }

    /// The same for the mixed pixels, with all their stretches put in order before they are integrated.
    #[inline(never)]
    fn one_by_one<F: Four>(
        &mut self,
        frame: &Frame<'_>,
        of: &InView,
        [rect, tile]: [&Rect; 2],
        last: &[u32],
        sink: &mut impl Sink,
        counts: &mut Counts,
    ) {
        self.counts.clear();
        self.counts.resize(tile.area(), 0);
        self.raws.clear();
        self.collect::<F>(frame, of, tile, Some(last));
        if self.raws.is_empty() {
            return;
        }
        self.order();
        let [across, _] = tile.size();
        let mut from = 0;
        for (y, row) in (tile.low[1]..).zip(self.counts.chunks_exact(across)) {
            let first = rect.number([tile.low[0], y]);
            for (x, &to) in row.iter().enumerate() {
                let to = to as usize;
                if to == from {
                    continue;
                }
                let at = [tile.low[0] + x as i32, y];
                let raws = &mut self.ordered[from..to];
                from = to;
                sort(raws);
                self.spans.clear();
                integrate(raws, frame.table, frame.lens.stretch(at), &mut self.spans);
                if overlap(&self.spans) {
                    counts.overlaps += 1;
                    self.spans = add_up(&self.spans);
                }
                merge(&self.spans, |run| {
                    if run.rgba[3] > 0.0 {
                        counts.runs += 1;
                        sink.done(first + x, run);
                    }
                });
            }
        }
    }
}
