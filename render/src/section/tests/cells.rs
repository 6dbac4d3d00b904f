//! Grids in sections against every tetrahedron asked at every pixel, and against closed forms.

use super::*;
use crate::reference::tetrahedra;
use crate::scene::CellItem;
use crate::volume::cells::{CellGrid, CellKind, Field, Part, Place, Scalar, Step, Values};
use crate::volume::{ControlPoint, Transfer};

/// Numbers from 0 to 1 without order.
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector(&mut self) -> Vector {
        Vector::from_fn(|_, _| self.next() - 0.5)
    }
}

/// Cubes from 0 to `n` along each axis, as hexahedra or as any kinds; inner points are moved by up to `shake`. Scalars of
/// points and of cells are both called "s".
fn cubes(
    n: usize,
    shake: f64,
    only: Option<CellKind>,
    seed: u64,
    scalar: impl Fn(&Point) -> f64,
) -> CellGrid {
    let mut dice = Dice(seed);
    let side = n + 1;
    let points: Vec<Point> = (0..side * side * side)
        .map(|i| {
            let at = [i % side, i / side % side, i / (side * side)];
            Point::from(at.map(|v| {
                let by = (dice.next() - 0.5) * 2.0 * shake;
                if v == 0 || v == n { v as f64 } else { v as f64 + by }
            }))
        })
        .collect();
    let number = |x: usize, y: usize, z: usize| (x + side * (y + side * z)) as u32;
    let (mut kinds, mut corners) = (Vec::new(), Vec::new());
    for i in 0..n * n * n {
        let [x, y, z] = [i % n, i / n % n, i / (n * n)];
        let [a, b, c, d] = [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]].map(|[x, y]| number(x, y, z));
        let [e, f, g, h] = [a, b, c, d].map(|corner| corner + number(0, 0, 1));
        match only.unwrap_or(CellKind::ALL[(dice.next() * 4.0) as usize]) {
            CellKind::Hexahedron => {
                kinds.push(CellKind::Hexahedron);
                corners.extend([a, b, c, d, e, f, g, h]);
            }
            CellKind::Wedge => {
                kinds.extend([CellKind::Wedge; 2]);
                corners.extend([a, b, c, e, f, g, a, c, d, e, g, h]);
            }
            CellKind::Pyramid => {
                kinds.push(CellKind::Pyramid);
                corners.extend([a, b, c, d, g]);
            }
            CellKind::Tetra => {
                kinds.push(CellKind::Tetra);
                corners.extend([a, b, d, e]);
            }
        }
    }
    let values = points.iter().map(scalar).collect();
    let of_cells = (0..kinds.len()).map(|i| i as f64).collect();
    let field = |values| vec![Field::new("s".to_owned(), 1, Values::F64(values))];
    let steps = vec![Step { time: 0.0, point_fields: field(values), cell_fields: field(of_cells) }];
    CellGrid::new(points, kinds, corners, steps).expect("a grid")
}

fn item(grid: CellGrid, place: Place, pose: Affine) -> CellItem {
    let point = |value, a| ControlPoint { value, rgba: [1.0, 0.0, 0.0, a] };
    let transfer = Transfer::new(vec![point(0.0, 0.0), point(0.0, 0.5)], 1.0).expect("a function");
    let scalar = Scalar { place, name: "s".to_owned(), part: Part::Component(0) };
    CellItem { grid: Arc::new(grid), step: 0, scalar, pose, transfer: Arc::new(transfer) }
}

/// Every tetrahedron that a world place may be in, by its least weight, with the scalar there.
fn at_place(item: &CellItem, p: &Point) -> Vec<(f64, f64)> {
    let field = item.scalar.field(&item.grid.steps()[0]).expect("the field");
    let mut found = Vec::new();
    for cell in 0..item.grid.len() {
        let (kind, corners) = item.grid.cell(cell);
        for numbers in tetrahedra(kind, corners) {
            let corner = numbers.map(|n| item.pose.point(&item.grid.points()[n as usize]));
            let volume = |c: [Point; 4]| (c[1] - c[0]).cross(&(c[2] - c[0])).dot(&(c[3] - c[0]));
            let whole = volume(corner);
            if whole == 0.0 {
                continue;
            }
            // Of each corner: the volume with the place in its stead.
            let weights: [f64; 4] = std::array::from_fn(|k| {
                let mut with = corner;
                with[k] = *p;
                volume(with) / whole
            });
            let value = match item.scalar.place {
                Place::Points => {
                    numbers.iter().zip(weights).map(|(&n, w)| w * field.value(n as usize, 0)).sum()
                }
                Place::Cells => field.value(cell, 0),
            };
            found.push((weights.into_iter().fold(f64::INFINITY, f64::min), value));
        }
    }
    found
}

fn places(section: &Section) -> Vec<Point> {
    let [width, height] = section.size();
    let at = |i: usize| section.point((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
    (0..width * height).map(at).collect()
}

#[test]
fn each_pixel_has_the_scalar_of_the_cell_that_it_lies_in() {
    let mut dice = Dice(5);
    let mut seen = 0;
    for turn in 0..24 {
        let shake = if turn % 2 == 0 { 0.25 } else { 0.0 };
        let wild = |p: &Point| (p.x * 12.9 + p.y * 78.2 + p.z * 37.7).sin() * 10.0;
        // The last kind is all of them, whose faces do not fit together: some places have no cell, some have two.
        let only = CellKind::ALL.get(turn % 5).copied();
        let grid = cubes(3, shake, only, turn as u64, wild);
        let scale = Affine::from_columns(
            Vector::x() * 2.5,
            Vector::y() * 2.5,
            Vector::z() * 2.5,
            Point::new(40.0, -7.0, 300.0),
        );
        let turned = Affine::rotation_about(Point::new(1.0, 2.0, 3.0), dice.vector(), 2.0 * dice.next());
        let place = if turn % 3 == 0 { Place::Cells } else { Place::Points };
        let item = item(grid, place, turned * scale.expect("a scale"));
        let middle = item.pose.point(&Point::new(1.5, 1.5, 1.5)) + dice.vector() * 2.0;
        let section = Section::new(middle, dice.vector(), dice.vector(), 0.45, [26, 19]).expect("a section");
        for (value, p) in cell_values(&section, &item).into_iter().zip(places(&section)) {
            let known = at_place(&item, &p);
            let near = |(_, known): &(f64, f64)| (known - value).abs() < 1e-6;
            let within = |least: f64| known.iter().filter(move |(weight, _)| *weight >= least);
            if value.is_nan() {
                assert_eq!(within(1e-6).count(), 0, "{turn}: a cell is passed over at {p}");
            } else {
                assert!(within(-1e-6).any(near), "{turn}: {value} at {p}, not one of {known:?}");
                seen += 1;
            }
            let asked = cell_value(&item, &p);
            assert!(
                asked.map_or(value.is_nan() || within(1e-6).count() == 0, |v| near(&(0.0, v))
                    || within(1e-6).count() != 1),
                "{turn}: {asked:?} asked at {p}, drawn {value}"
            );
        }
    }
    assert!(seen > 3000, "the sections must pass through the cells: {seen}");
}

#[test]
fn no_pixel_is_missed_on_faces_and_edges_and_in_a_plane_through_corners() {
    let linear = |p: &Point| 3.0 * p.x - 2.0 * p.y + 0.5 * p.z;
    // Pixel centres on corners, on edges and between; the planes through corners, and between them.
    for (depth, mm) in [(1.0, 0.5), (0.0, 0.1), (3.0, 1.0 / 3.0), (1.5, 0.7), (2.0, 0.3)] {
        for only in [CellKind::Hexahedron, CellKind::Wedge] {
            let item = item(cubes(3, 0.0, Some(only), 1, linear), Place::Points, Affine::identity());
            let n = (2.8 / mm) as usize | 1;
            let section = Section::new(Point::new(1.5, 1.5, depth), Vector::x(), Vector::y(), mm, [n, n]);
            let section = section.expect("a section");
            for (value, p) in cell_values(&section, &item).into_iter().zip(places(&section)) {
                assert!((value - linear(&p)).abs() < 1e-9, "{value} is not that of {p}");
            }
        }
    }
}

#[test]
fn beside_the_cells_and_where_a_scalar_is_no_number_there_is_nothing() {
    let item_of = |scalar: fn(&Point) -> f64| {
        item(cubes(2, 0.0, Some(CellKind::Hexahedron), 1, scalar), Place::Points, Affine::identity())
    };
    let section = |z| {
        Section::new(Point::new(1.0, 1.0, z), Vector::x(), Vector::y(), 0.1, [40, 20]).expect("a section")
    };
    let count = |item: &CellItem, z| cell_values(&section(z), item).iter().filter(|v| v.is_finite()).count();
    let whole = item_of(|p| p.x);
    assert_eq!(count(&whole, 0.5), 20 * 20, "two by two millimetres");
    assert_eq!((count(&whole, -0.01), count(&whole, 2.01)), (0, 0), "before and behind");
    assert_eq!(cell_value(&whole, &Point::new(1.0, 2.1, 1.0)), None, "nothing beside it");
    let broken = item_of(|p| if p.x > 1.5 { f64::NAN } else { 7.0 });
    assert_eq!(count(&broken, 0.5), 10 * 20, "the half that has numbers");
    assert_eq!(cell_value(&broken, &Point::new(0.4, 0.3, 0.2)), Some(7.0), "there");
    assert_eq!(cell_value(&broken, &Point::new(1.4, 0.3, 0.2)), None, "and not there");
    let later = CellItem { step: 1, ..whole };
    assert_eq!(
        (count(&later, 0.5), cell_value(&later, &Point::new(0.4, 0.3, 0.2))),
        (0, None),
        "no such step"
    );
}

#[test]
fn sections_of_a_grid_are_the_same_by_any_number_of_threads() {
    let item = item(cubes(6, 0.2, None, 9, |p| p.coords.norm()), Place::Points, Affine::identity());
    let section =
        Section::new(Point::new(3.0, 3.1, 2.9), Vector::new(1.0, 0.2, 0.1), Vector::z(), 0.04, [300, 200]);
    let section = section.expect("a section");
    let by = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| cell_values(&section, &item)).into_iter().map(f64::to_bits).collect::<Vec<_>>()
    };
    assert!(by(1) == by(4), "bit for bit");
}

#[test]
fn a_grid_is_one_more_layer_in_its_own_colours_where_it_is_not_clear() {
    // Clear below 0, red above; over a white volume that reaches farther to the right.
    let cells = cubes(2, 0.0, Some(CellKind::Hexahedron), 1, |p| p.x - 1.0);
    let item = item(cells, Place::Points, Affine::identity());
    let white = Grid::new([4, 3, 3], Samples::F64(vec![1000.0; 36]), Rescale::default(), Affine::identity());
    let volume = layer(Arc::new(white.expect("grid")), vec![Piece::whole()]);
    let section =
        Section::new(Point::new(2.0, 1.0, 1.0), Vector::x(), Vector::y(), 0.5, [8, 1]).expect("a section");
    let pixel = |bytes: &[u8], i: usize| [bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2]];
    let grids = std::slice::from_ref(&item);
    let alone = picture(&section, &[], grids, [0.0, 0.0, 1.0]);
    assert_eq!(pixel(&alone, 1), [0, 0, 255], "clear cells show the background");
    assert_eq!(pixel(&alone, 2), [255, 0, 0], "whole, however little of the light it stops");
    assert_eq!(pixel(&alone, 4), [0, 0, 255], "beside the cells");
    let both = picture(&section, std::slice::from_ref(&volume), grids, [0.0, 0.0, 1.0]);
    assert_eq!(pixel(&both, 1), [255, 255, 255], "the volume through clear cells");
    assert_eq!(pixel(&both, 2), [255, 128, 128], "half each");
    assert_eq!(pixel(&both, 5), [255, 255, 255], "the volume alone");
    let thick = section.with_slab(Slab { thickness_mm: 9.0, mode: SlabMode::Mip }).expect("a slab");
    assert_eq!(picture(&thick, &[], grids, [0.0, 0.0, 1.0]), alone, "of a thick section the middle plane");
}

#[test]
fn the_stretches_of_a_ray_add_up_to_its_chord_and_carry_the_scalar() {
    let linear = |p: &Point| 3.0 * p.x - 2.0 * p.y + 0.5 * p.z;
    let mut dice = Dice(3);
    for only in [CellKind::Hexahedron, CellKind::Wedge] {
        // Twice as large, and 10 mm to the left.
        let columns = [Vector::x() * 2.0, Vector::y() * 2.0, Vector::z() * 2.0];
        let pose = Affine::from_columns(columns[0], columns[1], columns[2], Point::new(10.0, 0.0, 0.0));
        let item = item(cubes(3, 0.2, Some(only), 4, linear), Place::Points, pose.expect("a pose"));
        for _ in 0..200 {
            let through = Point::new(13.0, 3.0, 3.0) + dice.vector() * 5.0;
            let direction = dice.vector().try_normalize(1e-3).unwrap_or_else(Vector::x);
            let origin = through - direction * 20.0;
            // The chord of the box that all cells make.
            let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
            for (axis, [low, high]) in [[10.0, 16.0], [0.0, 6.0], [0.0, 6.0]].into_iter().enumerate() {
                let (a, b) =
                    ((low - origin[axis]) / direction[axis], (high - origin[axis]) / direction[axis]);
                (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
            }
            let spans = cell_spans(&item, &origin, &direction);
            let length: f64 = spans.iter().map(|s| s.reach[1] - s.reach[0]).sum();
            assert!((length - (to - from)).abs() < 1e-9, "{only:?}: {length} of {}", to - from);
            for span in &spans {
                let middle = 0.5 * (span.reach[0] + span.reach[1]);
                let own = item.pose.inverse().point(&(origin + direction * middle));
                assert!(
                    (cell_value(&item, &(origin + direction * middle)).expect("within") - span.value(middle))
                        .abs()
                        < 1e-9,
                    "{own}"
                );
            }
            let behind = cell_spans(&item, &(through + direction * 20.0), &direction);
            assert_eq!(behind, [], "nothing behind its start");
        }
    }
}
