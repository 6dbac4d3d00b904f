//! From samples to texels, in parallel, with the error that it costs: [`compress::texture`] on a box of a grid.

use std::borrow::Cow;

use compress::bc::EncodeOptions;
use compress::texture::{ColourPoint, ColourTable, Loss, Mapping, SampleKind, Source, TexelFormat, Volume, Window};
use compress::{BlockFormat, Extent3, texture};
use rayon::prelude::*;

use super::plan::{Plan, is_colour};
use crate::gpu::GpuError;
use crate::scene::TextureFormat;
use crate::volume::{Grid, Samples, Transfer};

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
    /// From samples to texels, without the measuring of the error; ms.
    pub(crate) generate_ms: f64,
}

/// Samples in a type that the encoders take, as the grid has them or converted, and where the box lies in them.
struct Stored<'a> {
    samples: Typed<'a>,
    extent: Extent3,
    low: [u32; 3],
    texels: Extent3,
    /// `value = slope · stored + intercept`.
    slope: f64,
    intercept: f64,
    padding: f64,
}

enum Typed<'a> {
    U8(&'a [u8]),
    I16(Cow<'a, [i16]>),
    U16(Cow<'a, [u16]>),
    F32(Cow<'a, [f32]>),
}

impl Typed<'_> {
    fn borrowed(&self) -> texture::Samples<'_> {
        match self {
            Self::U8(s) => texture::Samples::U8(s),
            Self::I16(s) => texture::Samples::I16(s),
            Self::U16(s) => texture::Samples::U16(s),
            Self::F32(s) => texture::Samples::F32(s),
        }
    }
}

impl<'a> Stored<'a> {
    fn new(plan: &'a Plan) -> Result<Self, GpuError> {
        let key = &plan.key;
        let grid = key.grid.as_ref();
        let texels = extent3(plan.texels())?;
        if key.reduce != [1; 3] {
            let samples = Typed::F32(Cow::Owned(reduced(plan)));
            let (extent, low) = (texels, [0; 3]);
            return Ok(Self { samples, extent, low, texels, slope: 1.0, intercept: 0.0, padding: grid.padding() });
        }
        let rescale = grid.rescale();
        Ok(Self {
            samples: typed(grid),
            extent: extent3(grid.extent())?,
            low: key.low.map(|n| n as u32),
            texels,
            slope: rescale.slope,
            intercept: rescale.intercept,
            padding: (grid.padding() - rescale.intercept) / rescale.slope,
        })
    }

    fn volume(&self) -> Result<Volume<'_>, GpuError> {
        let whole = Volume::new(self.samples.borrowed(), self.extent).map_err(failed)?;
        whole.part(self.low, self.texels).map_err(failed)
    }

    fn kind(&self) -> SampleKind {
        self.samples.borrowed().kind()
    }

    fn stored(&self, value: f64) -> f64 {
        (value - self.intercept) / self.slope
    }

    /// The transfer function in stored values.
    fn table(&self, transfer: &Transfer) -> Result<ColourTable, GpuError> {
        let point = |p: &crate::volume::ControlPoint| ColourPoint { value: self.stored(p.value), rgba: p.rgba };
        let mut points: Vec<ColourPoint> = transfer.points().iter().map(point).collect();
        if self.slope < 0.0 {
            points.reverse();
        }
        ColourTable::new(&points, self.kind(), self.padding).map_err(failed)
    }

    /// All values of the grid.
    fn window(&self, grid: &Grid) -> Result<Window, GpuError> {
        let ends = grid.range().map(|v| self.stored(v));
        Window::new([ends[0].min(ends[1]), ends[0].max(ends[1])], self.kind(), self.padding).map_err(failed)
    }
}

/// Makes the texels of a plan.
pub(crate) fn encode(plan: &Plan) -> Result<Texels, GpuError> {
    let begin = std::time::Instant::now();
    let grid = plan.key.grid.as_ref();
    let [low, high] = grid.range();
    let span = high - low;
    let ms = || begin.elapsed().as_secs_f64() * 1e3;
    if plan.key.format == TextureFormat::R32f {
        let bytes = floats(plan);
        let rounding = low.abs().max(high.abs()) * f64::from(f32::EPSILON) / 2.0;
        let max_error = if exact_in_f32(grid) { 0.0 } else { rounding };
        // The mean square of a uniform error of at most `e` is e²/3.
        let psnr_db = if max_error > 0.0 {
            20.0 * (span * 3.0_f64.sqrt() / max_error).log10()
        } else {
            f64::INFINITY
        };
        let extent = plan.texels().map(|n| n as u32);
        let (value_scale, value_offset) = (1.0, 0.0);
        return Ok(Texels { bytes, extent, value_scale, value_offset, max_error, psnr_db, generate_ms: ms() });
    }
    let stored = Stored::new(plan)?;
    let (table, window);
    let mapping = match &plan.key.transfer {
        Some(transfer) if is_colour(plan.key.format) => {
            table = stored.table(transfer)?;
            Mapping::Colours(&table)
        }
        _ => {
            window = stored.window(grid)?;
            Mapping::Scalars(&window)
        }
    };
    let source = Source::new(stored.volume()?, mapping).map_err(failed)?;
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
    let mut extent = stored.texels.sizes();
    if matches!(plan.key.format, TextureFormat::Bc3 | TextureFormat::Bc4 | TextureFormat::Bc7) {
        extent = [extent[0].next_multiple_of(4), extent[1].next_multiple_of(4), extent[2]];
    }
    let (value_scale, value_offset, unit, peak) = match mapping {
        Mapping::Colours(_) => (1.0, 0.0, 1.0, 255.0),
        Mapping::Scalars(window) => {
            let domain = window.domain();
            let first = domain.value(0);
            let length = if plan.key.format == TextureFormat::Bc4 {
                window.range()[1] - first
            } else {
                // A texel of 16 bits is the index itself, of 65 536 there could be.
                domain.step() * 65535.0
            };
            let scale = stored.slope * if length > 0.0 { length } else { 1.0 };
            (scale, stored.slope * first + stored.intercept, stored.slope.abs(), span)
        }
    };
    Ok(Texels {
        bytes,
        extent,
        value_scale,
        value_offset,
        max_error: loss.largest * unit,
        psnr_db: loss.psnr_db(peak / unit),
        generate_ms,
    })
}

fn extent3(extent: [usize; 3]) -> Result<Extent3, GpuError> {
    Extent3::new(extent.map(|n| u32::try_from(n).unwrap_or(u32::MAX))).map_err(failed)
}

fn exact_in_f32(grid: &Grid) -> bool {
    let [low, high] = grid.range();
    let rescale = grid.rescale();
    let whole = rescale.slope.fract() == 0.0 && rescale.intercept.fract() == 0.0;
    grid.samples().is_integer() && whole && low.abs().max(high.abs()) <= 16_777_216.0
}

/// The samples of a grid in a type that encoders take; whole numbers stay whole where 16 bits hold them.
fn typed(grid: &Grid) -> Typed<'_> {
    let rescale = grid.rescale();
    let ends = grid.range().map(|v| ((v - rescale.intercept) / rescale.slope).round());
    let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let narrow = |value: f64| value as i16;
    match grid.samples() {
        Samples::U8(s) => Typed::U8(s),
        Samples::I16(s) => Typed::I16(Cow::Borrowed(s)),
        Samples::U16(s) => Typed::U16(Cow::Borrowed(s)),
        Samples::F32(s) => Typed::F32(Cow::Borrowed(s)),
        Samples::I8(s) => Typed::I16(s.par_iter().map(|&v| i16::from(v)).collect::<Vec<_>>().into()),
        Samples::I32(s) if low >= -32768.0 && high <= 32767.0 => {
            Typed::I16(s.par_iter().map(|&v| narrow(v.into())).collect::<Vec<_>>().into())
        }
        Samples::U32(s) if high <= 65535.0 => {
            Typed::U16(s.par_iter().map(|&v| v as u16).collect::<Vec<_>>().into())
        }
        Samples::I32(s) => Typed::F32(s.par_iter().map(|&v| v as f32).collect::<Vec<_>>().into()),
        Samples::U32(s) => Typed::F32(s.par_iter().map(|&v| v as f32).collect::<Vec<_>>().into()),
        Samples::F64(s) => Typed::F32(s.par_iter().map(|&v| v as f32).collect::<Vec<_>>().into()),
    }
}

/// The values of the texels of a box that is drawn coarser: means of the voxels that each stands for.
fn reduced(plan: &Plan) -> Vec<f32> {
    let [nx, ny, nz] = plan.texels();
    let mut values = vec![0.0; nx * ny * nz];
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

/// The values as 32-bit floats, x fastest.
fn floats(plan: &Plan) -> Vec<u8> {
    let [nx, ny, nz] = plan.texels();
    let mut bytes = vec![0_u8; nx * ny * nz * 4];
    bytes.par_chunks_mut(nx * 4).enumerate().for_each(|(row, out)| {
        for (x, texel) in out.chunks_exact_mut(4).enumerate() {
            texel.copy_from_slice(&(mean(plan, [x, row % ny, row / ny]) as f32).to_le_bytes());
        }
    });
    bytes
}

fn failed(error: impl std::fmt::Display) -> GpuError {
    GpuError::Encode { reason: error.to_string() }
}
