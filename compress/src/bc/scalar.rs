//! The kernel of BC4, and of alpha in BC3: a batch of blocks at a time, see `batch`.
//!
//! The range of the block gives the end points, in both kinds of block where values touch the ends of the scale.
//! [`Effort::Fitted`] moves them to the least squares of the places found; [`Effort::Searched`] then tries the
//! neighbours of both end points, since least squares know nothing of rounding, which in a narrow range matters as much.
//! What has the least error of all tried is kept, measured against the values that the decoder gives. A block whose
//! values span at most 7 is kept exactly at every effort.

use super::batch::{LANES, Plane, Row, Words, choose, each, interleave, least_of, most_of, rounded, sum};
use super::endpoints::TEXELS;

/// How much is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
pub(super) enum Effort {
    /// The range of the values, in both kinds of block.
    Ranges,
    /// And its least squares.
    Fitted,
    /// And the neighbours of the end points.
    Searched,
}

/// Neighbours of end points, and rounds of trying them.
const NEIGHBOURS: [(i16, i16); 8] = [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)];
const SEARCHES: usize = 3;

/// Steps from one end point to the other in the two kinds of block.
const SEVENTHS: i16 = 7;
const FIFTHS: i16 = 5;

/// The largest error of a texel that is told from larger ones: 16 squares of it fit 15 bits.
const MOST_OFF: i16 = 45;

/// End points, `low` < `high`, and the sum of squared errors.
struct Fit {
    low: Row,
    high: Row,
    error: Row,
}

/// The blocks of a plane.
#[inline(always)]
pub(super) fn encode(plane: &Plane, effort: Effort, blocks: &mut [Words; LANES]) {
    let (mut low, mut high) = ([0; LANES], [0; LANES]);
    for l in 0..LANES {
        let values = each!(|i| plane[i][l]);
        low[l] = least_of(&values);
        high[l] = most_of(&values);
    }
    // All ones, or 0 for a block of one value.
    let mut varied = [0; LANES];
    for l in 0..LANES {
        varied[l] = if low[l] == high[l] { 0 } else { -1 };
    }
    let mut words = [[0; LANES]; 4];
    // A block takes the second kind only where it touches an end itself, not where one beside it does.
    let (mut touches, mut touching) = ([0; LANES], 0);
    for l in 0..LANES {
        touches[l] = if low[l] == 0 || high[l] == 255 { varied[l] } else { 0 };
        touching |= touches[l];
    }
    widen(&mut low, &mut high, SEVENTHS);
    let sevenths = refined::<SEVENTHS>(plane, low, high, effort);
    pack_sevenths(plane, [&sevenths.low, &sevenths.high], &mut words);
    if touching != 0 {
        inner_range(plane, &mut low, &mut high);
        widen(&mut low, &mut high, FIFTHS);
        let fifths = refined::<FIFTHS>(plane, low, high, effort);
        let mut others = [[0; LANES]; 4];
        pack_fifths(plane, &fifths, &mut others);
        for (word, other) in words.iter_mut().zip(&others) {
            for l in 0..LANES {
                let better = if fifths.error[l] < sevenths.error[l] { touches[l] as u16 } else { 0 };
                word[l] ^= (word[l] ^ other[l]) & better;
            }
        }
    }
    for l in 0..LANES {
        let varied = varied[l] as u16;
        words[0][l] = (words[0][l] & varied) | ((plane[0][l] as u16 * 0x101) & !varied);
        words[1][l] &= varied;
        words[2][l] &= varied;
        words[3][l] &= varied;
    }
    interleave(&words, blocks);
}

/// The range of the values other than 0 and 255; one value in the middle if there are no others.
#[inline(always)]
fn inner_range(plane: &Plane, low: &mut Row, high: &mut Row) {
    for l in 0..LANES {
        let least = least_of(&each!(|i| if plane[i][l] == 0 { 255 } else { plane[i][l] }));
        let most = most_of(&each!(|i| if plane[i][l] == 255 { 0 } else { plane[i][l] }));
        low[l] = if least > most { 128 } else { least };
        high[l] = if least > most { 128 } else { most };
    }
}

/// A range of fewer values than there are steps is made as wide as the steps: then every value is met exactly.
#[inline(always)]
fn widen(low: &mut Row, high: &mut Row, steps: i16) {
    for l in 0..LANES {
        let wide = high[l] - low[l] >= steps;
        low[l] = if wide { low[l] } else { low[l].min(255 - steps) };
        high[l] = if wide { high[l] } else { low[l] + steps };
    }
}

/// The best end points found from a range of values.
#[inline(always)]
fn refined<const STEPS: i16>(plane: &Plane, low: Row, high: Row, effort: Effort) -> Fit {
    let mut best = Fit { low, high, error: [i16::MAX; LANES] };
    let mut tried = (low, high);
    try_ends::<STEPS>(plane, &tried.0, &tried.1, &mut best);
    if effort >= Effort::Fitted {
        least_squares::<STEPS>(plane, &mut tried.0, &mut tried.1);
        try_ends::<STEPS>(plane, &tried.0, &tried.1, &mut best);
    }
    if effort == Effort::Searched {
        for _ in 0..SEARCHES {
            let (low, high) = (best.low, best.high);
            for (down, up) in NEIGHBOURS {
                let mut ends = (low, high);
                for l in 0..LANES {
                    ends.0[l] = (low[l] + down).clamp(0, 254);
                    ends.1[l] = (high[l] + up).min(255).max(ends.0[l] + 1);
                }
                try_ends::<STEPS>(plane, &ends.0, &ends.1, &mut best);
            }
            if best.low == low && best.high == high {
                break;
            }
        }
    }
    best
}

/// Steps for each value of 8 bits, in units of 1/8192.
#[inline(always)]
fn steps_per_value(low: &Row, high: &Row, steps: i16, scale: &mut Row) {
    let all = f32::from(steps) * 8192.0;
    for l in 0..LANES {
        scale[l] = rounded(all / f32::from(high[l] - low[l]));
    }
}

/// Steps down from the high end, rounded.
#[inline(always)]
fn place(value: i16, low: i16, high: i16, scale: i16) -> i16 {
    let down = (high - value.max(low).min(high)) as u16;
    (down.wrapping_mul(scale as u16).wrapping_add(4096) >> 13) as i16
}

/// The value that the decoder gives at a place, rounded as the standard says.
#[inline(always)]
fn level<const STEPS: i16>(place: i16, low: i16, high: i16) -> i16 {
    let sum = (STEPS * high - place * (high - low) + STEPS / 2) as u16;
    // Exact for all ends: 1/7 and 1/5 in units of 1/65536, rounded up.
    let share = if STEPS == SEVENTHS { 9363 } else { 13108 };
    ((u32::from(sum) * share) >> 16) as i16
}

/// How far a value is from the nearest that its block gives.
#[inline(always)]
fn off<const STEPS: i16>(value: i16, low: i16, high: i16, scale: i16) -> i16 {
    let off = (level::<STEPS>(place(value, low, high, scale), low, high) - value).abs();
    if STEPS == FIFTHS { off.min(value).min(255 - value) } else { off }
}

/// Takes end points where their error is the least.
#[inline(always)]
fn try_ends<const STEPS: i16>(plane: &Plane, low: &Row, high: &Row, best: &mut Fit) {
    let mut scale = [0; LANES];
    steps_per_value(low, high, STEPS, &mut scale);
    let mut error = [0; LANES];
    for l in 0..LANES {
        let off = each!(|i| off::<STEPS>(plane[i][l], low[l], high[l], scale[l]).min(MOST_OFF));
        error[l] = sum(&each!(|i| off[i] * off[i]));
    }
    let mut better = [0; LANES];
    for l in 0..LANES {
        better[l] = if error[l] < best.error[l] { -1 } else { 0 };
        best.error[l] = best.error[l].min(error[l]);
    }
    choose(&better, low, &mut best.low);
    choose(&better, high, &mut best.high);
}

/// Moves the end points to those that fit the values best where they are placed now, if that defines any.
#[inline(always)]
fn least_squares<const STEPS: i16>(plane: &Plane, low: &mut Row, high: &mut Row) {
    let mut scale = [0; LANES];
    steps_per_value(low, high, STEPS, &mut scale);
    let (mut counts, mut places, mut squares) = ([0; LANES], [0; LANES], [0; LANES]);
    let (mut totals, mut products) = ([0; LANES], [0; LANES]);
    for l in 0..LANES {
        let (low, high, scale) = (low[l], high[l], scale[l]);
        // All ones for texels that lie on the line, not at 0 or 255.
        let on_line = each!(|i| {
            let value = plane[i][l];
            let off = (level::<STEPS>(place(value, low, high, scale), low, high) - value).abs();
            if STEPS == FIFTHS && off > value.min(255 - value) { 0 } else { -1_i16 }
        });
        let at = each!(|i| place(plane[i][l], low, high, scale) & on_line[i]);
        counts[l] = -sum(&on_line);
        places[l] = sum(&at);
        squares[l] = sum(&each!(|i| at[i] * at[i]));
        totals[l] = sum(&each!(|i| plane[i][l] & on_line[i]));
        products[l] = sum(&each!(|i| at[i] * plane[i][l]));
    }
    let (mut lows, mut highs, mut defined) = ([0; LANES], [0; LANES], [0; LANES]);
    for l in 0..LANES {
        let (count, place) = (f32::from(counts[l]), f32::from(places[l]));
        let (total, product) = (f32::from(totals[l]), f32::from(products[l]));
        let determinant = count * f32::from(squares[l]) - place * place;
        let inverse = 1.0 / if determinant > 0.5 { determinant } else { 1.0 };
        let step = (count * product - place * total) * inverse;
        let start = (total - step * place) / if count > 0.5 { count } else { 1.0 };
        let (new_low, new_high) = (clamped(start + f32::from(STEPS) * step), clamped(start));
        lows[l] = new_low;
        highs[l] = new_high;
        defined[l] = if determinant > 0.5 { -1 } else { 0 };
    }
    for l in 0..LANES {
        defined[l] &= if lows[l] < highs[l] { -1 } else { 0 };
    }
    choose(&defined, &lows, low);
    choose(&defined, &highs, high);
}

/// A value of 8 bits, rounded to the nearest.
#[inline(always)]
fn clamped(value: f32) -> i16 {
    let value = if value > 0.0 { value } else { 0.0 };
    rounded(if value < 255.0 { value } else { 255.0 })
}

/// The words of blocks of six values between the end points.
#[inline(always)]
fn pack_sevenths(plane: &Plane, [low, high]: [&Row; 2], words: &mut [[u16; LANES]; 4]) {
    let mut scale = [0; LANES];
    steps_per_value(low, high, SEVENTHS, &mut scale);
    for l in 0..LANES {
        let (low, high, scale) = (low[l], high[l], scale[l] as u16);
        let next = each!(|i| {
            let down = (high - plane[i][l].max(low).min(high)) as u16;
            // Steps down from the high end, rounded, and one more: 7 + 1 is 0 since 3 bits are left.
            down.wrapping_mul(scale).wrapping_add(4096 + 8192) >> 13
        });
        let (a, b) = (turned(four(&next, 0)), turned(four(&next, 4)));
        let (c, d) = (turned(four(&next, 8)), turned(four(&next, 12)));
        words[0][l] = high as u16 | (low as u16) << 8;
        words[1][l] = a | b << 12;
        words[2][l] = b >> 4 | c << 8;
        words[3][l] = c >> 8 | d << 4;
    }
}

/// The words of blocks of four values between the end points, and 0 and 255.
#[inline(always)]
fn pack_fifths(plane: &Plane, fit: &Fit, words: &mut [[u16; LANES]; 4]) {
    let mut scale = [0; LANES];
    steps_per_value(&fit.low, &fit.high, FIFTHS, &mut scale);
    for l in 0..LANES {
        let (low, high, scale) = (fit.low[l], fit.high[l], scale[l]);
        let indices = each!(|i| {
            let value = plane[i][l];
            let down = place(value, low, high, scale);
            let off = (level::<FIFTHS>(down, low, high) - value).abs();
            // Up from the low end: 0, 2, 3, 4, 5, 1; then 6 for 0 and 7 for 255.
            let up = if down == 5 { 0 } else { 6 - down };
            let up = if down == 0 { 1 } else { up };
            let up = if value < off { 6 } else { up };
            (if 255 - value < off { 7 } else { up }) as u16
        });
        let (a, b, c, d) = (four(&indices, 0), four(&indices, 4), four(&indices, 8), four(&indices, 12));
        words[0][l] = low as u16 | (high as u16) << 8;
        words[1][l] = a | b << 12;
        words[2][l] = b >> 4 | c << 8;
        words[3][l] = c >> 8 | d << 4;
    }
}

/// Four numbers of 3 bits each.
#[inline(always)]
fn four(numbers: &[u16; TEXELS], i: usize) -> u16 {
    numbers[i] | numbers[i + 1] << 3 | numbers[i + 2] << 6 | numbers[i + 3] << 9
}

/// The indices of four texels, which count 0, 2, 3, … 7, 1, from numbers that count 1, 2, … 7, 0.
#[inline(always)]
fn turned(four: u16) -> u16 {
    four ^ (!(four >> 1 | four >> 2) & 0o1111)
}
