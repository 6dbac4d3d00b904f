//! The kernels of [`Level::Fast`](super::Level::Fast): BC1, BC3 and BC4, from the range of a block, one block in a few registers.
//!
//! **Scalars**: the ends are the least and the greatest value; a range of fewer values than there are steps is made as
//! wide as the steps, so that every value is met exactly.
//!
//! **Colours**: the ends are two corners of the block's box, moved in by 1/16, on that diagonal which the colours follow:
//! the channel of the widest range leads, and another falls where it rises if their covariance is below 0. A texel's
//! index is that of the nearest point on the line between the ends as they are decoded. Ends that become one colour
//! give way to the block that is nearest to the middle of the box.
//!
//! All is done in whole numbers: `plain` says what, `avx2` does the same in fewer instructions.

#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;
pub(crate) mod group;
mod plain;

use super::batch::{EDGE, strips};
use crate::simd::in_each_kind;

/// Blocks of a strip of scalars.
const STRIP: usize = 8;

/// Four texels side by side.
pub(super) type Four = [u8; 16];

in_each_kind! {
    /// The blocks of BC4 of a row.
    pub(super) fn scalars(rows: [&[u8]; EDGE], out: &mut [[u8; 8]]),
    plain strips(rows, out, plain::strip),
    wide strips(rows, out, |strip| avx2::strip(strip))
}
in_each_kind! {
    /// The blocks of BC3, or of BC1 if they have 8 bytes, of a row of whole blocks.
    pub(super) fn colours<const BYTES: usize>(rows: [&[Four]; EDGE], out: &mut [[u8; BYTES]]),
    plain group::row(rows, out, plain::ranges, plain::sums, plain::indices),
    wide group::row(
        rows,
        out,
        |rows, ranges| avx2::ranges(rows, ranges),
        |rows, centre| avx2::sums(rows, centre),
        |rows, lines, l| avx2::indices::<BYTES>(rows, lines, l),
    )
}

/// Sevenths for each value of 8 bits, in units of 2⁻¹⁵, by the range of a block; from 7 on.
static SCALES: [u16; 256] = {
    let mut scales = [0; 256];
    let mut range = 7;
    while range < 256 {
        let scale = (2 * 7 * 32768 + range) / (2 * range);
        // One is more than 15 bits; it is nearer than 1/7 of a step for all of the 7 values.
        scales[range] = if scale > 32767 { 32767 } else { scale as u16 };
        range += 1;
    }
    scales
};

/// The indices of sevenths of the way from the first, greater end.
pub(crate) const INDICES_3: [u8; 8] = [0, 2, 3, 4, 5, 6, 7, 1];

/// The indices of thirds of the way from the first colour.
pub(crate) const INDICES_2: [u8; 4] = [0, 2, 3, 1];

/// The other two channels, by the one that leads.
const OTHERS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];
