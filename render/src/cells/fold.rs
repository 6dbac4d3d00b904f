//! From what a ray has of cells to segments: integrated, put in order of depth and merged where they meet.

use std::cmp::Ordering;

use super::scan::Raw;
use super::stats::Counts;
use super::table::{Place, Table, opacity};
use super::worker::RowSegments;

/// A stretch of a pixel's ray with what is seen of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// Depth where it begins: millimetres before the eye plane, along the view (not along the ray).
    pub front: f64,
    /// Depth where it ends.
    pub back: f64,
    /// Red, green, blue, premultiplied, and opacity; 0 to 1.
    pub rgba: [f32; 4],
}

/// So many are put in order by moving each to its place.
const FEW: usize = 48;
/// Opacity from which on a segment's optical depth is no more told apart: that of 16.
const OPAQUE: f32 = 1.0 - 1e-7;

impl Segment {
    /// By depth, and where that is one by all the rest: the same for any order that segments were found in.
    pub(super) fn order(&self, other: &Self) -> Ordering {
        let rest = |s: &Self| s.rgba.map(f32::to_bits);
        self.front
            .total_cmp(&other.front)
            .then_with(|| self.back.total_cmp(&other.back))
            .then_with(|| rest(self).cmp(&rest(other)))
    }

    /// Optical depth times colour, and optical depth.
    fn depth(&self) -> [f64; 4] {
        let opacity = self.rgba[3].min(OPAQUE);
        if opacity <= 0.0 {
            return [0.0; 4];
        }
        let tau = -f64::from(-opacity).ln_1p();
        let part = tau / f64::from(self.rgba[3]);
        let [r, g, b, _] = self.rgba.map(|v| f64::from(v) * part);
        [r, g, b, tau]
    }
}

/// Colour, premultiplied, and opacity of an optical depth, given with its product with colour.
fn seen(depth: [f64; 4]) -> [f32; 4] {
    let depth = depth.map(|d| d as f32);
    if depth[3] <= 0.0 {
        return [0.0; 4];
    }
    let opacity = opacity(depth[3]);
    let part = opacity / depth[3];
    [depth[0] * part, depth[1] * part, depth[2] * part, opacity]
}

/// Puts `behind` under what is seen so far.
#[inline(always)]
pub(super) fn under(seen: &mut [f32; 4], behind: [f32; 4]) {
    let through = 1.0 - seen[3];
    for c in 0..4 {
        seen[c] += through * behind[c];
    }
}

/// Puts what a ray has of cells in order of depth, the same for any order it was found in.
#[inline(always)]
pub(super) fn sort(raws: &mut [Raw]) {
    sort_by(raws, is_before);
}

/// The same of segments, by [`Segment::order`].
#[inline(always)]
pub(super) fn put_in_order(segments: &mut [Segment]) {
    sort_by(segments, |a, b| if a.front == b.front { a.order(b).is_lt() } else { a.front < b.front });
}

/// Puts a list in order, of which much is in order already.
#[inline(always)]
fn sort_by<T: Copy>(list: &mut [T], is_before: impl Fn(&T, &T) -> bool) {
    if list.len() > FEW {
        list.sort_unstable_by(|a, b| {
            let before = |a, b| if is_before(a, b) { Ordering::Less } else { Ordering::Equal };
            before(a, b).then_with(|| before(b, a).reverse())
        });
        return;
    }
    for i in 1..list.len() {
        let one = list[i];
        let mut at = i;
        while at > 0 && is_before(&one, &list[at - 1]) {
            list[at] = list[at - 1];
            at -= 1;
        }
        list[at] = one;
    }
}

#[inline(always)]
fn is_before(a: &Raw, b: &Raw) -> bool {
    if a.front != b.front {
        return a.front < b.front;
    }
    let rest = |r: &Raw| (r.back.to_bits(), r.values.map(f32::to_bits));
    // Depths are not negative: their bits are in their order.
    rest(a) < rest(b)
}

/// Integrates what a ray has of cells, in their order; `stretch` is mm for one of depth.
#[inline(always)]
pub(super) fn integrate(raws: &[Raw], table: &Table, stretch: f64, into: &mut Vec<Segment>) {
    let mut last = Place::NOWHERE;
    for raw in raws {
        let from = table.at(raw.values[0], &last);
        last = table.at(raw.values[1], &from);
        let rgba = table.segment(&from, &last, length(raw.back - raw.front, stretch));
        into.push(Segment { front: raw.front, back: raw.back, rgba });
    }
}

/// Millimetres of a stretch of depth; beyond this much all is opaque or clear.
#[inline(always)]
pub(super) fn length(depth: f64, stretch: f64) -> f32 {
    (depth * stretch).min(1e20) as f32
}

/// Whether segments in order overlap.
#[inline(always)]
pub(super) fn overlap(segments: &[Segment]) -> bool {
    segments.windows(2).any(|pair| pair[1].front < pair[0].back)
}

/// Replaces segments that overlap by segments that do not: where several are, their optical depths add up and colours are
/// weighted by them, each taken as the same all along.
pub(super) fn add_up(segments: &[Segment]) -> Vec<Segment> {
    // Rates of what begins and ends, by depth; in the order of the segments where depths are one.
    let mut changes: Vec<(f64, bool, [f64; 4])> = Vec::with_capacity(2 * segments.len());
    for s in segments {
        let length = s.back - s.front;
        let rate = s.depth().map(|d| d / length);
        changes.push((s.front, true, rate));
        changes.push((s.back, false, rate));
    }
    changes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut apart = Vec::with_capacity(changes.len());
    let (mut open, mut rate, mut at) = (0_usize, [0.0_f64; 4], f64::NEG_INFINITY);
    for (depth, begins, of) in changes {
        if depth > at && open > 0 {
            let rgba = seen(rate.map(|r| (r * (depth - at)).max(0.0)));
            apart.push(Segment { front: at, back: depth, rgba });
        }
        at = depth;
        if begins {
            open += 1;
            rate = std::array::from_fn(|c| rate[c] + of[c]);
        } else {
            open = open.saturating_sub(1);
            // What rounding left does not stay.
            rate = if open == 0 { [0.0; 4] } else { std::array::from_fn(|c| rate[c] - of[c]) };
        }
    }
    apart
}

/// Merges segments that meet, front to back.
#[inline(always)]
pub(super) fn merge(segments: &[Segment], mut done: impl FnMut(Segment)) {
    let mut rest = segments.iter();
    let Some(mut run) = rest.next().copied() else { return };
    for next in rest {
        if next.front == run.back {
            under(&mut run.rgba, next.rgba);
            run.back = next.back;
        } else {
            done(run);
            run = *next;
        }
    }
    done(run);
}

/// Composites the segments of a pixel, those of the nearest clusters first, and puts them in order; `kept` gets its runs.
#[inline(always)]
pub(super) fn composite(
    list: &mut [Segment],
    mut kept: Option<&mut RowSegments>,
    counts: &mut Counts,
) -> [f32; 4] {
    let apart;
    // What comes one behind the other is in order.
    let list = if overlap(list) {
        put_in_order(list);
        if overlap(list) {
            counts.overlapping_pixels += 1;
            apart = add_up(list);
            &apart[..]
        } else {
            list
        }
    } else {
        list
    };
    let mut color = [0.0; 4];
    let mut runs = 0;
    merge(list, |run| {
        under(&mut color, run.rgba);
        if let Some(row) = &mut kept {
            row.segments.push(run);
            runs += 1;
        }
    });
    if let Some(row) = kept {
        row.counts.push(runs);
    }
    color
}
