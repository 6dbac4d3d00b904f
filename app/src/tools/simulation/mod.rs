//! Results of simulations on unstructured grids: what is shown of them, in which colours, where, and where it is least and
//! greatest.

mod colors;
mod extremes;
mod look;
mod panel;
mod time;

use std::sync::{Arc, Weak};

use render::volume::cells::Scalar;
use render::volume::{CellGrid, Point};

use crate::case::grids::GridChange;
use crate::case::{Edit, UnstructuredGrid};
use crate::host::context::ToolContext;
use crate::host::overlay::Overlay;
use crate::host::tool::{Tool, ToolId};
use crate::scene;
use crate::sections::ShownGrid;
use crate::steps::clock::Clock;
use crate::ui::pose::PoseEditor;
use crate::ui::{number, theme};
use extremes::Extremes;

/// The tool.
#[derive(Debug, Default)]
pub struct Simulation {
    pose: PoseEditor,
    clock: Clock,
    known: Option<Known>,
}

/// Makes a change to a grid.
fn change(ctx: &mut ToolContext<'_>, grid: &UnstructuredGrid, change: GridChange) {
    ctx.edit(Edit::ChangeGrid { id: grid.id.clone(), change });
}

/// What takes a walk over all cells to know, kept for as long as the same scalar is shown.
#[derive(Debug)]
struct Known {
    cells: Weak<CellGrid>,
    step: usize,
    scalar: Scalar,
    extremes: Option<Extremes>,
    /// The place last asked for, in the grid's own coordinates, and the scalar there.
    probed: Option<(Point, Option<f64>)>,
}

impl Known {
    fn is_of(&self, cells: &Arc<CellGrid>, step: usize, scalar: &Scalar) -> bool {
        self.cells.as_ptr() == Arc::as_ptr(cells) && (self.step, &self.scalar) == (step, scalar)
    }
}

impl Tool for Simulation {
    fn id(&self) -> ToolId {
        ToolId("simulation")
    }

    fn title(&self) -> &'static str {
        "Simulation"
    }

    fn panel_ui(&mut self, ctx: &mut ToolContext<'_>, ui: &mut egui::Ui) {
        panel::show_ui(self, ctx, ui);
    }

    /// Where the scalar of the chosen grid is least and greatest.
    fn draw(&self, ctx: &ToolContext<'_>, overlay: &mut Overlay) {
        let Some((grid, known)) = ctx.grid().zip(self.known.as_ref()).filter(|(grid, _)| grid.visible) else {
            return;
        };
        let of_grid = ctx.assets.cells(grid).is_some_and(|cells| known.cells.as_ptr() == Arc::as_ptr(cells));
        let Some(extremes) = known.extremes.as_ref().filter(|_| of_grid) else { return };
        let pose = scene::world_from_grid(ctx.case, grid);
        for (name, (value, place)) in [("least", extremes.least), ("greatest", extremes.greatest)] {
            let place = pose.point(&place);
            overlay.dot(place, theme::HOT, 4.0);
            overlay.text(place, theme::HOT, format!("{name} {}", number::with_unit(value, &grid.unit)));
        }
    }
}

impl Simulation {
    /// What is known of the scalar that a grid shows, found where it is not.
    fn known(&mut self, cells: &Arc<CellGrid>, step: usize, scalar: &Scalar) -> &mut Known {
        let known = self.known.take().filter(|known| known.is_of(cells, step, scalar));
        self.known.insert(known.unwrap_or_else(|| Known {
            cells: Arc::downgrade(cells),
            step,
            scalar: scalar.clone(),
            extremes: Extremes::of(cells, step, scalar),
            probed: None,
        }))
    }

    /// The scalar of the chosen grid at a world place.
    fn probe(&mut self, grid: &UnstructuredGrid, shown: &ShownGrid, p: &Point) -> Option<f64> {
        let at = shown.item.pose.inverse().point(p);
        let known = self.known(&shown.item.grid, shown.item.step, &shown.item.scalar);
        debug_assert_eq!(grid.id, shown.id, "one grid");
        match known.probed {
            Some((before, value)) if before == at => value,
            _ => {
                let value = shown.value(p);
                known.probed = Some((at, value));
                value
            }
        }
    }
}
