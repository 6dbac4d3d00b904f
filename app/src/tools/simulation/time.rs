//! The moment of a grid of several steps: a slider, and playing.

use egui::{DragValue, Slider, Ui};
use render::volume::CellGrid;

use super::{Simulation, change};
use crate::case::UnstructuredGrid;
use crate::case::grids::GridChange;
use crate::host::context::ToolContext;
use crate::steps::clock::{Due, SPEEDS};
use crate::ui::number;

/// Steps a second at speed 1: files count time in anything from microseconds to years.
const RATE: f64 = 5.0;

/// Draws the slider, and asks for the step that is due.
pub(super) fn time_ui(
    tool: &mut Simulation,
    ctx: &mut ToolContext<'_>,
    ui: &mut Ui,
    grid: &UnstructuredGrid,
    cells: &CellGrid,
) {
    let count = cells.steps().len();
    if count < 2 {
        tool.clock.stop();
        return;
    }
    let times: Vec<f64> = (0..count).map(|i| i as f64 / RATE).collect();
    let shown = grid.step.min(count - 1);
    let now_secs = ui.input(|i| i.time);
    let clock = &mut tool.clock;
    let mut wish = shown;
    ui.add(Slider::new(&mut wish, 0..=count - 1).text("step"));
    if wish != shown {
        clock.stop();
    }
    ui.horizontal(|ui| {
        if clock.is_playing() {
            if ui.button("Pause").clicked() {
                clock.stop();
            }
        } else if ui.button("Play").clicked() {
            clock.play(now_secs, shown, &times);
        }
        let (speed, direction) = clock.speed();
        let mut new_speed = speed;
        ui.add(DragValue::new(&mut new_speed).range(SPEEDS[0]..=SPEEDS[1]).speed(0.02).suffix(" ×"))
            .on_hover_text(format!("1 is {RATE} steps a second"));
        if new_speed != speed {
            clock.set_speed(new_speed, direction, now_secs, shown, &times);
        }
        let time = number::short(cells.steps()[shown].time);
        ui.label(format!("step {} of {count}, at {time}", shown + 1));
    });
    if let Due::Step(due) | Due::End(due) = clock.due(now_secs, shown, &times) {
        wish = due;
    }
    if clock.is_playing() {
        ui.ctx().request_repaint();
    }
    if wish != shown {
        change(ctx, grid, GridChange::Step(wish));
    }
}
