//! Cutters' lines where their pieces went to.

use super::*;

#[test]
fn a_cutters_line_moves_with_its_piece_and_ends_where_the_piece_does() {
    let grid =
        Grid::new([21, 21, 5], Samples::U8(vec![0; 21 * 21 * 5]), Rescale::default(), Affine::identity());
    let grid = grid.expect("grid");
    let up = Cutter::plane(Point::new(10.0, 10.0, 2.0), Vector::y()).expect("plane");
    let across = Cutter::plane(Point::new(10.0, 10.0, 2.0), Vector::x()).expect("plane");
    let away = Affine::rotation_about(Point::origin(), Vector::z(), 0.3)
        * Affine::translation(Vector::new(30.0, 5.0, 0.0));
    let piece = Piece { keep: vec![(up, Side::Plus), (across, Side::Minus)], pose: away };
    let section = Section::new(Point::new(30.0, 20.0, 2.0), Vector::x(), Vector::y(), 0.5, [200, 200]);
    let lines = piece_outlines(&section.expect("a section"), &grid, &Affine::identity(), &piece);
    assert_eq!(lines.len(), 2, "one line a cutter");
    for (line, [a, b]) in lines.iter().zip([
        // Along y = 10 from the box to the other cutter, and along x = 10 from this one to the box.
        [Point::new(-0.5, 10.0, 2.0), Point::new(10.0, 10.0, 2.0)],
        [Point::new(10.0, 10.0, 2.0), Point::new(10.0, 20.5, 2.0)],
    ]) {
        let ends = [away.point(&a), away.point(&b)];
        let (first, last) = (line.places[0], line.places[line.places.len() - 1]);
        let near = |p: Point, q: Point| (p - q).norm() < 1e-2;
        assert!(
            (near(first, ends[0]) && near(last, ends[1])) || (near(first, ends[1]) && near(last, ends[0])),
            "cutter {}: from {first} to {last}, not {ends:?}",
            line.cutter
        );
    }
}

#[test]
fn a_cylinder_bounds_its_piece_only_inside_the_volume() {
    let grid =
        Grid::new([21, 21, 5], Samples::U8(vec![0; 21 * 21 * 5]), Rescale::default(), Affine::identity());
    let grid = grid.expect("grid");
    let tube = Cutter::cylinder(Point::new(0.0, 10.0, 0.0), Vector::z(), 6.0).expect("tube");
    let piece = Piece { keep: vec![(tube, Side::Minus)], pose: Affine::identity() };
    let section = Section::new(Point::new(10.0, 10.0, 2.0), Vector::x(), Vector::y(), 0.1, [300, 300]);
    let lines = piece_outlines(&section.expect("a section"), &grid, &Affine::identity(), &piece);
    let length: f64 =
        lines.iter().flat_map(|l| l.places.windows(2)).map(|pair| (pair[1] - pair[0]).norm()).sum();
    // Its arc right of x = -0.5.
    let known = 2.0 * 6.0 * (-0.5_f64 / 6.0).acos();
    assert!((length - known).abs() < 0.02, "{length} mm is not {known}");
}
