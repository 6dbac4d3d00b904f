use std::time::{Duration, Instant};

use compress::container::StepCodec;
use compress::lossless::ByteCodec;
use compress::pvtc::packed::Packing;
use compress::pvtc::{Encoder, Layout};
use render::volume::{PackedFormat, Samples};

use super::*;
use crate::load::Silent;
use crate::save::series::{SeriesOptions, Written, write};

/// Nine steps of 10 × 9 × 7 voxels, 0.25 s apart; values are whole and fit 8 bits.
fn series() -> Series {
    let grid = |t: i16| {
        let samples = (0..630_i16).map(|i| (i % 97) + 10 * t + if i > 300 { 40 } else { 0 }).collect();
        let rescale = render::volume::Rescale { slope: 1.0, intercept: -50.0 };
        let place = render::volume::Affine::translation(render::volume::Vector::new(1.0, 2.0, 3.0));
        Arc::new(Grid::new([10, 9, 7], Samples::I16(samples), rescale, place).expect("grid"))
    };
    Series::new((0..9).map(grid).collect(), (0..9).map(|t| 0.25 * f64::from(t)).collect()).expect("series")
}

fn written(folder: &Path, codec: StepCodec, byte_codec: ByteCodec) -> (Steps, Written) {
    let path = folder.join("a.series");
    let options = SeriesOptions { codec, encoder: Encoder::Fitted, byte_codec };
    let made = write(&path, &Steps::in_memory(series()), "beat", "MR", options, &Silent).expect("written");
    (Steps::open(&path, 1 << 30).expect("opened"), made)
}

#[test]
fn every_codec_gives_back_its_steps_within_the_error_that_it_states() {
    let folder = tempfile::tempdir().expect("folder");
    let truth = series();
    let pvtc = |s, t| StepCodec::Pvtc(Layout::new(s, t).expect("layout"));
    let packed = Packing::ALL.map(StepCodec::Packed);
    for codec in [StepCodec::Raw8, StepCodec::Raw16, pvtc(4, 3), pvtc(1, 2), pvtc(2, 4), packed[0], packed[1]]
    {
        let (steps, made) = written(folder.path(), codec, ByteCodec::Zstd);
        assert_eq!(steps.times_secs(), truth.times_secs(), "{codec}: times");
        assert_eq!(steps.title(), Some(("beat", "MR")), "{codec}: names");
        let mut largest = 0.0_f64;
        for (step, original) in truth.steps().iter().enumerate() {
            let grid = steps.grid(step).expect("a step");
            assert_eq!(grid.world_from_voxel(), original.world_from_voxel(), "{codec}: place");
            let apart = |i: usize| (grid.value_at(i) - original.value_at(i)).abs();
            largest = (0..630).map(apart).fold(largest, f64::max);
        }
        assert!((largest - made.largest_error).abs() < 1e-9, "{codec}: {largest} is stated as {made:?}");
        let lossless = matches!(codec, StepCodec::Raw8 | StepCodec::Raw16);
        assert_eq!(lossless, largest == 0.0, "{codec}: {largest}");
        assert!(made.psnr_db > 25.0, "{codec}: {made:?}");
    }
}

#[test]
fn steps_that_lie_together_share_their_bytes() {
    let folder = tempfile::tempdir().expect("folder");
    let (steps, _) = written(folder.path(), StepCodec::Packed(Packing::Te), ByteCodec::Lz4);
    let [a, b, c] = [3, 4, 6].map(|step| steps.packed(step).expect("a step"));
    assert_eq!(a.format(), PackedFormat::Te, "as the renderer knows it");
    assert!(a.shares_bytes(&b) && !a.is_same(&b), "steps 3 and 4 are of one chunk");
    assert!(!a.shares_bytes(&c), "step 6 is of the next");
    assert_eq!([a.step(), b.step(), c.step()], [0, 1, 0], "counted within the chunk");
}

#[test]
fn what_is_wanted_becomes_ready_forwards_backwards_and_after_a_jump() {
    let folder = tempfile::tempdir().expect("folder");
    let (steps, _) =
        written(folder.path(), StepCodec::Pvtc(Layout::new(4, 2).expect("layout")), ByteCodec::Lzo);
    let wait = |step: usize, direction: Direction| {
        let begin = Instant::now();
        loop {
            steps.want(step, direction, Repeat::Loop);
            if steps.is_ready(step) {
                break;
            }
            assert!(
                begin.elapsed() < Duration::from_secs(10),
                "step {step} does not come: {:?}",
                steps.fault()
            );
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    for step in (0..9).chain(0..4) {
        wait(step, Direction::Forward);
    }
    for step in [3, 2, 1, 0, 8, 7, 6] {
        wait(step, Direction::Backward);
    }
    for step in [1, 8, 0, 5] {
        wait(step, Direction::Forward);
        assert!(steps.grid(step).is_some(), "and can be looked at");
    }
    assert_eq!(steps.fault(), None, "nothing went wrong");
}

#[test]
fn a_damaged_chunk_is_a_fault_that_names_the_file_and_the_others_still_come() {
    let folder = tempfile::tempdir().expect("folder");
    drop(written(folder.path(), StepCodec::Raw8, ByteCodec::Store));
    let path = folder.path().join("a.series");
    let mut bytes = std::fs::read(&path).expect("read");
    bytes[512 + 630 * 4 + 17] ^= 1;
    std::fs::write(&path, bytes).expect("written");
    let steps = Steps::open(&path, 1 << 30).expect("header and index are whole");
    assert!(steps.grid(3).is_some(), "the one before");
    assert!(steps.grid(4).is_none(), "the damaged one");
    assert!(
        steps.fault().is_some_and(|f| f.contains("chunk 4") && f.contains("a.series")),
        "{:?}",
        steps.fault()
    );
    assert!(steps.grid(5).is_some(), "the one after");
    assert!(Steps::open(&path, 1000).is_err(), "and a limit is kept");
}
