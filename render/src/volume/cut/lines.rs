//! From the edges in a plane to the closed lines along which the two parts meet.
//!
//! Where several lines pass through one vertex they are joined so that none crosses another: going around the
//! vertex clockwise, each edge that comes in goes on in the next one that goes out, as brackets match. Solid is
//! on the left of every edge, so pieces that only touch fall apart and a hole that touches its outline joins it.

use std::cmp::Ordering;

use super::divide::Rim;
use super::exact::turn;

/// Lines over numbered places of the plane; the cap lies on their left.
#[derive(Debug, Default)]
pub(super) struct Lines {
    /// The vertex at each place.
    pub(super) vertices: Vec<u32>,
    /// Coordinates of each place, seen from "+".
    pub(super) flat: Vec<[f64; 2]>,
    /// Places in order, each line closed.
    pub(super) closed: Vec<Vec<usize>>,
    /// How many lines do not close.
    pub(super) open: usize,
    /// Whether the mesh is inside out here: then all lines were turned round.
    pub(super) inside_out: bool,
    /// All edges in the plane, lower place first, in order.
    pub(super) edges: Vec<[usize; 2]>,
}

impl Lines {
    pub(super) fn of(rim: Vec<Rim>, flat: impl Fn(u32) -> [f64; 2]) -> Self {
        let rim = joined(rim);
        let mut vertices: Vec<u32> = rim.iter().flat_map(|r| [r.low, r.high]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let place = |v: u32| vertices.binary_search(&v).unwrap_or(0);
        let mut lines = Self {
            flat: vertices.iter().map(|&v| flat(v)).collect(),
            edges: rim.iter().map(|r| [place(r.low), place(r.high)]).collect(),
            ..Self::default()
        };
        lines.vertices.clone_from(&vertices);
        let mut ways: Vec<[usize; 2]> = Vec::with_capacity(rim.len());
        for (edge, &[low, high]) in rim.iter().zip(&lines.edges) {
            // The rim of the part on "-" runs against the cap that closes it.
            let way = if edge.minus > 0 { [high, low] } else { [low, high] };
            // Where only one part has the edge, the mesh ends there: that is no cut.
            let meets = edge.minus.signum() * edge.plus.signum() < 0;
            let times = if meets { edge.minus.abs().min(edge.plus.abs()) } else { 0 };
            ways.extend((0..times).map(|_| way));
        }
        lines.inside_out = ways.iter().map(|&way| lines.doubled_area(&way)).sum::<f64>() < 0.0;
        if lines.inside_out {
            for way in &mut ways {
                way.reverse();
            }
        }
        lines.walk(&ways);
        lines
    }

    /// Twice the signed area between an edge and the first place.
    fn doubled_area(&self, &[from, to]: &[usize; 2]) -> f64 {
        let (o, a, b) = (self.flat[0], self.flat[from], self.flat[to]);
        (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
    }

    /// Twice the signed area of a closed line.
    pub(super) fn doubled_area_of(&self, line: &[usize]) -> f64 {
        let Some(&first) = line.first() else { return 0.0 };
        let o = self.flat[first];
        let from_first = |i: usize| [self.flat[i][0] - o[0], self.flat[i][1] - o[1]];
        let cross = |pair: &[usize]| {
            let (a, b) = (from_first(pair[0]), from_first(pair[1]));
            a[0] * b[1] - a[1] * b[0]
        };
        line.windows(2).map(cross).sum()
    }

    /// Follows all edges; those that lead nowhere first.
    fn walk(&mut self, ways: &[[usize; 2]]) {
        let next = self.successors(ways);
        let mut is_reached = vec![false; ways.len()];
        for &next in next.iter().flatten() {
            is_reached[next] = true;
        }
        let mut is_done = vec![false; ways.len()];
        for start in (0..ways.len()).filter(|&way| !is_reached[way]) {
            self.open += 1;
            let mut way = Some(start);
            while let Some(at) = way {
                is_done[at] = true;
                way = next[at];
            }
        }
        for start in 0..ways.len() {
            let mut line = Vec::new();
            let mut way = start;
            while !is_done[way] {
                is_done[way] = true;
                line.push(ways[way][0]);
                way = next[way].unwrap_or(way);
            }
            if !line.is_empty() {
                self.closed.push(line);
            }
        }
    }

    /// The edge that follows each.
    fn successors(&self, ways: &[[usize; 2]]) -> Vec<Option<usize>> {
        let mut around: Vec<Vec<(usize, bool)>> = vec![Vec::new(); self.flat.len()];
        for (way, &[from, to]) in ways.iter().enumerate() {
            around[from].push((way, true));
            around[to].push((way, false));
        }
        let mut next = vec![None; ways.len()];
        for (place, mut ends) in around.into_iter().enumerate() {
            if let [(a, a_leaves), (b, b_leaves)] = ends[..] {
                match (a_leaves, b_leaves) {
                    (true, false) => next[b] = Some(a),
                    (false, true) => next[a] = Some(b),
                    _ => {}
                }
                continue;
            }
            ends.sort_by(|&(a, _), &(b, _)| {
                let other = |way: usize| ways[way][usize::from(ways[way][0] == place)];
                self.by_angle(place, other(b), other(a)).then(a.cmp(&b))
            });
            // Clockwise twice, since the brackets stand in a circle.
            let mut waiting = Vec::new();
            let mut is_taken = vec![false; ends.len()];
            for round in 0..2 {
                for (i, &(way, leaves)) in ends.iter().enumerate() {
                    if !leaves && round == 0 {
                        waiting.push(way);
                    } else if leaves
                        && !is_taken[i]
                        && let Some(from) = waiting.pop()
                    {
                        next[from] = Some(way);
                        is_taken[i] = true;
                    }
                }
            }
        }
        next
    }

    /// The order of two places by their angle about a third, counter-clockwise; what coincides with it first.
    fn by_angle(&self, about: usize, a: usize, b: usize) -> Ordering {
        let o = self.flat[about];
        let half = |p: [f64; 2]| {
            if p == o {
                0
            } else if p[1] > o[1] || (p[1] == o[1] && p[0] > o[0]) {
                1
            } else {
                2
            }
        };
        let (p, q) = (self.flat[a], self.flat[b]);
        half(p).cmp(&half(q)).then_with(
            || {
                if p == o { Ordering::Equal } else { turn(o, q, p).total_cmp(&0.0) }
            },
        )
    }
}

/// One entry for each edge.
fn joined(mut rim: Vec<Rim>) -> Vec<Rim> {
    rim.sort_unstable_by_key(|r| (r.low, r.high));
    rim.dedup_by(|next, kept| {
        let same = (next.low, next.high) == (kept.low, kept.high);
        if same {
            kept.minus += next.minus;
            kept.plus += next.plus;
        }
        same
    });
    rim
}
