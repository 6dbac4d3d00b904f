//! Scenes whose pictures are known without a renderer: by a closed form, or by an integral of the formula that the
//! samples were taken from.

use std::sync::Arc;

use ::render::scene::{Camera, Piece, Projection, Scene, Shading, TextureFormat, VolumeItem, VolumeMode};
use ::render::volume::{Affine, ControlPoint, Cutter, Point, Side, Transfer, Vector, synth};

use super::ray::{Cube, Ray, integral, layers};
use crate::headless::Failure;

/// Side of every cube, mm.
const SIDE_MM: f64 = 24.0;
/// Thickness that opacities are of, mm.
const UNIT_MM: f64 = 4.0;
/// Where the smooth ball ends, mm from its centre.
const BALL_MM: f64 = 10.5;
/// Distance of the eye from the middle, mm.
const EYE_MM: f64 = 60.0;
/// Half the picture's side as the eye sees it: a tangent, or mm.
const TANGENT: f64 = 0.13;
const HALF_MM: f64 = 17.0;

type Truth = Box<dyn Fn(&Ray) -> [f64; 4] + Sync>;

/// A scene with its picture, which is square.
pub(super) struct Known {
    pub(super) name: &'static str,
    pub(super) scene: Scene,
    truth: Truth,
}

impl Known {
    /// The format of its texture.
    pub(super) fn format(&self) -> TextureFormat {
        self.scene.volumes.first().map_or(TextureFormat::Auto, |volume| volume.texture)
    }

    /// The same from a texture of another format.
    pub(super) fn with_texture(mut self, format: TextureFormat) -> Self {
        for volume in &mut self.scene.volumes {
            volume.texture = format;
        }
        self
    }

    /// What is seen at a place of the picture, -1 to 1 from the left and from the bottom.
    pub(super) fn seen(&self, [u, v]: [f64; 2]) -> [f64; 4] {
        let eye = Point::new(0.0, -EYE_MM, 0.0);
        let ray = match self.scene.camera.projection {
            Projection::Perspective { .. } => {
                Ray { origin: eye, direction: Vector::new(TANGENT * u, 1.0, TANGENT * v).normalize() }
            }
            Projection::Parallel { .. } => {
                Ray { origin: eye + Vector::new(HALF_MM * u, 0.0, HALF_MM * v), direction: Vector::y() }
            }
        };
        (self.truth)(&ray)
    }
}

/// The scenes whose slices are refined: those of closed form, then the one with a smooth integrand.
pub(super) fn for_spacing() -> Result<Vec<Known>, Failure> {
    Ok(vec![slab()?, ramp()?, jump()?, cut()?, product()?])
}

/// A cube of one value, seen askew.
fn slab() -> Result<Known, Failure> {
    let cube = cube(12, true)?;
    let scene = scene(&cube, &[(0.0, RED, 0.3), (1.0, RED, 0.3)], false, |_| 0.5)?;
    let tau = tau(0.3);
    let truth = move |ray: &Ray| layers(&[(length(&cube.stretches(ray)), RED, tau)]);
    Ok(Known { name: "slab", scene, truth: Box::new(truth) })
}

/// Opacity that rises along the view: -∫ln(1 - a) da is (1 - a) ln(1 - a) + a.
fn ramp() -> Result<Known, Failure> {
    let cube = cube(12, false)?;
    let (first, last) = (0.05, 0.6);
    let scene = scene(&cube, &[(0.0, RED, first), (1.0, RED, last)], false, move |p| p.y / 11.0)?;
    let voxel = SIDE_MM / 12.0;
    let primitive = |a: f64| (1.0 - a) * (-a).ln_1p() + a;
    let rising = (primitive(last) - primitive(first)) / (last - first) / UNIT_MM * (11.0 * voxel);
    let truth = move |ray: &Ray| {
        let inside = !cube.stretches(ray).is_empty();
        let depth = rising + (tau(first) + tau(last)) * voxel / 2.0;
        layers(&[(if inside { 1.0 } else { 0.0 }, RED, depth)])
    };
    Ok(Known { name: "ramp", scene, truth: Box::new(truth) })
}

/// A value that rises askew, and a transfer function that jumps: two homogeneous parts.
fn jump() -> Result<Known, Failure> {
    let cube = cube(12, true)?;
    let at = 0.37;
    let points = [(0.0, RED, 0.1), (at, RED, 0.1), (at, BLUE, 0.5), (1.0, BLUE, 0.5)];
    let scene = scene(&cube, &points, false, |p| p.x / 11.0)?;
    let truth = move |ray: &Ray| {
        let inverse = cube.world_from_voxel.inverse();
        let (p, d) = (inverse.point(&ray.origin).x, inverse.vector(&ray.direction).x);
        let cross = (11.0 * at - p) / d;
        let (low, high) = ((RED, tau(0.1)), (BLUE, tau(0.5)));
        let (front, back) = if d > 0.0 { (low, high) } else { (high, low) };
        let ends = cube.stretches(ray);
        let (Some(near), Some(far)) = (ends.first(), ends.last()) else { return [0.0; 4] };
        let cross = cross.clamp(*near, *far);
        layers(&[(cross - near, front.0, front.1), (far - cross, back.0, back.1)])
    };
    Ok(Known { name: "jump", scene, truth: Box::new(truth) })
}

/// A cube of one value, cut askew, of which the part before the plane is left.
fn cut() -> Result<Known, Failure> {
    let cube = cube(12, true)?;
    let mut scene = scene(&cube, &[(0.0, BLUE, 0.4), (1.0, BLUE, 0.4)], false, |_| 0.5)?;
    let (point, normal) = (Point::new(0.7, -1.3, 0.4), Vector::new(0.3, 1.0, -0.2));
    let cutter = Cutter::plane(point, normal).map_err(|e| Failure::Other(e.to_string()))?;
    scene.volumes[0].pieces = vec![Piece { keep: vec![(cutter, Side::Minus)], pose: Affine::identity() }];
    let truth = move |ray: &Ray| {
        let ends = cube.stretches(ray);
        let (Some(near), Some(far)) = (ends.first(), ends.last()) else { return [0.0; 4] };
        let cross = normal.dot(&(point - ray.origin)) / normal.dot(&ray.direction);
        layers(&[((cross.min(*far) - near).max(0.0), BLUE, tau(0.4))])
    };
    Ok(Known { name: "cut", scene, truth: Box::new(truth) })
}

/// A product of three linear functions, which trilinear interpolation gives back, in perspective. Every ray comes in
/// by the front face and leaves by the back one, so that the picture is smooth.
pub(super) fn product() -> Result<Known, Failure> {
    let cube = cube(12, false)?;
    let value = |p: &Point| {
        let [x, y, z] = [p.x / 11.0, p.y / 11.0, p.z / 11.0];
        (0.3 + 0.7 * x) * (1.0 - 0.6 * y) * (0.4 + 0.6 * z)
    };
    let scene = scene(&cube, &[(0.0, RED, 0.02), (1.0, BLUE, 0.7)], true, value)?;
    let truth = move |ray: &Ray| {
        integral(&cube.stretches(ray), |t| linear(value(&cube.held(&ray.at(t))), [0.02, 0.7]))
    };
    Ok(Known { name: "product", scene, truth: Box::new(truth) })
}

/// A smooth ball, (1 - r²/R²)³, on `count` voxels a side: the truth is that of the formula, not of the samples.
pub(super) fn ball(count: usize) -> Result<Known, Failure> {
    let cube = cube(count, false)?;
    let value = |p: &Point| (1.0 - p.coords.norm_squared() / (BALL_MM * BALL_MM)).max(0.0).powi(3);
    let place = cube.world_from_voxel;
    let scene = scene(&cube, &[(0.0, RED, 0.0), (1.0, BLUE, 0.7)], false, move |p| value(&place.point(p)))?;
    let truth = move |ray: &Ray| {
        let middle = -ray.origin.coords.dot(&ray.direction);
        let half = BALL_MM * BALL_MM - ray.at(middle).coords.norm_squared();
        if half <= 0.0 {
            return [0.0; 4];
        }
        let half = half.sqrt();
        integral(&[middle - half, middle + half], |t| linear(value(&ray.at(t)), [0.0, 0.7]))
    };
    Ok(Known { name: "ball", scene, truth: Box::new(truth) })
}

const RED: [f64; 3] = [1.0, 0.3, 0.1];
const BLUE: [f64; 3] = [0.1, 0.5, 1.0];

/// Extinction of an opacity per unit; 1/mm.
fn tau(opacity: f64) -> f64 {
    -(-opacity).ln_1p() / UNIT_MM
}

/// Colour and extinction of a value from 0, red, to 1, blue, with opacities at either end.
fn linear(value: f64, [first, last]: [f64; 2]) -> ([f64; 3], f64) {
    let color = std::array::from_fn(|c| RED[c] + (BLUE[c] - RED[c]) * value);
    (color, tau(first + (last - first) * value))
}

fn length(ends: &[f64]) -> f64 {
    ends.last().zip(ends.first()).map_or(0.0, |(far, near)| far - near)
}

/// A cube about the origin, straight or turned.
fn cube(count: usize, turned: bool) -> Result<Cube, Failure> {
    let voxel = SIDE_MM / count as f64;
    let first = Point::from([-(SIDE_MM - voxel) / 2.0; 3]);
    let [x, y, z] = [Vector::x(), Vector::y(), Vector::z()].map(|axis| axis * voxel);
    let straight = Affine::from_columns(x, y, z, first).map_err(|e| Failure::Other(e.to_string()))?;
    let turn = if turned { 0.5 } else { 0.0 };
    let turn = Affine::rotation_about(Point::origin(), Vector::new(0.6, 0.2, 1.0), turn);
    Ok(Cube { count, world_from_voxel: turn * straight })
}

/// A scene of one cube with `value` at each voxel, through control points of value, colour and opacity.
fn scene(
    cube: &Cube,
    points: &[(f64, [f64; 3], f64)],
    perspective: bool,
    value: impl Fn(&Point) -> f64 + Sync,
) -> Result<Scene, Failure> {
    let of = |at: [usize; 3]| value(&Point::from(at.map(|i| i as f64)));
    let grid = synth::from_voxels([cube.count; 3], cube.world_from_voxel, of);
    let grid = grid.map_err(|e| Failure::Other(e.to_string()))?;
    let point = |&(value, [r, g, b], a): &(f64, [f64; 3], f64)| ControlPoint { value, rgba: [r, g, b, a] };
    let transfer = Transfer::new(points.iter().map(point).collect(), UNIT_MM);
    let transfer = transfer.map_err(|e| Failure::Other(e.to_string()))?;
    let projection = if perspective {
        Projection::Perspective { fov_rad: 2.0 * TANGENT.atan() }
    } else {
        Projection::Parallel { height_mm: 2.0 * HALF_MM }
    };
    let volume = VolumeItem {
        grid: Arc::new(grid),
        packed: None,
        pose: Affine::identity(),
        transfer: Arc::new(transfer),
        shading: Shading::None,
        texture: TextureFormat::R32f,
        pieces: vec![Piece::whole()],
        labels: None,
        mode: VolumeMode::Composite,
    };
    let eye = Point::new(0.0, -EYE_MM, 0.0);
    let camera = Camera { eye, target: Point::origin(), up: Vector::z(), projection };
    Ok(Scene { volumes: vec![volume], meshes: Vec::new(), grids: Vec::new(), camera, background: [0.0; 3] })
}
