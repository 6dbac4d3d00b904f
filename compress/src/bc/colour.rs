//! The kernel of BC1, and of colour in BC3: a batch of blocks at a time, see `batch`.

#![expect(clippy::needless_range_loop, reason = "loops over lanes, the same in all arrays, must vectorise")]

use super::batch::{
    LANES, Plane, ROUND, Row, Words, each, interleave, least_of, most_of, rounded, rounded_signed, sum,
};
use super::bc1;
use super::endpoints::TEXELS;

/// Weight of a voxel of alpha 0, in units of alpha: 1/32 of an opaque voxel. Measured on a CT: seen colour is
/// within 0.03 dB of what no weight at all gives it, and unseen colour, which linear filtering mixes into seen
/// voxels beside it, is 2 dB better. A block without any seen voxel still gets its own colours.
const UNSEEN_WEIGHT: i16 = 8;

/// Rounds of the power method. The ratio of the two largest eigenvalues of a block is seldom near 1, and where it
/// is, any axis between the two serves as well; the least squares that follow mend the rest.
const POWER_ROUNDS: usize = 4;

/// Rounds of least squares, from the diagonal and from the principal axis.
const REFINEMENTS: [usize; 2] = [1, 2];

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

/// Sums over a block's texels, by weight.
struct Moments {
    /// Of the weights, and one over that.
    weight: [f32; LANES],
    share: [f32; LANES],
    /// Of the values.
    values: Reals,
}

/// What a least-squares fit asks of the texels at their places, 0 to 3; by weight.
struct Sums {
    /// Of places, and of their squares.
    places: [f32; LANES],
    squares: [f32; LANES],
    /// Of places times values.
    products: Reals,
}

/// The blocks of the first three planes, from their `PRINCIPAL` axis or the diagonal of their box; `WEIGHTED` by alpha,
/// the fourth.
#[inline(always)]
pub(super) fn encode<const WEIGHTED: bool, const PRINCIPAL: bool>(
    planes: &[Plane; 4],
    blocks: &mut [Words; LANES],
) {
    let [red, green, blue, alpha] = planes;
    let texels = [red, green, blue];
    let (mut low, mut high) = ([[0; LANES]; 3], [[0; LANES]; 3]);
    let mut weights = [[1; LANES]; TEXELS];
    let mut moments =
        Moments { weight: [16.0; LANES], share: [1.0 / 16.0; LANES], values: [[0.0; LANES]; 3] };
    if WEIGHTED {
        for l in 0..LANES {
            let shares = each!(|i| (alpha[i][l] + UNSEEN_WEIGHT + 4) >> 3);
            each!(|i| weights[i][l] = shares[i]);
        }
    }
    moments_of::<WEIGHTED>(texels, &weights, &mut moments);
    let mut reals = [[[0.0; LANES]; 3]; 2];
    let mut ends = Ends { packed: [[0; LANES]; 2], values: [[[0; LANES]; 3]; 2] };
    range(texels, &mut low, &mut high);
    if PRINCIPAL {
        principal::<WEIGHTED>(texels, &weights, &low, &high, &moments, &mut reals);
    } else {
        diagonal(texels, &low, &high, &mut reals);
    }
    quantise(&reals, &mut ends);
    for _ in 0..REFINEMENTS[usize::from(PRINCIPAL)] {
        refine::<WEIGHTED>(texels, &weights, &moments, &mut ends);
    }
    pack(texels, &ends, blocks);
    let mut single = 0_u32;
    for l in 0..LANES {
        single |= u32::from(ends.packed[0][l] == ends.packed[1][l]) << l;
    }
    while single != 0 {
        let l = single.trailing_zeros() as usize;
        single &= single - 1;
        let mean = |c: usize| (moments.values[c][l] * moments.share[l] + 0.5) as u8;
        let block = bc1::solid([mean(0), mean(1), mean(2)]);
        blocks[l] = [block as u16, (block >> 16) as u16, (block >> 32) as u16, (block >> 48) as u16];
    }
}

/// The sums of weights, and of weights times values.
#[inline(always)]
fn moments_of<const WEIGHTED: bool>(texels: [&Plane; 3], weights: &Plane, moments: &mut Moments) {
    if WEIGHTED {
        for l in 0..LANES {
            moments.weight[l] = f32::from(sum(&each!(|i| weights[i][l])));
            moments.share[l] = 1.0 / moments.weight[l];
        }
    }
    for c in 0..3 {
        weighted_sum::<WEIGHTED>(weights, texels[c], &mut moments.values[c]);
    }
}

/// The sum of products. Without `WEIGHTED` the first factors are at most 3, or 1 with values that are centred, and the
/// sum fits 16 bits; with it they are 33 times that.
#[inline(always)]
fn weighted_sum<const WEIGHTED: bool>(factors: &Plane, values: &Plane, out: &mut [f32; LANES]) {
    if WEIGHTED {
        for l in 0..LANES {
            let products = each!(|i| i32::from(factors[i][l]) * i32::from(values[i][l]));
            let mut sum = products[0];
            for product in &products[1..] {
                sum += product;
            }
            out[l] = sum as f32;
        }
    } else {
        let mut sums = [0; LANES];
        for l in 0..LANES {
            sums[l] = sum(&each!(|i| factors[i][l] * values[i][l]));
        }
        convert(&sums, out);
    }
}

/// Whole numbers as real ones: on their own, since a loop of both would be as narrow as the wider type asks.
#[inline(always)]
fn convert(whole: &Row, real: &mut [f32; LANES]) {
    for l in 0..LANES {
        real[l] = f32::from(whole[l]);
    }
}

/// The least and the greatest value of each channel.
#[inline(always)]
fn range(texels: [&Plane; 3], low: &mut Channels, high: &mut Channels) {
    for c in 0..3 {
        let (plane, low, high) = (texels[c], &mut low[c], &mut high[c]);
        for l in 0..LANES {
            let values = each!(|i| plane[i][l]);
            low[l] = least_of(&values);
            high[l] = most_of(&values);
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
        let off = each!(|i| [(red[i][l] - r0) >> 1, (green[i][l] - g0) >> 1, (blue[i][l] - b0) >> 1]);
        let sum = |a: usize, b: usize| sum(&each!(|i| (off[i][a] * off[i][b]) >> 2));
        signs[0][l] = sum(0, 1);
        signs[1][l] = sum(1, 2);
        signs[2][l] = sum(0, 2);
    }
    // Which channels fall where that of the widest range rises, all ones if they do.
    let mut falls = [[0_i16; LANES]; 3];
    for l in 0..LANES {
        let (red, green, blue) = (high[0][l] - low[0][l], high[1][l] - low[1][l], high[2][l] - low[2][l]);
        let green_leads = if green >= red.max(blue) { -1 } else { 0 };
        let red_leads = if red >= blue { !green_leads } else { 0 };
        let blue_leads = !green_leads & !red_leads;
        let (red_green, green_blue, red_blue) = (signs[0][l] >> 15, signs[1][l] >> 15, signs[2][l] >> 15);
        falls[0][l] = red_green & green_leads | red_blue & blue_leads;
        falls[1][l] = red_green & red_leads | green_blue & blue_leads;
        falls[2][l] = green_blue & green_leads | red_blue & red_leads;
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
fn principal<const WEIGHTED: bool>(
    texels: [&Plane; 3],
    weights: &Plane,
    low: &Channels,
    high: &Channels,
    moments: &Moments,
    ends: &mut [Reals; 2],
) {
    let mut scale = [0; LANES];
    for l in 0..LANES {
        let widest = (high[0][l] - low[0][l]).max(high[1][l] - low[1][l]).max(high[2][l] - low[2][l]).max(6);
        scale[l] = rounded(HALF_RANGE * 4096.0 / f32::from(widest));
    }
    let mut centred = [[[0_i16; LANES]; TEXELS]; 3];
    for c in 0..3 {
        let mut mean = [0; LANES];
        for l in 0..LANES {
            mean[l] = rounded(16.0 * moments.values[c][l] * moments.share[l]);
        }
        centre(texels[c], &mean, &scale, &mut centred[c]);
    }
    let [red, green, blue] = &centred;
    let mut covariance = [[0.0; LANES]; 6];
    let pairs = [[red, red], [red, green], [red, blue], [green, green], [green, blue], [blue, blue]];
    for (covariance, [a, b]) in covariance.iter_mut().zip(pairs) {
        if WEIGHTED {
            let mut weighted = [[0; LANES]; TEXELS];
            products(weights, a, &mut weighted);
            weighted_sum::<true>(&weighted, b, covariance);
        } else {
            weighted_sum::<false>(a, b, covariance);
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
    let mut unit = [0.0; LANES];
    for l in 0..LANES {
        unit[l] = 4096.0 / (AXIS * AXIS) / f32::from(scale[l]);
    }
    for c in 0..3 {
        for l in 0..LANES {
            let step = f32::from(axis[c][l]) * unit[l];
            let mean = moments.values[c][l] * moments.share[l];
            ends[0][c][l] = mean + step * f32::from(most[l]);
            ends[1][c][l] = mean + step * f32::from(least[l]);
        }
    }
}

/// The values less their mean, scaled; `mean` in sixteenths.
#[inline(always)]
fn centre(values: &Plane, mean: &Row, scale: &Row, centred: &mut Plane) {
    for l in 0..LANES {
        let off = each!(|i| high_half(16 * values[i][l] - mean[l], scale[l]));
        each!(|i| centred[i][l] = off[i]);
    }
}

/// The upper 16 bits of a product.
#[inline(always)]
fn high_half(a: i16, b: i16) -> i16 {
    ((i32::from(a) * i32::from(b)) >> 16) as i16
}

/// The length of a principal axis.
const AXIS: f32 = 128.0;

/// The direction of largest variance, of length [`AXIS`].
#[inline(always)]
fn principal_axis(covariance: &[[f32; LANES]; 6], axis: &mut Channels) {
    let [rr, rg, rb, gg, gb, bb] = covariance;
    for l in 0..LANES {
        let scale = 1.0 / (rr[l] + gg[l] + bb[l] + 1.0);
        let (rr, rg, rb) = (rr[l] * scale, rg[l] * scale, rb[l] * scale);
        let (gg, gb, bb) = (gg[l] * scale, gb[l] * scale, bb[l] * scale);
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
fn projection(ends: &Ends, slopes: &mut Channels, base: &mut Row) {
    let [from, to] = &ends.values;
    for l in 0..LANES {
        let r = f32::from(from[0][l] - to[0][l]);
        let g = f32::from(from[1][l] - to[1][l]);
        let b = f32::from(from[2][l] - to[2][l]);
        let square = r * r + g * g + b * b;
        let scale = (3 << PLACE_BITS) as f32 / (if square > 1.0 { square } else { 1.0 });
        let (r, g, b) = (rounded_signed(r * scale), rounded_signed(g * scale), rounded_signed(b * scale));
        slopes[0][l] = r;
        slopes[1][l] = g;
        slopes[2][l] = b;
        let sum = (r.wrapping_mul(from[0][l])).wrapping_add(g.wrapping_mul(from[1][l]));
        base[l] = sum.wrapping_add(b.wrapping_mul(from[2][l])).wrapping_add(1 << (PLACE_BITS - 1));
    }
}

/// The place of a colour between the ends: 0 to 3 thirds of the way.
#[inline(always)]
fn place(texels: [&Plane; 3], i: usize, l: usize, slopes: &Channels, base: &Row) -> i16 {
    let r = slopes[0][l].wrapping_mul(texels[0][i][l]);
    let g = slopes[1][l].wrapping_mul(texels[1][i][l]);
    let b = slopes[2][l].wrapping_mul(texels[2][i][l]);
    let place = base[l].wrapping_sub(r).wrapping_sub(g).wrapping_sub(b) >> PLACE_BITS;
    place.clamp(0, 3)
}

/// Moves the ends to the least squares of the places found.
#[inline(always)]
fn refine<const WEIGHTED: bool>(texels: [&Plane; 3], weights: &Plane, moments: &Moments, ends: &mut Ends) {
    let (mut slopes, mut base) = ([[0; LANES]; 3], [0; LANES]);
    projection(ends, &mut slopes, &mut base);
    let mut sums = Sums { places: [0.0; LANES], squares: [0.0; LANES], products: [[0.0; LANES]; 3] };
    add_up::<WEIGHTED>(texels, weights, &slopes, &base, &mut sums);
    let mut reals = [[[0.0; LANES]; 3]; 2];
    least_squares(moments, &sums, &mut reals);
    quantise(&reals, ends);
}

/// The places of all texels.
#[inline(always)]
fn find_places(texels: [&Plane; 3], slopes: &Channels, base: &Row, places: &mut Plane) {
    for l in 0..LANES {
        let found = each!(|i| place(texels, i, l, slopes, base));
        each!(|i| places[i][l] = found[i]);
    }
}

#[inline(always)]
fn add_up<const WEIGHTED: bool>(
    texels: [&Plane; 3],
    weights: &Plane,
    slopes: &Channels,
    base: &Row,
    sums: &mut Sums,
) {
    let mut places = [[0; LANES]; TEXELS];
    find_places(texels, slopes, base, &mut places);
    let mut weighted = places;
    if WEIGHTED {
        products(weights, &places, &mut weighted);
    }
    let (mut first, mut second) = ([0; LANES], [0; LANES]);
    for l in 0..LANES {
        first[l] = sum(&each!(|i| weighted[i][l]));
        second[l] = sum(&each!(|i| weighted[i][l] * places[i][l]));
    }
    convert(&first, &mut sums.places);
    convert(&second, &mut sums.squares);
    for c in 0..3 {
        weighted_sum::<WEIGHTED>(&weighted, texels[c], &mut sums.products[c]);
    }
}

/// Products of two planes that fit 16 bits.
#[inline(always)]
fn products(a: &Plane, b: &Plane, out: &mut Plane) {
    for l in 0..LANES {
        let products = each!(|i| a[i][l] * b[i][l]);
        each!(|i| out[i][l] = products[i]);
    }
}

/// The ends that fit the texels best where they are placed now; their mean, twice, if they are all at one place.
#[inline(always)]
fn least_squares(moments: &Moments, sums: &Sums, ends: &mut [Reals; 2]) {
    let mut inverse = [0.0; LANES];
    for l in 0..LANES {
        let determinant = moments.weight[l] * sums.squares[l] - sums.places[l] * sums.places[l];
        // Whole numbers, and more than 0 unless all places are the same.
        inverse[l] = if determinant > 0.5 { 1.0 / determinant } else { 0.0 };
    }
    let [from, to] = ends;
    for c in 0..3 {
        let (total, products, from, to) = (&moments.values[c], &sums.products[c], &mut from[c], &mut to[c]);
        for l in 0..LANES {
            let slope = (moments.weight[l] * products[l] - sums.places[l] * total[l]) * inverse[l];
            let start = (total[l] - slope * sums.places[l]) * moments.share[l];
            from[l] = start;
            to[l] = start + 3.0 * slope;
        }
    }
}

/// The bytes of the blocks, in the order of ends that says "four colours".
#[inline(always)]
fn pack(texels: [&Plane; 3], ends: &Ends, blocks: &mut [Words; LANES]) {
    let (mut slopes, mut base) = ([[0; LANES]; 3], [0; LANES]);
    projection(ends, &mut slopes, &mut base);
    let mut words = [[0_u16; LANES]; 4];
    for l in 0..LANES {
        let places = each!(|i| place(texels, i, l, &slopes, &base) as u16);
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
