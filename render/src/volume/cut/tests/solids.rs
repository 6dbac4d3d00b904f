//! Convex solids: their facets, and both parts of meshes cut by them.

use std::f64::consts::PI;

use super::shapes::{Dice, Edges, ball, cube, edges, made, snapped, stem, torus, volume};
use crate::volume::cut::{Notes, Plane, Solid, SolidError, by_plane, by_solid};
use crate::volume::{Affine, Cutter, Point, Side, TriangleMesh, Vector};

/// Everything that must hold of a closed mesh cut by a solid; the volumes within and outside.
fn checked(mesh: &TriangleMesh, solid: &Solid) -> [f64; 2] {
    let parts = by_solid(mesh, solid).expect("cut");
    assert_eq!(parts.notes.open, 0, "every line closes");
    for part in [&parts.plus, &parts.minus].into_iter().flatten() {
        assert_eq!(edges(part).unmatched, 0, "closed: {solid:?}");
    }
    for (part, is_within) in [(&parts.minus, true), (&parts.plus, false)] {
        for p in part.iter().flat_map(|m| m.positions()) {
            let depth = |plane: &Plane| plane.normal().dot(&(p - plane.point())) / plane.normal().norm();
            let most = solid.planes().iter().map(depth).fold(f64::NEG_INFINITY, f64::max);
            let wrong = if is_within { most } else { -most };
            assert!(wrong < 1e-13, "{p} is {wrong} mm on the wrong side");
        }
    }
    let [inside, outside] = [&parts.minus, &parts.plus].map(|part| volume(part.as_ref(), mesh));
    let whole = volume(Some(mesh), mesh);
    assert!((inside + outside - whole).abs() <= 1e-12 * whole.abs(), "{inside} + {outside} is not {whole}");
    [inside, outside]
}

fn random_solid(dice: &mut Dice, count: usize, reach: f64) -> Solid {
    let plane = |_| {
        let out = dice.vector();
        Plane::new(Point::from(dice.vector() * 0.2 + out.normalize() * reach), out).expect("plane")
    };
    Solid::new((0..count).map(plane).collect()).expect("solid")
}

#[test]
fn both_parts_are_closed_whatever_the_solid() {
    let mut dice = Dice::new(7);
    for mesh in [cube(1), cube(4), ball(12), torus(12), stem(12), snapped(&ball(10), 0.125)] {
        let [low, high] = mesh.bounds();
        let size = (high - low).norm() / 2.0;
        for round in 0..60 {
            let (count, reach) = (2 + round % 9, 0.3 + 0.3 * dice.number().abs());
            let solid = random_solid(&mut dice, count, reach * size);
            let moved =
                solid.transformed(&Affine::translation((low + (high - low) / 2.0).coords)).expect("moved");
            checked(&mesh, &moved);
        }
    }
}

#[test]
fn planes_through_the_vertices_of_a_lattice_make_a_box_of_it() {
    // All six planes hold many vertices and edges of the mesh.
    let mesh = cube(8);
    let side = |axis: usize, sign: f64| {
        let mut out = Vector::zeros();
        out[axis] = sign;
        Plane::new(Point::from(out * 0.5), out).expect("plane")
    };
    let solid =
        Solid::new((0..6).map(|i| side(i % 3, if i < 3 { 1.0 } else { -1.0 })).collect()).expect("solid");
    assert_eq!(checked(&mesh, &solid), [1.0, 7.0], "a box in a box");
    let shaft = Solid::new(vec![side(0, 1.0), side(0, -1.0), side(1, 1.0), side(1, -1.0)]).expect("solid");
    assert_eq!(checked(&mesh, &shaft), [2.0, 6.0], "a square shaft");
    let parts = by_solid(&mesh, &shaft).expect("cut");
    assert_eq!(edges(&parts.plus.expect("outside")).euler, 0, "with a hole through it");
    assert_eq!(edges(&parts.minus.expect("within")).euler, 2, "and what was drilled out");
}

#[test]
fn a_cylinder_is_drilled_out_of_a_box_and_a_ball_out_of_its_middle() {
    let mesh = cube(5);
    let cutter =
        Cutter::cylinder(Point::new(0.1, -0.05, 3.0), Vector::new(0.0, 0.0, -2.0), 0.6).expect("cutter");
    let solid = Solid::of(&cutter.solid(Side::Minus).0, 1e-3).expect("solid");
    let n = solid.planes().len() as f64;
    let [drilled, _] = checked(&mesh, &solid);
    let polygon = n / 2.0 * 0.36 * (2.0 * PI / n).sin();
    assert!((drilled - 2.0 * polygon).abs() < 1e-13, "a prism of {n} sides: {drilled}");
    assert!(0.6 * (1.0 - (PI / n).cos()) <= 1e-3, "within the departure");

    let solid = Solid::ball(Point::new(0.1, 0.0, 0.0), 0.7, 5e-3).expect("solid");
    let [scooped, _] = checked(&mesh, &solid);
    let round = 4.0 / 3.0 * PI * 0.7_f64.powi(3);
    assert!(scooped < round && scooped > round * (1.0 - 5e-3 / 0.7_f64).powi(3), "{scooped} of {round}");
    // Where the ball reaches through a side, a dome is cut.
    let solid = Solid::ball(Point::new(0.0, 0.0, 1.2), 0.7, 5e-3).expect("solid");
    let height = 0.5;
    let dome = PI * height * height * (0.7 - height / 3.0);
    let [scooped, _] = checked(&mesh, &solid);
    assert!(scooped < dome && scooped > 0.97 * dome, "{scooped} of {dome}");
}

/// No facet lies further in than the departure, and none cuts anything but the ball's outside.
#[test]
fn a_balls_facets_lie_within_the_departure() {
    let mut dice = Dice::new(9);
    for (radius, sagitta) in [(1.0, 0.3), (2.0, 0.05), (20.0, 0.1), (22.0, 0.01)] {
        let solid = Solid::ball(Point::origin(), radius, sagitta).expect("solid");
        let mut deepest = 0.0_f64;
        for _ in 0..2000 {
            let out = dice.vector().normalize();
            let reach = |p: &Plane| p.normal().dot(&p.point().coords) / p.normal().dot(&out).max(1e-9);
            let wall = solid.planes().iter().map(reach).fold(f64::INFINITY, f64::min);
            assert!(wall <= radius * (1.0 + 1e-12), "outside the ball: {wall} of {radius}");
            deepest = deepest.max(radius - wall);
        }
        assert!(deepest <= sagitta * (1.0 + 1e-9), "{deepest} within {sagitta}");
        assert!(deepest > 0.5 * sagitta, "and not finer than asked for: {deepest} of {sagitta}");
    }
}

#[test]
fn a_meshs_vertices_go_where_the_cutter_says() {
    let mut dice = Dice::new(11);
    let mesh = ball(20);
    for _ in 0..40 {
        let cutter = Cutter::plane(Point::from(dice.vector() * 0.5), dice.vector()).expect("cutter");
        let parts =
            by_solid(&mesh, &Solid::of(&cutter.solid(Side::Minus).0, 0.01).expect("solid")).expect("cut");
        let plus = parts.plus.expect("plus");
        for p in mesh.positions() {
            assert_eq!(plus.positions().contains(p), cutter.side(p) == Some(Side::Plus), "{p}");
        }
    }
}

#[test]
fn what_is_no_solid_is_refused() {
    assert_eq!(Solid::new(Vec::new()), Err(SolidError::NoPlane), "nothing");
    let too_fine = Solid::cylinder(Point::origin(), Vector::z(), 1e9, 1e-9);
    assert!(matches!(too_fine, Err(SolidError::Sagitta { .. })), "too fine");
    let none = Solid::ball(Point::origin(), 1.0, 0.0);
    assert!(matches!(none, Err(SolidError::Sagitta { .. })), "no departure");
    assert!(Solid::ball(Point::origin(), -1.0, 0.1).is_err(), "no radius");
}

/// The convex hull of whole-numbered points, by trying every triangle; none where four lie in one face.
fn hull(dice: &mut Dice) -> Option<TriangleMesh> {
    let place = |_| (dice.vector().normalize() * 1000.0).map(f64::round);
    let corners: Vec<Vector> = (0..12).map(place).collect();
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in 0..12 {
            for c in (0..12).filter(|&c| a < b && a < c && b != c) {
                let normal = (corners[b] - corners[a]).cross(&(corners[c] - corners[a]));
                // Whole numbers below 2⁵³ throughout: exact.
                let above = |d: usize| normal.dot(&(corners[d] - corners[a]));
                let others = (0..12).filter(|d| ![a, b, c].contains(d));
                let highest = others.map(above).fold(f64::NEG_INFINITY, f64::max);
                if highest == 0.0 {
                    return None;
                }
                if highest < 0.0 {
                    triangles.push([a, b, c].map(|v| v as u32));
                }
            }
        }
    }
    Some(made(corners.into_iter().map(Point::from).collect(), triangles))
}

/// V − E + F = 2 in both parts of a convex body, for planes anywhere and, exactly, through its vertices, edges and
/// faces. `CUT_PLANES` says how many planes, 20 000 where it is not set.
#[test]
fn a_convex_body_falls_into_convex_bodies() {
    let wanted = std::env::var("CUT_PLANES").ok().and_then(|text| text.parse().ok()).unwrap_or(20_000_usize);
    let mut dice = Dice::new(13);
    let bodies: Vec<TriangleMesh> = (0..40).filter_map(|_| hull(&mut dice)).take(12).collect();
    assert_eq!(bodies.len(), 12, "bodies");
    let mut halved = 0;
    for round in 0..wanted {
        let body = &bodies[round % 12];
        let whole_number = |dice: &mut Dice| (dice.vector() * 1000.0).map(f64::round);
        let corners: Vec<Vector> = (0..3).map(|_| body.positions()[dice.below(12)].coords).collect();
        let [face_a, face_b, face_c] = body.corners(dice.below(body.triangles().len()));
        let (point, normal) = match round / 12 % 5 {
            0 => (dice.vector() * 900.0, dice.vector()),
            1 => (corners[0], whole_number(&mut dice)),
            2 => (face_a.coords, (face_b - face_a).cross(&whole_number(&mut dice))),
            3 => (corners[0], (corners[1] - corners[0]).cross(&(corners[2] - corners[0]))),
            _ => (face_a.coords, (face_b - face_a).cross(&(face_c - face_a))),
        };
        let Ok(plane) = Plane::new(Point::from(point), normal) else { continue };
        let parts = by_plane(body, &plane).expect("cut");
        let is_halved = parts.plus.is_some() && parts.minus.is_some();
        assert_eq!(parts.notes, Notes { closed: usize::from(is_halved), open: 0 }, "round {round}");
        halved += usize::from(is_halved);
        let closed = Edges { unmatched: 0, crowded: 0, euler: 2 };
        for part in [&parts.plus, &parts.minus].into_iter().flatten() {
            assert_eq!(edges(part), closed, "round {round}: {plane:?}");
            // And once more, by a plane through nothing in particular.
            let plane = Plane::new(Point::from(dice.vector() * 500.0), dice.vector()).expect("plane");
            let again = by_plane(part, &plane).expect("cut");
            for part in [&again.plus, &again.minus].into_iter().flatten() {
                assert_eq!(edges(part), closed, "round {round}, again: {plane:?}");
            }
        }
    }
    assert!(halved * 2 > wanted, "{halved} of {wanted} planes cut in two");
}
