//! The renderers under test.

use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use render::TextureSummary;
use render::cpu::CpuRenderer;
use render::gpu::Gpu;
use render::image::FloatImage;
use render::reference;
use render::renderer::{Quality, Renderer};
use render::scene::Scene;

use crate::support::gpu_wanted;

/// A way to draw a scene with sub-steps of so many voxels of the finest volume.
pub(super) struct Drawer {
    pub(super) name: &'static str,
    pub(super) draw: fn(&Scene, [u32; 2], f64) -> Result<FloatImage, String>,
}

/// All that are measured against the reference.
pub(super) fn all() -> Vec<Drawer> {
    let mut drawers = vec![processor()];
    if gpu_wanted() {
        drawers.push(Drawer { name: "gpu", draw: by_gpu });
    }
    drawers
}

/// The processor's.
pub(super) fn processor() -> Drawer {
    Drawer { name: "cpu", draw: by_cpu }
}

/// The picture as it is defined.
pub(super) fn truth(scene: &Scene, size: [u32; 2]) -> Result<FloatImage, String> {
    reference::draw(scene, size, &reference::Options::default(), &|_, _| true).map_err(|e| e.to_string())
}

static GPU: LazyLock<Result<Mutex<Renderer>, String>> = LazyLock::new(|| {
    let gpu = Gpu::headless().map_err(|e| e.to_string())?;
    Ok(Mutex::new(Renderer::new(Arc::new(gpu)).map_err(|e| e.to_string())?))
});

fn by_cpu(scene: &Scene, size: [u32; 2], voxels: f64) -> Result<FloatImage, String> {
    let drawn = CpuRenderer::new().render(scene, size, Quality::Spacing(voxels), &|_, _| true);
    drawn.map(|(picture, _)| picture).map_err(|e| e.to_string())
}

fn by_gpu(scene: &Scene, size: [u32; 2], voxels: f64) -> Result<FloatImage, String> {
    Ok(with_textures(scene, size, voxels)?.0)
}

/// A picture by the GPU, with what its textures say of themselves.
pub(super) fn with_textures(
    scene: &Scene,
    size: [u32; 2],
    voxels: f64,
) -> Result<(FloatImage, Vec<TextureSummary>), String> {
    let mut renderer = GPU.as_ref().map_err(Clone::clone)?.lock().unwrap_or_else(PoisonError::into_inner);
    let stats = renderer.render(scene, size, Quality::Spacing(voxels)).map_err(|e| e.to_string())?;
    Ok((renderer.read().map_err(|e| e.to_string())?, stats.textures))
}
