//! A tetrahedron as the planes of its faces, for rays that pass well clear of its edges: nearly all of them.
//!
//! Over the picture, the *rank* of a plane runs linearly: depth where rays are parallel, minus its inverse where they come
//! from one eye; either grows with depth. A ray enters a tetrahedron where the last of the planes of its near faces ranks, and
//! leaves it at the first of its far ones; between them the scalar runs linearly with rank and place (Haines 1991, "Fast
//! ray-convex polyhedron intersection"). The plane of a face depends on its three corners alone, in the order of their
//! numbers, so cells that share it agree on depth to the bit.
//!
//! Two planes rank alike along the line of the edge that they share. Where they do so within what rounding may have done to
//! them, the ray is left to exact predicates (`sides`). So is a cell that is too flat to have such planes.

use super::Corner;
use super::{FACES, LANES, Lanes};

/// Roundings, of which an error is made up at most, in units in the last place.
const ROUNDINGS: f64 = 32.0 * f64::EPSILON;
/// Parts of its sum that are left of a difference which still counts.
const CANCELLED: f64 = 1e-10;
/// A face seen narrower than that is steep: pixels.
const NARROW: f64 = 1e-6;
/// A tetrahedron that fills less of the box of its corners is flat.
const FLAT: f64 = 1e-6;

/// The planes of four faces, each of the corners that [`FACES`] has. Rank at a pixel (i, j) is (c + b·j) + a·i.
#[derive(Debug, Clone, Copy)]
pub(super) struct Planes {
    a: [f64; 4],
    b: [f64; 4],
    c: [f64; 4],
    /// Whether the face is seen from aside enough to have one.
    pub(super) known: [bool; 4],
}

impl Planes {
    /// Rank at lanes from `i` on of a row.
    #[inline(always)]
    pub(super) fn rank(&self, face: usize, [i, j]: [i32; 2]) -> Lanes<f64> {
        let row = self.c[face] + self.b[face] * f64::from(j);
        Lanes(std::array::from_fn(|lane| row + self.a[face] * f64::from(i + lane as i32)))
    }
}

/// Depth of a rank.
#[inline(always)]
pub(super) fn depth(rank: f64, perspective: bool) -> f64 {
    if perspective { -1.0 / rank } else { rank }
}

/// Vectors along each axis: right, down and in rank.
type Vectors = [[f64; 4]; 3];

#[inline(always)]
fn each(of: impl Fn(usize) -> f64) -> [f64; 4] {
    std::array::from_fn(of)
}

/// Planes of the faces with what they are worked out from.
struct Faces {
    planes: Planes,
    /// Normals.
    normal: Vectors,
    /// What the products that make up a normal add up to without regard to sign.
    size: Vectors,
    corners: Vectors,
}

impl Faces {
    #[inline(always)]
    fn new(corners: &[&Corner; 4]) -> Self {
        let places = [each(|v| corners[v].x), each(|v| corners[v].y), each(|v| corners[v].rank)];
        let of = |corner: usize| places.map(|axis| each(|face| axis[FACES[face].0[corner]]));
        let [first, second, third] = [of(0), of(1), of(2)];
        let along = |to: &Vectors| -> Vectors { std::array::from_fn(|x| each(|f| to[x][f] - first[x][f])) };
        let (u, v) = (along(&second), along(&third));
        let (mut normal, mut size) = ([[0.0; 4]; 3], [[0.0; 4]; 3]);
        for x in 0..3 {
            let (y, z) = ((x + 1) % 3, (x + 2) % 3);
            for f in 0..4 {
                let (p, q) = (u[y][f] * v[z][f], u[z][f] * v[y][f]);
                normal[x][f] = p - q;
                size[x][f] = p.abs() + q.abs();
            }
        }
        let [nx, ny, nz] = &normal;
        let part = each(|f| -1.0 / nz[f]);
        let (a, b) = (each(|f| nx[f] * part[f]), each(|f| ny[f] * part[f]));
        let c = each(|f| (first[2][f] - a[f] * first[0][f]) - b[f] * first[1][f]);
        let known = std::array::from_fn(|f| {
            let deep = u[2][f].abs() + v[2][f].abs();
            (nx[f].abs() + ny[f].abs()) * NARROW <= nz[f].abs() * deep && nz[f].abs() > CANCELLED * size[2][f]
        });
        Self { planes: Planes { a, b, c, known }, normal, size, corners: places }
    }
}

/// The planes of the faces of a tetrahedron, in the order of [`FACES`].
pub(super) fn of(corners: &[&Corner; 4]) -> Planes {
    Faces::new(corners).planes
}

/// Faces with the near ones first, by which are near, a bit each.
const ORDERS: [[usize; 4]; 16] = orders();

const fn orders() -> [[usize; 4]; 16] {
    let mut orders = [[0; 4]; 16];
    let mut code = 0;
    while code < 16 {
        let (mut count, mut pass) = (0, 0);
        while pass < 2 {
            let mut face = 0;
            while face < 4 {
                if (code >> face) & 1 == 1 - pass {
                    orders[code][count] = face;
                    count += 1;
                }
                face += 1;
            }
            pass += 1;
        }
        code += 1;
    }
    orders
}

/// A tetrahedron before the camera, ready for rays that pass clear of its edges.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// Planes, those of near faces first.
    a: [f64; 4],
    b: [f64; 4],
    c: [f64; 4],
    /// How many are near; 1 to 3.
    pub(super) near: u32,
    /// Differences of rank which rounding may have made.
    unsure: f64,
    /// The same between near faces: first and second, first and third, second and third.
    unsure_near: [f64; 3],
    /// The scalar of the first corner, and what it changes: at the first pixel, for one to the right, down, and in rank. Where
    /// rays come from one eye the change is to be multiplied by depth.
    from: f64,
    change: [f64; 4],
}

impl Cell {
    /// None for one that is too flat, that is not wholly before the eye, or that has no sides that could be told.
    #[inline(always)]
    pub(super) fn new(corners: &[&Corner; 4], perspective: bool) -> Option<Self> {
        let faces = Faces::new(corners);
        let Faces { planes, normal, size, corners: places } = &faces;
        let spread = places.map(|axis| {
            let most = axis[0].max(axis[1]).max(axis[2].max(axis[3]));
            most - axis[0].min(axis[1]).min(axis[2].min(axis[3]))
        });
        let far = [0, 1].map(|x| places[x].iter().fold(0.0, |far: f64, v| far.max(v.abs())));
        let edge = |corner: usize, x: usize| places[x][corner] - places[x][0];
        let volume = (edge(1, 0) * normal[0][1] + edge(1, 1) * normal[1][1]) + edge(1, 2) * normal[2][1];
        let before = corners.iter().all(|c| c.z >= 0.0);
        // Written so that what is not a number is not plain.
        let full = volume.abs() >= FLAT * (spread[0] * spread[1] * spread[2]) && volume.is_finite();
        if !(before && full) {
            return None;
        }
        let mut code = 0;
        for face in 0..4 {
            let turned = (face % 2 == 0) ^ (volume < 0.0);
            code |= usize::from((normal[2][face] > 0.0) ^ turned) << face;
        }
        // What rounding may have done to a plane over the cell.
        let wrong = each(|f| {
            let [a, b] = [planes.a[f].abs(), planes.b[f].abs()];
            let normal = (size[0][f] + a * size[2][f]) * spread[0] + (size[1][f] + b * size[2][f]) * spread[1];
            let place = (a * far[0] + b * far[1]) + planes.c[f].abs();
            ROUNDINGS * (normal / faces.normal[2][f].abs() + place)
        });
        let sum = (wrong[0] + wrong[1]) + (wrong[2] + wrong[3]);
        let mut unsure = [sum; 4];
        let mut planes = *planes;
        if planes.known != [true; 4] {
            (code, unsure) = steep(&faces, volume, spread, &mut planes, wrong, code)?;
        }
        let near = code.count_ones();
        if near == 0 || near == 4 {
            return None;
        }
        let order = ORDERS[code];
        let pair = |one: usize, other: usize| unsure[order[one]].max(unsure[order[other]]);
        let weight = |corner: usize| if perspective { -places[2][corner] } else { 1.0 };
        let rise = |corner: usize| (corners[corner].scalar - corners[0].scalar) * weight(corner);
        let [one, two, three] = [rise(1), rise(2), rise(3)];
        let part = 1.0 / volume;
        let slope = [0, 1, 2].map(|x| ((one * normal[x][1] - two * normal[x][2]) + three * normal[x][3]) * part);
        let at_first = -((slope[0] * places[0][0] + slope[1] * places[1][0]) + slope[2] * places[2][0]);
        Some(Self {
            a: order.map(|f| planes.a[f]),
            b: order.map(|f| planes.b[f]),
            c: order.map(|f| planes.c[f]),
            near,
            unsure: unsure[order[near as usize]],
            unsure_near: [pair(0, 1), pair(0, 2), pair(1, 2)],
            from: corners[0].scalar,
            change: [at_first, slope[0], slope[1], slope[2]],
        })
    }

    /// Where the rays of a group pass, `NEAR` of the faces being near.
    #[inline(always)]
    pub(super) fn pass<const NEAR: usize, const PERSPECTIVE: bool>(&self, row: &Row, i: i32) -> Passed {
        let at: [f64; LANES] = std::array::from_fn(|lane| f64::from(i) + lane as f64);
        let mut ranks = [Lanes([0.0; LANES]); 4];
        for (face, rank) in ranks.iter_mut().enumerate() {
            for lane in 0..LANES {
                rank.0[lane] = row.ranks[face] + self.a[face] * at[lane];
            }
        }
        let mut enter = ranks[0];
        let mut leave = ranks[NEAR];
        let mut clear = Lanes([u64::MAX; LANES]);
        let mut apart = |[one, other]: [usize; 2], unsure: f64| {
            for lane in 0..LANES {
                let apart = (ranks[one].0[lane] - ranks[other].0[lane]).abs();
                clear.0[lane] &= if apart > unsure { u64::MAX } else { 0 };
            }
        };
        for one in 0..NEAR {
            for other in one + 1..NEAR {
                apart([one, other], self.unsure_near[one + other - 1]);
            }
        }
        for one in NEAR..4 {
            for other in one + 1..4 {
                apart([one, other], self.unsure);
            }
        }
        for rank in &ranks[1..NEAR] {
            for lane in 0..LANES {
                enter.0[lane] = if rank.0[lane] > enter.0[lane] { rank.0[lane] } else { enter.0[lane] };
            }
        }
        for rank in &ranks[NEAR + 1..] {
            for lane in 0..LANES {
                leave.0[lane] = if rank.0[lane] < leave.0[lane] { rank.0[lane] } else { leave.0[lane] };
            }
        }
        let mut hit = Lanes([0; LANES]);
        for lane in 0..LANES {
            let inside = leave.0[lane] - enter.0[lane];
            clear.0[lane] &= if inside.abs() > self.unsure { u64::MAX } else { 0 };
            hit.0[lane] = if inside > 0.0 { clear.0[lane] } else { 0 };
        }
        let mut passed =
            Passed { hit, clear, depths: [enter, leave], values: [Lanes([0.0; LANES]); 2] };
        for (depth, value) in passed.depths.iter_mut().zip(&mut passed.values) {
            for lane in 0..LANES {
                let rank = depth.0[lane];
                let change = (row.change + self.change[1] * at[lane]) + self.change[3] * rank;
                depth.0[lane] = self::depth(rank, PERSPECTIVE);
                let times = if PERSPECTIVE { depth.0[lane] } else { 1.0 };
                value.0[lane] = self.from + change * times;
            }
        }
        passed
    }

    #[inline(always)]
    pub(super) fn row(&self, j: i32) -> Row {
        let y = f64::from(j);
        Row { ranks: each(|f| self.c[f] + self.b[f] * y), change: self.change[0] + self.change[2] * y }
    }
}

/// What is one for all pixels of a row of the picture.
pub(super) struct Row {
    ranks: [f64; 4],
    change: f64,
}

/// Where the rays of a group pass a cell; all bits set where it is so.
pub(super) struct Passed {
    pub(super) hit: Lanes<u64>,
    /// Where not, exact predicates have to say.
    pub(super) clear: Lanes<u64>,
    /// In and out.
    pub(super) depths: [Lanes<f64>; 2],
    pub(super) values: [Lanes<f64>; 2],
}

/// Puts a plane that stands on the picture in the place of each face which is seen too much from aside to have one: it ends
/// the cell to one side, and no ray that is told apart from it passes it. Gives which faces are near then, and what rounding
/// may have done to each; none if that cannot be said.
#[cold]
#[inline(never)]
fn steep(
    faces: &Faces,
    volume: f64,
    spread: [f64; 3],
    planes: &mut Planes,
    wrong: [f64; 4],
    near: usize,
) -> Option<(usize, [f64; 4])> {
    let Faces { normal, size, corners, .. } = faces;
    let (mut known, mut sum) = (0, 0.0);
    for face in (0..4).filter(|&face| planes.known[face]) {
        known |= 1 << face;
        sum += wrong[face];
    }
    // Something of both kinds has to be left to pass.
    if near & known == 0 || !near & known == 0 {
        return None;
    }
    let (mut near, mut unsure) = (near & known, [sum; 4]);
    for face in (0..4).filter(|face| known >> face & 1 == 0) {
        let [nx, ny] = [normal[0][face], normal[1][face]];
        let length = nx.abs() + ny.abs();
        if length.is_nan() || length <= CANCELLED * (size[0][face] + size[1][face]) {
            return None;
        }
        // Towards the corner across, rank falls by all that there is of it in the cell in what is too narrow to be seen.
        let inward = if (face % 2 == 0) ^ (volume < 0.0) { -1.0 } else { 1.0 };
        let fall = -inward * spread[2] / (NARROW * length);
        let (a, b, first) = (fall * nx, fall * ny, FACES[face].0[0]);
        planes.a[face] = a;
        planes.b[face] = b;
        planes.c[face] = (corners[2][first] - a * corners[0][first]) - b * corners[1][first];
        near |= 1 << face;
        unsure[face] = 4.0 * spread[2];
    }
    Some((near, unsure))
}
