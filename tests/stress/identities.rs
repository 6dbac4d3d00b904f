//! What holds for any picture, whoever draws it.

use std::sync::Arc;

use render::image::FloatImage;
use render::scene::{Piece, Scene};
use render::volume::{Affine, Point, Side, Transfer, Vector};

use super::cases::{self, Case, Contents};
use super::drawers::{self, Drawer, truth};
use super::judge::same;
use super::random::Random;
use super::{each, parts};

/// The reference's rounding to `f32`, and what its rule leaves, in 1/255.
const EXACT: f64 = 0.02;
const SIZE: [u32; 2] = [7, 6];

/// The reference first, then all others, each with what it may be off by, in 1/255.
fn all(
    check: impl Fn(&str, &dyn Fn(&Scene) -> Result<FloatImage, String>, f64) -> Result<(), String>,
    voxels: f64,
) -> Result<(), String> {
    check("reference", &|scene| truth(scene, SIZE), EXACT)?;
    for Drawer { name, draw } in drawers::all() {
        check(name, &|scene| draw(scene, SIZE, voxels), 1.0)?;
    }
    Ok(())
}

#[test]
fn a_volume_cut_in_two_and_left_in_place_is_the_whole() {
    each("cut in two", 100, |random| {
        let case = cases::any(random, Contents { volumes: 1, cut: false, meshes: 0 });
        let mut cut = case.scene.clone();
        let volume = &mut cut.volumes[0];
        let at = cases::corners(&volume.grid, &volume.pose);
        let (cutter, _) = parts::cutters(random, &at, case.size_mm)[0];
        let half = |side| Piece { keep: vec![(cutter, side)], pose: Affine::identity() };
        volume.pieces = [Side::Plus, Side::Minus].map(half).into();
        let (whole, voxels) = (case.scene.clone(), cases::fine(&case));
        all(
            |name, draw, most| same(&draw(&cut)?, &draw(&whole)?, most).map_err(|e| format!("{name}: {e}")),
            voxels,
        )
    });
}

#[test]
fn a_scene_moved_and_turned_with_its_camera_is_the_same_picture() {
    each("moved alike", 60, |random| {
        let case = surfaceless(random);
        let by = Affine::translation(random.shift(case.size_mm * 10.0)) * random.turn();
        let moved = cases::moved(&case.scene, &by);
        all(
            |name, draw, most| {
                same(&draw(&moved)?, &draw(&case.scene)?, most).map_err(|e| format!("{name}: {e}"))
            },
            cases::fine(&case),
        )
    });
}

#[test]
fn a_fragment_moved_away_and_back_is_where_it_was() {
    each("away and back", 60, |random| {
        let case = surfaceless(random);
        let by = Affine::translation(random.shift(case.size_mm * 1e3)) * random.turn();
        let mut back = case.scene.clone();
        for volume in &mut back.volumes {
            for piece in &mut volume.pieces {
                piece.pose = by.inverse() * (by * piece.pose);
            }
        }
        all(
            |name, draw, most| {
                same(&draw(&back)?, &draw(&case.scene)?, most).map_err(|e| format!("{name}: {e}"))
            },
            cases::fine(&case),
        )
    });
}

#[test]
fn a_mirrored_scene_is_the_mirrored_picture() {
    each("mirrored", 60, |random| {
        let case = surfaceless(random);
        let mirror = Affine::from_columns(-Vector::x(), Vector::y(), Vector::z(), Point::origin());
        let mirrored = cases::moved(&case.scene, &mirror.expect("a mirror"));
        all(
            |name, draw, most| {
                let mut picture = draw(&mirrored)?;
                for row in picture.pixels.chunks_exact_mut(SIZE[0] as usize) {
                    row.reverse();
                }
                same(&picture, &draw(&case.scene)?, most).map_err(|e| format!("{name}: {e}"))
            },
            cases::fine(&case),
        )
    });
}

#[test]
fn the_order_of_volumes_and_of_pieces_is_no_matter() {
    each("permuted", 60, |random| {
        let case = cases::any(random, Contents { volumes: 4, cut: true, meshes: 0 });
        let mut permuted = case.scene.clone();
        permuted.volumes.reverse();
        for volume in &mut permuted.volumes {
            volume.pieces.reverse();
        }
        all(
            |name, draw, most| {
                same(&draw(&permuted)?, &draw(&case.scene)?, most).map_err(|e| format!("{name}: {e}"))
            },
            cases::fine(&case),
        )
    });
}

#[test]
fn a_clear_volume_and_a_clear_surface_change_nothing() {
    each("clear things", 40, |random| {
        let case = cases::any(random, Contents { volumes: 2, cut: true, meshes: 2 });
        let mut more = case.scene.clone();
        let mut extra = cases::any(random, Contents { volumes: 1, cut: false, meshes: 1 }).scene;
        for volume in &mut extra.volumes {
            let mut points = volume.transfer.points().to_vec();
            for point in &mut points {
                point.rgba[3] = 0.0;
            }
            let clear = Transfer::new(points, 1.0).expect("the same values");
            volume.transfer = Arc::new(clear);
        }
        extra.meshes.iter_mut().for_each(|m| m.opacity = 0.0);
        more.volumes.extend(extra.volumes);
        more.meshes.extend(extra.meshes);
        all(
            |name, draw, most| {
                same(&draw(&more)?, &draw(&case.scene)?, most).map_err(|e| format!("{name}: {e}"))
            },
            cases::fine(&case),
        )
    });
}

/// A scene without surfaces, whose edges may fall on either side when numbers round otherwise, and with an upward
/// direction of its own: what takes the place of one along the view is an axis of the world, which does not move.
fn surfaceless(random: &mut Random) -> Case {
    let mut case = cases::any(random, Contents { volumes: 2, cut: true, meshes: 0 });
    let camera = &mut case.scene.camera;
    let view = camera.target - camera.eye;
    if view.cross(&camera.up).norm() < 1e-3 * view.norm() * camera.up.norm() {
        let mut axis = Vector::zeros();
        axis[view.iamin()] = 1.0;
        camera.up = axis;
    }
    case
}
