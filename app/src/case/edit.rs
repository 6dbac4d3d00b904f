//! Every change there is to a case, as a value: one path for tools, undo, replay and tests.

use std::collections::BTreeMap;
use std::sync::Arc;

use render::scene::{Camera, CameraError, Shading, TextureFormat, VolumeMode};
use render::volume::{Affine, Cutter, CutterError, Point, Side, SpaceError, Transfer};
use thiserror::Error;

use super::labels::{self, LabelChange, LabelSet};
use super::{Case, Fragment, Implant, NamedCutter, Volume, split};

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
    /// A new cutter at the end of the list.
    AddCutter(NamedCutter),
    /// Takes a cutter away. Refused while fragments keep a side of it.
    RemoveCutter {
        /// The cutter.
        id: String,
    },
    /// Another id; the fragments that name it follow.
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
    /// Makes one fragment of several of one volume, in the place of the first. Refused where their
    /// union is not what one set of kept sides can say.
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
        /// Volume, cutter, fragment or implant.
        kind: &'static str,
        /// As asked for.
        id: String,
    },
    /// The id is taken.
    #[error("there is already a {kind} \"{id}\"; choose another name")]
    Taken {
        /// Volume, cutter, fragment or implant.
        kind: &'static str,
        /// As asked for.
        id: String,
    },
    /// The id is empty.
    #[error("a {kind} needs a name that is not empty")]
    Nameless {
        /// Volume, cutter, fragment or implant.
        kind: &'static str,
    },
    /// Something still refers to it.
    #[error("the {kind} \"{id}\" is still used by fragment \"{by}\"; remove or fuse the fragments first")]
    InUse {
        /// Volume or cutter.
        kind: &'static str,
        /// What was to be removed.
        id: String,
        /// The first fragment that uses it.
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
    /// The cutter is no surface.
    #[error("{0}")]
    Cutter(#[from] CutterError),
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

/// Applies a change, or leaves the case as it was.
///
/// # Errors
/// [`EditError`] where the change would break a reference, an id or a range.
pub fn apply(case: &mut Case, edit: Edit) -> Result<(), EditError> {
    match edit {
        Edit::SetName(name) => case.name = name,
        Edit::SetBackground(color) => {
            case.background = unit_color(color, "a component of the background")?;
        }
        Edit::SetCamera(camera) => {
            if let Some(camera) = &camera {
                camera.frame()?;
            }
            case.camera = camera;
        }
        Edit::SetStep { id, step } => volume_mut(case, &id)?.step = step,
        Edit::AddVolume(volume) => {
            new_id("volume", &volume.id, case.volume(&volume.id).is_some())?;
            rigid(&volume.id, volume.pose)?;
            case.volumes.push(*volume);
        }
        Edit::RemoveVolume { id } => {
            volume_mut(case, &id)?;
            let user = case.fragments_of(&id).next().map(|f| f.id.clone());
            if let Some(by) = user {
                return Err(EditError::InUse { kind: "volume", id, by });
            }
            case.volumes.retain(|v| v.id != id);
            case.labels.retain(|l| l.volume != id);
        }
        Edit::RenameVolume { id, to } => {
            new_id("volume", &to, id != to && case.volume(&to).is_some())?;
            volume_mut(case, &id)?.id.clone_from(&to);
            for fragment in case.fragments.iter_mut().filter(|f| f.volume == id) {
                fragment.volume.clone_from(&to);
            }
            for labels in case.labels.iter_mut().filter(|l| l.volume == id) {
                labels.volume.clone_from(&to);
            }
        }
        Edit::SetVolumePose { id, pose } => volume_mut(case, &id)?.pose = rigid(&id, pose)?,
        Edit::SetVolumeVisible { id, visible } => volume_mut(case, &id)?.visible = visible,
        Edit::SetTexture { id, texture } => volume_mut(case, &id)?.texture = texture,
        Edit::SetTransfer { id, transfer } => volume_mut(case, &id)?.transfer = transfer,
        Edit::SetVolumeShading { id, shading } => volume_mut(case, &id)?.shading = shading,
        Edit::SetVolumeMode { id, mode } => {
            if let VolumeMode::Isosurface { value, opacity } = mode {
                unit(opacity, "an isosurface's opacity")?;
                finite(value, "an isosurface's value")?;
            }
            volume_mut(case, &id)?.mode = mode;
        }
        Edit::SetBlend { id, blend } => {
            volume_mut(case, &id)?.blend = unit(blend, "a volume's blend")?;
        }
        Edit::AddCutter(cutter) => {
            new_id("cutter", &cutter.id, case.cutter(&cutter.id).is_some())?;
            valid(&cutter.cutter)?;
            case.cutters.push(cutter);
        }
        Edit::RemoveCutter { id } => {
            cutter_mut(case, &id)?;
            if let Some(user) = case.fragments.iter().find(|f| f.keep.contains_key(&id)) {
                return Err(EditError::InUse { kind: "cutter", by: user.id.clone(), id });
            }
            case.cutters.retain(|c| c.id != id);
        }
        Edit::RenameCutter { id, to } => {
            new_id("cutter", &to, id != to && case.cutter(&to).is_some())?;
            cutter_mut(case, &id)?.id.clone_from(&to);
            for fragment in &mut case.fragments {
                if let Some(side) = fragment.keep.remove(&id) {
                    fragment.keep.insert(to.clone(), side);
                }
            }
        }
        Edit::SetCutter { id, cutter } => {
            valid(&cutter)?;
            cutter_mut(case, &id)?.cutter = cutter;
        }
        Edit::Split { volume, cutters, corners } => split_volume(case, &volume, &cutters, &corners)?,
        Edit::Fuse { ids, corners } => fuse(case, &ids, &corners)?,
        Edit::Unsplit { volume } => {
            volume_mut(case, &volume)?;
            case.fragments.retain(|f| f.volume != volume);
        }
        Edit::AddFragment(fragment) => {
            new_id("fragment", &fragment.id, case.fragment(&fragment.id).is_some())?;
            volume_mut(case, &fragment.volume)?;
            for cutter in fragment.keep.keys() {
                cutter_mut(case, cutter)?;
            }
            rigid(&fragment.id, fragment.pose)?;
            case.fragments.push(fragment);
        }
        Edit::RemoveFragment { id } => {
            let volume = fragment_mut(case, &id)?.volume.clone();
            if case.fragments_of(&volume).count() == 1 {
                return Err(EditError::LastFragment { id });
            }
            case.fragments.retain(|f| f.id != id);
        }
        Edit::RenameFragment { id, to } => {
            new_id("fragment", &to, id != to && case.fragment(&to).is_some())?;
            fragment_mut(case, &id)?.id = to;
        }
        Edit::SetFragmentPose { id, pose } => fragment_mut(case, &id)?.pose = rigid(&id, pose)?,
        Edit::SetFragmentVisible { id, visible } => fragment_mut(case, &id)?.visible = visible,
        other => apply_to_labels(case, other)?,
    }
    Ok(())
}

fn apply_to_labels(case: &mut Case, edit: Edit) -> Result<(), EditError> {
    match edit {
        Edit::AddLabels(set) => {
            new_id("label set", &set.id, case.label_set(&set.id).is_some())?;
            volume_mut(case, &set.volume)?;
            for color in set.colors.values() {
                labels::check_color(*color)?;
            }
            case.labels.push(*set);
        }
        Edit::MakeLabels { id, volume } => {
            let made = volume_mut(case, &id)?.clone();
            volume_mut(case, &volume)?;
            if id == volume {
                return Err(EditError::OwnLabels { id });
            }
            let mut set = LabelSet::new(case.free_labels_id(&id), volume, Some(made.source));
            set.item = made.item;
            apply(case, Edit::RemoveVolume { id })?;
            case.labels.push(set);
        }
        Edit::ChangeLabels { id, change } => {
            let missing = || EditError::Missing { kind: "label set", id: id.clone() };
            let index = case.labels.iter().position(|l| l.id == id).ok_or_else(missing)?;
            labels::apply(&mut case.labels, index, change)?;
        }
        implant => apply_to_implants(case, implant)?,
    }
    Ok(())
}

fn apply_to_implants(case: &mut Case, edit: Edit) -> Result<(), EditError> {
    match edit {
        Edit::AddImplant(implant) => {
            new_id("implant", &implant.id, case.implant(&implant.id).is_some())?;
            rigid(&implant.id, implant.pose)?;
            positive(implant.scale)?;
            unit_color(implant.color, "a component of an implant's colour")?;
            unit(implant.opacity, "an implant's opacity")?;
            case.implants.push(*implant);
        }
        Edit::RemoveImplant { id } => {
            implant_mut(case, &id)?;
            case.implants.retain(|i| i.id != id);
        }
        Edit::RenameImplant { id, to } => {
            new_id("implant", &to, id != to && case.implant(&to).is_some())?;
            implant_mut(case, &id)?.id = to;
        }
        Edit::SetImplantPose { id, pose } => implant_mut(case, &id)?.pose = rigid(&id, pose)?,
        Edit::SetImplantScale { id, scale } => implant_mut(case, &id)?.scale = positive(scale)?,
        Edit::SetImplantColor { id, color } => {
            implant_mut(case, &id)?.color = unit_color(color, "a component of an implant's colour")?;
        }
        Edit::SetImplantOpacity { id, opacity } => {
            implant_mut(case, &id)?.opacity = unit(opacity, "an implant's opacity")?;
        }
        Edit::SetImplantVisible { id, visible } => implant_mut(case, &id)?.visible = visible,
        Edit::SetImplantShading { id, shading } => implant_mut(case, &id)?.shading = shading,
        // All others were done by `apply`.
        _ => {}
    }
    Ok(())
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

fn split_volume(
    case: &mut Case,
    volume: &str,
    ids: &[String],
    corners: &[Point; 8],
) -> Result<(), EditError> {
    volume_mut(case, volume)?;
    if ids.is_empty() {
        return Err(split::SplitError::NoCutter.into());
    }
    let mut cutters = Vec::with_capacity(ids.len());
    for id in ids {
        cutters.push(cutter_mut(case, id)?.cutter);
    }
    let patterns = split::patterns(&cutters, corners)?;
    let before: Vec<Fragment> = case.fragments_of(volume).cloned().collect();
    case.fragments.retain(|f| f.volume != volume);
    let keeps: Vec<BTreeMap<String, Side>> =
        patterns.iter().map(|sides| ids.iter().cloned().zip(sides.iter().copied()).collect()).collect();
    // Fragments that stay take their ids first, so that new ones do not.
    let stay: Vec<Option<Fragment>> =
        keeps.iter().map(|keep| before.iter().find(|f| f.keep == *keep).cloned()).collect();
    let mut taken: Vec<String> =
        case.fragments.iter().chain(stay.iter().flatten()).map(|f| f.id.clone()).collect();
    for (number, (keep, same)) in keeps.into_iter().zip(stay).enumerate() {
        let fragment = same.unwrap_or_else(|| {
            let wish = format!("{volume}-{}", number + 1);
            let id = Case::free_id(&wish, taken.iter().map(String::as_str));
            taken.push(id.clone());
            let parent = before.iter().find(|f| f.keep.iter().all(|(c, side)| keep.get(c) == Some(side)));
            let mut fragment = Fragment::new(id, volume, keep);
            if let Some(parent) = parent {
                (fragment.pose, fragment.visible) = (parent.pose, parent.visible);
            }
            fragment
        });
        case.fragments.push(fragment);
    }
    Ok(())
}

fn fuse(case: &mut Case, ids: &[String], corners: &[Point; 8]) -> Result<(), EditError> {
    let refuse = |fault: &str| Err(EditError::Fuse { fault: fault.to_owned() });
    let mut parts = Vec::with_capacity(ids.len());
    for id in ids {
        parts.push(fragment_mut(case, id)?.clone());
    }
    let [first, rest @ ..] = parts.as_slice() else {
        return refuse("choose two or more");
    };
    if rest.is_empty() {
        return refuse("choose two or more");
    }
    if rest.iter().any(|f| f.volume != first.volume) {
        return refuse("they are of different volumes");
    }
    // What all parts agree on; the union is that exactly if every pattern within it is in some part.
    let mut keep = first.keep.clone();
    keep.retain(|id, side| rest.iter().all(|f| f.keep.get(id) == Some(side)));
    let ids_used: std::collections::BTreeSet<&String> = parts.iter().flat_map(|f| f.keep.keys()).collect();
    let cutters: Vec<Cutter> = ids_used.iter().filter_map(|id| case.cutter(id).map(|c| c.cutter)).collect();
    for pattern in split::patterns(&cutters, corners)? {
        let sides: BTreeMap<&String, Side> = ids_used.iter().copied().zip(pattern).collect();
        let within =
            |keep: &BTreeMap<String, Side>| keep.iter().all(|(id, side)| sides.get(id) == Some(side));
        if within(&keep) && !parts.iter().any(|f| within(&f.keep)) {
            return refuse("another piece lies in the gap between them; fuse it too");
        }
    }
    let id = first.id.clone();
    fragment_mut(case, &id)?.keep = keep;
    case.fragments.retain(|f| f.id == id || !ids.contains(&f.id));
    Ok(())
}

fn volume_mut<'a>(case: &'a mut Case, id: &str) -> Result<&'a mut Volume, EditError> {
    let missing = || EditError::Missing { kind: "volume", id: id.to_owned() };
    case.volumes.iter_mut().find(|v| v.id == id).ok_or_else(missing)
}

fn cutter_mut<'a>(case: &'a mut Case, id: &str) -> Result<&'a mut NamedCutter, EditError> {
    let missing = || EditError::Missing { kind: "cutter", id: id.to_owned() };
    case.cutters.iter_mut().find(|c| c.id == id).ok_or_else(missing)
}

fn fragment_mut<'a>(case: &'a mut Case, id: &str) -> Result<&'a mut Fragment, EditError> {
    let missing = || EditError::Missing { kind: "fragment", id: id.to_owned() };
    case.fragments.iter_mut().find(|f| f.id == id).ok_or_else(missing)
}

fn implant_mut<'a>(case: &'a mut Case, id: &str) -> Result<&'a mut Implant, EditError> {
    let missing = || EditError::Missing { kind: "implant", id: id.to_owned() };
    case.implants.iter_mut().find(|i| i.id == id).ok_or_else(missing)
}

fn new_id(kind: &'static str, id: &str, taken: bool) -> Result<(), EditError> {
    if id.is_empty() {
        return Err(EditError::Nameless { kind });
    }
    if taken { Err(EditError::Taken { kind, id: id.to_owned() }) } else { Ok(()) }
}

fn rigid(id: &str, pose: Affine) -> Result<Affine, EditError> {
    pose.require_rigid().map_err(|source| EditError::Pose { id: id.to_owned(), source })
}

/// A cutter's fields are public, so what came from elsewhere than its constructors is checked.
fn valid(cutter: &Cutter) -> Result<(), EditError> {
    match *cutter {
        Cutter::Plane { point, normal } => Cutter::plane(point, normal)?,
        Cutter::Cylinder { point, axis, radius_mm } => Cutter::cylinder(point, axis, radius_mm)?,
        _ => return Ok(()),
    };
    Ok(())
}

fn positive(value: f64) -> Result<f64, EditError> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(EditError::Range { what: "an implant's scale", range: "positive and finite", value })
    }
}

fn unit(value: f64, what: &'static str) -> Result<f64, EditError> {
    if (0.0..=1.0).contains(&value) {
        Ok(value)
    } else {
        Err(EditError::Range { what, range: "between 0 and 1", value })
    }
}

fn finite(value: f64, what: &'static str) -> Result<(), EditError> {
    if value.is_finite() { Ok(()) } else { Err(EditError::Range { what, range: "finite", value }) }
}

fn unit_color(color: [f64; 3], what: &'static str) -> Result<[f64; 3], EditError> {
    for component in color {
        unit(component, what)?;
    }
    Ok(color)
}

#[cfg(test)]
mod tests;
