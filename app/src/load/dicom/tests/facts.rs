//! The sample data. The figures were taken with pydicom 3.0.2 (and pyjpegls, pylibjpeg) from the files
//! themselves.

use super::*;

fn single(name: &str) -> Option<Item> {
    Some(only(load(&sample(name)?).unwrap_or_else(|e| panic!("{e}"))))
}

/// Sum of the stored samples, as numpy gives it.
fn sum(grid: &Grid) -> f64 {
    (0..grid.samples().len()).map(|i| grid.value_at(i)).sum()
}

#[test]
fn ct_small_has_its_hounsfield_units_and_place() {
    let Some(item) = single("ct/dicom_single/CT_small.dcm") else { return };
    let grid = volume(&item);
    assert_eq!((grid.extent(), grid.range()), ([128, 128, 1], [-896.0, 1167.0]), "extent and range");
    assert_eq!(grid.spacing_mm(), [0.661_468, 0.661_468, 5.0], "a single slice has its thickness");
    // Stored 175, 1928, 1089 with intercept -1024.
    let values = [grid.value(0, 0, 0), grid.value(64, 64, 0), grid.value(30, 100, 0)];
    assert_eq!(values, [-849.0, 904.0, 65.0], "values");
    assert_near(world(grid, 0.0, 0.0, 0.0), [-158.135_803, -179.035_797, -75.699_997], "first pixel");
}

#[test]
fn one_slice_in_five_encodings_is_one_picture() {
    let Some(plain) = single("ct/dicom_single/GE10_uncompressed.dcm") else { return };
    let plain = volume(&plain);
    assert_eq!([plain.value(256, 256, 0), plain.value(200, 300, 0)], [5.0, 29.0], "values");
    assert_eq!(sum(plain), -150_774_726.0, "sum of all samples");
    for name in ["GE10_J2K", "GE10_JLS", "GE10_RLE"] {
        let item = single(&format!("ct/dicom_single/{name}.dcm")).expect("the data are there");
        assert_eq!(volume(&item), plain, "{name}");
    }
    let item = single("ct/dicom_single/GE10_MONOCHROME1_inverted.dcm").expect("the data are there");
    let inverted = volume(&item);
    let constant = inverted.value(0, 0, 0) - plain.value(0, 0, 0);
    let same = (0..plain.samples().len()).all(|i| inverted.value_at(i) - plain.value_at(i) == constant);
    assert!(same, "turned back up to a constant of {constant}");
    assert!(codes(&item).contains(&"dicom.monochrome1"), "noted");
}

#[test]
fn one_mr_slice_in_six_encodings_is_one_picture() {
    let Some(plain) = single("mri/dicom_single/MR_small.dcm") else { return };
    let plain = volume(&plain);
    let values = [plain.value(0, 0, 0), plain.value(32, 32, 0), plain.value(50, 10, 0)];
    assert_eq!((values, sum(plain)), ([905.0, 182.0, 1104.0], 2_125_338.0), "values and sum");
    for name in ["RLE", "bigendian", "implicit", "jp2klossless", "jpeg_ls_lossless"] {
        let item = single(&format!("mri/dicom_single/MR_small_{name}.dcm")).expect("the data are there");
        assert_eq!(volume(&item), plain, "{name}");
    }
}

#[test]
fn near_lossless_jpeg_ls_of_sixteen_bits_decodes() {
    let Some(item) = single("mri/dicom_single/JPEGLSNearLossless_16.dcm") else { return };
    let grid = volume(&item);
    assert_eq!((grid.extent(), sum(grid)), ([10, 50, 1], 6_007_250.0), "extent and sum");
    let rows = [grid.value(3, 0, 0), grid.value(9, 17, 0), grid.value(0, 49, 0)];
    assert_eq!(rows, [65535.0, 4095.0, 0.0], "rows 0, 17 and 49 are flat");
    assert!(codes(&item).contains(&"dicom.lossy"), "noted");
}

#[test]
fn a_dose_grid_has_its_offsets_and_scaling() {
    let Some(item) = single("ct/dicom_single/rtdose_multiframe.dcm") else { return };
    let grid = volume(&item);
    assert_eq!((grid.extent(), grid.spacing_mm()), ([10, 10, 15], [10.0, 10.0, 5.0]), "offsets of 5 mm");
    let doses = [grid.value(0, 0, 0), grid.value(3, 4, 7), grid.value(9, 9, 14)];
    for (found, expected) in doses.iter().zip([1.249, 1.026, 0.799]) {
        assert!((found - expected).abs() < 1e-12, "{found} for {expected} Gy");
    }
    assert_near(world(grid, 0.0, 0.0, 14.0), [189.431_25, 199.431_25, -691.87], "the last frame");
}

#[test]
fn the_tilted_head_lies_where_its_slices_say() {
    let Some(item) = single("ct/head_ge_tilt_dicom.zip") else { return };
    let grid = volume(&item);
    assert_eq!((grid.extent(), grid.range()), ([512, 512, 73], [-1500.0, 2121.0]), "extent and range");
    let expected = ["dicom.gantry-tilt", "dicom.slices-uneven", "dicom.padding"];
    assert_eq!(codes(&item), expected, "notes");
    assert!(item.notes[0].text.contains("18.5 degrees"), "the file's own figure: {}", item.notes[0].text);
    assert!(item.notes[1].text.contains("1.081 to 6.999 mm"), "the steps: {}", item.notes[1].text);
    // Pixel (200, 300) of the tenth file, by its own position, orientation and spacing: 29 HU. The cosines of
    // the file are short of a unit vector by 6e-8, so that they are made one here as in the loader.
    let down =
        [0.948_323_7, -0.317_304_7_f64].map(|c| c / 0.948_323_7_f64.hypot(0.317_304_7) * 0.488_281_2 * 300.0);
    let place = Point::new(-125.0 + 0.488_281_2 * 200.0, -123.540_456_9 + down[0], 43.816_058_6 + down[1]);
    let at = place_of(grid, &place);
    assert_near(at.coords.into(), [200.0, 300.0, 18.0], "it is a voxel of the grid");
    assert_eq!(grid.value(200, 300, 18), 29.0, "with its value");
    // Half way between files 21 and 22, along the table: between 27 and 22 HU, in a gap of 7 mm that the
    // grid has in steps of 2, so the values at its ends are interpolated twice.
    let row = [0.0, 0.948_323_7, -0.317_304_7].map(|c| c * 0.488_281_2 * 256.0);
    let middle = Point::new(
        -125.0 + 0.488_281_2 * 256.0,
        -123.540_456_9 + row[1],
        f64::midpoint(106.116_058_6, 113.496_058_6) + row[2],
    );
    let found = grid.sample(&place_of(grid, &middle)).expect("inside");
    assert!((found - 24.5).abs() <= 1.0, "rounded to whole numbers on the way: {found}");
}

fn place_of(grid: &Grid, world: &Point) -> Point {
    grid.world_from_voxel().inverse().point(world)
}

#[test]
fn missing_and_doubled_slices_of_the_head_are_noted() {
    let Some(item) = single("bad/head_ge_missing_and_duplicate_slices.zip") else { return };
    assert_eq!(volume(&item).extent(), [512, 512, 12], "eleven there, one filled");
    let notes: Vec<_> = codes(&item);
    for code in ["dicom.slices-doubled", "dicom.slices-missing", "dicom.gantry-tilt"] {
        assert!(notes.contains(&code), "{code} in {notes:?}");
    }
}

#[test]
fn the_functional_series_is_eighteen_volumes_two_seconds_apart() {
    let Some(item) = single("time/fmri_18vol_dicom.zip") else { return };
    let series = series(&item);
    let times: Vec<f64> = (0..18).map(|t| 2.0 * f64::from(t)).collect();
    assert_eq!(series.times_secs().len(), 18, "time points");
    for (found, expected) in series.times_secs().iter().zip(&times) {
        assert!((found - expected).abs() < 1e-5, "{found} for {expected} s, a clock of six decimals");
    }
    let grid = &series.steps()[0];
    assert_eq!((grid.extent(), series.range()), ([80, 80, 35], [0.0, 792.0]), "extent and range");
    let spacing = grid.spacing_mm().map(|s| (s * 1e6).round() / 1e6);
    assert_eq!(spacing, [3.0, 3.0, 3.3], "spacing");
    assert_near(
        world(grid, 0.0, 0.0, 0.0),
        [-119.624_675_247_35, -142.845_789_953_13, -0.471_882_225_014_2],
        "first pixel",
    );
    for (step, values, total) in [
        (0, [519.0, 298.0, 17.0], 19_843_525.0),
        (8, [504.0, 296.0, 13.0], 19_907_098.0),
        (17, [510.0, 300.0, 23.0], 19_857_165.0),
    ] {
        let grid = &series.steps()[step];
        let found = [grid.value(40, 40, 17), grid.value(50, 30, 17), grid.value(40, 40, 0)];
        assert_eq!((found, sum(grid)), (values, total), "step {step}");
    }
    assert!(item.notes.is_empty(), "nothing departs: {:?}", item.notes);
}

#[test]
fn odd_files_load_and_broken_ones_are_named() {
    let Some(item) = single("bad/J2K_pixelrep_mismatch.dcm") else { return };
    let grid = volume(&item);
    assert_eq!((grid.range(), sum(grid)), ([-2000.0, 1896.0], -172_605_258.0), "13 bits read as signed");
    let item = single("bad/badVR.dcm").expect("the data are there");
    assert_eq!(volume(&item).extent(), [10, 10, 15], "its frames are counted");
    assert!(codes(&item).contains(&"dicom.frame-count"), "noted");
    for (name, fault) in [
        ("CT_small_rows_lie.dcm", "its 512x512 picture needs 524288 bytes, but the pixel data have 32768"),
        ("MR_truncated.dcm", "its 64x64 picture needs 8192 bytes, but the pixel data have 8130"),
        ("GE10_RLE_cut_half.dcm", "the file ends before that"),
        ("JPEG2000-embedded-sequence-delimiter.dcm", "the header says 256x1024"),
        ("no_meta.dcm", "does not begin with a DICOM header"),
        ("meta_missing_tsyntax.dcm", "no usable Rows"),
        ("rtplan_truncated.dcm", "the file ends before that"),
        ("ExplVR_BigEndNoMeta.dcm", "an object without an image"),
        ("head_ge_zip_truncated.zip", "no zip archive"),
    ] {
        let path = sample(&format!("bad/{name}")).expect("the data are there");
        let error = load(&path).expect_err(name);
        assert!(error.to_string().contains(fault), "{name}: {error}");
        assert!(error.to_string().ends_with(&path.display().to_string()), "the path stands last: {error}");
    }
}
