//! The data format descriptor: what the bits of a voxel or a block mean, said again without Vulkan's numbers.
//!
//! One basic descriptor block: 24 bytes, then 16 bytes a sample. A sample is a run of bits that holds one channel;
//! of a compressed block it is the half, or the whole, that holds one.
//!
//! Source: KDFS, chapter "Khronos Data Format Descriptor", sections "Basic descriptor block" and "Compressed
//! formats".

use super::TextureFormat;
use crate::BlockFormat;

/// Bytes of the total size, which stands before the descriptor block.
const TOTAL_SIZE_BYTES: usize = 4;

/// Bytes of a basic descriptor block without its samples, and of a sample.
const BLOCK_BYTES: usize = 24;
const SAMPLE_BYTES: usize = 16;

/// `KHR_DF_VERSIONNUMBER_1_3`, also of version 1.4.
const VERSION: u16 = 2;

/// `KHR_DF_PRIMARIES_BT709`, which the standard recommends, and `KHR_DF_TRANSFER_LINEAR`: voxels are read as they
/// are stored.
const PRIMARIES_BT709: u8 = 1;
const TRANSFER_LINEAR: u8 = 1;

/// `channelType` of alpha in every colour model that has it.
const ALPHA: u8 = 15;

/// Where the fields that say nothing of the layout stand: primaries, transfer function, flags. A reader leaves
/// them open.
const OPEN_FIELDS: std::ops::Range<usize> = 13..16;

/// Where `bytesPlane0..8` stand. Older writers set them to 0 in packed files.
const PLANES: std::ops::Range<usize> = 20..28;

/// One channel of a format: bits `offset..offset + length` of the element.
struct Sample {
    offset: u16,
    length: u8,
    channel: u8,
    /// The stored number that stands for 1.
    upper: u32,
}

/// The whole descriptor of a format, with its total size first.
pub(super) fn descriptor(format: TextureFormat) -> Vec<u8> {
    let (model, block_edge, samples) = layout(format);
    let block_bytes = BLOCK_BYTES + SAMPLE_BYTES * samples.len();
    let mut bytes = Vec::with_capacity(TOTAL_SIZE_BYTES + block_bytes);
    bytes.extend(((TOTAL_SIZE_BYTES + block_bytes) as u32).to_le_bytes());
    bytes.extend(0_u32.to_le_bytes()); // vendor: Khronos; type: basic
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((block_bytes as u16).to_le_bytes());
    bytes.extend([model, PRIMARIES_BT709, TRANSFER_LINEAR, 0]); // flags 0: alpha is straight
    bytes.extend([block_edge - 1, block_edge - 1, 0, 0]);
    bytes.extend([format.element_bytes() as u8, 0, 0, 0, 0, 0, 0, 0]);
    for sample in samples {
        bytes.extend(sample.offset.to_le_bytes());
        bytes.extend([sample.length - 1, sample.channel, 0, 0, 0, 0]);
        bytes.extend(0_u32.to_le_bytes());
        bytes.extend(sample.upper.to_le_bytes());
    }
    bytes
}

/// Whether a file's descriptor says the layout of `format`. What it says of colour is left open.
pub(super) fn says(found: &[u8], format: TextureFormat) -> bool {
    let expected = descriptor(format);
    let planes_unsaid = found.get(PLANES).is_some_and(|planes| planes.iter().all(|&bytes| bytes == 0));
    found.len() == expected.len()
        && found.iter().zip(&expected).enumerate().all(|(at, (found, expected))| {
            found == expected || OPEN_FIELDS.contains(&at) || (planes_unsaid && PLANES.contains(&at))
        })
}

/// Colour model, edge of a block in x and y, and samples by their offset.
fn layout(format: TextureFormat) -> (u8, u8, Vec<Sample>) {
    let block = |offset, channel| Sample { offset, length: 64, channel, upper: u32::MAX };
    let whole = Sample { offset: 0, length: 128, channel: 0, upper: u32::MAX };
    let number = |offset, length: u8, channel| Sample { offset, length, channel, upper: (1 << length) - 1 };
    match format {
        // KHR_DF_MODEL_BC1A; channel 1 says that alpha may be present.
        TextureFormat::Block(BlockFormat::Bc1) => (128, 4, vec![block(0, 1)]),
        // KHR_DF_MODEL_BC3: the alpha half comes first.
        TextureFormat::Block(BlockFormat::Bc3) => (130, 4, vec![block(0, ALPHA), block(64, 0)]),
        // KHR_DF_MODEL_BC4
        TextureFormat::Block(BlockFormat::Bc4) => (131, 4, vec![block(0, 0)]),
        // KHR_DF_MODEL_BC7
        TextureFormat::Block(BlockFormat::Bc7) => (134, 4, vec![whole]),
        // KHR_DF_MODEL_RGBSDA: red 0, green 1, blue 2.
        TextureFormat::R8 => (1, 1, vec![number(0, 8, 0)]),
        TextureFormat::R16 => (1, 1, vec![number(0, 16, 0)]),
        TextureFormat::Rgba8 => {
            (1, 1, vec![number(0, 8, 0), number(8, 8, 1), number(16, 8, 2), number(24, 8, ALPHA)])
        }
    }
}
