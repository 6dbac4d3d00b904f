//! What the chunks of a series decode to.

use std::fmt;

use crate::Extent3;
use crate::lossless::Shape;
use crate::pvtc::Layout;
use crate::pvtc::packed::Packing;

/// Bytes of a BC1 block.
const BLOCK_BYTES: usize = 8;

/// Bytes of the end points of a sub-volume of PVTC.
const HEAD_BYTES: usize = 4;

/// How the steps of a chunk are compressed. The set is closed, and the ids stand in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum StepCodec {
    /// Not at all: 8 bits a voxel.
    Raw8,
    /// Not at all: 16 bits a voxel, little-endian.
    Raw16,
    /// A group of [`pvtc`](crate::pvtc).
    Pvtc(Layout),
    /// BC1 blocks of [`pvtc::packed`](crate::pvtc::packed): PVTC-TE or PVTC-SE.
    Packed(Packing),
}

impl StepCodec {
    /// Steps of a full chunk: 1 raw, T for PVTC, 3 for TE, 1 for SE.
    pub fn steps_per_chunk(self) -> u8 {
        match self {
            Self::Raw8 | Self::Raw16 | Self::Packed(Packing::Se) => 1,
            Self::Pvtc(layout) => layout.t(),
            Self::Packed(Packing::Te) => 3,
        }
    }

    /// The elements of a chunk's payload for a volume of `extent`; [`Shape::bytes`] is the payload's length.
    pub fn shape(self, extent: Extent3) -> Shape {
        match self {
            Self::Raw8 => Shape::new(extent.voxels(), 1),
            Self::Raw16 => Shape::new(extent.voxels(), 2),
            Self::Pvtc(layout) => {
                let heads = layout.head_len(extent);
                let sub_volumes = heads / HEAD_BYTES;
                let table_bytes = usize::from(layout.s()).saturating_mul(4);
                Shape::new(sub_volumes, HEAD_BYTES).then(sub_volumes, table_bytes)
            }
            Self::Packed(packing) => Shape::new(packing.encoded_len(extent) / BLOCK_BYTES, BLOCK_BYTES),
        }
    }

    /// The three bytes that stand in a header: id, S, T.
    pub(super) fn ids(self) -> [u8; 3] {
        match self {
            Self::Raw8 => [0, 0, 0],
            Self::Raw16 => [1, 0, 0],
            Self::Pvtc(layout) => [2, layout.s(), layout.t()],
            Self::Packed(Packing::Te) => [3, 0, 0],
            Self::Packed(Packing::Se) => [4, 0, 0],
        }
    }

    /// What the three bytes stand for; none if nothing.
    pub(super) fn from_ids(ids: [u8; 3]) -> Option<Self> {
        match ids {
            [0, 0, 0] => Some(Self::Raw8),
            [1, 0, 0] => Some(Self::Raw16),
            [2, s, t] => Layout::new(s, t).ok().map(Self::Pvtc),
            [3, 0, 0] => Some(Self::Packed(Packing::Te)),
            [4, 0, 0] => Some(Self::Packed(Packing::Se)),
            _ => None,
        }
    }
}

impl fmt::Display for StepCodec {
    /// Such as `raw 8`, `pvtc <4,3>`, `te`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Raw8 => f.write_str("raw 8"),
            Self::Raw16 => f.write_str("raw 16"),
            Self::Pvtc(layout) => write!(f, "pvtc {layout}"),
            Self::Packed(packing) => f.write_str(packing.name()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_of_a_header_lead_back_to_their_codec_and_no_others_are_taken() {
        let mut codecs = vec![StepCodec::Raw8, StepCodec::Raw16];
        codecs.extend(Layout::ALL.map(StepCodec::Pvtc));
        codecs.extend(Packing::ALL.map(StepCodec::Packed));
        for &codec in &codecs {
            assert_eq!(StepCodec::from_ids(codec.ids()), Some(codec), "{codec}");
        }
        let all = (0..=u8::MAX).flat_map(|id| (0..10).flat_map(move |s| (0..6).map(move |t| [id, s, t])));
        assert_eq!(
            all.filter_map(StepCodec::from_ids).count(),
            codecs.len(),
            "no other bytes stand for a codec"
        );
    }

    #[test]
    fn a_shape_has_the_bytes_that_the_codec_makes() {
        let extent = Extent3::new([9, 6, 7]).unwrap();
        for layout in Layout::ALL {
            assert_eq!(StepCodec::Pvtc(layout).shape(extent).bytes(), layout.encoded_len(extent), "{layout}");
        }
        for packing in Packing::ALL {
            let codec = StepCodec::Packed(packing);
            assert_eq!(codec.shape(extent).bytes(), packing.encoded_len(extent), "{codec}");
            assert_eq!(usize::from(codec.steps_per_chunk()), packing.steps(), "steps of {codec}");
        }
        assert_eq!(StepCodec::Raw16.shape(extent).bytes(), 2 * 378, "raw, 16 bits");
    }
}
