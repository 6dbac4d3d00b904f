//! PVTC-TE and PVTC-SE: what lies in which channel, and that it comes back.

use compress::bc::EncodeOptions;
use compress::pvtc::packed::{Packing, decode_packed_step, encode_packed};
use compress::pvtc::{DecodeError, EncodeError};

use super::{borrowed, extent, series};
use crate::naive::bc1_texel;

#[test]
fn three_samples_take_a_sixth_of_their_bytes() {
    let extent = extent([256, 256, 147]);
    for packing in Packing::ALL {
        assert_eq!(packing.encoded_len(extent) * 6, extent.voxels() * packing.steps(), "{packing:?}");
    }
}

#[test]
fn each_step_or_slice_is_a_channel_of_a_bc1_texel() {
    for (packing, sizes, given) in [
        (Packing::Te, [9, 6, 35], 3),
        (Packing::Te, [8, 8, 2], 2),
        (Packing::Te, [5, 5, 1], 1),
        (Packing::Se, [9, 6, 103], 1),
        (Packing::Se, [8, 4, 3], 1),
        (Packing::Se, [8, 4, 1], 1),
    ] {
        let extent = extent(sizes);
        let steps = series(extent, given, 0);
        let blocks = encode_packed(packing, &borrowed(&steps), extent, EncodeOptions::default()).unwrap();
        assert_eq!(blocks.len(), packing.encoded_len(extent), "{packing:?} {sizes:?}");
        let [across, down, _] = extent.blocks();
        for (step, samples) in steps.iter().enumerate() {
            let mut out = vec![0; extent.voxels()];
            decode_packed_step(packing, &blocks, extent, step, &mut out).unwrap();
            for (i, &voxel) in out.iter().enumerate() {
                let (x, y, z) = (i % extent.x(), i / extent.x() % extent.y(), i / extent.x() / extent.y());
                let (slice, channel) = match packing {
                    Packing::Te => (z, step),
                    Packing::Se => (z / 3, z % 3),
                };
                let block = &blocks[8 * ((slice * down + y / 4) * across + x / 4)..][..8];
                assert_eq!(
                    voxel,
                    bc1_texel(block, x % 4, y % 4, false)[channel],
                    "{packing:?} voxel {x} {y} {z}"
                );
                assert!(voxel.abs_diff(samples[i]) < 40, "{packing:?} voxel {x} {y} {z}");
            }
        }
    }
}

#[test]
fn wrong_sizes_are_refused_by_name() {
    let extent = extent([5, 5, 4]);
    let step = [0_u8; 100];
    let two = encode_packed(Packing::Se, &[step.as_slice(); 2], extent, EncodeOptions::default());
    assert_eq!(two, Err(EncodeError::Steps { found: 2, most: 1 }), "two steps");
    let short = encode_packed(Packing::Te, &[&step[1..]], extent, EncodeOptions::default());
    assert_eq!(short, Err(EncodeError::Length { step: 0, expected: 100, found: 99 }), "short step");
    let mut out = step;
    let blocks = encode_packed(Packing::Se, &[&step], extent, EncodeOptions::default()).unwrap();
    let cut = decode_packed_step(Packing::Se, &blocks[8..], extent, 0, &mut out);
    assert_eq!(cut, Err(DecodeError::Length { expected: 64, found: 56 }), "cut off");
    let past = decode_packed_step(Packing::Se, &blocks, extent, 1, &mut out);
    assert_eq!(past, Err(DecodeError::Step { step: 1, steps: 1 }), "second step");
    let narrow = decode_packed_step(Packing::Se, &blocks, extent, 0, &mut out[1..]);
    assert_eq!(narrow, Err(DecodeError::Room { expected: 100, found: 99 }), "no room");
}
