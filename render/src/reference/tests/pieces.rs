//! Cut volumes and moved pieces.

use super::*;
use crate::volume::{Cutter, Side};

fn piece(keep: &[(Cutter, Side)]) -> Piece {
    Piece { keep: keep.to_vec(), pose: Affine::identity() }
}

fn cutters() -> [Cutter; 5] {
    [
        Cutter::plane(Point::new(-2.0, 0.3, 0.0), Vector::new(1.0, 0.4, -0.3)).expect("plane"),
        Cutter::plane(Point::new(0.0, 1.0, -1.0), Vector::new(-0.2, 1.0, 0.7)).expect("plane"),
        Cutter::cylinder(Point::new(-1.0, 0.0, 1.0), Vector::new(0.3, 1.0, 0.4), 3.0).expect("cylinder"),
        Cutter::dome(Point::new(1.0, 0.5, -1.0), 4.0).expect("dome"),
        Cutter::blade(Point::new(1.0, 0.0, 1.0), Vector::new(0.2, -0.3, 1.0), Vector::x(), [5.0, 4.0])
            .expect("blade"),
    ]
}

fn camera() -> Camera {
    perspective(Point::new(22.0, -18.0, 9.0), Point::new(-1.0, -1.0, 0.0))
}

#[test]
fn a_volume_cut_in_pieces_that_stay_draws_as_the_whole() {
    let mut item = volume(noisy([14, 13, 10]), steep());
    for shading in [Shading::None, Shading::Lit] {
        item.shading = shading;
        item.pieces = vec![Piece::whole()];
        let whole = pixels(&scene(vec![item.clone()], Vec::new(), camera()), [24, 20]);
        item.pieces.clear();
        for sides in 0..8 {
            let side = |bit: usize| if sides >> bit & 1 == 1 { Side::Plus } else { Side::Minus };
            let keep: Vec<_> = cutters()[..3].iter().enumerate().map(|(i, c)| (*c, side(i))).collect();
            item.pieces.push(piece(&keep));
        }
        let cut = pixels(&scene(vec![item.clone()], Vec::new(), camera()), [24, 20]);
        let difference = largest_difference(&whole, &cut);
        // Cell by cell the rule is applied to other stretches: what differs is its own error.
        let allowed = if shading == Shading::None { 1e-9 } else { 1e-6 };
        assert!(difference < allowed, "{shading:?}: {difference:e}");
        assert!(whole.iter().any(|p| p[3] > 0.5), "something is drawn");
    }
    // Where the rule has no error nothing is left.
    let solid = |pieces| {
        let item = VolumeItem { pieces, ..volume(noisy([14, 13, 10]), flat([0.9, 0.4, 0.2, 0.1])) };
        pixels(&scene(vec![item], Vec::new(), camera()), [24, 20])
    };
    for cutter in cutters() {
        let cut = solid(vec![piece(&[(cutter, Side::Plus)]), piece(&[(cutter, Side::Minus)])]);
        let difference = largest_difference(&solid(vec![Piece::whole()]), &cut);
        assert!(difference < 1e-12, "{cutter:?}: {difference:e}");
    }
}

#[test]
fn a_cylinder_keeps_its_chord_and_leaves_the_rest() {
    let tau = -(0.95_f64.ln());
    let cutter =
        Cutter::cylinder(Point::new(0.0, 10.0, 10.0), Vector::new(2.0, 0.0, 0.0), 4.0).expect("tube");
    let mut item = block([21, 21, 21], [1.0, 1.0, 1.0, 0.05]);
    let camera = parallel(Point::new(10.0, -30.0, 10.0), Point::new(10.0, 0.0, 10.0), 12.0);
    let size = [5, 24];
    for side in [Side::Minus, Side::Plus] {
        item.pieces = vec![piece(&[(cutter, side)])];
        let all = pixels(&scene(vec![item.clone()], Vec::new(), camera), size);
        for (pixel, (start, _)) in all.iter().zip(rays(&camera, size)) {
            let off = start.z - 10.0;
            let chord = if off.abs() < 4.0 { 2.0 * (16.0 - off * off).sqrt() } else { 0.0 };
            let length = if side == Side::Minus { chord } else { 21.0 - chord };
            let alpha = 1.0 - (-tau * length).exp();
            assert!((pixel[3] - alpha).abs() < 1e-12, "{side:?} {off} mm off the axis: {}", pixel[3]);
        }
    }
}

/// A block of 21 mm, seen along y, of which each ray has `length(off)` for its distance from x = z = 10.
fn is_as_long_as(keep: &[(Cutter, Side)], what: &str, length: impl Fn(f64, f64) -> f64) {
    let tau = -(0.95_f64.ln());
    let mut item = block([21, 21, 21], [1.0, 1.0, 1.0, 0.05]);
    item.pieces = vec![piece(keep)];
    let camera = parallel(Point::new(10.0, -30.0, 10.0), Point::new(10.0, 0.0, 10.0), 12.0);
    let size = [24, 24];
    let all = pixels(&scene(vec![item], Vec::new(), camera), size);
    for (pixel, (start, _)) in all.iter().zip(rays(&camera, size)) {
        let (x, z) = (start.x - 10.0, start.z - 10.0);
        let alpha = 1.0 - (-tau * length(x, z)).exp();
        assert!((pixel[3] - alpha).abs() < 1e-12, "{what} at {x} {z}: {} is not {alpha}", pixel[3]);
    }
}

#[test]
fn domes_blades_and_kerfs_leave_as_much_of_a_ray_as_their_shape_says() {
    let middle = Point::new(10.0, 10.0, 10.0);
    let chord = |r: f64, x: f64, z: f64| 2.0 * (r * r - x * x - z * z).max(0.0).sqrt();
    let dome = Cutter::dome(middle, 4.0).and_then(|c| c.with_kerf(1.0)).expect("dome");
    is_as_long_as(&[(dome, Side::Minus)], "inside a dome", |x, z| chord(3.5, x, z));
    is_as_long_as(&[(dome, Side::Plus)], "outside a dome", |x, z| 21.0 - chord(4.5, x, z));
    let tube = Cutter::cylinder(middle, Vector::x(), 4.0).and_then(|c| c.with_kerf(1.0)).expect("tube");
    is_as_long_as(&[(tube, Side::Plus)], "outside a tube", |_, z| 21.0 - chord(4.5, 0.0, z));
    // The blade faces the eye, in the middle of the block: it has passed what is behind it.
    let blade = Cutter::blade(middle, -Vector::y(), Vector::new(0.0, 1.0, 2.0), [5.0, 3.0]);
    let blade = blade.and_then(|c| c.with_kerf(0.5)).expect("blade");
    let within = |x: f64, z: f64| z.abs() < 2.5 && x.abs() < 1.5;
    is_as_long_as(&[(blade, Side::Minus)], "a blade", |x, z| if within(x, z) { 10.25 } else { 0.0 });
    is_as_long_as(&[(blade, Side::Plus)], "around it", |x, z| if within(x, z) { 10.25 } else { 21.0 });
    let plane = Cutter::plane(middle, Vector::y() * 3.0).and_then(|c| c.with_kerf(2.0)).expect("plane");
    for side in [Side::Plus, Side::Minus] {
        is_as_long_as(&[(plane, side)], "a plane with a kerf", |_, _| 9.5);
    }
}

#[test]
fn a_fragment_moved_and_moved_back_is_unchanged() {
    let away = Affine::rotation_about(Point::new(3.0, 2.0, 1.0), Vector::new(0.3, 1.0, -0.4), 0.9)
        * Affine::translation(Vector::new(20.0, -8.0, 3.0));
    let keep = vec![(cutters()[0], Side::Plus), (cutters()[2], Side::Plus)];
    let picture = |pose: Affine, volume_pose: Affine| {
        let mut item = volume(noisy([14, 13, 10]), steep());
        item.pose = volume_pose;
        item.pieces = vec![Piece { keep: keep.clone(), pose }];
        pixels(&scene(vec![item], Vec::new(), camera()), [24, 20])
    };
    let still = picture(Affine::identity(), Affine::identity());
    let back = picture(away.inverse() * away, Affine::identity());
    assert!(largest_difference(&still, &back) < 1e-9, "moved and moved back");
    assert!(still.iter().any(|p| p[3] > 0.5), "something is drawn");
    assert!(largest_difference(&still, &picture(away, Affine::identity())) > 0.1, "away it is elsewhere");
}

#[test]
fn a_fragment_that_is_moved_looks_as_to_a_camera_moved_the_other_way() {
    let away = Affine::rotation_about(Point::new(3.0, 2.0, 1.0), Vector::new(0.3, 1.0, -0.4), 0.4);
    let mut item = volume(noisy([14, 13, 10]), steep());
    item.shading = Shading::Lit;
    item.pieces = vec![piece(&[(cutters()[1], Side::Minus), (cutters()[2], Side::Minus)])];
    let view = camera();
    let moved_view = Camera {
        eye: away.inverse().point(&view.eye),
        target: away.inverse().point(&view.target),
        up: away.inverse().vector(&view.up),
        ..view
    };
    let still = pixels(&scene(vec![item.clone()], Vec::new(), moved_view), [20, 20]);
    item.pieces[0].pose = away;
    let moved = pixels(&scene(vec![item], Vec::new(), view), [20, 20]);
    let difference = largest_difference(&still, &moved);
    assert!(difference < 1e-9, "{difference:e}");
    assert!(still.iter().any(|p| p[3] > 0.5), "something is drawn");
}

#[test]
fn pieces_that_overlap_count_twice_and_no_piece_draws_nothing() {
    let mut item = block([8, 8, 8], [1.0, 0.5, 0.2, 0.1]);
    let view = parallel(Point::new(3.5, -9.0, 3.5), Point::new(3.5, 0.0, 3.5), 3.0);
    item.pieces = vec![Piece::whole(), Piece::whole()];
    let alpha = 1.0 - 0.9_f64.powi(16);
    let twice = pixels(&scene(vec![item.clone()], Vec::new(), view), [2, 2]);
    assert!(largest_difference(&twice, &[[alpha, 0.5 * alpha, 0.2 * alpha, alpha]; 4]) < 1e-12, "{twice:?}");
    item.pieces.clear();
    let none = pixels(&scene(vec![item], Vec::new(), view), [2, 2]);
    assert_eq!(none, [[0.0; 4]; 4], "no piece");
}
