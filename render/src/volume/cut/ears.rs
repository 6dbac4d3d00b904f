//! Covers a region of the plane with triangles over exactly its places, by cutting off ears.
//!
//! Holes are joined to the outline by a bridge that is passed twice, so that one ring of places is left; then
//! corner after corner is cut off. Whatever the numbers, each cut replaces two edges of the ring by one and
//! makes a triangle of the three, so the triangles together have exactly the edges of the region. The exact
//! test of a corner only decides whether the cover is also without overlap: it is for every region whose lines
//! do not cross. Where no proper corner is left, which only such lines bring about, the test is lowered.
//!
//! Source: Eberly 2002, "Triangulation by ear clipping" (bridges by a ray); the order, every other corner in
//! turn, is that of the library `earcut`. That one was not taken because it drops places that lie on a straight
//! line, which would leave gaps beside the triangles that have them.

use super::exact::turn;

type Flat = [f64; 2];

/// Triangles over the places of an outline, counter-clockwise, without its holes, clockwise. `edges` are
/// those, lower place first and in order, that the inside of the cover keeps off where it can.
pub(super) fn cover(
    outline: &[usize],
    holes: &[Vec<usize>],
    flat: &[Flat],
    edges: &[[usize; 2]],
) -> Vec<[usize; 3]> {
    let mut ring = Ring { flat, corners: Vec::new() };
    let mut start = ring.add(outline);
    let mut count = outline.len();
    let leftmost = |hole: &Vec<usize>| {
        let x = |&(_, &place): &(usize, &usize)| flat[place];
        let less = |a: &Flat, b: &Flat| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]));
        hole.iter().enumerate().min_by(|a, b| less(&x(a), &x(b))).map_or(0, |(i, _)| i)
    };
    let mut order: Vec<(usize, &Vec<usize>)> = holes.iter().map(|hole| (leftmost(hole), hole)).collect();
    order.sort_by(|(i, a), (j, b)| flat[a[*i]][0].total_cmp(&flat[b[*j]][0]));
    for (left, hole) in order {
        let first = ring.add(hole);
        start = ring.bridge(start, first + left);
        count += hole.len() + 2;
    }
    let mut triangles = Vec::with_capacity(count.saturating_sub(2));
    ring.clip(start, count, edges, &mut triangles);
    triangles
}

/// A place of the ring with its neighbours, by their numbers.
#[derive(Debug, Clone, Copy)]
struct Corner {
    place: usize,
    previous: usize,
    next: usize,
    /// Not a left turn: only such corners can lie within an ear.
    is_reflex: bool,
    is_cut: bool,
}

struct Ring<'a> {
    flat: &'a [Flat],
    corners: Vec<Corner>,
}

/// How much is asked of an ear; each is tried where none of the one before is left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Demand {
    /// A left turn, no corner in it or on it, its third side not an edge of the mesh.
    Clean,
    /// The third side may be one.
    Proper,
    /// Without area: flat, or out and back between corners at one place.
    Flat,
    /// A left turn, no corner within it.
    Loose,
    /// Nothing.
    Any,
}

impl Ring<'_> {
    /// Adds a closed line as a ring of its own; the number of its first corner.
    fn add(&mut self, places: &[usize]) -> usize {
        let first = self.corners.len();
        let last = first + places.len().saturating_sub(1);
        for (i, &place) in places.iter().enumerate() {
            let at = first + i;
            let previous = if at == first { last } else { at - 1 };
            let next = if at == last { first } else { at + 1 };
            self.corners.push(Corner { place, previous, next, is_reflex: false, is_cut: false });
        }
        first
    }

    fn at(&self, corner: usize) -> Flat {
        self.flat[self.corners[corner].place]
    }

    fn turn(&self, a: usize, b: usize, c: usize) -> f64 {
        turn(self.at(a), self.at(b), self.at(c))
    }

    /// Whether the way from a corner to a place starts within the ring.
    fn looks_at(&self, corner: usize, p: Flat) -> bool {
        let (at, Corner { previous, next, .. }) = (self.at(corner), self.corners[corner]);
        let (before, after) = (self.at(previous), self.at(next));
        let (past_next, past_previous) = (turn(at, after, p), turn(before, at, p));
        if turn(before, at, after) > 0.0 {
            past_next >= 0.0 && past_previous >= 0.0
        } else {
            past_next > 0.0 || past_previous > 0.0
        }
    }

    /// Joins the ring of `hole`, the leftmost corner of its line, to the ring of `start`, through a corner
    /// that it sees to its left. Returns a corner of the joined ring.
    fn bridge(&mut self, start: usize, hole: usize) -> usize {
        let from = self.visible(start, hole);
        // from → hole … hole' → from': both ends come twice.
        let (Corner { place, next, .. }, Corner { place: hole_place, previous: hole_end, .. }) =
            (self.corners[from], self.corners[hole]);
        let (from_again, hole_again) = (self.corners.len() + 1, self.corners.len());
        let corner =
            |place, previous, next| Corner { place, previous, next, is_reflex: false, is_cut: false };
        self.corners.push(corner(hole_place, hole_end, from_again));
        self.corners.push(corner(place, hole_again, next));
        self.corners[hole_end].next = hole_again;
        self.corners[next].previous = from_again;
        self.corners[from].next = hole;
        self.corners[hole].previous = from;
        from
    }

    /// The corner of a ring that a ray to the left first meets, or one that hides it.
    fn visible(&self, start: usize, hole: usize) -> usize {
        let eye = self.at(hole);
        let (mut hit, mut best) = (f64::NEG_INFINITY, start);
        let mut at = start;
        loop {
            let next = self.corners[at].next;
            let (a, b) = (self.at(at), self.at(next));
            if a == eye {
                return at;
            }
            // On the left of the hole the outline runs downwards.
            if a[1] >= eye[1] && eye[1] >= b[1] && a[1] != b[1] {
                let x = a[0] + (eye[1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1]);
                if x <= eye[0] && x > hit {
                    (hit, best) = (x, if a[0] < b[0] { at } else { next });
                }
            }
            at = next;
            if at == start {
                break;
            }
        }
        let end = self.at(best);
        let is_above = eye[1] < end[1];
        let (p, q) = if is_above { (eye, [hit, eye[1]]) } else { ([hit, eye[1]], eye) };
        // Of the corners in the triangle of eye, hit and end, the one nearest to the ray's direction is seen.
        let slope = |c: Flat| (eye[1] - c[1]).abs() / (eye[0] - c[0]);
        let mut least = (f64::INFINITY, f64::INFINITY);
        let mut seen = best;
        at = start;
        loop {
            let c = self.at(at);
            let in_triangle =
                c == end || (turn(p, end, c) >= 0.0 && turn(end, q, c) >= 0.0 && turn(q, p, c) >= 0.0);
            if c[0] < eye[0] && in_triangle && self.looks_at(at, eye) {
                let rank = (slope(c), eye[0] - c[0]);
                if rank < least {
                    (least, seen) = (rank, at);
                }
            }
            at = self.corners[at].next;
            if at == start {
                break;
            }
        }
        seen
    }

    /// Cuts all ears off a ring of `count` corners.
    fn clip(&mut self, start: usize, count: usize, edges: &[[usize; 2]], triangles: &mut Vec<[usize; 3]>) {
        /// So often the search for better ears starts again after one that was not; it bounds the time.
        const FRESH_STARTS: usize = 1024;
        let mut at = start;
        for _ in 0..count {
            self.corners[at].is_reflex = self.is_reflex(at);
            at = self.corners[at].next;
        }
        let reflex = Places::of(self, start, count);
        let (mut left, mut fresh_starts) = (count, 0);
        let (mut demand, mut tried) = (Demand::Clean, 0);
        while left > 2 {
            let Corner { place, previous, next, .. } = self.corners[at];
            let [a, c] = [previous, next].map(|i| self.corners[i].place);
            let is_spike = a == c;
            if is_spike || left == 3 || self.is_ear(at, demand, edges, &reflex) {
                if is_spike {
                    // Out and back along one edge: both are gone, with the second copy of its end.
                    left -= 2;
                    self.unlink(at);
                    self.unlink(next);
                } else {
                    left -= 1;
                    triangles.push([a, place, c]);
                    self.unlink(at);
                }
                let after = self.corners[if is_spike { next } else { at }].next;
                for corner in [previous, after] {
                    self.corners[corner].is_reflex = self.is_reflex(corner);
                }
                if left == 2 {
                    break;
                }
                at = self.corners[after].next;
                tried = 0;
                let is_lowered = demand != Demand::Clean && demand != Demand::Proper;
                if !is_lowered || fresh_starts < FRESH_STARTS {
                    fresh_starts += usize::from(is_lowered);
                    demand = Demand::Clean;
                }
            } else {
                at = next;
                tried += 1;
                if tried >= left {
                    tried = 0;
                    demand = match demand {
                        Demand::Clean => Demand::Proper,
                        Demand::Proper => Demand::Flat,
                        Demand::Flat => Demand::Loose,
                        Demand::Loose | Demand::Any => Demand::Any,
                    };
                }
            }
        }
    }

    fn unlink(&mut self, corner: usize) {
        let Corner { previous, next, .. } = self.corners[corner];
        self.corners[previous].next = next;
        self.corners[next].previous = previous;
        self.corners[corner].is_cut = true;
    }

    fn is_reflex(&self, corner: usize) -> bool {
        let Corner { previous, next, .. } = self.corners[corner];
        self.turn(previous, corner, next) <= 0.0
    }

    fn is_ear(&self, corner: usize, demand: Demand, edges: &[[usize; 2]], reflex: &Places) -> bool {
        if demand == Demand::Any {
            return true;
        }
        let Corner { previous, next, is_reflex, .. } = self.corners[corner];
        let [a, b, c] = [previous, corner, next].map(|i| self.at(i));
        if demand == Demand::Flat {
            return turn(a, b, c) == 0.0;
        }
        if demand == Demand::Loose {
            let inside = |p| turn(a, b, p) > 0.0 && turn(b, c, p) > 0.0 && turn(c, a, p) > 0.0;
            return turn(a, b, c) >= 0.0 && !reflex.any_in(self, [a, b, c], |other| inside(self.at(other)));
        }
        if is_reflex {
            return false;
        }
        if demand == Demand::Clean {
            let [p, q] = [previous, next].map(|i| self.corners[i].place);
            if edges.binary_search(&[p.min(q), p.max(q)]).is_ok() {
                return false;
            }
        }
        let blocks = |other: usize| {
            let p = self.at(other);
            // Corners at one place, a bridge's ends or lines that touch, block where they lead into the triangle.
            let leads = |from: Flat, right: Flat, left: Flat| {
                let Corner { previous, next, .. } = self.corners[other];
                let ends = [previous, next].map(|i| self.at(i));
                let is_between = |q: Flat| turn(from, right, q) > 0.0 && turn(from, left, q) < 0.0;
                p == from
                    && (ends.into_iter().any(is_between) || ends == [left, right] || ends == [right, left])
            };
            if p == a || p == b || p == c {
                return leads(a, b, c) || leads(b, c, a) || leads(c, a, b);
            }
            turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
        };
        !reflex.any_in(self, [a, b, c], blocks)
    }
}

/// The reflex corners of a ring in a lattice of squares, so that an ear asks only those near it.
struct Places {
    low: Flat,
    per_mm: Flat,
    side: usize,
    /// Where each square's corners start in `corners`.
    starts: Vec<usize>,
    corners: Vec<usize>,
}

impl Places {
    fn of(ring: &Ring<'_>, start: usize, count: usize) -> Self {
        let mut reflex = Vec::new();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut at = start;
        for _ in 0..count {
            if ring.corners[at].is_reflex {
                let p = ring.at(at);
                for axis in 0..2 {
                    low[axis] = low[axis].min(p[axis]);
                    high[axis] = high[axis].max(p[axis]);
                }
                reflex.push(at);
            }
            at = ring.corners[at].next;
        }
        let side = (reflex.len() as f64).sqrt().ceil().max(1.0) as usize;
        // A width of zero makes this infinite; the conversion to a whole number takes care of what follows.
        let per_mm = [0, 1].map(|axis| side as f64 / (high[axis] - low[axis]));
        let mut places = Self { low, per_mm, side, starts: vec![0; side * side + 1], corners: Vec::new() };
        let squares: Vec<usize> = reflex
            .iter()
            .map(|&corner| {
                let [x, y] = places.square(ring.at(corner));
                x + side * y
            })
            .collect();
        for &square in &squares {
            places.starts[square + 1] += 1;
        }
        for square in 0..side * side {
            places.starts[square + 1] += places.starts[square];
        }
        let mut order: Vec<usize> = (0..reflex.len()).collect();
        order.sort_by_key(|&i| squares[i]);
        places.corners = order.into_iter().map(|i| reflex[i]).collect();
        places
    }

    /// The square of a place; the nearest one of a place outside. NaN goes to the first.
    fn square(&self, p: Flat) -> [usize; 2] {
        [0, 1].map(|axis| (((p[axis] - self.low[axis]) * self.per_mm[axis]) as usize).min(self.side - 1))
    }

    /// Whether a corner that is still reflex, near the box of a triangle, `blocks` it.
    fn any_in(&self, ring: &Ring<'_>, [a, b, c]: [Flat; 3], blocks: impl Fn(usize) -> bool) -> bool {
        let low = [0, 1].map(|i| a[i].min(b[i]).min(c[i]));
        let high = [0, 1].map(|i| a[i].max(b[i]).max(c[i]));
        let ([x0, y0], [x1, y1]) = (self.square(low), self.square(high));
        (y0..=y1).any(|y| {
            let row = y * self.side;
            self.corners[self.starts[row + x0]..self.starts[row + x1 + 1]].iter().any(|&corner| {
                let Corner { is_reflex, is_cut, .. } = ring.corners[corner];
                is_reflex && !is_cut && blocks(corner)
            })
        })
    }
}
