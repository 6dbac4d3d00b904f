//! Unstructured grids through the program: drawn beside a volume, and broken in every way that there is.

use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

use crate::support::program::{run, run_within};

/// Most address space.
const MEMORY: u64 = 3 << 30;
/// Longest time, on a busy machine.
const TIME: Duration = Duration::from_mins(1);

const POINTS: [[f64; 3]; 6] =
    [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0], [10.0; 3], [5.0, 5.0, 0.0]];

/// A legacy VTK file of tetrahedra, with a field "p" of the points.
fn vtk(points: &[[f64; 3]], cells: &[&[i64]], kind: u8, values: &[f64]) -> String {
    let mut text = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n".to_owned();
    writeln!(text, "POINTS {} double", points.len()).unwrap();
    for [x, y, z] in points {
        writeln!(text, "{x:e} {y:e} {z:e}").unwrap();
    }
    writeln!(text, "CELLS {} {}", cells.len(), cells.iter().map(|c| c.len() + 1).sum::<usize>()).unwrap();
    for cell in cells {
        let corners: Vec<String> = cell.iter().map(i64::to_string).collect();
        writeln!(text, "{} {}", cell.len(), corners.join(" ")).unwrap();
    }
    writeln!(text, "CELL_TYPES {}", cells.len()).unwrap();
    for _ in cells {
        writeln!(text, "{kind}").unwrap();
    }
    if !values.is_empty() {
        writeln!(text, "POINT_DATA {}\nSCALARS p double 1\nLOOKUP_TABLE default", values.len()).unwrap();
        for v in values {
            writeln!(text, "{v:e}").unwrap();
        }
    }
    text.replace("NaN", "nan").replace("inf", "1e999")
}

const VALUES: [f64; 6] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
const GOOD: &[i64] = &[0, 1, 2, 3];

/// What is wrong in part loads, says so and is drawn; what is wrong as a whole is refused with the file's name.
#[test]
fn broken_grids_are_refused_or_loaded_with_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let nan = [f64::NAN, 1.0, 2.0, 3.0, 4.0, 5.0];
    let at = |scale: f64| POINTS.map(|p| p.map(|c| c * scale));
    let mut nowhere = POINTS;
    nowhere[0][1] = f64::NAN;
    let flat: &[i64] = &[0, 1, 2, 5];
    // The name, the file, and the note's code or a part of the complaint.
    let loads = [
        ("inverted", vtk(&POINTS, &[&[0, 2, 1, 3], GOOD], 10, &VALUES), "cells.inverted"),
        ("flat", vtk(&POINTS, &[flat, GOOD], 10, &VALUES), "cells.flat"),
        ("all_flat", vtk(&POINTS, &[flat], 10, &VALUES), "cells.flat"),
        ("repeated_corner", vtk(&POINTS, &[&[0, 1, 1, 3], GOOD], 10, &VALUES), "cells.flat"),
        ("nan", vtk(&POINTS, &[GOOD, &[1, 2, 3, 4]], 10, &nan), "cells.not-finite"),
        ("all_nan", vtk(&POINTS, &[GOOD], 10, &[f64::NAN; 6]), "cells.not-finite"),
        (
            "quadratic",
            vtk(&[[POINTS, POINTS].concat()].concat(), &[&[0, 1, 2, 3, 6, 7, 8, 9, 10, 11]], 24, &[]),
            "cells.linearised",
        ),
    ];
    for (name, text, code) in loads {
        let path = folder.path().join(format!("{name}.vtk"));
        std::fs::write(&path, text).unwrap();
        let info = run_within(&["info", path.to_str().unwrap(), "--json"], TIME, MEMORY).json();
        let notes = info["items"][0]["notes"].as_array().expect("notes").clone();
        assert!(notes.iter().any(|n| n["code"] == code), "{name}: {notes:?}");
        if name != "quadratic" {
            draw(&path, folder.path(), name);
        }
    }
    let refused = [
        ("no_field", vtk(&POINTS, &[GOOD], 10, &[]), "no field that could be shown"),
        ("nowhere", vtk(&nowhere, &[GOOD], 10, &VALUES), "point 0 has a coordinate that is not finite"),
        ("too_far", vtk(&at(1e200), &[GOOD], 10, &VALUES), "beyond"),
        ("past_the_end", vtk(&POINTS, &[&[0, 1, 2, 99]], 10, &VALUES), "point 99"),
        ("negative", vtk(&POINTS, &[&[0, 1, 2, -1]], 10, &VALUES), "point -1"),
        ("three_corners", vtk(&POINTS, &[&[0, 1, 2]], 10, &VALUES), "tetra of 3 corners"),
        ("other_kind", vtk(&POINTS, &[GOOD], 99, &VALUES), "tetrahedron, pyramid, wedge or hexahedron"),
        ("no_cell", vtk(&POINTS, &[], 10, &VALUES), "no cell"),
        ("short_field", vtk(&POINTS, &[GOOD], 10, &VALUES[..3]), "has 3 values"),
    ];
    for (name, text, part) in refused {
        let path = folder.path().join(format!("{name}.vtk"));
        std::fs::write(&path, text).unwrap();
        let out = folder.path().join("never.png");
        let outcome =
            run_within(&["render", path.to_str().unwrap(), "--out", out.to_str().unwrap()], TIME, MEMORY);
        assert_eq!(outcome.code(), 3, "{name}: {}{}", outcome.stdout, outcome.stderr);
        let sentence = outcome.sentence();
        assert!(sentence.contains(part) && sentence.contains(name), "{name}: {sentence}");
        assert!(!out.exists(), "{name}: no picture");
    }
}

/// Numbers at the edge, and cells that overlap, are drawn.
#[test]
fn odd_but_sound_grids_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let at = |scale: f64, off: f64| POINTS.map(|[x, y, z]| [x * scale + off, y * scale, z * scale]);
    for (name, text) in [
        ("constant", vtk(&POINTS, &[GOOD], 10, &[7.0; 6])),
        ("wide_range", vtk(&POINTS, &[GOOD], 10, &[1e300, -1e300, 0.0, 1.0, 2.0, 3.0])),
        ("small", vtk(&at(0.1, 0.0), &[GOOD], 10, &VALUES)),
        ("vast", vtk(&at(1e12, 0.0), &[GOOD], 10, &VALUES)),
        ("far", vtk(&at(1.0, 1e9), &[GOOD], 10, &VALUES)),
        ("overlapping", vtk(&POINTS, &[GOOD, &[0, 1, 2, 4], GOOD], 10, &VALUES)),
    ] {
        let path = folder.path().join(format!("{name}.vtk"));
        std::fs::write(&path, text).unwrap();
        let lit = draw(&path, folder.path(), name);
        assert!(lit > 100, "{name}: {lit} pixels show something");
    }
}

/// How many pixels of a file's picture show something.
fn draw(path: &Path, folder: &Path, name: &str) -> usize {
    let out = folder.join(format!("{name}.png"));
    let args = ["render", path.to_str().unwrap(), "--out", out.to_str().unwrap(), "--size", "64x64"];
    let outcome = run_within(&args, TIME, MEMORY);
    assert_eq!(outcome.code(), 0, "{name}: {}", outcome.stderr);
    let picture = image::open(&out).unwrap().to_rgb8();
    picture.pixels().filter(|p| p.0 != [0; 3]).count()
}

#[test]
fn a_case_draws_a_grid_as_it_says_and_refuses_a_field_that_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("g.vtk"), vtk(&POINTS, &[GOOD, &[1, 2, 3, 4]], 10, &VALUES)).unwrap();
    let case = |grid: &str| {
        let path = folder.path().join("case.json");
        let camera = r#"{"eye": [4, -60, 4], "target": [4, 0, 4]}"#;
        let text = format!(
            r#"{{"osteotome": 1, "grids": [{{"id": "g", "source": "g.vtk", {grid}}}], "camera": {camera}}}"#
        );
        std::fs::write(&path, text).unwrap();
        path
    };
    let transfer = r#""transfer": {"points": [[0, 1, 0, 0, 1], [5, 0, 0, 1, 1]], "unit_mm": 1}"#;
    let seen = |grid: &str| {
        let out = folder.path().join("out.png");
        let args =
            ["render", case(grid).to_str().unwrap(), "--out", out.to_str().unwrap(), "--size", "32x32"]
                .map(str::to_owned);
        let outcome = run(&args.each_ref().map(String::as_str), TIME);
        assert_eq!(outcome.code(), 0, "{grid}: {}", outcome.stderr);
        image::open(&out).unwrap().to_rgb8()
    };
    let plain = seen(&format!(r#""field": "p", {transfer}"#));
    assert_eq!(
        plain,
        seen(&format!(r#""field": {{"name": "p", "on": "points", "part": 0}}, {transfer}"#)),
        "in full"
    );
    assert_eq!(plain, seen(transfer), "the first field");
    let gone = seen(&format!(r#"{transfer}, "visible": false"#));
    assert!(gone.pixels().all(|p| p.0 == [0; 3]), "hidden");
    let large = seen(&format!(r#"{transfer}, "scale": 2, "pose": [1,0,0,-4, 0,1,0,0, 0,0,1,-4, 0,0,0,1]"#));
    let lit = |picture: &image::RgbImage| picture.pixels().filter(|p| p.0 != [0; 3]).count();
    assert!(lit(&large) > 3 * lit(&plain), "twice as large: {} and {}", lit(&large), lit(&plain));
    let out = folder.path().join("never.png");
    let path = case(r#""field": "q""#);
    let outcome = run(&["render", path.to_str().unwrap(), "--out", out.to_str().unwrap()], TIME);
    assert_eq!(outcome.code(), 3, "{}", outcome.stderr);
    let sentence = outcome.sentence();
    assert!(
        sentence.contains("\"q\"") && sentence.contains("\"p\"") && sentence.contains("g.vtk"),
        "{sentence}"
    );
}
