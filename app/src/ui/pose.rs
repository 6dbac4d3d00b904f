//! A pose by numbers: where the middle of a thing went, and turns about a chosen axis and centre.

use egui::{ComboBox, Grid, Ui};
use render::volume::{Affine, Point, Vector};

use super::theme;
use super::value;

/// What a turn is about; the axis of a right-handed turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Axis {
    /// From the patient's right to the left: +x.
    #[default]
    ToLeft,
    /// From the front to the back: +y.
    ToPosterior,
    /// From the feet to the head: +z.
    ToSuperior,
    /// The direction the tool offers: a cutter's normal.
    Offered,
}

/// Where the axis goes through.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Centre {
    /// The middle of the thing, where it is now.
    #[default]
    Own,
    /// Where the sections cross.
    Crosshair,
}

/// What the editor is about.
#[derive(Debug, Clone)]
pub struct PoseInput<'a> {
    /// The pose as it is; rigid.
    pub pose: Affine,
    /// The middle of the thing in its own, unmoved place.
    pub centre: Point,
    /// Where the sections cross; world mm.
    pub crosshair: Point,
    /// Another axis to turn about, with its name.
    pub offered: Option<(&'a str, Vector)>,
}

/// The editor's choices, and the turn being made.
#[derive(Debug, Clone, Default)]
pub struct PoseEditor {
    axis: Axis,
    centre: Centre,
    turn: Option<Turn>,
}

/// A turn in the making: `angle_deg` from where it began.
#[derive(Debug, Clone, Copy)]
struct Turn {
    angle_deg: f64,
    began: Affine,
    made: Affine,
}

/// `pose` with its thing's middle at another displacement from its own place; mm.
pub fn displaced(pose: Affine, centre: &Point, displacement: Vector) -> Affine {
    let now = pose.point(centre) - centre;
    Affine::translation(displacement - now) * pose
}

/// The angle of the one turn that a rigid pose amounts to; radians, 0 to π.
pub fn angle_rad(pose: &Affine) -> f64 {
    let cosine = ((pose.linear().trace() - 1.0) / 2.0).clamp(-1.0, 1.0);
    cosine.acos()
}

impl PoseEditor {
    /// Draws the editor; the new pose where a number was changed.
    pub fn ui(&mut self, ui: &mut Ui, input: &PoseInput<'_>) -> Option<Affine> {
        let mut result = None;
        let moved = input.pose.point(&input.centre) - input.centre;
        theme::section_ui(ui, "Moved by");
        Grid::new("displacement").num_columns(2).show(ui, |ui| {
            let names = ["Left (−right)", "Posterior (−anterior)", "Superior (−inferior)"];
            for (axis, name) in names.into_iter().enumerate() {
                let mut part = moved[axis];
                if value::mm_ui(ui, name, &mut part).changed() && part.is_finite() {
                    let mut wish = moved;
                    wish[axis] = part;
                    result = Some(displaced(input.pose, &input.centre, wish));
                }
                ui.end_row();
            }
        });
        theme::section_ui(ui, "Turn");
        let axis = self.axis_ui(ui, input);
        self.centre_ui(ui);
        let through = match self.centre {
            Centre::Own => input.pose.point(&input.centre),
            Centre::Crosshair => input.crosshair,
        };
        // Something else moved it (undo, a drag): the turn in the making is over.
        if self.turn.is_some_and(|t| t.made != input.pose) {
            self.turn = None;
        }
        let began = self.turn.map_or(input.pose, |t| t.began);
        let mut angle_deg = self.turn.map_or(0.0, |t| t.angle_deg);
        ui.horizontal(|ui| {
            let changed = value::degrees_ui(ui, "Turn by", &mut angle_deg).changed();
            if changed && angle_deg.is_finite() {
                let made = Affine::rotation_about(through, axis, angle_deg.to_radians()) * began;
                self.turn = Some(Turn { angle_deg, began, made });
                result = Some(made);
            }
        });
        let total = angle_rad(&input.pose).to_degrees();
        theme::quiet_ui(ui, format!("{:.2} mm moved, {total:.2}° turned in all", moved.norm()));
        if ui
            .add_enabled(input.pose != Affine::identity(), egui::Button::new("Back to its own place"))
            .clicked()
        {
            self.turn = None;
            result = Some(Affine::identity());
        }
        result
    }

    fn axis_ui(&mut self, ui: &mut Ui, input: &PoseInput<'_>) -> Vector {
        if input.offered.is_none() && self.axis == Axis::Offered {
            self.axis = Axis::default();
        }
        let before = self.axis;
        let name = |axis: Axis| match axis {
            Axis::ToLeft => "right to left axis".to_owned(),
            Axis::ToPosterior => "front to back axis".to_owned(),
            Axis::ToSuperior => "feet to head axis".to_owned(),
            Axis::Offered => input.offered.map_or_else(String::new, |(name, _)| name.to_owned()),
        };
        ComboBox::from_label("Axis").selected_text(name(self.axis)).show_ui(ui, |ui| {
            let mut all = vec![Axis::ToLeft, Axis::ToPosterior, Axis::ToSuperior];
            all.extend(input.offered.map(|_| Axis::Offered));
            for axis in all {
                ui.selectable_value(&mut self.axis, axis, name(axis));
            }
        });
        if self.axis != before {
            self.turn = None;
        }
        match self.axis {
            Axis::ToLeft => Vector::x(),
            Axis::ToPosterior => Vector::y(),
            Axis::ToSuperior => Vector::z(),
            Axis::Offered => input.offered.map_or_else(Vector::z, |(_, axis)| axis),
        }
    }

    fn centre_ui(&mut self, ui: &mut Ui) {
        let before = self.centre;
        let name = |centre| if centre == Centre::Own { "its own middle" } else { "the crosshair" };
        ComboBox::from_label("Through").selected_text(name(self.centre)).show_ui(ui, |ui| {
            for centre in [Centre::Own, Centre::Crosshair] {
                ui.selectable_value(&mut self.centre, centre, name(centre));
            }
        });
        if self.centre != before {
            self.turn = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_displacement_moves_the_middle_there_and_keeps_the_turn() {
        let centre = Point::new(5.0, -3.0, 40.0);
        let pose = Affine::rotation_about(Point::new(1.0, 2.0, 3.0), Vector::new(1.0, 1.0, 0.0), 0.8);
        let wish = Vector::new(-7.0, 2.5, 0.0);
        let made = displaced(pose, &centre, wish);
        assert!((made.point(&centre) - centre - wish).norm() < 1e-12, "the middle is where it was asked to");
        assert!((made.linear() - pose.linear()).norm() < 1e-15, "the turn is unchanged");
        assert!(made.require_rigid().is_ok(), "still rigid");
    }

    #[test]
    fn the_angle_is_that_of_the_turn() {
        for angle in [0.0, 0.3, 2.0, std::f64::consts::PI] {
            let pose = Affine::rotation_about(Point::origin(), Vector::new(0.2, -0.5, 1.0), angle);
            assert!((angle_rad(&pose) - angle).abs() < 1e-6, "{angle}");
        }
    }
}
