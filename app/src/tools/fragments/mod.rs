//! Fragments: split a volume by cutters, show and pose the pieces, fuse them again.

pub mod middle;
mod panel;

use std::collections::BTreeSet;
use std::sync::Arc;

use render::volume::{Affine, Grid, Point, Side};

use crate::case::{Fragment, Volume};
use crate::host::context::ToolContext;
use crate::host::overlay::Overlay;
use crate::host::tool::{Tool, ToolId};
use crate::ui::pose::PoseEditor;
use crate::ui::theme;

/// The tool.
#[derive(Debug, Default)]
pub struct Fragments {
    pose: PoseEditor,
    /// Fragments ticked to be fused, by id.
    ticked: BTreeSet<String>,
    /// The middle of the fragment last asked about, in its unmoved place.
    found: Option<Found>,
}

/// A middle, with all that it depends on.
#[derive(Debug, Clone)]
struct Found {
    grid: Arc<Grid>,
    pose: Affine,
    keep: Vec<(render::volume::Cutter, Side)>,
    middle: Point,
}

impl Tool for Fragments {
    fn id(&self) -> ToolId {
        ToolId("fragments")
    }

    fn title(&self) -> &'static str {
        "Fragments"
    }

    fn panel_ui(&mut self, ctx: &mut ToolContext<'_>, ui: &mut egui::Ui) {
        panel::show_ui(self, ctx, ui);
    }

    fn draw(&self, ctx: &ToolContext<'_>, overlay: &mut Overlay) {
        let (Some(fragment), Some(found)) = (ctx.fragment(), &self.found) else { return };
        let now = fragment.pose.point(&found.middle);
        if (now - found.middle).norm() > 0.05 {
            overlay.line(vec![found.middle, now], theme::ACCENT, 1.5);
            overlay.dot(found.middle, theme::QUIET, 3.0);
        }
        overlay.dot(now, theme::ACCENT, 4.5);
        overlay.text(now, theme::ACCENT, &fragment.id);
    }
}

impl Fragments {
    /// The middle of what is seen of a fragment, in its unmoved place.
    fn middle(
        &mut self,
        ctx: &ToolContext<'_>,
        volume: &Volume,
        grid: &Arc<Grid>,
        fragment: &Fragment,
    ) -> Point {
        let keep = ctx.case.piece(fragment).keep;
        let known = self
            .found
            .as_ref()
            .filter(|f| Arc::ptr_eq(&f.grid, grid) && f.pose == volume.pose && f.keep == keep);
        if let Some(found) = known {
            return found.middle;
        }
        let middle = middle::of_piece(grid, &volume.pose, &volume.transfer, &keep);
        self.found = Some(Found { grid: Arc::clone(grid), pose: volume.pose, keep, middle });
        middle
    }
}
