//! The triangles that close an opening: closed lines sorted into outlines and holes, each outline covered.

use super::divide::{Points, Rim, Triangle};
use super::exact::turn;
use super::lines::Lines;
use super::{Notes, Plane, ears};

/// What closes the part on "-"; turned round it closes the one on "+".
#[derive(Debug, Default)]
pub(super) struct Cap {
    pub(super) triangles: Vec<Triangle>,
    pub(super) notes: Notes,
}

pub(super) fn of(rim: Vec<Rim>, points: &Points<'_>, plane: &Plane) -> Cap {
    let lines = Lines::of(rim, |vertex| plane.flat(&points.at(vertex)));
    let mut triangles = Vec::new();
    for region in regions(&lines) {
        for [a, b, c] in ears::cover(&region.outline, &region.holes, &lines.flat, &lines.edges) {
            let [a, b, c] = [a, b, c].map(|place| lines.vertices[place]);
            triangles.push(if region.is_turned == lines.inside_out { [a, b, c] } else { [a, c, b] });
        }
    }
    Cap { triangles, notes: Notes { closed: lines.closed.len(), open: lines.open } }
}

/// A line with the lines that are cut out of it; the outline counter-clockwise, the holes clockwise.
struct Region {
    outline: Vec<usize>,
    holes: Vec<Vec<usize>>,
    /// Whether all were the other way round: a surface inside out among others.
    is_turned: bool,
}

/// Every line is the outline of a region or a hole of one, by how often what lies within it is enclosed.
///
/// From the outside in, an outline opens a region and a line the other way closes the one opened last. So the
/// void in a solid is a hole, a solid in the void an outline again, and of solids that overlap each is covered.
fn regions(lines: &Lines) -> Vec<Region> {
    let outlines: Vec<Outline<'_>> = lines.closed.iter().map(|line| Outline::of(line, lines)).collect();
    let mut order: Vec<usize> = (0..outlines.len()).collect();
    order.sort_by(|&a, &b| outlines[b].area.abs().total_cmp(&outlines[a].area.abs()).then(a.cmp(&b)));
    let mut regions: Vec<Region> = Vec::new();
    let mut region_of: Vec<usize> = vec![0; outlines.len()];
    // What is open within each line, by the line that opened it.
    let mut within: Vec<Vec<usize>> = vec![Vec::new(); outlines.len()];
    for (rank, &line) in order.iter().enumerate() {
        let this = &outlines[line];
        let parent = order[..rank].iter().rev().find(|&&other| outlines[other].holds(this, lines));
        let mut open = parent.map_or_else(Vec::new, |&parent| within[parent].clone());
        let is_turned = this.area < 0.0;
        let oriented = |turn: bool| {
            let mut places = lines.closed[line].clone();
            if turn {
                places.reverse();
            }
            places
        };
        if let Some(&opener) = open.last()
            && regions[region_of[opener]].is_turned != is_turned
        {
            open.pop();
            let region = &mut regions[region_of[opener]];
            region.holes.push(oriented(region.is_turned));
        } else {
            region_of[line] = regions.len();
            regions.push(Region { outline: oriented(is_turned), holes: Vec::new(), is_turned });
            open.push(line);
        }
        within[line] = open;
    }
    regions
}

/// A closed line with its box and its area.
struct Outline<'a> {
    places: &'a [usize],
    low: [f64; 2],
    high: [f64; 2],
    /// Twice the signed area.
    area: f64,
}

impl<'a> Outline<'a> {
    fn of(places: &'a [usize], lines: &Lines) -> Self {
        let fold = |start: f64, pick: fn(f64, f64) -> f64| {
            [0, 1].map(|axis| places.iter().map(|&p| lines.flat[p][axis]).fold(start, pick))
        };
        let (low, high) = (fold(f64::INFINITY, f64::min), fold(f64::NEG_INFINITY, f64::max));
        Self { places, low, high, area: lines.doubled_area_of(places) }
    }

    /// Whether another line lies within this one: where the two do not cross, any place of it tells that is
    /// not on this one. One that lies all on this one counts as within.
    fn holds(&self, other: &Self, lines: &Lines) -> bool {
        let boxed =
            (0..2).all(|axis| self.low[axis] <= other.low[axis] && other.high[axis] <= self.high[axis]);
        boxed
            && other.places.iter().find_map(|&place| self.encloses(lines.flat[place], lines)).unwrap_or(true)
    }

    /// Whether a place is inside, by the crossings of a ray; none on the line itself. Exact.
    fn encloses(&self, p: [f64; 2], lines: &Lines) -> Option<bool> {
        let mut inside = false;
        let ends = self.places.iter().zip(self.places.iter().cycle().skip(1));
        for (a, b) in ends.map(|(&a, &b)| (lines.flat[a], lines.flat[b])) {
            let side = || turn(a, b, p);
            if (a[1] > p[1]) != (b[1] > p[1]) {
                let side = side();
                if side == 0.0 {
                    return None;
                }
                inside ^= (side > 0.0) == (b[1] > a[1]);
            } else if a[1] == p[1] || b[1] == p[1] {
                // It may lie on an edge along the ray, or on an end.
                let among = a[0].min(b[0]) <= p[0] && p[0] <= a[0].max(b[0]);
                if among && (a[1] == b[1] || a == p || b == p) {
                    return None;
                }
            }
        }
        Some(inside)
    }
}
