//! Scan conversion: which pixels' rays pass a tetrahedron, and where they enter and leave it.
//!
//! A corner before the camera is a point (x, y, w) of the projective plane, in pixels, where whole numbers are the
//! middles of pixels; w is 1 but for corners beside or behind a perspective eye, which no division reaches. Rays that pass
//! clear of a cell's edges are told by the planes of its faces (`planes`), all others by exact predicates (`sides`). Depth
//! on a face is that of its plane, or where it has none the mean of its corners': cells that share the face get the same
//! bits, and each ray passes it in both of them or in neither.

mod outline;
mod planes;
mod scanner;
mod sides;
#[cfg(test)]
mod tests;

use crate::simd::Four;
use planes::Passed;
use scanner::ROOM;
pub(super) use scanner::{Cells, PIXELS, Scanner};

/// A little less than to the next pixel: of a place and this, the whole number is the first pixel that does not lie before it, or
/// one that does so by rounding.
pub(super) const NEXT: f64 = 1.0 - 1e-9;
/// Pixels that go at once.
const LANES: usize = 4;

/// A corner before the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub(super) struct Corner {
    /// Place in the picture, pixels, times w.
    pub(super) x: f64,
    pub(super) y: f64,
    /// What runs linearly over the picture and grows with depth: see `planes`. Not a number where w is not 1.
    pub(super) rank: f64,
    pub(super) scalar: f64,
    pub(super) w: f64,
    /// Depth; mm before the eye plane.
    pub(super) z: f64,
}

impl Corner {
    /// Its place, rank and scalar.
    #[inline(always)]
    fn row(&self) -> [f64; 4] {
        [self.x, self.y, self.rank, self.scalar]
    }
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

    #[inline(always)]
    pub(super) fn size(&self) -> [usize; 2] {
        [0, 1].map(|a| usize::try_from(self.high[a] - self.low[a]).unwrap_or(0))
    }

    /// How many pixels.
    #[inline(always)]
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
    fn between(low: [f64; 2], high: [f64; 2]) -> Self {
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

    /// Adds what the rays of the first pixels of a list, as many as there are lanes, all of which pass, have of a cell.
    #[inline(always)]
    fn add_all<F: Four>(&mut self, list: &[u32], lanes: usize, passed: &Passed<F>) {
        let at = self.count.min(ROOM - LANES);
        let [front, back] = passed.depths;
        let [from, to] = passed.values;
        put(&mut self.fronts, at, front.to_array());
        put(&mut self.backs, at, back.to_array());
        put(&mut self.from, at, from.to_f32());
        put(&mut self.to, at, to.to_f32());
        if let Some(pixels) = list.first_chunk() {
            put(&mut self.pixels, at, *pixels);
        }
        self.count = at + lanes;
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

/// Writes a group into a list.
#[inline(always)]
fn put<T>(list: &mut [T; ROOM], at: usize, group: [T; LANES]) {
    if let Some(into) = list[at..].first_chunk_mut() {
        *into = group;
    }
}

/// A tetrahedron that may show.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(super) struct Shown {
    /// Numbers of its corners in its cluster.
    pub(super) corners: [u16; 4],
    pub(super) tetrahedron: u32,
    /// Depth of its nearest corner, or a little less; more only where that is too little for such a number, some 1e-45 mm.
    pub(super) nearest: f32,
    pub(super) reach: Rect,
}

/// A tetrahedron: its corners, in the order of their numbers, and its scalar where that is one for all of it.
pub(super) type Tetrahedron<'a> = ([&'a Corner; 4], Option<f64>);
