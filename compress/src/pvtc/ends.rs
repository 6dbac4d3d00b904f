//! End points: their fields in a head, and the four values that a pair of them gives.

/// Bits of the field of each step, by T − 1; unused steps have 0.
const BITS: [[u32; 4]; 4] = [[16, 0, 0, 0], [8, 8, 0, 0], [5, 6, 5, 0], [4, 4, 4, 4]];

/// One step's field in the words U and D of a head.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Field {
    /// Its lowest bit.
    pub(super) shift: u32,
    /// Its largest value, 2^bits − 1: M in the formulas.
    pub(super) most: u32,
}

impl Field {
    /// The field of `step` (from 0) in a group of `steps` (1 to 4): the first step has the highest bits.
    pub(super) const fn new(steps: usize, step: usize) -> Self {
        let bits = BITS[steps - 1];
        let (mut shift, mut at) = (16, 0);
        while at <= step {
            shift -= bits[at];
            at += 1;
        }
        Self { shift, most: (1 << bits[step]) - 1 }
    }

    /// The fields of U and D in a head.
    #[inline(always)]
    pub(super) const fn unpack(self, head: u32) -> [u32; 2] {
        [head >> self.shift & self.most, head >> (16 + self.shift) & self.most]
    }

    /// The part of a head that holds U and D, both at most [`Field::most`].
    pub(super) const fn pack(self, [u, d]: [u32; 2]) -> u32 {
        u << self.shift | d << (16 + self.shift)
    }

    /// The field nearest to an 8-bit value.
    pub(super) const fn nearest(self, value: u32) -> u32 {
        // No ties: 255 is odd.
        (value * self.most + 127) / 255
    }

    /// The values of the indices 0 to 3.
    #[inline(always)]
    pub(super) const fn levels(self, [u, d]: [u32; 2]) -> [u32; 4] {
        [self.value(3 * u), self.value(2 * u + d), self.value(u + 2 * d), self.value(3 * d)]
    }

    /// The 8-bit value of a mixture, given in thirds of a field.
    #[inline(always)]
    const fn value(self, thirds: u32) -> u32 {
        (170 * thirds + self.most) / (2 * self.most)
    }
}
