//! The picture by the processor alone: for machines without a GPU, where it is several times faster than a GPU's
//! passes on a software driver, and exact where they are not.
//!
//! 1. `field`, `table`: a volume's samples stay as they are; the range of each brick of cells, asked against the
//!    transfer function, says how far a ray may go at once. Both are kept from picture to picture.
//! 2. `line`, `piece`, `tiles`: what is affine in space becomes affine on a ray; each tile of pixels knows how deep
//!    a piece may show anything in it.
//! 3. `surfaces`: triangles are scanned into a list of crossings for each pixel, at their exact depth.
//! 4. `march`, `walker`: a ray goes from one end, cut or surface to the next, in between from cell wall to cell
//!    wall; on each step the scalar is taken as linear, and extinction is integrated exactly along it (`table`).
//!    Any number of pieces and surfaces may meet: the extinctions of pieces that overlap add up.
//! 5. Unstructured grids, scan-converted by `crate::cells` for a strip of the picture at a time, are walked on the same rays, from
//!    cell to cell; where a piece or another grid lies in the same place, by the same steps.
//!
//! **Error**: second order in the length of the steps, which are at most [`Quality::voxels`] of a voxel and never
//! longer than a cell; what lies behind a pixel that lets less than 1/1024 through is left out (1/512 in drafts,
//! 1/65536 from [`Quality::Finest`] on).
//!
//! The same scene gives the same bytes for any number of threads.

mod cubic;
mod field;
#[cfg(target_arch = "x86_64")]
mod lanes;
mod layered;
mod line;
mod march;
#[cfg(target_arch = "x86_64")]
mod packet;
mod painting;
mod piece;
mod shine;
mod surfaces;
mod table;
mod tiles;
mod walker;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

use rayon::prelude::*;
use thiserror::Error;

use crate::cells::{self, CellPicture, CellRenderer, CellsError, Early, Group, Link, Spans, Strip};
use crate::image::FloatImage;
use crate::renderer::{Quality, Stats};
use crate::scene::{CameraError, CellItem, Scene, TextureFormat, VolumeItem, VolumeMode};
use crate::simd::has_wide;
use crate::view::View;
use crate::volume::{Grid, Point, Transfer};
use field::{Field, Occupancy};
use layered::Layered;
use line::Rays;
use march::{Manner, Scratch, Work};
use piece::{Placed, Prepared};
use surfaces::Surfaces;
use table::Table;
use tiles::{Depths, TILE};
use walker::Ray;

/// Why there is no picture.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CpuError {
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
    /// An unstructured grid cannot be shown.
    #[error(transparent)]
    Cells(CellsError),
    /// The caller said to stop.
    #[error("drawing was cancelled")]
    Cancelled,
}

impl From<CellsError> for CpuError {
    fn from(error: CellsError) -> Self {
        match error {
            CellsError::Camera(error) => Self::Camera(error),
            CellsError::Size { width, height } => Self::Size { width, height },
            CellsError::Cancelled => Self::Cancelled,
            other => Self::Cells(other),
        }
    }
}

/// The largest picture: 16 384 × 16 384, 4 GiB.
pub const MAX_PIXELS: u64 = 1 << 28;

/// What may be skipped. All is; for tests and measurements each can be had.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Skips {
    /// Bricks that the transfer function makes clear.
    pub empty: bool,
    /// What lies behind a pixel that lets next to nothing through.
    pub finished: Finish,
}

impl Default for Skips {
    fn default() -> Self {
        Self { empty: true, finished: Finish::default() }
    }
}

/// When a pixel is finished, so that nothing behind it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Finish {
    /// At the end of its ray.
    Never,
    /// When it lets so little through that it is below what the quality's steps are off by.
    #[default]
    WithQuality,
    /// When it lets less than this part of the light behind through, 0 to 1.
    Below(f32),
}

/// Which instructions are used. All give the same bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Instructions {
    /// The widest that the machine has: AVX2 on x86-64.
    #[default]
    Best,
    /// What every machine of the architecture has.
    Plain,
}

/// Steps between two walls of cells where cells overlap, for one step a voxel.
const STEPS_IN_CELLS: f64 = 8.0;

/// Bands at most that grids are scan-converted for at once.
const STRIP: usize = 8;

/// Pixels that may go at once, across and down.
const BLOCK: [usize; 2] = [4, 2];

/// A volume's samples made ready, and what transfer functions make of them.
#[derive(Debug)]
struct Kept {
    field: Field,
    transfers: Vec<(Arc<Transfer>, VolumeMode, Occupancy, Table)>,
}

/// Whether a scene asks for nothing but what this renderer shows: the samples themselves. A texture that loses
/// something, and a compressed step of a series, are to be seen with their loss.
pub fn shows(scene: &Scene) -> bool {
    let is_exact = |item: &VolumeItem| {
        let exact = matches!(item.texture, TextureFormat::Auto | TextureFormat::R16 | TextureFormat::R32f);
        exact && item.packed.is_none()
    };
    scene.volumes.iter().all(is_exact)
}

/// Whether only this renderer shows a scene, and not the passes: labels, MIP, isosurfaces and unstructured grids.
pub fn alone_shows(scene: &Scene) -> bool {
    !scene.grids.is_empty()
        || scene.volumes.iter().any(|item| item.mode != VolumeMode::Composite || item.labels.is_some())
}

/// The grid of a scene that has nothing else.
fn grid_alone(scene: &Scene) -> Option<&CellItem> {
    match (&scene.volumes[..], &scene.meshes[..], &scene.grids[..]) {
        ([], [], [grid]) => Some(grid),
        _ => None,
    }
}

/// The picture of a grid that is alone; nothing where cells of it overlap, whose colours mix along their depth.
fn picture_of_grid(drawn: CellPicture) -> Option<(FloatImage, Stats)> {
    let cells = drawn.stats;
    if cells.total.overlaps + cells.total.overlapping_pixels > 0 {
        return None;
    }
    let stats = Stats {
        frame_ms: cells.prepare_ms + cells.frame_ms,
        prepare_ms: cells.prepare_ms,
        tetrahedra: cells.tetrahedra,
        tetrahedra_scanned: cells.total.scanned,
        grid: Some(cells),
        ..Stats::default()
    };
    Some((drawn.image, stats))
}

/// Draws scenes. Keeps what it knows of volumes from picture to picture.
#[derive(Debug, Default)]
pub struct CpuRenderer {
    kept: Vec<Kept>,
    cells: CellRenderer,
    skips: Skips,
    instructions: Instructions,
}

impl CpuRenderer {
    /// A renderer that knows nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// What it skips from now on.
    pub fn set_skips(&mut self, skips: Skips) {
        if skips != self.skips {
            (self.skips, self.kept) = (skips, Vec::new());
        }
    }

    /// Which instructions it uses from now on.
    pub fn set_instructions(&mut self, instructions: Instructions) {
        self.instructions = instructions;
    }

    /// Draws a picture of `size`, `[width, height]`, on all threads of the current pool: premultiplied, without
    /// background.
    ///
    /// `progress` is told, from any thread, how much of the picture is done and of how much; as soon as it answers `false`
    /// the drawing stops.
    ///
    /// An unstructured grid that is alone in the scene and of which no cells overlap is drawn by [`CellRenderer`], in drafts
    /// with early termination at what a draft may leave out; such drafts depend on the threads' timing, within that.
    ///
    /// # Errors
    /// All of [`CpuError`].
    pub fn render(
        &mut self,
        scene: &Scene,
        size: [u32; 2],
        quality: Quality,
        progress: &(dyn Fn(usize, usize) -> bool + Sync),
    ) -> Result<(FloatImage, Stats), CpuError> {
        if let Some(grid) = grid_alone(scene) {
            let options = self.of_grids(quality);
            let drawn = self.cells.render(grid, &scene.camera, size, &options, progress)?;
            if let Some(picture) = picture_of_grid(drawn) {
                return Ok(picture);
            }
        }
        self.walk_rays(scene, size, quality, progress)
    }

    /// Draws as [`CpuRenderer::render`] does, but an unstructured grid that is alone in the scene by all processes of a group.
    /// What else there is, is drawn by this process.
    ///
    /// # Errors
    /// All of [`CpuError`].
    pub fn render_by<L: Link>(
        &mut self,
        group: &mut Group<L>,
        scene: &Scene,
        size: [u32; 2],
        quality: Quality,
        progress: &(dyn Fn(usize, usize) -> bool + Sync),
    ) -> Result<(FloatImage, Stats), CpuError> {
        if let Some(grid) = grid_alone(scene) {
            let options = self.of_grids(quality);
            let drawn = group.render(grid, &scene.camera, size, &options, progress)?;
            if let Some(picture) = picture_of_grid(drawn) {
                return Ok(picture);
            }
        }
        self.walk_rays(scene, size, quality, progress)
    }

    /// Any scene, ray by ray.
    fn walk_rays(
        &mut self,
        scene: &Scene,
        size: [u32; 2],
        quality: Quality,
        progress: &(dyn Fn(usize, usize) -> bool + Sync),
    ) -> Result<(FloatImage, Stats), CpuError> {
        let begin = Instant::now();
        let [width, height] = size;
        let too_large = CpuError::Size { width, height };
        let count = u64::from(width) * u64::from(height);
        if count == 0 || count > MAX_PIXELS {
            return Err(too_large);
        }
        let mut pixels = Vec::new();
        pixels.try_reserve_exact(count as usize).map_err(|_no_memory| too_large)?;
        pixels.resize(count as usize, [0.0_f32; 4]);
        let mut stats = Stats::default();
        let view = View::new(&scene.camera, size)?;
        let wide = self.instructions == Instructions::Best && has_wide();
        let grids = self.cells.place(&scene.grids, &view, &self.of_grids(quality))?;
        let ready = self.ready(scene, &mut stats);
        let placed = place(scene, &self.kept, &ready, &view, &mut stats);
        let rays = placed.rays;
        let surfaces = Surfaces::new(&scene.meshes, &view, &rays);
        let depths: Vec<Depths> = placed.pieces.iter().map(|p| Depths::new(p, &rays, size)).collect();
        let voxel_mm = placed.pieces.iter().map(|p| p.voxel_mm).fold(f64::INFINITY, f64::min);
        let voxel_mm = if voxel_mm.is_finite() { voxel_mm } else { 1.0 };
        stats.step_mm = voxel_mm * quality.voxels();
        let steps_in_cells = (STEPS_IN_CELLS / quality.voxels()).ceil() as u32;
        let manner = Manner { step_mm: stats.step_mm as f32, steps_in_cells, dark: self.dark(quality) };
        let tiles = (width as usize).div_ceil(TILE) * (height as usize).div_ceil(TILE);
        for depths in &depths {
            let shown = depths.shown;
            stats.tiles += tiles as u64;
            stats.tiles_skipped += (tiles - shown) as u64;
            *(if shown > 0 { &mut stats.fragments } else { &mut stats.fragments_skipped }) += 1;
        }
        stats.prepare_ms = begin.elapsed().as_secs_f64() * 1e3;
        let picture = Picture {
            placed: &placed.pieces,
            layered: &placed.layered,
            depths: &depths,
            surfaces: &surfaces,
            grids: &grids,
            rays,
            manner,
            size,
            wide,
        };
        let counts = [const { AtomicU64::new(0) }; 3];
        let tetrahedra = AtomicU64::new(0);
        let done = AtomicUsize::new(0);
        let (w, bands) = (width as usize, (height as usize).div_ceil(TILE));
        // What is before a strip is scan-converted at once.
        let per_strip =
            if grids.is_empty() { 1 } else { STRIP.min(bands.div_ceil(4 * rayon::current_num_threads())) };
        let strips = pixels.par_chunks_mut(w * TILE * per_strip).with_max_len(1).enumerate();
        let fresh = || (Scratch::default(), grids.iter().map(|_| Strip::default()).collect::<Vec<_>>());
        strips.try_for_each_init(fresh, |(scratch, cells), (strip, rows)| {
            let first = strip * per_strip;
            for (cells, grid) in cells.iter_mut().zip(&grids) {
                cells.fill(grid, first * TILE..first * TILE + rows.len() / w);
                let scanned = std::mem::take(&mut cells.counts).scanned;
                tetrahedra.fetch_add(scanned, Ordering::Relaxed);
            }
            for (band, rows) in (first..).zip(rows.chunks_mut(w * TILE)) {
                let cells = InStrip { list: cells, before: (band - first) * TILE * w };
                let (work, crossings) = picture.band(band, rows, &cells, scratch);
                for (count, more) in counts.iter().zip([work.cells, work.finished, crossings]) {
                    count.fetch_add(more, Ordering::Relaxed);
                }
                let bands_done = done.fetch_add(1, Ordering::Relaxed) + 1;
                if !progress(bands_done, bands) {
                    return Err(CpuError::Cancelled);
                }
            }
            Ok(())
        })?;
        [stats.cells, stats.pixels_finished, stats.layers] = counts.map(AtomicU64::into_inner);
        stats.tetrahedra = grids.iter().map(cells::Among::tetrahedra).sum();
        stats.tetrahedra_scanned = tetrahedra.into_inner();
        stats.frame_ms = begin.elapsed().as_secs_f64() * 1e3;
        Ok((FloatImage { width, height, pixels }, stats))
    }

    /// How a grid that is alone is drawn.
    fn of_grids(&self, quality: Quality) -> cells::Options {
        let dark = f64::from(self.dark(quality));
        let ends_early = quality == Quality::Draft && dark > 0.0;
        cells::Options {
            early: ends_early.then(|| Early { threshold: 1.0 - 2.0 * dark, ..Early::default() }),
            skip_clear: self.skips.empty,
            wide: self.instructions == Instructions::Best,
            ..cells::Options::default()
        }
    }

    /// What may be left out behind a pixel falls with the error of the steps, which goes with their square.
    fn dark(&self, quality: Quality) -> f32 {
        match self.skips.finished {
            Finish::Never => 0.0,
            Finish::WithQuality => {
                (quality.voxels().powi(2) / 1024.0).clamp(1.0 / 65536.0, 1.0 / 512.0) as f32
            }
            Finish::Below(through) => through,
        }
    }

    /// Makes ready what is not, lets go of what the scene does not show. For each volume of the scene its place among
    /// the kept and that of its transfer function.
    fn ready(&mut self, scene: &Scene, stats: &mut Stats) -> Vec<[usize; 2]> {
        let is_same = |(transfer, mode, ..): &(Arc<Transfer>, VolumeMode, Occupancy, Table),
                       item: &VolumeItem| {
            *mode == item.mode && Transfer::same(transfer, &item.transfer)
        };
        self.kept.retain_mut(|kept| {
            let shown = |grid: &Arc<Grid>| Arc::ptr_eq(grid, kept.field.grid());
            let items: Vec<&VolumeItem> = scene.volumes.iter().filter(|item| shown(&item.grid)).collect();
            kept.transfers.retain(|known| items.iter().any(|item| is_same(known, item)));
            !items.is_empty()
        });
        let mut ready = Vec::new();
        for item in &scene.volumes {
            let known = self.kept.iter().position(|k| Arc::ptr_eq(k.field.grid(), &item.grid));
            let volume = known.unwrap_or_else(|| {
                stats.volumes_prepared += 1;
                self.kept.push(Kept { field: Field::new(&item.grid), transfers: Vec::new() });
                self.kept.len() - 1
            });
            let Kept { field, transfers } = &mut self.kept[volume];
            let known = transfers.iter().position(|t| is_same(t, item));
            let transfer = known.unwrap_or_else(|| {
                stats.transfers_prepared += 1;
                let occupancy = if self.skips.empty {
                    Occupancy::new(field, &item.transfer, item.mode)
                } else {
                    Occupancy::full(field)
                };
                let table = Table::new(&item.transfer, &item.grid);
                transfers.push((Arc::clone(&item.transfer), item.mode, occupancy, table));
                transfers.len() - 1
            });
            let (_, _, occupancy, _) = &transfers[transfer];
            let bricks = field.bricks.iter().product::<usize>();
            stats.bricks += bricks as u64;
            stats.bricks_skipped += (bricks - occupancy.occupied) as u64;
            ready.push([volume, transfer]);
        }
        ready
    }
}

/// The pieces of a scene before the camera.
struct PlacedScene<'a> {
    pieces: Vec<Placed<'a>>,
    layered: Vec<Layered<'a>>,
    rays: Rays,
}

fn place<'a>(
    scene: &'a Scene,
    kept: &'a [Kept],
    ready: &[[usize; 2]],
    view: &View,
    stats: &mut Stats,
) -> PlacedScene<'a> {
    // Zeta counts from the first thing before the eye, so that it keeps its digits.
    let mut near = f64::INFINITY;
    for item in &scene.volumes {
        for piece in &item.pieces {
            let view_from_volume = view.view_from_world * piece.pose * item.pose;
            for corner in item.grid.corners_in_world() {
                near = near.min(view_from_volume.point(&corner).z);
            }
        }
    }
    for item in &scene.meshes {
        let view_from_mesh = view.view_from_world * item.pose;
        let [low, high] = item.mesh.bounds();
        for corner in 0..8 {
            let at =
                [0, 1, 2].map(|axis: usize| if corner >> axis & 1 == 1 { high[axis] } else { low[axis] });
            near = near.min(view_from_mesh.point(&Point::from(at)).z);
        }
    }
    for item in &scene.grids {
        let view_from_grid = view.view_from_world * item.pose;
        near = item.grid.points().iter().fold(near, |near, p| near.min(view_from_grid.point(p).z));
    }
    let rays = Rays::new(view, if near.is_finite() { near.max(0.0) } else { 0.0 });
    let (mut pieces, mut layered) = (Vec::new(), Vec::new());
    for (item, [volume, transfer]) in scene.volumes.iter().zip(ready) {
        let Kept { field, transfers } = &kept[*volume];
        let (_, _, occupancy, table) = &transfers[*transfer];
        if occupancy.occupied == 0 {
            stats.fragments_skipped += item.pieces.len() as u32;
            continue;
        }
        let place = |piece| Placed::new(item, piece, Prepared { field, occupancy, table }, view, &rays);
        let placed = item.pieces.iter().map(place);
        if item.mode == VolumeMode::Composite {
            pieces.extend(placed);
        } else {
            stats.fragments += item.pieces.len() as u32;
            let rescale = item.grid.rescale();
            layered.push(Layered {
                mode: item.mode,
                transfer: &item.transfer,
                rescale: [rescale.slope, rescale.intercept],
                pieces: placed.collect(),
            });
        }
    }
    PlacedScene { pieces, layered, rays }
}

/// A picture being drawn.
struct Picture<'a> {
    placed: &'a [Placed<'a>],
    layered: &'a [Layered<'a>],
    depths: &'a [Depths],
    surfaces: &'a Surfaces,
    grids: &'a [cells::Among],
    rays: Rays,
    manner: Manner,
    size: [u32; 2],
    /// Whether eight rays go at once; only where the machine has the instructions.
    wide: bool,
}

/// What the rays of a row of tiles have of each grid.
#[derive(Debug, Clone, Copy)]
struct InStrip<'a> {
    list: &'a [Strip],
    /// Pixels of the strip before the row of tiles.
    before: usize,
}

impl Picture<'_> {
    /// Draws a row of tiles; the work it was, and the crossings of surfaces in it. The same source for every kind of
    /// instructions, and no fused multiply-add, so that all give the same bytes.
    fn band(
        &self,
        band: usize,
        rows: &mut [[f32; 4]],
        cells: &InStrip<'_>,
        scratch: &mut Scratch,
    ) -> (Work, u64) {
        #[cfg(target_arch = "x86_64")]
        if self.wide {
            #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
            // SAFETY: they were detected.
            return unsafe { self.band_avx2(band, rows, cells, scratch) };
        }
        self.tiles(band, rows, cells, scratch, &|_, _, _, _| None)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn band_avx2(
        &self,
        band: usize,
        rows: &mut [[f32; 4]],
        cells: &InStrip<'_>,
        scratch: &mut Scratch,
    ) -> (Work, u64) {
        self.tiles(band, rows, cells, scratch, &|piece, depths, [x, y], work| {
            if !packet::suits(piece) {
                return None;
            }
            let mut lanes = packet::Lanes::default();
            for (lane, lens) in lanes.lens.iter_mut().enumerate() {
                *lens = self.rays.lens(x + lane % BLOCK[0], y + lane / BLOCK[0]);
                lanes.rays[lane] = self.ray(*lens);
                [lanes.from[lane], lanes.to[lane]] = piece.stretch(*lens, depths).unwrap_or_default();
            }
            Some(packet::march(piece, &lanes, self.manner, work))
        })
    }

    /// All tiles of a row, block by block. `eight` is asked first for the pixels of a block whose rays see nothing but
    /// one piece; it may leave them to the rays one by one.
    #[inline(always)]
    fn tiles(
        &self,
        band: usize,
        rows: &mut [[f32; 4]],
        cells: &InStrip<'_>,
        scratch: &mut Scratch,
        eight: &impl Fn(&Placed<'_>, [f32; 2], [usize; 2], &mut Work) -> Option<[[f32; 4]; 8]>,
    ) -> (Work, u64) {
        let mut work = Work::default();
        let [width, height] = self.size.map(|n| n as usize);
        let crossings = self.surfaces.band(band, &self.rays, width, height);
        let mut shown = Vec::with_capacity(self.placed.len());
        let tall = rows.len() / width;
        let mut spans: Vec<Spans<'_>> = Vec::with_capacity(self.grids.len());
        let in_cells = |place: usize| {
            self.grids
                .iter()
                .zip(cells.list)
                .map(move |(grid, strip)| strip.pixel(grid, cells.before + place, self.rays.near_mm))
        };
        for tile in 0..width.div_ceil(TILE) {
            shown.clear();
            for (piece, depths) in self.placed.iter().zip(self.depths) {
                let range = depths.tile(tile, band);
                if range[0] < range[1] {
                    shown.push((piece, range));
                }
            }
            if shown.is_empty() && self.layered.is_empty() && self.grids.is_empty() && crossings.len() == 0 {
                continue;
            }
            for block in 0..TILE * TILE / 8 {
                let across = TILE / BLOCK[0];
                let (left, top) = (tile * TILE + block % across * BLOCK[0], block / across * BLOCK[1]);
                let (right, bottom) = ((left + BLOCK[0]).min(width), (top + BLOCK[1]).min(tall));
                if left >= right || top >= bottom {
                    continue;
                }
                let is_whole = right - left == BLOCK[0] && bottom - top == BLOCK[1];
                let places = (top..bottom).flat_map(|row| (left..right).map(move |x| row * width + x));
                let drawn = match (&shown[..], self.layered) {
                    ([(piece, depths)], [])
                        if is_whole
                            && places.clone().all(|place| {
                                crossings.of(place).is_empty() && in_cells(place).all(|s| s.is_empty())
                            }) =>
                    {
                        eight(piece, *depths, [left, band * TILE + top], &mut work)
                    }
                    _ => None,
                };
                if let Some(pixels) = drawn {
                    for (place, pixel) in places.zip(pixels) {
                        rows[place] = pixel;
                    }
                    continue;
                }
                for place in places {
                    let hits = crossings.of(place);
                    spans.clear();
                    spans.extend(in_cells(place).filter(|spans| !spans.is_empty()));
                    if shown.is_empty() && self.layered.is_empty() && hits.is_empty() && spans.is_empty() {
                        continue;
                    }
                    let lens = self.rays.lens(place % width, band * TILE + place / width);
                    let ray = self.ray(lens);
                    rows[place] = march::pixel(
                        &shown,
                        self.layered,
                        hits,
                        &spans,
                        lens,
                        &ray,
                        self.manner,
                        scratch,
                        &mut work,
                    );
                }
            }
        }
        (work, crossings.len() as u64)
    }

    #[inline(always)]
    fn ray(&self, lens: [f64; 2]) -> Ray {
        let mm_per_zeta = self.rays.mm_per_zeta(lens);
        let [x, y, z] = self.rays.direction(lens);
        let direction = [(x / mm_per_zeta) as f32, (y / mm_per_zeta) as f32, (z / mm_per_zeta) as f32];
        Ray { mm_per_zeta: mm_per_zeta as f32, direction }
    }
}
