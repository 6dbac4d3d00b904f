//! From a stack's frames to a grid or a series: decoding, padding, rescale, polarity, resampling.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use render::volume::{Grid, Rescale, Series};

use super::super::voxels::not_finite;
use super::group::{Ref, Stack, frame_of};
use super::header::Image;
use super::layout::{self, Layout};
use super::pixels::{self, Sample, Trouble};
use super::source::Sources;
use super::walk::PixelKind;
use super::{Content, FORMAT, LoadError, Note, Severity};

/// What the decoding of stacks shares.
pub(super) struct Bench<'a> {
    pub(super) images: &'a [Image],
    pub(super) sources: &'a Sources,
    pub(super) progress: &'a dyn super::Progress,
    pub(super) limit: u64,
    pub(super) done: AtomicUsize,
    pub(super) total: usize,
}

/// Frames of one file, each with where its samples go.
type Slots<'a, T> = Vec<(usize, &'a mut [T])>;

/// Why a stack became no volume.
pub(super) enum Failure {
    /// These frames cannot be decoded; without them the stack may be whole enough.
    Frames(Vec<(Ref, Trouble)>),
    /// It is over.
    Load(LoadError),
}

impl From<LoadError> for Failure {
    fn from(error: LoadError) -> Self {
        Self::Load(error)
    }
}

impl Bench<'_> {
    /// Decodes a stack into what it holds.
    pub(super) fn build(
        &self,
        stack: &Stack,
        layout: &Layout,
        notes: &mut Vec<Note>,
    ) -> Result<Content, Failure> {
        let format = stack.steps.first().and_then(|s| s.first()).and_then(|r| self.images.get(r.image));
        let format = format.map(|i| i.format).ok_or_else(|| self.broken("it has no frame".to_owned()))?;
        match (format.kind, format.allocated, format.signed) {
            (PixelKind::Double, ..) => self.build_as::<f64>(stack, layout, notes),
            (PixelKind::Float, ..) => self.build_as::<f32>(stack, layout, notes),
            (_, 8, false) => self.build_as::<u8>(stack, layout, notes),
            (_, 8, true) => self.build_as::<i8>(stack, layout, notes),
            (_, 16, false) => self.build_as::<u16>(stack, layout, notes),
            (_, 16, true) => self.build_as::<i16>(stack, layout, notes),
            (_, _, false) => self.build_as::<u32>(stack, layout, notes),
            (_, _, true) => self.build_as::<i32>(stack, layout, notes),
        }
    }

    fn broken(&self, fault: String) -> LoadError {
        LoadError::Broken { format: FORMAT, fault, path: self.sources.path().to_owned() }
    }

    fn build_as<T: Sample>(
        &self,
        stack: &Stack,
        layout: &Layout,
        notes: &mut Vec<Note>,
    ) -> Result<Content, Failure> {
        let first = stack.steps.first().and_then(|s| s.first()).and_then(|r| self.images.get(r.image));
        let first = first.ok_or_else(|| self.broken("it has no frame".to_owned()))?;
        let slices = stack.steps.first().map_or(0, Vec::len);
        let depth = layout.blends.as_ref().map_or(slices, Vec::len);
        self.check_size::<T>(first, depth.max(slices), stack.steps.len())?;
        let mut rescales =
            stack.steps.iter().flatten().filter_map(|r| frame_of(self.images, *r).map(|f| f.rescale));
        let rescale = rescales.next().unwrap_or_default();
        let even = rescales.all(|r| r == rescale);
        let mut volumes = Vec::new();
        for step in &stack.steps {
            volumes.push(self.decode::<T>(step, first)?);
        }
        let extent = [first.columns, first.rows, depth];
        let rescale = if first.monochrome1 {
            inverted(&volumes, rescale, notes)
        } else {
            hide_padding(&mut volumes, first.padding, rescale, notes);
            rescale
        };
        if even {
            let laid = volumes.into_iter().map(|v| arranged(v, layout, extent));
            return self.content(laid, (extent, rescale), stack, layout, notes);
        }
        notes.push(Note {
            severity: Severity::Fact,
            code: "dicom.rescale-per-slice",
            text: "The slices have different rescales; values are kept as 32-bit floats.".to_owned(),
        });
        let laid = volumes
            .into_iter()
            .zip(&stack.steps)
            .map(|(volume, step)| arranged(self.rescaled(&volume, step, extent), layout, extent));
        self.content(laid, (extent, Rescale::default()), stack, layout, notes)
    }

    fn check_size<T: Sample>(&self, first: &Image, depth: usize, steps: usize) -> Result<(), LoadError> {
        let bytes = [first.columns, first.rows, depth, steps, size_of::<T>()]
            .iter()
            .fold(1_u128, |all, &n| all.saturating_mul(n as u128));
        if bytes > u128::from(self.limit) {
            let path = self.sources.path().to_owned();
            return Err(LoadError::TooLarge { format: FORMAT, bytes, limit: self.limit, path });
        }
        Ok(())
    }

    /// All frames of one step, one after the other. Each file is opened once, whatever its frames.
    fn decode<T: Sample>(&self, step: &[Ref], first: &Image) -> Result<Vec<T>, Failure> {
        let area = first.columns.saturating_mul(first.rows);
        let mut volume = vec![T::default(); area.saturating_mul(step.len())];
        let mut jobs: Vec<(usize, Slots<'_, T>)> = Vec::new();
        let mut slots: Vec<(Ref, &mut [T])> =
            step.iter().copied().zip(volume.chunks_exact_mut(area)).collect();
        slots.sort_by_key(|(r, _)| (r.image, r.frame));
        for (r, slot) in slots {
            match jobs.last_mut() {
                Some((image, frames)) if *image == r.image => frames.push((r.frame, slot)),
                _ => jobs.push((r.image, vec![(r.frame, slot)])),
            }
        }
        let failures = jobs
            .par_iter_mut()
            .map(|(image, frames)| self.decode_file(*image, frames))
            .try_reduce(Vec::new, |mut a, b| {
                a.extend(b);
                Ok(a)
            })?;
        if failures.is_empty() { Ok(volume) } else { Err(Failure::Frames(failures)) }
    }

    fn decode_file<T: Sample>(
        &self,
        index: usize,
        frames: &mut [(usize, &mut [T])],
    ) -> Result<Vec<(Ref, Trouble)>, LoadError> {
        let Some(image) = self.images.get(index) else { return Ok(Vec::new()) };
        let whole = |trouble: &Trouble, frames: &[(usize, &mut [T])]| {
            frames.iter().map(|(frame, _)| (Ref { image: index, frame: *frame }, trouble.clone())).collect()
        };
        let opened = match self.sources.open(image.source) {
            Ok(opened) => opened,
            Err(super::source::Refusal::Load(error)) => return Err(error),
            Err(super::source::Refusal::Fault(fault)) => return Ok(whole(&Trouble::Broken(fault), frames)),
        };
        let failures = frames
            .par_iter_mut()
            .filter_map(|(frame, slot)| {
                let result = pixels::decode(&opened.bytes, &opened.anatomy, image, *frame, slot);
                result.err().map(|trouble| (Ref { image: index, frame: *frame }, trouble))
            })
            .collect();
        let done = self.done.fetch_add(frames.len(), Ordering::Relaxed).saturating_add(frames.len());
        if self.progress.step("decoding slices", done.min(self.total), self.total) {
            Ok(failures)
        } else {
            Err(LoadError::Cancelled)
        }
    }

    /// Each slice with its own rescale.
    fn rescaled<T: Sample>(&self, volume: &[T], step: &[Ref], extent: [usize; 3]) -> Vec<f32> {
        let area = extent[0].saturating_mul(extent[1]);
        let slices = volume.chunks_exact(area.max(1)).zip(step);
        let each = slices.flat_map(|(slice, r)| {
            let Rescale { slope, intercept } =
                frame_of(self.images, *r).map(|f| f.rescale).unwrap_or_default();
            slice.iter().map(move |s| <f32 as Sample>::nearest(s.to_f64() * slope + intercept))
        });
        each.collect()
    }

    fn content<T: Sample>(
        &self,
        volumes: impl Iterator<Item = Vec<T>>,
        (extent, rescale): ([usize; 3], Rescale),
        stack: &Stack,
        layout: &Layout,
        notes: &mut Vec<Note>,
    ) -> Result<Content, Failure> {
        let mut grids = Vec::new();
        for volume in volumes {
            let grid = Grid::new(extent, T::samples(volume), rescale, layout.world_from_voxel);
            grids.push(Arc::new(grid.map_err(|e| self.broken(e.to_string()))?));
        }
        notes.extend(not_finite(&grids));
        if grids.len() == 1 {
            let only = grids.pop().map(Arc::unwrap_or_clone);
            let only = only.ok_or_else(|| self.broken("it has no frame".to_owned()))?;
            return Ok(Content::Volume(only));
        }
        let series = Series::new(grids, stack.times_secs.clone());
        Ok(Content::Series(series.map_err(|e| self.broken(e.to_string()))?))
    }
}

/// MONOCHROME1 says that the least value is white. Everything after the loader takes more for brighter
/// and denser, so the values are turned about the middle of their range; the rescale does it, the samples
/// stay. The values of a file that was inverted when it was marked so come back up to a constant.
fn inverted<T: Sample>(volumes: &[Vec<T>], rescale: Rescale, notes: &mut Vec<Note>) -> Rescale {
    let [low, high] = volumes
        .par_iter()
        .flat_map(|v| v.par_iter())
        .map(|s| s.to_f64())
        .filter(|v| v.is_finite())
        .fold(|| [f64::INFINITY, f64::NEG_INFINITY], |r, v| [r[0].min(v), r[1].max(v)])
        .reduce(|| [f64::INFINITY, f64::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    let sum = if low <= high { low + high } else { 0.0 };
    notes.push(Note {
        severity: Severity::Caution,
        code: "dicom.monochrome1",
        text: format!(
            "The file shows its least value as white (MONOCHROME1); stored values were turned about their middle, {}, so that more is brighter.",
            sum / 2.0
        ),
    });
    Rescale { slope: -rescale.slope, intercept: rescale.slope * sum + rescale.intercept }
}

/// Pixels that mean "no sample" must not shine: unless they are the lowest values anyway, they are set to
/// the lowest value there is.
fn hide_padding<T: Sample>(
    volumes: &mut [Vec<T>],
    padding: Option<[i64; 2]>,
    rescale: Rescale,
    notes: &mut Vec<Note>,
) {
    let Some([low, high]) = padding.map(|p| p.map(|v| v as f64)) else { return };
    let is_padding = |s: &T| (low..=high).contains(&s.to_f64());
    let count: usize = volumes.par_iter().map(|v| v.par_iter().filter(|s| is_padding(s)).count()).sum();
    if count == 0 {
        return;
    }
    let real = volumes.par_iter().flat_map(|v| v.par_iter()).copied().filter(|s| !is_padding(s));
    let lowest = if rescale.slope > 0.0 {
        real.reduce_with(|a, b| if b < a { b } else { a })
    } else {
        real.reduce_with(|a, b| if b > a { b } else { a })
    };
    let Some(lowest) = lowest else { return };
    let below = if rescale.slope > 0.0 { high < lowest.to_f64() } else { low > lowest.to_f64() };
    let value = |stored: f64| stored * rescale.slope + rescale.intercept;
    let text = if below {
        format!(
            "{count} pixels hold the padding value {}, which is below all others; they were kept.",
            value(low)
        )
    } else {
        volumes
            .par_iter_mut()
            .flat_map(|v| v.par_iter_mut())
            .filter(|s| is_padding(s))
            .for_each(|s| *s = lowest);
        format!(
            "{count} pixels hold the padding value {}; they were set to the lowest value, {}.",
            value(low),
            value(lowest.to_f64())
        )
    };
    notes.push(Note { severity: Severity::Fact, code: "dicom.padding", text });
}

/// The samples on the even grid of the layout.
fn arranged<T: Sample>(mut volume: Vec<T>, layout: &Layout, extent: [usize; 3]) -> Vec<T> {
    let area = extent[0].saturating_mul(extent[1]).max(1);
    if let Some(shifts) = &layout.shifts {
        volume.par_chunks_exact_mut(area).zip(shifts).for_each(|(slice, shift)| {
            let moved = layout::moved(slice, extent[0], *shift);
            slice.copy_from_slice(&moved);
        });
    }
    let Some(blends) = &layout.blends else { return volume };
    let mut out = vec![T::default(); area.saturating_mul(blends.len())];
    let slice = |k: usize| volume.chunks_exact(area).nth(k).unwrap_or_default();
    out.par_chunks_exact_mut(area)
        .zip(blends)
        .for_each(|(slot, b)| layout::mix(slice(b.low), slice(b.high), b.part, slot));
    out
}
