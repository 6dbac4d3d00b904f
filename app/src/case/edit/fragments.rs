//! Volumes and fragments divided by cutters, and fragments made one again.

use std::collections::{BTreeMap, BTreeSet};

use render::volume::{Affine, Cutter, Point, Side};

use super::EditError;
use super::apply::{cutter_mut, fragment_mut, volume_mut};
use crate::case::{Case, Fragment, NamedCutter, grids, split};

pub(super) fn split_volume(
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
    let stays: Vec<String> = stay.iter().flatten().map(|f| f.id.clone()).collect();
    for (number, (keep, same)) in keeps.into_iter().zip(stay).enumerate() {
        let fragment = same.unwrap_or_else(|| {
            let wish = format!("{volume}-{}", number + 1);
            let id = Case::free_id(&wish, taken.iter().map(String::as_str));
            taken.push(id.clone());
            let parent = before.iter().find(|f| f.keep.iter().all(|(c, side)| keep.get(c) == Some(side)));
            let mut fragment = Fragment::new(id, volume, keep);
            if let Some(parent) = parent {
                (fragment.pose, fragment.visible) = (parent.pose, parent.visible);
                if !stays.contains(&parent.id) {
                    grids::follow(case, &parent.id, &fragment.id);
                }
            }
            fragment
        });
        case.fragments.push(fragment);
    }
    Ok(())
}

pub(super) fn split(case: &mut Case, id: &str, cutter: &str, corners: &[Point; 8]) -> Result<(), EditError> {
    let parent = fragment_mut(case, id)?.clone();
    let given = cutter_mut(case, cutter)?.clone();
    let is_moved = parent.pose != Affine::identity();
    let own = if is_moved {
        // Cutters are about the volume in its unmoved place, so the cut goes back with the fragment.
        let own_id = case.free_cutter_id(&format!("{cutter}-{id}"));
        NamedCutter::new(own_id, given.cutter.moved(&parent.pose.inverse()))
    } else {
        given
    };
    let misses = || EditError::Misses { cutter: cutter.to_owned(), id: id.to_owned() };
    if parent.keep.contains_key(&own.id) {
        return Err(misses());
    }
    let (mut cutters, sides): (Vec<Cutter>, Vec<Side>) = case.piece(&parent).keep.into_iter().unzip();
    cutters.push(own.cutter);
    let mut patterns = split::patterns(&cutters, corners)?;
    patterns.retain(|pattern| pattern.starts_with(&sides));
    if patterns.len() < 2 {
        return Err(misses());
    }
    let mut parts = Vec::with_capacity(2);
    for side in [Side::Plus, Side::Minus] {
        let taken = case.fragments.iter().chain(&parts).map(|f: &Fragment| f.id.as_str());
        let mut part =
            Fragment { id: Case::free_id(&format!("{id}-{}", parts.len() + 1), taken), ..parent.clone() };
        part.keep.insert(own.id.clone(), side);
        parts.push(part);
    }
    if let Some(part) = parts.first() {
        grids::follow(case, id, &part.id);
    }
    if let Some(at) = case.fragments.iter().position(|f| f.id == id) {
        case.fragments.splice(at..=at, parts);
    }
    if is_moved {
        case.cutters.push(own);
    }
    Ok(())
}

pub(super) fn fuse(case: &mut Case, ids: &[String], corners: &[Point; 8]) -> Result<(), EditError> {
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
    let ids_used: BTreeSet<&String> = parts.iter().flat_map(|f| f.keep.keys()).collect();
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
    for other in ids {
        grids::follow(case, other, &id);
    }
    Ok(())
}
