//! `render`: one picture of a case, by the GPU or by the reference.

use std::path::Path;
use std::time::Instant;

use ::render::TextureSummary;
use ::render::cells;
use ::render::cpu::{self, CpuRenderer};
use ::render::gpu::{Gpu, GpuError};
use ::render::image::FloatImage;
use ::render::recovery::RecoveringRenderer;
use ::render::reference;
use ::render::renderer::{Quality, Stats};
use ::render::scene::Scene;
use serde_json::{Map, Value, json};

use super::ranks::{self, Place, Ranks};
use super::{Failure, Terminal, check_folder, input, say, write_file};
use crate::cli::{Backend, QualityName, RenderArgs};
use crate::load::Progress as _;
use crate::{save, scene};

/// The kinds of picture files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Png,
    Exr,
}

/// Draws the picture and says what it cost.
///
/// # Errors
/// [`Failure`].
pub fn run(args: &RenderArgs) -> Result<(), Failure> {
    let ranks = match ranks::join()? {
        Place::Alone => None,
        Place::First(ranks) => Some(ranks),
        Place::Done => return Ok(()),
    };
    let kind = kind(&args.out)?;
    check_folder(&args.out)?;
    let begin = Instant::now();
    let input = input::open(&args.input)?;
    let load_ms = ms(begin);
    let scene = scene::scene(&input.case, &input.assets);
    let (picture, mut stats, statement) = match args.backend {
        Backend::Auto => by_either(&scene, args, ranks)?,
        Backend::Gpu => by_gpu(Gpu::headless()?, &scene, args)?,
        Backend::Cpu => by_cpu(&scene, args, ranks)?,
        Backend::Reference => by_reference(&scene, args.size)?,
    };
    let begin = Instant::now();
    let bytes = match kind {
        Kind::Png => save::picture::png(&picture, scene.background, &statement)
            .map_err(|e| Failure::Other(format!("the picture cannot be made into PNG ({e})")))?,
        Kind::Exr => save::picture::exr(&picture, &statement)
            .map_err(|e| Failure::Other(format!("the picture cannot be made into EXR ({e})")))?,
    };
    write_file(&args.out, &bytes)?;
    if args.stats {
        stats.insert("size".to_owned(), json!(args.size));
        stats.insert("load_ms".to_owned(), json!(load_ms));
        stats.insert("write_ms".to_owned(), json!(ms(begin)));
        say(&Value::Object(stats).to_string())?;
    }
    Ok(())
}

fn kind(path: &Path) -> Result<Kind, Failure> {
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("png") => Ok(Kind::Png),
        Some("exr") => Ok(Kind::Exr),
        _ => {
            let fault = "the picture's name must end in .png or .exr";
            Err(Failure::Usage(format!("{fault}; change --out: {}", path.display())))
        }
    }
}

type Drawn = (FloatImage, Map<String, Value>, String);

/// By the GPU, unless it is none and the processor shows the same, or only the processor can.
fn by_either(scene: &Scene, args: &RenderArgs, ranks: Option<Ranks>) -> Result<Drawn, Failure> {
    if cpu::alone_shows(scene) {
        return by_cpu(scene, args, ranks);
    }
    match Gpu::headless() {
        Ok(gpu) if gpu.caps().software && cpu::shows(scene) => by_cpu(scene, args, ranks),
        Ok(gpu) => by_gpu(gpu, scene, args),
        Err(GpuError::NoAdapter { .. }) if cpu::shows(scene) => by_cpu(scene, args, ranks),
        Err(error) => Err(error.into()),
    }
}

fn quality(args: &RenderArgs) -> Quality {
    match args.quality {
        QualityName::Draft => Quality::Draft,
        QualityName::Good => Quality::Good,
        QualityName::Finest => Quality::Finest,
    }
}

fn by_cpu(scene: &Scene, args: &RenderArgs, ranks: Option<Ranks>) -> Result<Drawn, Failure> {
    let terminal = Terminal::default();
    let progress = |done: usize, total: usize| terminal.step("drawing", done, total);
    let quality = quality(args);
    let mut renderer = CpuRenderer::new();
    let (picture, stats) = match ranks {
        Some(mut ranks) => renderer.render_by(&mut ranks, scene, args.size, quality, &progress)?,
        None => renderer.render(scene, args.size, quality, &progress)?,
    };
    let mut map = Map::new();
    map.insert("backend".to_owned(), json!("cpu"));
    map.insert("threads".to_owned(), json!(rayon::current_num_threads()));
    map.insert("quality_voxels".to_owned(), json!(quality.voxels()));
    figures(&stats, &mut map);
    map.insert("statement".to_owned(), json!(""));
    Ok((picture, map, String::new()))
}

fn by_gpu(gpu: Gpu, scene: &Scene, args: &RenderArgs) -> Result<Drawn, Failure> {
    let adapter = gpu.adapter().to_owned();
    let mut renderer = RecoveringRenderer::on(gpu, Gpu::headless)?;
    let quality = quality(args);
    let (picture, stats) = renderer.render(scene, args.size, quality)?;
    for note in &stats.notes {
        log::warn!("{note}");
    }
    let mut map = Map::new();
    map.insert("backend".to_owned(), json!("gpu"));
    map.insert("adapter".to_owned(), json!(adapter));
    map.insert("quality_voxels".to_owned(), json!(quality.voxels()));
    figures(&stats, &mut map);
    let statement = statement(&stats.textures);
    map.insert("statement".to_owned(), json!(statement));
    Ok((picture, map, statement))
}

fn by_reference(scene: &Scene, size: [u32; 2]) -> Result<Drawn, Failure> {
    let begin = Instant::now();
    let terminal = Terminal::default();
    let progress = |done: usize, total: usize| terminal.step("drawing", done, total);
    let picture = reference::draw(scene, size, &reference::Options::default(), &progress)?;
    let mut map = Map::new();
    map.insert("backend".to_owned(), json!("reference"));
    map.insert("threads".to_owned(), json!(rayon::current_num_threads()));
    map.insert("frame_ms".to_owned(), json!(ms(begin)));
    Ok((picture, map, String::new()))
}

/// All figures of a frame, into a JSON object. Each skip stands beside what was done.
pub(super) fn figures(stats: &Stats, map: &mut Map<String, Value>) {
    let textures: Vec<Value> = stats.textures.iter().map(texture).collect();
    let object = json!({
        "frame_ms": stats.frame_ms,
        "prepare_ms": stats.prepare_ms,
        "step_mm": stats.step_mm,
        "slabs": stats.slabs,
        "slabs_occupied": stats.slabs_occupied,
        "steps_per_slab": stats.steps_per_slab,
        "draws": stats.draws,
        "most_overlapping": stats.most_overlapping,
        "fragments": stats.fragments,
        "fragments_skipped": stats.fragments_skipped,
        "bricks": stats.bricks,
        "bricks_skipped": stats.bricks_skipped,
        "textures_sent": stats.textures_sent,
        "off_screen_skipped": stats.off_screen_skipped,
        "saturate_looks": stats.saturate_looks,
        "layers": stats.layers,
        "tiles": stats.tiles,
        "tiles_skipped": stats.tiles_skipped,
        "cells": stats.cells,
        "tetrahedra": stats.tetrahedra,
        "tetrahedra_scanned": stats.tetrahedra_scanned,
        "grid": stats.grid.as_ref().map(grid),
        "pixels_finished": stats.pixels_finished,
        "bands": stats.bands,
        "textures": textures,
        "notes": stats.notes,
    });
    if let Value::Object(object) = object {
        map.extend(object);
    }
}

/// Figures of a grid that was drawn alone, and of the workers that drew it.
fn grid(stats: &cells::Stats) -> Value {
    let total = &stats.total;
    let each = |figure: fn(&cells::Counts) -> u64| stats.workers.iter().map(figure).collect::<Vec<_>>();
    json!({
        "workers": stats.workers.len(),
        "imbalance": stats.imbalance(),
        "segments": total.segments,
        "outside": total.outside,
        "clear": total.clear,
        "hidden": total.hidden,
        "not_finite": total.not_finite,
        "overlapping_pixels": total.overlapping_pixels,
        "messages": total.messages,
        "bytes": total.bytes,
        "bytes_of_cells": total.cell_bytes,
        "clusters_taken": total.taken,
        "work": each(cells::Counts::work),
        "tetrahedra_held": each(|counts| counts.held),
    })
}

/// One texture's figures. JSON has no infinity: a lossless texture's PSNR is `null`.
fn texture(t: &TextureSummary) -> Value {
    json!({
        "format": t.stored.to_string(),
        "extent": t.extent,
        "bytes": t.bytes,
        "ratio_to_r16": ratio(t),
        "lossy": t.max_error > 0.0,
        "max_error": t.max_error,
        "psnr_db": t.psnr_db,
        "generate_ms": t.generate_ms,
    })
}

/// Bytes of the same texels in 16 bits each, for one byte of this texture.
fn ratio(t: &TextureSummary) -> f64 {
    let texels: f64 = t.extent.iter().map(|&n| f64::from(n)).product();
    2.0 * texels / (t.bytes as f64).max(1.0)
}

/// What must be said of a picture of lossy data: format, ratio and largest error of each lossy texture.
/// Empty where nothing is lossy.
pub fn statement(textures: &[TextureSummary]) -> String {
    let lossy = textures.iter().filter(|t| t.max_error > 0.0);
    let parts: Vec<String> = lossy
        .map(|t| {
            let unit = if t.stored.is_colour() { "of 255" } else { "of the data's unit" };
            format!("{}, {:.1}:1 of 16 bits, largest error {:.3} {unit}", t.stored, ratio(t), t.max_error)
        })
        .collect();
    if parts.is_empty() { String::new() } else { format!("lossy data: {}", parts.join("; ")) }
}

/// Milliseconds since.
pub(super) fn ms(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::render::Stored;
    use ::render::scene::TextureFormat;

    fn summary(format: TextureFormat, bytes: u64, max_error: f64) -> TextureSummary {
        let stored = Stored::Grid(format);
        TextureSummary { stored, extent: [8, 8, 8], bytes, max_error, psnr_db: 50.0, generate_ms: 1.0 }
    }

    #[test]
    fn only_lossy_textures_are_spoken_of() {
        assert_eq!(statement(&[summary(TextureFormat::R16, 1024, 0.0)]), "", "lossless");
        let said = statement(&[
            summary(TextureFormat::R16, 1024, 0.0),
            summary(TextureFormat::Bc4, 256, 7.5),
            summary(TextureFormat::Bc3, 512, 12.0),
        ]);
        assert_eq!(
            said,
            "lossy data: bc4, 4.0:1 of 16 bits, largest error 7.500 of the data's unit; \
             bc3, 2.0:1 of 16 bits, largest error 12.000 of 255",
            "format, ratio, error"
        );
    }

    #[test]
    fn the_name_decides_the_kind() {
        assert_eq!(kind(Path::new("a.PNG")).expect("png"), Kind::Png, "any case of letters");
        assert_eq!(kind(Path::new("a.b.exr")).expect("exr"), Kind::Exr, "the last ending");
        assert_eq!(kind(Path::new("a.bmp")).expect_err("bmp").exit_code(), 2, "usage");
        assert_eq!(kind(Path::new("png")).expect_err("no ending").exit_code(), 2, "usage");
    }
}
