//! Thick sections against closed forms, and labels in sections.

use super::*;
use crate::scene::Labels;
use crate::volume::synth;

fn slab(section: Section, thickness_mm: f64, mode: SlabMode) -> Section {
    section.with_slab(Slab { thickness_mm, mode }).expect("a slab")
}

/// `field` at the middle of every pixel, moved by `offset_mm` along the normal.
fn known(section: &Section, field: impl Fn(&Point) -> f64, offset_mm: f64) -> Vec<f64> {
    let [width, height] = section.size();
    let at =
        |i: usize, j: usize| section.point(i as f64 + 0.5, j as f64 + 0.5) + section.forward() * offset_mm;
    (0..height).flat_map(|j| (0..width).map(move |i| (i, j))).map(|(i, j)| field(&at(i, j))).collect()
}

#[test]
fn the_mean_of_a_linear_field_is_its_middle_and_its_extremes_are_at_the_ends() {
    let (grid, field) = linear_grid();
    let oblique = through(&grid, [5, 4]);
    // Along the grid's second axis: the exact way.
    let linear = grid.world_from_voxel().linear();
    let [x, y, z] = [0, 1, 2].map(|c| linear.column(c).into_owned());
    let aligned = Section::new(oblique.centre(), x, z, 0.4, [5, 4]).expect("a section");
    assert!(aligned.forward().cross(&y).norm() < 1e-9, "across the second axis");
    let layer = layer(grid, vec![Piece::whole()]);
    for (section, name) in [(oblique, "oblique"), (aligned, "aligned")] {
        let slope = (field(&(section.centre() + section.forward())) - field(&section.centre())).abs();
        let middle = known(&section, &field, 0.0);
        let mean = values(&slab(section, 4.2, SlabMode::Mean), &layer);
        for (found, known) in mean.iter().zip(&middle) {
            assert!((found - known).abs() < 1e-9, "{name}: the mean {found} is not {known}");
        }
        // The ends are at 2.1 mm; evenly spread samples stop half a step, at most 0.375 mm, before.
        let short = if name == "aligned" { 1e-9 } else { 0.376 * slope };
        for (mode, sign) in [(SlabMode::Mip, 1.0), (SlabMode::MinIp, -1.0)] {
            for (found, middle) in values(&slab(section, 4.2, mode), &layer).iter().zip(&middle) {
                let end = middle + sign * 2.1 * slope;
                let inside = sign * (end - found);
                assert!((-1e-9..=short).contains(&inside), "{name} {mode:?}: {found} is not {end}");
            }
        }
    }
}

#[test]
fn the_mean_over_a_ball_is_its_chord() {
    // 1 inside and 0 outside a ball of 9 mm, soft over a voxel of a quarter millimetre.
    let (n, spacing, radius) = (96, 0.25, 9.0);
    let half = (n - 1) as f64 / 2.0 * spacing;
    let columns = Affine::from_columns(
        Vector::x() * spacing,
        Vector::y() * spacing,
        Vector::z() * spacing,
        Point::new(-half, -half, -half),
    );
    let ball = synth::from_places([n; 3], columns.expect("columns"), |p: &Point| {
        ((radius - p.coords.norm()) / spacing + 0.5).clamp(0.0, 1.0)
    });
    let layer = layer(Arc::new(ball.expect("a grid")), vec![Piece::whole()]);
    for (right, down) in
        [(Vector::x(), Vector::y()), (Vector::new(1.0, 0.3, -0.2), Vector::new(0.1, 1.0, 0.4))]
    {
        let section = Section::new(Point::origin(), right, down, 0.37, [21, 21]).expect("a section");
        let thickness = 20.0;
        let found = values(&slab(section, thickness, SlabMode::Mean), &layer);
        let chords =
            known(&section, |p| 2.0 * (radius * radius - p.coords.norm_squared()).max(0.0).sqrt(), 0.0);
        for (mean, chord) in found.iter().zip(&chords) {
            assert!((mean * thickness - chord).abs() < 0.02 * chord, "{} is not {chord}", mean * thickness);
        }
        let most = values(&slab(section, thickness, SlabMode::Mip), &layer);
        assert!(most.iter().all(|v| *v == 1.0), "the ball fills the picture");
    }
}

#[test]
fn no_voxel_of_the_slab_is_passed_over() {
    let mut samples = vec![0_i16; 20 * 20 * 20];
    for k in 0..20 {
        samples[(k * 7 % 20) + 20 * ((k * 3 % 20) + 20 * k)] = 100;
    }
    let grid = Grid::new([20; 3], Samples::I16(samples), Rescale::default(), Affine::identity());
    let layer = layer(Arc::new(grid.expect("grid")), vec![Piece::whole()]);
    let middle = Point::new(9.5, 9.5, 9.5);
    // Fine pixels: what is left of a voxel's 100 is lost between samples along the normal only.
    for (right, down, least) in
        [(Vector::x(), Vector::y(), 85.0), (Vector::new(1.0, 0.2, 0.1), Vector::new(-0.1, 1.0, 0.3), 50.0)]
    {
        let section = Section::new(middle, right, down, 0.1, [300, 300]).expect("a section");
        let found = values(&slab(section, 60.0, SlabMode::Mip), &layer);
        for k in 0..20 {
            let at = Point::new(f64::from(k * 7 % 20), f64::from(k * 3 % 20), f64::from(k));
            let [x, y] = section.pixel(&at);
            let value = found[x as usize + 300 * y as usize];
            assert!(value >= least, "voxel {k} shows {value}");
        }
    }
}

#[test]
fn a_slab_gathers_all_pieces_and_nothing_outside_them() {
    let (grid, field) = linear_grid();
    let section = slab(through(&grid, [31, 25]), 5.0, SlabMode::Mean);
    let whole = values(&section, &layer(grid.clone(), vec![Piece::whole()]));
    // A cut across the slab, between its stations: each goes to one side.
    let plane = Cutter::plane(section.centre(), section.forward() + section.right() * 0.3).expect("plane");
    let piece = |side| Piece { keep: vec![(plane, side)], pose: Affine::identity() };
    let both = values(&section, &layer(grid.clone(), vec![piece(Side::Plus), piece(Side::Minus)]));
    for (a, b) in whole.iter().zip(&both) {
        assert!(a.is_nan() == b.is_nan() && (a.is_nan() || (a - b).abs() < 1e-9), "{a} is not {b}");
    }
    // Half of the slab in the middle: the mean is that of the field over that half.
    let flat = Cutter::plane(section.centre(), section.forward()).expect("plane");
    let half = Piece { keep: vec![(flat, Side::Plus)], pose: Affine::identity() };
    let found = values(&section, &layer(grid, vec![half]))[15 + 31 * 12];
    let known = known(&section, &field, 1.25)[15 + 31 * 12];
    let slope = (field(&(section.centre() + section.forward())) - field(&section.centre())).abs();
    assert!((found - known).abs() < 0.4 * slope, "{found} is not {known}");
}

#[test]
fn a_slab_of_no_sense_is_refused() {
    let section = Section::new(Point::origin(), Vector::x(), Vector::y(), 1.0, [2, 2]).expect("a section");
    for thickness_mm in [-1.0, f64::NAN, f64::INFINITY, 20_000.0] {
        let made = section.with_slab(Slab { thickness_mm, mode: SlabMode::Mean });
        assert!(matches!(made, Err(SectionError::Thickness { .. })), "{thickness_mm}");
    }
}

#[test]
fn labels_are_painted_by_the_nearest_and_ride_with_their_piece() {
    let grid = Grid::new([8, 4, 4], Samples::U8(vec![200; 128]), Rescale::default(), Affine::identity());
    let voxels = Grid::new(
        [4, 1, 1],
        Samples::U8(vec![0, 1, 2, 3]),
        Rescale::default(),
        Affine::from_columns(
            Vector::x() * 2.0,
            Vector::y() * 9.0,
            Vector::z() * 9.0,
            Point::new(0.5, 1.0, 1.0),
        )
        .expect("columns"),
    );
    let colors: Arc<[[f64; 4]]> =
        Arc::from([[0.0; 4], [1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]]);
    let away = Affine::translation(Vector::new(40.0, 0.0, 0.0));
    let mut layer = layer(Arc::new(grid.expect("grid")), vec![Piece { keep: vec![], pose: away }]);
    layer.window = Window { level: 200.0, width: 400.0 };
    layer.labels = Some(Labels { grid: Arc::new(voxels.expect("labels")), pose: Affine::identity(), colors });
    let section =
        Section::new(Point::new(43.5, 1.0, 1.0), Vector::x(), Vector::y(), 1.0, [8, 1]).expect("a section");
    for section in [section, slab(section, 2.0, SlabMode::Mean)] {
        let bytes = picture(&section, std::slice::from_ref(&layer), &[], [0.0; 3]);
        let pixels: Vec<_> = bytes.chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect();
        let (plain, red, green) = ([128, 128, 128], [191, 64, 64], [0, 255, 0]);
        assert_eq!(pixels, [plain, plain, red, red, green, green, plain, plain], "two voxels a label");
    }
    assert_eq!(layer.label(&Point::new(42.0, 1.0, 1.0)), 1, "asked at a place");
    assert_eq!(layer.label(&Point::new(2.0, 1.0, 1.0)), 0, "where the piece is no more");
}
