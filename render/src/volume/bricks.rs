//! Least and greatest value of each brick of a grid: what a transfer function is asked against to
//! skip what it makes empty.

use rayon::prelude::*;

use super::{Grid, Transfer};

/// Min-max of boxes of [`Bricks::EDGE`]³ cells. A brick's range covers every sample that trilinear
/// interpolation inside it can touch, so its neighbours' first layer is in it too.
#[derive(Debug, Clone, PartialEq)]
pub struct Bricks {
    count: [usize; 3],
    extent: [usize; 3],
    range: Vec<[f64; 2]>,
}

impl Bricks {
    /// Voxels along a brick's edge.
    pub const EDGE: usize = 8;

    /// The bricks of a grid, in parallel.
    pub fn of(grid: &Grid) -> Self {
        let extent = grid.extent();
        let count = extent.map(|n| n.div_ceil(Self::EDGE));
        let range = (0..count.iter().product::<usize>())
            .into_par_iter()
            .map(|b| {
                let at = [b % count[0], b / count[0] % count[1], b / (count[0] * count[1])];
                // Interpolation between voxel centres reaches one sample past either end.
                let low = at.map(|i| (i * Self::EDGE).saturating_sub(1));
                let high: [usize; 3] = std::array::from_fn(|a| ((at[a] + 1) * Self::EDGE + 1).min(extent[a]));
                let mut range = [f64::INFINITY, f64::NEG_INFINITY];
                for z in low[2]..high[2] {
                    for y in low[1]..high[1] {
                        for x in low[0]..high[0] {
                            let v = grid.value(x, y, z);
                            range = [range[0].min(v), range[1].max(v)];
                        }
                    }
                }
                range
            })
            .collect();
        Self { count, extent, range }
    }

    /// How many bricks there are.
    pub fn len(&self) -> usize {
        self.range.len()
    }

    /// Whether there are none (never, for a grid).
    pub fn is_empty(&self) -> bool {
        self.range.is_empty()
    }

    /// The smallest box of voxel space that holds every brick `transfer` does not make clear, with the
    /// number of such bricks; `None` where all are clear.
    pub fn occupied(&self, transfer: &Transfer) -> Option<([[f64; 2]; 3], usize)> {
        let mut low = [usize::MAX; 3];
        let mut high = [0_usize; 3];
        let mut occupied = 0;
        for (b, range) in self.range.iter().enumerate() {
            if transfer.is_clear(range[0], range[1]) {
                continue;
            }
            occupied += 1;
            let c = self.count;
            let at = [b % c[0], b / c[0] % c[1], b / (c[0] * c[1])];
            for axis in 0..3 {
                low[axis] = low[axis].min(at[axis]);
                high[axis] = high[axis].max(at[axis] + 1);
            }
        }
        (occupied > 0).then(|| {
            let span = std::array::from_fn(|axis| {
                let end = (high[axis] * Self::EDGE).min(self.extent[axis]);
                [(low[axis] * Self::EDGE) as f64 - 0.5, end as f64 - 0.5]
            });
            (span, occupied)
        })
    }
}
