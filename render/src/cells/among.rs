//! A grid among volumes and surfaces: what each ray of some rows of the picture has of its cells, in order of depth, for a
//! renderer that walks rays and adds up whatever they meet.
//!
//! The picture is divided, not the grid: every thread scan-converts the cells before its own rows. All stretches are integrated
//! at once; nothing is merged before the ray is walked, so that a volume between or within cells needs no slices: a ray takes
//! what is seen of a cell that it passes whole and alone, and only integrates itself where something else is in it.

use std::ops::Range;

use super::blocks::{Near, fill, in_view};
use super::clusters::Grain;
use super::project::{Gathered, Projector};
use super::scan::{PIXELS, Raw, Rect};
use super::stats::Counts;
use super::table::{Place, Table};
use super::{CellsError, Options, Placed};
use crate::scene::CellItem;
use crate::view::View;

/// A grid before the camera, with what of it may show.
#[derive(Debug)]
pub(crate) struct Among {
    placed: Placed,
    near: Vec<Near>,
}

impl Among {
    fn new(placed: Placed) -> Self {
        let (near, mut counts) = in_view(&placed.frame());
        fill(&placed.frame(), &near, &mut counts);
        Self { placed, near }
    }

    /// How many tetrahedra the grid has.
    pub(crate) fn tetrahedra(&self) -> u64 {
        self.placed.tetrahedra()
    }
}

/// Pixels that a block is wide: what the rays of one have must be sorted while it is at hand.
const BLOCK: usize = 64;
const _: () = assert!(BLOCK <= PIXELS, "a block is scan-converted at once");

/// What the rays of some rows have of a grid, in blocks side by side; kept from strip to strip.
#[derive(Debug, Default)]
pub(crate) struct Strip {
    projector: Projector,
    blocks: Vec<Gathered>,
    width: usize,
    /// Work since it was made.
    pub(crate) counts: Counts,
}

impl Strip {
    /// Finds what the rays of `rows` have of a grid.
    pub(crate) fn fill(&mut self, among: &Among, rows: Range<usize>) {
        let Among { placed, near } = among;
        let [width, height] = placed.size.map(|n| i32::try_from(n).unwrap_or(i32::MAX));
        let row = |y: usize| i32::try_from(y).unwrap_or(height).min(height);
        self.width = placed.size[0] as usize;
        self.blocks.resize_with(self.width.div_ceil(BLOCK), Gathered::default);
        let frame = placed.frame();
        for (block, left) in self.blocks.iter_mut().zip((0..width).step_by(BLOCK)) {
            let right = left.saturating_add(BLOCK as i32).min(width);
            let rect = Rect { low: [left, row(rows.start)], high: [right, row(rows.end)] };
            let reaching = near.iter().filter(|near| !near.reach.meet(&rect).is_empty());
            let clusters = reaching.filter_map(Near::known);
            self.projector.gather(&frame, &rect, clusters, block, &mut self.counts);
        }
    }

    /// What the ray of a pixel has of the grid; pixels count from the first row, row by row. `near_mm` is the depth that
    /// zeta counts from.
    #[inline(always)]
    pub(crate) fn pixel<'a>(&'a self, among: &'a Among, pixel: usize, near_mm: f64) -> Spans<'a> {
        let (x, y) = (pixel % self.width, pixel / self.width);
        let block = x / BLOCK;
        let wide = BLOCK.min(self.width - block * BLOCK);
        let (list, seen) = self.blocks[block].pixel(y * wide + x % BLOCK);
        Spans { list, seen, table: &among.placed.table, near_mm }
    }
}

/// What a ray has of a grid, nearest first.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spans<'a> {
    list: &'a [Raw],
    /// What is seen of each of the list, whole.
    seen: &'a [[f32; 4]],
    table: &'a Table,
    near_mm: f64,
}

impl<'a> Spans<'a> {
    pub(crate) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    fn zeta(&self, depth: f64) -> f32 {
        (depth - self.near_mm) as f32
    }

    /// Zeta where it begins and ends.
    pub(crate) fn ends(&self) -> [f32; 2] {
        let first = self.list.first().map_or(0.0, |raw| raw.front);
        [first, self.list.iter().fold(first, |far, raw| far.max(raw.back))].map(|depth| self.zeta(depth))
    }

    pub(crate) fn walker(self) -> Walker<'a> {
        Walker { spans: self, next: 0, open: Vec::new(), place: Place::NOWHERE }
    }
}

/// A cell that the ray is in.
#[derive(Debug, Clone, Copy)]
struct Open {
    front: f32,
    back: f32,
    values: [f32; 2],
    /// The last place looked up.
    place: Place,
}

impl Open {
    /// From one zeta within the cell to another.
    #[inline(always)]
    fn places(&mut self, table: &Table, [from, to]: [f32; 2]) -> [Place; 2] {
        let at = |zeta: f32| {
            let part = ((zeta - self.front) / (self.back - self.front)).clamp(0.0, 1.0);
            self.values[0] + (self.values[1] - self.values[0]) * part
        };
        let begin = table.at(at(from), &self.place);
        let end = table.at(at(to), &begin);
        self.place = end;
        [begin, end]
    }
}

/// A way along a ray through the cells of a grid.
#[derive(Debug)]
pub(crate) struct Walker<'a> {
    spans: Spans<'a>,
    next: usize,
    open: Vec<Open>,
    /// The place last looked up in a cell that is left.
    place: Place,
}

impl Walker<'_> {
    /// Passes cells that lie whole and alone between two zetas, the first of which is where the last call ended, as long as
    /// `each` goes on from what is seen of each; where it stops.
    #[inline(always)]
    pub(crate) fn run(&mut self, [from, to]: [f32; 2], mut each: impl FnMut([f32; 4]) -> bool) -> f32 {
        let Spans { list, seen, .. } = self.spans;
        let mut at = from;
        while let (true, Some(raw), Some(&seen)) =
            (self.open.is_empty(), list.get(self.next), seen.get(self.next))
        {
            let back = self.spans.zeta(raw.back);
            let overlaps = list.get(self.next + 1).is_some_and(|next| next.front < raw.back);
            if overlaps || back > to || self.spans.zeta(raw.front) < at {
                break;
            }
            at = back;
            self.next += 1;
            if !each(seen) {
                break;
            }
        }
        at
    }

    /// On to a zeta, which does not fall.
    pub(crate) fn reach(&mut self, zeta: f32) {
        let place = &mut self.place;
        self.open.retain(|open| {
            let stays = open.back > zeta;
            if !stays {
                *place = open.place;
            }
            stays
        });
        while let Some(raw) = self.spans.list.get(self.next) {
            let [front, back] = [raw.front, raw.back].map(|depth| self.spans.zeta(depth));
            if front > zeta {
                break;
            }
            self.next += 1;
            if back > zeta {
                self.open.push(Open { front, back, values: raw.values, place: self.place });
            }
        }
    }

    /// Whether the ray is in no cell.
    pub(crate) fn is_clear(&self) -> bool {
        self.open.is_empty()
    }

    /// Whether the ray is in more than one cell.
    pub(crate) fn is_many(&self) -> bool {
        self.open.len() > 1
    }

    /// Where the next cell begins or one ends.
    pub(crate) fn next_bend(&self) -> f32 {
        let next = self.spans.list.get(self.next).map_or(f32::INFINITY, |raw| self.spans.zeta(raw.front));
        self.open.iter().fold(next, |nearest, open| nearest.min(open.back))
    }

    /// Optical depth times colour, and optical depth, between two places before the next bend.
    pub(crate) fn step(&mut self, range: [f32; 2], mm_per_zeta: f32) -> [f32; 4] {
        let mut sum = [0.0; 4];
        let table = self.spans.table;
        for open in &mut self.open {
            let [from, to] = open.places(table, range);
            let depth = table.depth(&from, &to, (range[1] - range[0]) * mm_per_zeta);
            sum = std::array::from_fn(|c| sum[c] + depth[c].max(0.0));
        }
        sum
    }

    /// Colour, premultiplied, and opacity between two places before the next bend, of the one cell that the ray is in.
    pub(crate) fn segment(&mut self, range: [f32; 2], mm_per_zeta: f32) -> [f32; 4] {
        let table = self.spans.table;
        let Some(open) = self.open.first_mut() else { return [0.0; 4] };
        let [from, to] = open.places(table, range);
        table.segment(&from, &to, (range[1] - range[0]) * mm_per_zeta)
    }
}

impl super::CellRenderer {
    /// Makes grids ready to be drawn among other things. Of the options only what is skipped and the instructions are looked at.
    ///
    /// # Errors
    /// [`CellsError::Step`] and [`CellsError::Field`].
    pub(crate) fn place(
        &mut self,
        items: &[CellItem],
        view: &View,
        options: &Options,
    ) -> Result<Vec<Among>, CellsError> {
        let ready = self.prepare(items, Grain::Fine)?;
        let placed = items.iter().zip(ready);
        Ok(placed.map(|(item, ready)| Among::new(Placed::new(ready, item, view, options))).collect())
    }
}
