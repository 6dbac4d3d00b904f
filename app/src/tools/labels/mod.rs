//! Labels: regions painted on volumes; which are shown and in what colour, and the brush that paints them.

mod brush;
mod panel;

use crate::case::labels::LabelChange;
use crate::case::{Edit, LabelSet};
use crate::host::context::ToolContext;
use crate::host::pointer::{Phase, SectionEvent};
use crate::host::tool::{Tool, ToolId};
use brush::Stroke;

/// The tool: the chosen set, the brush, and the stroke being made.
#[derive(Debug)]
pub struct LabelsTool {
    set: Option<String>,
    is_painting: bool,
    label: u16,
    erases: bool,
    radius_mm: f64,
    stroke: Option<Stroke>,
}

impl Default for LabelsTool {
    fn default() -> Self {
        Self { set: None, is_painting: false, label: 1, erases: false, radius_mm: 5.0, stroke: None }
    }
}

impl LabelsTool {
    /// The chosen set, or the first one.
    fn set<'a>(&self, ctx: &ToolContext<'a>) -> Option<&'a LabelSet> {
        let chosen = self.set.as_deref().and_then(|id| ctx.case.label_set(id));
        chosen.or_else(|| ctx.case.labels.first())
    }

    /// Starts or continues a stroke at a place.
    fn paint(&mut self, ctx: &mut ToolContext<'_>, event: &SectionEvent) {
        let Some(set) = self.set(ctx).filter(|set| set.visible) else { return };
        let Some(volume) = ctx.case.volume(&set.volume) else { return };
        let Some(labels) = ctx.assets.labels(ctx.case, set) else { return };
        if event.phase == Phase::Press {
            let piece = crate::sections::piece_at(ctx.case, ctx.assets, volume, &event.place);
            self.stroke = piece.map(|piece| Stroke::new(&piece, volume.pose, event.place));
        }
        let Some(stroke) = &mut self.stroke else { return };
        let label = if self.erases { 0 } else { self.label };
        let bricks = stroke.to(&labels, event.place, self.radius_mm, label);
        if !bricks.is_empty() {
            ctx.edit(Edit::ChangeLabels { id: set.id.clone(), change: LabelChange::Paint(bricks) });
        }
    }
}

impl Tool for LabelsTool {
    fn id(&self) -> ToolId {
        ToolId("labels")
    }

    fn title(&self) -> &'static str {
        "Labels"
    }

    fn panel_ui(&mut self, ctx: &mut ToolContext<'_>, ui: &mut egui::Ui) {
        panel::show_ui(self, ctx, ui);
    }

    fn section_pointer(&mut self, ctx: &mut ToolContext<'_>, event: &SectionEvent) {
        if !self.is_painting || ctx.case.labels.is_empty() {
            return;
        }
        ctx.capture();
        match event.phase {
            Phase::Press | Phase::Drag => self.paint(ctx, event),
            Phase::Release | Phase::Cancel => self.stroke = None,
            Phase::Hover => {}
        }
    }

    fn brush_mm(&self) -> Option<f64> {
        self.is_painting.then_some(self.radius_mm)
    }
}
