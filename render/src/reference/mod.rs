//! The `f64` reference: draws a [`Scene`] as the picture is defined, on all cores, without a GPU.
//!
//! It is what every faster renderer is measured against, so it shares nothing with them but the scene's
//! types. A picture is emission and absorption along the ray through each pixel's centre; this module
//! takes the limit of infinitely small steps instead of choosing a step:
//!
//! 1. `intervals`: where the ray is inside each piece of a volume, exactly, by its box and its cutters.
//! 2. `surface`: every crossing with a triangle, none twice, none missed.
//! 3. `walk`, `field`, `cubic`, `class`: the ray is split where the integrand is not smooth, at cell
//!    walls, where the scalar, a cubic there, passes a control point, and where light has a bend.
//!    `labels` adds the places where another label is the nearest.
//! 4. `integrate`: between two such places a rule of high order, halved until it holds.
//! 5. `cells`: the stretches of a ray in tetrahedra, where the scalar is linear, cut at control points.
//! 6. `modes`: volumes that are not integrated but found as layers, by the same cubics.
//!
//! **Unstructured grids** (`cells`): a cell is the tetrahedra of its corner of the smallest number with every triangle of the
//! faces that lack it, where a face of four corners is cut from its own smallest. In a tetrahedron the scalar is linear; a
//! field of cells is the same throughout each cell. Tetrahedra of no volume, and those with a value that is not a number, are
//! nothing. Where several overlap, extinctions add up and colours are weighted by them, as those of volumes do. No light.
//!
//! **Geometry** is relative to the camera's eye, so that a scene far from the origin keeps its digits.
//! Lengths are world millimetres along the ray. Row 0 is the top one.
//!
//! **Scalar**: trilinear, the edge sample held in the outer half voxel, classified after interpolation.
//!
//! **Gradient**: the trilinear scalar has none at cell walls, so the gradient is defined as its central
//! differences, one voxel to either side along each voxel axis with places outside held at the edge,
//! mapped to world by the inverse transpose of `world_from_voxel`. Light falls on either side of it,
//! by |n·v|; where it is shorter than [`crate::scene::light::FLAT`] times the span of the control values,
//! per mm, the colour is the plain one. Control points all at one value have no span: there it is the span of
//! the samples; and a volume of one value is plain throughout.
//!
//! **Labels**: where the nearest label at a point is n > 0 with colour (r, g, b, a), the colour c of the transfer
//! function becomes (1 - a)·c + a·(r, g, b), before light; extinction stays. The nearest is by the labels' own
//! voxels, half way between two the later one; labels ride with each piece of their volume.
//!
//! **MIP**: on each ray the greatest value m of the trilinear scalar over all pieces of the volume is classified
//! once: one layer of colour c(m), with the label where m is met first in the first piece that has it, and opacity
//! a(m), that of one `unit_mm`, at the depth where the ray first enters any piece. No light; surfaces inside the
//! volume do not shorten the ray.
//!
//! **Isosurface**: every crossing of the trilinear scalar with the value v inside a piece is a surface: colour c(v)
//! with its label, the mode's opacity, lit from the eye as a surface is, by |n·v| of the gradient. Faces of the box
//! and of cuts are no crossings: a cut surface is open.
//!
//! **Ties**: surfaces at one distance are crossed in the order of the scene's meshes, then of triangles, then come
//! layers of volumes in their order.
//!
//! **Error**: what is left is that of the rule, and of stopping at a transmittance of 1e-7 (2.6e-5 of
//! 1/255). Against eight times finer parts the rule's is below 1e-4 of 1/255 without light and below 0.02
//! of 1/255 with it; the tests hold it there, and measure about a hundredth of that.
//!
//! # References
//! - Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection", JCGT 2(1).
//! - Edelsbrunner, Mücke 1990, "Simulation of Simplicity", ACM Transactions on Graphics 9(1).
//! - Butcher 1964, "Implicit Runge-Kutta processes", Mathematics of Computation 18; Hairer, Nørsett,
//!   Wanner, "Solving Ordinary Differential Equations I", II.7.

mod cells;
mod class;
mod cubic;
mod field;
mod hierarchy;
mod integrate;
mod intervals;
mod labels;
mod light;
mod modes;
mod ray;
mod slope;
mod surface;
mod walk;

#[cfg(test)]
mod tests;

#[cfg(test)]
pub(crate) use cells::tetrahedra;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use thiserror::Error;

use crate::image::FloatImage;
use crate::scene::{CameraError, Scene, VolumeMode};

/// How a picture is drawn. The defaults are as exact as this module gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Every smooth stretch is cut into so many equal parts before the rule is applied; at least 1.
    /// For measuring the error of the rule.
    pub parts: u32,
    /// Whether bricks of a volume that are fully transparent are passed in one step. The picture is the
    /// same either way.
    pub skip_empty: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { parts: 1, skip_empty: true }
    }
}

/// Why there is no picture.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The camera shows nothing.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A side is zero, or there are more pixels than [`MAX_PIXELS`] or than memory holds.
    #[error("a picture of {width} by {height} pixels cannot be drawn: take 1 to {MAX_PIXELS} pixels in all")]
    Size {
        /// As asked for.
        width: u32,
        /// As asked for.
        height: u32,
    },
    /// A pixel that was asked for is not in the picture.
    #[error("pixel {x}, {y} is outside the picture")]
    Pixel {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
    },
    /// A colour or an opacity of a mesh is not a number from 0 to 1.
    #[error("mesh {mesh} has a colour or an opacity outside 0 to 1")]
    Mesh {
        /// Position in [`Scene::meshes`].
        mesh: usize,
    },
    /// An isosurface's value is not finite, or its opacity is not a number from 0 to 1.
    #[error("the isosurface of volume {volume} has a value that is not finite or an opacity outside 0 to 1")]
    Isosurface {
        /// Position in [`Scene::volumes`].
        volume: usize,
    },
    /// A grid has no such step, or the step no such field.
    #[error("unstructured grid {grid} has no such step, or no field of that name with that component there")]
    Grid {
        /// Position in [`Scene::grids`].
        grid: usize,
    },
    /// The caller said to stop.
    #[error("drawing was cancelled")]
    Cancelled,
}

/// The largest picture: 16 384 × 16 384, 4 GiB.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Draws a picture of `size`, `[width, height]`, with [`Options`], on all threads of the current pool.
///
/// `progress` is told, from any thread and after each row, how many rows are done and of how many; as
/// soon as it answers `false` the drawing stops. The result does not depend on the number of threads.
///
/// # Errors
/// All of [`ReferenceError`] but [`ReferenceError::Pixel`].
pub fn draw(
    scene: &Scene,
    size: [u32; 2],
    options: &Options,
    progress: &(dyn Fn(usize, usize) -> bool + Sync),
) -> Result<FloatImage, ReferenceError> {
    let [width, height] = size;
    check(scene, size)?;
    let too_large = |_| ReferenceError::Size { width, height };
    let count = width as usize * height as usize;
    let mut pixels = Vec::new();
    pixels.try_reserve_exact(count).map_err(too_large)?;
    pixels.resize(count, [0.0_f32; 4]);
    let fields = ray::fields(scene, *options);
    let tracer = ray::Tracer::new(scene, &fields, size, *options)?;
    let done = AtomicUsize::new(0);
    let rows = pixels.par_chunks_exact_mut(width as usize).with_max_len(1).enumerate();
    rows.try_for_each_init(ray::Scratch::default, |scratch, (y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            *pixel = tracer.pixel(x as u32, y as u32, scratch).map(|c| c as f32);
        }
        let rows_done = done.fetch_add(1, Ordering::Relaxed) + 1;
        if progress(rows_done, height as usize) { Ok(()) } else { Err(ReferenceError::Cancelled) }
    })?;
    Ok(FloatImage { width, height, pixels })
}

/// Draws single pixels, `(column, row)`, of a picture of `size`; premultiplied red, green, blue and
/// opacity, not rounded to `f32`.
///
/// # Errors
/// All of [`ReferenceError`] but [`ReferenceError::Cancelled`].
pub fn draw_pixels(
    scene: &Scene,
    size: [u32; 2],
    options: &Options,
    pixels: &[(u32, u32)],
) -> Result<Vec<[f64; 4]>, ReferenceError> {
    check(scene, size)?;
    if let Some(&(x, y)) = pixels.iter().find(|p| p.0 >= size[0] || p.1 >= size[1]) {
        return Err(ReferenceError::Pixel { x, y });
    }
    let fields = ray::fields(scene, *options);
    let tracer = ray::Tracer::new(scene, &fields, size, *options)?;
    let draw = |scratch: &mut ray::Scratch, &(x, y): &(u32, u32)| tracer.pixel(x, y, scratch);
    Ok(pixels.par_iter().map_init(ray::Scratch::default, draw).collect())
}

fn check(scene: &Scene, [width, height]: [u32; 2]) -> Result<(), ReferenceError> {
    let count = u64::from(width) * u64::from(height);
    if count == 0 || count > MAX_PIXELS {
        return Err(ReferenceError::Size { width, height });
    }
    let display = |v: &f64| (0.0..=1.0).contains(v);
    for (mesh, item) in scene.meshes.iter().enumerate() {
        if !(item.color.iter().all(display) && display(&item.opacity)) {
            return Err(ReferenceError::Mesh { mesh });
        }
    }
    for (volume, item) in scene.volumes.iter().enumerate() {
        if let VolumeMode::Isosurface { value, opacity } = item.mode
            && !(value.is_finite() && display(&opacity))
        {
            return Err(ReferenceError::Isosurface { volume });
        }
    }
    Ok(())
}
