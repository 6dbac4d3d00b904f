//! Blocks side by side: what the kernels of BC1, BC3 and BC4 work on.
//!
//! A kernel is written for one block, in loops over the [`LANES`] blocks of a batch, which the compiler makes vector
//! instructions of. A lane's result depends on that lane alone, so it does not matter which blocks stand together, nor
//! how wide the machine's vectors are.

use super::endpoints::TEXELS;

/// Voxels of a block in x, and in y.
pub(super) const EDGE: usize = 4;

/// Blocks of a batch.
pub(super) const LANES: usize = 32;

/// One number for each block of a batch.
pub(super) type Row = [i16; LANES];

/// One number for each texel of each block of a batch, by texel.
pub(super) type Plane = [Row; TEXELS];

/// Rows of a batch's blocks side by side; `N` bytes a texel.
pub(super) type Strip<const N: usize> = [[[u8; N]; LANES * EDGE]; EDGE];

/// A block of 8 bytes, as four little-endian numbers.
pub(super) type Words = [u16; 4];

/// 2²³: adding it rounds an `f32` from 0 to 2²² to a whole number in its low bits, ties to even.
pub(super) const ROUND: f32 = 8_388_608.0;

/// A number from 0 to 32767, rounded to the nearest.
#[inline(always)]
pub(super) fn rounded(value: f32) -> i16 {
    (value + ROUND).to_bits() as i16
}

/// One value for each texel. Written out, so that the loop around it over lanes is one of straight code, which the
/// compiler vectorises.
#[inline(always)]
pub(super) fn each<T>(f: impl Fn(usize) -> T) -> [T; TEXELS] {
    [
        f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7), f(8), f(9), f(10), f(11), f(12), f(13), f(14), f(15),
    ]
}

/// The sum over all texels.
#[inline(always)]
pub(super) fn sum(f: impl Fn(usize) -> i16) -> i16 {
    let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = each(f);
    let add = i16::wrapping_add;
    let upper = add(add(add(a, b), add(c, d)), add(add(e, f), add(g, h)));
    add(upper, add(add(add(i, j), add(k, l)), add(add(m, n), add(o, p))))
}

/// The least and the greatest of all texels.
#[inline(always)]
pub(super) fn least_of(values: &[i16; TEXELS]) -> i16 {
    let four = |k: usize| values[k].min(values[k + 1]).min(values[k + 2].min(values[k + 3]));
    four(0).min(four(4)).min(four(8).min(four(12)))
}

#[inline(always)]
pub(super) fn most_of(values: &[i16; TEXELS]) -> i16 {
    let four = |k: usize| values[k].max(values[k + 1]).max(values[k + 2].max(values[k + 3]));
    four(0).max(four(4)).max(four(8).max(four(12)))
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

/// Four channels, by channel and texel.
#[inline(always)]
pub(super) fn colour_planes(strip: &Strip<4>, [red, green, blue, alpha]: &mut [Plane; 4]) {
    for (j, row) in strip.iter().enumerate() {
        for k in 0..EDGE {
            let i = EDGE * j + k;
            let (red, green, blue, alpha) = (&mut red[i], &mut green[i], &mut blue[i], &mut alpha[i]);
            for l in 0..LANES {
                let word = u32::from_le_bytes(row[EDGE * l + k]);
                red[l] = (word & 255) as i16;
                green[l] = (word >> 8 & 255) as i16;
                blue[l] = (word >> 16 & 255) as i16;
                alpha[l] = (word >> 24) as i16;
            }
        }
    }
}
