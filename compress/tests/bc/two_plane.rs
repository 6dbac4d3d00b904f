//! Two planes for one scalar: the rule of decoding, the errors stated, and what linear interpolation makes of them.

use compress::bc::two_plane::{TwoPlaneError, decode_two_planes, encode_two_planes};
use compress::quality::compare;
use compress::{BlockFormat, Extent3, bc};

use super::extent;
use crate::{naive, phantom};

const RANGE: [f64; 2] = [-1024.0, 3071.0];

/// The phantom in whole HU, as a scanner gives it, within the range of one.
fn whole_hounsfield(extent: Extent3) -> Vec<i16> {
    let [low, high] = RANGE;
    phantom::hounsfield(extent).iter().map(|hu| hu.round().clamp(low, high) as i16).collect()
}

#[test]
fn values_are_the_offset_and_the_two_planes_times_their_scales() {
    let extent = extent([23, 18, 3]);
    let values = whole_hounsfield(extent);
    let planes = encode_two_planes(&values, extent, RANGE).unwrap();
    let decoded = decode_two_planes(&planes.blocks, extent, planes.scales).unwrap();
    let [blocks_x, blocks_y, _] = extent.blocks();
    let (mut largest, mut squares) = (0.0_f64, 0.0);
    for (i, &value) in values.iter().enumerate() {
        let (x, y, z) = (i % 23, i / 23 % 18, i / 23 / 18);
        let block = &planes.blocks[((z * blocks_y + y / 4) * blocks_x + x / 4) * 16..][..16];
        let [red, green] = [&block[..8], &block[8..]].map(|half| naive::bc4_value(half, x % 4, y % 4));
        let scales = planes.scales;
        let expected = scales.offset + scales.coarse * red + scales.residual * (green - 0.5);
        assert!((f64::from(decoded[i]) - expected).abs() < 1e-3, "voxel {x} {y} {z}");
        largest = largest.max((expected - f64::from(value)).abs());
        squares += (expected - f64::from(value)).powi(2);
    }
    let quality = planes.quality;
    assert!((quality.largest - largest).abs() < 1e-3, "stated {}, found {largest}", quality.largest);
    let rmse = (squares / values.len() as f64).sqrt();
    assert!((quality.rmse - rmse).abs() < 1e-3, "stated {}, found {rmse}", quality.rmse);
}

#[test]
fn a_decoder_of_eight_bits_is_off_by_no_more_than_is_stated_for_it() {
    let extent = extent([64, 64, 4]);
    let values = whole_hounsfield(extent);
    let planes = encode_two_planes(&values, extent, RANGE).unwrap();
    let bytes = bc::decode_volume(BlockFormat::Bc5, &planes.blocks, extent).unwrap();
    let bound = planes.quality.largest + planes.scales.rounding() + 1e-3;
    for (rg, &value) in bytes.chunks_exact(2).zip(&values) {
        let [red, green] = [rg[0], rg[1]].map(|byte| f64::from(byte) / 255.0);
        let off = (planes.scales.value(red, green) - f64::from(value)).abs();
        assert!(off <= bound, "{value} HU is off by {off} of {bound}");
    }
}

#[test]
fn two_planes_are_at_least_twice_as_near_as_eight_bits_and_eight_times_as_bc4() {
    let extent = extent([128, 128, 16]);
    let values = whole_hounsfield(extent);
    let planes = encode_two_planes(&values, extent, RANGE).unwrap().quality;
    let [low, high] = RANGE;
    let original: Vec<f64> = values.iter().map(|&value| value.into()).collect();
    let codes: Vec<u8> =
        original.iter().map(|hu| ((hu - low) / (high - low) * 255.0).round() as u8).collect();
    let hu = |codes: &[u8]| -> Vec<f64> {
        codes.iter().map(|&code| low + f64::from(code) / 255.0 * (high - low)).collect()
    };
    let eight_bits = compare(&original, &hu(&codes), high - low).unwrap();
    let blocks = bc::encode_volume(BlockFormat::Bc4, &codes, extent).unwrap();
    let bc4 = bc::decode_volume(BlockFormat::Bc4, &blocks, extent).unwrap();
    let bc4 = compare(&original, &hu(&bc4), high - low).unwrap();
    println!("two planes {planes:?}\n8 bits {eight_bits:?}\nBC4 {bc4:?}");
    assert!(2.0 * planes.rmse < eight_bits.rmse, "8 bits");
    assert!(8.0 * planes.rmse < bc4.rmse, "BC4");
    // A 126th of the widest block there can be, and the rounding of end points.
    assert!(planes.largest < (high - low) / 126.0 + (high - low) / 510.0 + 2.0, "{planes:?}");
}

#[test]
fn values_outside_the_range_are_taken_as_its_ends() {
    let extent = extent([8, 8, 1]);
    let values: Vec<i16> = (0..64).map(|i| i * 40 - 1000).collect();
    let planes = encode_two_planes(&values, extent, [100.0, 300.0]).unwrap();
    let clamped: Vec<i16> = values.iter().map(|&value| value.clamp(100, 300)).collect();
    assert_eq!(planes, encode_two_planes(&clamped, extent, [100.0, 300.0]).unwrap(), "clamped or not");
    assert!(planes.quality.largest < 4.0, "{:?}", planes.quality);
}

#[test]
fn the_bytes_of_two_planes_do_not_depend_on_the_number_of_threads() {
    let extent = extent([61, 45, 11]);
    let values = whole_hounsfield(extent);
    let [one, four] = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| encode_two_planes(&values, extent, RANGE).unwrap())
    });
    assert_eq!(one, four, "one thread and four");
}

#[test]
fn what_cannot_be_put_into_two_planes_is_refused_by_name() {
    let extent = extent([4, 4, 1]);
    let refused = |values: &[f64], range| encode_two_planes(values, extent, range).unwrap_err();
    let length = TwoPlaneError::Length { expected: 16, found: 3 };
    assert_eq!(refused(&[0.0; 3], [0.0, 1.0]), length, "length");
    let range = TwoPlaneError::Range { low: 2.0, high: 2.0 };
    assert_eq!(refused(&[0.0; 16], [2.0, 2.0]), range, "range");
    assert!(matches!(refused(&[0.0; 16], [f64::NAN, 2.0]), TwoPlaneError::Range { .. }), "NaN");
    let mut values = [0.0; 16];
    values[5] = f64::INFINITY;
    assert_eq!(refused(&values, [0.0, 1.0]), TwoPlaneError::NotFinite { index: 5 }, "infinity");
}
