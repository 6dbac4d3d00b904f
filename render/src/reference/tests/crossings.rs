//! Rays against triangles: an even number of crossings of what is closed, and no triangle overlooked.

use super::*;
use crate::reference::surface::{Hit, Surfaces};

fn mesh(positions: Vec<Point>, triangles: Vec<[u32; 3]>) -> MeshItem {
    MeshItem {
        mesh: Arc::new(TriangleMesh::new(positions, triangles).expect("a mesh")),
        pose: Affine::identity(),
        color: [1.0; 3],
        opacity: 0.5,
        shading: Shading::None,
    }
}

/// A torus of `n` by `m` quads with bumps; closed.
fn torus(n: u32, m: u32) -> MeshItem {
    let mut positions = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let a = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            let b = std::f64::consts::TAU * f64::from(j) / f64::from(m);
            let r = 2.0 + 0.3 * synth::noise(5, [i as usize, j as usize, 0]);
            let ring = 5.0 + r * b.cos();
            positions.push(Point::new(ring * a.cos(), ring * a.sin(), r * b.sin()));
        }
    }
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let at = |p: u32, q: u32| (p % n) * m + q % m;
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i + 1, j + 1), at(i, j + 1), at(i, j)]);
        }
    }
    mesh(positions, triangles)
}

/// A box of whole numbers, each side of `n` by `n` quads: rays along lattice directions meet its edges and
/// corners exactly.
fn lattice_box(n: i32) -> MeshItem {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [0, n] {
            for u in 0..n {
                for v in 0..n {
                    let corner = |du: i32, dv: i32| {
                        let mut p = Point::origin();
                        p[axis] = f64::from(side);
                        p[(axis + 1) % 3] = f64::from(u + du);
                        p[(axis + 2) % 3] = f64::from(v + dv);
                        p
                    };
                    // Corners are not shared: what counts is where they are, as in an STL file.
                    let first = positions.len() as u32;
                    positions.extend([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]);
                    triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
                }
            }
        }
    }
    mesh(positions, triangles)
}

fn count(surfaces: &Surfaces, start: Point, direction: Vector) -> Vec<Hit> {
    let mut hits = Vec::new();
    surfaces.hits(&start.coords, &direction.normalize(), &mut hits);
    hits
}

#[test]
fn rays_cross_a_closed_mesh_an_even_number_of_times() {
    let item = torus(40, 24);
    let surfaces = Surfaces::of(std::slice::from_ref(&item), &Point::origin());
    let unit = |k: usize, salt: usize| synth::noise(11, [k, salt, 0]);
    let mut crossed = [0_usize; 12];
    for k in 0..60_000 {
        let start = Point::new(unit(k, 0), unit(k, 1), unit(k, 2)) * 20.0 + Vector::new(0.0, 0.0, 40.0);
        // A third of the rays go through a vertex, a third through a point of an edge.
        let positions = item.mesh.positions();
        let [p, q, _] = item.mesh.triangles()[k % item.mesh.triangles().len()].map(|v| positions[v as usize]);
        let target = match k % 3 {
            0 => p,
            1 => p + (q - p) * unit(k, 3).abs(),
            _ => Point::new(unit(k, 4), unit(k, 5), 0.3 * unit(k, 6)) * 8.0,
        };
        let hits = count(&surfaces, start, target - start);
        assert_eq!(hits.len() % 2, 0, "ray {k} has {} crossings", hits.len());
        assert!(hits.windows(2).all(|pair| pair[0].at <= pair[1].at), "ray {k} is not sorted");
        crossed[hits.len()] += 1;
    }
    assert!(crossed[0] > 1000 && crossed[2] > 1000 && crossed[4] > 1000, "{crossed:?}");
}

#[test]
fn rays_through_edges_and_corners_of_a_box_cross_it_twice_or_not_at_all() {
    let n = 3;
    let surfaces = Surfaces::of(&[lattice_box(n)], &Point::origin());
    let (mut inside, mut outside) = (0, 0);
    for a in -2..=2 {
        for b in -2..=2 {
            for c in -2..=2 {
                let direction = Vector::new(f64::from(a), f64::from(b), f64::from(c));
                if direction == Vector::zeros() {
                    continue;
                }
                for k in 0..(2 * n + 3).pow(3) {
                    let side = 2 * n + 3;
                    let at = [k % side, k / side % side, k / (side * side)].map(|i| f64::from(i - 1) * 0.5);
                    let start = Point::from(at) - direction * 64.0;
                    let hits = count(&surfaces, start, direction).len();
                    assert!(hits == 0 || hits == 2, "{at:?} along {direction:?}: {hits} crossings");
                    // A point well inside is always between two crossings.
                    let within = at.iter().all(|&x| x > 0.25 && x < f64::from(n) - 0.25);
                    assert!(!within || hits == 2, "{at:?} along {direction:?} is inside");
                    if within { inside += 1 } else { outside += 1 }
                }
            }
        }
    }
    assert!(inside > 10_000 && outside > 10_000, "{inside} inside, {outside} not");
}

/// Möller and Trumbore's test on every triangle: no hierarchy, no shear.
#[test]
fn the_hierarchy_overlooks_no_triangle() {
    let item = torus(23, 11);
    let eye = Point::new(100.0, -50.0, 25.0);
    let surfaces = Surfaces::of(std::slice::from_ref(&item), &eye);
    let mut compared = 0;
    for k in 0..3000 {
        let unit = |salt: usize| synth::noise(17, [k, salt, 1]);
        let start = Point::new(unit(0), unit(1), unit(2)) * 6.0;
        let direction = Vector::new(unit(3), unit(4), unit(5)).normalize();
        let mut known = Vec::new();
        for t in 0..item.mesh.triangles().len() {
            let [a, b, c] = item.mesh.corners(t);
            let (e, f) = (b - a, c - a);
            let across = direction.cross(&f);
            let scale = 1.0 / e.dot(&across);
            let from = start - a;
            let (u, turned) = (from.dot(&across) * scale, from.cross(&e));
            let v = direction.dot(&turned) * scale;
            let at = f.dot(&turned) * scale;
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && at >= 0.0 {
                known.push(at);
            }
        }
        known.sort_by(f64::total_cmp);
        let hits = count(&surfaces, start - eye.coords, direction);
        assert_eq!(hits.len(), known.len(), "ray {k}");
        for (hit, at) in hits.iter().zip(&known) {
            assert!((hit.at - at).abs() < 1e-9, "ray {k}: {} is not {at}", hit.at);
            compared += 1;
        }
    }
    assert!(compared > 1500, "{compared} crossings compared");
}

#[test]
fn invisible_meshes_and_triangles_without_area_are_no_surface() {
    let mut hidden = torus(8, 6);
    hidden.opacity = 0.0;
    let line =
        mesh(vec![Point::new(-1.0, 0.0, 0.0), Point::new(1.0, 0.0, 0.0), Point::origin()], vec![[0, 1, 2]]);
    let surfaces = Surfaces::of(&[hidden, line], &Point::origin());
    for direction in [Vector::new(0.0, 0.0, 1.0), Vector::x(), Vector::new(0.3, 0.2, 1.0)] {
        assert_eq!(count(&surfaces, Point::new(0.0, 0.0, -30.0), direction), [], "along {direction:?}");
    }
}
