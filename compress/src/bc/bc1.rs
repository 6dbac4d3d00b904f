//! BC1: two colours of 5:6:5 bits and sixteen 2-bit indices. 8 bytes.
//!
//! | bits | holds |
//! |---|---|
//! | 0..16, 16..32 | colours `c0`, `c1`: blue in bits 0..5, green in 5..11, red in 11..16 |
//! | 32..64 | index of texel `i` (x fastest) at bit `32 + 2·i` |
//!
//! If `c0 > c1` as numbers, the four colours are `c0`, `c1`, (2·c0 + c1)/3, (c0 + 2·c1)/3. Otherwise they are
//! `c0`, `c1`, (c0 + c1)/2 and transparent black; the encoder never writes that mode with an index that
//! tells the two apart. In BC3 every block is of the first mode.
//!
//! The encoder takes the ends of the block's principal axis, moves them to the least squares of the indices found,
//! and keeps what has the least error of all tried. Errors are measured against the colours that the decoder
//! gives, not against ideal ones. A block of one colour takes the nearest colour that any two end points mix.
//!
//! Source: KDFS, "S3TC Compressed Texture Image Formats", sections "BC1 with no alpha", "BC1 with alpha".

use std::cmp::Ordering;

use super::block::Texels;

/// Largest values of red, green and blue in a colour.
const MOST: [u32; 3] = [31, 63, 31];

/// How the four colours of a block are meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// Two colours between the end points, whatever their order: BC3.
    FourColours,
    /// By the order of the end points: BC1.
    ByOrder,
}

/// A colour of 5:6:5 bits: red, green, blue.
type Packed = [u32; 3];

/// Decodes one block of BC1.
pub(super) fn decode(block: [u8; 8]) -> Texels<4> {
    decode_mode(block, Mode::ByOrder)
}

/// Decodes one block.
pub(super) fn decode_mode(block: [u8; 8], mode: Mode) -> Texels<4> {
    let c0 = u16::from_le_bytes([block[0], block[1]]);
    let c1 = u16::from_le_bytes([block[2], block[3]]);
    let indices = u32::from_le_bytes([block[4], block[5], block[6], block[7]]);
    let ends = [c0, c1].map(unpacked);
    let palette = if mode == Mode::FourColours || c0 > c1 {
        let [c0, near, far, c1] = four_colours(ends).map(|[r, g, b]| [r as u8, g as u8, b as u8, 255]);
        [c0, c1, near, far]
    } else {
        let [a, b] = ends;
        let colour = |near: u32, far: u32| {
            let [r, g, b] =
                [0, 1, 2].map(|c: usize| widened(near * a[c] + far * b[c], (near + far) * MOST[c]));
            [r as u8, g as u8, b as u8, 255]
        };
        [colour(1, 0), colour(0, 1), colour(1, 1), [0; 4]]
    };
    std::array::from_fn(|i| palette[(indices >> (2 * i) & 3) as usize])
}

/// The four colours from the first end to the second, in thirds; 8 bits a channel.
fn four_colours([a, b]: [Packed; 2]) -> [[u32; 3]; 4] {
    [(3, 0), (2, 1), (1, 2), (0, 3)]
        .map(|(near, far)| [0, 1, 2].map(|c: usize| widened(near * a[c] + far * b[c], 3 * MOST[c])))
}

/// `value` of `most` in 8 bits, rounded to the nearest.
const fn widened(value: u32, most: u32) -> u32 {
    (2 * 255 * value + most) / (2 * most)
}

fn unpacked(colour: u16) -> Packed {
    let colour = u32::from(colour);
    [colour >> 11, colour >> 5 & 63, colour & 31]
}

/// The block nearest to a single colour: index 2 of the best pair of end points in each channel.
pub(super) fn solid([red, green, blue]: [u8; 3]) -> u64 {
    let ends = SOLID[0][usize::from(red)] | SOLID[1][usize::from(green)] | SOLID[2][usize::from(blue)];
    let (c0, c1) = (ends & 0xFFFF, ends >> 16);
    let (ends, indices) = match c0.cmp(&c1) {
        Ordering::Greater => (ends, 0xAAAA_AAAA),
        Ordering::Less => (ends.rotate_left(16), 0xFFFF_FFFF),
        // Not the order of four colours: index 3 would be transparent. All four are alike, so 0 does.
        Ordering::Equal => (ends, 0),
    };
    u64::from(ends) | indices << 32
}

/// By channel and value of 8 bits, the pair of 5-bit (6-bit) end points whose mix (2·a + b)/3 is nearest to it, where
/// they stand in a block.
static SOLID: [[u32; 256]; 3] = {
    let mut tables = [[0; 256]; 3];
    let (fives, sixes) = (solid_table(31), solid_table(63));
    let mut i = 0;
    while i < 256 {
        let ([a, b], [c, d]) = (fives[i], sixes[i]);
        tables[0][i] = (a as u32 | (b as u32) << 16) << 11;
        tables[1][i] = (c as u32 | (d as u32) << 16) << 5;
        tables[2][i] = a as u32 | (b as u32) << 16;
        i += 1;
    }
    tables
};

/// For each value of 8 bits, the pair of end points of up to `most` whose mix (2·a + b)/3 is nearest to it.
const fn solid_table(most: u32) -> [[u8; 2]; 256] {
    let mut table = [[0; 2]; 256];
    let mut met = [false; 256];
    // Near pairs last, so that they win: hardware's rounding errs least between near end points.
    let mut gap = most + 1;
    while gap > 0 {
        gap -= 1;
        let mut low = 0;
        while low + gap <= most {
            let high = low + gap;
            let value = widened(2 * low + high, 3 * most) as usize;
            table[value] = [low as u8, high as u8];
            met[value] = true;
            let value = widened(2 * high + low, 3 * most) as usize;
            table[value] = [high as u8, low as u8];
            met[value] = true;
            low += 1;
        }
    }
    // Values that no pair gives take the pair of the nearest value that has one.
    let mut value = 0;
    while value < 256 {
        let mut off = 0;
        while off < 256 {
            if value >= off && met[value - off] {
                table[value] = table[value - off];
                break;
            }
            if value + off < 256 && met[value + off] {
                table[value] = table[value + off];
                break;
            }
            off += 1;
        }
        value += 1;
    }
    table
}
