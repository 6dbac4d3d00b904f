//! `bench`: run time beside error. `frame` draws, `compress` makes textures.
//!
//! Each result is one JSON object a line (`--json`) or a line of a table. Times are the median of
//! `REPEATS` runs after one that is not counted, so that neither the first upload nor one busy moment
//! decides; fewer where a measurement takes long.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use ::render::gpu::Gpu;
use ::render::reference;
use ::render::renderer::{Quality, Renderer};
use ::render::scene::{Scene, Shading, TextureFormat};
use serde_json::{Map, Value, json};

use super::input::Input;
use super::plot::{Chart, Series};
use super::{Failure, Terminal, compress, input, say, write_file};
use crate::cli::{BenchArgs, BenchName, Format};
use crate::load::Progress as _;
use crate::scene;

/// Counted runs of each measurement.
const REPEATS: usize = 3;
/// No run is repeated once its measurement has taken this long: a software adapter is slow, but steady.
const ENOUGH: Duration = Duration::from_secs(10);
/// The picture of `frame`; pixels.
const SIZE: [u32; 2] = [512, 512];
/// Slice spacings of `frame`; voxels of the finest volume.
const SPACINGS: [f64; 2] = [1.0, 0.5];
/// Textures of `frame`, the uncompressed one of each kind first.
const TEXTURES: [TextureFormat; 4] =
    [TextureFormat::R16, TextureFormat::Bc4, TextureFormat::Rgba8, TextureFormat::Bc3];
/// Formats of `compress`, each with the uncompressed one that it stands beside.
const FORMATS: [(Format, Format); 3] =
    [(Format::Bc4, Format::R8), (Format::Bc3, Format::Rgba8), (Format::Bc1, Format::Rgba8)];

/// Runs a benchmark.
///
/// # Errors
/// [`Failure`].
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    let input = match &args.data {
        Some(path) => input::open(path)?,
        None => input::builtin()?,
    };
    let (rows, chart) = match args.name {
        BenchName::Frame => frame(&input, args)?,
        BenchName::Compress => textures(&input, args)?,
    };
    if let Some(folder) = &args.plot {
        std::fs::create_dir_all(folder).map_err(|source| Failure::Output { path: folder.clone(), source })?;
        let name = if args.name == BenchName::Frame { "frame.svg" } else { "compress.svg" };
        write_file(&folder.join(name), chart(&rows).svg().as_bytes())?;
    }
    Ok(())
}

/// What was measured of one thing.
type Row = Map<String, Value>;
type Measured = (Vec<Row>, fn(&[Row]) -> Chart);

/// Prints a row as soon as it is measured, and keeps it.
fn report(rows: &mut Vec<Row>, row: Value, json: bool) -> Result<(), Failure> {
    let Value::Object(row) = row else { return Ok(()) };
    if json {
        say(&Value::Object(row.clone()).to_string())?;
    } else {
        let cell = |(key, value): (&String, &Value)| match value.as_f64() {
            Some(number) if value.is_f64() => format!("{key} {number:.2}"),
            _ => format!("{key} {}", value.as_str().map_or_else(|| value.to_string(), str::to_owned)),
        };
        say(&row.iter().map(cell).collect::<Vec<_>>().join("  "))?;
    }
    rows.push(row);
    Ok(())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn frame(input: &Input, args: &BenchArgs) -> Result<Measured, Failure> {
    let mut scene = scene::scene(&input.case, &input.assets);
    // Colours classified beforehand have no gradient to be lit by: without light all textures compare.
    for volume in &mut scene.volumes {
        volume.shading = Shading::None;
    }
    let gpu = Arc::new(Gpu::headless()?);
    let terminal = Terminal::default();
    let progress = |done: usize, total: usize| terminal.step("drawing the reference", done, total);
    let truth = reference::draw(&scene, SIZE, &reference::Options::default(), &progress)?;
    let mut rows = Vec::new();
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
            report(&mut rows, row, args.json)?;
        }
    }
    Ok((rows, frame_chart))
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

fn frame_chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| format!("{} voxel", row["spacing_voxels"]);
    Chart {
        title: "A frame of 512 x 512: time against error".to_owned(),
        x: "frame, ms".to_owned(),
        y: "PSNR against the reference, dB".to_owned(),
        series: series(rows, "texture", &|row| (number(row, "frame_ms"), number(row, "psnr_db"), label(row))),
    }
}

fn textures(input: &Input, args: &BenchArgs) -> Result<Measured, Failure> {
    let path = args.data.as_deref().unwrap_or(Path::new("the built-in case"));
    let (volume, grid) = compress::volume(&input.case, &input.assets, path)?;
    let extent = compress::extent(&grid)?;
    let mut rows = Vec::new();
    for threads in thread_counts() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| {
            Failure::Other(format!("the threads cannot be started ({e}); close other programs"))
        })?;
        for (format, plain) in FORMATS {
            let make = |format| pool.install(|| compress::make(format, &grid, &volume.transfer, extent));
            let mut made = make(format)?;
            let (mut generate, mut encode, mut uncompressed) = (Vec::new(), Vec::new(), Vec::new());
            for _ in 0..REPEATS {
                uncompressed.push(make(plain)?.generate_ms);
                made = make(format)?;
                generate.push(made.generate_ms);
                encode.push(made.encode_ms);
            }
            let (generate, encode) = (median(generate), median(encode));
            let texels = extent.voxels() * if format.is_colour() { 4 } else { 1 };
            let quality = made.quality.as_ref();
            let row = json!({
                "bench": "compress", "format": format.name(), "extent": extent.sizes(), "threads": threads,
                "texture_ms": generate + encode, "encode_ms": encode,
                "uncompressed": plain.name(), "uncompressed_ms": median(uncompressed),
                "encode_mb_per_s": texels as f64 / 1e3 / encode.max(1e-6),
                "texture_bytes": made.data.len(), "ratio_to_uncompressed": texels as f64 / made.data.len() as f64,
                "psnr_db": quality.map(|q| q.psnr_db), "max_error_255": quality.map(|q| q.largest),
            });
            report(&mut rows, row, args.json)?;
        }
    }
    Ok((rows, compress_chart))
}

/// One thread and all of them.
fn thread_counts() -> Vec<usize> {
    let all = rayon::current_num_threads();
    if all > 1 { vec![1, all] } else { vec![1] }
}

fn compress_chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| format!("{} threads", row["threads"]);
    Chart {
        title: "Textures: time against error".to_owned(),
        x: "encoding, ms".to_owned(),
        y: "PSNR against the texels, dB".to_owned(),
        series: series(rows, "format", &|row| (number(row, "encode_ms"), number(row, "psnr_db"), label(row))),
    }
}

fn number(row: &Row, key: &str) -> f64 {
    row.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN)
}

/// Rows with one value of `key` are one series.
fn series(rows: &[Row], key: &str, point: &dyn Fn(&Row) -> (f64, f64, String)) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for row in rows {
        let name = row.get(key).and_then(Value::as_str).unwrap_or_default();
        match all.iter_mut().find(|s| s.name == name) {
            Some(series) => series.points.push(point(row)),
            None => all.push(Series { name: name.to_owned(), points: vec![point(row)] }),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_ignores_one_busy_moment() {
        assert_eq!(median(vec![5.0, 900.0, 4.0]), 5.0, "the middle");
        assert!(median(Vec::new()).is_nan(), "of nothing");
    }

    #[test]
    fn rows_of_one_name_are_one_series() {
        let row = |name: &str, x: f64| {
            let value = json!({"texture": name, "frame_ms": x, "psnr_db": 40.0, "spacing_voxels": 1.0});
            value.as_object().expect("object").clone()
        };
        let chart = frame_chart(&[row("r16", 10.0), row("bc4", 20.0), row("r16", 30.0)]);
        assert_eq!(chart.series.len(), 2, "two names");
        assert_eq!(chart.series[0].points[1].0, 30.0, "the second of r16");
    }
}
