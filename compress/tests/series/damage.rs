//! Files that were cut, flipped, or made to lie.

use std::io::Cursor;

use compress::Limits;
use compress::container::{ReadError, Reader, StepCodec};
use compress::lossless::ByteCodec;
use compress::pvtc::Layout;

use super::{header, series};

/// Opens and verifies: what a careful reader does.
fn read(bytes: &[u8], limits: Limits) -> Result<(), ReadError> {
    Reader::new(Cursor::new(bytes), &limits)?.verify()
}

/// A small series of several chunks.
fn small() -> Vec<u8> {
    series(&header([8, 8, 4], StepCodec::Pvtc(Layout::new(4, 2).unwrap()), ByteCodec::Zstd), 5)
}

/// Puts right checksums on a header and a trailer that were changed.
fn with_checksums(mut file: Vec<u8>) -> Vec<u8> {
    let crc = |bytes: &[u8]| naive_crc(bytes).to_le_bytes();
    let header = crc(&file[..508]);
    file[508..512].copy_from_slice(&header);
    let end = file.len() - 64;
    let footer_at = u64::from_le_bytes(file[end..end + 8].try_into().unwrap()) as usize;
    if let Some(footer) = file.get(footer_at..end).map(crc) {
        file[end + 48..end + 52].copy_from_slice(&footer);
    }
    let trailer = crc(&file[end..end + 52]);
    file[end + 52..end + 56].copy_from_slice(&trailer);
    file
}

/// CRC-32 bit by bit, from its definition.
fn naive_crc(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 };
        }
    }
    !crc
}

#[test]
fn every_flipped_byte_is_found() {
    let file = small();
    read(&file, Limits::default()).unwrap();
    for at in 0..file.len() {
        for mask in [1, 0x80, 0xFF] {
            let mut flipped = file.clone();
            flipped[at] ^= mask;
            let found = read(&flipped, Limits::default());
            let named = matches!(
                found,
                Err(ReadError::Identifier
                    | ReadError::Version { .. }
                    | ReadError::Checksum { .. }
                    | ReadError::ChunkChecksum { .. }
                    | ReadError::Unfinished { .. })
            );
            assert!(named, "byte {at} with {mask:#x}: {found:?}");
        }
    }
}

#[test]
fn every_cut_is_found_and_so_are_bytes_too_many() {
    let file = small();
    for len in 0..file.len() {
        let found = read(&file[..len], Limits::default());
        let named = matches!(
            found,
            Err(ReadError::Identifier | ReadError::Short { .. } | ReadError::Unfinished { .. })
        );
        assert!(named, "cut to {len}: {found:?}");
    }
    let mut longer = file.clone();
    longer.extend([0; 7]);
    assert!(matches!(read(&longer, Limits::default()), Err(ReadError::Unfinished { .. })), "7 bytes more");
    // A piece out of the middle leaves the end mark in its place.
    let mut shorter = file;
    shorter.drain(520..530);
    assert!(matches!(read(&shorter, Limits::default()), Err(ReadError::FileLength { .. })), "10 bytes less");
}

#[test]
fn the_chunk_that_is_damaged_is_named_and_the_others_are_read() {
    let mut file = small();
    let mut whole = super::open(&file);
    let at = 512 + whole.packed_len(0).unwrap() as usize + 3;
    let first = whole.read_chunk(0).unwrap();
    file[at] ^= 4;
    let mut damaged = super::open(&file);
    assert!(damaged.read_chunk(0).unwrap() == first, "chunk 0 is as it was");
    damaged.read_chunk(2).unwrap();
    let message = damaged.read_chunk(1).unwrap_err().to_string();
    assert!(message.starts_with("the checksum of chunk 1 differs"), "{message}");
}

/// Changes `bytes` at `at`, puts checksums right, and gives the error's words.
fn lie(at: usize, bytes: &[u8]) -> String {
    let mut file = small();
    file[at..at + bytes.len()].copy_from_slice(bytes);
    read(&with_checksums(file), Limits::default()).unwrap_err().to_string()
}

#[test]
fn a_header_that_lies_with_right_checksums_is_named() {
    let cases: [(usize, &[u8], &str); 17] = [
        (0, b"PK", "not a series file"),
        (8, &2_u32.to_le_bytes(), "version 2"),
        (12, &513_u32.to_le_bytes(), "length in the header"),
        (16, &[0; 4], "size of the volume"),
        (16, &[0xFF; 12], "size of the volume"),
        (28, &[9], "step codec"),
        (29, &[3], "step codec"),
        (30, &[5], "step codec"),
        (31, &[4], "byte codec"),
        (32, &0.0_f64.to_le_bytes(), "scale"),
        (40, &f64::NAN.to_le_bytes(), "offset"),
        (48, &(-1.0_f64).to_le_bytes(), "steps per second"),
        (56 + 120, &2.0_f64.to_le_bytes(), "world_from_voxel"),
        (184, &[0xC3, 0x28], "name"),
        (312, &[0, 1], "kind"),
        (344, &[0xFF], "unit"),
        (400, &[1], "reserved part"),
    ];
    for (at, bytes, words) in cases {
        let message = lie(at, bytes);
        assert!(message.contains(words), "byte {at}: {message}");
    }
}

#[test]
fn a_footer_that_lies_with_right_checksums_is_named() {
    let file = small();
    let end = file.len() - 64;
    let footer = u64::from_le_bytes(file[end..end + 8].try_into().unwrap()) as usize;
    let cases: [(usize, &[u8], &str); 14] = [
        (footer, &0_u64.to_le_bytes(), "length of chunk 0"),
        (footer, &u64::MAX.to_le_bytes(), "length of chunk 0"),
        (footer, &1_u64.to_le_bytes(), "sum of the chunks' lengths"),
        (footer + 12, &[77], "byte codec of chunk 0"),
        (footer + 13, &[3], "planes of chunk 0"),
        (footer + 14, &[1], "number of steps of chunk 0"),
        (footer + 16 + 14, &[3], "number of steps of chunk 1"),
        (footer + 32 + 14, &[2], "sum of the chunks' steps"),
        (footer + 15, &[1], "reserved byte of chunk 0"),
        (footer + 48 + 8, &f64::INFINITY.to_le_bytes(), "times of the steps"),
        (end + 8, &u64::MAX.to_le_bytes(), "footer length"),
        (end + 16, &u32::MAX.to_le_bytes(), "footer length"),
        (end + 24, &(-1.0_f64).to_le_bytes(), "largest error"),
        (end + 32, &f64::NEG_INFINITY.to_le_bytes(), "PSNR"),
    ];
    for (at, bytes, words) in cases {
        let message = lie(at, bytes);
        assert!(message.contains(words), "byte {at}: {message}");
    }
    let message = lie(end, &(footer as u64 + 1).to_le_bytes());
    assert!(message.contains("footer offset"), "{message}");
}

#[test]
fn a_chunk_that_does_not_unpack_is_named_where_its_checksum_is_right() {
    let mut file = small();
    let end = file.len() - 64;
    let footer = u64::from_le_bytes(file[end..end + 8].try_into().unwrap()) as usize;
    file[footer + 12] = ByteCodec::Lz4.id(); // zstd's bytes
    let message = read(&with_checksums(file), Limits::default()).unwrap_err().to_string();
    assert_eq!(
        message, "chunk 0 does not unpack: the series file was written by a faulty program",
        "message"
    );
}

#[test]
fn a_series_above_the_limit_is_refused() {
    let file = small();
    let payload = super::open(&file).shape().bytes() as u64;
    let footer = 3 * 16 + 5 * 8;
    let needed = 3 * payload + 4 * footer;
    read(&file, Limits { decoded_bytes: needed }).unwrap();
    let refused = read(&file, Limits { decoded_bytes: needed - 1 });
    assert!(matches!(refused, Err(ReadError::TooLarge { bytes, .. }) if bytes == needed), "{refused:?}");
}

#[test]
fn a_volume_that_no_machine_holds_is_refused_whatever_the_file_says() {
    // 4 Gi voxels along x, one chunk: a payload of 4 GiB and more in a file of some hundred bytes.
    let message = lie(16, &u32::MAX.to_le_bytes());
    assert!(message.contains("more than the limit of"), "{message}");
}
