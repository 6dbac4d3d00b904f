//! Volumes as 3D textures: which format, which box of the grid, and with what error.
//!
//! A texture holds a box of voxels, `texture_from_voxel` maps into its 0 to 1 over texel edges. Block
//! formats are stored as 4×4×1 blocks, slice by slice; their sides are padded to multiples of 4 by
//! repeating the last voxel, which is also what sampling past the edge gives.

mod encode;
mod plan;

use std::sync::Arc;

pub(crate) use plan::{Plan, TextureKey, is_colour};

use crate::gpu::{Gpu, GpuError};
use crate::scene::TextureFormat;
use crate::volume::Affine;

/// A texture on the GPU, and what is known of it.
#[derive(Debug)]
pub(crate) struct VolumeTexture {
    pub(crate) key: TextureKey,
    pub(crate) view: wgpu::TextureView,
    pub(crate) texture_from_voxel: Affine,
    /// `value = scale · texel + offset` for scalar formats, texel 0 to 1 (or the value itself for R32F).
    pub(crate) value_scale: f64,
    pub(crate) value_offset: f64,
    pub(crate) summary: TextureSummary,
}

/// One texture of a frame: what it costs and how far it is from the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureSummary {
    /// The format used, which may not be the one asked for.
    pub format: TextureFormat,
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
    /// Time to make the texels from the samples, ms; upload not counted.
    pub generate_ms: f64,
}

impl VolumeTexture {
    /// Makes the texels and hands them to the device.
    pub(crate) fn new(gpu: &Gpu, plan: &Plan) -> Result<Self, GpuError> {
        let start = std::time::Instant::now();
        let texels = encode::encode(plan)?;
        let generate_ms = start.elapsed().as_secs_f64() * 1e3;
        let [width, height, depth] = texels.extent;
        let format = match plan.key.format {
            TextureFormat::R32f => wgpu::TextureFormat::R32Float,
            TextureFormat::Bc4 => wgpu::TextureFormat::Bc4RUnorm,
            TextureFormat::Rgba8 => wgpu::TextureFormat::Rgba8Unorm,
            TextureFormat::Bc3 => wgpu::TextureFormat::Bc3RgbaUnorm,
            _ => wgpu::TextureFormat::R16Unorm,
        };
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("volume.texture"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: depth },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let block = u32::from(format.is_compressed()) * 3 + 1;
        let row = width / block * format.block_copy_size(None).unwrap_or(1);
        gpu.queue.write_texture(
            texture.as_image_copy(),
            &texels.bytes,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(row),
                rows_per_image: Some(height / block),
            },
            texture.size(),
        );
        gpu.check()?;
        Ok(Self {
            key: plan.key.clone(),
            view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            texture_from_voxel: plan.texture_from_voxel(texels.extent),
            value_scale: texels.value_scale,
            value_offset: texels.value_offset,
            summary: TextureSummary {
                format: plan.key.format,
                extent: texels.extent,
                bytes: texels.bytes.len() as u64,
                max_error: texels.max_error,
                psnr_db: texels.psnr_db,
                generate_ms,
            },
        })
    }
}

/// Textures kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct TextureCache {
    kept: Vec<Arc<VolumeTexture>>,
}

impl TextureCache {
    /// The texture of a plan: the one kept, or a new one.
    pub(crate) fn get(&mut self, gpu: &Gpu, plan: &Plan) -> Result<Arc<VolumeTexture>, GpuError> {
        if let Some(found) = self.kept.iter().find(|t| t.key.is_same(&plan.key)) {
            return Ok(Arc::clone(found));
        }
        let made = Arc::new(VolumeTexture::new(gpu, plan)?);
        self.kept.push(Arc::clone(&made));
        Ok(made)
    }

    /// Lets go of what nobody but the cache holds.
    pub(crate) fn forget_unused(&mut self) {
        self.kept.retain(|t| Arc::strong_count(t) > 1);
    }
}
