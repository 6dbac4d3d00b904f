//! Triangles to either side of a plane, and the edges in it.

use std::collections::HashMap;

use rayon::prelude::*;

use super::{CutError, Plane};
use crate::volume::{Point, TriangleMesh};

/// Triangles sorted by one task. It depends on nothing but itself, so that the order of the result does not
/// depend on the number of threads.
const CHUNK: usize = 1 << 14;

pub(super) type Triangle = [u32; 3];

/// The vertices of a mesh, followed by those that cuts have made.
#[derive(Debug)]
pub(super) struct Points<'a> {
    old: &'a [Point],
    new: Vec<Point>,
}

impl<'a> Points<'a> {
    pub(super) fn of(mesh: &'a TriangleMesh) -> Self {
        Self { old: mesh.positions(), new: Vec::new() }
    }

    pub(super) fn at(&self, vertex: u32) -> Point {
        let vertex = vertex as usize;
        self.old.get(vertex).copied().unwrap_or_else(|| self.new[vertex - self.old.len()])
    }

    pub(super) fn count(&self) -> usize {
        self.old.len() + self.new.len()
    }

    /// Whether a vertex was made by a cut.
    pub(super) fn is_new(&self, vertex: u32) -> bool {
        vertex as usize >= self.old.len()
    }

    /// Refuses where a cut of so many triangles might make more vertices than 32 bits count.
    pub(super) fn check_room(&self, triangles: usize) -> Result<(), CutError> {
        let most = self.count().saturating_add(triangles.saturating_mul(2));
        if most > u32::MAX as usize { Err(CutError::TooLarge { triangles }) } else { Ok(()) }
    }

    fn push(&mut self, p: Point) -> u32 {
        self.new.push(p);
        (self.count() - 1) as u32
    }
}

/// An edge in the plane, from its lower vertex to its higher, with how often it bounds what lies on either
/// side; backwards counts negative.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rim {
    pub(super) low: u32,
    pub(super) high: u32,
    pub(super) minus: i32,
    pub(super) plus: i32,
}

/// What a plane makes of triangles.
#[derive(Debug, Default)]
pub(super) struct Divided {
    pub(super) minus: Vec<Triangle>,
    pub(super) plus: Vec<Triangle>,
    pub(super) rim: Vec<Rim>,
}

impl Divided {
    /// Notes that the triangle of one side has the edge `from` `to` in the plane.
    fn rim(&mut self, from: u32, to: u32, [minus, plus]: [i32; 2]) {
        if from < to {
            self.rim.push(Rim { low: from, high: to, minus, plus });
        } else if to < from {
            self.rim.push(Rim { low: to, high: from, minus: -minus, plus: -plus });
        }
    }
}

/// The vertices that a plane has made, by the cut edge from its end on "-" to its end on "+".
#[derive(Debug, Default)]
pub(super) struct Crossings {
    made: HashMap<[u32; 2], u32>,
}

impl Crossings {
    /// The edges that were cut, each as its ends, lower first, and the vertex between them.
    pub(super) fn into_edges(self) -> impl Iterator<Item = ([u32; 2], u32)> {
        self.made.into_iter().map(|([a, b], at)| ([a.min(b), a.max(b)], at))
    }

    fn between(&mut self, points: &mut Points<'_>, plane: &Plane, minus: u32, plus: u32) -> u32 {
        *self.made.entry([minus, plus]).or_insert_with(|| {
            let (a, b) = (points.at(minus), points.at(plus));
            // Their signs are known; where rounding says otherwise the end lies in the plane as far as f64 can say.
            let (below, above) = ((-plane.value(&a)).max(0.0), plane.value(&b).max(0.0));
            let share = if below + above > 0.0 { below / (below + above) } else { 0.5 };
            // Within the edge's box, which also replaces what is no number after an overflow.
            let at = (a + (b - a) * share).coords.zip_zip_map(&a.coords, &b.coords, |at, a, b| {
                let (low, high) = (a.min(b), a.max(b));
                at.max(low).min(high)
            });
            points.push(Point::from(at))
        })
    }
}

/// Divides triangles by a plane. `signs` holds the side of every vertex that they name: -1, 0 in the plane, 1.
/// Whether the mesh is inside out is asked only where triangles lie in the plane.
pub(super) fn divide(
    points: &mut Points<'_>,
    plane: &Plane,
    signs: &[i8],
    triangles: &[Triangle],
    crossings: &mut Crossings,
    is_inside_out: impl FnOnce() -> bool,
) -> Divided {
    let sorted: Vec<Sorted> = triangles.par_chunks(CHUNK).map(|chunk| sort(signs, chunk)).collect();
    let mut all = Divided::default();
    let total = |of: fn(&Sorted) -> usize| sorted.iter().map(of).sum::<usize>();
    let more = 2 * total(|s| s.across.len()) + total(|s| s.flat.len());
    all.minus.reserve_exact(total(|s| s.whole.minus.len()) + more);
    all.plus.reserve_exact(total(|s| s.whole.plus.len()) + more);
    for Sorted { whole, .. } in &sorted {
        all.minus.extend_from_slice(&whole.minus);
        all.plus.extend_from_slice(&whole.plus);
        all.rim.extend_from_slice(&whole.rim);
    }
    for triangle in sorted.iter().flat_map(|s| &s.across) {
        cut(points, plane, signs, *triangle, crossings, &mut all);
    }
    let mut flat = sorted.iter().flat_map(|s| &s.flat).peekable();
    if flat.peek().is_some() {
        let is_inside_out = is_inside_out();
        for &[a, b, c] in flat {
            // It bounds what lies behind it; one without area may go anywhere.
            let is_minus = plane.faces(&[a, b, c].map(|v| points.at(v))) != is_inside_out;
            (if is_minus { &mut all.minus } else { &mut all.plus }).push([a, b, c]);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                all.rim(from, to, if is_minus { [1, 0] } else { [0, 1] });
            }
        }
    }
    all
}

/// Triangles by how they lie.
#[derive(Default)]
struct Sorted {
    whole: Divided,
    /// With vertices on both sides.
    across: Vec<Triangle>,
    /// In the plane.
    flat: Vec<Triangle>,
}

fn sort(signs: &[i8], triangles: &[Triangle]) -> Sorted {
    let Sorted { mut whole, mut across, mut flat } = Sorted::default();
    for &triangle in triangles {
        let [a, b, c] = triangle.map(|v| signs[v as usize]);
        if a == b && b == c && a != 0 {
            (if a > 0 { &mut whole.plus } else { &mut whole.minus }).push(triangle);
            continue;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if low < 0 && high > 0 {
            across.push(triangle);
            continue;
        }
        if low == 0 && high == 0 {
            flat.push(triangle);
            continue;
        }
        let is_plus = high > 0;
        (if is_plus { &mut whole.plus } else { &mut whole.minus }).push(triangle);
        let [p, q, r] = triangle;
        for (from, to, signs) in [(p, q, [a, b]), (q, r, [b, c]), (r, p, [c, a])] {
            if signs == [0, 0] {
                whole.rim(from, to, if is_plus { [0, 1] } else { [1, 0] });
            }
        }
    }
    Sorted { whole, across, flat }
}

/// Cuts a triangle with vertices on both sides.
fn cut(
    points: &mut Points<'_>,
    plane: &Plane,
    signs: &[i8],
    triangle: Triangle,
    crossings: &mut Crossings,
    out: &mut Divided,
) {
    let side = triangle.map(|v| signs[v as usize]);
    let turned = |first: usize| [0, 1, 2].map(|i| (triangle[(first + i) % 3], side[(first + i) % 3]));
    let mut between = |points: &mut Points<'_>, (p, sign): (u32, i8), (q, _): (u32, i8)| {
        if sign < 0 { crossings.between(points, plane, p, q) } else { crossings.between(points, plane, q, p) }
    };
    let give = |out: &mut Divided, sign: i8, triangle: Triangle| {
        (if sign < 0 { &mut out.minus } else { &mut out.plus }).push(triangle);
    };
    if let Some(first) = side.iter().position(|&s| s == 0) {
        // One vertex is in the plane: the cut goes from it to the edge across.
        let [(p, _), q, r] = turned(first);
        let x = between(points, q, r);
        give(out, q.1, [p, q.0, x]);
        give(out, r.1, [p, x, r.0]);
        let (from, to) = if q.1 < 0 { (x, p) } else { (p, x) };
        out.rim(from, to, [1, -1]);
        return;
    }
    // One vertex is alone on its side.
    let alone = (0..3).find(|&i| side[i] != side[(i + 1) % 3] && side[i] != side[(i + 2) % 3]).unwrap_or(0);
    let [p, q, r] = turned(alone);
    let (x, y) = (between(points, p, q), between(points, p, r));
    give(out, p.1, [p.0, x, y]);
    // The shorter diagonal makes the rounder triangles.
    let [px, py, pq, pr] = [x, y, q.0, r.0].map(|v| points.at(v));
    if (px - pr).norm_squared() <= (pq - py).norm_squared() {
        give(out, q.1, [x, q.0, r.0]);
        give(out, q.1, [x, r.0, y]);
    } else {
        give(out, q.1, [x, q.0, y]);
        give(out, q.1, [q.0, r.0, y]);
    }
    let (from, to) = if p.1 < 0 { (x, y) } else { (y, x) };
    out.rim(from, to, [1, -1]);
}
