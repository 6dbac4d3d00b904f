//! What a stored sample becomes: a colour and an opacity, or a number of 8 or 16 bits.

use std::sync::OnceLock;

use super::TextureError;
use super::domain::{Domain, SampleKind};
use crate::{BlockFormat, bc};

/// Entries of a table: one for each index that a [`Domain`] can give, so that none is out of bounds.
const ENTRIES: usize = 1 << 16;

/// How much of the way along a stretch of the curve its chord must be for the stretch to count as straight: 70 %, in
/// hundredths of the square. On three CTs with three functions this costs at most 1.4 dB against 95 %.
const STRAIGHT_PERCENT_SQUARED: i64 = 49;

/// Stretches of the curve that are told apart.
const STRETCHES: usize = 64;

/// Fraction bits of [`ColourTable::unit`].
const UNIT_BITS: u32 = 24;

/// A stretch of colours so short, in 1/255 of a channel, that its bend is of the size of rounding.
const SHORT: i64 = 6;

/// One point of a transfer function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColourPoint {
    /// The stored value: of CT, HU with the rescale undone.
    pub value: f64,
    /// Red, green, blue and opacity, straight (not premultiplied), in `[0, 1]`.
    pub rgba: [f64; 4],
}

/// A transfer function as a table over the values that samples can have.
///
/// The function is linear between its points and constant outside them; where two points have one value it jumps,
/// and the value itself belongs to the later one. Samples of whole numbers each have their own entry, so the table
/// is exact; for floats see [`Domain`], and at a jump a float may fall to either side.
///
/// **What is not seen.** Values whose opacity rounds to 0 of 255 are *clear*. A block with only such values of one
/// run is a constant, of the colour of the seen values that the run adjoins: there, linear filtering mixes it in,
/// and no other colour brings a fringe.
#[derive(Debug)]
pub struct ColourTable {
    domain: Domain,
    opaque: bool,
    /// By index up to the last: the unrounded colour and opacity.
    truth: Vec<[f32; 4]>,
    /// By index: the colour and opacity of the uncompressed texture.
    texels: Box<[[u8; 4]; ENTRIES]>,
    /// By index: the run of neighbouring values that look the same, by its number, in the low half; in the high half the
    /// stretch of the curve, below [`STRETCHES`].
    kinds: Box<[u32; ENTRIES]>,
    /// By stretch: to the end of which others the colours lie nearly on a line, a bit for each.
    straight: [u64; STRETCHES],
    /// By index: the place on the curve that the function is. The low half is the opacity in 1/65535; the high half
    /// is the way along the curve of *seen* colours, in 1/65535 of all of it, which never falls.
    places: Box<[u32; ENTRIES]>,
    /// By index: the colour at that place; of a clear value, that of its run's constant. And in 5:6:5 bits.
    colours: Box<[[u8; 4]; ENTRIES]>,
    packed: Box<[u16; ENTRIES]>,
    /// The longest run of clear values, first and last index; none is empty, from 1 to 0.
    clear: [u16; 2],
    /// What one step of the way along the curve is; 2⁻²⁴ of 1/255 of a channel.
    unit: i64,
    /// By run: its constant block.
    constants: Vec<Constant>,
    /// By run: its constant block in BC7.
    accurate: OnceLock<Vec<[u8; 16]>>,
}

/// A block all of whose values are in one run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Constant {
    /// Whether it is not seen.
    pub(super) clear: bool,
    /// Its colour and opacity.
    texel: [u8; 4],
    /// Its bytes as BC3; the last 8 are BC1.
    block: [u8; 16],
}

impl Constant {
    /// The bytes of BC3, or of BC1 if a block has 8.
    #[inline(always)]
    pub(super) fn block<const BYTES: usize>(&self) -> [u8; BYTES] {
        let mut block = [0; BYTES];
        block.copy_from_slice(&self.block[16 - BYTES..]);
        block
    }
}

impl ColourTable {
    /// The table of a transfer function for samples of `kind`; floats that are not finite count as `padding`.
    ///
    /// # Errors
    /// [`TextureError::Points`] without points, where values fall, and for numbers that are not finite or
    /// components outside `[0, 1]`.
    pub fn new(points: &[ColourPoint], kind: SampleKind, padding: f64) -> Result<Self, TextureError> {
        Self::with_opacity(points, kind, padding, false)
    }

    /// The same without opacity, every value fully opaque: what [`crate::BlockFormat::Bc1`] can hold.
    ///
    /// # Errors
    /// Those of [`ColourTable::new`].
    pub fn opaque(points: &[ColourPoint], kind: SampleKind, padding: f64) -> Result<Self, TextureError> {
        Self::with_opacity(points, kind, padding, true)
    }

    fn with_opacity(
        points: &[ColourPoint],
        kind: SampleKind,
        padding: f64,
        opaque: bool,
    ) -> Result<Self, TextureError> {
        let ordered = points.is_sorted_by(|a, b| a.value <= b.value);
        let in_range = |point: &ColourPoint| {
            point.value.is_finite() && point.rgba.iter().all(|c| (0.0..=1.0).contains(c))
        };
        let (Some(first), Some(last)) = (points.first(), points.last()) else {
            return Err(TextureError::Points { index: 0 });
        };
        if !ordered || !points.iter().all(in_range) {
            let index = (0..points.len())
                .find(|&i| !in_range(&points[i]) || (i > 0 && points[i].value < points[i - 1].value));
            return Err(TextureError::Points { index: index.unwrap_or_default() });
        }
        // A step further than the points on either side, since the function may jump there.
        let margin = match kind {
            SampleKind::F32 if last.value > first.value => (last.value - first.value) / ENTRIES as f64,
            _ => 1.0,
        };
        let domain = Domain::new(kind, [first.value - margin, last.value + margin], padding);
        let mut table = Self {
            domain,
            opaque,
            truth: Vec::with_capacity(usize::from(domain.last()) + 1),
            texels: entries(),
            kinds: entries(),
            straight: [0; STRETCHES],
            places: entries(),
            colours: entries(),
            packed: entries(),
            clear: [1, 0],
            unit: 0,
            constants: Vec::new(),
            accurate: OnceLock::new(),
        };
        table.sample(points);
        table.find_runs();
        table.follow_curve();
        table.find_stretches(points);
        Ok(table)
    }

    /// The values that have an entry.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// Whether every value is fully opaque.
    pub fn is_opaque(&self) -> bool {
        self.opaque
    }

    /// The unrounded colour and opacity, by index.
    pub(super) fn truth(&self) -> &[[f32; 4]] {
        &self.truth
    }

    /// The texels of the uncompressed texture, by index.
    pub(super) fn texels(&self) -> &[[u8; 4]; ENTRIES] {
        &self.texels
    }

    /// The run that both ends of a range of indices, and so all of it, are in.
    #[inline(always)]
    pub(super) fn run(&self, range: [u16; 2]) -> Option<u16> {
        self.is_constant(range).then_some(self.run_at(range[0]))
    }

    /// Whether both ends of a range of indices, and so all of it, are in one run.
    #[inline(always)]
    pub(super) fn is_constant(&self, range: [u16; 2]) -> bool {
        let [low, high] = range.map(|index| self.run_at(index));
        low == high
    }

    /// Whether the colours of a range of indices lie nearly on a line, as far as that is known of its stretches.
    #[inline(always)]
    pub(super) fn is_straight(&self, range: [u16; 2]) -> bool {
        let [low, high] = range.map(|index| self.kinds[usize::from(index)] >> 16);
        self.straight[low as usize % STRETCHES] >> (high % STRETCHES as u32) & 1 == 1
    }

    /// The places on the curve, by index: opacity in the low half, the way along in the high half.
    pub(super) fn places(&self) -> &[u32; ENTRIES] {
        &self.places
    }

    /// The colours at those places in 5:6:5 bits, by index.
    pub(super) fn packed(&self) -> &[u16; ENTRIES] {
        &self.packed
    }

    /// The longest run of clear values, first and last index; from 1 to 0 if there are none.
    #[inline(always)]
    pub(super) fn clear(&self) -> [u16; 2] {
        self.clear
    }

    /// The run of an index.
    #[inline(always)]
    pub(super) fn run_at(&self, index: u16) -> u16 {
        self.kinds[usize::from(index)] as u16
    }

    /// The constant block of a run.
    #[inline(always)]
    pub(super) fn constant(&self, run: u16) -> &Constant {
        &self.constants[usize::from(run)]
    }

    /// How many runs there are.
    pub(super) fn runs_count(&self) -> usize {
        self.constants.len()
    }

    /// The constant block of each run in BC7, made when it is first asked for.
    pub(super) fn accurate(&self) -> &[[u8; 16]] {
        self.accurate.get_or_init(|| self.constants.iter().map(|c| bc::bc7_constant(c.texel)).collect())
    }

    /// The constant block of a run in a format of colours.
    pub(super) fn constant_bytes(&self, run: usize, format: BlockFormat) -> &[u8] {
        match format {
            BlockFormat::Bc7 => &self.accurate()[run],
            _ => &self.constants[run].block[16 - format.block_bytes().min(16)..],
        }
    }

    /// Fills in the colours of all indices, piece by piece.
    fn sample(&mut self, points: &[ColourPoint]) {
        let mut after = 0;
        for index in 0..=self.domain.last() {
            let value = self.domain.value(index);
            while points.get(after).is_some_and(|point| point.value <= value) {
                after += 1;
            }
            let below = points[after.saturating_sub(1)];
            let above = points[after.min(points.len() - 1)];
            let part = if above.value > below.value {
                (value - below.value) / (above.value - below.value)
            } else {
                0.0
            };
            let mut rgba: [f64; 4] =
                std::array::from_fn(|c| below.rgba[c] + (above.rgba[c] - below.rgba[c]) * part);
            if self.opaque {
                rgba[3] = 1.0;
            }
            self.texels[usize::from(index)] = rgba.map(|component| (component * 255.0 + 0.5) as u8);
            self.truth.push(rgba.map(|component| component as f32));
        }
    }

    /// Numbers the runs of values that look the same, and finds the constant of each.
    fn find_runs(&mut self) {
        let texels = &self.texels[..=usize::from(self.domain.last())];
        let mut start = 0;
        for run in texels.chunk_by(|a, b| a == b || (a[3] == 0 && b[3] == 0)) {
            let end = start + run.len();
            self.kinds[start..end].fill(self.constants.len() as u32);
            let clear = run[0][3] == 0;
            let texel = if clear {
                // The colours of the seen neighbours, or the mean of both.
                let before = start.checked_sub(1).map(|i| texels[i]);
                let after = texels.get(end).copied();
                let (a, b) = (before.or(after).unwrap_or(run[0]), after.or(before).unwrap_or(run[0]));
                let mean = |c: usize| u16::midpoint(a[c].into(), b[c].into()) as u8;
                [mean(0), mean(1), mean(2), 0]
            } else {
                run[0]
            };
            self.constants.push(Constant { clear, texel, block: bc::constant(texel) });
            for (i, own) in (start..end).zip(run) {
                self.colours[i] = if clear { texel } else { *own };
                self.packed[i] = packed(self.colours[i]);
            }
            let [from, to] = self.clear.map(usize::from);
            if clear && (from > to || run.len() > to - from + 1) {
                self.clear = [start as u16, (end - 1) as u16];
            }
            start = end;
        }
    }

    /// Fills in the places on the curve.
    fn follow_curve(&mut self) {
        let colour = |i: usize| {
            // Unrounded where it is seen: rounding would lengthen a slow curve.
            let [red, green, blue, _] = self.truth[i];
            if self.texels[i][3] > 0 { [red, green, blue] } else { self.constant_colour(i) }
        };
        let mut way = 0.0_f64;
        let mut ways = vec![0.0; self.truth.len()];
        let mut last = colour(0);
        for (i, sum) in ways.iter_mut().enumerate() {
            let here = colour(i);
            way += f64::from(distance(last, here));
            (last, *sum) = (here, way);
        }
        let scale = if way > 0.0 { 65535.0 / way } else { 0.0 };
        self.unit = (way * 255.0 / 65535.0 * f64::from(1 << UNIT_BITS)).round() as i64;
        for (i, way) in ways.into_iter().enumerate() {
            let opacity = (self.truth[i][3] * 65535.0 + 0.5) as u32;
            self.places[i] = opacity | ((way * scale + 0.5) as u32) << 16;
        }
    }

    /// Numbers the stretches of the curve, between the points and where it begins or ends to be seen, and finds which
    /// lie on a line together.
    fn find_stretches(&mut self, points: &[ColourPoint]) {
        let len = self.truth.len();
        let kind = |index: usize| {
            let value = self.domain.value(index as u16);
            (points.partition_point(|point| point.value <= value), self.texels[index][3] == 0)
        };
        let (mut stretch, mut last) = (0_usize, kind(0));
        let mut numbers = Vec::with_capacity(len);
        for index in 0..len {
            let kind = kind(index);
            stretch += usize::from(kind != last);
            last = kind;
            numbers.push(stretch);
        }
        // Of too many, neighbours count as one.
        let merged = (stretch + 1).div_ceil(STRETCHES);
        let mut ends: Vec<[u16; 2]> = Vec::new();
        for (index, number) in numbers.into_iter().enumerate() {
            let number = number / merged;
            self.kinds[index] |= (number as u32) << 16;
            match ends.get_mut(number) {
                Some([_, last]) => *last = index as u16,
                None => ends.push([index as u16; 2]),
            }
        }
        for (a, from) in ends.iter().enumerate() {
            for (b, to) in ends.iter().enumerate().skip(a) {
                let all = [[from[0], to[0]], [from[0], to[1]], [from[1], to[0]], [from[1], to[1]]];
                let straight =
                    all.iter().all(|[low, high]| self.is_near_its_chord([*low.min(high), *high.max(low)]));
                self.straight[a] |= u64::from(straight) << b;
            }
        }
    }

    /// Whether the colours of a range of indices are near the line from the first to the last.
    fn is_near_its_chord(&self, range: [u16; 2]) -> bool {
        let [from, to] = range.map(|index| self.places[usize::from(index)] >> 16);
        let [a, b] = range.map(|index| self.colours[usize::from(index)]);
        let apart = |c: usize| i32::from(a[c]) - i32::from(b[c]);
        let [red, green, blue] = [apart(0), apart(1), apart(2)];
        let chord_squared = i64::from(red * red + green * green + blue * blue);
        let way = (i64::from(to - from) * self.unit) >> UNIT_BITS;
        100 * chord_squared >= STRAIGHT_PERCENT_SQUARED * (way * way) || way < SHORT
    }

    fn constant_colour(&self, index: usize) -> [f32; 3] {
        let [red, green, blue, _] = self.colours[index];
        [red, green, blue].map(|c| f32::from(c) / 255.0)
    }
}

/// A colour in 5:6:5 bits, rounded to the nearest.
fn packed([red, green, blue, _]: [u8; 4]) -> u16 {
    let [red, green, blue] = [red, green, blue].map(u32::from);
    // Exact for all of 8 bits: (31·v + 127)/255 and (63·v + 127)/255.
    (((red * 249 + 1014) >> 11) << 11 | ((green * 253 + 505) >> 10) << 5 | ((blue * 249 + 1014) >> 11)) as u16
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [red, green, blue] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    (red * red + green * green + blue * blue).sqrt()
}

/// A table of all entries. Only those that are written or read take memory.
#[expect(clippy::unnecessary_box_returns, reason = "a table of that size is no value to move about")]
fn entries<T: Copy + Default>() -> Box<[T; ENTRIES]> {
    let entries: Result<Box<[T; ENTRIES]>, _> = vec![T::default(); ENTRIES].into_boxed_slice().try_into();
    // The length is right, so the second way, through the stack, is never taken.
    entries.unwrap_or_else(|_| Box::new([T::default(); ENTRIES]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_8_bits_are_rounded_to_the_nearest_of_5_and_6() {
        for v in 0..=255_u8 {
            let nearest = |most: f64| (f64::from(v) * most / 255.0).round() as u16;
            assert_eq!(packed([v, 0, 0, 0]) >> 11, nearest(31.0), "red {v}");
            assert_eq!(packed([0, v, 0, 0]) >> 5, nearest(63.0), "green {v}");
            assert_eq!(packed([0, 0, v, 0]), nearest(31.0), "blue {v}");
        }
    }
}
