//! From samples to texels, in parallel, with the error that it costs.

use compress::{BlockFormat, Extent3, bc};
use rayon::prelude::*;

use super::plan::Plan;
use crate::gpu::GpuError;
use crate::scene::TextureFormat;
use crate::volume::{Grid, Transfer};

/// The bytes of a texture and what they mean.
#[derive(Debug)]
pub(crate) struct Texels {
    pub(crate) bytes: Vec<u8>,
    /// Texels along each axis, padded to whole blocks.
    pub(crate) extent: [u32; 3],
    pub(crate) value_scale: f64,
    pub(crate) value_offset: f64,
    pub(crate) max_error: f64,
    pub(crate) psnr_db: f64,
}

pub(crate) fn encode(plan: &Plan) -> Result<Texels, GpuError> {
    let key = &plan.key;
    let [low, high] = key.grid.range();
    let span = high - low;
    match (key.format, key.transfer.as_deref()) {
        (TextureFormat::R32f, _) => {
            let bytes = fill(plan, 4, |v, out| out.copy_from_slice(&(v as f32).to_le_bytes()));
            let rounding = low.abs().max(high.abs()) * f64::from(f32::EPSILON) / 2.0;
            let max_error = if exact_in_f32(&key.grid) { 0.0 } else { rounding };
            Ok(scalar(plan, bytes, 1.0, 0.0, max_error, span))
        }
        (TextureFormat::Bc4, _) => {
            let scale = if span > 0.0 { span } else { 1.0 };
            let raw = fill(plan, 1, |v, out| out[0] = unorm(v, low, scale, 255.0) as u8);
            let (bytes, extent) = blocks(plan, BlockFormat::Bc4, &raw)?;
            let decoded = decode(plan, BlockFormat::Bc4, &bytes)?;
            let (max_error, psnr_db) =
                scalar_error(plan, span, |i| low + scale * f64::from(decoded[i]) / 255.0);
            Ok(Texels { bytes, extent, value_scale: scale, value_offset: low, max_error, psnr_db })
        }
        (TextureFormat::Rgba8, Some(transfer)) => {
            let bytes = colours(plan, transfer);
            let (max_error, psnr_db) = colour_error(plan, transfer, &bytes);
            let extent = plan.texels().map(|n| n as u32);
            Ok(Texels { bytes, extent, value_scale: 1.0, value_offset: 0.0, max_error, psnr_db })
        }
        (TextureFormat::Bc3, Some(transfer)) => {
            let (bytes, extent) = blocks(plan, BlockFormat::Bc3, &colours(plan, transfer))?;
            let decoded = decode(plan, BlockFormat::Bc3, &bytes)?;
            let (max_error, psnr_db) = colour_error(plan, transfer, &decoded);
            Ok(Texels { bytes, extent, value_scale: 1.0, value_offset: 0.0, max_error, psnr_db })
        }
        _ => {
            // One stored unit a step where the samples are whole numbers and few enough: nothing is lost.
            let unit = key.grid.rescale().slope.abs();
            let whole = key.grid.samples().is_integer() && span <= unit * 65535.0 && key.reduce == [1; 3];
            let scale = if whole {
                unit * 65535.0
            } else if span > 0.0 {
                span
            } else {
                1.0
            };
            let bytes = fill(plan, 2, |v, out| {
                out.copy_from_slice(&(unorm(v, low, scale, 65535.0) as u16).to_le_bytes());
            });
            let max_error = if whole { 0.0 } else { scale / 131_070.0 };
            Ok(scalar(plan, bytes, scale, low, max_error, span))
        }
    }
}

/// A value as a whole number of `steps` over `scale` from `low`.
fn unorm(v: f64, low: f64, scale: f64, steps: f64) -> f64 {
    ((v - low) / scale * steps).round().clamp(0.0, steps)
}

fn exact_in_f32(grid: &Grid) -> bool {
    let [low, high] = grid.range();
    let rescale = grid.rescale();
    let whole = rescale.slope.fract() == 0.0 && rescale.intercept.fract() == 0.0;
    grid.samples().is_integer() && whole && low.abs().max(high.abs()) <= 16_777_216.0
}

/// A scalar format whose error is known without looking: uniform rounding.
fn scalar(plan: &Plan, bytes: Vec<u8>, scale: f64, offset: f64, max_error: f64, span: f64) -> Texels {
    // The mean square of a uniform error of at most `e` is e²/3.
    let psnr_db =
        if max_error > 0.0 { 20.0 * (span * 3.0_f64.sqrt() / max_error).log10() } else { f64::INFINITY };
    let extent = plan.texels().map(|n| n as u32);
    Texels { bytes, extent, value_scale: scale, value_offset: offset, max_error, psnr_db }
}

/// The value of a texel: the mean of the voxels it stands for.
fn value(plan: &Plan, at: [usize; 3]) -> f64 {
    let key = &plan.key;
    let first = [0, 1, 2].map(|a| key.low[a] + at[a] * key.reduce[a]);
    if key.reduce == [1; 3] {
        return key.grid.value(first[0], first[1], first[2]);
    }
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

/// Texels of `size` bytes each from the value of each, x fastest, in parallel over rows.
fn fill(plan: &Plan, size: usize, write: impl Fn(f64, &mut [u8]) + Sync) -> Vec<u8> {
    let [nx, ny, nz] = plan.texels();
    let mut bytes = vec![0_u8; nx * ny * nz * size];
    bytes.par_chunks_mut(nx * size).enumerate().for_each(|(row, out)| {
        let (y, z) = (row % ny, row / ny);
        for (x, texel) in out.chunks_exact_mut(size).enumerate() {
            write(value(plan, [x, y, z]), texel);
        }
    });
    bytes
}

/// Straight (not premultiplied) colour: the function has a colour where it is clear, too, so that
/// interpolation towards clear voxels brings no dark fringe.
fn colours(plan: &Plan, transfer: &Transfer) -> Vec<u8> {
    fill(plan, 4, |v, out| {
        for (byte, c) in out.iter_mut().zip(transfer.rgba(v)) {
            *byte = (c * 255.0).round() as u8;
        }
    })
}

fn failed(error: impl std::fmt::Display) -> GpuError {
    GpuError::Encode { reason: error.to_string() }
}

fn blocks(plan: &Plan, format: BlockFormat, raw: &[u8]) -> Result<(Vec<u8>, [u32; 3]), GpuError> {
    let texels = plan.texels().map(|n| n as u32);
    let bytes = bc::encode_volume(format, raw, Extent3::new(texels).map_err(failed)?).map_err(failed)?;
    let [x, y, z] = texels;
    Ok((bytes, [x.next_multiple_of(4), y.next_multiple_of(4), z]))
}

fn decode(plan: &Plan, format: BlockFormat, bytes: &[u8]) -> Result<Vec<u8>, GpuError> {
    let texels = plan.texels().map(|n| n as u32);
    bc::decode_volume(format, bytes, Extent3::new(texels).map_err(failed)?).map_err(failed)
}

/// Largest error and PSNR over all texels; `pair` gives a texel's sum of squares and largest error from its
/// position and true value.
fn error_over(
    plan: &Plan,
    peak: f64,
    per_texel: f64,
    pair: impl Fn(usize, f64) -> (f64, f64) + Sync,
) -> (f64, f64) {
    let [nx, ny, nz] = plan.texels();
    let (square, max) = (0..nx * ny * nz)
        .into_par_iter()
        .with_min_len(4096)
        .map(|i| pair(i, value(plan, [i % nx, i / nx % ny, i / (nx * ny)])))
        .reduce(|| (0.0, 0.0), |a, b| (a.0 + b.0, a.1.max(b.1)));
    let count = (nx * ny * nz) as f64 * per_texel;
    let psnr_db = if square > 0.0 { 10.0 * (peak * peak * count / square).log10() } else { f64::INFINITY };
    (max, psnr_db)
}

fn scalar_error(plan: &Plan, span: f64, decoded: impl Fn(usize) -> f64 + Sync) -> (f64, f64) {
    error_over(plan, span, 1.0, |i, v| {
        let d = (decoded(i) - v).abs();
        (d * d, d)
    })
}

/// Of premultiplied colour and opacity: the colour of a clear texel is no error.
fn colour_error(plan: &Plan, transfer: &Transfer, decoded: &[u8]) -> (f64, f64) {
    error_over(plan, 255.0, 4.0, |i, v| {
        let truth = transfer.rgba(v);
        let found: [f64; 4] = std::array::from_fn(|c| f64::from(decoded[4 * i + c]) / 255.0);
        let mut sum = (0.0, 0.0_f64);
        for c in 0..4 {
            let weigh = |p: [f64; 4]| if c == 3 { p[3] } else { p[c] * p[3] };
            let d = (weigh(found) - weigh(truth)).abs() * 255.0;
            sum = (sum.0 + d * d, sum.1.max(d));
        }
        sum
    })
}
