//! Plain image formats and folders, against files made here and against the sample data. The figures of the
//! sample data were taken with nibabel 5.4 and `SimpleITK` 2.5.
#![expect(clippy::indexing_slicing, clippy::arithmetic_side_effects, reason = "a test may fail loudly")]

mod metaimage;
mod nifti;
mod nrrd;

use std::io::Write as _;
use std::path::PathBuf;

use render::volume::{Point, Series};

use super::bytes::trial::{sample, survives};
use super::*;

fn load(path: &Path) -> Result<Vec<Item>, LoadError> {
    open(path, &Limits::default(), &Silent)
}

pub(crate) fn only(items: Vec<Item>) -> Item {
    let [item] = <[Item; 1]>::try_from(items).expect("one item");
    item
}

pub(crate) fn volume(item: &Item) -> &Grid {
    match &item.content {
        Content::Volume(grid) => grid,
        other => panic!("{other:?} is no volume"),
    }
}

pub(crate) fn series(item: &Item) -> &Series {
    match &item.content {
        Content::Series(series) => series,
        other => panic!("{other:?} is no series"),
    }
}

pub(crate) fn codes(item: &Item) -> Vec<&'static str> {
    item.notes.iter().map(|n| n.code).collect()
}

fn world(grid: &Grid, at: [f64; 3]) -> [f64; 3] {
    grid.world_from_voxel().point(&Point::from(at)).coords.into()
}

fn assert_near(found: [f64; 3], expected: [f64; 3], what: &str) {
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-5, "{what}: {found:?} instead of {expected:?}");
    }
}

/// A file of that name in a folder of its own.
fn file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("written");
    (folder, path)
}

fn load_bytes(name: &str, bytes: &[u8]) -> Result<Item, LoadError> {
    let (_folder, path) = file(name, bytes);
    load(&path).map(only)
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    out.write_all(bytes).expect("in memory");
    out.finish().expect("in memory")
}

/// The turn by 0.3 rad about z, spacing 1, 2, 3 and origin 10, 20, 30 in LPS that `SimpleITK` was asked to
/// write as `.mha`, `.nrrd` and `.nii`: voxel (3, 2, 1) lies here, by its `TransformIndexToPhysicalPoint`.
const TURNED: [f64; 3] = [11.683_928_640_731_46, 24.707_906_576_486_44, 33.0];

fn counted() -> Vec<u8> {
    (0..24_i16).flat_map(i16::to_le_bytes).collect()
}

#[test]
fn letters_say_where_an_array_runs() {
    let letters = |x: [f64; 3], y: [f64; 3], z: [f64; 3]| {
        let affine = Affine::from_columns(x.into(), y.into(), z.into(), Point::origin()).expect("a space");
        axis_codes(&affine)
    };
    assert_eq!(letters([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]), "LPS", "the world's own axes");
    assert_eq!(letters([0.0, 0.0, -2.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]), "IRA", "turned");
    // The third axis leans nearer to P than to S, but P is the second one's.
    assert_eq!(letters([1.0, 0.0, 0.0], [0.0, 1.0, 0.1], [0.0, 0.8, 0.6]), "LPS", "no pair twice");
}

#[test]
fn a_folder_gives_its_dicom_series_and_every_other_file_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let header = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 1 1\nspacings: 1 1 1\nencoding: raw\n\n";
    let put = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).expect("written");
    put("b.nrrd", &[header.as_bytes(), &[1, 2]].concat());
    put("c.nrrd", &[header.as_bytes(), &[1]].concat());
    put("notes.txt", b"nothing");
    std::fs::create_dir(folder.path().join("inner")).expect("a folder");
    put("inner/d.nrrd", &[header.as_bytes(), &[5, 6]].concat());
    let items = load(folder.path()).expect("two load");
    assert_eq!(items.iter().map(|i| i.name.as_str()).collect::<Vec<_>>(), ["b.nrrd", "d.nrrd"], "in order");
    assert!(codes(&items[0]).contains(&"folder.left-out"), "the short one is noted");
    let empty = tempfile::tempdir().expect("a folder");
    assert!(matches!(load(empty.path()), Err(LoadError::Unknown { .. })), "nothing in it");
    let limits = Limits { files: 2, ..Limits::default() };
    assert!(open(folder.path(), &limits, &Silent).is_err(), "more files than allowed");
}

#[test]
fn the_volumes_of_the_sample_data_have_their_figures() {
    let Some(root) = sample("") else { return };
    // File, extent, spacing, letters, range, voxel and its value, LPS place of the first voxel.
    type Fact = (&'static str, [usize; 3], [f64; 3], &'static str, [f64; 2], ([usize; 3], f64), [f64; 3]);
    let facts: [Fact; 7] = [
        (
            "ct/chest_lidc0001.nii.gz",
            [512, 512, 133],
            [0.703_125, 0.703_125, 2.5],
            "LAS",
            [-2048.0, 3071.0],
            ([256, 256, 66], 396.0),
            [-166.0, 187.596_878, -340.0],
        ),
        (
            "ct/chest_lidc0001_labels.nii.gz",
            [512, 512, 133],
            [0.703_125, 0.703_125, 2.5],
            "LAS",
            [0.0, 118.0],
            ([256, 256, 66], 51.0),
            [-166.0, 187.596_878, -340.0],
        ),
        (
            "ct/torso_pelvis_3mm.nii.gz",
            [122, 101, 112],
            [3.0; 3],
            "RAS",
            [-1207.0, 3382.0],
            ([36, 60, 78], 60.0),
            [177.956_329, -11.319, 94.301_758],
        ),
        (
            "mri/ch2_t1.nii.gz",
            [181, 217, 181],
            [1.0; 3],
            "RAS",
            [0.0, 254.0],
            ([54, 130, 126], 99.0),
            [90.0, 125.0, -71.0],
        ),
        (
            "mri/ct_brain_atlas_1mm.nii.gz",
            [202, 202, 179],
            [1.0; 3],
            "RAS",
            [-30.0, 385.0],
            ([60, 121, 125], 39.0),
            [100.802_734, -81.697_266, 1_126.800_049],
        ),
        (
            "mri/torso_mr_3mm.nii.gz",
            [117, 91, 20],
            [3.0; 3],
            "LPS",
            [-47.0, 833.0],
            ([35, 54, 14], 119.0),
            [-168.599_640, -166.359_436, 28.989_641],
        ),
        (
            "ct/cranium_256.nrrd",
            [256, 256, 108],
            [0.957_031_2, 0.957_031_2, 1.5],
            "LAS",
            [-1024.0, 2986.0],
            ([100, 128, 54], 37.0),
            [0.0; 3],
        ),
    ];
    for (name, extent, spacing, letters, range, (at, value), origin) in facts {
        let item = only(load(&root.join(name)).unwrap_or_else(|e| panic!("{e}")));
        let grid = volume(&item);
        assert_eq!((grid.extent(), grid.range()), (extent, range), "{name}: extent and range");
        assert_near(grid.spacing_mm(), spacing, name);
        assert_eq!(axis_codes(grid.world_from_voxel()), letters, "{name}: letters");
        assert_eq!(grid.value(at[0], at[1], at[2]), value, "{name}: value at {at:?}");
        assert_near(world(grid, [0.0; 3]), origin, name);
        assert!(item.notes.is_empty(), "{name}: {:?}", item.notes);
    }
}

#[test]
fn the_series_of_the_sample_data_have_their_figures() {
    let Some(root) = sample("") else { return };
    let item = only(load(&root.join("time/example4d_2vol.nii.gz")).expect("loads"));
    let pair = series(&item);
    assert_eq!((pair.len(), pair.range()), (2, [0.0, 1162.0]), "steps and range");
    assert_eq!(pair.steps()[1].value(64, 48, 12), 266.0, "a value of the second");
    // An oblique sform, first voxel negated to LPS.
    assert_near(world(&pair.steps()[0], [0.0; 3]), [-117.855_103, 35.722_942, -7.248_798], "first voxel");
    assert_eq!(codes(&item), ["nifti.time-unit"], "2000 s are doubted");
    let item = only(load(&root.join("time/turbulence_taylor_green_96_36steps.nii.gz")).expect("loads"));
    let flow = series(&item);
    assert_eq!((flow.len(), flow.range()), (36, [0.0, 255.0]), "steps and range");
    assert_eq!(flow.steps()[32].value(28, 57, 67), 48.0, "a value of step 32");
    assert_eq!(flow.times_secs()[1], 0.2, "as written, not its nearest float");
}

#[test]
fn every_bad_file_gives_an_error_or_notes_and_no_panic() {
    let Some(root) = sample("bad") else { return };
    let mut loaded = Vec::new();
    for entry in std::fs::read_dir(&root).expect("the folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        match load(&path) {
            Ok(items) => loaded.push((name, items.iter().map(|i| i.notes.len()).sum::<usize>())),
            Err(error) => assert!(error.to_string().len() > 40, "{name}: a sentence, not {error}"),
        }
    }
    loaded.sort();
    println!("loaded: {loaded:?}");
    for (name, fault) in [
        ("ch2_truncated.nii.gz", "cut short or damaged"),
        ("nifti_huge_dims.nii", "asks for 70362301923326 bytes"),
        ("nifti_nan_slope_zero_pixdim.nii", "asks for 425880 bytes of samples, but only 39648"),
        ("nifti_negative_dim.nii", "its size along axis 1 is -117"),
        ("nrrd_missing_data_file.nhdr", "not_here.raw"),
        ("nrrd_short_data.nrrd", "asks for 761856 bytes of samples, but only 8192"),
        ("bad_datatype+orig.HEAD", "is not a format this program reads"),
    ] {
        let error = load(&root.join(name)).expect_err(name);
        assert!(error.to_string().contains(fault), "{name}: {error}");
    }
}
