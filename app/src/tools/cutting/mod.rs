//! Cutters: osteotomy planes, blades, cylinders and domes, set by numbers or by their handle in the 3D view.

pub mod handle;
mod panel;
pub mod turn;

use crate::case::Edit;
use crate::host::context::ToolContext;
use crate::host::overlay::Overlay;
use crate::host::pointer::{Phase, PointerEvent};
use crate::host::tool::{Tool, ToolId};
use crate::host::views;
use crate::ui::theme;
use handle::{Grip, Handle};
use render::volume::Cutter;

/// What the pointer is doing with the chosen cutter's handle.
#[derive(Debug, Clone, Default, PartialEq)]
enum Pull {
    /// Nothing.
    #[default]
    Idle,
    /// It is over a part.
    Over(Grip),
    /// It drags a part: from where, and the handle as it was then.
    Dragging { id: String, grip: Grip, began: Box<PointerEvent>, handle: Box<Handle>, before: Cutter },
}

/// The tool.
#[derive(Debug, Default)]
pub struct Cutting {
    pull: Pull,
    turn: turn::TurnEntry,
}

/// Radius of a plane's disc: what is seen well on a body of the case's size; mm.
fn disc_mm(ctx: &ToolContext<'_>) -> f64 {
    (views::ball_of_case(ctx.case, ctx.assets).radius_mm * 0.35).clamp(2.0, 500.0)
}

fn chosen_handle(ctx: &ToolContext<'_>) -> Option<Handle> {
    Handle::of(&ctx.cutter()?.cutter, disc_mm(ctx))
}

impl Tool for Cutting {
    fn id(&self) -> ToolId {
        ToolId("cutting")
    }

    fn title(&self) -> &'static str {
        "Cutting"
    }

    fn panel_ui(&mut self, ctx: &mut ToolContext<'_>, ui: &mut egui::Ui) {
        panel::show_ui(&mut self.turn, ctx, ui);
    }

    fn pointer(&mut self, ctx: &mut ToolContext<'_>, event: &PointerEvent) {
        match (event.phase, std::mem::take(&mut self.pull)) {
            (Phase::Press, _) => {
                let Some(chosen) = ctx.cutter() else { return };
                let Some(handle) = chosen_handle(ctx) else { return };
                let Some(grip) = handle.grip(event) else { return };
                ctx.capture();
                self.pull = Pull::Dragging {
                    id: chosen.id.clone(),
                    grip,
                    began: Box::new(*event),
                    handle: Box::new(handle),
                    before: chosen.cutter,
                };
            }
            (Phase::Drag, Pull::Dragging { id, grip, began, handle, before }) => {
                let cutter = handle.dragged(grip, &began, event);
                ctx.edit(Edit::SetCutter { id: id.clone(), cutter });
                self.pull = Pull::Dragging { id, grip, began, handle, before };
            }
            (Phase::Cancel, Pull::Dragging { id, before, .. }) => {
                ctx.edit(Edit::SetCutter { id, cutter: before });
            }
            (Phase::Hover | Phase::Release, _) => {
                let over = chosen_handle(ctx).and_then(|h| h.grip(event));
                self.pull = over.map_or(Pull::Idle, Pull::Over);
            }
            _ => {}
        }
    }

    fn draw(&self, ctx: &ToolContext<'_>, overlay: &mut Overlay) {
        let disc_mm = disc_mm(ctx);
        let chosen = ctx.cutter().map(|c| c.id.as_str());
        for cutter in &ctx.case.cutters {
            let Some(handle) = Handle::of(&cutter.cutter, disc_mm) else { continue };
            if Some(cutter.id.as_str()) == chosen {
                self.draw_chosen(&handle, overlay);
            } else {
                overlay.line(handle.outline(), theme::CUTTER.gamma_multiply(0.6), 1.0);
            }
            overlay.text(handle.centre, theme::CUTTER, &cutter.id);
        }
    }
}

impl Cutting {
    fn draw_chosen(&self, handle: &Handle, overlay: &mut Overlay) {
        let hot = match &self.pull {
            Pull::Idle => None,
            Pull::Over(grip) | Pull::Dragging { grip, .. } => Some(*grip),
        };
        let color = |grip| if hot == Some(grip) { theme::HOT } else { theme::CUTTER };
        for line in handle.lines() {
            // What goes round the body is drawn stronger than what runs along it.
            let goes_round = line.len() > 2;
            let (strength, width) = if goes_round { (1.0, 1.5) } else { (0.5, 1.0) };
            overlay.line(line, theme::CUTTER.gamma_multiply(strength), width);
        }
        if handle.is_flat() {
            overlay.sheet(handle.outline(), theme::CUTTER.gamma_multiply(0.16));
            overlay.line(handle.outline(), color(Grip::Along), 1.5);
            overlay.line(vec![handle.centre, handle.tip()], color(Grip::Along), 3.0);
            overlay.dot(handle.tip(), color(Grip::Along), 6.5);
        }
        for (k, p) in handle.rim().into_iter().enumerate() {
            overlay.dot(p, color(Grip::Rim(k)), 5.0);
        }
        overlay.dot(handle.centre, color(Grip::Middle), 4.5);
    }
}
