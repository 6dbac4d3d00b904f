//! The kernel of BC1, and of colour in BC3: a batch of blocks at a time, see `batch`.

use super::batch::{LANES, Plane, ROUND, Row, Words, each, interleave, least_of, most_of, rounded, rounded_signed, sum};
use super::endpoints::TEXELS;
use super::{ColourWeight, EncodeOptions, Level, bc1};

/// Weight of a voxel of alpha 0, in units of alpha: 1/32 of an opaque voxel. Measured on a CT: seen colour is
/// within 0.03 dB of what no weight at all gives it, and unseen colour, which linear filtering mixes into seen
/// voxels beside it, is 2 dB better. A block without any seen voxel still gets its own colours.
const UNSEEN_WEIGHT: i16 = 8;

/// Rounds of the power method. The ratio of the two largest eigenvalues of a block is seldom near 1, and where it
/// is, any axis between the two serves as well; the least squares that follow mend the rest.
const POWER_ROUNDS: usize = 4;

/// Half the widest range of a block, in the whole numbers that its principal axis is found in: 16 products fit 16 bits.
const HALF_RANGE: f32 = 45.0;

/// Bits of the fraction of a place on the line from one end point to the other, in thirds.
const PLACE_BITS: u32 = 12;

/// Red, green and blue.
type Channels = [Row; 3];

/// Real numbers for red, green and blue.
type Reals = [[f32; LANES]; 3];

/// Two colours of each block.
struct Ends {
    /// 5:6:5 bits.
    packed: [Row; 2],
    /// 8 bits a channel, as they are decoded.
    values: [Channels; 2],
}

/// What a least-squares fit asks of the texels at their places, 0 to 3.
struct Sums {
    /// Of places, and of their squares.
    places: Row,
    squares: Row,
    /// Of places times values.
    products: Channels,
}

/// The blocks of the first three planes.
#[inline(always)]
pub(super) fn encode(planes: &[Plane; 4], _with_alpha: bool, options: EncodeOptions, blocks: &mut [Words; LANES]) {
    let [red, green, blue, _] = planes;
    let texels = [red, green, blue];
    let (mut low, mut high, mut total) = ([[0; LANES]; 3], [[0; LANES]; 3], [[0; LANES]; 3]);
    range(texels, &mut low, &mut high, &mut total);
    let mut ends = Ends { packed: [[0; LANES]; 2], values: [[[0; LANES]; 3]; 2] };
    let _ = ColourWeight::Equal;
    let _ = UNSEEN_WEIGHT;
    match options.level {
        Level::Fast => {
            let mut reals = [[[0.0; LANES]; 3]; 2];
            diagonal(texels, &low, &high, &mut reals);
            quantise(&reals, &mut ends);
        }
        Level::Best => {
            let mut reals = [[[0.0; LANES]; 3]; 2];
            principal(texels, &low, &high, &total, &mut reals);
            quantise(&reals, &mut ends);
            let mut best = [f32::INFINITY; LANES];
            refine(texels, &total, &mut ends, &mut best);
        }
    }
    pack(texels, &ends, blocks);
    for l in 0..LANES {
        if ends.packed[0][l] == ends.packed[1][l] {
            let mean = [0, 1, 2].map(|c: usize| ((total[c][l] + 8) / 16) as u8);
            let block = u64::from_le_bytes(bc1::solid(mean));
            blocks[l] = [0, 16, 32, 48].map(|bit| (block >> bit) as u16);
        }
    }
}

/// The least and the greatest value of each channel, and the sum.
#[inline(always)]
fn range(texels: [&Plane; 3], low: &mut Channels, high: &mut Channels, total: &mut Channels) {
    for c in 0..3 {
        let (plane, low, high, total) = (texels[c], &mut low[c], &mut high[c], &mut total[c]);
        for l in 0..LANES {
            let values = each!(|i| plane[i][l]);
            low[l] = least_of(&values);
            high[l] = most_of(&values);
            total[l] = sum(&values);
        }
    }
}

/// The ends of that diagonal of the block's box that its colours follow, moved in a little.
#[inline(always)]
fn diagonal(texels: [&Plane; 3], low: &Channels, high: &Channels, ends: &mut [Reals; 2]) {
    let [red, green, blue] = texels;
    // Signs of the covariances with green, and of red with blue.
    let mut signs = [[0_i16; LANES]; 3];
    let middle = |c: usize, l: usize| (low[c][l] + high[c][l]) >> 1;
    for l in 0..LANES {
        let [r0, g0, b0] = [middle(0, l), middle(1, l), middle(2, l)];
        let off = each!(|i| [(red[i][l] - r0) >> 1, (green[i][l] - g0) >> 1, blue[i][l] - b0 >> 1]);
        signs[0][l] = sum(&each!(|i| off[i][0] * off[i][1] >> 2));
        signs[1][l] = sum(&each!(|i| off[i][1] * off[i][2] >> 2));
        signs[2][l] = sum(&each!(|i| off[i][0] * off[i][2] >> 2));
    }
    // Which channel falls where the others rise, all ones if it does: green decides, but where its range is less than
    // half of another's.
    let mut falls = [[0_i16; LANES]; 3];
    for l in 0..LANES {
        let (red, green, blue) = (high[0][l] - low[0][l], high[1][l] - low[1][l], high[2][l] - low[2][l]);
        let other_leads = if 2 * green < red.max(blue) { -1 } else { 0 };
        let (red_green, green_blue, red_blue) = (signs[0][l] >> 15, signs[1][l] >> 15, signs[2][l] >> 15);
        falls[0][l] = red_green & !other_leads;
        falls[1][l] = red_green & other_leads;
        falls[2][l] = green_blue & !other_leads | red_blue & other_leads;
    }
    for c in 0..3 {
        for l in 0..LANES {
            let (least, most) = (f32::from(low[c][l]), f32::from(high[c][l]));
            let inset = (most - least) * (1.0 / 16.0);
            let (least, most) = (least + inset, most - inset);
            let falls = falls[c][l] < 0;
            ends[0][c][l] = if falls { least } else { most };
            ends[1][c][l] = if falls { most } else { least };
        }
    }
}

/// The ends of the stretch of the principal axis that the colours fill.
#[inline(always)]
fn principal(texels: [&Plane; 3], low: &Channels, high: &Channels, total: &Channels, ends: &mut [Reals; 2]) {
    let mut scale = [0; LANES];
    for l in 0..LANES {
        let widest = (high[0][l] - low[0][l]).max(high[1][l] - low[1][l]).max(high[2][l] - low[2][l]).max(6);
        scale[l] = rounded(HALF_RANGE * 4096.0 / f32::from(widest));
    }
    let mut covariance = [[0_i16; LANES]; 6];
    let mut centred = [[[0_i16; LANES]; TEXELS]; 3];
    for c in 0..3 {
        for i in 0..TEXELS {
            for l in 0..LANES {
                let off = 16 * texels[c][i][l] - total[c][l];
                centred[c][i][l] = ((i32::from(off) * i32::from(scale[l])) >> 16) as i16;
            }
        }
    }
    let [red, green, blue] = &centred;
    for (k, [a, b]) in [[red, red], [red, green], [red, blue], [green, green], [green, blue], [blue, blue]].into_iter().enumerate() {
        for l in 0..LANES {
            covariance[k][l] = sum(&each!(|i| a[i][l] * b[i][l]));
        }
    }
    let mut axis = [[0_i16; LANES]; 3];
    principal_axis(&covariance, &mut axis);
    let (mut least, mut most) = ([0_i16; LANES], [0_i16; LANES]);
    for l in 0..LANES {
        let [x, y, z] = [axis[0][l], axis[1][l], axis[2][l]];
        let places = each!(|i| x * red[i][l] + y * green[i][l] + z * blue[i][l]);
        least[l] = least_of(&places);
        most[l] = most_of(&places);
    }
    for c in 0..3 {
        for l in 0..LANES {
            let step = f32::from(axis[c][l]) * 4096.0 / (AXIS * AXIS) / f32::from(scale[l]);
            let mean = f32::from(total[c][l]) * (1.0 / 16.0);
            ends[0][c][l] = mean + step * f32::from(most[l]);
            ends[1][c][l] = mean + step * f32::from(least[l]);
        }
    }
}

/// The length of a principal axis.
const AXIS: f32 = 128.0;

/// The direction of largest variance, of length [`AXIS`].
#[inline(always)]
fn principal_axis(covariance: &[Row; 6], axis: &mut Channels) {
    let [rr, rg, rb, gg, gb, bb] = covariance;
    for l in 0..LANES {
        let scale = 1.0 / (f32::from(rr[l]) + f32::from(gg[l]) + f32::from(bb[l]) + 1.0);
        let (rr, rg, rb) = (f32::from(rr[l]) * scale, f32::from(rg[l]) * scale, f32::from(rb[l]) * scale);
        let (gg, gb, bb) = (f32::from(gg[l]) * scale, f32::from(gb[l]) * scale, f32::from(bb[l]) * scale);
        // The column of the largest variance is never orthogonal to the axis unless it is the axis's own zero.
        let [mut x, mut y, mut z] = if rr > gg { [rr, rg, rb] } else { [rg, gg, gb] };
        if bb > rr && bb > gg {
            [x, y, z] = [rb, gb, bb];
        }
        for _ in 0..POWER_ROUNDS {
            [x, y, z] = [rr * x + rg * y + rb * z, rg * x + gg * y + gb * z, rb * x + gb * y + bb * z];
        }
        let square = x * x + y * y + z * z;
        let size = AXIS / (square + 1e-30).sqrt();
        axis[0][l] = rounded_signed(x * size);
        axis[1][l] = rounded_signed(y * size);
        axis[2][l] = rounded_signed(z * size);
    }
}

/// Colours of 5:6:5 bits, the nearest.
#[inline(always)]
fn quantise(ends: &[Reals; 2], out: &mut Ends) {
    for end in 0..2 {
        let [red, green, blue] = &ends[end];
        for l in 0..LANES {
            let red = bits(red[l], 31.0);
            let green = bits(green[l], 63.0);
            let blue = bits(blue[l], 31.0);
            out.packed[end][l] = red << 11 | green << 5 | blue;
            // Exact: (255·v + 15)/31 and (255·v + 31)/63.
            out.values[end][0][l] = (red * 527 + 23) >> 6;
            out.values[end][1][l] = (green * 259 + 33) >> 6;
            out.values[end][2][l] = (blue * 527 + 23) >> 6;
        }
    }
}

/// A value of 255 as one of `most`.
#[inline(always)]
fn bits(value: f32, most: f32) -> i16 {
    let value = value * (most / 255.0);
    let value = if value > 0.0 { value } else { 0.0 };
    let value = if value < most { value } else { most };
    (value + ROUND).to_bits() as i16
}

/// The number whose product with a texel's colour falls from `base` to its place between the ends.
#[inline(always)]
fn projection(ends: &Ends, weights: &mut Channels, base: &mut Row) {
    let [from, to] = &ends.values;
    for l in 0..LANES {
        let r = f32::from(from[0][l] - to[0][l]);
        let g = f32::from(from[1][l] - to[1][l]);
        let b = f32::from(from[2][l] - to[2][l]);
        let square = r * r + g * g + b * b;
        let scale = (3 << PLACE_BITS) as f32 / (if square > 1.0 { square } else { 1.0 });
        let (r, g, b) = (rounded_signed(r * scale), rounded_signed(g * scale), rounded_signed(b * scale));
        weights[0][l] = r;
        weights[1][l] = g;
        weights[2][l] = b;
        let sum = (r.wrapping_mul(from[0][l])).wrapping_add(g.wrapping_mul(from[1][l]));
        base[l] = sum.wrapping_add(b.wrapping_mul(from[2][l])).wrapping_add(1 << (PLACE_BITS - 1));
    }
}

/// The place of a colour between the ends: 0 to 3 thirds of the way.
#[inline(always)]
fn place(texels: [&Plane; 3], i: usize, l: usize, weights: &Channels, base: &Row) -> i16 {
    let r = weights[0][l].wrapping_mul(texels[0][i][l]);
    let g = weights[1][l].wrapping_mul(texels[1][i][l]);
    let b = weights[2][l].wrapping_mul(texels[2][i][l]);
    let place = base[l].wrapping_sub(r).wrapping_sub(g).wrapping_sub(b) >> PLACE_BITS;
    place.max(0).min(3)
}

/// Moves the ends to the least squares of the places found, as long as that helps.
#[inline(always)]
fn refine(texels: [&Plane; 3], total: &Channels, ends: &mut Ends, best: &mut [f32; LANES]) {
    let mut tried = Ends { packed: ends.packed, values: ends.values };
    for round in 0..3 {
        let (mut weights, mut base) = ([[0; LANES]; 3], [0; LANES]);
        projection(&tried, &mut weights, &mut base);
        let mut sums = Sums { places: [0; LANES], squares: [0; LANES], products: [[0; LANES]; 3] };
        add_up(texels, &weights, &base, &mut sums);
        keep(&tried, total, &sums, ends, best);
        if round < 2 {
            let mut reals = [[[0.0; LANES]; 3]; 2];
            least_squares(total, &sums, &mut reals);
            quantise(&reals, &mut tried);
        }
    }
}

#[inline(always)]
fn add_up(texels: [&Plane; 3], weights: &Channels, base: &Row, sums: &mut Sums) {
    for l in 0..LANES {
        let places = each!(|i| place(texels, i, l, weights, base));
        sums.places[l] = sum(&places);
        sums.squares[l] = sum(&each!(|i| places[i] * places[i]));
        sums.products[0][l] = sum(&each!(|i| places[i] * texels[0][i][l]));
        sums.products[1][l] = sum(&each!(|i| places[i] * texels[1][i][l]));
        sums.products[2][l] = sum(&each!(|i| places[i] * texels[2][i][l]));
    }
}

/// Takes what was tried where its error is the least.
#[inline(always)]
fn keep(tried: &Ends, total: &Channels, sums: &Sums, ends: &mut Ends, best: &mut [f32; LANES]) {
    // Without the squares of the values, which are the same for all that is tried.
    let mut errors = [0.0; LANES];
    for c in 0..3 {
        let (from, to) = (&tried.values[0][c], &tried.values[1][c]);
        let (total, products) = (&total[c], &sums.products[c]);
        for l in 0..LANES {
            let (places, squares) = (f32::from(sums.places[l]), f32::from(sums.squares[l]));
            let step = f32::from(to[l] - from[l]) * (1.0 / 3.0);
            let from = f32::from(from[l]);
            errors[l] += from * (16.0 * from - 2.0 * f32::from(total[l]))
                + step * (step * squares + 2.0 * (from * places - f32::from(products[l])));
        }
    }
    let mut better = [0_i16; LANES];
    for l in 0..LANES {
        better[l] = if errors[l] < best[l] { -1 } else { 0 };
        best[l] = if errors[l] < best[l] { errors[l] } else { best[l] };
    }
    for end in 0..2 {
        for l in 0..LANES {
            let (old, new) = (ends.packed[end][l], tried.packed[end][l]);
            ends.packed[end][l] = if better[l] < 0 { new } else { old };
        }
        for c in 0..3 {
            for l in 0..LANES {
                let (old, new) = (ends.values[end][c][l], tried.values[end][c][l]);
                ends.values[end][c][l] = if better[l] < 0 { new } else { old };
            }
        }
    }
}

/// The ends that fit the texels best where they are placed now; their mean, twice, if they are all at one place.
#[inline(always)]
fn least_squares(total: &Channels, sums: &Sums, ends: &mut [Reals; 2]) {
    let (mut inverse, mut places) = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        places[l] = f32::from(sums.places[l]);
        let determinant = 16.0 * f32::from(sums.squares[l]) - places[l] * places[l];
        // Whole numbers, and at least 15 unless all places are the same.
        inverse[l] = if determinant > 0.5 { 1.0 / determinant } else { 0.0 };
    }
    let [from, to] = ends;
    for c in 0..3 {
        let (total, products, from, to) = (&total[c], &sums.products[c], &mut from[c], &mut to[c]);
        for l in 0..LANES {
            let total = f32::from(total[l]);
            let slope = (16.0 * f32::from(products[l]) - places[l] * total) * inverse[l];
            let start = (total - slope * places[l]) * (1.0 / 16.0);
            from[l] = start;
            to[l] = start + 3.0 * slope;
        }
    }
}

/// The bytes of the blocks, in the order of ends that says "four colours".
#[inline(always)]
fn pack(texels: [&Plane; 3], ends: &Ends, blocks: &mut [Words; LANES]) {
    let (mut weights, mut base) = ([[0; LANES]; 3], [0; LANES]);
    projection(ends, &mut weights, &mut base);
    let mut words = [[0_u16; LANES]; 4];
    for l in 0..LANES {
        let places = each!(|i| place(texels, i, l, &weights, &base) as u16);
        let halves = [eight(&places, 0), eight(&places, 8)];
        let (from, to) = (ends.packed[0][l] as u16, ends.packed[1][l] as u16);
        // 0 and 1 change places with the ends, 2 and 3 too.
        let turn = if from < to { 0x5555 } else { 0 };
        words[0][l] = from.max(to);
        words[1][l] = from.min(to);
        words[2][l] = indices(halves[0]) ^ turn;
        words[3][l] = indices(halves[1]) ^ turn;
    }
    interleave(&words, blocks);
}

/// Eight places, of two bits each.
#[inline(always)]
fn eight(places: &[u16; TEXELS], i: usize) -> u16 {
    let low = places[i] | places[i + 1] << 2 | places[i + 2] << 4 | places[i + 3] << 6;
    let high = places[i + 4] | places[i + 5] << 2 | places[i + 6] << 4 | places[i + 7] << 6;
    low | high << 8
}

/// The indices that stand for eight places: 0, 2, 3, 1 for 0 to 3 thirds of the way.
#[inline(always)]
fn indices(places: u16) -> u16 {
    let (odd, upper) = (places & 0x5555, places >> 1 & 0x5555);
    (odd ^ upper) << 1 | upper
}
