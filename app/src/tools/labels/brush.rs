//! The brush: a ball of paint, drawn along the way of the pointer, in the place where the piece under it came from.

use std::collections::BTreeSet;
use std::sync::Arc;

use render::scene::Piece;
use render::volume::{Affine, Body, Point};

use crate::case::label_grid::LabelGrid;
use crate::case::labels::{Bricks, EDGE};

/// A stroke, from press to release. It paints the piece that it began on, wherever it goes.
#[derive(Debug, Clone)]
pub(super) struct Stroke {
    /// Of the piece: `unmoved_from_world`.
    unmoved_from_world: Affine,
    /// Whether the piece is inside of each.
    bodies: Vec<(Body, bool)>,
    /// `world_from_patient` of the volume.
    pose: Affine,
    at: Point,
    /// All bricks that it changed so far: the case follows a frame later.
    changed: Bricks,
}

impl Stroke {
    /// A stroke that begins at a world place on a piece of the volume with this pose.
    pub(super) fn new(piece: &Piece, pose: Affine, at: Point) -> Self {
        let bodies = piece.keep.iter().map(|(cutter, side)| cutter.solid(*side)).collect();
        Self { unmoved_from_world: piece.pose.inverse(), bodies, pose, at, changed: Bricks::new() }
    }

    /// Paints from where it is to a world place: the bricks that this changed.
    ///
    /// Labels are painted whose centre is within `radius_mm` of a point of the way, or nearest to it, and in the
    /// piece; 0 erases.
    pub(super) fn to(&mut self, labels: &LabelGrid, place: Point, radius_mm: f64, label: u16) -> Bricks {
        let along = place - self.at;
        let steps = (along.norm() / (0.5 * radius_mm).max(0.05)).ceil().clamp(1.0, 2000.0) as usize;
        let mut touched = BTreeSet::new();
        for step in 1..=steps {
            let p = self.at + along * (step as f64 / steps as f64);
            self.dab(labels, &p, radius_mm, label, &mut touched);
        }
        self.at = place;
        let brick = |at: [usize; 3]| Some((at, Arc::clone(self.changed.get(&at)?)));
        touched.into_iter().filter_map(brick).collect()
    }

    fn dab(
        &mut self,
        labels: &LabelGrid,
        p: &Point,
        radius_mm: f64,
        label: u16,
        touched: &mut BTreeSet<[usize; 3]>,
    ) {
        let grid = &labels.grid;
        let unmoved_from_voxel = self.pose * *grid.world_from_voxel();
        let voxel_from_unmoved = unmoved_from_voxel.inverse();
        let centre = self.unmoved_from_world.point(p);
        let in_voxels = voxel_from_unmoved.point(&centre);
        let rows = voxel_from_unmoved.linear();
        // How far the ball reaches along each voxel axis; at least to the nearest sample.
        let ranges: [std::ops::Range<usize>; 3] = std::array::from_fn(|axis| {
            let (c, reach) = (in_voxels[axis], (radius_mm * rows.row(axis).norm()).max(0.5));
            let low = (c - reach).ceil().max(0.0) as usize;
            let end = (c + reach).floor() + 1.0;
            low..end.clamp(0.0, grid.extent()[axis] as f64) as usize
        });
        let nearest = in_voxels.map(f64::round);
        for z in ranges[2].clone() {
            for y in ranges[1].clone() {
                for x in ranges[0].clone() {
                    let sample = Point::new(x as f64, y as f64, z as f64);
                    let there = unmoved_from_voxel.point(&sample);
                    let in_ball = (there - centre).norm() <= radius_mm || sample == nearest;
                    if in_ball && self.bodies.iter().all(|(body, inside)| body.holds(&there) == *inside) {
                        self.put(labels, [x, y, z], label, touched);
                    }
                }
            }
        }
    }

    fn put(&mut self, labels: &LabelGrid, at: [usize; 3], label: u16, touched: &mut BTreeSet<[usize; 3]>) {
        let place = at.map(|i| i / EDGE);
        let [i, j, k] = at.map(|i| i % EDGE);
        let local = i + EDGE * (j + EDGE * k);
        let brick = self.changed.entry(place).or_insert_with(|| labels.brick(place));
        if brick[local] != label {
            // A copy where the case has this brick already, the first time only.
            Arc::make_mut(brick)[local] = label;
            touched.insert(place);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::case::label_grid::LabelGrids;
    use crate::case::{Case, Edit, LabelSet, Source, Volume, edit, labels::LabelChange};
    use crate::presets;
    use render::volume::{Cutter, Grid, Rescale, Samples, Side, Vector};

    const N: usize = 40;

    fn empty() -> LabelGrid {
        let grid = Grid::new([N; 3], Samples::U8(vec![0; N * N * N]), Rescale::default(), Affine::identity());
        LabelGrid { grid: Arc::new(grid.expect("grid")), counts: Arc::new(BTreeMap::new()) }
    }

    /// Samples with a label, by the bricks.
    fn painted(bricks: &Bricks) -> Vec<Point> {
        let mut places = Vec::new();
        for (at, brick) in bricks {
            for (i, _) in brick.iter().enumerate().filter(|(_, label)| **label > 0) {
                let local = [i % EDGE, i / EDGE % EDGE, i / (EDGE * EDGE)];
                places.push(Point::from(std::array::from_fn::<f64, 3, _>(|a| {
                    (at[a] * EDGE + local[a]) as f64
                })));
            }
        }
        places
    }

    #[test]
    fn a_dab_is_a_ball_and_a_stroke_a_rod_with_round_ends() {
        let from = Point::new(12.0, 20.0, 20.0);
        let mut stroke = Stroke::new(&Piece::whole(), Affine::identity(), from);
        let first = stroke.to(&empty(), from, 6.0, 3);
        for z in 0..N {
            for y in 0..N {
                for x in 0..N {
                    let p = Point::new(x as f64, y as f64, z as f64);
                    let inside = (p - from).norm() <= 6.0;
                    assert_eq!(painted_at(&first, [x, y, z]) == 3, inside, "{p}");
                }
            }
        }
        let to = Point::new(28.0, 20.0, 20.0);
        let rod = painted(&stroke.to(&empty(), to, 6.0, 3)).len() as f64;
        let known = std::f64::consts::PI * 36.0 * (16.0 + 4.0 / 3.0 * 6.0);
        assert!((rod - known).abs() < 0.06 * known, "{rod} samples, {known} mm³");
        let mut erased = stroke.to(&empty(), to, 9.0, 0);
        erased.extend(stroke.to(&empty(), from, 9.0, 0));
        assert!(painted(&erased).is_empty(), "a wider rubber leaves nothing of it");
    }

    fn painted_at(bricks: &Bricks, at: [usize; 3]) -> u16 {
        let local = at.map(|i| i % EDGE);
        bricks.get(&at.map(|i| i / EDGE)).map_or(0, |b| b[local[0] + EDGE * (local[1] + EDGE * local[2])])
    }

    #[test]
    fn a_moved_piece_is_painted_where_it_came_from_and_its_neighbour_is_not() {
        let cutter = Cutter::plane(Point::new(20.0, 0.0, 0.0), Vector::x()).expect("plane");
        let away = Affine::rotation_about(Point::new(5.0, 5.0, 5.0), Vector::z(), 1.1);
        let piece = Piece { keep: vec![(cutter, Side::Plus)], pose: away };
        let centre = Point::new(21.0, 20.0, 20.0);
        let at = away.point(&centre);
        let bricks = Stroke::new(&piece, Affine::identity(), at).to(&empty(), at, 5.0, 1);
        let places = painted(&bricks);
        assert!(places.iter().all(|p| p.x >= 20.0 && (p - centre).norm() < 5.0 + 1e-9), "its own side only");
        assert!(places.len() > 200, "but all of that: {}", places.len());
    }

    #[test]
    fn a_brush_finer_than_the_labels_paints_the_nearest() {
        let at = Point::new(3.3, 4.4, 5.4);
        let bricks = Stroke::new(&Piece::whole(), Affine::identity(), at).to(&empty(), at, 0.05, 1);
        assert_eq!(painted(&bricks), [Point::new(3.0, 4.0, 5.0)], "one sample");
    }

    #[test]
    fn bricks_that_a_stroke_gave_away_do_not_change_as_it_goes_on() {
        let at = Point::new(4.0, 4.0, 4.0);
        let mut stroke = Stroke::new(&Piece::whole(), Affine::identity(), at);
        let first = stroke.to(&empty(), at, 2.0, 1);
        let before = painted(&first).len();
        let second = stroke.to(&empty(), Point::new(10.0, 10.0, 10.0), 2.0, 1);
        assert_eq!(painted(&first).len(), before, "the case keeps it for undo");
        assert!(painted(&second).len() > before, "the same brick goes on");
        assert!(
            stroke.to(&empty(), Point::new(10.0, 10.0, 10.0), 2.0, 1).is_empty(),
            "nothing more to paint"
        );
    }

    #[test]
    fn undo_holds_the_touched_bricks_only() {
        let mut case = Case::default();
        let transfer = Arc::new(presets::default_for(Some("CT"), [0.0, 1.0]));
        case.volumes.push(Volume::new("ct", Source::Builtin("hip/ct".to_owned()), transfer));
        case.labels.push(LabelSet::new("l", "ct", None));
        let paint = |case: &mut Case, at: Point, labels: &LabelGrid| {
            let bricks = Stroke::new(&Piece::whole(), Affine::identity(), at).to(labels, at, 3.0, 1);
            let change = LabelChange::Paint(bricks);
            edit::apply(case, Edit::ChangeLabels { id: "l".to_owned(), change }).expect("painted");
        };
        let (grids, base) = (LabelGrids::default(), empty().grid);
        let labels = grids.grid(&case.labels[0], &base);
        paint(&mut case, Point::new(8.0, 8.0, 8.0), &labels);
        let before = case.clone();
        let labels = grids.grid(&case.labels[0], &base);
        paint(&mut case, Point::new(24.0, 8.0, 8.0), &labels);
        assert_ne!(before, case, "a change");
        let (old, new) = (&before.labels[0].painted, &case.labels[0].painted);
        assert_eq!((old.len(), new.len()), (1, 2), "one brick more");
        assert!(Arc::ptr_eq(&old[&[0, 0, 0]], &new[&[0, 0, 0]]), "the other is shared");
    }
}
