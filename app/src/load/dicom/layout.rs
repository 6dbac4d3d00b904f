//! Where the slices of a stack lie, and what regular grid they make.
//!
//! The distance between slices is that of their positions along the normal, never the slice thickness.
//! A stack whose positions drift sideways (a tilted gantry) keeps its samples: the third column of
//! `world_from_voxel` is the real step from slice to slice, so the grid is sheared. Slices that are not
//! evenly spaced are resampled linearly along that line.
#![expect(clippy::arithmetic_side_effects, reason = "f64 vectors of nalgebra; counts of slices in memory")]

use render::volume::{Affine, Point, Vector};

use super::super::{Note, Severity};
use super::header::Frame;
use super::pixels::Sample;
use super::walk::Fault;

/// Steps may differ by this part of the usual one, or by [`SLACK_MM`], and count as even.
const SLACK: f64 = 0.02;
const SLACK_MM: f64 = 0.02;
/// A stack with more slices is one of slices that do not belong together.
const MOST_SLICES: f64 = 100_000.0;
/// Least tilt worth a note; degrees. Cosines are often written with six digits.
const LEAST_TILT_DEG: f64 = 0.1;

/// One slice of the result, as a mixture of two slices of the stack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Blend {
    pub(super) low: usize,
    pub(super) high: usize,
    /// Share of `high`; in `[0, 1]`.
    pub(super) part: f64,
}

/// The grid that a stack makes.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub(super) world_from_voxel: Affine,
    /// How each slice of the result comes about; `None`: the slices are taken as they are.
    pub(super) blends: Option<Vec<Blend>>,
    /// How far each slice of the stack lies beside the line of the others, in pixels along x and y.
    pub(super) shifts: Option<Vec<[f64; 2]>>,
    pub(super) notes: Vec<Note>,
}

/// What is known of a stack beside its positions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hints {
    pub(super) thickness_mm: Option<f64>,
    pub(super) between_mm: Option<f64>,
}

/// Lays out the slices of one stack: `frames` by rising distance `along_mm`, empty where the files give no
/// positions.
///
/// # Errors
/// A [`Fault`] where the numbers make no space, or a stack of more than [`MOST_SLICES`].
pub(super) fn lay(frames: &[&Frame], along_mm: &[f64], hints: Hints) -> Result<Layout, Fault> {
    let mut notes = Vec::new();
    let first = frames.first();
    let [row, column] = first.and_then(|f| f.directions).unwrap_or_else(|| {
        notes.push(caution("dicom.no-orientation", "The file gives no orientation; rows were taken to run to the patient's left and columns to the back.".to_owned()));
        [Vector::x(), Vector::y()]
    });
    let spacing = first.and_then(|f| f.spacing_mm).unwrap_or_else(|| {
        notes.push(caution(
            "dicom.no-spacing",
            "The file gives no pixel spacing; 1 mm was taken, so nothing can be measured.".to_owned(),
        ));
        [1.0, 1.0]
    });
    let normal = row.cross(&column);
    let origin = first.and_then(|f| f.position);
    let columns = [row * spacing[0], column * spacing[1]];
    let make = |step: Vector| {
        Affine::from_columns(columns[0], columns[1], step, origin.unwrap_or_else(Point::origin))
            .map_err(|e| format!("its geometry is impossible ({e})"))
    };
    if along_mm.is_empty() || origin.is_none() || frames.len() < 2 {
        let (step_mm, note) = alone(frames.len(), hints);
        if origin.is_none() {
            notes.push(caution(
                "dicom.no-position",
                "The file gives no position; the first pixel was put at the origin.".to_owned(),
            ));
        }
        notes.push(note);
        return Ok(Layout { world_from_voxel: make(normal * step_mm)?, blends: None, shifts: None, notes });
    }
    let positions: Vec<Point> = frames.iter().filter_map(|f| f.position).collect();
    let (start, end) = (along_mm.first().copied().unwrap_or(0.0), along_mm.last().copied().unwrap_or(0.0));
    let (Some(p0), Some(p1)) = (positions.first(), positions.last()) else {
        return Err("its slices have no positions".to_owned());
    };
    let slope = (p1 - p0) / (end - start);
    let tilt_deg = slope.cross(&normal).norm().atan().to_degrees();
    if tilt_deg > LEAST_TILT_DEG {
        notes.push(Note {
            severity: Severity::Fact,
            code: "dicom.gantry-tilt",
            text: format!("The slices are stacked {tilt_deg:.1} degrees off their normal (gantry tilt); the grid is sheared accordingly."),
        });
    }
    let (step_mm, blends) = spread(along_mm, &mut notes)?;
    let beside: Vec<[f64; 2]> = positions
        .iter()
        .zip(along_mm)
        .map(|(p, mm)| {
            let off = p - p0 - slope * (mm - start);
            [off.dot(&row) / spacing[0], off.dot(&column) / spacing[1]]
        })
        .collect();
    let worst = beside.iter().flatten().fold(0.0_f64, |most, s| most.max(s.abs()));
    let shifts = (worst > 0.1).then(|| {
        notes.push(caution(
            "dicom.slices-shifted",
            format!("Slices lie up to {worst:.2} pixels beside the line of the others; they were moved back by interpolation."),
        ));
        beside
    });
    Ok(Layout { world_from_voxel: make(slope * step_mm)?, blends, shifts, notes })
}

fn caution(code: &'static str, text: String) -> Note {
    Note { severity: Severity::Caution, code, text }
}

/// The step where there are no two positions to tell it.
fn alone(count: usize, hints: Hints) -> (f64, Note) {
    if count > 1 {
        let step = hints.between_mm.unwrap_or(1.0);
        let source = if hints.between_mm.is_some() { "as the file says" } else { "which is a guess" };
        let text = format!(
            "The {count} slices have no positions; they were stacked in the order of their numbers, {step} mm apart, {source}."
        );
        return (step, caution("dicom.no-positions", text));
    }
    let (step, source) = match (hints.thickness_mm, hints.between_mm) {
        (Some(mm), _) => (mm, "the slice thickness"),
        (None, Some(mm)) => (mm, "the spacing between slices"),
        (None, None) => (1.0, "a guess"),
    };
    let text = format!("There is a single slice; it was made {step} mm thick, {source}.");
    (step, Note { severity: Severity::Fact, code: "dicom.single-slice", text })
}

/// The even step that fits the slices, and how to get there.
///
/// Where all gaps are multiples of the usual step, slices are missing: the step stays, each slice stays as
/// it is, and the holes are filled between their neighbours. Otherwise the step is the smallest one, so
/// that no slice is lost, but at least half the usual one, so that one close pair does not multiply the
/// volume; the grid starts on the first slice.
fn spread(along_mm: &[f64], notes: &mut Vec<Note>) -> Result<(f64, Option<Vec<Blend>>), Fault> {
    let gaps: Vec<f64> = along_mm.array_windows().map(|[a, b]| b - a).collect();
    let mut sorted = gaps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(gaps.len().saturating_sub(1) / 2).copied().unwrap_or(1.0);
    let (least, most) = (sorted.first().copied().unwrap_or(1.0), sorted.last().copied().unwrap_or(1.0));
    let slack = (usual * SLACK).max(SLACK_MM);
    let start = along_mm.first().copied().unwrap_or(0.0);
    let length = along_mm.last().copied().unwrap_or(0.0) - start;
    if most - usual <= slack && usual - least <= slack {
        return Ok((length / gaps.len() as f64, None));
    }
    let count = length / least.max(usual / 2.0);
    if count > MOST_SLICES {
        return Err(format!(
            "its slices lie {most:.1} mm apart where {usual:.3} mm are usual; a stack would have {count:.0}"
        ));
    }
    let multiple = |gap: f64| (gap / usual).round().max(1.0);
    let gapped = |gap: &f64| (gap - multiple(*gap) * usual).abs() <= slack * multiple(*gap);
    if gaps.iter().all(gapped) {
        let count: f64 = gaps.iter().map(|g| multiple(*g)).sum();
        let step = length / count;
        let missing = count - gaps.len() as f64;
        let at: Vec<String> = along_mm
            .array_windows()
            .filter(|[a, b]| multiple(b - a) > 1.0)
            .take(5)
            .map(|[a, _]| format!("{:.1}", a - start))
            .collect();
        notes.push(Note {
            severity: Severity::Loss,
            code: "dicom.slices-missing",
            text: format!(
                "{missing} slices are missing (usual step {step:.3} mm, largest gap {most:.3} mm; after {} mm along the stack); the gaps were filled between their neighbours.",
                at.join(", ")
            ),
        });
        return Ok((step, Some(blends(along_mm, step))));
    }
    let step = least.max(usual / 2.0);
    notes.push(caution(
        "dicom.slices-uneven",
        format!(
            "The steps between slices run from {least:.3} to {most:.3} mm; the stack was resampled linearly to steps of {step:.3} mm, whole stored values (rounding at most 0.5)."
        ),
    ));
    Ok((step, Some(blends(along_mm, step))))
}

fn blends(along_mm: &[f64], step: f64) -> Vec<Blend> {
    let start = along_mm.first().copied().unwrap_or(0.0);
    let last = along_mm.len().saturating_sub(1);
    let length = along_mm.last().copied().unwrap_or(0.0) - start;
    let mut blends = Vec::new();
    let mut z = 0.0;
    while z <= (length / step).round() {
        let at = start + z * step;
        let high = along_mm.partition_point(|mm| *mm < at).clamp(1, last);
        let low = high - 1;
        let (a, b) = (along_mm.get(low).copied().unwrap_or(at), along_mm.get(high).copied().unwrap_or(at));
        let part = ((at - a) / (b - a)).clamp(0.0, 1.0);
        // A slice that is there is taken as it is, not mixed with a thousandth of its neighbour.
        let near = (SLACK / 2.0).min(0.01 / step);
        let part = if part < near {
            0.0
        } else if part > 1.0 - near {
            1.0
        } else {
            part
        };
        blends.push(Blend { low, high, part });
        z += 1.0;
    }
    blends
}

/// Mixes two slices into one, sample by sample.
pub(super) fn mix<T: Sample>(low: &[T], high: &[T], part: f64, out: &mut [T]) {
    if part == 0.0 {
        out.copy_from_slice(low);
    } else if part == 1.0 {
        out.copy_from_slice(high);
    } else {
        for ((slot, a), b) in out.iter_mut().zip(low).zip(high) {
            let (a, b) = (a.to_f64(), b.to_f64());
            *slot = T::nearest(a + (b - a) * part);
        }
    }
}

/// Moves a slice by whole and part pixels: what lay at `at + shift` on the patient's line comes to `at`.
/// The edge is held.
pub(super) fn moved<T: Sample>(slice: &[T], columns: usize, shift: [f64; 2]) -> Vec<T> {
    let rows = slice.len().checked_div(columns).unwrap_or(0);
    let split = |at: usize, by: f64, count: usize| {
        let c = (at as f64 - by).clamp(0.0, count.saturating_sub(1) as f64);
        let low = Sample::nearest(c.floor());
        let low: u32 = low;
        let low = usize::try_from(low).unwrap_or(0);
        (low, (low + 1).min(count.saturating_sub(1)), c - c.floor())
    };
    let at = |x: usize, y: usize| slice.get(x + y * columns).map_or(0.0, |s| s.to_f64());
    let mut out = Vec::with_capacity(slice.len());
    for y in 0..rows {
        let (y0, y1, v) = split(y, shift[1], rows);
        for x in 0..columns {
            let (x0, x1, u) = split(x, shift[0], columns);
            let line = |y| at(x0, y) + (at(x1, y) - at(x0, y)) * u;
            out.push(T::nearest(line(y0) + (line(y1) - line(y0)) * v));
        }
    }
    out
}

#[cfg(test)]
#[expect(clippy::indexing_slicing, reason = "a test may fail loudly")]
mod tests {
    use super::*;

    #[test]
    fn even_slices_are_taken_as_they_are() {
        let mut notes = Vec::new();
        let (step, blends) = spread(&[0.0, 2.5, 5.001, 7.5], &mut notes).expect("laid out");
        assert_eq!((step, blends), (2.5, None), "within the slack");
        assert!(notes.is_empty(), "nothing to say");
    }

    #[test]
    fn a_missing_slice_leaves_the_others_untouched() {
        let mut notes = Vec::new();
        let (step, blends) = spread(&[10.0, 12.0, 16.0, 18.0], &mut notes).expect("laid out");
        let blends = blends.expect("resampled");
        assert_eq!(step, 2.0, "the usual step");
        let parts: Vec<_> = blends.iter().map(|b| b.low as f64 + b.part).collect();
        assert_eq!(parts, [0.0, 1.0, 1.5, 2.0, 3.0], "half way in the gap");
        assert_eq!(notes[0].code, "dicom.slices-missing", "noted");
    }

    #[test]
    fn uneven_slices_are_resampled_at_the_smallest_step() {
        let mut notes = Vec::new();
        let (step, blends) = spread(&[0.0, 2.5, 5.0, 6.0, 8.5], &mut notes).expect("laid out");
        let parts: Vec<_> = blends.expect("resampled").iter().map(|b| b.low as f64 + b.part).collect();
        assert_eq!(step, 1.25, "half the usual step of 2.5, which is more than the smallest");
        assert_eq!(parts.len(), 8, "0 to 8.5 mm in steps of 1.25, to the nearest");
        assert_eq!(parts[2], 1.0, "2.5 mm is a slice itself");
        assert!((parts[5] - 3.1).abs() < 1e-12, "6.25 mm lies a tenth into the gap from 6 to 8.5");
        assert_eq!(notes[0].code, "dicom.slices-uneven", "noted");
    }

    #[test]
    fn a_shifted_slice_is_moved_back() {
        let slice: Vec<i16> = vec![0, 10, 20, 30];
        assert_eq!(moved(&slice, 4, [1.0, 0.0]), [0, 0, 10, 20], "a pixel to the right, edge held");
        assert_eq!(moved(&slice, 4, [-0.5, 0.0]), [5, 15, 25, 30], "half a pixel to the left");
    }
}
