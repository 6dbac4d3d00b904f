//! Every change there is to a case, as a value: one path for tools, undo, replay and tests.

use std::collections::BTreeMap;
use std::sync::Arc;

use render::scene::{Camera, CameraError, Shading, TextureFormat, VolumeMode};
use render::volume::{Affine, Cutter, Point, Side, SpaceError, Transfer};
use thiserror::Error;

use super::grids::{GridChange, UnstructuredGrid};
use super::labels::{LabelChange, LabelSet};
use super::{Fragment, Implant, NamedCutter, Volume, split};

mod apply;
mod fragments;

pub use apply::apply;
pub(super) use apply::{fragment_mut, new_id, positive, rigid};

/// A change to a case. `id` names the thing changed.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Edit {
    /// The case's name.
    SetName(String),
    /// Display colour behind everything; 0 to 1.
    SetBackground([f64; 3]),
    /// The view; none fits everything. Not undone: see [`super::History`].
    SetCamera(Option<Camera>),
    /// The step that a volume over time shows. Not undone: see [`super::History`].
    SetStep {
        /// The volume.
        id: String,
        /// From 0.
        step: usize,
    },
    /// A new volume at the end of the list.
    AddVolume(Box<Volume>),
    /// Takes a volume away, and the labels on it. Refused while fragments are of it.
    RemoveVolume {
        /// The volume.
        id: String,
    },
    /// Another id; its fragments and labels follow.
    RenameVolume {
        /// The volume.
        id: String,
        /// The new id.
        to: String,
    },
    /// Where the whole volume is placed.
    SetVolumePose {
        /// The volume.
        id: String,
        /// Rigid.
        pose: Affine,
    },
    /// Whether it is drawn.
    SetVolumeVisible {
        /// The volume.
        id: String,
        /// Drawn.
        visible: bool,
    },
    /// How the GPU keeps it.
    SetTexture {
        /// The volume.
        id: String,
        /// The format.
        texture: TextureFormat,
    },
    /// Its colours and opacities.
    SetTransfer {
        /// The volume.
        id: String,
        /// The function.
        transfer: Arc<Transfer>,
    },
    /// Its lighting.
    SetVolumeShading {
        /// The volume.
        id: String,
        /// The lighting.
        shading: Shading,
    },
    /// What is drawn of it in 3D.
    SetVolumeMode {
        /// The volume.
        id: String,
        /// The mode.
        mode: VolumeMode,
    },
    /// How much it counts where other volumes are in a section.
    SetBlend {
        /// The volume.
        id: String,
        /// 0 to 1.
        blend: f64,
    },
    /// A new label set at the end of the list.
    AddLabels(Box<LabelSet>),
    /// Labels that were loaded as a volume become labels on another one, in one step.
    MakeLabels {
        /// The volume that holds labels; it is taken away.
        id: String,
        /// The volume that they are on.
        volume: String,
    },
    /// A change to a label set.
    ChangeLabels {
        /// The set.
        id: String,
        /// What changes.
        change: LabelChange,
    },
    /// A new unstructured grid at the end of the list.
    AddGrid(Box<UnstructuredGrid>),
    /// A change to an unstructured grid.
    ChangeGrid {
        /// The grid.
        id: String,
        /// What changes.
        change: GridChange,
    },
    /// A new cutter at the end of the list.
    AddCutter(NamedCutter),
    /// Takes a cutter away. Refused while fragments or implants keep a side of it.
    RemoveCutter {
        /// The cutter.
        id: String,
    },
    /// Another id; the fragments and implants that name it follow.
    RenameCutter {
        /// The cutter.
        id: String,
        /// The new id.
        to: String,
    },
    /// Another surface: moved, turned or of another kind.
    SetCutter {
        /// The cutter.
        id: String,
        /// The surface; world mm.
        cutter: Cutter,
    },
    /// Replaces a volume's fragments by all that the cutters make of it and that are not empty. One
    /// with the keep of an existing fragment stays that fragment; one that is part of an existing
    /// fragment starts at its pose.
    Split {
        /// The volume.
        volume: String,
        /// Cutter ids.
        cutters: Vec<String>,
        /// The corners of the volume's box in its unmoved place, world mm; corner bits are x, y, z.
        corners: [Point; 8],
    },
    /// Divides one fragment by a cutter, meant where the fragment is now, in two that stay there. Where
    /// the fragment was moved a cutter of its own is added: this one, taken back by its pose. Refused
    /// where the cutter does not pass through it.
    SplitFragment {
        /// The fragment.
        id: String,
        /// A cutter's id.
        cutter: String,
        /// As for [`Edit::Split`].
        corners: [Point; 8],
    },
    /// Makes one fragment of several of one volume, in the place of the first; what a saw took between
    /// them comes back. Refused where their union is not what one set of kept sides can say.
    Fuse {
        /// The fragments, two or more; the first gives id and pose.
        ids: Vec<String>,
        /// As for [`Edit::Split`].
        corners: [Point; 8],
    },
    /// Removes all fragments of a volume, so that it is whole again.
    Unsplit {
        /// The volume.
        volume: String,
    },
    /// A new fragment at the end of the list.
    AddFragment(Fragment),
    /// Takes a fragment away: the piece is no longer drawn. Taking the last one away would show the
    /// whole volume again, so that is refused; see [`Edit::Unsplit`].
    RemoveFragment {
        /// The fragment.
        id: String,
    },
    /// Another id.
    RenameFragment {
        /// The fragment.
        id: String,
        /// The new id.
        to: String,
    },
    /// Moves it.
    SetFragmentPose {
        /// The fragment.
        id: String,
        /// `world_from_unmoved`, rigid.
        pose: Affine,
    },
    /// Whether it is drawn.
    SetFragmentVisible {
        /// The fragment.
        id: String,
        /// Drawn.
        visible: bool,
    },
    /// A new implant at the end of the list.
    AddImplant(Box<Implant>),
    /// Takes an implant away.
    RemoveImplant {
        /// The implant.
        id: String,
    },
    /// Another id.
    RenameImplant {
        /// The implant.
        id: String,
        /// The new id.
        to: String,
    },
    /// Moves it.
    SetImplantPose {
        /// The implant.
        id: String,
        /// Rigid.
        pose: Affine,
    },
    /// Millimetres per unit of the model.
    SetImplantScale {
        /// The implant.
        id: String,
        /// > 0.
        scale: f64,
    },
    /// What cutters leave of it.
    SetImplantKeep {
        /// The implant.
        id: String,
        /// Side kept, by cutter id.
        keep: BTreeMap<String, Side>,
    },
    /// Its colour.
    SetImplantColor {
        /// The implant.
        id: String,
        /// 0 to 1.
        color: [f64; 3],
    },
    /// How much it hides.
    SetImplantOpacity {
        /// The implant.
        id: String,
        /// 0 to 1.
        opacity: f64,
    },
    /// Whether it is drawn.
    SetImplantVisible {
        /// The implant.
        id: String,
        /// Drawn.
        visible: bool,
    },
    /// Its lighting.
    SetImplantShading {
        /// The implant.
        id: String,
        /// The lighting.
        shading: Shading,
    },
}

/// Why a change was refused; the case is as it was.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EditError {
    /// Nothing of that kind has the id.
    #[error("there is no {kind} \"{id}\"")]
    Missing {
        /// Volume, cutter, fragment, implant or grid.
        kind: &'static str,
        /// As asked for.
        id: String,
    },
    /// The id is taken.
    #[error("there is already a {kind} \"{id}\"; choose another name")]
    Taken {
        /// Volume, cutter, fragment, implant or grid.
        kind: &'static str,
        /// As asked for.
        id: String,
    },
    /// The id is empty.
    #[error("a {kind} needs a name that is not empty")]
    Nameless {
        /// Volume, cutter, fragment, implant or grid.
        kind: &'static str,
    },
    /// Something still refers to it.
    #[error("the {kind} \"{id}\" is still used by {user} \"{by}\"; remove that, or its cuts, first")]
    InUse {
        /// Volume or cutter.
        kind: &'static str,
        /// What was to be removed.
        id: String,
        /// Fragment or implant.
        user: &'static str,
        /// The first that uses it.
        by: String,
    },
    /// The last fragment of a volume.
    #[error("\"{id}\" is the only fragment of its volume; hide it, or fuse the volume")]
    LastFragment {
        /// The fragment.
        id: String,
    },
    /// The pose is not rigid.
    #[error("the pose of \"{id}\" cannot be used: {source}")]
    Pose {
        /// What was to be moved.
        id: String,
        /// What is wrong with it.
        source: SpaceError,
    },
    /// Not both sides of the cutter have a part of the fragment.
    #[error("\"{cutter}\" does not pass through \"{id}\" where it is now; move the cutter there")]
    Misses {
        /// The cutter.
        cutter: String,
        /// The fragment.
        id: String,
    },
    /// The camera shows nothing.
    #[error("{0}")]
    Camera(#[from] CameraError),
    /// A number is out of its range.
    #[error("{what} must be {range}, not {value}")]
    Range {
        /// What it is.
        what: &'static str,
        /// What is allowed.
        range: &'static str,
        /// As given.
        value: f64,
    },
    /// Labels on themselves.
    #[error("\"{id}\" cannot be labels on itself; choose another volume")]
    OwnLabels {
        /// The volume.
        id: String,
    },
    /// The cutters cannot split the volume.
    #[error("{0}")]
    Split(#[from] split::SplitError),
    /// The fragments cannot be fused.
    #[error("these fragments cannot become one: {fault}")]
    Fuse {
        /// Why, in a clause.
        fault: String,
    },
}

impl Edit {
    /// Whether this and an earlier change are steps of one drag: both set the same property of the
    /// same thing. What adds, removes or splits is always a step of its own.
    pub fn continues(&self, earlier: &Self) -> bool {
        if std::mem::discriminant(self) != std::mem::discriminant(earlier) {
            return false;
        }
        if let (Self::ChangeLabels { id: a, change }, Self::ChangeLabels { id: b, change: before }) =
            (self, earlier)
        {
            return a == b && change.continues(before);
        }
        if let (Self::ChangeGrid { id: a, change }, Self::ChangeGrid { id: b, change: before }) =
            (self, earlier)
        {
            return a == b && change.continues(before);
        }
        match (self.dragged(), earlier.dragged()) {
            (Some(a), Some(b)) => a == b,
            _ => false,
        }
    }

    /// The thing whose property is set; none where the change is not of the kind a drag makes.
    fn dragged(&self) -> Option<&str> {
        match self {
            Self::SetName(_) | Self::SetBackground(_) => Some(""),
            Self::SetVolumePose { id, .. }
            | Self::SetTransfer { id, .. }
            | Self::SetBlend { id, .. }
            | Self::SetVolumeMode { id, .. }
            | Self::SetCutter { id, .. }
            | Self::SetFragmentPose { id, .. }
            | Self::SetImplantPose { id, .. }
            | Self::SetImplantScale { id, .. }
            | Self::SetImplantColor { id, .. }
            | Self::SetImplantOpacity { id, .. } => Some(id),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests;
