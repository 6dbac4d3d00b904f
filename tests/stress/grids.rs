//! Unstructured grids, alone and among volumes and surfaces: by the processor, since the passes show none.

use std::sync::Arc;

use render::scene::CellItem;
use render::volume::cells::{CellKind, Field, Part, Place, Scalar, Step, Values};
use render::volume::{Affine, CellGrid, Point, Vector};

use super::cases::{self, Case, Contents};
use super::drawers;
use super::each;
use super::pictures::{SIZES, comes_right};
use super::random::Random;

/// A grid about the origin.
fn any(random: &mut Random, size: f64) -> CellItem {
    let side = 2 + random.below(2);
    let cell = size * random.power(-0.7, 0.0) / (side - 1) as f64;
    // Half of them on the lattice itself, where faces are seen edge-on and rays meet corners.
    let askew = if random.chance(0.5) { 0.25 * cell } else { 0.0 };
    let mut points = Vec::new();
    for i in 0..side * side * side {
        let at = [i % side, i / side % side, i / (side * side)].map(|n| n as f64 - (side - 1) as f64 / 2.0);
        points.push(Point::from(at) * cell + random.shift(askew));
    }
    let number = |x: usize, y: usize, z: usize| (x + side * (y + side * z)) as u32;
    let (mut kinds, mut corners) = (Vec::new(), Vec::new());
    let loose = random.chance(0.3);
    for i in 0..(side - 1).pow(3) {
        let n = side - 1;
        let [x, y, z] = [i % n, i / n % n, i / (n * n)];
        let [a, b, c, d] = [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]].map(|[x, y]| number(x, y, z));
        let [e, f, g, h] = [a, b, c, d].map(|corner| corner + number(0, 0, 1));
        if loose {
            // Of any points: such cells overlap, are turned round, or have no volume.
            kinds.push(CellKind::Tetra);
            corners.extend((0..4).map(|_| random.below(points.len()) as u32));
            continue;
        }
        match random.below(3) {
            0 => {
                kinds.extend([CellKind::Wedge; 2]);
                corners.extend([a, b, c, e, f, g, a, c, d, e, g, h]);
            }
            1 => {
                // Sound only where the faces beside it are cut alike: what is not is drawn twice or not at all.
                kinds.push(CellKind::Pyramid);
                corners.extend([a, b, c, d, g]);
            }
            _ => {
                kinds.push(CellKind::Hexahedron);
                corners.extend([a, b, c, d, e, f, g, h]);
            }
        }
    }
    let place = random.one(&[Place::Points, Place::Points, Place::Cells]);
    let count = if place == Place::Points { points.len() } else { kinds.len() };
    let mut values: Vec<f64> = (0..count).map(|_| random.between(-3.0, 5.0)).collect();
    if random.chance(0.2) {
        values[random.below(count)] = f64::NAN;
    }
    let field = vec![Field::new("s".to_owned(), 1, Values::F64(values))];
    let (point_fields, cell_fields) = if place == Place::Points { (field, vec![]) } else { (vec![], field) };
    let steps = vec![Step { time: 0.0, point_fields, cell_fields }];
    let pose = match random.below(3) {
        0 => Affine::identity(),
        1 => Affine::translation(random.shift(size * 0.3)),
        _ => random.turn(),
    };
    CellItem {
        grid: Arc::new(CellGrid::new(points, kinds, corners, steps).expect("a grid")),
        step: 0,
        scalar: Scalar { place, name: "s".to_owned(), part: Part::Component(0) },
        pose,
        transfer: Arc::new(cases::transfer(random, [-3.0, 5.0], size)),
    }
}

/// Refuses a picture by the processor that is off by more than `most`/255.
fn check(random: &mut Random, case: &Case, most: f64) -> Result<(), String> {
    let size = random.one(&SIZES);
    let fine = if case.scene.volumes.is_empty() { 0.25 } else { cases::fine(case) };
    comes_right(&drawers::processor(), case, size, fine, most)
}

#[test]
fn grids_of_any_kind_alone() {
    each("grids alone", 300, |random| {
        let mut case = cases::any(random, Contents { volumes: 1, cut: false, meshes: 0 });
        case.scene.volumes.clear();
        case.scene.grids = vec![any(random, case.size_mm)];
        check(random, &case, 1.0)
    });
}

#[test]
fn grids_with_surfaces_in_them_and_other_grids() {
    each("grids and surfaces", 200, |random| {
        let mut case = cases::any(random, Contents { volumes: 1, cut: false, meshes: 3 });
        case.scene.volumes.clear();
        case.scene.grids = (0..=random.below(2)).map(|_| any(random, case.size_mm)).collect();
        check(random, &case, 1.0)
    });
}

#[test]
fn grids_among_cut_volumes_and_surfaces() {
    each("grids and volumes", 150, |random| {
        let mut case = cases::any(random, Contents { volumes: 2, cut: true, meshes: 2 });
        case.scene.grids = (0..=random.below(2)).map(|_| any(random, case.size_mm)).collect();
        check(random, &case, 2.0)
    });
}

#[test]
fn a_grid_among_volumes_a_kilometre_away_is_the_same_picture() {
    each("grids far away", 60, |random| {
        let mut case = cases::any(random, Contents { volumes: 1, cut: true, meshes: 1 });
        case.scene.grids = vec![any(random, case.size_mm)];
        let far = Affine::translation(Vector::from_fn(|_, _| random.one(&[-1e6, 0.0, 1e6])));
        let case = Case { scene: cases::moved(&case.scene, &far), ..case };
        check(random, &case, 2.0)
    });
}
