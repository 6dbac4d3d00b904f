//! A grid's transfer function as three choices: colours, the values that they run between, and opacity at both ends.

use render::volume::{ControlPoint, Transfer};

use crate::colormaps::Colormap;

/// The values of the first and the last point.
pub(super) fn range(transfer: &Transfer) -> [f64; 2] {
    let points = transfer.points();
    [points.first(), points.last()].map(|p| p.map_or(0.0, |p| p.value))
}

/// Opacity at both ends.
pub(super) fn opacity(transfer: &Transfer) -> [f64; 2] {
    let points = transfer.points();
    [points.first(), points.last()].map(|p| p.map_or(0.0, |p| p.rgba[3]))
}

/// How far between the ends a point is, from 0 to 1.
fn part(transfer: &Transfer, index: usize) -> f64 {
    let [low, high] = range(transfer);
    let points = transfer.points();
    if high > low {
        (points[index].value - low) / (high - low)
    } else {
        index as f64 / (points.len() - 1).max(1) as f64
    }
}

fn changed(transfer: &Transfer, unit_mm: f64, change: impl Fn(f64, &mut ControlPoint)) -> Option<Transfer> {
    let mut points = transfer.points().to_vec();
    for (index, point) in points.iter_mut().enumerate() {
        change(part(transfer, index), point);
    }
    Transfer::new(points, unit_mm).ok()
}

/// The same between other values; nothing where the second does not lie above the first, or one is no number.
pub(super) fn with_range(transfer: &Transfer, [low, high]: [f64; 2]) -> Option<Transfer> {
    let width = high - low;
    if !(width > 0.0 && width.is_finite()) {
        return None;
    }
    changed(transfer, transfer.unit_mm(), |part, point| {
        // The ends themselves, whatever the rounding between.
        point.value = if part >= 1.0 { high } else { (low + width * part).min(high) };
    })
}

/// The same with opacity that rises or falls evenly.
pub(super) fn with_opacity(transfer: &Transfer, [from, to]: [f64; 2]) -> Option<Transfer> {
    changed(transfer, transfer.unit_mm(), |part, point| {
        point.rgba[3] = (from + (to - from) * part).clamp(0.0, 1.0);
    })
}

/// The same with the opacity of another length; mm, > 0.
pub(super) fn with_unit(transfer: &Transfer, unit_mm: f64) -> Option<Transfer> {
    Transfer::new(transfer.points().to_vec(), unit_mm).ok()
}

/// Other colours between the same values and opacities.
pub(super) fn with_map(transfer: &Transfer, map: &Colormap) -> Transfer {
    let made = map.transfer(range(transfer), opacity(transfer), transfer.unit_mm());
    // The very ends, which a sum of parts may miss.
    with_range(&made, range(transfer)).unwrap_or(made)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colormaps::{COLORMAPS, OPACITY};

    #[test]
    fn each_choice_leaves_the_others_alone() {
        let first = COLORMAPS[1].transfer([0.0, 8.0], OPACITY, 2.0);
        let moved = with_range(&first, [-3.1, 0.7]).expect("a range");
        assert_eq!((range(&moved), opacity(&moved), moved.unit_mm()), ([-3.1, 0.7], OPACITY, 2.0), "moved");
        assert!(COLORMAPS[1].is_of(&moved), "in the same colours");
        let faint = with_opacity(&moved, [0.0, 0.2]).expect("an opacity");
        assert_eq!((range(&faint), opacity(&faint)), ([-3.1, 0.7], [0.0, 0.2]), "fainter");
        let grey = with_map(&faint, &COLORMAPS[4]);
        assert!(COLORMAPS[4].is_of(&grey), "grey");
        assert_eq!((range(&grey), opacity(&grey)), ([-3.1, 0.7], [0.0, 0.2]), "otherwise as before");
        assert_eq!(with_unit(&grey, 5.0).map(|t| t.unit_mm()), Some(5.0), "of another length");
    }

    #[test]
    fn what_makes_no_function_is_refused() {
        let t = COLORMAPS[0].transfer([0.0, 8.0], OPACITY, 2.0);
        for range in [[1.0, 1.0], [2.0, 1.0], [f64::NAN, 1.0], [f64::MIN, f64::MAX]] {
            assert_eq!(with_range(&t, range), None, "{range:?}");
        }
        assert_eq!(with_unit(&t, 0.0), None, "no length");
        let point = ControlPoint { value: 4.0, rgba: [1.0; 4] };
        let flat = Transfer::new(vec![point; 3], 1.0).expect("a function");
        let spread = with_range(&flat, [0.0, 1.0]).expect("a range");
        assert_eq!(
            spread.points().iter().map(|p| p.value).collect::<Vec<_>>(),
            [0.0, 0.5, 1.0],
            "spread evenly"
        );
    }
}
