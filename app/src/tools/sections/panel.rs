//! The panel of the sections.

use egui::{Button, ComboBox, DragValue, Grid, Ui};
use nalgebra::Rotation3;

use crate::host::context::{Slab, SlabMode, ToolContext};
use crate::host::views::Orientation;
use crate::ui::{theme, value};

pub(super) fn show_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    theme::section_ui(ui, "Where they cross");
    let mut crosshair = ctx.crosshair();
    ui.horizontal(|ui| {
        for (axis, name) in ["L", "P", "S"].into_iter().enumerate() {
            if value::mm_ui(ui, name, &mut crosshair[axis]).changed() && crosshair[axis].is_finite() {
                ctx.views.crosshair = Some(crosshair);
            }
        }
    });
    for orientation in Orientation::ALL {
        ui.separator();
        ui.push_id(orientation.title(), |ui| one_ui(ctx, ui, orientation));
    }
    ui.add_space(4.0);
    theme::quiet_ui(ui, "In a section: drag a dot on another section's line to turn that one.");
}

fn one_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, orientation: Orientation) {
    ui.horizontal(|ui| {
        ui.label(egui::RichText::new(orientation.title()).strong().color(orientation.color()));
        let turned = ctx.views.sections[orientation.index()].turn != Rotation3::identity();
        let name = format!("Back to {}", orientation.title().to_lowercase());
        if ui.add_enabled(turned, Button::new(name).small()).clicked() {
            ctx.views.sections[orientation.index()].turn = Rotation3::identity();
        }
    });
    let state = &mut ctx.views.sections[orientation.index()];
    let (x, y, z) = state.turn.euler_angles();
    let mut angles_deg = [x, y, z].map(f64::to_degrees);
    let mut turned = false;
    Grid::new("turn").num_columns(2).show(ui, |ui| {
        let names = ["right to left axis", "front to back axis", "feet to head axis"];
        for (angle, name) in angles_deg.iter_mut().zip(names) {
            turned |= value::degrees_ui(ui, name, angle).changed();
            ui.end_row();
        }
    });
    if turned && angles_deg.iter().all(|a| a.is_finite()) {
        let [x, y, z] = angles_deg.map(f64::to_radians);
        state.turn = Rotation3::from_euler_angles(x, y, z);
    }
    let mut by = 0.0;
    ui.horizontal(|ui| slab_ui(ui, &mut state.slab));
    if ui.horizontal(|ui| value::mm_ui(ui, "Move across by", &mut by).changed()).inner && f64::is_finite(by) {
        let normal = ctx.views.normal(orientation);
        ctx.views.crosshair = Some(ctx.crosshair() + normal * by);
    }
}

fn slab_ui(ui: &mut Ui, slab: &mut Slab) {
    let label = ui.label("Thickness");
    let drag =
        DragValue::new(&mut slab.thickness_mm).speed(0.1).range(0.0..=500.0).max_decimals(2).suffix(" mm");
    ui.add(drag).labelled_by(label.id);
    let name = |mode| match mode {
        SlabMode::Mean => "mean",
        SlabMode::Mip => "MIP",
        SlabMode::MinIp => "MinIP",
    };
    ComboBox::from_label("is shown").width(70.0).selected_text(name(slab.mode)).show_ui(ui, |ui| {
        for mode in [SlabMode::Mean, SlabMode::Mip, SlabMode::MinIp] {
            ui.selectable_value(&mut slab.mode, mode, name(mode));
        }
    });
}
