//! BC7's eight modes: what each spends its 128 bits on, and the interpolation they share.
//!
//! Source: KDFS, "BPTC Compressed Texture Image Formats", tables "Mode-dependent BPTC parameters" and "BPTC
//! interpolation factors", and the formula below it.

/// What a mode's block holds, in the order of its bits; its number comes first, as that many zeros and a one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mode {
    /// Groups of texels with end points of their own.
    pub(super) subsets: usize,
    /// Bits that choose the pattern of the subsets.
    pub(super) pattern_bits: u32,
    /// Bits that choose the channel which changes places with alpha.
    pub(super) rotation_bits: u32,
    /// Bits that say whether colour takes the second indices.
    pub(super) selection_bits: u32,
    /// Bits of an end point in each of R, G, B.
    pub(super) colour_bits: u32,
    /// Bits of an end point in alpha; 0 means that the block is opaque.
    pub(super) alpha_bits: u32,
    /// Who shares a lowest bit.
    pub(super) low_bits: LowBits,
    /// Bits of an index, and of a second index where colour and alpha have each their own.
    pub(super) index_bits: u32,
    pub(super) second_index_bits: u32,
}

/// The lowest bits of end points, called P-bits in the standard, which all channels of an end point share.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LowBits {
    /// There are none.
    None,
    /// One for each end point.
    EachEnd,
    /// One for both end points of a subset.
    EachSubset,
}

/// The modes, by number.
pub(super) const MODES: [Mode; 8] = [
    mode([3, 4, 0, 0, 4, 0, 3, 0], LowBits::EachEnd),
    mode([2, 6, 0, 0, 6, 0, 3, 0], LowBits::EachSubset),
    mode([3, 6, 0, 0, 5, 0, 2, 0], LowBits::None),
    mode([2, 6, 0, 0, 7, 0, 2, 0], LowBits::EachEnd),
    mode([1, 0, 2, 1, 5, 6, 2, 3], LowBits::None),
    mode([1, 0, 2, 0, 7, 8, 2, 2], LowBits::None),
    mode([1, 0, 0, 0, 7, 7, 4, 0], LowBits::EachEnd),
    mode([2, 6, 0, 0, 5, 5, 2, 0], LowBits::EachEnd),
];

/// A mode of the standard's table: subsets, then bits of pattern, rotation, selection, colour, alpha, index and
/// second index.
const fn mode(numbers: [u32; 8], low_bits: LowBits) -> Mode {
    let [
        subsets,
        pattern_bits,
        rotation_bits,
        selection_bits,
        colour_bits,
        alpha_bits,
        index_bits,
        second_index_bits,
    ] = numbers;
    Mode {
        subsets: subsets as usize,
        pattern_bits,
        rotation_bits,
        selection_bits,
        colour_bits,
        alpha_bits,
        low_bits,
        index_bits,
        second_index_bits,
    }
}

/// The share of the second end point, in parts of 64, of an index of `bits` bits: what the standard's table rounds.
pub(super) fn weight(bits: u32, index: u32) -> u32 {
    let last = (1 << bits) - 1;
    (128 * index + last) / (2 * last)
}

/// The value at `weight` parts of 64 from `a` to `b`.
pub(super) fn interpolate(a: u32, b: u32, weight: u32) -> u8 {
    (((64 - weight) * a + weight * b + 32) >> 6) as u8
}

/// An end point's `bits` bits as 8, the highest repeated below the lowest.
pub(super) fn widen(value: u32, bits: u32) -> u32 {
    value << (8 - bits) | value >> (2 * bits - 8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weights_are_those_of_the_standards_table() {
        let two = [0, 21, 43, 64];
        let three = [0, 9, 18, 27, 37, 46, 55, 64];
        let four = [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64];
        let found = |bits: u32| (0..1 << bits).map(|index| weight(bits, index)).collect::<Vec<_>>();
        assert_eq!(found(2), two, "2 bits");
        assert_eq!(found(3), three, "3 bits");
        assert_eq!(found(4), four, "4 bits");
    }

    #[test]
    fn every_mode_fills_its_block() {
        for (number, mode) in MODES.iter().enumerate() {
            let ends = 2 * mode.subsets as u32;
            let low = match mode.low_bits {
                LowBits::None => 0,
                LowBits::EachEnd => ends,
                LowBits::EachSubset => ends / 2,
            };
            let indices = |bits: u32| if bits == 0 { 0 } else { 16 * bits - mode.subsets as u32 };
            let bits = number as u32
                + 1
                + mode.pattern_bits
                + mode.rotation_bits
                + mode.selection_bits
                + ends * (3 * mode.colour_bits + mode.alpha_bits)
                + low
                + indices(mode.index_bits)
                + indices(mode.second_index_bits);
            assert_eq!(bits, 128, "mode {number}");
        }
    }
}
