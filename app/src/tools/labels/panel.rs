//! The panel of the labels.

use egui::{Button, ComboBox, DragValue, Slider, Ui};

use super::LabelsTool;
use crate::case::labels::LabelChange;
use crate::case::{Edit, LabelSet};
use crate::host::context::ToolContext;
use crate::ui::{theme, value};

pub(super) fn show_ui(tool: &mut LabelsTool, ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    new_ui(tool, ctx, ui);
    if ctx.case.labels.is_empty() {
        theme::quiet_ui(ui, "No labels yet.");
        return;
    }
    ui.separator();
    let chosen = tool.set(ctx).map(|set| set.id.clone());
    for set in &ctx.case.labels {
        ui.horizontal(|ui| row_ui(tool, ctx, ui, set, chosen.as_deref() == Some(set.id.as_str())));
    }
    let Some(set) = tool.set(ctx) else { return };
    ui.separator();
    brush_ui(tool, ui);
    ui.separator();
    colors_ui(tool, ctx, ui, set);
}

fn new_ui(tool: &mut LabelsTool, ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    let Some(volume) = ctx.volume() else {
        theme::quiet_ui(ui, "Open a volume to paint on.");
        return;
    };
    theme::section_ui(ui, &format!("New, on {}", volume.id));
    if ui.button("Empty labels").clicked() {
        let id = ctx.case.free_labels_id("labels");
        tool.set = Some(id.clone());
        tool.is_painting = true;
        ctx.edit(Edit::AddLabels(Box::new(LabelSet::new(id, volume.id.clone(), None))));
    }
    let others = ctx.case.volumes.iter().filter(|v| v.id != volume.id);
    let whole = others.filter(|v| ctx.assets.grid(v).is_some_and(|g| g.range()[0] >= 0.0));
    let mut made = None;
    ComboBox::from_label("become its labels").selected_text("Open volume…").show_ui(ui, |ui| {
        for other in whole {
            if ui.selectable_label(false, &other.id).clicked() {
                made = Some(other.id.clone());
            }
        }
    });
    if let Some(id) = made {
        ctx.edit(Edit::MakeLabels { id, volume: volume.id.clone() });
    }
}

fn row_ui(tool: &mut LabelsTool, ctx: &mut ToolContext<'_>, ui: &mut Ui, set: &LabelSet, is_chosen: bool) {
    let mut visible = set.visible;
    let shown = ui.checkbox(&mut visible, "").on_hover_text("Show in all views");
    shown.widget_info(|| {
        egui::WidgetInfo::selected(egui::Role::CheckBox, true, visible, format!("Show labels {}", set.id))
    });
    let mut change = None;
    if shown.changed() {
        change = Some(LabelChange::Visible(visible));
    }
    if ui.selectable_label(is_chosen, &set.id).clicked() {
        tool.set = Some(set.id.clone());
    }
    theme::quiet_ui(ui, format!("on {}", set.volume));
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        if ui.add(Button::new("Remove").small()).clicked() {
            change = Some(LabelChange::Remove);
        }
    });
    if let Some(change) = change {
        ctx.edit(Edit::ChangeLabels { id: set.id.clone(), change });
    }
}

fn brush_ui(tool: &mut LabelsTool, ui: &mut Ui) {
    ui.checkbox(&mut tool.is_painting, "Paint in the sections");
    ui.add_enabled_ui(tool.is_painting, |ui| {
        ui.horizontal(|ui| {
            let label = ui.label("Label");
            ui.add(DragValue::new(&mut tool.label).range(1..=u16::MAX)).labelled_by(label.id);
            ui.checkbox(&mut tool.erases, "Erase");
        });
        ui.horizontal(|ui| {
            value::positive_mm_ui(ui, "Radius", &mut tool.radius_mm);
            tool.radius_mm = tool.radius_mm.min(200.0);
        });
    });
    theme::quiet_ui(ui, "A ball of paint, in the piece that the stroke begins on. Saved beside the case.");
}

fn colors_ui(tool: &mut LabelsTool, ctx: &mut ToolContext<'_>, ui: &mut Ui, set: &LabelSet) {
    let Some(labels) = ctx.assets.labels(ctx.case, set) else {
        theme::quiet_ui(ui, "not loaded");
        return;
    };
    if labels.counts.is_empty() {
        theme::quiet_ui(ui, "Nothing is painted.");
    }
    let sample_ml = labels.sample_mm3() / 1000.0;
    for (&label, &count) in labels.counts.iter().take(200) {
        ui.horizontal(|ui| {
            let [r, g, b, mut a] = set.color(label);
            let mut rgb = [r, g, b].map(|c| c as f32);
            let picked = ui.color_edit_button_rgb(&mut rgb).changed();
            let is_brush = u32::from(tool.label) == label;
            if ui.selectable_label(is_brush, label.to_string()).on_hover_text("Paint with it").clicked() {
                tool.label = u16::try_from(label).unwrap_or(u16::MAX);
            }
            let slider = Slider::new(&mut a, 0.0..=1.0).show_value(false);
            let faded = ui.add(slider).on_hover_text("Opacity").changed();
            theme::quiet_ui(ui, format!("{:.2} ml", count as f64 * sample_ml));
            if picked || faded {
                let [red, green, blue] = if picked { rgb.map(f64::from) } else { [r, g, b] };
                let color = [red, green, blue, a];
                let change = LabelChange::Color { label, color };
                ctx.edit(Edit::ChangeLabels { id: set.id.clone(), change });
            }
        });
    }
}
