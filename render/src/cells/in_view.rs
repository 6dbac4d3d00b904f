//! The cells of a cluster before the camera: corners in the picture, and those cells that may show, roughly from front to
//! back. That is the same for any part of the picture, so that runs of cells are merged in one order everywhere.

use super::project::Frame;
use super::scan::{Cells, Corner, Rect, Shown};
use super::stats::Counts;
#[cfg(target_arch = "x86_64")]
use crate::simd::WideFour;
use crate::simd::{Four, PlainFour};
use crate::volume::cells::Place;

/// Steps of depth in which cells are told apart for going through them from front to back.
const STEPS: usize = 1024;

/// One with the depths of its corners, added.
pub(super) type Chosen = (Shown, f64);

/// What of a cluster is before the camera.
#[derive(Debug, Default)]
pub(super) struct InView {
    pub(super) corners: Vec<Corner>,
    pub(super) cells: Vec<Shown>,
    /// Each tetrahedron's scalar, where it is constant within it: positions in the transfer function.
    pub(super) constants: Vec<f64>,
}

impl InView {
    /// Some of the cells, for scan conversion.
    #[inline(always)]
    pub(super) fn cells<'a>(&'a self, shown: &'a [Shown]) -> Cells<'a> {
        Cells { corners: &self.corners, constants: &self.constants, shown }
    }

    /// Brings a cluster before the camera; counts what cannot show. What is in it is forgotten; `scratch` is for reuse.
    pub(super) fn fill(
        &mut self,
        frame: &Frame<'_>,
        cluster: usize,
        scratch: &mut Vec<Chosen>,
        counts: &mut Counts,
    ) {
        if !frame.wide {
            self.fill_by::<PlainFour>(frame, cluster, scratch, counts);
            return;
        }
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
            fn wide(
                view: &mut InView,
                frame: &Frame<'_>,
                cluster: usize,
                scratch: &mut Vec<Chosen>,
                counts: &mut Counts,
            ) {
                view.fill_by::<WideFour>(frame, cluster, scratch, counts);
            }
            #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
            // SAFETY: `wide` is set only where these instructions were detected.
            unsafe {
                wide(self, frame, cluster, scratch, counts);
            }
        }
    }

    #[inline(always)]
    fn fill_by<F: Four>(
        &mut self,
        frame: &Frame<'_>,
        cluster: usize,
        scratch: &mut Vec<Chosen>,
        counts: &mut Counts,
    ) {
        let of_points = frame.scalars.place() == Place::Points;
        let raw = frame.scalars.of(cluster);
        let points = frame.clusters.points(cluster).iter();
        self.corners.clear();
        self.constants.clear();
        if of_points {
            let points = points.zip(raw);
            self.corners.extend(points.map(|(p, &v)| frame.lens.corner(p, frame.table.position(v))));
        } else {
            self.corners.extend(points.map(|p| frame.lens.corner(p, 0.0)));
            self.constants.extend(raw.iter().map(|&v| frame.table.position(v)));
        }
        self.choose::<F>(frame, cluster, scratch, counts);
        self.put_in_order(scratch);
    }

    /// Decides which tetrahedra may show.
    #[inline(always)]
    fn choose<F: Four>(
        &self,
        frame: &Frame<'_>,
        cluster: usize,
        chosen: &mut Vec<Chosen>,
        counts: &mut Counts,
    ) {
        chosen.clear();
        let picture = frame.rect();
        let of_points = frame.scalars.place() == Place::Points;
        let raw = frame.scalars.of(cluster);
        for (index, tetrahedron) in frame.clusters.tetrahedra(cluster).iter().enumerate() {
            let [p, q, r, s] = tetrahedron.map(usize::from);
            let values = if of_points { [raw[p], raw[q], raw[r], raw[s]] } else { [raw[index]; 4] };
            let (p, q) = (place::<F>(&self.corners[p]), place::<F>(&self.corners[q]));
            let (r, s) = (place::<F>(&self.corners[r]), place::<F>(&self.corners[s]));
            let [x, y, w, depth] = ((p + q) + (r + s)).to_array();
            let sum = ((x + y) + (w + depth)) + ((values[0] + values[1]) + (values[2] + values[3]));
            if !sum.is_finite() {
                counts.not_finite += 1;
                continue;
            }
            if frame.skip_clear && frame.table.is_clear(range(values)) {
                counts.clear += 1;
                continue;
            }
            let [left, top, least_w, nearest] = p.least(q).least(r.least(s)).to_array();
            let [right, bottom, most_w, farthest] = p.most(q).most(r.most(s)).to_array();
            let reach = if least_w == 1.0 && most_w == 1.0 {
                Rect::between([left, top], [right, bottom]).meet(&picture)
            } else {
                picture
            };
            if reach.is_empty() || farthest <= 0.0 {
                counts.outside += 1;
                continue;
            }
            let nearest = (nearest as f32).next_down();
            chosen.push((Shown { corners: *tetrahedron, tetrahedron: index as u32, nearest, reach }, depth));
        }
    }

    /// Puts what is chosen roughly in order of depth: most stretches then go on where the one before ended.
    #[inline(always)]
    fn put_in_order(&mut self, chosen: &[Chosen]) {
        self.cells.clear();
        let Some(&(any, _)) = chosen.first() else { return };
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &(_, depth) in chosen {
            (low, high) = (low.min(depth), high.max(depth));
        }
        let scale = if high > low { STEPS as f64 / (high - low) } else { 0.0 };
        let step = |depth: f64| (((depth - low) * scale) as usize).min(STEPS - 1);
        let mut begins = [0_u32; STEPS];
        for &(_, depth) in chosen {
            begins[step(depth)] += 1;
        }
        let mut begin = 0;
        for count in &mut begins {
            (*count, begin) = (begin, begin + *count);
        }
        self.cells.resize(chosen.len(), any);
        for &(shown, depth) in chosen {
            let place = &mut begins[step(depth)];
            self.cells[*place as usize] = shown;
            *place += 1;
        }
    }
}

/// Place of a corner, w and depth.
#[inline(always)]
fn place<F: Four>(corner: &Corner) -> F {
    F::from_array([corner.x, corner.y, corner.w, corner.z])
}

/// The least and the greatest.
#[inline(always)]
fn range([a, b, c, d]: [f64; 4]) -> [f64; 2] {
    [a.min(b).min(c.min(d)), a.max(b).max(c.max(d))]
}
