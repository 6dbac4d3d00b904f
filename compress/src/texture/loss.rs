//! How far a texture is from what the samples say, without decoding it as a whole.

use rayon::prelude::*;

use super::Mapping;
use super::domain::{Domain, SampleKind};
use super::rows::{EDGE, Rows, VOXELS};
use super::table::ColourTable;
use super::volume::Volume;
use super::window::Window;
use crate::simd::Simd;
use crate::{BlockFormat, bc};

/// The error of a texture over all voxels of its volume.
///
/// Of colours it is that of the three premultiplied components and of opacity, four a voxel, in 1/255, against the
/// unrounded transfer function: the colour of what is not seen is no error. Of scalars it is that of the value, one a
/// voxel, in stored units, against the sample clamped to the window. Of floats the table's own steps are the
/// truth for colours (see [`Domain`]); for scalars half a step is added to the largest error, and its mean square to the
/// squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loss {
    /// The largest absolute error.
    pub largest: f64,
    /// The sum of the squared errors.
    pub squares: f64,
    /// Errors summed: 4 a voxel of colour, 1 of a scalar.
    pub samples: u64,
}

impl Loss {
    /// Peak signal-to-noise ratio, 10·log10(peak² / mean square error), dB; infinite where nothing is lost. The
    /// peak of colours is 255.
    pub fn psnr_db(&self, peak: f64) -> f64 {
        10.0 * (peak * peak * self.samples as f64 / self.squares).log10()
    }

    fn plus(self, other: Self) -> Self {
        Self {
            largest: self.largest.max(other.largest),
            squares: self.squares + other.squares,
            samples: self.samples + other.samples,
        }
    }
}

const NONE: Loss = Loss { largest: 0.0, squares: 0.0, samples: 0 };

/// What one voxel, or one block, adds: the sum of squares, and the largest error.
type Sum = [f32; 2];

fn add([squares, largest]: Sum, [more, error]: Sum) -> Sum {
    [squares + more, if error > largest { error } else { largest }]
}

/// What is known of a block without decoding it.
enum Known<'a> {
    Nothing,
    /// It is without error.
    Exact,
    /// It is a constant, whose error follows from the index alone.
    ByIndex(&'a [Sum]),
}

/// The errors of a mapping, as it is asked for them.
trait Errors: Sync {
    /// Samples of a voxel.
    const SAMPLES: u64;
    /// A decoded texel.
    type Texel: Copy;
    fn domain(&self) -> &Domain;
    /// The texels of the block with these bytes.
    fn decode(&self, block: &[u8]) -> [Self::Texel; VOXELS];
    /// The error of a texel where a voxel of this index is.
    fn error(&self, index: u16, texel: Self::Texel) -> Sum;
    /// What is known of a block without decoding it, from its range of indices.
    fn known(&self, range: [u16; 2], block: &[u8]) -> Known<'_>;
}

struct ColourErrors<'a> {
    table: &'a ColourTable,
    format: BlockFormat,
    /// By index: premultiplied colour and opacity, times 255.
    truth: Vec<[f32; 4]>,
    /// By index: the error of the constant of its run.
    constant: Vec<Sum>,
    /// By run: whether its constant is without error.
    exact: Vec<bool>,
}

impl<'a> ColourErrors<'a> {
    fn new(table: &'a ColourTable, format: BlockFormat) -> Self {
        let truth = table.truth().iter().map(|rgba| premultiplied(*rgba)).collect();
        let mut errors = Self {
            table,
            format,
            truth,
            constant: Vec::with_capacity(table.truth().len()),
            exact: vec![true; table.runs_count()],
        };
        let mut decoded = None;
        for index in 0..=table.domain().last() {
            let run = table.run([index; 2]).unwrap_or_default();
            let texel = match decoded {
                Some((of, texel)) if of == run => texel,
                _ => errors.decode(table.constant_bytes(run.into(), format))[0],
            };
            decoded = Some((run, texel));
            let error = errors.error(index, texel);
            errors.exact[usize::from(run)] &= error[0] == 0.0;
            errors.constant.push(error);
        }
        errors
    }
}

impl Errors for ColourErrors<'_> {
    const SAMPLES: u64 = 4;
    type Texel = [u8; 4];

    fn domain(&self) -> &Domain {
        self.table.domain()
    }

    fn decode(&self, block: &[u8]) -> [[u8; 4]; VOXELS] {
        bc::decode_colours(self.format, block)
    }

    #[inline(always)]
    fn error(&self, index: u16, texel: [u8; 4]) -> Sum {
        let truth = self.truth[usize::from(index)];
        let found = premultiplied(texel.map(|component| f32::from(component) / 255.0));
        (0..4).fold([0.0; 2], |sum, c| {
            let error = (found[c] - truth[c]).abs();
            add(sum, [error * error, error])
        })
    }

    fn known(&self, range: [u16; 2], block: &[u8]) -> Known<'_> {
        match self.table.run(range).map(usize::from) {
            Some(run) if block != self.table.constant_bytes(run, self.format) => Known::Nothing,
            Some(run) if self.exact[run] => Known::Exact,
            Some(_) => Known::ByIndex(&self.constant),
            None => Known::Nothing,
        }
    }
}

struct ScalarErrors<'a> {
    window: &'a Window,
    /// What a texel of 8 bits is in indices, and an index in stored units.
    index_per_texel: f32,
    step: f32,
}

impl<'a> ScalarErrors<'a> {
    fn new(window: &'a Window) -> Self {
        let index_per_texel = f32::from(window.domain().last()) / 255.0;
        Self { window, index_per_texel, step: window.domain().step() as f32 }
    }
}

impl Errors for ScalarErrors<'_> {
    const SAMPLES: u64 = 1;
    type Texel = u8;

    fn domain(&self) -> &Domain {
        self.window.domain()
    }

    fn decode(&self, block: &[u8]) -> [u8; VOXELS] {
        bc::decode_scalars(block)
    }

    #[inline(always)]
    fn error(&self, index: u16, texel: u8) -> Sum {
        let error = (f32::from(texel) * self.index_per_texel - f32::from(index)).abs() * self.step;
        [error * error, error]
    }

    fn known(&self, _: [u16; 2], _: &[u8]) -> Known<'_> {
        Known::Nothing
    }
}

/// The error of the blocks of a whole volume; their number is that of the volume, and the mapping suits the format.
pub(super) fn of_blocks(
    volume: &Volume<'_>,
    mapping: Mapping<'_>,
    format: BlockFormat,
    simd: Simd,
    blocks: &[u8],
) -> Loss {
    match mapping {
        Mapping::Colours(table) => {
            sum_of_blocks(volume, &ColourErrors::new(table, format), simd, format.block_bytes(), blocks)
        }
        Mapping::Scalars(window) => {
            let loss = sum_of_blocks(volume, &ScalarErrors::new(window), simd, format.block_bytes(), blocks);
            of_steps(loss, window.domain())
        }
    }
}

/// The error of 8-bit texels of a whole volume, or, without `rounded`, of 16-bit ones.
pub(super) fn of_texels(volume: &Volume<'_>, mapping: Mapping<'_>, rounded: bool) -> Loss {
    match mapping {
        Mapping::Colours(table) => {
            let errors = ColourErrors::new(table, BlockFormat::Bc3);
            let by_index = |i: u16| errors.error(i, table.texels()[usize::from(i)]);
            sum_of_texels(volume, table.domain(), 4, by_index)
        }
        Mapping::Scalars(window) => {
            let errors = ScalarErrors::new(window);
            let by_index = |i: u16| if rounded { errors.error(i, window.texel(i)) } else { [0.0; 2] };
            of_steps(sum_of_texels(volume, window.domain(), 1, by_index), window.domain())
        }
    }
}

/// With the error of a float in steps of its domain: at most half a step, a twelfth of its square in the mean.
fn of_steps(loss: Loss, domain: &Domain) -> Loss {
    if domain.kind() != SampleKind::F32 {
        return loss;
    }
    let squares = loss.squares + loss.samples as f64 * domain.step() * domain.step() / 12.0;
    Loss { largest: loss.largest + domain.step() / 2.0, squares, ..loss }
}

fn sum_of_blocks<E: Errors>(
    volume: &Volume<'_>,
    errors: &E,
    simd: Simd,
    block_bytes: usize,
    blocks: &[u8],
) -> Loss {
    let extent = volume.extent();
    let [width, height, _] = extent.blocks();
    let rows = blocks.par_chunks_exact(width * block_bytes).enumerate();
    let sums: Vec<Loss> = rows
        .map_init(
            || Rows::new(width),
            |buffer, (row, blocks)| {
                let [y, z] = [row % height, row / height];
                buffer.read(volume, errors.domain(), [0, y, z], width, simd);
                let mut loss = NONE;
                for (i, bytes) in blocks.chunks_exact(block_bytes).enumerate() {
                    // Voxels past the edges are not there to be wrong.
                    let inside = [(extent.x() - EDGE * i).min(EDGE), (extent.y() - EDGE * y).min(EDGE)];
                    let [squares, largest] = of_block(buffer, i, inside, errors, bytes);
                    let samples = E::SAMPLES * (inside[0] * inside[1]) as u64;
                    loss = loss.plus(Loss { largest: largest.into(), squares: squares.into(), samples });
                }
                loss
            },
        )
        .collect();
    // In order, so that the last bits do not depend on which thread was first.
    sums.into_iter().fold(NONE, Loss::plus)
}

/// The error of a block, over the voxels that are inside.
fn of_block<E: Errors>(rows: &Rows, i: usize, [x, y]: [usize; 2], errors: &E, block: &[u8]) -> Sum {
    let lines = rows.block(i).into_iter().take(y);
    match errors.known(rows.range(i), block) {
        Known::Exact => [0.0; 2],
        Known::ByIndex(by_index) => {
            lines.flat_map(|line| &line[..x]).fold([0.0; 2], |sum, i| add(sum, by_index[usize::from(*i)]))
        }
        Known::Nothing => {
            let texels = errors.decode(block);
            let lines = lines.zip(texels.chunks_exact(EDGE));
            let voxels = lines.flat_map(|(line, texels)| line.iter().zip(texels).take(x));
            voxels.fold([0.0; 2], |sum, (index, texel)| add(sum, errors.error(*index, *texel)))
        }
    }
}

/// Of texels the error follows from the index alone: it is enough to count those.
fn sum_of_texels(volume: &Volume<'_>, domain: &Domain, samples: u64, error: impl Fn(u16) -> Sum) -> Loss {
    let extent = volume.extent();
    let entries = usize::from(domain.last()) + 1;
    let counts = (0..extent.z())
        .into_par_iter()
        .fold(
            || (vec![0; extent.x()], vec![0_u64; entries]),
            |(mut row, mut counts), z| {
                for y in 0..extent.y() {
                    volume.indices(domain, [0, y, z], &mut row);
                    for index in &row {
                        counts[usize::from(*index)] += 1;
                    }
                }
                (row, counts)
            },
        )
        .map(|(_, counts)| counts)
        .reduce(|| vec![0; entries], |a, b| a.iter().zip(&b).map(|(a, b)| a + b).collect());
    let met = (0..=domain.last()).zip(counts).filter(|(_, count)| *count > 0);
    met.fold(NONE, |loss, (index, count)| {
        let [squares, largest] = error(index).map(f64::from);
        loss.plus(Loss { largest, squares: squares * count as f64, samples: samples * count })
    })
}

/// Colour times opacity, and opacity, in 1/255.
fn premultiplied([red, green, blue, opacity]: [f32; 4]) -> [f32; 4] {
    let factor = opacity * 255.0;
    [red * factor, green * factor, blue * factor, factor]
}
