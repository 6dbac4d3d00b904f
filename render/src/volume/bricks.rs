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

    /// What of a grid `transfer` does not make clear, in at most `most_boxes` boxes but for one; `None` where all is clear.
    pub fn occupied(&self, transfer: &Transfer, most_boxes: usize) -> Option<Occupied> {
        let shown: Vec<usize> = (0..self.range.len())
            .into_par_iter()
            .filter(|&b| !transfer.is_clear(self.range[b][0], self.range[b][1]))
            .collect();
        let c = self.count;
        let places = shown.iter().map(|b| [b % c[0], b / c[0] % c[1], b / (c[0] * c[1])]);
        let mut boxes: Vec<[usize; 3]> = places.collect();
        let mut edge = Self::EDGE;
        let bricks = boxes.len();
        while boxes.len() > most_boxes.max(1) {
            for place in &mut boxes {
                *place = place.map(|i| i / 2);
            }
            boxes.sort_unstable();
            boxes.dedup();
            edge *= 2;
        }
        let boxes: Vec<[[f64; 2]; 3]> = boxes
            .iter()
            .map(|place| {
                std::array::from_fn(|axis| {
                    let end = ((place[axis] + 1) * edge).min(self.extent[axis]);
                    [(place[axis] * edge) as f64 - 0.5, end as f64 - 0.5]
                })
            })
            .collect();
        let ends = |axis: usize, end: usize, pick: fn(f64, f64) -> f64| {
            let start = boxes.first()?[axis][end];
            Some(boxes.iter().fold(start, |v, b| pick(v, b[axis][end])))
        };
        let mut span = [[0.0; 2]; 3];
        for (axis, span) in span.iter_mut().enumerate() {
            *span = [ends(axis, 0, f64::min)?, ends(axis, 1, f64::max)?];
        }
        Some(Occupied { span, bricks, boxes })
    }
}

/// What a transfer function leaves of a grid; boxes of voxel space, low and high end along each axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Occupied {
    /// The smallest box of bricks around all.
    pub span: [[f64; 2]; 3],
    /// How many bricks are not clear.
    pub bricks: usize,
    /// Those bricks, or groups of them.
    pub boxes: Vec<[[f64; 2]; 3]>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Affine, ControlPoint, Rescale, Samples};

    #[test]
    fn bricks_that_show_something_are_in_some_box() {
        let extent = [40, 17, 30];
        let mut samples = vec![0.0_f32; extent.iter().product()];
        for at in [[0, 0, 0], [23, 9, 16], [39, 16, 29]] {
            samples[at[0] + extent[0] * (at[1] + extent[1] * at[2])] = 1.0;
        }
        let grid =
            Grid::new(extent, Samples::F32(samples), Rescale::default(), Affine::identity()).expect("grid");
        let point = |value, a| ControlPoint { value, rgba: [1.0, 1.0, 1.0, a] };
        let transfer = Transfer::new(vec![point(0.0, 0.0), point(1.0, 1.0)], 1.0).expect("transfer");
        let bricks = Bricks::of(&grid);
        let all = bricks.occupied(&transfer, usize::MAX).expect("something");
        // Each bright voxel is seen from every brick whose cells reach it: 23 and 16 lie at an edge.
        assert_eq!((all.bricks, all.boxes.len()), (1 + 4 + 2, 7), "bricks");
        assert_eq!(all.span, [[-0.5, 39.5], [-0.5, 16.5], [-0.5, 29.5]], "span");
        let few = bricks.occupied(&transfer, 4).expect("something");
        assert!(few.boxes.len() <= 4 && few.bricks == 7, "{few:?}");
        for inner in &all.boxes {
            let holds = |outer: &[[f64; 2]; 3]| {
                (0..3).all(|a| outer[a][0] <= inner[a][0] && outer[a][1] >= inner[a][1])
            };
            assert!(few.boxes.iter().any(holds), "{inner:?} in a group");
        }
        let clear = Transfer::new(vec![point(0.0, 0.0)], 1.0).expect("transfer");
        assert_eq!(bricks.occupied(&clear, 1), None, "nothing");
    }
}
