//! BC4, unsigned: one channel in two 8-bit end points and sixteen 3-bit indices. 8 bytes.
//!
//! | bits | holds |
//! |---|---|
//! | 0..8, 8..16 | end points `e0`, `e1` |
//! | 16..64 | index of texel `i` (x fastest) at bit `16 + 3·i` |
//!
//! If `e0 > e1`, the eight values are `e0`, `e1`, then six between them at sevenths; otherwise `e0`, `e1`, four
//! between them at fifths, then 0 and 255. The second kind serves blocks that touch the ends of the range, as air
//! does.
//!
//! The encoder takes the range of the block as end points, moves them to the least squares of the indices found,
//! and keeps what has the least error of all tried; a block whose values span at most 7 is kept exactly.
//!
//! Source: KDFS, "RGTC Compressed Texture Image Formats", section "BC4 unsigned".

use super::block::Texels;

/// Which of the two kinds a block is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Six values between the end points.
    Sevenths,
    /// Four values between the end points, and 0 and 255.
    Fifths,
}

impl Kind {
    /// Steps from one end point to the other.
    fn steps(self) -> u32 {
        match self {
            Self::Sevenths => 7,
            Self::Fifths => 5,
        }
    }
}

/// Decodes one block.
pub(super) fn decode(block: [u8; 8]) -> Texels<1> {
    let palette = palette(block[0], block[1]);
    let bits = u64::from_le_bytes(block) >> 16;
    std::array::from_fn(|i| [palette[(bits >> (3 * i) & 7) as usize]])
}

/// The eight values of a block, by index.
fn palette(e0: u8, e1: u8) -> [u8; 8] {
    let kind = if e0 > e1 { Kind::Sevenths } else { Kind::Fifths };
    let (e0, e1) = (u32::from(e0), u32::from(e1));
    let levels = match kind {
        Kind::Sevenths => levels::<7>(e0, e1),
        Kind::Fifths => levels::<5>(e0, e1),
    };
    let mut palette = [e0, e1, 0, 0, 0, 0, 0, 255];
    let between = kind.steps() as usize - 1;
    palette[2..2 + between].copy_from_slice(&levels[1..=between]);
    palette.map(|level| level as u8)
}

/// The values from `a` to `b` in `STEPS` steps, rounded to the nearest; `STEPS` is odd, so there are no ties. A
/// constant, since these divisions are much of the encoder's time.
fn levels<const STEPS: u32>(a: u32, b: u32) -> [u32; 8] {
    std::array::from_fn(|i| {
        let i = (i as u32).min(STEPS);
        (2 * ((STEPS - i) * a + i * b) + STEPS) / (2 * STEPS)
    })
}
