//! Colours for the values of a simulation.
//!
//! Sources: viridis and plasma of matplotlib 2.0 (S. van der Walt, N. Smith; CC0); Moreland 2009, "Diverging Color Maps for
//! Scientific Visualization"; the rainbow is that of the field's older programs.

use render::volume::{ControlPoint, Transfer};

/// Colours at even distances, lowest value first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colormap {
    /// For people.
    pub name: &'static str,
    /// Red, green, blue; 0 to 255.
    colors: &'static [[u8; 3]],
}

/// All, the default first.
pub const COLORMAPS: [Colormap; 5] = [
    Colormap {
        name: "Cool to warm",
        colors: &[
            [59, 76, 192],
            [98, 130, 234],
            [141, 176, 254],
            [184, 208, 249],
            [221, 221, 221],
            [245, 196, 173],
            [244, 154, 123],
            [222, 96, 77],
            [180, 4, 38],
        ],
    },
    Colormap {
        name: "Viridis",
        colors: &[
            [68, 1, 84],
            [71, 45, 123],
            [59, 82, 139],
            [44, 114, 142],
            [33, 145, 140],
            [40, 174, 128],
            [94, 201, 98],
            [173, 220, 48],
            [253, 231, 37],
        ],
    },
    Colormap {
        name: "Plasma",
        colors: &[
            [13, 8, 135],
            [76, 2, 161],
            [126, 3, 168],
            [169, 35, 149],
            [204, 71, 120],
            [229, 107, 93],
            [248, 149, 64],
            [253, 197, 39],
            [240, 249, 33],
        ],
    },
    Colormap {
        name: "Rainbow",
        colors: &[[0, 0, 255], [0, 255, 255], [0, 255, 0], [255, 255, 0], [255, 0, 0]],
    },
    Colormap { name: "Grey", colors: &[[0, 0, 0], [255, 255, 255]] },
];

/// Opacity at the least and the greatest value, of a hundredth of the grid's diagonal: what is high is seen through what is low.
pub const OPACITY: [f64; 2] = [0.06, 0.5];

impl Colormap {
    /// Whether a transfer function has these colours at even distances; its opacities do not matter.
    pub fn is_of(&self, transfer: &Transfer) -> bool {
        let points = transfer.points();
        let (Some(first), Some(last)) = (points.first(), points.last()) else { return false };
        let width = last.value - first.value;
        let steps = (self.colors.len() - 1) as f64;
        points.len() == self.colors.len()
            && points.iter().zip(self.colors).enumerate().all(|(i, (point, color))| {
                let value = first.value + width * i as f64 / steps;
                (point.value - value).abs() <= 1e-9 * width
                    && point.rgba[..3] == color.map(|c| f64::from(c) / 255.0)
            })
    }

    /// These colours over a range of values, with an opacity of `unit_mm` that rises evenly between two. A range without
    /// width, or not finite, counts as one unit wide.
    pub fn transfer(&self, [low, high]: [f64; 2], opacity: [f64; 2], unit_mm: f64) -> Transfer {
        let low = if low.is_finite() { low } else { 0.0 };
        let width = if high > low && (high - low).is_finite() { high - low } else { 1.0 };
        let last = (self.colors.len() - 1) as f64;
        let [from, to] = opacity.map(|a| if a.is_nan() { 0.0 } else { a.clamp(0.0, 1.0) });
        let points = self.colors.iter().enumerate().map(|(i, color)| {
            let part = i as f64 / last;
            let [r, g, b] = color.map(|c| f64::from(c) / 255.0);
            ControlPoint {
                value: low + width * part,
                rgba: [r, g, b, (from + (to - from) * part).clamp(0.0, 1.0)],
            }
        });
        let unit_mm = if unit_mm > 0.0 && unit_mm.is_finite() { unit_mm } else { 1.0 };
        match Transfer::new(points.collect(), unit_mm) {
            Ok(transfer) => transfer,
            // Finite values that rise, components within 0 to 1 and a positive unit are always accepted.
            Err(_) => unreachable!("even colours over a range are a transfer function"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_and_opacity_run_from_the_least_value_to_the_greatest() {
        for map in COLORMAPS {
            let t = map.transfer([10.0, 30.0], [0.1, 0.5], 2.0);
            assert_eq!((t.points()[0].value, t.rgba(30.0)[3], t.unit_mm()), (10.0, 0.5, 2.0), "{}", map.name);
            assert!((t.rgba(20.0)[3] - 0.3).abs() < 1e-12, "half way, {}", map.name);
            assert_ne!(t.rgba(10.0)[..3], t.rgba(30.0)[..3], "{} has two ends", map.name);
            let same: Vec<&str> = COLORMAPS.iter().filter(|m| m.is_of(&t)).map(|m| m.name).collect();
            assert_eq!(same, [map.name], "known again by its colours");
        }
        let t = COLORMAPS[0].transfer([f64::NAN, f64::INFINITY], [f64::NAN, 7.0], f64::NAN);
        assert_eq!((t.points()[0].value, t.unit_mm(), t.rgba(1.0)[3]), (0.0, 1.0, 1.0), "no range");
        let t = COLORMAPS[0].transfer([f64::MIN, f64::MAX], OPACITY, 1.0);
        assert!(t.points().iter().all(|p| p.value.is_finite()), "a range past the largest number");
    }
}
