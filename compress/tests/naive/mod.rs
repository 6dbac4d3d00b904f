//! Decoders straight from the standard, as the oracle: one texel at a time, in real numbers from 0 to 1, each line
//! next to the sentence it stands for. Slow, plain, and sharing nothing with the crate.
//!
//! Source: Khronos Data Format Specification 1.4, "S3TC Compressed Texture Image Formats" and "RGTC Compressed
//! Texture Image Formats"; for BC7 see `bc7`.

mod bc7;

pub(crate) use bc7::bc7_texel;

/// A real number in [0, 1] as 8 bits. Halves go up; the small number is for a half that floating point made less.
fn byte(value: f64) -> u8 {
    (value * 255.0 + 0.5 + 1e-9).floor() as u8
}

/// Bits `from..from + count` of a block, bit 0 being the lowest of its first byte.
fn bits(block: &[u8], from: usize, count: usize) -> u32 {
    (0..count).map(|i| u32::from(block[(from + i) / 8] >> ((from + i) % 8) & 1) << i).sum()
}

/// The colour of a texel of a BC1 block, or of the colour half of a BC3 block (`four_only`).
pub(crate) fn bc1_texel(block: &[u8], x: usize, y: usize, four_only: bool) -> [u8; 4] {
    let (color0, color1) = (bits(block, 0, 16), bits(block, 16, 16));
    // "RGB colors are encoded as 5:6:5": red in the highest bits.
    let rgb = |color: u32| {
        [f64::from(color >> 11) / 31.0, f64::from(color >> 5 & 63) / 63.0, f64::from(color & 31) / 31.0]
    };
    let (rgb0, rgb1) = (rgb(color0), rgb(color1));
    let mix = |a: f64, b: f64| [0, 1, 2].map(|c: usize| a * rgb0[c] + b * rgb1[c]);
    // "code = bits[2*(4*y+x)+1..2*(4*y+x)+0]"
    let code = bits(block, 32 + 2 * (4 * y + x), 2);
    let opaque = |[r, g, b]: [f64; 3]| [byte(r), byte(g), byte(b), 255];
    match (code, four_only || color0 > color1) {
        (0, _) => opaque(rgb0),
        (1, _) => opaque(rgb1),
        (2, true) => opaque(mix(2.0 / 3.0, 1.0 / 3.0)),
        (_, true) => opaque(mix(1.0 / 3.0, 2.0 / 3.0)),
        (2, false) => opaque(mix(0.5, 0.5)),
        // "BLACK", with alpha 0
        (_, false) => [0; 4],
    }
}

/// The value of a texel of a BC4 block, or of the alpha half of a BC3 block.
pub(crate) fn bc4_texel(block: &[u8], x: usize, y: usize) -> u8 {
    let (red0, red1) = (f64::from(block[0]) / 255.0, f64::from(block[1]) / 255.0);
    let code = bits(block, 16 + 3 * (4 * y + x), 3);
    let value = match (code, red0 > red1) {
        (0, _) => red0,
        (1, _) => red1,
        (n, true) => (f64::from(8 - n) * red0 + f64::from(n - 1) * red1) / 7.0,
        (6, false) => 0.0,
        (7, false) => 1.0,
        (n, false) => (f64::from(6 - n) * red0 + f64::from(n - 1) * red1) / 5.0,
    };
    byte(value)
}

/// A texel of a BC3 block: alpha first, then colour.
pub(crate) fn bc3_texel(block: &[u8], x: usize, y: usize) -> [u8; 4] {
    let [r, g, b, _] = bc1_texel(&block[8..], x, y, true);
    [r, g, b, bc4_texel(&block[..8], x, y)]
}
