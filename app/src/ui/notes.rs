//! What a loader says of data: what needs care in sight, plain facts folded away.

use egui::{RichText, Ui};

use super::theme;
use crate::load::{Note, Severity};

/// Draws the notes of one asset.
pub fn notes_ui(ui: &mut Ui, notes: &[Note]) {
    for note in notes.iter().filter(|n| n.severity >= Severity::Caution) {
        ui.label(RichText::new(&note.text).small().color(theme::CAUTION));
    }
    let facts: Vec<_> = notes.iter().filter(|n| n.severity == Severity::Fact).collect();
    if !facts.is_empty() {
        ui.collapsing(format!("Notes ({})", facts.len()), |ui| {
            for note in facts {
                theme::quiet_ui(ui, note.text.clone());
            }
        });
    }
}
