//! What is shown of a grid, and how: field, unit, colours, range, opacity.

use std::sync::Arc;

use egui::{Button, ComboBox, DragValue, Slider, TextEdit, Ui};
use render::volume::cells::{Part, Place, Scalar};
use render::volume::{CellGrid, Transfer};

use super::{change, colors, extremes};
use crate::case::UnstructuredGrid;
use crate::case::grids::{FieldChoice, GridChange};
use crate::colormaps::COLORMAPS;
use crate::host::context::ToolContext;
use crate::scene;
use crate::sections;
use crate::ui::theme;

/// The field, what of it, and its unit.
pub(super) fn field_ui(
    ctx: &mut ToolContext<'_>,
    ui: &mut Ui,
    grid: &UnstructuredGrid,
    cells: &CellGrid,
    scalar: Option<&Scalar>,
) {
    let Some(step) = cells.steps().first() else { return };
    let words = |place: Place, name: &str| match place {
        Place::Points => format!("{name} (points)"),
        Place::Cells => format!("{name} (cells)"),
    };
    let shown = scalar.map_or_else(|| "choose".to_owned(), |s| words(s.place, &s.name));
    let mut wish = None;
    ComboBox::from_label("Field").selected_text(&shown).width(220.0).show_ui(ui, |ui| {
        for place in [Place::Points, Place::Cells] {
            for field in step.fields(place) {
                let words = words(place, field.name());
                if ui.selectable_label(words == shown, words).clicked() {
                    wish =
                        Some(FieldChoice { name: field.name().to_owned(), place: Some(place), part: None });
                }
            }
        }
    });
    if let Some((scalar, field)) = scalar.and_then(|s| Some((s, s.field(step)?))) {
        let count = field.components();
        if count > 1 {
            let parts = std::iter::once(Part::Magnitude).chain((0..count).map(Part::Component));
            let shown = sections::part_title(scalar.part, count);
            ComboBox::from_label("of it").selected_text(shown).show_ui(ui, |ui| {
                for part in parts {
                    if ui.selectable_label(part == scalar.part, sections::part_title(part, count)).clicked() {
                        wish = Some(FieldChoice::from(Scalar { part, ..scalar.clone() }));
                    }
                }
            });
        }
        if field.non_finite() > 0 {
            let words =
                format!("{} values are no numbers: cells with such are not drawn", field.non_finite());
            ui.label(egui::RichText::new(words).small().color(theme::CAUTION));
        }
    }
    if let Some(wish) = wish.filter(|wish| Some(wish) != grid.field.as_ref()) {
        change(ctx, grid, GridChange::Field(Some(wish)));
    }
    ui.horizontal(|ui| {
        let mut unit = grid.unit.clone();
        let label = ui.label("Unit");
        let edit = TextEdit::singleline(&mut unit).desired_width(80.0).hint_text("MPa");
        if ui.add(edit).labelled_by(label.id).changed() {
            change(ctx, grid, GridChange::Unit(unit));
        }
    });
}

/// Colours, the values that they run between, and opacity.
pub(super) fn colors_ui(
    ctx: &mut ToolContext<'_>,
    ui: &mut Ui,
    grid: &UnstructuredGrid,
    cells: &CellGrid,
    scalar: &Scalar,
) {
    theme::section_ui(ui, "Colours");
    let transfer = scene::transfer_of(grid, cells, scalar);
    let wish = range_ui(ui, grid, cells, scalar, &transfer);
    let wish = map_ui(ui, &transfer).or(wish);
    let wish = opacity_ui(ui, &transfer).or(wish);
    if let Some(wish) = wish.filter(|wish| *wish != *transfer) {
        change(ctx, grid, GridChange::Transfer(Some(Arc::new(wish))));
    }
    if ui.add_enabled(grid.transfer.is_some(), Button::new("Default colours").small()).clicked() {
        change(ctx, grid, GridChange::Transfer(None));
    }
}

fn range_ui(
    ui: &mut Ui,
    grid: &UnstructuredGrid,
    cells: &CellGrid,
    scalar: &Scalar,
    transfer: &Transfer,
) -> Option<Transfer> {
    let [low, high] = colors::range(transfer);
    let mut range = [low, high];
    let width = (high - low).abs().max(f64::MIN_POSITIVE);
    // Four digits of the range, whether it is of pascals or of gigapascals.
    let decimals = (4.0 - width.log10()).clamp(0.0, 12.0) as usize;
    let number = |v| DragValue::new(v).speed(width / 300.0).max_decimals(decimals);
    ui.horizontal(|ui| {
        let [low, high] = &mut range;
        let label = ui.label("From");
        ui.add(number(low)).labelled_by(label.id);
        let label = ui.label("to");
        ui.add(number(high)).labelled_by(label.id);
        theme::quiet_ui(ui, grid.unit.clone());
    });
    ui.horizontal(|ui| {
        let whole = ui.add(Button::new("Full range").small());
        if whole.on_hover_text("Least and greatest value of all steps").clicked() {
            range = scalar.range(cells).unwrap_or(range);
        }
        let bulk = ui.add(Button::new("1 to 99 %").small());
        if bulk
            .on_hover_text("All but the lowest and the highest hundredth of the values of this step")
            .clicked()
        {
            let step = grid.step.min(cells.steps().len() - 1);
            range = extremes::bulk(cells, step, scalar).unwrap_or(range);
        }
    });
    // A range that is none (a number typed out of order) is not taken.
    if range == [low, high] { None } else { colors::with_range(transfer, range) }
}

fn map_ui(ui: &mut Ui, transfer: &Transfer) -> Option<Transfer> {
    let shown = COLORMAPS.iter().find(|map| map.is_of(transfer)).map_or("own", |map| map.name);
    let mut wish = None;
    ComboBox::from_label("Colour map").selected_text(shown).width(150.0).show_ui(ui, |ui| {
        for map in &COLORMAPS {
            if ui.selectable_label(map.name == shown, map.name).clicked() {
                wish = Some(colors::with_map(transfer, map));
            }
        }
    });
    wish
}

fn opacity_ui(ui: &mut Ui, transfer: &Transfer) -> Option<Transfer> {
    let before = colors::opacity(transfer);
    let mut ends = before;
    ui.add(Slider::new(&mut ends[0], 0.0..=1.0).text("Opacity of the least"));
    ui.add(Slider::new(&mut ends[1], 0.0..=1.0).text("Opacity of the greatest"));
    let mut unit_mm = transfer.unit_mm();
    ui.horizontal(|ui| {
        let label = ui.label("of a thickness of");
        let drag =
            DragValue::new(&mut unit_mm).speed(0.01 * transfer.unit_mm()).max_decimals(4).suffix(" mm");
        let words = "In 3D. Sections show every value that is not clear.";
        ui.add(drag).labelled_by(label.id).on_hover_text(words);
    });
    if ends != before {
        colors::with_opacity(transfer, ends)
    } else if unit_mm != transfer.unit_mm() {
        colors::with_unit(transfer, unit_mm)
    } else {
        None
    }
}
