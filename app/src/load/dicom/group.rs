//! Which frames make one volume: by series and geometry, then by place, then by time.
#![expect(clippy::arithmetic_side_effects, reason = "f64 vectors of nalgebra; counts of frames in memory")]

use std::collections::BTreeMap;

use render::volume::Vector;

use super::super::{Note, Severity};
use super::header::{Frame, Image};

/// A frame of an image, by position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Ref {
    pub(super) image: usize,
    pub(super) frame: usize,
}

/// Frames of one series and one geometry.
#[derive(Debug, Clone)]
pub(super) struct Group {
    pub(super) frames: Vec<Ref>,
}

/// One or more volumes over the same places.
#[derive(Debug, Clone)]
pub(super) struct Stack {
    /// Distances of the slices along the normal, rising, mm; empty where there is no geometry.
    pub(super) along_mm: Vec<f64>,
    /// Frames of each step in time, in the order of the slices.
    pub(super) steps: Vec<Vec<Ref>>,
    /// Rising from 0; as many as steps.
    pub(super) times_secs: Vec<f64>,
    pub(super) notes: Vec<Note>,
}

/// Directions that differ by less belong to one volume; cosines written with few digits.
const SAME_DIRECTION: f64 = 2e-3;

/// Frames that may lie in one volume, in the order of first sight.
pub(super) fn groups(images: &[Image]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    let mut by_key: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (i, image) in images.iter().enumerate() {
        let key = format!(
            "{} {}x{} {:?} {}",
            image.series_uid, image.columns, image.rows, image.format, image.monochrome1
        );
        let same_key = by_key.entry(key).or_default();
        for (f, frame) in image.frames.iter().enumerate() {
            let it = Ref { image: i, frame: f };
            let fits = |g: &&usize| {
                let first = groups.get(**g).and_then(|g| g.frames.first());
                first.and_then(|r| frame_of(images, *r)).is_some_and(|other| same_geometry(frame, other))
            };
            if let Some(group) = same_key.iter().find(fits).and_then(|g| groups.get_mut(*g)) {
                group.frames.push(it);
            } else {
                same_key.push(groups.len());
                groups.push(Group { frames: vec![it] });
            }
        }
    }
    groups
}

/// The frame that a [`Ref`] names.
pub(super) fn frame_of(images: &[Image], it: Ref) -> Option<&Frame> {
    images.get(it.image)?.frames.get(it.frame)
}

fn same_geometry(a: &Frame, b: &Frame) -> bool {
    let near = |x: &Vector, y: &Vector| (x - y).amax() < SAME_DIRECTION;
    let directions = match (&a.directions, &b.directions) {
        (Some([ar, ac]), Some([br, bc])) => near(ar, br) && near(ac, bc),
        (None, None) => true,
        _ => false,
    };
    let spacing = match (a.spacing_mm, b.spacing_mm) {
        (Some(a), Some(b)) => a.iter().zip(b).all(|(x, y)| (x - y).abs() <= 1e-3 * x.abs()),
        (None, None) => true,
        _ => false,
    };
    directions && spacing && a.position.is_some() == b.position.is_some()
}

/// Sorts a group into volumes: doubled slices dropped, other pictures of one place told apart by what
/// they show, and the rest ordered in time.
pub(super) fn stacks(images: &[Image], group: &Group) -> Vec<Stack> {
    let frame = |r: Ref| frame_of(images, r);
    let first = group.frames.first().and_then(|r| frame(*r));
    let normal = first.and_then(|f| f.directions).map(|[row, column]| row.cross(&column));
    let mut placed: Vec<(f64, Ref)> = Vec::new();
    for (order, r) in group.frames.iter().enumerate() {
        let along = match (normal, frame(*r).and_then(|f| f.position)) {
            (Some(normal), Some(position)) => normal.dot(&position.coords),
            _ => order as f64,
        };
        placed.push((along, *r));
    }
    if normal.is_none() || first.is_none_or(|f| f.position.is_none()) {
        // Without places the file's own count is all there is; cine frames share one.
        placed.sort_by_key(|(_, r)| frame(*r).map(|f| (f.instance, f.temporal_index)));
        let timed = group.frames.len() > 1
            && group.frames.iter().all(|r| frame(*r).is_some_and(|f| f.temporal_index.is_some()));
        let mut slices: Vec<Vec<Ref>> = Vec::new();
        if timed {
            slices.push(placed.iter().map(|(_, r)| *r).collect());
        } else {
            slices.extend(placed.iter().map(|(_, r)| vec![*r]));
        }
        return vec![in_time(images, Vec::new(), slices)];
    }
    placed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (along, slices) = by_place(&placed);
    by_variant(images, along, slices)
}

/// Frames of one place, for each place.
fn by_place(placed: &[(f64, Ref)]) -> (Vec<f64>, Vec<Vec<Ref>>) {
    let mut along: Vec<f64> = Vec::new();
    let mut slices: Vec<Vec<Ref>> = Vec::new();
    for &(mm, r) in placed {
        // A hundredth of a millimetre is less than any scanner's step, and more than rounding.
        match (along.last(), slices.last_mut()) {
            (Some(last), Some(slice)) if mm - last < 0.01 => slice.push(r),
            _ => {
                along.push(mm);
                slices.push(vec![r]);
            }
        }
    }
    (along, slices)
}

/// Where places hold several frames that show different things (another echo, phase, weighting), each
/// kind is a stack of its own.
fn by_variant(images: &[Image], along: Vec<f64>, slices: Vec<Vec<Ref>>) -> Vec<Stack> {
    let variant = |r: &Ref| frame_of(images, *r).map_or("", |f| f.variant.as_str());
    let kinds: std::collections::BTreeSet<&str> = slices.iter().flatten().map(variant).collect();
    if kinds.len() < 2 || slices.iter().all(|s| s.len() < 2) {
        return vec![in_time(images, along, slices)];
    }
    kinds
        .into_iter()
        .map(|kind| {
            let pairs = along.iter().zip(&slices).filter_map(|(mm, slice)| {
                let own: Vec<Ref> = slice.iter().filter(|r| variant(r) == kind).copied().collect();
                (!own.is_empty()).then_some((*mm, own))
            });
            let (along, slices) = pairs.unzip();
            in_time(images, along, slices)
        })
        .collect()
}

/// Deals the frames of each place to steps in time.
fn in_time(images: &[Image], along_mm: Vec<f64>, mut slices: Vec<Vec<Ref>>) -> Stack {
    let mut notes = Vec::new();
    drop_doubles(images, &mut slices, &mut notes);
    let steps = usual_length(&slices);
    if steps < 2 {
        let extra: usize = slices.iter().map(|s| s.len().saturating_sub(1)).sum();
        if extra > 0 {
            notes.push(Note {
                severity: Severity::Loss,
                code: "dicom.slices-doubled",
                text: format!(
                    "{extra} slices lie where another one lies but differ from it; the first of each place was used."
                ),
            });
        }
        let only = slices.iter().filter_map(|s| s.first().copied()).collect();
        return Stack { along_mm, steps: vec![only], times_secs: vec![0.0], notes };
    }
    let volumes = dealt(images, &slices, steps, &mut notes);
    let times_secs = times(images, &volumes, &mut notes);
    Stack { along_mm, steps: volumes, times_secs, notes }
}

/// Frames with the UID of another one of their place are copies.
fn drop_doubles(images: &[Image], slices: &mut [Vec<Ref>], notes: &mut Vec<Note>) {
    let mut dropped = 0_usize;
    for slice in slices {
        let mut seen = std::collections::BTreeSet::new();
        slice.sort_by_key(|r| frame_of(images, *r).map(|f| (f.instance, f.temporal_index)));
        slice.retain(|r| {
            let uid = images.get(r.image).map_or("", |i| i.instance_uid.as_str());
            let fresh = uid.is_empty() || seen.insert((uid, r.frame));
            dropped += usize::from(!fresh);
            fresh
        });
    }
    if dropped > 0 {
        notes.push(Note {
            severity: Severity::Caution,
            code: "dicom.slices-doubled",
            text: format!("{dropped} slices are there twice; the copies were left out."),
        });
    }
}

/// How many frames most places have.
fn usual_length(slices: &[Vec<Ref>]) -> usize {
    let mut lengths: Vec<usize> = slices.iter().map(Vec::len).collect();
    lengths.sort_unstable();
    lengths.get(lengths.len() / 2).copied().unwrap_or(0)
}

/// Steps by the file's temporal index, else by acquisition number where either tells the frames of every
/// place apart, else by the order of time and instance number at each place.
fn dealt(images: &[Image], slices: &[Vec<Ref>], usual: usize, notes: &mut Vec<Note>) -> Vec<Vec<Ref>> {
    type Key = fn(&Frame) -> Option<i64>;
    let keys: [Key; 2] = [|f| f.temporal_index, |f| f.acquisition];
    for key in keys {
        let of = |r: &Ref| frame_of(images, *r).and_then(key);
        let mut by_key: BTreeMap<i64, Vec<Ref>> = BTreeMap::new();
        let all_known = slices.iter().flatten().all(|r| of(r).is_some());
        let distinct = slices.iter().all(|s| {
            let values: std::collections::BTreeSet<_> = s.iter().map(of).collect();
            values.len() == s.len()
        });
        if !(all_known && distinct) {
            continue;
        }
        for r in slices.iter().flatten() {
            by_key.entry(of(r).unwrap_or(0)).or_default().push(*r);
        }
        let found = by_key.len();
        let whole: Vec<Vec<Ref>> = by_key.into_values().filter(|v| v.len() == slices.len()).collect();
        if whole.is_empty() {
            continue;
        }
        if whole.len() < found {
            notes.push(Note {
                severity: Severity::Loss,
                code: "dicom.steps-incomplete",
                text: format!("{} of {found} time steps lack slices and were left out.", found - whole.len()),
            });
        }
        return whole;
    }
    let count = slices.iter().map(Vec::len).min().unwrap_or(0).min(usual);
    let lost: usize = slices.iter().map(|s| s.len() - count).sum();
    if lost > 0 {
        notes.push(Note {
            severity: Severity::Loss,
            code: "dicom.steps-incomplete",
            text: format!("Places have unequal numbers of time steps; {lost} frames were left out."),
        });
    }
    let ordered: Vec<Vec<Ref>> = slices
        .iter()
        .map(|slice| {
            let mut slice = slice.clone();
            let when = |r: &Ref| {
                let f = frame_of(images, *r);
                (f.and_then(|f| f.clock_secs.or(f.trigger_secs)).unwrap_or(0.0), f.map_or(0, |f| f.instance))
            };
            slice.sort_by(|a, b| {
                let (a, b) = (when(a), when(b));
                a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
            });
            slice
        })
        .collect();
    (0..count).map(|t| ordered.iter().filter_map(|s| s.get(t).copied()).collect()).collect()
}

/// When each step began, from the first one on: by the clock, the trigger, the repetition time, or, where
/// nothing says so, a second each.
fn times(images: &[Image], steps: &[Vec<Ref>], notes: &mut Vec<Note>) -> Vec<f64> {
    let start = |of: fn(&Frame) -> Option<f64>| -> Option<Vec<f64>> {
        let starts: Option<Vec<f64>> = steps
            .iter()
            .map(|step| {
                let all = step.iter().filter_map(|r| frame_of(images, *r).and_then(of));
                all.reduce(f64::min)
            })
            .collect();
        let starts = starts?;
        let first = starts.first().copied()?;
        starts.is_sorted_by(|a, b| a < b).then(|| starts.iter().map(|t| t - first).collect())
    };
    if let Some(times) = start(|f| f.clock_secs).or_else(|| start(|f| f.trigger_secs)) {
        return times;
    }
    let image = steps.first().and_then(|s| s.first()).and_then(|r| images.get(r.image));
    let repetition = image.and_then(|i| i.repetition_secs).filter(|t| *t > 0.0);
    let period = repetition.unwrap_or(1.0);
    notes.push(Note {
        severity: Severity::Caution,
        code: "dicom.time-guessed",
        text: format!(
            "The times of the {} steps are not told apart; they were set {period} s apart{}.",
            steps.len(),
            if repetition.is_some() { ", the repetition time" } else { ", which is a guess" }
        ),
    });
    (0..steps.len()).map(|t| t as f64 * period).collect()
}
