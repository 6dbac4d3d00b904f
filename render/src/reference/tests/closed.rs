//! Closed forms of volumes.

use super::*;
use crate::scene::CameraError;

/// Length of a ray inside the volume's box, by the six planes through its corners in the world.
fn chord(item: &VolumeItem, (start, direction): (Point, Vector)) -> f64 {
    let corners = item.grid.corners_in_world().map(|p| item.pose.point(&p));
    let centre = corners.iter().map(|p| p.coords).sum::<Vector>() / 8.0;
    let (mut from, mut to) = (0.0_f64, f64::INFINITY);
    for face in [[0, 1, 2], [4, 5, 6], [0, 1, 4], [2, 3, 6], [0, 2, 4], [1, 3, 5]] {
        let [a, b, c] = face.map(|i| corners[i]);
        let mut normal = (b - a).cross(&(c - a));
        if normal.dot(&(centre - a.coords)) < 0.0 {
            normal = -normal;
        }
        let (height, rise) = (normal.dot(&(start - a)), normal.dot(&direction));
        if rise > 0.0 {
            from = from.max(-height / rise);
        } else if rise < 0.0 {
            to = to.min(-height / rise);
        } else if height < 0.0 {
            return 0.0;
        }
    }
    (to - from).max(0.0)
}

/// Every pixel is 1 - exp(-τ L); returns how many rays met the volume and how many missed.
fn check_chords(item: &VolumeItem, camera: Camera, size: [u32; 2]) -> (usize, usize) {
    let (color, tau) = item.transfer.classify(0.0);
    let scene = scene(vec![item.clone()], Vec::new(), camera);
    let mut met = 0;
    let rays = rays(&camera, size);
    for (pixel, ray) in pixels(&scene, size).iter().zip(&rays) {
        let length = chord(item, *ray);
        let alpha = 1.0 - (-tau * length).exp();
        met += usize::from(length > 0.0);
        assert!((pixel[3] - alpha).abs() < 1e-12, "opacity {} for {length} mm, not {alpha}", pixel[3]);
        for c in 0..3 {
            assert!((pixel[c] - alpha * color[c]).abs() < 1e-12, "colour {c} for {length} mm");
        }
    }
    (met, rays.len() - met)
}

fn tilted(extent: [usize; 3]) -> VolumeItem {
    let spacing = Affine::from_columns(
        Vector::new(0.7, 0.1, 0.0),
        Vector::new(0.0, 1.3, 0.2),
        Vector::new(0.0, 0.0, 2.1),
        Point::new(-3.0, 2.0, 1.0),
    );
    let grid = synth::homogeneous(extent, -40.0, spacing.expect("a transform")).expect("a grid");
    let mut item = volume(grid, flat([0.9, 0.5, 0.1, 0.06]));
    item.pose = Affine::rotation_about(Point::new(1.0, 2.0, 3.0), Vector::new(1.0, -2.0, 0.5), 1.1);
    item
}

#[test]
fn a_homogeneous_box_lets_through_the_exponential_of_its_chord() {
    let item = tilted([9, 7, 5]);
    let (eye, target) = (Point::new(-25.0, 14.0, 9.0), Point::new(1.0, 4.0, 5.0));
    for camera in [perspective(eye, target), parallel(eye, target, 22.0)] {
        let (met, missed) = check_chords(&item, camera, [45, 40]);
        assert!(met > 300 && missed > 300, "{met} rays met the box, {missed} missed it");
    }
}

#[test]
fn volumes_one_voxel_thin_are_as_thick_as_a_voxel() {
    for extent in [[1, 9, 9], [9, 1, 9], [9, 9, 1], [1, 1, 9], [1, 1, 1]] {
        let item = tilted(extent);
        let centre = item
            .pose
            .point(&item.grid.world_from_voxel().point(&Point::from(extent.map(|n| (n as f64 - 1.0) / 2.0))));
        let camera = perspective(centre + Vector::new(4.0, -15.0, 6.0), centre);
        let (met, _) = check_chords(&item, camera, [41, 41]);
        assert!(met > 4, "{met} rays met {extent:?}");
    }
}

#[test]
fn an_eye_inside_the_volume_sees_what_is_before_it() {
    let item = tilted([9, 7, 5]);
    let eye = item.pose.point(&item.grid.world_from_voxel().point(&Point::new(4.2, 3.1, 2.4)));
    for camera in [perspective(eye, Point::origin()), parallel(eye, Point::origin(), 1.0)] {
        assert_eq!(check_chords(&item, camera, [15, 11]), (165, 0), "every ray starts inside");
    }
}

#[test]
fn a_view_along_an_axis_with_up_along_it_is_drawn() {
    // Parallel rays along z through a block of 4 mm: any choice of "up" across the view gives the same.
    let mut camera = parallel(Point::new(1.5, 1.5, -9.0), Point::new(1.5, 1.5, 0.0), 2.0);
    assert_eq!(camera.up, Vector::z(), "up is along the view");
    for _ in 0..2 {
        let all = pixels(&scene(vec![block([4, 4, 4], [1.0, 1.0, 1.0, 0.2])], Vec::new(), camera), [6, 6]);
        let alpha = 1.0 - 0.8_f64.powi(4);
        assert!(all.iter().all(|p| (p[3] - alpha).abs() < 1e-12), "4 mm everywhere");
        camera.up = Vector::zeros();
    }
}

#[test]
fn a_picture_of_one_pixel_looks_along_the_view() {
    let camera = perspective(Point::new(1.5, -20.0, 1.5), Point::new(1.5, 0.0, 1.5));
    let one = pixels(&scene(vec![block([4, 4, 4], [0.5, 1.0, 0.0, 0.2])], Vec::new(), camera), [1, 1]);
    let alpha = 1.0 - 0.8_f64.powi(4);
    assert!(largest_difference(&one, &[[0.5 * alpha, alpha, 0.0, alpha]]) < 1e-12, "{one:?}");
}

#[test]
fn the_first_row_is_the_top_and_the_first_column_the_left() {
    // Seen from the front (-y, the patient's face) with the head up, +x is on the picture's right.
    let item = block([1, 1, 1], [1.0, 1.0, 1.0, 0.9]);
    let camera = parallel(Point::new(-0.9, -9.0, -1.4), Point::new(-0.9, 0.0, -1.4), 4.0);
    let all = pixels(&scene(vec![item], Vec::new(), camera), [4, 4]);
    let seen: Vec<usize> = (0..16).filter(|&i| all[i][3] > 0.0).collect();
    assert_eq!(
        seen,
        [2],
        "columns at x = -2.4, -1.4, -0.4, 0.6, rows at z = 0.1, -0.9, …: the box is in one pixel"
    );
}

/// Value x along x, from 0 to 16 over 16 mm; wide enough that rays leave by the far wall.
fn ramp_along_x(points: &[ControlPoint]) -> VolumeItem {
    let grid = synth::ramp([17, 21, 21], 0.0, Vector::x(), Affine::identity()).expect("a grid");
    volume(grid, transfer(points))
}

const FROM_LEFT: (Point, Point) = (Point::new(-30.0, 10.0, 10.0), Point::new(0.0, 10.0, 10.0));

#[test]
fn an_opacity_that_rises_linearly_has_its_closed_form() {
    let most = 0.8_f64;
    let item = ramp_along_x(&[point(0.0, [0.5, 0.5, 0.5, 0.0]), point(16.0, [0.5, 0.5, 0.5, most])]);
    let (eye, target) = FROM_LEFT;
    for (camera, size) in [(parallel(eye, target, 15.0), [8, 8]), (perspective(eye, target), [9, 5])] {
        let camera = match camera.projection {
            Projection::Perspective { .. } => {
                Camera { projection: Projection::Perspective { fov_rad: 0.2 }, ..camera }
            }
            Projection::Parallel { .. } => camera,
        };
        let scene = scene(vec![item.clone()], Vec::new(), camera);
        for (pixel, (_, direction)) in pixels(&scene, size).iter().zip(rays(&camera, size)) {
            // ∫ -ln(1 - a·s/16) ds from 0 to 16, and half a voxel of the last value; longer if oblique.
            let depth = 16.0 / most * ((1.0 - most) * (1.0 - most).ln() + most) - 0.5 * (1.0 - most).ln();
            let alpha = 1.0 - (-depth / direction.x).exp();
            assert!((pixel[3] - alpha).abs() < 1e-9, "opacity {} is not {alpha}", pixel[3]);
            assert!((pixel[0] - 0.5 * alpha).abs() < 1e-9, "colour {} is not {}", pixel[0], 0.5 * alpha);
        }
    }
}

#[test]
fn a_colour_that_rises_linearly_has_its_closed_form() {
    let item = ramp_along_x(&[point(0.0, [0.0, 0.3, 0.0, 0.1]), point(16.0, [1.0, 0.3, 0.0, 0.1])]);
    let (eye, target) = FROM_LEFT;
    let camera = parallel(eye, target, 10.0);
    let tau = -(0.9_f64.ln());
    let through = |mm: f64| (-tau * mm).exp();
    let rise = (1.0 - through(16.0) * (1.0 + tau * 16.0)) / (tau * 16.0);
    let known = through(0.5) * (rise + through(16.0) * (1.0 - through(0.5)));
    for pixel in pixels(&scene(vec![item], Vec::new(), camera), [3, 3]) {
        assert!((pixel[0] - known).abs() < 1e-10, "red {} is not {known}", pixel[0]);
        assert!((pixel[1] - 0.3 * pixel[3]).abs() < 1e-12, "green is the same all along");
    }
}

#[test]
fn a_jump_of_the_transfer_function_is_met_where_it_is() {
    let clear = [0.0, 0.0, 1.0, 0.0];
    let full = [1.0, 0.0, 0.0, 0.3];
    let item = ramp_along_x(&[point(0.0, clear), point(5.3, clear), point(5.3, full), point(9.7, full)]);
    let (eye, target) = FROM_LEFT;
    let far = Point::new(50.0, 10.0, 10.0);
    for camera in [parallel(eye, target, 12.0), parallel(far, target, 12.0)] {
        let alpha = 1.0 - 0.7_f64.powf(16.5 - 5.3);
        for pixel in pixels(&scene(vec![item.clone()], Vec::new(), camera), [4, 4]) {
            assert!((pixel[3] - alpha).abs() < 1e-12, "opacity {} is not {alpha}", pixel[3]);
            assert!((pixel[0] - alpha).abs() < 1e-12 && pixel[2] == 0.0, "red alone: {pixel:?}");
        }
    }
}

#[test]
fn opaque_material_stays_finite_and_hides_what_is_behind() {
    let front = block([4, 4, 4], [0.3, 0.6, 0.9, 1.0]);
    let mut back = block([4, 4, 4], [1.0, 1.0, 1.0, 1.0]);
    back.pose = Affine::translation(Vector::new(0.0, 10.0, 0.0));
    let camera = parallel(Point::new(1.5, -9.0, 1.5), Point::new(1.5, 0.0, 1.5), 2.0);
    for pixel in pixels(&scene(vec![back, front], Vec::new(), camera), [2, 2]) {
        assert!(largest_difference(&[pixel], &[[0.3, 0.6, 0.9, 1.0]]) < 1e-6, "{pixel:?}");
    }
    // A unit length that makes one panel opaque however it is halved.
    let mut dense = block([4, 4, 4], [0.3, 0.6, 0.9, 1.0]);
    dense.transfer = Arc::new(Transfer::new(dense.transfer.points().to_vec(), 1e-200).expect("dense"));
    for pixel in pixels(&scene(vec![dense], Vec::new(), camera), [2, 2]) {
        assert!(largest_difference(&[pixel], &[[0.3, 0.6, 0.9, 1.0]]) < 1e-12, "{pixel:?}");
    }
}

#[test]
fn overlapping_volumes_add_their_extinction_and_mix_their_colours_by_it() {
    let near = block([4, 4, 10], [1.0, 0.0, 0.2, 0.1]);
    let mut far = block([4, 4, 10], [0.0, 1.0, 0.6, 0.3]);
    far.pose = Affine::translation(Vector::new(0.0, 0.0, 6.0));
    let camera = parallel(Point::new(1.5, 1.5, -9.0), Point::new(1.5, 1.5, 0.0), 3.0);
    let (t1, t2) = (-(0.9_f64.ln()), -(0.7_f64.ln()));
    let mut known = [0.0; 4];
    let mut through = 1.0_f64;
    for (mm, a, b) in [(6.0, t1, 0.0), (4.0, t1, t2), (6.0, 0.0, t2)] {
        let part = through * (1.0 - (-(a + b) * mm).exp());
        for (c, (p, q)) in [(1.0, 0.0), (0.0, 1.0), (0.2, 0.6)].into_iter().enumerate() {
            known[c] += part * (a * p + b * q) / (a + b);
        }
        through -= part;
    }
    known[3] = 1.0 - through;
    for volumes in [vec![near.clone(), far.clone()], vec![far, near]] {
        for pixel in pixels(&scene(volumes, Vec::new(), camera), [3, 3]) {
            assert!(largest_difference(&[pixel], &[known]) < 1e-12, "{pixel:?} is not {known:?}");
        }
    }
}

#[test]
fn samples_that_are_not_numbers_draw_as_the_padding_value() {
    let known = noisy([9, 8, 7]);
    let mut holes: Vec<f64> = (0..9 * 8 * 7).map(|i| known.value_at(i)).collect();
    let mut filled = holes.clone();
    for i in (3..holes.len()).step_by(11) {
        holes[i] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][i % 3];
        filled[i] = 130.0;
    }
    let picture = |samples: Vec<f64>| {
        let samples = crate::volume::Samples::F64(samples);
        let grid = Grid::new([9, 8, 7], samples, Default::default(), *known.world_from_voxel());
        let item = volume(grid.expect("a grid").with_padding(130.0), steep());
        pixels(
            &scene(vec![item], Vec::new(), perspective(Point::new(20.0, -15.0, 5.0), Point::origin())),
            [20, 20],
        )
    };
    let (a, b) = (picture(holes), picture(filled));
    assert_eq!(largest_difference(&a, &b), 0.0, "the same picture");
    assert!(a.iter().any(|p| p[3] > 0.3), "of something");
}

#[test]
fn a_camera_that_shows_nothing_is_refused() {
    let camera = perspective(Point::origin(), Point::origin());
    let result = draw_pixels(&scene(Vec::new(), Vec::new(), camera), [2, 2], &Options::default(), &[(0, 0)]);
    assert_eq!(result, Err(CameraError::NoDirection.into()), "eye and target are one");
}

/// Values that rise by `rise` a mm along x in all of the volume but its far corner, where one sample is 1000.
fn ramp(rise: f64) -> VolumeItem {
    let grid = synth::from_voxels([12; 3], Affine::identity(), |at| {
        if at == [11; 3] { 1000.0 } else { rise * at[0] as f64 }
    });
    volume(grid.expect("a grid"), flat([0.5, 0.4, 0.3, 0.1]))
}

/// Gradients across the ray take all but the ambient part of the light, so that light is seen.
#[test]
fn a_function_of_one_value_measures_gradients_by_the_samples() {
    let camera = parallel(Point::new(4.0, -20.0, 4.0), Point::new(4.0, 0.0, 4.0), 4.0);
    let jump = transfer(&[point(-1.0, [0.5, 0.4, 0.3, 0.1]), point(-1.0, [0.6, 0.4, 0.3, 0.1])]);
    for (rise, lights) in [(0.0, false), (1e-9, false), (0.99, false), (1.01, true), (5.0, true)] {
        for transfer in [flat([0.5, 0.4, 0.3, 0.1]), Arc::clone(&jump)] {
            let plain = VolumeItem { transfer, ..ramp(rise) };
            let lit = VolumeItem { shading: Shading::Lit, ..plain.clone() };
            let [plain, lit] =
                [plain, lit].map(|item| pixels(&scene(vec![item], Vec::new(), camera), [3, 3]));
            assert_eq!(plain != lit, lights, "a rise of {rise} a mm: {:?} and {:?}", plain[0], lit[0]);
        }
    }
}

#[test]
fn a_volume_of_one_value_is_plain_in_any_light() {
    let camera = perspective(Point::new(4.0, -20.0, 4.0), Point::new(4.0, 0.0, 4.0));
    let plain = block([7, 8, 9], [0.5, 0.4, 0.3, 0.1]);
    let lit = VolumeItem { shading: Shading::Lit, ..plain.clone() };
    let [plain, lit] = [plain, lit].map(|item| pixels(&scene(vec![item], Vec::new(), camera), [5, 5]));
    assert_eq!(plain, lit, "there is no gradient");
}
