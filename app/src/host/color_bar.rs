//! The colours of grids over the 3D picture: a bar each, with the values that they stand for. On the screen only.

use egui::{Align2, Color32, FontId, Mesh, Painter, Rect, Shape, Stroke, pos2, vec2};
use render::volume::{ControlPoint, Transfer};

use super::section_view::shadowed_ui;
use crate::sections::ShownGrid;
use crate::ui::{number, theme};

/// Bars at most; the panel tells of the others.
const MOST: usize = 3;
/// Width of a bar, and from one bar to the next; points.
const WIDTH: f32 = 14.0;
const APART: f32 = 104.0;
/// Letters of a title at most.
const LETTERS: usize = 26;
/// Points of height that a number needs.
const LINE: f32 = 17.0;

/// Draws a bar for each grid down the right side of `rect`, the first outermost.
pub(super) fn bars_ui(painter: &Painter, rect: Rect, grids: &[ShownGrid]) {
    let height = (rect.height() * 0.42).min(240.0);
    let top = rect.top() + 74.0;
    if height < 60.0 {
        return;
    }
    for (index, grid) in grids.iter().take(MOST).enumerate() {
        let right = rect.right() - 34.0 - APART * index as f32;
        let bar = Rect::from_min_max(pos2(right - WIDTH, top), pos2(right, top + height));
        if bar.left() - APART < rect.left() {
            return;
        }
        bar_ui(painter, bar, grid);
    }
}

fn bar_ui(painter: &Painter, bar: Rect, grid: &ShownGrid) {
    let transfer = &grid.item.transfer;
    let [low, high] = ends(transfer);
    if !(high - low).is_finite() {
        return;
    }
    painter.add(Shape::mesh(ramp(transfer, [low, high], bar)));
    painter.rect_stroke(bar, 0.0, Stroke::new(1.0, Color32::from_gray(200)), egui::StrokeKind::Outside);
    let font = FontId::proportional(11.5);
    let white = Color32::from_rgb(235, 238, 241);
    for value in numbers([low, high], (bar.height() / LINE) as usize) {
        let y = place(value, [low, high], bar);
        painter.line_segment([pos2(bar.left() - 4.0, y), pos2(bar.left(), y)], Stroke::new(1.0, white));
        let at = pos2(bar.left() - 7.0, y);
        shadowed_ui(painter, at, Align2::RIGHT_CENTER, &number::short(value), &font, white);
    }
    let short = |text: &str| match text.char_indices().nth(LETTERS) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    };
    let title = match grid.unit.as_str() {
        "" => short(&grid.title),
        unit => format!("{} ({unit})", short(&grid.title)),
    };
    let above = |lines: f32| bar.right_top() + vec2(0.0, -10.0 - 14.0 * lines);
    shadowed_ui(painter, above(0.0), Align2::RIGHT_BOTTOM, &title, &font, white);
    shadowed_ui(painter, above(1.0), Align2::RIGHT_BOTTOM, &short(&grid.id), &font, theme::QUIET);
}

/// Values of the first and the last point; a single one has a little to either side.
fn ends(transfer: &Transfer) -> [f64; 2] {
    let points = transfer.points();
    let [low, high] = [points.first(), points.last()].map(|p| p.map_or(0.0, |p| p.value));
    if high > low {
        return [low, high];
    }
    let around = (low.abs() * 1e-3).max(1e-3);
    [low - around, low + around]
}

/// The height at which a value stands.
fn place(value: f64, [low, high]: [f64; 2], bar: Rect) -> f32 {
    bar.bottom() - ((value - low) / (high - low)) as f32 * bar.height()
}

/// The colours from the lowest value at the bottom to the greatest, a jump where there is one; opaque.
fn ramp(transfer: &Transfer, range: [f64; 2], bar: Rect) -> Mesh {
    let mut mesh = Mesh::default();
    let color = |rgba: [f64; 4]| {
        let [r, g, b] = [rgba[0], rgba[1], rgba[2]].map(|c| (c * 255.0).round() as u8);
        Color32::from_rgb(r, g, b)
    };
    let stop = |value| ControlPoint { value, rgba: transfer.rgba(value) };
    let points = transfer.points();
    // A function of one value holds it to either end.
    let first = points.first().map(|p| ControlPoint { value: range[0], ..*p });
    let all: Vec<ControlPoint> =
        first.into_iter().chain(points.iter().copied()).chain([stop(range[1])]).collect();
    for pair in all.windows(2) {
        let first = mesh.vertices.len() as u32;
        for point in pair {
            let y = place(point.value, range, bar);
            mesh.colored_vertex(pos2(bar.left(), y), color(point.rgba));
            mesh.colored_vertex(pos2(bar.right(), y), color(point.rgba));
        }
        mesh.add_triangle(first, first + 1, first + 2);
        mesh.add_triangle(first + 1, first + 2, first + 3);
    }
    mesh
}

/// Both ends, and as many round values between as leave each other room; `most` of all, at least two.
fn numbers([low, high]: [f64; 2], most: usize) -> Vec<f64> {
    let width = high - low;
    let least = width / most.saturating_sub(1).max(1) as f64;
    let mut found = vec![low];
    let power = 10_f64.powf(least.log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|step| *step >= least * (1.0 - 1e-9));
    if let Some(step) = step.filter(|step| step.is_finite() && *step > 0.0) {
        let first = (low / step).ceil();
        let round = (0..most).map(|i| (first + i as f64) * step);
        // An end keeps its place before a round value that is too near.
        found.extend(round.filter(|v| *v - low >= 0.7 * least && high - *v >= 0.7 * least));
    }
    found.push(high);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colormaps::{COLORMAPS, OPACITY};

    #[test]
    fn numbers_are_round_and_leave_each_other_room() {
        assert_eq!(numbers([0.0, 10.0], 6), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0], "fives and twos");
        let found = numbers([-3.7, 96.2], 8);
        assert_eq!((found[0], found[found.len() - 1]), (-3.7, 96.2), "both ends");
        assert!(found[1..found.len() - 1].iter().all(|v| (v / 20.0).fract() == 0.0), "round: {found:?}");
        for range in [[0.0, 1e-9], [-1e12, 3e12], [5.0, 5.001], [0.0, 61.3]] {
            let found = numbers(range, 14);
            let least = (range[1] - range[0]) / 13.0 * 0.69;
            assert!(found.windows(2).all(|p| p[1] - p[0] >= least), "{range:?}: {found:?}");
            assert!((2..=14).contains(&found.len()), "{range:?}: {found:?}");
        }
    }

    #[test]
    fn the_ramp_runs_upwards_and_fills_the_bar() {
        let bar = Rect::from_min_max(pos2(10.0, 100.0), pos2(24.0, 300.0));
        let t = COLORMAPS[0].transfer([2.0, 6.0], OPACITY, 1.0);
        let mesh = ramp(&t, ends(&t), bar);
        assert!(mesh.is_valid(), "corners are there");
        let at = |y: f32| mesh.vertices.iter().find(|v| v.pos.y == y).map(|v| v.color);
        assert_eq!(at(300.0), Some(Color32::from_rgb(59, 76, 192)), "the least value is at the bottom");
        assert_eq!(at(100.0), Some(Color32::from_rgb(180, 4, 38)), "the greatest at the top");
        assert_eq!(place(4.0, [2.0, 6.0], bar), 200.0, "half way");
        let one = Transfer::new(vec![t.points()[3]], 1.0).expect("a function");
        let [low, high] = ends(&one);
        assert!(low < high, "a function of one value still has a bar");
        assert!(ramp(&one, [low, high], bar).vertices.iter().all(|v| v.pos.y.is_finite()), "somewhere");
    }
}
