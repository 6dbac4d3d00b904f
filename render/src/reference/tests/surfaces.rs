//! Closed forms of meshes in and about a volume.

use super::*;
use crate::scene::light;

const SIZE: [u32; 2] = [12, 10];

/// A block of 8 mm from y = -0.5 to 7.5, seen along y, all rays through its near and far side.
fn wall() -> (VolumeItem, Camera, f64) {
    let view = parallel(Point::new(10.0, -20.0, 10.0), Point::new(10.0, 0.0, 10.0), 12.0);
    (block([21, 8, 21], [0.2, 0.4, 0.9, 0.15]), view, -(0.85_f64.ln()))
}

/// Front to back: a stretch of the wall, a surface, another stretch.
fn layered(before_mm: f64, tau: f64, mesh: &MeshItem, after_mm: f64) -> [f64; 4] {
    let mut known = [0.0; 4];
    let mut through = 1.0;
    let material = |mm: f64| ([0.2, 0.4, 0.9], 1.0 - (-tau * mm).exp());
    for (color, alpha) in [material(before_mm), (mesh.color, mesh.opacity), material(after_mm)] {
        for c in 0..3 {
            known[c] += through * alpha * color[c];
        }
        through *= 1.0 - alpha;
    }
    known[3] = 1.0 - through;
    known
}

fn wide(centre: Point, tilt: f64) -> MeshItem {
    quad(centre, Vector::new(30.0, 30.0 * tilt, 0.0), Vector::new(0.0, 0.0, 30.0), [1.0, 0.8, 0.0], 0.35)
}

#[test]
fn a_translucent_mesh_takes_its_place_before_in_and_behind_the_volume() {
    let (item, view, tau) = wall();
    for y in [-7.0, -0.5, 2.3, 7.0, 7.5, 12.0] {
        let mesh = wide(Point::new(10.0, y, 10.0), 0.0);
        let before = (y + 0.5).clamp(0.0, 8.0);
        let known = layered(before, tau, &mesh, 8.0 - before);
        for pixel in pixels(&scene(vec![item.clone()], vec![mesh], view), SIZE) {
            assert!(largest_difference(&[pixel], &[known]) < 1e-12, "at {y} mm: {pixel:?}, not {known:?}");
        }
    }
}

#[test]
fn a_mesh_that_crosses_the_volume_is_met_at_its_depth_in_every_pixel() {
    let (item, view, tau) = wall();
    let mesh = wide(Point::new(10.0, 3.0, 10.0), 1.2);
    let all = pixels(&scene(vec![item], vec![mesh.clone()], view), SIZE);
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for (pixel, (start, _)) in all.iter().zip(rays(&view, SIZE)) {
        let before = (3.0 + 1.2 * (start.x - 10.0) + 0.5).clamp(0.0, 8.0);
        (least, most) = (least.min(before), most.max(before));
        let known = layered(before, tau, &mesh, 8.0 - before);
        assert!(largest_difference(&[*pixel], &[known]) < 1e-12, "{before} mm: {pixel:?}, not {known:?}");
    }
    assert_eq!((least, most), (0.0, 8.0), "it came in front and went behind");
}

#[test]
fn two_meshes_that_cross_are_ordered_in_every_pixel() {
    let (mut item, view, tau) = wall();
    item.transfer = flat([0.2, 0.4, 0.9, 0.15]);
    let mut rising = wide(Point::new(10.0, 3.0, 10.0), 0.3);
    let mut falling = wide(Point::new(10.0, 3.0, 10.0), -0.3);
    (rising.color, rising.opacity) = ([1.0, 0.0, 0.0], 0.6);
    (falling.color, falling.opacity) = ([0.0, 1.0, 0.0], 0.7);
    let all = pixels(&scene(vec![item], vec![rising.clone(), falling.clone()], view), SIZE);
    let mut firsts = [0, 0];
    for (pixel, (start, _)) in all.iter().zip(rays(&view, SIZE)) {
        let ahead = 0.3 * (start.x - 10.0);
        let (first, second) = if ahead < 0.0 { (&rising, &falling) } else { (&falling, &rising) };
        firsts[usize::from(ahead < 0.0)] += 1;
        let near = layered(3.5 - ahead.abs(), tau, first, 2.0 * ahead.abs());
        let far = layered(0.0, tau, second, 4.5 - ahead.abs());
        let known = std::array::from_fn::<f64, 4, _>(|c| near[c] + (1.0 - near[3]) * far[c]);
        assert!(largest_difference(&[*pixel], &[known]) < 1e-12, "{pixel:?} is not {known:?}");
    }
    assert_eq!(firsts, [60, 60], "each was in front in half of the picture");
}

#[test]
fn an_opaque_mesh_hides_everything_behind_it() {
    let (item, view, tau) = wall();
    let mut mesh = wide(Point::new(10.0, 2.0, 10.0), 0.0);
    mesh.opacity = 1.0;
    let mut behind = wide(Point::new(10.0, 5.0, 10.0), 0.0);
    (behind.color, behind.opacity) = ([0.0, 0.0, 1.0], 1.0);
    let known = layered(2.5, tau, &mesh, 0.0);
    for pixel in pixels(&scene(vec![item], vec![behind, mesh], view), SIZE) {
        assert!(largest_difference(&[pixel], &[known]) < 1e-12, "{pixel:?} is not {known:?}");
        assert_eq!(pixel[3], 1.0, "nothing comes through");
    }
}

#[test]
fn surfaces_at_one_depth_are_crossed_in_the_order_of_the_scene() {
    let (_, view, _) = wall();
    let first = wide(Point::new(10.0, 2.0, 10.0), 0.0);
    let mut second = first.clone();
    second.color = [0.0, 0.0, 1.0];
    let all = pixels(&scene(Vec::new(), vec![first, second], view), SIZE);
    let known = [0.35, 0.35 * 0.8, 0.65 * 0.35, 1.0 - 0.65 * 0.65];
    assert!(all.iter().all(|p| largest_difference(&[*p], &[known]) < 1e-12), "the first is in front");
}

#[test]
fn a_lit_mesh_is_shaded_by_its_face_from_both_sides() {
    let view = perspective(Point::new(10.0, -20.0, 10.0), Point::new(10.0, 0.0, 10.0));
    let mut mesh = wide(Point::new(10.0, 2.0, 10.0), 0.7);
    mesh.shading = Shading::Lit;
    let mut turned = mesh.clone();
    let flipped = mesh.mesh.triangles().iter().map(|t| [t[0], t[2], t[1]]).collect();
    turned.mesh = Arc::new(TriangleMesh::new(mesh.mesh.positions().to_vec(), flipped).expect("a mesh"));
    let normal = Vector::new(-0.7, 1.0, 0.0).normalize();
    for item in [mesh, turned] {
        let all = pixels(&scene(Vec::new(), vec![item], view), SIZE);
        for (pixel, (_, direction)) in all.iter().zip(rays(&view, SIZE)) {
            let facing = normal.dot(&direction).abs();
            let white = light::SPECULAR * facing.powf(light::SHININESS);
            for (c, plain) in [1.0, 0.8, 0.0].into_iter().enumerate() {
                let lit = (plain * (light::AMBIENT + light::DIFFUSE * facing) + white).min(1.0);
                assert!((pixel[c] - 0.35 * lit).abs() < 1e-12, "channel {c}: {}", pixel[c]);
            }
        }
    }
}

#[test]
fn a_mesh_in_metres_is_scaled_by_its_pose() {
    let (item, view, tau) = wall();
    let mut mesh = wide(Point::new(0.010, 0.003, 0.010), 0.0);
    mesh.pose = Affine::from_columns(
        Vector::x() * 1000.0,
        Vector::y() * 1000.0,
        Vector::z() * 1000.0,
        Point::new(0.0, 1.0, 0.0),
    )
    .expect("a scale");
    let known = layered(4.5, tau, &mesh, 3.5);
    let all = pixels(&scene(vec![item], vec![mesh], view), SIZE);
    assert!(all.iter().all(|p| largest_difference(&[*p], &[known]) < 1e-9), "at 4 mm: {:?}", all[0]);
}
