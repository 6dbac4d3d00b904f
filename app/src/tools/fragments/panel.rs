//! The panel of the fragments.

use egui::{Button, ComboBox, Ui};
use render::volume::{Shape, Side};

use super::Fragments;
use crate::case::{Edit, Fragment, Volume};
use crate::host::context::ToolContext;
use crate::scene;
use crate::ui::pose::PoseInput;
use crate::ui::{name, theme};

pub(super) fn show_ui(tool: &mut Fragments, ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    let chosen = ctx.selection.volume.clone().unwrap_or_default();
    ComboBox::from_label("Volume").selected_text(&chosen).show_ui(ui, |ui| {
        for volume in &ctx.case.volumes {
            if ui.selectable_label(chosen == volume.id, &volume.id).clicked() {
                ctx.selection.volume = Some(volume.id.clone());
            }
        }
    });
    let Some(volume) = ctx.volume() else {
        theme::quiet_ui(ui, "No volume yet. Open one in the panel Volumes.");
        return;
    };
    split_ui(ctx, ui, volume);
    tool.ticked.retain(|id| ctx.case.fragment(id).is_some_and(|f| f.volume == volume.id));
    if ctx.case.fragments_of(&volume.id).next().is_none() {
        theme::quiet_ui(ui, "The volume is whole.");
        return;
    }
    ui.separator();
    for fragment in ctx.case.fragments_of(&volume.id) {
        row_ui(tool, ctx, ui, fragment);
    }
    fuse_ui(tool, ctx, ui, volume);
    if let Some(fragment) = ctx.fragment().filter(|f| f.volume == volume.id) {
        ui.separator();
        chosen_ui(tool, ctx, ui, volume, fragment);
    }
}

fn split_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, volume: &Volume) {
    theme::section_ui(ui, "Split by");
    if ctx.case.cutters.is_empty() {
        theme::quiet_ui(ui, "No cutter yet. Add one in the panel Cutting.");
        return;
    }
    ui.horizontal_wrapped(|ui| {
        for cutter in &ctx.case.cutters {
            let mut chosen = ctx.selection.split_by.contains(&cutter.id);
            if ui.checkbox(&mut chosen, &cutter.id).changed() {
                if chosen {
                    ctx.selection.split_by.insert(cutter.id.clone());
                } else {
                    ctx.selection.split_by.remove(&cutter.id);
                }
            }
        }
    });
    let corners = scene::unmoved_corners(volume, ctx.assets);
    let ready = corners.is_some() && !ctx.selection.split_by.is_empty();
    let button = ui.add_enabled(ready, Button::new("Split into pieces"));
    let button = button.on_disabled_hover_text("Choose at least one cutter; the volume must be loaded.");
    if button.clicked()
        && let Some(corners) = corners
    {
        let cutters = ctx.selection.split_by.iter().cloned().collect();
        ctx.edit(Edit::Split { volume: volume.id.clone(), cutters, corners });
    }
}

fn row_ui(tool: &mut Fragments, ctx: &mut ToolContext<'_>, ui: &mut Ui, fragment: &Fragment) {
    ui.horizontal(|ui| {
        let mut visible = fragment.visible;
        let shown = ui.checkbox(&mut visible, "").on_hover_text("Show");
        shown.widget_info(|| {
            let name = format!("Show {}", fragment.id);
            egui::WidgetInfo::selected(egui::Role::CheckBox, true, visible, name)
        });
        if shown.changed() {
            ctx.edit(Edit::SetFragmentVisible { id: fragment.id.clone(), visible });
        }
        let chosen = ctx.selection.fragment.as_deref() == Some(fragment.id.as_str());
        if ui.selectable_label(chosen, &fragment.id).clicked() {
            ctx.selection.fragment = Some(fragment.id.clone());
        }
        let sides = fragment.keep.iter().map(|(id, side)| match side {
            Side::Plus => format!("{id} +"),
            Side::Minus => format!("{id} −"),
        });
        theme::quiet_ui(ui, sides.collect::<Vec<_>>().join(", "));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let mut ticked = tool.ticked.contains(&fragment.id);
            let tick = ui.checkbox(&mut ticked, "fuse");
            if tick.changed() {
                if ticked {
                    tool.ticked.insert(fragment.id.clone());
                } else {
                    tool.ticked.remove(&fragment.id);
                }
            }
        });
    });
}

fn fuse_ui(tool: &mut Fragments, ctx: &mut ToolContext<'_>, ui: &mut Ui, volume: &Volume) {
    ui.horizontal(|ui| {
        let corners = scene::unmoved_corners(volume, ctx.assets);
        let ready = corners.is_some() && tool.ticked.len() > 1;
        let button = ui.add_enabled(ready, Button::new("Fuse the ticked"));
        let button = button.on_disabled_hover_text("Tick two or more pieces that were cut from one.");
        if button.clicked()
            && let Some(corners) = corners
        {
            // In the case's order, so that the first is the one that stands first in the list.
            let ids = ctx.case.fragments_of(&volume.id).map(|f| f.id.clone());
            let ids = ids.filter(|id| tool.ticked.contains(id)).collect();
            ctx.edit(Edit::Fuse { ids, corners });
            tool.ticked.clear();
        }
        if ui.button("Make the volume whole").clicked() {
            ctx.edit(Edit::Unsplit { volume: volume.id.clone() });
        }
    });
}

/// Splits one fragment by the chosen cutter, where both are now.
fn split_chosen_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, volume: &Volume, fragment: &Fragment) {
    let (Some(cutter), Some(corners)) = (ctx.cutter(), scene::unmoved_corners(volume, ctx.assets)) else {
        return;
    };
    let button = ui.button(format!("Split it by {} where it is now", cutter.id));
    if button.on_hover_text("The other fragments stay as they are.").clicked() {
        let (id, cutter) = (fragment.id.clone(), cutter.id.clone());
        ctx.edit(Edit::SplitFragment { id, cutter, corners });
    }
}

fn chosen_ui(
    tool: &mut Fragments,
    ctx: &mut ToolContext<'_>,
    ui: &mut Ui,
    volume: &Volume,
    fragment: &Fragment,
) {
    ui.horizontal(|ui| {
        if let Some(to) = name::name_ui(ui, "fragment", &fragment.id) {
            ctx.edit(Edit::RenameFragment { id: fragment.id.clone(), to });
        }
        if ui.add(Button::new("Remove").small()).clicked() {
            ctx.edit(Edit::RemoveFragment { id: fragment.id.clone() });
        }
    });
    let Some(grid) = ctx.assets.grid(volume) else {
        theme::quiet_ui(ui, "The volume is not loaded.");
        return;
    };
    split_chosen_ui(ctx, ui, volume, fragment);
    let centre = tool.middle(ctx, volume, &grid, fragment);
    // The direction of the chosen cutter, where this fragment was cut by it.
    let offered = ctx.cutter().filter(|c| fragment.keep.contains_key(&c.id)).and_then(|c| {
        let axis = match *c.cutter.shape() {
            Shape::Plane { normal, .. } | Shape::Blade { normal, .. } => normal,
            Shape::Cylinder { axis, .. } => axis,
            Shape::Dome { .. } => return None,
        };
        Some((c.id.as_str(), fragment.pose.vector(&axis)))
    });
    let input = PoseInput { pose: fragment.pose, centre, crosshair: ctx.crosshair(), offered };
    if let Some(pose) = tool.pose.ui(ui, &input) {
        ctx.edit(Edit::SetFragmentPose { id: fragment.id.clone(), pose });
    }
}
