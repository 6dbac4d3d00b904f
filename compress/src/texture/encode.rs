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
use super::volume::Volume;
use super::window::Window;
use super::{EncodeStats, Part};
use crate::BlockFormat;
use crate::bc::{self, EncodeOptions, Level};
use crate::simd::Simd;

/// Voxels of a block along x, and along y.
const EDGE: usize = 4;

/// Blocks of one task, about: enough that starting it costs nothing, few enough to share out evenly.
const TASK_BLOCKS: usize = 2048;

/// Blocks that are handed to a kernel together.
const BATCH: usize = curve::BATCH;

/// Four rows of voxels as table indices, and what is known of each block in them.
#[derive(Debug)]
pub(super) struct Strip {
    rows: [Vec<u16>; EDGE],
    /// The least and the greatest index of each block.
    low: Vec<u16>,
    high: Vec<u16>,
}

impl Strip {
    /// Buffers for rows of at most `blocks` blocks.
    pub(super) fn new(blocks: usize) -> Self {
        let row = || vec![0; blocks * EDGE];
        Self { rows: [row(), row(), row(), row()], low: vec![0; blocks], high: vec![0; blocks] }
    }

    /// Reads `count` blocks from block `[x, y, z]` of the volume on. Past its edges the last voxel is repeated.
    #[inline(always)]
    pub(super) fn read(
        &mut self,
        volume: &Volume<'_>,
        domain: &super::Domain,
        [x, y, z]: [usize; 3],
        count: usize,
    ) {
        let last = volume.extent().y() - 1;
        for (j, row) in self.rows.iter_mut().enumerate() {
            volume.indices(domain, [x * EDGE, (y * EDGE + j).min(last), z], &mut row[..count * EDGE]);
        }
        let [a, b, c, d] = self.rows.each_ref().map(|row| row[..count * EDGE].as_chunks::<EDGE>().0);
        let (low, high) = (&mut self.low[..count], &mut self.high[..count]);
        for i in 0..count {
            let (mut least, mut most) = ([0; EDGE], [0; EDGE]);
            for lane in 0..EDGE {
                let [a, b, c, d] = [a[i][lane], b[i][lane], c[i][lane], d[i][lane]];
                least[lane] = a.min(b).min(c.min(d));
                most[lane] = a.max(b).max(c.max(d));
            }
            low[i] = least[0].min(least[1]).min(least[2].min(least[3]));
            high[i] = most[0].max(most[1]).max(most[2].max(most[3]));
        }
    }

    /// The least and the greatest index of block `i` of those read.
    #[inline(always)]
    pub(super) fn range(&self, i: usize) -> [u16; 2] {
        [self.low[i], self.high[i]]
    }

    /// The indices of row `j` of block `i` of those read.
    #[inline(always)]
    pub(super) fn block_row(&self, i: usize, j: usize) -> &[u16] {
        &self.rows[j][i * EDGE..][..EDGE]
    }
}

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

    /// Adds block `i` of a strip, as block `at` of the output; says whether the batch is full.
    #[inline(always)]
    fn push(&mut self, strip: &Strip, i: usize, texel: impl Fn(u16) -> [u8; N], at: usize) -> bool {
        for (j, row) in self.rows.iter_mut().enumerate() {
            let out = &mut row[self.len * EDGE..][..EDGE];
            for (out, index) in out.iter_mut().zip(strip.block_row(i, j)) {
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
struct Scratch {
    strip: Strip,
    curve: Box<curve::Batch>,
    colours: Box<TexelBatch<4>>,
    scalars: Box<TexelBatch<1>>,
    /// Of each block of a row, the run that it is known to be of without looking.
    known: Vec<Option<u16>>,
}

impl Scratch {
    fn new(blocks: usize) -> Self {
        Self {
            strip: Strip::new(blocks),
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

    /// What is known beforehand of the blocks of a row that begins at block `at`.
    fn know(&self, at: [usize; 3], known: &mut [Option<u16>]) {
        if let Some(skip) = self.skip {
            skip.know(&self.volume, at, known);
        }
    }

    /// The first block of a row of the part, in the volume.
    fn row_at(&self, row: usize) -> [usize; 3] {
        let Part { low, count } = self.part;
        [low[0], low[1] + row % count[1], low[2] + row / count[1]]
    }
}

/// Encodes the colours of a part as BC3, or as BC1 if a block has 8 bytes.
pub(super) fn colours<const BYTES: usize>(
    job: &Job<'_>,
    table: &ColourTable,
    format: BlockFormat,
    blocks: &mut [u8],
) -> EncodeStats {
    job.rows::<BYTES>(blocks, |scratch, blocks, first| match job.simd {
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
fn colour_task_avx2<const BYTES: usize>(
    job: &Job<'_>,
    table: &ColourTable,
    format: BlockFormat,
    scratch: &mut Scratch,
    blocks: &mut [[u8; BYTES]],
    first: usize,
) -> EncodeStats {
    colour_task(job, table, format, scratch, blocks, first)
}

/// Encodes some rows of blocks, `first` of the part and those after it.
#[inline(always)]
fn colour_task<const BYTES: usize>(
    job: &Job<'_>,
    table: &ColourTable,
    format: BlockFormat,
    scratch: &mut Scratch,
    blocks: &mut [[u8; BYTES]],
    first: usize,
) -> EncodeStats {
    let mut stats = EncodeStats { blocks: blocks.len() as u64, ..EncodeStats::default() };
    let Scratch { strip, curve, colours, known, .. } = scratch;
    let encode =
        |rows: [&[[u8; 4]]; EDGE], out: &mut [u8]| bc::encode_row(format, rows, out, job.options, job.simd);
    let constants = table.constants();
    let constant = |run: u16| {
        let constant = &constants[usize::from(run)];
        (constant.clear, constant.block::<BYTES>())
    };
    let width = job.part.count[0];
    for row in 0..blocks.len() / width {
        let at = job.row_at(first + row);
        job.know(at, known);
        for (span, run) in spans(known) {
            let begin = row * width + span.start;
            if let Some(run) = run {
                blocks[begin..begin + span.len()].fill(constant(run).1);
                stats.skipped += span.len() as u64;
                continue;
            }
            strip.read(&job.volume, table.domain(), [at[0] + span.start, at[1], at[2]], span.len());
            for i in 0..span.len() {
                let range = strip.range(i);
                if let Some(run) = table.run(range) {
                    let (clear, block) = constant(run);
                    blocks[begin + i] = block;
                    stats.clear += u64::from(clear);
                    stats.solid += u64::from(!clear);
                } else if job.options.level == Level::Fast && table.is_straight(range) {
                    stats.curve += 1;
                    if curve.push(strip, i, table, begin + i) {
                        curve.flush(blocks);
                    }
                } else if colours.push(strip, i, |index| table.texels()[usize::from(index)], begin + i) {
                    colours.flush(blocks, encode);
                }
            }
        }
    }
    curve.flush(blocks);
    colours.flush(blocks, encode);
    stats
}

/// Encodes the scalars of a part as BC4.
pub(super) fn scalars(job: &Job<'_>, window: &Window, blocks: &mut [u8]) -> EncodeStats {
    job.rows::<8>(blocks, |scratch, blocks, first| match job.simd {
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
fn scalar_task_avx2(
    job: &Job<'_>,
    window: &Window,
    scratch: &mut Scratch,
    blocks: &mut [[u8; 8]],
    first: usize,
) -> EncodeStats {
    scalar_task(job, window, scratch, blocks, first)
}

/// Encodes some rows of blocks, `first` of the part and those after it.
#[inline(always)]
fn scalar_task(
    job: &Job<'_>,
    window: &Window,
    scratch: &mut Scratch,
    blocks: &mut [[u8; 8]],
    first: usize,
) -> EncodeStats {
    let mut stats = EncodeStats { blocks: blocks.len() as u64, ..EncodeStats::default() };
    let Scratch { strip, scalars, known, .. } = scratch;
    let encode = |rows: [&[[u8; 1]]; EDGE], out: &mut [u8]| {
        bc::encode_scalar_row(rows.map(|row| row.as_flattened()), out, job.options, job.simd);
    };
    // Both ends the same, all indices 0.
    let constant = |texel: u8| [texel, texel, 0, 0, 0, 0, 0, 0];
    let width = job.part.count[0];
    for row in 0..blocks.len() / width {
        let at = job.row_at(first + row);
        job.know(at, known);
        for (span, texel) in spans(known) {
            let begin = row * width + span.start;
            if let Some(texel) = texel {
                blocks[begin..begin + span.len()].fill(constant(texel as u8));
                stats.skipped += span.len() as u64;
                continue;
            }
            strip.read(&job.volume, window.domain(), [at[0] + span.start, at[1], at[2]], span.len());
            for i in 0..span.len() {
                let [low, high] = strip.range(i).map(|index| window.texel(index));
                if low == high {
                    blocks[begin + i] = constant(low);
                    stats.solid += 1;
                } else if scalars.push(strip, i, |index| [window.texel(index)], begin + i) {
                    scalars.flush(blocks, encode);
                }
            }
        }
    }
    scalars.flush(blocks, encode);
    stats
}

/// The stretches of blocks that are known to be of one run, and those that are to be read.
fn spans(known: &[Option<u16>]) -> impl Iterator<Item = (Range<usize>, Option<u16>)> {
    known.chunk_by(|a, b| a == b).scan(0, |start, chunk| {
        let first = *start;
        *start += chunk.len();
        Some((first..*start, chunk[0]))
    })
}
