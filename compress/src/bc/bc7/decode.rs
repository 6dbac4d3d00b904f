//! Decodes a block of any mode.

use super::modes::{LowBits, MODES, Mode, interpolate, weight, widen};
use super::partitions::{anchors, subset};
use crate::bc::block::Texels;
use crate::bc::endpoints::TEXELS;

/// Bits of a block, taken from the lowest upwards.
struct Bits(u128);

impl Bits {
    fn take(&mut self, count: u32) -> u32 {
        let value = self.0 & ((1 << count) - 1);
        self.0 >>= count;
        value as u32
    }
}

/// Decodes one block. The reserved mode, a first byte of 0, is transparent black.
pub(in crate::bc) fn decode(block: [u8; 16]) -> Texels<4> {
    let mut bits = Bits(u128::from_le_bytes(block));
    let number = block[0].trailing_zeros();
    let Some(mode) = MODES.get(number as usize) else { return [[0; 4]; TEXELS] };
    bits.take(number + 1);
    let pattern = bits.take(mode.pattern_bits) as usize;
    let rotation = bits.take(mode.rotation_bits) as usize;
    let colour_takes_second = bits.take(mode.selection_bits) == 1;
    let ends = ends(mode, &mut bits);
    let anchors = &anchors(mode.subsets, pattern)[..mode.subsets];
    let first = weights(mode.index_bits, anchors, &mut bits);
    let second =
        if mode.second_index_bits == 0 { first } else { weights(mode.second_index_bits, anchors, &mut bits) };
    let (colour, alpha) = if colour_takes_second { (second, first) } else { (first, second) };
    std::array::from_fn(|i| {
        let at = 2 * subset(mode.subsets, pattern, i);
        let [a, b] = [ends[at], ends[at + 1]];
        let mut texel = [0, 1, 2, 3].map(|channel: usize| {
            let weight = if channel == 3 { alpha[i] } else { colour[i] };
            interpolate(a[channel], b[channel], weight)
        });
        if rotation > 0 {
            texel.swap(3, rotation - 1);
        }
        texel
    })
}

/// The end points as 8 bits a channel, two a subset.
fn ends(mode: &Mode, bits: &mut Bits) -> [[u32; 4]; 6] {
    let count = 2 * mode.subsets;
    let mut ends = [[0; 4]; 6];
    for channel in 0..4 {
        let stored = if channel == 3 { mode.alpha_bits } else { mode.colour_bits };
        for end in &mut ends[..count] {
            end[channel] = bits.take(stored);
        }
    }
    let mut low = [0; 6];
    match mode.low_bits {
        LowBits::None => {}
        LowBits::EachEnd => low[..count].fill_with(|| bits.take(1)),
        LowBits::EachSubset => low[..count].chunks_exact_mut(2).for_each(|pair| pair.fill(bits.take(1))),
    }
    let extra = u32::from(mode.low_bits != LowBits::None);
    for (end, low) in ends[..count].iter_mut().zip(low) {
        for (channel, value) in end.iter_mut().enumerate() {
            let stored = if channel == 3 { mode.alpha_bits } else { mode.colour_bits };
            *value = if stored == 0 { 255 } else { widen(*value << extra | low, stored + extra) };
        }
    }
    ends
}

/// The weights that sixteen indices of `count` bits stand for; those of the anchors lack their highest bit.
fn weights(count: u32, anchors: &[usize], bits: &mut Bits) -> [u32; TEXELS] {
    std::array::from_fn(|i| weight(count, bits.take(count - u32::from(anchors.contains(&i)))))
}
