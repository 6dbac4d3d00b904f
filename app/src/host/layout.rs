//! Where the views lie: two by two, or one alone.

use egui::{Rect, pos2};

use super::views::{Orientation, ViewId};

/// Width of the line between views; points.
pub const GAP: f32 = 3.0;

/// The views and their places within `area`: four of equal size with [`GAP`] between them, or the one
/// that fills it.
pub fn cells(area: Rect, only: Option<ViewId>) -> Vec<(ViewId, Rect)> {
    if let Some(view) = only {
        return vec![(view, area)];
    }
    let middle = area.center();
    let half = GAP / 2.0;
    let cell = |right: bool, lower: bool| {
        let (x0, x1) = if right { (middle.x + half, area.right()) } else { (area.left(), middle.x - half) };
        let (y0, y1) = if lower { (middle.y + half, area.bottom()) } else { (area.top(), middle.y - half) };
        Rect::from_min_max(pos2(x0, y0), pos2(x1.max(x0), y1.max(y0)))
    };
    vec![
        (ViewId::Spatial, cell(false, false)),
        (ViewId::Section(Orientation::Axial), cell(true, false)),
        (ViewId::Section(Orientation::Coronal), cell(false, true)),
        (ViewId::Section(Orientation::Sagittal), cell(true, true)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_views_fill_the_area_but_for_the_gaps() {
        let area = Rect::from_min_max(pos2(10.0, 20.0), pos2(1013.0, 723.0));
        let cells = cells(area, None);
        assert_eq!(cells.len(), 4, "two by two");
        let covered: f32 = cells.iter().map(|(_, r)| r.area()).sum();
        assert!((covered - 1000.0 * 700.0).abs() < 1.0, "all but the cross of gaps: {covered}");
        for (i, (view, rect)) in cells.iter().enumerate() {
            assert!(area.contains_rect(*rect), "{view:?} lies inside");
            for (other, there) in &cells[i + 1..] {
                assert!(!rect.intersects(*there), "{view:?} and {other:?} overlap");
            }
        }
    }

    #[test]
    fn one_view_may_have_it_all() {
        let area = Rect::from_min_max(pos2(0.0, 0.0), pos2(50.0, 40.0));
        assert_eq!(cells(area, Some(ViewId::Spatial)), [(ViewId::Spatial, area)], "alone");
    }
}
