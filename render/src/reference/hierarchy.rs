//! A bounding volume hierarchy: halves by the median of middles along the longest side, down to leaves.

use std::ops::Range;

use crate::volume::Vector;

/// Things in a leaf at most.
const LEAF: usize = 4;

/// Something between corners.
pub(super) trait Bounded {
    /// Its corners; none lies outside their box.
    fn corners(&self) -> &[Vector];
}

#[derive(Debug)]
struct Node {
    low: [f64; 3],
    high: [f64; 3],
    /// Things of a leaf; none for an inner node, whose first child is the next node.
    things: Range<usize>,
    /// The node after all below this one.
    skip: usize,
}

/// Things, for rays to ask which they may meet.
#[derive(Debug)]
pub(super) struct Hierarchy<T> {
    things: Vec<T>,
    nodes: Vec<Node>,
}

impl<T: Bounded> Hierarchy<T> {
    pub(super) fn new(things: Vec<T>) -> Self {
        let mut hierarchy = Self { things, nodes: Vec::new() };
        hierarchy.build(0..hierarchy.things.len());
        hierarchy
    }

    /// Adds the node of a range of things and all below it. It calls itself as deep as their number has bits.
    fn build(&mut self, range: Range<usize>) {
        if range.is_empty() {
            return;
        }
        let (mut low, mut high) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
        let (mut first, mut last) = (low, high);
        for thing in &self.things[range.clone()] {
            for corner in thing.corners() {
                (low, high) = (low.inf(corner), high.sup(corner));
            }
            let middle = thing.corners().iter().sum::<Vector>();
            (first, last) = (first.inf(&middle), last.sup(&middle));
        }
        // Whoever asks may move corners by rounding; boxes must not be narrower than that.
        let pad = 1e-12 * (1.0 + low.amax().max(high.amax()));
        let leaf = range.len() <= LEAF;
        let node = self.nodes.len();
        self.nodes.push(Node {
            low: low.add_scalar(-pad).into(),
            high: high.add_scalar(pad).into(),
            things: if leaf { range.clone() } else { 0..0 },
            skip: 0,
        });
        if !leaf {
            let axis = (last - first).imax();
            let half = range.len() / 2;
            let middle = |thing: &T| thing.corners().iter().map(|c| c[axis]).sum::<f64>();
            self.things[range.clone()].select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
            self.build(range.start..range.start + half);
            self.build(range.start + half..range.end);
        }
        self.nodes[node].skip = self.nodes.len();
    }

    /// What a ray may meet at or after its start; `offset` is that.
    pub(super) fn near<'a>(&'a self, offset: &'a Vector, direction: &Vector) -> impl Iterator<Item = &'a T> {
        let inverse = direction.map(|d| 1.0 / d);
        let mut i = 0;
        let leaves = std::iter::from_fn(move || {
            loop {
                let node = self.nodes.get(i)?;
                if node.is_met(offset, &inverse) {
                    i += 1;
                    return Some(&self.things[node.things.clone()]);
                }
                i = node.skip;
            }
        });
        leaves.flatten()
    }
}

impl Node {
    fn is_met(&self, offset: &Vector, inverse: &Vector) -> bool {
        let (mut from, mut to) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let (low, high) = (self.low[axis] - offset[axis], self.high[axis] - offset[axis]);
            if inverse[axis].is_infinite() {
                if low > 0.0 || high < 0.0 {
                    return false;
                }
                continue;
            }
            let (a, b) = (low * inverse[axis], high * inverse[axis]);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        from <= to * (1.0 + 1e-12)
    }
}
