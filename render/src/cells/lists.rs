//! The lists of a worker: for each pixel the segments that are known, merged runs of cells.

use std::ops::Range;

use super::fold::{Segment, merge, under};

const NONE: u32 = u32::MAX;

#[derive(Debug, Clone, Copy)]
struct Node {
    segment: Segment,
    next: u32,
}

/// A list of segments for each pixel of a picture.
#[derive(Debug)]
pub(super) struct Lists {
    heads: Vec<u32>,
    nodes: Vec<Node>,
    scratch: [Vec<Segment>; 2],
}

impl Lists {
    pub(super) fn new(pixels: usize) -> Self {
        Self { heads: vec![NONE; pixels], nodes: Vec::new(), scratch: Default::default() }
    }

    /// Adds a segment in no order.
    pub(super) fn add(&mut self, pixel: usize, segment: Segment) {
        self.nodes.push(Node { segment, next: self.heads[pixel] });
        self.heads[pixel] = (self.nodes.len() - 1) as u32;
    }

    /// Adds a segment in order of depth, merges what meets and drops what lies behind an opacity of `threshold`. Where that
    /// is reached, its depth is told. `merged` is how many segments there are fewer.
    pub(super) fn add_early(
        &mut self,
        pixel: usize,
        segment: Segment,
        threshold: f32,
        merged: &mut u64,
    ) -> Option<f64> {
        let [mut list, mut runs] = std::mem::take(&mut self.scratch);
        list.clear();
        runs.clear();
        let first = self.heads[pixel];
        let mut at = first;
        while at != NONE {
            let node = &self.nodes[at as usize];
            list.push(node.segment);
            at = node.next;
        }
        let place = list.partition_point(|s| s.order(&segment).is_lt());
        list.insert(place, segment);
        merge(&list, |run| runs.push(run));
        let mut seen = [0.0; 4];
        let mut end = None;
        for (i, run) in runs.iter().enumerate() {
            under(&mut seen, run.rgba);
            if seen[3] >= threshold {
                // Where cells overlap, what ends first need not end last.
                let reached = runs[..=i].iter().fold(0.0, |far: f64, r| far.max(r.back));
                end = Some((i + 1, reached));
                break;
            }
        }
        if let Some((count, _)) = end {
            runs.truncate(count);
        }
        *merged += (list.len() - runs.len().min(list.len())) as u64;
        // The nodes that there are take what is left; there may be one more.
        let mut node = first;
        for (i, run) in runs.iter().enumerate() {
            if node == NONE {
                self.nodes.push(Node { segment: *run, next: NONE });
                let new = (self.nodes.len() - 1) as u32;
                self.link(pixel, first, i, new);
                break;
            }
            self.nodes[node as usize].segment = *run;
            let next = self.nodes[node as usize].next;
            if i + 1 == runs.len() {
                self.nodes[node as usize].next = NONE;
            }
            node = next;
        }
        self.scratch = [list, runs];
        end.map(|(_, depth)| depth)
    }

    /// Hangs a node behind the first `place` of a pixel's list.
    fn link(&mut self, pixel: usize, first: u32, place: usize, new: u32) {
        if place == 0 {
            self.heads[pixel] = new;
            return;
        }
        let mut at = first;
        for _ in 1..place {
            at = self.nodes[at as usize].next;
        }
        self.nodes[at as usize].next = new;
    }

    /// The segments of a pixel, in no order.
    pub(super) fn pixel(&self, pixel: usize) -> impl Iterator<Item = &Segment> {
        let mut at = self.heads[pixel];
        std::iter::from_fn(move || {
            let node = self.nodes.get(at as usize)?;
            at = node.next;
            Some(&node.segment)
        })
    }

    /// Forgets the segments of a pixel.
    pub(super) fn clear(&mut self, pixel: usize) {
        self.heads[pixel] = NONE;
    }
}

/// Segments as they come, put together by pixel when all are there.
#[derive(Debug, Default)]
pub(super) struct Log {
    pixels: Vec<u32>,
    segments: Vec<Segment>,
    /// How many each pixel has; then where those of the pixel end.
    ends: Vec<u32>,
    by_pixel: Vec<Segment>,
}

impl Log {
    /// Forgets all, for so many pixels.
    pub(super) fn reset(&mut self, pixels: usize) {
        self.pixels.clear();
        self.segments.clear();
        self.ends.clear();
        self.ends.resize(pixels, 0);
    }

    pub(super) fn add(&mut self, pixel: usize, segment: Segment) {
        self.pixels.push(pixel as u32);
        self.segments.push(segment);
        self.ends[pixel] += 1;
    }

    /// Puts all together by pixel, in the order in which they came.
    pub(super) fn close(&mut self) {
        let pixels = self.pixels.iter().copied();
        put_by_pixel(&mut self.ends, pixels.zip(&self.segments), &mut self.by_pixel);
    }

    /// The segments of a pixel, when all are put together.
    pub(super) fn pixel(&mut self, pixel: usize) -> &mut [Segment] {
        &mut self.by_pixel[of_pixel(&self.ends, pixel)]
    }
}

/// Puts things together by pixel, in the order in which they come. `counts` says how many each pixel has, and then where those
/// of the pixel end.
#[inline(always)]
pub(super) fn put_by_pixel<'a, T: Copy + 'a>(
    counts: &mut [u32],
    things: impl ExactSizeIterator<Item = (u32, &'a T)> + Clone,
    by_pixel: &mut Vec<T>,
) {
    let mut begin = 0;
    for count in &mut *counts {
        (*count, begin) = (begin, begin + *count);
    }
    let Some((_, &any)) = things.clone().next() else {
        by_pixel.clear();
        return;
    };
    // What there was before is written over.
    by_pixel.resize(things.len(), any);
    for (pixel, thing) in things {
        let place = &mut counts[pixel as usize];
        by_pixel[*place as usize] = *thing;
        *place += 1;
    }
}

/// Where the things of a pixel are then.
#[inline(always)]
pub(super) fn of_pixel(ends: &[u32], pixel: usize) -> Range<usize> {
    let begin = if pixel == 0 { 0 } else { ends[pixel - 1] };
    begin as usize..ends[pixel] as usize
}
