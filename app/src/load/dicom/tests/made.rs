//! Geometry, values and time of files made here, whose truth is known.

use super::*;

#[test]
fn slices_are_ordered_by_position_and_their_distance_is_never_the_thickness() {
    let slices = [2_i16, 0, 1].map(|k| Slice::new([-10.0, 20.0, 2.5 * f64::from(k)], &numbered(k)));
    let item = only(load_slices(&slices).expect("loads"));
    let grid = volume(&item);
    assert_eq!(grid.extent(), [4, 3, 3], "columns, rows, slices");
    assert_eq!(grid.spacing_mm(), [0.5, 0.75, 2.5], "9.5 mm is the thickness only");
    for k in 0..3_u8 {
        let value = grid.value(3, 2, usize::from(k));
        assert_eq!(value, 1000.0 * f64::from(k) + 23.0, "slice {k} in its place");
    }
    assert_near(world(grid, 3.0, 2.0, 1.0), [-8.5, 21.5, 2.5], "a voxel in the world");
    assert_eq!(super::super::super::axis_codes(grid.world_from_voxel()), "LPS", "its letters");
    assert!(item.notes.is_empty(), "nothing departs: {:?}", item.notes);
}

#[test]
fn a_tilted_gantry_becomes_a_sheared_grid_whose_slices_lie_where_they_say() {
    let slices: Vec<_> =
        [0_i16, 1, 2].map(|k| Slice::new([0.0, 0.3 * f64::from(k), f64::from(k)], &numbered(k))).into();
    let item = only(load_slices(&slices).expect("loads"));
    let grid = volume(&item);
    for k in [0.0, 1.0, 2.0] {
        assert_near(world(grid, 0.0, 0.0, k), [0.0, 0.3 * k, k], "first pixel of each slice");
    }
    assert_eq!(codes(&item), ["dicom.gantry-tilt"], "noted");
    // atan 0.3 = 16.699 degrees.
    assert!(item.notes[0].text.contains("16.7 degrees"), "with its angle: {}", item.notes[0].text);
}

/// A field that is linear in the world is linear on any grid, so resampling must not change it.
#[test]
fn uneven_tilted_slices_keep_a_linear_field() {
    let field = |p: [f64; 3]| 40.0 * p[0] - 30.0 * p[1] + 50.0 * p[2];
    let slices: Vec<_> = [0.0, 3.0, 6.0, 7.0, 12.0, 17.0]
        .map(|z| {
            let samples = std::array::from_fn(|i| {
                let (x, y) = (0.5 * (i % 4) as f64, 0.2 * z + 0.75 * (i / 4) as f64);
                #[expect(clippy::cast_possible_truncation, reason = "small")]
                let value = field([x, y, z]).round() as i16;
                value
            });
            Slice::new([0.0, 0.2 * z, z], &samples)
        })
        .into();
    let item = only(load_slices(&slices).expect("loads"));
    let grid = volume(&item);
    assert_eq!(grid.extent(), [4, 3, 12], "17 mm in steps of half the usual 3, to the nearest");
    for z in 0..12 {
        for (x, y) in [(0, 0), (3, 0), (1, 2)] {
            let expected = field(world(grid, x as f64, y as f64, z as f64));
            let found = grid.value(x, y, z);
            assert!((found - expected).abs() <= 1.0, "rounded twice at most: {found} for {expected}");
        }
    }
    assert_eq!(codes(&item), ["dicom.gantry-tilt", "dicom.slices-uneven"], "both noted");
}

#[test]
fn missing_and_doubled_slices_are_counted_and_the_others_stay() {
    let mut slices: Vec<_> =
        [0_i16, 1, 3, 4].map(|k| Slice::new([0.0, 0.0, 2.0 * f64::from(k)], &numbered(k))).into();
    slices.push(Slice::new([0.0, 0.0, 2.0], &numbered(1)));
    let item = only(load_slices(&slices).expect("loads"));
    let grid = volume(&item);
    assert_eq!(grid.extent()[2], 5, "the hole is filled");
    assert_eq!((grid.value(1, 1, 1), grid.value(1, 1, 3)), (1011.0, 3011.0), "as they were");
    assert_eq!(grid.value(1, 1, 2), 2011.0, "half way between its neighbours");
    assert_eq!(codes(&item), ["dicom.slices-doubled", "dicom.slices-missing"], "both noted");
    assert!(item.notes[1].text.starts_with("1 slices"), "with the number: {}", item.notes[1].text);
}

#[test]
fn series_and_orientations_are_kept_apart() {
    let axial = |k: i16| Slice::new([0.0, 0.0, f64::from(k)], &numbered(k));
    let other = Slice::new([0.0; 3], &numbered(7)).with(text(0x0020_000E, "UI", "1.2.4"));
    let scout = Slice::new([5.0; 3], &numbered(8)).with(text(0x0020_0037, "DS", "0\\1\\0\\0\\0\\-1"));
    let items = load_slices(&[axial(0), other, axial(1), scout]).expect("loads");
    let mut depths: Vec<_> = items.iter().map(|i| volume(i).extent()[2]).collect();
    depths.sort_unstable();
    assert_eq!(depths, [1, 1, 2], "one pair, one of another series, one of another orientation");
    let sagittal = items.iter().map(volume).find(|g| g.value(0, 0, 0) == 8000.0).expect("the scout");
    assert_eq!(
        super::super::super::axis_codes(sagittal.world_from_voxel()),
        "PIR",
        "rows run to the back, columns down"
    );
}

#[test]
fn bits_sign_and_rescale_are_applied_exactly() {
    let samples = [0x0FFF_i16, 0x7000, 0x0800, 0x07FF, 0, 0, 0, 0, 0, 0, 0, 0];
    let slice = Slice::new([0.0; 3], &samples)
        .with(short(0x0028_0101, 12))
        .with(short(0x0028_0102, 11))
        .with(text(0x0028_1052, "DS", "-1024"))
        .with(text(0x0028_1053, "DS", "0.5"));
    let item = only(load_slices(&[slice]).expect("loads"));
    let values: Vec<_> = (0..4).map(|x| volume(&item).value(x, 0, 0)).collect();
    // -1, 0 under an overlay, -2048, 2047, halved, less 1024.
    assert_eq!(values, [-1024.5, -1024.0, -2048.0, -0.5], "twelve signed bits");
    assert_eq!(volume(&item).samples().kind(), "i16", "kept as stored");
}

#[test]
fn slices_with_their_own_rescale_become_floats() {
    let slice =
        |z: f64, slope: &str| Slice::new([0.0, 0.0, z], &[3; 12]).with(text(0x0028_1053, "DS", slope));
    let item = only(load_slices(&[slice(0.0, "0.25"), slice(1.0, "2.5")]).expect("loads"));
    let grid = volume(&item);
    assert_eq!((grid.value(0, 0, 0), grid.value(0, 0, 1)), (0.75, 7.5), "each by its own slope");
    assert_eq!((grid.samples().kind(), codes(&item)), ("f32", vec!["dicom.rescale-per-slice"]), "noted");
}

#[test]
fn padding_that_would_shine_is_put_out_and_low_padding_is_kept() {
    let mut samples = numbered(0);
    samples[5] = 30000;
    let high = Slice::new([0.0; 3], &samples).with(short(0x0028_0120, 30000));
    let item = only(load_slices(&[high]).expect("loads"));
    assert_eq!(volume(&item).range(), [0.0, 23.0], "set to the lowest value");
    assert!(codes(&item).contains(&"dicom.padding"), "noted");
    samples[5] = -2000;
    // Written as unsigned, as many writers do.
    let low = Slice::new([0.0; 3], &samples).with(short(0x0028_0120, 63536));
    let item = only(load_slices(&[low]).expect("loads"));
    assert_eq!(volume(&item).range(), [-2000.0, 23.0], "kept, as it cannot shine");
}

#[test]
fn an_enhanced_file_takes_each_frames_own_place_and_time() {
    let frame = |z: f64, time: u16| {
        vec![
            (
                0x0020_9111,
                "SQ",
                Value::Items(vec![vec![(
                    0x0020_9128,
                    "UL",
                    Value::Bytes(u32::from(time).to_le_bytes().into()),
                )]]),
            ),
            (0x0020_9113, "SQ", Value::Items(vec![vec![text(0x0020_0032, "DS", joined(&[1.0, 2.0, z]))]])),
        ]
    };
    let shared = vec![
        (0x0020_9116, "SQ", Value::Items(vec![vec![text(0x0020_0037, "DS", "1\\0\\0\\0\\1\\0")]])),
        (0x0028_9110, "SQ", Value::Items(vec![vec![text(0x0028_0030, "DS", "0.75\\0.5")]])),
        (
            0x0028_9145,
            "SQ",
            Value::Items(vec![vec![text(0x0028_1052, "DS", "-5"), text(0x0028_1053, "DS", "2")]]),
        ),
    ];
    // Time runs fastest, and the slices go down.
    let places = [(3.0, 1), (3.0, 2), (0.0, 1), (0.0, 2)];
    let pixels = (0..4_i16).flat_map(numbered).flat_map(i16::to_le_bytes).collect();
    let file = Slice::new([0.0; 3], &[0; 12])
        .without(0x0020_0032)
        .without(0x0020_0037)
        .without(0x0028_0030)
        .with(text(0x0028_0008, "IS", "4"))
        .with((0x5200_9229, "SQ", Value::Items(vec![shared])))
        .with((0x5200_9230, "SQ", Value::Items(places.map(|(z, t)| frame(z, t)).into())))
        .with((0x7FE0_0010, "OW", Value::Bytes(pixels)));
    let item = only(load_slices(&[file]).expect("loads"));
    let series = series(&item);
    assert_eq!((series.len(), series.steps()[0].extent()), (2, [4, 3, 2]), "two steps of two slices");
    assert_near(world(&series.steps()[0], 0.0, 0.0, 1.0), [1.0, 2.0, 3.0], "the upper slice");
    // Frames 2, 0 are the first step, frames 3, 1 the second; slope 2, intercept -5.
    let value = |t: usize, z| series.steps()[t].value(1, 0, z);
    assert_eq!([value(0, 0), value(0, 1)], [3997.0, -3.0], "first step");
    assert_eq!([value(1, 0), value(1, 1)], [5997.0, 1997.0], "second step");
    assert_eq!(codes(&item), ["dicom.time-guessed"], "nothing says when");
}

#[test]
fn steps_in_time_are_told_by_the_clock() {
    let slice = |z: f64, t: i16| {
        Slice::new([0.0, 0.0, z], &numbered(t))
            .with(text(0x0008_0018, "UI", format!("1.9.{z}.{t}")))
            .with(text(0x0008_002A, "DT", format!("2023093023595{}", 7 + 2 * t)))
    };
    let slices = [slice(1.0, 1), slice(0.0, 0), slice(1.0, 0), slice(0.0, 1)];
    let item = only(load_slices(&slices).expect("loads"));
    assert_eq!(series(&item).times_secs(), [0.0, 2.0], "two seconds apart");
    assert_eq!(series(&item).steps()[1].value(0, 0, 1), 1000.0, "the later volume");
}

#[test]
fn a_lone_slice_without_geometry_loads_and_says_so() {
    let bare = Slice::new([0.0; 3], &numbered(1))
        .without(0x0020_0032)
        .without(0x0020_0037)
        .without(0x0028_0030)
        .without(0x0018_0050);
    let item = only(load_slices(&[bare]).expect("loads"));
    assert_eq!(volume(&item).spacing_mm(), [1.0; 3], "millimetres are a guess");
    let expected = ["dicom.no-orientation", "dicom.no-spacing", "dicom.no-position", "dicom.single-slice"];
    assert_eq!(codes(&item), expected, "each guess is noted");
}

#[test]
fn a_slice_that_cannot_be_read_is_left_out_with_a_note() {
    let slices: Vec<_> =
        [0_i16, 1, 2].map(|k| Slice::new([0.0, 0.0, 2.0 * f64::from(k)], &numbered(k))).into();
    let mut files: Vec<_> = slices.iter().map(Slice::file).collect();
    let half = files[2].len() - 10;
    files[2].truncate(half);
    let item = only(load(folder(&files).path()).expect("the others load"));
    assert_eq!(volume(&item).extent()[2], 2, "two are left");
    assert_eq!(codes(&item), ["dicom.slices-unreadable"], "noted");
}

#[test]
fn a_shifted_slice_comes_back_onto_the_line() {
    // The middle slice was reconstructed two columns (1 mm) further left, so its picture is two columns on.
    let field = |x: f64| 100.0 * x;
    let slices: Vec<_> = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)]
        .map(|(z, x0)| {
            #[expect(clippy::cast_possible_truncation, reason = "small")]
            let samples = std::array::from_fn(|i| field(x0 + 0.5 * (i % 4) as f64) as i16);
            Slice::new([x0, 0.0, z], &samples)
        })
        .into();
    let item = only(load_slices(&slices).expect("loads"));
    let grid = volume(&item);
    assert_eq!((grid.value(2, 1, 1), grid.value(3, 1, 1)), (100.0, 150.0), "as in the other slices");
    assert_eq!(grid.value(2, 1, 0), 100.0, "which are untouched");
    assert!(codes(&item).contains(&"dicom.slices-shifted"), "noted");
}

#[test]
fn the_inverse_of_inverted_values_comes_back_by_the_rescale() {
    let slice = Slice::new([0.0; 3], &numbered(0)).with(text(0x0028_0004, "CS", "MONOCHROME1"));
    let item = only(load_slices(&[slice]).expect("loads"));
    let grid = volume(&item);
    assert_eq!([grid.value(0, 0, 0), grid.value(3, 2, 0)], [23.0, 0.0], "turned about the middle");
    assert_eq!(codes(&item)[1], "dicom.monochrome1", "noted");
}
