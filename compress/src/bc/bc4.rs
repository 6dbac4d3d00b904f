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

use super::EncodeOptions;
use super::block::Texels;
use super::endpoints::{LineFit, TEXELS, round_to, sum};

/// Rounds of refinement. The third round gains less than 0.01 dB on noise.
const REFINEMENTS: usize = 2;

/// Rounds of trying the neighbours of both end points, and the widest range in which that is done. On a CT this
/// gains 0.6 dB (8 bits for the whole range) or 0.2 dB (a narrow window) for about half the speed.
const NUDGES: usize = 4;
const NUDGED_RANGE: u32 = 64;

/// 1.5·2²³: adding it rounds a small `f32` to a whole number in its low bits, ties to even.
const ROUND: f32 = 12_582_912.0;

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

/// End points with the place of each texel between them, and what they cost.
#[derive(Debug, Clone, Copy)]
struct Fit {
    kind: Kind,
    low: u32,
    high: u32,
    /// Steps from `low`; 8 stands for 0 and 9 for 255 in [`Kind::Fifths`].
    places: [i32; TEXELS],
    /// Sum of squared errors.
    error: f32,
}

/// The place of the value 0, and of 255, in a block of [`Kind::Fifths`].
const PLACE_OF_ZERO: i32 = 8;
const PLACE_OF_FULL: i32 = 9;

/// Encodes a row of blocks: `rows` are four rows of 4·n voxels, `blocks` takes 8·n bytes.
pub(super) fn encode_row(rows: [&[u8]; 4], blocks: &mut [u8], _: EncodeOptions) {
    for (x, block) in blocks.chunks_exact_mut(8).enumerate() {
        let texels = std::array::from_fn(|i| [rows[i / 4][4 * x + i % 4]]);
        block.copy_from_slice(&encode(&texels));
    }
}

/// Encodes one block.
pub(super) fn encode(texels: &Texels<1>) -> [u8; 8] {
    let (low, high) = texels.iter().fold((255, 0), |(low, high), &[v]| (v.min(low), v.max(high)));
    if low == high {
        return pack(low, high, 0);
    }
    let values = texels.map(|[value]| f32::from(value));
    let mut best = refined(Kind::Sevenths, &values, (low.into(), high.into()));
    if best.error > 0.0 && (low == 0 || high == 255) {
        let inner = inner_range(texels);
        let fifths = refined(Kind::Fifths, &values, inner);
        if fifths.error < best.error {
            best = fifths;
        }
    }
    best.block()
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

/// The range of the values other than 0 and 255; one value in the middle if there are no others.
fn inner_range(texels: &Texels<1>) -> (u32, u32) {
    let inner = texels.iter().filter(|&&[v]| v != 0 && v != 255);
    let (low, high) = inner.fold((255, 0), |(low, high), &[v]| (v.min(low), v.max(high)));
    if low <= high { (low.into(), high.into()) } else { (128, 128) }
}

/// The best fit found from a range of values: as it is, and moved to the least squares of its own indices.
fn refined(kind: Kind, values: &[f32; TEXELS], range: (u32, u32)) -> Fit {
    let (low, high) = widened(kind, range);
    let mut best = Fit::new(kind, low, high, values);
    let mut last = best;
    for _ in 0..REFINEMENTS {
        if last.error == 0.0 {
            break;
        }
        let Some((low, high)) = last.least_squares(values) else { break };
        if (low, high) == (last.low, last.high) {
            break;
        }
        last = Fit::new(kind, low, high, values);
        if last.error < best.error {
            best = last;
        }
    }
    nudged(best, values)
}

/// A fit whose end points are moved by ones as long as that helps: least squares know nothing of rounding, which in
/// a narrow range matters as much.
fn nudged(mut best: Fit, values: &[f32; TEXELS]) -> Fit {
    for _ in 0..NUDGES {
        let (low, high) = (best.low, best.high);
        if best.error == 0.0 || high - low > NUDGED_RANGE {
            break;
        }
        for low in low.saturating_sub(1)..=low + 1 {
            for high in (high - 1).max(low + 1)..=(high + 1).min(255) {
                let fit = Fit::new(best.kind, low, high, values);
                best = if fit.error < best.error { fit } else { best };
            }
        }
        if (low, high) == (best.low, best.high) {
            break;
        }
    }
    best
}

/// A range of fewer values than there are steps is made as wide as the steps: then every value is met exactly.
fn widened(kind: Kind, (low, high): (u32, u32)) -> (u32, u32) {
    let steps = kind.steps();
    if high - low >= steps {
        return (low, high);
    }
    let low = low.min(255 - steps);
    (low, low + steps)
}

impl Fit {
    /// Puts each value at the nearest place between `low` < `high`.
    fn new(kind: Kind, low: u32, high: u32, values: &[f32; TEXELS]) -> Self {
        let steps = kind.steps();
        let levels = match kind {
            Kind::Sevenths => levels::<7>(low, high),
            Kind::Fifths => levels::<5>(low, high),
        }
        .map(|level| level as f32);
        let (low_value, last_place) = (low as f32, steps as f32);
        let scale = last_place / (high - low) as f32;
        // No branches: these loops must vectorise.
        let mut places = values.map(|value| {
            let place = (value - low_value) * scale;
            let place = if place > 0.0 { place } else { 0.0 };
            let place = if place < last_place { place } else { last_place };
            ((place + ROUND).to_bits() & 7) as i32
        });
        let mut off: [f32; TEXELS] =
            std::array::from_fn(|i| (levels[(places[i] & 7) as usize] - values[i]).abs());
        if kind == Kind::Fifths {
            for i in 0..TEXELS {
                for (end, end_place) in [(0.0, PLACE_OF_ZERO), (255.0, PLACE_OF_FULL)] {
                    if (values[i] - end).abs() < off[i] {
                        off[i] = (values[i] - end).abs();
                        places[i] = end_place;
                    }
                }
            }
        }
        Self { kind, low, high, places, error: sum(&off.map(|off| off * off)) }
    }

    /// The end points that fit the values best where they are placed now; `None` if that defines none.
    fn least_squares(&self, values: &[f32; TEXELS]) -> Option<(u32, u32)> {
        let steps = self.kind.steps();
        let places = self.places.map(|place| place as f32 / steps as f32);
        let weights = self.places.map(|place| if place < PLACE_OF_ZERO { 1.0 } else { 0.0 });
        let (low, high) = LineFit::new(&places, &weights)?.ends(values);
        let (low, high) = (round_to(low, 255.0), round_to(high, 255.0));
        (low < high).then_some((low, high))
    }

    /// The bytes of the block.
    fn block(&self) -> [u8; 8] {
        let mut bits = 0;
        for (i, &place) in self.places.iter().enumerate() {
            bits |= self.index(place) << (3 * i);
        }
        match self.kind {
            Kind::Sevenths => pack(self.high as u8, self.low as u8, bits),
            Kind::Fifths => pack(self.low as u8, self.high as u8, bits),
        }
    }

    /// The index that stands for a place.
    fn index(&self, place: i32) -> u64 {
        // Sevenths count up to e0, the high end; fifths count up from e0, the low end.
        const SEVENTHS: [u64; 8] = [1, 7, 6, 5, 4, 3, 2, 0];
        const FIFTHS: [u64; 10] = [0, 2, 3, 4, 5, 1, 0, 0, 6, 7];
        match self.kind {
            Kind::Sevenths => SEVENTHS[place as usize],
            Kind::Fifths => FIFTHS[place as usize],
        }
    }
}

/// A block of two end points and 48 bits of indices.
fn pack(e0: u8, e1: u8, indices: u64) -> [u8; 8] {
    (u64::from(e0) | u64::from(e1) << 8 | indices << 16).to_le_bytes()
}
