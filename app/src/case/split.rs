//! Which combinations of sides a box really has: the non-empty pieces that cutters make of a volume.
//!
//! The box is divided into tetrahedra; planes and blades cut them exactly, cylinders and domes by bisection.
//! A combination counts once a point with it was found in the middle of a tetrahedron, asked of
//! [`Body::holds`] itself, so a piece that is reported is never empty. A piece without volume, such as a
//! box's face that lies in a plane, counts as empty, and what the saw takes is no piece.

use std::collections::{BTreeSet, VecDeque};

use render::volume::{Body, Cutter, Face, Point, Side, Vector};
use thiserror::Error;

/// Why cutters cannot split a volume.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SplitError {
    /// No cutter was named.
    #[error("choose at least one cutter to split by")]
    NoCutter,
    /// More than [`MAX_CUTTERS`].
    #[error("a volume can be split by {MAX_CUTTERS} cutters at once, not {count}; split by fewer")]
    TooMany {
        /// As given.
        count: usize,
    },
    /// The box has a corner that is not finite.
    #[error("the volume's box has a corner that is not finite")]
    NotFinite,
}

/// Most cutters in one split: pieces grow with their third power.
pub const MAX_CUTTERS: usize = 12;
/// Tetrahedra looked at for round bodies. It bounds the time where surfaces touch; pieces found before
/// are all that are thicker than about a hundredth of the box.
const BUDGET: usize = 400_000;
/// A tetrahedron smaller than this part of the box is rounding, not a piece.
const SLIVER: f64 = 1e-13;

type Tetrahedron = [Point; 4];

/// The combinations of sides of `cutters` that occur within the box, each in the order of the cutters;
/// "+" first. `corners` in world mm, corner bits are x, y, z. No cutter gives one empty combination.
///
/// # Errors
/// [`SplitError::TooMany`], [`SplitError::NotFinite`].
pub fn patterns(cutters: &[Cutter], corners: &[Point; 8]) -> Result<Vec<Vec<Side>>, SplitError> {
    if cutters.len() > MAX_CUTTERS {
        return Err(SplitError::TooMany { count: cutters.len() });
    }
    if corners.iter().flat_map(|p| p.iter()).any(|v| !v.is_finite()) {
        return Err(SplitError::NotFinite);
    }
    let walls = Walls::of(cutters);
    let mut cells = of_box(corners);
    let whole: f64 = cells.iter().map(volume).sum();
    for body in &walls.bodies {
        let (inside, mut outside) = divided(cells, body.faces());
        outside.extend(inside);
        cells = outside;
        cells.retain(|cell| volume(cell) > SLIVER * whole);
    }
    let mut found: BTreeSet<u32> =
        cells.iter().filter_map(|cell| walls.minus_bits(walls.held_bits(&centre(cell)))).collect();
    if walls.bodies.iter().any(|b| b.faces().is_empty()) {
        walls.search_round(cells, &mut found);
    }
    let sides = |bits: u32| {
        let side = |i: usize| if bits >> i & 1 == 1 { Side::Minus } else { Side::Plus };
        (0..cutters.len()).map(side).collect()
    };
    Ok(found.into_iter().map(sides).collect())
}

/// Points whose convex hull holds all of a box that `keep` keeps, tight where only planes and the insides
/// of blades cut; none where they leave nothing. The rest cuts nothing off here.
pub fn hull_of(keep: &[(Cutter, Side)], corners: &[Point; 8]) -> Vec<Point> {
    let mut cells = of_box(corners);
    for (cutter, side) in keep {
        let (body, is_inside) = cutter.solid(*side);
        match body {
            Body::HalfSpace(_) | Body::Prism(_) if is_inside => (cells, _) = divided(cells, body.faces()),
            Body::HalfSpace(_) => (_, cells) = divided(cells, body.faces()),
            Body::Prism(_) | Body::Cylinder { .. } | Body::Ball { .. } => {}
        }
    }
    cells.into_iter().flatten().collect()
}

/// The bodies that bound the sides of some cutters.
struct Walls {
    bodies: Vec<Body>,
    /// Of each cutter, the body that ends its "-" and the one where its "+" begins: two where it has a
    /// kerf, of which the first is within the second.
    of_cutter: Vec<[usize; 2]>,
}

impl Walls {
    fn of(cutters: &[Cutter]) -> Self {
        let (mut bodies, mut of_cutter) = (Vec::new(), Vec::new());
        for cutter in cutters {
            let first = bodies.len();
            bodies.push(cutter.solid(Side::Minus).0);
            if cutter.kerf_mm() > 0.0 {
                bodies.push(cutter.solid(Side::Plus).0);
            }
            of_cutter.push([first, bodies.len() - 1]);
        }
        Self { bodies, of_cutter }
    }

    /// Bit i is set where the point is in body i.
    fn held_bits(&self, p: &Point) -> u32 {
        self.bodies.iter().enumerate().map(|(i, body)| u32::from(body.holds(p)) << i).sum()
    }

    /// Bit i is set where what is in these bodies is on "-" of cutter i; `None` in a kerf, and for what
    /// cannot be.
    fn minus_bits(&self, held: u32) -> Option<u32> {
        let side = |(i, bodies): (usize, &[usize; 2])| match bodies.map(|b| held >> b & 1 == 1) {
            [false, false] => Some(0),
            [true, true] => Some(1 << i),
            _ => None,
        };
        self.of_cutter.iter().enumerate().map(side).sum()
    }

    /// Looks, widest first, into the tetrahedra that the wall of some round body crosses, until nothing
    /// unknown can be in them.
    fn search_round(&self, cells: Vec<Tetrahedron>, found: &mut BTreeSet<u32>) {
        let mut queue: VecDeque<Tetrahedron> = cells.into();
        for _ in 0..BUDGET {
            let Some(cell) = queue.pop_front() else { break };
            let base = self.held_bits(&centre(&cell));
            found.extend(self.minus_bits(base));
            let crossing: Vec<usize> =
                (0..self.bodies.len()).filter(|&i| wall_crosses(&self.bodies[i], &cell)).collect();
            // With more walls than this a smaller cell is the quicker answer.
            let all_known = crossing.len() <= MAX_CUTTERS
                && (0..1_u32 << crossing.len()).all(|choice| {
                    let flip = |(k, &i): (usize, &usize)| (choice >> k & 1) << i;
                    let held = base ^ crossing.iter().enumerate().map(flip).sum::<u32>();
                    self.minus_bits(held).is_none_or(|bits| found.contains(&bits))
                });
            if !all_known {
                queue.extend(bisect(&cell));
            }
        }
    }
}

/// What of some tetrahedra is behind all of these faces, and what is not. What is before one is not
/// divided by the others. Without faces all is behind them.
fn divided(cells: Vec<Tetrahedron>, faces: &[Face]) -> (Vec<Tetrahedron>, Vec<Tetrahedron>) {
    let (mut inside, mut outside) = (cells, Vec::new());
    for face in faces {
        let unit = face.normal / face.normal.norm();
        let parts = inside.iter().flat_map(|cell| cut(cell, &face.point, &unit));
        let (behind, before): (Vec<_>, Vec<_>) = parts.partition(|part| face.is_behind(&centre(part)));
        outside.extend(before);
        inside = behind;
    }
    (inside, outside)
}

/// Whether both sides of the wall of a round body may be within a tetrahedron.
fn wall_crosses(body: &Body, cell: &Tetrahedron) -> bool {
    match body {
        Body::HalfSpace(_) | Body::Prism(_) => false,
        Body::Cylinder { point, axis, radius_mm } => {
            let along = axis / axis.norm();
            let mut pick = Vector::zeros();
            pick[along.iamin()] = 1.0;
            let u = along.cross(&pick).normalize();
            let v = along.cross(&u);
            let flat = cell.map(|p| [(p - point).dot(&u), (p - point).dot(&v)]);
            let outside = flat.iter().any(|[x, y]| x.hypot(*y) > *radius_mm);
            outside && distance_to_hull(&flat) < *radius_mm
        }
        Body::Ball { centre, radius_mm } => {
            let outside = cell.iter().any(|p| (p - centre).norm() > *radius_mm);
            outside && least_distance(cell, centre) < *radius_mm
        }
    }
}

/// No more than the distance of a point to a tetrahedron, and near it where the point is not far away.
fn least_distance(cell: &Tetrahedron, p: &Point) -> f64 {
    let middle = centre(cell);
    let reach = cell.iter().map(|q| (q - middle).norm()).fold(0.0, f64::max);
    let beyond = |[a, b, c, opposite]: [usize; 4]| {
        let normal = (cell[b] - cell[a]).cross(&(cell[c] - cell[a]));
        let outward = if normal.dot(&(cell[opposite] - cell[a])) > 0.0 { -normal } else { normal };
        outward.try_normalize(0.0).map_or(0.0, |unit| unit.dot(&(p - cell[a])))
    };
    let faces = [[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 3, 1], [1, 2, 3, 0]];
    faces.map(beyond).into_iter().fold((p - middle).norm() - reach, f64::max)
}

/// Distance of the origin to the convex hull of four points of a plane: 0 inside, and otherwise to
/// the nearest of the six segments between them.
fn distance_to_hull(points: &[[f64; 2]; 4]) -> f64 {
    let turn = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    for [i, j, k] in [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]] {
        let (a, b, c) = (points[i], points[j], points[k]);
        let turns = [turn(a, b), turn(b, c), turn(c, a)];
        if turns.iter().all(|&t| t > 0.0) || turns.iter().all(|&t| t < 0.0) {
            return 0.0;
        }
    }
    let segment = |a: [f64; 2], b: [f64; 2]| {
        let d = [b[0] - a[0], b[1] - a[1]];
        let length = d[0] * d[0] + d[1] * d[1];
        let t = if length > 0.0 { -(a[0] * d[0] + a[1] * d[1]) / length } else { 0.0 };
        let t = t.clamp(0.0, 1.0);
        (a[0] + t * d[0]).hypot(a[1] + t * d[1])
    };
    let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    pairs.iter().map(|&[i, j]| segment(points[i], points[j])).fold(f64::INFINITY, f64::min)
}

/// Kuhn's six tetrahedra: each walks from corner 0 to corner 7 along x, y and z in some order.
fn of_box(corners: &[Point; 8]) -> Vec<Tetrahedron> {
    let orders: [[usize; 3]; 6] = [[1, 2, 4], [1, 4, 2], [2, 1, 4], [2, 4, 1], [4, 1, 2], [4, 2, 1]];
    orders.iter().map(|&[a, b, _]| [corners[0], corners[a], corners[a + b], corners[7]]).collect()
}

/// The parts of a tetrahedron on either side of a plane: an edge that crosses is divided at the
/// crossing, which makes two tetrahedra, until none does.
fn cut(cell: &Tetrahedron, point: &Point, unit: &Vector) -> Vec<Tetrahedron> {
    let reach = cell.iter().map(|p| (p - point).norm()).fold(0.0, f64::max);
    let near = 1e-12 * (reach + point.coords.amax());
    let distance = |p: &Point| (p - point).dot(unit);
    let mut open = vec![(*cell, cell.map(|p| distance(&p)))];
    let mut done = Vec::new();
    while let Some((cell, far)) = open.pop() {
        let above = far.iter().position(|&d| d > near);
        let below = far.iter().position(|&d| d < -near);
        let (Some(a), Some(b)) = (above, below) else {
            done.push(cell);
            continue;
        };
        let middle = cell[a] + (cell[b] - cell[a]) * (far[a] / (far[a] - far[b]));
        for replaced in [a, b] {
            let (mut part, mut far) = (cell, far);
            part[replaced] = middle;
            far[replaced] = 0.0;
            open.push((part, far));
        }
    }
    done
}

/// Two halves, divided at the middle of the longest edge.
fn bisect(cell: &Tetrahedron) -> [Tetrahedron; 2] {
    let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let length = |&[i, j]: &[usize; 2]| (cell[i] - cell[j]).norm_squared();
    let [a, b] = pairs.into_iter().max_by(|p, q| length(p).total_cmp(&length(q))).unwrap_or([0, 1]);
    let middle = nalgebra::center(&cell[a], &cell[b]);
    let (mut one, mut other) = (*cell, *cell);
    one[a] = middle;
    other[b] = middle;
    [one, other]
}

fn centre(cell: &Tetrahedron) -> Point {
    let [a, b, c, d] = cell;
    a + ((b - a) + (c - a) + (d - a)) / 4.0
}

/// mm³.
fn volume(cell: &Tetrahedron) -> f64 {
    let [a, b, c, d] = cell;
    ((b - a).cross(&(c - a)).dot(&(d - a)) / 6.0).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(half: f64) -> [Point; 8] {
        std::array::from_fn(|corner| {
            Point::from(std::array::from_fn(|axis| if corner >> axis & 1 == 1 { half } else { -half }))
        })
    }

    fn plane(x: f64, normal: [f64; 3]) -> Cutter {
        Cutter::plane(Point::new(x, 0.0, 0.0), Vector::from(normal)).expect("plane")
    }

    #[test]
    fn two_crossing_planes_make_four_pieces_and_two_parallel_ones_three() {
        let crossing = [plane(0.0, [1.0, 0.0, 0.0]), plane(0.0, [0.0, 1.0, 0.3])];
        assert_eq!(patterns(&crossing, &cube(10.0)).expect("patterns").len(), 4, "crossing");
        let parallel = [plane(-1.0, [1.0, 0.0, 0.0]), plane(1.0, [1.0, 0.0, 0.0])];
        let found = patterns(&parallel, &cube(10.0)).expect("patterns");
        use Side::{Minus, Plus};
        assert_eq!(found, [vec![Plus, Plus], vec![Plus, Minus], vec![Minus, Minus]], "parallel");
    }

    #[test]
    fn a_plane_beside_the_box_or_in_its_face_makes_one_piece() {
        for x in [10.0, 10.5, -10.0] {
            let found = patterns(&[plane(x, [1.0, 0.0, 0.0])], &cube(10.0)).expect("patterns");
            assert_eq!(found.len(), 1, "plane at {x}");
        }
        let thin = patterns(&[plane(10.0 - 1e-6, [1.0, 0.0, 0.0])], &cube(10.0)).expect("patterns");
        assert_eq!(thin.len(), 2, "a nanometre is a piece");
    }

    #[test]
    fn a_thin_cylinder_within_the_box_is_found() {
        let tube = |x, r| {
            Cutter::cylinder(Point::new(x, 0.3, 0.0), Vector::new(0.1, 0.2, 1.0), r).expect("cylinder")
        };
        assert_eq!(patterns(&[tube(3.0, 0.4)], &cube(50.0)).expect("patterns").len(), 2, "thin");
        assert_eq!(patterns(&[tube(200.0, 0.4)], &cube(50.0)).expect("patterns").len(), 1, "outside");
        assert_eq!(patterns(&[tube(0.0, 900.0)], &cube(50.0)).expect("patterns").len(), 1, "all in it");
        let apart = patterns(&[tube(-20.0, 4.0), tube(20.0, 4.0)], &cube(50.0)).expect("patterns");
        assert_eq!(apart.len(), 3, "inside both at once is nowhere");
    }

    #[test]
    fn a_dome_and_a_blade_within_the_box_make_two_pieces_and_one_beside_it_none() {
        let dome = |x, r| Cutter::dome(Point::new(x, 0.3, 0.0), r).expect("dome");
        assert_eq!(patterns(&[dome(3.0, 0.4)], &cube(50.0)).expect("patterns").len(), 2, "small");
        assert_eq!(patterns(&[dome(60.0, 8.0)], &cube(50.0)).expect("patterns").len(), 1, "outside");
        assert_eq!(patterns(&[dome(0.0, 99.0)], &cube(50.0)).expect("patterns").len(), 1, "all in it");
        let edge = dome(55.0, 5.5);
        assert_eq!(patterns(&[edge], &cube(50.0)).expect("patterns").len(), 2, "half a mm of it");
        let blade = |z, y| {
            let at = Point::new(1.0, y, z);
            Cutter::blade(at, Vector::z(), Vector::new(1.0, 0.4, 0.0), [9.0, 4.0]).expect("blade")
        };
        assert_eq!(patterns(&[blade(2.0, 0.0)], &cube(50.0)).expect("patterns").len(), 2, "within");
        assert_eq!(patterns(&[blade(-50.5, 0.0)], &cube(50.0)).expect("patterns").len(), 1, "below");
        assert_eq!(patterns(&[blade(2.0, 90.0)], &cube(50.0)).expect("patterns").len(), 1, "beside");
    }

    #[test]
    fn what_the_saw_takes_is_no_piece() {
        let kerf = |c: Cutter, mm| c.with_kerf(mm).expect("kerf");
        let thick = kerf(plane(9.0, [1.0, 0.0, 0.0]), 4.0);
        assert_eq!(patterns(&[thick], &cube(10.0)).expect("patterns"), [[Side::Minus]], "nothing beyond it");
        let shell = kerf(Cutter::dome(Point::origin(), 6.0).expect("dome"), 1.0);
        assert_eq!(patterns(&[shell], &cube(10.0)).expect("patterns").len(), 2, "inside and outside");
        // Two planes whose kerfs meet leave nothing between them.
        let near = [-0.4, 0.4].map(|x| kerf(plane(x, [1.0, 0.0, 0.0]), 0.8));
        let found = patterns(&near, &cube(10.0)).expect("patterns");
        assert_eq!(found, [[Side::Plus; 2], [Side::Minus; 2]], "no piece between");
        let hull = hull_of(&[(thick, Side::Minus)], &cube(10.0));
        let high = hull.iter().fold(f64::NEG_INFINITY, |x, p| x.max(p.x));
        assert!((high - 7.0).abs() < 1e-9, "the hull ends where the kerf begins: {high}");
    }

    /// The combinations are those that a dense lattice of points shows, and no others.
    #[test]
    fn every_point_is_in_exactly_one_piece() {
        let mut state = 7_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as f64 / f64::from(u32::MAX >> 1) * 2.0 - 1.0
        };
        for round in 0..8 {
            let mut cutters = Vec::new();
            for i in 0..4 {
                let at = Point::new(next(), next(), next()) * 5.0;
                let way = Vector::new(next(), next(), next());
                let made = match (i + round) % 4 {
                    0 => Cutter::plane(at, way),
                    1 => Cutter::cylinder(at, way, 2.0 + 2.0 * next().abs()),
                    2 => Cutter::dome(at, 3.0 + 3.0 * next().abs()),
                    _ => Cutter::blade(at, way, Vector::new(next(), next(), next()), [6.0, 9.0]),
                };
                let kerf_mm = if round > 5 { 0.8 } else { 0.0 };
                cutters.push(made.and_then(|c| c.with_kerf(kerf_mm)).expect("cutter"));
            }
            let found = patterns(&cutters, &cube(10.0)).expect("patterns");
            let mut seen = BTreeSet::new();
            let n = 80;
            for i in 0..n * n * n {
                let at = [i % n, i / n % n, i / (n * n)];
                let p = Point::from(at.map(|k| (f64::from(k) + 0.5) * 20.0 / f64::from(n) - 10.0));
                let sides: Option<Vec<Side>> = cutters.iter().map(|c| c.side(&p)).collect();
                let Some(sides) = sides else { continue };
                let pieces = found.iter().filter(|piece| **piece == sides).count();
                assert_eq!(pieces, 1, "round {round}, point {p}");
                seen.insert(sides.iter().map(|side| *side == Side::Minus).collect::<Vec<_>>());
            }
            assert!(found.len() >= seen.len(), "the lattice cannot see more");
            assert!(found.len() <= seen.len() + 2, "round {round}: only tiny pieces escape the lattice");
        }
    }

    #[test]
    fn the_hull_of_a_piece_ends_at_its_planes() {
        let keep = [(plane(2.0, [1.0, 0.0, 0.0]), Side::Plus), (plane(7.0, [1.0, 0.0, 0.0]), Side::Minus)];
        let hull = hull_of(&keep, &cube(10.0));
        let low = hull.iter().fold(Point::from([99.0; 3]), |a, p| a.inf(p));
        let high = hull.iter().fold(Point::from([-99.0; 3]), |a, p| a.sup(p));
        assert!((low - Point::new(2.0, -10.0, -10.0)).norm() < 1e-9, "from {low}");
        assert!((high - Point::new(7.0, 10.0, 10.0)).norm() < 1e-9, "to {high}");
        assert!(hull_of(&[(plane(11.0, [1.0, 0.0, 0.0]), Side::Plus)], &cube(10.0)).is_empty(), "nothing");
    }

    #[test]
    fn too_many_cutters_are_refused() {
        let many = vec![plane(0.0, [1.0, 0.0, 0.0]); MAX_CUTTERS + 1];
        assert_eq!(patterns(&many, &cube(1.0)), Err(SplitError::TooMany { count: 13 }), "13");
    }
}
