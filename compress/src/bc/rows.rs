//! From rows of voxels to blocks of BC1, BC3 and BC4: what is constant is written at once, the rest goes to the kernels
//! in batches.

use super::batch::{EDGE, LANES, Plane, Texels, Words, colour_planes, scalar_plane};
use super::endpoints::TEXELS;
use super::scalar::{self, Effort};
use super::{ColourWeight, EncodeOptions, Level, bc1, colour};
use crate::simd::Simd;

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
    let mut last = ([0; 4], constant::<BYTES>([0; 4]));
    for (begin, rows) in (0..out.len()).step_by(across.max(1)).zip(rows) {
        for place in 0..across {
            let fours =
                [four(rows[0], place), four(rows[1], place), four(rows[2], place), four(rows[3], place)];
            if let Some(texel) = one_texel(&fours) {
                if texel != last.0 {
                    last = (texel, constant(texel));
                }
                out[begin + place] = last.1;
            } else if batch.push(&fours, begin + place) {
                batch.flush(out, options, simd);
            }
        }
    }
    batch.flush(out, options, simd);
}

/// The four texels of a row of block `place`. Past the end the last is repeated.
fn four(row: &[[u8; 4]], place: usize) -> [[u8; 4]; EDGE] {
    let rest = &row[EDGE * place..];
    match rest.first_chunk() {
        Some(four) => *four,
        None => std::array::from_fn(|k| rest[k.min(rest.len() - 1)]),
    }
}

/// The texel that all 16 are, if they are.
fn one_texel(fours: &[[[u8; 4]; EDGE]; EDGE]) -> Option<[u8; 4]> {
    let [a, b, c, d] = [word(&fours[0]), word(&fours[1]), word(&fours[2]), word(&fours[3])];
    let off = (a ^ b) | (a ^ c) | (a ^ d) | (a ^ a.rotate_left(32));
    (off == 0).then_some(fours[0][0])
}

/// The bytes of four texels as one number.
fn word([a, b, c, d]: &[[u8; 4]; EDGE]) -> u128 {
    let [a, b, c, d] = [*a, *b, *c, *d].map(|texel| u128::from(u32::from_le_bytes(texel)));
    a | b << 32 | c << 64 | d << 96
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

/// Blocks of colours that wait for the kernels.
struct Batch {
    texels: Texels,
    /// Which block of the output each is.
    at: [u32; LANES],
    len: usize,
}

impl Batch {
    fn new() -> Self {
        Self { texels: [[[0; 4]; LANES]; TEXELS], at: [0; LANES], len: 0 }
    }

    /// Adds a block that goes to place `at`; says whether the batch is full.
    fn push(&mut self, fours: &[[[u8; 4]; EDGE]; EDGE], at: usize) -> bool {
        for (row, texel) in self.texels.iter_mut().zip(fours.as_flattened()) {
            row[self.len] = *texel;
        }
        self.at[self.len] = at as u32;
        self.len += 1;
        self.len == LANES
    }

    /// Encodes what waits.
    fn flush<const BYTES: usize>(&mut self, out: &mut [[u8; BYTES]], options: EncodeOptions, simd: Simd) {
        if self.len == 0 {
            return;
        }
        let mut blocks = [[[0; 4]; LANES]; 2];
        colours(&self.texels, BYTES == 16, options, simd, &mut blocks);
        let [alphas, colours] = blocks;
        for ((alpha, colour), at) in alphas.into_iter().zip(colours).zip(&self.at[..self.len]) {
            let (alphas, colours) = out[*at as usize].split_at_mut(BYTES - 8);
            if BYTES == 16 {
                alphas.copy_from_slice(&bytes(alpha));
            }
            colours.copy_from_slice(&bytes(colour));
        }
        self.len = 0;
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

/// The blocks of texels of four channels: those of alpha, if it is asked for, and those of colour.
fn colours(
    texels: &Texels,
    with_alpha: bool,
    options: EncodeOptions,
    simd: Simd,
    [alphas, colours]: &mut [[Words; LANES]; 2],
) {
    let mut planes: [Plane; 4] = [[[0; LANES]; TEXELS]; 4];
    split_colours(texels, &mut planes, simd);
    let weighted = with_alpha && options.colour_weight == ColourWeight::Alpha;
    match options.level {
        Level::Fast => {
            if with_alpha {
                range_scalars(&planes[3], alphas, simd);
            }
            fast_colours(&planes, colours, simd);
        }
        Level::Best => {
            if with_alpha {
                fitted_scalars(&planes[3], alphas, simd);
            }
            if weighted {
                weighted_colours(&planes, colours, simd);
            } else {
                best_colours(&planes, colours, simd);
            }
        }
    }
}
