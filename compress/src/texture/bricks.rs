//! Bricks whose range of samples is known: where the table makes of a whole range one run, nothing is read.

use super::TextureError;
use super::volume::Volume;
use crate::Extent3;

/// The least and the greatest stored value of each brick of a grid, as empty-space skipping has them anyway.
///
/// Brick `[x, y, z]` covers at least the voxels from `edge·x` to `edge·(x + 1) − 1` of the *grid*, likewise in y and z;
/// ranges may be wider than those voxels need. Floats that are not finite count as the padding value.
#[derive(Debug, Clone, Copy)]
pub struct Bricks<'a> {
    /// Voxels along the edge of a brick, ≥ 1.
    pub edge: u32,
    /// The least and the greatest stored value, `[x, y, z]`, x fastest: ⌈x/edge⌉·⌈y/edge⌉·⌈z/edge⌉ bricks of the
    /// grid.
    pub ranges: &'a [[f64; 2]],
}

/// What each brick is known to be.
#[derive(Debug)]
pub(super) struct SkipMap {
    edge: usize,
    count: [usize; 3],
    known: Vec<Option<u16>>,
}

impl SkipMap {
    /// The map of `bricks` of a grid; `known` says of a range of stored values what block it makes, if one.
    pub(super) fn new(
        bricks: Bricks<'_>,
        grid: Extent3,
        known: impl Fn([f64; 2]) -> Option<u16>,
    ) -> Result<Self, TextureError> {
        let edge = bricks.edge.max(1) as usize;
        let count = [grid.x(), grid.y(), grid.z()].map(|n| n.div_ceil(edge));
        let expected = count.iter().product();
        if bricks.ranges.len() != expected || bricks.edge == 0 {
            return Err(TextureError::Bricks { expected, found: bricks.ranges.len() });
        }
        Ok(Self { edge, count, known: bricks.ranges.iter().map(|range| known(*range)).collect() })
    }

    /// What is known of the blocks from block `[x, y, z]` of a volume on: what all bricks say that a block touches.
    pub(super) fn know(&self, volume: &Volume<'_>, [x, y, z]: [usize; 3], known: &mut [Option<u16>]) {
        let (low, extent) = (volume.low(), volume.extent());
        let bricks = |low: usize, first: usize, most: usize| {
            (low + first) / self.edge..=(low + (first + 3).min(most - 1)) / self.edge
        };
        let slice = (low[2] + z) / self.edge;
        let rows = bricks(low[1], 4 * y, extent.y());
        for (i, known) in known.iter_mut().enumerate() {
            let mut all = rows.clone().flat_map(|row| {
                let line = (slice * self.count[1] + row) * self.count[0];
                bricks(low[0], 4 * (x + i), extent.x()).map(move |column| line + column)
            });
            let first = all.next().and_then(|brick| self.known[brick]);
            *known = first.filter(|_| all.all(|brick| self.known[brick] == first));
        }
    }
}
