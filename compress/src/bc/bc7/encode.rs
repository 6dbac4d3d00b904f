//! Encodes rows of blocks, eight blocks at a time.
//!
//! A block of one colour is exact and costs next to nothing. Others are gathered in batches of [`LANES`] and tried in
//! mode 6, one line through R, G, B, A; those that it does not serve well are tried on, at [`Level::Best`] only, in
//! modes 4 and 5, which give one channel a line of its own, and in modes 7, 1 and 3, which divide the block in two.
//! Modes 0 and 2, three opaque lines, are not written: a CT's colours seldom are three lines in one block, and
//! opaque hardly ever.

use super::fit::{Colours, Line, Plane, Storage};
use super::lanes::{LANES, Lanes};
use super::modes::LowBits;
use super::pack::Content;
use super::partitions::TWO;
use super::split::patterns;
use crate::bc::endpoints::TEXELS;
use crate::bc::{ColourWeight, EncodeOptions, Level};

/// Voxels of a block in x.
const EDGE: usize = 4;

/// Weight of the colour of a voxel of alpha 0, in units of alpha; as in BC3.
const UNSEEN_WEIGHT: f32 = 8.0;

/// Mean squared error of a block, over its four channels, that is not worth another mode.
const GOOD: f32 = 0.12;

/// Patterns of two subsets that are fitted in full.
const PATTERNS: usize = 4;

/// Rounds of least squares: on one line, and in each of the many lines of the other modes.
const ROUNDS: usize = 2;
const FAST_ROUNDS: usize = 1;

/// Which channel each of modes 4 and 5 may part from the others: alpha, R, G, B by rotation.
const ROTATIONS: usize = 4;

/// Eight blocks, or fewer: what is in the other lanes is encoded and left.
struct Batch {
    /// R, G, B, A.
    values: [Plane; 4],
    /// How much an error counts in colour, and in alpha.
    colour_weight: Plane,
    alpha_weight: Plane,
    /// Where each block goes, and how many there are.
    places: [usize; LANES],
    len: usize,
}

/// The best found for each block.
struct Found {
    contents: [Content; LANES],
    errors: [f32; LANES],
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
#[inline(always)]
fn encode_row_plain(rows: [&[[u8; 4]]; EDGE], blocks: &mut [u8], options: EncodeOptions) {
    let mut batch = Batch::new();
    for place in 0..blocks.len() / 16 {
        let texels = gather(rows, place);
        if texels.iter().all(|texel| *texel == texels[0]) {
            blocks[16 * place..][..16].copy_from_slice(&Content::solid(texels[0]).pack());
            continue;
        }
        batch.push(&texels, place, options.colour_weight);
        if batch.len == LANES {
            batch.encode(blocks, options.level);
        }
    }
    if batch.len > 0 {
        batch.encode(blocks, options.level);
    }
}

/// The texels of one block. Past the end of a row its last voxel is repeated.
#[inline(always)]
fn gather(rows: [&[[u8; 4]]; EDGE], place: usize) -> [[u8; 4]; TEXELS] {
    let mut texels = [[0; 4]; TEXELS];
    for (texels, row) in texels.chunks_exact_mut(EDGE).zip(rows) {
        let rest = &row[EDGE * place..];
        if let Some(whole) = rest.first_chunk::<EDGE>() {
            texels.copy_from_slice(whole);
        } else {
            for (i, texel) in texels.iter_mut().enumerate() {
                *texel = rest[i.min(rest.len() - 1)];
            }
        }
    }
    texels
}

impl Batch {
    fn new() -> Self {
        let plane = [Lanes::ZERO; TEXELS];
        Self {
            values: [plane; 4],
            colour_weight: [Lanes::ONE; TEXELS],
            alpha_weight: [Lanes::ONE; TEXELS],
            places: [0; LANES],
            len: 0,
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
        self.places[lane] = place;
        self.len += 1;
    }

    /// Encodes the blocks to their places and empties the batch.
    #[inline(always)]
    fn encode(&mut self, blocks: &mut [u8], level: Level) {
        let mut found = Found { contents: [Content::NONE; LANES], errors: [f32::INFINITY; LANES] };
        self.one_line(&mut found, if level == Level::Best { ROUNDS } else { FAST_ROUNDS });
        if level == Level::Best {
            if self.any_worth_more(&found) {
                self.two_lines_of_channels(&mut found);
            }
            if self.any_worth_more(&found) {
                self.two_lines_of_texels(&mut found);
            }
        }
        for (content, &place) in found.contents.iter().zip(&self.places[..self.len]) {
            blocks[16 * place..][..16].copy_from_slice(&content.pack());
        }
        self.len = 0;
    }

    /// Whether a block's error is worth more work.
    fn any_worth_more(&self, found: &Found) -> bool {
        found.errors[..self.len].iter().any(|&error| error > GOOD * (4 * TEXELS) as f32)
    }

    /// Mode 6.
    #[inline(always)]
    fn one_line(&self, found: &mut Found, rounds: usize) {
        let [r, g, b, a] = &self.values;
        let (colour, alpha) = (&self.colour_weight, &self.alpha_weight);
        let colours = Colours { values: [r, g, b, a], weights: [colour, colour, colour, alpha] };
        let line = colours.line(Storage { bits: 7, low_bits: LowBits::EachEnd, steps: 15.0 }, rounds);
        for lane in 0..LANES {
            let error = line.error.0[lane];
            if error < found.errors[lane] {
                found.errors[lane] = error;
                let content = &mut found.contents[lane];
                *content = Content { mode: 6, ..Content::NONE };
                put_ends(&line, lane, content, 0);
                content.colour = bytes(&line.places, lane);
            }
        }
    }

    /// Modes 5 and 4: one channel apart from the others.
    #[inline(always)]
    fn two_lines_of_channels(&self, found: &mut Found) {
        for rotation in 0..ROTATIONS {
            let mut together = [0, 1, 2];
            let mut apart = 3;
            if rotation > 0 {
                apart = rotation - 1;
                together[apart] = 3;
            }
            let weight = |channel: usize| if channel == 3 { &self.alpha_weight } else { &self.colour_weight };
            let colours =
                Colours { values: together.map(|c| &self.values[c]), weights: together.map(weight) };
            let scalars = Colours { values: [&self.values[apart]], weights: [weight(apart)] };
            for (mode, colour_takes_second, colour, scalar) in [
                (5, false, (7, 3.0), (8, 3.0)),
                (4, false, (5, 3.0), (6, 7.0)),
                (4, true, (5, 7.0), (6, 3.0)),
            ] {
                let storage = |(bits, steps)| Storage { bits, low_bits: LowBits::None, steps };
                let colour = colours.line(storage(colour), FAST_ROUNDS);
                let scalar = scalars.line(storage(scalar), FAST_ROUNDS);
                let errors = colour.error + scalar.error;
                for lane in 0..LANES {
                    if errors.0[lane] < found.errors[lane] {
                        found.errors[lane] = errors.0[lane];
                        let content = &mut found.contents[lane];
                        *content = Content { mode, rotation, colour_takes_second, ..Content::NONE };
                        put_ends(&colour, lane, content, 0);
                        content.ends[0][3] = scalar.codes[0][0].byte(lane);
                        content.ends[1][3] = scalar.codes[1][0].byte(lane);
                        content.colour = bytes(&colour.places, lane);
                        content.alpha = bytes(&scalar.places, lane);
                    }
                }
            }
        }
    }

    /// Modes 7, 1 and 3: a line for each of two subsets of the texels.
    #[inline(always)]
    fn two_lines_of_texels(&self, found: &mut Found) {
        let opaque: [bool; LANES] =
            std::array::from_fn(|lane| self.values[3].iter().all(|alpha| alpha.0[lane] == 255.0));
        let best = patterns::<PATTERNS>(&self.values, &self.colour_weight);
        for chosen in best {
            let mut colour = [[Lanes::ZERO; TEXELS]; 2];
            let mut alpha = colour;
            for i in 0..TEXELS {
                for lane in 0..LANES {
                    let subset = usize::from(TWO[chosen[lane]] >> i & 1);
                    colour[subset][i].0[lane] = self.colour_weight[i].0[lane];
                    alpha[subset][i].0[lane] = self.alpha_weight[i].0[lane];
                }
            }
            let [r, g, b, a] = &self.values;
            if opaque[..self.len].contains(&false) {
                let storage = Storage { bits: 5, low_bits: LowBits::EachEnd, steps: 3.0 };
                let lines = [0, 1].map(|subset: usize| {
                    let (colour, alpha) = (&colour[subset], &alpha[subset]);
                    Colours { values: [r, g, b, a], weights: [colour, colour, colour, alpha] }
                        .line(storage, FAST_ROUNDS)
                });
                found.offer(&lines, 7, &chosen, &[true; LANES]);
            }
            if opaque[..self.len].contains(&true) {
                for (mode, storage) in [
                    (1, Storage { bits: 6, low_bits: LowBits::EachSubset, steps: 7.0 }),
                    (3, Storage { bits: 7, low_bits: LowBits::EachEnd, steps: 3.0 }),
                ] {
                    let lines = [0, 1].map(|subset: usize| {
                        let colour = &colour[subset];
                        Colours { values: [r, g, b], weights: [colour; 3] }.line(storage, FAST_ROUNDS)
                    });
                    found.offer(&lines, mode, &chosen, &opaque);
                }
            }
        }
    }
}

impl Found {
    /// Takes two lines where they are better and allowed.
    #[inline(always)]
    fn offer<const C: usize>(
        &mut self,
        lines: &[Line<C>; 2],
        mode: usize,
        patterns: &[usize; LANES],
        allowed: &[bool; LANES],
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

/// The whole numbers of one lane.
#[inline(always)]
fn bytes(plane: &Plane, lane: usize) -> [u8; TEXELS] {
    plane.map(|lanes| lanes.byte(lane))
}
