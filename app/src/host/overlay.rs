//! Lines and handles over the 3D picture, given in world mm and drawn by egui in picture space.
//!
//! Nothing here is hidden by the picture: a handle must be seen to be taken.

use egui::{Color32, Pos2, Rect, Stroke};
use render::volume::Point;

use super::camera::Lens;

/// Something to draw.
#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Line { places: Vec<Point>, color: Color32, width: f32 },
    Sheet { places: Vec<Point>, color: Color32 },
    Dot { place: Point, color: Color32, radius: f32 },
    Text { place: Point, color: Color32, text: String },
}

/// What the tools want over the 3D view, in the order drawn.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Overlay {
    shapes: Vec<Shape>,
}

impl Overlay {
    /// A line through `places`; `width` in points.
    pub fn line(&mut self, places: Vec<Point>, color: Color32, width: f32) {
        self.shapes.push(Shape::Line { places, color, width });
    }

    /// A filled convex outline.
    pub fn sheet(&mut self, places: Vec<Point>, color: Color32) {
        self.shapes.push(Shape::Sheet { places, color });
    }

    /// A round dot with a dark rim; `radius` in points.
    pub fn dot(&mut self, place: Point, color: Color32, radius: f32) {
        self.shapes.push(Shape::Dot { place, color, radius });
    }

    /// Words beside a place.
    pub fn text(&mut self, place: Point, color: Color32, text: impl Into<String>) {
        self.shapes.push(Shape::Text { place, color, text: text.into() });
    }

    /// How many things there are.
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Whether there is nothing.
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// Draws it all. What reaches behind the eye is left out as a whole.
    pub(super) fn paint(&self, painter: &egui::Painter, rect: Rect, lens: &Lens) {
        let place = |p: &Point| {
            let [x, y] = lens.project(p)?;
            Some(Pos2::new(rect.left() + x as f32, rect.top() + y as f32))
        };
        for shape in &self.shapes {
            match shape {
                Shape::Line { places, color, width } => {
                    if let Some(points) = places.iter().map(place).collect::<Option<Vec<_>>>() {
                        painter.add(egui::Shape::line(points, Stroke::new(*width, *color)));
                    }
                }
                Shape::Sheet { places, color } => {
                    if let Some(points) = places.iter().map(place).collect::<Option<Vec<_>>>() {
                        painter.add(egui::Shape::convex_polygon(points, *color, Stroke::NONE));
                    }
                }
                Shape::Dot { place: at, color, radius } => {
                    if let Some(centre) = place(at) {
                        painter.circle(
                            centre,
                            *radius,
                            *color,
                            Stroke::new(1.0, Color32::from_black_alpha(180)),
                        );
                    }
                }
                Shape::Text { place: at, color, text } => {
                    if let Some(at) = place(at) {
                        let font = egui::FontId::proportional(13.0);
                        painter.text(
                            at + egui::vec2(8.0, -8.0),
                            egui::Align2::LEFT_BOTTOM,
                            text,
                            font,
                            *color,
                        );
                    }
                }
            }
        }
    }
}
