//! The page behind "?".

use egui::{Context, Grid, Window};

use crate::ui::theme;

const SPATIAL: [[&str; 2]; 7] = [
    ["Left drag", "turn the view; on a handle: move or turn the cutter"],
    ["Middle drag, or Shift + left", "pan"],
    ["Wheel, or right drag", "zoom"],
    ["Double click", "crosshair to what is seen there"],
    ["A P L R S I", "look from that side"],
    ["A face of the cube", "look at that side"],
    ["Escape", "put back what is being dragged"],
];

const SECTIONS: [[&str; 2]; 8] = [
    ["Left click or drag", "move the crosshair; the other views follow"],
    ["Left drag of a dot on a line", "turn that section"],
    ["Left drag with the Labels tool", "paint"],
    ["Wheel", "next slice"],
    ["Right drag", "window: width across, level upwards"],
    ["Ctrl + wheel", "zoom"],
    ["Middle drag, or Shift + left", "pan"],
    ["Double click", "this view alone, and back"],
];

const PROGRAM: [[&str; 2]; 4] = [
    ["Ctrl + Z, Ctrl + Shift + Z", "undo, redo"],
    ["Ctrl + O, Ctrl + S", "open, save"],
    ["Ctrl + Shift + S", "save as another file"],
    ["Drop files on the window", "open them"],
];

/// Draws the page while `open`.
pub fn help_ui(ctx: &Context, open: &mut bool) {
    Window::new("Pointer and keys")
        .open(open)
        .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO)
        .resizable(false)
        .collapsible(false)
        .show(ctx, |ui| {
            for (title, rows) in [
                ("In the 3D view", SPATIAL.as_slice()),
                ("In a section", &SECTIONS),
                ("Everywhere", &PROGRAM),
            ] {
                theme::section_ui(ui, title);
                Grid::new(title).num_columns(2).show(ui, |ui| {
                    for [keys, does] in rows {
                        ui.monospace(*keys);
                        ui.label(*does);
                        ui.end_row();
                    }
                });
            }
            ui.add_space(6.0);
            theme::quiet_ui(
                ui,
                "Sections and values are sampled from the data as loaded, never from a texture.",
            );
        });
}
