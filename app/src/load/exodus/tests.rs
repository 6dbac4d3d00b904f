//! The files in `golden/` were written by the netCDF library itself (netCDF4 1.7.5 for Python), one in each
//! version of the classic format, with the same hand-made mesh: a block of one hexahedron, a block of two
//! tetrahedra of ten nodes, a block of one shell; two times. The figures of the sample were read with VTK.
#![expect(clippy::indexing_slicing, reason = "a test may fail loudly")]

use render::volume::cells::Place;

use super::super::bytes::trial::{sample, survives};
use super::super::{Content, Silent};
use super::*;

const GOLDEN: [(&str, &[u8]); 3] = [
    ("version 1", include_bytes!("golden/cdf1.ex2")),
    ("version 2", include_bytes!("golden/cdf2.ex2")),
    ("version 5", include_bytes!("golden/cdf5.ex2")),
];
const LIMITS: Limits = Limits { decoded_bytes: 1 << 20, files: 10 };

fn loaded(file: &[u8]) -> Result<Item, Fault> {
    parse(file, "a".to_owned(), &LIMITS, &Silent)
}

fn grid(item: &Item) -> &CellGrid {
    let Content::Cells(grid) = &item.content else { panic!("no grid") };
    grid
}

#[test]
fn each_version_of_the_format_gives_the_same_grid() {
    for (name, file) in GOLDEN {
        let item = loaded(file).expect(name);
        let grid = grid(&item);
        let expected: [(CellKind, &[u32]); 3] = [
            (CellKind::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]),
            (CellKind::Tetra, &[4, 5, 6, 8]),
            (CellKind::Tetra, &[4, 6, 7, 8]),
        ];
        assert_eq!((0..3).map(|cell| grid.cell(cell)).collect::<Vec<_>>(), expected, "{name}: cells");
        assert_eq!((grid.len(), grid.points().len()), (3, 10), "{name}: the shell is gone");
        assert_eq!(grid.points()[8], Point::new(1.0, 1.0, 4.0), "{name}: the apex");
        let [first, second] = grid.steps() else { panic!("{name}: steps") };
        assert_eq!((first.time, second.time), (0.5, 1.5), "{name}: times");
        let fields = second.point_fields.iter().map(|field| (field.name(), field.components()));
        assert_eq!(fields.collect::<Vec<_>>(), [("disp", 3), ("T", 1)], "{name}: three became a vector");
        let disp = &second.point_fields[0];
        assert_eq!([0, 1, 2].map(|part| disp.value(9, part)), [109.0, 118.0, 127.0], "{name}: last node");
        assert_eq!(second.point_fields[1].value(2, 0), 108.0, "{name}: T");
        let stress = second.field(Place::Cells, "stress").expect("stress");
        assert!(stress.value(0, 0).is_nan(), "{name}: block 1 has no stress");
        assert_eq!([stress.value(1, 0), stress.value(2, 0)], [2.0, -2.0], "{name}: block 2 has");
        assert_eq!(grid.range(Place::Cells, "ObjectId", 0), Some([10.0, 20.0]), "{name}: ids of blocks");
        let codes = item.notes.iter().map(|note| note.code).collect::<Vec<_>>();
        assert_eq!(codes, ["cells.dropped", "cells.linearised", "cells.not-finite"], "{name}: told");
    }
}

#[test]
fn nodes_that_are_not_there_are_told() {
    let mut file = GOLDEN[0].1.to_vec();
    let hexahedron: Vec<u8> = (1_i32..=8).flat_map(i32::to_be_bytes).collect();
    let at = file.windows(32).position(|part| part == hexahedron).expect("the block");
    for wrong in [0_i32, -3, 11] {
        file[at..at + 4].copy_from_slice(&wrong.to_be_bytes());
        let Err(Fault::Broken(fault)) = loaded(&file) else { panic!("accepted") };
        assert!(fault.contains(&format!("names node {wrong}, but there are only 10")), "{fault}");
    }
}

#[test]
fn times_that_lie_past_the_end_are_told() {
    let mut file = GOLDEN[0].1.to_vec();
    file[4..8].copy_from_slice(&4_000_000_000_u32.to_be_bytes());
    let Err(Fault::Broken(fault)) = loaded(&file) else { panic!("accepted") };
    assert!(fault.contains("step 2 of \"time_whole\" lies past the end"), "{fault}");
    // A file that was never closed says that its end is not known.
    file[4..8].copy_from_slice(&u32::MAX.to_be_bytes());
    assert_eq!(grid(&loaded(&file).expect("found by length")).steps().len(), 2, "as many as there are");
}

#[test]
fn a_file_on_hdf5_says_how_to_convert_it() {
    let Err(Fault::Unsupported(_, remedy)) = loaded(b"\x89HDF\r\n\x1a\n") else { panic!("accepted") };
    assert!(remedy.contains("nccopy"), "{remedy}");
}

#[test]
fn only_three_names_in_a_row_become_a_vector() {
    assert_eq!(vector_name("VX", "VY", "VZ"), Some("V"), "as VTK does");
    assert_eq!(vector_name("disp_x", "disp_y", "disp_z"), Some("disp"), "without the stroke");
    assert_eq!(vector_name("SXX", "SXY", "SXZ"), None, "a row of a tensor");
    assert_eq!(vector_name("X", "Y", "Z"), None, "no name is left");
    assert_eq!(vector_name("VX", "VZ", "VY"), None, "another order");
}

#[test]
fn the_disk_has_the_facts_that_vtk_reads() {
    let Some(path) = sample("grid/disk_out_ref.ex2") else { return };
    let items = read(&path, &Limits::default(), &Silent).expect("the disk");
    let grid = grid(&items[0]);
    assert_eq!(
        (grid.points().len(), grid.len(), grid.count(CellKind::Hexahedron)),
        (8499, 7472, 7472),
        "sizes"
    );
    let [low, high] = grid.bounds();
    assert_eq!(low, Point::new(-5.75, -5.75, -10.0), "low");
    assert!((high - Point::new(5.75, 5.75, 10.16)).norm() < 1e-6, "{high}");
    assert_eq!((grid.steps().len(), grid.steps()[0].time), (1, 0.0), "one time");
    for (name, component, low, high) in [
        ("Temp", 0, 293.149_993_896_484_4, 913.150_024_414_062_5),
        ("V", 0, -19.949_113_845_825_195, 19.949_113_845_825_195),
        ("V", 2, -21.125_976_562_5, 6.711_901_187_896_728_5),
        ("Pres", 0, 0.006_785_521_749_407_053, 0.028_818_512_335_419_655),
        ("AsH3", 0, 0.080_476_820_468_902_59, 0.184_839_472_174_644_47),
        ("GaMe3", 0, 0.000_222_844_362_724_572_42, 0.007_213_925_942_778_587),
        ("CH4", 0, 0.0, 0.001_170_239_178_463_816_6),
        ("H2", 0, 0.807_613_134_384_155_3, 0.917_687_892_913_818_4),
    ] {
        assert_eq!(grid.range(Place::Points, name, component), Some([low, high]), "{name} {component}");
    }
    assert_eq!(grid.range(Place::Cells, "ObjectId", 0), Some([1.0, 1.0]), "one block");
}

#[test]
fn the_cut_disk_is_refused() {
    let Some(path) = sample("bad/exodus_truncated.ex2") else { return };
    let Err(error) = read(&path, &Limits::default(), &Silent) else { panic!("accepted") };
    assert!(error.to_string().contains("past the end of the file"), "{error}");
}

#[test]
fn no_byte_makes_it_panic() {
    for (_, file) in GOLDEN {
        survives(file, loaded);
    }
}
