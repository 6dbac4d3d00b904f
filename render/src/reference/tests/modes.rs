//! Volumes drawn as layers: the greatest value on the ray, and isosurfaces.

use super::*;
use crate::reference::ReferenceError;
use crate::scene::{VolumeMode, light};
use crate::volume::{Cutter, Side};

/// x·y on 21 × 21 × 5 samples: bilinear, so interpolation gives it back exactly.
fn product() -> Grid {
    synth::from_voxels([21, 21, 5], Affine::identity(), |[x, y, _]| (x * y) as f64).expect("a grid")
}

/// Colour and opacity grow with the value up to 400.
fn rising() -> Arc<Transfer> {
    transfer(&[point(0.0, [0.0, 0.2, 0.4, 0.0]), point(400.0, [1.0, 0.2, 0.0, 0.8])])
}

/// Along (1, -1, 0), so that x + y stays what it is on a ray: from 17.03 to 22.97 over 40 pixels.
fn diagonal(rows: u32) -> Camera {
    let height_mm = 0.105 * f64::from(rows);
    parallel(Point::new(-20.0, 40.0, 2.0), Point::new(10.0, 10.0, 2.0), height_mm)
}

/// The square of the mean of x and y: what x·y is at most on a ray of [`diagonal`].
fn most((start, _): &(Point, Vector)) -> f64 {
    (0.5 * (start.x + start.y)).powi(2)
}

#[test]
fn the_greatest_value_on_a_ray_is_classified_once() {
    let mut item = volume(product(), rising());
    item.mode = VolumeMode::Mip;
    let (size, camera) = ([40, 3], diagonal(3));
    let drawn = pixels(&scene(vec![item.clone()], Vec::new(), camera), size);
    let mut met = 0;
    for (pixel, ray) in drawn.iter().zip(rays(&camera, size)) {
        let [r, g, b, a] = item.transfer.rgba(most(&ray));
        let known = [a * r, a * g, a * b, a];
        met += usize::from(known[3] > 0.1);
        for c in 0..4 {
            assert!((pixel[c] - known[c]).abs() < 1e-12, "{pixel:?} is not {known:?}");
        }
    }
    assert!(met >= 40, "{met} rays saw more than air");
}

#[test]
fn a_volume_cut_in_two_has_the_greatest_value_of_the_whole() {
    let mut item = volume(noisy([14, 13, 10]), steep());
    item.mode = VolumeMode::Mip;
    let view = perspective(Point::new(30.0, -25.0, 12.0), Point::origin());
    let whole = pixels(&scene(vec![item.clone()], Vec::new(), view), [24, 20]);
    let cutter = Cutter::plane(Point::new(0.3, -0.2, 0.1), Vector::new(1.0, 0.4, -0.3)).expect("a plane");
    let piece = |side| Piece { keep: vec![(cutter, side)], pose: Affine::identity() };
    item.pieces = vec![piece(Side::Plus), piece(Side::Minus)];
    let cut = pixels(&scene(vec![item.clone()], Vec::new(), view), [24, 20]);
    assert!(largest_difference(&whole, &cut) < 1e-9, "cut and left in place");
    item.pieces.pop();
    let half = pixels(&scene(vec![item], Vec::new(), view), [24, 20]);
    assert!(largest_difference(&whole, &half) > 0.1, "the other half counts no more");
}

#[test]
fn a_layer_lies_where_its_volume_is_entered() {
    let mut near = block([5, 5, 5], [1.0, 0.0, 0.0, 0.5]);
    near.mode = VolumeMode::Mip;
    let mut far = block([5, 5, 5], [0.0, 1.0, 0.0, 0.5]);
    far.mode = VolumeMode::Mip;
    far.pose = Affine::translation(Vector::new(0.0, 2.0, 0.0));
    let sheet = |y| quad(Point::new(2.0, y, 2.0), Vector::x() * 9.0, Vector::z() * 9.0, [0.0, 0.0, 1.0], 0.5);
    let view = parallel(Point::new(2.0, -9.0, 2.0), Point::new(2.0, 0.0, 2.0), 2.0);
    let draw = |y| pixels(&scene(vec![far.clone(), near.clone()], vec![sheet(y)], view), [1, 1])[0];
    // The near volume begins at -0.5 and the far one at 1.5.
    for (y, known) in [(-1.0, [0.25, 0.125, 0.5]), (0.5, [0.5, 0.125, 0.25]), (3.0, [0.5, 0.25, 0.125])] {
        let pixel = draw(y);
        for c in 0..3 {
            assert!((pixel[c] - known[c]).abs() < 1e-12, "a sheet at {y}: {pixel:?} is not {known:?}");
        }
    }
}

#[test]
fn every_crossing_of_a_value_is_a_lit_surface() {
    let level = 81.0;
    let mut item = volume(product(), rising());
    item.mode = VolumeMode::Isosurface { value: level, opacity: 0.5 };
    let (size, camera) = ([40, 1], diagonal(1));
    let drawn = pixels(&scene(vec![item.clone()], Vec::new(), camera), size);
    let [r, ..] = item.transfer.rgba(level);
    let mut twice = 0;
    for (pixel, ray) in drawn.iter().zip(rays(&camera, size)) {
        let mean = 0.5 * (ray.0.x + ray.0.y);
        if most(&ray) <= level {
            assert_eq!(*pixel, [0.0; 4], "the value is not reached");
            continue;
        }
        // (mean + s)(mean - s) = level; the gradient of x·y is (y, x).
        let s = (mean * mean - level).sqrt();
        let facing = |s: f64| {
            let (x, y) = (mean + s, mean - s);
            ((y - x) / std::f64::consts::SQRT_2 / x.hypot(y)).abs()
        };
        let lit = |f: f64| {
            (r * (light::AMBIENT + light::DIFFUSE * f) + light::SPECULAR * f.powf(light::SHININESS)).min(1.0)
        };
        let (first, second) = (lit(facing(-s)), lit(facing(s)));
        assert!((pixel[3] - 0.75).abs() < 1e-12, "two surfaces of a half: {pixel:?}");
        assert!((pixel[0] - 0.5 * first - 0.25 * second).abs() < 1e-9, "{pixel:?}: {first} and {second}");
        twice += 1;
    }
    assert!(twice > 10, "{twice} rays pass the surface twice");
}

#[test]
fn an_isosurface_of_a_closed_body_is_crossed_an_even_number_of_times() {
    let noise = |at: [usize; 3]| {
        let inside = at.iter().all(|i| (1..9).contains(i));
        if inside { (10.0 * synth::noise(5, at)).round() } else { -20.0 }
    };
    let grid = synth::from_voxels([10, 10, 10], Affine::identity(), noise).expect("a grid");
    let mut item = volume(grid, flat([0.5, 0.5, 0.5, 0.1]));
    let view = parallel(Point::new(4.5, -20.0, 4.5), Point::new(4.5, 0.0, 4.5), 9.0);
    let tilted = perspective(Point::new(30.0, -21.0, 14.0), Point::new(4.5, 4.5, 4.5));
    let mut most = 0;
    // Whole values are those of samples: the surface passes through corners and lies in faces of cells.
    for (value, camera) in [(2.0, view), (3.0, view), (2.5, tilted), (3.0, tilted), (-20.0 + 1e-9, tilted)] {
        item.mode = VolumeMode::Isosurface { value, opacity: 0.5 };
        for pixel in pixels(&scene(vec![item.clone()], Vec::new(), camera), [37, 36]) {
            let crossings = -(1.0 - pixel[3]).log2();
            let whole = crossings.round();
            assert!((crossings - whole).abs() < 1e-6, "{crossings} crossings of {value}");
            // Beyond that the ray ends, dark.
            assert!(whole > 20.0 || whole as i64 % 2 == 0, "{whole} crossings of {value}");
            most = most.max(whole as i64);
        }
    }
    assert!(most >= 4, "the body has hollows, not {most} crossings at most");
}

#[test]
fn an_isosurface_that_cannot_be_is_refused() {
    let mut item = block([2, 2, 2], [1.0; 4]);
    for (value, opacity) in [(f64::NAN, 1.0), (0.0, 1.5), (0.0, f64::NAN)] {
        item.mode = VolumeMode::Isosurface { value, opacity };
        let scene = scene(vec![item.clone()], Vec::new(), diagonal(1));
        let drawn = draw_pixels(&scene, [1, 1], &Options::default(), &[(0, 0)]);
        assert_eq!(drawn, Err(ReferenceError::Isosurface { volume: 0 }), "{value} {opacity}");
    }
}
