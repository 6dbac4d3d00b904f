//! The cells of a cluster before the camera: corners in the picture, and those cells that may show, roughly from front to
//! back. That is the same for any part of the picture, so that runs of cells are merged in one order everywhere.

use super::project::Frame;
use super::scan::{Corner, Rect};
use super::stats::Counts;
use crate::volume::cells::Place;

/// Steps of depth in which cells are told apart for going through them from front to back.
const STEPS: usize = 1024;

/// A tetrahedron that may show.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shown {
    pub(super) tetrahedron: u32,
    pub(super) reach: Rect,
    /// Depth of its nearest corner.
    pub(super) nearest: f64,
    /// Depths of all corners, added.
    depth: f64,
}

/// What of a cluster is before the camera.
#[derive(Debug, Default)]
pub(super) struct InView {
    pub(super) corners: Vec<Corner>,
    pub(super) cells: Vec<Shown>,
    /// Each tetrahedron's scalar, where it is constant within it: positions in the transfer function.
    pub(super) constants: Vec<f32>,
}

impl InView {
    /// Brings a cluster before the camera; counts what cannot show. What is in it is forgotten; `scratch` is for reuse.
    pub(super) fn fill(
        &mut self,
        frame: &Frame<'_>,
        cluster: usize,
        scratch: &mut Vec<Shown>,
        counts: &mut Counts,
    ) {
        if !frame.wide {
            self.fill_by(frame, cluster, scratch, counts);
            return;
        }
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
            fn wide(
                view: &mut InView,
                frame: &Frame<'_>,
                cluster: usize,
                scratch: &mut Vec<Shown>,
                counts: &mut Counts,
            ) {
                view.fill_by(frame, cluster, scratch, counts);
            }
            #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
            // SAFETY: `wide` is set only where these instructions were detected.
            unsafe {
                wide(self, frame, cluster, scratch, counts);
            }
        }
    }

    #[inline(always)]
    fn fill_by(&mut self, frame: &Frame<'_>, cluster: usize, scratch: &mut Vec<Shown>, counts: &mut Counts) {
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
            self.constants.extend(raw.iter().map(|&v| frame.table.position(v) as f32));
        }
        self.choose(frame, cluster, scratch, counts);
        self.put_in_order(scratch);
    }

    /// Decides which tetrahedra may show.
    #[inline(always)]
    fn choose(&self, frame: &Frame<'_>, cluster: usize, chosen: &mut Vec<Shown>, counts: &mut Counts) {
        chosen.clear();
        let picture = frame.rect();
        let of_points = frame.scalars.place() == Place::Points;
        let raw = frame.scalars.of(cluster);
        for (index, tetrahedron) in frame.clusters.tetrahedra(cluster).iter().enumerate() {
            let corners = tetrahedron.map(|v| &self.corners[v as usize]);
            let values = if of_points { tetrahedron.map(|v| raw[v as usize]) } else { [raw[index]; 4] };
            let sum: f64 = corners.iter().map(|c| c.x + c.y + c.z).sum::<f64>() + values.iter().sum::<f64>();
            if !sum.is_finite() {
                counts.not_finite += 1;
                continue;
            }
            let [mut low, mut high, mut nearest, mut farthest] =
                [values[0], values[0], corners[0].z, corners[0].z];
            for i in 1..4 {
                (low, high) = (low.min(values[i]), high.max(values[i]));
                (nearest, farthest) = (nearest.min(corners[i].z), farthest.max(corners[i].z));
            }
            if frame.skip_clear && frame.table.is_clear([low, high]) {
                counts.clear += 1;
                continue;
            }
            let reach = Rect::around(corners, &picture);
            if reach.is_empty() || farthest <= 0.0 {
                counts.outside += 1;
                continue;
            }
            let depth = (corners[0].z + corners[1].z) + (corners[2].z + corners[3].z);
            chosen.push(Shown { tetrahedron: index as u32, reach, nearest, depth });
        }
    }

    /// Puts what is chosen roughly in order of depth: most stretches then go on where the one before ended.
    #[inline(always)]
    fn put_in_order(&mut self, chosen: &[Shown]) {
        self.cells.clear();
        let Some(&any) = chosen.first() else { return };
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for shown in chosen {
            (low, high) = (low.min(shown.depth), high.max(shown.depth));
        }
        let scale = if high > low { STEPS as f64 / (high - low) } else { 0.0 };
        let step = |shown: &Shown| (((shown.depth - low) * scale) as usize).min(STEPS - 1);
        let mut begins = [0_u32; STEPS];
        for shown in chosen {
            begins[step(shown)] += 1;
        }
        let mut begin = 0;
        for count in &mut begins {
            (*count, begin) = (begin, begin + *count);
        }
        self.cells.resize(chosen.len(), any);
        for shown in chosen {
            let place = &mut begins[step(shown)];
            self.cells[*place as usize] = *shown;
            *place += 1;
        }
    }
}
