//! Numbers with their unit, each with a name that a screen reader (and a test) finds it by.

use egui::{DragValue, Response, Ui};

/// A length; mm, dragged in tenths.
pub fn mm_ui(ui: &mut Ui, name: &str, value: &mut f64) -> Response {
    named_ui(ui, name, DragValue::new(value).speed(0.1).max_decimals(2).suffix(" mm"))
}

/// A length that must be positive; mm.
pub fn positive_mm_ui(ui: &mut Ui, name: &str, value: &mut f64) -> Response {
    let drag = DragValue::new(value).speed(0.1).range(0.01..=1e5).max_decimals(2).suffix(" mm");
    named_ui(ui, name, drag)
}

/// An angle; degrees, dragged in tenths.
pub fn degrees_ui(ui: &mut Ui, name: &str, value: &mut f64) -> Response {
    named_ui(ui, name, DragValue::new(value).speed(0.1).max_decimals(2).suffix("°"))
}

/// A plain number, dragged by `speed`.
pub fn number_ui(ui: &mut Ui, name: &str, value: &mut f64, speed: f64) -> Response {
    named_ui(ui, name, DragValue::new(value).speed(speed).max_decimals(3))
}

fn named_ui(ui: &mut Ui, name: &str, drag: DragValue<'_>) -> Response {
    let label = ui.label(name);
    ui.add(drag).labelled_by(label.id)
}
