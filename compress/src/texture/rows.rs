//! The four rows of voxels of a row of blocks, where they lie or copied.

use super::domain::{Domain, SampleKind};
use super::volume::{Samples, Volume};

/// Voxels of a block along x, and along y.
pub(super) const EDGE: usize = 4;

/// Voxels of a block.
pub(super) const VOXELS: usize = EDGE * EDGE;

/// A type that the least and the greatest of samples are found in: that of the samples, or table indices of them.
pub(super) trait Cell: Copy + Ord + Default + Send + Sync {
    /// The samples, where they are of this type.
    fn stored<'a>(samples: &Samples<'a>) -> Option<&'a [Self]>;

    /// The table indices of a row of voxels, where samples are not of this type.
    fn read(volume: &Volume<'_>, domain: &Domain, at: [usize; 3], out: &mut [Self]);

    /// What index 0 stands for, and what the last.
    fn bounds(domain: &Domain) -> [Self; 2];

    /// The index of a sample.
    fn index(self, bounds: [Self; 2]) -> u16;
}

impl Cell for i16 {
    fn stored<'a>(samples: &Samples<'a>) -> Option<&'a [Self]> {
        if let Samples::I16(samples) = samples { Some(samples) } else { None }
    }

    fn read(_: &Volume<'_>, _: &Domain, _: [usize; 3], _: &mut [Self]) {}

    fn bounds(domain: &Domain) -> [Self; 2] {
        [domain.value(0) as Self, domain.value(domain.last()) as Self]
    }

    #[inline(always)]
    fn index(self, [low, high]: [Self; 2]) -> u16 {
        self.max(low).min(high).wrapping_sub(low) as u16
    }
}

impl Cell for u16 {
    fn stored<'a>(samples: &Samples<'a>) -> Option<&'a [Self]> {
        if let Samples::U16(samples) = samples { Some(samples) } else { None }
    }

    #[inline(always)]
    fn read(volume: &Volume<'_>, domain: &Domain, at: [usize; 3], out: &mut [Self]) {
        volume.indices(domain, at, out);
    }

    fn bounds(domain: &Domain) -> [Self; 2] {
        if domain.kind() == SampleKind::U16 {
            [domain.value(0) as Self, domain.value(domain.last()) as Self]
        } else {
            [0, domain.last()]
        }
    }

    #[inline(always)]
    fn index(self, [low, high]: [Self; 2]) -> u16 {
        self.max(low).min(high) - low
    }
}

/// Four rows of voxels, copied into the first cache. Rows follow each other in memory, and copying them one by one is
/// the order that hardware reads ahead in; to look at four at once, a line of each, is half as fast.
#[derive(Debug)]
pub(super) struct Rows<T> {
    copies: [Vec<T>; EDGE],
}

impl<T: Cell> Rows<T> {
    /// Room for rows of at most `blocks` blocks.
    pub(super) fn new(blocks: usize) -> Self {
        let row = || vec![T::default(); blocks * EDGE];
        Self { copies: [row(), row(), row(), row()] }
    }

    /// The rows of `count` blocks from block `[x, y, z]` of the volume on. Past its edges the last voxel is repeated.
    #[inline(always)]
    pub(super) fn of(
        &mut self,
        volume: &Volume<'_>,
        domain: &Domain,
        [x, y, z]: [usize; 3],
        count: usize,
    ) -> [&[T]; EDGE] {
        let (extent, first) = (volume.extent(), x * EDGE);
        let len = count * EDGE;
        let inside = len.min(extent.x() - first);
        for (j, copy) in self.copies.iter_mut().enumerate() {
            let at = [first, (y * EDGE + j).min(extent.y() - 1), z];
            let (row, past) = copy[..len].split_at_mut(inside);
            match T::stored(volume.samples()) {
                Some(samples) => row.copy_from_slice(&samples[volume.offset(at)..][..inside]),
                None => T::read(volume, domain, at, row),
            }
            past.fill(row.last().copied().unwrap_or_default());
        }
        let [a, b, c, d] = &self.copies;
        [&a[..len], &b[..len], &c[..len], &d[..len]]
    }
}

/// Blocks that are looked at together.
pub(super) const GROUP: usize = 8;

/// Voxels of a row of a group.
pub(super) const WIDE: usize = GROUP * EDGE;

/// The least and the greatest voxel of each column of four rows.
#[inline(always)]
pub(super) fn columns<T: Cell, const N: usize>([a, b, c, d]: [&[T; N]; EDGE]) -> [[T; N]; 2] {
    let (mut least, mut most) = (*a, *a);
    for i in 0..N {
        least[i] = a[i].min(b[i]).min(c[i].min(d[i]));
        most[i] = a[i].max(b[i]).max(c[i].max(d[i]));
    }
    [least, most]
}

/// The least of the first, and the greatest of the second.
#[inline(always)]
pub(super) fn outer<T: Copy + Ord, const N: usize>([least, most]: [&[T; N]; 2]) -> [T; 2] {
    let (mut low, mut high) = (least[0], most[0]);
    for i in 1..N {
        low = low.min(least[i]);
        high = high.max(most[i]);
    }
    [low, high]
}

/// The table indices of block `i` of some rows, x fastest.
#[inline(always)]
pub(super) fn indices<T: Cell, const N: usize>(
    [a, b, c, d]: [&[T; N]; EDGE],
    i: usize,
    bounds: [T; 2],
) -> [u16; VOXELS] {
    let mut indices = [0; VOXELS];
    for (row, indices) in [a, b, c, d].into_iter().zip(indices.as_chunks_mut::<EDGE>().0) {
        for (index, voxel) in indices.iter_mut().zip(&row[i * EDGE..][..EDGE]) {
            *index = voxel.index(bounds);
        }
    }
    indices
}
