//! Colours, a group of blocks at a time: what is found once a block is found for all of them side by side, in loops that
//! the compiler makes vector instructions of.

#![expect(clippy::needless_range_loop, reason = "loops over lanes, the same in all arrays, must vectorise")]

use super::{Four, SCALES};
use crate::bc::batch::EDGE;
use crate::bc::bc1;
use crate::bc::rows::Constants;
use crate::simd::{LINE_BYTES, fetch_ahead};

/// Blocks of a group.
pub(crate) const GROUP: usize = 16;

/// A number of each block.
pub(crate) type PerBlock<T> = [T; GROUP];

/// The four rows of a block.
pub(super) type Rows<'a> = [&'a Four; EDGE];

/// What the covariances of a block are found with: the channel that leads, and 255 less the middle of each channel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Centre {
    pub(super) lead: u32,
    pub(super) below: [u8; 4],
}

/// The least and the greatest values of each block, by channel.
#[derive(Debug, Default)]
pub(super) struct Ranges {
    pub(super) low: PerBlock<[u8; 4]>,
    pub(super) high: PerBlock<[u8; 4]>,
}

/// Encodes a row of blocks of BC3, or of BC1 if they have 8 bytes. It is given what is done block by block: finding the
/// ranges; the sums of products of half the distances from the middle, of the two channels that do not lead with the one
/// that does, half of each column's in the first and the last row; and the indices, of colour and of alpha.
#[inline(always)]
pub(super) fn row<const BYTES: usize>(
    [a, b, c, d]: [&[Four]; EDGE],
    out: &mut [[u8; BYTES]],
    ranges: impl Fn([&[Four]; EDGE], &mut Ranges),
    sums: impl Fn(Rows<'_>, Centre) -> [i16; 2],
    indices: impl Fn(Rows<'_>, &Lines, usize) -> [[u32; 2]; 2],
) {
    let across = a.len();
    let mut group = Group::default();
    let mut constants = Constants::new();
    for (i, out) in out.chunks_mut(GROUP).enumerate() {
        let count = out.len();
        let [a, b, c, d] = [&a[i * GROUP..], &b[i * GROUP..], &c[i * GROUP..], &d[i * GROUP..]];
        let [a, b, c, d] = [&a[..count], &b[..count], &c[..count], &d[..count]];
        for line in (0..count).step_by(LINE_BYTES / size_of::<Four>()) {
            // The rows of the next blocks follow these.
            for row in [a, b, c, d] {
                fetch_ahead(&row[line..], EDGE * across);
            }
        }
        let block = |l: usize| [&a[l], &b[l], &c[l], &d[l]];
        ranges([a, b, c, d], &mut group.ranges);
        let Ranges { low, high } = &group.ranges;
        if low[..count] == high[..count] {
            for (low, out) in low.iter().zip(out) {
                *out = constants.block(*low);
            }
            continue;
        }
        // Those that are not of one colour. Without a branch, since which they are is not to be foreseen.
        let (mut varied, mut some) = ([0_u8; GROUP], 0);
        for l in 0..count {
            varied[some] = l as u8;
            some += usize::from(low[l] != high[l]);
        }
        let varied = || varied[..some].iter().map(|l| usize::from(*l) % GROUP);
        group.centre();
        for l in varied() {
            group.sums[l] = sums(block(l), Centre { lead: group.lead[l], below: group.below[l] });
        }
        group.find_ends();
        group.find_lines();
        if BYTES == 16 {
            group.find_alphas();
        }
        for l in varied() {
            group.parts.indices[l] = indices(block(l), &group.lines, l);
        }
        let mut blocks = group.parts.blocks();
        let mut single = 0_u32;
        for l in 0..GROUP {
            single |= u32::from(group.first[l] == group.second[l]) << l;
        }
        while single != 0 {
            let l = single.trailing_zeros() as usize;
            single &= single - 1;
            blocks[l][1] = group.middle(l);
        }
        for (block, out) in blocks.into_iter().zip(out) {
            stored(block, out);
        }
    }
}

/// The blocks of a group.
#[derive(Debug, Default)]
struct Group {
    ranges: Ranges,
    lead: PerBlock<u32>,
    below: PerBlock<[u8; 4]>,
    sums: PerBlock<[i16; 2]>,
    /// The ends as they are stored, and as they are decoded.
    first: PerBlock<u32>,
    second: PerBlock<u32>,
    from: [PerBlock<i32>; 3],
    to: [PerBlock<i32>; 3],
    lines: Lines,
    parts: Parts,
}

/// What blocks are put together from.
#[derive(Debug, Default)]
pub(crate) struct Parts {
    /// Both colours, in the order that means four colours, and what turns the indices where that is not theirs.
    ends: PerBlock<u32>,
    turned: PerBlock<u32>,
    /// Both values of alpha, and all ones if there are indices.
    alphas: PerBlock<u16>,
    varied: PerBlock<u64>,
    /// The bits of the indices of colour and of alpha, of rows 0 and 1, and of rows 2 and 3.
    pub(crate) indices: PerBlock<[[u32; 2]; 2]>,
}

impl Parts {
    /// Takes the two colours of each block, in the order that its indices mean.
    #[inline(always)]
    pub(crate) fn order_ends(&mut self, first: &PerBlock<u32>, second: &PerBlock<u32>) {
        for l in 0..GROUP {
            let (first, second) = (first[l], second[l]);
            self.turned[l] = if first < second { 0x5555_5555 } else { 0 };
            self.ends[l] = first.max(second) | first.min(second) << 16;
        }
    }

    /// Takes the two values of alpha of each block: without indices if they are the same.
    #[inline(always)]
    pub(crate) fn take_alphas(&mut self, first: &PerBlock<u16>, second: &PerBlock<u16>) {
        for l in 0..GROUP {
            self.alphas[l] = first[l] | second[l] << 8;
            self.varied[l] = if first[l] == second[l] { 0 } else { u64::MAX };
        }
    }

    /// Alpha and colour of each block.
    #[inline(always)]
    pub(crate) fn blocks(&self) -> PerBlock<[u64; 2]> {
        let mut blocks = [[0; 2]; GROUP];
        for l in 0..GROUP {
            let [first, second] = self.indices[l].map(|half| u64::from(half[0]) | u64::from(half[1]) << 32);
            let colour = (first & 0xFFFF | second << 16) as u32 ^ self.turned[l];
            let alpha = (first >> 32 | second >> 32 << 24) & self.varied[l];
            blocks[l] =
                [u64::from(self.alphas[l]) | alpha << 16, u64::from(self.ends[l]) | u64::from(colour) << 32];
        }
        blocks
    }
}

/// A block as it is stored: BC3, or BC1.
#[inline(always)]
pub(crate) fn stored<const BYTES: usize>(block: [u64; 2], out: &mut [u8; BYTES]) {
    out.copy_from_slice(&bytemuck::cast::<[u64; 2], [u8; 16]>(block.map(u64::to_le))[16 - BYTES..]);
}

/// What the indices of blocks are found with.
#[derive(Debug, Default)]
pub(super) struct Lines {
    /// The direction from the second end to the first, numbers with a sign.
    pub(super) direction: PerBlock<[u8; 4]>,
    /// How far the first end is along it, less 2¹⁵.
    pub(super) from: PerBlock<i32>,
    /// Where the indices change, in the way from the first end, less 2¹⁵.
    pub(super) halfway: [PerBlock<i16>; 3],
    /// The greater end of alpha, and sevenths for each value below it, see [`SCALES`].
    pub(super) top: PerBlock<u16>,
    pub(super) scale: PerBlock<u16>,
}

impl Group {
    #[inline(always)]
    fn centre(&mut self) {
        let (low, high) = (self.ranges.low.as_flattened(), self.ranges.high.as_flattened());
        for ((below, low), high) in self.below.as_flattened_mut().iter_mut().zip(low).zip(high) {
            *below = !((u16::from(*low) + u16::from(*high)).div_ceil(2) as u8);
        }
        for l in 0..GROUP {
            // No channel is less at its high end, so nothing is borrowed from the next.
            let [red, green, blue] =
                channels(u32::from_le_bytes(self.ranges.high[l]) - u32::from_le_bytes(self.ranges.low[l]));
            let lead = if red >= blue { 0 } else { 2 };
            self.lead[l] = if green >= red && green >= blue { 1 } else { lead };
        }
    }

    #[inline(always)]
    fn find_ends(&mut self) {
        self.first = [0; GROUP];
        self.second = [0; GROUP];
        for c in 0..3 {
            let [factor, widen, round] = [[498, 527, 23], [1012, 259, 33], [498, 527, 23]][c];
            let shift = [11, 5, 0][c];
            for l in 0..GROUP {
                let [low, high] = [self.ranges.low[l], self.ranges.high[l]]
                    .map(|value| channels(u32::from_le_bytes(value))[c]);
                // The first of the others falls if the lower half of the sums says so, the second if the upper does.
                let sums: u32 = bytemuck::cast(self.sums[l]);
                let sums = if cfg!(target_endian = "big") { sums.rotate_left(16) } else { sums };
                let sum = if c == 0 || c == 1 && self.lead[l] == 0 { sums << 16 } else { sums };
                let falls = sum >> 31 == 1 && self.lead[l] != c as u32;
                // In units of 1/256 of a value; then 5 or 6 bits, the nearest.
                let inset = (high - low) * 16;
                let [low, high] =
                    [low * 256 + inset, high * 256 - inset].map(|value| (((value * factor) >> 16) + 8) >> 4);
                let (from, to) = if falls { (low, high) } else { (high, low) };
                self.first[l] |= from << shift;
                self.second[l] |= to << shift;
                self.from[c][l] = ((from * widen + round) >> 6) as i32;
                self.to[c][l] = ((to * widen + round) >> 6) as i32;
            }
        }
        self.parts.order_ends(&self.first, &self.second);
    }

    #[inline(always)]
    fn find_lines(&mut self) {
        for l in 0..GROUP {
            let apart = [0, 1, 2].map(|c: usize| self.from[c][l] - self.to[c][l]);
            let most = apart[0].abs().max(apart[1].abs()).max(apart[2].abs());
            let shift = i32::from(most > 63) + i32::from(most > 127);
            let [red, green, blue] = apart.map(|apart| apart >> shift);
            let bytes = [red, green, blue].map(|value| value as u32 & 255);
            self.lines.direction[l] = (bytes[0] | bytes[1] << 8 | bytes[2] << 16).to_le_bytes();
            let along = |end: &[PerBlock<i32>; 3]| end[0][l] * red + end[1][l] * green + end[2][l] * blue;
            let (from, span) = (along(&self.from), along(&self.from) - along(&self.to));
            self.lines.from[l] = from - 32768;
            // Sixths, rounded down.
            self.lines.halfway[0][l] = (((span as u32 * 10923) >> 16) as i32 - 32768) as i16;
            self.lines.halfway[1][l] = ((span >> 1) - 32768) as i16;
            self.lines.halfway[2][l] = (((span as u32 * 54613) >> 16) as i32 - 32768) as i16;
        }
    }

    #[inline(always)]
    fn find_alphas(&mut self) {
        let (mut first, mut second, mut span) = ([0_u16; GROUP], [0_u16; GROUP], [0_u16; GROUP]);
        for l in 0..GROUP {
            let [low, high] = [self.ranges.low[l], self.ranges.high[l]]
                .map(|value| (u32::from_le_bytes(value) >> 24) as u16);
            let lowered = low.min(255 - 7);
            let narrow = high - low < 7;
            let from = if narrow { lowered } else { low };
            let to = if narrow { lowered + 7 } else { high };
            self.lines.top[l] = to;
            span[l] = to - from;
            first[l] = if low == high { low } else { to };
            second[l] = if low == high { low } else { from };
        }
        // On its own, since look-ups are done one by one.
        for l in 0..GROUP {
            self.lines.scale[l] = SCALES[usize::from(span[l]) & 255];
        }
        self.parts.take_alphas(&first, &second);
    }

    /// The block of the colour in the middle of the box.
    fn middle(&self, l: usize) -> u64 {
        let (low, high) = (self.ranges.low[l], self.ranges.high[l]);
        bc1::solid(std::array::from_fn(|c| low[c].midpoint(high[c])))
    }
}

/// Red, green and blue.
#[inline(always)]
fn channels(texel: u32) -> [u32; 3] {
    [texel & 255, texel >> 8 & 255, texel >> 16 & 255]
}
