//! The doors of the block codecs: any bytes of the right number are blocks, any other number is refused.

use compress::bc::decode_volume;
use compress::pvtc::packed::{Packing, decode_packed_step};
use compress::pvtc::{Layout, decode_step};
use compress::{BlockFormat, Extent3};

use crate::mutate::Random;
use crate::{Tally, knock};

const FORMATS: [BlockFormat; 3] = [BlockFormat::Bc1, BlockFormat::Bc3, BlockFormat::Bc4];

/// A small extent; once in a while one of any size, which no bytes here can be of.
fn extent(random: &mut Random) -> Option<Extent3> {
    let size = |random: &mut Random, any| if any { random.next() as u32 } else { random.below(18) as u32 };
    let any = random.once_in(16);
    Extent3::new([(); 3].map(|()| size(random, any))).ok()
}

/// Bytes of the right number most of the time.
fn bytes(random: &mut Random, expected: usize) -> Vec<u8> {
    let len = if random.once_in(4) { random.below(4000) } else { expected.min(1 << 16) };
    let like = random.next();
    (0..len).map(|_| if like.is_multiple_of(3) { like as u8 } else { random.next() as u8 }).collect()
}

pub(crate) fn bc(door: &'static str) -> Tally {
    knock(
        door,
        |random| {
            let extent = extent(random)?;
            let format = *random.pick(&FORMATS);
            Some((format, extent, bytes(random, format.encoded_len(extent))))
        },
        |prepared| {
            let Some((format, extent, blocks)) = prepared else { return (false, 0) };
            let decoded = decode_volume(*format, blocks, *extent);
            let right = blocks.len() == format.encoded_len(*extent);
            assert_eq!(decoded.is_ok(), right, "{format:?} of {extent:?}");
            (right, if right { format.decoded_len(*extent) } else { 0 })
        },
    )
}

/// A layout of PVTC, or a packed texture.
enum Group {
    Layout(Layout),
    Packing(Packing),
}

impl Group {
    fn encoded_len(&self, extent: Extent3) -> usize {
        match self {
            Self::Layout(layout) => layout.encoded_len(extent),
            Self::Packing(packing) => packing.encoded_len(extent),
        }
    }

    fn steps(&self) -> usize {
        match self {
            Self::Layout(layout) => layout.t().into(),
            Self::Packing(packing) => packing.steps(),
        }
    }
}

pub(crate) fn pvtc(door: &'static str) -> Tally {
    knock(
        door,
        |random| {
            let extent = extent(random)?;
            let group = if random.once_in(3) {
                Group::Packing(*random.pick(&Packing::ALL))
            } else {
                Group::Layout(*random.pick(&Layout::ALL))
            };
            let blocks = bytes(random, group.encoded_len(extent));
            let room = if random.once_in(8) { random.below(6000) } else { extent.voxels().min(1 << 16) };
            Some((extent, group, blocks, random.below(6), room))
        },
        |prepared| {
            let Some((extent, group, blocks, step, room)) = prepared else { return (false, 0) };
            let mut out = vec![0; *room];
            let decoded = match group {
                Group::Layout(layout) => decode_step(*layout, blocks, *extent, *step, &mut out),
                Group::Packing(packing) => decode_packed_step(*packing, blocks, *extent, *step, &mut out),
            };
            let right = blocks.len() == group.encoded_len(*extent)
                && *step < group.steps()
                && *room == extent.voxels();
            assert_eq!(decoded.is_ok(), right, "step {step} of {extent:?}");
            // Texels of BC1 are decoded before a channel is taken from them: 4 bytes for each.
            (right, room + if right { 4 * extent.voxels() } else { 0 })
        },
    )
}
