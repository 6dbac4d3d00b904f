//! The renderers that a benchmark measures, as it sees them: a scene and a spacing in, a picture and its time out.

use std::sync::Arc;
use std::time::Instant;

use ::render::cpu::{CpuRenderer, Finish, Skips};
use ::render::gpu::Gpu;
use ::render::image::FloatImage;
use ::render::reference;
use ::render::renderer::{Quality, Renderer};
use ::render::scene::{Scene, TextureFormat};

use crate::headless::Failure;

/// A picture and what it took.
#[derive(Debug)]
pub(super) struct Painted {
    pub(super) picture: FloatImage,
    /// From the scene to the finished picture, without reading it back.
    pub(super) frame_ms: f64,
}

/// Something that draws scenes.
pub(super) trait Painter {
    /// For rows and plots.
    fn name(&self) -> &'static str;

    /// Whether the spacing matters to it: the reference has none.
    fn has_spacing(&self) -> bool {
        true
    }

    /// The textures worth comparing; one where it reads the samples themselves.
    fn formats(&self) -> &'static [TextureFormat] {
        &[TextureFormat::Auto]
    }

    /// The ways to finish pixels that are worth comparing; none is told where it is fixed.
    fn terminations(&self) -> &'static [Option<Finish>] {
        &[None]
    }

    /// Finishes pixels by one of its [`Painter::terminations`] from now on.
    fn terminate(&mut self, _finish: Finish) {}

    /// A picture of `size` pixels with sub-steps of `spacing` voxels of the finest volume.
    fn paint(&mut self, scene: &Scene, size: [u32; 2], spacing: f64) -> Result<Painted, Failure>;
}

/// Makes a renderer that has drawn nothing yet.
pub(super) type Maker = fn(&Arc<Gpu>) -> Result<Box<dyn Painter>, Failure>;

/// All there are.
pub(super) const MAKERS: [Maker; 3] = [
    |gpu| Ok(Box::new(OnGpu(Renderer::new(Arc::clone(gpu))?))),
    |_| Ok(Box::new(OnCpu(CpuRenderer::new()))),
    |_| Ok(Box::new(Exact)),
];

/// The wgpu renderer.
struct OnGpu(Renderer);

impl Painter for OnGpu {
    fn name(&self) -> &'static str {
        "gpu"
    }

    fn formats(&self) -> &'static [TextureFormat] {
        use TextureFormat::{Bc3, Bc4, Bc5, Bc7, R16, R32f, Rgba8};
        &[R16, R32f, Bc4, Bc5, Rgba8, Bc3, Bc7]
    }

    fn paint(&mut self, scene: &Scene, size: [u32; 2], spacing: f64) -> Result<Painted, Failure> {
        let stats = self.0.render(scene, size, Quality::Spacing(spacing))?;
        Ok(Painted { picture: self.0.read()?, frame_ms: stats.frame_ms })
    }
}

/// The processor alone.
struct OnCpu(CpuRenderer);

impl Painter for OnCpu {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn terminations(&self) -> &'static [Option<Finish>] {
        use Finish::{Below, Never, WithQuality};
        const BELOW: [Finish; 4] =
            [Below(1.0 / 65536.0), Below(1.0 / 1024.0), Below(1.0 / 256.0), Below(1.0 / 64.0)];
        &[Some(WithQuality), Some(Never), Some(BELOW[0]), Some(BELOW[1]), Some(BELOW[2]), Some(BELOW[3])]
    }

    fn terminate(&mut self, finish: Finish) {
        self.0.set_skips(Skips { finished: finish, ..Skips::default() });
    }

    fn paint(&mut self, scene: &Scene, size: [u32; 2], spacing: f64) -> Result<Painted, Failure> {
        let (picture, stats) = self.0.render(scene, size, Quality::Spacing(spacing), &|_, _| true)?;
        Ok(Painted { picture, frame_ms: stats.frame_ms })
    }
}

/// The reference, which takes the limit of small steps.
struct Exact;

impl Painter for Exact {
    fn name(&self) -> &'static str {
        "reference"
    }

    fn has_spacing(&self) -> bool {
        false
    }

    fn paint(&mut self, scene: &Scene, size: [u32; 2], _spacing: f64) -> Result<Painted, Failure> {
        let begin = Instant::now();
        let picture = reference::draw(scene, size, &reference::Options::default(), &|_, _| true)?;
        Ok(Painted { picture, frame_ms: begin.elapsed().as_secs_f64() * 1e3 })
    }
}
