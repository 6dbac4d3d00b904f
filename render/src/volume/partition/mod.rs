//! Which piece every voxel of a grid belongs to, for any number of cutters at once.
//!
//! A voxel belongs where its centre does, and the answer is that of [`Body::holds`](super::Body::holds) at the centre's place
//! in the world, bit for bit. Where a row of voxels is far from a surface, an interval says so for all of
//! them: along a row every body is one stretch, whose ends are bounded with room for every rounding
//! (`rows`). Only voxels between the bounds are asked one by one, so that cutters may be coincident,
//! nearly parallel or go through voxel centres, in any order, and each voxel still has exactly one pattern.

mod rows;

use std::collections::BTreeMap;

use rayon::prelude::*;
use rows::Wall;
use thiserror::Error;

use super::{Affine, Cutter, Side};

/// Most cutters of one partition: a pattern has two bits for each.
pub const MAX_CUTTERS: usize = 16;

/// Why a grid cannot be divided.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PartitionError {
    /// More than [`MAX_CUTTERS`].
    #[error("a grid can be divided by {MAX_CUTTERS} cutters at once, not {count}; divide by fewer")]
    TooMany {
        /// As given.
        count: usize,
    },
    /// The grid has more voxels than can be counted.
    #[error("a grid of {extent:?} voxels has too many to be divided")]
    TooLarge {
        /// As given.
        extent: [usize; 3],
    },
}

/// On which side of each cutter a voxel lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pattern(u32);

impl Pattern {
    /// Bits of cutter `index`: in the body that ends its "-", in the body where its "+" begins. The first
    /// is within the second.
    fn bits(index: usize) -> [u32; 2] {
        [1 << (2 * index), 2 << (2 * index)]
    }

    /// The side of the cutter that was given as number `index`; `None` in its kerf.
    pub fn side(self, index: usize) -> Option<Side> {
        let [minus, not_plus] = Self::bits(index).map(|bit| self.0 & bit != 0);
        match (minus, not_plus) {
            (_, false) => Some(Side::Plus),
            (true, true) => Some(Side::Minus),
            (false, true) => None,
        }
    }

    /// Whether a fragment that keeps these sides, in the order of the cutters, has the voxel.
    pub fn is_kept_by(self, sides: &[Side]) -> bool {
        sides.iter().enumerate().all(|(index, side)| self.side(index) == Some(*side))
    }
}

/// The pattern of every voxel of a grid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Labels(Vec<u32>);

impl Labels {
    /// The patterns, `[x, y, z]`, x fastest.
    pub fn patterns(&self) -> impl ExactSizeIterator<Item = Pattern> + '_ {
        self.0.iter().map(|&bits| Pattern(bits))
    }

    /// The pattern of the voxel at an index of the grid's samples; `None` past the last.
    pub fn pattern(&self, index: usize) -> Option<Pattern> {
        self.0.get(index).map(|&bits| Pattern(bits))
    }
}

/// The pattern of every voxel.
///
/// # Errors
/// [`PartitionError`].
pub fn label(
    extent: [usize; 3],
    world_from_voxel: &Affine,
    cutters: &[Cutter],
) -> Result<Labels, PartitionError> {
    let walls = walls(extent, world_from_voxel, cutters)?;
    let [nx, ny, _] = extent;
    let mut labels = vec![0; extent.iter().product()];
    if !labels.is_empty() {
        labels.par_chunks_mut(nx).enumerate().for_each(|(row, labels)| {
            fill(labels, [row % ny, row / ny], world_from_voxel, &walls);
        });
    }
    Ok(Labels(labels))
}

/// How many voxels have each pattern; patterns that none has are left out.
///
/// # Errors
/// [`PartitionError`].
pub fn count(
    extent: [usize; 3],
    world_from_voxel: &Affine,
    cutters: &[Cutter],
) -> Result<BTreeMap<Pattern, u64>, PartitionError> {
    let walls = walls(extent, world_from_voxel, cutters)?;
    let [nx, ny, nz] = extent;
    let slice = |z: usize| {
        let mut counts = BTreeMap::new();
        let mut row = vec![0; nx];
        for y in 0..ny {
            row.fill(0);
            fill(&mut row, [y, z], world_from_voxel, &walls);
            for run in row.chunk_by(|a, b| a == b) {
                *counts.entry(Pattern(run[0])).or_insert(0) += run.len() as u64;
            }
        }
        counts
    };
    let add = |mut all: BTreeMap<Pattern, u64>, one: BTreeMap<Pattern, u64>| {
        for (pattern, voxels) in one {
            *all.entry(pattern).or_insert(0) += voxels;
        }
        all
    };
    Ok((0..nz).into_par_iter().map(slice).reduce(BTreeMap::new, add))
}

/// The volume of a fragment: its voxels' count times the volume of one; mm³.
///
/// # Errors
/// [`PartitionError`].
pub fn fragment_volume_mm3(
    extent: [usize; 3],
    world_from_voxel: &Affine,
    keep: &[(Cutter, Side)],
) -> Result<f64, PartitionError> {
    let (cutters, sides): (Vec<Cutter>, Vec<Side>) = keep.iter().copied().unzip();
    let counts = count(extent, world_from_voxel, &cutters)?;
    let voxels: u64 = counts.iter().filter(|(p, _)| p.is_kept_by(&sides)).map(|(_, n)| n).sum();
    Ok(voxels as f64 * world_from_voxel.linear().determinant().abs())
}

fn walls(
    extent: [usize; 3],
    world_from_voxel: &Affine,
    cutters: &[Cutter],
) -> Result<Vec<Wall>, PartitionError> {
    if cutters.len() > MAX_CUTTERS {
        return Err(PartitionError::TooMany { count: cutters.len() });
    }
    let voxels = extent.iter().try_fold(1_usize, |n, &e| n.checked_mul(e));
    if voxels.is_none_or(|n| n > isize::MAX as usize / size_of::<u32>()) {
        return Err(PartitionError::TooLarge { extent });
    }
    let wall = |cutter: &Cutter, side, bits| Wall::new(cutter.solid(side).0, bits, extent, world_from_voxel);
    let of_cutter = |(index, cutter): (usize, &Cutter)| {
        let [minus, not_plus] = Pattern::bits(index);
        if cutter.kerf_mm() > 0.0 {
            vec![wall(cutter, Side::Minus, minus), wall(cutter, Side::Plus, not_plus)]
        } else {
            vec![wall(cutter, Side::Minus, minus | not_plus)]
        }
    };
    Ok(cutters.iter().enumerate().flat_map(of_cutter).collect())
}

/// Sets the bits of one row that was clear; `at` is its place in y and z.
fn fill(row: &mut [u32], at: [usize; 2], world_from_voxel: &Affine, walls: &[Wall]) {
    for wall in walls {
        let (inside, perhaps) = wall.of_row(at, row.len());
        for bits in &mut row[inside.clone()] {
            *bits |= wall.bits;
        }
        for x in (perhaps.start..inside.start).chain(inside.end..perhaps.end) {
            if wall.holds([x, at[0], at[1]], world_from_voxel) {
                row[x] |= wall.bits;
            }
        }
    }
}

#[cfg(test)]
mod tests;
