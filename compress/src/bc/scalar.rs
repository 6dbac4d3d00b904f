//! The kernel of BC4, and of alpha in BC3: a batch of blocks at a time, see `batch`.

use super::Level;
use super::endpoints::TEXELS;
use super::batch::{LANES, Plane, Row, Words, each, interleave, least_of, most_of, rounded};

/// The narrowest range of end points: with one step a value, what spans at most 7 is kept exactly.
const NARROWEST: i16 = 7;

/// The blocks of a plane.
#[inline(always)]
pub(super) fn encode(plane: &Plane, level: Level, blocks: &mut [Words; LANES]) {
    let (mut low, mut high) = ([0; LANES], [0; LANES]);
    range(plane, &mut low, &mut high);
    // All ones, or 0 for a block of one value.
    let mut varied = [0; LANES];
    for l in 0..LANES {
        varied[l] = if low[l] == high[l] { 0 } else { -1 };
        let wide = high[l] - low[l] >= NARROWEST;
        low[l] = if wide { low[l] } else { low[l].min(255 - NARROWEST) };
        high[l] = if wide { high[l] } else { low[l] + NARROWEST };
    }
    let _ = level;
    let mut scale = [0; LANES];
    steps_per_value(&low, &high, &mut scale);
    pack(plane, [&low, &high], &scale, &varied, blocks);
}

/// The least and the greatest value of each block.
#[inline(always)]
fn range(plane: &Plane, low: &mut Row, high: &mut Row) {
    for l in 0..LANES {
        let values = each!(|i| plane[i][l]);
        low[l] = least_of(&values);
        high[l] = most_of(&values);
    }
}

/// Sevenths of the range for each value of 8 bits, in units of 1/8192.
#[inline(always)]
fn steps_per_value(low: &Row, high: &Row, scale: &mut Row) {
    for l in 0..LANES {
        scale[l] = rounded(57344.0 / f32::from(high[l] - low[l]));
    }
}

/// The blocks of the nearest of eight values to each, between `low` and `high`.
#[inline(always)]
fn pack(plane: &Plane, [low, high]: [&Row; 2], scale: &Row, varied: &Row, blocks: &mut [Words; LANES]) {
    let mut words = [[0_u16; LANES]; 4];
    for l in 0..LANES {
        let (low, high, scale) = (low[l], high[l], scale[l] as u16);
        let next = each!(|i| {
            let down = (high - plane[i][l].max(low).min(high)) as u16;
            // Steps down from the high end, rounded, and one more: 7 + 1 is 0 since 3 bits are left.
            down.wrapping_mul(scale).wrapping_add(4096 + 8192) >> 13
        });
        let (a, b, c, d) = (four(&next, 0), four(&next, 4), four(&next, 8), four(&next, 12));
        let varied = varied[l] as u16;
        let (low, high) = (low as u16, high as u16);
        words[0][l] = if varied == 0 { plane[0][l] as u16 * 0x101 } else { high | low << 8 };
        words[1][l] = (a | b << 12) & varied;
        words[2][l] = (b >> 4 | c << 8) & varied;
        words[3][l] = (c >> 8 | d << 4) & varied;
    }
    interleave(&words, blocks);
}

/// The indices of four texels, of 3 bits each. They count 0, 2, 3, … 7, 1 from the high end down, where `next` counts
/// 1, 2, … 7, 0.
#[inline(always)]
fn four(next: &[u16; TEXELS], i: usize) -> u16 {
    let four = next[i] | next[i + 1] << 3 | next[i + 2] << 6 | next[i + 3] << 9;
    four ^ (!(four >> 1 | four >> 2) & 0o1111)
}
