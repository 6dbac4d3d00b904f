//! Volumes that are not integrated: the greatest value on the ray, and the surface of one value. Each becomes
//! crossings, as those of meshes.

use super::cubic::Cubic;
use super::painting::paint;
use super::piece::{Placed, Stretches};
use super::shine::shine;
use super::surfaces::Hit;
use super::walker::{Ray, Walker};
use crate::scene::VolumeMode;
use crate::volume::Transfer;

/// A volume in one of these modes, with its pieces before the camera.
#[derive(Debug)]
pub(super) struct Layered<'a> {
    pub(super) mode: VolumeMode,
    pub(super) transfer: &'a Transfer,
    /// Value of a stored number: slope and intercept.
    pub(super) rescale: [f64; 2],
    pub(super) pieces: Vec<Placed<'a>>,
}

/// The greatest value so far: where it is, in which piece, and where the volume is entered first.
struct Most<'p, 'a> {
    value: f64,
    at: Option<(f32, &'p Placed<'a>)>,
    entry: f32,
}

impl Layered<'_> {
    /// Appends the crossings of a ray.
    pub(super) fn hits(&self, lens: [f64; 2], ray: &Ray, stretches: &mut Stretches, into: &mut Vec<Hit>) {
        let mut most = Most { value: f64::NEG_INFINITY, at: None, entry: f32::INFINITY };
        for piece in &self.pieces {
            piece.stretches(lens, [-piece.near_mm, f64::INFINITY], stretches);
            for &[from, to] in &*stretches {
                let (from, to) = (from as f32, to as f32);
                let walker = Walker::new(piece, lens, from);
                match self.mode {
                    VolumeMode::Isosurface { value, opacity } => {
                        self.surface(walker, [from, to], [value, opacity], lens, ray, into);
                    }
                    _ => self.greatest(walker, piece, [from, to], &mut most),
                }
            }
        }
        if let Some((zeta, piece)) = most.at {
            let [r, g, b, opacity] = self.transfer.rgba(most.value);
            let color = painted(piece, lens, zeta, [r, g, b]);
            into.push(Hit::layer(most.entry, color, opacity as f32));
        }
    }

    /// The scalar along the walker's cell from `from` to `to`.
    fn cubic(&self, walker: &Walker<'_>, [from, to]: [f32; 2]) -> Cubic {
        let [slope, intercept] = self.rescale;
        let value = |part: f32| slope * f64::from(walker.number_at(from + (to - from) * part)) + intercept;
        Cubic::through([value(0.0), value(1.0 / 3.0), value(2.0 / 3.0), value(1.0)])
    }

    fn greatest<'p, 'a>(
        &self,
        mut walker: Walker<'_>,
        piece: &'p Placed<'a>,
        [from, to]: [f32; 2],
        most: &mut Most<'p, 'a>,
    ) where
        'a: 'p,
    {
        let [slope, intercept] = self.rescale;
        let mut at = from;
        most.entry = most.entry.min(from);
        loop {
            let end = walker.exit.min(to);
            if !walker.clear && end >= at {
                let [low, high] = walker.corner_range().map(|v| slope * f64::from(v) + intercept);
                if low.max(high) > most.value {
                    let (value, u) = self.cubic(&walker, [at, end]).most();
                    if value > most.value {
                        (most.value, most.at) = (value, Some((at + (end - at) * u as f32, piece)));
                    }
                }
            }
            if walker.exit >= to {
                return;
            }
            at = at.max(end);
            walker.advance();
        }
    }

    /// The side is carried from cell to cell, so that a crossing in a wall is found once.
    fn surface(
        &self,
        mut walker: Walker<'_>,
        [from, to]: [f32; 2],
        [level, opacity]: [f64; 2],
        lens: [f64; 2],
        ray: &Ray,
        into: &mut Vec<Hit>,
    ) {
        let [slope, intercept] = self.rescale;
        let [r, g, b, _] = self.transfer.rgba(level);
        let mut found = |walker: &Walker<'_>, zeta: f32| {
            let mut color = painted(walker.piece(), lens, zeta, [r, g, b]);
            if let Some(facing) = walker.facing(zeta, ray) {
                let [shade, highlight] = shine(facing);
                color = color.map(|c| (c * shade + highlight).clamp(0.0, 1.0));
            }
            into.push(Hit::layer(zeta, color, opacity as f32));
        };
        let mut at = from;
        let mut below = None;
        loop {
            let end = walker.exit.min(to);
            if walker.clear {
                below = None;
            } else if end >= at {
                let [low, high] = walker.corner_range().map(|v| slope * f64::from(v) + intercept - level);
                let (low, high) = (low.min(high), low.max(high));
                let meets = low < 0.0 && high >= 0.0;
                let cubic = meets.then(|| self.cubic(&walker, [at, end]).above(level));
                let sides = cubic.map_or([high < 0.0; 2], |c| [c.at(0.0) < 0.0, c.at(1.0) < 0.0]);
                if below.is_some_and(|b| b != sides[0]) {
                    found(&walker, at);
                }
                if let Some(cubic) = cubic {
                    cubic.crossings(|u| found(&walker, at + (end - at) * u as f32));
                }
                below = Some(sides[1]);
            }
            if walker.exit >= to {
                return;
            }
            at = at.max(end);
            walker.advance();
        }
    }
}

/// The colour under the label there.
fn painted(piece: &Placed<'_>, lens: [f64; 2], zeta: f32, [r, g, b]: [f64; 3]) -> [f32; 3] {
    let mut color = [r as f32, g as f32, b as f32, 1.0];
    if let Some(painting) = &piece.painting
        && let Some(over) = painting.color_at(&painting.line(lens), zeta)
    {
        paint(&mut color, 1.0, over);
    }
    [color[0], color[1], color[2]]
}
