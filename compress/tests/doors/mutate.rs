//! Mutations of bytes, by a chance that is the same in every run.

/// Numbers that decoders trip over.
const NUMBERS: [u64; 16] = [
    0,
    1,
    2,
    3,
    0x7F,
    0x80,
    0xFF,
    0x100,
    0x7FFF,
    0xFFFF,
    0x7FFF_FFFF,
    0x8000_0000,
    0xFFFF_FFFF,
    0x7FFF_FFFF_FFFF_FFFF,
    0x8000_0000_0000_0000,
    u64::MAX,
];

/// Largest number of mutations at once.
const MOST_AT_ONCE: u64 = 6;

/// Longest that mutated bytes may become.
const LONGEST: usize = 1 << 16;

/// A source of chance: `SplitMix64`.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xD134_2543_DE82_EF95))
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// A number below `end`; 0 if that is 0.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        if end == 0 { 0 } else { (self.next() % end as u64) as usize }
    }

    /// True once in `times`.
    pub(crate) fn once_in(&mut self, times: u64) -> bool {
        self.next().is_multiple_of(times)
    }

    pub(crate) fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }

    /// One of the seeds, mutated, or mixed with another one.
    pub(crate) fn mutation(&mut self, seeds: &[Vec<u8>]) -> Vec<u8> {
        let seed = self.pick(seeds);
        self.mutation_of(seed, seeds)
    }

    /// One seed, mutated, or mixed with others.
    pub(crate) fn mutation_of(&mut self, seed: &[u8], seeds: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = seed.to_vec();
        for _ in 0..self.next() % (MOST_AT_ONCE + 1) {
            self.mutate(&mut bytes, seeds);
        }
        bytes.truncate(LONGEST);
        bytes
    }

    /// Changes the bytes once.
    fn mutate(&mut self, bytes: &mut Vec<u8>, seeds: &[Vec<u8>]) {
        let at = self.place(bytes.len());
        let rest = bytes.len() - at;
        match self.next() % 10 {
            0 if rest > 0 => bytes[at] ^= 1 << self.below(8),
            1 if rest > 0 => bytes[at] = self.next() as u8,
            2 => {
                let width = *self.pick(&[1, 2, 4, 8]);
                let number = self.number(bytes.len());
                for (byte, new) in bytes[at..].iter_mut().zip(&number.to_le_bytes()[..width]) {
                    *byte = *new;
                }
            }
            3 => {
                // A field that is nearly right is the likeliest to be believed.
                let width = *self.pick(&[1, 2, 4, 8]);
                let by = self.next() % 9;
                let mut field = [0; 8];
                let end = (at + width).min(bytes.len());
                field[..end - at].copy_from_slice(&bytes[at..end]);
                let near = u64::from_le_bytes(field).wrapping_add(by).wrapping_sub(4);
                bytes[at..end].copy_from_slice(&near.to_le_bytes()[..end - at]);
            }
            4 => bytes.truncate(at),
            5 => {
                let count = self.below(40);
                bytes.extend((0..count).map(|_| self.next() as u8));
            }
            6 => {
                let end = at + self.below(rest.min(64) + 1);
                bytes.drain(at..end);
            }
            7 => {
                let end = at + self.below(rest.min(64) + 1);
                let again = bytes[at..end].to_vec();
                let to = self.below(bytes.len() + 1);
                bytes.splice(to..to, again);
            }
            8 => {
                let other = self.pick(seeds);
                let from = self.below(other.len() + 1);
                bytes.truncate(at);
                bytes.extend(&other[from..]);
            }
            _ => {
                let end = at + self.below(rest.min(300) + 1);
                let fill = self.next() as u8;
                bytes[at..end].fill(fill);
            }
        }
    }

    /// A place in the bytes: often near the beginning or the end, where fields are.
    fn place(&mut self, len: usize) -> usize {
        match self.next() % 4 {
            0 => self.below(len.min(128) + 1),
            1 => len - self.below(len.min(200) + 1),
            _ => self.below(len + 1),
        }
    }

    /// A number that decoders trip over, or one near the length.
    fn number(&mut self, len: usize) -> u64 {
        if self.once_in(4) {
            (len as u64).wrapping_add(self.next() % 5).wrapping_sub(2)
        } else {
            *self.pick(&NUMBERS)
        }
    }
}
