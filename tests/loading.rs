//! Real files through `info`, against figures that other programs read from them: nibabel 5.4 and pydicom 3.0 (volumes),
//! trimesh and VTK 9.7 (surfaces and cells). The loaders' own tests lie beside them; here is the whole way to the user.

use std::time::Duration;

use serde_json::Value;

use crate::support::program::run;
use crate::support::shared_data;

/// A chest CT of 133 slices, unpacked in a development build on a busy machine.
const LIMIT: Duration = Duration::from_mins(3);

/// What a volume must be.
struct Volume {
    file: &'static str,
    /// `[x, y, z]`.
    extent: [u64; 3],
    spacing_mm: [f64; 3],
    /// Where each array axis runs.
    axes: &'static str,
    /// Where the first voxel's centre lies; LPS mm.
    first_mm: [f64; 3],
    /// Least and largest sample after rescaling, padding left out.
    range: [f64; 2],
}

const fn volume(
    file: &'static str,
    extent: [u64; 3],
    spacing_mm: [f64; 3],
    axes: &'static str,
    first_mm: [f64; 3],
    range: [f64; 2],
) -> Volume {
    Volume { file, extent, spacing_mm, axes, first_mm, range }
}

#[rustfmt::skip]
const VOLUMES: [Volume; 20] = [
    volume("ct/chest_lidc0001.nii.gz", [512, 512, 133], [0.703125, 0.703125, 2.5], "LAS", [-166.0, 187.5969, -340.0], [-2048.0, 3071.0]),
    volume("ct/chest_lidc0001_labels.nii.gz", [512, 512, 133], [0.703125, 0.703125, 2.5], "LAS", [-166.0, 187.5969, -340.0], [0.0, 118.0]),
    volume("ct/cranium_256.nrrd", [256, 256, 108], [0.9570312, 0.9570312, 1.5], "LAS", [0.0; 3], [-1024.0, 2986.0]),
    volume("ct/torso_pelvis_3mm.nii.gz", [122, 101, 112], [3.0; 3], "RAS", [177.9563, -11.319, 94.3018], [-1207.0, 3382.0]),
    volume("ct/dicom_single/CT_small.dcm", [128, 128, 1], [0.661468, 0.661468, 5.0], "LPS", [-158.135803, -179.035797, -75.699997], [-896.0, 1167.0]),
    volume("ct/dicom_single/GE10_uncompressed.dcm", GE10, GE10_MM, "LPS, oblique", GE10_FIRST, GE10_RANGE),
    volume("ct/dicom_single/GE10_RLE.dcm", GE10, GE10_MM, "LPS, oblique", GE10_FIRST, GE10_RANGE),
    volume("ct/dicom_single/GE10_J2K.dcm", GE10, GE10_MM, "LPS, oblique", GE10_FIRST, GE10_RANGE),
    volume("ct/dicom_single/GE10_JLS.dcm", GE10, GE10_MM, "LPS, oblique", GE10_FIRST, GE10_RANGE),
    // Turned back from white-is-least, it is the same slice again.
    volume("ct/dicom_single/GE10_MONOCHROME1_inverted.dcm", GE10, GE10_MM, "LPS, oblique", GE10_FIRST, GE10_RANGE),
    // Frame offsets of 5 mm; DoseGridScaling 1e-6 of 795 000 to 1 254 000.
    volume("ct/dicom_single/rtdose_multiframe.dcm", [10, 10, 15], [10.0, 10.0, 5.0], "LPS", [189.43125, 199.43125, -761.87], [0.795, 1.254]),
    volume("mri/ch2_t1.nii.gz", [181, 217, 181], [1.0; 3], "RAS", [90.0, 125.0, -71.0], [0.0, 254.0]),
    volume("mri/ct_brain_atlas_1mm.nii.gz", [202, 202, 179], [1.0; 3], "RAS", [100.8027, -81.6973, 1126.8], [-30.0, 385.0]),
    volume("mri/torso_mr_3mm.nii.gz", [117, 91, 20], [3.0; 3], "LPS", [-168.5996, -166.3594, 28.9896], [-47.0, 833.0]),
    volume("mri/dicom_single/MR_small.dcm", MR, MR_MM, "LPS", MR_FIRST, MR_RANGE),
    volume("mri/dicom_single/MR_small_RLE.dcm", MR, MR_MM, "LPS", MR_FIRST, MR_RANGE),
    volume("mri/dicom_single/MR_small_bigendian.dcm", MR, MR_MM, "LPS", MR_FIRST, MR_RANGE),
    volume("mri/dicom_single/MR_small_implicit.dcm", MR, MR_MM, "LPS", MR_FIRST, MR_RANGE),
    volume("mri/dicom_single/MR_small_jp2klossless.dcm", MR, MR_MM, "LPS", MR_FIRST, MR_RANGE),
    volume("mri/dicom_single/MR_small_jpeg_ls_lossless.dcm", MR, MR_MM, "LPS", MR_FIRST, MR_RANGE),
];

// One slice of a tilted head, and one of an MR, each in several transfer syntaxes.
const GE10: [u64; 3] = [512, 512, 1];
const GE10_MM: [f64; 3] = [0.4882812, 0.4882812, 4.0];
const GE10_FIRST: [f64; 3] = [-125.0, -123.5404569, 43.8160586];
const GE10_RANGE: [f64; 2] = [-1500.0, 1900.0];
const MR: [u64; 3] = [64, 64, 1];
const MR_MM: [f64; 3] = [0.3125, 0.3125, 0.8];
const MR_FIRST: [f64; 3] = [-83.9063, -91.2, 6.6406];
const MR_RANGE: [f64; 2] = [127.0, 2145.0];

/// The items that `info --json` finds in a file of the sample data.
fn items(file: &str) -> Option<Vec<Value>> {
    let path = shared_data()?.join(file);
    let answer = run(&["info", path.to_str().unwrap(), "--json"], LIMIT).json();
    Some(answer["items"].as_array().unwrap_or_else(|| panic!("a list of items: {answer}")).clone())
}

/// The one item of a file that must have one.
fn item(file: &str) -> Option<Value> {
    let mut items = items(file)?;
    assert_eq!(items.len(), 1, "{file} holds one thing: {items:?}");
    items.pop()
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap_or_else(|| panic!("a list: {value}"));
    list.iter().map(|v| v.as_f64().unwrap_or_else(|| panic!("a number: {v}"))).collect()
}

/// Whether all numbers agree to a part in a million, or a ten thousandth of a millimetre.
fn near(found: &[f64], wanted: &[f64]) -> bool {
    let one = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-4_f64.max(b.abs() * 1e-6);
    found.len() == wanted.len() && found.iter().zip(wanted).all(one)
}

fn has_note(item: &Value, part: &str) -> bool {
    let notes = item["notes"].as_array().expect("notes are a list");
    notes.iter().any(|note| note["code"].as_str().unwrap_or_default().contains(part))
}

#[test]
fn volumes_are_where_and_what_other_programs_say() {
    let mut faults = Vec::new();
    for wanted in &VOLUMES {
        let Some(item) = item(wanted.file) else { return };
        let matrix = numbers(&item["world_from_voxel"]);
        let first = [matrix[3], matrix[7], matrix[11]];
        let right = item["kind"] == "volume"
            && item["extent"] == serde_json::json!(wanted.extent)
            && item["orientation"] == wanted.axes
            && near(&numbers(&item["spacing_mm"]), &wanted.spacing_mm)
            && near(&first, &wanted.first_mm)
            && near(&numbers(&item["range"]), &wanted.range);
        if !right {
            faults.push(format!("{}: first voxel {first:?}: {item}", wanted.file));
        }
    }
    assert!(faults.is_empty(), "these differ:\n{}", faults.join("\n"));
}

#[test]
fn volumes_over_time_have_their_steps() {
    for (file, extent, steps, range) in [
        ("time/example4d_2vol.nii.gz", [128, 96, 24], 2, [0.0, 1162.0]),
        ("time/fmri_18vol_dicom.zip", [80, 80, 35], 18, [0.0, 792.0]),
        ("time/turbulence_taylor_green_96_36steps.nii.gz", [96, 96, 96], 36, [0.0, 255.0]),
    ] {
        let Some(item) = item(file) else { return };
        assert_eq!(item["kind"], "series", "{file}: {item}");
        assert_eq!(item["extent"], serde_json::json!(extent), "{file}");
        assert_eq!(item["steps"], steps, "{file}");
        assert!(near(&numbers(&item["range"]), &range), "{file}: {}", item["range"]);
        assert!(item["orientation"].as_str().is_some_and(|o| o.len() >= 3), "{file}: {item}");
    }
}

#[test]
fn a_tilted_gantry_and_uneven_slices_are_kept_right_and_said() {
    let Some(item) = item("ct/head_ge_tilt_dicom.zip") else { return };
    assert_eq!(item["modality"], "CT", "{item}");
    assert!(has_note(&item, "tilt"), "the tilt is said: {}", item["notes"]);
    assert!(has_note(&item, "uneven"), "the uneven slices are said: {}", item["notes"]);
    // The table runs along z: the first slice at 5.836, the last at 157.776, whatever the slices between are made into.
    let matrix = numbers(&item["world_from_voxel"]);
    let extent = numbers(&item["extent"]);
    let at = |k: f64| [2, 6, 10].map(|column| matrix[column] * k + matrix[column + 1]);
    assert!(near(&at(0.0), &[-125.0, -123.54046, 5.836_06]), "the first slice: {item}");
    let last = at(extent[2] - 1.0);
    assert!(
        (last[0] + 125.0).abs() < 1e-3 && (last[1] + 123.54046).abs() < 1e-3,
        "slices are above each other: {last:?}"
    );
    // 1.081 mm is no whole part of the steps beside it: the resampled stack may end a little before the last slice.
    assert!((last[2] - 157.776).abs() < 0.05, "the last slice: {last:?}");
    assert!(near(&numbers(&item["range"]), &[-1500.0, 2121.0]), "{}", item["range"]);
}

#[test]
fn surfaces_have_their_triangles_and_size() {
    for (file, triangles, size_mm) in [
        ("mesh/libhip_m4_lfemur.stl", 72_868, [96.68, 64.92, 164.4]),
        ("mesh/tka_femoral_component.stl", 24_442, [0.06636, 0.05558, 0.07505]),
        ("mesh/tka_patient_femur.stl", 29_590, [0.0802, 0.467, 0.1094]),
        ("mesh/tka_patient_tibia.stl", 56_134, [0.06725, 0.3811, 0.07974]),
        ("mesh/tka_tibial_insert.stl", 15_042, [0.04691, 0.009475, 0.07923]),
        ("mesh/tka_tibial_insert.obj", 15_042, [0.04691, 0.009475, 0.07923]),
        ("mesh/tka_tibial_tray.stl", 64_388, [0.05298, 0.1113, 0.0795]),
    ] {
        let Some(item) = item(file) else { return };
        assert_eq!(item["kind"], "surface", "{file}: {item}");
        assert_eq!(item["triangles"], triangles, "{file}");
        // The figures have four digits.
        let right = numbers(&item["size_mm"]).iter().zip(size_mm).all(|(a, b)| (a - b).abs() <= b * 6e-4);
        assert!(right, "{file}: {}", item["size_mm"]);
    }
    // glTF's unit is the metre, so that what an STL leaves open is plain here.
    let Some(parts) = items("mesh/tka_assembly.glb") else { return };
    let triangles: u64 = parts.iter().map(|part| part["triangles"].as_u64().unwrap()).sum();
    assert_eq!((parts.len(), triangles), (3, 103_872), "three parts in the assembly");
    let longest = parts.iter().flat_map(|part| numbers(&part["size_mm"])).fold(0.0, f64::max);
    assert!((longest - 111.3).abs() < 0.1, "the tray's stem is 111.3 mm long: {longest}");
}

#[test]
fn cell_grids_have_their_points_and_cells() {
    for (file, points, cells) in [
        ("grid/femur_fe_stress.vtu", 90_358, 415_436),
        ("grid/post.vtk", 2288, 8750),
        // VTK counts 10 424 in eight blocks: seven of these are sets of sides and nodes, not cells of the volume.
        ("grid/disk_out_ref.ex2", 8499, 7472),
        ("grid/bluntfinxyz.bin", 40_960, 37_479),
        ("time/cfd_tjunction/tj_05.vtu", 37_631, 31_000),
    ] {
        let Some(item) = item(file) else { return };
        assert_eq!(item["kind"], "cells", "{file}: {item}");
        assert_eq!((&item["points"], &item["cells"]), (&points.into(), &cells.into()), "{file}");
    }
    let Some(steps) = item("time/cfd_tjunction/tj.pvd") else { return };
    assert_eq!(steps["steps"], 11, "{steps}");
}

#[test]
fn every_file_of_the_sample_data_loads() {
    let Some(data) = shared_data() else { return };
    let mut faults = Vec::new();
    for folder in ["ct/dicom_single", "mri/dicom_single", "grid", "mesh"] {
        let mut files: Vec<_> =
            std::fs::read_dir(data.join(folder)).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        assert!(files.len() >= 5, "{folder} is whole: {files:?}");
        for path in files {
            let outcome = run(&["info", path.to_str().unwrap(), "--json"], LIMIT);
            if outcome.code() != 0 {
                faults.push(outcome.stderr);
            }
        }
    }
    assert!(faults.is_empty(), "these do not load:\n{}", faults.join(""));
}
