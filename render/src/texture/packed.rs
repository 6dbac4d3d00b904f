//! Textures of the steps of a time series, from their compressed bytes.
//!
//! | format | texture | who decodes |
//! |---|---|---|
//! | raw | R8, R16 | nobody |
//! | PVTC-TE | BC1, one for three steps: a channel each | the texture hardware |
//! | PVTC-SE | BC1, a third of the slices | the texture hardware; slices are mixed in the shader |
//! | PVTC <S,T> | R8 | a compute shader, or the CPU |
//!
//! Playing makes one texture after the other of the same size, so those let go are filled again: a new one costs
//! its pages and a clear.

use std::sync::Arc;
use std::time::Instant;

use compress::pvtc::packed::{self, Packing};
use compress::{Extent3, pvtc};

use super::pvtc::Decoder;
use super::{Reading, Stored, TextureSummary, VolumeTexture, create, texture_from_voxel, write};
use crate::gpu::{Gpu, GpuError};
use crate::volume::{PackedFormat, PackedStep};

/// Textures kept to be filled again.
const SPARE: usize = 3;

/// What decodes PVTC <S,T>. Both give the same bytes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum StepDecoder {
    /// The device, unless it is software: then the CPU's decoder is the shorter way.
    #[default]
    Auto,
    /// A compute shader, one invocation a sub-volume; the CPU where the bytes are more than a binding holds.
    Device,
    /// The CPU's decoder, and the decoded samples are sent.
    Cpu,
}

/// A step's texture, kept while it is in use.
#[derive(Debug)]
struct Kept {
    step: PackedStep,
    made: Arc<VolumeTexture>,
}

/// Textures of steps.
#[derive(Debug, Default)]
pub(super) struct PackedCache {
    kept: Vec<Kept>,
    spare: Vec<wgpu::Texture>,
    choice: StepDecoder,
    decoder: Option<Decoder>,
    /// Samples decoded on the CPU, kept for the next step's.
    samples: Vec<u8>,
}

impl PackedCache {
    pub(super) fn set_decoder(&mut self, choice: StepDecoder) {
        self.choice = choice;
    }

    /// The texture of a step, and whether texels had to be sent for it.
    pub(super) fn get(
        &mut self,
        gpu: &Gpu,
        step: &PackedStep,
    ) -> Result<(Arc<VolumeTexture>, bool), GpuError> {
        if let Some(found) = self.kept.iter().find(|k| k.step.is_same(step)) {
            return Ok((Arc::clone(&found.made), false));
        }
        let begin = Instant::now();
        let form = Form::new(gpu, step);
        // The three steps of PVTC-TE lie in one texture.
        let shared = self.kept.iter().find(|k| form.is_shared && k.step.shares_bytes(step));
        let (texture, is_new) = if let Some(kept) = shared {
            (kept.made.texture.clone(), false)
        } else {
            let texture = self.empty(gpu, &form);
            self.fill(gpu, step, &form, &texture)?;
            (texture, true)
        };
        let made = Arc::new(form.texture(step, &texture, begin));
        gpu.check()?;
        self.kept.push(Kept { step: step.clone(), made: Arc::clone(&made) });
        Ok((made, is_new))
    }

    /// Lets go of what nobody but the cache holds; the textures may be filled again.
    pub(super) fn forget_unused(&mut self) {
        let (kept, unused): (Vec<Kept>, Vec<Kept>) =
            self.kept.drain(..).partition(|k| Arc::strong_count(&k.made) > 1);
        for old in unused {
            let known =
                kept.iter().map(|k| &k.made.texture).chain(&self.spare).any(|t| *t == old.made.texture);
            if !known {
                self.spare.push(old.made.texture.clone());
            }
        }
        self.kept = kept;
        let surplus = self.spare.len().saturating_sub(SPARE);
        self.spare.drain(..surplus);
    }

    fn empty(&mut self, gpu: &Gpu, form: &Form) -> wgpu::Texture {
        let [width, height, depth_or_array_layers] = form.texels;
        let size = wgpu::Extent3d { width, height, depth_or_array_layers };
        let fits = |t: &wgpu::Texture| t.format() == form.format && t.size() == size;
        match self.spare.iter().position(fits) {
            Some(at) => self.spare.swap_remove(at),
            None => create(gpu, form.format, form.texels),
        }
    }

    fn fill(
        &mut self,
        gpu: &Gpu,
        step: &PackedStep,
        form: &Form,
        texture: &wgpu::Texture,
    ) -> Result<(), GpuError> {
        match (form.source, step.format()) {
            (Source::Bytes, _) => write(gpu, texture, step.bytes()),
            (Source::Floats, _) => {
                let (words, _) = step.bytes().as_chunks::<2>();
                let float = |w: &[u8; 2]| (f32::from(u16::from_le_bytes(*w)) / 65535.0).to_le_bytes();
                write(gpu, texture, &words.iter().flat_map(float).collect::<Vec<u8>>());
            }
            (Source::Decoded, PackedFormat::Pvtc { s, t }) => {
                let layout = pvtc::Layout::new(s, t).map_err(failed)?;
                let extent = extent(step)?;
                let is_long = step.bytes().len() as u64 > gpu.caps().storage_bytes;
                let software = self.choice == StepDecoder::Auto && gpu.caps().software;
                if self.choice == StepDecoder::Cpu || software || is_long {
                    self.samples.resize(extent.voxels(), 0);
                    pvtc::decode_step(layout, step.bytes(), extent, step.step(), &mut self.samples)
                        .map_err(failed)?;
                    write(gpu, texture, &self.samples);
                } else {
                    let decoder = match &mut self.decoder {
                        Some(decoder) => decoder,
                        none => none.insert(Decoder::new(gpu)?),
                    };
                    decoder.decode(gpu, layout, step, extent, texture);
                }
            }
            (Source::Decoded, format) => {
                let packing = if format == PackedFormat::Te { Packing::Te } else { Packing::Se };
                let extent = extent(step)?;
                self.samples.resize(extent.voxels(), 0);
                packed::decode_packed_step(packing, step.bytes(), extent, step.step(), &mut self.samples)
                    .map_err(failed)?;
                write(gpu, texture, &self.samples);
            }
        }
        Ok(())
    }
}

/// Where texels come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    /// The bytes are the texels, or blocks of them.
    Bytes,
    /// 16-bit numbers, for a device without such textures.
    Floats,
    /// The bytes must be decoded to one byte a voxel.
    Decoded,
}

/// What the texture of a step is like.
#[derive(Debug)]
struct Form {
    format: wgpu::TextureFormat,
    texels: [u32; 3],
    reading: Reading,
    source: Source,
    /// Whether all steps in the bytes lie in one texture.
    is_shared: bool,
}

impl Form {
    fn new(gpu: &Gpu, step: &PackedStep) -> Self {
        let [x, y, z] = step.extent().map(|n| n as u32);
        let (bc, norm16) = (gpu.caps().bc_3d, gpu.caps().norm16);
        let plain = Reading::channel(0);
        let decoded = Self {
            format: wgpu::TextureFormat::R8Unorm,
            texels: [x, y, z],
            reading: plain,
            source: Source::Decoded,
            is_shared: false,
        };
        let blocks = |layers, reading, is_shared| Self {
            format: wgpu::TextureFormat::Bc1RgbaUnorm,
            texels: [x.next_multiple_of(4), y.next_multiple_of(4), layers],
            reading,
            source: Source::Bytes,
            is_shared,
        };
        match step.format() {
            PackedFormat::R8 => Self { source: Source::Bytes, ..decoded },
            PackedFormat::R16 if norm16 => {
                Self { format: wgpu::TextureFormat::R16Unorm, source: Source::Bytes, ..decoded }
            }
            PackedFormat::R16 => {
                Self { format: wgpu::TextureFormat::R32Float, source: Source::Floats, ..decoded }
            }
            PackedFormat::Te if bc => blocks(z, Reading::channel(step.step()), true),
            PackedFormat::Se if bc => blocks(z.div_ceil(3), Reading::Stacked { slices: z as usize }, false),
            PackedFormat::Pvtc { .. } | PackedFormat::Te | PackedFormat::Se => decoded,
        }
    }

    fn texture(&self, step: &PackedStep, texture: &wgpu::Texture, begin: Instant) -> VolumeTexture {
        let mut cover = self.texels.map(f64::from);
        if let Reading::Stacked { slices } = self.reading {
            cover[2] = slices as f64;
        }
        let (max_error, psnr_db) = step.error();
        let texels: u64 = self.texels.iter().map(|&n| u64::from(n)).product();
        let bytes = match self.format.block_copy_size(None) {
            Some(size) if self.format.is_compressed() => texels / 16 * u64::from(size),
            size => texels * u64::from(size.unwrap_or(1)),
        };
        VolumeTexture {
            reading: self.reading,
            texture: texture.clone(),
            view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            texture_from_voxel: texture_from_voxel(cover, [0.0; 3]),
            value_scale: step.rescale().slope * step.top(),
            value_offset: step.rescale().intercept,
            summary: TextureSummary {
                stored: Stored::Step(step.format()),
                extent: self.texels,
                bytes,
                max_error,
                psnr_db,
                generate_ms: begin.elapsed().as_secs_f64() * 1e3,
            },
        }
    }
}

fn extent(step: &PackedStep) -> Result<Extent3, GpuError> {
    Extent3::new(step.extent().map(|n| n as u32)).map_err(failed)
}

fn failed(error: impl std::fmt::Display) -> GpuError {
    GpuError::Encode { reason: error.to_string() }
}
