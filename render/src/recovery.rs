//! A renderer on a device of its own, that opens the device again where it is lost.
//!
//! All that a picture is made of is kept outside the device, so the picture after a loss has the same bytes.

use std::sync::Arc;

use crate::gpu::{Gpu, GpuError};
use crate::image::FloatImage;
use crate::renderer::{Quality, Renderer, Stats};
use crate::scene::Scene;

/// Times that one picture is begun anew on a new device: a driver that resets at each is not used for ever.
const RETRIES: u32 = 3;

/// What opens a device.
type Open = Box<dyn Fn() -> Result<Gpu, GpuError> + Send>;

/// A renderer without a window, and its device.
pub struct RecoveringRenderer {
    open: Open,
    renderer: Option<Renderer>,
    losses: u32,
}

impl std::fmt::Debug for RecoveringRenderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let adapter = self.renderer.as_ref().map(|r| r.gpu().adapter());
        f.debug_struct("RecoveringRenderer")
            .field("adapter", &adapter)
            .field("losses", &self.losses)
            .finish_non_exhaustive()
    }
}

impl RecoveringRenderer {
    /// A renderer on the device that `open` gives, now and after each loss.
    ///
    /// # Errors
    /// What opening the device or making the pipelines reports.
    pub fn new(open: impl Fn() -> Result<Gpu, GpuError> + Send + 'static) -> Result<Self, GpuError> {
        let mut made = Self { open: Box::new(open), renderer: None, losses: 0 };
        made.retry(|_| Ok(()))?;
        Ok(made)
    }

    /// A renderer on a device that is open already; `open` gives the ones after it.
    ///
    /// # Errors
    /// What making the pipelines reports.
    pub fn on(gpu: Gpu, open: impl Fn() -> Result<Gpu, GpuError> + Send + 'static) -> Result<Self, GpuError> {
        Ok(Self { open: Box::new(open), renderer: Some(Renderer::new(Arc::new(gpu))?), losses: 0 })
    }

    /// The device in use; none after a loss that was not got over.
    pub fn gpu(&self) -> Option<&Arc<Gpu>> {
        self.renderer.as_ref().map(Renderer::gpu)
    }

    /// Devices that were lost so far.
    pub fn losses(&self) -> u32 {
        self.losses
    }

    /// Draws a scene and reads the picture. Where the device is lost it begins anew, with a note.
    ///
    /// # Errors
    /// Those of [`Renderer::render`] and [`Renderer::read`]; [`GpuError::Lost`] only where devices are lost time and
    /// again.
    pub fn render(
        &mut self,
        scene: &Scene,
        size: [u32; 2],
        quality: Quality,
    ) -> Result<(FloatImage, Stats), GpuError> {
        let before = self.losses;
        let (picture, mut stats) = self.retry(|renderer| {
            let stats = renderer.render(scene, size, quality)?;
            Ok((renderer.read()?, stats))
        })?;
        if self.losses > before {
            stats.notes.push("the GPU stopped answering and was opened again".to_owned());
        }
        Ok((picture, stats))
    }

    fn retry<T>(&mut self, work: impl Fn(&mut Renderer) -> Result<T, GpuError>) -> Result<T, GpuError> {
        let before = self.losses;
        loop {
            let done = match &mut self.renderer {
                Some(renderer) => work(renderer),
                None => (self.open)().and_then(|gpu| {
                    let renderer = self.renderer.insert(Renderer::new(Arc::new(gpu))?);
                    work(renderer)
                }),
            };
            match done {
                Err(GpuError::Lost { .. }) if self.losses - before < RETRIES => {
                    self.renderer = None;
                    self.losses += 1;
                }
                other => return other,
            }
        }
    }
}
