//! `frame`: time and error of a picture, for each texture and slice spacing.

use std::sync::Arc;
use std::time::Instant;

use ::render::gpu::Gpu;
use ::render::reference;
use ::render::renderer::{Quality, Renderer};
use ::render::scene::{Scene, Shading, TextureFormat};
use serde_json::json;

use super::{Bench, ENOUGH, REPEATS, Row, median, number, series};
use crate::headless::input::Input;
use crate::headless::plot::{Chart, Scale};
use crate::headless::{Failure, Terminal};
use crate::load::Progress as _;
use crate::scene;

/// The picture; pixels.
const SIZE: [u32; 2] = [512, 512];
/// Slice spacings; voxels of the finest volume.
const SPACINGS: [f64; 2] = [1.0, 0.5];
/// Textures, the uncompressed one of each kind first.
const TEXTURES: [TextureFormat; 4] =
    [TextureFormat::R16, TextureFormat::Bc4, TextureFormat::Rgba8, TextureFormat::Bc3];

/// Measures.
pub(super) fn run(input: &Input, bench: &mut Bench) -> Result<(), Failure> {
    let mut scene = scene::scene(&input.case, &input.assets);
    // Colours classified beforehand have no gradient to be lit by: without light all textures compare.
    for volume in &mut scene.volumes {
        volume.shading = Shading::None;
    }
    let gpu = Arc::new(Gpu::headless()?);
    let terminal = Terminal::default();
    let progress = |done: usize, total: usize| terminal.step("drawing the reference", done, total);
    let truth = reference::draw(&scene, SIZE, &reference::Options::default(), &progress)?;
    for texture in TEXTURES {
        for volume in &mut scene.volumes {
            volume.texture = texture;
        }
        let generate_ms = generate_ms(&gpu, &scene)?;
        let mut renderer = Renderer::new(Arc::clone(&gpu))?;
        for spacing in SPACINGS {
            let quality = Quality::Spacing(spacing);
            let mut stats = renderer.render(&scene, SIZE, quality)?;
            let mut times = Vec::new();
            let begin = Instant::now();
            while times.is_empty() || times.len() < REPEATS && begin.elapsed() < ENOUGH {
                stats = renderer.render(&scene, SIZE, quality)?;
                times.push(stats.frame_ms);
            }
            let apart = renderer.read()?.difference(&truth, scene.background);
            let apart = apart.map_err(|e| Failure::Other(e.to_string()))?;
            let bytes: u64 = stats.textures.iter().map(|t| t.bytes).sum();
            let largest = stats.textures.iter().map(|t| t.max_error).fold(0.0, f64::max);
            // What the adapter lacks is replaced: the row names what was drawn.
            let drawn: Vec<String> = stats.textures.iter().map(|t| t.stored.to_string()).collect();
            let replaced = drawn.iter().any(|name| name != texture.name());
            let row = json!({
                "bench": "frame", "adapter": gpu.adapter(), "texture": texture.name(),
                "drawn_as_asked": !replaced, "size": SIZE, "shading": "none", "spacing_voxels": spacing, "step_mm": stats.step_mm,
                "runs": times.len(), "frame_ms": median(times), "generate_ms": generate_ms, "texture_bytes": bytes,
                "texture_max_error": largest, "psnr_db": apart.psnr_db, "max_error_255": apart.max,
            });
            bench.report(row)?;
        }
    }
    Ok(())
}

/// Time to make all textures of a scene anew; ms, the median of some renderers that know none yet.
fn generate_ms(gpu: &Arc<Gpu>, scene: &Scene) -> Result<f64, Failure> {
    let mut times = Vec::new();
    for _ in 0..=REPEATS {
        let mut renderer = Renderer::new(Arc::clone(gpu))?;
        let stats = renderer.render(scene, [16, 16], Quality::Draft)?;
        times.push(stats.textures.iter().map(|t| t.generate_ms).sum());
    }
    // The first run warms the caches.
    times.remove(0);
    Ok(median(times))
}

/// Time against error.
pub(super) fn chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| format!("{} voxel", row["spacing_voxels"]);
    Chart {
        title: "A frame of 512 x 512: time against error".to_owned(),
        x: "frame, ms".to_owned(),
        y: "PSNR against the reference, dB".to_owned(),
        y_scale: Scale::Linear,
        joined: false,
        series: series(rows, "texture", &|row| (number(row, "frame_ms"), number(row, "psnr_db"), label(row))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_one_name_are_one_series() {
        let row = |name: &str, x: f64| {
            let value = json!({"texture": name, "frame_ms": x, "psnr_db": 40.0, "spacing_voxels": 1.0});
            value.as_object().expect("object").clone()
        };
        let chart = chart(&[row("r16", 10.0), row("bc4", 20.0), row("r16", 30.0)]);
        assert_eq!(chart.series.len(), 2, "two names");
        assert_eq!(chart.series[0].points[1].0, 30.0, "the second of r16");
    }
}
