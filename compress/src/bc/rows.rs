//! From rows of voxels to blocks of BC1, BC3 and BC4: what is constant is written at once, the rest goes to the kernels
//! in batches.

use super::batch::{EDGE, LANES, Plane, Texels, Words, colour_planes, scalar_plane};
use super::endpoints::TEXELS;
use super::scalar::{self, Effort};
use super::{ColourWeight, EncodeOptions, Level, bc1, colour};
use crate::simd::Simd;

/// Blocks that are looked at before any is encoded: the memory that they lie in is fetched meanwhile.
const LOOK_AHEAD: usize = 64;

/// Encodes one row of blocks of BC4: `rows` are its four rows of voxels, of one length each, `out` a block for each
/// four voxels begun. Past the end of a row its last voxel is repeated.
pub(super) fn encode_scalars(rows: [&[u8]; EDGE], out: &mut [[u8; 8]], options: EncodeOptions, simd: Simd) {
    let mut blocks = [[0; 4]; LANES];
    let mut padded = [[0; LANES * EDGE]; EDGE];
    for (i, out) in out.chunks_mut(LANES).enumerate() {
        let rest = rows.map(|row| &row[i * LANES * EDGE..]);
        if let [Some(a), Some(b), Some(c), Some(d)] = rest.map(|row| row.first_chunk()) {
            scalars([a, b, c, d], options, simd, &mut blocks);
        } else {
            for (padded, row) in padded.iter_mut().zip(rest) {
                let (whole, beyond) = padded.split_at_mut(row.len().min(LANES * EDGE));
                whole.copy_from_slice(&row[..whole.len()]);
                beyond.fill(row.last().copied().unwrap_or_default());
            }
            scalars(padded.each_ref(), options, simd, &mut blocks);
        }
        for (out, block) in out.iter_mut().zip(&blocks) {
            *out = bytes(*block);
        }
    }
}

/// Encodes rows of blocks of BC1, if they have 8 bytes, or BC3, `across` blocks each; see [`encode_scalars`].
pub(super) fn encode_colours<'a, const BYTES: usize>(
    rows: impl Iterator<Item = [&'a [[u8; 4]]; EDGE]>,
    across: usize,
    out: &mut [[u8; BYTES]],
    options: EncodeOptions,
    simd: Simd,
) {
    let mut batch = Batch::new();
    let mut writer = Writer { out, options, simd, last: ([0; 4], constant([0; 4])) };
    for (begin, rows) in (0..writer.out.len()).step_by(across.max(1)).zip(rows) {
        let fours = rows.map(|row| row.as_flattened().as_chunks().0);
        let whole = fours[0].len();
        for first in (0..whole).step_by(LOOK_AHEAD) {
            let [a, b, c, d] = fours.map(|fours| &fours[first..whole.min(first + LOOK_AHEAD)]);
            let mut varied = 0_u64;
            for (i, (((a, b), c), d)) in a.iter().zip(b).zip(c).zip(d).enumerate() {
                varied |= u64::from(!is_one_colour([a, b, c, d])) << i;
            }
            for (i, four) in a.iter().enumerate() {
                if varied >> i & 1 == 0 {
                    writer.write(four, begin + first + i);
                }
            }
            while varied != 0 {
                let i = varied.trailing_zeros() as usize;
                batch.add([&a[i], &b[i], &c[i], &d[i]], begin + first + i, &mut writer);
                varied &= varied - 1;
            }
        }
        if whole < across {
            let [a, b, c, d] = rows.map(padded);
            if is_one_colour([&a, &b, &c, &d]) {
                writer.write(&a, begin + whole);
            } else {
                batch.add([&a, &b, &c, &d], begin + whole, &mut writer);
            }
        }
    }
    batch.flush(&mut writer);
}

/// The last four texels of a row that is cut off, the last repeated.
fn padded(row: &[[u8; 4]]) -> Four {
    let rest = row.as_chunks::<EDGE>().1;
    let last = rest.len().saturating_sub(1);
    let mut four = [0; 16];
    for (k, texel) in four.as_chunks_mut().0.iter_mut().enumerate() {
        *texel = rest.get(k.min(last)).copied().unwrap_or_default();
    }
    four
}

/// The block of one colour.
pub(super) fn constant<const BYTES: usize>([red, green, blue, alpha]: [u8; 4]) -> [u8; BYTES] {
    let mut block = [0; BYTES];
    let (alphas, colours) = block.split_at_mut(BYTES - 8);
    if let [low, high, ..] = alphas {
        (*low, *high) = (alpha, alpha);
    }
    colours.copy_from_slice(&bc1::solid([red, green, blue]));
    block
}

/// A block as it is stored.
fn bytes([a, b, c, d]: Words) -> [u8; 8] {
    (u64::from(a) | u64::from(b) << 16 | u64::from(c) << 32 | u64::from(d) << 48).to_le_bytes()
}

/// Four texels side by side.
type Four = [u8; 16];

/// Where blocks go, and how they are made.
struct Writer<'a, const BYTES: usize> {
    out: &'a mut [[u8; BYTES]],
    options: EncodeOptions,
    simd: Simd,
    /// The block of one colour that came last: the next is often the same.
    last: ([u8; 4], [u8; BYTES]),
}

impl<const BYTES: usize> Writer<'_, BYTES> {
    /// Writes the block of the colour that all four texels are.
    fn write(&mut self, [red, green, blue, alpha, ..]: &Four, at: usize) {
        let texel = [*red, *green, *blue, *alpha];
        if texel != self.last.0 {
            self.last = (texel, constant(texel));
        }
        self.out[at] = self.last.1;
    }
}

/// Whether all 16 texels of a block are one.
#[inline(always)]
fn is_one_colour(rows: [&Four; EDGE]) -> bool {
    let [a, b, c, d] = rows.map(|row| u128::from_le_bytes(*row));
    (a ^ b) | (a ^ c) | (a ^ d) | (a ^ a.rotate_left(32)) == 0
}

/// Blocks of colours that wait for the kernels.
struct Batch {
    texels: Texels,
    planes: [Plane; 4],
    /// Which block of the output each is.
    at: [u32; LANES],
    len: usize,
}

impl Batch {
    fn new() -> Self {
        Self { texels: [[[0; 4]; LANES]; TEXELS], planes: [[[0; LANES]; TEXELS]; 4], at: [0; LANES], len: 0 }
    }

    /// Adds a block that goes to place `at`, and encodes what waits if that is enough.
    #[inline(always)]
    fn add<const BYTES: usize>(&mut self, rows: [&Four; EDGE], at: usize, writer: &mut Writer<'_, BYTES>) {
        // Always so: it spares the checks of 16 indices.
        let lane = self.len % LANES;
        for (texels, row) in self.texels.as_chunks_mut::<EDGE>().0.iter_mut().zip(rows) {
            for (lanes, texel) in texels.iter_mut().zip(row.as_chunks::<4>().0) {
                lanes[lane] = *texel;
            }
        }
        self.at[lane] = at as u32;
        self.len = lane + 1;
        if self.len == LANES {
            self.flush(writer);
        }
    }

    /// Encodes what waits.
    #[inline(never)]
    fn flush<const BYTES: usize>(&mut self, writer: &mut Writer<'_, BYTES>) {
        if self.len == 0 {
            return;
        }
        let mut alphas = [[0; 4]; LANES];
        let mut colours = [[0; 4]; LANES];
        self.encode(BYTES == 16, writer.options, writer.simd, &mut alphas, &mut colours);
        for ((alpha, colour), at) in alphas.into_iter().zip(colours).zip(&self.at[..self.len]) {
            let (alphas, colours) = writer.out[*at as usize].split_at_mut(BYTES - 8);
            if BYTES == 16 {
                alphas.copy_from_slice(&bytes(alpha));
            }
            colours.copy_from_slice(&bytes(colour));
        }
        self.len = 0;
    }

    /// The blocks of alpha, if it is asked for, and those of colour.
    fn encode(
        &mut self,
        with_alpha: bool,
        options: EncodeOptions,
        simd: Simd,
        alphas: &mut [Words; LANES],
        colours: &mut [Words; LANES],
    ) {
        let planes = &mut self.planes;
        split_colours(&self.texels, planes, simd);
        match (options.level, with_alpha) {
            (Level::Fast, true) => range_scalars(&planes[3], alphas, simd),
            (Level::Best, true) => fitted_scalars(&planes[3], alphas, simd),
            (_, false) => {}
        }
        let weighted = with_alpha && options.colour_weight == ColourWeight::Alpha;
        match (options.level, weighted) {
            (Level::Fast, _) => fast_colours(planes, colours, simd),
            (Level::Best, false) => best_colours(planes, colours, simd),
            (Level::Best, true) => weighted_colours(planes, colours, simd),
        }
    }
}

/// A kernel in both kinds of instructions: the same source, inlined into functions of either kind. Each on its own,
/// since in one large function the compiler leaves calls in the loops.
macro_rules! kernel {
    ($(#[$doc:meta])* $name:ident($($argument:ident: $type:ty),*), $wide:ident, $body:expr) => {
        $(#[$doc])*
        fn $name($($argument: $type),*, simd: Simd) {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
            fn $wide($($argument: $type),*) {
                $body;
            }
            match simd {
                Simd::Plain => $body,
                #[cfg(target_arch = "x86_64")]
                Simd::Avx2(_) => {
                    #[expect(unsafe_code, reason = "instructions that this machine was asked for")]
                    // SAFETY: a value of that variant exists only where AVX2, BMI1, BMI2 and LZCNT were detected.
                    unsafe {
                        $wide($($argument),*);
                    }
                }
            }
        }
    };
}

kernel! {
    /// One channel, by texel.
    split_scalars(strip: [&[u8; LANES * EDGE]; EDGE], plane: &mut Plane), wide,
    scalar_plane(strip, plane)
}
kernel! {
    /// Four channels, by texel.
    split_colours(texels: &Texels, planes: &mut [Plane; 4]), wide, colour_planes(texels, planes)
}
kernel! {
    range_scalars(plane: &Plane, blocks: &mut [Words; LANES]), wide,
    scalar::encode(plane, Effort::Range, blocks)
}
kernel! {
    fitted_scalars(plane: &Plane, blocks: &mut [Words; LANES]), wide,
    scalar::encode(plane, Effort::Fitted, blocks)
}
kernel! {
    searched_scalars(plane: &Plane, blocks: &mut [Words; LANES]), wide,
    scalar::encode(plane, Effort::Searched, blocks)
}
kernel! {
    fast_colours(planes: &[Plane; 4], blocks: &mut [Words; LANES]), wide,
    colour::encode::<false, false>(planes, blocks)
}
kernel! {
    best_colours(planes: &[Plane; 4], blocks: &mut [Words; LANES]), wide,
    colour::encode::<true, false>(planes, blocks)
}
kernel! {
    weighted_colours(planes: &[Plane; 4], blocks: &mut [Words; LANES]), wide,
    colour::encode::<true, true>(planes, blocks)
}

/// The blocks of a strip of one channel.
fn scalars(
    strip: [&[u8; LANES * EDGE]; EDGE],
    options: EncodeOptions,
    simd: Simd,
    blocks: &mut [Words; LANES],
) {
    let mut plane: Plane = [[0; LANES]; TEXELS];
    split_scalars(strip, &mut plane, simd);
    match options.level {
        Level::Fast => range_scalars(&plane, blocks, simd),
        Level::Best => searched_scalars(&plane, blocks, simd),
    }
}
