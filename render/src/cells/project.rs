//! One cluster of cells, from points to segments of pixels.

use super::clusters::{Clusters, Scalars};
use super::early;
use super::fold::{Segment, add_up, integrate, length, merge, overlap, sort, under};
use super::lens::Lens;
use super::scan::{Corner, Raw, Raws, Rect, scan};
use super::stats::Counts;
use super::table::{BATCH, Batch, Table};
use crate::volume::cells::Place;

/// Pixels that a cluster is drawn in at once, across and down: what it makes there has to be remembered.
const TILE: i32 = 128;

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
}

/// A tetrahedron in a tile.
#[derive(Debug, Clone, Copy)]
struct Shown {
    tetrahedron: u32,
    reach: Rect,
    /// Nearest and farthest depth, added.
    depth: f64,
}

/// What a pixel has of a cluster while its tetrahedra are gone through.
#[derive(Debug, Clone, Copy)]
struct Open {
    /// The run that was last gone on with; its back is less than nothing where there is none.
    run: Segment,
    /// Millimetres for one of depth.
    stretch: f64,
    /// The last of those put aside, or [`NONE`], or [`MIXED`].
    aside: u32,
}

const NONE: u32 = u32::MAX;
/// Cells overlap here: their stretches are needed one by one.
const MIXED: u32 = u32::MAX - 1;

/// Steps of depth in which tetrahedra are told apart for going through them from front to back.
const STEPS: usize = 256;

/// What the rays of a rectangle have of a grid.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    /// Where each pixel's end, row by row.
    ends: Vec<u32>,
    raws: Vec<Raw>,
}

impl Gathered {
    /// What the ray of a pixel has, nearest first.
    #[inline(always)]
    pub(super) fn pixel(&self, pixel: usize) -> &[Raw] {
        let from = if pixel == 0 { 0 } else { self.ends[pixel - 1] };
        &self.raws[from as usize..self.ends[pixel] as usize]
    }
}

/// What is kept from cluster to cluster.
#[derive(Debug, Default)]
pub(super) struct Projector {
    values: Vec<f64>,
    corners: Vec<Corner>,
    shown: Vec<Shown>,
    gathered: Box<Raws>,
    nearest_first: Vec<Shown>,
    open: Vec<Open>,
    /// Runs put aside, each with the one before it.
    aside: Vec<(Segment, u32)>,
    raws: Vec<Raw>,
    counts: Vec<u32>,
    ordered: Vec<Raw>,
    spans: Vec<Segment>,
    /// Runs of a cluster, for a worker that cannot take them while it is drawn.
    pub(super) runs: Vec<(usize, Segment)>,
}

impl Projector {
    /// Draws a cluster: hands on segments with the pixels they are of.
    pub(super) fn draw(
        &mut self,
        frame: &Frame<'_>,
        cluster: usize,
        early: Option<&early::Table>,
        counts: &mut Counts,
        mut done: impl FnMut(usize, Segment),
    ) {
        if !frame.wide {
            self.project(frame, cluster, early, counts, &mut done);
            return;
        }
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
            fn wide(
                projector: &mut Projector,
                frame: &Frame<'_>,
                cluster: usize,
                early: Option<&early::Table>,
                counts: &mut Counts,
                done: &mut impl FnMut(usize, Segment),
            ) {
                projector.project(frame, cluster, early, counts, done);
            }
            #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
            // SAFETY: `wide` is set only where these instructions were detected.
            unsafe {
                wide(self, frame, cluster, early, counts, &mut done);
            }
        }
    }

    /// Finds what the rays of a rectangle have of clusters, nearest first for each.
    pub(super) fn gather(
        &mut self,
        frame: &Frame<'_>,
        rect: &Rect,
        clusters: impl Iterator<Item = usize>,
        gathered: &mut Gathered,
        counts: &mut Counts,
    ) {
        self.counts.clear();
        self.counts.resize(rect.area(), 0);
        self.raws.clear();
        for cluster in clusters {
            if !frame.wide {
                self.gather_cluster(frame, rect, cluster, counts);
                continue;
            }
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
                fn wide(
                    projector: &mut Projector,
                    frame: &Frame<'_>,
                    rect: &Rect,
                    cluster: usize,
                    counts: &mut Counts,
                ) {
                    projector.gather_cluster(frame, rect, cluster, counts);
                }
                #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
                // SAFETY: `wide` is set only where these instructions were detected.
                unsafe {
                    wide(self, frame, rect, cluster, counts);
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
    }

    #[inline(always)]
    fn gather_cluster(&mut self, frame: &Frame<'_>, rect: &Rect, cluster: usize, counts: &mut Counts) {
        if frame.skip_clear && frame.table.is_clear(frame.scalars.range(cluster)) {
            counts.clear += frame.clusters.count(cluster) as u64;
            return;
        }
        self.place(frame, cluster);
        self.choose(frame, cluster, rect, None, counts);
        self.collect(frame, cluster, rect, None);
    }

    /// Brings corners and values of a cluster before the camera.
    #[inline(always)]
    fn place(&mut self, frame: &Frame<'_>, cluster: usize) {
        let of_points = frame.scalars.place() == Place::Points;
        let raw = frame.scalars.of(cluster);
        self.values.clear();
        self.values.extend(raw.iter().map(|&v| frame.table.position(v)));
        self.corners.clear();
        let points = frame.clusters.points(cluster).iter().enumerate();
        let values = &self.values;
        self.corners
            .extend(points.map(|(i, p)| frame.lens.corner(p, if of_points { values[i] } else { 0.0 })));
    }

    /// Puts what was scan-converted together by pixel; `counts` become where each pixel's end.
    #[inline(always)]
    fn order(&mut self) {
        let mut begin = 0;
        for count in &mut self.counts {
            (*count, begin) = (begin, begin + *count);
        }
        self.ordered.clear();
        let Some(&any) = self.raws.first() else { return };
        self.ordered.resize(self.raws.len(), any);
        for raw in &self.raws {
            let place = &mut self.counts[raw.pixel as usize];
            self.ordered[*place as usize] = *raw;
            *place += 1;
        }
    }

    #[inline(always)]
    fn project(
        &mut self,
        frame: &Frame<'_>,
        cluster: usize,
        early: Option<&early::Table>,
        counts: &mut Counts,
        done: &mut impl FnMut(usize, Segment),
    ) {
        let count = frame.clusters.count(cluster) as u64;
        let (reach, nearest) = frame.reach(cluster);
        if reach.is_empty() {
            counts.outside += count;
            return;
        }
        if frame.skip_clear && frame.table.is_clear(frame.scalars.range(cluster)) {
            counts.clear += count;
            return;
        }
        if early.is_some_and(|table| table.hides(&reach, nearest)) {
            counts.hidden += count;
            return;
        }
        self.place(frame, cluster);
        self.choose(frame, cluster, &reach, early, counts);
        let mut top = reach.low[1];
        while top < reach.high[1] {
            let mut left = reach.low[0];
            while left < reach.high[0] {
                let tile = Rect { low: [left, top], high: [left + TILE, top + TILE] }.meet(&reach);
                self.convert(frame, cluster, &tile, counts, done);
                left += TILE;
            }
            top += TILE;
        }
    }

    /// Decides which tetrahedra of a cluster are scan-converted.
    #[inline(always)]
    fn choose(
        &mut self,
        frame: &Frame<'_>,
        cluster: usize,
        reach: &Rect,
        early: Option<&early::Table>,
        counts: &mut Counts,
    ) {
        self.shown.clear();
        let of_points = frame.scalars.place() == Place::Points;
        let raw = frame.scalars.of(cluster);
        for (index, tetrahedron) in frame.clusters.tetrahedra(cluster).iter().enumerate() {
            let corners = tetrahedron.map(|v| &self.corners[v as usize]);
            let values = if of_points { tetrahedron.map(|v| raw[v as usize]) } else { [raw[index]; 4] };
            let sum: f64 = corners.iter().map(|c| c.x + c.y + c.z).sum::<f64>() + values.iter().sum::<f64>();
            if !sum.is_finite() {
                counts.not_finite += 1;
                continue;
            }
            let [mut low, mut high, mut nearest, mut farthest] =
                [values[0], values[0], corners[0].z, corners[0].z];
            for i in 1..4 {
                (low, high) = (low.min(values[i]), high.max(values[i]));
                (nearest, farthest) = (nearest.min(corners[i].z), farthest.max(corners[i].z));
            }
            if frame.skip_clear && frame.table.is_clear([low, high]) {
                counts.clear += 1;
                continue;
            }
            let mine = Rect::around(corners, reach);
            if mine.is_empty() || farthest <= 0.0 {
                counts.outside += 1;
                continue;
            }
            if early.is_some_and(|table| table.hides(&mine, nearest)) {
                counts.hidden += 1;
                continue;
            }
            counts.scanned += 1;
            self.shown.push(Shown { tetrahedron: index as u32, reach: mine, depth: nearest + farthest });
        }
        self.put_in_order();
    }

    /// Puts what is chosen roughly in order of depth: most stretches then go on where the one before ended.
    #[inline(always)]
    fn put_in_order(&mut self) {
        let Some(&any) = self.shown.first() else { return };
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for shown in &self.shown {
            (low, high) = (low.min(shown.depth), high.max(shown.depth));
        }
        let scale = if high > low { STEPS as f64 / (high - low) } else { 0.0 };
        let step = |shown: &Shown| (((shown.depth - low) * scale) as usize).min(STEPS - 1);
        let mut begins = [0_u32; STEPS];
        for shown in &self.shown {
            begins[step(shown)] += 1;
        }
        let mut begin = 0;
        for count in &mut begins {
            (*count, begin) = (begin, begin + *count);
        }
        self.nearest_first.clear();
        self.nearest_first.resize(self.shown.len(), any);
        for shown in &self.shown {
            let place = &mut begins[step(shown)];
            self.nearest_first[*place as usize] = *shown;
            *place += 1;
        }
        std::mem::swap(&mut self.shown, &mut self.nearest_first);
    }

    /// Scan-converts what is chosen, in one tile, and merges it.
    #[inline(always)]
    fn convert(
        &mut self,
        frame: &Frame<'_>,
        cluster: usize,
        tile: &Rect,
        counts: &mut Counts,
        done: &mut impl FnMut(usize, Segment),
    ) {
        let none = Segment { front: -1.0, back: -1.0, rgba: [0.0; 4] };
        self.open.clear();
        for y in tile.low[1]..tile.high[1] {
            let columns = tile.low[0]..tile.high[0];
            let stretch = |x| frame.lens.stretch([x, y]);
            self.open.extend(columns.map(|x| Open { run: none, stretch: stretch(x), aside: NONE }));
        }
        self.aside.clear();
        let (open, aside) = (&mut self.open, &mut self.aside);
        let mut batch = Batch::new();
        let constants = (frame.scalars.place() == Place::Cells).then_some(&self.values[..]);
        let tetrahedra = frame.clusters.tetrahedra(cluster);
        let mut go_on = |raws: &[Raw], constant: Option<f32>| {
            counts.segments += raws.len() as u64;
            go_on(frame, raws, constant, &mut batch, open, aside);
        };
        for shown in &self.shown {
            let reach = shown.reach.meet(tile);
            let index = shown.tetrahedron as usize;
            let corners = tetrahedra[index].map(|v| &self.corners[v as usize]);
            let constant = constants.map(|values| values[index] as f32);
            scan(corners, [tile, &reach], &mut self.gathered, &mut |raws| go_on(raws, constant));
            if constant.is_some() {
                go_on(self.gathered.take(), constant);
            }
        }
        go_on(self.gathered.take(), None);
        let [across, _] = tile.size();
        let mut mixed = false;
        for (y, row) in (tile.low[1]..).zip(self.open.chunks_exact_mut(across)) {
            let first = y as usize * frame.size[0] as usize;
            for (x, open) in (tile.low[0]..).zip(row) {
                if open.run.back < 0.0 {
                    continue;
                }
                let mut done = |run: Segment| {
                    if run.rgba[3] > 0.0 {
                        counts.runs += 1;
                        done(first + x as usize, run);
                    }
                };
                if open.aside == NONE {
                    done(open.run);
                    continue;
                }
                self.spans.clear();
                self.spans.push(open.run);
                while let Some(&(run, before)) = self.aside.get(open.aside as usize) {
                    self.spans.push(run);
                    open.aside = before;
                }
                self.spans.sort_unstable_by(Segment::order);
                if overlap(&self.spans) {
                    (open.aside, mixed) = (MIXED, true);
                } else {
                    merge(&self.spans, done);
                }
            }
        }
        if mixed {
            let open = std::mem::take(&mut self.open);
            self.one_by_one(frame, cluster, tile, &open, counts, done);
            self.open = open;
        }
    }

    /// Appends the stretches of what is chosen; of the mixed pixels of `only`, if given.
    #[inline(always)]
    fn collect(&mut self, frame: &Frame<'_>, cluster: usize, tile: &Rect, only: Option<&[Open]>) {
        let tetrahedra = frame.clusters.tetrahedra(cluster);
        let constant = frame.scalars.place() == Place::Cells;
        for shown in &self.shown {
            let reach = shown.reach.meet(tile);
            let index = shown.tetrahedron as usize;
            let corners = tetrahedra[index].map(|v| &self.corners[v as usize]);
            let (totals, raws) = (&mut self.counts, &mut self.raws);
            let mut keep = |found: &[Raw]| {
                for &(mut raw) in found {
                    if only.is_none_or(|open| open[raw.pixel as usize].aside == MIXED) {
                        totals[raw.pixel as usize] += 1;
                        if constant {
                            raw.values = [self.values[index] as f32; 2];
                        }
                        raws.push(raw);
                    }
                }
            };
            scan(corners, [tile, &reach], &mut self.gathered, &mut keep);
            keep(self.gathered.take());
        }
    }

    /// The same for the mixed pixels, with all their stretches put in order before they are integrated.
    #[inline(never)]
    fn one_by_one(
        &mut self,
        frame: &Frame<'_>,
        cluster: usize,
        tile: &Rect,
        open: &[Open],
        counts: &mut Counts,
        done: &mut impl FnMut(usize, Segment),
    ) {
        self.counts.clear();
        self.counts.resize(tile.area(), 0);
        self.raws.clear();
        self.collect(frame, cluster, tile, Some(open));
        if self.raws.is_empty() {
            return;
        }
        self.order();
        let [across, _] = tile.size();
        let mut from = 0;
        for (y, row) in (tile.low[1]..).zip(self.counts.chunks_exact(across)) {
            let first = y as usize * frame.size[0] as usize;
            for (x, &to) in (tile.low[0]..).zip(row) {
                let to = to as usize;
                if to == from {
                    continue;
                }
                let pixel = first + x as usize;
                let raws = &mut self.ordered[from..to];
                from = to;
                sort(raws);
                self.spans.clear();
                integrate(raws, frame.table, frame.lens.stretch([x, y]), &mut self.spans);
                if overlap(&self.spans) {
                    counts.overlaps += 1;
                    add_up(&mut self.spans);
                }
                merge(&self.spans, |run| {
                    if run.rgba[3] > 0.0 {
                        counts.runs += 1;
                        done(pixel, run);
                    }
                });
            }
        }
    }
}

/// Integrates stretches and goes on with the runs of their pixels.
fn go_on(
    frame: &Frame<'_>,
    raws: &[Raw],
    constant: Option<f32>,
    batch: &mut Batch,
    open: &mut [Open],
    aside: &mut Vec<(Segment, u32)>,
) {
    if !frame.wide {
        go_on_by(frame.table, raws, constant, batch, open, aside);
        return;
    }
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
        fn wide(
            table: &Table,
            raws: &[Raw],
            constant: Option<f32>,
            batch: &mut Batch,
            open: &mut [Open],
            aside: &mut Vec<(Segment, u32)>,
        ) {
            go_on_by(table, raws, constant, batch, open, aside);
        }
        #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
        // SAFETY: `wide` is set only where these instructions were detected.
        unsafe {
            wide(frame.table, raws, constant, batch, open, aside);
        }
    }
}

#[inline(always)]
fn go_on_by(
    table: &Table,
    raws: &[Raw],
    constant: Option<f32>,
    batch: &mut Batch,
    open: &mut [Open],
    aside: &mut Vec<(Segment, u32)>,
) {
    for raws in raws.chunks(BATCH) {
        for (n, raw) in raws.iter().enumerate() {
            let values = constant.map_or(raw.values, |value| [value; 2]);
            batch.set(n, values, length(raw.back - raw.front, open[raw.pixel as usize].stretch));
        }
        table.segments(batch, raws.len());
        for (n, raw) in raws.iter().enumerate() {
            let rgba = batch.seen(n);
            let Open { run, aside: last, .. } = &mut open[raw.pixel as usize];
            if raw.front == run.back {
                under(&mut run.rgba, rgba);
                run.back = raw.back;
                continue;
            }
            let mut new = Segment { front: raw.front, back: raw.back, rgba };
            if raw.back == run.front {
                under(&mut new.rgba, run.rgba);
                new.back = run.back;
            } else if run.back >= 0.0 {
                aside.push((*run, *last));
                *last = (aside.len() - 1) as u32;
            }
            *run = new;
        }
    }
}
