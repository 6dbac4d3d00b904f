//! The other sections as lines in a section, and the dots on them that turn those sections.

use egui::{Color32, Painter, Pos2, Stroke, vec2};
use render::volume::Point;

use super::section_view::OnScreen;
use super::views::{Orientation, Views};
use crate::ui::theme;

/// The direction on the screen of another section's line; none where it lies in the same plane.
fn line_on_screen(map: &OnScreen, views: &Views, other: Orientation) -> Option<egui::Vec2> {
    let along = map.section.forward().cross(&views.normal(other)).try_normalize(1e-6)?;
    let [x, y] = [map.section.right(), map.section.down()].map(|axis| axis.dot(&along) as f32);
    Some(vec2(x, y).normalized())
}

/// How near to a dot the pointer takes it; points.
pub(super) const DOT_REACH: f32 = 9.0;

/// The dots on the other sections' lines that turn them: each with the section it turns.
pub(super) fn turning_dots(
    map: &OnScreen,
    orientation: Orientation,
    views: &Views,
    crosshair: &Point,
) -> Vec<(Orientation, Pos2)> {
    let (middle, reach) = (map.place(crosshair), 0.36 * map.rect.width().min(map.rect.height()));
    let others = Orientation::ALL.into_iter().filter(|o| *o != orientation);
    others
        .filter_map(|other| Some((other, line_on_screen(map, views, other)? * reach)))
        .flat_map(|(other, along)| [(other, middle + along), (other, middle - along)])
        .filter(|(_, dot)| map.rect.contains(*dot))
        .collect()
}

/// Turns another section about this one's normal by as much as the pointer went about the crosshair.
pub(super) fn turn(map: &OnScreen, other: Orientation, views: &mut Views, from: Pos2, to: Pos2) {
    let Some(crosshair) = views.crosshair else { return };
    let [before, after] = [from, to].map(|at| map.point(at) - crosshair);
    let axis = map.section.forward();
    let angle_rad = axis.dot(&before.cross(&after)).atan2(before.dot(&after));
    views.turn(other, &axis, angle_rad);
}

/// The other two sections as lines, each in its colour, open in the middle so that the spot is seen, with a dot
/// towards either end that turns it.
pub(super) fn crosshair_ui(
    painter: &Painter,
    map: &OnScreen,
    orientation: Orientation,
    views: &Views,
    crosshair: &Point,
    pointer: Option<Pos2>,
) {
    const OPEN: f32 = 9.0;
    let at = map.place(crosshair);
    let far = map.rect.width() + map.rect.height();
    for other in Orientation::ALL.into_iter().filter(|o| *o != orientation) {
        let Some(along) = line_on_screen(map, views, other) else { continue };
        let stroke = Stroke::new(1.0, other.color().gamma_multiply(0.8));
        for along in [along, -along] {
            painter.line_segment([at + along * OPEN, at + along * far], stroke);
        }
    }
    if pointer.is_some() {
        for (other, dot) in turning_dots(map, orientation, views, crosshair) {
            let hot = pointer.is_some_and(|p| p.distance(dot) <= DOT_REACH);
            let color = if hot { theme::HOT } else { other.color() };
            painter.circle(dot, 4.0, color, Stroke::new(1.0, Color32::from_black_alpha(180)));
        }
    }
}
