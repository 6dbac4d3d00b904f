//! Scan conversion: which pixels' rays pass a tetrahedron, and where they enter and leave it.
//!
//! A corner before the camera is a point (x, y, w) of the projective plane, in pixels, where whole numbers are the
//! middles of pixels; w is 1 but for corners beside or behind a perspective eye, which no division reaches. Rays that pass
//! clear of a cell's edges are told by the planes of its faces (`planes`), all others by exact predicates (`sides`). Depth
//! on a face is that of its plane, or where it has none the mean of its corners': cells that share the face get the same
//! bits, and each ray passes it in both of them or in neither.

mod planes;
mod sides;

use crate::simd::{Four, put_from};
use planes::{Cell, Passed};
use sides::Sides;

/// Pixels that go at once.
const LANES: usize = 4;

/// A corner before the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub(super) struct Corner {
    /// Place in the picture, pixels, times w.
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) w: f64,
    /// Depth; mm before the eye plane.
    pub(super) z: f64,
    /// What runs linearly over the picture and grows with depth: see `planes`. Not a number where w is not 1.
    pub(super) rank: f64,
    pub(super) scalar: f64,
}

/// Pixels from `low` up to but not at `high`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    pub(super) low: [i32; 2],
    pub(super) high: [i32; 2],
}

impl Rect {
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.low[0] >= self.high[0] || self.low[1] >= self.high[1]
    }

    #[inline(always)]
    pub(super) fn meet(&self, other: &Self) -> Self {
        Self {
            low: [0, 1].map(|a| self.low[a].max(other.low[a])),
            high: [0, 1].map(|a| self.high[a].min(other.high[a])),
        }
    }

    /// The least that has all of both.
    #[inline(always)]
    pub(super) fn join(&self, other: &Self) -> Self {
        Self {
            low: [0, 1].map(|a| self.low[a].min(other.low[a])),
            high: [0, 1].map(|a| self.high[a].max(other.high[a])),
        }
    }

    /// Which of its pixels one is, row by row.
    #[inline(always)]
    pub(super) fn number(&self, [i, j]: [i32; 2]) -> usize {
        (j - self.low[1]) as usize * self.size()[0] + (i - self.low[0]) as usize
    }

    pub(super) fn size(&self) -> [usize; 2] {
        [0, 1].map(|a| usize::try_from(self.high[a] - self.low[a]).unwrap_or(0))
    }

    /// How many pixels.
    pub(super) fn area(&self) -> usize {
        self.size().into_iter().product()
    }

    /// The pixels whose rays may pass between corners: all of `within` where one of them is not before the eye.
    #[inline(always)]
    pub(super) fn around<'a>(corners: impl IntoIterator<Item = &'a Corner>, within: &Self) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for c in corners {
            if c.w != 1.0 {
                return *within;
            }
            low = [low[0].min(c.x), low[1].min(c.y)];
            high = [high[0].max(c.x), high[1].max(c.y)];
        }
        Self::between(low, high).meet(within)
    }

    /// The pixels whose middles lie between two places.
    #[inline(always)]
    pub(super) fn between(low: [f64; 2], high: [f64; 2]) -> Self {
        // `as` saturates; one more keeps the range half open.
        Self { low: low.map(|v| v.ceil() as i32), high: high.map(|v| (v.floor() as i32).saturating_add(1)) }
    }
}

/// What a ray has of one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Raw {
    /// Depth where it enters and leaves; mm before the eye plane.
    pub(super) front: f64,
    pub(super) back: f64,
    /// The scalar there.
    pub(super) values: [f32; 2],
    /// Which of the rectangle's, row by row.
    pub(super) pixel: u32,
}

/// Corners of a face, and for each the edge across from it.
const FACES: [([usize; 3], [usize; 3]); 4] =
    [([1, 2, 3], [5, 4, 3]), ([0, 2, 3], [5, 2, 1]), ([0, 1, 3], [4, 2, 0]), ([0, 1, 2], [3, 1, 0])];
/// What is gathered before it is handed on.
const GATHERED: usize = 512;

/// Pixels of a row, a multiple of [`LANES`], that are gone through before it is asked whether that is so.
const AHEAD: usize = 128;
/// There is room for these, and for a group that is not written whole.
const ROOM: usize = GATHERED + AHEAD + LANES;

/// What rays have of cells, gathered until there is enough of it: a [`Raw`] each, part by part.
#[derive(Debug)]
pub(super) struct Raws {
    fronts: [f64; ROOM],
    backs: [f64; ROOM],
    from: [f32; ROOM],
    to: [f32; ROOM],
    pixels: [u32; ROOM],
    count: usize,
}

impl Default for Raws {
    fn default() -> Self {
        Self {
            fronts: [0.0; ROOM],
            backs: [0.0; ROOM],
            from: [0.0; ROOM],
            to: [0.0; ROOM],
            pixels: [0; ROOM],
            count: 0,
        }
    }
}

/// What was gathered.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found<'a> {
    pub(super) fronts: &'a [f64],
    pub(super) backs: &'a [f64],
    pub(super) from: &'a [f32],
    pub(super) to: &'a [f32],
    pub(super) pixels: &'a [u32],
}

impl Found<'_> {
    pub(super) fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Up to `count` of it from the `first` on.
    #[inline(always)]
    pub(super) fn part(&self, first: usize, count: usize) -> Self {
        let last = self.len().min(first + count);
        Self {
            fronts: &self.fronts[first..last],
            backs: &self.backs[first..last],
            from: &self.from[first..last],
            to: &self.to[first..last],
            pixels: &self.pixels[first..last],
        }
    }

    #[inline(always)]
    pub(super) fn get(&self, n: usize) -> Raw {
        let [front, back] = [self.fronts[n], self.backs[n]];
        Raw { front, back, values: [self.from[n], self.to[n]], pixel: self.pixels[n] }
    }
}

impl Raws {
    /// Takes out what is there.
    #[inline(always)]
    pub(super) fn take(&mut self) -> Found<'_> {
        let count = std::mem::take(&mut self.count);
        Found {
            fronts: &self.fronts[..count],
            backs: &self.backs[..count],
            from: &self.from[..count],
            to: &self.to[..count],
            pixels: &self.pixels[..count],
        }
    }

    /// Adds what those rays of a group pass that do.
    #[inline(always)]
    fn add_all<F: Four>(&mut self, first: u32, passed: &Passed<F>, hit: u32) {
        let at = self.count.min(ROOM - LANES);
        let [front, back] = passed.depths;
        let [from, to] = passed.values;
        if let Some(fronts) = self.fronts[at..].first_chunk_mut() {
            front.put(hit, fronts);
        }
        if let Some(backs) = self.backs[at..].first_chunk_mut() {
            back.put(hit, backs);
        }
        if let Some(values) = self.from[at..].first_chunk_mut() {
            from.put_f32(hit, values);
        }
        if let Some(values) = self.to[at..].first_chunk_mut() {
            to.put_f32(hit, values);
        }
        if let Some(pixels) = self.pixels[at..].first_chunk_mut() {
            put_from(first, hit, pixels);
        }
        self.count = at + hit.count_ones() as usize;
    }

    /// Adds where a ray passes two faces, if it does so before the eye.
    #[inline(always)]
    fn add(&mut self, pixel: u32, [a, b]: [[f64; 2]; 2]) {
        let [mut front, mut from] = if a[0] <= b[0] { a } else { b };
        let [back, to] = if a[0] <= b[0] { b } else { a };
        if back > 0.0 && back > front {
            if front < 0.0 {
                from += (to - from) * (front / (front - back));
                front = 0.0;
            }
            let n = self.count;
            (self.fronts[n], self.backs[n]) = (front, back);
            (self.from[n], self.to[n], self.pixels[n]) = (from as f32, to as f32, pixel);
            self.count += 1;
        }
    }
}

/// A tetrahedron: its corners, in the order of their numbers, and its scalar where that is one for all of it.
pub(super) type Tetrahedron<'a> = ([&'a Corner; 4], Option<f64>);

/// The scalar of each corner.
#[inline(always)]
fn scalars((corners, constant): &Tetrahedron<'_>) -> [f64; 4] {
    let [p, q, r, s] = corners;
    constant.map_or([p.scalar, q.scalar, r.scalar, s.scalar], |value| [value; 4])
}

/// Finds what the rays of `reach`, which lies within `rect`, have of a tetrahedron. Pixels are counted in `rect`. Whenever
/// much is gathered it goes to `full`; what is left stays in `raws`.
#[inline(always)]
pub(super) fn scan<F: Four>(
    of: Tetrahedron<'_>,
    rects: [&Rect; 2],
    perspective: bool,
    raws: &mut Raws,
    full: &mut impl FnMut(Found<'_>),
) {
    let of = &of;
    let Some(cell) = Cell::new::<F>(of, perspective) else {
        flat(of, rects, perspective, raws, full);
        return;
    };
    match (cell.near, perspective) {
        (1, false) => plain::<F, 1, false>(&cell, of, rects, raws, full),
        (2, false) => plain::<F, 2, false>(&cell, of, rects, raws, full),
        (_, false) => plain::<F, 3, false>(&cell, of, rects, raws, full),
        (1, true) => plain::<F, 1, true>(&cell, of, rects, raws, full),
        (2, true) => plain::<F, 2, true>(&cell, of, rects, raws, full),
        (_, true) => plain::<F, 3, true>(&cell, of, rects, raws, full),
    }
}

/// The same of a cell that has planes, `NEAR` of them near.
#[inline(always)]
fn plain<F: Four, const NEAR: usize, const PERSPECTIVE: bool>(
    cell: &Cell,
    of: &Tetrahedron<'_>,
    [rect, reach]: [&Rect; 2],
    raws: &mut Raws,
    full: &mut impl FnMut(Found<'_>),
) {
    let width = rect.high[0] - rect.low[0];
    for j in reach.low[1]..reach.high[1] {
        let before = (j - rect.low[1]) * width - rect.low[0];
        let row = cell.row(j);
        let mut i = reach.low[0];
        while i < reach.high[0] {
            // For as many at once as there is room for.
            let end = reach.high[0].min(i + AHEAD as i32);
            while i < end {
                let lanes = LANES.min((end - i) as usize);
                let within = (1 << lanes) - 1;
                let passed = cell.pass::<F, NEAR, PERSPECTIVE>(&row, i);
                let first = (before + i) as u32;
                if passed.clear & within == within {
                    raws.add_all(first, &passed, passed.hit & within);
                } else {
                    unsure(of, [i, j], first, lanes, PERSPECTIVE, raws);
                }
                i += LANES as i32;
            }
            if raws.count >= GATHERED {
                full(raws.take());
            }
        }
    }
}

/// A group of rays of which some pass close to an edge.
#[cold]
#[inline(never)]
fn unsure(of: &Tetrahedron<'_>, at: [i32; 2], first: u32, lanes: usize, perspective: bool, raws: &mut Raws) {
    Sides::new(of, perspective).pass(at, first, lanes, raws);
}

/// What `scan` finds, of a cell without planes.
#[inline(never)]
fn flat(
    of: &Tetrahedron<'_>,
    [rect, reach]: [&Rect; 2],
    perspective: bool,
    raws: &mut Raws,
    full: &mut impl FnMut(Found<'_>),
) {
    let width = rect.high[0] - rect.low[0];
    let sides = Sides::new(of, perspective);
    for j in reach.low[1]..reach.high[1] {
        let before = (j - rect.low[1]) * width - rect.low[0];
        for i in (reach.low[0]..reach.high[0]).step_by(LANES) {
            let lanes = LANES.min((reach.high[0] - i) as usize);
            sides.pass([i, j], (before + i) as u32, lanes, raws);
            if raws.count >= GATHERED {
                full(raws.take());
            }
        }
    }
}
