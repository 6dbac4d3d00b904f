//! Time to make a compressed texture from samples against that of an uncompressed one, interleaved in one process.
//!
//! `cargo bench -p compress --bench generate -- [FILE...]`, with raw little-endian files named `NAME_XxYxZ.KIND`
//! (`KIND` is u8, i16, u16 or f32; CT in HU), else with a phantom. One JSON line per volume, transfer function,
//! threads and way: the least time of all rounds, its ratio to the uncompressed texture's of the same threads and
//! memory, and the PSNR of premultiplied colour and opacity. `fresh` allocates its result, `reused` writes over an old
//! one, `staged` does that and copies it, on one thread, to a buffer written before: ready for an upload.

#![expect(clippy::print_stdout, reason = "the figures are its output")]
#![expect(clippy::panic, clippy::unwrap_used, reason = "a benchmark may fail loudly")]

use std::hint::black_box;
use std::time::Instant;

use compress::bc::{EncodeOptions, Level};
use compress::texture::{
    ColourPoint, ColourTable, Mapping, SampleKind, Samples, Source, TexelFormat, Volume,
};
use compress::{BlockFormat, Extent3};

/// Rounds, one if this is not run by `cargo bench`, and the seconds after which a volume has had enough of them.
const ROUNDS: usize = 60;
const SECONDS: f64 = 2.5;

/// HU, red, green, blue, opacity: bone as a solid surface; fat, muscle and bone, each translucent.
const BONE: [[f64; 5]; 7] = [
    [-1024.0, 0.40, 0.20, 0.12, 0.0],
    [160.0, 0.52, 0.30, 0.18, 0.0],
    [240.0, 0.72, 0.47, 0.30, 0.10],
    [420.0, 0.87, 0.68, 0.47, 0.42],
    [750.0, 0.95, 0.86, 0.70, 0.80],
    [1300.0, 0.99, 0.96, 0.88, 0.94],
    [3071.0, 1.0, 1.0, 1.0, 0.97],
];
const SOFT: [[f64; 5]; 8] = [
    [-1024.0, 0.0, 0.0, 0.0, 0.0],
    [-180.0, 0.88, 0.74, 0.42, 0.0],
    [-105.0, 0.93, 0.80, 0.48, 0.006],
    [-30.0, 0.80, 0.48, 0.34, 0.006],
    [55.0, 0.70, 0.24, 0.18, 0.035],
    [160.0, 0.80, 0.46, 0.34, 0.06],
    [400.0, 0.95, 0.86, 0.70, 0.35],
    [3071.0, 1.0, 1.0, 1.0, 0.90],
];
/// Muscle as a solid surface.
const MUSCLE: [[f64; 5]; 7] = [
    [-1024.0, 0.0, 0.0, 0.0, 0.0],
    [-25.0, 0.45, 0.10, 0.08, 0.0],
    [25.0, 0.60, 0.18, 0.14, 0.20],
    [90.0, 0.74, 0.28, 0.22, 0.55],
    [180.0, 0.82, 0.52, 0.40, 0.60],
    [500.0, 0.95, 0.88, 0.74, 0.85],
    [3071.0, 1.0, 1.0, 1.0, 0.95],
];
/// The built-in case's own: the surface of bone, and a little of its inside.
const HIP: [[f64; 5]; 8] = [
    [-1024.0, 0.6, 0.4, 0.25, 0.0],
    [290.0, 0.8, 0.58, 0.4, 0.0],
    [420.0, 0.95, 0.81, 0.61, 0.22],
    [800.0, 1.0, 0.95, 0.84, 0.22],
    [1050.0, 1.0, 0.98, 0.92, 0.045],
    [1700.0, 1.0, 1.0, 0.98, 0.045],
    [2400.0, 1.0, 1.0, 1.0, 0.3],
    [3071.0, 1.0, 1.0, 1.0, 0.3],
];

/// Samples of a file, as they are stored.
enum Stored {
    U8(Vec<u8>),
    I16(Vec<i16>),
    U16(Vec<u16>),
    F32(Vec<f32>),
}

impl Stored {
    fn samples(&self) -> Samples<'_> {
        match self {
            Self::U8(samples) => Samples::U8(samples),
            Self::I16(samples) => Samples::I16(samples),
            Self::U16(samples) => Samples::U16(samples),
            Self::F32(samples) => Samples::F32(samples),
        }
    }
}

/// A file `NAME_XxYxZ.KIND`.
fn read(path: &str) -> (String, Extent3, Stored) {
    let stem = path.rsplit('/').next().unwrap();
    let (name, kind) = stem.rsplit_once('.').unwrap();
    let (name, sizes) = name.rsplit_once('_').unwrap();
    let sizes: Vec<u32> = sizes.split('x').map(|n| n.parse().unwrap()).collect();
    let bytes = std::fs::read(path).unwrap();
    let pairs = || bytes.as_chunks::<2>().0.iter();
    let stored = match kind {
        "u8" => Stored::U8(bytes),
        "i16" => Stored::I16(pairs().map(|b| i16::from_le_bytes(*b)).collect()),
        "u16" => Stored::U16(pairs().map(|b| u16::from_le_bytes(*b)).collect()),
        "f32" => Stored::F32(bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()),
        other => panic!("samples of kind {other}: give u8, i16, u16 or f32"),
    };
    (name.to_owned(), Extent3::new(sizes.try_into().unwrap()).unwrap(), stored)
}

/// A trunk with a bone, blurred by nothing but with the noise of a scanner.
fn phantom() -> (String, Extent3, Stored) {
    let extent = Extent3::new([192, 192, 96]).unwrap();
    let mut state = 1_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 16) / 65536.0 - 0.5
    };
    let mut samples = Vec::with_capacity(extent.voxels());
    for z in 0..extent.z() {
        for y in 0..extent.y() {
            for x in 0..extent.x() {
                let at = [x as f64 - 96.0, y as f64 - 96.0, z as f64 - 48.0];
                let (trunk, bone) = (at[0].hypot(at[1]), (at[0] - 30.0).hypot(at[1] + at[2] / 4.0));
                let hu = match (trunk, bone) {
                    (_, bone) if bone < 12.0 => 250.0,
                    (_, bone) if bone < 18.0 => 1200.0,
                    (trunk, _) if trunk < 70.0 => 50.0,
                    (trunk, _) if trunk < 80.0 => -90.0,
                    _ => -1000.0,
                };
                samples.push((hu + 80.0 * (noise() + noise())) as i16);
            }
        }
    }
    ("phantom".to_owned(), extent, Stored::I16(samples))
}

/// One way to make a texture.
#[derive(Clone, Copy)]
enum Way {
    Uncompressed,
    Blocks(Level),
}

fn table(points: &[[f64; 5]], kind: SampleKind) -> ColourTable {
    // CT in HU; 8 bits as if they were a window from -200 to 1075.
    let scale = |hu: f64| if kind == SampleKind::U8 { (hu + 200.0) / 5.0 } else { hu };
    let points: Vec<ColourPoint> =
        points.iter().map(|&[hu, r, g, b, a]| ColourPoint { value: scale(hu), rgba: [r, g, b, a] }).collect();
    ColourTable::new(&points, kind, -1024.0).unwrap()
}

fn main() {
    let files: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with('-')).collect();
    let volumes = if files.is_empty() { vec![phantom()] } else { files.iter().map(|f| read(f)).collect() };
    for (name, extent, stored) in &volumes {
        for (function, points) in
            [("bone", &BONE[..]), ("soft", &SOFT[..]), ("muscle", &MUSCLE[..]), ("hip", &HIP[..])]
        {
            let volume = Volume::new(stored.samples(), *extent).unwrap();
            let begin = Instant::now();
            let table = black_box(table(points, volume.kind()));
            let table_us = begin.elapsed().as_secs_f64() * 1e6;
            let source = Source::new(volume, Mapping::Colours(&table)).unwrap();
            measure(
                &format!(r#""volume":"{name}","function":"{function}","table_us":{table_us:.0}"#),
                &source,
            );
        }
    }
}

fn measure(what: &str, source: &Source<'_>) {
    let ways = [Way::Uncompressed, Way::Blocks(Level::Fast), Way::Blocks(Level::Best)];
    let names = ["uncompressed", "fast", "best"];
    let options = |level| EncodeOptions::default().with_level(level);
    let fresh = |way: Way| match way {
        Way::Uncompressed => source.texels(TexelFormat::Rgba8).unwrap(),
        Way::Blocks(level) => source.blocks(BlockFormat::Bc3, options(level)).unwrap().0,
    };
    let mut texels = fresh(Way::Uncompressed);
    let mut blocks = fresh(Way::Blocks(Level::Fast));
    // What an upload copies from: written beforehand, as mapped memory is.
    let mut staging = vec![1; texels.len().max(blocks.len())];
    let reused = |way: Way, texels: &mut [u8], blocks: &mut [u8]| match way {
        Way::Uncompressed => source.texels_into(TexelFormat::Rgba8, texels).unwrap(),
        Way::Blocks(level) => {
            black_box(source.blocks_into(BlockFormat::Bc3, options(level), blocks).unwrap());
        }
    };
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut least = [[f64::INFINITY; 3]; 3];
        let begin = Instant::now();
        let rounds = if std::env::args().any(|arg| arg == "--bench") { ROUNDS } else { 1 };
        for _ in 0..rounds {
            for (way, least) in ways.iter().zip(&mut least) {
                let mut time = |memory: usize, run: &mut (dyn FnMut() + Send)| {
                    let begin = Instant::now();
                    pool.install(run);
                    least[memory] = least[memory].min(begin.elapsed().as_secs_f64() * 1e3);
                };
                time(0, &mut || drop(black_box(fresh(*way))));
                time(1, &mut || reused(*way, &mut texels, &mut blocks));
                time(2, &mut || {
                    reused(*way, &mut texels, &mut blocks);
                    let ready = if matches!(way, Way::Uncompressed) { &texels } else { &blocks };
                    black_box(&mut staging)[..ready.len()].copy_from_slice(ready);
                });
            }
            if begin.elapsed().as_secs_f64() > SECONDS {
                break;
            }
        }
        for (i, way) in ways.iter().enumerate() {
            let quality = match way {
                Way::Uncompressed => source.loss_of_texels(TexelFormat::Rgba8).unwrap(),
                Way::Blocks(level) => {
                    let (blocks, stats) = source.blocks(BlockFormat::Bc3, options(*level)).unwrap();
                    if threads == 1 {
                        println!("{{{what},\"way\":\"{}\",\"stats\":\"{stats:?}\"}}", names[i]);
                    }
                    source.loss_of_blocks(BlockFormat::Bc3, &blocks).unwrap()
                }
            };
            for (memory, name) in ["fresh", "reused", "staged"].into_iter().enumerate() {
                println!(
                    "{{{what},\"way\":\"{}\",\"memory\":\"{name}\",\"threads\":{threads},\"ms\":{:.3},\"ratio\":{:.3},\
                     \"psnr_db\":{:.2},\"largest\":{:.1}}}",
                    names[i],
                    least[i][memory],
                    least[i][memory] / least[0][memory],
                    quality.psnr_db(255.0),
                    quality.largest,
                );
            }
        }
    }
}
