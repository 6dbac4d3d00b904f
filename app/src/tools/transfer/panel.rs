//! The panel of the transfer function.

use std::sync::Arc;

use egui::{ComboBox, Ui};
use render::volume::{ControlPoint, Transfer};

use super::TransferTool;
use crate::case::{Edit, Volume};
use crate::host::context::{Shading, ToolContext};
use crate::presets;
use crate::ui::{curve, theme, value};

pub(super) fn show_ui(tool: &mut TransferTool, ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    volume_ui(ctx, ui);
    let Some(volume) = ctx.volume() else {
        theme::quiet_ui(ui, "No volume yet. Open one in the panel Volumes.");
        return;
    };
    let Some(grid) = ctx.assets.grid(volume) else {
        theme::quiet_ui(ui, "The volume is not loaded.");
        return;
    };
    preset_ui(ctx, ui, volume, grid.range());
    let transfer = &volume.transfer;
    let heights = tool.heights(&grid).to_vec();
    let points = tool.curve.ui(ui, transfer, &heights, grid.range());
    let [low, high] = grid.range();
    ui.horizontal(|ui| {
        theme::quiet_ui(ui, format!("{low:.0}"));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            theme::quiet_ui(ui, format!("{high:.0}"));
            ui.vertical_centered(|ui| theme::quiet_ui(ui, "value across, opacity upwards (square root)"));
        });
    });
    let points = point_ui(tool, ui, transfer, (high - low) / 400.0).or(points);
    let points = shift_ui(ui, transfer, (high - low) / 400.0).or(points);
    let mut unit_mm = transfer.unit_mm();
    ui.horizontal(|ui| value::positive_mm_ui(ui, "Opacity is that of", &mut unit_mm));
    let points = points.or_else(|| (unit_mm != transfer.unit_mm()).then(|| transfer.points().to_vec()));
    // A function that is not valid (a number typed out of range) is not taken.
    if let Some(made) = points.and_then(|p| Transfer::new(p, unit_mm).ok()) {
        ctx.edit(Edit::SetTransfer { id: volume.id.clone(), transfer: Arc::new(made) });
    }
    let mut lit = volume.shading == Shading::Lit;
    if ui.checkbox(&mut lit, "Lit by the gradient").changed() {
        let shading = if lit { Shading::Lit } else { Shading::None };
        ctx.edit(Edit::SetVolumeShading { id: volume.id.clone(), shading });
    }
}

fn volume_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    let chosen = ctx.selection.volume.clone().unwrap_or_default();
    ComboBox::from_label("Volume").selected_text(&chosen).show_ui(ui, |ui| {
        for volume in &ctx.case.volumes {
            if ui.selectable_label(chosen == volume.id, &volume.id).clicked() {
                ctx.selection.volume = Some(volume.id.clone());
            }
        }
    });
}

fn preset_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, volume: &Volume, range: [f64; 2]) {
    let is_now = |p: &&presets::Preset| p.transfer(range).is_ok_and(|t| t == *volume.transfer);
    let shown = presets::presets().iter().find(is_now).map_or("own", |p| p.name.as_str());
    ComboBox::from_label("Preset").selected_text(shown).width(180.0).show_ui(ui, |ui| {
        for preset in presets::presets() {
            let choice = ui.selectable_label(shown == preset.name, &preset.name);
            if choice.on_hover_text(&preset.about).clicked()
                && let Ok(made) = preset.transfer(range)
            {
                ctx.edit(Edit::SetTransfer { id: volume.id.clone(), transfer: Arc::new(made) });
            }
        }
    });
}

fn point_ui(
    tool: &mut TransferTool,
    ui: &mut Ui,
    transfer: &Transfer,
    speed: f64,
) -> Option<Vec<ControlPoint>> {
    let index = tool.curve.chosen.filter(|&i| i < transfer.points().len());
    let Some(index) = index else {
        theme::quiet_ui(ui, "Choose a point of the curve to set it by numbers.");
        return None;
    };
    let mut point = transfer.points()[index];
    let mut result = None;
    ui.horizontal(|ui| {
        let moved = value::number_ui(ui, "Value", &mut point.value, speed).changed();
        let faded = value::number_ui(ui, "Opacity", &mut point.rgba[3], 0.005).changed();
        let mut rgb = [0, 1, 2].map(|c| point.rgba[c] as f32);
        let colored = ui.color_edit_button_rgb(&mut rgb).changed();
        if moved || faded || colored {
            let mut points = curve::moved(transfer.points(), index, point.value, point.rgba[3]);
            if colored {
                points[index].rgba[..3].copy_from_slice(&rgb.map(|c| f64::from(c).clamp(0.0, 1.0)));
            }
            result = Some(points);
        }
        if ui.add_enabled(transfer.points().len() > 1, egui::Button::new("Remove").small()).clicked() {
            result = Some(curve::removed(transfer.points(), index));
            tool.curve.chosen = None;
        }
    });
    result
}

fn shift_ui(ui: &mut Ui, transfer: &Transfer, speed: f64) -> Option<Vec<ControlPoint>> {
    let first = transfer.points().first()?.value;
    let mut wish = first;
    let response = ui.horizontal(|ui| value::number_ui(ui, "All from", &mut wish, speed)).inner;
    let response = response.on_hover_text("The value of the first point; the others keep their distance");
    (response.changed() && wish.is_finite()).then(|| curve::shifted(transfer.points(), wish - first))
}
