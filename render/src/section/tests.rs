//! Sections against closed forms.

mod cells;
mod lines;
mod slabs;

use std::sync::Arc;

use super::*;
use crate::scene::Piece;
use crate::volume::{Affine, Cutter, Grid, Rescale, Samples, Side, TriangleMesh};

/// 9 × 8 × 7 samples of a linear field (so that interpolation has a closed form), turned and moved.
fn linear_grid() -> (Arc<Grid>, impl Fn(&Point) -> f64) {
    let turn = Affine::rotation_about(Point::new(5.0, 5.0, 5.0), Vector::new(1.0, 2.0, 3.0), 0.4);
    let scale = Affine::from_columns(
        Vector::new(2.0, 0.0, 0.0),
        Vector::new(0.0, 1.5, 0.0),
        Vector::new(0.0, 0.0, 3.0),
        Point::new(-7.0, 4.0, 11.0),
    )
    .expect("columns");
    let world_from_voxel = turn * scale;
    let field = |p: &Point| 3.0 * p.x - 2.0 * p.y + 0.5 * p.z + 10.0;
    let mut samples = Vec::new();
    for z in 0..7 {
        for y in 0..8 {
            for x in 0..9 {
                let at = Point::new(f64::from(x), f64::from(y), f64::from(z));
                samples.push(field(&world_from_voxel.point(&at)));
            }
        }
    }
    let grid = Grid::new([9, 8, 7], Samples::F64(samples), Rescale::default(), world_from_voxel);
    (Arc::new(grid.expect("grid")), field)
}

fn layer(grid: Arc<Grid>, pieces: Vec<Piece>) -> Layer {
    let window = Window { level: 0.0, width: 100.0 };
    Layer { grid, pose: Affine::identity(), pieces, window, color: [1.0; 3], weight: 1.0, labels: None }
}

fn through(grid: &Grid, size: [usize; 2]) -> Section {
    let middle = grid.world_from_voxel().point(&Point::new(4.0, 3.5, 3.0));
    Section::new(middle, Vector::new(1.0, 0.2, 0.0), Vector::new(0.0, 0.3, -1.0), 0.7, size).expect("section")
}

#[test]
fn a_section_of_a_linear_field_is_that_field() {
    let (grid, field) = linear_grid();
    let section = through(&grid, [31, 25]);
    let values = values(&section, &layer(grid.clone(), vec![Piece::whole()]));
    let mut seen = 0;
    for (index, value) in values.iter().enumerate() {
        let p = section.point((index % 31) as f64 + 0.5, (index / 31) as f64 + 0.5);
        let at = grid.world_from_voxel().inverse().point(&p);
        let inside = at.iter().zip(grid.extent()).all(|(&c, n)| c >= -0.5 && c <= n as f64 - 0.5);
        assert_eq!(value.is_finite(), inside, "there is a value exactly inside, pixel {index}");
        // In the outer half voxel the edge is held, so the closed form is for the inner part.
        if at.iter().zip(grid.extent()).all(|(&c, n)| c >= 0.0 && c <= n as f64 - 1.0) {
            seen += 1;
            assert!((value - field(&p)).abs() < 1e-9, "pixel {index}: {value} is not {}", field(&p));
        }
    }
    assert!(seen > 100, "the section must pass through the data, not beside it: {seen}");
}

#[test]
fn a_moved_fragment_is_shown_where_it_was_moved_to() {
    let (grid, field) = linear_grid();
    let section = through(&grid, [41, 41]);
    let plane = Cutter::plane(section.point(20.5, 20.5), Vector::new(1.0, 0.0, 0.0)).expect("plane");
    let shift = Vector::new(30.0, 2.0, 0.0);
    let pieces = vec![
        Piece { keep: vec![(plane, Side::Minus)], pose: Affine::identity() },
        Piece { keep: vec![(plane, Side::Plus)], pose: Affine::translation(shift) },
    ];
    let layer = layer(grid, pieces);
    let kept = section.point(18.5, 20.5);
    let went = section.point(22.5, 20.5);
    assert!(layer.value(&kept).is_some_and(|v| (v - field(&kept)).abs() < 1e-9), "the part that stayed");
    assert_eq!(layer.value(&went), None, "the place it left is empty");
    let value = layer.value(&(went + shift));
    assert!(value.is_some_and(|v| (v - field(&went)).abs() < 1e-9), "its values went with it");
}

#[test]
fn pixels_and_places_are_each_others_inverse() {
    let (grid, _) = linear_grid();
    let section = through(&grid, [30, 20]);
    let [x, y] = section.pixel(&section.point(3.25, 17.5));
    assert!((x - 3.25).abs() < 1e-9 && (y - 17.5).abs() < 1e-9, "there and back: {x} {y}");
    let step = (section.point(1.0, 0.0) - section.point(0.0, 0.0)).norm();
    let down = (section.point(0.0, 1.0) - section.point(0.0, 0.0)).norm();
    assert!((step - 0.7).abs() < 1e-12 && (down - 0.7).abs() < 1e-12, "square pixels: {step} {down}");
    assert!(section.right().dot(&section.down()).abs() < 1e-12, "at right angles");
}

#[test]
fn two_layers_blend_by_weight_and_one_alone_is_whole() {
    let flat = |value: f64, n: usize| {
        let grid = Grid::new([n, 1, 1], Samples::F64(vec![value; n]), Rescale::default(), Affine::identity());
        Arc::new(grid.expect("grid"))
    };
    let mut low = layer(flat(-50.0, 4), vec![Piece::whole()]);
    let high = layer(flat(50.0, 2), vec![Piece::whole()]);
    low.window = Window { level: 0.0, width: 200.0 };
    let section = Section::new(Point::new(1.5, 0.0, 0.0), Vector::x(), Vector::y(), 1.0, [6, 1]);
    let bytes = picture(&section.expect("section"), &[low, high], &[], [0.0, 0.0, 1.0]);
    let pixel = |i: usize| [bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]];
    assert_eq!(pixel(0), [0, 0, 255, 255], "background beside the data");
    // A quarter grey below, white above, half each: 0.625.
    assert_eq!(pixel(1), [159, 159, 159, 255], "blended where both are");
    assert_eq!(pixel(4), [64, 64, 64, 255], "one alone is shown whole");
}

#[test]
fn a_cube_is_outlined_by_its_square() {
    let corner = |i: usize| Point::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64);
    let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mesh = TriangleMesh::new((0..8).map(corner).collect(), triangles).expect("cube");
    let centre = Point::new(10.5, 0.5, 0.25);
    let section = Section::new(centre, Vector::x(), Vector::y(), 0.1, [40, 40]).expect("section");
    let pose = Affine::translation(Vector::new(10.0, 0.0, 0.0));
    let length: f64 = mesh_outline(&section, &mesh, &pose).iter().map(|[a, b]| (b - a).norm()).sum();
    assert!((length - 4.0).abs() < 1e-9, "the outline is as long as the square: {length}");
}

#[test]
fn numbers_that_make_no_section_are_refused() {
    let make = |right, mm, size| Section::new(Point::origin(), right, Vector::y(), mm, size);
    assert_eq!(make(Vector::y(), 1.0, [4, 4]), Err(SectionError::Flat), "parallel");
    assert_eq!(make(Vector::x(), 0.0, [4, 4]), Err(SectionError::NotFinite), "no scale");
    let huge = make(Vector::x(), 1.0, [usize::MAX, 2]);
    assert!(matches!(huge, Err(SectionError::Size { .. })), "product does not overflow");
}
