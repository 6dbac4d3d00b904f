//! Extremes with a closed form, which the reference is held to as the others are.

use std::sync::Arc;

use render::image::FloatImage;
use render::scene::{
    Camera, MeshItem, Piece, Projection, Scene, Shading, TextureFormat, VolumeItem, VolumeMode,
};
use render::volume::{
    Affine, ControlPoint, Grid, Point, Rescale, Samples, Transfer, TriangleMesh, Vector, synth,
};

use super::drawers::{self, truth};
use super::judge::same;
use super::random::Random;
use super::{each, shapes};

/// A cube of 16 mm of one value about the origin, seen straight on by parallel rays.
fn cube(voxels: usize, value: f64, points: Vec<ControlPoint>, unit_mm: f64) -> Scene {
    let side = 16.0 / voxels as f64;
    let [x, y, z] = [Vector::x(), Vector::y(), Vector::z()].map(|axis| axis * side);
    let first = Point::from([-8.0 + side / 2.0; 3]);
    let place = Affine::from_columns(x, y, z, first).expect("three axes");
    let volume = VolumeItem {
        grid: Arc::new(synth::homogeneous([voxels; 3], value, place).expect("a grid")),
        packed: None,
        pose: Affine::identity(),
        transfer: Arc::new(Transfer::new(points, unit_mm).expect("rising values")),
        shading: Shading::None,
        texture: TextureFormat::R32f,
        pieces: vec![Piece::whole()],
        labels: None,
        mode: VolumeMode::Composite,
    };
    let camera = Camera {
        eye: Point::new(0.0, -40.0, 0.0),
        target: Point::origin(),
        up: Vector::z(),
        projection: Projection::Parallel { height_mm: 12.0 },
    };
    Scene { volumes: vec![volume], meshes: Vec::new(), grids: Vec::new(), camera, background: [0.0; 3] }
}

fn point(value: f64, opacity: f64) -> ControlPoint {
    ControlPoint { value, rgba: [1.0, 0.5, 0.25, opacity] }
}

/// All pixels alike.
fn plain(color: [f64; 3], opacity: f64, [width, height]: [u32; 2]) -> FloatImage {
    let pixel = [color[0], color[1], color[2], opacity].map(|c| c as f32);
    FloatImage { width, height, pixels: vec![pixel; (width * height) as usize] }
}

/// The reference and every renderer against what is known.
fn known(scene: &Scene, voxels: f64, exact: &FloatImage, most: f64) -> Result<(), String> {
    let size = [exact.width, exact.height];
    same(&truth(scene, size)?, exact, 0.01).map_err(|e| format!("reference: {e}"))?;
    for drawer in drawers::all() {
        let picture = (drawer.draw)(scene, size, voxels).map_err(|e| format!("{}: {e}", drawer.name))?;
        same(&picture, exact, most).map_err(|e| format!("{}: {e}", drawer.name))?;
    }
    Ok(())
}

#[test]
fn faint_slices_by_the_thousand_and_by_the_hundred_thousand_keep_their_sum() {
    each("faint slices", 12, |random| {
        let slices = if random.chance(0.7) { 2048.0 } else { 1e5 };
        let depth = random.one(&[0.01, 0.5, 1.0, 6.0]);
        let opacity = -(-depth / 16.0_f64).exp_m1();
        let scene = cube(4, 1.0, vec![point(0.0, opacity)], 1.0);
        let alpha = -(-depth).exp_m1();
        let exact = plain([alpha, alpha * 0.5, alpha * 0.25], alpha, [4, 4]);
        known(&scene, 4.0 / slices, &exact, 0.25)
    });
}

#[test]
fn opacity_0_shows_nothing_and_opacity_1_hides_all() {
    each("opacity 0 and 1", 40, |random| {
        let opacity = random.one(&[0.0, 1.0]);
        let unit = random.power(-3.0, 0.0);
        let scene = cube(random.one(&[1, 2, 7]), 3.0, vec![point(random.between(-9.0, 9.0), opacity)], unit);
        let exact = plain([opacity, opacity * 0.5, opacity * 0.25], opacity, [4, 4]);
        known(&scene, 0.5, &exact, 0.25)
    });
}

#[test]
fn samples_that_are_no_numbers_are_the_padding() {
    each("no numbers", 40, |random| {
        let mut scene = cube(3, 1.0, vec![point(0.0, 0.0), point(1.0, 0.3)], 8.0);
        let bad = random.one(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        let padding = random.part();
        let place = *scene.volumes[0].grid.world_from_voxel();
        let grid = Grid::new([3; 3], Samples::F32(vec![bad; 27]), Rescale::default(), place);
        scene.volumes[0].grid = Arc::new(grid.expect("a grid").with_padding(padding));
        let depth = -(-0.3 * padding).ln_1p() / 8.0 * 16.0;
        let alpha = -(-depth).exp_m1();
        known(&scene, 0.5, &plain([alpha, alpha * 0.5, alpha * 0.25], alpha, [4, 4]), 0.25)
    });
}

#[test]
fn a_jump_at_the_very_value_belongs_to_its_later_point() {
    each("a jump at the value", 40, |random| {
        let value = random.between(-1000.0, 1000.0).round();
        let (low, high) = (random.part() * 0.3, random.part() * 0.3);
        let mut points =
            vec![point(value - random.power(-1.0, 3.0), low), point(value, low), point(value, 0.9)];
        points.extend([point(value, high), point(value + random.power(-1.0, 3.0), high)]);
        let scene = cube(2, value, points, 16.0);
        known(&scene, 0.5, &plain([high, high * 0.5, high * 0.25], high, [4, 4]), 0.25)
    });
}

/// Along each ray the scalar stays what it is; from pixel to pixel it rises slowly, across a control point. No pixel has just
/// that point's value, beside which single precision may be on either side of a peak.
#[test]
fn a_scalar_that_stays_is_what_the_function_says_beside_a_control_point_too() {
    each("a scalar that stays", 40, |random| {
        let [low, high] = [random.between(-1000.0, 0.0), random.between(1.0, 2000.0)].map(|v| v as f32);
        let samples = Samples::F32(vec![low, high]);
        let (low, span) = (f64::from(low), f64::from(high) - f64::from(low));
        let mut points = Vec::new();
        let mut value = low - random.between(-0.3, 0.3) * span;
        for _ in 0..=random.below(6) {
            let opacity = random.one(&[0.0, 1.0, 1.0, 0.8, 0.02]);
            let rgba = [random.part(), random.part(), random.part(), opacity];
            points.push(ControlPoint { value, rgba });
            value += random.power(-3.0, 0.0) * span;
        }
        let unit_mm = 16.0 * random.power(-1.0, 1.0);
        let middle = ((points[random.below(points.len())].value - low) / span).clamp(0.01, 0.99);
        let mut scene = cube(1, 0.0, points, unit_mm);
        let sides = [8.0, 16.0, 16.0];
        let [x, y, z] = [0, 1, 2].map(|axis| Vector::ith(axis, sides[axis]));
        let place = Affine::from_columns(x, y, z, Point::new(-4.0, 0.0, 0.0)).expect("three axes");
        let grid = Grid::new([2, 1, 1], samples, Rescale::default(), place).expect("two samples");
        scene.volumes[0].grid = Arc::new(grid);
        let (size, across) = ([512, 1], 0.01);
        let offset = Vector::x() * (8.0 * middle - 4.0);
        scene.camera.eye += offset;
        scene.camera.target += offset;
        scene.camera.projection = Projection::Parallel { height_mm: 8.0 * across / f64::from(size[0]) };
        let transfer = Arc::clone(&scene.volumes[0].transfer);
        let pixel = |i: u32| {
            let part = middle + ((f64::from(i) + 0.5) / f64::from(size[0]) - 0.5) * across;
            let ([r, g, b], tau) = transfer.classify(low + span * part);
            let alpha = -(-16.0 * tau).exp_m1();
            [r * alpha, g * alpha, b * alpha, alpha].map(|v| v as f32)
        };
        let exact = FloatImage { width: size[0], height: 1, pixels: (0..size[0]).map(pixel).collect() };
        same(&truth(&scene, size)?, &exact, 0.01).map_err(|e| format!("reference: {e}"))?;
        same(&(drawers::processor().draw)(&scene, size, 0.125)?, &exact, 1.0)
    });
}

/// Surfaces at one place are crossed in the order of the scene's meshes.
#[test]
fn sheets_at_one_place_composite_in_their_order() {
    each("sheets at one place", 60, |random| {
        let mut scene = cube(1, 0.0, vec![point(0.0, 0.0)], 1.0);
        scene.volumes.clear();
        let (mut color, mut through) = ([0.0; 3], 1.0);
        let at = Point::new(0.3, random.between(-5.0, 5.0), 0.1);
        for _ in 0..=random.below(6) {
            let item = sheet(random, at, Vector::y());
            for (sum, own) in color.iter_mut().zip(item.color) {
                *sum += through * item.opacity * own;
            }
            through *= 1.0 - item.opacity;
            scene.meshes.push(item);
        }
        known(&scene, 0.5, &plain(color, 1.0 - through, [4, 4]), 0.25)
    });
}

/// A triangle whose corners are one point, or two, or three on a line, shows nothing, in the middle of a pixel too.
#[test]
fn triangles_without_an_area_show_nothing() {
    each("no area", 40, |random| {
        let mut scene = cube(1, 0.0, vec![point(0.0, 0.0)], 1.0);
        scene.volumes.clear();
        let mut middle = || random.one(&[-4.5, -1.5, 1.5, 4.5]) + random.one(&[0.0, 0.0, 1e-3]);
        let (x, z) = (middle(), middle());
        let first = Point::new(x, random.between(-5.0, 5.0), z);
        let along = random.one(&[Vector::x(), Vector::z(), Vector::new(1.0, 0.0, -1.0)]) * 3.0;
        let positions = vec![first, first + along, first + along * 2.0];
        let triangles = vec![[0, 0, 0], [0, 1, 1], [1, 0, 1], [2, 2, 0], [0, 1, 2], [2, 0, 1], [1, 0, 2]];
        scene.meshes.push(shapes::item(random, positions, triangles));
        scene.meshes[0].pose = Affine::identity();
        known(&scene, 0.5, &plain([0.0; 3], 0.0, [4, 4]), 0.0)
    });
}

/// 16 sheets that cross in a line, each seen by every pixel, in a homogeneous volume.
#[test]
fn sixteen_sheets_in_a_volume_composite_at_their_depth() {
    each("sixteen sheets", 40, |random| {
        let mut scene = cube(4, 0.0, vec![point(0.0, 0.2)], 8.0);
        for _ in 0..16 {
            let tilt = Vector::new(random.between(-0.5, 0.5), 1.0, random.between(-0.5, 0.5));
            let at = Point::new(0.0, random.between(-2.0, 2.0), 0.0);
            scene.meshes.push(sheet(random, at, tilt));
        }
        let exact =
            FloatImage { width: 5, height: 5, pixels: (0..25).map(|i| by_hand(&scene, i, 5)).collect() };
        known(&scene, 0.125, &exact, 1.0)
    });
}

/// A pixel of a straight view of the cube with sheets in it, layer by layer.
fn by_hand(scene: &Scene, pixel: u32, side: u32) -> [f32; 4] {
    let place = |i: u32| ((f64::from(i) + 0.5) / f64::from(side) - 0.5) * 12.0;
    let (x, z) = (place(pixel % side), -place(pixel / side));
    let tau = -(-0.2_f64).ln_1p() / 8.0;
    let mut layers: Vec<(f64, &MeshItem)> = scene.meshes.iter().map(|m| (depth(m, x, z), m)).collect();
    layers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut sum, mut through, mut at) = ([0.0; 3], 1.0, -8.0_f64);
    let mut add = |color: [f64; 3], opacity: f64| {
        for c in 0..3 {
            sum[c] += through * opacity * color[c];
        }
        through *= 1.0 - opacity;
    };
    let bone = [1.0, 0.5, 0.25];
    for (y, mesh) in layers {
        let stop = y.clamp(-8.0, 8.0);
        if y <= 8.0 {
            add(bone, -(-tau * (stop - at)).exp_m1());
            at = stop;
        } else if at < 8.0 {
            add(bone, -(-tau * (8.0 - at)).exp_m1());
            at = 8.0;
        }
        add(mesh.color, mesh.opacity);
    }
    add(bone, -(-tau * (8.0 - at)).exp_m1());
    [sum[0] as f32, sum[1] as f32, sum[2] as f32, (1.0 - through) as f32]
}

/// Where the plane of a mesh's first triangle is, along y.
fn depth(mesh: &MeshItem, x: f64, z: f64) -> f64 {
    let [a, b, c] = mesh.mesh.corners(0);
    let n = (b - a).cross(&(c - a));
    a.y - (n.x * (x - a.x) + n.z * (z - a.z)) / n.y
}

fn sheet(random: &mut Random, at: Point, normal: Vector) -> MeshItem {
    let (positions, triangles) = shapes::sheet(at, normal, 60.0);
    MeshItem {
        mesh: Arc::new(TriangleMesh::new(positions, triangles).expect("a mesh")),
        pose: Affine::identity(),
        color: [random.part(), random.part(), random.part()],
        opacity: random.between(0.05, 0.5),
        shading: Shading::None,
    }
}
