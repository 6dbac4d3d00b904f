//! Unstructured grids as volumes, by projection of their cells; on all cores, without a GPU.
//!
//! After Takayama et al., "Cell-projection parallel volume rendering with early ray termination":
//!
//! 1. `split`, `clusters`: cells become tetrahedra, the same across a shared face, in clusters of up to some thousand near
//!    ones. That is done once a grid.
//! 2. `lens`, `in_view`: corners are projected, and cells that may show put roughly in order of depth. That is done once a
//!    picture.
//! 3. `scan`: tetrahedra are scan-converted, several at once: for every pixel whose ray passes it, where the ray enters and leaves it, and
//!    the scalar there. Exact predicates decide near edges which rays those are, and neighbours agree to the bit about depth
//!    on the face that they share: no ray passes between two cells or through both at once.
//! 4. `table`, `fold`: each stretch is integrated for a scalar that runs linearly and the transfer function as it is; a
//!    cluster's stretches are merged in each pixel where they meet, and put in order.
//! 5. `lists`, `early`: for each pixel there is a list of [`Segment`]s, which is composited in order of depth in the end;
//!    clusters and cells behind what is opaque are left out, if asked for ([`Early`]). Grids may be of several parts, not
//!    convex, and cells may lie in a circle before each other.
//! 6. Who does so, by [`Engine`]: `blocks`, threads that share out the picture, all of which have the whole grid; or
//!    `worker`, `wire`, `link`, workers that share out clusters and exchange lists, by messages ([`Link`]), as the paper has it.
//! 7. `group`, `serve`, `orders`: the same workers as processes, each with no more than its part of the grid ([`Group`]); over
//!    MPI where the feature `mpi` is on.
//!
//! **Meaning**: that of `crate::reference`. The scalar is linear within each tetrahedron; fields of cells are constant
//! within each cell. Cells with a value that is not a number are left out, and counted. Where cells overlap, their optical
//! depths add up, and colours are weighted by them, each cell or merged run of cells taken as the same all along its depth;
//! grids that are sound have no such place.
//!
//! **Error**: below 1/255 in any channel; the parts that it is made of are said in `table`. With early termination, at most
//! half of 1 - [`Early::threshold`] is added.
//!
//! **Same bytes**: without early termination the picture and the segments do not depend on how the work is shared out and
//! among how many, on the order of the grid's cells, or on the processor's instructions. With it they depend on the workers'
//! timing, within its bound; by blocks on their size alone.

mod among;
mod blocks;
mod bytes;
mod clusters;
mod early;
mod engine;
mod fold;
mod group;
mod in_view;
mod lens;
mod link;
mod lists;
#[cfg(feature = "mpi")]
pub mod mpi;
mod orders;
mod project;
mod runs;
mod scan;
mod serve;
mod split;
mod spread;
mod stats;
mod table;
#[cfg(test)]
mod tests;
mod wire;
mod worker;

pub(crate) use among::{Among, Spans, Strip, Walker};
pub use clusters::Faults;
pub use early::Early;
pub use engine::Engine;
pub use fold::Segment;
pub use group::Group;
pub use link::{Link, LinkError};
pub(crate) use split::tetrahedra;
pub use spread::Spread;
pub use stats::{Counts, Stats};

use std::sync::{Arc, Weak};
use std::time::Instant;

use thiserror::Error;

use crate::image::FloatImage;
use crate::scene::{Camera, CameraError, CellItem};
use crate::simd::has_wide;
use crate::view::View;
use crate::volume::cells::{CellGrid, Scalar};
use clusters::{Clusters, Grain, Scalars};
use lens::Lens;
use project::Frame;
use table::Table;
use worker::{Gathered, Manner};

/// The largest picture: 16 384 × 16 384.
pub const MAX_PIXELS: u64 = 1 << 28;
/// Pixels that it is wide or high at most: places are told apart to a thousandth of a millionth of a pixel.
pub const MAX_SIDE: u32 = 1 << 20;

/// Whether a picture has pixels, and no more than it may.
fn can_be_drawn(size: [u32; 2]) -> bool {
    let pixels = size.into_iter().map(u64::from).product();
    (1..=MAX_PIXELS).contains(&pixels) && size.iter().all(|&side| side <= MAX_SIDE)
}

/// Workers at most.
pub const MAX_WORKERS: usize = 1024;

/// How a picture of cells is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Whether, and when, what lies behind is given up.
    pub early: Option<Early>,
    /// How many workers; where none is said, one for each thread of the current pool.
    pub workers: Option<usize>,
    /// How they share out the picture.
    pub engine: Engine,
    /// Which cells each worker begins with.
    pub spread: Spread,
    /// Whether a worker without cells takes a third of those of the one that has most.
    pub balance: bool,
    /// Whether workers tell each other which subscreens are terminated.
    pub share: bool,
    /// Whether cells that the transfer function makes clear are left out. The picture is the same either way.
    pub skip_clear: bool,
    /// Whether the segments of each pixel are handed out, beside the picture.
    pub keep_segments: bool,
    /// Whether the machine's widest instructions are used. The picture is the same either way.
    pub wide: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            early: None,
            workers: None,
            engine: Engine::Blocks,
            spread: Spread::Columns,
            balance: true,
            share: true,
            skip_clear: true,
            keep_segments: false,
            wide: true,
        }
    }
}

/// Why there is no picture of cells.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CellsError {
    /// The camera shows nothing.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A side is zero or longer than [`MAX_SIDE`], or there are more pixels than [`MAX_PIXELS`].
    #[error(
        "a picture of {width} by {height} pixels cannot be drawn: take sides of 1 to {MAX_SIDE} pixels and {MAX_PIXELS} in all at most"
    )]
    Size {
        /// As asked for.
        width: u32,
        /// As asked for.
        height: u32,
    },
    /// The grid has no such step.
    #[error("the grid has no step {step}, only {count}")]
    Step {
        /// As asked for, from 0.
        step: usize,
        /// How many there are.
        count: usize,
    },
    /// The step has no such field, or the field no such component.
    #[error("the grid has no field \"{name}\" with that component at that place")]
    Field {
        /// As asked for.
        name: String,
    },
    /// The numbers of early termination are out of their ranges.
    #[error(
        "early termination needs a threshold between 0 and 1, and numbers of subscreens and refreshes above 0"
    )]
    Early,
    /// There is no worker, or there are more than [`MAX_WORKERS`].
    #[error("a picture takes 1 to {MAX_WORKERS} workers")]
    Workers,
    /// Workers cannot go on together.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The caller said to stop.
    #[error("drawing was cancelled")]
    Cancelled,
}

/// A picture of cells.
#[derive(Debug, Clone, PartialEq)]
pub struct CellPicture {
    /// Premultiplied, without background.
    pub image: FloatImage,
    /// What it is made of, where asked for.
    pub segments: Option<Segments>,
    /// How it came about.
    pub stats: Stats,
}

/// The segments of every pixel, nearest first; no two of a pixel overlap.
#[derive(Debug, Clone, PartialEq)]
pub struct Segments {
    width: u32,
    /// Where each pixel's begin, and at the end how many there are.
    starts: Vec<usize>,
    list: Vec<Segment>,
}

impl Segments {
    /// The segments of a pixel; none for one outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> &[Segment] {
        let pixel = y as usize * self.width as usize + x as usize;
        match self.starts.get(pixel..pixel + 2) {
            Some(&[from, to]) if x < self.width => &self.list[from..to],
            _ => &[],
        }
    }
}

/// A grid that was made ready.
#[derive(Debug)]
struct Kept {
    grid: Weak<CellGrid>,
    grain: Grain,
    clusters: Arc<Clusters>,
    /// Of steps: what was drawn last.
    scalars: Vec<(usize, Scalar, Arc<Scalars>)>,
}

/// What of a grid does not depend on the view.
type Prepared = (Arc<Clusters>, Arc<Scalars>);

/// Draws grids. Keeps what it has made ready of a grid for as long as the grid lives.
#[derive(Debug, Default)]
pub struct CellRenderer {
    kept: Vec<Kept>,
}

impl CellRenderer {
    /// A renderer that knows no grid yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Draws a picture of `size`, `[width, height]`.
    ///
    /// `progress` is told, from any thread, about how many clusters of cells are done and of how many; as soon as it answers
    /// `false` the drawing stops.
    ///
    /// # Errors
    /// All of [`CellsError`].
    pub fn render(
        &mut self,
        item: &CellItem,
        camera: &Camera,
        size: [u32; 2],
        options: &Options,
        progress: &(dyn Fn(usize, usize) -> bool + Sync),
    ) -> Result<CellPicture, CellsError> {
        let count = options.workers.unwrap_or_else(rayon::current_num_threads);
        let by_cells = options.engine != Engine::Blocks;
        let ready = self.ready(item, camera, size, options, Grain::of(options, by_cells))?;
        let (frame, manner) = (ready.placed.frame(), ready.manner(options));
        if count == 0 || count > MAX_WORKERS {
            return Err(CellsError::Workers);
        }
        let gathered = options.engine.run(&frame, manner, (count, options.spread), progress)?;
        Ok(ready.picture(gathered, options))
    }

    /// Checks what is asked for, and makes ready what is not.
    fn ready(
        &mut self,
        item: &CellItem,
        camera: &Camera,
        size: [u32; 2],
        options: &Options,
        grain: Grain,
    ) -> Result<Ready, CellsError> {
        let begin = Instant::now();
        if !can_be_drawn(size) {
            let [width, height] = size;
            return Err(CellsError::Size { width, height });
        }
        if options.early.is_some_and(|early| {
            !(early.threshold > 0.0 && early.threshold < 1.0)
                || early.refreshes == 0
                || early.subscreens == Some(0)
        }) {
            return Err(CellsError::Early);
        }
        let view = View::new(camera, size)?;
        let prepared = self.prepare(std::slice::from_ref(item), grain)?;
        let Some(prepared) = prepared.into_iter().next() else { return Err(CellsError::Workers) };
        let prepare_ms = begin.elapsed().as_secs_f64() * 1e3;
        let begin = Instant::now();
        Ok(Ready { placed: Placed::new(prepared, item, &view, options), prepare_ms, begin })
    }

    /// Makes ready what is not of grids and their scalars, and lets go of scalars that are not asked for.
    fn prepare(&mut self, items: &[CellItem], grain: Grain) -> Result<Vec<Prepared>, CellsError> {
        self.kept.retain(|kept| kept.grid.strong_count() > 0);
        let is_of = |item: &CellItem, grid: &Weak<CellGrid>| grid.as_ptr() == Arc::as_ptr(&item.grid);
        for Kept { grid, scalars, .. } in &mut self.kept {
            let mine = || items.iter().filter(|item| is_of(item, grid));
            scalars.retain(|(step, scalar, _)| mine().any(|i| (i.step, &i.scalar) == (*step, scalar)));
        }
        let mut ready = Vec::with_capacity(items.len());
        for item in items {
            let steps = item.grid.steps();
            let missing = CellsError::Step { step: item.step, count: steps.len() };
            let step = steps.get(item.step).ok_or(missing)?;
            let missing = || CellsError::Field { name: item.scalar.name.clone() };
            let field = item.scalar.field(step).ok_or_else(missing)?;
            let is_kept = |kept: &Kept| kept.grain == grain && is_of(item, &kept.grid);
            let index = self.kept.iter().position(is_kept).unwrap_or_else(|| {
                let grid = Arc::downgrade(&item.grid);
                let clusters = Arc::new(Clusters::new(&item.grid, grain));
                self.kept.push(Kept { grid, grain, clusters, scalars: Vec::new() });
                self.kept.len() - 1
            });
            let Kept { clusters, scalars, .. } = &mut self.kept[index];
            let known = scalars.iter().find(|(step, scalar, _)| (*step, scalar) == (item.step, &item.scalar));
            let values = known.map(|(_, _, values)| Arc::clone(values)).unwrap_or_else(|| {
                let of = |n: usize| item.scalar.part.of(field, n);
                let values = Arc::new(Scalars::new(clusters, item.scalar.place, of));
                scalars.push((item.step, item.scalar.clone(), Arc::clone(&values)));
                values
            });
            ready.push((Arc::clone(clusters), values));
        }
        Ok(ready)
    }
}

/// A grid before the camera.
#[derive(Debug)]
struct Placed {
    clusters: Arc<Clusters>,
    scalars: Arc<Scalars>,
    table: Table,
    lens: Lens,
    size: [u32; 2],
    skip_clear: bool,
    wide: bool,
}

impl Placed {
    /// Of the options only what is skipped and the instructions are looked at.
    fn new((clusters, scalars): Prepared, item: &CellItem, view: &View, options: &Options) -> Self {
        Self {
            clusters,
            scalars,
            table: Table::new(&item.transfer),
            lens: Lens::new(view, &item.pose),
            size: view.size,
            skip_clear: options.skip_clear,
            wide: options.wide && has_wide(),
        }
    }

    fn frame(&self) -> Frame<'_> {
        Frame {
            clusters: &self.clusters,
            scalars: &self.scalars,
            table: &self.table,
            lens: self.lens,
            size: self.size,
            skip_clear: self.skip_clear,
            wide: self.wide,
        }
    }

    /// How many tetrahedra the grid has.
    fn tetrahedra(&self) -> u64 {
        (0..self.clusters.len()).map(|cluster| self.clusters.count(cluster) as u64).sum()
    }
}

/// What a picture is drawn from.
struct Ready {
    placed: Placed,
    prepare_ms: f64,
    begin: Instant,
}

impl Ready {
    fn manner(&self, options: &Options) -> Manner {
        let side = options.early.map_or(1, |early| self.side(&early));
        let Options { early, share, balance, keep_segments: keep, .. } = *options;
        Manner { early, side, share, balance, keep }
    }

    /// Pixels that a subscreen is wide: half of what a cell is in the picture, since a cell may lie in several.
    fn side(&self, early: &Early) -> usize {
        let Placed { clusters, lens, size, .. } = &self.placed;
        let longer = size[0].max(size[1]);
        if let Some(count) = early.subscreens {
            return longer.div_ceil(count.max(1)).max(1) as usize;
        }
        let (mut sum, mut cells) = (0.0, 0.0);
        let frame = self.placed.frame();
        for cluster in 0..clusters.len() {
            let (reach, nearest) = frame.reach(cluster);
            if !reach.is_empty() {
                let count = clusters.count(cluster) as f64;
                let wide = clusters.cell_mm(cluster) * lens.pixels_per_mm(nearest);
                sum += wide.min(f64::from(longer)) * count;
                cells += count;
            }
        }
        if cells > 0.0 { (0.5 * sum / cells).ceil().clamp(1.0, 64.0) as usize } else { 16 }
    }

    fn picture(&self, gathered: Gathered, options: &Options) -> CellPicture {
        let [width, height] = self.placed.size;
        let image = FloatImage { width, height, pixels: gathered.pixels };
        let mut segments = Segments { width, starts: vec![0], list: Vec::new() };
        for row in gathered.kept {
            for count in row.counts {
                let last = segments.starts[segments.starts.len() - 1];
                segments.starts.push(last + count as usize);
            }
            segments.list.extend(row.segments);
        }
        let mut stats = Stats {
            tetrahedra: self.placed.tetrahedra(),
            faults: self.placed.clusters.faults,
            prepare_ms: self.prepare_ms,
            ..Stats::default()
        };
        if let Some(early) = &options.early {
            stats.subscreens = width.max(height).div_ceil(self.side(early) as u32);
        }
        for counts in &gathered.counts {
            stats.total.add(*counts);
        }
        stats.workers = gathered.counts;
        stats.frame_ms = self.begin.elapsed().as_secs_f64() * 1e3;
        CellPicture { image, segments: options.keep_segments.then_some(segments), stats }
    }
}
