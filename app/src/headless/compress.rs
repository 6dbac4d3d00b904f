//! `compress`: a KTX2 texture file of one volume, readable by other KTX2 tools; of a volume over time, a series
//! file (see `series`).

use std::sync::Arc;
use std::time::Instant;

use ::compress::bc::{EncodeOptions, Level};
use ::compress::ktx2::{self, Supercompression, Texture};
use ::compress::texture::{ColourTable, EncodeStats, Mapping, Source, TexelFormat, TextureError, Window};
use ::compress::{BlockFormat, Extent3};
use ::render::volume::{Grid, Transfer};
use ::render::{GridSource, SourceError};
use rayon::ThreadPool;
use serde_json::json;

use super::render::ms;
use super::{Failure, check_folder, input, say, write_file};
use crate::case::{Assets, Case, Volume};
use crate::cli::{CompressArgs, Format};
use crate::presets;

/// Level of zstd for blocks: past it little is gained.
const BLOCK_LEVEL: i32 = 9;
/// Level of zstd for plain samples, whose noise a higher one would only search for longer.
const SAMPLE_LEVEL: i32 = 3;

/// What a format of textures is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Blocks(BlockFormat),
    Texels(TexelFormat),
}

impl Format {
    /// The format as the encoders know it; none for one of series.
    fn kind(self) -> Option<Kind> {
        Some(match self {
            Self::Bc1 => Kind::Blocks(BlockFormat::Bc1),
            Self::Bc3 => Kind::Blocks(BlockFormat::Bc3),
            Self::Bc4 => Kind::Blocks(BlockFormat::Bc4),
            Self::Bc7 => Kind::Blocks(BlockFormat::Bc7),
            Self::Rgba8 => Kind::Texels(TexelFormat::Rgba8),
            Self::R8 => Kind::Texels(TexelFormat::R8),
            Self::R16 => Kind::Texels(TexelFormat::R16),
            Self::Pvtc | Self::PvtcTe | Self::PvtcSe | Self::Raw8 | Self::Raw16 => return None,
        })
    }

    /// The name on the command line.
    pub(super) fn name(self) -> String {
        use clap::ValueEnum as _;
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// Whether voxels are colours, classified beforehand.
    fn is_colour(self) -> bool {
        matches!(self, Self::Bc1 | Self::Bc3 | Self::Bc7 | Self::Rgba8)
    }
}

/// All textures that can be made of one volume.
#[derive(Debug)]
pub(super) struct Textures<'a> {
    source: &'a GridSource<'a>,
    range: [f64; 2],
    colours: ColourTable,
    opaque: ColourTable,
    window: Window,
}

/// What a texture has lost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lost {
    pub(super) largest: f64,
    /// None where nothing is lost: JSON has no infinity.
    pub(super) psnr_db: Option<f64>,
    /// `"1/255"` of premultiplied colours, `"value"` of scalars.
    pub(super) unit: &'static str,
}

impl<'a> Textures<'a> {
    /// What samples become: colours by `transfer`, scalars over their own range.
    pub(super) fn new(source: &'a GridSource<'a>, grid: &Grid, transfer: &Transfer) -> Result<Self, Failure> {
        let range = grid.range();
        Ok(Self {
            source,
            range,
            colours: source.table(transfer)?,
            opaque: source.opaque_table(transfer)?,
            window: source.window(range)?,
        })
    }

    fn source(&self, format: Format) -> Result<(Source<'_>, Kind), Failure> {
        let kind = format.kind();
        let kind = kind.ok_or_else(|| Failure::Usage(format!("{} is of a volume over time", format.name())))?;
        let mapping = match format {
            Format::Bc1 => Mapping::Colours(&self.opaque),
            _ if format.is_colour() => Mapping::Colours(&self.colours),
            _ => Mapping::Scalars(&self.window),
        };
        Ok((Source::new(self.source.volume()?, mapping)?, kind))
    }

    /// Writes the texture into `out`, whose memory is used again.
    pub(super) fn make(&self, format: Format, level: Level, out: &mut Vec<u8>) -> Result<(), Failure> {
        self.stats(format, level, out).map(|_| ())
    }

    /// The same, and how its blocks came to be.
    pub(super) fn stats(
        &self,
        format: Format,
        level: Level,
        out: &mut Vec<u8>,
    ) -> Result<EncodeStats, Failure> {
        let (source, kind) = self.source(format)?;
        let extent = source.volume().extent();
        match kind {
            Kind::Blocks(blocks) => {
                out.resize(blocks.encoded_len(extent), 0);
                Ok(source.blocks_into(blocks, EncodeOptions::default().with_level(level), out)?)
            }
            Kind::Texels(texels) => {
                out.resize(extent.voxels() * texels.bytes(), 0);
                source.texels_into(texels, out)?;
                Ok(EncodeStats::default())
            }
        }
    }

    /// How far a texture is from the samples.
    pub(super) fn lost(&self, format: Format, texture: &[u8]) -> Result<Lost, Failure> {
        let (source, kind) = self.source(format)?;
        let loss = match kind {
            Kind::Blocks(blocks) => source.loss_of_blocks(blocks, texture)?,
            Kind::Texels(texels) => source.loss_of_texels(texels)?,
        };
        let (per_stored, peak, unit) = if format.is_colour() {
            (1.0, 255.0, "1/255")
        } else {
            (self.source.unit(), self.range[1] - self.range[0], "value")
        };
        let psnr = loss.psnr_db(peak / per_stored);
        Ok(Lost { largest: loss.largest * per_stored, psnr_db: psnr.is_finite().then_some(psnr), unit })
    }

    /// The values that a stored 0 and the greatest stored number stand for.
    fn range(&self, format: Format) -> [f64; 2] {
        if format.is_colour() { self.range } else { self.source.values(&self.window, format == Format::R16) }
    }
}

/// Makes the texture and says what it cost.
///
/// # Errors
/// [`Failure`].
pub fn run(args: &CompressArgs) -> Result<(), Failure> {
    if let Some(codec) = args.format.of_series(args.layout) {
        return super::series::compress(args, codec);
    }
    check_folder(&args.out)?;
    let input = input::open(&args.input)?;
    let (volume, grid) = volume(&input.case, &input.assets, &args.input)?;
    let grid = grid.as_ref();
    let transfer = transfer(args.preset.as_deref(), volume, grid)?;
    let pool = pool(args.threads.map_or(0, usize::from))?;
    let source = GridSource::new(grid)?;
    let textures = Textures::new(&source, grid, &transfer)?;
    let level = args.level.of_encoder();
    let mut data = Vec::new();
    let begin = Instant::now();
    pool.install(|| textures.make(args.format, level, &mut data))?;
    let texture_ms = ms(begin);
    let lost = pool.install(|| textures.lost(args.format, &data))?;
    let range = textures.range(args.format);
    let (of_file, sample_level) = match args.format.kind() {
        Some(Kind::Blocks(block)) => (ktx2::TextureFormat::Block(block), BLOCK_LEVEL),
        Some(Kind::Texels(TexelFormat::Rgba8)) => (ktx2::TextureFormat::Rgba8, SAMPLE_LEVEL),
        Some(Kind::Texels(TexelFormat::R8)) => (ktx2::TextureFormat::R8, SAMPLE_LEVEL),
        _ => (ktx2::TextureFormat::R16, SAMPLE_LEVEL),
    };
    let mut texture = Texture::new(of_file, extent(grid)?, data);
    let world_from_voxel = volume.pose * *grid.world_from_voxel();
    texture.set_text(ktx2::KEY_WORLD_FROM_VOXEL, &numbers(&world_from_voxel.to_row_major()));
    texture.set_text(ktx2::KEY_RANGE, &numbers(&range));
    let begin = Instant::now();
    let mut file = Vec::new();
    ktx2::write(&mut file, &texture, Supercompression::Zstd { level: sample_level })
        .map_err(|e| Failure::Other(format!("the texture cannot be packed ({e}): {}", args.out.display())))?;
    let pack_ms = ms(begin);
    write_file(&args.out, &file)?;
    if args.stats {
        let samples = sample_bytes(grid);
        // Rounding of the comparison itself does not count.
        let exact = lost.unit == "value" && lost.largest <= 1e-9 * (range[1] - range[0]);
        let largest = if exact { 0.0 } else { lost.largest };
        say(&json!({
            "format": args.format.name(),
            "extent": grid.extent(),
            "threads": pool.current_num_threads(),
            "sample_bytes": samples,
            "texture_bytes": texture.data.len(),
            "file_bytes": file.len(),
            "ratio_texture": samples as f64 / texture.data.len() as f64,
            "ratio_file": samples as f64 / file.len() as f64,
            "texture_ms": texture_ms,
            "pack_ms": pack_ms,
            "value_range": range,
            // Colours classified beforehand only approximate the picture of the samples.
            "lossy": args.format.is_colour() || largest > 0.0,
            "largest_error": largest,
            "error_unit": lost.unit,
            "psnr_db": lost.psnr_db,
        })
        .to_string())?;
    }
    Ok(())
}

impl From<SourceError> for Failure {
    fn from(error: SourceError) -> Self {
        Self::Other(error.to_string())
    }
}

impl From<TextureError> for Failure {
    fn from(error: TextureError) -> Self {
        Self::Other(error.to_string())
    }
}

/// Threads to measure or to work with; 0 are all cores.
pub(super) fn pool(threads: usize) -> Result<ThreadPool, Failure> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Failure::Other(format!("the threads cannot be started ({e}); ask for fewer")))
}

/// Bytes of the samples as stored.
fn sample_bytes(grid: &Grid) -> usize {
    let bytes = match grid.samples().kind() {
        "u8" | "i8" => 1,
        "u16" | "i16" => 2,
        "f64" => 8,
        _ => 4,
    };
    bytes * grid.samples().len()
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// The first visible volume of an input.
pub(super) fn volume<'a>(
    case: &'a Case,
    assets: &Assets,
    path: &std::path::Path,
) -> Result<(&'a Volume, Arc<Grid>), Failure> {
    let mut visible = case.volumes.iter().filter(|v| v.visible);
    visible.find_map(|v| Some((v, assets.grid(v)?))).ok_or_else(|| {
        let fault = "there is no volume to take; choose a file with a volume, or make one visible";
        Failure::Unfit(format!("{fault}: {}", path.display()))
    })
}

fn transfer(preset: Option<&str>, volume: &Volume, grid: &Grid) -> Result<Arc<Transfer>, Failure> {
    let Some(name) = preset else { return Ok(Arc::clone(&volume.transfer)) };
    let transfer = presets::by_name(name).and_then(|p| p.transfer(grid.range()).ok());
    transfer.map(Arc::new).ok_or_else(|| {
        let names: Vec<&str> = presets::presets().iter().map(|p| p.name.as_str()).collect();
        Failure::Usage(format!("there is no preset \"{name}\"; choose one of {}", names.join(", ")))
    })
}

/// The extent as the codecs know it.
fn extent(grid: &Grid) -> Result<Extent3, Failure> {
    let sizes = grid.extent().map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    Extent3::new(sizes).map_err(|e| Failure::Unfit(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::render::volume::{Affine, Rescale, Samples};

    const FORMATS: [Format; 7] =
        [Format::Bc1, Format::Bc3, Format::Bc4, Format::Bc7, Format::Rgba8, Format::R8, Format::R16];

    fn grid(extent: [usize; 3], sample: impl Fn(i32) -> i16) -> Grid {
        let count = extent.iter().product::<usize>() as i32;
        let samples = Samples::I16((0..count).map(sample).collect());
        Grid::new(extent, samples, Rescale::default(), Affine::identity()).expect("grid")
    }

    #[test]
    fn what_is_lost_is_said_in_the_datas_unit() {
        let grid = grid([16, 16, 16], |i| i as i16);
        let transfer = presets::default_for(Some("CT"), grid.range());
        let source = GridSource::new(&grid).expect("source");
        let textures = Textures::new(&source, &grid, &transfer).expect("textures");
        let lost = |format| {
            let mut out = Vec::new();
            textures.make(format, Level::Best, &mut out).expect("made");
            textures.lost(format, &out).expect("measured")
        };
        let wide = lost(Format::R16);
        assert_eq!((wide.largest, wide.psnr_db, wide.unit), (0.0, None, "value"), "16 bits hold 4096 values");
        let eight = lost(Format::R8).largest;
        assert!((7.9..8.1).contains(&eight), "half of 4095/255: {eight}");
        assert!(lost(Format::Bc4).largest >= eight, "blocks lose more");
        assert_eq!(lost(Format::Rgba8).unit, "1/255", "colours have no value");
    }

    #[test]
    fn the_bytes_do_not_depend_on_the_threads() {
        let grid = grid([20, 12, 9], |i| (i * 7919 % 3000) as i16);
        let transfer = presets::default_for(Some("CT"), grid.range());
        let source = GridSource::new(&grid).expect("source");
        let textures = Textures::new(&source, &grid, &transfer).expect("textures");
        for format in FORMATS {
            let with = |threads| {
                let mut out = Vec::new();
                pool(threads).expect("pool").install(|| textures.make(format, Level::Best, &mut out)).expect("made");
                out
            };
            let one = with(1);
            assert!(!one.is_empty() && one == with(4), "{} differs", format.name());
        }
    }

    #[test]
    fn a_format_of_series_is_no_texture() {
        for format in [Format::Pvtc, Format::PvtcTe, Format::PvtcSe, Format::Raw8, Format::Raw16] {
            assert_eq!(format.kind(), None, "{}", format.name());
        }
        assert!(FORMATS.iter().all(|f| f.kind().is_some()), "and the others are");
    }
}
