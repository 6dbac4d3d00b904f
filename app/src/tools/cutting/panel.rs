//! The panel of the cutters.

use egui::{Button, Grid, Ui};
use render::volume::{Affine, Cutter, Point, Shape, Vector};

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
        if ui.button("Dome").clicked() {
            add(ctx, "dome", Cutter::dome(ctx.crosshair(), 25.0).ok());
        }
        if ui.button("Blade").clicked() {
            add(ctx, "blade", Cutter::blade(ctx.crosshair(), Vector::z(), Vector::x(), [60.0, 30.0]).ok());
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
    let kerf = match cutter.kerf_mm() {
        0.0 => String::new(),
        kerf_mm => format!(", kerf {kerf_mm:.2} mm"),
    };
    match cutter.shape() {
        Shape::Plane { normal, .. } => format!("plane, + to {}{kerf}", Facing::letters(normal)),
        Shape::Cylinder { radius_mm, .. } => format!("cylinder of {radius_mm:.1} mm{kerf}"),
        Shape::Dome { radius_mm, .. } => format!("dome of {radius_mm:.1} mm{kerf}"),
        Shape::Blade { width_mm, height_mm, normal, .. } => {
            format!("blade of {width_mm:.1} x {height_mm:.1} mm, + to {}{kerf}", Facing::letters(normal))
        }
    }
}

fn chosen_ui(turn: &mut TurnEntry, ctx: &mut ToolContext<'_>, ui: &mut Ui, named: &NamedCutter) {
    ui.horizontal(|ui| {
        if let Some(to) = name::name_ui(ui, "cutter", &named.id) {
            ctx.edit(Edit::RenameCutter { id: named.id.clone(), to });
        }
    });
    let mut shape = *named.cutter.shape();
    let mut kerf_mm = named.cutter.kerf_mm();
    let mut changed = match &mut shape {
        Shape::Plane { point, normal } => {
            point_ui(ctx, ui, point)
                | along_ui(ui, point, normal, "Move along its normal by")
                | turn_ui(turn, ui, normal, "Turn its normal about")
        }
        Shape::Cylinder { point, axis, radius_mm } => {
            point_ui(ctx, ui, point)
                | along_ui(ui, point, axis, "Move along its axis by")
                | turn_ui(turn, ui, axis, "Turn its axis about")
                | value::positive_mm_ui(ui, "Radius", radius_mm).changed()
        }
        Shape::Dome { centre, radius_mm } => {
            point_ui(ctx, ui, centre) | value::positive_mm_ui(ui, "Radius", radius_mm).changed()
        }
        Shape::Blade { point, normal, right, width_mm, height_mm } => {
            point_ui(ctx, ui, point)
                | along_ui(ui, point, normal, "Move along its normal by")
                | turn_ui(turn, ui, normal, "Turn its normal about")
                | spin_ui(ui, normal, right)
                | value::positive_mm_ui(ui, "Width", width_mm).changed()
                | value::positive_mm_ui(ui, "Height", height_mm).changed()
        }
    };
    changed |= value::mm_ui(ui, "Kerf", &mut kerf_mm).changed();
    // Numbers typed that make no cutter are not taken.
    if changed && let Ok(cutter) = Cutter::new(shape, kerf_mm) {
        ctx.edit(Edit::SetCutter { id: named.id.clone(), cutter });
    }
    ui.add_space(4.0);
    theme::quiet_ui(ui, advice(&shape));
}

fn advice(shape: &Shape) -> &'static str {
    match shape {
        Shape::Plane { .. } => {
            "In the 3D view: drag the arrow or the disc to move the plane along its normal, a dot on the rim \
             to turn it, the middle dot to slide the handle. Escape puts it back."
        }
        Shape::Blade { .. } => {
            "A blade cuts out all that is behind it within its outline: where it is shorter than the bone, a \
             block. In the 3D view: drag the arrow or the blade to move it along its normal, the middle of an \
             edge to turn it, the middle dot to slide it. Escape puts it back."
        }
        Shape::Cylinder { .. } | Shape::Dome { .. } => {
            "In the 3D view: drag the middle dot to move it, the dot on its wall to set its radius. Escape \
             puts it back."
        }
    }
}

/// Angles by which a direction is turned, and a button that turns it round.
fn turn_ui(turn: &mut TurnEntry, ui: &mut Ui, direction: &mut Vector, title: &str) -> bool {
    let before = *direction;
    theme::section_ui(ui, title);
    let mut angles_deg = turn.angles_deg(direction);
    let mut turned = false;
    Grid::new("turn").num_columns(2).show(ui, |ui| {
        let names = ["right to left axis", "front to back axis", "feet to head axis"];
        for (angle, name) in angles_deg.iter_mut().zip(names) {
            turned |= value::degrees_ui(ui, name, angle).changed();
            ui.end_row();
        }
    });
    if turned && angles_deg.iter().all(|a| a.is_finite()) {
        *direction = turn.turned(direction, angles_deg);
    }
    if let Some(unit) = direction.try_normalize(0.0) {
        theme::quiet_ui(ui, format!("direction {:.3}, {:.3}, {:.3} (LPS)", unit.x, unit.y, unit.z));
    }
    if ui.add(Button::new("Flip sides").small()).clicked() {
        *direction = -*direction;
    }
    *direction != before
}

/// A turn of a blade in its own plane, entered as a number that springs back to zero.
fn spin_ui(ui: &mut Ui, normal: &Vector, right: &mut Vector) -> bool {
    let mut by_deg = 0.0;
    let changed = ui.horizontal(|ui| value::degrees_ui(ui, "Spin in its plane by", &mut by_deg).changed());
    if changed.inner && f64::is_finite(by_deg) {
        *right = Affine::rotation_about(Point::origin(), *normal, by_deg.to_radians()).vector(right);
    }
    changed.inner
}

fn point_ui(ctx: &ToolContext<'_>, ui: &mut Ui, point: &mut Point) -> bool {
    theme::section_ui(ui, "A point of it, or its middle");
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

/// A step along a direction, entered as a number that springs back to zero.
fn along_ui(ui: &mut Ui, point: &mut Point, direction: &Vector, name: &str) -> bool {
    let Some(unit) = direction.try_normalize(0.0) else { return false };
    let mut by = 0.0;
    let changed = ui.horizontal(|ui| value::mm_ui(ui, name, &mut by).changed()).inner;
    if changed && f64::is_finite(by) {
        *point += unit * by;
    }
    changed
}
