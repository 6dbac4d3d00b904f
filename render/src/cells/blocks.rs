//! The picture shared out among threads that have the whole grid at hand: each draws one block of pixels after another, with
//! all cells before it. Nothing is exchanged, and what a block's rays have of the grid stays near the core. Cells that reach
//! into several blocks are set up in each of them.
//!
//! Clusters are gone through, and runs of theirs composited, as workers do that share out the grid: the bytes are the same.
//! Early termination is kept by each block for itself, with subscreens of its own.

use std::cmp::Reverse;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use rayon::prelude::*;

use super::CellsError;
use super::early::{Early, Ending};
use super::fold::{Segment, composite};
use super::in_view::{Chosen, InView};
use super::lists::Log;
use super::project::{Frame, Projector, Sink};
use super::runs::Run;
use super::scan::Rect;
use super::stats::Counts;
use super::worker::{Gathered, Manner, RowSegments};

/// Pixels that a block is wide and high: at most, and where the picture is too small for [`EACH`] at least.
const BLOCK: [usize; 2] = [64, 8];
/// Blocks for each thread, so that all are done at about the same time.
const EACH: usize = 8;

/// A cluster that may show.
#[derive(Debug)]
pub(super) struct Near {
    cluster: usize,
    /// Pixels that it may show in.
    pub(super) reach: Rect,
    nearest: f64,
    view: OnceLock<InView>,
}

impl Near {
    /// What of it is before the camera, if that was found.
    pub(super) fn known(&self) -> Option<&InView> {
        self.view.get()
    }

    /// What of it is before the camera, found now if it was not; cells that cannot show are counted then.
    fn view(&self, frame: &Frame<'_>, scratch: &mut Chosen, counts: &mut Counts) -> &InView {
        self.view.get_or_init(|| {
            let mut view = InView::default();
            view.fill(frame, self.cluster, scratch, counts);
            view
        })
    }
}

/// All clusters that may show, nearest first, and how many cells of the others cannot.
pub(super) fn in_view(frame: &Frame<'_>) -> (Vec<Near>, Counts) {
    let mut counts = Counts::default();
    let mut shown = Vec::new();
    for cluster in 0..frame.clusters.len() {
        if let Some((reach, nearest)) = frame.shows(cluster, &mut counts) {
            shown.push(Near { cluster, reach, nearest: nearest.max(0.0), view: OnceLock::new() });
        }
    }
    shown.sort_unstable_by(|a, b| a.nearest.total_cmp(&b.nearest).then(a.cluster.cmp(&b.cluster)));
    (shown, counts)
}

/// Brings all clusters before the camera, where all are needed; cells that cannot show are counted.
pub(super) fn fill(frame: &Frame<'_>, near: &[Near], counts: &mut Counts) {
    let fill = |scratch: &mut Chosen, near: &Near| {
        let mut counts = Counts::default();
        near.view(frame, scratch, &mut counts);
        counts
    };
    let each: Vec<Counts> = near.par_iter().with_min_len(8).map_init(Chosen::default, fill).collect();
    for more in each {
        counts.add(more);
    }
}

/// What a thread keeps from block to block.
struct Desk<'a> {
    frame: &'a Frame<'a>,
    manner: Manner,
    near: &'a [Near],
    projector: Projector,
    scratch: Chosen,
    log: Log,
    /// The most that colours have.
    most: [f32; 3],
    counts: Counts,
}

impl<'a> Desk<'a> {
    fn new(frame: &'a Frame<'a>, manner: Manner, near: &'a [Near]) -> Self {
        Self {
            frame,
            manner,
            near,
            projector: Projector::default(),
            scratch: Chosen::default(),
            log: Log::default(),
            most: frame.table.most(),
            counts: Counts { held: frame.clusters.held(), ..Counts::default() },
        }
    }

    /// Draws a block into its rows of the picture, as long as `goes_on`, which is asked for each cluster. What is kept of
    /// each row.
    fn draw(
        &mut self,
        Block { rect, near }: &Block,
        rows: &mut [&mut [[f32; 4]]],
        goes_on: impl Fn() -> bool,
    ) -> Option<Vec<RowSegments>> {
        let Self { frame, manner, projector, scratch, log, counts, .. } = self;
        log.reset(rect.area());
        let [width, _] = rect.size();
        let ending = manner.early.map(|early| Ending::new(rect, manner.side, early.threshold));
        let mut sink = Drawing { log, ending };
        for &place in near {
            let of = &self.near[place as usize];
            counts.clusters += 1;
            if sink.hides(&of.reach.meet(rect), of.nearest) {
                counts.hidden += frame.clusters.count(of.cluster) as u64;
            } else {
                projector.draw(frame, of.view(frame, scratch, counts), rect, &mut sink, counts);
                if let Some(ending) = &mut sink.ending {
                    ending.refresh();
                }
            }
            if !goes_on() {
                return None;
            }
        }
        let Drawing { log, ending } = sink;
        log.close();
        let lacking = manner.early.filter(|_| ending.is_some_and(|ending| ending.lacks()));
        Some(rows.iter_mut().enumerate().map(|(y, row)| self.composite(y * width, row, lacking)).collect())
    }

    /// Composites the pixels of a row of a block, which begins with `first`; with `lacking` something was left out of the block.
    fn composite(&mut self, first: usize, row: &mut [[f32; 4]], lacking: Option<Early>) -> RowSegments {
        let mut kept = RowSegments::default();
        for (pixel, color) in (first..).zip(row) {
            let kept = self.manner.keep.then_some(&mut kept);
            *color = composite(self.log.pixel(pixel), kept, &mut self.counts);
            if let Some(early) = lacking {
                early.complete(color, self.most);
            }
        }
        kept
    }
}

/// A block that is being drawn.
struct Drawing<'a> {
    log: &'a mut Log,
    /// With early termination.
    ending: Option<Ending>,
}

impl Sink for Drawing<'_> {
    fn is_early(&self) -> bool {
        self.ending.as_ref().is_some_and(Ending::is_near)
    }

    fn hides(&mut self, rect: &Rect, nearest: f64) -> bool {
        self.ending.as_mut().is_some_and(|ending| ending.hides(rect, nearest))
    }

    fn renews(&self) -> bool {
        self.is_early()
    }

    fn renew(&mut self, rects: [&Rect; 2], runs: &[Run]) {
        if let Some(ending) = &mut self.ending {
            ending.look_at(rects, runs);
        }
    }

    #[inline(always)]
    fn done(&mut self, pixel: usize, run: Segment) {
        self.log.add(pixel, run);
        if let Some(ending) = &mut self.ending {
            ending.add(pixel, &run);
        }
    }
}

/// A block of pixels, and which clusters may show in it, nearest first.
struct Block {
    rect: Rect,
    near: Vec<u32>,
}

/// The blocks of a picture, row by row.
struct Blocks {
    side: usize,
    across: usize,
    list: Vec<Block>,
}

impl Blocks {
    fn new(frame: &Frame<'_>, near: &[Near], workers: usize) -> Self {
        let count = |side: usize| frame.size.map(|n| (n as usize).div_ceil(side));
        let mut side = BLOCK[0];
        while side > BLOCK[1] && count(side).into_iter().product::<usize>() < EACH * workers {
            side /= 2;
        }
        let [across, down] = count(side);
        let mut list = Vec::with_capacity(across * down);
        for y in 0..down {
            for x in 0..across {
                let low = [x, y].map(|n| (n * side) as i32);
                let rect = Rect { low, high: low.map(|v| v + side as i32) }.meet(&frame.rect());
                list.push(Block { rect, near: Vec::new() });
            }
        }
        for (place, near) in near.iter().enumerate() {
            let [x0, y0] = near.reach.low.map(|v| v as usize / side);
            let [x1, y1] = near.reach.high.map(|v| (v - 1) as usize / side);
            for y in y0..=y1 {
                for block in &mut list[y * across + x0..=y * across + x1] {
                    block.near.push(place as u32);
                }
            }
        }
        Self { side, across, list }
    }
}

/// What threads have kept of rows of blocks, with the blocks' numbers; and what each of them did.
#[derive(Default)]
struct Drawn {
    kept: Vec<(usize, Vec<RowSegments>)>,
    counts: Vec<Counts>,
}

/// Draws a picture with `workers` threads of the current pool at most.
pub(super) fn run(
    frame: &Frame<'_>,
    manner: Manner,
    workers: usize,
    progress: &(dyn Fn(usize, usize) -> bool + Sync),
) -> Result<Gathered, CellsError> {
    let (near, mut skipped) = in_view(frame);
    // What ends early may need but some.
    if manner.early.is_none() {
        fill(frame, &near, &mut skipped);
    }
    let Blocks { side, across, list: blocks } = Blocks::new(frame, &near, workers);
    // Those with most to do first, so that no thread is left with a long one in the end.
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by_key(|&block| Reverse(blocks[block].near.len()));
    let total: usize = blocks.iter().map(|block| block.near.len()).sum();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let cancelled = AtomicBool::new(false);
    let goes_on = || {
        if !progress((done.fetch_add(1, Ordering::Relaxed) + 1).min(total), total) {
            cancelled.store(true, Ordering::Relaxed);
        }
        !cancelled.load(Ordering::Relaxed)
    };
    let [width, height] = frame.size.map(|n| n as usize);
    let mut pixels = vec![[0.0; 4]; width * height];
    let mut rows: Vec<Vec<&mut [[f32; 4]]>> = blocks.iter().map(|_| Vec::with_capacity(side)).collect();
    for (y, row) in pixels.chunks_mut(width).enumerate() {
        for (block, part) in (y / side * across..).zip(row.chunks_mut(side)) {
            rows[block].push(part);
        }
    }
    let rows: Vec<_> = rows.into_iter().map(Mutex::new).collect();
    let drawn = Mutex::new(Drawn::default());
    let work = || {
        let mut desk = Desk::new(frame, manner, &near);
        let mut mine = Vec::new();
        while let Some(&block) = order.get(next.fetch_add(1, Ordering::Relaxed)) {
            let mut rows = rows[block].lock().unwrap_or_else(PoisonError::into_inner);
            let Some(kept) = desk.draw(&blocks[block], &mut rows, goes_on) else { return };
            mine.push((block, kept));
        }
        let mut drawn = drawn.lock().unwrap_or_else(PoisonError::into_inner);
        drawn.kept.append(&mut mine);
        drawn.counts.push(desk.counts);
    };
    rayon::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|_| work());
        }
    });
    if cancelled.into_inner() {
        return Err(CellsError::Cancelled);
    }
    drop(rows);
    let Drawn { kept: mut drawn, mut counts } = drawn.into_inner().unwrap_or_else(PoisonError::into_inner);
    // Then blocks that stand side by side come one behind the other.
    drawn.sort_unstable_by_key(|&(block, _)| block);
    let mut kept = vec![RowSegments::default(); height];
    for (block, part) in drawn {
        for (row, more) in kept[block / across * side..].iter_mut().zip(part) {
            row.append(more);
        }
    }
    if let Some(first) = counts.first_mut() {
        first.add(skipped);
    }
    Ok(Gathered { pixels, kept, counts })
}
