//! Where a fragment can show anything: which tiles of the picture, slab by slab. What a transfer function makes clear is
//! neither drawn nor looked at.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::stack::Spacing;
use crate::view::View;
use crate::volume::convex::HalfSpace;
use crate::volume::{Affine, Occupied, Point};

/// Pixels along a tile's side, at least.
const TILE: u32 = 16;
/// Tiles along a side of the picture, at most; then each is larger.
const MOST_TILES: u32 = 64;
/// Room around a box, so that rounding takes nothing away: pixels, and a part of a slab.
const ROOM_PIXELS: f64 = 0.1;
const ROOM_SLABS: f64 = 1e-3;

/// Low and high end of x, then of y, in normalised coordinates.
pub(crate) type Rectangle = [[f64; 2]; 2];

/// The tiles of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Tiles {
    size: [u32; 2],
    edge: u32,
    pub(crate) count: [u32; 2],
}

impl Tiles {
    pub(crate) fn new(size: [u32; 2]) -> Self {
        let edge = TILE.max(size[0].max(size[1]).div_ceil(MOST_TILES));
        Self { size, edge, count: size.map(|n| n.div_ceil(edge)) }
    }

    /// The tiles of a picture as one run of bits.
    fn words(self) -> usize {
        (self.count[0] * self.count[1]).div_ceil(64) as usize
    }

    /// First and last tile, x and y, between two corners in normalised coordinates; `None` beside the picture.
    pub(crate) fn between(self, low: [f64; 2], high: [f64; 2]) -> Option<[[u32; 2]; 2]> {
        let axis = |a: usize, near: f64, far: f64| {
            let edge = f64::from(self.edge);
            let [first, last] = [near - ROOM_PIXELS, far + ROOM_PIXELS].map(|pixel| (pixel / edge).floor());
            let most = f64::from(self.count[a] - 1);
            (last >= 0.0 && first <= most).then(|| [first, last].map(|tile| tile.clamp(0.0, most) as u32))
        };
        let [width, height] = self.size.map(|n| 0.5 * f64::from(n));
        let x = axis(0, (1.0 + low[0]) * width, (1.0 + high[0]) * width)?;
        let y = axis(1, (1.0 - high[1]) * height, (1.0 - low[1]) * height)?;
        Some([x, y])
    }

    fn index(self, [column, row]: [u32; 2]) -> usize {
        (row * self.count[0] + column) as usize
    }

    /// What a run of tiles covers.
    pub(crate) fn rectangle(self, columns: [u32; 2], row: u32) -> Rectangle {
        let end =
            |a: usize, tile: u32| f64::from((tile * self.edge).min(self.size[a])) / f64::from(self.size[a]);
        [
            [2.0 * end(0, columns[0]) - 1.0, 2.0 * end(0, columns[1] + 1) - 1.0],
            [1.0 - 2.0 * end(1, row + 1), 1.0 - 2.0 * end(1, row)],
        ]
    }
}

/// Column and row of each tile within bounds, row by row.
pub(crate) fn each([x, y]: [[u32; 2]; 2]) -> impl Iterator<Item = [u32; 2]> {
    (y[0]..=y[1]).flat_map(move |row| (x[0]..=x[1]).map(move |column| [column, row]))
}

/// What of a fragment may show.
#[derive(Debug)]
pub(crate) struct Shown {
    pub(crate) occupied: Arc<Occupied>,
    pub(crate) view_from_voxel: Affine,
    /// Beyond any of these, in view space, nothing shows.
    pub(crate) planes: Vec<HalfSpace>,
}

/// A set of tiles for each slab.
#[derive(Debug)]
pub(crate) struct Coverage {
    tiles: Tiles,
    slabs: Vec<AtomicU64>,
}

impl Coverage {
    pub(crate) fn new(shown: &Shown, tiles: Tiles, view: &View, spacing: &Spacing) -> Self {
        let words = tiles.words();
        let slabs = (0..words * spacing.slabs as usize).map(|_| AtomicU64::new(0)).collect();
        let coverage = Self { tiles, slabs };
        shown.occupied.boxes.par_iter().with_min_len(64).for_each(|ends| {
            let corners: [Point; 8] = std::array::from_fn(|c| {
                let at = [0, 1, 2].map(|axis: usize| ends[axis][c >> axis & 1]);
                shown.view_from_voxel.point(&Point::from(at))
            });
            if !shown.planes.iter().any(|plane| corners.iter().all(|p| plane.value(p) < 0.0)) {
                coverage.mark(&corners, view, spacing);
            }
        });
        coverage
    }

    fn mark(&self, corners: &[Point; 8], view: &View, spacing: &Spacing) {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut depth = [f64::INFINITY, f64::NEG_INFINITY];
        for corner in corners {
            depth = [depth[0].min(corner.z), depth[1].max(corner.z)];
            // Where part of the box is behind the eye, it may be anywhere.
            let Some(place) = view.ndc(corner) else {
                (low, high) = ([-1.0; 2], [1.0; 2]);
                continue;
            };
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
        let slab = |z: f64| (z - spacing.near_mm) / spacing.slab_mm();
        let [first, last] = [slab(depth[0]) - ROOM_SLABS, slab(depth[1]) + ROOM_SLABS].map(f64::floor);
        if last < 0.0 || first >= f64::from(spacing.slabs) {
            return;
        }
        let Some([x, y]) = self.tiles.between(low, high) else { return };
        let words = self.tiles.words();
        for slab in first.max(0.0) as usize..=(last as usize).min(spacing.slabs as usize - 1) {
            for tile in each([x, y]) {
                let bit = self.tiles.index(tile);
                let word = &self.slabs[slab * words + bit / 64];
                let mask = 1 << (bit % 64);
                if word.load(Ordering::Relaxed) & mask == 0 {
                    word.fetch_or(mask, Ordering::Relaxed);
                }
            }
        }
    }

    /// Whether anything may show in a tile of a slab.
    pub(crate) fn has(&self, slab: u32, tile: [u32; 2]) -> bool {
        let bit = self.tiles.index(tile);
        let word = &self.slabs[slab as usize * self.tiles.words() + bit / 64];
        word.load(Ordering::Relaxed) >> (bit % 64) & 1 == 1
    }
}

/// What shows in each tile of a slab.
#[derive(Debug)]
pub(crate) struct Sets {
    tiles: Tiles,
    /// Words a tile, a bit for each member.
    stride: usize,
    bits: Vec<u64>,
    seen: Vec<bool>,
    /// Tiles in which something might show, and does.
    pub(crate) looked: u64,
    pub(crate) shown: u64,
}

impl Sets {
    pub(crate) fn new(tiles: Tiles, members: usize) -> Self {
        let (stride, count) = (members.div_ceil(64), (tiles.count[0] * tiles.count[1]) as usize);
        Self { tiles, stride, bits: vec![0; stride * count], seen: vec![false; count], looked: 0, shown: 0 }
    }

    fn of(&self, tile: usize) -> &[u64] {
        &self.bits[tile * self.stride..][..self.stride]
    }

    /// Notes that a member may show in a tile, and whether it does.
    pub(crate) fn look(&mut self, tile: [u32; 2], member: usize, shows: bool) {
        let tile = self.tiles.index(tile);
        self.looked += u64::from(!std::mem::replace(&mut self.seen[tile], true));
        if shows {
            self.shown += u64::from(self.of(tile).iter().all(|&word| word == 0));
            self.bits[tile * self.stride + member / 64] |= 1 << (member % 64);
        }
    }

    /// Runs of tiles in which the same members show, by those members.
    pub(crate) fn runs(&self) -> BTreeMap<Vec<usize>, Vec<Rectangle>> {
        let mut runs: BTreeMap<Vec<usize>, Vec<Rectangle>> = BTreeMap::new();
        if self.shown == 0 {
            return runs;
        }
        let [width, height] = self.tiles.count;
        for row in 0..height {
            let of = |column| self.of(self.tiles.index([column, row]));
            let mut first = 0;
            for column in 1..=width {
                if column < width && of(column) == of(first) {
                    continue;
                }
                let bits = of(first);
                let members: Vec<usize> =
                    (0..64 * self.stride).filter(|m| bits[m / 64] >> (m % 64) & 1 == 1).collect();
                if !members.is_empty() {
                    runs.entry(members).or_default().push(self.tiles.rectangle([first, column - 1], row));
                }
                first = column;
            }
        }
        runs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Camera, Projection};
    use crate::volume::Vector;

    #[test]
    fn every_point_of_a_box_is_in_a_marked_tile_of_its_slab() {
        let size = [300, 170];
        let tiles = Tiles::new(size);
        let boxes = vec![[[-0.5, 7.5], [7.5, 15.5], [-0.5, 3.5]], [[31.5, 39.5], [-0.5, 7.5], [7.5, 15.5]]];
        let occupied = Arc::new(Occupied { span: [[-0.5, 39.5]; 3], bricks: 2, boxes });
        for projection in [Projection::Perspective { fov_rad: 0.9 }, Projection::Parallel { height_mm: 40.0 }]
        {
            let eye = Point::new(60.0, 25.0, -30.0);
            let camera = Camera { eye, target: Point::new(15.0, 6.0, 5.0), up: Vector::y(), projection };
            let view = View::new(&camera, size).expect("view");
            let shown = Shown {
                occupied: Arc::clone(&occupied),
                view_from_voxel: view.view_from_world,
                planes: Vec::new(),
            };
            let spacing = Spacing { near_mm: 20.0, step_mm: 0.5, steps: 8, slabs: 25 };
            let coverage = Coverage::new(&shown, tiles, &view, &spacing);
            let mut seen = 0;
            for ends in &occupied.boxes {
                for i in 0..20 * 20 * 20 {
                    let part = [i % 20, i / 20 % 20, i / 400].map(|n| f64::from(n) / 19.0);
                    let at: [f64; 3] =
                        std::array::from_fn(|a| ends[a][0] + (ends[a][1] - ends[a][0]) * part[a]);
                    let p = view.view_from_world.point(&Point::from(at));
                    let slab = ((p.z - spacing.near_mm) / spacing.slab_mm()).floor();
                    let ndc = view.ndc(&p).expect("before the eye");
                    if ndc.iter().any(|c| c.abs() >= 1.0) || !(0.0..25.0).contains(&slab) {
                        continue;
                    }
                    let tile = |a: usize, part: f64| {
                        (part * 0.5 * f64::from(size[a]) / f64::from(tiles.edge)) as u32
                    };
                    let (x, y) = (tile(0, 1.0 + ndc[0]), tile(1, 1.0 - ndc[1]));
                    assert!(coverage.has(slab as u32, [x, y]), "{at:?} in slab {slab}");
                    seen += 1;
                }
            }
            assert!(seen > 1000, "only {seen} points lay in the picture");
            let all = [[0, tiles.count[0] - 1], [0, tiles.count[1] - 1]];
            let marked = |slab| each(all).filter(|tile| coverage.has(slab, *tile)).count() as u64;
            let total: u64 = (0..spacing.slabs).map(marked).sum();
            let most = u64::from(spacing.slabs * tiles.count[0] * tiles.count[1]);
            assert!(total < most / 4, "{total} of {most} tiles");
        }
    }

    #[test]
    fn tiles_with_the_same_members_are_drawn_together() {
        let tiles = Tiles::new([64, 32]);
        let mut sets = Sets::new(tiles, 70);
        for tile in [[0, 0], [1, 0], [2, 0], [1, 1]] {
            sets.look(tile, 3, true);
        }
        sets.look([1, 0], 69, true);
        sets.look([3, 1], 69, false);
        assert_eq!((sets.looked, sets.shown), (5, 4), "tiles");
        let runs = sets.runs();
        assert_eq!(runs.keys().collect::<Vec<_>>(), [&vec![3], &vec![3, 69]], "sets of members");
        assert_eq!(runs[&vec![3, 69]], [[[-0.5, 0.0], [0.0, 1.0]]], "where both are");
        let alone = [[[-1.0, -0.5], [0.0, 1.0]], [[0.0, 0.5], [0.0, 1.0]], [[-0.5, 0.0], [-1.0, 0.0]]];
        assert_eq!(runs[&vec![3]], alone, "where one is");
    }
}
