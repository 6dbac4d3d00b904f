//! How often values occur, for the eye: heights on a logarithmic scale.

use render::volume::Grid;

/// Most samples looked at: a curve needs no more.
const MOST: usize = 400_000;

/// `count` heights over the grid's range, 0 to 1, the logarithm of how many of about 400 000 samples
/// fall in each part. A grid of one value has all of them in the first part.
pub fn heights(grid: &Grid, count: usize) -> Vec<f32> {
    let mut bins = vec![0_u32; count.max(1)];
    let [low, high] = grid.range();
    let scale = if high > low { bins.len() as f64 / (high - low) } else { 0.0 };
    let total = grid.samples().len();
    let stride = (total / MOST).max(1);
    let last = bins.len() - 1;
    for index in (0..total).step_by(stride) {
        let bin = ((grid.value_at(index) - low) * scale) as usize;
        bins[bin.min(last)] += 1;
    }
    let logs: Vec<f32> = bins.iter().map(|&n| (n as f32).ln_1p()).collect();
    let most = logs.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    logs.iter().map(|l| l / most).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::volume::{Affine, Rescale, Samples};

    #[test]
    fn the_commonest_value_is_highest_and_absent_ones_are_zero() {
        let mut samples = vec![0_i16; 100];
        samples.extend([100; 10]);
        samples.push(50);
        let grid = Grid::new([111, 1, 1], Samples::I16(samples), Rescale::default(), Affine::identity());
        let heights = heights(&grid.expect("grid"), 10);
        assert_eq!(heights[0], 1.0, "zeros");
        assert!(heights[9] < 1.0 && heights[9] > heights[5] && heights[5] > 0.0, "by count: {heights:?}");
        assert_eq!(heights[2], 0.0, "none there");
    }
}
