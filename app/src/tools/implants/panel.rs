//! The panel of the implants.

use egui::{Button, ComboBox, Slider, Ui};
use render::volume::Side;

use super::place;
use crate::case::{Edit, Implant};
use crate::host::context::{Request, Shading, ToolContext};
use crate::scene;
use crate::ui::pose::{PoseEditor, PoseInput};
use crate::ui::{name, theme, value};

pub(super) fn show_ui(pose: &mut PoseEditor, ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    if ui.button("Open a surface…").on_hover_text("STL, OBJ, PLY, glTF").clicked() {
        ctx.request(Request::OpenFile);
    }
    if ctx.case.implants.is_empty() {
        theme::quiet_ui(ui, "No implant yet. Open a surface, or drop its file on the window.");
        return;
    }
    for implant in &ctx.case.implants {
        row_ui(ctx, ui, implant);
    }
    if let Some(implant) = ctx.implant() {
        ui.separator();
        chosen_ui(pose, ctx, ui, implant);
    }
}

fn row_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, implant: &Implant) {
    ui.horizontal(|ui| {
        let mut visible = implant.visible;
        let shown = ui.checkbox(&mut visible, "").on_hover_text("Show in all views");
        shown.widget_info(|| {
            let name = format!("Show {}", implant.id);
            egui::WidgetInfo::selected(egui::Role::CheckBox, true, visible, name)
        });
        if shown.changed() {
            ctx.edit(Edit::SetImplantVisible { id: implant.id.clone(), visible });
        }
        let chosen = ctx.selection.implant.as_deref() == Some(implant.id.as_str());
        if ui.selectable_label(chosen, &implant.id).clicked() {
            ctx.selection.implant = Some(implant.id.clone());
        }
        if ctx.assets.mesh(implant).is_none() {
            theme::quiet_ui(ui, if implant.visible { "not loaded" } else { "loads when shown" });
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            if ui.add(Button::new("Remove").small()).clicked() {
                ctx.edit(Edit::RemoveImplant { id: implant.id.clone() });
            }
        });
    });
}

fn chosen_ui(pose: &mut PoseEditor, ctx: &mut ToolContext<'_>, ui: &mut Ui, implant: &Implant) {
    let id = || implant.id.clone();
    ui.horizontal(|ui| {
        if let Some(to) = name::name_ui(ui, "implant", &implant.id) {
            ctx.edit(Edit::RenameImplant { id: id(), to });
        }
    });
    ui.horizontal(|ui| {
        let mut rgb = implant.color.map(|c| c as f32);
        let label = ui.label("Colour");
        if ui.color_edit_button_rgb(&mut rgb).labelled_by(label.id).changed() {
            let color = rgb.map(|c| f64::from(c).clamp(0.0, 1.0));
            ctx.edit(Edit::SetImplantColor { id: id(), color });
        }
        let mut opacity = implant.opacity;
        if ui.add(Slider::new(&mut opacity, 0.0..=1.0).text("Opacity")).changed() {
            ctx.edit(Edit::SetImplantOpacity { id: id(), opacity });
        }
    });
    let mut lit = implant.shading == Shading::Lit;
    if ui.checkbox(&mut lit, "Lit from the eye").changed() {
        let shading = if lit { Shading::Lit } else { Shading::None };
        ctx.edit(Edit::SetImplantShading { id: id(), shading });
    }
    let Some(mesh) = ctx.assets.mesh(implant) else {
        theme::quiet_ui(ui, "The surface is not loaded.");
        return;
    };
    scale_ui(ctx, ui, implant, place::longest(mesh));
    theme::quiet_ui(ui, format!("{} triangles", mesh.triangles().len()));
    keep_ui(ctx, ui, implant);
    let middle = place::middle(mesh, implant.scale);
    if ui.button("Put it at the crosshair").clicked() {
        let pose = place::moved_to(&implant.pose, &middle, &ctx.crosshair());
        ctx.edit(Edit::SetImplantPose { id: id(), pose });
    }
    let input = PoseInput { pose: implant.pose, centre: middle, crosshair: ctx.crosshair(), offered: None };
    if let Some(pose) = pose.ui(ui, &input) {
        ctx.edit(Edit::SetImplantPose { id: id(), pose });
    }
}

/// Which side of each cutter stays.
fn keep_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, implant: &Implant) {
    const CHOICES: [(Option<Side>, &str); 3] =
        [(None, "not cut"), (Some(Side::Plus), "keeps +"), (Some(Side::Minus), "keeps −")];
    for cutter in &ctx.case.cutters {
        let now = implant.keep.get(&cutter.id).copied();
        let mut chosen = now;
        let words = CHOICES.iter().find(|(side, _)| *side == now).map_or("", |(_, words)| words);
        ComboBox::from_label(format!("Cut by {}", cutter.id)).selected_text(words).show_ui(ui, |ui| {
            for (side, words) in CHOICES {
                ui.selectable_value(&mut chosen, side, words);
            }
        });
        if chosen != now {
            let mut keep = implant.keep.clone();
            keep.remove(&cutter.id);
            keep.extend(chosen.map(|side| (cutter.id.clone(), side)));
            ctx.edit(Edit::SetImplantKeep { id: implant.id.clone(), keep });
        }
    }
    let Some(cut) = scene::implant_cut(ctx.case, implant, ctx.assets) else { return };
    match (cut.open, cut.mesh) {
        (0, Some(_)) => {}
        (_, None) => theme::quiet_ui(ui, "The cutters leave nothing of it."),
        (_, Some(_)) => theme::quiet_ui(ui, "The surface is open where it is cut, so the cut is not closed."),
    }
}

fn scale_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, implant: &Implant, longest: f64) {
    let mut scale = implant.scale;
    ui.horizontal(|ui| {
        value::number_ui(ui, "Millimetres per unit", &mut scale, 0.01);
        theme::quiet_ui(ui, format!("longest side {:.1} mm", longest * implant.scale));
    });
    let likely = place::likely_scale(longest);
    if implant.scale == 1.0 && likely != 1.0 && ui.button("The file is in metres").clicked() {
        scale = likely;
    }
    if scale != implant.scale && scale.is_finite() && scale > 0.0 {
        ctx.edit(Edit::SetImplantScale { id: implant.id.clone(), scale });
    }
}
