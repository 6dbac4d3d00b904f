//! Labels: painted regions as whole numbers on a grid, found by the nearest sample.

use super::{Grid, Point};

/// The label that a sample's value stands for: the nearest whole number, or 0, none, for what is below a half
/// or not a number.
pub fn label_of(value: f64) -> u32 {
    if value >= 0.5 { value.round().min(f64::from(u32::MAX)) as u32 } else { 0 }
}

/// The label at a place in the voxel space of a grid of labels: that of the nearest sample, and half way
/// between two that of the later one. Outside `[-0.5, n - 0.5)`, and for NaN, it is 0.
pub fn label_at(grid: &Grid, at_voxel: &Point) -> u32 {
    let mut nearest = [0_usize; 3];
    for axis in 0..3 {
        let c = at_voxel[axis] + 0.5;
        if !(c >= 0.0 && c < grid.extent()[axis] as f64) {
            return 0;
        }
        nearest[axis] = c as usize;
    }
    let [x, y, z] = nearest;
    label_of(grid.value(x, y, z))
}

/// The colour of a label that nobody has chosen one for: red, green, blue and a share of a half. Hues follow
/// each other by the golden ratio, so that neighbours are well apart and none comes twice.
pub fn default_color(label: u32) -> [f64; 4] {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let hue = (f64::from(label.saturating_sub(1)) * GOLDEN).fract() * 6.0;
    let channel = |at: f64| {
        let k = (at + hue) % 6.0;
        1.0 - 0.875 * k.min(4.0 - k).clamp(0.0, 1.0)
    };
    [channel(5.0), channel(3.0), channel(1.0), 0.5]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Affine, Rescale, Samples};

    #[test]
    fn the_nearest_sample_has_the_label() {
        let samples = Samples::U8(vec![1, 2, 0, 4]);
        let grid = Grid::new([4, 1, 1], samples, Rescale::default(), Affine::identity()).expect("grid");
        let at = |x: f64| label_at(&grid, &Point::new(x, 0.0, 0.0));
        assert_eq!([at(-0.5), at(0.49), at(0.5), at(2.2), at(3.49)], [1, 1, 2, 0, 4], "inside");
        assert_eq!([at(-0.51), at(3.5), at(f64::NAN)], [0, 0, 0], "outside");
        assert_eq!(
            [label_of(-3.0), label_of(0.4), label_of(2.6), label_of(f64::NAN)],
            [0, 0, 3, 0],
            "values"
        );
    }

    #[test]
    fn default_colours_are_apart_and_begin_with_red() {
        assert_eq!(default_color(1), [1.0, 0.125, 0.125, 0.5], "red");
        for a in 1..12 {
            for b in 1..a {
                let apart: f64 = (0..3).map(|c| (default_color(a)[c] - default_color(b)[c]).abs()).sum();
                assert!(apart > 0.1, "{a} looks like {b}");
            }
        }
    }
}
