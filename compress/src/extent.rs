//! The size of a volume in voxels, checked once so that no later product of it can overflow.

use thiserror::Error;

/// Edge of a block in x and y, in voxels.
const BLOCK_EDGE: usize = 4;

/// Most bytes that any codec here needs per voxel: one block of 16 bytes may hold a single voxel.
const MOST_BYTES_PER_VOXEL: usize = 16;

/// Size of a volume: `[x, y, z]` voxels, each at least 1.
///
/// A value of this type exists only if 16 bytes a voxel can be addressed on this machine, so that
/// [`Extent3::voxels`] and every byte size made of it are plain numbers, not results to check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Extent3 {
    voxels: [u32; 3],
}

/// Why an extent cannot be.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ExtentError {
    /// One of the three sizes is zero.
    #[error("a volume of {}×{}×{} voxels is empty: each size must be at least 1", .extent[0], .extent[1], .extent[2])]
    Empty {
        /// The sizes asked for, `[x, y, z]`.
        extent: [u32; 3],
    },
    /// The bytes of such a volume cannot be addressed.
    #[error(
        "a volume of {}×{}×{} voxels is too large for this machine: split it into parts",
        .extent[0], .extent[1], .extent[2]
    )]
    TooLarge {
        /// The sizes asked for, `[x, y, z]`.
        extent: [u32; 3],
    },
}

impl Extent3 {
    /// An extent of `[x, y, z]` voxels.
    ///
    /// # Errors
    /// [`ExtentError::Empty`] if a size is zero; [`ExtentError::TooLarge`] if 16 bytes a voxel cannot be
    /// addressed.
    pub fn new(voxels: [u32; 3]) -> Result<Self, ExtentError> {
        if voxels.contains(&0) {
            return Err(ExtentError::Empty { extent: voxels });
        }
        let bytes =
            voxels.iter().try_fold(MOST_BYTES_PER_VOXEL as u128, |n, &size| n.checked_mul(size.into()));
        if bytes.is_none_or(|n| n > isize::MAX as u128) {
            return Err(ExtentError::TooLarge { extent: voxels });
        }
        Ok(Self { voxels })
    }

    /// A small extent: 255³ times 16 bytes can be addressed on any machine. A size of 0 is taken as 1.
    pub(crate) fn small(voxels: [u8; 3]) -> Self {
        Self { voxels: voxels.map(|size| u32::from(size.max(1))) }
    }

    /// The sizes, `[x, y, z]`.
    pub fn sizes(self) -> [u32; 3] {
        self.voxels
    }

    /// Voxels along x.
    pub fn x(self) -> usize {
        self.voxels[0] as usize
    }

    /// Voxels along y.
    pub fn y(self) -> usize {
        self.voxels[1] as usize
    }

    /// Voxels along z: slices.
    pub fn z(self) -> usize {
        self.voxels[2] as usize
    }

    /// All voxels: x·y·z.
    pub fn voxels(self) -> usize {
        self.x() * self.y() * self.z()
    }

    /// The same volume with `z` slices, at least 1 and at most its own.
    pub(crate) fn with_slices(self, z: usize) -> Self {
        let [x, y, most] = self.voxels;
        Self { voxels: [x, y, u32::try_from(z).unwrap_or(most).clamp(1, most)] }
    }

    /// How many 4×4×1 blocks cover the volume, `[x, y, z]`; those at the far edges may be partly outside it.
    pub fn blocks(self) -> [usize; 3] {
        [self.x().div_ceil(BLOCK_EDGE), self.y().div_ceil(BLOCK_EDGE), self.z()]
    }

    /// All 4×4×1 blocks.
    pub fn block_count(self) -> usize {
        let [x, y, z] = self.blocks();
        x * y * z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_extent_counts_its_voxels_and_the_blocks_that_cover_it() {
        let extent = Extent3::new([5, 7, 3]).unwrap();
        assert_eq!(extent.voxels(), 105, "voxels");
        assert_eq!(extent.blocks(), [2, 2, 3], "blocks");
        assert_eq!(extent.block_count(), 12, "all blocks");
        assert_eq!(Extent3::new([4, 8, 1]).unwrap().blocks(), [1, 2, 1], "whole blocks need no padding");
    }

    #[test]
    fn an_empty_extent_is_refused_by_name() {
        for sizes in [[0, 1, 1], [1, 0, 1], [1, 1, 0]] {
            assert_eq!(Extent3::new(sizes), Err(ExtentError::Empty { extent: sizes }), "{sizes:?}");
        }
    }

    #[test]
    fn an_extent_whose_bytes_cannot_be_addressed_is_refused_by_name() {
        for sizes in [[u32::MAX; 3], [1 << 30, 1 << 30, 1]] {
            assert_eq!(Extent3::new(sizes), Err(ExtentError::TooLarge { extent: sizes }), "{sizes:?}");
        }
    }
}
