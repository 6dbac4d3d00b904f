//! From the device's memory to ours.

use super::{Gpu, GpuError};

/// The first `bytes` of a buffer with `COPY_SRC`, once all submitted work is done.
///
/// # Errors
/// What the device reports.
pub(crate) fn read_buffer(gpu: &Gpu, buffer: &wgpu::Buffer, bytes: u64) -> Result<Vec<u8>, GpuError> {
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback.staging"),
        size: bytes,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, bytes);
    gpu.submit(Some(encoder));
    map(gpu, &staging)
}

/// The whole of a 2D float RGBA texture with `COPY_SRC`, rows from the top. `texel` is its bytes a texel.
///
/// # Errors
/// What the device reports.
pub(crate) fn read_texture(gpu: &Gpu, texture: &wgpu::Texture, texel: u32) -> Result<Vec<u8>, GpuError> {
    let (width, height) = (texture.width(), texture.height());
    let row = width * texel;
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback.picture"),
        size: u64::from(padded) * u64::from(height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &staging,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: Some(height),
            },
        },
        texture.size(),
    );
    gpu.submit(Some(encoder));
    let mut bytes = map(gpu, &staging)?;
    let (row, padded) = (row as usize, padded as usize);
    for y in 0..height as usize {
        bytes.copy_within(y * padded..y * padded + row, y * row);
    }
    bytes.truncate(row * height as usize);
    Ok(bytes)
}

fn map(gpu: &Gpu, staging: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
    // The outcome of the mapping is seen below: a range that is not mapped is an error there.
    staging.map_async(wgpu::MapMode::Read, .., |_| {});
    gpu.wait()?;
    let lost = |e: wgpu::MapRangeError| GpuError::Lost { reason: e.to_string() };
    let view = staging.get_mapped_range(..).map_err(lost)?;
    Ok(view.to_vec())
}
