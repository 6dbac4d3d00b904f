//! Sections: how each is turned, where it lies and how thick it is.

mod panel;

use crate::host::context::ToolContext;
use crate::host::tool::{Tool, ToolId};

/// The tool. What it changes is in the views.
#[derive(Debug, Default)]
pub struct Sections;

impl Tool for Sections {
    fn id(&self) -> ToolId {
        ToolId("sections")
    }

    fn title(&self) -> &'static str {
        "Sections"
    }

    fn panel_ui(&mut self, ctx: &mut ToolContext<'_>, ui: &mut egui::Ui) {
        panel::show_ui(ctx, ui);
    }
}
