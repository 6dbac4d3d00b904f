//! A grid's cells as tetrahedra, in clusters of near ones: the unit of work.
//!
//! Clusters hold their own corners, those of lower numbers first, so that the order of the grid's points decides ties
//! everywhere. Which cells share a cluster depends on geometry and point numbers alone, not on the order of cells.

use rayon::prelude::*;

use super::split;
use crate::volume::cells::{CellGrid, CellKind, Place};
use crate::volume::{Point, Vector};

/// Tetrahedra in a cluster at most; more only where many have the same corners.
const CLUSTER: usize = 512;

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
    list: Vec<Cluster>,
    points: Vec<[f64; 3]>,
    /// Their numbers in the grid.
    numbers: Vec<u32>,
    tetrahedra: Vec<[u32; 4]>,
    /// The cell that each is of.
    cells: Vec<u32>,
    pub(super) faults: Faults,
}

/// One of the clusters: ranges of the lists, and its box.
#[derive(Debug, Clone, Copy)]
struct Cluster {
    points: [u32; 2],
    tetrahedra: [u32; 2],
    low: Point,
    high: Point,
    /// Mean of the cells' longest sides along an axis; mm of the grid.
    cell_mm: f64,
}

/// A tetrahedron with its corners' numbers in rising order.
#[derive(Debug, Clone, Copy)]
struct Part {
    corners: [u32; 4],
    middle: Vector,
    cell: u32,
}

impl Clusters {
    pub(super) fn new(grid: &CellGrid) -> Self {
        let mut faults = Faults::default();
        let mut parts = parts(grid, &mut faults);
        let mut clusters = Self {
            list: Vec::new(),
            points: Vec::new(),
            numbers: Vec::new(),
            tetrahedra: Vec::with_capacity(parts.len()),
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
        // Halves of halves, across the longest side, the lower one first.
        let mut open = vec![&mut groups[..]];
        while let Some(range) = open.pop() {
            let middles = range.iter().map(|g| &parts[g[0] as usize].middle);
            let (mut low, mut high) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
            for middle in middles {
                (low, high) = (low.inf(middle), high.sup(middle));
            }
            if range.len() <= CLUSTER {
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
        let begin = [self.points.len() as u32, self.tetrahedra.len() as u32];
        let mut size = 0.0;
        for part in of() {
            // Every corner is among the numbers.
            self.tetrahedra.push(part.corners.map(|n| numbers.binary_search(&n).unwrap_or(0) as u32));
            self.cells.push(part.cell);
            let [a, b, c, d] = part.corners.map(|n| grid.points()[n as usize].coords);
            size += (a.sup(&b).sup(&c.sup(&d)) - a.inf(&b).inf(&c.inf(&d))).max();
        }
        let (mut low, mut high) = (Point::from([f64::INFINITY; 3]), Point::from([f64::NEG_INFINITY; 3]));
        for &number in &numbers {
            let p = &grid.points()[number as usize];
            (low, high) = (low.inf(p), high.sup(p));
            self.points.push([p.x, p.y, p.z]);
        }
        self.numbers.extend(numbers);
        let end = [self.points.len() as u32, self.tetrahedra.len() as u32];
        self.list.push(Cluster {
            points: [begin[0], end[0]],
            tetrahedra: [begin[1], end[1]],
            low,
            high,
            cell_mm: size / f64::from(end[1] - begin[1]),
        });
    }

    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    /// How many tetrahedra a cluster has.
    pub(super) fn count(&self, cluster: usize) -> usize {
        let [from, to] = self.list[cluster].tetrahedra;
        (to - from) as usize
    }

    pub(super) fn points(&self, cluster: usize) -> &[[f64; 3]] {
        let [from, to] = self.list[cluster].points;
        &self.points[from as usize..to as usize]
    }

    /// Corners of each tetrahedron, positions among the cluster's points.
    pub(super) fn tetrahedra(&self, cluster: usize) -> &[[u32; 4]] {
        let [from, to] = self.list[cluster].tetrahedra;
        &self.tetrahedra[from as usize..to as usize]
    }

    /// Corners of the box of a cluster.
    pub(super) fn corners(&self, cluster: usize) -> [Point; 8] {
        let [a, b] = [self.list[cluster].low, self.list[cluster].high];
        std::array::from_fn(|i| {
            let of = |axis: usize| if i >> axis & 1 == 0 { a[axis] } else { b[axis] };
            Point::new(of(0), of(1), of(2))
        })
    }

    /// Mean length of a cluster's cells; mm of the grid.
    pub(super) fn cell_mm(&self, cluster: usize) -> f64 {
        self.list[cluster].cell_mm
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
    /// One for each of the clusters' points or tetrahedra.
    values: Vec<f64>,
    /// Least and greatest finite value of each cluster.
    ranges: Vec<[f64; 2]>,
}

impl Scalars {
    /// `value` gives the scalar of a point or a cell of the grid.
    pub(super) fn new(clusters: &Clusters, place: Place, value: impl Fn(usize) -> f64) -> Self {
        let numbers = match place {
            Place::Points => &clusters.numbers,
            Place::Cells => &clusters.cells,
        };
        let values: Vec<f64> = numbers.iter().map(|&n| value(n as usize)).collect();
        let mut scalars = Self { place, values, ranges: Vec::with_capacity(clusters.len()) };
        for cluster in 0..clusters.len() {
            let finite = scalars.of(clusters, cluster).iter().filter(|v| v.is_finite());
            let range = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &v| [a.min(v), b.max(v)]);
            scalars.ranges.push(range);
        }
        scalars
    }

    pub(super) fn place(&self) -> Place {
        self.place
    }

    /// The scalar of each point, or tetrahedron, of a cluster.
    pub(super) fn of(&self, clusters: &Clusters, cluster: usize) -> &[f64] {
        let [from, to] = match self.place {
            Place::Points => clusters.list[cluster].points,
            Place::Cells => clusters.list[cluster].tetrahedra,
        };
        &self.values[from as usize..to as usize]
    }

    /// Least and greatest finite value of a cluster; the first is the greater where there is none.
    pub(super) fn range(&self, cluster: usize) -> [f64; 2] {
        self.ranges[cluster]
    }
}
