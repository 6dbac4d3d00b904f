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

use super::outline::Outline;
use super::{Corner, FACES, Tetrahedron, scalars};
use crate::simd::{Four, PlainFour};

/// Roundings, of which an error is made up at most, in units in the last place.
const ROUNDINGS: f64 = 32.0 * f64::EPSILON;
/// Parts of its sum that are left of a difference which still counts.
const CANCELLED: f64 = 1e-10;
/// A face seen narrower than that is steep: pixels.
const NARROW: f64 = 1e-6;
/// A tetrahedron that fills less of the box of its edges is flat.
const FLAT: f64 = 1e-7;
/// All four faces.
const ALL: u32 = 0b1111;
/// The first and third face: of a positive tetrahedron, a normal by the right hand there points away from the corner across.
const EVEN: u32 = 0b0101;

/// The planes of four faces, each of the corners that [`FACES`] has. Rank at a pixel (i, j) is (c + b·j) + a·i.
#[derive(Debug, Clone, Copy)]
pub(super) struct Planes {
    a: [f64; 4],
    b: [f64; 4],
    c: [f64; 4],
    /// Which faces are seen from aside enough to have one, a bit each.
    known: u32,
}

impl Planes {
    #[inline(always)]
    pub(super) fn new(corners: &[&Corner; 4]) -> Self {
        Faces::<PlainFour>::new(corners).planes()
    }

    #[inline(always)]
    pub(super) fn known(&self, face: usize) -> bool {
        self.known >> face & 1 == 1
    }

    /// Rank at a pixel.
    #[inline(always)]
    pub(super) fn rank(&self, face: usize, [i, j]: [i32; 2]) -> f64 {
        (self.c[face] + self.b[face] * f64::from(j)) + self.a[face] * f64::from(i)
    }
}

/// Depth of a rank.
#[inline(always)]
pub(super) fn depth(rank: f64, perspective: bool) -> f64 {
    if perspective { -1.0 / rank } else { rank }
}

/// Planes of the faces with what they are worked out from: one of each face, or of each corner.
struct Faces<F> {
    /// Right, down and in rank, of each corner.
    places: [F; 3],
    a: F,
    b: F,
    c: F,
    /// Normals along each axis.
    normal: [F; 3],
    /// What the two products that make up each come to without regard to sign.
    size: [F; 3],
    /// Minus one over how much the normals point in rank.
    part: F,
    known: u32,
}

impl<F: Four> Faces<F> {
    #[inline(always)]
    fn new(corners: &[&Corner; 4]) -> Self {
        let [p, q, r, s] = corners;
        let x = F::from_array([p.x, q.x, r.x, s.x]);
        let y = F::from_array([p.y, q.y, r.y, s.y]);
        let z = F::from_array([p.rank, q.rank, r.rank, s.rank]);
        // From the first corner of each face to its second and third, as `FACES` has them.
        let u = [second(x) - first(x), second(y) - first(y), second(z) - first(z)];
        let v = [third(x) - first(x), third(y) - first(y), third(z) - first(z)];
        let (nx, size_x) = cross([u[1], u[2]], [v[1], v[2]]);
        let (ny, size_y) = cross([u[2], u[0]], [v[2], v[0]]);
        let (nz, size_z) = cross([u[0], u[1]], [v[0], v[1]]);
        let part = (F::all(0.0) - nz).inverse();
        let (a, b) = (nx * part, ny * part);
        let c = (first(z) - a * first(x)) - b * first(y);
        let (deep, length) = (u[2].abs() + v[2].abs(), nx.abs() + ny.abs());
        let narrow = (nz.abs() * deep).below(length * F::all(NARROW));
        // Where a corner has no rank, c is not a number.
        let known =
            (size_z * F::all(CANCELLED)).below(nz.abs()) & c.abs().below(F::all(f64::INFINITY)) & !narrow;
        let (normal, size) = ([nx, ny, nz], [size_x, size_y, size_z]);
        Self { places: [x, y, z], a, b, c, normal, size, part, known }
    }

    #[inline(always)]
    fn planes(&self) -> Planes {
        Planes { a: self.a.to_array(), b: self.b.to_array(), c: self.c.to_array(), known: self.known }
    }
}

/// Of each face of [`FACES`], what its first corner has.
#[inline(always)]
fn first<F: Four>(of: F) -> F {
    of.picked::<0b00_00_00_01>()
}

/// The same of its second.
#[inline(always)]
fn second<F: Four>(of: F) -> F {
    of.picked::<0b01_01_10_10>()
}

/// The same of its third.
#[inline(always)]
fn third<F: Four>(of: F) -> F {
    of.picked::<0b10_11_11_11>()
}

/// A component of the cross product of two vectors, and what its products come to without regard to sign.
#[inline(always)]
fn cross<F: Four>(u: [F; 2], v: [F; 2]) -> (F, F) {
    let (p, q) = (u[0] * v[1], u[1] * v[0]);
    (p - q, p.abs() + q.abs())
}

/// Faces with the near ones first, by which are near, a bit each.
const ORDERS: [[u8; 4]; 16] = orders();

const fn orders() -> [[u8; 4]; 16] {
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
    /// What the outline has to allow for each plane: see there.
    slack: [f64; 4],
    /// The scalar of the first corner, and what it changes: at the first pixel, for one to the right, down, and in rank. Where
    /// rays come from one eye the change is to be multiplied by depth.
    from: f64,
    change: [f64; 4],
}

impl Cell {
    /// Nothing.
    pub(super) const NONE: Self = Self {
        a: [0.0; 4],
        b: [0.0; 4],
        c: [0.0; 4],
        near: 0,
        unsure: 0.0,
        unsure_near: [0.0; 3],
        slack: [0.0; 4],
        from: 0.0,
        change: [0.0; 4],
    };

    /// Becomes a tetrahedron; none if that is too flat, not wholly before the eye, or has no sides that could be told.
    #[inline(always)]
    pub(super) fn set<F: Four>(&mut self, of: &Tetrahedron<'_>, perspective: bool) -> Option<()> {
        let (corners, scalars) = (&of.0, scalars(of));
        let faces = Faces::<F>::new(corners);
        let [x, y, z] = faces.places.map(F::to_array);
        let [nx, ny, nz] = faces.normal.map(F::to_array);
        let volume = ((x[1] - x[0]) * nx[1] + (y[1] - y[0]) * ny[1]) + (z[1] - z[0]) * nz[1];
        let spread = [spread(x), spread(y), spread(z)];
        let nearest = corners[0].z.min(corners[1].z).min(corners[2].z.min(corners[3].z));
        // Written so that what is not a number is not plain.
        let full = volume.abs() >= FLAT * (spread[0] * spread[1] * spread[2]) && volume.is_finite();
        if !(nearest >= 0.0 && full) {
            return None;
        }
        let turned = if volume < 0.0 { ALL & !EVEN } else { EVEN };
        let mut near = F::all(0.0).below(faces.normal[2]) ^ turned;
        // What rounding may have done to a plane over the cell.
        let (a, b) = (faces.a.abs(), faces.b.abs());
        let normal = (faces.size[0] + a * faces.size[2]) * F::all(spread[0])
            + (faces.size[1] + b * faces.size[2]) * F::all(spread[1]);
        let place = a * F::all(x[0].abs() + spread[0]) + b * F::all(y[0].abs() + spread[1]);
        let wrong = (normal * faces.part.abs() + (place + faces.c.abs())) * F::all(ROUNDINGS);
        let wrong = wrong.to_array();
        let mut unsure = [(wrong[0] + wrong[1]) + (wrong[2] + wrong[3]); 4];
        let mut planes = faces.planes();
        if planes.known != ALL {
            let normal = [nx, ny, nz];
            let size = faces.size.map(F::to_array);
            let of = [[x, y, z], normal, size];
            (near, unsure) = steep(&mut planes, &of, [volume, spread[2]], wrong, near)?;
        }
        if near == 0 || near == ALL {
            return None;
        }
        let order = ORDERS[near as usize & 15].map(|face| usize::from(face & 3));
        let pair = |one: usize, other: usize| unsure[order[one]].max(unsure[order[other]]);
        let weight = |corner: usize| if perspective { -z[corner] } else { 1.0 };
        let rise = |corner: usize| (scalars[corner] - scalars[0]) * weight(corner);
        let [one, two, three] = [rise(1), rise(2), rise(3)];
        let part = 1.0 / volume;
        let slope = |n: &[f64; 4]| ((one * n[1] - two * n[2]) + three * n[3]) * part;
        let [right, down, back] = [slope(&nx), slope(&ny), slope(&nz)];
        let at_first = -((right * x[0] + down * y[0]) + back * z[0]);
        for (place, from) in order.into_iter().enumerate() {
            self.a[place] = planes.a[from];
            self.b[place] = planes.b[from];
            self.c[place] = planes.c[from];
            self.slack[place] = 2.0 * unsure[from];
        }
        self.near = near.count_ones();
        self.unsure = unsure[order[3]];
        self.unsure_near = [pair(0, 1), pair(0, 2), pair(1, 2)];
        self.from = scalars[0];
        self.change = [at_first, right, down, back];
        Some(())
    }

    /// Finds its outline.
    #[inline(always)]
    pub(super) fn outline<F: Four>(&self, outline: &mut Outline) {
        outline.set::<F>([&self.a, &self.b, &self.c], self.near, &self.slack);
    }

    /// Where rays pass, `NEAR` of the faces being near.
    #[inline(always)]
    pub(super) fn pass<F: Four, const NEAR: usize, const PERSPECTIVE: bool>(
        &self,
        [x, y]: [F; 2],
    ) -> Passed<F> {
        let mut ranks = [x; 4];
        for (face, rank) in ranks.iter_mut().enumerate() {
            *rank = (F::all(self.c[face]) + F::all(self.b[face]) * y) + F::all(self.a[face]) * x;
        }
        let (mut enter, mut leave) = (ranks[0], ranks[NEAR]);
        for rank in &ranks[1..NEAR] {
            enter = enter.most(*rank);
        }
        for rank in &ranks[NEAR + 1..] {
            leave = leave.least(*rank);
        }
        let inside = leave - enter;
        // By how much all differences are beyond doubt.
        let mut clear = inside.abs() - F::all(self.unsure);
        for one in 0..NEAR {
            for other in one + 1..NEAR {
                let apart = (ranks[one] - ranks[other]).abs();
                clear = clear.least(apart - F::all(self.unsure_near[one + other - 1]));
            }
        }
        for one in NEAR..4 {
            for other in one + 1..4 {
                clear = clear.least((ranks[one] - ranks[other]).abs() - F::all(self.unsure));
            }
        }
        let none = F::all(0.0);
        let along = (F::all(self.change[0]) + F::all(self.change[2]) * y) + F::all(self.change[1]) * x;
        let depth = |rank: F| if PERSPECTIVE { (none - rank).inverse() } else { rank };
        let value = |rank: F, depth: F| {
            let change = along + F::all(self.change[3]) * rank;
            F::all(self.from) + if PERSPECTIVE { change * depth } else { change }
        };
        let depths = [depth(enter), depth(leave)];
        let values = [value(enter, depths[0]), value(leave, depths[1])];
        Passed { hit: none.below(inside), clear: none.below(clear), depths, values }
    }
}

/// Not less than the least and greatest are apart.
#[inline(always)]
fn spread(v: [f64; 4]) -> f64 {
    ((v[1] - v[0]).abs() + (v[2] - v[0]).abs()) + (v[3] - v[0]).abs()
}

/// Where the rays of a group pass a cell.
pub(super) struct Passed<F> {
    /// Which do, and of which that is sure, a bit each; of the others exact predicates have to say.
    pub(super) hit: u32,
    pub(super) clear: u32,
    /// In and out.
    pub(super) depths: [F; 2],
    pub(super) values: [F; 2],
}

/// Puts a plane that stands on the picture in the place of each face which is seen too much from aside to have one: it ends
/// the cell to one side, and no ray that is told apart from it passes it. Gives which faces are near then, and what rounding
/// may have done to each; none if that cannot be said.
///
/// `of` are the corners, the faces' normals, and the sizes of what made these up, along each axis; `extent` the cell's volume
/// and its spread in rank.
#[cold]
#[inline(never)]
fn steep(
    planes: &mut Planes,
    of: &[[[f64; 4]; 3]; 3],
    extent: [f64; 2],
    wrong: [f64; 4],
    near: u32,
) -> Option<(u32, [f64; 4])> {
    let ([corners, normal, size], [volume, spread], known) = (of, extent, planes.known);
    // Something of both kinds has to be left to pass.
    if near & known == 0 || !near & known == 0 {
        return None;
    }
    let sum = (0..4).filter(|face| known >> face & 1 == 1).fold(0.0, |sum, face| sum + wrong[face]);
    let (mut near, mut unsure) = (near & known, [sum; 4]);
    for face in (0..4).filter(|face| known >> face & 1 == 0) {
        let [nx, ny] = [normal[0][face], normal[1][face]];
        let length = nx.abs() + ny.abs();
        if length.is_nan() || length <= CANCELLED * (size[0][face] + size[1][face]) {
            return None;
        }
        // Towards the corner across, rank falls by all that there is of it in the cell in what is too narrow to be seen.
        let inward = if (EVEN >> face & 1 == 1) ^ (volume < 0.0) { -1.0 } else { 1.0 };
        let fall = -inward * spread / (NARROW * length);
        let (a, b, first) = (fall * nx, fall * ny, FACES[face].0[0]);
        planes.a[face] = a;
        planes.b[face] = b;
        planes.c[face] = (corners[2][first] - a * corners[0][first]) - b * corners[1][first];
        near |= 1 << face;
        unsure[face] = 4.0 * spread;
    }
    Some((near, unsure))
}
