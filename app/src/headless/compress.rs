//! `compress`: a KTX2 texture file of one volume, readable by other KTX2 tools.

use std::sync::Arc;
use std::time::Instant;

use ::compress::ktx2::{self, Supercompression, Texture};
use ::compress::quality::{self, Quality};
use ::compress::{BlockFormat, Extent3, bc};
use ::render::volume::{Grid, Transfer};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::render::ms;
use super::{Failure, check_folder, input, say, write_file};
use crate::case::{Assets, Case, Volume};
use crate::cli::{CompressArgs, Format};
use crate::presets;

/// Level of zstd for blocks: past it little is gained.
const BLOCK_LEVEL: i32 = 9;
/// Level of zstd for plain samples, whose noise a higher one would only search for longer.
const SAMPLE_LEVEL: i32 = 3;

impl Format {
    /// The format as the file knows it.
    fn of_file(self) -> ktx2::TextureFormat {
        match self {
            Self::Bc1 => ktx2::TextureFormat::Block(BlockFormat::Bc1),
            Self::Bc3 => ktx2::TextureFormat::Block(BlockFormat::Bc3),
            Self::Bc4 => ktx2::TextureFormat::Block(BlockFormat::Bc4),
            Self::Rgba8 => ktx2::TextureFormat::Rgba8,
            Self::R8 => ktx2::TextureFormat::R8,
            Self::R16 => ktx2::TextureFormat::R16,
        }
    }

    /// The name on the command line.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Bc1 => "bc1",
            Self::Bc3 => "bc3",
            Self::Bc4 => "bc4",
            Self::Rgba8 => "rgba8",
            Self::R8 => "r8",
            Self::R16 => "r16",
        }
    }

    /// Whether voxels are colours, classified beforehand.
    pub(super) fn is_colour(self) -> bool {
        matches!(self, Self::Bc1 | Self::Bc3 | Self::Rgba8)
    }
}

/// What a texture is made of and what was lost.
#[derive(Debug)]
pub(super) struct Made {
    pub(super) data: Vec<u8>,
    /// The values that a stored 0 and the greatest stored number stand for.
    pub(super) range: [f64; 2],
    /// From samples to uncompressed texels; ms.
    pub(super) generate_ms: f64,
    /// From texels to blocks; ms, 0 where there are none.
    pub(super) encode_ms: f64,
    /// Blocks against texels, in 1/255 of a channel; all channels of opaque colour, colour and opacity
    /// alike of the rest. None where nothing is encoded.
    pub(super) quality: Option<Quality>,
    /// Largest distance of a stored value from the grid's, in its unit; none for colours.
    pub(super) value_error: Option<f64>,
}

/// Makes the texture and says what it cost.
///
/// # Errors
/// [`Failure`].
pub fn run(args: &CompressArgs) -> Result<(), Failure> {
    check_folder(&args.out)?;
    let input = input::open(&args.input)?;
    let (volume, grid) = volume(&input.case, &input.assets, &args.input)?;
    let grid = grid.as_ref();
    let transfer = transfer(args.preset.as_deref(), volume, grid)?;
    let threads = args.threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Failure::Other(format!("the threads cannot be started ({e}); ask for fewer")))?;
    let extent = extent(grid)?;
    let made = pool.install(|| make(args.format, grid, &transfer, extent))?;
    let mut texture = Texture::new(args.format.of_file(), extent, made.data);
    let world_from_voxel = volume.pose * *grid.world_from_voxel();
    texture.set_text(ktx2::KEY_WORLD_FROM_VOXEL, &numbers(&world_from_voxel.to_row_major()));
    texture.set_text(ktx2::KEY_RANGE, &numbers(&made.range));
    let begin = Instant::now();
    let mut file = Vec::new();
    let level = if made.quality.is_some() { BLOCK_LEVEL } else { SAMPLE_LEVEL };
    ktx2::write(&mut file, &texture, Supercompression::Zstd { level })
        .map_err(|e| Failure::Other(format!("the texture cannot be packed ({e}): {}", args.out.display())))?;
    let pack_ms = ms(begin);
    write_file(&args.out, &file)?;
    if args.stats {
        let samples = sample_bytes(grid);
        say(&json!({
            "format": args.format.name(),
            "extent": extent.sizes(),
            "threads": pool.current_num_threads(),
            "sample_bytes": samples,
            "texture_bytes": texture.data.len(),
            "file_bytes": file.len(),
            "ratio_texture": samples as f64 / texture.data.len() as f64,
            "ratio_file": samples as f64 / file.len() as f64,
            "generate_ms": made.generate_ms,
            "encode_ms": made.encode_ms,
            "pack_ms": pack_ms,
            "value_range": made.range,
            // Colours classified beforehand only approximate the picture of the samples.
            "lossy": made.value_error.is_none_or(|e| e > 0.0),
            "largest_value_error": made.value_error,
            "encoding_error": quality_json(made.quality.as_ref()),
        })
        .to_string())?;
    }
    Ok(())
}

/// What was lost, in 1/255 of a channel; `null` where nothing was encoded.
pub(super) fn quality_json(quality: Option<&Quality>) -> Value {
    quality.map_or(Value::Null, |q| {
        json!({
            "unit": "1/255", "psnr_db": q.psnr_db, "rmse": q.rmse,
            "largest": q.largest, "percentile_99_9": q.percentile_999,
        })
    })
}

/// Bytes of the samples as stored.
pub(super) fn sample_bytes(grid: &Grid) -> usize {
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
pub(super) fn extent(grid: &Grid) -> Result<Extent3, Failure> {
    let sizes = grid.extent().map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    Extent3::new(sizes).map_err(|e| Failure::Unfit(e.to_string()))
}

/// Texels, or blocks of them, of a grid; on the threads of the current pool.
pub(super) fn make(
    format: Format,
    grid: &Grid,
    transfer: &Transfer,
    extent: Extent3,
) -> Result<Made, Failure> {
    let begin = Instant::now();
    let (texels, range): (Vec<u8>, [f64; 2]) = if format.is_colour() {
        (colours(grid, transfer), grid.range())
    } else if format == Format::R16 {
        scalars_16(grid)
    } else {
        scalars_8(grid)
    };
    let generate_ms = ms(begin);
    let ktx2::TextureFormat::Block(block) = format.of_file() else {
        let value_error = (!format.is_colour()).then(|| value_error(grid, &texels, range));
        return Ok(Made { data: texels, range, generate_ms, encode_ms: 0.0, quality: None, value_error });
    };
    let begin = Instant::now();
    let broken = |e: &dyn std::error::Error| Failure::Other(e.to_string());
    let data = bc::encode_volume(block, &texels, extent).map_err(|e| broken(&e))?;
    let encode_ms = ms(begin);
    let decoded = bc::decode_volume(block, &data, extent).map_err(|e| broken(&e))?;
    let channels = block.channels();
    // BC1 keeps no opacity, so it is not asked about it.
    let which = if format == Format::Bc1 { 0..3 } else { 0..channels };
    let quality =
        quality::compare_channels(&texels, &decoded, channels, which, 255.0).map_err(|e| broken(&e))?;
    let value_error = (!format.is_colour()).then(|| value_error(grid, &decoded, range));
    Ok(Made { data, range, generate_ms, encode_ms, quality: Some(quality), value_error })
}

/// Largest distance between the values that 8- or 16-bit numbers over `range` stand for and the grid's.
/// Rounding of the comparison itself, 1e-9 of the range, does not count.
fn value_error(grid: &Grid, stored: &[u8], [low, high]: [f64; 2]) -> f64 {
    let wide = stored.len() > grid.samples().len();
    let part = |i: usize| {
        if wide {
            f64::from(u16::from_le_bytes([stored[2 * i], stored[2 * i + 1]])) / 65535.0
        } else {
            f64::from(stored[i]) / 255.0
        }
    };
    let apart = |i: usize| (low + (high - low) * part(i) - grid.value_at(i)).abs();
    let largest = (0..grid.samples().len()).into_par_iter().map(apart).reduce(|| 0.0, f64::max);
    if largest > 1e-9 * (high - low) { largest } else { 0.0 }
}

/// `size` bytes a voxel from its value, x fastest, in parallel.
fn fill(grid: &Grid, size: usize, write: impl Fn(f64, &mut [u8]) + Sync) -> Vec<u8> {
    const PIECE: usize = 1 << 14;
    let mut bytes = vec![0_u8; grid.samples().len() * size];
    bytes.par_chunks_mut(PIECE * size).enumerate().for_each(|(piece, out)| {
        for (i, texel) in out.chunks_exact_mut(size).enumerate() {
            write(grid.value_at(piece * PIECE + i), texel);
        }
    });
    bytes
}

/// Straight (not premultiplied) colour and opacity, 4 bytes a voxel.
fn colours(grid: &Grid, transfer: &Transfer) -> Vec<u8> {
    fill(grid, 4, |value, texel| {
        for (byte, component) in texel.iter_mut().zip(transfer.rgba(value)) {
            *byte = (component * 255.0).round() as u8;
        }
    })
}

fn scalars_8(grid: &Grid) -> (Vec<u8>, [f64; 2]) {
    let [low, high] = grid.range();
    let span = if high > low { high - low } else { 1.0 };
    let texels = fill(grid, 1, |v, texel| texel.fill(((v - low) / span * 255.0).round() as u8));
    (texels, [low, low + span])
}

/// One stored unit a step where the samples are whole numbers and few enough, so that nothing is lost.
fn scalars_16(grid: &Grid) -> (Vec<u8>, [f64; 2]) {
    let [low, high] = grid.range();
    let exact = grid.rescale().slope.abs() * 65535.0;
    let whole = grid.samples().is_integer() && high - low <= exact;
    let span = if whole { exact } else { high - low };
    let texels = fill(grid, 2, |v, texel| {
        texel.copy_from_slice(&(((v - low) / span * 65535.0).round() as u16).to_le_bytes());
    });
    (texels, [low, low + span])
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::render::volume::{Affine, Rescale, Samples};

    fn grid(samples: Samples) -> Grid {
        let rescale = Rescale { slope: 2.0, intercept: -1000.0 };
        Grid::new([samples.len(), 1, 1], samples, rescale, Affine::identity()).expect("grid")
    }

    fn word(texels: &[u8], i: usize) -> f64 {
        f64::from(u16::from_le_bytes([texels[2 * i], texels[2 * i + 1]]))
    }

    #[test]
    fn whole_numbers_go_through_16_bits_unchanged() {
        let grid = grid(Samples::I16(vec![-7, 0, 1, 32_000]));
        let (texels, [low, high]) = scalars_16(&grid);
        for i in 0..4 {
            let back = low + (high - low) * word(&texels, i) / 65535.0;
            assert!((back - grid.value_at(i)).abs() < 1e-9, "voxel {i}: {back}");
        }
    }

    #[test]
    fn floats_spread_over_all_16_bits() {
        let grid = grid(Samples::F32(vec![0.0, 0.25, 1.0, f32::NAN]));
        let (texels, range) = scalars_16(&grid);
        assert_eq!(range, [-1000.0, -998.0], "the values' own range");
        assert_eq!([word(&texels, 0), word(&texels, 2)], [0.0, 65535.0], "end to end");
        assert_eq!(word(&texels, 3), 0.0, "NaN is padding, the least value");
    }

    #[test]
    fn a_flat_volume_divides_by_nothing() {
        let (texels, range) = scalars_8(&grid(Samples::U8(vec![5; 4])));
        assert_eq!((texels, range), (vec![0; 4], [-990.0, -989.0]), "the value is the range's foot");
    }

    #[test]
    fn what_is_lost_is_said_in_the_datas_unit() {
        let samples = Samples::I16((0..4096).collect());
        let grid = Grid::new([16, 16, 16], samples, Rescale::default(), Affine::identity()).expect("grid");
        let transfer = presets::default_for(Some("CT"), grid.range());
        let lost = |format| {
            make(format, &grid, &transfer, extent(&grid).expect("extent")).expect("made").value_error
        };
        assert_eq!(lost(Format::R16), Some(0.0), "16 bits hold 4096 values");
        let eight = lost(Format::R8).expect("a scalar");
        assert!((7.9..8.1).contains(&eight), "half of 4095/255: {eight}");
        assert!(lost(Format::Bc4).expect("a scalar") >= eight, "blocks lose more");
        assert_eq!(lost(Format::Rgba8), None, "colours have no value");
    }

    #[test]
    fn the_bytes_do_not_depend_on_the_threads() {
        let samples = Samples::I16((0..20 * 12 * 9_i32).map(|i| (i * 7919 % 3000) as i16).collect());
        let grid = Grid::new([20, 12, 9], samples, Rescale::default(), Affine::identity()).expect("grid");
        let transfer = presets::default_for(Some("CT"), grid.range());
        let extent = extent(&grid).expect("extent");
        for format in [Format::Bc1, Format::Bc3, Format::Bc4, Format::Rgba8, Format::R8, Format::R16] {
            let with = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
                pool.install(|| make(format, &grid, &transfer, extent)).expect("made").data
            };
            let one = with(1);
            assert_eq!(one.len(), format.of_file().data_len(extent), "{} bytes", format.name());
            assert!(one == with(4), "{} differs", format.name());
        }
    }
}
