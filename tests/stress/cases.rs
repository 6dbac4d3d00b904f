//! Whole scenes at random: volumes, cuts, surfaces, views.

use std::sync::Arc;

use render::scene::{Camera, Piece, Projection, Scene, Shading, TextureFormat, VolumeItem, VolumeMode};
use render::volume::{Affine, ControlPoint, Cutter, Grid, Point, Rescale, Samples, Shape, Transfer, Vector};

use super::parts::{self, Corners};
use super::random::Random;
use super::shapes;

/// A scene about the origin, with half the diagonal of what is in it.
#[derive(Debug, Clone)]
pub(super) struct Case {
    pub(super) scene: Scene,
    pub(super) size_mm: f64,
}

/// What may be in a scene.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contents {
    /// The most volumes.
    pub(super) volumes: usize,
    /// Whether they may be cut.
    pub(super) cut: bool,
    /// The most surfaces.
    pub(super) meshes: usize,
}

/// A scene of at least one volume.
pub(super) fn any(random: &mut Random, contents: Contents) -> Case {
    let spacing = random.power(-2.0, 1.0);
    let first = grid(random, spacing);
    let size_mm = corners(&first, &Affine::identity()).iter().map(|p| p.coords.norm()).fold(0.0, f64::max);
    let mut volumes = vec![volume(random, first, size_mm, contents.cut)];
    for _ in 0..random.below(contents.volumes) {
        let mut grid = grid(random, spacing);
        // Of any shape, but about as large as the first.
        let own = corners(&grid, &Affine::identity()).iter().map(|p| p.coords.norm()).fold(0.0, f64::max);
        let [x, y, z] = [Vector::x(), Vector::y(), Vector::z()].map(|axis| axis * (size_mm / own));
        let scale = Affine::from_columns(x, y, z, Point::origin()).expect("a scale");
        let place = scale * *grid.world_from_voxel();
        grid = grid.with_world_from_voxel(place);
        volumes.push(volume(random, grid, size_mm, contents.cut));
    }
    let mut meshes = Vec::new();
    for _ in 0..random.below(contents.meshes + 1) {
        meshes.push(shapes::any(random, size_mm));
    }
    let camera = camera(random, &volumes, size_mm);
    let background = random.one(&[[0.0; 3], [1.0; 3], [0.1, 0.2, 0.3]]);
    Case { scene: Scene { volumes, meshes, grids: Vec::new(), camera, background }, size_mm }
}

/// The corners of a volume's box, where `pose` takes it.
pub(super) fn corners(grid: &Grid, pose: &Affine) -> Corners {
    let place = *pose * *grid.world_from_voxel();
    std::array::from_fn(|bits| {
        let end = |axis: usize| if bits >> axis & 1 == 1 { grid.extent()[axis] as f64 - 0.5 } else { -0.5 };
        place.point(&Point::new(end(0), end(1), end(2)))
    })
}

fn volume(random: &mut Random, grid: Grid, size: f64, cut: bool) -> VolumeItem {
    let transfer = transfer(random, grid.range(), size);
    let pose = match random.below(3) {
        0 => Affine::identity(),
        1 => Affine::translation(random.shift(size * 0.2)),
        _ => random.turn(),
    };
    let at = corners(&grid, &pose);
    let pieces = if cut && random.chance(0.6) { parts::any(random, &at, size) } else { vec![Piece::whole()] };
    VolumeItem {
        grid: Arc::new(grid),
        packed: None,
        pose,
        transfer: Arc::new(transfer),
        shading: Shading::None,
        texture: TextureFormat::R32f,
        pieces,
        labels: None,
        mode: VolumeMode::Composite,
    }
}

/// A small grid about the origin with voxels of about `spacing` along the finest axis.
fn grid(random: &mut Random, spacing: f64) -> Grid {
    let mut extent = [0; 3].map(|_: usize| random.one(&[1, 2, 3, 5, 8]));
    let mut sides = [spacing; 3];
    if random.chance(0.3) {
        let axis = random.below(3);
        sides[axis] *= random.power(0.0, 2.0);
        // Few of the long ones, so that a picture of fine steps stays small.
        extent[axis] = extent[axis].min(2);
    }
    let mut columns = [Vector::x() * sides[0], Vector::y() * sides[1], Vector::z() * sides[2]];
    if random.chance(0.2) {
        columns[0] *= -1.0;
    }
    let turn = if random.chance(0.5) { random.turn() } else { Affine::identity() };
    let [x, y, z] = columns.map(|c| turn.vector(&c));
    let middle = |i: usize| (extent[i] as f64 - 1.0) / 2.0;
    let first = Point::origin() - x * middle(0) - y * middle(1) - z * middle(2);
    let place = Affine::from_columns(x, y, z, first).expect("three directions");
    let values = values(random, extent);
    let samples = match random.below(3) {
        0 => Samples::I16(values.iter().map(|v| *v as i16).collect()),
        1 => Samples::F64(values),
        _ => Samples::F32(values.iter().map(|v| *v as f32).collect()),
    };
    Grid::new(extent, samples, Rescale::default(), place).expect("as many samples as voxels")
}

fn values(random: &mut Random, extent: [usize; 3]) -> Vec<f64> {
    let count = extent.iter().product();
    let (low, high) = (random.between(-1000.0, 0.0), random.between(1.0, 2000.0));
    let kind = random.below(5);
    let slope = random.direction() * (high - low) / 8.0;
    let mut values: Vec<f64> = (0..count)
        .map(|i| {
            let [x, y, z] = [i % extent[0], i / extent[0] % extent[1], i / (extent[0] * extent[1])];
            match kind {
                0 => high,
                1 => random.between(low, high),
                2 => f64::midpoint(low, high) + slope.dot(&Vector::new(x as f64, y as f64, z as f64)),
                3 => {
                    if (x + y + z) % 2 == 0 {
                        low
                    } else {
                        high
                    }
                }
                _ => {
                    if i == count / 2 {
                        high
                    } else {
                        low
                    }
                }
            }
        })
        .collect();
    if random.chance(0.2) {
        for _ in 0..=random.below(3) {
            let at = random.below(count);
            values[at] = random.one(&[f64::NAN, f64::INFINITY, f64::NEG_INFINITY]);
        }
    }
    values
}

/// A transfer function over a range of values: ramps, jumps, doubled points, opacity from 0 to 1.
pub(super) fn transfer(random: &mut Random, [low, high]: [f64; 2], size: f64) -> Transfer {
    let span = (high - low).max(1.0);
    let mut at = low - random.between(-0.5, 0.5) * span;
    let mut points = Vec::new();
    for _ in 0..=random.below(5) {
        for _ in 0..random.one(&[1, 1, 1, 2, 3]) {
            let opacity = match random.below(6) {
                0 => 0.0,
                1 => 1.0,
                2 => random.power(-6.0, -2.0),
                _ => random.part(),
            };
            let rgba = [random.part(), random.part(), random.part(), opacity];
            points.push(ControlPoint { value: at, rgba });
        }
        at += random.between(0.01, 0.6) * span;
    }
    Transfer::new(points, size * random.power(-1.5, 0.5)).expect("rising values")
}

/// A view of everything, of part of it, from inside, along an axis, or with up along the view.
fn camera(random: &mut Random, volumes: &[VolumeItem], size: f64) -> Camera {
    let first = &volumes[0];
    let at = corners(&first.grid, &first.pose);
    let axis = random.one(&[Vector::x(), -Vector::x(), Vector::y(), Vector::z(), -Vector::z()]);
    let away = if random.chance(0.3) { axis } else { random.direction() };
    let target = Point::from(random.shift(size * 0.1));
    let eye = match random.below(8) {
        // Inside, perhaps.
        0 => Point::from(random.shift(size * 0.5)),
        // On a face.
        1 => at[0] + (at[1] - at[0]) * random.part() + (at[2] - at[0]) * random.part(),
        // On a plane that cuts.
        2 => match first.pieces.first().and_then(|p| p.keep.first()).map(|(cutter, _)| *cutter.shape()) {
            Some(Shape::Plane { point, .. }) => point,
            _ => at[7],
        },
        _ => target + away * (size * random.power(0.1, 1.0)),
    };
    let forward = target - eye;
    let target = if forward.norm() < 1e-6 * size { target + axis * size } else { target };
    let up = if random.chance(0.2) {
        target - eye
    } else {
        {
            let any = random.direction();
            random.one(&[Vector::z(), Vector::y(), any])
        }
    };
    let projection = if random.chance(0.3) {
        Projection::Parallel { height_mm: size * random.power(-0.5, 0.5) }
    } else {
        let reach = (target - eye).norm();
        let fits = 2.0 * (size / reach.max(size * 0.5)).atan();
        Projection::Perspective { fov_rad: (fits * random.between(0.3, 1.2)).clamp(0.01, 2.6) }
    };
    Camera { eye, target, up, projection }
}

/// All of a scene moved alike; `by` may mirror.
pub(super) fn moved(scene: &Scene, by: &Affine) -> Scene {
    let mut scene = scene.clone();
    let cutter = |cutter: &Cutter| match *cutter.shape() {
        // A normal, since `by` may mirror.
        Shape::Plane { point, normal } => {
            let shape = Shape::Plane { point: by.point(&point), normal: by.normal(&normal) };
            Cutter::new(shape, cutter.kerf_mm()).expect("finite numbers")
        }
        _ => cutter.moved(by),
    };
    for volume in &mut scene.volumes {
        volume.pose = *by * volume.pose;
        for piece in &mut volume.pieces {
            piece.pose = *by * piece.pose * by.inverse();
            for (kept, _) in &mut piece.keep {
                *kept = cutter(kept);
            }
        }
    }
    for mesh in &mut scene.meshes {
        mesh.pose = *by * mesh.pose;
    }
    for grid in &mut scene.grids {
        grid.pose = *by * grid.pose;
    }
    scene.camera.eye = by.point(&scene.camera.eye);
    scene.camera.target = by.point(&scene.camera.target);
    scene.camera.up = by.vector(&scene.camera.up);
    scene
}

/// Sub-steps so fine, in voxels of the finest volume, that what a picture is off by is no matter of sampling; coarser
/// where there would be too many.
pub(super) fn fine(case: &Case) -> f64 {
    let spacing = |v: &VolumeItem| v.grid.spacing_mm().into_iter().fold(f64::INFINITY, f64::min);
    let finest = case.scene.volumes.iter().map(spacing).fold(f64::INFINITY, f64::min);
    let voxels = 2.0 * case.size_mm / finest;
    // Where many pieces meet, every sub-step is a slab of its own.
    let pieces: usize = case.scene.volumes.iter().map(|v| v.pieces.len()).sum();
    let most = if pieces > 4 { 250.0 } else { 1000.0 };
    (voxels / most).clamp(1.0 / 32.0, 1.0)
}
