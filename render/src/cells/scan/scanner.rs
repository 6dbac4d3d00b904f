//! Many cells at once, step by step: which waits, which rows each reaches, which pixels of these, and what their rays have of it.
//! No step has to wait for what the one before it has just written.

use std::ops::Range;

use super::outline::Outline;
use super::planes::{Cell, Passed};
use super::sides::Sides;
use super::{Corner, Found, LANES, Raws, Rect, Shown, Tetrahedron};
use crate::simd::{Four, fetch};

/// Cells that go at once, at most.
const CELLS: usize = 16;
/// The same of fours of rows.
const FOURS: usize = 128;
/// Pixels of the boxes of cells that go at once, at most: a cell of more goes in several parts, one below the other. So wide may
/// be what is scan-converted at once.
pub(in super::super) const PIXELS: usize = 1520;
/// Pixels that are written at once.
const WRITTEN: usize = 8;
/// Enough to hand it on.
const GATHERED: usize = 512;
/// There is room for these, and for a group that is not written whole.
pub(super) const ROOM: usize = GATHERED + PIXELS + LANES;
/// Cells ahead whose corners are called for.
const AHEAD: usize = 8;

/// The cells of a cluster, as they are before the camera.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Cells<'a> {
    pub(in super::super) corners: &'a [Corner],
    /// Each tetrahedron's scalar, where it is constant within it.
    pub(in super::super) constants: &'a [f64],
    pub(in super::super) shown: &'a [Shown],
}

impl<'a> Cells<'a> {
    #[inline(always)]
    fn tetrahedron(&self, shown: &Shown) -> Tetrahedron<'a> {
        let [p, q, r, s] = shown.corners.map(usize::from);
        let constant = self.constants.get(shown.tetrahedron as usize).copied();
        ([&self.corners[p], &self.corners[q], &self.corners[r], &self.corners[s]], constant)
    }

    /// Has the corners of a cell brought near.
    #[inline(always)]
    fn fetch(&self, number: usize) {
        if let Some(shown) = self.shown.get(number) {
            for corner in shown.corners {
                if let Some(corner) = self.corners.get(usize::from(corner)) {
                    fetch(corner);
                }
            }
        }
    }
}

/// A cell that waits.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    cell: Cell,
    outline: Outline,
    /// Which of those shown.
    number: u32,
    /// Where its pixels end.
    end: u32,
    /// Columns from one up to but not at another, and its last row.
    columns: [i32; 2],
    last: i32,
}

/// Four rows of a cell.
#[derive(Debug, Clone, Copy)]
struct Rows {
    cell: u32,
    top: i32,
}

/// Scan-converts cells.
#[derive(Debug)]
pub(in super::super) struct Scanner {
    waiting: [Waiting; CELLS],
    count: usize,
    fours: [Rows; FOURS],
    fours_count: usize,
    /// How many pixels the boxes of the cells have.
    area: usize,
    places: Places,
    raws: Raws,
}

/// Pixels that cells may pass, cell by cell.
#[derive(Debug)]
struct Places {
    /// How far right and down in the picture.
    right: [u32; PIXELS + WRITTEN],
    down: [i32; PIXELS + WRITTEN],
    /// Their numbers.
    pixels: [u32; PIXELS + WRITTEN],
}

impl Default for Scanner {
    fn default() -> Self {
        let (cell, outline) = (Cell::NONE, Outline::NONE);
        let none = Waiting { cell, outline, number: 0, end: 0, columns: [0; 2], last: 0 };
        Self {
            waiting: [none; CELLS],
            count: 0,
            fours: [Rows { cell: 0, top: 0 }; FOURS],
            fours_count: 0,
            area: 0,
            places: Places {
                right: [0; PIXELS + WRITTEN],
                down: [0; PIXELS + WRITTEN],
                pixels: [0; PIXELS + WRITTEN],
            },
            raws: Raws::default(),
        }
    }
}

impl Places {
    /// Writes some pixels of a row, one by one from the first on.
    #[inline(always)]
    fn write<F: Four>(&mut self, at: usize, [right, down]: [i32; 2], pixel: u32) {
        if let Some(into) = self.right[at..].first_chunk_mut() {
            F::put_rising(right as u32, into);
        }
        if let Some(into) = self.down[at..].first_chunk_mut::<WRITTEN>() {
            *into = [down; WRITTEN];
        }
        if let Some(into) = self.pixels[at..].first_chunk_mut() {
            F::put_rising(pixel, into);
        }
    }

    /// A group: right and down.
    #[inline(always)]
    fn group<F: Four>(&self, at: usize) -> [F; 2] {
        let [mut right, mut down] = [[0; LANES]; 2];
        if let Some(group) = self.right[at..].first_chunk() {
            right = group.map(|right| right as i32);
        }
        if let Some(group) = self.down[at..].first_chunk() {
            down = *group;
        }
        [F::from_whole(right), F::from_whole(down)]
    }
}

impl Scanner {
    /// Finds what the rays of `tile`, [`PIXELS`] wide at most, have of cells, in the order of these. Pixels are counted in `rect`. Whenever much is gathered it goes to `full`; what is left stays here.
    #[inline(always)]
    pub(in super::super) fn scan<F: Four>(
        &mut self,
        cells: Cells<'_>,
        [rect, tile]: [&Rect; 2],
        perspective: bool,
        full: &mut impl FnMut(Found<'_>),
    ) {
        let mut next = 0;
        // Where what is left of the next begins, if it has begun.
        let mut rest = None;
        while next < cells.shown.len() {
            let mut flat = None;
            while let Some(shown) = cells.shown.get(next) {
                let mut reach = shown.reach.meet(tile);
                if reach.is_empty() {
                    next += 1;
                    continue;
                }
                let bottom = reach.high[1];
                reach.low[1] = rest.unwrap_or(reach.low[1]);
                reach.high[1] = bottom.min(reach.low[1] + most_rows(&reach));
                if !self.makes_room(&reach) {
                    break;
                }
                cells.fetch(next + AHEAD);
                let of = cells.tetrahedron(shown);
                let waits = self.wait::<F>(&of, perspective, next, &reach);
                rest = Some(reach.high[1]).filter(|&row| row < bottom);
                next += usize::from(rest.is_none());
                if !waits {
                    flat = Some((of, reach));
                    break;
                }
            }
            self.find_pixels::<F>(rect);
            self.pass::<F>(&cells, perspective, full);
            if let Some((of, reach)) = flat {
                Sides::new(&of, perspective).pass_rect(rect, &reach, &mut self.raws);
                if self.raws.count >= GATHERED {
                    full(self.raws.take());
                }
            }
        }
    }

    /// Takes out what is left.
    #[inline(always)]
    pub(in super::super) fn rest(&mut self) -> Found<'_> {
        self.raws.take()
    }

    /// Whether a cell may wait with the others; takes it into account if so.
    #[inline(always)]
    fn makes_room(&mut self, reach: &Rect) -> bool {
        let [width, height] = [0, 1].map(|a| (reach.high[a] - reach.low[a]) as u32 as usize);
        let (fours, area) = (self.fours_count + height.div_ceil(4), self.area + width * height);
        let room = self.count < CELLS && fours <= FOURS && area <= PIXELS;
        if room {
            self.area = area;
        }
        room
    }

    /// Has a cell wait, if it has planes.
    #[inline(always)]
    fn wait<F: Four>(
        &mut self,
        of: &Tetrahedron<'_>,
        perspective: bool,
        number: usize,
        reach: &Rect,
    ) -> bool {
        let count = self.count % CELLS;
        let one = &mut self.waiting[count];
        if one.cell.set::<F>(&mut one.outline, of, perspective).is_none() {
            return false;
        }
        (one.number, one.last, one.columns) =
            (number as u32, reach.high[1] - 1, [reach.low[0], reach.high[0]]);
        self.count = count + 1;
        let mut top = reach.low[1];
        while top < reach.high[1] {
            self.fours[self.fours_count % FOURS] = Rows { cell: count as u32, top };
            self.fours_count += 1;
            top += 4;
        }
        true
    }

    /// Finds which pixels' rays may pass the cells that wait.
    #[inline(always)]
    fn find_pixels<F: Four>(&mut self, rect: &Rect) {
        let width = rect.high[0] - rect.low[0];
        let mut count = 0;
        for &Rows { cell, top } in &self.fours[..self.fours_count] {
            let one = &mut self.waiting[cell as usize % CELLS];
            let rows = F::all(f64::from(top)) + F::from_array([0.0, 1.0, 2.0, 3.0]);
            let [begins, ends] = one.outline.columns::<F>(rows, one.last, one.columns);
            let mut before = (top - rect.low[1]) * width - rect.low[0];
            for ((row, begin), end) in (top..).zip(begins).zip(ends) {
                let first = (before + begin) as u32;
                before += width;
                let mut n = 0;
                // At least once: most rows are as short as that, which need not be asked.
                loop {
                    self.places.write::<F>(
                        count + n as usize,
                        [begin + n, row],
                        first.wrapping_add(n as u32),
                    );
                    n += WRITTEN as i32;
                    if n >= end - begin {
                        break;
                    }
                }
                count += (end - begin).max(0) as usize;
            }
            one.end = count as u32;
        }
    }

    /// Finds what the rays of these pixels have of the cells, which no longer wait then.
    #[inline(always)]
    fn pass<F: Four>(&mut self, cells: &Cells<'_>, perspective: bool, full: &mut impl FnMut(Found<'_>)) {
        let mut first = 0;
        for n in 0..self.count {
            let end = self.waiting[n].end as usize;
            let range = [first, end];
            first = end;
            match (self.waiting[n].cell.near, perspective) {
                (1, false) => self.pass_cell::<F, 1, false>(cells, n, range),
                (2, false) => self.pass_cell::<F, 2, false>(cells, n, range),
                (_, false) => self.pass_cell::<F, 3, false>(cells, n, range),
                (1, true) => self.pass_cell::<F, 1, true>(cells, n, range),
                (2, true) => self.pass_cell::<F, 2, true>(cells, n, range),
                (_, true) => self.pass_cell::<F, 3, true>(cells, n, range),
            }
            if self.raws.count >= GATHERED {
                full(self.raws.take());
            }
        }
        (self.count, self.fours_count, self.area) = (0, 0, 0);
    }

    /// The same of one cell, `NEAR` of whose faces are near, and the pixels in a range.
    #[inline(always)]
    fn pass_cell<F: Four, const NEAR: usize, const PERSPECTIVE: bool>(
        &mut self,
        cells: &Cells<'_>,
        n: usize,
        [first, end]: [usize; 2],
    ) {
        let Waiting { cell, number, .. } = &self.waiting[n];
        let mut at = first;
        while at < end {
            let passed = cell.pass::<F, NEAR, PERSPECTIVE>(self.places.group(at));
            let lanes = LANES.min(end - at);
            let within = (1 << lanes) - 1;
            if passed.clear & passed.hit & within == within {
                self.raws.add_all(&self.places.pixels[at..], lanes, &passed);
            } else {
                let of = cells.tetrahedron(&cells.shown[*number as usize]);
                add_some(&of, &self.places, at..at + lanes, &passed, PERSPECTIVE, &mut self.raws);
            }
            at += LANES;
        }
    }
}

/// How many rows of a rectangle there is room for.
#[inline(always)]
fn most_rows(rect: &Rect) -> i32 {
    // Of nearly all cells without a division.
    const NARROW: i32 = 32;
    let width = rect.high[0] - rect.low[0];
    PIXELS as i32 / if width <= NARROW { NARROW } else { width }
}

/// Adds what rays of a group have of a cell, not all of which pass, or clear of its edges.
#[cold]
#[inline(never)]
fn add_some<F: Four>(
    of: &Tetrahedron<'_>,
    places: &Places,
    group: Range<usize>,
    passed: &Passed<F>,
    perspective: bool,
    raws: &mut Raws,
) {
    let [front, back] = passed.depths.map(F::to_array);
    let [from, to] = passed.values.map(F::to_array);
    for (lane, at) in group.enumerate() {
        if passed.clear >> lane & 1 == 0 {
            let place = [places.right[at] as i32, places.down[at]];
            Sides::new(of, perspective).pass(place, places.pixels[at], 1, raws);
        } else if passed.hit >> lane & 1 == 1 {
            raws.add(places.pixels[at], [[front[lane], from[lane]], [back[lane], to[lane]]]);
        }
    }
}
