//! What a texture is to be, decided before a texel is made: format, box and reduction.

use std::sync::Arc;

use super::texture_from_voxel;
use crate::gpu::Caps;
use crate::scene::TextureFormat;
use crate::volume::{Affine, Grid, Point, Transfer};

/// What makes two textures the same.
#[derive(Debug, Clone)]
pub(crate) struct TextureKey {
    pub(crate) grid: Arc<Grid>,
    /// For pre-classified formats only.
    pub(crate) transfer: Option<Arc<Transfer>>,
    pub(crate) format: TextureFormat,
    /// First and last voxel of the box, both within.
    pub(crate) low: [usize; 3],
    pub(crate) high: [usize; 3],
    /// Voxels averaged into a texel along each axis.
    pub(crate) reduce: [usize; 3],
}

impl TextureKey {
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        let transfer = match (&self.transfer, &other.transfer) {
            (None, None) => true,
            (Some(a), Some(b)) => Transfer::same(a, b),
            _ => false,
        };
        transfer
            && Arc::ptr_eq(&self.grid, &other.grid)
            && (self.format, self.low, self.high, self.reduce)
                == (other.format, other.low, other.high, other.reduce)
    }
}

/// A texture to be made.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) key: TextureKey,
}

impl Plan {
    /// Plans the texture of the part of a grid that lies within `bounds` (voxel space), with a voxel more
    /// on every side for gradients. What the device lacks is replaced and noted.
    pub(crate) fn new(
        grid: &Arc<Grid>,
        transfer: &Arc<Transfer>,
        asked: TextureFormat,
        bounds: [Point; 2],
        caps: Caps,
        notes: &mut Vec<String>,
    ) -> Self {
        let extent = grid.extent();
        let inside = |c: f64, axis: usize| (c.max(0.0) as usize).min(extent[axis] - 1);
        let low = [0, 1, 2].map(|a| inside(bounds[0][a].floor() - 1.0, a));
        let high = [0, 1, 2].map(|a| inside(bounds[1][a].ceil() + 1.0, a));
        let texels = [0, 1, 2].map(|a| high[a] - low[a] + 1);
        let format =
            available(if asked == TextureFormat::Auto { fitting(texels, caps) } else { asked }, caps, notes);
        if asked == TextureFormat::Auto && matches!(format, TextureFormat::Bc4 | TextureFormat::Bc5) {
            notes.push(format!(
                "a volume of {} x {} x {} is kept as {format}: 16 bits a voxel would take more than {} MiB",
                texels[0],
                texels[1],
                texels[2],
                caps.texture_budget >> 20
            ));
        }
        let reduce = [0, 1, 2].map(|a| texels[a].div_ceil(caps.texture_3d as usize & !3));
        // Where even half a byte a voxel is too much, every axis is halved, or more.
        let fits = |by: usize| {
            let voxels: u64 = texels.iter().map(|&n| n.div_ceil(by) as u64).product();
            voxels / 2 <= caps.texture_budget
        };
        let by = (1..=64).find(|&by| fits(by)).unwrap_or(64);
        if asked == TextureFormat::Auto && by > 1 {
            let [x, y, z] = extent;
            let budget = caps.texture_budget >> 20;
            notes.push(format!(
                "a volume of {x} x {y} x {z} is drawn at 1/{by} of its resolution: it may take {budget} MiB"
            ));
        }
        let reduce = if asked == TextureFormat::Auto { reduce.map(|r| r.max(by)) } else { reduce };
        if reduce.iter().any(|&r| r > by) {
            notes.push(format!(
                "a volume of {} x {} x {} is drawn at 1/{} of its resolution: this GPU's 3D textures end at {}",
                extent[0],
                extent[1],
                extent[2],
                reduce.iter().max().unwrap_or(&1),
                caps.texture_3d
            ));
        }
        let colour = is_colour(format).then(|| Arc::clone(transfer));
        Self { key: TextureKey { grid: Arc::clone(grid), transfer: colour, format, low, high, reduce } }
    }

    /// Texels along each axis, before padding to blocks.
    pub(crate) fn texels(&self) -> [usize; 3] {
        let key = &self.key;
        [0, 1, 2].map(|a| (key.high[a] - key.low[a] + 1).div_ceil(key.reduce[a]))
    }

    /// 0 to 1 over the edges of a texture of `extent` texels.
    pub(crate) fn texture_from_voxel(&self, extent: [u32; 3]) -> Affine {
        let cover = [0, 1, 2].map(|a| f64::from(extent[a]) * self.key.reduce[a] as f64);
        texture_from_voxel(cover, self.key.low.map(|n| n as f64))
    }
}

/// Whether a format holds colours instead of values.
pub(crate) fn is_colour(format: TextureFormat) -> bool {
    matches!(format, TextureFormat::Rgba8 | TextureFormat::Bc3 | TextureFormat::Bc7)
}

/// The most accurate format of scalars that one volume may take memory for.
fn fitting(texels: [usize; 3], caps: Caps) -> TextureFormat {
    let voxels: u64 = texels.iter().map(|&n| n as u64).product();
    match caps.texture_budget / voxels.max(1) {
        0 => TextureFormat::Bc4,
        1 => TextureFormat::Bc5,
        _ => TextureFormat::Auto,
    }
}

/// The format asked for, or the nearest that the device has, with a note.
fn available(asked: TextureFormat, caps: Caps, notes: &mut Vec<String>) -> TextureFormat {
    use TextureFormat as F;
    let mut replaced = |by: F, why: &str| {
        notes.push(format!("texture {asked:?} was replaced by {by:?}: {why}"));
        by
    };
    let scalar = if caps.norm16 { F::R16 } else { F::R32f };
    match asked {
        F::Bc3 | F::Bc7 if !caps.bc_3d => {
            replaced(F::Rgba8, "this GPU has no block compression in 3D textures")
        }
        F::Bc4 | F::Bc5 if !caps.bc_3d => {
            replaced(scalar, "this GPU has no block compression in 3D textures")
        }
        F::R32f if !caps.float_filter && caps.norm16 => {
            replaced(F::R16, "this GPU does not filter 32-bit floats")
        }
        F::R16 if !caps.norm16 => replaced(F::R32f, "this GPU has no 16-bit textures"),
        F::Auto => scalar,
        other => other,
    }
}
