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
use super::{Corner, FACES, Tetrahedron};
use crate::simd::{Four, Order, PlainFour};

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
/// What the scalars of corners come in with where it is found how much it changes, by the faces across from them.
const SIGNS: [f64; 4] = [0.0, 1.0, -1.0, 1.0];
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
    if !perspective {
        return rank;
    }
    // Of what lies farther away than rounding can tell it is as far as there are numbers.
    if rank < 0.0 { -1.0 / rank } else { f64::MAX }
}

/// Planes of the faces with what they are worked out from: one of each face, or of each corner.
struct Faces<F> {
    /// Right, down and in rank, of each corner.
    places: [F; 3],
    /// Of each corner.
    scalars: F,
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
        let [x, y, z, scalars] = F::columns([p.row(), q.row(), r.row(), s.row()]);
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
        let narrow = (nz.abs() * deep).bits_below(length * F::all(NARROW));
        // Where a corner has no rank, c is not a number.
        let known = (size_z * F::all(CANCELLED)).bits_below(nz.abs())
            & c.abs().bits_below(F::all(f64::INFINITY))
            & !narrow;
        let (normal, size) = ([nx, ny, nz], [size_x, size_y, size_z]);
        Self { places: [x, y, z], scalars, a, b, c, normal, size, part, known }
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

/// Of the faces, those that are near first; then by pairs of a near one and a far one, each with an edge of the outline between
/// them, the near ones and the far ones. Where there are but three pairs one comes twice.
#[derive(Debug, Clone, Copy)]
struct Orders {
    /// How many are near.
    near: u32,
    all: Order,
    pairs: [Order; 2],
}

/// By which faces are near, a bit each.
const ORDERS: [Orders; 16] = orders();

/// By how many are near: which are paired, by their places among all.
const PAIRS: [[[u8; 4]; 2]; 4] =
    [[[0; 4]; 2], [[0, 0, 0, 0], [1, 2, 3, 3]], [[0, 0, 1, 1], [2, 3, 2, 3]], [[0, 1, 2, 2], [3, 3, 3, 3]]];

const fn orders() -> [Orders; 16] {
    let none = Order::new([0; 4]);
    let mut orders = [Orders { near: 0, all: none, pairs: [none; 2] }; 16];
    let mut code = 0_usize;
    while code < 16 {
        let mut faces = [0; 4];
        let (mut count, mut pass) = (0, 0);
        while pass < 2 {
            let mut face = 0;
            while face < 4 {
                if (code >> face) & 1 == 1 - pass {
                    faces[count] = face;
                    count += 1;
                }
                face += 1;
            }
            pass += 1;
        }
        let near = code.count_ones();
        let [one, other] = PAIRS[near as usize & 3];
        let pairs = [of_pairs(faces, one), of_pairs(faces, other)];
        orders[code] = Orders { near, all: Order::new(faces), pairs };
        code += 1;
    }
    orders
}

const fn of_pairs(faces: [u8; 4], [p, q, r, s]: [u8; 4]) -> Order {
    Order::new([faces[p as usize], faces[q as usize], faces[r as usize], faces[s as usize]])
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
    /// Differences of rank which rounding may have made: between near faces, first and second, first and third, second and
    /// third; and between others.
    unsure: [f64; 4],
    /// The scalar of the first corner, and what it changes: for one pixel to the right, down, and in rank, and at the first pixel.
    /// Where rays come from one eye the change is to be multiplied by depth.
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
        unsure: [0.0; 4],
        from: 0.0,
        change: [0.0; 4],
    };

    /// Becomes a tetrahedron, and finds its outline; none if that is too flat, not wholly before the eye, or has no sides that
    /// could be told.
    #[inline(always)]
    pub(super) fn set<F: Four>(
        &mut self,
        outline: &mut Outline,
        of: &Tetrahedron<'_>,
        perspective: bool,
    ) -> Option<()> {
        let faces = Faces::<F>::new(&of.0);
        let ([x, y, z], [nx, ny, nz]) = (faces.places, faces.normal);
        let (x0, y0, z0) = (alike(x), alike(y), alike(z));
        let (dx, dy, dz) = (x - x0, y - y0, z - z0);
        let none = F::all(0.0);
        // Not less than the least and greatest are apart.
        let spreads = F::sums([dx.abs(), dy.abs(), dz.abs(), none]);
        let spread = spreads.to_array();
        let volume = ((dx * nx + dy * ny) + dz * nz).to_array()[1];
        // Written so that what is not a number is not plain; from one eye a corner that is not before it has no rank.
        let full = volume.abs() >= FLAT * (spread[0] * spread[1] * spread[2]) && volume.is_finite();
        if !(full && (perspective || z.bits_below(none) == 0)) {
            return None;
        }
        let turned = if volume < 0.0 { ALL & !EVEN } else { EVEN };
        let mut near = none.bits_below(nz) ^ turned;
        let (mut a, mut b, mut c) = (faces.a, faces.b, faces.c);
        // What rounding may have done to a plane over the cell.
        let (wide, high) = (spreads.picked::<0b00_00_00_00>(), spreads.picked::<0b01_01_01_01>());
        let (right, down) = (a.abs(), b.abs());
        let normal =
            (faces.size[0] + right * faces.size[2]) * wide + (faces.size[1] + down * faces.size[2]) * high;
        let place = right * (x0.abs() + wide) + down * (y0.abs() + high);
        let wrong = (normal * faces.part.abs() + (place + c.abs())) * F::all(ROUNDINGS);
        // How much the scalar changes: what it has more than that of the first corner, and for each of place.
        let scalars = match of.1 {
            Some(scalar) => F::all(scalar),
            None => faces.scalars,
        };
        let mut rise = (scalars - alike(scalars)) * F::from_array(SIGNS);
        if perspective {
            rise = rise * (none - z);
        }
        let sums = F::sums([rise * nx, rise * ny, rise * nz, wrong]);
        let mut unsure = sums.picked::<0b11_11_11_11>();
        if faces.known != ALL {
            let of = [[x, y, z], faces.normal, faces.size].map(|of| of.map(F::to_array));
            let mut planes = faces.planes();
            let (near_now, unsure_now) =
                steep(&mut planes, &of, [volume, spread[2]], wrong.to_array(), near)?;
            (near, unsure) = (near_now, F::from_array(unsure_now));
            (a, b, c) = (F::from_array(planes.a), F::from_array(planes.b), F::from_array(planes.c));
        }
        if near == 0 || near == ALL {
            return None;
        }
        let orders = &ORDERS[near as usize & 15];
        let slack = unsure.ordered(&orders.pairs[0]) + unsure.ordered(&orders.pairs[1]);
        outline.set([apart(a, orders), apart(b, orders), apart(c, orders)], slack);
        self.a = a.ordered(&orders.all).to_array();
        self.b = b.ordered(&orders.all).to_array();
        self.c = c.ordered(&orders.all).to_array();
        self.near = orders.near;
        let unsure = unsure.ordered(&orders.all);
        let pairs = unsure.picked::<0b11_01_00_00>().most(unsure.picked::<0b11_10_10_01>());
        self.unsure = pairs.to_array();
        let [right, down, back, _] = (sums * F::all(1.0 / volume)).to_array();
        let first = of.0[0];
        self.from = scalars.to_array()[0];
        self.change = [right, down, back, -((right * first.x + down * first.y) + back * first.rank)];
        Some(())
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
        let mut clear = inside.abs() - F::all(self.unsure[3]);
        for one in 0..NEAR {
            for other in one + 1..NEAR {
                let apart = (ranks[one] - ranks[other]).abs();
                clear = clear.least(apart - F::all(self.unsure[one + other - 1]));
            }
        }
        for one in NEAR..4 {
            for other in one + 1..4 {
                clear = clear.least((ranks[one] - ranks[other]).abs() - F::all(self.unsure[3]));
            }
        }
        let none = F::all(0.0);
        let along = (F::all(self.change[3]) + F::all(self.change[1]) * y) + F::all(self.change[0]) * x;
        let depth = |rank: F| if PERSPECTIVE { (none - rank).inverse() } else { rank };
        let value = |rank: F, depth: F| {
            let change = along + F::all(self.change[2]) * rank;
            F::all(self.from) + if PERSPECTIVE { change * depth } else { change }
        };
        let depths = [depth(enter), depth(leave)];
        let values = [value(enter, depths[0]), value(leave, depths[1])];
        // What has no depth before the eye is left to the others.
        let before = if PERSPECTIVE { leave.bits_below(none) } else { ALL };
        Passed { hit: none.bits_below(inside), clear: none.bits_below(clear) & before, depths, values }
    }
}

/// The first, four times.
#[inline(always)]
fn alike<F: Four>(v: F) -> F {
    v.picked::<0b00_00_00_00>()
}

/// By how much the far plane of each pair has more than the near one.
#[inline(always)]
fn apart<F: Four>(v: F, Orders { pairs: [near, far], .. }: &Orders) -> F {
    v.ordered(far) - v.ordered(near)
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
