//! What schemes make of a sample: similarity against closed forms, sizes that are exact.

use compress::Extent3;
use compress::pvtc::measure::{Scheme, measure, similarity};
use compress::pvtc::packed::Packing;
use compress::pvtc::{Encoder, Layout, decode_step, encode};
use compress::quality;

use super::{borrowed, extent};
use crate::phantom::Noise;

/// Twelve steps of a smooth pattern, with noise of its own in each step, or the same in all.
fn series(extent: Extent3, noise_in_time: bool) -> Vec<Vec<u8>> {
    let step = |t: u64| -> Vec<u8> {
        let mut noise = Noise(if noise_in_time { t } else { 0 });
        (0..extent.voxels())
            .map(|i| {
                let [x, y, z] = [i % extent.x(), i / extent.x() % extent.y(), i / extent.x() / extent.y()];
                let wave = (0.05 * x as f64).sin() + (0.07 * y as f64).cos() + (0.06 * z as f64).sin();
                (120.0 + 30.0 * wave) as u8 + (noise.bits() % 32) as u8
            })
            .collect()
    };
    (0..12).map(step).collect()
}

#[test]
fn a_still_series_is_alike_in_time_and_a_checkerboard_is_the_opposite_of_its_neighbours() {
    let extent = extent([6, 6, 6]);
    let board = |t: usize| -> Vec<u8> {
        (0..216).map(|i| if (i % 6 + i / 6 % 6 + i / 36 + t).is_multiple_of(2) { 10 } else { 250 }).collect()
    };
    let (even, odd) = (board(0), board(1));
    let still = similarity(&[&even, &even, &even], extent).unwrap();
    assert!((still.spatial + 1.0).abs() < 1e-12 && still.temporal == 1.0, "{still:?}");
    let blinking = similarity(&[&even, &odd, &even], extent).unwrap();
    assert!((blinking.temporal + 1.0).abs() < 1e-12, "{blinking:?}");
    let flat = similarity(&[&[7; 216]], extent).unwrap();
    assert_eq!((flat.spatial, flat.temporal), (1.0, 1.0), "nothing differs");
    let noise = Noise(3).bytes(2 * 64 * 64 * 64);
    let (first, second) = noise.split_at(noise.len() / 2);
    let unlike = similarity(&[first, second], Extent3::new([64; 3]).unwrap()).unwrap();
    assert!(unlike.spatial.abs() < 0.01 && unlike.temporal.abs() < 0.01, "{unlike:?}");
}

#[test]
fn a_sample_that_is_the_whole_gives_the_exact_size_and_quality() {
    // One box: 32 by 8 by 24.
    let extent = extent([32, 8, 24]);
    let steps = series(extent, true);
    let steps = borrowed(&steps);
    let candidates = measure(&steps, extent, Scheme::all(), Encoder::Fitted, |_, bytes| bytes.len()).unwrap();
    assert_eq!(candidates.len(), 18, "all schemes");
    for candidate in candidates {
        let Scheme::Layout(layout) = candidate.scheme else { continue };
        let t = usize::from(layout.t());
        assert_eq!(candidate.bytes_per_step, layout.encoded_len(extent) as f64 / t as f64, "{layout}");
        let mut copy = vec![0; extent.voxels() * 12];
        for (group, out) in steps.chunks(t).zip(copy.chunks_mut(extent.voxels() * t)) {
            let bytes = encode(layout, group, extent, Encoder::Fitted).unwrap();
            for (step, out) in out.chunks_mut(extent.voxels()).enumerate() {
                decode_step(layout, &bytes, extent, step, out).unwrap();
            }
        }
        let exact = quality::compare(&steps.concat(), &copy, 255.0).unwrap().psnr_db;
        assert!((candidate.psnr_db - exact).abs() < 1e-9, "{layout}: {} for {exact}", candidate.psnr_db);
    }
}

#[test]
fn a_sample_of_a_large_series_is_near_the_whole_also_where_boxes_do_not_divide_it() {
    for sizes in [[100, 72, 52], [36, 20, 28]] {
        let extent = extent(sizes);
        let steps = series(extent, true);
        let steps = borrowed(&steps[..3]);
        let layout = Layout::new(4, 3).unwrap();
        let scheme = [Scheme::Layout(layout)];
        let sampled = measure(&steps, extent, scheme, Encoder::MinMax, |_, bytes| bytes.len()).unwrap()[0];
        let bytes = encode(layout, &steps, extent, Encoder::MinMax).unwrap();
        let mut copy = vec![0; extent.voxels() * 3];
        for (step, out) in copy.chunks_mut(extent.voxels()).enumerate() {
            decode_step(layout, &bytes, extent, step, out).unwrap();
        }
        let exact = quality::compare(&steps.concat(), &copy, 255.0).unwrap().psnr_db;
        assert!((sampled.psnr_db - exact).abs() < 0.1, "{sizes:?}: {} for {exact}", sampled.psnr_db);
    }
}

#[test]
fn a_second_stage_counts_in_the_size_and_long_groups_need_enough_steps() {
    let extent = extent([40, 20, 30]);
    let steps = series(extent, false);
    let steps = borrowed(&steps[..2]);
    let halved = |scheme: Scheme, bytes: &[u8]| match scheme {
        Scheme::Packed(_) => bytes.len() / 2,
        Scheme::Layout(_) => bytes.len(),
    };
    let candidates = measure(&steps, extent, Scheme::all(), Encoder::MinMax, halved).unwrap();
    assert!(candidates.iter().all(|candidate| candidate.scheme.steps() <= 2), "no groups of 3 or 4");
    let se = candidates.iter().find(|candidate| candidate.scheme == Scheme::Packed(Packing::Se)).unwrap();
    assert_eq!(se.bytes_per_step, Packing::Se.encoded_len(extent) as f64 / 2.0, "half");
}
