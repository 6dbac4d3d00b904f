//! A change made to a case, once it is known to break no reference, no id and no range.

use render::scene::VolumeMode;
use render::volume::Affine;

use super::{Edit, EditError, fragments};
use crate::case::labels::{self, LabelSet};
use crate::case::{Case, Fragment, Implant, NamedCutter, Volume, grids};

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
                return Err(EditError::InUse { kind: "volume", id, user: "fragment", by });
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
            case.cutters.push(cutter);
        }
        Edit::RemoveCutter { id } => {
            cutter_mut(case, &id)?;
            let fragments = case.fragments.iter().map(|f| ("fragment", &f.id, &f.keep));
            let implants = case.implants.iter().map(|i| ("implant", &i.id, &i.keep));
            let used = fragments.chain(implants).find(|(_, _, keep)| keep.contains_key(&id));
            if let Some((user, by, _)) = used {
                return Err(EditError::InUse { kind: "cutter", user, by: by.clone(), id });
            }
            case.cutters.retain(|c| c.id != id);
        }
        Edit::RenameCutter { id, to } => {
            new_id("cutter", &to, id != to && case.cutter(&to).is_some())?;
            cutter_mut(case, &id)?.id.clone_from(&to);
            let fragments = case.fragments.iter_mut().map(|f| &mut f.keep);
            for keep in fragments.chain(case.implants.iter_mut().map(|i| &mut i.keep)) {
                if let Some(side) = keep.remove(&id) {
                    keep.insert(to.clone(), side);
                }
            }
        }
        Edit::SetCutter { id, cutter } => cutter_mut(case, &id)?.cutter = cutter,
        Edit::Split { volume, cutters, corners } => {
            fragments::split_volume(case, &volume, &cutters, &corners)?;
        }
        Edit::SplitFragment { id, cutter, corners } => fragments::split(case, &id, &cutter, &corners)?,
        Edit::Fuse { ids, corners } => fragments::fuse(case, &ids, &corners)?,
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
            fragment_mut(case, &id)?.id.clone_from(&to);
            grids::follow(case, &id, &to);
        }
        Edit::SetFragmentPose { id, pose } => fragment_mut(case, &id)?.pose = rigid(&id, pose)?,
        Edit::SetFragmentVisible { id, visible } => fragment_mut(case, &id)?.visible = visible,
        Edit::AddGrid(grid) => grids::add(case, *grid)?,
        Edit::ChangeGrid { id, change } => grids::apply(case, &id, change)?,
        other => apply_to_labels(case, other)?,
    }
    grids::let_go(case);
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
            positive(implant.scale, "an implant's scale")?;
            for cutter in implant.keep.keys() {
                cutter_mut(case, cutter)?;
            }
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
        Edit::SetImplantScale { id, scale } => {
            implant_mut(case, &id)?.scale = positive(scale, "an implant's scale")?;
        }
        Edit::SetImplantKeep { id, keep } => {
            for cutter in keep.keys() {
                cutter_mut(case, cutter)?;
            }
            implant_mut(case, &id)?.keep = keep;
        }
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

pub(super) fn volume_mut<'a>(case: &'a mut Case, id: &str) -> Result<&'a mut Volume, EditError> {
    let missing = || EditError::Missing { kind: "volume", id: id.to_owned() };
    case.volumes.iter_mut().find(|v| v.id == id).ok_or_else(missing)
}

pub(super) fn cutter_mut<'a>(case: &'a mut Case, id: &str) -> Result<&'a mut NamedCutter, EditError> {
    let missing = || EditError::Missing { kind: "cutter", id: id.to_owned() };
    case.cutters.iter_mut().find(|c| c.id == id).ok_or_else(missing)
}

pub(in crate::case) fn fragment_mut<'a>(case: &'a mut Case, id: &str) -> Result<&'a mut Fragment, EditError> {
    let missing = || EditError::Missing { kind: "fragment", id: id.to_owned() };
    case.fragments.iter_mut().find(|f| f.id == id).ok_or_else(missing)
}

fn implant_mut<'a>(case: &'a mut Case, id: &str) -> Result<&'a mut Implant, EditError> {
    let missing = || EditError::Missing { kind: "implant", id: id.to_owned() };
    case.implants.iter_mut().find(|i| i.id == id).ok_or_else(missing)
}

pub(in crate::case) fn new_id(kind: &'static str, id: &str, taken: bool) -> Result<(), EditError> {
    if id.is_empty() {
        return Err(EditError::Nameless { kind });
    }
    if taken { Err(EditError::Taken { kind, id: id.to_owned() }) } else { Ok(()) }
}

pub(in crate::case) fn rigid(id: &str, pose: Affine) -> Result<Affine, EditError> {
    pose.require_rigid().map_err(|source| EditError::Pose { id: id.to_owned(), source })
}

pub(in crate::case) fn positive(value: f64, what: &'static str) -> Result<f64, EditError> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(EditError::Range { what, range: "positive and finite", value })
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
