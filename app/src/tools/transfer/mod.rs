//! The transfer function of the chosen volume: presets, a curve to drag, colours, lighting.

pub mod histogram;
mod panel;

use std::sync::Arc;

use render::volume::Grid;

use crate::host::context::ToolContext;
use crate::host::tool::{Tool, ToolId};
use crate::ui::curve::CurveEditor;

/// The tool.
#[derive(Debug, Default)]
pub struct TransferTool {
    curve: CurveEditor,
    /// The histogram of the grid it was made of.
    counted: Option<(Arc<Grid>, Vec<f32>)>,
}

impl Tool for TransferTool {
    fn id(&self) -> ToolId {
        ToolId("transfer")
    }

    fn title(&self) -> &'static str {
        "Transfer"
    }

    fn panel_ui(&mut self, ctx: &mut ToolContext<'_>, ui: &mut egui::Ui) {
        panel::show_ui(self, ctx, ui);
    }
}

impl TransferTool {
    /// The histogram's heights, made anew only for another grid.
    fn heights(&mut self, grid: &Arc<Grid>) -> &[f32] {
        let known = self.counted.as_ref().is_some_and(|(of, _)| Arc::ptr_eq(of, grid));
        if !known {
            self.counted = Some((Arc::clone(grid), histogram::heights(grid, 160)));
        }
        self.counted.as_ref().map_or(&[], |(_, heights)| heights.as_slice())
    }
}
