//! The choice of a scheme: similarity against closed forms, sizes that are exact, targets that are met or said not to be.

use compress::Extent3;
use compress::pvtc::choose::{Candidate, Scheme, Target, choose, measure, similarity};
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
fn a_sample_of_a_large_series_is_near_the_whole() {
    let extent = extent([100, 70, 50]);
    let steps = series(extent, true);
    let steps = borrowed(&steps);
    let layout = Layout::new(4, 3).unwrap();
    let scheme = [Scheme::Layout(layout)];
    let sampled = measure(&steps, extent, scheme, Encoder::MinMax, |_, bytes| bytes.len()).unwrap()[0];
    let bytes = encode(layout, &steps[..3], extent, Encoder::MinMax).unwrap();
    let mut copy = vec![0; extent.voxels()];
    decode_step(layout, &bytes, extent, 0, &mut copy).unwrap();
    let exact = quality::compare(steps[0], &copy, 255.0).unwrap().psnr_db;
    assert!((sampled.psnr_db - exact).abs() < 0.5, "{} for {exact}", sampled.psnr_db);
}

#[test]
fn longer_groups_are_chosen_where_time_is_alike_and_shorter_where_it_is_not() {
    let extent = extent([64, 48, 24]);
    let chosen = |noise_in_time: bool, target: Target| {
        let steps = series(extent, noise_in_time);
        let candidates =
            measure(&borrowed(&steps), extent, Scheme::all(), Encoder::Fitted, |_, bytes| bytes.len())
                .unwrap();
        choose(&candidates, target).unwrap()
    };
    // A still series loses little by long groups, so that the quality comes in fewer bytes.
    let (still, moving) = (chosen(false, Target::Psnr { db: 37.0 }), chosen(true, Target::Psnr { db: 37.0 }));
    assert!(still.met && moving.met, "{still:?} {moving:?}");
    assert!(still.candidate.scheme.steps() > moving.candidate.scheme.steps(), "{still:?} {moving:?}");
    assert!(still.candidate.bytes_per_step < moving.candidate.bytes_per_step, "{still:?} {moving:?}");
    // The same size holds more of it.
    let size = Target::Bytes { per_step: 0.17 * extent.voxels() as f64 };
    let (still, moving) = (chosen(false, size), chosen(true, size));
    assert!(still.met && still.candidate.psnr_db > moving.candidate.psnr_db, "{still:?} {moving:?}");
}

#[test]
fn the_target_is_met_by_the_best_and_where_none_does_the_nearest_is_named_as_such() {
    let candidate = |s, t, bytes_per_step, psnr_db| Candidate {
        scheme: Scheme::Layout(Layout::new(s, t).unwrap()),
        bytes_per_step,
        psnr_db,
    };
    // Yamada, tables 1 and 5, turbulence, of 1000 bytes a step.
    let [a, b, c, d] = [
        candidate(4, 3, 104.0, 31.5),
        candidate(4, 2, 156.0, 39.2),
        candidate(1, 3, 167.0, 31.8),
        candidate(1, 2, 250.0, 40.9),
    ];
    let all = [a, b, c, d];
    let check = |target: Target, expected: Candidate, met: bool| {
        let choice = choose(&all, target).unwrap();
        assert_eq!((choice.candidate, choice.met), (expected, met), "{target:?}");
    };
    check(Target::Psnr { db: 31.6 }, b, true);
    check(Target::Psnr { db: 30.0 }, a, true);
    check(Target::Psnr { db: 50.0 }, d, false);
    check(Target::Bytes { per_step: 200.0 }, b, true);
    check(Target::Bytes { per_step: 50.0 }, a, false);
    // 20 a second leave 50 ms, 30 of them for 3000 bytes a second: 90 bytes; 10 leave 80 ms, 240 bytes.
    let fps = |fps| Target::Fps { fps, bytes_per_second: 3000.0, fixed_seconds: 0.02 };
    check(fps(20.0), a, false);
    check(fps(10.0), b, true);
    check(fps(60.0), a, false);
    assert_eq!(choose(&[], fps(10.0)), None, "nothing to choose from");
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
