//! `bench`: run time beside error. `frame` draws, `compress` makes textures, `series` and `play` are of volumes over
//! time.
//!
//! Each result is one JSON object a line (`--json`) or a line of a table. Times are the median of
//! `REPEATS` runs after one that is not counted, so that neither the first upload nor one busy moment
//! decides; fewer where a measurement takes long.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use ::compress::bc::Level;
use ::render::GridSource;
use ::render::gpu::Gpu;
use ::render::image::FloatImage;
use ::render::reference;
use ::render::renderer::{Quality, Renderer};
use ::render::scene::{Scene, Shading, TextureFormat};
use serde_json::{Map, Value, json};

use super::input::Input;
use super::plot::{Chart, Series};
use super::{Failure, Terminal, compress, input, say, write_file};
use crate::case::Source;
use crate::cli::{BenchArgs, BenchName, Format};
use crate::load::Progress as _;
use crate::{sample, scene};

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
const FORMATS: [(Format, Format); 4] = [
    (Format::Bc4, Format::R8),
    (Format::Bc3, Format::Rgba8),
    (Format::Bc1, Format::Rgba8),
    (Format::Bc7, Format::Rgba8),
];
/// The pictures of `compress`, as large as Doi's; pixels.
const PICTURE: [u32; 2] = [425, 481];
/// Textures that are drawn, each with the uncompressed one that it stands beside.
const PICTURES: [(TextureFormat, TextureFormat); 5] = [
    (TextureFormat::Bc3, TextureFormat::Rgba8),
    (TextureFormat::Bc7, TextureFormat::Rgba8),
    (TextureFormat::Bc4, TextureFormat::R32f),
    (TextureFormat::Bc5, TextureFormat::R32f),
    (TextureFormat::Auto, TextureFormat::R32f),
];
/// Turns of `compress`: a texture takes milliseconds, and where it does not a few are enough.
const TURNS: usize = 15;
/// No more turns of one format after this.
const ENOUGH_OF_ONE: Duration = Duration::from_secs(2);

/// Runs a benchmark.
///
/// # Errors
/// [`Failure`].
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    let moves = matches!(args.name, BenchName::Series | BenchName::Play);
    let input = match &args.data {
        Some(path) => input::open(path)?,
        None if moves => input::of_source(&Source::Builtin(sample::BEAT.to_owned()))?,
        None => input::builtin()?,
    };
    let path = args.data.as_deref().unwrap_or(Path::new("the built-in data"));
    let mut bench = Bench { json: args.json, enlarge: usize::from(args.enlarge), rows: Vec::new() };
    let (name, chart): (_, fn(&[Row]) -> Chart) = match args.name {
        BenchName::Frame => {
            frame(&input, &mut bench)?;
            ("frame.svg", frame_chart)
        }
        BenchName::Compress => {
            textures(&input, path, &mut bench)?;
            pictures(&input, &mut bench)?;
            ("compress.svg", compress_chart)
        }
        BenchName::Series => {
            super::series::bench(&input, path, &mut bench)?;
            ("series.svg", series_chart)
        }
        BenchName::Play => {
            super::play::bench(&input, path, &mut bench)?;
            ("play.svg", play_chart)
        }
    };
    if let Some(folder) = &args.plot {
        std::fs::create_dir_all(folder).map_err(|source| Failure::Output { path: folder.clone(), source })?;
        write_file(&folder.join(name), chart(&bench.rows).svg().as_bytes())?;
    }
    Ok(())
}

/// What was measured of one thing.
type Row = Map<String, Value>;

/// How a benchmark is run and what it found.
#[derive(Debug)]
pub(super) struct Bench {
    json: bool,
    enlarge: usize,
    rows: Vec<Row>,
}

impl Bench {
    /// Voxels along each axis for one of the data's.
    pub(super) fn enlarge(&self) -> usize {
        self.enlarge
    }

    /// Prints a row as soon as it is measured, and keeps it.
    pub(super) fn report(&mut self, row: Value) -> Result<(), Failure> {
        let Value::Object(row) = row else { return Ok(()) };
        if self.json {
            say(&Value::Object(row.clone()).to_string())?;
        } else {
            let cell = |(key, value): (&String, &Value)| match value.as_f64() {
                Some(number) if value.is_f64() => format!("{key} {number:.2}"),
                _ => format!("{key} {}", value.as_str().map_or_else(|| value.to_string(), str::to_owned)),
            };
            say(&row.iter().map(cell).collect::<Vec<_>>().join("  "))?;
        }
        self.rows.push(row);
        Ok(())
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn frame(input: &Input, bench: &mut Bench) -> Result<(), Failure> {
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

fn frame_chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| format!("{} voxel", row["spacing_voxels"]);
    Chart {
        title: "A frame of 512 x 512: time against error".to_owned(),
        x: "frame, ms".to_owned(),
        y: "PSNR against the reference, dB".to_owned(),
        series: series(rows, "texture", &|row| (number(row, "frame_ms"), number(row, "psnr_db"), label(row))),
    }
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

/// Peak signal-to-noise ratio of a mean square in 1/255, dB; none where nothing differs.
pub(super) fn psnr(mean_square: f64) -> Option<f64> {
    (mean_square > 0.0).then(|| 10.0 * (255.0 * 255.0 / mean_square).log10())
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

fn compress_chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| format!("{}, {} threads", row["level"], row["threads"]).replace('"', "");
    Chart {
        title: "Textures: time against error".to_owned(),
        x: "from samples to blocks, ms".to_owned(),
        y: "PSNR against the samples, dB".to_owned(),
        series: series(rows, "format", &|row| {
            (number(row, "texture_ms"), number(row, "psnr_db"), label(row))
        }),
    }
}

fn series_chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| format!("{} {}", row["encoder"], row["second"]).replace('"', "");
    Chart {
        title: "Codecs of a series: size against error".to_owned(),
        x: "bytes for one of the samples'".to_owned(),
        y: "PSNR, dB".to_owned(),
        series: series(rows, "codec", &|row| {
            (1.0 / number(row, "ratio"), number(row, "psnr_db"), label(row))
        }),
    }
}

fn play_chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| format!("{} to texture", row["second"]).replace('"', "");
    Chart {
        title: "Playing from a file that is in no cache: speed against error".to_owned(),
        x: "volumes a second, from file to texture".to_owned(),
        y: "PSNR, dB".to_owned(),
        series: series(rows, "codec", &|row| {
            (number(row, "volumes_per_s"), number(row, "psnr_db"), label(row))
        }),
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
    fn the_background_is_left_out_of_a_channels_error() {
        let image = |pixels: Vec<[f32; 4]>| FloatImage { width: pixels.len() as u32, height: 1, pixels };
        let exact = image(vec![[0.2, 0.4, 0.6, 1.0], [0.0; 4], [0.0; 4], [0.0; 4]]);
        let picture = image(vec![[0.2, 0.4, 0.6 + 10.0 / 255.0, 1.0], [0.0; 4], [0.0; 4], [0.0; 4]]);
        assert_eq!(channels(&picture, &exact), [0.0, 0.0, 100.0], "one pixel of four");
        assert_eq!(psnr(0.0), None, "nothing differs, and JSON has no infinity");
        assert!((psnr(1.0).expect("dB") - 48.1308).abs() < 1e-4, "of an error of one");
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
