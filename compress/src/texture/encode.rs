//! From samples to blocks, row of blocks by row of blocks, never through a volume of texels.
//!
//! The four rows of voxels of a row of blocks become table indices in a buffer of the first cache. Each block is
//! reduced to its least and greatest index. Where both are of one run of the table the block is a constant and done;
//! most of a CT is. What remains is gathered, as places on the table's curve or as texels, in batches of full width,
//! from wherever in the task it comes.

use std::ops::Range;

use rayon::prelude::*;

use super::bricks::SkipMap;
use super::curve;
use super::rows::{Block, EDGE, GROUP, Ranges, Rows};
use super::table::ColourTable;
use super::volume::Volume;
use super::window::Window;
use super::{EncodeStats, Part};
use crate::BlockFormat;
use crate::bc::{self, EncodeOptions, Level};
use crate::simd::Simd;

/// Blocks of one task, about: enough that starting it costs nothing, few enough to share out evenly.
const TASK_BLOCKS: usize = 2048;

/// Blocks that are handed to a kernel together.
const BATCH: usize = 64;

/// Blocks of texels that wait to be encoded; `N` bytes a texel.
#[derive(Debug)]
struct TexelBatch<const N: usize> {
    /// The rows of the blocks, one block beside the other.
    rows: [[[u8; N]; BATCH * EDGE]; EDGE],
    /// Which block of the output each is.
    at: [u32; BATCH],
    len: usize,
}

impl<const N: usize> TexelBatch<N> {
    fn new() -> Self {
        Self { rows: [[[0; N]; BATCH * EDGE]; EDGE], at: [0; BATCH], len: 0 }
    }

    /// Adds a block, as block `at` of the output; says whether the batch is full.
    #[inline(always)]
    fn push(&mut self, block: Block<'_>, at: usize, texel: impl Fn(u16) -> [u8; N]) -> bool {
        for (row, indices) in self.rows.iter_mut().zip(block) {
            let texels = &mut row[self.len * EDGE..][..EDGE];
            for (out, index) in texels.iter_mut().zip(indices) {
                *out = texel(*index);
            }
        }
        self.at[self.len] = at as u32;
        self.len += 1;
        self.len == BATCH
    }

    /// Encodes what waits into its places in `blocks`.
    fn flush<const BYTES: usize>(
        &mut self,
        blocks: &mut [[u8; BYTES]],
        encode_row: impl FnOnce([&[[u8; N]]; EDGE], &mut [u8]),
    ) {
        if self.len == 0 {
            return;
        }
        let mut encoded = [[0; BYTES]; BATCH];
        let encoded = &mut encoded[..self.len];
        encode_row(self.rows.each_ref().map(|row| &row[..self.len * EDGE]), encoded.as_flattened_mut());
        for (block, at) in encoded.iter().zip(self.at) {
            blocks[at as usize] = *block;
        }
        self.len = 0;
    }
}

/// Some blocks of a row.
#[derive(Debug)]
struct List {
    blocks: Vec<u32>,
    len: usize,
}

impl List {
    /// Room for the blocks of a row.
    fn new(blocks: usize) -> Self {
        Self { blocks: vec![0; blocks + 1], len: 0 }
    }

    /// Adds a block if it is asked for: 1, else 0.
    #[inline(always)]
    fn add(&mut self, block: usize, asked: u32) {
        self.blocks[self.len] = block as u32;
        self.len += asked as usize;
    }

    fn blocks(&self) -> impl Iterator<Item = usize> {
        self.blocks[..self.len].iter().map(|block| *block as usize)
    }
}

/// What one thread works with.
#[derive(Debug)]
struct Scratch {
    rows: Rows,
    curve: Box<curve::Batch>,
    colours: Box<TexelBatch<4>>,
    scalars: Box<TexelBatch<1>>,
    /// Blocks of a row: those on the curve, and those that are to be looked at one by one.
    straight: List,
    others: List,
    /// Of each block of a row, the run that it is known to be of without looking.
    known: Vec<Option<u16>>,
}

impl Scratch {
    fn new(blocks: usize) -> Self {
        Self {
            rows: Rows::new(blocks),
            curve: Box::default(),
            colours: Box::new(TexelBatch::new()),
            scalars: Box::new(TexelBatch::new()),
            straight: List::new(blocks),
            others: List::new(blocks),
            known: vec![None; blocks],
        }
    }
}

/// What is to be encoded: samples, and which blocks of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Job<'a> {
    pub(super) volume: Volume<'a>,
    pub(super) part: Part,
    pub(super) skip: Option<&'a SkipMap>,
    pub(super) options: EncodeOptions,
    pub(super) simd: Simd,
}

impl Job<'_> {
    /// Runs `row` on each row of blocks of the part, in parallel over tasks of some rows. It is given the task's
    /// blocks, where in them its row begins, and the first block of the row in the volume.
    fn rows<const BYTES: usize>(
        &self,
        blocks: &mut [u8],
        task: impl Fn(&mut Scratch, &mut [[u8; BYTES]], usize) -> EncodeStats + Sync,
    ) -> EncodeStats {
        let row = self.part.count[0];
        let rows = (TASK_BLOCKS / row).max(1);
        let (blocks, _) = blocks.as_chunks_mut::<BYTES>();
        blocks
            .par_chunks_mut(row * rows)
            .enumerate()
            .map_init(|| Scratch::new(row), |scratch, (i, blocks)| task(scratch, blocks, i * rows))
            .reduce(EncodeStats::default, EncodeStats::plus)
    }

    /// The stretches of a row that begins at block `at`: of blocks that are known to be of one run, and of blocks to
    /// be read.
    #[inline(always)]
    fn spans<'b>(&self, at: [usize; 3], known: &'b mut [Option<u16>]) -> Spans<'b> {
        let len = known.len();
        match self.skip {
            Some(skip) => {
                skip.know(&self.volume, at, known);
                Spans { known, at: 0, len }
            }
            None => Spans { known: &[], at: 0, len },
        }
    }

    /// The first block of a row of the part, in the volume.
    fn row_at(&self, row: usize) -> [usize; 3] {
        let Part { low, count } = self.part;
        [low[0], low[1] + row % count[1], low[2] + row / count[1]]
    }
}

/// Stretches of a row of `len` blocks, of which all is known or nothing.
struct Spans<'a> {
    known: &'a [Option<u16>],
    at: usize,
    len: usize,
}

impl Iterator for Spans<'_> {
    type Item = (Range<usize>, Option<u16>);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        let (start, known) = (self.at, self.known.get(self.at).copied().flatten());
        let same = |other: &&Option<u16>| **other == known;
        self.at = match self.known {
            [] => self.len,
            all => start + all[start..].iter().take_while(same).count(),
        };
        (start < self.len).then_some((start..self.at, known))
    }
}

/// Encodes the colours of a part as BC3 or BC7, or as BC1 if a block has 8 bytes.
pub(super) fn colours<const BYTES: usize>(
    job: &Job<'_>,
    table: &ColourTable,
    format: BlockFormat,
    blocks: &mut [u8],
) -> EncodeStats {
    job.rows::<BYTES>(blocks, |scratch, blocks, first| {
        colour_task(job, table, format, scratch, blocks, first)
    })
}

/// Encodes some rows of blocks, `first` of the part and those after it.
fn colour_task<const BYTES: usize>(
    job: &Job<'_>,
    table: &ColourTable,
    format: BlockFormat,
    scratch: &mut Scratch,
    blocks: &mut [[u8; BYTES]],
    first: usize,
) -> EncodeStats {
    let mut task = ColourTask {
        table,
        format,
        options: job.options,
        simd: job.simd,
        on_curve: job.options.level == Level::Fast && format != BlockFormat::Bc7,
        curve: &mut scratch.curve,
        colours: &mut scratch.colours,
        blocks,
        stats: EncodeStats::default(),
    };
    let width = job.part.count[0];
    for row in 0..task.blocks.len() / width {
        let ([x, y, z], begin) = (job.row_at(first + row), row * width);
        for (span, run) in job.spans([x, y, z], &mut scratch.known) {
            let at = begin + span.start;
            if let Some(run) = run {
                let constant = task.constant(run);
                task.blocks[at..at + span.len()].fill(constant);
                task.stats.skipped += span.len() as u64;
            } else {
                let from = [x + span.start, y, z];
                scratch.rows.read(&job.volume, table.domain(), from, span.len(), job.simd);
                task.sort(&scratch.rows, at, span.len(), &mut scratch.straight, &mut scratch.others);
                task.encode(&scratch.rows, at, &scratch.straight, &scratch.others);
            }
        }
    }
    task.curve.flush(task.blocks, task.simd);
    task.flush_colours();
    EncodeStats { blocks: task.blocks.len() as u64, ..task.stats }
}

/// Some rows of blocks of colours on the way.
struct ColourTask<'a, const BYTES: usize> {
    table: &'a ColourTable,
    format: BlockFormat,
    options: EncodeOptions,
    simd: Simd,
    /// Whether blocks that lie on the curve are encoded from their places on it.
    on_curve: bool,
    curve: &'a mut curve::Batch,
    colours: &'a mut TexelBatch<4>,
    blocks: &'a mut [[u8; BYTES]],
    stats: EncodeStats,
}

impl<const BYTES: usize> ColourTask<'_, BYTES> {
    /// Makes clear those of `count` blocks read that are of the longest clear run, as most are, from block `at` of the
    /// output on, and lists those on the curve and all others.
    #[inline(always)]
    fn sort(&mut self, rows: &Rows, at: usize, count: usize, straight: &mut List, others: &mut List) {
        let [from, to] = self.table.clear();
        let clear = self.constant(self.table.run_at(from));
        straight.len = 0;
        others.len = 0;
        for (group, out) in self.blocks[at..at + count].chunks_mut(GROUP).enumerate() {
            let Ranges { low, high, all } = rows.ranges(group);
            for out in &mut *out {
                *out = clear;
            }
            if all[0] >= from && all[1] <= to {
                continue;
            }
            // Without a branch, since which it is is not to be foreseen.
            for i in 0..out.len() {
                let range = [low[i], high[i]];
                let listed = u32::from(range[0] < from) | u32::from(range[1] > to);
                let on_curve = u32::from(self.table.is_straight(range))
                    & u32::from(!self.table.is_constant(range))
                    & u32::from(self.on_curve);
                straight.add(group * GROUP + i, listed & on_curve);
                others.add(group * GROUP + i, listed & (on_curve ^ 1));
            }
        }
        self.stats.clear += (count - straight.len - others.len) as u64;
        self.stats.curve += straight.len as u64;
    }

    /// Encodes the listed blocks, of those read, from block `at` of the output on.
    #[inline(always)]
    fn encode(&mut self, rows: &Rows, at: usize, straight: &List, others: &List) {
        for i in straight.blocks() {
            if self.curve.push(rows.block(i), rows.range(i), self.table, at + i) {
                self.curve.flush(self.blocks, self.simd);
            }
        }
        for i in others.blocks() {
            if let Some(run) = self.table.run(rows.range(i)) {
                self.blocks[at + i] = self.constant(run);
                let clear = self.table.constant(run).clear;
                *(if clear { &mut self.stats.clear } else { &mut self.stats.solid }) += 1;
            } else {
                let texel = |index| self.table.texels()[usize::from(index)];
                if self.colours.push(rows.block(i), at + i, texel) {
                    self.flush_colours();
                }
            }
        }
    }

    /// The constant block of a run in this task's format.
    fn constant(&self, run: u16) -> [u8; BYTES] {
        let mut block = [0; BYTES];
        match self.format {
            BlockFormat::Bc7 => block.copy_from_slice(&self.table.accurate()[usize::from(run)]),
            _ => block = self.table.constant(run).block(),
        }
        block
    }

    fn flush_colours(&mut self) {
        // What is off the curve has colours that a quick fit would lose 4 dB of.
        let options =
            if self.format == BlockFormat::Bc7 { self.options } else { self.options.with_level(Level::Best) };
        let (format, simd) = (self.format, self.simd);
        self.colours.flush(self.blocks, |rows, out| bc::encode_colours(format, rows, out, options, simd));
    }
}

/// Encodes the scalars of a part as BC4.
pub(super) fn scalars(job: &Job<'_>, window: &Window, blocks: &mut [u8]) -> EncodeStats {
    job.rows::<8>(blocks, |scratch, blocks, first| scalar_task(job, window, scratch, blocks, first))
}

/// Encodes some rows of blocks, `first` of the part and those after it.
fn scalar_task(
    job: &Job<'_>,
    window: &Window,
    scratch: &mut Scratch,
    blocks: &mut [[u8; 8]],
    first: usize,
) -> EncodeStats {
    let mut task = ScalarTask {
        window,
        options: job.options,
        simd: job.simd,
        scalars: &mut scratch.scalars,
        blocks,
        stats: EncodeStats::default(),
    };
    let width = job.part.count[0];
    for row in 0..task.blocks.len() / width {
        let ([x, y, z], begin) = (job.row_at(first + row), row * width);
        for (span, texel) in job.spans([x, y, z], &mut scratch.known) {
            let at = begin + span.start;
            if let Some(texel) = texel {
                task.blocks[at..at + span.len()].fill(solid(texel as u8));
                task.stats.skipped += span.len() as u64;
            } else {
                let from = [x + span.start, y, z];
                scratch.rows.read(&job.volume, window.domain(), from, span.len(), job.simd);
                for i in 0..span.len() {
                    task.block(&scratch.rows, i, at + i);
                }
            }
        }
    }
    task.flush();
    EncodeStats { blocks: task.blocks.len() as u64, ..task.stats }
}

/// Some rows of blocks of scalars on the way.
struct ScalarTask<'a> {
    window: &'a Window,
    options: EncodeOptions,
    simd: Simd,
    scalars: &'a mut TexelBatch<1>,
    blocks: &'a mut [[u8; 8]],
    stats: EncodeStats,
}

impl ScalarTask<'_> {
    /// Encodes block `i` of those read, as block `at` of the output.
    #[inline(always)]
    fn block(&mut self, rows: &Rows, i: usize, at: usize) {
        let [low, high] = rows.range(i).map(|index| self.window.texel(index));
        if low == high {
            self.blocks[at] = solid(low);
            self.stats.solid += 1;
        } else if self.scalars.push(rows.block(i), at, |index| [self.window.texel(index)]) {
            self.flush();
        }
    }

    fn flush(&mut self) {
        let (options, simd) = (self.options, self.simd);
        self.scalars.flush(self.blocks, |rows, out| {
            bc::encode_scalars(rows.map(|row| row.as_flattened()), out, options, simd);
        });
    }
}

/// The block of BC4 of one texel: both ends the same, all indices 0.
fn solid(texel: u8) -> [u8; 8] {
    [texel, texel, 0, 0, 0, 0, 0, 0]
}
