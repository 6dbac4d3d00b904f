//! Blocks side by side: what the kernels of BC1, BC3 and BC4 work on.
//!
//! A kernel is written for one block, in loops over the [`LANES`] blocks of a batch, which the compiler makes vector
//! instructions of. A lane's result depends on that lane alone, so it does not matter which blocks stand together, nor
//! how wide the machine's vectors are.

use super::endpoints::TEXELS;
use crate::simd::fetch_ahead;

/// Voxels of a block in x, and in y.
pub(super) const EDGE: usize = 4;

/// Blocks of a batch.
pub(super) const LANES: usize = 32;

/// One number for each block of a batch.
pub(super) type Row = [i16; LANES];

/// One number for each texel of each block of a batch, by texel.
pub(super) type Plane = [Row; TEXELS];

/// A block of 8 bytes, as four little-endian numbers.
pub(super) type Words = [u16; 4];

/// 2²³: adding it rounds an `f32` from 0 to 2²² to a whole number in its low bits, ties to even.
pub(super) const ROUND: f32 = 8_388_608.0;

/// A number from 0 to 32767, rounded to the nearest.
#[inline(always)]
pub(super) fn rounded(value: f32) -> i16 {
    (value + ROUND).to_bits() as i16
}

/// A number from -16384 to 16383, rounded to the nearest.
#[inline(always)]
pub(super) fn rounded_signed(value: f32) -> i16 {
    rounded(value + 16384.0) - 16384
}

/// One value for each texel, `each!(|i| …)`. Written out, so that the loop around it over lanes is one of straight code,
/// which the compiler vectorises; a closure called 16 times it may leave as a call.
macro_rules! each {
    (|$i:ident| $value:expr) => {
        each!(@ $i $value; 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15)
    };
    (@ $i:ident $value:expr; $($number:literal)*) => {
        [$({ let $i: usize = $number; $value }),*]
    };
}
pub(super) use each;

/// Takes `new` where `mask` is all ones, and leaves what is there where it is 0.
#[inline(always)]
pub(super) fn choose(mask: &Row, new: &Row, out: &mut Row) {
    for l in 0..LANES {
        out[l] ^= (out[l] ^ new[l]) & mask[l];
    }
}

/// The sum of all texels.
#[inline(always)]
pub(super) fn sum(values: &[i16; TEXELS]) -> i16 {
    let mut sum = values[0];
    for value in &values[1..] {
        sum = sum.wrapping_add(*value);
    }
    sum
}

/// The least of all texels.
#[inline(always)]
pub(super) fn least_of(values: &[i16; TEXELS]) -> i16 {
    let mut least = values[0];
    for value in &values[1..] {
        least = least.min(*value);
    }
    least
}

/// The greatest of all texels.
#[inline(always)]
pub(super) fn most_of(values: &[i16; TEXELS]) -> i16 {
    let mut most = values[0];
    for value in &values[1..] {
        most = most.max(*value);
    }
    most
}

/// The blocks of a batch from their first words, their second words, and so on.
#[inline(always)]
pub(super) fn interleave(words: &[[u16; LANES]; 4], blocks: &mut [Words; LANES]) {
    let [a, b, c, d] = words;
    for l in 0..LANES {
        blocks[l] = [a[l], b[l], c[l], d[l]];
    }
}

/// One channel, alone in its bytes, by texel.
#[inline(always)]
pub(super) fn scalar_plane(strip: [&[u8; LANES * EDGE]; EDGE], plane: &mut Plane) {
    for (j, row) in strip.into_iter().enumerate() {
        let (words, _) = row.as_chunks::<EDGE>();
        let [a, b, c, d] = &mut plane.as_chunks_mut::<EDGE>().0[j];
        for l in 0..LANES {
            let word = u32::from_le_bytes(words[l]);
            a[l] = (word & 255) as i16;
            b[l] = (word >> 8 & 255) as i16;
            c[l] = (word >> 16 & 255) as i16;
            d[l] = (word >> 24) as i16;
        }
    }
}

/// Four channels of blocks side by side, each alone in its bytes.
#[inline(always)]
pub(super) fn colour_rows(rows: &[[[u8; 16]; LANES]; EDGE], channels: &mut [[[u8; LANES * EDGE]; EDGE]; 4]) {
    let [red, green, blue, alpha] = channels;
    for j in 0..EDGE {
        let texels = rows[j].as_flattened().as_chunks::<4>().0;
        let (red, green, blue, alpha) = (&mut red[j], &mut green[j], &mut blue[j], &mut alpha[j]);
        for x in 0..LANES * EDGE {
            [red[x], green[x], blue[x], alpha[x]] = texels[x];
        }
    }
}

/// Encodes a row of blocks of one channel strip by strip of `BLOCKS` blocks, which have `VOXELS` voxels in a row; past
/// the end of a row its last voxel is repeated.
#[inline(always)]
pub(super) fn strips<const VOXELS: usize, const BLOCKS: usize>(
    rows: [&[u8]; EDGE],
    out: &mut [[u8; 8]],
    encode: impl Fn([&[u8; VOXELS]; EDGE]) -> [[u8; 8]; BLOCKS],
) {
    let mut padded = [[0; VOXELS]; EDGE];
    for (i, out) in out.chunks_mut(BLOCKS).enumerate() {
        let rest = rows.map(|row| &row[i * VOXELS..]);
        // The rows of the next blocks follow these.
        for rest in rest {
            fetch_ahead(rest, EDGE * rows[0].len());
        }
        if let ([Some(a), Some(b), Some(c), Some(d)], Some(out)) =
            (rest.map(|row| row.first_chunk()), out.first_chunk_mut())
        {
            *out = encode([a, b, c, d]);
            continue;
        }
        for (padded, row) in padded.iter_mut().zip(rest) {
            let (whole, beyond) = padded.split_at_mut(row.len().min(VOXELS));
            whole.copy_from_slice(&row[..whole.len()]);
            beyond.fill(row.last().copied().unwrap_or_default());
        }
        out.copy_from_slice(&encode(padded.each_ref())[..out.len()]);
    }
}
