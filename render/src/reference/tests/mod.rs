//! The reference against what is known without it: closed forms, and a plain march in tiny steps.

mod closed;
mod crossings;
mod exactness;
mod labels;
mod march;
mod modes;
mod pieces;
mod surfaces;

use std::sync::Arc;

use super::{Options, draw_pixels};
use crate::scene::{Camera, MeshItem, Piece, Projection, Scene, Shading, TextureFormat, VolumeItem};
use crate::volume::{Affine, ControlPoint, Grid, Point, Transfer, TriangleMesh, Vector, synth};

fn point(value: f64, rgba: [f64; 4]) -> ControlPoint {
    ControlPoint { value, rgba }
}

fn transfer(points: &[ControlPoint]) -> Arc<Transfer> {
    Arc::new(Transfer::new(points.to_vec(), 1.0).expect("a transfer function"))
}

/// One colour and opacity per mm for every value.
fn flat(rgba: [f64; 4]) -> Arc<Transfer> {
    transfer(&[point(0.0, rgba)])
}

fn volume(grid: Grid, transfer: Arc<Transfer>) -> VolumeItem {
    VolumeItem {
        packed: None,
        grid: Arc::new(grid),
        pose: Affine::identity(),
        transfer,
        shading: Shading::None,
        texture: TextureFormat::Auto,
        pieces: vec![Piece::whole()],
        labels: None,
        mode: Default::default(),
    }
}

/// Homogeneous, `extent` voxels of 1 mm from the origin on: its box starts at -0.5 mm.
fn block(extent: [usize; 3], rgba: [f64; 4]) -> VolumeItem {
    volume(synth::homogeneous(extent, 7.0, Affine::identity()).expect("a grid"), flat(rgba))
}

/// Smooth bumps with noise on them, values from about -150 to 350, voxels of 0.9 × 1.1 × 1.6 mm.
fn noisy(extent: [usize; 3]) -> Grid {
    let columns = Affine::from_columns(
        Vector::new(0.9, 0.0, 0.0),
        Vector::new(0.0, 1.1, 0.0),
        Vector::new(0.0, 0.0, 1.6),
        Point::new(-6.0, -7.0, -8.0),
    );
    synth::from_voxels(extent, columns.expect("a transform"), |at| {
        let [x, y, z] = at.map(|i| i as f64);
        (100.0 + 200.0 * (x * 0.7).sin() * (y * 0.5).cos() * (z * 0.6).sin() + 50.0 * synth::noise(3, at))
            .round()
    })
    .expect("a grid")
}

/// A transfer function with a clear foot, a ramp, a bend and a jump.
fn steep() -> Arc<Transfer> {
    transfer(&[
        point(50.0, [0.2, 0.1, 0.6, 0.0]),
        point(120.0, [0.9, 0.4, 0.2, 0.15]),
        point(160.0, [0.3, 0.9, 0.2, 0.05]),
        point(160.0, [0.9, 0.9, 0.8, 0.4]),
        point(260.0, [1.0, 1.0, 0.9, 0.7]),
    ])
}

fn perspective(eye: Point, target: Point) -> Camera {
    Camera { eye, target, up: Vector::z(), projection: Projection::Perspective { fov_rad: 0.6 } }
}

fn parallel(eye: Point, target: Point, height_mm: f64) -> Camera {
    Camera { eye, target, up: Vector::z(), projection: Projection::Parallel { height_mm } }
}

fn scene(volumes: Vec<VolumeItem>, meshes: Vec<MeshItem>, camera: Camera) -> Scene {
    Scene { volumes, meshes, grids: Vec::new(), camera, background: [0.0; 3] }
}

/// Two triangles about `centre`, spanned by `a` and `b` to either side.
fn quad(centre: Point, a: Vector, b: Vector, color: [f64; 3], opacity: f64) -> MeshItem {
    let corners = vec![centre - a - b, centre + a - b, centre + a + b, centre - a + b];
    MeshItem {
        mesh: Arc::new(TriangleMesh::new(corners, vec![[0, 1, 2], [2, 3, 0]]).expect("a mesh")),
        pose: Affine::identity(),
        color,
        opacity,
        shading: Shading::None,
    }
}

fn pixels_with(scene: &Scene, size: [u32; 2], options: Options) -> Vec<[f64; 4]> {
    let all: Vec<_> = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))).collect();
    draw_pixels(scene, size, &options, &all).expect("a picture")
}

fn pixels(scene: &Scene, size: [u32; 2]) -> Vec<[f64; 4]> {
    pixels_with(scene, size, Options::default())
}

/// The ray of every pixel by the definition of a picture, rows from the top: start and direction.
fn rays(camera: &Camera, [width, height]: [u32; 2]) -> Vec<(Point, Vector)> {
    let forward = (camera.target - camera.eye).normalize();
    let right = forward.cross(&camera.up).normalize();
    let up = right.cross(&forward);
    let mut rays = Vec::new();
    for j in 0..height {
        for i in 0..width {
            let u = ((f64::from(i) + 0.5) / f64::from(width) - 0.5) * f64::from(width) / f64::from(height);
            let v = 0.5 - (f64::from(j) + 0.5) / f64::from(height);
            rays.push(match camera.projection {
                Projection::Perspective { fov_rad } => {
                    let plane = 2.0 * (fov_rad / 2.0).tan();
                    (camera.eye, (forward + (right * u + up * v) * plane).normalize())
                }
                Projection::Parallel { height_mm } => {
                    (camera.eye + (right * u + up * v) * height_mm, forward)
                }
            });
        }
    }
    rays
}

fn largest_difference(a: &[[f64; 4]], b: &[[f64; 4]]) -> f64 {
    assert_eq!(a.len(), b.len(), "pictures of one size");
    let channels = a.iter().flatten().zip(b.iter().flatten());
    channels
        .map(|(p, q)| if p.is_finite() && q.is_finite() { (p - q).abs() } else { f64::INFINITY })
        .fold(0.0, f64::max)
}
