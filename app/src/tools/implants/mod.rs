//! Implants: open, place, colour, opacity.

mod panel;
pub mod place;

use crate::host::context::ToolContext;
use crate::host::tool::{Tool, ToolId};
use crate::ui::pose::PoseEditor;

/// The tool.
#[derive(Debug, Default)]
pub struct Implants {
    pose: PoseEditor,
}

impl Tool for Implants {
    fn id(&self) -> ToolId {
        ToolId("implants")
    }

    fn title(&self) -> &'static str {
        "Implants"
    }

    fn panel_ui(&mut self, ctx: &mut ToolContext<'_>, ui: &mut egui::Ui) {
        panel::show_ui(&mut self.pose, ctx, ui);
    }
}
