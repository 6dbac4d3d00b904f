//! A transfer function as a curve to drag: values across, opacity up, its colours underneath.
//!
//! Opacity is drawn on a square-root scale, since what matters in soft tissue is below 0.05. The
//! functions that move, add and remove points are plain and keep the function valid.

use egui::{Color32, Pos2, Rect, Sense, Stroke, Ui, pos2, vec2};
use render::volume::{ControlPoint, Transfer};

use super::theme;

/// How near the pointer must be to take a point; points of the screen.
const REACH: f32 = 9.0;

/// The point that is chosen, and the one being dragged.
#[derive(Debug, Clone, Default)]
pub struct CurveEditor {
    /// Position in the function's points.
    pub chosen: Option<usize>,
    dragged: Option<usize>,
}

/// `points` with one moved; its value stays between its neighbours', its opacity in `[0, 1]`.
pub fn moved(points: &[ControlPoint], index: usize, value: f64, opacity: f64) -> Vec<ControlPoint> {
    let mut points = points.to_vec();
    let low = index.checked_sub(1).and_then(|i| points.get(i)).map_or(f64::NEG_INFINITY, |p| p.value);
    let high = points.get(index + 1).map_or(f64::INFINITY, |p| p.value);
    if let Some(point) = points.get_mut(index)
        && value.is_finite()
        && opacity.is_finite()
    {
        point.value = value.max(low).min(high);
        point.rgba[3] = opacity.clamp(0.0, 1.0);
    }
    points
}

/// The function's points with one more at `value`, in the colour and opacity it has there, and where the
/// new one stands.
pub fn added(transfer: &Transfer, value: f64) -> (Vec<ControlPoint>, usize) {
    let mut points = transfer.points().to_vec();
    let at = points.partition_point(|p| p.value <= value);
    points.insert(at, ControlPoint { value, rgba: transfer.rgba(value) });
    (points, at)
}

/// `points` without one, unless it is the last there is.
pub fn removed(points: &[ControlPoint], index: usize) -> Vec<ControlPoint> {
    let mut points = points.to_vec();
    if points.len() > 1 && index < points.len() {
        points.remove(index);
    }
    points
}

/// `points` all shifted by `by`.
pub fn shifted(points: &[ControlPoint], by: f64) -> Vec<ControlPoint> {
    points.iter().map(|p| ControlPoint { value: p.value + by, ..*p }).collect()
}

/// Values and opacities on the screen.
#[derive(Debug, Clone, Copy)]
struct Chart {
    rect: Rect,
    range: [f64; 2],
}

impl Chart {
    fn place(&self, value: f64, opacity: f64) -> Pos2 {
        let [low, high] = self.range;
        let x = (value - low) / (high - low).max(1e-12);
        let y = opacity.max(0.0).sqrt();
        pos2(
            self.rect.left() + x as f32 * self.rect.width(),
            self.rect.bottom() - y as f32 * self.rect.height(),
        )
    }

    fn value(&self, at: Pos2) -> f64 {
        let [low, high] = self.range;
        low + f64::from((at.x - self.rect.left()) / self.rect.width().max(1.0)) * (high - low)
    }

    fn opacity(&self, at: Pos2) -> f64 {
        let y = f64::from((self.rect.bottom() - at.y) / self.rect.height().max(1.0)).clamp(0.0, 1.0);
        y * y
    }
}

impl CurveEditor {
    /// Draws the curve over `histogram` (heights 0 to 1 over `range`, values shown); the new points
    /// where something was changed.
    pub fn ui(
        &mut self,
        ui: &mut Ui,
        transfer: &Transfer,
        histogram: &[f32],
        range: [f64; 2],
    ) -> Option<Vec<ControlPoint>> {
        let size = vec2(ui.available_width(), 170.0);
        let (whole, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
        let response = response.on_hover_text("Drag a point. Double-click adds one, right-click removes it.");
        let chart = Chart { rect: whole.shrink2(vec2(8.0, 6.0)), range };
        let points = transfer.points();
        self.chosen = self.chosen.filter(|&i| i < points.len());
        let near = |at: Pos2| {
            let distance = |p: &ControlPoint| chart.place(p.value, p.rgba[3]).distance(at);
            let all = points.iter().enumerate().map(|(i, p)| (i, distance(p)));
            all.filter(|(_, d)| *d <= REACH).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
        };
        let pointer = response.interact_pointer_pos();
        let mut result = None;
        if let Some(at) = pointer {
            if response.drag_started() || response.clicked() {
                let pressed = ui.input(|i| i.pointer.press_origin()).unwrap_or(at);
                self.chosen = near(pressed).or(self.chosen);
                self.dragged = if response.drag_started() { near(pressed) } else { None };
            }
            if response.dragged()
                && let Some(index) = self.dragged
            {
                result = Some(moved(points, index, chart.value(at), chart.opacity(at)));
            }
            if response.double_clicked() && near(at).is_none() {
                let (more, index) = added(transfer, chart.value(at));
                self.chosen = Some(index);
                result = Some(more);
            }
            if response.secondary_clicked()
                && let Some(index) = near(at)
            {
                self.chosen = None;
                result = Some(removed(points, index));
            }
        }
        if response.drag_stopped() {
            self.dragged = None;
        }
        let hot = response.hover_pos().and_then(near);
        self.paint(ui, whole, chart, transfer, histogram, hot);
        result
    }

    fn paint(
        &self,
        ui: &Ui,
        whole: Rect,
        chart: Chart,
        transfer: &Transfer,
        histogram: &[f32],
        hot: Option<usize>,
    ) {
        let painter = ui.painter_at(whole);
        painter.rect_filled(whole, 3.0, ui.visuals().extreme_bg_color);
        let bars = histogram.len().max(1) as f32;
        for (i, height) in histogram.iter().enumerate() {
            let x0 = chart.rect.left() + chart.rect.width() * i as f32 / bars;
            let x1 = chart.rect.left() + chart.rect.width() * (i + 1) as f32 / bars;
            let top = chart.rect.bottom() - chart.rect.height() * height;
            let bar = Rect::from_min_max(pos2(x0, top), pos2(x1, chart.rect.bottom()));
            painter.rect_filled(bar, 0.0, Color32::from_rgb(52, 57, 64));
        }
        // The colours along the lower edge, as opaque as the square-root scale shows them.
        let steps = 128;
        for i in 0..steps {
            let x0 = chart.rect.left() + chart.rect.width() * i as f32 / steps as f32;
            let x1 = chart.rect.left() + chart.rect.width() * (i + 1) as f32 / steps as f32;
            let [r, g, b, _] = transfer.rgba(chart.value(pos2(x0 / 2.0 + x1 / 2.0, 0.0)));
            let [r, g, b] = [r, g, b].map(|c| (c * 255.0).round() as u8);
            let strip = Rect::from_min_max(pos2(x0, whole.bottom() - 6.0), pos2(x1 + 0.5, whole.bottom()));
            painter.rect_filled(strip, 0.0, Color32::from_rgb(r, g, b));
        }
        // Straight pieces are curved on a square-root scale, so the line is walked.
        let [low, high] = chart.range;
        let mut values: Vec<f64> = (0..=200).map(|i| low + (high - low) * f64::from(i) / 200.0).collect();
        values.extend(transfer.points().iter().map(|p| p.value));
        values.sort_by(f64::total_cmp);
        let line = values.into_iter().map(|v| chart.place(v, transfer.rgba(v)[3])).collect();
        painter.add(egui::Shape::line(line, Stroke::new(1.5, theme::ACCENT)));
        for (index, p) in transfer.points().iter().enumerate() {
            let [r, g, b, a] = p.rgba;
            let fill = [r, g, b].map(|c| (c * 255.0).round() as u8);
            let rim =
                if self.chosen == Some(index) || hot == Some(index) { theme::HOT } else { Color32::WHITE };
            let centre = chart.place(p.value, a);
            painter.circle(centre, 5.0, Color32::from_rgb(fill[0], fill[1], fill[2]), Stroke::new(1.5, rim));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Transfer {
        let point = |value, a| ControlPoint { value, rgba: [a, 0.0, 1.0, a] };
        Transfer::new(vec![point(0.0, 0.0), point(10.0, 0.4), point(20.0, 1.0)], 1.0).expect("ramp")
    }

    #[test]
    fn a_moved_point_stays_between_its_neighbours() {
        let points = moved(ramp().points(), 1, 25.0, 1.7);
        assert_eq!((points[1].value, points[1].rgba[3]), (20.0, 1.0), "held by the next point and by 1");
        assert!(Transfer::new(points, 1.0).is_ok(), "still a transfer function");
        let points = moved(ramp().points(), 0, -50.0, 0.2);
        assert_eq!(points[0].value, -50.0, "the first may go down freely");
        assert_eq!(moved(ramp().points(), 1, f64::NAN, 0.5), ramp().points(), "nonsense moves nothing");
    }

    #[test]
    fn an_added_point_changes_no_colour() {
        let before = ramp();
        let (points, at) = added(&before, 4.0);
        assert_eq!(at, 1, "between the first two");
        let after = Transfer::new(points, 1.0).expect("still a transfer function");
        for i in -5..30 {
            let (a, b) = (before.rgba(f64::from(i)), after.rgba(f64::from(i)));
            assert!(a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-12), "at {i}");
        }
    }

    #[test]
    fn the_last_point_cannot_be_removed() {
        let one = removed(&removed(ramp().points(), 0), 1);
        assert_eq!(one.len(), 1, "two are gone");
        assert_eq!(removed(&one, 0), one, "the last stays");
    }

    #[test]
    fn places_on_the_chart_go_there_and_back() {
        let chart =
            Chart { rect: Rect::from_min_size(pos2(5.0, 7.0), vec2(200.0, 100.0)), range: [-50.0, 150.0] };
        let at = chart.place(30.0, 0.3);
        assert!((chart.value(at) - 30.0).abs() < 1e-4, "value");
        assert!((chart.opacity(at) - 0.3).abs() < 1e-4, "opacity");
    }
}
