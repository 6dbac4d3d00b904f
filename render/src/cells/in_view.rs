//! The cells of a cluster before the camera: corners in the picture, and those cells that may show, roughly from front to
//! back. That is the same for any part of the picture, so that runs of cells are merged in one order everywhere.

use super::project::Frame;
use super::scan::{Cells, Corner, NEXT, Rect, Shown};
use super::stats::Counts;
#[cfg(target_arch = "x86_64")]
use crate::simd::WideFour;
use crate::simd::{Four, PlainFour};
use crate::volume::cells::Place;

/// Steps of depth in which cells are told apart for going through them from front to back.
const STEPS: usize = 1024;

/// Cells that may show, while a cluster is brought before the camera.
#[derive(Debug, Default)]
pub(super) struct Chosen {
    cells: Vec<Shown>,
    /// Of each, the depths of its corners, added.
    depths: Vec<f64>,
    /// And its step of depth.
    steps: Vec<i32>,
}

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
        scratch: &mut Chosen,
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
                scratch: &mut Chosen,
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
        scratch: &mut Chosen,
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
        let depths = self.choose::<F>(frame, cluster, scratch, counts);
        self.put_in_order::<F>(scratch, depths);
    }

    /// Decides which tetrahedra may show. The least and the most depth of these.
    #[inline(always)]
    fn choose<F: Four>(
        &self,
        frame: &Frame<'_>,
        cluster: usize,
        chosen: &mut Chosen,
        counts: &mut Counts,
    ) -> [f64; 2] {
        chosen.cells.clear();
        chosen.depths.clear();
        let picture = frame.rect();
        let first = picture.low.map(f64::from);
        let last = picture.high.map(|v| f64::from(v) - 1.0);
        let first = F::from_array([first[0], first[1], f64::NEG_INFINITY, f64::NEG_INFINITY]);
        let last = F::from_array([last[0], last[1], f64::INFINITY, f64::INFINITY]);
        let one = F::all(1.0);
        let of_points = frame.scalars.place() == Place::Points;
        let raw = frame.scalars.of(cluster);
        let some_clear = frame.skip_clear && frame.table.has_clear(frame.scalars.range(cluster));
        let (mut near, mut far) = (F::all(f64::INFINITY), F::all(f64::NEG_INFINITY));
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
            if some_clear && frame.table.is_clear(range(values)) {
                counts.clear += 1;
                continue;
            }
            let (least, most) = (p.least(q).least(r.least(s)), p.most(q).most(r.most(s)));
            let ([_, _, least_w, nearest], [_, _, most_w, farthest]) = (least.to_array(), most.to_array());
            let reach = if least_w == 1.0 && most_w == 1.0 {
                // Within the picture there are whole numbers for all; a pixel more where a place is rounded to it does no harm.
                let [left, top, ..] = (least.most(first).least(last + one) + F::all(NEXT)).to_whole();
                let [right, bottom, ..] = (most.most(first - one).least(last) + one).to_whole();
                Rect { low: [left, top], high: [right, bottom] }
            } else {
                picture
            };
            if reach.is_empty() || farthest <= 0.0 {
                counts.outside += 1;
                continue;
            }
            (near, far) = (near.least(least), far.most(most));
            let nearest = ((nearest - nearest.abs() * f64::from(f32::EPSILON)) as f32).min(f32::MAX);
            chosen.cells.push(Shown { corners: *tetrahedron, tetrahedron: index as u32, nearest, reach });
            chosen.depths.push(depth);
        }
        [near.to_array()[3], far.to_array()[3]]
    }

    /// Puts what is chosen roughly in order of depth, which lies between two: most stretches then go on where the one before
    /// ended.
    #[inline(always)]
    fn put_in_order<F: Four>(&mut self, chosen: &mut Chosen, [near, far]: [f64; 2]) {
        self.cells.clear();
        let Chosen { cells, depths, steps } = chosen;
        let Some(&any) = cells.first() else { return };
        let (low, high) = (4.0 * near, 4.0 * far);
        let scale = F::all(if high > low { STEPS as f64 / (high - low) } else { 0.0 });
        let last = F::all((STEPS - 1) as f64);
        steps.clear();
        let count = depths.len();
        depths.resize(count.next_multiple_of(4), 0.0);
        for depths in depths.as_chunks().0 {
            let step = (F::from_array(*depths) - F::all(low)) * scale;
            steps.extend_from_slice(&step.most(F::all(0.0)).least(last).to_whole());
        }
        let mut begins = [0_u32; STEPS];
        for &step in &steps[..count] {
            begins[step as usize % STEPS] += 1;
        }
        let mut begin = 0;
        for count in &mut begins {
            (*count, begin) = (begin, begin + *count);
        }
        self.cells.resize(count, any);
        for (&shown, &step) in cells.iter().zip(&*steps) {
            let place = &mut begins[step as usize % STEPS];
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

/// The least and the greatest of numbers.
#[inline(always)]
fn range([a, b, c, d]: [f64; 4]) -> [f64; 2] {
    let least = |a: f64, b: f64| if a < b { a } else { b };
    let most = |a: f64, b: f64| if a > b { a } else { b };
    [least(least(a, b), least(c, d)), most(most(a, b), most(c, d))]
}
