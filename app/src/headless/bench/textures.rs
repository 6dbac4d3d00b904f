//! `compress`: time and error of making textures, beside making uncompressed ones, and of pictures of them.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use ::compress::bc::Level;
use ::render::GridSource;
use ::render::gpu::Gpu;
use ::render::image::FloatImage;
use ::render::renderer::{Quality, Renderer};
use ::render::scene::{Shading, TextureFormat};
use serde_json::json;

use super::{Bench, Row, number, psnr, series};
use crate::cli::Format;
use crate::headless::input::Input;
use crate::headless::plot::{Chart, Scale};
use crate::headless::{Failure, compress};
use crate::scene;

/// Formats, each with the uncompressed one that it stands beside.
const FORMATS: [(Format, Format); 4] = [
    (Format::Bc4, Format::R8),
    (Format::Bc3, Format::Rgba8),
    (Format::Bc1, Format::Rgba8),
    (Format::Bc7, Format::Rgba8),
];
/// The pictures, as large as Doi's; pixels.
const PICTURE: [u32; 2] = [425, 481];
/// Textures that are drawn, each with the uncompressed one that it stands beside.
const PICTURES: [(TextureFormat, TextureFormat); 5] = [
    (TextureFormat::Bc3, TextureFormat::Rgba8),
    (TextureFormat::Bc7, TextureFormat::Rgba8),
    (TextureFormat::Bc4, TextureFormat::R32f),
    (TextureFormat::Bc5, TextureFormat::R32f),
    (TextureFormat::Auto, TextureFormat::R32f),
];
/// Turns: a texture takes milliseconds, and where it does not a few are enough.
const TURNS: usize = 15;
/// No more turns of one format after this.
const ENOUGH_OF_ONE: Duration = Duration::from_secs(2);

/// Measures both.
pub(super) fn run(input: &Input, path: &Path, bench: &mut Bench) -> Result<(), Failure> {
    textures(input, path, bench)?;
    pictures(input, bench)
}

fn textures(input: &Input, path: &Path, bench: &mut Bench) -> Result<(), Failure> {
    let (volume, grid) = compress::volume(&input.case, &input.assets, path)?;
    let source = GridSource::new(&grid)?;
    let textures = compress::Textures::new(&source, &grid, &volume.transfer)?;
    for threads in thread_counts() {
        let pool = compress::pool(threads)?;
        for (format, plain) in FORMATS {
            let levels: &[Level] =
                if format == Format::Bc4 { &[Level::Best] } else { &[Level::Fast, Level::Best] };
            for &level in levels {
                let make = |format, out: &mut Vec<u8>| -> Result<f64, Failure> {
                    let begin = Instant::now();
                    pool.install(|| textures.make(format, level, out))?;
                    Ok(begin.elapsed().as_secs_f64() * 1e3)
                };
                let (mut blocks, mut texels) = (Vec::new(), Vec::new());
                let (mut block_ms, mut texel_ms) = (f64::INFINITY, f64::INFINITY);
                // Turn by turn, the shortest of each: other work on the machine then meets both alike.
                let begin = Instant::now();
                for turn in 0..TURNS {
                    if turn > 1 && begin.elapsed() > ENOUGH_OF_ONE {
                        break;
                    }
                    texel_ms = texel_ms.min(make(plain, &mut texels)?);
                    block_ms = block_ms.min(make(format, &mut blocks)?);
                }
                let lost = pool.install(|| textures.lost(format, &blocks))?;
                let stats = pool.install(|| textures.stats(format, level, &mut blocks))?;
                let name = if level == Level::Fast { "fast" } else { "best" };
                bench.report(json!({
                    "bench": "compress", "format": format.name(), "level": name, "volume": volume.id,
                    "extent": grid.extent(), "threads": threads,
                    "texture_ms": block_ms, "uncompressed": plain.name(), "uncompressed_ms": texel_ms,
                    "time_to_uncompressed": block_ms / texel_ms,
                    "mvoxel_per_s": grid.samples().len() as f64 / 1e3 / block_ms,
                    "texture_bytes": blocks.len(), "ratio_to_uncompressed": texels.len() as f64 / blocks.len() as f64,
                    "psnr_db": lost.psnr_db, "largest": lost.largest, "largest_unit": lost.unit,
                    "blocks": stats.blocks, "blocks_clear": stats.clear, "blocks_solid": stats.solid,
                    "blocks_curve": stats.curve,
                }))?;
            }
        }
    }
    Ok(())
}

/// Doi's table 2: how far pictures of compressed textures are from those of uncompressed ones, channel by channel,
/// the background left out.
fn pictures(input: &Input, bench: &mut Bench) -> Result<(), Failure> {
    let mut scene = scene::scene(&input.case, &input.assets);
    for volume in &mut scene.volumes {
        volume.shading = Shading::None;
    }
    let mut renderer = Renderer::new(Arc::new(Gpu::headless()?))?;
    let mut draw = |texture| -> Result<(FloatImage, String), Failure> {
        for volume in &mut scene.volumes {
            volume.texture = texture;
        }
        let stats = renderer.render(&scene, PICTURE, Quality::Good)?;
        let drawn: Vec<String> = stats.textures.iter().map(|t| t.stored.to_string()).collect();
        Ok((renderer.read()?, drawn.join("+")))
    };
    for (texture, plain) in PICTURES {
        let (exact, against) = draw(plain)?;
        let (picture, drawn) = draw(texture)?;
        let squares = channels(&picture, &exact);
        let (psnr_db, rms) = (squares.map(psnr), squares.map(f64::sqrt));
        bench.report(json!({
            "bench": "compress", "picture": PICTURE, "texture": texture.name(), "drawn_as": drawn, "against": against,
            "psnr_db_rgb": psnr_db, "rms_255_rgb": rms,
        }))?;
    }
    Ok(())
}

/// Mean squares of the differences of red, green and blue, in 1/255, over the pixels that show anything.
fn channels(picture: &FloatImage, exact: &FloatImage) -> [f64; 3] {
    let (mut squares, mut count) = ([0.0; 3], 0.0);
    for (a, b) in picture.pixels.iter().zip(&exact.pixels) {
        if a[3] > 0.0 || b[3] > 0.0 {
            count += 1.0;
            for c in 0..3 {
                // Pictures are shown in whole numbers.
                let shown = |p: &[f32; 4]| f64::from(p[c].clamp(0.0, 1.0) * 255.0).round();
                squares[c] += (shown(a) - shown(b)).powi(2);
            }
        }
    }
    squares.map(|sum: f64| sum / f64::max(count, 1.0))
}

/// One thread and all of them.
fn thread_counts() -> Vec<usize> {
    let all = rayon::current_num_threads();
    if all > 1 { vec![1, all] } else { vec![1] }
}

/// Time against error.
pub(super) fn chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| format!("{}, {} threads", row["level"], row["threads"]).replace('"', "");
    Chart {
        title: "Textures: time against error".to_owned(),
        x: "from samples to blocks, ms".to_owned(),
        y: "PSNR against the samples, dB".to_owned(),
        y_scale: Scale::Linear,
        joined: false,
        series: series(rows, "format", &|row| {
            (number(row, "texture_ms"), number(row, "psnr_db"), label(row))
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_background_is_left_out_of_a_channels_error() {
        let image = |pixels: Vec<[f32; 4]>| FloatImage { width: pixels.len() as u32, height: 1, pixels };
        let exact = image(vec![[0.2, 0.4, 0.6, 1.0], [0.0; 4], [0.0; 4], [0.0; 4]]);
        let picture = image(vec![[0.2, 0.4, 0.6 + 10.0 / 255.0, 1.0], [0.0; 4], [0.0; 4], [0.0; 4]]);
        assert_eq!(channels(&picture, &exact), [0.0, 0.0, 100.0], "one pixel of four");
        assert_eq!(psnr(0.0), None, "nothing differs, and JSON has no infinity");
        assert!((psnr(1.0).expect("dB") - 48.1308).abs() < 1e-4, "of an error of one");
    }
}
