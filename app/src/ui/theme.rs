//! The look: dark and quiet, so that the pictures are the brightest thing on the screen.

use egui::{Color32, FontFamily, FontId, TextStyle, Visuals};

/// Behind the panels.
pub const PANEL: Color32 = Color32::from_rgb(30, 33, 37);
/// Behind the views and between them.
pub const STAGE: Color32 = Color32::from_rgb(12, 13, 15);
/// What is chosen, and what can be dragged.
pub const ACCENT: Color32 = Color32::from_rgb(86, 172, 232);
/// Cutters and their handles.
pub const CUTTER: Color32 = Color32::from_rgb(236, 112, 208);
/// Something under the pointer.
pub const HOT: Color32 = Color32::from_rgb(255, 226, 120);
/// Words that matter less.
pub const QUIET: Color32 = Color32::from_rgb(158, 165, 174);
/// Something to look at before going on.
pub const CAUTION: Color32 = Color32::from_rgb(240, 184, 90);
/// Something that failed.
pub const FAULT: Color32 = Color32::from_rgb(240, 110, 100);

/// Sets colours and text sizes.
pub fn apply(ctx: &egui::Context) {
    ctx.set_theme(egui::Theme::Dark);
    let mut visuals = Visuals::dark();
    visuals.panel_fill = PANEL;
    visuals.window_fill = PANEL;
    visuals.extreme_bg_color = Color32::from_rgb(20, 22, 25);
    visuals.selection.bg_fill = Color32::from_rgb(38, 92, 134);
    visuals.hyperlink_color = ACCENT;
    visuals.override_text_color = Some(Color32::from_rgb(224, 228, 232));
    ctx.set_visuals_of(egui::Theme::Dark, visuals);
    ctx.all_styles_mut(|style| {
        let sizes = [
            (TextStyle::Heading, 16.0, FontFamily::Proportional),
            (TextStyle::Body, 13.5, FontFamily::Proportional),
            (TextStyle::Button, 13.5, FontFamily::Proportional),
            (TextStyle::Small, 11.5, FontFamily::Proportional),
            (TextStyle::Monospace, 12.5, FontFamily::Monospace),
        ];
        style.text_styles = sizes.into_iter().map(|(s, size, f)| (s, FontId::new(size, f))).collect();
        style.spacing.item_spacing = egui::vec2(6.0, 5.0);
        style.spacing.slider_width = 150.0;
    });
}

/// A small heading within a panel.
pub fn section_ui(ui: &mut egui::Ui, title: &str) {
    ui.add_space(6.0);
    ui.label(egui::RichText::new(title).strong());
}

/// A line of quiet words.
pub fn quiet_ui(ui: &mut egui::Ui, text: impl Into<String>) {
    ui.label(egui::RichText::new(text.into()).small().color(QUIET));
}
