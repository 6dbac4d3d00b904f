//! The choice of a texture: bounds are kept on the whole volume, budgets are kept, the same volume gives the same.

use compress::bc::choose::{ChooseError, ColourTexture, Goal, ScalarTexture, choose_colour, choose_scalar};
use compress::bc::{EncodeOptions, decode_volume, encode_volume};
use compress::{BlockFormat, Extent3, quality};

use super::extent;
use crate::phantom;

const RANGE: [f64; 2] = [-1024.0, 3071.0];

fn whole_hounsfield(extent: Extent3) -> Vec<i16> {
    let [low, high] = RANGE;
    phantom::hounsfield(extent).iter().map(|hu| hu.round().clamp(low, high) as i16).collect()
}

#[test]
fn a_tighter_bound_takes_a_larger_texture() {
    let extent = extent([128, 128, 16]);
    let values = whole_hounsfield(extent);
    let chosen = |goal| choose_scalar(&values, extent, RANGE, goal).unwrap();
    for (goal, texture) in [
        (Goal::MaxError(400.0), ScalarTexture::Bc4),
        (Goal::MaxError(10.0), ScalarTexture::R8),
        (Goal::MaxError(1.0), ScalarTexture::R16),
        (Goal::Psnr(40.0), ScalarTexture::Bc4),
        (Goal::Psnr(58.0), ScalarTexture::R8),
        (Goal::Psnr(62.0), ScalarTexture::TwoPlanes),
        (Goal::Psnr(90.0), ScalarTexture::R16),
        (Goal::Bytes(extent.voxels() as u64 / 2), ScalarTexture::Bc4),
        (Goal::Bytes(extent.voxels() as u64), ScalarTexture::TwoPlanes),
        (Goal::Bytes(extent.voxels() as u64 * 3), ScalarTexture::R16),
    ] {
        let choice = chosen(goal);
        println!("{goal:?}: {:?}", choice.chosen);
        assert!(choice.meets_goal, "{goal:?}: {choice:?}");
        assert_eq!(choice.chosen.texture, texture, "{goal:?}: {choice:?}");
    }
    let choice = chosen(Goal::Bytes(10));
    assert!(!choice.meets_goal && choice.chosen.texture == ScalarTexture::Bc4, "{choice:?}");
}

#[test]
fn the_estimate_is_near_what_the_whole_volume_loses() {
    let extent = extent([160, 120, 40]);
    let values = whole_hounsfield(extent);
    let [low, high] = RANGE;
    let choice = choose_scalar(&values, extent, RANGE, Goal::Psnr(40.0)).unwrap();
    let original: Vec<u8> =
        values.iter().map(|&hu| ((f64::from(hu) - low) / (high - low) * 255.0).round() as u8).collect();
    let blocks = encode_volume(BlockFormat::Bc4, &original, extent).unwrap();
    let decoded = decode_volume(BlockFormat::Bc4, &blocks, extent).unwrap();
    let hu = |codes: &[u8]| -> Vec<f64> {
        codes.iter().map(|&code| low + f64::from(code) / 255.0 * (high - low)).collect()
    };
    let original: Vec<f64> = values.iter().map(|&value| value.into()).collect();
    let whole = quality::compare(&original, &hu(&decoded), high - low).unwrap();
    println!("estimated {:?}, whole {whole:?}", choice.chosen);
    assert!((choice.chosen.psnr_db - whole.psnr_db).abs() < 0.5, "PSNR {whole:?}");
    assert!(
        choice.chosen.largest <= whole.largest + 1e-9,
        "a part cannot be worse than the whole: {whole:?}"
    );
    assert!(choice.chosen.largest > 0.7 * whole.largest, "largest {whole:?}");
}

#[test]
fn colour_is_chosen_by_what_is_seen() {
    let extent = extent([96, 96, 8]);
    let hu = phantom::hounsfield(extent);
    let colour = phantom::colour(&hu);
    let chosen =
        |samples: &[u8], goal| choose_colour(samples, extent, goal, EncodeOptions::default()).unwrap();
    let choice = chosen(&colour, Goal::Psnr(35.0));
    println!("{choice:?}");
    assert!(choice.meets_goal, "{choice:?}");
    assert_eq!(choice.chosen.texture, ColourTexture::Bc3, "BC1 loses opacity: {choice:?}");
    let [bc1, bc3, bc7, rgba8] = choice.candidates.as_slice() else { unreachable!("four textures") };
    assert!(bc1.psnr_db < 35.0 && bc7.psnr_db > bc3.psnr_db, "{choice:?}");
    assert_eq!(rgba8.largest, 0.0, "as they are");
    assert_eq!(chosen(&colour, Goal::MaxError(0.0)).chosen.texture, ColourTexture::Rgba8, "lossless");
    let budget = chosen(&colour, Goal::Bytes(extent.voxels() as u64));
    assert_eq!(budget.chosen.texture, ColourTexture::Bc7, "{budget:?}");
    // Nothing is seen: nothing is lost.
    let unseen: Vec<u8> = colour.chunks_exact(4).flat_map(|c| [c[0], c[1], c[2], 0]).collect();
    assert_eq!(chosen(&unseen, Goal::Psnr(35.0)).chosen.texture, ColourTexture::Bc3, "unseen");
    // Opaque colour needs no alpha.
    let opaque: Vec<u8> = colour.chunks_exact(4).flat_map(|c| [c[0], c[1], c[2], 255]).collect();
    assert_eq!(chosen(&opaque, Goal::Psnr(35.0)).chosen.texture, ColourTexture::Bc1, "opaque");
}

#[test]
fn the_choice_does_not_depend_on_the_number_of_threads() {
    let extent = extent([100, 90, 60]);
    let values = whole_hounsfield(extent);
    let [one, four] = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| choose_scalar(&values, extent, RANGE, Goal::Psnr(50.0)).unwrap())
    });
    assert_eq!(one, four, "one thread and four");
}

#[test]
fn what_nothing_can_be_chosen_for_is_refused_by_name() {
    let extent = extent([4, 4, 1]);
    let refused = |values: &[f64], range, goal| choose_scalar(values, extent, range, goal).unwrap_err();
    let goal = Goal::Psnr(40.0);
    let length = ChooseError::Length { expected: 16, found: 2 };
    assert_eq!(refused(&[0.0; 2], [0.0, 1.0], goal), length, "length");
    assert!(matches!(refused(&[0.0; 16], [1.0, 0.0], goal), ChooseError::TwoPlanes(_)), "range");
    assert!(matches!(refused(&[f64::NAN; 16], [0.0, 1.0], goal), ChooseError::TwoPlanes(_)), "NaN");
    for bound in [-1.0, f64::INFINITY] {
        let error = refused(&[0.0; 16], [0.0, 1.0], Goal::MaxError(bound));
        assert_eq!(error, ChooseError::Goal { bound }, "{bound}");
    }
    let error = choose_colour(&[0; 16], extent, goal, EncodeOptions::default()).unwrap_err();
    assert_eq!(error, ChooseError::Length { expected: 64, found: 16 }, "colour");
}
