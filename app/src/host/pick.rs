//! What is seen at a place of the 3D picture: a walk along the ray on the CPU, through the original data.

use render::scene::Scene;
use render::section;
use render::volume::{Affine, Point};

use super::camera::{Ball, Ray};

/// Steps along the ray through the ball about everything.
const STEPS: usize = 1500;
/// The place is where this much of the light is stopped.
const SEEN: f64 = 0.5;

/// A piece of a volume with the way back to its samples.
struct Prepared<'a> {
    item: &'a render::scene::VolumeItem,
    piece: &'a render::scene::Piece,
    unmoved_from_world: Affine,
    voxel_from_world: Affine,
}

/// The place along `ray` where half the light is stopped by the volumes and grids, or the nearest opaque crossing
/// of a surface before it; `None` where one sees through.
pub fn place(scene: &Scene, ball: Ball, ray: &Ray) -> Option<Point> {
    let soft = soft_place(scene, ball, ray);
    let surface = surface_distance(scene, ray);
    match (soft, surface) {
        (Some(a), Some(b)) => Some(ray.at(a.min(b))),
        (a, b) => a.or(b).map(|d| ray.at(d)),
    }
}

fn soft_place(scene: &Scene, ball: Ball, ray: &Ray) -> Option<f64> {
    let middle = (ball.centre - ray.origin).dot(&ray.direction);
    let start = (middle - ball.radius_mm * 1.5).max(0.0);
    let end = middle + ball.radius_mm * 1.5;
    let step_mm = (end - start) / STEPS as f64;
    let prepare = |item| {
        let item: &render::scene::VolumeItem = item;
        let voxel_from_unmoved = (item.pose * *item.grid.world_from_voxel()).inverse();
        item.pieces.iter().map(move |piece| {
            let unmoved_from_world = piece.pose.inverse();
            let voxel_from_world = voxel_from_unmoved * unmoved_from_world;
            Prepared { item, piece, unmoved_from_world, voxel_from_world }
        })
    };
    let pieces: Vec<Prepared<'_>> = scene.volumes.iter().flat_map(prepare).collect();
    let of_grids = grids_depth(scene, ray, start, step_mm);
    let mut through = 1.0_f64;
    for (step, depth) in of_grids.into_iter().enumerate() {
        through *= (-depth).exp();
        let distance = start + (step as f64 + 0.5) * step_mm;
        let p = ray.at(distance);
        for of in &pieces {
            let Some(value) = of.item.grid.sample(&of.voxel_from_world.point(&p)) else { continue };
            let unmoved = of.unmoved_from_world.point(&p);
            if of.piece.keep.iter().all(|(cutter, side)| cutter.keeps(*side, &unmoved)) {
                let (_, extinction) = of.item.transfer.classify(value);
                through *= (-extinction * step_mm).exp();
            }
        }
        if through <= 1.0 - SEEN {
            return Some(distance);
        }
    }
    None
}

/// The optical depth of the grids in each of the steps along the ray.
fn grids_depth(scene: &Scene, ray: &Ray, start: f64, step_mm: f64) -> Vec<f64> {
    let mut depth = vec![0.0; STEPS];
    for item in &scene.grids {
        for span in section::cell_spans(item, &ray.origin, &ray.direction) {
            let [from, to] = span.reach;
            let first = ((from - start) / step_mm).max(0.0) as usize;
            let end = (((to - start) / step_mm).ceil().max(0.0) as usize).min(STEPS);
            for (step, depth) in depth.iter_mut().enumerate().take(end).skip(first) {
                let begin = start + step as f64 * step_mm;
                let (a, b) = (from.max(begin), to.min(begin + step_mm));
                let (_, extinction) = item.transfer.classify(span.value(0.5 * (a + b)));
                *depth += extinction * (b - a).max(0.0);
            }
        }
    }
    depth
}

/// Distance to the nearest crossing with a surface that stops at least half the light (Möller and
/// Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection").
fn surface_distance(scene: &Scene, ray: &Ray) -> Option<f64> {
    let mut nearest: Option<f64> = None;
    for item in scene.meshes.iter().filter(|m| m.opacity >= SEEN) {
        let back = item.pose.inverse();
        // Not normalised, so that distances along it are still world millimetres.
        let (origin, direction) = (back.point(&ray.origin), back.vector(&ray.direction));
        for triangle in 0..item.mesh.triangles().len() {
            let [a, b, c] = item.mesh.corners(triangle);
            let (u, v) = (b - a, c - a);
            let p = direction.cross(&v);
            let determinant = u.dot(&p);
            if determinant.abs() < 1e-14 {
                continue;
            }
            let t = origin - a;
            let q = t.cross(&u);
            let (s, r) = (t.dot(&p) / determinant, direction.dot(&q) / determinant);
            let distance = v.dot(&q) / determinant;
            if s >= 0.0 && r >= 0.0 && s + r <= 1.0 && distance > 0.0 {
                nearest = Some(nearest.map_or(distance, |n| n.min(distance)));
            }
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::host::camera::Facing;
    use render::scene::{CellItem, MeshItem, Piece, Shading, TextureFormat, VolumeItem};
    use render::volume::cells::{CellGrid, CellKind, Field, Part, Place, Scalar, Step, Values};
    use render::volume::{ControlPoint, Grid, Rescale, Samples, Transfer, TriangleMesh, Vector};

    fn ball() -> Ball {
        Ball { centre: Point::new(10.0, 10.0, 10.0), radius_mm: 20.0 }
    }

    /// A cube from -0.5 to 20.5 that is opaque within a fraction of a millimetre.
    fn scene() -> Scene {
        let n = 21;
        let grid = Grid::new([n; 3], Samples::U8(vec![9; n * n * n]), Rescale::default(), Affine::identity());
        let point = ControlPoint { value: 0.0, rgba: [1.0, 1.0, 1.0, 0.99999] };
        let item = VolumeItem {
            packed: None,
            grid: Arc::new(grid.expect("grid")),
            pose: Affine::identity(),
            transfer: Arc::new(Transfer::new(vec![point], 1.0).expect("transfer")),
            shading: Shading::None,
            texture: TextureFormat::Auto,
            pieces: vec![Piece::whole()],
            labels: None,
            mode: Default::default(),
        };
        let camera = Facing::Anterior.camera(ball());
        Scene { volumes: vec![item], meshes: Vec::new(), grids: Vec::new(), camera, background: [0.0; 3] }
    }

    fn ray() -> Ray {
        Ray { origin: Point::new(7.0, -60.0, 12.0), direction: Vector::y() }
    }

    #[test]
    fn the_place_is_on_the_near_face_of_an_opaque_cube() {
        let p = place(&scene(), ball(), &ray()).expect("met");
        assert!((p - Point::new(7.0, -0.5, 12.0)).norm() < 0.2, "{p}");
        let beside = Ray { origin: Point::new(70.0, -60.0, 12.0), ..ray() };
        assert_eq!(place(&scene(), ball(), &beside), None, "beside it");
    }

    #[test]
    fn a_moved_piece_is_met_where_it_is() {
        let mut scene = scene();
        scene.volumes[0].pieces[0].pose = Affine::translation(Vector::new(0.0, 5.0, 0.0));
        let p = place(&scene, ball(), &ray()).expect("met");
        assert!((p.y - 4.5).abs() < 0.2, "{p}");
    }

    #[test]
    fn a_grid_is_met_where_it_stops_half_the_light() {
        let field = Field::new("s".to_owned(), 1, Values::F64(vec![9.0]));
        let step = Step { time: 0.0, point_fields: vec![], cell_fields: vec![field] };
        let (a, b) = (0.0, 20.0);
        let corners = [[a, a], [b, a], [b, b], [a, b]];
        let points = [a, b].into_iter().flat_map(|z| corners.map(|[x, y]| Point::new(x, y, z))).collect();
        let cells = CellGrid::new(points, vec![CellKind::Hexahedron], (0..8).collect(), vec![step]);
        // A tenth of the light passes 10 mm.
        let point = ControlPoint { value: 0.0, rgba: [1.0, 1.0, 1.0, 0.9] };
        let mut scene = scene();
        scene.volumes.clear();
        scene.grids = vec![CellItem {
            grid: Arc::new(cells.expect("cells")),
            step: 0,
            scalar: Scalar { place: Place::Cells, name: "s".to_owned(), part: Part::Component(0) },
            pose: Affine::translation(Vector::new(0.0, 3.0, 0.0)),
            transfer: Arc::new(Transfer::new(vec![point], 10.0).expect("transfer")),
        }];
        let p = place(&scene, ball(), &ray()).expect("met");
        let known = 3.0 + 10.0 * 0.5_f64.log10().abs();
        assert!((p - Point::new(7.0, known, 12.0)).norm() < 0.05, "{p}, not {known}");
        let beside = Ray { origin: Point::new(7.0, -60.0, 21.0), ..ray() };
        assert_eq!(place(&scene, ball(), &beside), None, "beside it");
    }

    #[test]
    fn a_surface_before_the_volume_is_met_first_if_it_is_opaque() {
        let corners = [[-50.0, 0.0, -50.0], [50.0, 0.0, -50.0], [0.0, 0.0, 80.0]];
        let mesh = TriangleMesh::new(corners.map(Point::from).to_vec(), vec![[0, 1, 2]]).expect("mesh");
        let pose = Affine::translation(Vector::new(0.0, -9.0, 0.0));
        let item = |opacity| MeshItem {
            mesh: Arc::new(mesh.clone()),
            pose,
            color: [1.0; 3],
            opacity,
            shading: Shading::None,
        };
        let mut scene = scene();
        scene.meshes = vec![item(1.0)];
        let p = place(&scene, ball(), &ray()).expect("met");
        assert!((p - Point::new(7.0, -9.0, 12.0)).norm() < 1e-9, "on the surface: {p}");
        scene.meshes = vec![item(0.2)];
        let p = place(&scene, ball(), &ray()).expect("met");
        assert!((p.y + 0.5).abs() < 0.2, "through a faint surface: {p}");
    }
}
