//! Where along its normal a thick section takes its values.

use super::{Section, SlabMode};
use crate::volume::{Affine, Point};

/// A plane parallel to the section's in which values are taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Station {
    /// From the section's plane, along its normal; mm.
    pub(super) offset_mm: f64,
    /// The length that it stands for; mm.
    pub(super) weight: f64,
}

/// Off an axis or a plane by less than this part of a voxel over a whole voxel counts as on it.
const ALIGNED: f64 = 1e-9;
/// The ends of a slab keep this far, in voxels, from the faces of the data, so that rounding leaves none outside.
const WITHIN: f64 = 1e-9;

/// The stations of a section in a grid of `extent` samples. A thin section has one.
pub(super) fn stations(section: &Section, voxel_from_world: &Affine, extent: [usize; 3]) -> Vec<Station> {
    let thickness_mm = section.slab.thickness_mm;
    if thickness_mm == 0.0 {
        return vec![Station { offset_mm: 0.0, weight: 1.0 }];
    }
    match aligned_axis(section, voxel_from_world) {
        Some(axis) => exact(section, voxel_from_world, axis, extent[axis]),
        None => even(section, voxel_from_world, extent),
    }
}

/// The voxel axis that the section's normal runs along, if the other two lie in its plane.
fn aligned_axis(section: &Section, voxel_from_world: &Affine) -> Option<usize> {
    let [normal, right, down] =
        [section.forward(), section.right, section.down].map(|v| voxel_from_world.vector(&v));
    let axis = normal.iamax();
    let others = (0..3).filter(|&a| a != axis).all(|a| normal[a].abs() <= ALIGNED * normal[axis].abs());
    let flat = [right, down].iter().all(|v| v[axis].abs() <= ALIGNED * v.amax());
    (others && flat).then_some(axis)
}

/// At the voxel centres and the slab's ends, with the weights of the trapezoid rule: exact for what is linear
/// between them, and greatest and least values are at one of them.
fn exact(section: &Section, voxel_from_world: &Affine, axis: usize, n: usize) -> Vec<Station> {
    let middle = voxel_from_world.point(&section.centre)[axis];
    let per_mm = voxel_from_world.vector(&section.forward())[axis];
    let half = 0.5 * section.slab.thickness_mm * per_mm.abs();
    let (low, high) = ((middle - half).max(-0.5 + WITHIN), (middle + half).min(n as f64 - 0.5 - WITHIN));
    if low > high {
        return Vec::new();
    }
    let mut places = vec![low];
    let mut knot = low.floor() + 1.0;
    while knot < high {
        places.push(knot);
        knot += 1.0;
    }
    places.push(high);
    (0..places.len())
        .map(|i| {
            let (before, after) = (places[i.saturating_sub(1)], places[(i + 1).min(places.len() - 1)]);
            // A slab that only touches the data has no length there, but still a value.
            let weight = (0.5 * (after - before) / per_mm.abs()).max(f64::MIN_POSITIVE);
            Station { offset_mm: (places[i] - middle) / per_mm, weight }
        })
        .collect()
}

/// In the middle of equal steps of at most half the finest spacing, as far as the data reach.
fn even(section: &Section, voxel_from_world: &Affine, extent: [usize; 3]) -> Vec<Station> {
    let world_from_voxel = voxel_from_world.inverse();
    let corners = std::array::from_fn::<f64, 8, _>(|c| {
        let at = |axis: usize| if c >> axis & 1 == 1 { extent[axis] as f64 - 0.5 } else { -0.5 };
        section.depth_mm(&world_from_voxel.point(&Point::new(at(0), at(1), at(2))))
    });
    let half = 0.5 * section.slab.thickness_mm;
    let low = corners.iter().copied().fold(f64::INFINITY, f64::min).max(-half);
    let high = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max).min(half);
    if low >= high {
        return Vec::new();
    }
    let finest = world_from_voxel.column_lengths().into_iter().fold(f64::INFINITY, f64::min);
    // So many that even 0.01 mm voxels and the thickest slab stay a finite wait.
    let count = ((high - low) / (0.5 * finest)).ceil().clamp(1.0, 1e6);
    let step = (high - low) / count;
    (0..count as usize).map(|i| Station { offset_mm: low + step * (i as f64 + 0.5), weight: step }).collect()
}

/// What becomes of the values of one pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gathered {
    value: f64,
    weight: f64,
}

impl Gathered {
    /// No value yet.
    pub(super) const NOTHING: Self = Self { value: 0.0, weight: 0.0 };

    /// One more value.
    #[inline(always)]
    pub(super) fn take(&mut self, mode: SlabMode, value: f64, weight: f64) {
        match mode {
            SlabMode::Mean => self.value += value * weight,
            _ if self.weight == 0.0 => self.value = value,
            SlabMode::Mip => self.value = self.value.max(value),
            SlabMode::MinIp => self.value = self.value.min(value),
        }
        self.weight += weight;
    }

    /// The pixel's value; NaN where there was none.
    pub(super) fn result(self, mode: SlabMode) -> f64 {
        match mode {
            _ if self.weight == 0.0 => f64::NAN,
            SlabMode::Mean => self.value / self.weight,
            SlabMode::Mip | SlabMode::MinIp => self.value,
        }
    }
}
