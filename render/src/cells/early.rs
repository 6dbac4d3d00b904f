//! Conservative subscreen termination: cells behind what is opaque enough are not scan-converted.
//!
//! The picture is cut into subscreens. Each knows whether all its pixels are *terminated*, having gathered an opacity of
//! the threshold, and the *deepest* of the depths at which they are. A cell whose subscreens all are, and whose nearest
//! point lies behind their deepest, adds at most 1 - threshold to any channel of any pixel, all such cells together, since
//! what is known to lie in front of them lets no more through.
//!
//! Source: Takayama, section 3. Differs: a cell may lie in several subscreens.

use super::scan::Rect;

/// When to give up what lies behind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Early {
    /// Opacity from which a pixel is terminated; 0 < threshold < 1. The picture differs from that without termination by at
    /// most 1 - threshold in every channel.
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
}

impl Default for Early {
    /// Off by at most 1/512, half of what 8 bits show.
    fn default() -> Self {
        Self { threshold: 1.0 - 1.0 / 512.0, subscreens: None, refreshes: 100 }
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
    /// Depth from which each pixel is terminated; infinite where it is not.
    pixels: Vec<f64>,
    /// The deepest of a subscreen; infinite where a pixel of it is not terminated.
    deepest: Vec<f64>,
    /// Subscreens with a pixel that has changed since.
    stale: Vec<bool>,
}

impl Table {
    /// A table of subscreens of `side` pixels of a part of the picture, whose pixels it counts.
    pub(super) fn new(rect: &Rect, side: usize) -> Self {
        let size = rect.size();
        let [across, down] = size.map(|n| n.div_ceil(side));
        Self {
            low: rect.low,
            size,
            side,
            across,
            pixels: vec![f64::INFINITY; size[0] * size[1]],
            deepest: vec![f64::INFINITY; across * down],
            stale: vec![false; across * down],
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
            let [x, y] = [pixel % self.size[0] / self.side, pixel / self.size[0] / self.side];
            self.stale[y * self.across + x] = true;
        }
    }

    /// Whether nothing of a rectangle within it that lies behind a depth can be seen.
    pub(super) fn hides(&self, rect: &Rect, nearest: f64) -> bool {
        let place = |axis: usize, v: i32| (v - self.low[axis]) as usize / self.side;
        let [x0, y0] = [0, 1].map(|axis| place(axis, rect.low[axis]));
        let [x1, y1] = [0, 1].map(|axis| place(axis, rect.high[axis] - 1));
        (y0..=y1).all(|y| (x0..=x1).all(|x| self.deepest[y * self.across + x] < nearest))
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
                nearer.push((index as u32, deepest));
            }
        }
        nearer
    }

    /// Takes over that a subscreen is terminated elsewhere.
    pub(super) fn learn(&mut self, index: u32, deepest: f64) {
        if let Some(own) = self.deepest.get_mut(index as usize) {
            *own = own.min(deepest);
        }
    }
}
