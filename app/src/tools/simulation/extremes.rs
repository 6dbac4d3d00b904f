//! Where a scalar of a grid is least and greatest, and between which values most of it lies.

use render::volume::cells::{Place, Scalar};
use render::volume::{CellGrid, Point};

/// Values looked at for the bulk of them.
const SAMPLES: usize = 30_000;

/// Least and greatest finite value of the cells, each with where it is first: a corner, or the middle of a cell; in the
/// grid's own coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extremes {
    pub(super) least: (f64, Point),
    pub(super) greatest: (f64, Point),
}

impl Extremes {
    /// Those of a step; nothing where it has no such scalar, or no number.
    pub(super) fn of(cells: &CellGrid, step: usize, scalar: &Scalar) -> Option<Self> {
        let field = scalar.field(cells.steps().get(step)?)?;
        let value = |n: usize| scalar.part.of(field, n);
        let mut ends: Option<[(f64, usize); 2]> = None;
        let mut take = |n: usize| {
            let value = value(n);
            if value.is_finite() {
                let [least, greatest] = ends.get_or_insert([(value, n); 2]);
                if value < least.0 {
                    *least = (value, n);
                }
                if value > greatest.0 {
                    *greatest = (value, n);
                }
            }
        };
        match scalar.place {
            // Points that no cell has are nowhere to be seen.
            Place::Points => (0..cells.len()).flat_map(|c| cells.cell(c).1).for_each(|&n| take(n as usize)),
            Place::Cells => (0..cells.len()).for_each(take),
        }
        let place = |n: usize| match scalar.place {
            Place::Points => cells.points()[n],
            Place::Cells => middle(cells, n),
        };
        let [least, greatest] = ends?.map(|(value, n)| (value, place(n)));
        Some(Self { least, greatest })
    }
}

/// The mean of a cell's corners.
fn middle(cells: &CellGrid, cell: usize) -> Point {
    let corners = cells.cell(cell).1;
    let sum = corners.iter().fold(Point::origin(), |sum, &n| sum + cells.points()[n as usize].coords);
    sum / corners.len() as f64
}

/// From the 1st to the 99th percentile of the finite values of a step, of about 30 000 of them.
pub(super) fn bulk(cells: &CellGrid, step: usize, scalar: &Scalar) -> Option<[f64; 2]> {
    let field = scalar.field(cells.steps().get(step)?)?;
    let count = field.values().len() / field.components();
    let every = (count / SAMPLES).max(1);
    let all = (0..count).step_by(every).map(|n| scalar.part.of(field, n));
    let mut values: Vec<f64> = all.filter(|v| v.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some([0.01, 0.99].map(|part| values[(part * last as f64).round() as usize]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::volume::cells::{CellKind, Field, Part, Step, Values};

    fn grid(values: Vec<f64>, of_cells: Vec<f64>) -> CellGrid {
        // The last point belongs to no cell.
        let places = [[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0], [4.0; 3], [9.0; 3]];
        let field = |values| vec![Field::new("s".to_owned(), 1, Values::F64(values))];
        let step = Step { time: 0.0, point_fields: field(values), cell_fields: field(of_cells) };
        let corners = vec![0, 1, 2, 3, 1, 2, 3, 4];
        let points = places.map(Point::from).to_vec();
        CellGrid::new(points, vec![CellKind::Tetra; 2], corners, vec![step]).expect("a grid")
    }

    fn scalar(place: Place) -> Scalar {
        Scalar { place, name: "s".to_owned(), part: Part::Component(0) }
    }

    #[test]
    fn the_ends_are_where_cells_are_and_numbers() {
        let grid = grid(vec![2.0, f64::INFINITY, -3.0, 7.0, 7.0, 100.0], vec![5.0, 1.0]);
        let of_points = Extremes::of(&grid, 0, &scalar(Place::Points)).expect("numbers");
        assert_eq!(of_points.least, (-3.0, Point::new(0.0, 4.0, 0.0)), "a corner");
        assert_eq!(
            of_points.greatest,
            (7.0, Point::new(0.0, 0.0, 4.0)),
            "the first of two, not the point without a cell"
        );
        let of_cells = Extremes::of(&grid, 0, &scalar(Place::Cells)).expect("numbers");
        assert_eq!(of_cells.greatest, (5.0, Point::new(1.0, 1.0, 1.0)), "the middle of a cell");
        assert_eq!(Extremes::of(&grid, 1, &scalar(Place::Cells)), None, "no such step");
    }

    #[test]
    fn the_bulk_leaves_outliers_out() {
        let step = |values: Vec<f64>| {
            let count = values.len();
            let field = Field::new("s".to_owned(), 1, Values::F64(values));
            let step = Step { time: 0.0, point_fields: vec![field], cell_fields: vec![] };
            let points = (0..count).map(|i| Point::new(i as f64, (i * i) as f64, (i % 3) as f64)).collect();
            CellGrid::new(points, vec![CellKind::Tetra], vec![0, 1, 2, 3], vec![step]).expect("a grid")
        };
        let mut values: Vec<f64> = (0..1001).map(f64::from).collect();
        (values[0], values[1000]) = (-1e9, f64::NAN);
        assert_eq!(bulk(&step(values), 0, &scalar(Place::Points)), Some([10.0, 989.0]), "not the outliers");
        assert_eq!(bulk(&step(vec![f64::NAN; 4]), 0, &scalar(Place::Points)), None, "no number");
    }
}
