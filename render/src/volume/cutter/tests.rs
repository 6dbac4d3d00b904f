use super::*;

fn blade() -> Cutter {
    let (normal, right) = (Vector::new(0.0, 0.0, 2.0), Vector::new(3.0, 0.0, 5.0));
    Cutter::blade(Point::new(1.0, 2.0, 3.0), normal, right, [4.0, 6.0]).expect("blade")
}

#[test]
fn a_point_on_the_surface_is_on_the_plus_side() {
    let plane = Cutter::plane(Point::new(0.1, 0.2, 0.3), Vector::new(0.3, -0.7, 0.9)).expect("plane");
    assert_eq!(plane.side(&Point::new(0.1, 0.2, 0.3)), Some(Side::Plus), "its own point");
    let tube = Cutter::cylinder(Point::origin(), Vector::z(), 2.0).expect("tube");
    let dome = Cutter::dome(Point::origin(), 2.0).expect("dome");
    for (what, cutter) in [("tube", tube), ("dome", dome)] {
        assert_eq!(cutter.side(&Point::new(2.0, 0.0, 0.0)), Some(Side::Plus), "on the wall of a {what}");
        assert_eq!(cutter.side(&Point::new(1.9, 0.0, 0.0)), Some(Side::Minus), "inside a {what}");
    }
    for on in [[1.0, 2.0, 3.0], [3.0, 2.0, 0.0], [-1.0, 2.0, 0.0], [1.0, 5.0, 0.0], [1.0, -1.0, -9.0]] {
        assert_eq!(blade().side(&Point::from(on)), Some(Side::Plus), "on a face of the blade: {on:?}");
    }
}

#[test]
fn a_blade_has_passed_what_is_behind_it_within_its_outline() {
    for (at, passed) in [
        ([1.0, 2.0, 2.9], true),
        ([2.9, 4.9, -50.0], true),
        ([1.0, 2.0, 3.1], false),
        ([3.1, 2.0, 0.0], false),
        ([1.0, 5.1, 0.0], false),
        ([-1.1, -1.1, 0.0], false),
    ] {
        let expected = if passed { Side::Minus } else { Side::Plus };
        assert_eq!(blade().side(&Point::from(at)), Some(expected), "{at:?}");
    }
}

#[test]
fn the_kerf_belongs_to_neither_side() {
    let kerf = |cutter: Cutter| cutter.with_kerf(0.5).expect("kerf");
    let plane = kerf(Cutter::plane(Point::origin(), Vector::new(0.0, 0.0, 8.0)).expect("plane"));
    let tube = kerf(Cutter::cylinder(Point::new(0.0, 0.0, -4.0), Vector::x() * 3.0, 4.0).expect("tube"));
    let dome = kerf(Cutter::dome(Point::new(0.0, 0.0, -4.0), 4.0).expect("dome"));
    let face = kerf(blade().moved(&Affine::translation(Vector::new(-1.0, -2.0, -3.0))));
    for cutter in [plane, tube, dome, face] {
        let side = |z: f64| cutter.side(&Point::new(0.0, 0.0, z));
        assert_eq!(side(0.25), Some(Side::Plus), "at half a kerf outside: {cutter:?}");
        assert_eq!([side(0.24), side(0.0), side(-0.25)], [None; 3], "within the kerf: {cutter:?}");
        assert_eq!(side(-0.26), Some(Side::Minus), "inside: {cutter:?}");
    }
    let beside = face.side(&Point::new(2.01, 0.0, -5.0));
    assert_eq!(beside, Some(Side::Plus), "the sides of what a blade passed have no kerf");
}

/// Also where the kerf is so thin that rounding decides.
#[test]
fn no_point_is_on_both_sides_and_without_kerf_none_is_on_neither() {
    let mut state = 9_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let mut waste = 0;
    for round in 0..4000 {
        let mut triple = |scale: f64| Vector::new(next(), next(), next()) * scale;
        let (point, axis, right) = (Point::from(triple(50.0)), triple(1.0), triple(1.0));
        let made = match round % 4 {
            0 => Cutter::plane(point, axis),
            1 => Cutter::cylinder(point, axis, 7.0),
            2 => Cutter::dome(point, 7.0),
            _ => Cutter::blade(point, axis, right, [9.0, 4.0]),
        };
        let kerf_mm = [0.0, 1e-300, 1e-16, 1e-13, 0.3][round % 5];
        let cutter = made.and_then(|c| c.with_kerf(kerf_mm)).expect("cutter");
        let (body, _) = cutter.solid(Side::Plus);
        for _ in 0..20 {
            let offset = match body {
                // Points in or next to the wall.
                Body::HalfSpace(_) | Body::Prism(_) => axis.cross(&triple(5.0)),
                _ => triple(1.0).normalize() * 7.0,
            };
            let p = point + offset;
            let kept = [Side::Plus, Side::Minus].map(|s| cutter.keeps(s, &p));
            assert!(kept != [true; 2], "both sides of {cutter:?} have {p}");
            assert!(kerf_mm > 0.0 || kept != [false; 2], "neither side of {cutter:?} has {p}");
            waste += usize::from(kept == [false; 2]);
        }
    }
    assert!(waste > 10_000, "only {waste} points lay in a kerf");
}

#[test]
fn a_cutter_that_moves_takes_its_sides_along() {
    let pose = Affine::rotation_about(Point::new(1.0, -2.0, 0.5), Vector::new(0.3, 1.0, -0.4), 0.9)
        * Affine::translation(Vector::new(20.0, -8.0, 3.0));
    let tube = Cutter::cylinder(Point::new(1.0, 2.0, 3.0), Vector::new(1.0, 1.0, 0.0), 2.0);
    let plane = Cutter::plane(Point::new(1.0, 2.0, 3.0), Vector::new(1.0, 2.0, -2.0));
    let dome = Cutter::dome(Point::new(1.0, 2.0, 3.0), 2.5);
    for cutter in [tube, plane, dome, Ok(blade())] {
        let cutter = cutter.and_then(|c| c.with_kerf(0.7)).expect("cutter");
        for i in 0..343 {
            let lattice = Vector::new(f64::from(i % 7), f64::from(i / 7 % 7), f64::from(i / 49));
            let p = Point::from(lattice * 1.1 - Vector::repeat(0.93));
            assert_eq!(cutter.moved(&pose).side(&pose.point(&p)), cutter.side(&p), "{cutter:?} at {p}");
        }
    }
}

#[test]
fn numbers_that_make_no_cutter_are_refused() {
    let o = Point::origin();
    let blade = |right, size| Cutter::blade(o, Vector::z(), right, size);
    assert_eq!(Cutter::plane(o, Vector::zeros()), Err(CutterError::NoDirection), "no normal");
    assert_eq!(Cutter::dome(o, 0.0), Err(CutterError::Radius { radius_mm: 0.0 }), "no radius");
    assert_eq!(Cutter::dome(Point::new(f64::NAN, 0.0, 0.0), 1.0), Err(CutterError::NotFinite), "NaN");
    assert_eq!(blade(Vector::z() * -4.0, [1.0; 2]), Err(CutterError::NoRight), "right along the normal");
    let flat = CutterError::Extent { width_mm: 1.0, height_mm: 0.0 };
    assert_eq!(blade(Vector::x(), [1.0, 0.0]), Err(flat), "no height");
    let tube = Cutter::cylinder(o, Vector::x(), 1.0).expect("tube");
    assert_eq!(tube.with_kerf(-1.0), Err(CutterError::Kerf { kerf_mm: -1.0 }), "negative kerf");
    let hollow = CutterError::NothingInside { kerf_mm: 2.0, radius_mm: 1.0 };
    assert_eq!(tube.with_kerf(2.0), Err(hollow), "a saw as thick as the tube");
    assert!(tube.with_kerf(f64::INFINITY).is_err(), "endless kerf");
}
