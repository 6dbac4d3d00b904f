//! What a writer refuses, and what it leaves in its folder.

use std::fs;

use compress::Limits;
use compress::container::{Figures, FileWriter, Reader, StepCodec, Writer};
use compress::lossless::{ByteCodec, PackOptions, Packed};
use compress::pvtc::packed::Packing;

use super::{FIGURES, header, payload};

const TE: StepCodec = StepCodec::Packed(Packing::Te);

#[test]
fn steps_that_do_not_follow_are_refused_and_leave_the_series_as_it_was() {
    let header = header([8, 8, 2], TE, ByteCodec::Lzo);
    let bytes = header.codec.shape(header.extent).bytes();
    let payload = payload(0, bytes);
    let mut writer = Writer::new(Vec::new(), &header, PackOptions::default()).unwrap();
    let cases: [(&[f64], &str); 5] = [
        (&[], "chunk 0 has 0 steps"),
        (&[0.0, 1.0, 2.0, 3.0], "chunk 0 has 4 steps"),
        (&[0.0, 0.0, 1.0], "the time of step 1 is 0 s"),
        (&[0.0, f64::NAN, 1.0], "the time of step 1 is NaN s"),
        (&[2.0, 1.0], "the time of step 1 is 1 s"),
    ];
    for (times, words) in cases {
        let message = writer.push(&payload, times).unwrap_err().to_string();
        assert!(message.contains(words), "{times:?}: {message}");
    }
    assert!(writer.push(&payload[1..], &[0.0]).is_err(), "a payload cut short");
    let empty = Packed { form: compress::lossless::Form::STORED, bytes: Vec::new() };
    assert!(writer.push_packed(&empty, &[0.0]).is_err(), "no bytes");
    writer.push(&payload, &[0.0, 1.0]).unwrap();
    let message = writer.push(&payload, &[2.0]).unwrap_err().to_string();
    assert!(message.contains("chunk 1 has 1 steps"), "after a chunk that was not full: {message}");
    let file = writer.finish(FIGURES).unwrap();
    let mut reader = super::open(&file);
    assert_eq!((reader.steps(), reader.chunks()), (2, 1), "what was refused is not there");
    reader.verify().unwrap();
}

#[test]
fn a_header_or_figures_that_cannot_be_are_refused() {
    let good = header([4, 4, 4], StepCodec::Raw8, ByteCodec::Store);
    let refused = |change: &dyn Fn(&mut compress::container::Header)| {
        let mut header = good.clone();
        change(&mut header);
        Writer::new(Vec::new(), &header, PackOptions::default()).unwrap_err().to_string()
    };
    assert!(refused(&|header| header.value_scale = 0.0).contains("scale"), "scale");
    assert!(refused(&|header| header.steps_per_sec = f64::INFINITY).contains("steps per second"), "speed");
    assert!(refused(&|header| header.world_from_voxel[15] = 0.5).contains("world_from_voxel"), "matrix");
    assert!(refused(&|header| header.name = "x".repeat(129)).contains("name"), "name");
    assert!(refused(&|header| header.unit = "\0".to_owned()).contains("unit"), "unit");

    let begun = || {
        let mut writer = Writer::new(Vec::new(), &good, PackOptions::default()).unwrap();
        writer.push(&payload(0, 64), &[0.0]).unwrap();
        writer
    };
    assert!(begun().finish(Figures { largest_error: Some(-1.0), psnr_db: None }).is_err(), "error");
    assert!(begun().finish(Figures { largest_error: None, psnr_db: Some(f64::NAN) }).is_err(), "PSNR");
    let lossless = Figures { largest_error: Some(0.0), psnr_db: Some(f64::INFINITY) };
    assert_eq!(super::open(&begun().finish(lossless).unwrap()).figures(), lossless, "nothing lost");
    let unknown = Figures::default();
    assert_eq!(super::open(&begun().finish(unknown).unwrap()).figures(), unknown, "not measured");
    let none = Writer::new(Vec::new(), &good, PackOptions::default()).unwrap();
    assert!(none.finish(FIGURES).is_err(), "no steps");
}

#[test]
fn a_file_appears_when_it_is_whole_and_not_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flow.series");
    let names = || fs::read_dir(folder.path()).unwrap().count();
    let header = header([8, 8, 2], StepCodec::Raw8, ByteCodec::Zstd);

    let mut dropped = FileWriter::create(&path, &header, PackOptions::default()).unwrap();
    dropped.push(&payload(0, 128), &[0.0]).unwrap();
    assert!(!path.exists(), "not under its name yet");
    drop(dropped);
    assert_eq!(names(), 0, "nothing is left behind");

    fs::write(&path, b"what was there before").unwrap();
    let mut writer = FileWriter::create(&path, &header, PackOptions::default()).unwrap();
    writer.push(&payload(0, 128), &[0.0]).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"what was there before", "until the end");
    let bytes = writer.finish(FIGURES).unwrap();
    assert_eq!(fs::metadata(&path).unwrap().len(), bytes, "the file's length");
    assert_eq!(names(), 1, "the series alone");
    Reader::open(&path, &Limits::default()).unwrap().verify().unwrap();
}

#[test]
fn a_folder_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("none").join("flow.series");
    let header = header([8, 8, 2], StepCodec::Raw8, ByteCodec::Zstd);
    let message = FileWriter::create(&path, &header, PackOptions::default()).unwrap_err().to_string();
    assert!(message.ends_with("flow.series"), "{message}");
}
