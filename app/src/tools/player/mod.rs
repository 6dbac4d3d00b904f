//! Plays a volume over time: which step is due is [`crate::steps::clock`]'s, the panel draws and asks.
//!
//! A step is shown when it is there: a step that is due but not read yet is waited for, and what the clock passed
//! over meanwhile is counted as dropped.

mod panel;

use crate::host::context::ToolContext;
use crate::host::tool::{Tool, ToolId};
use crate::steps::clock::Clock;

/// Play, stop, speed, loop, single steps and the time axis.
#[derive(Debug, Default)]
pub struct Player {
    clock: Clock,
    /// The volume that plays, by id.
    volume: Option<String>,
}

impl Tool for Player {
    fn id(&self) -> ToolId {
        ToolId("player")
    }

    fn title(&self) -> &'static str {
        "Time"
    }

    fn panel_ui(&mut self, ctx: &mut ToolContext<'_>, ui: &mut egui::Ui) {
        panel::show_ui(self, ctx, ui);
    }
}
