//! DICOM: files, folders and zip archives of them, into volumes and time series.
//!
//! A first look at every file ([`walk`], [`header`]) tells series, geometry and time; frames are then
//! grouped ([`group`]), laid out ([`layout`]) and decoded straight into the volume ([`volume`],
//! [`pixels`]), each file a second time, so that no more than the volume and a few files are in memory.
//! Slices that cannot be read are left out with a note as long as others are there.

mod codecs;
mod group;
mod header;
mod jpegls;
mod layout;
mod pixels;
mod rle;
mod source;
#[cfg(test)]
mod tests;
mod volume;
mod walk;

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use rayon::prelude::*;

use super::{Content, Item, Limits, LoadError, Note, Progress, Severity};
use group::{Group, Ref, Stack};
use header::Image;
use layout::Hints;
use pixels::Trouble;
use source::Refusal;
use volume::{Bench, Failure};

pub(super) use source::Sources;
pub(super) use walk::begins_as_dicom;

const FORMAT: &str = "DICOM";

/// What one file turned out to be.
enum Look {
    Image(Box<Image>),
    /// DICOM without pixels: a plan, a report, a directory.
    NoPixels,
    Refused(String),
}

/// Every volume in the sources.
///
/// # Errors
/// [`LoadError`] where no file gives a volume.
pub(super) fn read(
    sources: &Sources,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<Vec<Item>, LoadError> {
    let broken = |fault: String| LoadError::Broken { format: FORMAT, fault, path: sources.path().to_owned() };
    let looks = look(sources, limits, progress)?;
    let (mut images, mut without_pixels, mut refused) = (Vec::new(), 0_usize, Vec::new());
    for look in looks {
        match look {
            Look::Image(image) => images.push(*image),
            Look::NoPixels => without_pixels = without_pixels.saturating_add(1),
            Look::Refused(fault) => refused.push(fault),
        }
    }
    // Colour pictures are screen shots and photographs; they hold no measured quantity.
    let all = images.len();
    images.retain(|i| i.grey);
    let coloured = all.saturating_sub(images.len());
    if images.is_empty() {
        let unsupported = |feature: &str, remedy| LoadError::Unsupported {
            format: FORMAT,
            feature: feature.to_owned(),
            remedy,
            path: sources.path().to_owned(),
        };
        return Err(match (refused.into_iter().next(), coloured) {
            (Some(fault), 0) => broken(fault),
            (_, 1..) => unsupported("colour pictures only", "export the grey images of the series"),
            (None, 0) if without_pixels > 0 => {
                unsupported("an object without an image", "choose the files of an image series")
            }
            (None, 0) => LoadError::Unknown { path: sources.path().to_owned() },
        });
    }
    let mut left_out = Vec::new();
    let mut leave = |count: usize, severity, what: &str| {
        if count > 0 {
            let text = format!("{count} of {} files were left out: {what}.", sources.len());
            left_out.push(Note { severity, code: "dicom.files-left-out", text });
        }
    };
    leave(without_pixels, Severity::Fact, "they hold no image");
    leave(coloured, Severity::Fact, "they hold colour pictures");
    let why = refused.first().map_or(String::new(), |f| format!("they cannot be read ({f})"));
    leave(refused.len(), Severity::Loss, &why);
    let items = volumes(&images, sources, limits, progress)?;
    Ok(items
        .into_iter()
        .map(|mut item| {
            item.notes.extend(left_out.iter().cloned());
            item
        })
        .collect())
}

/// The first look at every file, in parallel.
fn look(sources: &Sources, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Look>, LoadError> {
    let done = AtomicUsize::new(0);
    let inflated = AtomicU64::new(0);
    let total = sources.len();
    (0..total)
        .into_par_iter()
        .map(|index| {
            let step = done.fetch_add(1, Ordering::Relaxed).saturating_add(1);
            if !progress.step("reading headers", step, total) {
                return Err(LoadError::Cancelled);
            }
            let opened = match sources.open(index) {
                Ok(opened) => opened,
                Err(Refusal::Fault(fault)) => return Ok(Look::Refused(fault)),
                Err(Refusal::Load(error)) => return Err(error),
            };
            let length = u64::try_from(opened.bytes.len()).unwrap_or(u64::MAX);
            let before = inflated.fetch_add(length, Ordering::Relaxed);
            if sources.is_archive() && before.saturating_add(length) > limits.decoded_bytes {
                return Err(LoadError::TooLarge {
                    format: FORMAT,
                    bytes: u128::from(before).saturating_add(length.into()),
                    limit: limits.decoded_bytes,
                    path: sources.path().to_owned(),
                });
            }
            if opened.anatomy.pixels.is_none() {
                return Ok(Look::NoPixels);
            }
            Ok(match header::read(index, &opened.bytes, &opened.anatomy) {
                Ok(image) => Look::Image(Box::new(image)),
                Err(fault) => Look::Refused(fault),
            })
        })
        .collect()
}

fn volumes(
    images: &[Image],
    sources: &Sources,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<Vec<Item>, LoadError> {
    let bench = Bench {
        images,
        sources,
        progress,
        limit: limits.decoded_bytes,
        done: AtomicUsize::new(0),
        total: images.iter().map(|i| i.frames.len()).sum(),
    };
    let (mut items, mut first_error) = (Vec::new(), None);
    for group in group::groups(images) {
        match group_items(&bench, group) {
            Ok(found) => items.extend(found),
            Err(LoadError::Cancelled) => return Err(LoadError::Cancelled),
            Err(error) => first_error = first_error.or(Some(error)),
        }
    }
    match first_error {
        None => Ok(items),
        Some(error) if items.is_empty() => Err(error),
        Some(error) => {
            let text = format!("A further series was left out: {}.", without_path(&error));
            if let Some(item) = items.first_mut() {
                item.notes.push(Note { severity: Severity::Loss, code: "dicom.series-left-out", text });
            }
            Ok(items)
        }
    }
}

fn without_path(error: &LoadError) -> String {
    match error {
        LoadError::Broken { fault, .. } => fault.clone(),
        LoadError::Unsupported { feature, .. } => format!("it uses {feature}"),
        LoadError::TooLarge { bytes, .. } => format!("it asks for {bytes} bytes"),
        _ => "it cannot be read".to_owned(),
    }
}

/// The volumes of one group; frames that cannot be decoded are taken out and the rest is tried again.
fn group_items(bench: &Bench<'_>, mut group: Group) -> Result<Vec<Item>, LoadError> {
    let mut lost: Vec<(Ref, Trouble)> = Vec::new();
    'again: loop {
        let mut items = Vec::new();
        for stack in group::stacks(bench.images, &group) {
            match stack_item(bench, &stack) {
                Ok(item) => items.push(item),
                Err(Failure::Load(error)) => return Err(error),
                Err(Failure::Frames(failed)) => {
                    group.frames.retain(|r| failed.iter().all(|(f, _)| f != r));
                    lost.extend(failed);
                    if group.frames.is_empty() {
                        return Err(no_frame(bench, &lost));
                    }
                    continue 'again;
                }
            }
        }
        if let (Some((_, trouble)), Some(item)) = (lost.first(), items.first_mut()) {
            let why = match trouble {
                Trouble::Broken(fault) => fault.clone(),
                Trouble::Unsupported(feature) => format!("it uses {feature}"),
            };
            let text =
                format!("{} slices cannot be decoded and were left out; the first: {why}.", lost.len());
            item.notes.push(Note { severity: Severity::Loss, code: "dicom.slices-unreadable", text });
        }
        return Ok(items);
    }
}

fn no_frame(bench: &Bench<'_>, lost: &[(Ref, Trouble)]) -> LoadError {
    let path = bench.sources.path().to_owned();
    match lost.first() {
        Some((_, Trouble::Unsupported(feature))) => LoadError::Unsupported {
            format: FORMAT,
            feature: feature.clone(),
            remedy: "export it uncompressed",
            path,
        },
        Some((_, Trouble::Broken(fault))) => LoadError::Broken { format: FORMAT, fault: fault.clone(), path },
        None => LoadError::Broken { format: FORMAT, fault: "it has no frame".to_owned(), path },
    }
}

fn stack_item(bench: &Bench<'_>, stack: &Stack) -> Result<Item, Failure> {
    let slices = stack.steps.first().map(Vec::as_slice).unwrap_or_default();
    let frames: Vec<_> = slices.iter().filter_map(|r| group::frame_of(bench.images, *r)).collect();
    let broken =
        |fault: String| LoadError::Broken { format: FORMAT, fault, path: bench.sources.path().to_owned() };
    let image = slices.first().and_then(|r| bench.images.get(r.image));
    let image = image.ok_or_else(|| broken("it has no frame".to_owned()))?;
    let hints = Hints { thickness_mm: image.thickness_mm, between_mm: image.between_mm };
    let layout = layout::lay(&frames, &stack.along_mm, hints).map_err(broken)?;
    let mut notes = stack.notes.clone();
    notes.extend(layout.notes.iter().cloned());
    notes.extend(image.notes.iter().cloned());
    if image.lossy
        || matches!(image.transfer_syntax.as_str(), "1.2.840.10008.1.2.4.50" | "1.2.840.10008.1.2.4.81")
    {
        notes.push(Note {
            severity: Severity::Caution,
            code: "dicom.lossy",
            text: "The pixels were compressed with loss before they came here.".to_owned(),
        });
    }
    let content = bench.build(stack, &layout, &mut notes)?;
    Ok(Item { name: name(image, bench), format: FORMAT, modality: image.modality.clone(), content, notes })
}

/// The series' own description, its number, or the name of the file; none of them names a patient.
fn name(image: &Image, bench: &Bench<'_>) -> String {
    if !image.description.is_empty() {
        return image.description.clone();
    }
    if let Some(number) = image.series_number {
        return format!("Series {number}");
    }
    bench.sources.path().file_stem().map_or_else(|| FORMAT.to_owned(), |s| s.to_string_lossy().into_owned())
}
