//! How exact the rule is, and that nothing that should not matter does.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::reference::{ReferenceError, draw};
use crate::volume::{Cutter, Side};

/// Largest difference from eight times finer parts, in units of 1/255.
fn error_of(scene: &Scene, size: [u32; 2]) -> f64 {
    let finer = Options { parts: 8, ..Options::default() };
    255.0 * largest_difference(&pixels(scene, size), &pixels_with(scene, size, finer))
}

/// The Marschner-Lobb signal on 24³ voxels over 24 mm.
fn rings() -> VolumeItem {
    let scale = 2.0 / 24.0;
    let grid = synth::from_places([24; 3], Affine::identity(), |p| {
        synth::marschner_lobb(&((p - Vector::repeat(11.5)) * scale))
    });
    let points = [point(0.3, [0.1, 0.3, 0.9, 0.0]), point(0.7, [0.9, 0.6, 0.2, 0.3])];
    volume(grid.expect("a grid"), transfer(&points))
}

fn around() -> Camera {
    perspective(Point::new(45.0, -30.0, 30.0), Point::new(11.0, 11.0, 11.0))
}

#[test]
fn the_rule_errs_by_less_than_a_ten_thousandth_of_a_shade_without_light() {
    let error = error_of(&scene(vec![rings()], Vec::new(), around()), [40, 40]);
    assert!(error < 1e-4, "smooth: {error:e} of 1/255");
    let item = volume(noisy([20, 20, 16]), steep());
    let noise = scene(vec![item], Vec::new(), perspective(Point::new(30.0, -30.0, 20.0), Point::origin()));
    let error = error_of(&noise, [40, 40]);
    assert!(error < 1e-4, "noisy with a jump: {error:e} of 1/255");
}

#[test]
fn the_rule_errs_by_less_than_a_fiftieth_of_a_shade_with_light() {
    let mut item = rings();
    item.shading = Shading::Lit;
    let error = error_of(&scene(vec![item], Vec::new(), around()), [32, 32]);
    assert!(error < 0.02, "smooth: {error:e} of 1/255");
    let mut item = volume(noisy([20, 20, 16]), steep());
    item.shading = Shading::Lit;
    let noise = scene(vec![item], Vec::new(), perspective(Point::new(30.0, -30.0, 20.0), Point::origin()));
    let error = error_of(&noise, [32, 32]);
    assert!(error < 0.02, "noisy: {error:e} of 1/255");
}

#[test]
fn skipping_what_is_empty_changes_nothing() {
    // Mostly clear: three small balls in 40³ voxels, so that whole bricks are skipped.
    let centres = [[8.0, 9.0, 30.0], [30.0, 12.0, 12.0], [22.0, 33.0, 25.0]].map(Point::from);
    let grid = synth::from_places([40; 3], Affine::identity(), |p| {
        centres.iter().map(|c| 6.0 - (p - c).norm()).fold(f64::NEG_INFINITY, f64::max)
    });
    let points = [point(0.0, [0.9, 0.6, 0.2, 0.0]), point(2.0, [0.9, 0.8, 0.7, 0.4])];
    let mut item = volume(grid.expect("a grid"), transfer(&points));
    let camera = perspective(Point::new(90.0, -50.0, 60.0), Point::new(20.0, 20.0, 20.0));
    for shading in [Shading::None, Shading::Lit] {
        item.shading = shading;
        let scene = scene(vec![item.clone()], Vec::new(), camera);
        let skipped = pixels(&scene, [40, 40]);
        let walked = pixels_with(&scene, [40, 40], Options { skip_empty: false, ..Options::default() });
        let difference = largest_difference(&skipped, &walked);
        assert!(difference < 1e-13, "{shading:?}: {difference:e}");
        assert!(skipped.iter().filter(|p| p[3] > 0.0).count() > 100, "the balls are seen");
    }
}

#[test]
fn a_scene_far_away_gives_the_same_picture() {
    let cutter = |shift: Vector| {
        let tube = Cutter::cylinder(Point::new(-1.0, 0.0, 1.0) + shift, Vector::new(0.3, 1.0, 0.4), 3.0);
        let plane = Cutter::plane(Point::new(0.0, 0.5, 0.0) + shift, Vector::new(0.1, 1.0, 0.3));
        vec![(tube.expect("tube"), Side::Plus), (plane.expect("plane"), Side::Minus)]
    };
    let picture = |shift: Vector| {
        let mut item = volume(noisy([14, 13, 10]), steep());
        item.shading = Shading::Lit;
        item.pose = Affine::translation(shift);
        let turn = Affine::rotation_about(Point::origin() + shift, Vector::new(0.2, 0.5, 1.0), 0.3);
        item.pieces = vec![Piece { keep: cutter(shift), pose: turn }, Piece::whole()];
        let mut mesh = quad(
            Point::origin(),
            Vector::new(5.0, 3.0, 0.0),
            Vector::new(1.0, 0.0, 6.0),
            [1.0, 0.2, 0.1],
            0.4,
        );
        mesh.pose = Affine::translation(shift);
        let camera = perspective(Point::new(22.0, -18.0, 9.0) + shift, Point::new(-1.0, -1.0, 0.0) + shift);
        pixels(&scene(vec![item], vec![mesh], camera), [24, 20])
    };
    let near = picture(Vector::zeros());
    let far = picture(Vector::new(1.0e6, -1.0e6, 1.0e6));
    let difference = largest_difference(&near, &far);
    assert!(difference < 1e-6, "{difference:e}");
    assert!(near.iter().any(|p| p[3] > 0.5), "something is drawn");
}

#[test]
fn the_picture_is_the_pixels_and_does_not_depend_on_threads() {
    let mesh = quad(Point::new(11.0, 11.0, 11.0), Vector::x() * 9.0, Vector::z() * 9.0, [1.0, 0.2, 0.1], 0.4);
    let scene = scene(vec![rings()], vec![mesh], around());
    let known: Vec<_> = pixels(&scene, [31, 17]).iter().map(|p| p.map(|c| c as f32)).collect();
    for threads in [1, 4] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let rows = AtomicUsize::new(0);
        let count = |done: usize, all: usize| {
            rows.fetch_add(1, Ordering::Relaxed);
            done <= all && all == 17
        };
        let image = pool.install(|| draw(&scene, [31, 17], &Options::default(), &count)).expect("a picture");
        assert_eq!((image.width, image.height), (31, 17), "size");
        assert_eq!(image.pixels, known, "{threads} threads");
        assert_eq!(rows.into_inner(), 17, "progress was told of every row");
    }
}

#[test]
fn drawing_stops_when_it_is_told_to() {
    let scene = scene(vec![rings()], Vec::new(), around());
    let result = draw(&scene, [16, 200], &Options::default(), &|done, _| done < 3);
    assert_eq!(result, Err(ReferenceError::Cancelled), "cancelled");
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let mut broken = scene(Vec::new(), Vec::new(), around());
    let options = Options::default();
    for (width, height) in [(0, 5), (5, 0), (u32::MAX, u32::MAX)] {
        let result = draw(&broken, [width, height], &options, &|_, _| true);
        assert_eq!(result, Err(ReferenceError::Size { width, height }), "size");
    }
    let result = draw_pixels(&broken, [4, 4], &options, &[(1, 1), (4, 0)]);
    assert_eq!(result, Err(ReferenceError::Pixel { x: 4, y: 0 }), "outside");
    broken.meshes.push(quad(Point::origin(), Vector::x(), Vector::z(), [f64::NAN, 0.0, 0.0], 0.5));
    let result = draw(&broken, [4, 4], &options, &|_, _| true);
    assert_eq!(result, Err(ReferenceError::Mesh { mesh: 0 }), "a colour that is no number");
    broken.meshes.clear();
    let empty = draw(&broken, [4, 4], &options, &|_, _| true).expect("an empty picture");
    assert!(empty.pixels.iter().all(|p| *p == [0.0; 4]), "an empty scene is clear");
}
