//! Planes: through nothing in particular, through vertices, edges and faces; open and broken meshes.

use std::collections::HashMap;

use super::shapes::{
    Dice, area_in, ball, check_halves, cube, edges, made, snapped, stem, together, torus, volume,
};
use crate::volume::cut::{Notes, Plane, by_plane};
use crate::volume::{Point, TriangleMesh, Vector};

fn plane(point: [f64; 3], normal: [f64; 3]) -> Plane {
    Plane::new(Point::from(point), Vector::from(normal)).expect("plane")
}

/// The plane through three vertices of a mesh; none where they lie on a line.
fn through_three(mesh: &TriangleMesh, dice: &mut Dice) -> Option<Plane> {
    let mut pick = || mesh.positions()[dice.below(mesh.positions().len())];
    let (a, b, c) = (pick(), pick(), pick());
    Plane::new(a, (b - a).cross(&(c - a))).ok()
}

/// Through a face: its own plane.
fn through_face(mesh: &TriangleMesh, dice: &mut Dice) -> Option<Plane> {
    let [a, b, c] = mesh.corners(dice.below(mesh.triangles().len()));
    Plane::new(a, (b - a).cross(&(c - a))).ok()
}

fn through_edge(mesh: &TriangleMesh, dice: &mut Dice) -> Option<Plane> {
    let [a, b, _] = mesh.corners(dice.below(mesh.triangles().len()));
    Plane::new(a, (b - a).cross(&dice.vector())).ok()
}

fn through_vertex(mesh: &TriangleMesh, dice: &mut Dice) -> Option<Plane> {
    let at = mesh.positions()[dice.below(mesh.positions().len())];
    Plane::new(at, dice.vector()).ok()
}

fn anywhere(mesh: &TriangleMesh, dice: &mut Dice) -> Option<Plane> {
    let [low, high] = mesh.bounds();
    let at = low + (high - low).component_mul(&dice.vector().map(|c| c.mul_add(0.55, 0.5)));
    Plane::new(at, dice.vector()).ok()
}

type Choice = fn(&TriangleMesh, &mut Dice) -> Option<Plane>;

const CHOICES: [Choice; 5] = [anywhere, through_vertex, through_edge, through_face, through_three];

fn shapes() -> Vec<(&'static str, TriangleMesh)> {
    let (box_, round, ring) = (cube(1), ball(8), torus(10));
    let far = Vector::new(1e6, -2e6, 3e5);
    vec![
        ("box", cube(1)),
        ("box of lattices", cube(5)),
        ("ball", ball(12)),
        ("torus", torus(14)),
        ("stem", stem(16)),
        ("snapped ball", snapped(&ball(12), 0.125)),
        ("snapped torus", snapped(&torus(14), 0.125)),
        ("snapped stem", snapped(&stem(16), 0.25)),
        ("torus far away", together(&[(&ring, far, 1.0)], false)),
        ("box inside out", together(&[(&box_, Vector::zeros(), 1.0)], true)),
        ("hollow ball", together(&[(&round, Vector::zeros(), 1.0), (&round, Vector::zeros(), -0.6)], false)),
        (
            "ball in the void of a box beside a torus",
            together(
                &[
                    (&box_, Vector::zeros(), 1.0),
                    (&box_, Vector::zeros(), -0.9),
                    (&round, Vector::zeros(), 0.8),
                    (&round, Vector::zeros(), -0.5),
                    (&ring, Vector::new(4.0, 0.0, 0.0), 1.0),
                ],
                false,
            ),
        ),
    ]
}

#[test]
fn ten_thousand_planes_leave_closed_halves_whose_volumes_add_up() {
    let mut dice = Dice::new(1);
    let mut done = 0;
    for (name, mesh) in shapes() {
        for choice in CHOICES {
            for _ in 0..175 {
                let Some(plane) = choice(&mesh, &mut dice) else { continue };
                let parts = by_plane(&mesh, &plane).expect(name);
                let crowded = check_halves(&mesh, &plane, &parts);
                // Snapped shapes have vertices at one place and pass through themselves; all others have no edge
                // with more than two triangles, and do not get one.
                assert!(
                    crowded == 0 || name.contains("snapped"),
                    "{name}: {crowded} edges are crowded: {plane:?}"
                );
                done += 1;
            }
        }
    }
    assert!(done > 10_000, "only {done} planes");
}

/// The cap of a solid that does not pass through itself has no overlap: its triangles all face one way. Where the
/// plane lies within rounding of a face the outline is as wide as rounding, so those are asked of exact shapes only.
#[test]
fn caps_cover_their_opening_once() {
    let mut dice = Dice::new(2);
    for (name, mesh) in shapes().into_iter().filter(|(name, _)| !name.contains("snapped")) {
        let choices = if name.starts_with("box") { 5 } else { 3 };
        for choice in &CHOICES[..choices] {
            for _ in 0..60 {
                let Some(plane) = choice(&mesh, &mut dice) else { continue };
                let parts = by_plane(&mesh, &plane).expect(name);
                let Some(minus) = &parts.minus else { continue };
                let [low, high] = mesh.bounds();
                let reach = low.coords.amax().max(high.coords.amax());
                let [facing, all] = area_in(minus, &plane, 1e-14 * reach);
                let overlap = all - facing.abs();
                assert!(overlap <= 1e-13 * reach * reach, "{name}: {overlap} of {all} mm²: {plane:?}");
            }
        }
    }
}

#[test]
fn a_box_is_cut_where_the_plane_is() {
    for n in [1, 4, 7] {
        let mesh = cube(n);
        let parts = by_plane(&mesh, &plane([0.0, 0.0, 0.25], [0.0, 0.0, 3.0])).expect("cut");
        let (plus, minus) = (parts.plus.expect("above"), parts.minus.expect("below"));
        assert!((volume(Some(&plus), &mesh) - 4.0 * 0.75).abs() < 1e-14, "above");
        assert!((volume(Some(&minus), &mesh) - 4.0 * 1.25).abs() < 1e-14, "below");
        assert_eq!((edges(&plus).euler, edges(&minus).euler), (2, 2), "both are boxes");
        assert_eq!(parts.notes, Notes { closed: 1, open: 0 }, "one line around");
        let [facing, _] = area_in(&minus, &plane([0.0, 0.0, 0.25], [0.0, 0.0, 1.0]), 0.0);
        assert_eq!(facing, 4.0, "the cap faces up");
    }
}

#[test]
fn a_torus_across_falls_into_two_bows_and_along_into_two_rings() {
    let mesh = torus(24);
    let euler = |normal, point| {
        let parts = by_plane(&mesh, &plane(point, normal)).expect("cut");
        assert_eq!(parts.notes, Notes { closed: 2, open: 0 }, "two lines");
        [parts.plus, parts.minus].map(|part| edges(&part.expect("a part")).euler)
    };
    assert_eq!(
        euler([0.3, 1.0, 0.1], [0.01, 0.02, 0.03]),
        [2, 2],
        "each half is one bow, a ball to topology"
    );
    assert_eq!(
        euler([0.01, 0.02, 1.0], [0.01, 0.02, 0.03]),
        [0, 0],
        "each half is a ring, its cap has a hole"
    );
}

#[test]
fn a_plane_in_a_face_beside_the_mesh_or_through_a_corner_only_leaves_it_whole() {
    let mesh = cube(3);
    for (point, normal) in [
        ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]),
        ([0.0, 0.0, 5.0], [0.0, 0.0, 1.0]),
        ([1.0, 1.0, 1.0], [1.0, 1.0, 1.0]),
        ([1.0, 1.0, 0.0], [1.0, 1.0, 0.0]),
    ] {
        let below = by_plane(&mesh, &plane(point, normal)).expect("cut");
        assert_eq!(below.plus, None, "nothing beyond {normal:?}");
        assert_eq!(below.minus.as_ref(), Some(&mesh), "all of it, as it was");
        assert_eq!(below.notes, Notes::default(), "no cut");
        let above = by_plane(&mesh, &plane(point, normal.map(|c: f64| -c))).expect("cut");
        assert_eq!((above.minus, above.plus.as_ref()), (None, Some(&mesh)), "turned round");
    }
}

#[test]
fn a_vertex_in_the_plane_is_not_doubled() {
    // Every vertex of the middle lattice line lies in the plane, so no edge is cut.
    let mesh = cube(4);
    let parts = by_plane(&mesh, &plane([0.0; 3], [1.0, 0.0, 0.0])).expect("cut");
    for part in [parts.plus.expect("right"), parts.minus.expect("left")] {
        let mut places: Vec<_> = part.positions().iter().map(|p| [p.x, p.y, p.z].map(f64::to_bits)).collect();
        places.sort_unstable();
        places.dedup();
        assert_eq!(places.len(), part.positions().len(), "no two at one place");
        assert!(part.positions().iter().all(|p| mesh.positions().contains(p)), "and no new one");
        assert_eq!(edges(&part), super::shapes::Edges { unmatched: 0, crowded: 0, euler: 2 }, "a box");
    }
}

/// Two boxes that touch along an edge, cut across it: two squares that touch at a corner.
#[test]
fn lines_that_touch_are_covered_apart() {
    let positions: Vec<Point> = (0..18)
        .map(|i| Point::new(f64::from(i % 3) - 1.0, f64::from(i / 3 % 3) - 1.0, f64::from(i / 9)))
        .collect();
    let mut triangles = Vec::new();
    for [x, y] in [[0, 0], [1, 1]] {
        let at = |dx: u32, dy: u32, z: u32| x + dx + 3 * (y + dy) + 9 * z;
        let corner = [at(0, 0, 0), at(1, 0, 0), at(1, 1, 0), at(0, 1, 0)];
        let top = corner.map(|v| v + 9);
        triangles.extend([[corner[0], corner[2], corner[1]], [corner[0], corner[3], corner[2]]]);
        triangles.extend([[top[0], top[1], top[2]], [top[0], top[2], top[3]]]);
        for i in 0..4 {
            let j = (i + 1) % 4;
            triangles.extend([[corner[i], corner[j], top[j]], [corner[i], top[j], top[i]]]);
        }
    }
    let mesh = made(positions, triangles);
    let level = plane([0.0, 0.0, 0.5], [0.0, 0.0, 1.0]);
    let parts = by_plane(&mesh, &level).expect("cut");
    assert_eq!(parts.notes, Notes { closed: 2, open: 0 }, "two squares");
    check_halves(&mesh, &level, &parts);
    assert_eq!(area_in(&parts.minus.expect("below"), &level, 1e-15), [2.0, 2.0], "each covered once");
}

/// A hole that touches its outline at a corner belongs to it: one line that passes there twice.
#[test]
fn a_hole_that_touches_its_outline_stays_open() {
    // A prism over a square with a triangle cut out of it, whose tip is a corner of the square.
    let outline = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
    let hole = [[0.0, 0.0], [1.0, 3.0], [3.0, 1.0]];
    let flat = [&outline[..], &hole[1..]].concat();
    let n = flat.len() as u32;
    let positions =
        [0.0, 1.0].iter().flat_map(|&z| flat.iter().map(move |p| Point::new(p[0], p[1], z))).collect();
    let mut triangles = Vec::new();
    for way in [[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [4, 5], [5, 0]] {
        let [a, b]: [u32; 2] = way;
        triangles.extend([[a, b, b + n], [a, b + n, a + n]]);
    }
    for [a, b, c] in [[0, 1, 5], [1, 2, 5], [5, 2, 4], [4, 2, 3], [0, 4, 3]] {
        triangles.extend([[a, c, b], [a + n, b + n, c + n]]);
    }
    let mesh = made(positions, triangles);
    assert_eq!(edges(&mesh).unmatched, 0, "the test's own shape is closed");
    let level = plane([0.0, 0.0, 0.5], [0.0, 0.0, 1.0]);
    let parts = by_plane(&mesh, &level).expect("cut");
    check_halves(&mesh, &level, &parts);
    let [facing, all] = area_in(&parts.minus.expect("below"), &level, 1e-15);
    assert!(
        (facing - 12.0).abs() < 1e-14 && (all - 12.0).abs() < 1e-14,
        "16 less the hole's 4: {facing}, {all}"
    );
}

#[test]
fn an_open_mesh_is_cut_and_what_does_not_close_is_said() {
    let whole = ball(10);
    // Without a quarter of its faces, in one piece.
    let some = whole
        .triangles()
        .iter()
        .copied()
        .filter(|t| t.iter().any(|&v| whole.positions()[v as usize].x < 0.4));
    let shell = made(whole.positions().to_vec(), some.collect());
    let parts = by_plane(&shell, &plane([0.0, 0.0, 0.1], [0.1, 0.0, 1.0])).expect("cut");
    assert_eq!(parts.notes, Notes { closed: 0, open: 1 }, "one line from rim to rim");
    let count = |part: &Option<TriangleMesh>| part.as_ref().map_or(0, |m| m.triangles().len());
    assert!(count(&parts.plus) > 50 && count(&parts.minus) > 50, "both parts are there");
    let parts = by_plane(&shell, &plane([-0.5, 0.0, 0.0], [1.0, 0.0, 0.1])).expect("cut");
    assert_eq!(parts.notes, Notes { closed: 1, open: 0 }, "away from the opening the line closes");
    assert_eq!(edges(&parts.minus.expect("the cup's bottom")).unmatched, 0, "and that part is closed");
}

#[test]
fn the_rim_of_an_opening_in_the_plane_is_no_cut() {
    let whole = cube(3);
    let some = whole
        .triangles()
        .iter()
        .copied()
        .filter(|t| t.iter().any(|&v| whole.positions()[v as usize].z < 0.99));
    let open = made(whole.positions().to_vec(), some.collect());
    let parts = by_plane(&open, &plane([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])).expect("cut");
    assert_eq!((parts.plus, parts.notes), (None, Notes::default()), "nothing above");
    assert_eq!(parts.minus.expect("below").triangles(), open.triangles(), "and no lid");
}

/// Triangles of a binary STL file, corners at one place being one vertex.
fn stl(bytes: &[u8]) -> TriangleMesh {
    let mut known: HashMap<[u32; 3], u32> = HashMap::new();
    let mut positions = Vec::new();
    let mut corner = |bytes: &[u8]| {
        let numbers = [0, 4, 8].map(|i| f32::from_le_bytes(bytes[i..i + 4].try_into().expect("four bytes")));
        *known.entry(numbers.map(f32::to_bits)).or_insert_with(|| {
            positions.push(Point::from(numbers.map(f64::from)));
            positions.len() as u32 - 1
        })
    };
    let faces = bytes[84..].chunks_exact(50);
    let triangles = faces.map(|face| [12, 24, 36].map(|at| corner(&face[at..]))).collect();
    made(positions, triangles)
}

/// Bones and implants as scanned and as designed; one of them is open, one inside out.
#[test]
fn real_surfaces_are_cut_like_made_ones() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/mesh");
    let Ok(files) = std::fs::read_dir(&folder) else {
        println!("not tested: there is no {}", folder.display());
        return;
    };
    let mut paths: Vec<_> = files.flatten().map(|entry| entry.path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "stl"));
    paths.sort();
    let mut dice = Dice::new(17);
    let mut closed = 0;
    for path in &paths {
        let mesh = stl(&std::fs::read(path).expect("a file"));
        let is_closed = edges(&mesh).unmatched == 0;
        closed += usize::from(is_closed);
        for choice in CHOICES {
            for _ in 0..6 {
                let Some(plane) = choice(&mesh, &mut dice) else { continue };
                let parts = by_plane(&mesh, &plane).expect("cut");
                if is_closed {
                    check_halves(&mesh, &plane, &parts);
                }
                let kept = [parts.plus, parts.minus].into_iter().flatten().map(|m| m.triangles().len());
                assert!(kept.sum::<usize>() >= mesh.triangles().len(), "no triangle is lost");
            }
        }
    }
    assert!(closed >= 4, "{closed} of {} are closed", paths.len());
}

#[test]
fn broken_meshes_do_not_disturb() {
    let mut dice = Dice::new(3);
    for round in 0..400 {
        // Triangles thrown together: degenerate, doubled, contradicting, many of them in one plane.
        let positions: Vec<Point> =
            (0..12).map(|_| Point::from(dice.vector().map(|c| (c * 2.0).round()))).collect();
        let triangles = (0..40).map(|_| [0; 3].map(|_: u32| dice.below(12) as u32)).collect();
        let mesh = made(positions, triangles);
        let normal = dice.vector().map(|c| (c * 2.0).round());
        let Ok(plane) = Plane::new(Point::origin(), normal) else { continue };
        let parts = by_plane(&mesh, &plane).expect("cut");
        let kept = [&parts.plus, &parts.minus].map(|p| p.as_ref().map_or(0, |m| m.triangles().len()));
        assert!(kept.iter().sum::<usize>() >= 40, "round {round}: no triangle is lost");
    }
}

/// A prism over a star of many corners, and one whose section is a comb: outlines far from convex.
#[test]
fn ragged_outlines_are_covered_without_overlap() {
    let mut dice = Dice::new(5);
    let n = 3000_u32;
    let star = |i: u32| {
        let angle = std::f64::consts::TAU * f64::from(i) / f64::from(n);
        let r = if i.is_multiple_of(2) { 3.0 } else { 1.0 } + 0.5 * dice.number();
        Point::new(r * angle.cos(), r * angle.sin(), 0.0)
    };
    let low: Vec<Point> = (0..n).map(star).collect();
    let positions = low.iter().copied().chain(low.iter().map(|p| p + Vector::z())).collect();
    let walls = (0..n).flat_map(|i| {
        let j = (i + 1) % n;
        [[i, j, j + n], [i, j + n, i + n]]
    });
    let mesh = made(positions, walls.collect());
    let level = plane([0.0, 0.0, 0.5], [0.0, 0.0, 1.0]);
    let parts = by_plane(&mesh, &level).expect("cut");
    let cross = |i: usize| low[i].coords.cross(&low[(i + 1) % low.len()].coords).z / 2.0;
    let area: f64 = (0..low.len()).map(cross).sum();
    for part in [parts.plus.expect("above"), parts.minus.expect("below")] {
        let [facing, all] = area_in(&part, &level, 1e-12);
        assert!((facing.abs() - area).abs() < 1e-12 * area, "all of it: {facing} of {area}");
        assert!((all - area).abs() < 1e-12 * area, "once: {all} of {area}");
    }
}

#[test]
fn one_and_four_threads_cut_alike() {
    let mesh = torus(160);
    let plane = plane([0.1, 0.2, 0.05], [0.3, 0.2, 1.0]);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| by_plane(&mesh, &plane).expect("cut"))
    };
    assert_eq!(with(1), with(4), "the same");
}
