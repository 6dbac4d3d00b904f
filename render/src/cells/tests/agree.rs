//! Pictures within 1/255 of the reference.

use super::*;

const SIZE: [u32; 2] = [48, 40];
const WIDE: Projection = Projection::Perspective { fov_rad: 1.2 };

fn cameras(n: f64) -> Vec<(&'static str, Camera)> {
    let middle = [n / 2.0; 3];
    vec![
        ("parallel", looks([n * 2.0, -n, n * 1.5], middle, Projection::Parallel { height_mm: n * 1.6 })),
        ("perspective", looks([n * 1.5, -n * 0.6, n], middle, Projection::Perspective { fov_rad: 0.9 })),
        ("eye inside", looks([n * 0.4, n * 0.55, n * 0.45], [n, n * 0.3, n * 0.6], WIDE)),
        ("eye plane inside", looks(middle, [n, n * 0.3, n * 0.6], Projection::Parallel { height_mm: n })),
        ("eye on a point", looks([n * 0.5, 0.0, n * 0.5], middle, WIDE)),
    ]
}

#[test]
fn random_meshes_from_anywhere_are_those_of_the_reference() {
    for (seed, strength) in [(1, 0.2), (2, 0.6), (3, 0.98)] {
        let mesh = lattice(4, 0.3, seed);
        let mut dice = Dice::new(seed + 10);
        let noise: Vec<f64> = mesh.0.iter().map(|_| dice.next()).collect();
        let grid = grid(&mesh, |i, _| noise[i]);
        let item = item(&grid, varied(strength));
        for (name, camera) in cameras(4.0) {
            let picture = draw(&item, &camera, SIZE, &Options::default());
            let (off, shown) = off(&item, &camera, SIZE, 3, &picture);
            assert!(shown > 100, "{name}: {shown} pixels show something");
            assert!(off < 0.5, "{name}, strength {strength}: off by {off} of 1/255");
            assert_eq!(picture.stats.total.overlaps, 0, "{name}: a sound grid has no overlap");
        }
    }
}

#[test]
fn few_large_cells_across_all_colours_are_those_of_the_reference() {
    let mesh = lattice(1, 0.0, 0);
    let mut dice = Dice::new(4);
    let noise: Vec<f64> = mesh.0.iter().map(|_| dice.next() * 1.6 - 0.3).collect();
    let grid = grid(&mesh, |i, _| noise[i]);
    for unit in [3.0, 0.3, 0.02] {
        let mut item = item(&grid, varied(0.9));
        let points = item.transfer.points().to_vec();
        item.transfer = Arc::new(Transfer::new(points, unit).expect("a function"));
        for (name, camera) in cameras(1.0) {
            let picture = draw(&item, &camera, SIZE, &Options::default());
            let (off, _) = off(&item, &camera, SIZE, 3, &picture);
            assert!(off < 0.5, "{name}, unit {unit}: off by {off} of 1/255");
        }
    }
}

/// Cells of all kinds in a row along x, with jittered inner points.
fn mixed(seed: u64) -> (Vec<Point>, Vec<CellKind>, Vec<u32>) {
    let mut dice = Dice::new(seed);
    let mut points = Vec::new();
    for x in 0..4 {
        for [y, z] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
            let by = [0; 3].map(|_| 0.1 * (dice.next() - 0.5));
            points.push(Point::new(f64::from(x) + by[0], y + by[1], z + by[2]));
        }
    }
    points.push(Point::new(4.0, 0.5, 0.5));
    // Numbers in another order, so that diagonals go either way.
    let count = points.len();
    let number = |i: usize| ((i * 7 + seed as usize) % count) as u32;
    let mut placed = vec![Point::origin(); count];
    for (i, p) in points.iter().enumerate() {
        placed[number(i) as usize] = *p;
    }
    let ring = |x: usize| [0, 1, 2, 3].map(|i| number(4 * x + i));
    let [a, b, c, d] = [0, 1, 2, 3].map(ring);
    let kinds =
        vec![CellKind::Hexahedron, CellKind::Wedge, CellKind::Wedge, CellKind::Hexahedron, CellKind::Pyramid];
    // Wedges with a whole side towards either hexahedron: the cube between is cut from an edge to the one across.
    let corners = [
        [a, b].concat(),
        vec![b[0], b[3], c[3], b[1], b[2], c[2]],
        vec![b[0], c[3], c[0], b[1], c[2], c[1]],
        [c, d].concat(),
        [&d[..], &[number(16)]].concat(),
    ];
    (placed, kinds, corners.concat())
}

#[test]
fn all_kinds_of_cells_and_both_places_of_fields_are_those_of_the_reference() {
    for seed in 0..6 {
        let (points, kinds, corners) = mixed(seed);
        let mut dice = Dice::new(seed + 20);
        let mut values = |n: usize| Values::F64((0..2 * n).map(|_| dice.next()).collect());
        let (at_points, at_cells) = (values(points.len()), values(kinds.len()));
        let step = Step {
            time: 0.0,
            point_fields: vec![Field::new("s".to_owned(), 2, at_points)],
            cell_fields: vec![Field::new("s".to_owned(), 2, at_cells)],
        };
        let grid = Arc::new(CellGrid::new(points, kinds, corners, vec![step]).expect("a grid"));
        let camera = looks([5.0, -4.0, 3.0], [2.0, 0.5, 0.5], Projection::Perspective { fov_rad: 0.7 });
        for place in [Place::Points, Place::Cells] {
            for part in [Part::Component(1), Part::Magnitude] {
                let mut item = item(&grid, varied(0.8));
                item.scalar = Scalar { part, ..on(place) };
                let picture = draw(&item, &camera, SIZE, &Options::default());
                let (off, shown) = off(&item, &camera, SIZE, 2, &picture);
                assert!(shown > 50, "{shown} pixels show something");
                assert!(off < 0.5, "seed {seed}, {place:?}, {part:?}: off by {off} of 1/255");
                assert_eq!(picture.stats.total.overlaps, 0, "faces of neighbours are cut alike");
                assert_eq!(picture.stats.faults, Faults::default(), "all cells are sound");
            }
        }
    }
}

#[test]
fn a_grid_that_is_moved_is_drawn_where_it_is() {
    let mesh = lattice(3, 0.2, 5);
    let grid = grid(&mesh, |_, p| (p.x + 0.7 * p.y - 0.4 * p.z).sin().abs());
    let mut item = item(&grid, varied(0.5));
    let turn = Affine::rotation_about(Point::new(1.0, 2.0, 3.0), Vector::new(1.0, -2.0, 0.5), 0.8);
    item.pose = Affine::translation(Vector::new(1e6, -1e6, 3e5)) * turn;
    let middle = item.pose.point(&Point::new(1.5, 1.5, 1.5));
    let eye = middle + Vector::new(-6.0, 5.0, 4.0);
    let projection = Projection::Perspective { fov_rad: 0.8 };
    let camera = looks(eye.coords.into(), middle.coords.into(), projection);
    let picture = draw(&item, &camera, SIZE, &Options::default());
    let (off, shown) = off(&item, &camera, SIZE, 2, &picture);
    assert!(shown > 100 && off < 0.5, "{shown} pixels, off by {off} of 1/255");
}

#[test]
fn cells_in_a_circle_before_each_other_are_those_of_the_reference() {
    // Three bars, each before the next in a corner of a triangle.
    let mut points = Vec::new();
    let mut cells = Vec::new();
    for turn in 0..3 {
        let angle = f64::from(turn) * std::f64::consts::TAU / 3.0;
        let (sin, cos) = angle.sin_cos();
        let place = |along: f64, side: f64, deep: f64| {
            let [x, y] = [along, 1.0 + side];
            Point::new(x * cos - y * sin, deep, x * sin + y * cos)
        };
        let first = points.len() as u32;
        points.extend([
            place(-3.0, 0.0, -1.0),
            place(3.0, -0.4, 0.8),
            place(3.0, 0.4, 0.9),
            place(3.0, 0.0, 1.4),
        ]);
        cells.push([first, first + 1, first + 2, first + 3]);
    }
    let grid = grid(&(points, cells), |i, _| (i as f64 * 0.37).fract());
    let item = item(&grid, varied(0.9));
    let camera = looks([0.0, -9.0, 0.1], [0.0; 3], Projection::Perspective { fov_rad: 0.8 });
    let picture = draw(&item, &camera, [64, 64], &Options::default());
    let (off, shown) = off(&item, &camera, [64, 64], 1, &picture);
    assert!(shown > 200 && off < 0.5, "{shown} pixels, off by {off} of 1/255");
}

#[test]
fn where_cells_overlap_extinctions_add_up() {
    let mesh = lattice(2, 0.0, 0);
    let moved: Vec<Point> = mesh.0.iter().map(|p| p + Vector::new(0.55, 0.4, 0.3)).collect();
    let shift = mesh.0.len() as u32;
    let cells = mesh.1.iter().copied().chain(mesh.1.iter().map(|c| c.map(|v| v + shift))).collect();
    let both = ([mesh.0, moved].concat(), cells);
    // Each of the two has one colour: what is merged is then the same all along.
    let grid = grid(&both, |i, _| if i < shift as usize { 0.0 } else { 1.0 });
    let item = item(&grid, transfer(&[[0.0, 1.0, 0.2, 0.0, 0.3], [1.0, 0.0, 0.3, 1.0, 0.6]], 1.0));
    let camera = looks([7.0, -5.0, 4.0], [1.2; 3], Projection::Perspective { fov_rad: 0.6 });
    let picture = draw(&item, &camera, SIZE, &Options::default());
    let (off, shown) = off(&item, &camera, SIZE, 1, &picture);
    assert!(picture.stats.total.overlaps > 100, "there are overlaps");
    assert!(shown > 100 && off < 0.1, "{shown} pixels, off by {off} of 1/255");
}
