//! From samples to texels, in parallel, with the error that it costs: [`compress::texture`] on a box of a grid.

use compress::bc::EncodeOptions;
use compress::bc::two_plane::{Scales, encode_two_planes};
use compress::texture::{Loss, Mapping, Patch, Source, TexelFormat};
use compress::{BlockFormat, Extent3};
use rayon::prelude::*;

use super::plan::{Plan, is_colour};
use super::{GridSource, Reading};
use crate::gpu::GpuError;
use crate::scene::TextureFormat;
use crate::volume::{Grid, Rescale, Samples};

/// The bytes of a texture and what they mean.
#[derive(Debug)]
pub(crate) struct Texels {
    pub(crate) bytes: Vec<u8>,
    /// Texels along each axis, padded to whole blocks.
    pub(crate) extent: [u32; 3],
    pub(crate) reading: Reading,
    pub(crate) value_scale: f64,
    pub(crate) value_offset: f64,
    pub(crate) max_error: f64,
    pub(crate) psnr_db: f64,
    /// From samples to texels, without the measuring of the error; ms.
    pub(crate) generate_ms: f64,
}

/// Makes the texels of a plan.
pub(crate) fn encode(plan: &Plan) -> Result<Texels, GpuError> {
    let begin = std::time::Instant::now();
    let grid = plan.key.grid.as_ref();
    let [low, high] = grid.range();
    let span = high - low;
    let ms = || begin.elapsed().as_secs_f64() * 1e3;
    if plan.key.format == TextureFormat::R32f {
        let bytes = values(plan).into_iter().flat_map(f32::to_le_bytes).collect();
        let rounding = low.abs().max(high.abs()) * f64::from(f32::EPSILON) / 2.0;
        let max_error = if exact_in_f32(grid) { 0.0 } else { rounding };
        // The mean square of a uniform error of at most `e` is e²/3.
        let psnr_db =
            if max_error > 0.0 { 20.0 * (span * 3.0_f64.sqrt() / max_error).log10() } else { f64::INFINITY };
        let extent = plan.texels().map(|n| n as u32);
        let (reading, value_scale, value_offset) = (Reading::channel(0), 1.0, 0.0);
        let generate_ms = ms();
        return Ok(Texels {
            bytes,
            extent,
            reading,
            value_scale,
            value_offset,
            max_error,
            psnr_db,
            generate_ms,
        });
    }
    if plan.key.format == TextureFormat::Bc5 {
        return two_planes(plan, begin);
    }
    let coarse;
    let stored = if plan.key.reduce == [1; 3] {
        GridSource::new(grid).map_err(failed)?
    } else {
        coarse = reduced(plan)?;
        GridSource::new(&coarse).map_err(failed)?
    };
    let (table, window);
    let mapping = match &plan.key.transfer {
        Some(transfer) if is_colour(plan.key.format) => {
            table = stored.table(transfer).map_err(failed)?;
            Mapping::Colours(&table)
        }
        _ => {
            window = stored.window([low, high]).map_err(failed)?;
            Mapping::Scalars(&window)
        }
    };
    let mut volume = stored.volume().map_err(failed)?;
    if plan.key.reduce == [1; 3] {
        let texels = Extent3::new(plan.texels().map(|n| n as u32)).map_err(failed)?;
        volume = volume.part(plan.key.low.map(|n| n as u32), texels).map_err(failed)?;
    }
    let source = Source::new(volume, mapping).map_err(failed)?;
    let as_blocks = |format| -> Result<(Vec<u8>, Loss, f64), GpuError> {
        let (bytes, _) = source.blocks(format, EncodeOptions::default()).map_err(failed)?;
        let ms = ms();
        let loss = source.loss_of_blocks(format, &bytes).map_err(failed)?;
        Ok((bytes, loss, ms))
    };
    let as_texels = |format| -> Result<(Vec<u8>, Loss, f64), GpuError> {
        let bytes = source.texels(format).map_err(failed)?;
        let ms = ms();
        Ok((bytes, source.loss_of_texels(format).map_err(failed)?, ms))
    };
    let (bytes, loss, generate_ms) = match plan.key.format {
        TextureFormat::Bc4 => as_blocks(BlockFormat::Bc4),
        TextureFormat::Bc3 => as_blocks(BlockFormat::Bc3),
        TextureFormat::Bc7 => as_blocks(BlockFormat::Bc7),
        TextureFormat::Rgba8 => as_texels(TexelFormat::Rgba8),
        _ => as_texels(TexelFormat::R16),
    }?;
    let mut extent = volume.extent().sizes();
    if matches!(plan.key.format, TextureFormat::Bc3 | TextureFormat::Bc4 | TextureFormat::Bc7) {
        extent = [extent[0].next_multiple_of(4), extent[1].next_multiple_of(4), extent[2]];
    }
    let (value_scale, value_offset, unit, peak) = match mapping {
        Mapping::Colours(_) => (1.0, 0.0, 1.0, 255.0),
        Mapping::Scalars(window) => {
            let [first, last] = stored.values(window, plan.key.format != TextureFormat::Bc4);
            (last - first, first, stored.unit(), span)
        }
    };
    let reading = if is_colour(plan.key.format) { Reading::Colour } else { Reading::channel(0) };
    Ok(Texels {
        bytes,
        extent,
        reading,
        value_scale,
        value_offset,
        max_error: loss.largest * unit,
        psnr_db: loss.psnr_db(peak / unit),
        generate_ms,
    })
}

/// A scalar in two planes: the sum of red and green, weighted, is the value, also between texels.
fn two_planes(plan: &Plan, begin: std::time::Instant) -> Result<Texels, GpuError> {
    let extent = Extent3::new(plan.texels().map(|n| n as u32)).map_err(failed)?;
    let mut range = plan.key.grid.range();
    if range[0] == range[1] {
        // One value is an end of a range that has a width, and so exact.
        range = if range[0] < 0.0 { [range[0], 1.0] } else { [-1.0, range[0]] };
    }
    let made = encode_two_planes(&values(plan), extent, range).map_err(failed)?;
    let Scales { offset, coarse, residual } = made.scales;
    let [x, y, z] = extent.sizes();
    Ok(Texels {
        bytes: made.blocks,
        extent: [x.next_multiple_of(4), y.next_multiple_of(4), z],
        reading: Reading::Scalar { weights: [1.0, (residual / coarse) as f32, 0.0, 0.0] },
        value_scale: coarse,
        value_offset: offset - 0.5 * residual,
        max_error: made.quality.largest,
        psnr_db: made.quality.psnr_db,
        generate_ms: begin.elapsed().as_secs_f64() * 1e3,
    })
}

/// The blocks of a plan's texture that hold any of the voxels from `touched[0]` to before `touched[1]` of its grid, in
/// texels of the texture; none where the texture is not of blocks or cannot keep its window, empty where it holds
/// none of them.
pub(crate) fn patch(plan: &Plan, old: &Grid, touched: [[usize; 3]; 2]) -> Result<Option<Patch>, GpuError> {
    let key = &plan.key;
    let format = match key.format {
        TextureFormat::Bc4 => BlockFormat::Bc4,
        TextureFormat::Bc3 => BlockFormat::Bc3,
        TextureFormat::Bc7 => BlockFormat::Bc7,
        _ => return Ok(None),
    };
    let grid = key.grid.as_ref();
    if key.reduce != [1; 3] || format == BlockFormat::Bc4 && grid.range() != old.range() {
        return Ok(None);
    }
    let start = [0, 1, 2].map(|a| touched[0][a].max(key.low[a]));
    let end = [0, 1, 2].map(|a| touched[1][a].min(key.high[a] + 1));
    if (0..3).any(|a| start[a] >= end[a]) {
        return Ok(Some(Patch { low: [0; 3], size: [0; 3], blocks: Vec::new() }));
    }
    let stored = GridSource::new(grid).map_err(failed)?;
    let (table, window);
    let mapping = if let Some(transfer) = &key.transfer {
        table = stored.table(transfer).map_err(failed)?;
        Mapping::Colours(&table)
    } else {
        window = stored.window(grid.range()).map_err(failed)?;
        Mapping::Scalars(&window)
    };
    let texels = Extent3::new(plan.texels().map(|n| n as u32)).map_err(failed)?;
    let part =
        stored.volume().and_then(|v| Ok(v.part(key.low.map(|n| n as u32), texels)?)).map_err(failed)?;
    let source = Source::new(part, mapping).map_err(failed)?;
    let within = |at: [usize; 3]| [0, 1, 2].map(|a| (at[a] - key.low[a]) as u32);
    let patch = source.blocks_of(format, EncodeOptions::default(), within(start)..within(end));
    patch.map(Some).map_err(failed)
}

fn exact_in_f32(grid: &Grid) -> bool {
    let [low, high] = grid.range();
    let rescale = grid.rescale();
    let whole = rescale.slope.fract() == 0.0 && rescale.intercept.fract() == 0.0;
    grid.samples().is_integer() && whole && low.abs().max(high.abs()) <= 16_777_216.0
}

/// A box that is drawn coarser: the mean of the voxels that each texel stands for.
fn reduced(plan: &Plan) -> Result<Grid, GpuError> {
    let place = *plan.key.grid.world_from_voxel();
    Grid::new(plan.texels(), Samples::F32(values(plan)), Rescale::default(), place).map_err(failed)
}

/// The values of the texels, x fastest, in parallel over rows.
fn values(plan: &Plan) -> Vec<f32> {
    let [nx, ny, nz] = plan.texels();
    let mut values = vec![0.0_f32; nx * ny * nz];
    values.par_chunks_mut(nx).enumerate().for_each(|(row, out)| {
        for (x, value) in out.iter_mut().enumerate() {
            *value = mean(plan, [x, row % ny, row / ny]) as f32;
        }
    });
    values
}

/// The value of a texel: the mean of the voxels it stands for.
fn mean(plan: &Plan, at: [usize; 3]) -> f64 {
    let key = &plan.key;
    let first = [0, 1, 2].map(|a| key.low[a] + at[a] * key.reduce[a]);
    let end = [0, 1, 2].map(|a| (first[a] + key.reduce[a]).min(key.high[a] + 1));
    let (mut sum, mut count) = (0.0, 0.0);
    for z in first[2]..end[2] {
        for y in first[1]..end[1] {
            for x in first[0]..end[0] {
                sum += key.grid.value(x, y, z);
                count += 1.0;
            }
        }
    }
    sum / count
}

fn failed(error: impl std::fmt::Display) -> GpuError {
    GpuError::Encode { reason: error.to_string() }
}
