//! Random scenes, drawn by every renderer beside the reference.

use std::sync::Arc;

use render::scene::{Scene, Shading};
use render::volume::{Affine, Cutter, Side, Transfer, Vector};

use super::cases::{self, Case, Contents};
use super::drawers::{self, Drawer};
use super::judge::right;
use super::random::Random;
use super::{each, shapes};

/// What a picture at fine sub-steps may be off by, in 1/255: the bound of the contract's finest quality.
const MOST: f64 = 2.0;
pub(super) const SIZES: [[u32; 2]; 4] = [[8, 8], [9, 5], [3, 16], [1, 1]];

fn check(random: &mut Random, case: &Case) -> Result<(), String> {
    let size = random.one(&SIZES);
    check_sized(case, size)
}

fn check_sized(case: &Case, size: [u32; 2]) -> Result<(), String> {
    drawers::all().iter().try_for_each(|drawer| comes_right(drawer, case, size, cases::fine(case), MOST))
}

/// Refuses a picture with steps of `fine` voxels that is off by more than `most`/255. A jump in a transfer function may hide
/// a thin shell in any sub-step: a picture that is wrong is drawn again with steps an eighth and a sixty-fourth as long,
/// and must come right.
pub(super) fn comes_right(
    Drawer { name, draw }: &Drawer,
    case: &Case,
    size: [u32; 2],
    fine: f64,
    most: f64,
) -> Result<(), String> {
    let judged = |voxels: f64| {
        let picture = draw(&case.scene, size, voxels).map_err(|e| format!("{name}: {e}"))?;
        right(&case.scene, &picture, most).map_err(|e| format!("{name}: {e}"))
    };
    judged(fine).or_else(|_| judged(fine / 8.0)).or_else(|_| judged(fine / 64.0))
}

#[test]
fn one_volume_of_any_kind_from_anywhere() {
    each("one volume", 300, |random| {
        let case = cases::any(random, Contents { volumes: 1, cut: false, meshes: 0 });
        check(random, &case)
    });
}

#[test]
fn volumes_cut_by_planes_and_cylinders_of_any_kind() {
    each("cut volumes", 200, |random| {
        let case = cases::any(random, Contents { volumes: 1, cut: true, meshes: 0 });
        check(random, &case)
    });
}

#[test]
fn several_volumes_cut_and_with_surfaces_in_them() {
    each("all together", 60, |random| {
        let case = cases::any(random, Contents { volumes: 3, cut: true, meshes: 3 });
        check(random, &case)
    });
}

#[test]
fn surfaces_of_any_kind_without_a_volume() {
    each("surfaces alone", 300, |random| {
        let mut case = cases::any(random, Contents { volumes: 1, cut: false, meshes: 0 });
        case.scene.volumes.clear();
        for _ in 0..=random.below(4) {
            case.scene.meshes.push(shapes::any(random, case.size_mm));
        }
        // Without a volume there is no spacing to be fine in.
        let size = random.one(&SIZES);
        for Drawer { name, draw } in drawers::all() {
            let picture = draw(&case.scene, size, 0.25).map_err(|e| format!("{name}: {e}"))?;
            right(&case.scene, &picture, 0.1).map_err(|e| format!("{name}: {e}"))?;
        }
        Ok(())
    });
}

#[test]
fn a_scene_a_kilometre_away_is_the_same_picture() {
    each("far away", 60, |random| {
        let case = cases::any(random, Contents { volumes: 2, cut: true, meshes: 2 });
        let far = Affine::translation(Vector::from_fn(|_, _| random.one(&[-1e6, 0.0, 1e6])));
        let case = Case { scene: cases::moved(&case.scene, &far), ..case };
        check(random, &case)
    });
}

#[test]
fn a_picture_4096_wide_or_high_is_right_at_both_ends() {
    each("wide pictures", 6, |random| {
        let case = cases::any(random, Contents { volumes: 1, cut: true, meshes: 1 });
        let size = random.one(&[[4096, 1], [1, 4096], [4096, 2]]);
        check_sized(&case, size)
    });
}

/// A sheet that lies in the plane of a cut is drawn whole: what is behind it is not before it.
#[test]
fn a_surface_in_the_plane_of_a_cut() {
    each("a surface in a cut", 120, |random| {
        let mut case = cases::any(random, Contents { volumes: 1, cut: false, meshes: 0 });
        let Scene { volumes, meshes, .. } = &mut case.scene;
        let at = cases::corners(&volumes[0].grid, &volumes[0].pose);
        let point = at[0] + (at[7] - at[0]) * random.between(0.2, 0.8);
        let any = random.direction();
        let normal = random.one(&[at[1] - at[0], any]);
        let (cutter, side) = (Cutter::plane(point, normal).expect("a plane"), Side::Plus);
        volumes[0].pieces[0].keep = vec![(cutter, side)];
        let (positions, triangles) = shapes::sheet(point, normal, case.size_mm);
        let mut item = shapes::item(random, positions, triangles);
        item.pose = Affine::identity();
        meshes.push(item);
        check(random, &case)
    });
}

/// Light falls by the gradient, of which there is none in flat parts and at jumps of the samples.
#[test]
fn lit_volumes_cut_and_with_surfaces_in_them() {
    each("lit volumes", 40, |random| {
        let mut case = cases::any(random, Contents { volumes: 2, cut: true, meshes: 1 });
        for volume in &mut case.scene.volumes {
            volume.shading = Shading::Lit;
        }
        check(random, &case)
    });
}

/// A function whose control points are all at one value has no span that gradients could be measured by.
#[test]
fn lit_volumes_of_a_function_that_only_jumps() {
    each("lit jumps", 60, |random| {
        let mut case = cases::any(random, Contents { volumes: 1, cut: false, meshes: 0 });
        for volume in &mut case.scene.volumes {
            volume.shading = Shading::Lit;
            let [low, high] = volume.grid.range();
            let span = if high > low { high - low } else { low.abs().max(1.0) };
            let value = low + span * random.between(-0.2, 1.2);
            let mut points = volume.transfer.points().to_vec();
            for point in &mut points {
                point.value = value;
            }
            volume.transfer = Arc::new(Transfer::new(points, volume.transfer.unit_mm()).expect("one value"));
        }
        check(random, &case)
    });
}
