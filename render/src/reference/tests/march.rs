//! Everything at once against a plain march in tiny steps, written from the contract alone: it asks the
//! grid, the transfer function and the cutters themselves at every step.

use super::*;
use crate::scene::CellItem;
use crate::scene::light::{AMBIENT, DIFFUSE, FLAT, SHININESS, SPECULAR};
use crate::volume::cells::{CellKind, Field, Part, Place, Scalar, Step, Values};
use crate::volume::{CellGrid, Cutter, Side};

fn lit(color: [f64; 3], facing: f64) -> [f64; 3] {
    color.map(|c| (c * (AMBIENT + DIFFUSE * facing) + SPECULAR * facing.powf(SHININESS)).clamp(0.0, 1.0))
}

/// Colour and extinction of one piece at a place, if it is there.
fn at(item: &VolumeItem, piece: &Piece, p: &Point, direction: &Vector) -> Option<([f64; 3], f64)> {
    let unmoved = piece.pose.inverse().point(p);
    if !piece.keep.iter().all(|(cutter, side)| cutter.keeps(*side, &unmoved)) {
        return None;
    }
    let world_from_voxel = piece.pose * item.pose * *item.grid.world_from_voxel();
    let voxel = world_from_voxel.inverse().point(p);
    let value = item.grid.sample(&voxel)?;
    let (color, tau) = item.transfer.classify(value);
    if item.shading == Shading::None {
        return Some((color, tau));
    }
    let held = |axis: usize, by: f64| {
        let mut q = voxel;
        q[axis] += by;
        let n = item.grid.extent();
        let inside = std::array::from_fn::<f64, 3, _>(|a| q[a].clamp(-0.5, n[a] as f64 - 0.5));
        item.grid.sample(&Point::from(inside)).expect("inside")
    };
    let slope = Vector::from_fn(|axis, _| (held(axis, 1.0) - held(axis, -1.0)) / 2.0);
    let gradient = world_from_voxel.normal(&slope);
    let points = item.transfer.points();
    let span = points[points.len() - 1].value - points[0].value;
    let [low, high] = item.grid.range();
    let span = if span > 0.0 { span } else { high - low };
    let steep = gradient.norm() >= FLAT * span && gradient.norm() > 0.0;
    Some((if steep { lit(color, gradient.normalize().dot(direction).abs()) } else { color }, tau))
}

/// Colour and extinction of each tetrahedron of a grid at a place, by Cramer's rule.
fn in_cells(item: &CellItem, p: &Point) -> Vec<([f64; 3], f64)> {
    let field = item.scalar.field(&item.grid.steps()[item.step]).expect("a field");
    let mut found = Vec::new();
    for cell in 0..item.grid.len() {
        let corners: [u32; 4] = item.grid.cell(cell).1.try_into().expect("a tetrahedron");
        let [a, b, c, d] = corners.map(|n| item.pose.point(&item.grid.points()[n as usize]));
        let matrix = nalgebra::Matrix3::from_columns(&[b - a, c - a, d - a]);
        let w = matrix.try_inverse().expect("a volume") * (p - a);
        let weights = [1.0 - w.sum(), w.x, w.y, w.z];
        if weights.iter().all(|w| *w >= 0.0) {
            let values = corners.map(|n| field.value(n as usize, 0));
            let value = weights.iter().zip(values).map(|(w, v)| w * v).sum::<f64>();
            found.push(item.transfer.classify(value));
        }
    }
    found
}

/// Every crossing of the ray with a triangle, by Cramer's rule.
fn crossings(mesh: &MeshItem, start: &Point, direction: &Vector) -> Vec<(f64, [f64; 3], f64)> {
    let mut found = Vec::new();
    for t in 0..mesh.mesh.triangles().len() {
        let [a, b, c] = mesh.mesh.corners(t).map(|p| mesh.pose.point(&p));
        let (u, v) = (b - a, c - a);
        let matrix = nalgebra::Matrix3::from_columns(&[u, v, -direction]);
        let Some(inverse) = matrix.try_inverse() else { continue };
        let x = inverse * (start - a);
        if x.x >= 0.0 && x.y >= 0.0 && x.x + x.y <= 1.0 && x.z >= 0.0 {
            let facing = u.cross(&v).normalize().dot(direction).abs();
            let color = if mesh.shading == Shading::Lit { lit(mesh.color, facing) } else { mesh.color };
            found.push((x.z, color, mesh.opacity));
        }
    }
    found
}

fn march(scene: &Scene, (start, direction): (Point, Vector), [from, to]: [f64; 2], step: f64) -> [f64; 4] {
    let mut surfaces: Vec<_> = scene.meshes.iter().flat_map(|m| crossings(m, &start, &direction)).collect();
    surfaces.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut surfaces = surfaces.into_iter().peekable();
    let mut pixel = [0.0; 4];
    let mut through = 1.0;
    let mut add = |color: [f64; 3], alpha: f64| {
        for c in 0..3 {
            pixel[c] += through * alpha * color[c];
        }
        through *= 1.0 - alpha;
        pixel[3] = 1.0 - through;
    };
    for i in 0..((to - from) / step) as usize {
        let t = from + (i as f64 + 0.5) * step;
        while let Some((_, color, alpha)) = surfaces.next_if(|s| s.0 <= t) {
            add(color, alpha);
        }
        let p = start + direction * t;
        let (mut tau, mut glow) = (0.0, [0.0; 3]);
        for item in &scene.volumes {
            for (color, extinction) in item.pieces.iter().filter_map(|piece| at(item, piece, &p, &direction))
            {
                tau += extinction;
                for c in 0..3 {
                    glow[c] += extinction * color[c];
                }
            }
        }
        for (color, extinction) in scene.grids.iter().flat_map(|item| in_cells(item, &p)) {
            tau += extinction;
            for c in 0..3 {
                glow[c] += extinction * color[c];
            }
        }
        if tau > 0.0 {
            add(glow.map(|g| g / tau), 1.0 - (-tau * step).exp());
        }
    }
    for (_, color, alpha) in surfaces {
        add(color, alpha);
    }
    pixel
}

/// Five tetrahedra that make a cube, askew, among the volumes, and one that overlaps them.
fn grid() -> CellItem {
    let corner = |i: usize| [0, 1, 2].map(|a| if i >> a & 1 == 1 { 3.0 } else { -3.5 });
    let mut points: Vec<Point> = (0..8).map(|i| Point::from(corner(i))).collect();
    points.push(Point::new(1.0, 0.5, 6.0));
    let cells = [[0, 1, 2, 4], [3, 1, 2, 7], [5, 1, 4, 7], [6, 2, 4, 7], [1, 2, 4, 7], [0, 1, 2, 8]];
    let values = vec![0.0, 9.0, 3.0, 7.0, 1.0, 8.0, 2.0, 4.0, 6.0];
    let field = Field::new("s".to_owned(), 1, Values::F64(values));
    let steps = vec![Step { time: 0.0, point_fields: vec![field], cell_fields: Vec::new() }];
    let kinds = vec![CellKind::Tetra; cells.len()];
    CellItem {
        grid: Arc::new(CellGrid::new(points, kinds, cells.concat(), steps).expect("a grid")),
        step: 0,
        scalar: Scalar { place: Place::Points, name: "s".to_owned(), part: Part::Component(0) },
        pose: Affine::rotation_about(Point::origin(), Vector::new(0.3, 1.0, 0.2), 0.4),
        transfer: transfer(&[
            point(1.0, [0.9, 0.2, 0.1, 0.0]),
            point(4.0, [0.2, 0.9, 0.4, 0.2]),
            point(4.0, [0.2, 0.1, 0.9, 0.05]),
            point(8.0, [0.9, 0.9, 0.1, 0.3]),
        ]),
    }
}

/// Two volumes with their own poses that overlap, one of them lit and in three pieces, one of which is
/// turned, a grid among them, and two surfaces that cross.
fn everything() -> Scene {
    let mut first = volume(noisy([13, 12, 9]), steep());
    first.shading = Shading::Lit;
    let plane = Cutter::plane(Point::new(0.0, 0.5, 0.0), Vector::new(0.3, 1.0, 0.2)).expect("plane");
    let plane = plane.with_kerf(0.4).expect("kerf");
    let tube = Cutter::cylinder(Point::origin(), Vector::new(0.2, 0.1, 1.0), 3.5).expect("tube");
    let dome = Cutter::dome(Point::new(1.0, 1.5, 0.5), 2.5).expect("dome");
    let blade =
        Cutter::blade(Point::new(0.5, -1.0, 1.0), Vector::z(), Vector::new(1.0, 0.4, 0.0), [3.0, 4.0])
            .expect("blade");
    let turn = Affine::rotation_about(Point::new(2.0, 3.0, 0.0), Vector::new(0.0, 0.3, 1.0), 0.5);
    let away = turn * Affine::translation(Vector::new(1.0, 4.0, 0.5));
    first.pieces = vec![
        Piece { keep: vec![(plane, Side::Minus), (tube, Side::Minus)], pose: Affine::identity() },
        Piece { keep: vec![(plane, Side::Minus), (tube, Side::Plus)], pose: Affine::identity() },
        Piece { keep: vec![(plane, Side::Plus), (dome, Side::Plus), (blade, Side::Plus)], pose: away },
    ];
    let mut second = volume(
        noisy([7, 9, 8]),
        transfer(&[point(0.0, [0.1, 0.2, 0.9, 0.0]), point(200.0, [0.4, 1.0, 0.9, 0.2])]),
    );
    second.pose = Affine::rotation_about(Point::new(1.0, 0.0, -1.0), Vector::new(1.0, 1.0, 0.1), 0.7);
    let mut sheet = quad(
        Point::new(0.0, 0.0, 0.5),
        Vector::new(6.0, 2.0, 0.0),
        Vector::new(0.0, 3.0, 6.0),
        [0.9, 0.1, 0.1],
        0.4,
    );
    sheet.shading = Shading::Lit;
    let other =
        quad(Point::new(0.0, 1.0, 0.0), Vector::new(5.0, -3.0, 1.0), Vector::z() * 7.0, [0.1, 0.9, 0.1], 0.3);
    let eye = Point::new(19.0, -21.0, 8.0);
    let mut scene =
        scene(vec![first, second], vec![sheet, other], perspective(eye, Point::new(0.0, 0.0, 0.0)));
    scene.grids = vec![grid()];
    scene
}

#[test]
fn everything_at_once_is_what_a_march_in_tiny_steps_sees() {
    let mut scene = everything();
    let size = [9, 8];
    for projection in [scene.camera.projection, Projection::Parallel { height_mm: 14.0 }] {
        scene.camera.projection = projection;
        let all = pixels(&scene, size);
        let mut mean = 0.0;
        for (i, (pixel, ray)) in all.iter().zip(rays(&scene.camera, size)).enumerate().step_by(5) {
            let known = march(&scene, ray, [10.0, 50.0], 2e-3);
            let difference = largest_difference(&[*pixel], &[known]);
            // A step that straddles a jump errs by up to τ·step: 2e-3 here, several times on a ray.
            assert!(difference < 2e-3, "pixel {i}: {pixel:?} is not {known:?}");
            mean += difference / 15.0;
        }
        assert!(mean < 2e-4, "mean of the largest differences {mean:e}");
        assert!(all.iter().filter(|p| p[3] > 0.4).count() > 15, "something is drawn");
    }
}
