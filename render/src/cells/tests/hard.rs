//! Bad cells, bad values, bad questions.

use super::*;

const SIZE: [u32; 2] = [40, 36];

fn camera() -> Camera {
    looks([7.0, -5.0, 5.0], [1.5; 3], Projection::Perspective { fov_rad: 0.6 })
}

#[test]
fn cells_that_are_turned_round_are_drawn_as_others_and_counted() {
    let mesh = lattice(3, 0.3, 1);
    let turned: Mesh = (
        mesh.0.clone(),
        mesh.1
            .iter()
            .enumerate()
            .map(|(i, c)| if i % 5 == 0 { [c[1], c[0], c[2], c[3]] } else { *c })
            .collect(),
    );
    let scalar = |_: usize, p: &Point| (p.x * 1.1 + p.z).sin().abs();
    let [plain, mixed] = [&mesh, &turned]
        .map(|m| draw(&item(&grid(m, scalar), varied(0.5)), &camera(), SIZE, &Options::default()));
    assert!(plain.image == mixed.image, "the same picture");
    // Three of the six walks along the axes go round the other way.
    let [a, b] = [plain, mixed].map(|p| p.stats.faults.inverted as i64);
    assert_eq!(a, 3 * 27, "half of the lattice's own");
    assert!(a != b, "each that is turned is counted: {a} and {b}");
}

#[test]
fn cells_without_volume_are_left_out_and_counted() {
    let (mut points, mut cells) = lattice(3, 0.3, 2);
    let scalar = |_: usize, p: &Point| (p.x + p.y).cos().abs();
    let known = draw(
        &item(&grid(&(points.clone(), cells.clone()), scalar), varied(0.5)),
        &camera(),
        SIZE,
        &Options::default(),
    );
    let first = points.len() as u32;
    points.extend([[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0], [1.0, 1.0, 5.0]].map(Point::from));
    cells.push([first, first + 1, first + 2, first + 3]);
    cells.push([0, 1, 1, 5]);
    cells.push([first; 4]);
    let picture =
        draw(&item(&grid(&(points, cells), scalar), varied(0.5)), &camera(), SIZE, &Options::default());
    assert_eq!(picture.stats.faults.flat, 3, "counted");
    let off = picture.image.difference(&known.image, [0.0; 3]).expect("same size").max;
    assert!(off < 1e-3, "the same picture: {off}");
}

#[test]
fn slivers_are_those_of_the_reference() {
    // Layers of cells down to a thousandth of a millionth thick, with points that nearly lie on lines.
    for thin in [1e-3, 1e-6, 1e-9] {
        let mesh = lattice(3, 0.0, 0);
        let squeeze = |v: f64| {
            if v == 1.0 {
                1.5 - thin
            } else if v == 2.0 {
                1.5 + thin
            } else {
                v
            }
        };
        let points: Vec<Point> = mesh.0.iter().map(|p| Point::new(p.x, squeeze(p.y), squeeze(p.z))).collect();
        let grid = grid(&(points, mesh.1), |i, _| (i as f64 * 0.37).fract());
        let item = item(&grid, varied(0.6));
        for eye in [[7.0, -5.0, 5.0], [1.3, -6.0, 1.5]] {
            let camera = looks(eye, [1.5; 3], Projection::Perspective { fov_rad: 0.6 });
            let picture = draw(&item, &camera, SIZE, &Options::default());
            let (off, shown) = off(&item, &camera, SIZE, 2, &picture);
            assert!(shown > 100 && off < 0.5, "{thin}: {shown} pixels, off by {off} of 1/255");
        }
    }
}

#[test]
fn values_that_are_no_numbers_leave_holes() {
    let mesh = lattice(3, 0.2, 3);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let grid = grid(&mesh, |i, p| if i == 21 { bad } else { (p.x + p.z).sin().abs() });
        let item = item(&grid, varied(0.6));
        let picture = draw(&item, &camera(), SIZE, &Options::default());
        let touched = mesh.1.iter().filter(|c| c.contains(&21)).count() as u64;
        assert_eq!(picture.stats.total.not_finite, touched, "counted");
        let (off, shown) = off(&item, &camera(), SIZE, 2, &picture);
        assert!(shown > 100 && off < 0.5, "{bad}: {shown} pixels, off by {off} of 1/255");
    }
    let all = item(&grid(&mesh, |_, _| f64::NAN), varied(0.6));
    let picture = draw(&all, &camera(), SIZE, &Options::default());
    assert!(picture.image.pixels.iter().all(|p| *p == [0.0; 4]), "nothing is left");
}

#[test]
fn places_and_values_at_the_end_of_numbers_are_survived() {
    let mesh = lattice(2, 0.2, 4);
    for size in [1e-200, 1e-30, 1e12, 1e29] {
        let points = mesh.0.iter().map(|p| p * size).collect();
        let grid = grid(&(points, mesh.1.clone()), |i, _| if i % 2 == 0 { -size } else { size });
        let spread = transfer(&[[-size, 1.0, 0.0, 0.0, 0.1], [size, 0.0, 1.0, 0.0, 0.9]], 1.0);
        for projection in [Projection::Perspective { fov_rad: 2.0 }, Projection::Parallel { height_mm: 3.0 }]
        {
            let camera = looks([0.7, 0.6, -0.5], [0.6, 0.5, 0.4], projection);
            let picture = draw(&item(&grid, spread.clone()), &camera, SIZE, &Options::default());
            let sound = |p: &[f32; 4]| p.iter().all(|c| (0.0..=1.0001).contains(c));
            assert!(picture.image.pixels.iter().all(sound), "{size}, {projection:?}: colours are colours");
        }
    }
}

#[test]
fn what_lies_behind_or_beside_costs_nothing() {
    let grid = grid(&lattice(4, 0.2, 5), |_, p| p.x / 4.0);
    let item = item(&grid, varied(0.5));
    for target in [[20.0, -5.0, 5.0], [7.0, -15.0, 5.0]] {
        let camera = looks([7.0, -5.0, 5.0], target, Projection::Perspective { fov_rad: 0.6 });
        let picture = draw(&item, &camera, SIZE, &Options::default());
        assert_eq!(picture.stats.total.outside, picture.stats.tetrahedra, "all are outside");
        assert!(picture.image.pixels.iter().all(|p| *p == [0.0; 4]), "nothing is seen");
    }
}

#[test]
fn many_cells_in_one_place_are_survived() {
    let (points, cells) = lattice(1, 0.0, 0);
    let many = (points, cells.iter().cycle().take(6 * 300).copied().collect());
    let grid = grid(&many, |i, _| i as f64 / 8.0);
    let item = item(&grid, varied(0.01));
    let camera = looks([3.0, -2.0, 2.0], [0.5; 3], Projection::Perspective { fov_rad: 0.6 });
    let picture = draw(&item, &camera, SIZE, &Options::default());
    assert!(picture.stats.total.overlaps > 100, "they overlap");
    assert!(picture.image.pixels.iter().any(|p| p[3] > 0.5), "and add up");
}

#[test]
fn what_cannot_be_drawn_is_said() {
    let grid = grid(&lattice(2, 0.2, 6), |_, p| p.x);
    let item = item(&grid, varied(0.5));
    let options = Options::default();
    let mut renderer = CellRenderer::new();
    let mut draw = |item: &CellItem, camera: &Camera, size, options: &Options| {
        renderer.render(item, camera, size, options, &|_, _| true).map(|p| p.stats.tetrahedra)
    };
    let camera = camera();
    assert_eq!(draw(&item, &camera, SIZE, &options), Ok(48), "as it is");
    assert_eq!(
        draw(&item, &camera, [0, 9], &options),
        Err(CellsError::Size { width: 0, height: 9 }),
        "no pixel"
    );
    let large = Err(CellsError::Size { width: 1 << 15, height: 1 << 15 });
    assert_eq!(draw(&item, &camera, [1 << 15; 2], &options), large, "too many pixels");
    let long = Err(CellsError::Size { width: MAX_SIDE + 1, height: 1 });
    assert_eq!(draw(&item, &camera, [MAX_SIDE + 1, 1], &options), long, "too long a side");
    let blind = Camera { target: camera.eye, ..camera };
    assert_eq!(
        draw(&item, &blind, SIZE, &options),
        Err(CellsError::Camera(CameraError::NoDirection)),
        "no view"
    );
    let late = CellItem { step: 1, ..item.clone() };
    assert_eq!(
        draw(&late, &camera, SIZE, &options),
        Err(CellsError::Step { step: 1, count: 1 }),
        "no such step"
    );
    for scalar in [
        Scalar { name: "t".to_owned(), ..on(Place::Points) },
        on(Place::Cells),
        Scalar { part: Part::Component(1), ..on(Place::Points) },
    ] {
        let name = scalar.name.clone();
        let other = CellItem { scalar, ..item.clone() };
        assert_eq!(draw(&other, &camera, SIZE, &options), Err(CellsError::Field { name }), "no such field");
    }
    for workers in [0, MAX_WORKERS + 1] {
        let options = Options { workers: Some(workers), ..options };
        assert_eq!(draw(&item, &camera, SIZE, &options), Err(CellsError::Workers), "{workers} workers");
    }
    for early in [
        Early { threshold: 1.0, ..Early::default() },
        Early { threshold: f64::NAN, ..Early::default() },
        Early { refreshes: 0, ..Early::default() },
        Early { subscreens: Some(0), ..Early::default() },
    ] {
        let options = Options { early: Some(early), ..options };
        assert_eq!(draw(&item, &camera, SIZE, &options), Err(CellsError::Early), "{early:?}");
    }
}

#[test]
fn drawing_stops_when_told_to() {
    let grid = grid(&lattice(10, 0.2, 6), |_, p| p.x / 10.0);
    let item = item(&grid, varied(0.5));
    for engine in [Engine::Blocks, Engine::Threads, Engine::Simulated] {
        let options = Options { engine, workers: Some(3), ..Options::default() };
        let camera = looks([20.0, -15.0, 15.0], [5.0; 3], Projection::Perspective { fov_rad: 0.6 });
        let stopped = CellRenderer::new().render(&item, &camera, SIZE, &options, &|done, _| done < 2);
        assert_eq!(stopped, Err(CellsError::Cancelled), "{engine:?}");
    }
}
