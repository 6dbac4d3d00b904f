//! Volumes: open, show and hide, window, weight, mode in 3D, texture format, place.

mod mode;
mod panel;
pub mod window;

use crate::host::context::ToolContext;
use crate::host::tool::{Tool, ToolId};
use crate::ui::pose::PoseEditor;

/// The tool. Its state is the turn being made.
#[derive(Debug, Default)]
pub struct Volumes {
    pose: PoseEditor,
}

impl Tool for Volumes {
    fn id(&self) -> ToolId {
        ToolId("volumes")
    }

    fn title(&self) -> &'static str {
        "Volumes"
    }

    fn panel_ui(&mut self, ctx: &mut ToolContext<'_>, ui: &mut egui::Ui) {
        panel::show_ui(&mut self.pose, ctx, ui);
    }
}
