//! The picture as a texture of egui: drawn on the window's own device, or by the processor where that device is none.
//! The only file of the program that names wgpu.

use std::sync::Arc;

use eframe::egui_wgpu::{RenderState, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use egui::TextureId;
use render::cpu::{self, CpuError, CpuRenderer};
use render::gpu::{Gpu, GpuError, wanted_features, wanted_limits};
use render::renderer::{Quality, Renderer, Stats};
use render::scene::Scene;
use thiserror::Error;

/// How the window opens its device: with all that the renderer can use of the adapter.
pub fn configuration() -> WgpuConfiguration {
    let setup = WgpuSetupCreateNew {
        device_descriptor: Arc::new(|adapter| wgpu::DeviceDescriptor {
            label: Some("window.device"),
            required_features: wanted_features(adapter),
            required_limits: wanted_limits(adapter),
            ..Default::default()
        }),
        ..WgpuSetupCreateNew::without_display_handle()
    };
    WgpuConfiguration { wgpu_setup: WgpuSetup::CreateNew(setup), ..WgpuConfiguration::default() }
}

/// Why there is no picture.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ViewportError {
    /// The GPU drew none.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The processor drew none.
    #[error(transparent)]
    Cpu(#[from] CpuError),
}

/// The 3D picture.
pub struct Viewport {
    renderer: Renderer,
    processor: CpuRenderer,
    /// The processor's last picture on the device; none where the GPU drew it.
    drawn: Option<wgpu::Texture>,
    window: RenderState,
    texture: Option<TextureId>,
    size: [u32; 2],
}

impl std::fmt::Debug for Viewport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Viewport")
            .field("adapter", &self.adapter())
            .field("size", &self.size)
            .finish_non_exhaustive()
    }
}

impl Viewport {
    /// A renderer on the window's device.
    ///
    /// # Errors
    /// [`GpuError`] where the device cannot draw volumes at all.
    pub fn new(window: &RenderState) -> Result<Self, GpuError> {
        let gpu = Gpu::from_wgpu(&window.adapter, window.device.clone(), window.queue.clone());
        let renderer = Renderer::new(Arc::new(gpu))?;
        Ok(Self {
            renderer,
            processor: CpuRenderer::new(),
            drawn: None,
            window: window.clone(),
            texture: None,
            size: [0, 0],
        })
    }

    /// Name and interface of what drew the last picture.
    pub fn adapter(&self) -> &str {
        if self.drawn.is_some() { "processor" } else { self.renderer.gpu().adapter() }
    }

    /// Draws a scene into the picture, which keeps its [`Viewport::texture`].
    ///
    /// # Errors
    /// [`ViewportError`]; the picture is then as it was, or none.
    pub fn draw(&mut self, scene: &Scene, size: [u32; 2], quality: Quality) -> Result<Stats, ViewportError> {
        let software = self.renderer.gpu().caps().software;
        let by_processor = cpu::alone_shows(scene) || (software && cpu::shows(scene));
        let same = by_processor == self.drawn.is_some() && self.size == size;
        let stats = if by_processor {
            let (picture, stats) = self.processor.render(scene, size, quality, &|_, _| true)?;
            let rgb = picture.to_rgb8(scene.background);
            let rgba: Vec<u8> = rgb.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect();
            self.send(&rgba, size);
            stats
        } else {
            self.drawn = None;
            self.renderer.render(scene, size, quality)?
        };
        // The view behind the texture is another one only where the size or the renderer changed.
        if self.texture.is_none() || !same {
            let view = self.drawn.as_ref().map(|t| t.create_view(&wgpu::TextureViewDescriptor::default()));
            let Some(picture) = view.as_ref().or_else(|| self.renderer.display()) else { return Ok(stats) };
            let device = &self.window.device;
            let mut egui = self.window.renderer.write();
            let filter = wgpu::FilterMode::Linear;
            match self.texture {
                Some(id) => egui.update_egui_texture_from_wgpu_texture(device, picture, filter, id),
                None => self.texture = Some(egui.register_native_texture(device, picture, filter)),
            }
            self.size = size;
        }
        Ok(stats)
    }

    /// Sends the processor's picture to the device.
    fn send(&mut self, rgba: &[u8], [width, height]: [u32; 2]) {
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        let make = || {
            self.window.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("viewport.processor"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8Unorm,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            })
        };
        let texture = self.drawn.take().filter(|t| t.size() == size).unwrap_or_else(make);
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(width * 4),
            rows_per_image: Some(height),
        };
        self.window.queue.write_texture(texture.as_image_copy(), rgba, layout, size);
        self.drawn = Some(texture);
    }

    /// The picture, once one was drawn.
    pub fn texture(&self) -> Option<TextureId> {
        self.texture
    }
}
