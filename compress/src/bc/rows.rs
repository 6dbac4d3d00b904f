//! From rows of voxels to blocks of BC1, BC3 and BC4: what is constant is written at once, the rest goes to the kernels
//! in batches.

use super::batch::{EDGE, LANES, Plane, Words, colour_rows, scalar_plane, strips};
use super::endpoints::TEXELS;
use super::fast::Four;
use super::scalar::{self, Effort};
use super::{ColourWeight, EncodeOptions, Level, bc1, colour, fast};
use crate::simd::{LINE_BYTES, Simd, fetch_ahead, in_each_kind};

/// Blocks that are looked at before any is encoded.
const LOOK_AHEAD: usize = LANES;

/// Encodes one row of blocks of BC4: `rows` are its four rows of voxels, of one length each, `out` a block for each
/// four voxels begun. Past the end of a row its last voxel is repeated.
pub(super) fn encode_scalars(rows: [&[u8]; EDGE], out: &mut [[u8; 8]], options: EncodeOptions, simd: Simd) {
    match options.level {
        Level::Fast => fast::scalars(rows, out, simd),
        Level::Best => strips(rows, out, |strip| best_scalars(strip, simd)),
    }
}

/// Encodes rows of blocks of BC1, if they have 8 bytes, or BC3, `across` blocks each; see [`encode_scalars`].
pub(super) fn encode_colours<'a, const BYTES: usize>(
    rows: impl Iterator<Item = [&'a [[u8; 4]]; EDGE]>,
    across: usize,
    out: &mut [[u8; BYTES]],
    options: EncodeOptions,
    simd: Simd,
) {
    if options.level == Level::Fast {
        for (rows, out) in rows.zip(out.chunks_mut(across.max(1))) {
            let [a, b, c, d] = rows.map(|row| row.as_flattened().as_chunks().0);
            let (whole, rest) = out.split_at_mut(a.len());
            fast::colours([a, b, c, d], whole, simd);
            if !rest.is_empty() {
                fast::colours(rows.map(padded).each_ref().map(std::slice::from_ref), rest, simd);
            }
        }
        return;
    }
    let mut batch = Batch::new();
    let mut writer = Writer { out, options, simd, constants: Constants::new() };
    for (begin, rows) in (0..writer.out.len()).step_by(across.max(1)).zip(rows) {
        let fours = rows.map(|row| row.as_flattened().as_chunks().0);
        let whole = fours[0].len();
        for first in (0..whole).step_by(LOOK_AHEAD) {
            let [a, b, c, d] = fours.map(|fours| &fours[first..whole.min(first + LOOK_AHEAD)]);
            let mut ahead = Ahead { rows: [a, b, c, d], distance: EDGE * whole, next: 0 };
            let mut varied = not_of_one_colour([a, b, c, d], simd);
            for (i, four) in a.iter().enumerate() {
                if varied >> i & 1 == 0 {
                    writer.write(four, begin + first + i);
                }
            }
            while varied != 0 {
                let i = varied.trailing_zeros() as usize;
                batch.add([&a[i], &b[i], &c[i], &d[i]], begin + first + i, &mut writer, &mut ahead);
                varied &= varied - 1;
            }
            (0..EDGE).for_each(|_| ahead.fetch());
        }
        if whole < across {
            let [a, b, c, d] = rows.map(padded);
            if is_one_colour([&a, &b, &c, &d]) {
                writer.write(&a, begin + whole);
            } else {
                batch.add([&a, &b, &c, &d], begin + whole, &mut writer, &mut Ahead::default());
            }
        }
    }
    batch.flush(&mut writer, &mut Ahead::default());
}

/// The last four texels of a row that is cut off, the last repeated.
fn padded(row: &[[u8; 4]]) -> Four {
    let rest = row.as_chunks::<EDGE>().1;
    let last = rest.len().saturating_sub(1);
    let mut four = [0; 16];
    for (k, texel) in four.as_chunks_mut().0.iter_mut().enumerate() {
        *texel = rest.get(k.min(last)).copied().unwrap_or_default();
    }
    four
}

/// The block of one colour.
pub(super) fn constant<const BYTES: usize>([red, green, blue, alpha]: [u8; 4]) -> [u8; BYTES] {
    let mut block = [0; BYTES];
    let (alphas, colours) = block.split_at_mut(BYTES - 8);
    if let [low, high, ..] = alphas {
        (*low, *high) = (alpha, alpha);
    }
    colours.copy_from_slice(&bc1::solid([red, green, blue]).to_le_bytes());
    block
}

/// A block as it is stored.
fn bytes([a, b, c, d]: Words) -> [u8; 8] {
    (u64::from(a) | u64::from(b) << 16 | u64::from(c) << 32 | u64::from(d) << 48).to_le_bytes()
}

/// Where blocks go, and how they are made.
struct Writer<'a, const BYTES: usize> {
    out: &'a mut [[u8; BYTES]],
    options: EncodeOptions,
    simd: Simd,
    constants: Constants<BYTES>,
}

impl<const BYTES: usize> Writer<'_, BYTES> {
    /// Writes the block of the colour that all four texels are.
    fn write(&mut self, [red, green, blue, alpha, ..]: &Four, at: usize) {
        self.out[at] = self.constants.block([*red, *green, *blue, *alpha]);
    }
}

/// Blocks of one colour. The one that came last is kept: the next is often the same.
pub(super) struct Constants<const BYTES: usize> {
    texel: [u8; 4],
    block: [u8; BYTES],
}

impl<const BYTES: usize> Constants<BYTES> {
    pub(super) fn new() -> Self {
        Self { texel: [0; 4], block: constant([0; 4]) }
    }

    /// The block of a colour.
    #[inline(always)]
    pub(super) fn block(&mut self, texel: [u8; 4]) -> [u8; BYTES] {
        if texel != self.texel {
            *self = Self { texel, block: constant(texel) };
        }
        self.block
    }
}

in_each_kind! {
    /// Which of at most 64 blocks are not of one colour, a bit for each.
    fn not_of_one_colour(rows: [&[Four]; EDGE]) -> u64,
    {
        let [a, b, c, d] = rows;
        let mut varied = 0;
        for (i, (((a, b), c), d)) in a.iter().zip(b).zip(c).zip(d).enumerate() {
            varied |= u64::from(!is_one_colour([a, b, c, d])) << i;
        }
        varied
    }
}

/// Whether all 16 texels of a block are one.
#[inline(always)]
fn is_one_colour(rows: [&Four; EDGE]) -> bool {
    let [a, b, c, d] = rows.map(|row| bytemuck::cast::<Four, [u64; 2]>(*row));
    let first = a[0] & 0xFFFF_FFFF;
    let twice = first | first << 32;
    let off = |row: [u64; 2]| (row[0] ^ twice) | (row[1] ^ twice);
    off(a) | off(b) | off(c) | off(d) == 0
}

/// The rows of the next blocks, which follow these: fetched bit by bit while these are encoded, since memory takes only so
/// many requests at a time.
#[derive(Default)]
struct Ahead<'a> {
    rows: [&'a [Four]; EDGE],
    distance: usize,
    next: usize,
}

impl Ahead<'_> {
    /// Asks for the next row.
    fn fetch(&mut self) {
        let row = self.rows.get(self.next).copied().unwrap_or_default();
        for line in row.chunks(LINE_BYTES / size_of::<Four>()) {
            fetch_ahead(line, self.distance);
        }
        self.next += 1;
    }
}

/// Blocks of colours that wait for the kernels.
struct Batch {
    /// Their four rows, one block beside the other.
    rows: [[Four; LANES]; EDGE],
    /// Their channels, each alone in its bytes; and by texel and lane.
    channels: [[[u8; LANES * EDGE]; EDGE]; 4],
    planes: [Plane; 4],
    /// Which block of the output each is.
    at: [u32; LANES],
    len: usize,
}

impl Batch {
    fn new() -> Self {
        Self {
            rows: [[[0; 16]; LANES]; EDGE],
            channels: [[[0; LANES * EDGE]; EDGE]; 4],
            planes: [[[0; LANES]; TEXELS]; 4],
            at: [0; LANES],
            len: 0,
        }
    }

    /// Adds a block that goes to place `at`, and encodes what waits if that is enough.
    #[inline(always)]
    fn add<const BYTES: usize>(
        &mut self,
        rows: [&Four; EDGE],
        at: usize,
        writer: &mut Writer<'_, BYTES>,
        ahead: &mut Ahead<'_>,
    ) {
        // Always so: it spares the checks of indices.
        let lane = self.len % LANES;
        for (fours, four) in self.rows.iter_mut().zip(rows) {
            fours[lane] = *four;
        }
        self.at[lane] = at as u32;
        self.len = lane + 1;
        if self.len == LANES {
            self.flush(writer, ahead);
        }
    }

    /// Encodes what waits.
    #[inline(never)]
    fn flush<const BYTES: usize>(&mut self, writer: &mut Writer<'_, BYTES>, ahead: &mut Ahead<'_>) {
        if self.len == 0 {
            return;
        }
        let mut alphas = [[0; 4]; LANES];
        let mut colours = [[0; 4]; LANES];
        self.encode(BYTES == 16, writer.options, writer.simd, ahead, &mut alphas, &mut colours);
        for ((alpha, colour), at) in alphas.into_iter().zip(colours).zip(&self.at[..self.len]) {
            let (alphas, colours) = writer.out[*at as usize].split_at_mut(BYTES - 8);
            if BYTES == 16 {
                alphas.copy_from_slice(&bytes(alpha));
            }
            colours.copy_from_slice(&bytes(colour));
        }
        self.len = 0;
    }

    /// The blocks of alpha, if it is asked for, and those of colour.
    fn encode(
        &mut self,
        with_alpha: bool,
        options: EncodeOptions,
        simd: Simd,
        ahead: &mut Ahead<'_>,
        alphas: &mut [Words; LANES],
        colours: &mut [Words; LANES],
    ) {
        let planes = &mut self.planes;
        ahead.fetch();
        split_colours(&self.rows, &mut self.channels, simd);
        for (channel, plane) in self.channels.iter().zip(&mut *planes) {
            split_scalars(channel.each_ref(), plane, simd);
        }
        ahead.fetch();
        let weighted = options.colour_weight == ColourWeight::Alpha;
        match (with_alpha, weighted) {
            (true, true) => fitted_scalars(&planes[3], alphas, simd),
            (true, false) => scalars_of_ranges(&planes[3], alphas, simd),
            (false, _) => {}
        }
        ahead.fetch();
        match (with_alpha, weighted) {
            (true, true) => weighted_colours(planes, colours, simd),
            (true, false) => diagonal_colours(planes, colours, simd),
            // What BC1 packs need not follow one curve, as the colours of a transfer function do.
            (false, _) => principal_colours(planes, colours, simd),
        }
    }
}

// Each on its own, since in one large function the compiler leaves calls in the loops.
in_each_kind! {
    /// One channel, by texel.
    fn split_scalars(strip: [&[u8; LANES * EDGE]; EDGE], plane: &mut Plane), scalar_plane(strip, plane)
}
in_each_kind! {
    /// Four channels, each alone in its bytes.
    fn split_colours(rows: &[[Four; LANES]; EDGE], channels: &mut [[[u8; LANES * EDGE]; EDGE]; 4]),
    colour_rows(rows, channels)
}
in_each_kind! {
    fn scalars_of_ranges(plane: &Plane, blocks: &mut [Words; LANES]), scalar::encode(plane, Effort::Ranges, blocks)
}
in_each_kind! {
    fn fitted_scalars(plane: &Plane, blocks: &mut [Words; LANES]), scalar::encode(plane, Effort::Fitted, blocks)
}
in_each_kind! {
    fn searched_scalars(plane: &Plane, blocks: &mut [Words; LANES]), scalar::encode(plane, Effort::Searched, blocks)
}
in_each_kind! {
    fn diagonal_colours(planes: &[Plane; 4], blocks: &mut [Words; LANES]),
    colour::encode::<false, false>(planes, blocks)
}
in_each_kind! {
    fn principal_colours(planes: &[Plane; 4], blocks: &mut [Words; LANES]),
    colour::encode::<false, true>(planes, blocks)
}
in_each_kind! {
    fn weighted_colours(planes: &[Plane; 4], blocks: &mut [Words; LANES]),
    colour::encode::<true, true>(planes, blocks)
}

/// The blocks of a strip of one channel.
fn best_scalars(strip: [&[u8; LANES * EDGE]; EDGE], simd: Simd) -> [[u8; 8]; LANES] {
    let mut plane: Plane = [[0; LANES]; TEXELS];
    let mut blocks = [[0; 4]; LANES];
    split_scalars(strip, &mut plane, simd);
    searched_scalars(&plane, &mut blocks, simd);
    blocks.map(bytes)
}
