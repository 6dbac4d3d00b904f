//! What the kernels mean, in plain arithmetic.

use super::group::{Centre, Lines, Ranges, Rows};
use super::{Four, INDICES_2, INDICES_3, OTHERS, SCALES, STRIP};
use crate::bc::batch::EDGE;
use crate::bc::endpoints::TEXELS;

/// The blocks of a strip of scalars.
pub(super) fn strip(strip: [&[u8; STRIP * EDGE]; EDGE]) -> [[u8; 8]; STRIP] {
    std::array::from_fn(|block| {
        let values = std::array::from_fn(|i| strip[i / EDGE][block * EDGE + i % EDGE]);
        scalars(values).to_le_bytes()
    })
}

/// The block of BC4 of 16 values.
fn scalars(values: [u8; TEXELS]) -> u64 {
    let low = values.into_iter().fold(255, u8::min);
    let high = values.into_iter().fold(0, u8::max);
    if low == high {
        return u64::from(low) * 0x101;
    }
    let lowered = low.min(255 - 7);
    let (low, high) = if high - low < 7 { (lowered, lowered + 7) } else { (low, high) };
    let scale = SCALES[usize::from(high - low)];
    u64::from(high) | u64::from(low) << 8 | sevenths(values, high.into(), scale) << 16
}

/// The index bits of values from `top` down; none of a block that has no ends.
fn sevenths(values: [u8; TEXELS], top: u16, scale: u16) -> u64 {
    let place = |value: u8| (u32::from(top.wrapping_sub(value.into())) * u32::from(scale) + (1 << 14)) >> 15;
    values
        .into_iter()
        .rev()
        .fold(0, |bits, value| bits << 3 | u64::from(INDICES_3[place(value) as usize & 7]))
}

/// The texels of a block.
fn texels(rows: Rows<'_>) -> [[u8; 4]; TEXELS] {
    std::array::from_fn(|i| rows[i / EDGE].as_chunks::<4>().0[i % EDGE])
}

/// The ranges of blocks side by side.
pub(super) fn ranges([a, b, c, d]: [&[Four]; EDGE], ranges: &mut Ranges) {
    for l in 0..a.len() {
        let texels = texels([&a[l], &b[l], &c[l], &d[l]]);
        let all = |with: fn(u8, u8) -> u8| {
            let both = |a: [u8; 4], b: [u8; 4]| std::array::from_fn(|c| with(a[c], b[c]));
            texels.into_iter().fold(texels[0], both)
        };
        (ranges.low[l], ranges.high[l]) = (all(u8::min), all(u8::max));
    }
}

/// The sums of products of the other two channels with the leading one.
pub(super) fn sums(rows: Rows<'_>, centre: Centre) -> [i16; 2] {
    let (texels, lead) = (texels(rows), centre.lead as usize);
    let off = |i: usize, c: usize| (i16::from(texels[i][c]) + i16::from(centre.below[c]) + 1) / 2 - 128;
    OTHERS[lead].map(|c| {
        let column =
            |x: usize| -> i16 { [x, TEXELS - EDGE + x].map(|i| off(i, c) * off(i, lead)).iter().sum() };
        (0..EDGE).map(|x| column(x) >> 1).sum()
    })
}

/// The index bits of colour and of alpha, of rows 0 and 1, and of rows 2 and 3.
pub(super) fn indices(rows: Rows<'_>, lines: &Lines, l: usize) -> [[u32; 2]; 2] {
    let texels = texels(rows);
    let index = |texel: [u8; 4]| {
        let along: i32 = (0..3).map(|c| i32::from(texel[c]) * i32::from(lines.direction[l][c] as i8)).sum();
        let thirds =
            lines.halfway.iter().filter(|halfway| lines.from[l] - along > i32::from(halfway[l])).count();
        u32::from(INDICES_2[thirds])
    };
    let colour = texels.into_iter().rev().fold(0, |bits, texel| bits << 2 | index(texel));
    let alpha = sevenths(texels.map(|texel| texel[3]), lines.top[l], lines.scale[l]);
    [[colour & 0xFFFF, (alpha & 0xFF_FFFF) as u32], [colour >> 16, (alpha >> 24) as u32]]
}
