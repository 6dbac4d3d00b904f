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
use super::table::ColourTable;
use super::rows::{Cell, EDGE, GROUP, Rows, VOXELS, WIDE, columns, indices, outer};
use super::volume::Volume;
use super::window::Window;
use super::{EncodeStats, Part};
use crate::bc::{self, EncodeOptions, Level};
use crate::BlockFormat;
use crate::simd::Simd;

/// Blocks of one task, about: enough that starting it costs nothing, few enough to share out evenly.
const TASK_BLOCKS: usize = 2048;

/// Blocks that are handed to a kernel together.
const BATCH: usize = curve::BATCH;

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
    fn push(&mut self, texels: &[[u8; N]; VOXELS], at: usize) -> bool {
        for (row, texels) in self.rows.iter_mut().zip(texels.as_chunks::<EDGE>().0) {
            row[self.len * EDGE..][..EDGE].copy_from_slice(texels);
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

/// What one thread works with.
#[derive(Debug)]
struct Scratch<T> {
    rows: Rows<T>,
    curve: Box<curve::Batch>,
    colours: Box<TexelBatch<4>>,
    scalars: Box<TexelBatch<1>>,
    /// Of each block of a row, the run that it is known to be of without looking.
    known: Vec<Option<u16>>,
}

impl<T: Cell> Scratch<T> {
    fn new(blocks: usize) -> Self {
        Self {
            rows: Rows::new(blocks),
            curve: Box::new(curve::Batch::new()),
            colours: Box::new(TexelBatch::new()),
            scalars: Box::new(TexelBatch::new()),
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
    fn rows<T: Cell, const BYTES: usize>(
        &self,
        blocks: &mut [u8],
        task: impl Fn(&mut Scratch<T>, &mut [[u8; BYTES]], usize) -> EncodeStats + Sync,
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

/// Encodes the colours of a part as BC3, or as BC1 if a block has 8 bytes.
pub(super) fn colours<T: Cell, const BYTES: usize>(
    job: &Job<'_>,
    table: &ColourTable,
    format: BlockFormat,
    blocks: &mut [u8],
) -> EncodeStats {
    job.rows::<T, BYTES>(blocks, |scratch, blocks, first| match job.simd {
        Simd::Plain => colour_task(job, table, format, scratch, blocks, first),
        #[cfg(target_arch = "x86_64")]
        Simd::Avx2(_) => {
            #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
            // SAFETY: a value of that variant exists only where AVX2, BMI1, BMI2 and LZCNT were detected.
            unsafe {
                colour_task_avx2(job, table, format, scratch, blocks, first)
            }
        }
    })
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn colour_task_avx2<T: Cell, const BYTES: usize>(
    job: &Job<'_>,
    table: &ColourTable,
    format: BlockFormat,
    scratch: &mut Scratch<T>,
    blocks: &mut [[u8; BYTES]],
    first: usize,
) -> EncodeStats {
    colour_task(job, table, format, scratch, blocks, first)
}

/// Encodes some rows of blocks, `first` of the part and those after it.
#[inline(always)]
fn colour_task<T: Cell, const BYTES: usize>(
    job: &Job<'_>,
    table: &ColourTable,
    format: BlockFormat,
    scratch: &mut Scratch<T>,
    blocks: &mut [[u8; BYTES]],
    first: usize,
) -> EncodeStats {
    let mut task = ColourTask {
        table,
        format,
        options: job.options,
        bounds: T::bounds(table.domain()),
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
                task.blocks[at..at + span.len()].fill(table.constant(run).block());
                task.stats.skipped += span.len() as u64;
            } else {
                let rows = scratch.rows.of(&job.volume, table.domain(), [x + span.start, y, z], span.len());
                task.span(rows, at);
            }
        }
    }
    task.curve.flush(task.blocks);
    task.flush_colours();
    EncodeStats { blocks: task.blocks.len() as u64, ..task.stats }
}

/// Some rows of blocks of colours on the way.
struct ColourTask<'a, T, const BYTES: usize> {
    table: &'a ColourTable,
    format: BlockFormat,
    options: EncodeOptions,
    bounds: [T; 2],
    curve: &'a mut curve::Batch,
    colours: &'a mut TexelBatch<4>,
    blocks: &'a mut [[u8; BYTES]],
    stats: EncodeStats,
}

impl<T: Cell, const BYTES: usize> ColourTask<'_, T, BYTES> {
    /// Encodes the blocks of four rows, from block `at` of the output on.
    #[inline(always)]
    fn span(&mut self, [a, b, c, d]: [&[T]; EDGE], at: usize) {
        let (wide_a, rest_a) = a.as_chunks::<WIDE>();
        let (wide_b, rest_b) = b.as_chunks::<WIDE>();
        let (wide_c, rest_c) = c.as_chunks::<WIDE>();
        let (wide_d, rest_d) = d.as_chunks::<WIDE>();
        for (group, (((a, b), c), d)) in wide_a.iter().zip(wide_b).zip(wide_c).zip(wide_d).enumerate() {
            self.group([a, b, c, d], at + group * GROUP, GROUP);
        }
        if !rest_a.is_empty() {
            // A last group that is not whole is filled up with its last voxel, and only its own blocks are kept.
            let mut rows = [[T::default(); WIDE]; EDGE];
            for (row, rest) in rows.iter_mut().zip([rest_a, rest_b, rest_c, rest_d]) {
                row[..rest.len()].copy_from_slice(rest);
                row[rest.len()..].fill(rest.last().copied().unwrap_or_default());
            }
            let at = at + wide_a.len() * GROUP;
            self.group([&rows[0], &rows[1], &rows[2], &rows[3]], at, rest_a.len() / EDGE);
        }
    }

    /// Encodes the first `count` blocks of a group, from block `at` of the output on.
    #[inline(always)]
    fn group(&mut self, rows: [&[T; WIDE]; EDGE], at: usize, count: usize) {
        let [least, most] = columns(rows);
        let [low, high] = outer([&least, &most]);
        if let Some(run) = self.table.run([low.index(self.bounds), high.index(self.bounds)]) {
            let constant = self.table.constant(run);
            self.blocks[at..at + count].fill(constant.block());
            *(if constant.clear { &mut self.stats.clear } else { &mut self.stats.solid }) += count as u64;
            return;
        }
        // Without branches, since here nothing is likely: each block becomes a constant, and those that are none are
        // listed to be written again.
        let (least, most) = (least.as_chunks::<EDGE>().0, most.as_chunks::<EDGE>().0);
        let mut mixed = [(0_u8, [0_u16; 2]); GROUP + 1];
        let mut mixed_count = 0;
        for (i, block) in self.blocks[at..at + count].iter_mut().enumerate() {
            let [low, high] = outer([&least[i], &most[i]]);
            let (low, high) = (low.index(self.bounds), high.index(self.bounds));
            let runs = self.table.runs();
            let (run, last) = (runs[usize::from(low)], runs[usize::from(high)]);
            let (constant, is_constant) = (self.table.constant(run), run == last);
            *block = constant.block();
            self.stats.clear += u64::from(is_constant & constant.clear);
            self.stats.solid += u64::from(is_constant & !constant.clear);
            mixed[mixed_count] = (i as u8, [low, high]);
            mixed_count += usize::from(!is_constant);
        }
        for (i, range) in &mixed[..mixed_count] {
            let i = usize::from(*i) & (GROUP - 1);
            self.mixed(rows, i, *range, at + i);
        }
    }

    /// Encodes block `i` of a group, of more than one look, as block `at` of the output.
    #[inline(always)]
    fn mixed(&mut self, rows: [&[T; WIDE]; EDGE], i: usize, range: [u16; 2], at: usize) {
        let indices = indices(rows, i, self.bounds);
        if self.options.level == Level::Fast && self.table.is_straight(range) {
            self.stats.curve += 1;
            if self.curve.push(&indices, range, self.table, at) {
                self.curve.flush(self.blocks);
            }
        } else {
            let mut texels = [[0; 4]; VOXELS];
            for (texel, index) in texels.iter_mut().zip(indices) {
                *texel = self.table.texels()[usize::from(index)];
            }
            if self.colours.push(&texels, at) {
                self.flush_colours();
            }
        }
    }

    fn flush_colours(&mut self) {
        let (format, options) = (self.format, self.options);
        self.colours.flush(self.blocks, |rows, out| bc::encode_row(format, rows, out, options));
    }
}

/// Encodes the scalars of a part as BC4.
pub(super) fn scalars<T: Cell>(job: &Job<'_>, window: &Window, blocks: &mut [u8]) -> EncodeStats {
    job.rows::<T, 8>(blocks, |scratch, blocks, first| match job.simd {
        Simd::Plain => scalar_task(job, window, scratch, blocks, first),
        #[cfg(target_arch = "x86_64")]
        Simd::Avx2(_) => {
            #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
            // SAFETY: a value of that variant exists only where AVX2, BMI1, BMI2 and LZCNT were detected.
            unsafe {
                scalar_task_avx2(job, window, scratch, blocks, first)
            }
        }
    })
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn scalar_task_avx2<T: Cell>(
    job: &Job<'_>,
    window: &Window,
    scratch: &mut Scratch<T>,
    blocks: &mut [[u8; 8]],
    first: usize,
) -> EncodeStats {
    scalar_task(job, window, scratch, blocks, first)
}

/// Encodes some rows of blocks, `first` of the part and those after it.
#[inline(always)]
fn scalar_task<T: Cell>(
    job: &Job<'_>,
    window: &Window,
    scratch: &mut Scratch<T>,
    blocks: &mut [[u8; 8]],
    first: usize,
) -> EncodeStats {
    let mut task = ScalarTask {
        window,
        options: job.options,
        bounds: T::bounds(window.domain()),
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
                let rows = scratch.rows.of(&job.volume, window.domain(), [x + span.start, y, z], span.len());
                task.span(rows, at);
            }
        }
    }
    task.flush();
    EncodeStats { blocks: task.blocks.len() as u64, ..task.stats }
}

/// Some rows of blocks of scalars on the way.
struct ScalarTask<'a, T> {
    window: &'a Window,
    options: EncodeOptions,
    bounds: [T; 2],
    scalars: &'a mut TexelBatch<1>,
    blocks: &'a mut [[u8; 8]],
    stats: EncodeStats,
}

impl<T: Cell> ScalarTask<'_, T> {
    /// Encodes the blocks of four rows, from block `at` of the output on.
    #[inline(always)]
    fn span(&mut self, [a, b, c, d]: [&[T]; EDGE], at: usize) {
        let [(a, _), (b, _), (c, _), (d, _)] =
            [a.as_chunks::<EDGE>(), b.as_chunks::<EDGE>(), c.as_chunks::<EDGE>(), d.as_chunks::<EDGE>()];
        for (i, (((a, b), c), d)) in a.iter().zip(b).zip(c).zip(d).enumerate() {
            let indices = indices([a, b, c, d], 0, self.bounds);
            let [low, high] = outer([&indices, &indices]);
            let [low, high] = [self.window.texel(low), self.window.texel(high)];
            if low == high {
                self.blocks[at + i] = solid(low);
                self.stats.solid += 1;
                continue;
            }
            let mut texels = [[0; 1]; VOXELS];
            for (texel, index) in texels.iter_mut().zip(indices) {
                *texel = [self.window.texel(index)];
            }
            if self.scalars.push(&texels, at + i) {
                self.flush();
            }
        }
    }

    fn flush(&mut self) {
        let options = self.options;
        self.scalars.flush(self.blocks, |rows, out| {
            bc::encode_scalar_row(rows.map(|row| row.as_flattened()), out, options);
        });
    }
}

/// The block of BC4 of one texel: both ends the same, all indices 0.
fn solid(texel: u8) -> [u8; 8] {
    [texel, texel, 0, 0, 0, 0, 0, 0]
}
