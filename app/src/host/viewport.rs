//! The picture as a texture of egui: drawn on the window's own device, or by the processor where that device is none.
//! The only file of the program that names wgpu.

use std::sync::Arc;

use eframe::egui_wgpu::{RenderState, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use egui::TextureId;
use render::cpu;
use render::gpu::{Gpu, GpuError, wanted_features, wanted_limits};
use render::renderer::{Renderer, Stats};
use render::scene::Scene;
use thiserror::Error;

use super::processor::{Order, Processor, ProcessorError, Tag};
use super::session::Wake;

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
    Processor(#[from] ProcessorError),
}

/// A picture that was asked for: what it cost, or why there is none. [`Viewport::texture`] shows it.
#[derive(Debug)]
pub struct Outcome {
    /// Which one.
    pub tag: Tag,
    /// What came of it.
    pub drawn: Result<Stats, ViewportError>,
}

/// The 3D picture.
pub struct Viewport {
    renderer: Renderer,
    processor: Processor,
    /// What the GPU drew and nobody has fetched.
    by_gpu: Option<Outcome>,
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
    /// A renderer on the window's device. `wake` is called when a picture by the processor is there.
    ///
    /// # Errors
    /// [`GpuError`] where the device cannot draw volumes at all.
    pub fn new(window: &RenderState, wake: Wake) -> Result<Self, GpuError> {
        let gpu = Gpu::from_wgpu(&window.adapter, window.device.clone(), window.queue.clone());
        let renderer = Renderer::new(Arc::new(gpu))?;
        Ok(Self {
            renderer,
            processor: Processor::new(wake),
            by_gpu: None,
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

    /// Whether the window's device is lost: then nothing may be drawn on it, and no picture comes any more.
    pub fn is_lost(&self) -> bool {
        self.renderer.gpu().is_lost()
    }

    /// Gives the device up, as a driver does that is reset.
    pub fn lose(&self) {
        self.window.device.destroy();
    }

    /// Whether the processor draws a scene, beside the window; the window stands still for the GPU.
    pub fn draws_beside(&self, scene: &Scene) -> bool {
        cpu::alone_shows(scene) || (self.renderer.gpu().caps().software && cpu::shows(scene))
    }

    /// Asks for a picture in place of any that was asked for; it comes out of [`Viewport::finished`], at once
    /// where the GPU draws it.
    pub fn ask(&mut self, order: Order) {
        if self.draws_beside(&order.scene) {
            self.processor.order(order);
            return;
        }
        self.processor.abandon();
        let Order { tag, scene } = order;
        let drawn = self.renderer.render(&scene, tag.size, tag.quality);
        if drawn.is_ok() {
            let is_new = self.drawn.take().is_some() || self.size != tag.size;
            self.show(is_new, tag.size);
        }
        self.by_gpu = Some(Outcome { tag, drawn: drawn.map_err(Into::into) });
    }

    /// A picture that came; to be asked until there is none. Where it could not be drawn, the one before stays.
    pub fn finished(&mut self) -> Option<Outcome> {
        if let Some(outcome) = self.by_gpu.take() {
            return Some(outcome);
        }
        let (tag, drawn) = self.processor.finished()?;
        let drawn = drawn.map(|drawn| {
            let is_new = self.drawn.is_none() || self.size != tag.size;
            self.send(&drawn.rgba, tag.size);
            self.show(is_new, tag.size);
            drawn.stats
        });
        Some(Outcome { tag, drawn: drawn.map_err(Into::into) })
    }

    /// Puts the last picture behind the texture, whose view is another one where `is_new`: the size or the renderer
    /// changed.
    fn show(&mut self, is_new: bool, size: [u32; 2]) {
        if self.texture.is_some() && !is_new {
            return;
        }
        let view = self.drawn.as_ref().map(|t| t.create_view(&wgpu::TextureViewDescriptor::default()));
        let Some(picture) = view.as_ref().or_else(|| self.renderer.display()) else { return };
        let device = &self.window.device;
        let mut egui = self.window.renderer.write();
        let filter = wgpu::FilterMode::Linear;
        match self.texture {
            Some(id) => egui.update_egui_texture_from_wgpu_texture(device, picture, filter, id),
            None => self.texture = Some(egui.register_native_texture(device, picture, filter)),
        }
        self.size = size;
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

#[cfg(test)]
mod tests {
    use eframe::egui_wgpu::RendererOptions;
    use egui::ViewportCommand;
    use egui_kittest::Harness;
    use egui_kittest::wgpu::create_render_state;

    use super::*;
    use crate::case::{Case, Edit};
    use crate::host::frame::Host;
    use crate::host::registry::Registry;

    fn on_a_device() -> Result<Viewport, GpuError> {
        let state = create_render_state(configuration().wgpu_setup, RendererOptions::PREDICTABLE);
        Viewport::new(&state, Arc::new(|| ()))
    }

    #[test]
    fn a_lost_device_shows_nothing_and_closes_the_window_but_keeps_the_plan() {
        if std::env::var_os("NO_GPU").is_some_and(|v| v == "1") {
            return;
        }
        let mut host = Host::new(Case::default(), Registry::default(), Arc::new(|| ()));
        host.attach(on_a_device());
        let draw = |ui: &mut egui::Ui, host: &mut Host| host.frame_ui(ui);
        let mut window = Harness::builder().with_size([1000.0, 700.0]).build_ui_state(draw, host);
        window.state_mut().apply(Edit::SetName("a plan".to_owned()));
        window.step();
        assert!(!window.output().shapes.is_empty() && !window.state().is_lost(), "a window like any other");
        window.state_mut().lose_before(Some(1));
        window.step();
        assert!(window.state().is_lost(), "it is seen at once");
        assert!(window.output().shapes.is_empty(), "nothing to paint on a device that is gone");
        let asked: Vec<&ViewportCommand> =
            window.output().viewport_output.values().flat_map(|v| &v.commands).collect();
        assert!(asked.contains(&&ViewportCommand::Close), "it closes: {asked:?}");
        assert!(!asked.contains(&&ViewportCommand::CancelClose), "unasked, as nothing is lost: {asked:?}");
        window.state_mut().attach(on_a_device());
        window.step();
        assert!(!window.output().shapes.is_empty() && !window.state().is_lost(), "on another device");
        let session = window.state().session();
        assert_eq!(session.case().name, "a plan", "with the plan");
        assert!(session.history().can_undo() && !session.history().is_saved(), "and its past");
        assert_eq!(session.problems().len(), 1, "and a word about it");
    }
}
