//! Closed meshes whose form is known, and what their edges tell.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use crate::volume::cut::{Parts, Plane};
use crate::volume::{Point, TriangleMesh, Vector};

/// Numbers that look random and are the same in every run.
pub(super) struct Dice(u64);

impl Dice {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// Below `n`.
    pub(super) fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % n
    }

    /// In -1 … 1.
    pub(super) fn number(&mut self) -> f64 {
        self.below(1 << 50) as f64 / (1_u64 << 49) as f64 - 1.0
    }

    pub(super) fn vector(&mut self) -> Vector {
        Vector::new(self.number(), self.number(), self.number())
    }
}

pub(super) fn made(positions: Vec<Point>, triangles: Vec<[u32; 3]>) -> TriangleMesh {
    TriangleMesh::new(positions, triangles).expect("mesh")
}

/// The surface of a lattice of `n` squares a side over the faces of a cube from -1 to 1, so that its faces have
/// many vertices in one plane and on straight lines.
pub(super) fn cube(n: usize) -> TriangleMesh {
    let mut places: HashMap<[usize; 3], u32> = HashMap::new();
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for end in [0, n] {
            for i in 0..n {
                for j in 0..n {
                    let mut corner = |di: usize, dj: usize| {
                        let mut at = [0; 3];
                        (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (end, i + di, j + dj);
                        *places.entry(at).or_insert_with(|| {
                            positions.push(Point::from(at.map(|k| 2.0 * k as f64 / n as f64 - 1.0)));
                            positions.len() as u32 - 1
                        })
                    };
                    let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    triangles.extend(if end == 0 { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] });
                }
            }
        }
    }
    made(positions, triangles)
}

/// Rings of `around` places, `along` of them, joined to a ring themselves or closed by a pole at each end.
fn lofted(along: usize, around: usize, is_ring: bool, at: impl Fn(f64, f64) -> Point) -> TriangleMesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let rows = if is_ring { along } else { along - 1 };
    for i in 0..rows {
        let u = if is_ring { i } else { i + 1 } as f64 / along as f64;
        positions.extend((0..around).map(|j| at(u, j as f64 / around as f64)));
    }
    let place = |i: usize, j: usize| (i % rows * around + j % around) as u32;
    for i in 0..if is_ring { rows } else { rows - 1 } {
        for j in 0..around {
            let [a, b, c, d] = [place(i, j), place(i, j + 1), place(i + 1, j + 1), place(i + 1, j)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    if !is_ring {
        let (south, north) = (positions.len() as u32, positions.len() as u32 + 1);
        positions.extend([at(0.0, 0.0), at(1.0, 0.0)]);
        for j in 0..around {
            triangles.push([south, place(0, j + 1), place(0, j)]);
            triangles.push([north, place(rows - 1, j), place(rows - 1, j + 1)]);
        }
    }
    made(positions, triangles)
}

/// A ball of radius 1 with `2 n` meridians.
pub(super) fn ball(n: usize) -> TriangleMesh {
    lofted(n, 2 * n, false, |u, v| {
        let (polar, around) = (PI * (1.0 - u), TAU * v);
        Point::new(polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos())
    })
}

/// A torus of radii 2 and 0.7 about z.
pub(super) fn torus(n: usize) -> TriangleMesh {
    lofted(2 * n, n, true, |u, v| {
        let (long, short) = (-TAU * u, TAU * v);
        let r = 2.0 + 0.7 * short.cos();
        Point::new(r * long.cos(), r * long.sin(), 0.7 * short.sin())
    })
}

/// A tapered stem with a bent neck, as implants have.
pub(super) fn stem(n: usize) -> TriangleMesh {
    lofted(4 * n, n, false, |u, v| {
        let bend = (u - 0.6).max(0.0);
        let centre = Vector::new(3.0 * bend * bend * 4.0, 0.0, 6.0 * u);
        let width = 0.9 * (PI * u.powf(0.4)).sin() + 1e-3;
        let angle = TAU * v;
        Point::from(
            centre + Vector::new(1.3 * width * angle.cos(), width * angle.sin(), 0.2 * width * angle.cos()),
        )
    })
}

/// Several meshes as one; `flip` turns all triangles round.
pub(super) fn together(parts: &[(&TriangleMesh, Vector, f64)], flip: bool) -> TriangleMesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (mesh, shift, scale) in parts {
        let first = positions.len() as u32;
        positions.extend(mesh.positions().iter().map(|p| Point::from(p.coords * scale.abs() + shift)));
        // A scale below zero stands for a void: the surface turned inside out.
        triangles.extend(mesh.triangles().iter().map(|&[a, b, c]| {
            let t = if (*scale < 0.0) == flip { [a, b, c] } else { [a, c, b] };
            t.map(|v| v + first)
        }));
    }
    made(positions, triangles)
}

/// The mesh with its vertices moved to whole multiples of `step`, so that many lie in one plane.
pub(super) fn snapped(mesh: &TriangleMesh, step: f64) -> TriangleMesh {
    let positions = mesh.positions().iter().map(|p| p.map(|c| (c / step).round())).collect();
    made(positions, mesh.triangles().to_vec())
}

/// What the edges of a mesh tell.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Edges {
    /// Edges used more often in one direction than in the other.
    pub(super) unmatched: usize,
    /// Edges used more than once in a direction.
    pub(super) crowded: usize,
    /// V − E + F.
    pub(super) euler: i64,
}

pub(super) fn edges(mesh: &TriangleMesh) -> Edges {
    let mut uses: HashMap<(u32, u32), [i32; 2]> = HashMap::new();
    for &[a, b, c] in mesh.triangles() {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            uses.entry((p.min(q), p.max(q))).or_default()[usize::from(p > q)] += 1;
        }
    }
    let mut used: Vec<u32> = mesh.triangles().iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    Edges {
        unmatched: uses.values().filter(|[there, back]| there != back).count(),
        crowded: uses.values().filter(|[there, back]| *there > 1 || *back > 1).count(),
        euler: used.len() as i64 - uses.len() as i64 + mesh.triangles().len() as i64,
    }
}

/// Enclosed volume about the centre of `frame`'s box, summed without loss (Neumaier).
pub(super) fn volume(mesh: Option<&TriangleMesh>, frame: &TriangleMesh) -> f64 {
    let [low, high] = frame.bounds();
    let centre = nalgebra::center(&low, &high);
    let (mut sum, mut lost) = (0.0_f64, 0.0);
    for t in 0..mesh.map_or(0, |m| m.triangles().len()) {
        let Some(mesh) = mesh else { break };
        let [a, b, c] = mesh.corners(t).map(|p| p - centre);
        let term = a.dot(&b.cross(&c)) / 6.0;
        let next = sum + term;
        lost += if sum.abs() >= term.abs() { (sum - next) + term } else { (term - next) + sum };
        sum = next;
    }
    sum + lost
}

/// Everything that must hold of a closed mesh cut by a plane. Returns the number of crowded edges.
pub(super) fn check_halves(mesh: &TriangleMesh, plane: &Plane, parts: &Parts) -> usize {
    let [low, high] = mesh.bounds();
    let size = (high - low).norm() + low.coords.amax().max(high.coords.amax());
    let unit = plane.normal() / plane.normal().norm();
    let mut crowded = 0;
    for (part, sign) in [(&parts.plus, 1.0), (&parts.minus, -1.0)] {
        let Some(part) = part else { continue };
        let found = edges(part);
        assert_eq!(found.unmatched, 0, "{sign} is closed: {plane:?}");
        crowded += found.crowded;
        for p in part.positions() {
            let depth = sign * unit.dot(&(p - plane.point()));
            assert!(depth >= -1e-14 * size, "{p} lies {depth} mm on the wrong side of {plane:?}");
        }
    }
    assert_eq!(parts.notes.open, 0, "every line closes: {plane:?}");
    let whole = volume(Some(mesh), mesh);
    let [plus, minus] = [&parts.plus, &parts.minus].map(|part| volume(part.as_ref(), mesh));
    // Far from the origin, vertices themselves are rounded more coarsely than that.
    let rounding = f64::EPSILON * size * (high - low).norm_squared();
    let defect = (plus + minus - whole).abs();
    assert!(defect <= rounding.max(1e-12 * whole.abs()), "{plus} + {minus} is not {whole}: {plane:?}");
    crowded
}

/// Of the triangles in a plane: area as they face along its normal, and without regard to that; their
/// difference is overlap.
pub(super) fn area_in(mesh: &TriangleMesh, plane: &Plane, within: f64) -> [f64; 2] {
    let unit = plane.normal() / plane.normal().norm();
    let mut areas = [0.0; 2];
    for t in 0..mesh.triangles().len() {
        let corners = mesh.corners(t);
        if corners.iter().all(|p| unit.dot(&(p - plane.point())).abs() <= within) {
            let [a, b, c] = corners;
            let area = (b - a).cross(&(c - a)).dot(&unit) / 2.0;
            areas[0] += area;
            areas[1] += area.abs();
        }
    }
    areas
}
