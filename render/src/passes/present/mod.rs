//! The accumulated picture over its background, as display values for a window.

use crate::gpu::{Gpu, GpuError};
use crate::shader;

/// Format of the display texture.
pub(crate) const DISPLAY: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

#[derive(Debug)]
pub(crate) struct Present {
    pipeline: wgpu::RenderPipeline,
    picture_layout: wgpu::BindGroupLayout,
}

impl Present {
    pub(crate) fn new(gpu: &Gpu, frame_layout: &wgpu::BindGroupLayout) -> Result<Self, GpuError> {
        let picture_layout = crate::target::picture_layout(gpu);
        let pipeline = crate::target::fullscreen_pipeline(
            gpu,
            "present.pipeline",
            &shader::module(&gpu.device, "passes/present/present.wgsl"),
            &[Some(frame_layout), Some(&picture_layout)],
            Some(DISPLAY),
        );
        gpu.check()?;
        Ok(Self { pipeline, picture_layout })
    }

    pub(crate) fn draw(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::BindGroup,
        picture: &wgpu::TextureView,
        display: &wgpu::TextureView,
    ) {
        let bound = crate::target::bind_picture(gpu, &self.picture_layout, picture);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("present"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: display,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, &bound, &[]);
        pass.draw(0..3, 0..1);
    }
}
