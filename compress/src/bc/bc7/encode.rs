//! Encodes rows of blocks, eight blocks at a time.
//!
//! A block of one colour is exact and costs next to nothing. Others are gathered in batches of [`LANES`] and tried in
//! mode 6, one line through R, G, B, A; those that it does not serve well are tried on, at [`Level::Best`] only, in
//! modes 4 and 5, which give one channel a line of its own, and in modes 7, 1 and 3, which divide the block in two.
//! Modes 0 and 2, three opaque lines, are not written: a CT's colours seldom are three lines in one block, and
//! opaque hardly ever.
#![expect(clippy::needless_range_loop, reason = "lanes, texels and matrices are indexed as in the formulas")]

use super::fit::{Colours, Line, Storage};
use super::modes::LowBits;
use super::pack::Content;
use super::partitions::TWO;
use super::split::patterns;
use crate::bc::block::texels;
use crate::bc::endpoints::TEXELS;
use crate::bc::lanes::{LANES, Lanes, Plane};
use crate::bc::{ColourWeight, EncodeOptions, Level};

/// Voxels of a block in x.
const EDGE: usize = 4;

/// Weight of the colour of a voxel of alpha 0, in units of alpha; as in BC3.
const UNSEEN_WEIGHT: f32 = 8.0;

/// Mean squared error of a block, over its four channels, that is not worth another mode.
const GOOD: f32 = 0.4;

/// Patterns of two subsets that are fitted in full.
const PATTERNS: usize = 3;

/// Rounds of least squares: on one line, and in each of the many lines of the other modes.
const ROUNDS: usize = 2;
const FAST_ROUNDS: usize = 1;

/// Which channel each of modes 4 and 5 may part from the others: alpha, R, G, B by rotation.
const ROTATIONS: usize = 4;

/// Eight blocks, or fewer, and the best found for each: what is in the other lanes is encoded and left.
struct Batch {
    /// R, G, B, A.
    values: [Plane; 4],
    /// How much an error counts in colour, and in alpha.
    colour_weight: Plane,
    alpha_weight: Plane,
    contents: [Content; LANES],
    errors: [f32; LANES],
    /// Where each block goes, and how many there are.
    places: [usize; LANES],
    len: usize,
    /// Whether this batch's step is done, and how many blocks have left since.
    solved: bool,
    handed_on: usize,
}

/// Encodes one row of blocks: `rows` are its four rows of voxels, of one length each, `blocks` 16 bytes for each four
/// voxels begun.
pub(in crate::bc) fn encode_row(rows: [&[[u8; 4]]; EDGE], blocks: &mut [u8], options: EncodeOptions) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        #[expect(unsafe_code, reason = "the same code with wider vectors, where the machine has them")]
        // SAFETY: the machine has AVX2, as was just asked.
        unsafe {
            encode_row_avx2(rows, blocks, options);
        }
        return;
    }
    encode_row_plain(rows, blocks, options);
}

/// [`encode_row_plain`] compiled for AVX2.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn encode_row_avx2(rows: [&[[u8; 4]]; EDGE], blocks: &mut [u8], options: EncodeOptions) {
    encode_row_plain(rows, blocks, options);
}

/// [`encode_row`] on any machine.
///
/// Blocks go from batch to batch, so that each step is given full ones: `first` tries one line, `hard` has what that
/// left, `hardest` what is left then. Each step stands here once, since all of it is inlined.
#[inline(always)]
fn encode_row_plain(rows: [&[[u8; 4]]; EDGE], blocks: &mut [u8], options: EncodeOptions) {
    let (blocks, _) = blocks.as_chunks_mut::<16>();
    let best = options.level == Level::Best;
    let [mut first, mut hard, mut hardest] = [Batch::new(), Batch::new(), Batch::new()];
    let mut place = 0;
    loop {
        let all_read = place == blocks.len();
        if hardest.is_due(all_read && first.len + hard.len == 0) {
            hardest.two_lines_of_texels();
            hardest.hand_on(blocks, None);
        } else if hard.solved {
            hard.hand_on(blocks, Some(&mut hardest));
        } else if hard.is_due(all_read && first.len == 0) {
            hard.two_lines_of_channels();
        } else if first.solved {
            first.hand_on(blocks, best.then_some(&mut hard));
        } else if first.is_due(all_read) {
            first.one_line(if best { ROUNDS } else { FAST_ROUNDS });
        } else if !all_read {
            let texels = texels(rows, place);
            if texels.iter().all(|texel| *texel == texels[0]) {
                blocks[place] = Content::solid(texels[0]).pack();
            } else {
                first.push(&texels, place, options.colour_weight);
            }
            place += 1;
        } else {
            break;
        }
    }
}

impl Batch {
    fn new() -> Self {
        let plane = [Lanes::ZERO; TEXELS];
        Self {
            values: [plane; 4],
            colour_weight: [Lanes::ONE; TEXELS],
            alpha_weight: [Lanes::ONE; TEXELS],
            contents: [Content::NONE; LANES],
            errors: [f32::INFINITY; LANES],
            places: [0; LANES],
            len: 0,
            handed_on: 0,
            solved: false,
        }
    }

    #[inline(always)]
    fn push(&mut self, texels: &[[u8; 4]; TEXELS], place: usize, weight: ColourWeight) {
        let lane = self.len;
        for (i, texel) in texels.iter().enumerate() {
            for (plane, &value) in self.values.iter_mut().zip(texel) {
                plane[i].0[lane] = value.into();
            }
            if weight == ColourWeight::Alpha {
                let seen = f32::from(texel[3]) + UNSEEN_WEIGHT;
                self.colour_weight[i].0[lane] = seen * (1.0 / (255.0 + UNSEEN_WEIGHT));
            }
        }
        self.errors[lane] = f32::INFINITY;
        self.places[lane] = place;
        self.len += 1;
    }

    /// Takes a block, and what was found for it, from another batch.
    #[inline(always)]
    fn take(&mut self, other: &Self, from: usize) {
        let to = self.len;
        for i in 0..TEXELS {
            for (plane, other) in self.values.iter_mut().zip(&other.values) {
                plane[i].0[to] = other[i].0[from];
            }
            self.colour_weight[i].0[to] = other.colour_weight[i].0[from];
        }
        self.contents[to] = other.contents[from];
        self.errors[to] = other.errors[from];
        self.places[to] = other.places[from];
        self.len += 1;
    }

    /// Whether the batch is full, or has what is left at the end.
    #[inline(always)]
    fn is_due(&self, at_end: bool) -> bool {
        !self.solved && (self.len == LANES || (at_end && self.len > 0))
    }

    /// Writes the blocks of a solved batch that are good, and all if there is no `next`; the others go there, as
    /// long as it has room. Empties the batch when all are gone.
    #[inline(always)]
    fn hand_on(&mut self, blocks: &mut [[u8; 16]], mut next: Option<&mut Self>) {
        while self.handed_on < self.len {
            let lane = self.handed_on;
            match &mut next {
                Some(next) if self.errors[lane] > GOOD * (4 * TEXELS) as f32 => {
                    if next.len == LANES {
                        return;
                    }
                    next.take(self, lane);
                }
                _ => blocks[self.places[lane]] = self.contents[lane].pack(),
            }
            self.handed_on += 1;
        }
        (self.len, self.handed_on, self.solved) = (0, 0, false);
    }

    /// Mode 6.
    #[inline(always)]
    fn one_line(&mut self, rounds: usize) {
        let [r, g, b, a] = &self.values;
        let (colour, alpha) = (&self.colour_weight, &self.alpha_weight);
        let colours = Colours { values: [r, g, b, a], weights: [colour, colour, colour, alpha] };
        let line = colours.line(Storage { bits: 7, low_bits: LowBits::EachEnd, steps: 15.0 }, rounds);
        for lane in 0..LANES {
            self.errors[lane] = line.error.0[lane];
            let content = &mut self.contents[lane];
            *content = Content { mode: 6, ..Content::NONE };
            put_ends(&line, lane, content, 0);
            put_places(&line.places, lane, &mut content.colour);
        }
        self.solved = true;
    }

    /// Modes 5 and 4: one channel apart from the others. Mode 5 finds which; mode 4, which divides the same bits
    /// otherwise, is tried with that one alone.
    #[inline(always)]
    fn two_lines_of_channels(&mut self) {
        let mut best = [(f32::INFINITY, 0); LANES];
        for step in 0..=ROTATIONS {
            // Of the last step, each lane has its own rotation.
            let chosen = best.map(|(_, rotation)| if step < ROTATIONS { step } else { rotation });
            let (values, weights) = self.rotated(&chosen);
            let [x, y, z, apart] = &values;
            let [x_weight, y_weight, z_weight, apart_weight] = &weights;
            let colours = Colours { values: [x, y, z], weights: [x_weight, y_weight, z_weight] };
            let scalars = Colours { values: [apart], weights: [apart_weight] };
            let modes: &[_] = if step < ROTATIONS {
                &[(5, false, (7, 3.0), (8, 3.0))]
            } else {
                &[(4, false, (5, 3.0), (6, 7.0)), (4, true, (5, 7.0), (6, 3.0))]
            };
            for &(mode, colour_takes_second, colour, scalar) in modes {
                let low_bits = LowBits::None;
                let colour = colours.line(Storage { bits: colour.0, low_bits, steps: colour.1 }, FAST_ROUNDS);
                let scalar = scalars.line(Storage { bits: scalar.0, low_bits, steps: scalar.1 }, FAST_ROUNDS);
                let errors = colour.error + scalar.error;
                for lane in 0..LANES {
                    let (error, rotation) = (errors.0[lane], chosen[lane]);
                    if error < best[lane].0 {
                        best[lane] = (error, rotation);
                    }
                    if error < self.errors[lane] {
                        self.errors[lane] = error;
                        let content = &mut self.contents[lane];
                        *content = Content { mode, rotation, colour_takes_second, ..Content::NONE };
                        put_ends(&colour, lane, content, 0);
                        content.ends[0][3] = scalar.codes[0][0].byte(lane);
                        content.ends[1][3] = scalar.codes[1][0].byte(lane);
                        put_places(&colour.places, lane, &mut content.colour);
                        put_places(&scalar.places, lane, &mut content.alpha);
                    }
                }
            }
        }
        self.solved = true;
    }

    /// The channels and their weights, in each lane with alpha and the channel of its rotation in each other's place.
    #[inline(always)]
    fn rotated(&self, rotations: &[usize; LANES]) -> ([Plane; 4], [Plane; 4]) {
        let mut values = self.values;
        let mut weights = [self.colour_weight, self.colour_weight, self.colour_weight, self.alpha_weight];
        for planes in [&mut values, &mut weights] {
            let [r, g, b, alpha] = planes;
            for (channel, plane) in [r, g, b].into_iter().enumerate() {
                for i in 0..TEXELS {
                    for lane in 0..LANES {
                        if rotations[lane] == channel + 1 {
                            std::mem::swap(&mut plane[i].0[lane], &mut alpha[i].0[lane]);
                        }
                    }
                }
            }
        }
        (values, weights)
    }

    /// Modes 7, 1 and 3: a line for each of two subsets of the texels.
    #[inline(always)]
    fn two_lines_of_texels(&mut self) {
        let mut opaque = [true; LANES];
        for alpha in &self.values[3] {
            for lane in 0..LANES {
                opaque[lane] &= alpha.0[lane] == 255.0;
            }
        }
        let any_opaque = opaque[..self.len].contains(&true);
        for chosen in patterns::<PATTERNS>(&self.values, &self.colour_weight) {
            let mut colour = [[Lanes::ZERO; TEXELS]; 2];
            let mut alpha = colour;
            for i in 0..TEXELS {
                for lane in 0..LANES {
                    let subset = usize::from(TWO[chosen[lane]] >> i & 1);
                    colour[subset][i].0[lane] = self.colour_weight[i].0[lane];
                    alpha[subset][i].0[lane] = self.alpha_weight[i].0[lane];
                }
            }
            let storage = Storage { bits: 5, low_bits: LowBits::EachEnd, steps: 3.0 };
            let [r, g, b, a] = &self.values;
            let mut lines = [Line::<4>::NONE; 2];
            for (subset, line) in lines.iter_mut().enumerate() {
                let (colour, alpha) = (&colour[subset], &alpha[subset]);
                *line = Colours { values: [r, g, b, a], weights: [colour, colour, colour, alpha] }
                    .line(storage, FAST_ROUNDS);
            }
            self.offer(&lines, 7, &chosen, [true; LANES]);
            if any_opaque {
                for (mode, storage) in [
                    (1, Storage { bits: 6, low_bits: LowBits::EachSubset, steps: 7.0 }),
                    (3, Storage { bits: 7, low_bits: LowBits::EachEnd, steps: 3.0 }),
                ] {
                    let [r, g, b, _] = &self.values;
                    let mut lines = [Line::<3>::NONE; 2];
                    for (line, colour) in lines.iter_mut().zip(&colour) {
                        *line =
                            Colours { values: [r, g, b], weights: [colour; 3] }.line(storage, FAST_ROUNDS);
                    }
                    self.offer(&lines, mode, &chosen, opaque);
                }
            }
        }
    }

    /// Takes two lines where they are better and allowed.
    #[inline(always)]
    fn offer<const C: usize>(
        &mut self,
        lines: &[Line<C>; 2],
        mode: usize,
        patterns: &[usize; LANES],
        allowed: [bool; LANES],
    ) {
        let errors = lines[0].error + lines[1].error;
        for lane in 0..LANES {
            if allowed[lane] && errors.0[lane] < self.errors[lane] {
                self.errors[lane] = errors.0[lane];
                let content = &mut self.contents[lane];
                *content = Content { mode, pattern: patterns[lane], ..Content::NONE };
                for (subset, line) in lines.iter().enumerate() {
                    put_ends(line, lane, content, subset);
                }
                for i in 0..TEXELS {
                    let subset = usize::from(TWO[patterns[lane]] >> i & 1);
                    content.colour[i] = lines[subset].places[i].byte(lane);
                }
            }
        }
    }
}

/// The ends of a line as those of a subset.
#[inline(always)]
fn put_ends<const C: usize>(line: &Line<C>, lane: usize, content: &mut Content, subset: usize) {
    for end in 0..2 {
        for c in 0..C {
            content.ends[2 * subset + end][c] = line.codes[end][c].byte(lane);
        }
        content.low[2 * subset + end] = line.low[end].byte(lane);
    }
}

/// One lane's places as indices.
#[inline(always)]
fn put_places(places: &Plane, lane: usize, indices: &mut [u8; TEXELS]) {
    for (index, place) in indices.iter_mut().zip(places) {
        *index = place.byte(lane);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bc::bc7::decode;

    /// Four rows of colours on a bent line with noise, some of them not seen, some opaque.
    fn rows(width: usize) -> [Vec<[u8; 4]>; EDGE] {
        let mut state = 7_u32;
        [0, 1, 2, 3].map(|y| {
            (0..width)
                .map(|x| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let hu = (x * 7 + y * 31) as u32 % 400 + (state >> 26);
                    let alpha = if hu < 100 { 0 } else { (2 * (hu - 100)).min(255) };
                    [hu / 2, if hu < 200 { hu } else { 200 }, 255 - hu / 2, alpha]
                        .map(|value| value.min(255) as u8)
                })
                .collect()
        })
    }

    #[test]
    fn wider_vectors_make_the_same_bytes() {
        for width in [1, 30, 64, 517] {
            let rows = rows(width);
            let rows = [0, 1, 2, 3].map(|y: usize| rows[y].as_slice());
            for level in [Level::Fast, Level::Best] {
                for weight in [ColourWeight::Alpha, ColourWeight::Equal] {
                    let options = EncodeOptions::default().with_level(level).with_colour_weight(weight);
                    let [mut wide, mut plain] = [0; 2].map(|_| vec![0; width.div_ceil(4) * 16]);
                    encode_row(rows, &mut wide, options);
                    encode_row_plain(rows, &mut plain, options);
                    assert_eq!(wide, plain, "{width} {level:?} {weight:?}");
                }
            }
        }
    }

    #[test]
    fn the_error_that_a_choice_rests_on_is_that_of_the_block_decoded() {
        let rows = rows(4 * LANES);
        let rows = [0, 1, 2, 3].map(|y: usize| rows[y].as_slice());
        let mut batch = Batch::new();
        for place in 0..LANES {
            batch.push(&texels(rows, place), place, ColourWeight::Equal);
        }
        let steps: [fn(&mut Batch); 3] =
            [|batch| batch.one_line(ROUNDS), Batch::two_lines_of_channels, Batch::two_lines_of_texels];
        for step in steps {
            step(&mut batch);
            for lane in 0..LANES {
                let decoded = decode(batch.contents[lane].pack());
                let error: u32 = decoded
                    .as_flattened()
                    .iter()
                    .zip(texels(rows, lane).as_flattened())
                    .map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2))
                    .sum();
                assert_eq!(batch.errors[lane], error as f32, "lane {lane}: {:?}", batch.contents[lane]);
            }
        }
    }
}
