//! What a block says, and its bits.

use super::modes::{LowBits, MODES, Mode, widen};
use super::partitions::{anchors, subset};
use crate::bc::endpoints::TEXELS;

/// Everything that a block of any mode says.
#[derive(Debug, Clone, Copy)]
pub(super) struct Content {
    /// The mode's number.
    pub(super) mode: usize,
    /// The pattern of subsets.
    pub(super) pattern: usize,
    /// The channel, counted from 1, that has changed places with alpha; 0 for none.
    pub(super) rotation: usize,
    /// Whether colour takes the second indices, and alpha the first.
    pub(super) colour_takes_second: bool,
    /// Codes of the end points without their lowest bits, two a subset.
    pub(super) ends: [[u8; 4]; 4],
    /// Their lowest bits.
    pub(super) low: [u8; 4],
    /// Indices of colour; of alpha too where it has none of its own.
    pub(super) colour: [u8; TEXELS],
    /// Indices of alpha where it has its own.
    pub(super) alpha: [u8; TEXELS],
}

impl Content {
    pub(super) const NONE: Self = Self {
        mode: 6,
        pattern: 0,
        rotation: 0,
        colour_takes_second: false,
        ends: [[0; 4]; 4],
        low: [0; 4],
        colour: [0; TEXELS],
        alpha: [0; TEXELS],
    };

    /// A block of one colour, exactly: in mode 5 alpha has 8 bits, and each value of a channel with 7 is met a third
    /// of the way between neighbours.
    pub(super) fn solid([r, g, b, a]: [u8; 4]) -> Self {
        let mut content = Self { mode: 5, colour: [1; TEXELS], ..Self::NONE };
        for (channel, value) in [r, g, b].into_iter().enumerate() {
            let near = value >> 1;
            let far = match widen(near.into(), 7).cmp(&value.into()) {
                std::cmp::Ordering::Less => near + 1,
                std::cmp::Ordering::Equal => near,
                std::cmp::Ordering::Greater => near - 1,
            };
            (content.ends[0][channel], content.ends[1][channel]) = (near, far);
        }
        (content.ends[0][3], content.ends[1][3]) = (a, a);
        content
    }

    /// The block.
    pub(super) fn pack(mut self) -> [u8; 16] {
        let mode = &MODES[self.mode];
        let anchors = anchors(mode.subsets, self.pattern);
        let anchors = &anchors[..mode.subsets];
        self.clear_anchors(mode, anchors);
        let mut bits = Bits { value: 1 << self.mode, len: self.mode as u32 + 1 };
        bits.put(self.pattern as u32, mode.pattern_bits);
        bits.put(self.rotation as u32, mode.rotation_bits);
        bits.put(self.colour_takes_second.into(), mode.selection_bits);
        let ends = &self.ends[..2 * mode.subsets];
        for channel in 0..4 {
            let stored = if channel == 3 { mode.alpha_bits } else { mode.colour_bits };
            for end in ends {
                bits.put(end[channel].into(), stored);
            }
        }
        let shared = match mode.low_bits {
            LowBits::None => &[][..],
            LowBits::EachEnd => &self.low[..2 * mode.subsets],
            LowBits::EachSubset => &[self.low[0], self.low[2]],
        };
        shared.iter().for_each(|&low| bits.put(low.into(), 1));
        let (first, second) =
            if self.colour_takes_second { (&self.alpha, &self.colour) } else { (&self.colour, &self.alpha) };
        for (indices, count) in [(first, mode.index_bits), (second, mode.second_index_bits)] {
            if count > 0 {
                for (i, &index) in indices.iter().enumerate() {
                    bits.put(index.into(), count - u32::from(anchors.contains(&i)));
                }
            }
        }
        bits.value.to_le_bytes()
    }

    /// Turns round each line whose anchor is in its farther half, so that the highest bit of its index is 0.
    fn clear_anchors(&mut self, mode: &Mode, anchors: &[usize]) {
        let (colour_bits, alpha_bits) = if self.colour_takes_second {
            (mode.second_index_bits, mode.index_bits)
        } else {
            (mode.index_bits, mode.second_index_bits)
        };
        for (number, &anchor) in anchors.iter().enumerate() {
            let last = (1 << colour_bits) - 1;
            if self.colour[anchor] > last / 2 {
                let [a, b] = [2 * number, 2 * number + 1];
                self.ends.swap(a, b);
                self.low.swap(a, b);
                if alpha_bits > 0 {
                    // Alpha has its own line, which stays.
                    (self.ends[a][3], self.ends[b][3]) = (self.ends[b][3], self.ends[a][3]);
                }
                for (i, index) in self.colour.iter_mut().enumerate() {
                    if subset(mode.subsets, self.pattern, i) == number {
                        *index = last - *index;
                    }
                }
            }
        }
        if alpha_bits > 0 {
            let last = (1 << alpha_bits) - 1;
            if self.alpha[0] > last / 2 {
                (self.ends[0][3], self.ends[1][3]) = (self.ends[1][3], self.ends[0][3]);
                self.alpha = self.alpha.map(|index| last - index);
            }
        }
    }
}

/// Bits of a block, put one after the other from the lowest upwards.
struct Bits {
    value: u128,
    len: u32,
}

impl Bits {
    #[inline(always)]
    fn put(&mut self, value: u32, count: u32) {
        self.value |= u128::from(value) << self.len;
        self.len += count;
    }
}
