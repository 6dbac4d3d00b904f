//! Transfer syntaxes and codecs. The coded pictures were written by imagecodecs 2025 (libjpeg, ljpeg) and
//! are given here byte by byte.

use std::io::Write as _;

use super::*;

fn hex(text: &str) -> Vec<u8> {
    text.as_bytes()
        .chunks(2)
        .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).expect("hex"), 16).expect("hex"))
        .collect()
}

fn eight_by_eight(bits: u16) -> Slice {
    Slice::new([0.0; 3], &[0; 12])
        .with(short(0x0028_0010, 8))
        .with(short(0x0028_0011, 8))
        .with(short(0x0028_0100, if bits > 8 { 16 } else { 8 }))
        .with(short(0x0028_0101, bits))
        .with(short(0x0028_0102, bits - 1))
        .with(short(0x0028_0103, 0))
}

fn values(slice: &Slice) -> Vec<f64> {
    let item = only(load_slices(std::slice::from_ref(slice)).expect("loads"));
    let grid = volume(&item);
    (0..64).map(|i| grid.value(i % 8, i / 8, 0)).collect()
}

#[test]
fn lossless_jpeg_gives_every_sample_back() {
    let twelve = hex(
        "ffd8ffc400180001010101010000000000000000000000070c0a080bffc3000b0c0008000801001100ffda0008010000060000f0\
         04df2ef977cbbe58f937cbbe5bca2793131313131313e2713131313131313e2713131313131313e2713131313131313e27be5279\
         31313be5279313e2713131313131313e2713131313131313ffd9",
    );
    let slice = eight_by_eight(12).coded("1.2.840.10008.1.2.4.70", &twelve);
    let expected: Vec<f64> = (0..64).map(|i| f64::from((i * 997 + 5) & 0xFFF)).collect();
    assert_eq!(values(&slice), expected, "12 bits");
    let sixteen = hex(
        "ffd8ffc4001700010101010000000000000000000000000d0e0f10ffc3000b100008000801001100ffda0008010000060000ea6f\
         5a6f5a6f5a6f5a6f5a6f5a6f5b7a86f51bd46f51bd46f51bd4c6f4edea1bd46f51bd46f531bd3c6f4dbd4b7a86f51bd46f531bd3\
         6f51bd46f52dea1bd4c6f4f1bd36f51bd46f51bd4b7a8c6f4dbd46f51bd46f51bd4c6f4edea1bd46f51bd46f51bd4c6f4dbd4b7a\
         86f51bd46f51bd4c6f4dbd46f500ffd9",
    );
    let slice = eight_by_eight(16).coded("1.2.840.10008.1.2.4.57", &sixteen);
    let expected: Vec<f64> = (0..64).map(|i| f64::from(i * 9973 % 65536)).collect();
    assert_eq!(values(&slice), expected, "16 bits");
}

#[test]
fn baseline_jpeg_loads_and_says_that_it_lost() {
    let flat = hex(
        "ffd8ffdb0043000302020302020303030304030304050805050404050a070706080c0a0c0c0b0a0b0b0d0e12100d0e110e0b0b10\
         16101113141515150c0f171816141812141514ffc0000b080008000801011100ffc4001f00000105010101010101000000000000\
         00000102030405060708090a0bffc400b5100002010303020403050504040000017d010203000411051221314106135161072271\
         14328191a1082342b1c11552d1f02433627282090a161718191a25262728292a3435363738393a434445464748494a5354555657\
         58595a636465666768696a737475767778797a838485868788898a92939495969798999aa2a3a4a5a6a7a8a9aab2b3b4b5b6b7b8\
         b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae1e2e3e4e5e6e7e8e9eaf1f2f3f4f5f6f7f8f9faffda0008010100003f00f9de\
         bfffd9",
    );
    let slice = eight_by_eight(8).coded("1.2.840.10008.1.2.4.50", &flat);
    assert!(values(&slice).iter().all(|v| (v - 77.0).abs() <= 1.0), "a flat grey of 77");
    let item = only(load_slices(&[slice]).expect("loads"));
    assert!(codes(&item).contains(&"dicom.lossy"), "noted");
}

#[test]
fn every_plain_transfer_syntax_gives_the_same_slice() {
    let slice = Slice::new([0.0; 3], &numbered(3));
    let implicit = wrapped("1.2.840.10008.1.2", &encode(&slice.elements, IMPLICIT));
    let mut deflater = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::default());
    deflater.write_all(&encode(&slice.elements, PLAIN)).expect("in memory");
    let deflated = wrapped("1.2.840.10008.1.2.1.99", &deflater.finish().expect("in memory"));
    let swapped: Vec<u8> = numbered(3).iter().flat_map(|s| s.to_be_bytes()).collect();
    let big = Slice::new([0.0; 3], &numbered(3)).with((0x7FE0_0010, "OW", Value::Bytes(swapped)));
    let big = wrapped("1.2.840.10008.1.2.2", &encode(&big.elements, BIG));
    // Files of old have neither preamble nor meta group.
    let bare = encode(&slice.elements, PLAIN);
    let bare_implicit = encode(&slice.elements, IMPLICIT);
    for (name, bytes) in [
        ("explicit", slice.file()),
        ("implicit", implicit),
        ("deflated", deflated),
        ("big endian", big),
        ("bare", bare),
        ("bare implicit", bare_implicit),
    ] {
        let item = only(load(folder(&[bytes]).path()).unwrap_or_else(|e| panic!("{name}: {e}")));
        let grid = volume(&item);
        assert_eq!([grid.value(0, 0, 0), grid.value(3, 2, 0)], [3000.0, 3023.0], "{name}");
    }
}

#[test]
fn a_codec_that_is_not_read_is_named_with_a_remedy() {
    let slice = eight_by_eight(12).coded("1.2.840.10008.1.2.4.100", &[0; 8]);
    let error = load_slices(&[slice]).expect_err("MPEG is not read");
    assert!(matches!(error, LoadError::Unsupported { .. }), "{error}");
    assert!(error.to_string().contains("1.2.840.10008.1.2.4.100"), "named: {error}");
}

#[test]
fn floating_point_pixels_are_kept() {
    let pixels: Vec<u8> = (0..12).flat_map(|i| (i as f32 * 0.1).to_le_bytes()).collect();
    let mut slice =
        Slice::new([0.0; 3], &[0; 12]).without(0x7FE0_0010).with((0x7FE0_0008, "OF", Value::Bytes(pixels)));
    if let Some((_, _, Value::Bytes(bytes))) = slice.elements.last_mut() {
        bytes[4..8].copy_from_slice(&f32::NAN.to_le_bytes());
    }
    let item = only(load_slices(&[slice]).expect("loads"));
    assert_eq!(volume(&item).value(3, 2, 0), f64::from(1.1_f32), "exactly");
    assert!(codes(&item).contains(&"volume.not-finite"), "the NaN is counted");
    assert_eq!(volume(&item).samples().kind(), "f32", "as stored");
}
