//! A grid's cells as tetrahedra, in clusters of near ones: the unit of work.
//!
//! Clusters hold their own corners, those of lower numbers first, so that the order of the grid's points decides ties
//! everywhere. Which cells share a cluster depends on geometry and point numbers alone, not on the order of cells.
//!
//! Of every cluster a worker knows the [`Outline`]: that is enough to share them out. Its [`Body`] and its values, which are
//! what takes memory, are only where it is drawn; workers in one process have all of them in common.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::{Options, split};
use crate::volume::cells::{CellGrid, CellKind, Place};
use crate::volume::{Point, Vector};

/// Tetrahedra in a cluster of a small grid at most; more only where many have the same corners.
const CLUSTER: usize = 512;
/// Clusters that a grid has at least before they are larger.
const CLUSTERS: usize = 128;

/// What clusters are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Grain {
    /// To be passed over one by one, and shared out evenly though nobody knows what will be hidden of them.
    Fine,
    /// For long runs of cells.
    Coarse,
}

impl Grain {
    /// Of what a picture is drawn with; `by_cells` says whether these are shared out.
    pub(super) fn of(options: &Options, by_cells: bool) -> Self {
        if by_cells && options.early.is_some() { Self::Fine } else { Self::Coarse }
    }

    /// Tetrahedra in a cluster of a large grid at most.
    fn most(self) -> usize {
        match self {
            Self::Fine => 1024,
            Self::Coarse => 4096,
        }
    }
}

/// What was wrong with cells, by its count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// Tetrahedra of no volume, left out; a cell that repeats a corner has some.
    pub flat: u64,
    /// Cells with a part that is turned round; drawn as any other.
    pub inverted: u64,
}

impl Faults {
    /// Those of a grid.
    pub fn of(grid: &CellGrid) -> Self {
        let of_cell = |mut faults: Self, cell| {
            parts_of(grid, cell, &mut faults, |_| ());
            faults
        };
        let sum = |a: Self, b: Self| Self { flat: a.flat + b.flat, inverted: a.inverted + b.inverted };
        (0..grid.len()).into_par_iter().fold(Self::default, of_cell).reduce(Self::default, sum)
    }
}

/// Cells of a grid, ready to be drawn from anywhere.
#[derive(Debug)]
pub(super) struct Clusters {
    outlines: Vec<Outline>,
    /// Those that are here.
    bodies: Vec<OnceLock<Body>>,
    /// Numbers in the grid of the points of one cluster after the other; empty where the grid is not here.
    numbers: Vec<u32>,
    /// The cell that each tetrahedron is of; empty where the grid is not here.
    cells: Vec<u32>,
    pub(super) faults: Faults,
}

/// What every worker knows of a cluster.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outline {
    pub(super) points: u32,
    pub(super) tetrahedra: u32,
    /// Its box.
    pub(super) low: Point,
    pub(super) high: Point,
    /// Mean of the cells' longest sides along an axis; mm of the grid.
    pub(super) cell_mm: f64,
}

/// The cells of a cluster.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Body {
    pub(super) points: Vec<[f64; 3]>,
    /// Corners of each, positions among the points: of these there are eight for each of some thousand cells at most.
    pub(super) tetrahedra: Vec<[u16; 4]>,
}

/// A tetrahedron with its corners' numbers in rising order.
#[derive(Debug, Clone, Copy)]
struct Part {
    corners: [u32; 4],
    middle: Vector,
    cell: u32,
}

impl Clusters {
    pub(super) fn new(grid: &CellGrid, grain: Grain) -> Self {
        let mut faults = Faults::default();
        let mut parts = parts(grid, &mut faults);
        let mut clusters = Self {
            outlines: Vec::new(),
            bodies: Vec::new(),
            numbers: Vec::new(),
            cells: Vec::with_capacity(parts.len()),
            faults,
        };
        // Those with the same corners stay together: nothing else could tell which comes first.
        parts.sort_unstable_by_key(|part| part.corners);
        let mut groups: Vec<[u32; 2]> = Vec::new();
        let mut begin = 0;
        for i in 1..=parts.len() {
            if i == parts.len() || parts[i].corners != parts[begin].corners {
                groups.push([begin as u32, i as u32]);
                begin = i;
            }
        }
        let most = (groups.len() / CLUSTERS).clamp(CLUSTER, grain.most());
        // Halves of halves, across the longest side, the lower one first.
        let mut open = vec![&mut groups[..]];
        while let Some(range) = open.pop() {
            let middles = range.iter().map(|g| &parts[g[0] as usize].middle);
            let (mut low, mut high) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
            for middle in middles {
                (low, high) = (low.inf(middle), high.sup(middle));
            }
            if range.len() <= most {
                clusters.add(grid, &parts, range);
                continue;
            }
            let axis = (high - low).imax();
            let key = |g: &[u32; 2]| &parts[g[0] as usize];
            let half = range.len() / 2;
            range.select_nth_unstable_by(half, |a, b| {
                let (a, b) = (key(a), key(b));
                a.middle[axis].total_cmp(&b.middle[axis]).then_with(|| a.corners.cmp(&b.corners))
            });
            let (lower, upper) = range.split_at_mut(half);
            open.push(upper);
            open.push(lower);
        }
        clusters
    }

    /// Adds a cluster of groups of tetrahedra.
    fn add(&mut self, grid: &CellGrid, parts: &[Part], groups: &mut [[u32; 2]]) {
        if groups.is_empty() {
            return;
        }
        groups.sort_unstable();
        let of = || groups.iter().flat_map(|g| &parts[g[0] as usize..g[1] as usize]);
        let mut numbers: Vec<u32> = of().flat_map(|p| p.corners).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let mut body = Body::default();
        let mut size = 0.0;
        for part in of() {
            // Every corner is among the numbers, and there are few enough.
            body.tetrahedra.push(part.corners.map(|n| numbers.binary_search(&n).unwrap_or(0) as u16));
            self.cells.push(part.cell);
            let [a, b, c, d] = part.corners.map(|n| grid.points()[n as usize].coords);
            size += (a.sup(&b).sup(&c.sup(&d)) - a.inf(&b).inf(&c.inf(&d))).max();
        }
        let (mut low, mut high) = (Point::from([f64::INFINITY; 3]), Point::from([f64::NEG_INFINITY; 3]));
        for &number in &numbers {
            let p = &grid.points()[number as usize];
            (low, high) = (low.inf(p), high.sup(p));
            body.points.push([p.x, p.y, p.z]);
        }
        self.numbers.extend(numbers);
        let [points, tetrahedra] = [body.points.len() as u32, body.tetrahedra.len() as u32];
        let cell_mm = size / f64::from(tetrahedra);
        self.outlines.push(Outline { points, tetrahedra, low, high, cell_mm });
        self.bodies.push(OnceLock::from(body));
    }

    /// Clusters of a grid that is elsewhere; none of their bodies is here.
    pub(super) fn elsewhere(outlines: Vec<Outline>) -> Self {
        let bodies = outlines.iter().map(|_| OnceLock::new()).collect();
        Self { outlines, bodies, numbers: Vec::new(), cells: Vec::new(), faults: Faults::default() }
    }

    pub(super) fn len(&self) -> usize {
        self.outlines.len()
    }

    pub(super) fn outlines(&self) -> &[Outline] {
        &self.outlines
    }

    /// How many tetrahedra a cluster has.
    pub(super) fn count(&self, cluster: usize) -> usize {
        self.outlines[cluster].tetrahedra as usize
    }

    /// A cluster's cells, where they are here.
    pub(super) fn body(&self, cluster: usize) -> Option<&Body> {
        self.bodies.get(cluster)?.get()
    }

    /// Takes over the cells of a cluster; not where they do not fit to its outline.
    pub(super) fn take(&self, cluster: usize, body: Body) -> bool {
        let (Some(outline), Some(place)) = (self.outlines.get(cluster), self.bodies.get(cluster)) else {
            return false;
        };
        let fits = body.points.len() == outline.points as usize
            && body.tetrahedra.len() == outline.tetrahedra as usize
            && body.tetrahedra.iter().flatten().all(|&corner| u32::from(corner) < outline.points);
        if fits {
            place.get_or_init(|| body);
        }
        fits
    }

    /// Forgets the cells of some clusters.
    pub(super) fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        for (cluster, body) in self.bodies.iter_mut().enumerate() {
            if !keep(cluster) {
                body.take();
            }
        }
    }

    /// How many tetrahedra are here.
    pub(super) fn held(&self) -> u64 {
        self.bodies.iter().filter_map(OnceLock::get).map(|body| body.tetrahedra.len() as u64).sum()
    }

    /// The points of a cluster that is here.
    pub(super) fn points(&self, cluster: usize) -> &[[f64; 3]] {
        self.body(cluster).map_or(&[], |body| &body.points)
    }

    /// Corners of each tetrahedron of a cluster that is here, positions among its points.
    pub(super) fn tetrahedra(&self, cluster: usize) -> &[[u16; 4]] {
        self.body(cluster).map_or(&[], |body| &body.tetrahedra)
    }

    /// Corners of the box of a cluster.
    pub(super) fn corners(&self, cluster: usize) -> [Point; 8] {
        let [a, b] = [self.outlines[cluster].low, self.outlines[cluster].high];
        std::array::from_fn(|i| {
            let of = |axis: usize| if i >> axis & 1 == 0 { a[axis] } else { b[axis] };
            Point::new(of(0), of(1), of(2))
        })
    }

    /// Mean length of a cluster's cells; mm of the grid.
    pub(super) fn cell_mm(&self, cluster: usize) -> f64 {
        self.outlines[cluster].cell_mm
    }
}

/// All tetrahedra that have a volume.
fn parts(grid: &CellGrid, faults: &mut Faults) -> Vec<Part> {
    let mut parts = Vec::with_capacity(grid.len());
    for cell in 0..grid.len() {
        parts_of(grid, cell, faults, |part| parts.push(part));
    }
    parts
}

/// Those of one cell.
fn parts_of(grid: &CellGrid, cell: usize, faults: &mut Faults, mut found: impl FnMut(Part)) {
    let points = grid.points();
    let (kind, corners) = grid.cell(cell);
    let [mut positive, mut negative] = [false; 2];
    let mut none = true;
    split::tetrahedra(kind, corners, |mut corners| {
        none = false;
        let [a, b, c, d] = corners.map(|n| points[n as usize]);
        let volume = (b - a).cross(&(c - a)).dot(&(d - a));
        if volume == 0.0 || volume.is_nan() {
            faults.flat += 1;
            return;
        }
        *(if volume < 0.0 { &mut negative } else { &mut positive }) = true;
        corners.sort_unstable();
        let [a, b, c, d] = corners.map(|n| points[n as usize].coords);
        let middle = (a * 0.25 + b * 0.25) + (c * 0.25 + d * 0.25);
        found(Part { corners, middle, cell: cell as u32 });
    });
    faults.flat += u64::from(none);
    // Files differ about which way a wedge is turned.
    faults.inverted += u64::from(negative && (positive || kind != CellKind::Wedge));
}

/// The scalar of one step, where clusters have it.
#[derive(Debug)]
pub(super) struct Scalars {
    place: Place,
    /// One for each point or tetrahedron of a cluster; those of clusters that are here.
    values: Vec<OnceLock<Vec<f64>>>,
    /// Least and greatest finite value of each cluster.
    ranges: Vec<[f64; 2]>,
}

impl Scalars {
    /// `value` gives the scalar of a point or a cell of the grid, which is here.
    pub(super) fn new(clusters: &Clusters, place: Place, value: impl Fn(usize) -> f64) -> Self {
        let mut rest = match place {
            Place::Points => &clusters.numbers[..],
            Place::Cells => &clusters.cells[..],
        };
        let count = clusters.len();
        let mut scalars =
            Self { place, values: Vec::with_capacity(count), ranges: Vec::with_capacity(count) };
        for outline in &clusters.outlines {
            let (mine, others) = rest.split_at(scalars.needed(outline));
            rest = others;
            let values: Vec<f64> = mine.iter().map(|&n| value(n as usize)).collect();
            let finite = values.iter().filter(|v| v.is_finite());
            let range = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &v| [a.min(v), b.max(v)]);
            scalars.values.push(OnceLock::from(values));
            scalars.ranges.push(range);
        }
        scalars
    }

    /// The scalar of a grid that is elsewhere; none of its values is here.
    pub(super) fn elsewhere(place: Place, ranges: Vec<[f64; 2]>) -> Self {
        Self { place, values: ranges.iter().map(|_| OnceLock::new()).collect(), ranges }
    }

    /// How many values a cluster has.
    fn needed(&self, outline: &Outline) -> usize {
        let count = match self.place {
            Place::Points => outline.points,
            Place::Cells => outline.tetrahedra,
        };
        count as usize
    }

    pub(super) fn place(&self) -> Place {
        self.place
    }

    /// Whether a cluster can be drawn here.
    pub(super) fn has(&self, clusters: &Clusters, cluster: usize) -> bool {
        clusters.body(cluster).is_some() && self.values.get(cluster).is_some_and(|v| v.get().is_some())
    }

    /// Takes over the values of a cluster; not where they are not as many as its outline says.
    pub(super) fn take(&self, clusters: &Clusters, cluster: usize, values: Vec<f64>) -> bool {
        let (Some(outline), Some(place)) = (clusters.outlines.get(cluster), self.values.get(cluster)) else {
            return false;
        };
        let fits = values.len() == self.needed(outline);
        if fits {
            place.get_or_init(|| values);
        }
        fits
    }

    /// Forgets the values of some clusters.
    pub(super) fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        for (cluster, values) in self.values.iter_mut().enumerate() {
            if !keep(cluster) {
                values.take();
            }
        }
    }

    /// The scalar of each point, or tetrahedron, of a cluster that is here.
    pub(super) fn of(&self, cluster: usize) -> &[f64] {
        self.values[cluster].get().map_or(&[], |values| values)
    }

    /// Least and greatest finite value of a cluster; the first is the greater where there is none.
    pub(super) fn range(&self, cluster: usize) -> [f64; 2] {
        self.ranges[cluster]
    }

    pub(super) fn ranges(&self) -> &[[f64; 2]] {
        &self.ranges
    }
}

/// What a worker lacks of a cluster.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pack {
    pub(super) cluster: u32,
    /// Its cells, where the worker has not got them.
    pub(super) body: Option<Body>,
    pub(super) values: Vec<f64>,
}

impl Pack {
    /// All of a cluster that is here.
    pub(super) fn of(clusters: &Clusters, scalars: &Scalars, cluster: u32) -> Self {
        let body = clusters.body(cluster as usize).cloned();
        Self { body, ..Self::values_of(scalars, cluster) }
    }

    /// The values of a cluster that is here.
    pub(super) fn values_of(scalars: &Scalars, cluster: u32) -> Self {
        Self { cluster, body: None, values: scalars.of(cluster as usize).to_vec() }
    }

    /// About how many bytes it has.
    pub(super) fn bytes(&self) -> usize {
        let body = self.body.as_ref().map_or(0, |body| 24 * body.points.len() + 8 * body.tetrahedra.len());
        body + 8 * self.values.len()
    }

    /// Puts it where it belongs; not where it does not fit there.
    pub(super) fn unpack(self, clusters: &Clusters, scalars: &Scalars) -> bool {
        let cluster = self.cluster as usize;
        self.body.is_none_or(|body| clusters.take(cluster, body))
            && scalars.take(clusters, cluster, self.values)
    }
}
