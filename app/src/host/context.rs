//! What a tool may see and ask for. Never the case to write to: edits are applied after the frame, so
//! that undo, saving and tests have one path.

use std::collections::BTreeSet;

// A tool sees of the renderer only data in space; these few plain types come through here.
pub use render::scene::{Shading, TextureFormat, VolumeMode};
pub use render::section::{Slab, SlabMode, Window};
use render::volume::Point;

use super::views::{self, Views};
use crate::case::{Assets, Case, Edit, Fragment, Implant, NamedCutter, UnstructuredGrid, Volume};

/// What is chosen, by id. May name what an undo took away: ask through [`Selection::repair`]ed fields.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Selection {
    /// The volume that window, transfer function and splitting are about.
    pub volume: Option<String>,
    /// The cutter with the handles.
    pub cutter: Option<String>,
    /// The fragment to move.
    pub fragment: Option<String>,
    /// The implant to move.
    pub implant: Option<String>,
    /// The unstructured grid to look at.
    pub grid: Option<String>,
    /// The cutters to split by.
    pub split_by: BTreeSet<String>,
}

impl Selection {
    /// Forgets what is no longer there, and chooses the first of each kind where nothing is chosen.
    pub fn repair(&mut self, case: &Case) {
        fn one<'a>(chosen: &mut Option<String>, mut ids: impl Iterator<Item = &'a str> + Clone) {
            let there = chosen.as_deref().is_some_and(|id| ids.clone().any(|i| i == id));
            if !there {
                *chosen = ids.next().map(str::to_owned);
            }
        }
        one(&mut self.volume, case.volumes.iter().map(|v| v.id.as_str()));
        one(&mut self.cutter, case.cutters.iter().map(|c| c.id.as_str()));
        one(&mut self.fragment, case.fragments.iter().map(|f| f.id.as_str()));
        one(&mut self.implant, case.implants.iter().map(|i| i.id.as_str()));
        one(&mut self.grid, case.grids.iter().map(|g| g.id.as_str()));
        self.split_by.retain(|id| case.cutter(id).is_some());
    }
}

/// Something only the host can do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Request {
    /// Ask for a data file or a case, and open it.
    OpenFile,
    /// Ask for a folder (a DICOM series), and open it.
    OpenFolder,
    /// Make all views fit, the camera included.
    Fit,
}

/// Lent to a tool for one frame.
#[derive(Debug)]
pub struct ToolContext<'a> {
    /// The plan, to read.
    pub case: &'a Case,
    /// Samples and triangles that are loaded.
    pub assets: &'a Assets,
    /// What is chosen.
    pub selection: &'a mut Selection,
    /// Crosshair, windows, pan and zoom.
    pub views: &'a mut Views,
    edits: &'a mut Vec<Edit>,
    requests: &'a mut Vec<Request>,
    captured: bool,
}

impl<'a> ToolContext<'a> {
    /// A context that collects into `edits` and `requests`.
    pub fn new(
        case: &'a Case,
        assets: &'a Assets,
        selection: &'a mut Selection,
        views: &'a mut Views,
        edits: &'a mut Vec<Edit>,
        requests: &'a mut Vec<Request>,
    ) -> Self {
        Self { case, assets, selection, views, edits, requests, captured: false }
    }

    /// Changes the case after this frame.
    pub fn edit(&mut self, edit: Edit) {
        self.edits.push(edit);
    }

    /// Asks the host for something.
    pub fn request(&mut self, request: Request) {
        self.requests.push(request);
    }

    /// Takes the drag that the press being handled starts: the view will not orbit.
    pub fn capture(&mut self) {
        self.captured = true;
    }

    /// Whether [`ToolContext::capture`] was called.
    pub fn is_captured(&self) -> bool {
        self.captured
    }

    /// The chosen volume.
    pub fn volume(&self) -> Option<&'a Volume> {
        self.case.volume(self.selection.volume.as_deref()?)
    }

    /// The chosen cutter.
    pub fn cutter(&self) -> Option<&'a NamedCutter> {
        self.case.cutter(self.selection.cutter.as_deref()?)
    }

    /// The chosen fragment.
    pub fn fragment(&self) -> Option<&'a Fragment> {
        self.case.fragment(self.selection.fragment.as_deref()?)
    }

    /// The chosen implant.
    pub fn implant(&self) -> Option<&'a Implant> {
        self.case.implant(self.selection.implant.as_deref()?)
    }

    /// The chosen unstructured grid.
    pub fn grid(&self) -> Option<&'a UnstructuredGrid> {
        self.case.grid(self.selection.grid.as_deref()?)
    }

    /// Where the sections cross, or the middle of everything.
    pub fn crosshair(&self) -> Point {
        self.views.crosshair.unwrap_or_else(|| views::ball_of_case(self.case, self.assets).centre)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::volume::{Cutter, Vector};

    #[test]
    fn a_selection_never_names_what_is_gone() {
        let plane = Cutter::plane(Point::origin(), Vector::x()).expect("plane");
        let cutters = vec![NamedCutter::new("a", plane), NamedCutter::new("b", plane)];
        let mut case = Case { cutters, ..Case::default() };
        let mut selection = Selection { cutter: Some("b".into()), ..Selection::default() };
        selection.split_by = ["a".to_owned(), "gone".to_owned()].into();
        selection.repair(&case);
        assert_eq!(selection.cutter.as_deref(), Some("b"), "what is there stays chosen");
        assert_eq!(selection.split_by.len(), 1, "what is gone is not split by");
        case.cutters.pop();
        selection.repair(&case);
        assert_eq!(selection.cutter.as_deref(), Some("a"), "another takes its place");
        case.cutters.clear();
        selection.repair(&case);
        assert_eq!(selection.cutter, None, "none where there is none");
    }
}
