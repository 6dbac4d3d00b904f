//! Conservative subscreen termination: cells behind what is opaque enough are not scan-converted.
//!
//! The picture is cut into subscreens. Each knows whether all its pixels are *terminated*, having gathered an opacity of
//! the threshold, and the *deepest* of the depths at which they are. A cell whose subscreens all are, and whose nearest
//! point lies behind their deepest, adds at most 1 - threshold to any channel of any pixel, all such cells together, since
//! what is known to lie in front of them lets no more through. Half of what may be missing is put in its place: that is off by
//! no more than the other half.
//!
//! Source: Takayama, section 3. Differs: a cell may lie in several subscreens; the half that is put in.

use super::fold::Segment;
use super::runs::Run;
use super::scan::Rect;

/// Where a pixel lets less through, or less than twice what terminates it, some may be soon; none is before.
const SOON: f32 = 0.1;

/// When to give up what lies behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Early {
    /// Opacity from which a pixel is terminated; 0 < threshold < 1. The picture differs from that without termination by at
    /// most (1 - threshold) / 2 in every channel, and rounding in single precision: under 1e-5.
    pub threshold: f64,
    /// Into how many subscreens the longer side of the picture is cut; where none is given, such that they are as large as
    /// cells are in the picture.
    pub subscreens: Option<u32>,
    /// The table is brought up to date each time one part in so many of the remaining cells is done; > 0.
    pub refreshes: u32,
}

impl Early {
    /// As in the paper, for comparing: a threshold of 0.9, 20 subscreens.
    pub const TAKAYAMA: Self = Self { threshold: 0.9, subscreens: Some(20), refreshes: 100 };

    /// Adds half of what may lie behind a pixel that something may have been left out of, if that is terminated; `most` is the
    /// most that a colour has there. It is no segment: these do not add up to it.
    #[inline]
    pub(super) fn complete(&self, color: &mut [f32; 4], most: [f32; 3]) {
        // What made its opacity known was put together in another order: rounding must not leave a pixel out.
        const ROUNDING: f64 = 1e-5;
        if f64::from(color[3]) >= self.threshold - ROUNDING {
            let half = 0.5 * (1.0 - color[3]).max(0.0);
            let [r, g, b] = most.map(|most| half * most);
            *color = [color[0] + r, color[1] + g, color[2] + b, color[3] + half];
        }
    }
}

impl Default for Early {
    /// Off by at most 1/512, half of what 8 bits show.
    fn default() -> Self {
        Self { threshold: 1.0 - 1.0 / 256.0, subscreens: None, refreshes: 100 }
    }
}

/// The table of one worker, and the depth at which each pixel is terminated.
#[derive(Debug)]
pub(super) struct Table {
    /// Of the picture that it is about.
    low: [i32; 2],
    size: [usize; 2],
    /// Pixels that a subscreen is wide and high.
    side: usize,
    across: usize,
    /// Of each column of pixels, which column of subscreens it is of; of each row, where its row of these begins.
    columns: Vec<u32>,
    rows: Vec<u32>,
    /// Depth from which each pixel is terminated; infinite where it is not.
    pixels: Vec<f64>,
    /// The deepest of a subscreen; infinite where a pixel of it is not terminated.
    deepest: Vec<f64>,
    /// Subscreens with a pixel that has changed since.
    stale: Vec<bool>,
    /// The least of the deepest.
    first: f64,
}

impl Table {
    /// A table of subscreens of `side` pixels of a part of the picture, whose pixels it counts.
    pub(super) fn new(rect: &Rect, side: usize) -> Self {
        let size = rect.size();
        let [across, down] = size.map(|n| n.div_ceil(side));
        let part = |count: usize, across: usize| (0..count).map(|v| (v / side * across) as u32).collect();
        Self {
            low: rect.low,
            size,
            side,
            across,
            columns: part(size[0], 1),
            rows: part(size[1], across),
            pixels: vec![f64::INFINITY; size[0] * size[1]],
            deepest: vec![f64::INFINITY; across * down],
            stale: vec![false; across * down],
            first: f64::INFINITY,
        }
    }

    /// Depth from which a pixel is terminated.
    pub(super) fn pixel(&self, pixel: usize) -> f64 {
        self.pixels[pixel]
    }

    /// Notes that a pixel is terminated from a depth on.
    pub(super) fn terminate(&mut self, pixel: usize, depth: f64) {
        if depth < self.pixels[pixel] {
            self.pixels[pixel] = depth;
            let [x, y] = [pixel % self.size[0], pixel / self.size[0]];
            self.stale[(self.rows[y] + self.columns[x]) as usize] = true;
        }
    }

    /// Whether nothing of a rectangle within it that lies behind a depth can be seen.
    #[inline]
    pub(super) fn hides(&self, rect: &Rect, nearest: f64) -> bool {
        if nearest <= self.first {
            return false;
        }
        let at = |of: &[u32], v: i32, axis: usize| of[(v - self.low[axis]) as usize] as usize;
        let [left, right] = [rect.low[0], rect.high[0] - 1].map(|x| at(&self.columns, x, 0));
        let [top, bottom] = [rect.low[1], rect.high[1] - 1].map(|y| at(&self.rows, y, 1));
        let far = |row: usize| self.deepest[row + left].max(self.deepest[row + right]);
        if far(top).max(far(bottom)) >= nearest {
            return false;
        }
        // Most reach no further.
        if right - left < 2 && bottom - top < 2 * self.across {
            return true;
        }
        let mut rows = (top..=bottom).step_by(self.across);
        rows.all(|row| self.deepest[row + left..=row + right].iter().all(|&deepest| deepest < nearest))
    }

    /// Brings the table up to date; gives the subscreens that are terminated nearer than before.
    pub(super) fn refresh(&mut self) -> Vec<(u32, f64)> {
        let mut nearer = Vec::new();
        for index in 0..self.deepest.len() {
            if !std::mem::take(&mut self.stale[index]) {
                continue;
            }
            let [x, y] = [index % self.across * self.side, index / self.across * self.side];
            let rows = y..(y + self.side).min(self.size[1]);
            let columns = x..(x + self.side).min(self.size[0]);
            let deepest = rows
                .flat_map(|row| &self.pixels[row * self.size[0]..][columns.clone()])
                .fold(0.0, |deepest: f64, &depth| deepest.max(depth));
            if deepest < self.deepest[index] {
                self.deepest[index] = deepest;
                self.first = self.first.min(deepest);
                nearer.push((index as u32, deepest));
            }
        }
        nearer
    }

    /// Takes over that a subscreen is terminated elsewhere.
    pub(super) fn learn(&mut self, index: u32, deepest: f64) {
        if let Some(own) = self.deepest.get_mut(index as usize) {
            *own = own.min(deepest);
            self.first = self.first.min(deepest);
        }
    }
}

/// What is terminated of a rectangle while it is drawn, cluster by cluster.
#[derive(Debug)]
pub(super) struct Ending {
    threshold: f32,
    table: Table,
    /// What comes through all that is known of each pixel, and how deep that reaches.
    known: Vec<(f32, f64)>,
    /// The least that comes through of any.
    least: f32,
    lacks: bool,
}

impl Ending {
    /// Of subscreens of `side` pixels.
    pub(super) fn new(rect: &Rect, side: usize, threshold: f64) -> Self {
        let known = vec![(1.0, 0.0); rect.area()];
        Self { threshold: threshold as f32, table: Table::new(rect, side), known, least: 1.0, lacks: false }
    }

    /// Whether nothing of a rectangle that lies behind a depth can be seen; then it is left out.
    pub(super) fn hides(&mut self, rect: &Rect, nearest: f64) -> bool {
        let hides = self.table.hides(rect, nearest);
        self.lacks |= hides;
        hides
    }

    /// Whether some pixels are terminated, or may be soon; before that nothing is hidden.
    pub(super) fn is_near(&self) -> bool {
        self.least <= SOON.max(2.0 * (1.0 - self.threshold))
    }

    /// Whether something was left out.
    pub(super) fn lacks(&self) -> bool {
        self.lacks
    }

    /// Brings the table up to date.
    pub(super) fn refresh(&mut self) {
        self.table.refresh();
    }

    /// Takes in a run of a pixel.
    pub(super) fn add(&mut self, pixel: usize, run: &Segment) {
        let (through, reach) = &mut self.known[pixel];
        *through *= 1.0 - run.rgba[3];
        self.least = self.least.min(*through);
        *reach = reach.max(run.back);
        if 1.0 - *through >= self.threshold {
            self.table.terminate(pixel, *reach);
        }
    }

    /// Takes a look at runs that are not finished, of the pixels of a tile within the rectangle.
    pub(super) fn look_at(&mut self, [rect, tile]: [&Rect; 2], runs: &[Run]) {
        let [across, _] = tile.size();
        for (y, runs) in (tile.low[1]..tile.high[1]).zip(runs.chunks_exact(across)) {
            let first = rect.number([tile.low[0], y]);
            for ((pixel, &(through, reach)), Run(run)) in (first..).zip(&self.known[first..]).zip(runs) {
                // Where there is no run its depth is not a number.
                if 1.0 - through * (1.0 - run.rgba[3]) >= self.threshold {
                    self.table.terminate(pixel, reach.max(run.back));
                }
            }
        }
        self.table.refresh();
    }
}
