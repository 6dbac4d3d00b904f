//! BC7: colour and alpha in one of eight modes. 16 bytes.
//!
//! A block names its mode by its lowest bits, as many zeros as the number and a one; then come, in this order, the
//! pattern of its subsets, the rotation, the choice of indices, the end points by channel, their lowest bits, and one
//! or two sets of indices. One index in each subset, the anchor, lacks its highest bit, which is 0.
//!
//! | mode | subsets | bits of an end point | indices | used here for |
//! |---|---|---|---|---|
//! | 0, 2 | 3 | RGB 4+1, 5 | 3, 2 bits | decoded only |
//! | 1, 3 | 2 | RGB 6+1, 7+1 | 3, 2 bits | opaque blocks with an edge |
//! | 4, 5 | 1 | RGB 5, 7 and A 6, 8 | 2 and 3, 2 and 2 bits | one channel off the line of the others; solid blocks |
//! | 6 | 1 | RGBA 7+1 | 4 bits | colours on one line |
//! | 7 | 2 | RGBA 5+1 | 2 bits | an edge between two lines |
//!
//! Decoding is exact: the standard gives it in whole numbers, and hardware keeps to it.
//!
//! Parts: `modes` and `partitions` are the standard's tables, `decode` reads, `pack` writes what `encode` chose; it
//! works on eight blocks side by side (`lanes`), with the lines of `fit` and the patterns of `split`.
//!
//! Source: KDFS, "BPTC Compressed Texture Image Formats", section "BC7". The choice of patterns by the covariance of
//! each subset follows Intel's ISPC Texture Compressor.

mod decode;
mod encode;
mod fit;
mod modes;
mod pack;
mod partitions;
mod split;

pub(super) use decode::decode;
pub(super) use encode::encode_row;

/// The block of one colour, exactly.
pub(super) fn constant(texel: [u8; 4]) -> [u8; 16] {
    pack::Content::solid(texel).pack()
}
