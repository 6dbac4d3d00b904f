//! NIfTI headers made byte by byte.

use super::super::nifti::read;
use super::*;

/// A NIfTI-1 header of 348 bytes and the 4 that follow it, of 4×3×2 samples of 16 bits, with an sform.
fn header() -> Vec<u8> {
    let mut h = vec![0_u8; 352];
    h[0..4].copy_from_slice(&348_i32.to_le_bytes());
    for (i, n) in [3_i16, 4, 3, 2, 1, 1, 1, 1].iter().enumerate() {
        put(&mut h, 40 + 2 * i, &n.to_le_bytes());
    }
    put(&mut h, 70, &4_i16.to_le_bytes());
    put(&mut h, 72, &16_i16.to_le_bytes());
    for (i, n) in [1.0_f32, 1.0, 2.0, 3.0, 0.5, 0.0, 0.0, 0.0].iter().enumerate() {
        put(&mut h, 76 + 4 * i, &n.to_le_bytes());
    }
    put(&mut h, 108, &352_f32.to_le_bytes());
    h[123] = 2 | 8;
    put(&mut h, 254, &1_i16.to_le_bytes());
    // RAS of the turn above: the first two rows negated.
    let (s, c) = 0.3_f32.sin_cos();
    let rows = [[-c, 2.0 * s, 0.0, -10.0], [-s, -2.0 * c, 0.0, -20.0], [0.0, 0.0, 3.0, 30.0]];
    for (i, n) in rows.iter().flatten().enumerate() {
        put(&mut h, 280 + 4 * i, &n.to_le_bytes());
    }
    put(&mut h, 344, b"n+1\0");
    h
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    bytes[at..at + value.len()].copy_from_slice(value);
}

fn with_data(header: &[u8]) -> Vec<u8> {
    [header, &counted()].concat()
}

#[test]
fn the_sform_places_samples_in_lps() {
    let item = load_bytes("a.nii", &with_data(&header())).expect("loads");
    let grid = volume(&item);
    assert_eq!((grid.extent(), grid.value(3, 2, 1)), ([4, 3, 2], 23.0), "extent and last sample");
    assert_near(world(grid, [3.0, 2.0, 1.0]), TURNED, "as SimpleITK wrote it");
    assert_eq!(codes(&item), [""; 0], "nothing departs");
    let packed = load_bytes("a.nii.gz", &gzip(&with_data(&header()))).expect("loads");
    assert_eq!(volume(&packed), grid, "packed");
}

#[test]
fn the_qform_is_used_where_there_is_no_sform() {
    let mut h = header();
    put(&mut h, 254, &0_i16.to_le_bytes());
    put(&mut h, 252, &1_i16.to_le_bytes());
    // A turn by half a circle and 0.3 rad about z: quaternion d = cos 0.15, a = sin -0.15 is negative, so
    // the other sign of both is meant. As written by SimpleITK for the same image.
    put(&mut h, 264, &(-(0.15_f32.cos())).to_le_bytes());
    for (i, n) in [-10.0_f32, -20.0, 30.0].iter().enumerate() {
        put(&mut h, 268 + 4 * i, &n.to_le_bytes());
    }
    let item = load_bytes("a.nii", &with_data(&h)).expect("loads");
    assert_near(world(volume(&item), [3.0, 2.0, 1.0]), TURNED, "the same place");
    put(&mut h, 252, &0_i16.to_le_bytes());
    let item = load_bytes("a.nii", &with_data(&h)).expect("loads");
    assert_eq!(codes(&item), ["nifti.no-orientation"], "neither form: noted");
    assert_eq!(axis_codes(volume(&item).world_from_voxel()), "RAS", "and taken as RAS");
}

#[test]
fn two_forms_that_differ_are_noted() {
    let mut h = header();
    put(&mut h, 252, &1_i16.to_le_bytes());
    let item = load_bytes("a.nii", &with_data(&h)).expect("loads");
    assert_eq!(codes(&item), ["nifti.forms-differ"], "the qform is the identity");
}

#[test]
fn slope_and_unit_are_applied() {
    let mut h = header();
    put(&mut h, 112, &2_f32.to_le_bytes());
    put(&mut h, 116, &(-3_f32).to_le_bytes());
    h[123] = 1 | 8;
    let item = load_bytes("a.nii", &with_data(&h)).expect("loads");
    assert_eq!(volume(&item).value(3, 2, 1), 43.0, "2 · 23 - 3");
    let spacing = volume(&item).spacing_mm();
    assert!((spacing[2] - 3000.0).abs() < 1e-9, "metres: {spacing:?}");
    assert_eq!(codes(&item), ["nifti.unit"], "noted");
    put(&mut h, 112, &f32::NAN.to_le_bytes());
    let item = load_bytes("a.nii", &with_data(&h)).expect("loads");
    assert_eq!(volume(&item).value(3, 2, 1), 23.0, "a slope that is no number is none");
}

#[test]
fn the_fourth_dimension_is_time() {
    let mut h = header();
    put(&mut h, 40, &4_i16.to_le_bytes());
    put(&mut h, 46, &1_i16.to_le_bytes());
    put(&mut h, 48, &2_i16.to_le_bytes());
    put(&mut h, 136, &7_f32.to_le_bytes());
    let item = load_bytes("a.nii", &with_data(&h)).expect("loads");
    let series = series(&item);
    assert_eq!(series.times_secs(), [7.0, 7.5], "offset and step");
    assert_eq!(series.steps()[1].value(0, 0, 0), 12.0, "the second half");
}

#[test]
fn both_byte_orders_and_the_second_version_are_read() {
    let mut h = vec![0_u8; 544];
    put(&mut h, 0, &540_i32.to_be_bytes());
    put(&mut h, 4, b"n+2\0\r\n\x1a\n");
    put(&mut h, 12, &16_i16.to_be_bytes());
    for (i, n) in [3_i64, 2, 1, 1, 1, 1, 1, 1].iter().enumerate() {
        put(&mut h, 16 + 8 * i, &n.to_be_bytes());
    }
    put(&mut h, 168, &544_i64.to_be_bytes());
    put(&mut h, 348, &1_i32.to_be_bytes());
    for (i, n) in [-2.0_f64, -3.0, 4.0].iter().enumerate() {
        put(&mut h, 400 + 40 * i, &n.to_be_bytes());
    }
    h.extend([1.5_f32, f32::NAN].iter().flat_map(|v| v.to_be_bytes()));
    let item = load_bytes("a.nii", &h).expect("loads");
    let grid = volume(&item);
    assert_eq!((grid.spacing_mm(), grid.value(0, 0, 0)), ([2.0, 3.0, 4.0], 1.5), "double sform, float data");
    assert_eq!(axis_codes(grid.world_from_voxel()), "LPS", "letters");
    assert_eq!(codes(&item), ["volume.not-finite"], "the NaN is counted");
}

#[test]
fn a_pair_of_header_and_image_is_one_volume() {
    let mut h = header();
    put(&mut h, 344, b"ni1\0");
    put(&mut h, 108, &0_f32.to_le_bytes());
    let (folder, path) = file("a.hdr", &h[..348]);
    assert!(load(&path).is_err(), "no image beside it");
    std::fs::write(folder.path().join("a.img"), counted()).expect("written");
    assert_eq!(volume(&only(load(&path).expect("loads"))).value(3, 2, 1), 23.0, "from the image");
}

#[test]
fn damaged_headers_never_panic_and_claims_are_checked() {
    let good = with_data(&header());
    let (_folder, path) = file("a.nii", &good);
    survives(&good[..352], |bytes| {
        std::fs::write(&path, bytes).expect("written");
        read(&path, &Limits { decoded_bytes: 1 << 16, files: 1 }, &Silent)
    });
    let error = load_bytes("a.nii", &good[..good.len() - 1]).expect_err("a byte is missing");
    assert!(error.to_string().contains("asks for 48 bytes of samples, but only 47"), "{error}");
}
