//! Rays that pass close to a cell's edges, and cells that have no planes: by exact predicates.
//!
//! About the ray of pixel (i, j) a corner is (x - i·w, y - j·w), an arithmetic that depends on the corner and the ray alone.
//! From there on the side of an edge on which the ray passes is exact: the sign of a 2 by 2 determinant of two products, which
//! rounding cannot turn round unless both round to one number, and then their remainders decide. Where the ray meets an
//! edge it is taken as moved by (ε, ε²), and where two corners fall on one point as moved apart in the order of
//! their numbers (Edelsbrunner, Mücke 1990). So cells that share an edge or a face agree on it: each ray passes a
//! face of both or of neither.
//!
//! Depth and scalar on a face are the mean of its corners', weighted by the areas that the ray makes with its edges; depth
//! only where the face has no plane.

use std::cmp::Ordering;

use super::planes::{Planes, depth};
use super::{Corner, FACES, LANES, Raws, Rect, Tetrahedron};

/// One of each pixel of a group, where no access of memory straddles two lines of a cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Lanes<T>([T; LANES]);

/// Corners of an edge.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
/// A ray that misses.
const MISS: u8 = u8::MAX;
/// By the sides of the six edges, a bit each: the two faces that the ray passes, four times the one plus the other.
const PASSED: [u8; 64] = passed();

const fn passed() -> [u8; 64] {
    let mut table = [MISS; 64];
    let mut code = 0;
    while code < 64 {
        let (mut faces, mut count, mut f) = (0, 0, 0);
        while f < 4 {
            let across = FACES[f].1;
            // Between the three edges i-j, j-k and i-k; the last is gone round the other way.
            let [jk, ik, ij] = [(code >> across[0]) & 1, (code >> across[1]) & 1, (code >> across[2]) & 1];
            if ij == jk && ij != ik {
                faces = faces * 4 + f as u8;
                count += 1;
            }
            f += 1;
        }
        if count == 2 {
            table[code] = faces;
        }
        code += 1;
    }
    table
}

/// Areas below this are looked at by themselves: their products may underflow.
const TINY: f64 = 1e-290;
/// A tetrahedron as the predicates see it.
pub(super) struct Sides<'a> {
    corners: &'a [&'a Corner; 4],
    /// Weight, depth and scalar of each corner, the latter two times weight: the mean of corners is that of these over that
    /// of weights.
    fields: [[f64; 3]; 4],
    planes: Planes,
    perspective: bool,
}

impl<'a> Sides<'a> {
    #[inline(always)]
    pub(super) fn new(of: &'a Tetrahedron<'a>, perspective: bool) -> Self {
        let (corners, scalars) = (&of.0, scalars(of));
        let fields = [0, 1, 2, 3].map(|corner: usize| {
            let c = corners[corner];
            // A corner beside the eye has not been divided by its depth.
            let divided = perspective && c.w == 1.0;
            let [weight, depth] = if divided { [-c.rank, 1.0] } else { [1.0, c.z] };
            [weight, depth, scalars[corner] * weight]
        });
        Self { corners, fields, planes: Planes::new(corners), perspective }
    }

    /// Adds what the rays of `reach` pass; pixels are counted in `rect`.
    #[inline(never)]
    pub(super) fn pass_rect(&self, rect: &Rect, reach: &Rect, raws: &mut Raws) {
        for j in reach.low[1]..reach.high[1] {
            for i in (reach.low[0]..reach.high[0]).step_by(LANES) {
                let lanes = LANES.min((reach.high[0] - i) as usize);
                self.pass([i, j], rect.number([i, j]) as u32, lanes, raws);
            }
        }
    }

    /// Adds what the rays of the first `lanes` of a group from pixel (i, j) on pass; `first` is that pixel's number.
    #[inline(always)]
    pub(super) fn pass(&self, [i, j]: [i32; 2], first: u32, lanes: usize, raws: &mut Raws) {
        let y = self.corners.map(|c| c.y - f64::from(j) * c.w);
        let mut x = [Lanes([0.0; LANES]); 4];
        for (x, c) in x.iter_mut().zip(self.corners) {
            for (lane, x) in x.0.iter_mut().enumerate() {
                *x = c.x - f64::from(i + lane as i32) * c.w;
            }
        }
        let mut areas = [Lanes([0.0; LANES]); 6];
        // All bits set where the area is less than nothing.
        let mut sides = [Lanes([0_u64; LANES]); 6];
        let mut least = Lanes([f64::INFINITY; LANES]);
        for (edge, [a, b]) in EDGES.into_iter().enumerate() {
            for lane in 0..LANES {
                let area = x[a].0[lane] * y[b] - y[a] * x[b].0[lane];
                sides[edge].0[lane] = ((area.to_bits() as i64) >> 63) as u64;
                let size = area.abs();
                areas[edge].0[lane] = size;
                least.0[lane] = if size < least.0[lane] { size } else { least.0[lane] };
            }
        }
        if least.0.iter().all(|&least| least >= TINY) {
            self.pass_all([i, j], &areas, &sides, first, lanes, raws);
            return;
        }
        for lane in 0..lanes {
            let at = [i + lane as i32, j];
            let faces = PASSED[(exact_sides(self.corners, at) & 63) as usize];
            if faces != MISS {
                let areas = areas.map(|area| area.0[lane]);
                let of = |face| self.on(usize::from(face & 3), &areas, at);
                raws.add(first + lane as u32, [of(faces >> 2), of(faces)]);
            }
        }
    }

    /// Which faces the rays of a group pass, and where: without a branch for each ray, since which do is as good as random.
    #[inline(always)]
    fn pass_all(
        &self,
        at: [i32; 2],
        areas: &[Lanes<f64>; 6],
        sides: &[Lanes<u64>; 6],
        first: u32,
        lanes: usize,
        raws: &mut Raws,
    ) {
        // By the way that a ray passes, in or out: the faces passed so.
        let mut passed = [[Lanes([0_u64; LANES]); 4]; 2];
        let mut any = [Lanes([0_u64; LANES]); 2];
        for (face, (_, [jk, ik, ij])) in FACES.iter().enumerate() {
            let turned = if face % 2 == 1 { u64::MAX } else { 0 };
            for lane in 0..LANES {
                let [jk, ik, ij] = [sides[*jk].0[lane], sides[*ik].0[lane], sides[*ij].0[lane]];
                let passes = (ij ^ ik) & !(ij ^ jk);
                passed[0][face].0[lane] = passes & (ij ^ turned);
                passed[1][face].0[lane] = passes & !(ij ^ turned);
                any[0].0[lane] |= passed[0][face].0[lane];
                any[1].0[lane] |= passed[1][face].0[lane];
            }
        }
        let mut hit = Lanes([0; LANES]);
        for lane in 0..lanes {
            hit.0[lane] = any[0].0[lane] & any[1].0[lane];
        }
        if hit.0 == [0; LANES] {
            return;
        }
        let mut depths = [Lanes([0.0; LANES]); 2];
        let mut values = [Lanes([0.0; LANES]); 2];
        for way in 0..2 {
            let mut weights = [Lanes([0_u64; LANES]); 4];
            // Ranks of the planes passed, and where there is one.
            let mut ranks = Lanes([0_u64; LANES]);
            let mut known = Lanes([0_u64; LANES]);
            for (face, (corners, across)) in FACES.iter().enumerate() {
                let passed = &passed[way][face];
                for (corner, edge) in corners.iter().zip(across) {
                    for lane in 0..LANES {
                        weights[*corner].0[lane] |= passed.0[lane] & areas[*edge].0[lane].to_bits();
                    }
                }
                if self.planes.known(face) {
                    for lane in 0..LANES {
                        let rank = self.planes.rank(face, [at[0] + lane as i32, at[1]]);
                        ranks.0[lane] |= passed.0[lane] & rank.to_bits();
                        known.0[lane] |= passed.0[lane];
                    }
                }
            }
            let mut sums = [Lanes([0.0; LANES]); 3];
            for (corner, field) in self.fields.iter().enumerate() {
                for (sum, field) in sums.iter_mut().zip(field) {
                    for lane in 0..LANES {
                        let term = f64::from_bits(weights[corner].0[lane]) * field;
                        sum.0[lane] = if corner == 0 { term } else { sum.0[lane] + term };
                    }
                }
            }
            for lane in 0..LANES {
                let part = 1.0 / sums[0].0[lane];
                let on_plane = depth(f64::from_bits(ranks.0[lane]), self.perspective);
                depths[way].0[lane] = if known.0[lane] == 0 { sums[1].0[lane] * part } else { on_plane };
                values[way].0[lane] = sums[2].0[lane] * part;
            }
        }
        for lane in (0..lanes).filter(|&lane| hit.0[lane] != 0) {
            let of = |way: usize| [depths[way].0[lane], values[way].0[lane]];
            raws.add(first + lane as u32, [of(0), of(1)]);
        }
    }

    /// Depth and scalar where a ray passes a face.
    #[inline(always)]
    fn on(&self, face: usize, areas: &[f64; 6], at: [i32; 2]) -> [f64; 2] {
        let (corners, across) = &FACES[face];
        let [p, q, r] = corners.map(|c| &self.fields[c]);
        let [a, b, c] = across.map(|edge| areas[edge]);
        let sum = |of: usize| a * p[of] + b * q[of] + c * r[of];
        let weight = sum(0);
        // Seen edge-on, all areas nothing: any place of the face is as good.
        let [z, value] = if weight > 0.0 {
            let part = 1.0 / weight;
            [sum(1) * part, sum(2) * part]
        } else {
            [p[1] / p[0], p[2] / p[0]]
        };
        let on_plane = || depth(self.planes.rank(face, at), self.perspective);
        [if self.planes.known(face) { on_plane() } else { z }, value]
    }
}

/// The scalar of each corner.
#[inline(always)]
fn scalars((corners, constant): &Tetrahedron<'_>) -> [f64; 4] {
    let [p, q, r, s] = corners;
    constant.map_or([p.scalar, q.scalar, r.scalar, s.scalar], |value| [value; 4])
}

/// On which side of each edge the ray of a pixel passes, a bit each, set where the area is less than nothing.
#[cold]
#[inline(never)]
fn exact_sides(corners: &[&Corner; 4], [i, j]: [i32; 2]) -> u64 {
    let about = corners.map(|c| [c.x - f64::from(i) * c.w, c.y - f64::from(j) * c.w]);
    let mut sides = 0;
    for (edge, [a, b]) in EDGES.into_iter().enumerate() {
        let ([ax, ay], [bx, by]) = (about[a], about[b]);
        let (aw, bw) = (corners[a].w, corners[b].w);
        let turned = [[[ax, by], [ay, bx]], [[bw, ay], [aw, by]], [[aw, bx], [bw, ax]]];
        // In turn: as it is; the ray moved by ε along x; by ε² along y; the corner of the lower number moved along x, with
        // the ray still moved.
        let decided = turned.into_iter().map(|[p, q]| compare(p, q)).find(|o| o.is_ne());
        let negative = match decided {
            Some(order) => order.is_lt(),
            None => by < 0.0 || (by == 0.0 && bw > 0.0),
        };
        sides |= u64::from(negative) << edge;
    }
    sides
}

/// Exactly, how a·b compares with c·d.
fn compare([a, b]: [f64; 2], [c, d]: [f64; 2]) -> Ordering {
    // Far from where products lose digits to underflow.
    let [a, b, c, d] = [a, b, c, d].map(|v| v * f64::from_bits((1023 + 300) << 52));
    let (p, q) = (a * b, c * d);
    // Rounding never turns an order round; products that round alike differ by what they rounded off.
    let order = |p: f64, q: f64| p.partial_cmp(&q).unwrap_or(Ordering::Equal);
    order(p, q).then_with(|| order(a.mul_add(b, -p), c.mul_add(d, -q)))
}
