//! Files that lie, and archives that would burst.

use std::io::Write as _;

use super::*;

fn parse(bytes: &[u8]) -> Option<Vec<i16>> {
    let (syntax, start) = walk::meta(bytes).ok()?;
    let anatomy = walk::walk(bytes, syntax, start).ok()?;
    let image = header::read(0, bytes, &anatomy).ok()?;
    let mut out = vec![0_i16; (image.rows * image.columns).min(1 << 20)];
    pixels::decode(bytes, &anatomy, &image, 0, &mut out).ok()?;
    Some(out)
}

#[test]
fn cut_and_damaged_files_never_panic() {
    let good = Slice::new([0.0; 3], &numbered(1))
        .with((0x0028_9145, "SQ", Value::Items(vec![vec![text(0x0028_1053, "DS", "2")]])))
        .file();
    assert_eq!(parse(&good).expect("good").len(), 12, "the oracle works");
    super::super::super::bytes::trial::survives(&good, parse);
}

#[test]
fn an_element_longer_than_its_file_is_refused_before_it_takes_memory() {
    let mut data_set = encode(&[text(0x0008_0060, "CS", "CT")], PLAIN);
    data_set.extend(b"\x10\x00\x10\x40UT\0\0\xF0\xFF\xFF\xFFshort");
    let error = load(folder(&[wrapped(EXPLICIT, &data_set)]).path()).expect_err("it lies");
    assert!(error.to_string().contains("claims 4294967280 bytes"), "{error}");
    // The same inside a sequence.
    let mut inner = b"\x10\x00\x10\x40UT\0\0\xF0\xFF\xFF\xFF".to_vec();
    inner.extend([0; 4]);
    let item = [b"\xFE\xFF\x00\xE0\xFF\xFF\xFF\xFF".to_vec(), inner].concat();
    let data_set = encode(&[(0x0028_9145, "SQ", Value::Bytes(item))], PLAIN);
    assert!(load(folder(&[wrapped(EXPLICIT, &data_set)]).path()).is_err(), "nested");
}

#[test]
fn sequences_nested_without_end_are_refused() {
    let mut data_set = Vec::new();
    for _ in 0..100_000 {
        data_set.extend(b"\x08\x00\x15\x11SQ\0\0\xFF\xFF\xFF\xFF\xFE\xFF\x00\xE0\xFF\xFF\xFF\xFF");
    }
    let error = load(folder(&[wrapped(EXPLICIT, &data_set)]).path()).expect_err("too deep");
    assert!(error.to_string().contains("nested"), "{error}");
}

#[test]
fn a_huge_picture_out_of_a_few_bytes_is_refused_before_it_is_decoded() {
    let slice = Slice::new([0.0; 3], &[0; 12])
        .with(short(0x0028_0010, 40_000))
        .with(short(0x0028_0011, 40_000))
        .coded("1.2.840.10008.1.2.4.90", &[0xFF, 0x4F, 0xFF, 0x51]);
    let error = load_slices(&[slice]).expect_err("a claim");
    assert!(error.to_string().contains("cannot come out of 4 bytes"), "{error}");
}

#[test]
fn colours_and_indices_are_not_taken_for_quantities() {
    for element in [text(0x0028_0004, "CS", "PALETTE COLOR"), short(0x0028_0002, 3)] {
        let error = load_slices(&[Slice::new([0.0; 3], &numbered(0)).with(element)]).expect_err("colours");
        assert!(error.to_string().contains("colour pictures only"), "{error}");
    }
}

#[test]
fn frames_that_are_not_there_are_refused() {
    let slice = Slice::new([0.0; 3], &numbered(0)).with(text(0x0028_0008, "IS", "2000000000"));
    let error = load_slices(&[slice]).expect_err("it has one");
    assert!(error.to_string().contains("claims 2000000000 frames"), "{error}");
}

fn zip(members: &[(&str, &[u8])]) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::with_suffix(".zip").expect("a file");
    let mut writer = zip::ZipWriter::new(file.reopen().expect("open"));
    for (name, bytes) in members {
        let options = zip::write::SimpleFileOptions::default();
        writer.start_file(*name, options).expect("a member");
        writer.write_all(bytes).expect("written");
    }
    writer.finish().expect("finished");
    file
}

#[test]
fn an_archive_is_read_in_memory_whatever_its_names_say() {
    let slices = [0_i16, 1].map(|k| Slice::new([0.0, 0.0, f64::from(k)], &numbered(k)).file());
    let outside = Path::new("../../osteotome-zip-slip.dcm");
    let archive = zip(&[
        ("../../osteotome-zip-slip.dcm", &slices[0]),
        ("/deep/b", &slices[1]),
        ("readme.txt", b"not an image"),
    ]);
    let item = only(load(archive.path()).expect("loads"));
    assert_eq!(volume(&item).extent(), [4, 3, 2], "both slices");
    assert_eq!(codes(&item), ["dicom.files-left-out"], "the text is noted");
    let beside = archive.path().parent().expect("a folder").join(outside);
    assert!(!beside.exists() && !outside.exists(), "no name reached the file system");
}

#[test]
fn an_archive_that_would_burst_is_refused() {
    let archive = zip(&[("bomb.dcm", &vec![0; 4 << 20])]);
    let limits = Limits { decoded_bytes: 1 << 20, files: 10 };
    let error = open(archive.path(), &limits, &Silent).expect_err("too large");
    assert!(matches!(error, LoadError::TooLarge { .. }), "{error}");
    // A member that lies about its size: both places that tell it are set to 16 bytes.
    let mut bytes = std::fs::read(archive.path()).expect("read");
    let size = (4_u32 << 20).to_le_bytes();
    for at in 0..bytes.len() - 4 {
        if bytes[at..at + 4] == size {
            bytes[at..at + 4].copy_from_slice(&16_u32.to_le_bytes());
        }
    }
    std::fs::write(archive.path(), bytes).expect("written");
    assert!(open(archive.path(), &limits, &Silent).is_err(), "the liar is stopped by what comes out of it");
}

#[test]
fn a_volume_beyond_the_limit_is_refused() {
    let slice = Slice::new([0.0; 3], &numbered(0));
    let folder = folder(&[slice.file()]);
    let limits = Limits { decoded_bytes: 1 << 12, files: 10 };
    assert!(open(folder.path(), &limits, &Silent).is_ok(), "24 bytes are allowed");
    // One stray slice: the even grid would have a thousand of them.
    let stray = |far: f64| [0.0, 1.0, far].map(|z| Slice::new([0.0, 0.0, z], &numbered(0)).file());
    let error = open(self::folder(&stray(1e3)).path(), &limits, &Silent).expect_err("too large");
    assert!(matches!(error, LoadError::TooLarge { .. }), "{error}");
    let error = load(self::folder(&stray(1e15)).path()).expect_err("no stack");
    assert!(error.to_string().contains("a stack would have"), "{error}");
}

#[test]
fn a_load_can_be_cancelled() {
    struct Stop;
    impl Progress for Stop {
        fn step(&self, doing: &str, _done: usize, _total: usize) -> bool {
            doing != "decoding slices"
        }
    }
    let folder = folder(&[Slice::new([0.0; 3], &numbered(0)).file()]);
    let error = open(folder.path(), &Limits::default(), &Stop).expect_err("cancelled");
    assert!(matches!(error, LoadError::Cancelled), "{error}");
}
