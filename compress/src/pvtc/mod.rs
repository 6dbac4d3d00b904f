//! PVTC <S, T>: a series of 8-bit volumes at a rate that is chosen, and known, before anything is compressed.
//!
//! A volume is split into sub-volumes of 4×4×S voxels, and T successive steps of a sub-volume are compressed
//! together: each step keeps two *end points* `U_t` and `D_t`, and all steps share one *table* L that gives each voxel
//! 2 bits. Step t of voxel i decodes as (Yamada, Eq. 1)
//!
//! ```text
//! L_i = 0: U_t     L_i = 1: (2·U_t + D_t)/3     L_i = 2: (U_t + 2·D_t)/3     L_i = 3: D_t
//! ```
//!
//! S is 1, 2, 4 or 8: larger S leans on likeness in space; T is 1 to 4: larger T on likeness in time.
//! [`Layout`] is such a pair. Yamada's own four are <4, 3>, <4, 2>, <1, 3> and <1, 2>; <1, 3> is Nagayasu's PVTC.
//!
//! # Bytes of a group of T steps
//! With `n = ⌈x/4⌉·⌈y/4⌉·⌈z/S⌉` sub-volumes, ordered x fastest, then y, then z:
//!
//! | bytes | holds |
//! |---|---|
//! | `4·i .. 4·i + 4`, for i in 0..n | head of sub-volume i: U in the first two bytes, D in the last two |
//! | `4·n + 4·S·i .. 4·n + 4·S·(i + 1)` | table of sub-volume i |
//!
//! so that all heads come first and all tables after them: `n·(4 + 4·S)` bytes in all.
//!
//! **Head.** U and D are 16-bit words, little-endian. Each holds one field a step, the first step in the highest
//! bits:
//!
//! | T | bits of the steps | step 0 | step 1 | step 2 | step 3 |
//! |---|---|---|---|---|---|
//! | 1 | 16 | 0..16 | | | |
//! | 2 | 8, 8 | 8..16 | 0..8 | | |
//! | 3 | 5, 6, 5 | 11..16 | 5..11 | 0..5 | |
//! | 4 | 4, 4, 4, 4 | 12..16 | 8..12 | 4..8 | 0..4 |
//!
//! For T = 3 the head is thus that of a BC1 block whose red, green and blue are three steps. The papers fix the
//! widths for T of 2 and 3; those for 1 and 4 share the same 16 bits alike.
//!
//! **Table.** Byte `4·s + j` of a table holds row j (along y) of slice s (along z) of the sub-volume; in it, voxel i
//! along x has bits `2·i .. 2·i + 2`. A table is thus S little-endian words of 32 bits, one a slice, in the order of
//! a BC1 block; the meaning of the four indices is Eq. 1's, not BC1's.
//!
//! **Value.** A field of b bits stands for the real number `field/M`, `M = 2^b − 1`, of the full scale 255. Values
//! are rounded once, to the nearest, after the mixture, in whole numbers:
//!
//! ```text
//! w     = (3 − L)·U + L·D           // 0 ..= 3·M
//! value = (170·w + M) / (2·M)       // rounded down; 0 ..= 255; fits 32 bits for every M
//! ```
//!
//! which no order of evaluation, and no GPU, can make different. For b = 8 it is `(w + 1) / 3`. For T = 3 it is what
//! [`crate::bc`] decodes from BC1.
//!
//! **Edges.** Where a sub-volume reaches over a far edge, the last voxel is repeated in x, y and z. A last group of
//! fewer than T steps repeats its last step; its size is that of a whole group.
//!
//! # Encoders
//! [`Encoder::MinMax`] is the papers': `U_t` is the largest and `D_t` the smallest value of step t, to the nearest that
//! the field can hold, and `L_i` is the index whose four (T-dimensional) decoded values are nearest to the voxel's, the
//! smallest such index. [`Encoder::Fitted`] writes the same format with end points and indices that are chosen
//! together for the least squared error. It orders `U_t` and `D_t` of each step as it likes, so that a step that falls
//! while another rises can share its table; decoders do not care.
//!
//! Parts: `ends` the fields and values, `encode` and `fit` the two encoders, `decode` the decoder; [`packed`] is the
//! other way to a texture, PVTC-TE and PVTC-SE, which texture hardware decodes; [`measure`] tries what each of these
//! makes of a series.
//!
//! Source: *Yamada*, sections 2 and 3; *Nagayasu*, section 3.2.

mod decode;
mod encode;
mod ends;
mod fit;
pub mod measure;
pub mod packed;

use std::fmt;

use thiserror::Error;

use crate::{Extent3, bc};

/// Voxels of a sub-volume in x, and in y.
const EDGE: usize = 4;

/// Bytes of the end points of a sub-volume.
const HEAD_BYTES: usize = 4;

/// Most slices of a sub-volume.
const MOST_SLICES: usize = 8;

/// A pair <S, T>: slices of a sub-volume, and steps that are compressed together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Layout {
    s: u8,
    t: u8,
}

/// Why a layout cannot be.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LayoutError {
    /// S is not one of 1, 2, 4, 8.
    #[error("a sub-volume of {s} slices is not defined: take 1, 2, 4 or 8")]
    Slices {
        /// The slices asked for.
        s: u8,
    },
    /// T is not in 1..=4.
    #[error("a group of {t} steps is not defined: take 1, 2, 3 or 4")]
    Steps {
        /// The steps asked for.
        t: u8,
    },
}

impl Layout {
    /// Every layout, by S, then T.
    pub const ALL: [Self; 16] = {
        let mut all = [Self { s: 1, t: 1 }; 16];
        let mut i = 0;
        while i < 16 {
            all[i] = Self { s: 1 << (i / 4), t: (i % 4 + 1) as u8 };
            i += 1;
        }
        all
    };

    /// The layout of sub-volumes of 4×4×`s` voxels and groups of `t` steps.
    ///
    /// # Errors
    /// [`LayoutError::Slices`] if `s` is not 1, 2, 4 or 8; [`LayoutError::Steps`] if `t` is not 1 to 4.
    pub fn new(s: u8, t: u8) -> Result<Self, LayoutError> {
        if !matches!(s, 1 | 2 | 4 | 8) {
            return Err(LayoutError::Slices { s });
        }
        if !matches!(t, 1..=4) {
            return Err(LayoutError::Steps { t });
        }
        Ok(Self { s, t })
    }

    /// Slices of a sub-volume: 1, 2, 4 or 8.
    pub fn s(self) -> u8 {
        self.s
    }

    /// Steps of a group: 1 to 4.
    pub fn t(self) -> u8 {
        self.t
    }

    /// How many sub-volumes cover a volume, `[x, y, z]`: ⌈x/4⌉, ⌈y/4⌉, ⌈z/S⌉.
    pub fn sub_volumes(self, extent: Extent3) -> [usize; 3] {
        [extent.x().div_ceil(EDGE), extent.y().div_ceil(EDGE), extent.z().div_ceil(self.s.into())]
    }

    /// Bytes of one group of T steps: `n·(4 + 4·S)` for n sub-volumes.
    pub fn encoded_len(self, extent: Extent3) -> usize {
        let [x, y, z] = self.sub_volumes(extent);
        x * y * z * (HEAD_BYTES + self.table_bytes())
    }

    /// Bytes of the heads of one group, which come before the tables: `4·n` for n sub-volumes.
    pub fn head_len(self, extent: Extent3) -> usize {
        let [x, y, z] = self.sub_volumes(extent);
        x * y * z * HEAD_BYTES
    }

    /// Encoded bytes for each byte of samples, edges apart: (4 + 4·S) / (16·S·T).
    pub fn rate(self) -> f64 {
        (HEAD_BYTES + self.table_bytes()) as f64 / (EDGE * EDGE * usize::from(self.s * self.t)) as f64
    }

    /// Where the end points of a step of the group, from 0, lie in the two words of a head: the lowest bit, and the
    /// greatest number. None past the last step.
    pub fn field(self, step: usize) -> Option<(u32, u32)> {
        let steps = usize::from(self.t);
        let field = (step < steps).then(|| ends::Field::new(steps, step))?;
        Some((field.shift, field.most))
    }

    /// Bytes of the table of a sub-volume.
    fn table_bytes(self) -> usize {
        4 * usize::from(self.s)
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "<{},{}>", self.s, self.t)
    }
}

/// How end points and indices are chosen. The bytes mean the same, and are as many.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Encoder {
    /// Largest and smallest value of each step, as in the papers.
    MinMax,
    /// End points and indices together, for the least squared error.
    #[default]
    Fitted,
}

/// Why steps cannot be encoded.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum EncodeError {
    /// There are no steps, or more than a group has.
    #[error("{found} steps were given for one group: give 1 to {most}")]
    Steps {
        /// Steps given.
        found: usize,
        /// Steps of a group.
        most: usize,
    },
    /// A step's samples are not those of the extent.
    #[error("step {step} has {found} bytes of samples, but its extent needs {expected}: give 1 byte a voxel")]
    Length {
        /// The step, counted from 0.
        step: usize,
        /// Bytes that the extent needs.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
    /// There is no memory for the encoded bytes.
    #[error("no memory for {bytes} encoded bytes: close other volumes or encode a part")]
    OutOfMemory {
        /// Bytes needed.
        bytes: usize,
    },
    /// The texture of [`packed`] cannot be encoded.
    #[error("the packed texture cannot be encoded")]
    Texture {
        /// Why.
        #[from]
        source: bc::EncodeError,
    },
}

/// Why a step cannot be decoded. Every bit pattern is valid; only sizes can be wrong.
#[derive(Debug, Error, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DecodeError {
    /// The bytes are not those of one group of the extent.
    #[error(
        "{found} encoded bytes were given, but one group of this extent has {expected}: the data are cut off or of another layout"
    )]
    Length {
        /// Bytes that the extent needs.
        expected: usize,
        /// Bytes given.
        found: usize,
    },
    /// The step is not in the group.
    #[error("step {step} was asked of a group of {steps}: count from 0 within the group")]
    Step {
        /// The step asked for.
        step: usize,
        /// Steps of a group.
        steps: usize,
    },
    /// The place for the samples is not that of the extent.
    #[error("there is room for {found} samples, but the extent has {expected}: give 1 byte a voxel")]
    Room {
        /// Samples of the extent.
        expected: usize,
        /// Bytes given to decode into.
        found: usize,
    },
    /// The texture of [`packed`] cannot be decoded.
    #[error("the packed texture cannot be decoded")]
    Texture {
        /// Why.
        #[from]
        source: bc::DecodeError,
    },
}

/// Encodes one group: `steps` are 1 to T successive volumes, each `[x, y, z]`, x fastest, 1 byte a voxel.
///
/// The result has [`Layout::encoded_len`] bytes, also where fewer than T steps are given: the last is then repeated,
/// and what decodes past it is of no meaning. Runs on the current rayon pool; the bytes are the same for any number
/// of threads.
///
/// # Errors
/// [`EncodeError::Steps`] if there are no steps or more than T; [`EncodeError::Length`] if one has not x·y·z bytes;
/// [`EncodeError::OutOfMemory`].
pub fn encode(
    layout: Layout,
    steps: &[&[u8]],
    extent: Extent3,
    encoder: Encoder,
) -> Result<Vec<u8>, EncodeError> {
    check_steps(steps, extent, layout.t.into())?;
    let bytes = layout.encoded_len(extent);
    let mut encoded = zeroed(bytes).ok_or(EncodeError::OutOfMemory { bytes })?;
    encode::group(layout, steps, extent, encoder, &mut encoded);
    Ok(encoded)
}

/// Decodes step `step`, counted from 0, of one group into `out`, `[x, y, z]`, x fastest.
///
/// `bytes` has [`Layout::encoded_len`] bytes and `out` x·y·z. Runs on the current rayon pool, over rows of
/// sub-volumes.
///
/// # Errors
/// [`DecodeError::Length`] and [`DecodeError::Room`] if `bytes` or `out` has another length; [`DecodeError::Step`]
/// if `step` is not below T.
pub fn decode_step(
    layout: Layout,
    bytes: &[u8],
    extent: Extent3,
    step: usize,
    out: &mut [u8],
) -> Result<(), DecodeError> {
    let expected = layout.encoded_len(extent);
    if bytes.len() != expected {
        return Err(DecodeError::Length { expected, found: bytes.len() });
    }
    check_room(step, layout.t.into(), extent, out)?;
    let (heads, tables) = bytes.split_at(layout.head_len(extent));
    decode::step(layout, heads, tables, extent, step, out);
    Ok(())
}

/// Checks that there are 1 to `most` steps, each of the extent's length.
fn check_steps(steps: &[&[u8]], extent: Extent3, most: usize) -> Result<(), EncodeError> {
    if steps.is_empty() || steps.len() > most {
        return Err(EncodeError::Steps { found: steps.len(), most });
    }
    let expected = extent.voxels();
    match steps.iter().position(|samples| samples.len() != expected) {
        Some(step) => Err(EncodeError::Length { step, expected, found: steps[step].len() }),
        None => Ok(()),
    }
}

/// Checks that the step is one of `steps`, and that `out` has the extent's length.
fn check_room(step: usize, steps: usize, extent: Extent3, out: &[u8]) -> Result<(), DecodeError> {
    if step >= steps {
        return Err(DecodeError::Step { step, steps });
    }
    if out.len() != extent.voxels() {
        return Err(DecodeError::Room { expected: extent.voxels(), found: out.len() });
    }
    Ok(())
}

/// `len` zero bytes, or none where there is no memory for them.
fn zeroed(len: usize) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(len).ok()?;
    bytes.resize(len, 0);
    Some(bytes)
}
