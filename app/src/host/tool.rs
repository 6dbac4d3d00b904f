//! What a tool is: an id, a title, a panel, and what it does with the pointer in a view.
//!
//! A tool's own fields hold only what may be lost on exit. What is planned is in the case, which a tool
//! reads and changes through [`ToolContext`] alone.

use std::fmt;

use super::context::ToolContext;
use super::overlay::Overlay;
use super::pointer::{PointerEvent, SectionEvent};

/// A tool's stable name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ToolId(pub &'static str);

impl fmt::Display for ToolId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

/// A panel at the side of the window, and what goes with it.
pub trait Tool {
    /// Stable and unique among the registered tools.
    fn id(&self) -> ToolId;

    /// For people.
    fn title(&self) -> &'static str;

    /// Draws the panel.
    fn panel_ui(&mut self, ctx: &mut ToolContext<'_>, ui: &mut egui::Ui);

    /// What the pointer does in the 3D view, before the view itself takes it. A tool that wants the drag
    /// that a press starts calls [`ToolContext::capture`].
    fn pointer(&mut self, _ctx: &mut ToolContext<'_>, _event: &PointerEvent) {}

    /// What the pointer does in a section, before the crosshair follows it; as [`Tool::pointer`].
    fn section_pointer(&mut self, _ctx: &mut ToolContext<'_>, _event: &SectionEvent) {}

    /// The radius of the brush that the pointer is in a section, mm; none where it is no brush.
    fn brush_mm(&self) -> Option<f64> {
        None
    }

    /// Lines and handles over the 3D view; world mm.
    fn draw(&self, _ctx: &ToolContext<'_>, _overlay: &mut Overlay) {}
}
