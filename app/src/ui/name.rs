//! A name that can be changed: shown as text to edit, given back when the editing ends.

use egui::{Id, TextEdit, Ui};

/// The new name, once, when another one was entered.
pub fn name_ui(ui: &mut Ui, kind: &str, name: &str) -> Option<String> {
    let id: Id = ui.scope_id().with((kind, name));
    let mut text = ui.data(|d| d.get_temp::<String>(id)).unwrap_or_else(|| name.to_owned());
    let label = ui.label("Name");
    let response = ui.add(TextEdit::singleline(&mut text).desired_width(150.0)).labelled_by(label.id);
    if response.lost_focus() {
        ui.data_mut(|d| d.remove::<String>(id));
        let text = text.trim();
        return (!text.is_empty() && text != name).then(|| text.to_owned());
    }
    if response.changed() {
        ui.data_mut(|d| d.insert_temp(id, text));
    }
    None
}
