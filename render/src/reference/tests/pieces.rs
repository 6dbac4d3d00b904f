//! Cut volumes and moved pieces.

use super::*;
use crate::volume::{Cutter, Side};

fn piece(keep: &[(Cutter, Side)]) -> Piece {
    Piece { keep: keep.to_vec(), pose: Affine::identity() }
}

fn cutters() -> [Cutter; 3] {
    [
        Cutter::plane(Point::new(-2.0, 0.3, 0.0), Vector::new(1.0, 0.4, -0.3)).expect("plane"),
        Cutter::plane(Point::new(0.0, 1.0, -1.0), Vector::new(-0.2, 1.0, 0.7)).expect("plane"),
        Cutter::cylinder(Point::new(-1.0, 0.0, 1.0), Vector::new(0.3, 1.0, 0.4), 3.0).expect("cylinder"),
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
            let keep: Vec<_> = cutters().into_iter().enumerate().map(|(i, c)| (c, side(i))).collect();
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
