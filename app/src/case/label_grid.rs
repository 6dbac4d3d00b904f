//! A label set as one grid: its source with what was painted over it, and how much there is of each label.
//!
//! Grids are made when asked for and kept until source or paint changes; then the bricks that differ are written
//! into a copy, so a dab of the brush costs one copy of the samples and no look at the rest.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use render::volume::{Grid, Rescale, Samples, label_of};

use super::labels::{Brick, Bricks, EDGE, LabelSet, MAX_LABEL};

/// All labels of a set.
#[derive(Debug, Clone)]
pub struct LabelGrid {
    /// One label a sample.
    pub grid: Arc<Grid>,
    /// Samples of each label, from 1; none with no sample.
    pub counts: Arc<BTreeMap<u32, usize>>,
}

impl LabelGrid {
    /// The brick at a place, as it is.
    pub fn brick(&self, at: [usize; 3]) -> Brick {
        brick(&self.grid, at)
    }

    /// The volume of one sample; mm³.
    pub fn sample_mm3(&self) -> f64 {
        self.grid.world_from_voxel().linear().determinant().abs()
    }
}

/// What a grid was made from.
#[derive(Debug)]
struct Made {
    base: Arc<Grid>,
    painted: Arc<Bricks>,
    grid: LabelGrid,
}

/// The grids made so far, by the id of their set; shared by the copies of one collection of assets.
#[derive(Debug, Clone, Default)]
pub struct LabelGrids(Arc<Mutex<BTreeMap<String, Made>>>);

impl LabelGrids {
    /// The grid of a set. `base` is its source's, or, for a set without a source, a grid of the same place whose
    /// samples mean nothing.
    pub fn grid(&self, set: &LabelSet, base: &Arc<Grid>) -> LabelGrid {
        let mut made = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let before = made.get(&set.id).filter(|m| Arc::ptr_eq(&m.base, base));
        if let Some(m) = before.filter(|m| Arc::ptr_eq(&m.painted, &set.painted)) {
            return m.grid.clone();
        }
        let start = match before {
            Some(m) => (Arc::clone(&m.painted), m.grid.clone()),
            None => (Arc::default(), first(base, set.source.is_some())),
        };
        let grid = repainted(&start, &set.painted, |at| first_brick(base, set.source.is_some(), at));
        let painted = Arc::clone(&set.painted);
        made.insert(set.id.clone(), Made { base: Arc::clone(base), painted, grid: grid.clone() });
        grid
    }
}

/// A set before anybody painted.
fn first(base: &Arc<Grid>, is_labels: bool) -> LabelGrid {
    if is_labels {
        return LabelGrid { grid: Arc::clone(base), counts: Arc::new(counted(base)) };
    }
    let samples = Samples::U8(vec![0; base.samples().len()]);
    LabelGrid { grid: like(base, samples), counts: Arc::default() }
}

/// Samples of each label, from 1. Labels come in runs, so only the ends of runs are entered.
fn counted(grid: &Grid) -> BTreeMap<u32, usize> {
    const CHUNK: usize = 1 << 16;
    let count = grid.samples().len();
    let in_chunk = |chunk: usize| {
        let (mut counts, mut run) = (BTreeMap::new(), (0, 0_usize));
        for i in chunk * CHUNK..count.min((chunk + 1) * CHUNK) {
            let label = label_of(grid.value_at(i));
            if label != run.0 {
                *counts.entry(run.0).or_insert(0) += run.1;
                run = (label, 0);
            }
            run.1 += 1;
        }
        *counts.entry(run.0).or_insert(0) += run.1;
        counts
    };
    let join = |mut a: BTreeMap<u32, usize>, b: BTreeMap<u32, usize>| {
        for (label, count) in b {
            *a.entry(label).or_insert(0) += count;
        }
        a
    };
    let mut all = (0..count.div_ceil(CHUNK)).into_par_iter().map(in_chunk).reduce(BTreeMap::new, join);
    all.retain(|label, count| *label > 0 && *count > 0);
    all
}

/// Other samples in the place of a grid's; its own where they do not make a grid, which is for lack of none.
fn like(base: &Arc<Grid>, samples: Samples) -> Arc<Grid> {
    let made = Grid::new(base.extent(), samples, Rescale::default(), *base.world_from_voxel());
    made.map_or_else(|_| Arc::clone(base), Arc::new)
}

fn first_brick(base: &Grid, is_labels: bool, at: [usize; 3]) -> Brick {
    if is_labels { brick(base, at) } else { Arc::from([0_u16; EDGE * EDGE * EDGE]) }
}

/// The samples of a brick, whatever kind they are of.
fn brick(grid: &Grid, at: [usize; 3]) -> Brick {
    let mut labels = [0_u16; EDGE * EDGE * EDGE];
    each(grid.extent(), at, |local, [x, y, z]| {
        labels[local] = label_of(grid.value(x, y, z)).min(MAX_LABEL) as u16;
    });
    Arc::from(labels)
}

/// Visits the samples of a brick that are in the grid: position in the brick, and in the grid.
fn each(extent: [usize; 3], at: [usize; 3], mut visit: impl FnMut(usize, [usize; 3])) {
    let ends: [usize; 3] =
        std::array::from_fn(|a| extent[a].saturating_sub(at[a].saturating_mul(EDGE)).min(EDGE));
    for k in 0..ends[2] {
        for j in 0..ends[1] {
            for i in 0..ends[0] {
                let place = [at[0] * EDGE + i, at[1] * EDGE + j, at[2] * EDGE + k];
                visit(i + EDGE * (j + EDGE * k), place);
            }
        }
    }
}

/// A grid with other paint: the bricks that differ are written into a copy.
fn repainted(
    (painted, before): &(Arc<Bricks>, LabelGrid),
    wanted: &Arc<Bricks>,
    first: impl Fn([usize; 3]) -> Brick,
) -> LabelGrid {
    let keys = painted.keys().chain(wanted.keys().filter(|k| !painted.contains_key(*k)));
    let changed: Vec<([usize; 3], Brick)> = keys
        .filter(|at| painted.get(*at) != wanted.get(*at))
        .map(|at| (*at, wanted.get(at).cloned().unwrap_or_else(|| first(*at))))
        .collect();
    if changed.is_empty() {
        return before.clone();
    }
    let grid = &before.grid;
    let mut counts = (*before.counts).clone();
    for (at, brick) in &changed {
        each(grid.extent(), *at, |local, [x, y, z]| {
            let (old, new) = (label_of(grid.value(x, y, z)), u32::from(brick[local]));
            if old != new {
                if let Some(count) = counts.get_mut(&old) {
                    *count = count.saturating_sub(1);
                }
                *counts.entry(new).or_insert(0) += 1;
            }
        });
    }
    counts.retain(|label, count| *label > 0 && *count > 0);
    let small = changed.iter().all(|(_, brick)| brick.iter().all(|&label| u8::try_from(label).is_ok()));
    let plain = grid.rescale() == Rescale::default();
    let samples = match grid.samples() {
        Samples::U8(v) if small && plain => {
            let mut v = v.clone();
            write(grid, &changed, |index, label| v[index] = label as u8);
            Samples::U8(v)
        }
        Samples::U16(v) if plain => {
            let mut v = v.clone();
            write(grid, &changed, |index, label| v[index] = label);
            Samples::U16(v)
        }
        _ => {
            let label = |i| label_of(grid.value_at(i)).min(MAX_LABEL) as u16;
            let mut v: Vec<u16> = (0..grid.samples().len()).map(label).collect();
            write(grid, &changed, |index, label| v[index] = label);
            Samples::U16(v)
        }
    };
    LabelGrid { grid: like(grid, samples), counts: Arc::new(counts) }
}

fn write(grid: &Grid, changed: &[([usize; 3], Brick)], mut put: impl FnMut(usize, u16)) {
    for (at, brick) in changed {
        each(grid.extent(), *at, |local, [x, y, z]| put(grid.index(x, y, z), brick[local]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Source;
    use render::volume::Affine;

    fn base() -> Arc<Grid> {
        let samples = (0..20 * 18 * 3).map(|i| u8::from(i % 5 == 0)).collect();
        let grid = Grid::new([20, 18, 3], Samples::U8(samples), Rescale::default(), Affine::identity());
        Arc::new(grid.expect("grid"))
    }

    /// What the counts must be, by a look at every sample.
    fn looked_at(grid: &Grid) -> BTreeMap<u32, usize> {
        let mut counts = BTreeMap::new();
        for i in 0..grid.samples().len() {
            *counts.entry(grid.value_at(i) as u32).or_insert(0) += 1;
        }
        counts.remove(&0);
        counts
    }

    #[test]
    fn paint_covers_the_source_and_comes_off_again() {
        let (base, grids) = (base(), LabelGrids::default());
        let mut set = LabelSet::new("l", "ct", Some(Source::Builtin("x".to_owned())));
        let plain = grids.grid(&set, &base);
        assert!(Arc::ptr_eq(&plain.grid, &base), "nothing painted, nothing copied");
        let mut labels = plain.brick([1, 1, 0]).to_vec();
        // Sample (17, 17, 2) is (1, 1, 2) of the brick.
        labels[1 + EDGE + 2 * EDGE * EDGE] = 7;
        set.painted = Arc::new([([1, 1, 0], Arc::from(labels))].into());
        let painted = grids.grid(&set, &base);
        assert_eq!(painted.grid.value(17, 17, 2), 7.0, "painted");
        let same =
            (0..base.samples().len()).filter(|&i| base.value_at(i) == painted.grid.value_at(i)).count();
        assert_eq!(same, base.samples().len() - 1, "all else as it was");
        assert_eq!(*painted.counts, looked_at(&painted.grid), "counted");
        assert!(Arc::ptr_eq(&painted.grid, &grids.grid(&set, &base).grid), "made once");
        set.painted = Arc::default();
        let back = grids.grid(&set, &base);
        assert_eq!((back.grid.samples(), &*back.counts), (base.samples(), &looked_at(&base)), "undone");
    }

    #[test]
    fn a_set_without_a_source_is_empty_and_large_labels_fit() {
        let (base, grids) = (base(), LabelGrids::default());
        let mut set = LabelSet::new("l", "ct", None);
        assert!(grids.grid(&set, &base).counts.is_empty(), "the volume's own values are no labels");
        set.painted = Arc::new([([0, 0, 0], Arc::from([40_000_u16; EDGE * EDGE * EDGE]))].into());
        let painted = grids.grid(&set, &base);
        assert_eq!(*painted.counts, [(40_000, EDGE * EDGE * 3)].into(), "within the grid only");
        assert_eq!(painted.grid.value(15, 15, 2), 40_000.0, "more than a byte");
        assert_eq!(painted.grid.value(16, 0, 0), 0.0, "the next brick");
    }
}
