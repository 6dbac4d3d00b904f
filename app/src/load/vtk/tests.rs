//! The files in `golden/` were written by VTK 9.7.2's own writers, each from the same hand-made grid or
//! surface, with blocks of 64 bytes so that every array has many. The figures of the sample data were
//! taken with VTK's readers and meshio.
#![expect(clippy::indexing_slicing, reason = "a test may fail loudly")]

use render::volume::TriangleMesh;
use render::volume::cells::{CellGrid, CellKind, Place, Values};

use super::super::bytes::trial::{sample, survives};
use super::super::{Content, Silent};
use super::*;

macro_rules! golden {
    ($($name:literal),* $(,)?) => { [$(($name, &include_bytes!(concat!("golden/", $name))[..])),*] };
}

const LIMITS: Limits = Limits { decoded_bytes: 1 << 20, files: 100 };

fn item(file: &[u8]) -> Result<Item, Fault> {
    match parse(file, &LIMITS)? {
        Parsed::Dataset(dataset) => dataset.into_item("a".to_owned(), &LIMITS),
        other => panic!("{other:?}"),
    }
}

fn grid(item: &Item) -> &CellGrid {
    let Content::Cells(grid) = &item.content else { panic!("no grid: {item:?}") };
    grid
}

fn mesh(item: &Item) -> &TriangleMesh {
    let Content::Mesh(mesh) = &item.content else { panic!("no mesh: {item:?}") };
    mesh
}

fn codes(item: &Item) -> Vec<&'static str> {
    item.notes.iter().map(|note| note.code).collect()
}

fn told<T: std::fmt::Debug>(result: Result<T, Fault>) -> String {
    match result {
        Err(Fault::Broken(clause)) => clause,
        Err(fault) => format!("{fault:?}"),
        Ok(item) => panic!("accepted: {item:?}"),
    }
}

fn is_the_hand_made_grid(name: &str, item: &Item) {
    let grid = grid(item);
    let expected: [(CellKind, &[u32]); 4] = [
        (CellKind::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]),
        (CellKind::Pyramid, &[4, 5, 6, 7, 8]),
        (CellKind::Tetra, &[1, 9, 2, 5]),
        (CellKind::Wedge, &[1, 9, 2, 5, 10, 6]),
    ];
    assert_eq!((0..grid.len()).map(|cell| grid.cell(cell)).collect::<Vec<_>>(), expected, "{name}: cells");
    assert_eq!(grid.points().len(), 11, "{name}: points");
    assert_eq!(grid.points()[8], [1.0, 1.0, 3.5].into(), "{name}: the apex");
    let [step] = grid.steps() else { panic!("{name}: steps") };
    let p = step.field(Place::Points, "p").expect("p");
    let expected = (0_u8..11).map(|n| f32::from(n) * 0.5 - 1.0).collect();
    assert_eq!((p.components(), p.values()), (1, &Values::F32(expected)), "{name}: p");
    let u = step.field(Place::Points, "U m/s").expect("U");
    let expected = (0_u8..11).flat_map(|n| [f64::from(n), -f64::from(n), 0.1]).collect();
    assert_eq!((u.components(), u.values()), (3, &Values::F64(expected)), "{name}: U");
    // The quadrilateral's 11 is gone with it.
    let part = step.field(Place::Cells, "part").expect("part");
    assert_eq!(part.values(), &Values::F64(vec![7.0, 8.0, 9.0, -10.0]), "{name}: part");
    assert_eq!(codes(item), ["cells.dropped"], "{name}: the quadrilateral");
}

#[test]
fn every_encoding_of_vtks_writers_gives_the_same_grid() {
    let files = golden![
        "ascii.vtu",
        "inline_none.vtu",
        "inline_zlib.vtu",
        "inline_lz4.vtu",
        "inline_lzma.vtu",
        "base64_none.vtu",
        "base64_zlib.vtu",
        "base64_lz4.vtu",
        "base64_lzma.vtu",
        "raw_none.vtu",
        "raw_zlib.vtu",
        "raw_lz4.vtu",
        "raw_lzma.vtu",
        "raw_none_u64.vtu",
        "raw_none_big.vtu",
        "raw_zlib_u64_big.vtu",
        "legacy42_ascii.vtk",
        "legacy42_binary.vtk",
        "legacy51_ascii.vtk",
        "legacy51_binary.vtk",
    ];
    for (name, file) in files {
        match item(file) {
            Ok(item) => is_the_hand_made_grid(name, &item),
            Err(fault) => panic!("{name}: {fault:?}"),
        }
    }
}

#[test]
fn surfaces_are_meshes() {
    for (name, file) in golden!["surface.vtp", "surface42.vtk", "surface51.vtk"] {
        let item = item(file).expect(name);
        let mut triangles = mesh(&item).triangles().to_vec();
        triangles.sort_unstable();
        let expected = [[0, 1, 4], [0, 2, 1], [0, 3, 2], [4, 1, 5], [4, 5, 6], [4, 6, 7]];
        assert_eq!(triangles, expected, "{name}: two quadrilaterals and a strip of two");
    }
}

const TETRA: &str = "# vtk DataFile Version 3.0\nmade here\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n\
    0 0 0 2 0 0 0 2 0 0 0 2\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 4\nSCALARS s float 1\n\
    LOOKUP_TABLE own\n1 2 3 nan\nLOOKUP_TABLE own 1\n1 1 1 1\nVECTORS v double\n0 0 0 1 1 1 2 2 2 3 3 3\n\
    CELL_DATA 1\nFIELD FieldData 2\nname 1 1 string\nbone%20a\nid 1 1 int\n7\n";

#[test]
fn legacy_attributes_are_read_one_by_one() {
    let item = item(TETRA.as_bytes()).expect("a grid");
    let step = &grid(&item).steps()[0];
    let names = step.point_fields.iter().map(|field| (field.name(), field.components())).collect::<Vec<_>>();
    assert_eq!(names, [("s", 1), ("v", 3)], "fields at points");
    assert_eq!(step.point_fields[0].range(0), Some([1.0, 3.0]), "NaN left out");
    assert_eq!(step.field(Place::Cells, "id").and_then(|id| id.range(0)), Some([7.0, 7.0]), "after the text");
    assert_eq!(codes(&item), ["vtk.field-dropped", "cells.not-finite"], "text and NaN told");
}

#[test]
fn slicers_title_says_the_frame() {
    let item = item(TETRA.replace("made here", "3D Slicer output. SPACE=RAS").as_bytes()).expect("a grid");
    let low = [-2.0, -2.0, 0.0].into();
    assert_eq!(grid(&item).bounds()[0], low, "turned");
}

#[test]
fn cells_of_other_orders_are_converted() {
    // A voxel, whose corners go row by row, and a quadratic tetrahedron of ten.
    let text = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 10 float\n\
        0 0 0 1 0 0 0 1 0 1 1 0 0 0 1 1 0 1 0 1 1 1 1 1 5 5 5 6 6 6\n\
        CELLS 2 20\n8 0 1 2 3 4 5 6 7\n10 0 1 2 4 8 8 8 9 9 9\nCELL_TYPES 2\n11 24\n";
    let item = item(text.as_bytes()).expect("a grid");
    assert_eq!(grid(&item).cell(0), (CellKind::Hexahedron, &[0, 1, 3, 2, 4, 5, 7, 6][..]), "voxel");
    assert_eq!(grid(&item).cell(1), (CellKind::Tetra, &[0, 1, 2, 4][..]), "corners only");
    assert_eq!(codes(&item), ["cells.linearised"], "told");
}

#[test]
fn contradictions_are_told() {
    let swap = |from: &str, to: &str| told(item(TETRA.replace(from, to).as_bytes()));
    let fault = swap("4 0 1 2 3", "4 0 1 2 -1");
    assert!(fault.contains("names point -1, but there are only 4"), "{fault}");
    let fault = swap("4 0 1 2 3", "4 0 1 2 4");
    assert!(fault.contains("names point 4"), "{fault}");
    let fault = swap("POINTS 4 float", "POINTS 18446744073709551615 float");
    assert!(fault.contains("TooLarge"), "{fault}");
    let fault = swap("POINTS 4 float", "POINTS 40000 float");
    assert!(fault.contains("is \"CELLS\""), "{fault}");
    let fault = swap("CELLS 1 5", "CELLS 2 5");
    assert!(fault.contains("announces 2 cells but has 1"), "{fault}");
    let fault = swap("POINT_DATA 4", "POINT_DATA 3");
    assert!(fault.contains("\"NAN\""), "the fourth number stands where a keyword should: {fault}");
    let fault = swap("0 0 0 2 0 0", "0 0 0 2 0 inf");
    assert!(fault.contains("not finite"), "{fault}");
    let fault = swap("CELL_TYPES 1\n10", "CELL_TYPES 1\n12");
    assert!(fault.contains("cell 0 is a hexahedron of 4 corners"), "{fault}");
    let fault = swap("UNSTRUCTURED_GRID", "STRUCTURED_POINTS");
    assert!(fault.contains("MetaImage"), "{fault}");
    let (_, raw) = golden!["raw_none.vtu"][0];
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let fault = told(item(&raw[..raw.len() - 32]));
    assert!(fault.contains("it ends 2 bytes early"), "{fault}");
    let fault = told(item(&raw[..raw.len() - 40]));
    assert!(fault.contains("past the end"), "{fault}");
    let (_, ascii) = golden!["ascii.vtu"][0];
    let many = text(ascii).replace("NumberOfPoints=\"11\"", "NumberOfPoints=\"90000000000\"");
    assert!(told(item(many.as_bytes())).contains("TooLarge"), "a count that lies");
    let few = text(ascii).replace("NumberOfPoints=\"11\"", "NumberOfPoints=\"12\"");
    assert!(told(item(few.as_bytes())).contains("has 33 numbers but needs 36"), "one point too few");
    let image = text(ascii).replace("UnstructuredGrid", "ImageData");
    assert!(told(item(image.as_bytes())).contains("NRRD"), "an image");
}

#[test]
fn tags_nested_without_end_do_not_overflow_the_stack() {
    let deep = format!("<VTKFile type=\"PolyData\">{}", "<a>".repeat(300_000));
    assert!(item(deep.as_bytes()).is_err(), "no end tags");
    let deep = format!("{deep}{}</VTKFile>", "</a>".repeat(300_000));
    assert!(item(deep.as_bytes()).is_err(), "no data set");
}

/// Writes `text` and the golden grid twice into a folder and opens it.
fn beside(name: &str, text: &str) -> Result<Vec<Item>, LoadError> {
    let folder = tempfile::tempdir().expect("a folder");
    let (_, file) = golden!["raw_zlib.vtu"][0];
    for other in ["0.vtu", "1.vtu"] {
        std::fs::write(folder.path().join(other), file).expect("written");
    }
    let (_, file) = golden!["legacy42_ascii.vtk"][0];
    std::fs::write(folder.path().join("old.vtk"), file).expect("written");
    let moved = String::from_utf8_lossy(file).replace("1 1 3.5", "1 1 3.75");
    std::fs::write(folder.path().join("moved.vtk"), moved).expect("written");
    std::fs::write(folder.path().join(name), text).expect("written");
    read(&folder.path().join(name), &LIMITS, &Silent)
}

fn collection(entries: &[(&str, &str)]) -> String {
    let entry =
        |(time, file): &(&str, &str)| format!("<DataSet timestep=\"{time}\" part=\"0\" file=\"{file}\"/>");
    let entries = entries.iter().map(entry).collect::<String>();
    format!(
        "<?xml version=\"1.0\"?><VTKFile type=\"Collection\"><Collection>{entries}</Collection></VTKFile>"
    )
}

#[test]
fn a_collection_is_one_grid_with_its_times_in_order() {
    let items = beside("a.pvd", &collection(&[("0.5", "./1.vtu"), ("0.25", "0.vtu"), ("2", "old.vtk")]));
    let items = items.expect("a collection");
    let times = grid(&items[0]).steps().iter().map(|step| step.time).collect::<Vec<_>>();
    assert_eq!(times, [0.25, 0.5, 2.0], "sorted");
    assert_eq!(grid(&items[0]).range(Place::Points, "p", 0), Some([-1.0, 4.0]), "fields of all");
    assert_eq!(grid(&items[0]).steps()[2].cell_fields[0].values().len(), 4, "dropped cells in each step");
    let parts = beside("a.pvd", &collection(&[("1", "0.vtu"), ("1", "1.vtu")])).expect("parts");
    assert_eq!((grid(&parts[0]).len(), grid(&parts[0]).steps().len()), (8, 1), "one time, two parts");
    assert_eq!(grid(&parts[0]).cell(5), (CellKind::Pyramid, &[15, 16, 17, 18, 19][..]), "indices moved on");
}

#[test]
fn collections_that_cannot_be_followed_are_told() {
    let moved = beside("a.pvd", &collection(&[("0", "old.vtk"), ("1", "moved.vtk")]));
    assert!(matches!(moved, Err(LoadError::Unsupported { .. })), "points that move: {moved:?}");
    let outside = beside("a.pvd", &collection(&[("0", "../old.vtk")]));
    assert!(matches!(outside, Err(LoadError::Unsupported { .. })), "outside the folder: {outside:?}");
    let own = beside("a.pvd", &collection(&[("0", "a.pvd")]));
    assert!(matches!(own, Err(LoadError::Broken { .. })), "names itself: {own:?}");
    let missing = beside("a.pvd", &collection(&[("0", "no.vtu")]));
    let named = matches!(&missing, Err(LoadError::Io { path, .. }) if path.ends_with("no.vtu"));
    assert!(named, "says which is missing: {missing:?}");
    let nothing = beside("a.pvd", &collection(&[]));
    assert!(matches!(nothing, Err(LoadError::Broken { .. })), "no file: {nothing:?}");
    let never = beside("a.pvd", &collection(&[("nan", "0.vtu")]));
    assert!(matches!(never, Err(LoadError::Broken { .. })), "no time: {never:?}");
}

#[test]
fn pieces_of_a_parallel_grid_are_put_together() {
    let text = "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid GhostLevel=\"0\"><PPoints/>\
        <Piece Source=\"0.vtu\"/><Piece Source=\"1.vtu\"/></PUnstructuredGrid></VTKFile>";
    let items = beside("a.pvtu", text).expect("pieces");
    assert_eq!((grid(&items[0]).len(), grid(&items[0]).points().len()), (8, 22), "both");
    let part = &grid(&items[0]).steps()[0].cell_fields[0];
    assert_eq!((part.value(0, 0), part.value(4, 0), part.value(7, 0)), (7.0, 7.0, -10.0), "fields of both");
    assert_eq!(codes(&items[0]), ["vtk.pieces", "cells.dropped"], "told");
    let own = text.replace("1.vtu", "a.pvtu");
    assert!(matches!(beside("a.pvtu", &own), Err(LoadError::Broken { .. })), "names itself");
}

#[test]
fn copies_of_cells_that_another_piece_has_are_left_out() {
    let text = TETRA.replace("CELLS 1 5\n4 0 1 2 3", "CELLS 2 10\n4 0 1 2 3 4 0 1 2 3");
    let text = text.replace("CELL_TYPES 1\n10", "CELL_TYPES 2\n10 10");
    let (text, _) = text.split_once("CELL_DATA").expect("a part");
    let text = format!("{text}CELL_DATA 2\nSCALARS vtkGhostType unsigned_char\n0 1\nSCALARS id int\n5 6\n");
    let item = item(text.as_bytes()).expect("a grid");
    assert_eq!(grid(&item).len(), 1, "the copy is gone");
    assert_eq!(grid(&item).range(Place::Cells, "id", 0), Some([5.0, 5.0]), "with its fields");
}

#[test]
fn no_byte_makes_it_panic() {
    let files = golden![
        "ascii.vtu",
        "inline_zlib.vtu",
        "raw_lzma.vtu",
        "legacy42_binary.vtk",
        "legacy51_ascii.vtk",
        "surface.vtp",
    ];
    for (_, file) in files {
        survives(file, |bytes| {
            parse(bytes, &LIMITS).map(|parsed| match parsed {
                Parsed::Dataset(dataset) => dataset.into_item(String::new(), &LIMITS).is_ok(),
                _ => false,
            })
        });
    }
    survives(collection(&[("0", "0.vtu")]).as_bytes(), |bytes| parse(bytes, &LIMITS));
}

/// Bounds, low then high, within what `f32` holds.
fn bounds_are(grid: &CellGrid, expected: [[f64; 3]; 2]) {
    for (found, expected) in grid.bounds().iter().zip(expected) {
        for axis in 0..3 {
            assert!((found[axis] - expected[axis]).abs() < 1e-6, "{found} for {expected:?}");
        }
    }
}

fn range_is(grid: &CellGrid, name: &str, component: usize, expected: [f64; 2]) {
    let [low, high] = grid.range(Place::Points, name, component).expect(name);
    assert!((low - expected[0]).abs() <= 1e-6 * expected[0].abs(), "{name} {component}: {low}");
    assert!((high - expected[1]).abs() <= 1e-6 * expected[1].abs(), "{name} {component}: {high}");
}

#[test]
fn the_femur_has_the_facts_that_vtk_reads() {
    let Some(path) = sample("grid/femur_fe_stress.vtu") else { return };
    let items = read(&path, &Limits::default(), &Silent).expect("the femur");
    let grid = grid(&items[0]);
    assert_eq!((grid.points().len(), grid.len()), (90_358, 415_436), "sizes");
    assert_eq!(grid.count(CellKind::Tetra), grid.len(), "tetrahedra only");
    bounds_are(
        grid,
        [
            [82.005_317_687_988_28, -194.944_442_749_023_44, -730.780_029_296_875],
            [186.573_898_315_429_7, -109.742_576_599_121_1, -588.408_142_089_843_8],
        ],
    );
    range_is(grid, "von_mises_MPa", 0, [0.0, 98.137_603_759_765_62]);
    range_is(grid, "displacement_mm", 1, [-0.001_707_670_046_016_574, 0.276_497_006_416_320_8]);
    range_is(grid, "stress_MPa", 5, [-30.761_499_404_907_227, 27.257_799_148_559_57]);
    assert_eq!(codes(&items[0]), [""; 0], "nothing to say");
}

#[test]
fn the_t_junction_has_its_eleven_steps() {
    let Some(path) = sample("time/cfd_tjunction/tj.pvd") else { return };
    let items = read(&path, &Limits::default(), &Silent).expect("the steps");
    let grid = grid(&items[0]);
    assert_eq!(
        (grid.points().len(), grid.count(CellKind::Hexahedron), grid.len()),
        (37_631, 31_000, 31_000),
        "sizes"
    );
    let times = grid.steps().iter().map(|step| step.time).collect::<Vec<_>>();
    assert_eq!(times, [0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05, 1.2, 1.35, 1.5], "times");
    bounds_are(grid, [[0.0, -0.21, 0.0], [0.22, 0.21, 0.02]]);
    let last = &grid.steps()[10];
    let p = last.field(Place::Points, "p").and_then(|p| p.range(0));
    assert_eq!(p, Some([-18.323_650_360_107_422, 38.074_401_855_468_75]), "last p");
    range_is(grid, "p", 0, [-18.323_650_360_107_422, 38.074_401_855_468_75]);
    range_is(grid, "U", 1, [-7.720_301_151_275_635, 9.588_680_267_333_984]);
    assert_eq!(codes(&items[0]), ["mesh.maybe-metres"], "22 cm in metres");
}

#[test]
fn the_oxygen_post_has_the_facts_that_vtk_reads() {
    let Some(path) = sample("grid/post.vtk") else { return };
    let items = read(&path, &Limits::default(), &Silent).expect("the post");
    let grid = grid(&items[0]);
    assert_eq!((grid.points().len(), grid.count(CellKind::Tetra), grid.len()), (2288, 8750, 8750), "sizes");
    let low = [-2.839_925_527_572_632, -2.856_848_478_317_260_7, 0.0];
    bounds_are(grid, [low, [2.862_497_091_293_335, 2.856_848_478_317_260_7, 1.125_546_455_383_300_8]]);
    range_is(grid, "Pressure", 0, [0.355_367_690_324_783_3, 1.641_240_477_561_950_7]);
}

#[test]
fn the_broken_samples_are_refused() {
    for (name, says) in
        [("bad/vtk_cell_index_negative.vtk", "names point -1"), ("bad/vtu_truncated.vtu", "tags")]
    {
        let Some(path) = sample(name) else { return };
        let Err(error) = read(&path, &Limits::default(), &Silent) else { panic!("{name} accepted") };
        assert!(error.to_string().contains(says), "{error}");
    }
}
