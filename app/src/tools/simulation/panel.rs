//! The panel of simulations.

use egui::{Button, ComboBox, RichText, Ui};
use render::volume::cells::CellKind;
use render::volume::{Affine, CellGrid, Point};

use super::{Simulation, change, look, time};
use crate::case::UnstructuredGrid;
use crate::case::assets::Key;
use crate::case::grids::GridChange;
use crate::host::context::{Request, ToolContext};
use crate::scene;
use crate::sections::{self, ShownGrid};
use crate::ui::notes::notes_ui;
use crate::ui::pose::PoseInput;
use crate::ui::{name, number, theme, value};

pub(super) fn show_ui(tool: &mut Simulation, ctx: &mut ToolContext<'_>, ui: &mut Ui) {
    if ui.button("Open a grid…").on_hover_text("VTU, VTK, PVTU, Exodus, PLOT3D").clicked() {
        ctx.request(Request::OpenFile);
    }
    if ctx.case.grids.is_empty() {
        theme::quiet_ui(ui, "No result of a simulation yet. Open its grid, or drop the file on the window.");
        return;
    }
    for grid in &ctx.case.grids {
        row_ui(ctx, ui, grid);
    }
    if let Some(grid) = ctx.grid() {
        ui.separator();
        chosen_ui(tool, ctx, ui, grid);
    }
}

fn row_ui(ctx: &mut ToolContext<'_>, ui: &mut Ui, grid: &UnstructuredGrid) {
    ui.horizontal(|ui| {
        let mut visible = grid.visible;
        let shown = ui.checkbox(&mut visible, "").on_hover_text("Show in all views");
        shown.widget_info(|| {
            let name = format!("Show {}", grid.id);
            egui::WidgetInfo::selected(egui::Role::CheckBox, true, visible, name)
        });
        if shown.changed() {
            change(ctx, grid, GridChange::Visible(visible));
        }
        let chosen = ctx.selection.grid.as_deref() == Some(grid.id.as_str());
        if ui.selectable_label(chosen, &grid.id).clicked() {
            ctx.selection.grid = Some(grid.id.clone());
        }
        if ctx.assets.cells(grid).is_none() {
            theme::quiet_ui(ui, if grid.visible { "not loaded" } else { "loads when shown" });
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            if ui.add(Button::new("Remove").small()).clicked() {
                change(ctx, grid, GridChange::Remove);
            }
        });
    });
}

fn chosen_ui(tool: &mut Simulation, ctx: &mut ToolContext<'_>, ui: &mut Ui, grid: &UnstructuredGrid) {
    ui.horizontal(|ui| {
        if let Some(to) = name::name_ui(ui, "grid", &grid.id) {
            change(ctx, grid, GridChange::Rename(to));
        }
    });
    let Some(cells) = ctx.assets.cells(grid) else {
        theme::quiet_ui(ui, "The grid is not loaded.");
        return;
    };
    let scalar = scene::scalar_of(grid, cells);
    look::field_ui(ctx, ui, grid, cells, scalar.as_ref());
    if let Some(fault) = scene::grid_fault(grid, ctx.assets) {
        ui.label(RichText::new(fault).small().color(theme::FAULT));
    }
    time::time_ui(tool, ctx, ui, grid, cells);
    if let Some(scalar) = &scalar {
        look::colors_ui(ctx, ui, grid, cells, scalar);
    }
    if let Some(shown) = sections::grid(ctx.case, grid, ctx.assets) {
        values_ui(tool, ctx, ui, grid, &shown);
    }
    place_ui(tool, ctx, ui, grid, cells);
    ui.separator();
    cells_ui(ctx, ui, grid, cells);
}

/// Where the scalar is least and greatest, and what it is at the crosshair.
fn values_ui(
    tool: &mut Simulation,
    ctx: &mut ToolContext<'_>,
    ui: &mut Ui,
    grid: &UnstructuredGrid,
    shown: &ShownGrid,
) {
    theme::section_ui(ui, "Values");
    let item = &shown.item;
    let extremes = tool.known(&item.grid, item.step, &item.scalar).extremes;
    let unit = &shown.unit;
    match extremes {
        Some(extremes) => {
            for (words, (value, place)) in [("Greatest", extremes.greatest), ("Least", extremes.least)] {
                let place = item.pose.point(&place);
                ui.horizontal(|ui| {
                    ui.label(format!("{words} {}", number::with_unit(value, unit)));
                    let go = ui.add(Button::new(format!("Go to the {}", words.to_lowercase())).small());
                    if go.on_hover_text("Puts the crosshair there").clicked() {
                        ctx.views.crosshair = Some(place);
                    }
                });
                let [x, y, z] = [0, 1, 2].map(|axis| place[axis]);
                theme::quiet_ui(ui, format!("at {x:.2}, {y:.2}, {z:.2} mm (left, posterior, superior)"));
            }
        }
        None => theme::quiet_ui(ui, "No value of this step is a number."),
    }
    let here = match tool.probe(grid, shown, &ctx.crosshair()) {
        Some(value) => format!("At the crosshair {}", number::with_unit(value, unit)),
        None => "The crosshair is outside of the grid.".to_owned(),
    };
    ui.label(here);
}

/// Scale, fragment and pose.
fn place_ui(
    tool: &mut Simulation,
    ctx: &mut ToolContext<'_>,
    ui: &mut Ui,
    grid: &UnstructuredGrid,
    cells: &CellGrid,
) {
    theme::section_ui(ui, "Place");
    let mut fragment = grid.fragment.clone();
    let words = fragment.clone().unwrap_or_else(|| "nothing".to_owned());
    ComboBox::from_label("is what it rides on").selected_text(words).show_ui(ui, |ui| {
        ui.selectable_value(&mut fragment, None, "nothing");
        for other in &ctx.case.fragments {
            ui.selectable_value(&mut fragment, Some(other.id.clone()), &other.id);
        }
    });
    if fragment != grid.fragment {
        change(ctx, grid, GridChange::Fragment(fragment));
    }
    let [low, high] = cells.bounds();
    let longest = (high - low).amax();
    let mut scale = grid.scale;
    ui.horizontal(|ui| {
        value::number_ui(ui, "Millimetres per unit", &mut scale, 0.01);
        theme::quiet_ui(ui, format!("longest side {} mm", number::short(longest * grid.scale)));
    });
    // What a person is made of is longer than a millimetre.
    if grid.scale == 1.0 && longest < 1.0 && ui.button("The file is in metres").clicked() {
        scale = 1000.0;
    }
    if scale != grid.scale && scale.is_finite() && scale > 0.0 {
        change(ctx, grid, GridChange::Scale(scale));
    }
    // The pose is about the fragment in its unmoved place.
    let moved = grid.fragment.as_deref().and_then(|id| ctx.case.fragment(id));
    let unmoved_from_world = moved.map_or_else(Affine::identity, |fragment| fragment.pose.inverse());
    let crosshair = unmoved_from_world.point(&ctx.crosshair());
    let centre = Point::from((low.coords + high.coords) * (0.5 * grid.scale));
    if ui.button("Put its middle at the crosshair").clicked() {
        let pose = Affine::translation(crosshair - grid.pose.point(&centre)) * grid.pose;
        change(ctx, grid, GridChange::Pose(Box::new(pose)));
    }
    let pose = ui.collapsing("Move and turn", |ui| {
        tool.pose.ui(ui, &PoseInput { pose: grid.pose, centre, crosshair, offered: None })
    });
    if let Some(pose) = pose.body_returned.flatten() {
        change(ctx, grid, GridChange::Pose(Box::new(pose)));
    }
}

/// How many points and cells there are, and what the loader says of them.
fn cells_ui(ctx: &ToolContext<'_>, ui: &mut Ui, grid: &UnstructuredGrid, cells: &CellGrid) {
    let kinds = CellKind::ALL.into_iter().filter(|&kind| cells.count(kind) > 0);
    let kinds: Vec<String> = kinds.map(|kind| format!("{} {}", cells.count(kind), kind.name())).collect();
    theme::quiet_ui(ui, format!("{} points; cells: {}", cells.points().len(), kinds.join(", ")));
    if let Some(asset) = ctx.assets.asset(&Key::of_grid(grid)) {
        theme::quiet_ui(ui, asset.format);
        notes_ui(ui, &asset.notes);
    }
}
