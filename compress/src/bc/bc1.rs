//! BC1: two colours of 5:6:5 bits and sixteen 2-bit indices. 8 bytes.
//!
//! | bits | holds |
//! |---|---|
//! | 0..16, 16..32 | colours `c0`, `c1`: blue in bits 0..5, green in 5..11, red in 11..16 |
//! | 32..64 | index of texel `i` (x fastest) at bit `32 + 2·i` |
//!
//! If `c0 > c1` as numbers, the four colours are `c0`, `c1`, (2·c0 + c1)/3, (c0 + 2·c1)/3. Otherwise they are
//! `c0`, `c1`, (c0 + c1)/2 and transparent black; the encoder never writes that mode with an index that
//! tells the two apart. In BC3 every block is of the first mode.
//!
//! The encoder takes the ends of the block's principal axis, moves them to the least squares of the indices found,
//! and keeps what has the least error of all tried. Errors are measured against the colours that the decoder
//! gives, not against ideal ones. A block of one colour takes the nearest colour that any two end points mix.
//!
//! Source: KDFS, "S3TC Compressed Texture Image Formats", sections "BC1 with no alpha", "BC1 with alpha".

use super::block::Texels;
use super::endpoints::{LineFit, TEXELS, principal_ends, round_to, sum};

/// Rounds of least squares. The fourth gains less than 0.01 dB on noise.
const REFINEMENTS: usize = 3;

/// Largest values of red, green and blue in a colour.
const MOST: [u32; 3] = [31, 63, 31];

/// How the four colours of a block are meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// Two colours between the end points, whatever their order: BC3.
    FourColours,
    /// By the order of the end points: BC1.
    ByOrder,
}

/// A colour of 5:6:5 bits: red, green, blue.
type Packed = [u32; 3];

/// Two colours, with the place of each texel between them and what they cost.
#[derive(Debug, Clone, Copy)]
struct Fit {
    ends: [Packed; 2],
    /// Thirds of the way from the first colour to the second.
    thirds: [i32; TEXELS],
    /// Weighted sum of squared errors.
    error: f32,
}

/// A block's colours as numbers, with the weight of each texel.
struct Colours<'a> {
    channels: [[f32; TEXELS]; 3],
    weights: &'a [f32; TEXELS],
}

/// Encodes one block. Alpha is not kept.
pub(super) fn encode(texels: &Texels<4>) -> [u8; 8] {
    encode_weighted(texels, &[1.0; TEXELS])
}

/// Encodes one block whose texels share in the error by `weights` > 0.
pub(super) fn encode_weighted(texels: &Texels<4>, weights: &[f32; TEXELS]) -> [u8; 8] {
    let [red, green, blue, _] = texels[0];
    if texels.iter().all(|texel| texel[..3] == [red, green, blue]) {
        return solid([red, green, blue]);
    }
    let channels = [0, 1, 2].map(|channel: usize| texels.map(|texel| f32::from(texel[channel])));
    let colours = Colours { channels, weights };
    let (a, b) = principal_ends(&colours.channels, weights);
    let mut best = Fit::new([quantised(a), quantised(b)], &colours);
    let mut last = best;
    for _ in 0..REFINEMENTS {
        if last.error == 0.0 {
            break;
        }
        let Some(ends) = last.least_squares(&colours) else { break };
        if ends == last.ends {
            break;
        }
        last = Fit::new(ends, &colours);
        if last.error < best.error {
            best = last;
        }
    }
    best.block()
}

/// Decodes one block of BC1.
pub(super) fn decode(block: [u8; 8]) -> Texels<4> {
    decode_mode(block, Mode::ByOrder)
}

/// Decodes one block.
pub(super) fn decode_mode(block: [u8; 8], mode: Mode) -> Texels<4> {
    let c0 = u16::from_le_bytes([block[0], block[1]]);
    let c1 = u16::from_le_bytes([block[2], block[3]]);
    let indices = u32::from_le_bytes([block[4], block[5], block[6], block[7]]);
    let ends = [c0, c1].map(unpacked);
    let palette = if mode == Mode::FourColours || c0 > c1 {
        let [c0, near, far, c1] = four_colours(ends).map(|[r, g, b]| [r as u8, g as u8, b as u8, 255]);
        [c0, c1, near, far]
    } else {
        let [a, b] = ends;
        let colour = |near: u32, far: u32| {
            let [r, g, b] =
                [0, 1, 2].map(|c: usize| widened(near * a[c] + far * b[c], (near + far) * MOST[c]));
            [r as u8, g as u8, b as u8, 255]
        };
        [colour(1, 0), colour(0, 1), colour(1, 1), [0; 4]]
    };
    std::array::from_fn(|i| palette[(indices >> (2 * i) & 3) as usize])
}

/// The index that stands for a place, in thirds of the way from the first colour to the second.
const INDEX_OF_THIRDS: [u32; 4] = [0, 2, 3, 1];

/// The four colours from the first end to the second, in thirds; 8 bits a channel.
fn four_colours([a, b]: [Packed; 2]) -> [[u32; 3]; 4] {
    [(3, 0), (2, 1), (1, 2), (0, 3)]
        .map(|(near, far)| [0, 1, 2].map(|c: usize| widened(near * a[c] + far * b[c], 3 * MOST[c])))
}

/// `value` of `most` in 8 bits, rounded to the nearest.
const fn widened(value: u32, most: u32) -> u32 {
    (2 * 255 * value + most) / (2 * most)
}

/// The colour of 5:6:5 bits nearest to a colour of 8 bits a channel.
fn quantised(colour: [f32; 3]) -> Packed {
    [0, 1, 2].map(|c: usize| round_to(colour[c] * (MOST[c] as f32 / 255.0), MOST[c] as f32))
}

fn unpacked(colour: u16) -> Packed {
    let colour = u32::from(colour);
    [colour >> 11, colour >> 5 & 63, colour & 31]
}

fn packed([red, green, blue]: Packed) -> u16 {
    (red << 11 | green << 5 | blue) as u16
}

impl Fit {
    /// Puts each texel at the nearest of the four colours of `ends`.
    fn new(ends: [Packed; 2], colours: &Colours<'_>) -> Self {
        let [red, green, blue] = &colours.channels;
        let off = four_colours(ends).map(|colour| {
            let [r, g, b] = colour.map(|value| value as f32);
            let off = |i: usize| [red[i] - r, green[i] - g, blue[i] - b];
            std::array::from_fn::<f32, TEXELS, _>(|i| off(i).iter().fold(0.0, |sum, d| sum + d * d))
        });
        // No branches: these loops must vectorise, they are most of the encoder's time.
        let mut thirds = [0; TEXELS];
        let mut nearest = [0.0; TEXELS];
        for i in 0..TEXELS {
            let [first, second, third, last] = [off[0][i], off[1][i], off[2][i], off[3][i]];
            let near = if second < first { second } else { first };
            let far = if last < third { last } else { third };
            let [in_near, in_far] = [i32::from(second < first), 2 + i32::from(last < third)];
            let is_far = -i32::from(far < near);
            thirds[i] = (in_far & is_far) | (in_near & !is_far);
            nearest[i] = (if far < near { far } else { near }) * colours.weights[i];
        }
        Self { ends, thirds, error: sum(&nearest) }
    }

    /// The end points that fit the colours best at the places of now; `None` if those define none.
    fn least_squares(&self, colours: &Colours<'_>) -> Option<[Packed; 2]> {
        let places = self.thirds.map(|thirds| thirds as f32 * (1.0 / 3.0));
        let fit = LineFit::new(&places, colours.weights)?;
        let ends = colours.channels.map(|values| fit.ends(&values));
        Some([quantised(ends.map(|(a, _)| a)), quantised(ends.map(|(_, b)| b))])
    }

    /// The bytes of the block, in the order that says "four colours".
    fn block(&self) -> [u8; 8] {
        let [mut c0, mut c1] = self.ends.map(packed);
        let mut indices = 0;
        for (i, &thirds) in self.thirds.iter().enumerate() {
            indices |= INDEX_OF_THIRDS[(thirds & 3) as usize] << (2 * i);
        }
        if c0 == c1 {
            // Not the order of four colours: index 3 would be transparent. All four are alike, so 0 does.
            indices = 0;
        } else if c0 < c1 {
            (c0, c1) = (c1, c0);
            // 0 and 1 change places, 2 and 3 too.
            indices ^= 0x5555_5555;
        }
        pack(c0, c1, indices)
    }
}

fn pack(c0: u16, c1: u16, indices: u32) -> [u8; 8] {
    (u64::from(c0) | u64::from(c1) << 16 | u64::from(indices) << 32).to_le_bytes()
}

/// The block nearest to a single colour: index 2 of the best pair of end points in each channel.
pub(super) fn solid(colour: [u8; 3]) -> [u8; 8] {
    let tables = [&SOLID_5, &SOLID_6, &SOLID_5];
    let pairs = [0, 1, 2].map(|c: usize| tables[c][usize::from(colour[c])]);
    let ends = [pairs.map(|[a, _]| u32::from(a)), pairs.map(|[_, b]| u32::from(b))];
    Fit { ends, thirds: [1; TEXELS], error: 0.0 }.block()
}

/// For each value of 8 bits, the pair of 5-bit (6-bit) end points whose mix (2·a + b)/3 is nearest to it.
static SOLID_5: [[u8; 2]; 256] = solid_table(31);
static SOLID_6: [[u8; 2]; 256] = solid_table(63);

const fn solid_table(most: u32) -> [[u8; 2]; 256] {
    let mut table = [[0; 2]; 256];
    let mut met = [false; 256];
    // Near pairs last, so that they win: hardware's rounding errs least between near end points.
    let mut gap = most + 1;
    while gap > 0 {
        gap -= 1;
        let mut low = 0;
        while low + gap <= most {
            let high = low + gap;
            let value = widened(2 * low + high, 3 * most) as usize;
            table[value] = [low as u8, high as u8];
            met[value] = true;
            let value = widened(2 * high + low, 3 * most) as usize;
            table[value] = [high as u8, low as u8];
            met[value] = true;
            low += 1;
        }
    }
    // Values that no pair gives take the pair of the nearest value that has one.
    let mut value = 0;
    while value < 256 {
        let mut off = 0;
        while off < 256 {
            if value >= off && met[value - off] {
                table[value] = table[value - off];
                break;
            }
            if value + off < 256 && met[value + off] {
                table[value] = table[value + off];
                break;
            }
            off += 1;
        }
        value += 1;
    }
    table
}
