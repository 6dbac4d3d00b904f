//! No ray passes between two cells or through both at once; closed forms.

use super::*;

/// Ray of a pixel: where it starts, and its direction for one of depth.
fn ray(camera: &Camera, size: [u32; 2], [x, y]: [u32; 2]) -> (Vector, Vector) {
    let frame = camera.frame().expect("a camera");
    let [w, h] = size.map(f64::from);
    let (across, up) = ((2.0 * f64::from(x) + 1.0 - w) / h, (h - 2.0 * f64::from(y) - 1.0) / h);
    let aside = frame.right * across + frame.up * up;
    match camera.projection {
        Projection::Perspective { fov_rad } => {
            (camera.eye.coords, frame.forward + aside * (0.5 * fov_rad).tan())
        }
        Projection::Parallel { height_mm } => (camera.eye.coords + aside * (0.5 * height_mm), frame.forward),
    }
}

/// Depths at which a ray is in the box from 0 to `n`.
fn chord(n: f64, start: &Vector, direction: &Vector) -> [f64; 2] {
    let (mut from, mut to) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if start[axis] < 0.0 || start[axis] > n {
                return [0.0; 2];
            }
            continue;
        }
        let [a, b] = [0.0, n].map(|wall| (wall - start[axis]) / direction[axis]);
        (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
    }
    [from, to.max(from)]
}

fn kept() -> Options {
    Options { keep_segments: true, ..Options::default() }
}

/// The same thin fog everywhere.
fn fog() -> Transfer {
    transfer(&[[0.0, 1.0, 1.0, 1.0, 0.01]], 1.0)
}

#[test]
fn lengths_of_segments_add_up_to_the_chord_of_the_hull() {
    let n = 5;
    let size = [60, 52];
    let tall = f64::from(size[1]);
    let side = n as f64;
    // Straight on, so that a row or a column of pixels lies on each plane of points, and askew.
    let straight = |height_mm: f64| Camera {
        eye: Point::new(side / 2.0, -3.0, side / 2.0),
        target: Point::new(side / 2.0, 0.0, side / 2.0),
        up: Vector::new(0.0, 0.0, 1.0),
        projection: Projection::Parallel { height_mm },
    };
    let middle = [side / 2.0; 3];
    let cameras = [
        ("on the points", straight(tall / 8.0)),
        ("on points and edges", straight(tall / 2.0)),
        ("askew", looks([9.0, -7.0, 6.0], middle, Projection::Parallel { height_mm: 8.0 })),
        ("perspective", looks([9.0, -7.0, 6.0], middle, Projection::Perspective { fov_rad: 0.7 })),
        ("inside", looks([2.0, 2.0, 2.0], [3.0, 4.0, 2.5], Projection::Perspective { fov_rad: 2.0 })),
        (
            "inside, along an axis",
            looks([2.5, 1.0, 2.5], [2.5, 3.0, 2.5], Projection::Perspective { fov_rad: 1.0 }),
        ),
    ];
    for shake in [0.0, 0.3] {
        let mesh = lattice(n, shake, 7);
        let grid = grid(&mesh, |i, _| i as f64);
        let item = item(&grid, fog());
        for (name, camera) in &cameras {
            let picture = draw(&item, camera, size, &kept());
            let segments = picture.segments.as_ref().expect("segments");
            let mut met = 0;
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let (start, direction) = ray(camera, size, [x, y]);
                    let [from, to] = chord(side, &start, &direction);
                    let list = segments.pixel(x, y);
                    let sum: f64 = list.iter().map(|s| s.back - s.front).sum();
                    let off = (sum - (to - from)).abs();
                    // Along a wall of the box either answer is right.
                    let on_wall = (0..3).any(|a| {
                        direction[a].abs() < 1e-9 && (start[a].abs() < 1e-9 || (start[a] - side).abs() < 1e-9)
                    });
                    if on_wall && list.is_empty() {
                        continue;
                    }
                    assert!(
                        off <= 1e-10 * (to - from).max(1.0),
                        "{name}, {shake}: {x}, {y}: {sum} for {}",
                        to - from
                    );
                    if to - from > 1e-6 {
                        met += 1;
                        assert_eq!(list.len(), 1, "{name}, {shake}: {x}, {y}: cells meet without a gap");
                    }
                }
            }
            assert!(met > 60, "{name}: {met} rays pass the box");
            // From an eye on a face depths of nothing may be off by a rounding.
            let inside = name.starts_with("inside") && picture.stats.total.overlaps < 10;
            assert!(
                inside || picture.stats.total.overlaps == 0,
                "{name}, {shake}: no ray is in two cells at once"
            );
        }
    }
}

#[test]
fn a_linear_field_is_its_closed_form_on_any_mesh() {
    let n = 4.0;
    let size = [40, 40];
    let slope = Vector::new(0.05, -0.03, 0.08);
    let of = |p: &Vector| 0.2 + slope.dot(p);
    let camera = looks([8.0, -6.0, 7.0], [2.0; 3], Projection::Perspective { fov_rad: 0.6 });
    // Opacity is the scalar itself.
    let ramp =
        transfer(&[[-1.0, 0.3, 0.3, 0.3, 0.0], [0.0, 0.3, 0.3, 0.3, 0.0], [1.0, 0.3, 0.3, 0.3, 1.0]], 1.0);
    // The antiderivative of -ln(1 - a).
    let sum = |a: f64| {
        let a = a.max(0.0);
        (1.0 - a) * (-a).ln_1p() + a
    };
    for (shake, seed) in [(0.0, 1), (0.2, 2), (0.3, 3)] {
        let mesh = lattice(4, shake, seed);
        let grid = grid(&mesh, |_, p| of(&p.coords));
        let picture = draw(&item(&grid, ramp.clone()), &camera, size, &Options::default());
        let mut shown = 0;
        for y in 0..size[1] {
            for x in 0..size[0] {
                let (start, direction) = ray(&camera, size, [x, y]);
                let [from, to] = chord(n, &start, &direction);
                let [a, b] = [from, to].map(|t| of(&(start + direction * t)));
                let mm = (to - from) * direction.norm();
                let depth = if (b - a).abs() > 1e-6 { mm * (sum(b) - sum(a)) / (b - a) } else { 0.0 };
                let known = -(-depth).exp_m1();
                let found = picture.image.pixels[(y * size[0] + x) as usize];
                if known > 0.01 && (b - a).abs() > 1e-6 {
                    shown += 1;
                    let off = (f64::from(found[3]) - known).abs() * 255.0;
                    assert!(
                        off < 0.02,
                        "{shake}: {x}, {y}: off by {off} of 1/255: {} is not {known}; {a} to {b}",
                        found[3]
                    );
                    let color = (f64::from(found[0]) - 0.3 * known).abs() * 255.0;
                    assert!(color < 0.02, "{x}, {y}: colour off by {color}");
                }
            }
        }
        assert!(shown > 300, "{shown} pixels");
    }
}

#[test]
fn segments_are_in_order_and_add_up_to_the_picture() {
    let mesh = lattice(4, 0.3, 11);
    let grid = grid(&mesh, |_, p| (p.x * 1.3 + p.y).sin() * 0.5 + 0.5);
    let item = item(&grid, varied(0.6));
    let size = [32, 30];
    let camera = looks([8.0, -6.0, 7.0], [2.0; 3], Projection::Perspective { fov_rad: 0.6 });
    let picture = draw(&item, &camera, size, &kept());
    let segments = picture.segments.expect("segments");
    for y in 0..size[1] {
        for x in 0..size[0] {
            let list = segments.pixel(x, y);
            assert!(list.windows(2).all(|w| w[0].back <= w[1].front), "{x}, {y}: in order");
            let mut seen = [0.0_f32; 4];
            for segment in list {
                let through = 1.0 - seen[3];
                seen = std::array::from_fn(|c| seen[c] + through * segment.rgba[c]);
            }
            assert_eq!(seen, picture.image.pixels[(y * size[0] + x) as usize], "{x}, {y}");
        }
    }
    assert!(
        segments.pixel(size[0], 0).is_empty() && segments.pixel(0, size[1]).is_empty(),
        "nothing outside"
    );
}
