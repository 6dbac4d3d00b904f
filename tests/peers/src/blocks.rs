//! `blocks`: encoders of BC1, BC3 and BC4 on a volume, its colours being those of a bone transfer function.

use std::error::Error;
use std::time::Instant;

use compress::bc::{ColourWeight, EncodeOptions, Level, encode_volume_into};
use compress::ktx2::{self, TextureFormat};
use compress::texture::{ColourPoint, ColourTable, Mapping, Samples, Source, TexelFormat, Volume, Window};
use compress::{BlockFormat, Extent3, Limits, quality};
use rayon::prelude::*;
use serde_json::json;

/// How it is called.
pub const USAGE: &str = "blocks --data FILE [--extent X,Y,Z --type u8|i16|u16] [--threads N] [--seconds S] [--slow]
  FILE: raw little-endian samples, x fastest (CT in HU), or a KTX2 file of R8 or R16";

/// HU, red, green, blue, opacity.
const BONE: [[f64; 5]; 7] = [
    [-1024.0, 0.40, 0.20, 0.12, 0.0],
    [160.0, 0.52, 0.30, 0.18, 0.0],
    [240.0, 0.72, 0.47, 0.30, 0.10],
    [420.0, 0.87, 0.68, 0.47, 0.42],
    [750.0, 0.95, 0.86, 0.70, 0.80],
    [1300.0, 0.99, 0.96, 0.88, 0.94],
    [3071.0, 1.0, 1.0, 1.0, 0.97],
];

/// The range of HU that is stored in a KTX2 file without a word of its own, and that grey values stand for.
const RANGE_HU: [f64; 2] = [-1024.0, 3071.0];

/// What the command line says.
struct Arguments {
    data: String,
    extent: Option<Extent3>,
    kind: String,
    threads: usize,
    seconds: f64,
    slow: bool,
}

impl Arguments {
    fn read(arguments: &[String]) -> Result<Self, Box<dyn Error>> {
        let mut read = Self {
            data: String::new(),
            extent: None,
            kind: "i16".into(),
            threads: 1,
            seconds: 6.0,
            slow: false,
        };
        let mut words = arguments.iter();
        while let Some(word) = words.next() {
            let mut value = || words.next().ok_or_else(|| format!("{word} needs a value\nusage: {USAGE}"));
            match word.as_str() {
                "--data" => read.data.clone_from(value()?),
                "--extent" => {
                    let sizes: Vec<u32> = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?;
                    let sizes = sizes.try_into().map_err(|_| "an extent is X,Y,Z")?;
                    read.extent = Some(Extent3::new(sizes)?);
                }
                "--type" => read.kind.clone_from(value()?),
                "--threads" => read.threads = value()?.parse()?,
                "--seconds" => read.seconds = value()?.parse()?,
                "--slow" => read.slow = true,
                other => return Err(format!("unknown: {other}\nusage: {USAGE}").into()),
            }
        }
        Ok(read)
    }

    /// The samples as HU, cut to whole blocks, since the peers take nothing else; and their extent.
    fn volume(&self) -> Result<(Vec<i16>, Extent3), Box<dyn Error>> {
        let bytes = std::fs::read(&self.data).map_err(|error| format!("{}: {error}", self.data))?;
        let [low, high] = RANGE_HU;
        let mut range = RANGE_HU;
        let (samples, extent): (Vec<i16>, _) = if self.data.ends_with(".ktx2") {
            let texture = ktx2::read(&bytes, &Limits::default())?;
            if let Some(text) = texture.text(ktx2::KEY_RANGE) {
                let ends: Vec<f64> = text.split(' ').map(str::parse).collect::<Result<_, _>>()?;
                range = ends.try_into().map_err(|_| "a range is two numbers")?;
            }
            let hu = |share: f64| (range[0] + (range[1] - range[0]) * share) as i16;
            let pairs = texture.data.as_chunks::<2>().0.iter();
            let samples = match texture.format {
                TextureFormat::R16 => pairs.map(|b| hu(f64::from(u16::from_le_bytes(*b)) / 65535.0)).collect(),
                TextureFormat::R8 => texture.data.iter().map(|b| hu(f64::from(*b) / 255.0)).collect(),
                other => return Err(format!("{other:?} holds no samples: give R8 or R16").into()),
            };
            (samples, texture.extent)
        } else {
            let pairs = bytes.as_chunks::<2>().0.iter();
            let samples = match self.kind.as_str() {
                "i16" => pairs.map(|b| i16::from_le_bytes(*b)).collect(),
                "u16" => pairs.map(|b| u16::from_le_bytes(*b).min(32767) as i16).collect(),
                "u8" => bytes.iter().map(|b| (low + (high - low) * f64::from(*b) / 255.0) as i16).collect(),
                other => return Err(format!("samples of type {other}: give u8, i16 or u16").into()),
            };
            (samples, self.extent.ok_or("raw samples need --extent X,Y,Z")?)
        };
        if samples.len() != extent.voxels() {
            return Err(format!("{} samples are not a volume of {:?}", samples.len(), extent.sizes()).into());
        }
        let whole = Extent3::new([extent.x() as u32 / 4 * 4, extent.y() as u32 / 4 * 4, extent.z() as u32])?;
        let mut cut = Vec::with_capacity(whole.voxels());
        for slice in samples.chunks(extent.x() * extent.y()) {
            for row in slice.chunks(extent.x()).take(whole.y()) {
                cut.extend_from_slice(&row[..whole.x()]);
            }
        }
        Ok((cut, whole))
    }
}

/// Whose encoder.
#[derive(Debug, Clone, Copy)]
enum Codec {
    Ours(Level),
    Intel,
    Etcpak,
    /// Of texpresso: the fast and the slow one.
    RangeFit,
    ClusterFit,
}

impl Codec {
    fn name(self) -> &'static str {
        match self {
            Self::Ours(_) => "compress",
            Self::Intel => "intel_tex_2",
            Self::Etcpak => "ctt-etcpak",
            Self::RangeFit | Self::ClusterFit => "texpresso",
        }
    }

    fn level(self) -> &'static str {
        match self {
            Self::Ours(Level::Fast) => "fast",
            Self::Ours(Level::Best) => "best",
            Self::Intel | Self::Etcpak => "only",
            Self::RangeFit => "range",
            Self::ClusterFit => "cluster",
        }
    }

    fn encode(self, task: &Task<'_>, blocks: &mut [u8]) -> Result<(), Box<dyn Error>> {
        let Task { format, extent, texels } = *task;
        if let Self::Ours(level) = self {
            let options = EncodeOptions::default().with_level(level).with_colour_weight(ColourWeight::Equal);
            return Ok(encode_volume_into(format, texels, extent, options, blocks)?);
        }
        // Slices are pictures of their own.
        let slice = extent.x() * extent.y();
        let pictures = texels.par_chunks(slice * format.channels());
        pictures.zip(blocks.par_chunks_mut(slice / 16 * format.block_bytes())).for_each(|(texels, blocks)| {
            self.encode_slice(format, extent, texels, blocks);
        });
        Ok(())
    }

    fn encode_slice(self, format: BlockFormat, extent: Extent3, texels: &[u8], blocks: &mut [u8]) {
        let (width, height) = (extent.x() as u32, extent.y() as u32);
        let stride = width * format.channels() as u32;
        match (self, format) {
            (Self::Intel, BlockFormat::Bc1) => intel_tex_2::bc1::compress_blocks_into(
                &intel_tex_2::RgbaSurface { data: texels, width, height, stride },
                blocks,
            ),
            (Self::Intel, BlockFormat::Bc3) => intel_tex_2::bc3::compress_blocks_into(
                &intel_tex_2::RgbaSurface { data: texels, width, height, stride },
                blocks,
            ),
            (Self::Intel, _) => intel_tex_2::bc4::compress_blocks_into(
                &intel_tex_2::RSurface { data: texels, width, height, stride },
                blocks,
            ),
            (Self::Etcpak, BlockFormat::Bc1) => {
                ctt_etcpak::bc1::compress_blocks_into(&ctt_etcpak::Surface::new(texels, width, height), blocks);
            }
            (Self::Etcpak, BlockFormat::Bc3) => {
                ctt_etcpak::bc3::compress_blocks_into(&ctt_etcpak::Surface::new(texels, width, height), blocks);
            }
            // It takes a channel only out of four. Making them is not timed: `Task::wide`.
            (Self::Etcpak, _) => unreachable!("BC4 of etcpak is run on wide texels"),
            (Self::RangeFit | Self::ClusterFit, _) => {
                let algorithm = if matches!(self, Self::RangeFit) {
                    texpresso::Algorithm::RangeFit
                } else {
                    texpresso::Algorithm::ClusterFit
                };
                let params = texpresso::Params { algorithm, ..texpresso::Params::default() };
                texpresso::Format::Bc3.compress(texels, width as usize, height as usize, params, blocks);
            }
            (Self::Ours(_), _) => {}
        }
    }
}

/// What is to be encoded.
#[derive(Clone, Copy)]
struct Task<'a> {
    format: BlockFormat,
    extent: Extent3,
    texels: &'a [u8],
}

impl Task<'_> {
    /// The blocks decoded by a decoder that is nobody's here.
    fn decoded(&self, blocks: &[u8]) -> Vec<u8> {
        let (channels, width) = (self.format.channels(), self.extent.x());
        let mut texels = vec![0; self.texels.len()];
        let across = width / 4;
        for (i, block) in blocks.chunks_exact(self.format.block_bytes()).enumerate() {
            let at = (i / across * 4 * width + i % across * 4) * channels;
            let out = &mut texels[at..];
            match self.format {
                BlockFormat::Bc1 => bcdec_rs::bc1(block, out, width * 4),
                BlockFormat::Bc3 => {
                    bcdec_rs::bc3(block, out, width * 4);
                    // Its alpha of BC3 is rounded down, that of BC4 to the nearest, as graphics processors do.
                    let mut alpha = [0; 16];
                    bcdec_rs::bc4(&block[..8], &mut alpha, 4, false);
                    for (k, alpha) in alpha.into_iter().enumerate() {
                        out[(k / 4 * width + k % 4) * 4 + 3] = alpha;
                    }
                }
                _ => bcdec_rs::bc4(block, out, width, false),
            }
        }
        texels
    }

    fn measure(&self, codecs: &[Codec], arguments: &Arguments) -> Result<(), Box<dyn Error>> {
        let mut blocks = vec![0; self.format.encoded_len(self.extent)];
        // Texels of four channels, for a peer that reads no others.
        let wide: Vec<u8> = match self.format {
            BlockFormat::Bc4 => self.texels.iter().flat_map(|v| [*v, 0, 0, 255]).collect(),
            _ => Vec::new(),
        };
        let mut least = vec![f64::INFINITY; codecs.len()];
        let begin = Instant::now();
        let mut rounds = 0;
        while rounds < 3 || begin.elapsed().as_secs_f64() < arguments.seconds {
            for (codec, least) in codecs.iter().zip(&mut least) {
                if matches!(codec, Codec::RangeFit | Codec::ClusterFit) && least.is_finite() {
                    continue;
                }
                let begin = Instant::now();
                self.encode(*codec, &wide, &mut blocks)?;
                *least = least.min(begin.elapsed().as_secs_f64());
            }
            rounds += 1;
        }
        let first = least[0];
        for (codec, least) in codecs.iter().zip(least) {
            self.encode(*codec, &wide, &mut blocks)?;
            let decoded = self.decoded(&blocks);
            let channels = self.format.channels();
            let colour = quality::compare_channels(self.texels, &decoded, channels, 0..channels.min(3), 255.0)?;
            let alpha = match self.format {
                BlockFormat::Bc3 => {
                    Some(quality::compare_channels(self.texels, &decoded, channels, 3..4, 255.0)?)
                }
                _ => None,
            };
            let mpix = |secs: f64| self.extent.voxels() as f64 / secs / 1e6;
            let round = |value: f64, unit: f64| (value / unit).round() * unit;
            println!(
                "{}",
                json!({
                    "format": self.format.name(),
                    "codec": codec.name(),
                    "level": codec.level(),
                    "threads": arguments.threads,
                    "rounds": rounds,
                    "mpix_s": mpix(least).round(),
                    "times_first": round(first / least, 0.01),
                    "bytes": blocks.len(),
                    "psnr_rgb_db": round(colour.psnr_db, 0.01),
                    "psnr_a_db": alpha.map(|alpha| round(alpha.psnr_db, 0.01)),
                    "largest_error": alpha.map_or(colour.largest, |alpha| alpha.largest.max(colour.largest)),
                })
            );
        }
        Ok(())
    }

    fn encode(&self, codec: Codec, wide: &[u8], blocks: &mut [u8]) -> Result<(), Box<dyn Error>> {
        if let (Codec::Etcpak, BlockFormat::Bc4) = (codec, self.format) {
            let slice = self.extent.x() * self.extent.y();
            let (width, height) = (self.extent.x() as u32, self.extent.y() as u32);
            wide.par_chunks(slice * 4).zip(blocks.par_chunks_mut(slice / 2)).for_each(|(texels, blocks)| {
                ctt_etcpak::bc4::compress_blocks_into(&ctt_etcpak::Surface::new(texels, width, height), blocks);
            });
            return Ok(());
        }
        codec.encode(self, blocks)
    }
}

/// Measures all codecs and prints a line for each; `times_first` is speed in units of that of the first.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::read(arguments)?;
    rayon::ThreadPoolBuilder::new().num_threads(arguments.threads).build_global()?;
    let (samples, extent) = arguments.volume()?;
    let volume = Volume::new(Samples::I16(&samples), extent)?;
    let points = BONE.map(|[value, r, g, b, a]| ColourPoint { value, rgba: [r, g, b, a] });
    let padding = RANGE_HU[0];
    let table = ColourTable::new(&points, volume.kind(), padding)?;
    let opaque = ColourTable::opaque(&points, volume.kind(), padding)?;
    let window = Window::new(RANGE_HU, volume.kind(), padding)?;
    for (format, mapping, texel) in [
        (BlockFormat::Bc3, Mapping::Colours(&table), TexelFormat::Rgba8),
        (BlockFormat::Bc1, Mapping::Colours(&opaque), TexelFormat::Rgba8),
        (BlockFormat::Bc4, Mapping::Scalars(&window), TexelFormat::R8),
    ] {
        let texels = Source::new(volume, mapping)?.texels(texel)?;
        let mut codecs =
            vec![Codec::Intel, Codec::Etcpak, Codec::Ours(Level::Fast), Codec::Ours(Level::Best)];
        if format == BlockFormat::Bc3 && arguments.slow {
            codecs.extend([Codec::RangeFit, Codec::ClusterFit]);
        }
        Task { format, extent, texels: &texels }.measure(&codecs, &arguments)?;
    }
    Ok(())
}
