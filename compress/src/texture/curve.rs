//! Blocks of colours that lie on one curve, encoded from the places on that curve alone.
//!
//! A transfer function of one variable is a curve through colours and opacity, so a voxel is known by its place: the
//! way along the curve of colours, and the opacity there. Where the curve between the least and the greatest sample
//! of a block is nearly straight, its ends are the block's end points and the way along is the index: no colour
//! is looked up, no axis is sought. Opacity is the block of BC4 in BC3, from its own range.
//!
//! Plain loops over arrays, to be vectorised where this is inlined; `f32` in a fixed order, so that the bytes do
//! not depend on the instructions used.

use super::encode::Strip;
use super::table::ColourTable;

/// Blocks encoded together.
pub(super) const BATCH: usize = 64;

/// Voxels of a block.
pub(super) const VOXELS: usize = 16;

/// 1.5·2²³: adding it rounds a small `f32` to a whole number in its low bits, ties to even.
const ROUND: f32 = 12_582_912.0;

/// Blocks that wait to be encoded.
#[derive(Debug)]
pub(super) struct Batch {
    /// Opacity of each voxel in the low half, way along in the high half; 1/65535.
    pub(super) places: [[u32; VOXELS]; BATCH],
    /// The colours at the two ends of the block's part of the curve.
    pub(super) ends: [[[u8; 4]; 2]; BATCH],
    /// The ways along of the two ends.
    pub(super) ways: [[u16; 2]; BATCH],
    /// Which block of the output each is.
    pub(super) at: [u32; BATCH],
    /// How many wait.
    pub(super) len: usize,
}

impl Batch {
    pub(super) fn new() -> Self {
        Self {
            places: [[0; VOXELS]; BATCH],
            ends: [[[0; 4]; 2]; BATCH],
            ways: [[0; 2]; BATCH],
            at: [0; BATCH],
            len: 0,
        }
    }

    /// Adds block `i` of a strip, as block `at` of the output; says whether the batch is full.
    #[inline(always)]
    pub(super) fn push(&mut self, strip: &Strip, i: usize, table: &ColourTable, at: usize) -> bool {
        let (rows, _) = self.places[self.len].as_chunks_mut::<4>();
        for (j, row) in rows.iter_mut().enumerate() {
            for (place, index) in row.iter_mut().zip(strip.block_row(i, j)) {
                *place = table.places()[usize::from(*index)];
            }
        }
        let range = strip.range(i).map(usize::from);
        self.ends[self.len] = range.map(|index| table.colours()[index]);
        self.ways[self.len] = range.map(|index| (table.places()[index] >> 16) as u16);
        self.at[self.len] = at as u32;
        self.len += 1;
        self.len == BATCH
    }

    /// Encodes what waits into its places in `blocks`: BC3, or BC1 if a block has 8 bytes.
    #[inline(always)]
    pub(super) fn flush<const BYTES: usize>(&mut self, blocks: &mut [[u8; BYTES]]) {
        for i in 0..self.len {
            let colour = colour(&self.places[i], self.ends[i], self.ways[i]);
            let block = &mut blocks[self.at[i] as usize];
            if BYTES == 16 {
                block[..8].copy_from_slice(&opacity(&self.places[i]).to_le_bytes());
            }
            block[BYTES - 8..].copy_from_slice(&colour.to_le_bytes());
        }
        self.len = 0;
    }
}

/// The block of colours between the ends.
#[inline(always)]
fn colour(places: &[u32; VOXELS], [low, high]: [[u8; 4]; 2], [from, to]: [u16; 2]) -> u64 {
    let (mut c0, mut c1) = (packed(high), packed(low));
    let scale = 3.0 / f32::from(to.saturating_sub(from).max(1));
    let to = f32::from(to);
    let thirds: [u8; VOXELS] =
        std::array::from_fn(|i| ((to - (places[i] >> 16) as f32) * scale + ROUND).to_bits() as u8 & 3);
    let thirds = squeezed::<2>(&thirds);
    // Thirds of the way from the first colour have the indices 0, 2, 3, 1.
    let (ones, twos) = (thirds & 0x5555_5555, thirds >> 1 & 0x5555_5555);
    let mut indices = (ones ^ twos) << 1 | twos;
    if c0 < c1 {
        (c0, c1) = (c1, c0);
        indices ^= 0x5555_5555;
    }
    let indices = if c0 == c1 { 0 } else { indices };
    c0 | c1 << 16 | indices << 32
}

/// The block of opacities.
#[inline(always)]
fn opacity(places: &[u32; VOXELS]) -> u64 {
    let opacities = places.map(|place| place as u16);
    let low = opacities.iter().fold(u16::MAX, |low, &o| low.min(o));
    let high = opacities.iter().fold(0, |high: u16, &o| high.max(o));
    let (low, high) = ((u32::from(low) + 128) / 257, (u32::from(high) + 128) / 257);
    let scale = 7.0 / ((high - low).max(1) * 257) as f32;
    let top = (high * 257) as f32;
    let sevenths: [u8; VOXELS] = std::array::from_fn(|i| {
        let place = (top - f32::from(opacities[i])) * scale;
        let place = if place > 0.0 { place } else { 0.0 };
        let place = if place < 7.0 { place } else { 7.0 };
        let seventh = (place + ROUND).to_bits() as u8;
        // From the first end: 0, then 2 to 7, then 1.
        let next = seventh + 1 & 7;
        next ^ u8::from(next < 2)
    });
    let indices = if high == low { 0 } else { squeezed::<3>(&sevenths) };
    u64::from(high) | u64::from(low) << 8 | indices << 16
}

/// The low `BITS` bits of 16 bytes, one after the other.
#[inline(always)]
fn squeezed<const BITS: u32>(bytes: &[u8; VOXELS]) -> u64 {
    let (halves, _) = bytes.as_chunks::<8>();
    let [low, high] = [0, 1].map(|i: usize| {
        let x = u64::from_le_bytes(halves[i]);
        let x = (x | x >> (8 - BITS)) & (0x0001_0001_0001_0001 * ((1 << (2 * BITS)) - 1));
        let x = (x | x >> (16 - 2 * BITS)) & (0x0000_0001_0000_0001 * ((1 << (4 * BITS)) - 1));
        (x | x >> (32 - 4 * BITS)) & ((1 << (8 * BITS)) - 1)
    });
    low | high << (8 * BITS)
}

/// A colour in 5:6:5 bits, rounded to the nearest.
#[inline(always)]
fn packed([red, green, blue, _]: [u8; 4]) -> u64 {
    let [red, green, blue] = [red, green, blue].map(u64::from);
    // Exact for all of 8 bits: (31·v + 127)/255 and (63·v + 127)/255.
    (red * 249 + 1014 >> 11) << 11 | (green * 253 + 505 >> 10) << 5 | blue * 249 + 1014 >> 11
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_8_bits_are_rounded_to_the_nearest_of_5_and_6() {
        for v in 0..=255_u8 {
            let nearest = |most: f64| (f64::from(v) * most / 255.0).round() as u64;
            assert_eq!(packed([v, 0, 0, 0]) >> 11, nearest(31.0), "red {v}");
            assert_eq!(packed([0, v, 0, 0]) >> 5, nearest(63.0), "green {v}");
            assert_eq!(packed([0, 0, v, 0]), nearest(31.0), "blue {v}");
        }
    }

    #[test]
    fn squeezing_keeps_the_low_bits_in_order() {
        let bytes: [u8; VOXELS] = std::array::from_fn(|i| (i * 5 % 8) as u8);
        let bits = |bits: u32| (0..VOXELS).fold(0, |sum, i| sum | u64::from(bytes[i]) << (bits * i as u32));
        assert_eq!(squeezed::<3>(&bytes), bits(3), "three bits");
        let bytes = bytes.map(|byte| byte & 3);
        let bits = (0..VOXELS).fold(0, |sum, i| sum | u64::from(bytes[i]) << (2 * i));
        assert_eq!(squeezed::<2>(&bytes), bits, "two bits");
    }
}
