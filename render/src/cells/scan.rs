//! Scan conversion: which pixels' rays pass a tetrahedron, and where they enter and leave it.
//!
//! A corner before the camera is a point (x, y, w) of the projective plane, in pixels, where whole numbers are the
//! middles of pixels; w is 1 but for corners beside or behind a perspective eye, which no division reaches. About the
//! ray of pixel (i, j) it is (x - i·w, y - j·w), an arithmetic that depends on the corner and the ray alone. From there
//! on the side of an edge on which the ray passes is exact: the sign of a 2 by 2 determinant of two products, which
//! rounding cannot turn round unless both round to one number, and then their remainders decide. Where the ray meets an
//! edge it is taken as moved by (ε, ε²), and where two corners fall on one point as moved apart in the order of
//! their numbers (Edelsbrunner, Mücke 1990). So cells that share an edge or a face agree on it: each ray passes a
//! face of both or of neither.
//!
//! Depth and value on a face are the mean of its corners', weighted by the areas that the ray makes with its edges, added
//! up in the order of the corners' numbers: cells that share the face get the same bits.

use std::cmp::Ordering;

/// Pixels that go at once.
const LANES: usize = 4;

/// One of each pixel of a group, where no access of memory straddles two lines of a cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Lanes<T>([T; LANES]);

/// A corner before the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Corner {
    /// Place in the picture, pixels, times w.
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) w: f64,
    /// Depth of a mean of corners is the mean of `depth` over the mean of `weight`.
    pub(super) depth: f64,
    pub(super) weight: f64,
    /// The scalar times `weight`.
    pub(super) value: f64,
    /// Depth of the corner itself; mm before the eye plane.
    pub(super) z: f64,
}

/// Pixels from `low` up to but not at `high`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    pub(super) low: [i32; 2],
    pub(super) high: [i32; 2],
}

impl Rect {
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.low[0] >= self.high[0] || self.low[1] >= self.high[1]
    }

    #[inline(always)]
    pub(super) fn meet(&self, other: &Self) -> Self {
        Self {
            low: [0, 1].map(|a| self.low[a].max(other.low[a])),
            high: [0, 1].map(|a| self.high[a].min(other.high[a])),
        }
    }

    pub(super) fn size(&self) -> [usize; 2] {
        [0, 1].map(|a| usize::try_from(self.high[a] - self.low[a]).unwrap_or(0))
    }

    /// How many pixels.
    pub(super) fn area(&self) -> usize {
        self.size().into_iter().product()
    }

    /// The pixels whose rays may pass between corners: all of `within` where one of them is not before the eye.
    #[inline(always)]
    pub(super) fn around<'a>(corners: impl IntoIterator<Item = &'a Corner>, within: &Self) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for c in corners {
            if c.w != 1.0 {
                return *within;
            }
            low = [low[0].min(c.x), low[1].min(c.y)];
            high = [high[0].max(c.x), high[1].max(c.y)];
        }
        // `as` saturates; one more keeps the range half open.
        let found = Self {
            low: low.map(|v| v.ceil() as i32),
            high: high.map(|v| (v.floor() as i32).saturating_add(1)),
        };
        found.meet(within)
    }
}

/// What a ray has of one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Raw {
    /// Depth where it enters and leaves; mm before the eye plane.
    pub(super) front: f64,
    pub(super) back: f64,
    /// The scalar there.
    pub(super) values: [f32; 2],
    /// Which of the rectangle's, row by row.
    pub(super) pixel: u32,
}

/// Corners of an edge.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
/// Corners of a face, and for each the edge across from it.
const FACES: [([usize; 3], [usize; 3]); 4] =
    [([1, 2, 3], [5, 4, 3]), ([0, 2, 3], [5, 2, 1]), ([0, 1, 3], [4, 2, 0]), ([0, 1, 2], [3, 1, 0])];
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
/// What is gathered before it is handed on.
const GATHERED: usize = 256;

/// What rays have of cells, gathered until there is enough of it.
#[derive(Debug)]
pub(super) struct Raws {
    list: [Raw; GATHERED + LANES],
    count: usize,
}

impl Default for Raws {
    fn default() -> Self {
        let none = Raw { front: 0.0, back: 0.0, values: [0.0; 2], pixel: 0 };
        Self { list: [none; GATHERED + LANES], count: 0 }
    }
}

impl Raws {
    /// Takes out what is there.
    #[inline(always)]
    pub(super) fn take(&mut self) -> &[Raw] {
        &self.list[..std::mem::take(&mut self.count)]
    }

    /// Adds where a ray passes two faces, if it does so before the eye.
    #[inline(always)]
    fn add(&mut self, pixel: u32, [a, b]: [[f64; 2]; 2]) {
        let [mut front, mut from] = if a[0] <= b[0] { a } else { b };
        let [back, to] = if a[0] <= b[0] { b } else { a };
        if back > 0.0 && back > front {
            if front < 0.0 {
                from += (to - from) * (front / (front - back));
                front = 0.0;
            }
            self.list[self.count] = Raw { front, back, values: [from as f32, to as f32], pixel };
            self.count += 1;
        }
    }
}

/// Finds what the rays of `reach`, which lies within `rect`, have of a tetrahedron. Its corners stand in the order of their
/// numbers. Pixels are counted in `rect`. Whenever much is gathered it goes to `full`; what is left stays in `raws`.
#[inline(always)]
pub(super) fn scan(
    corners: [&Corner; 4],
    [rect, reach]: [&Rect; 2],
    raws: &mut Raws,
    full: &mut impl FnMut(&[Raw]),
) {
    let fields = corners.map(|c| [c.weight, c.depth, c.value]);
    let width = rect.high[0] - rect.low[0];
    for j in reach.low[1]..reach.high[1] {
        let row = (j - rect.low[1]) * width - rect.low[0];
        let y = corners.map(|c| c.y - f64::from(j) * c.w);
        let mut i = reach.low[0];
        while i < reach.high[0] {
            let mut x = [Lanes([0.0; LANES]); 4];
            for (x, c) in x.iter_mut().zip(corners) {
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
            let lanes = LANES.min((reach.high[0] - i) as usize);
            let first = (row + i) as u32;
            if least.0.iter().any(|&least| least < TINY) {
                for lane in 0..lanes {
                    let code = exact_sides(&corners, [i + lane as i32, j]);
                    let faces = PASSED[(code & 63) as usize];
                    if faces != MISS {
                        let of = |face| pass(&fields, face, &areas, lane);
                        raws.add(first + lane as u32, [of(faces >> 2), of(faces)]);
                    }
                }
            } else {
                pass_all(&fields, &areas, &sides, first, lanes, raws);
            }
            if raws.count >= GATHERED {
                full(raws.take());
            }
            i += LANES as i32;
        }
    }
}

/// Which faces the rays of a group pass, and where: without a branch for each ray, since which do is as good as random.
#[inline(always)]
fn pass_all(
    fields: &[[f64; 3]; 4],
    areas: &[Lanes<f64>; 6],
    sides: &[Lanes<u64>; 6],
    first: u32,
    lanes: usize,
    raws: &mut Raws,
) {
    // By the way that a ray passes, in or out: the faces passed so, and the weights of the corners there.
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
    let hit: [u64; LANES] =
        std::array::from_fn(|lane| if lane < lanes { any[0].0[lane] & any[1].0[lane] } else { 0 });
    if hit[0] | hit[1] | hit[2] | hit[3] == 0 {
        return;
    }
    let mut depths = [Lanes([0.0; LANES]); 2];
    let mut values = [Lanes([0.0; LANES]); 2];
    for way in 0..2 {
        let mut weights = [Lanes([0_u64; LANES]); 4];
        for (face, (corners, across)) in FACES.iter().enumerate() {
            for (corner, edge) in corners.iter().zip(across) {
                for lane in 0..LANES {
                    weights[*corner].0[lane] |= passed[way][face].0[lane] & areas[*edge].0[lane].to_bits();
                }
            }
        }
        let mut sums = [Lanes([0.0; LANES]); 3];
        for (corner, field) in fields.iter().enumerate() {
            for (sum, field) in sums.iter_mut().zip(field) {
                for lane in 0..LANES {
                    let term = f64::from_bits(weights[corner].0[lane]) * field;
                    sum.0[lane] = if corner == 0 { term } else { sum.0[lane] + term };
                }
            }
        }
        for lane in 0..LANES {
            let part = 1.0 / sums[0].0[lane];
            depths[way].0[lane] = sums[1].0[lane] * part;
            values[way].0[lane] = sums[2].0[lane] * part;
        }
    }
    let (mut fronts, mut backs) = ([0.0; LANES], [0.0; LANES]);
    let (mut from, mut to) = ([0.0_f32; LANES], [0.0_f32; LANES]);
    for lane in 0..LANES {
        let in_order = depths[0].0[lane] <= depths[1].0[lane];
        fronts[lane] = if in_order { depths[0].0[lane] } else { depths[1].0[lane] };
        backs[lane] = if in_order { depths[1].0[lane] } else { depths[0].0[lane] };
        from[lane] = if in_order { values[0].0[lane] } else { values[1].0[lane] } as f32;
        to[lane] = if in_order { values[1].0[lane] } else { values[0].0[lane] } as f32;
    }
    if fronts.iter().any(|&front| front < 0.0) {
        for lane in (0..LANES).filter(|&lane| hit[lane] != 0) {
            let of = |way: usize| [depths[way].0[lane], values[way].0[lane]];
            raws.add(first + lane as u32, [of(0), of(1)]);
        }
        return;
    }
    for lane in 0..LANES {
        let values = [from[lane], to[lane]];
        raws.list[raws.count] =
            Raw { front: fronts[lane], back: backs[lane], values, pixel: first + lane as u32 };
        let counts = if backs[lane] > fronts[lane] { hit[lane] } else { 0 };
        raws.count += usize::from(counts != 0);
    }
}

/// Depth and scalar where a ray passes a face; `fields` are weight, depth and value of each corner.
#[inline(always)]
fn pass(fields: &[[f64; 3]; 4], face: u8, areas: &[Lanes<f64>; 6], lane: usize) -> [f64; 2] {
    let ([i, j, k], across) = &FACES[usize::from(face & 3)];
    let [p, q, r] = [&fields[*i & 3], &fields[*j & 3], &fields[*k & 3]];
    let [a, b, c] = [areas[across[0]].0[lane], areas[across[1]].0[lane], areas[across[2]].0[lane]];
    let weight = a * p[0] + b * q[0] + c * r[0];
    let depth = a * p[1] + b * q[1] + c * r[1];
    let value = a * p[2] + b * q[2] + c * r[2];
    if weight > 0.0 {
        let part = 1.0 / weight;
        return [depth * part, value * part];
    }
    // Seen edge-on, all areas nothing: any place of the face is as good.
    [p[1] / p[0], p[2] / p[0]]
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
