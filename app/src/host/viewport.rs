//! The renderer on the window's own device, and its picture as a texture of egui. The only file of the
//! program that names wgpu.

use std::sync::Arc;

use eframe::egui_wgpu::{RenderState, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use egui::TextureId;
use render::gpu::{Gpu, GpuError, wanted_features, wanted_limits};
use render::renderer::{Quality, Renderer, Stats};
use render::scene::Scene;

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

/// The 3D picture.
pub struct Viewport {
    renderer: Renderer,
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
        Ok(Self { renderer, window: window.clone(), texture: None, size: [0, 0] })
    }

    /// Name and interface of the adapter.
    pub fn adapter(&self) -> &str {
        self.renderer.gpu().adapter()
    }

    /// Draws a scene into the picture, which keeps its [`Viewport::texture`].
    ///
    /// # Errors
    /// [`GpuError`]; the picture is then as it was, or none.
    pub fn draw(&mut self, scene: &Scene, size: [u32; 2], quality: Quality) -> Result<Stats, GpuError> {
        let stats = self.renderer.render(scene, size, quality)?;
        let Some(picture) = self.renderer.display() else { return Ok(stats) };
        // The view behind the texture is another one only where the size changed.
        if self.texture.is_none() || self.size != size {
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

    /// The picture, once one was drawn.
    pub fn texture(&self) -> Option<TextureId> {
        self.texture
    }
}
