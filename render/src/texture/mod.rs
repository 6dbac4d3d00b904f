//! Volumes as 3D textures: which format, which box of the grid, and with what error.
//!
//! A texture holds a box of voxels, `texture_from_voxel` maps into its 0 to 1 over texel edges. Block
//! formats are stored as 4×4×1 blocks, slice by slice; their sides are padded to multiples of 4 by
//! repeating the last voxel, which is also what sampling past the edge gives.
//!
//! The steps of a time series come compressed: `packed` sends their bytes as they are where the hardware reads
//! them (BC1 of PVTC-TE and PVTC-SE), and decodes PVTC <S,T> on the device (`pvtc.wgsl`) or, on a software
//! adapter, with the CPU's decoder.

mod encode;
mod packed;
mod plan;
mod pvtc;
mod source;

use std::fmt;
use std::sync::Arc;

pub use packed::StepDecoder;
pub(crate) use plan::{Plan, TextureKey, is_colour};
pub use pvtc::decode_on_device;
pub(crate) use pvtc::gpu_data;
pub use source::{GridSource, SourceError};

use crate::gpu::{Gpu, GpuError};
use crate::scene::TextureFormat;
use crate::volume::{Affine, Grid, PackedFormat, PackedStep, Point, Vector};
use packed::PackedCache;

/// How the shader reads a texel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Reading {
    /// A value: the sum of the channels, weighted.
    Scalar {
        /// Of red, green, blue and alpha.
        weights: [f32; 4],
    },
    /// Three successive slices in red, green and blue.
    Stacked {
        /// Slices in all.
        slices: usize,
    },
    /// A pre-classified colour.
    Colour,
}

impl Reading {
    /// A value in one channel: 0 to 2 are red, green, blue.
    pub(crate) fn channel(channel: usize) -> Self {
        let mut weights = [0.0; 4];
        weights[channel] = 1.0;
        Self::Scalar { weights }
    }
}

/// A texture on the GPU, and what is known of it.
#[derive(Debug)]
pub(crate) struct VolumeTexture {
    pub(crate) reading: Reading,
    texture: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
    pub(crate) texture_from_voxel: Affine,
    /// `value = scale · texel + offset` for scalar formats, texel 0 to 1 (or the value itself for R32F).
    pub(crate) value_scale: f64,
    pub(crate) value_offset: f64,
    pub(crate) summary: TextureSummary,
}

/// What the texels of a texture are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stored {
    /// Samples or colours of a grid.
    Grid(TextureFormat),
    /// A step of a time series.
    Step(PackedFormat),
}

impl Stored {
    /// Whether texels are pre-classified colours, whose error is in 1/255.
    pub fn is_colour(self) -> bool {
        matches!(self, Self::Grid(format) if is_colour(format))
    }
}

impl fmt::Display for Stored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Grid(format) => format.fmt(f),
            Self::Step(format) => format.fmt(f),
        }
    }
}

/// One texture of a frame: what it costs and how far it is from the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureSummary {
    /// What it holds; its format may not be the one asked for.
    pub stored: Stored,
    /// Texels along x, y and z, padding included.
    pub extent: [u32; 3],
    /// Bytes in texture memory.
    pub bytes: u64,
    /// Largest error of a texel: in values (HU) for scalar formats; in 1/255 of a channel against the
    /// unrounded colour for pre-classified ones.
    pub max_error: f64,
    /// Peak signal-to-noise ratio of the texels, dB; the peak is the value range, or 255. Infinite where
    /// nothing is lost.
    pub psnr_db: f64,
    /// Time to make the texels from the samples, ms; measuring their error and upload not counted.
    pub generate_ms: f64,
}

impl VolumeTexture {
    /// Makes the texels and hands them to the device.
    fn new(gpu: &Gpu, plan: &Plan) -> Result<Self, GpuError> {
        let texels = encode::encode(plan)?;
        let format = match plan.key.format {
            TextureFormat::R32f => wgpu::TextureFormat::R32Float,
            TextureFormat::Bc4 => wgpu::TextureFormat::Bc4RUnorm,
            TextureFormat::Bc5 => wgpu::TextureFormat::Bc5RgUnorm,
            TextureFormat::Rgba8 => wgpu::TextureFormat::Rgba8Unorm,
            TextureFormat::Bc3 => wgpu::TextureFormat::Bc3RgbaUnorm,
            TextureFormat::Bc7 => wgpu::TextureFormat::Bc7RgbaUnorm,
            _ => wgpu::TextureFormat::R16Unorm,
        };
        let texture = create(gpu, format, texels.extent);
        write(gpu, &texture, &texels.bytes);
        gpu.check()?;
        Ok(Self {
            reading: texels.reading,
            view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            texture,
            texture_from_voxel: plan.texture_from_voxel(texels.extent),
            value_scale: texels.value_scale,
            value_offset: texels.value_offset,
            summary: TextureSummary {
                stored: Stored::Grid(plan.key.format),
                extent: texels.extent,
                bytes: texels.bytes.len() as u64,
                max_error: texels.max_error,
                psnr_db: texels.psnr_db,
                generate_ms: texels.generate_ms,
            },
        })
    }
}

/// An empty 3D texture of `extent` texels, whole blocks.
fn create(gpu: &Gpu, format: wgpu::TextureFormat, extent: [u32; 3]) -> wgpu::Texture {
    let [width, height, depth_or_array_layers] = extent;
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("volume.texture"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

/// Fills a texture with its texels or blocks, tightly packed, x fastest.
fn write(gpu: &Gpu, texture: &wgpu::Texture, bytes: &[u8]) {
    write_part(gpu, texture, wgpu::Origin3d::ZERO, texture.size(), bytes);
}

/// Writes the texels or blocks of a box of a texture, whole blocks, tightly packed, x fastest.
fn write_part(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    origin: wgpu::Origin3d,
    size: wgpu::Extent3d,
    bytes: &[u8],
) {
    gpu.count_call();
    let format = texture.format();
    let block = u32::from(format.is_compressed()) * 3 + 1;
    gpu.queue.write_texture(
        wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() },
        bytes,
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size.width / block * format.block_copy_size(None).unwrap_or(1)),
            rows_per_image: Some(size.height / block),
        },
        size,
    );
}

/// 0 to 1 over the edges of a texture of `cover` voxels, the first of which is voxel `low`.
fn texture_from_voxel(cover: [f64; 3], low: [f64; 3]) -> Affine {
    let column = |a: usize| {
        let mut v = Vector::zeros();
        v[a] = 1.0 / cover[a];
        v
    };
    let origin = Point::from([0, 1, 2].map(|a| (0.5 - low[a]) / cover[a]));
    // A diagonal of positive numbers has an inverse.
    Affine::from_columns(column(0), column(1), column(2), origin).unwrap_or_default()
}

/// Textures kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct TextureCache {
    kept: Vec<(TextureKey, Arc<VolumeTexture>)>,
    packed: PackedCache,
    sent: u64,
}

impl TextureCache {
    /// The texture of a plan: the one kept, or a new one.
    pub(crate) fn get(&mut self, gpu: &Gpu, plan: &Plan) -> Result<Arc<VolumeTexture>, GpuError> {
        if let Some((_, found)) = self.kept.iter().find(|(key, _)| key.is_same(&plan.key)) {
            return Ok(Arc::clone(found));
        }
        let made = Arc::new(VolumeTexture::new(gpu, plan)?);
        self.sent += 1;
        self.kept.push((plan.key.clone(), Arc::clone(&made)));
        Ok(made)
    }

    /// Puts `new` in the place of `old`, which it differs from only in the voxels from `touched[0]` to before
    /// `touched[1]`: textures of blocks get the blocks that hold them, the others are made anew when they are drawn.
    /// Returns the blocks sent, and the blocks that were not.
    pub(crate) fn replace(
        &mut self,
        gpu: &Gpu,
        old: &Arc<Grid>,
        new: &Arc<Grid>,
        touched: [[usize; 3]; 2],
    ) -> Result<[u64; 2], GpuError> {
        let mut sent = [0; 2];
        let mut kept = Vec::with_capacity(self.kept.len());
        for (mut key, texture) in self.kept.drain(..) {
            if Arc::ptr_eq(&key.grid, old) {
                key.grid = Arc::clone(new);
                let Some(patch) = encode::patch(&Plan { key: key.clone() }, old, touched)? else { continue };
                let (size, [x, y, z]) = (patch.size, patch.low);
                if !patch.blocks.is_empty() {
                    let [width, height, depth_or_array_layers] = size;
                    let box_size = wgpu::Extent3d { width, height, depth_or_array_layers };
                    write_part(gpu, &texture.texture, wgpu::Origin3d { x, y, z }, box_size, &patch.blocks);
                }
                let blocks = |size: [u32; 3]| size.iter().map(|&n| u64::from(n)).product::<u64>() / 16;
                let here = if patch.blocks.is_empty() { 0 } else { blocks(size) };
                sent = [sent[0] + here, sent[1] + blocks(texture.summary.extent) - here];
            }
            kept.push((key, texture));
        }
        self.kept = kept;
        gpu.check()?;
        Ok(sent)
    }

    /// The texture of a step: the one kept, or a new one.
    pub(crate) fn step(&mut self, gpu: &Gpu, step: &PackedStep) -> Result<Arc<VolumeTexture>, GpuError> {
        let (texture, is_new) = self.packed.get(gpu, step)?;
        self.sent += u64::from(is_new);
        Ok(texture)
    }

    /// Textures sent to the device since the last call.
    pub(crate) fn take_sent(&mut self) -> u64 {
        std::mem::take(&mut self.sent)
    }

    /// What decodes the steps from now on.
    pub(crate) fn set_decoder(&mut self, decoder: StepDecoder) {
        self.packed.set_decoder(decoder);
    }

    /// Lets go of everything.
    pub(crate) fn clear(&mut self) {
        self.kept.clear();
        self.packed.forget_unused();
    }

    /// Lets go of what nobody but the cache holds.
    pub(crate) fn forget_unused(&mut self) {
        self.kept.retain(|(_, t)| Arc::strong_count(t) > 1);
        self.packed.forget_unused();
    }
}
