//! The panel of the cutters.

use egui::{Button, Grid, Ui};
use render::volume::{Cutter, Point, Vector};

use super::turn::TurnEntry;
use crate::case::{Edit, NamedCutter};
use crate::host::camera::Facing;
use crate::host::context::ToolContext;
use crate::ui::{name, theme, value};

pub(super) fn show_ui(turn: &mut TurnEntry, ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    theme::section_ui(ui, "New, through the crosshair");
    ui.horizontal_wrapped(|ui| {
        let kinds =
            [("Axial plane", Vector::z()), ("Coronal plane", -Vector::y()), ("Sagittal plane", Vector::x())];
        for (title, normal) in kinds {
            if ui.button(title).clicked() {
                add(ctx, "plane", Cutter::plane(ctx.crosshair(), normal).ok());
            }
        }
        if ui.button("Cylinder").clicked() {
            add(ctx, "cylinder", Cutter::cylinder(ctx.crosshair(), Vector::z(), 25.0).ok());
        }
    });
    if ctx.case.cutters.is_empty() {
        theme::quiet_ui(ui, "No cutter yet.");
        return;
    }
    ui.separator();
    for cutter in &ctx.case.cutters {
        ui.horizontal(|ui| {
            let chosen = ctx.selection.cutter.as_deref() == Some(cutter.id.as_str());
            if ui.selectable_label(chosen, &cutter.id).clicked() {
                ctx.selection.cutter = Some(cutter.id.clone());
            }
            theme::quiet_ui(ui, describe(&cutter.cutter));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if ui.add(Button::new("Remove").small()).clicked() {
                    ctx.edit(Edit::RemoveCutter { id: cutter.id.clone() });
                }
            });
        });
    }
    if let Some(cutter) = ctx.cutter() {
        ui.separator();
        chosen_ui(turn, ctx, ui, cutter);
    }
}

fn add(ctx: &mut ToolContext<'_>, wish: &str, cutter: Option<Cutter>) {
    // The crosshair and these directions are finite, so there always is one.
    let Some(cutter) = cutter else { return };
    let id = ctx.case.free_cutter_id(wish);
    ctx.selection.cutter = Some(id.clone());
    ctx.selection.split_by.insert(id.clone());
    ctx.edit(Edit::AddCutter(NamedCutter::new(id, cutter)));
}

fn describe(cutter: &Cutter) -> String {
    match cutter {
        Cutter::Plane { normal, .. } => format!("plane, + to {}", Facing::letters(normal)),
        Cutter::Cylinder { radius_mm, .. } => format!("cylinder of {radius_mm:.1} mm"),
        _ => String::new(),
    }
}

fn chosen_ui(turn: &mut TurnEntry, ctx: &mut ToolContext<'_>, ui: &mut Ui, named: &NamedCutter) {
    ui.horizontal(|ui| {
        if let Some(to) = name::name_ui(ui, "cutter", &named.id) {
            ctx.edit(Edit::RenameCutter { id: named.id.clone(), to });
        }
    });
    let (mut point, direction, mut radius) = match named.cutter {
        Cutter::Plane { point, normal } => (point, normal, None),
        Cutter::Cylinder { point, axis, radius_mm } => (point, axis, Some(radius_mm)),
        _ => return,
    };
    let mut made = direction;
    let mut changed = point_ui(ctx, ui, &mut point);
    if let Some(unit) = direction.try_normalize(0.0) {
        changed |= along_ui(ui, &mut point, &unit, radius.is_none());
    }
    theme::section_ui(ui, if radius.is_none() { "Turn its normal about" } else { "Turn its axis about" });
    let mut angles_deg = turn.angles_deg(&direction);
    let mut turned = false;
    Grid::new("turn").num_columns(2).show(ui, |ui| {
        let names = ["right to left axis", "front to back axis", "feet to head axis"];
        for (angle, name) in angles_deg.iter_mut().zip(names) {
            turned |= value::degrees_ui(ui, name, angle).changed();
            ui.end_row();
        }
    });
    if turned && angles_deg.iter().all(|a| a.is_finite()) {
        made = turn.turned(&direction, angles_deg);
        changed = true;
    }
    if let Some(unit) = made.try_normalize(0.0) {
        theme::quiet_ui(ui, format!("direction {:.3}, {:.3}, {:.3} (LPS)", unit.x, unit.y, unit.z));
    }
    ui.horizontal(|ui| {
        if ui.add(Button::new("Flip sides").small()).clicked() {
            made = -made;
            changed = true;
        }
        if let Some(radius_mm) = &mut radius {
            changed |= value::positive_mm_ui(ui, "Radius", radius_mm).changed();
        }
    });
    if changed {
        let cutter = match radius {
            None => Cutter::plane(point, made),
            Some(radius_mm) => Cutter::cylinder(point, made, radius_mm),
        };
        // Numbers typed that make no cutter are not taken.
        if let Ok(cutter) = cutter {
            ctx.edit(Edit::SetCutter { id: named.id.clone(), cutter });
        }
    }
    ui.add_space(4.0);
    theme::quiet_ui(
        ui,
        "In the 3D view: drag the arrow or the disc to move the plane along its normal, a dot on the rim \
         to turn it, the middle dot to slide the handle. Escape puts it back.",
    );
}

fn point_ui(ctx: &ToolContext<'_>, ui: &mut Ui, point: &mut Point) -> bool {
    theme::section_ui(ui, "A point of it");
    let mut changed = false;
    ui.horizontal(|ui| {
        for (axis, name) in ["L", "P", "S"].into_iter().enumerate() {
            changed |= value::mm_ui(ui, name, &mut point[axis]).changed();
        }
    });
    if ui.add(Button::new("To the crosshair").small()).clicked() {
        *point = ctx.crosshair();
        changed = true;
    }
    changed
}

/// A step along the direction, entered as a number that springs back to zero.
fn along_ui(ui: &mut Ui, point: &mut Point, unit: &Vector, is_plane: bool) -> bool {
    let mut by = 0.0;
    let name = if is_plane { "Move along its normal by" } else { "Move along its axis by" };
    let changed = ui.horizontal(|ui| value::mm_ui(ui, name, &mut by).changed()).inner;
    if changed && f64::is_finite(by) {
        *point += unit * by;
    }
    changed
}
