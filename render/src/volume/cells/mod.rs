//! Unstructured grids: finite elements, flow. Cells between points, and fields over time on both.
//!
//! A [`CellGrid`] holds the geometry once and a list of [`Step`]s, each a moment with its [`Field`]s;
//! a grid without time has one step at 0. Corners are in VTK's order, which Exodus II shares for
//! linear cells. Whoever builds one has dropped or converted every other kind of cell before.
//!
//! Source: VTK User's Guide, 11th ed., "VTK file formats", figure 2 (linear cell types).

mod field;
mod scalar;

pub use field::{Field, Values};
pub use scalar::{Part, Scalar};

use thiserror::Error;

use super::Point;

/// Shape of one cell; corners in VTK's order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CellKind {
    /// Four corners; the fourth on the side that the first three's right-hand normal points to.
    Tetra,
    /// A quadrilateral base of four, then the apex.
    Pyramid,
    /// Two triangles of three, corner above corner.
    Wedge,
    /// Two quadrilaterals of four, corner above corner.
    Hexahedron,
}

impl CellKind {
    /// Every kind, fewest corners first.
    pub const ALL: [Self; 4] = [Self::Tetra, Self::Pyramid, Self::Wedge, Self::Hexahedron];

    /// How many corners it has.
    pub fn corners(self) -> usize {
        match self {
            Self::Tetra => 4,
            Self::Pyramid => 5,
            Self::Wedge => 6,
            Self::Hexahedron => 8,
        }
    }

    /// Its short name: `"tetra"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tetra => "tetra",
            Self::Pyramid => "pyramid",
            Self::Wedge => "wedge",
            Self::Hexahedron => "hexahedron",
        }
    }
}

/// Where a field's values sit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// One value, or one tuple, a point: varies within a cell.
    Points,
    /// One a cell: constant within it.
    Cells,
}

/// The fields at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// When; seconds where the file says no other unit, finite.
    pub time: f64,
    /// Fields with a tuple for each point.
    pub point_fields: Vec<Field>,
    /// Fields with a tuple for each cell.
    pub cell_fields: Vec<Field>,
}

impl Step {
    /// The fields that sit at `place`.
    pub fn fields(&self, place: Place) -> &[Field] {
        match place {
            Place::Points => &self.point_fields,
            Place::Cells => &self.cell_fields,
        }
    }

    /// The field of that name.
    pub fn field(&self, place: Place, name: &str) -> Option<&Field> {
        self.fields(place).iter().find(|field| field.name() == name)
    }
}

/// Why parts do not make a grid of cells.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CellGridError {
    /// There is no cell.
    #[error("the grid has no cell with a volume")]
    Empty,
    /// More points or corners than 32-bit indices reach.
    #[error("the grid has {count} points or corners, more than 32-bit indices reach")]
    TooMany {
        /// How many.
        count: usize,
    },
    /// A point has a coordinate that is not finite.
    #[error("point {point} has a coordinate that is not finite, or beyond {FARTHEST_MM:e} mm")]
    NotFinite {
        /// Position of the point.
        point: usize,
    },
    /// The corners are not as many as the kinds need.
    #[error("the cells need {needed} corners, but there are {found}")]
    Corners {
        /// Sum of [`CellKind::corners`].
        needed: usize,
        /// Corners given.
        found: usize,
    },
    /// A cell names a point that is not there.
    #[error("cell {cell} names point {point}, but there are only {count}")]
    Index {
        /// Position of the cell.
        cell: usize,
        /// The point it names.
        point: u32,
        /// How many there are.
        count: usize,
    },
    /// There is no step; a grid without fields has one empty step.
    #[error("the grid has no time step")]
    NoStep,
    /// Times are not finite, or do not increase.
    #[error("the time of step {step} is not after the one before it")]
    Time {
        /// Position of the step.
        step: usize,
    },
    /// A field has too few or too many values, or no component.
    #[error("field \"{name}\" of step {step} has {found} values, but needs {needed}")]
    FieldCount {
        /// The field.
        name: String,
        /// Position of the step.
        step: usize,
        /// Values given.
        found: usize,
        /// Components times points or cells.
        needed: u128,
    },
}

/// Coordinates beyond this are not a place; mm. Volumes of cells must stay finite.
pub const FARTHEST_MM: f64 = 1e30;

/// Cells between points, with fields over time; millimetres in the grid's own frame.
#[derive(Debug, Clone, PartialEq)]
pub struct CellGrid {
    points: Vec<Point>,
    kinds: Vec<CellKind>,
    starts: Vec<u32>,
    corners: Vec<u32>,
    steps: Vec<Step>,
    bounds: [Point; 2],
}

impl CellGrid {
    /// A grid of cells of `kinds`, whose corners (positions in `points`) stand one cell after the other
    /// in `corners`, with at least one step; times increase.
    ///
    /// # Errors
    /// [`CellGridError`] for what its variants name.
    pub fn new(
        points: Vec<Point>,
        kinds: Vec<CellKind>,
        corners: Vec<u32>,
        steps: Vec<Step>,
    ) -> Result<Self, CellGridError> {
        if kinds.is_empty() {
            return Err(CellGridError::Empty);
        }
        let largest = points.len().max(corners.len()).max(kinds.len());
        if u32::try_from(largest).is_err() {
            return Err(CellGridError::TooMany { count: largest });
        }
        if let Some(point) = points.iter().position(|p| p.iter().any(|c| c.is_nan() || c.abs() > FARTHEST_MM))
        {
            return Err(CellGridError::NotFinite { point });
        }
        let needed = kinds.iter().map(|kind| kind.corners()).sum();
        if needed != corners.len() {
            return Err(CellGridError::Corners { needed, found: corners.len() });
        }
        let mut starts = Vec::with_capacity(kinds.len() + 1);
        starts.push(0_u32);
        let mut end = 0;
        for kind in &kinds {
            end += kind.corners() as u32;
            starts.push(end);
        }
        let count = points.len();
        if let Some(at) = corners.iter().position(|&point| point as usize >= count) {
            let cell = starts.partition_point(|&start| start as usize <= at) - 1;
            return Err(CellGridError::Index { cell, point: corners[at], count });
        }
        check_steps(&steps, points.len(), kinds.len())?;
        let (mut low, mut high) = (Point::from([f64::INFINITY; 3]), Point::from([f64::NEG_INFINITY; 3]));
        for p in &points {
            (low, high) = (low.inf(p), high.sup(p));
        }
        Ok(Self { points, kinds, starts, corners, steps, bounds: [low, high] })
    }

    /// The points.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// The shape of each cell.
    pub fn kinds(&self) -> &[CellKind] {
        &self.kinds
    }

    /// How many cells there are; never 0.
    pub fn len(&self) -> usize {
        self.kinds.len()
    }

    /// Never: a grid has at least one cell.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// How many cells have that shape.
    pub fn count(&self, kind: CellKind) -> usize {
        self.kinds.iter().filter(|&&k| k == kind).count()
    }

    /// Shape and corners (positions in [`CellGrid::points`]) of one cell. The index must lie inside.
    pub fn cell(&self, index: usize) -> (CellKind, &[u32]) {
        let range = self.starts[index] as usize..self.starts[index + 1] as usize;
        (self.kinds[index], &self.corners[range])
    }

    /// The moments, earliest first; never empty.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Least and greatest coordinates of the points; mm.
    pub fn bounds(&self) -> [Point; 2] {
        self.bounds
    }

    /// Least and greatest finite value of one component of a field over all steps; nothing where no
    /// step has such a field with a finite value.
    pub fn range(&self, place: Place, name: &str, component: usize) -> Option<[f64; 2]> {
        let fields = self.steps.iter().filter_map(|step| step.field(place, name));
        fields.filter_map(|field| field.range(component)).reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
    }

    /// The same grid with other steps, for a file that tells them later than its cells.
    ///
    /// # Errors
    /// [`CellGridError::NoStep`], [`CellGridError::Time`] and [`CellGridError::FieldCount`].
    pub fn with_steps(mut self, steps: Vec<Step>) -> Result<Self, CellGridError> {
        check_steps(&steps, self.points.len(), self.kinds.len())?;
        self.steps = steps;
        Ok(self)
    }
}

fn check_steps(steps: &[Step], points: usize, cells: usize) -> Result<(), CellGridError> {
    if steps.is_empty() {
        return Err(CellGridError::NoStep);
    }
    let mut before = f64::NEG_INFINITY;
    for (position, step) in steps.iter().enumerate() {
        if !step.time.is_finite() || step.time <= before {
            return Err(CellGridError::Time { step: position });
        }
        before = step.time;
        let on_points = step.point_fields.iter().map(|field| (field, points));
        let on_cells = step.cell_fields.iter().map(|field| (field, cells));
        for (field, tuples) in on_points.chain(on_cells) {
            let needed = field.components() as u128 * tuples as u128;
            if field.components() == 0 || needed != field.values().len() as u128 {
                return Err(CellGridError::FieldCount {
                    name: field.name().to_owned(),
                    step: position,
                    found: field.values().len(),
                    needed,
                });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit tetrahedron and a pyramid that shares its base's corners.
    fn parts() -> (Vec<Point>, Vec<CellKind>, Vec<u32>) {
        let points = vec![
            Point::new(0.0, 0.0, 0.0),
            Point::new(1.0, 0.0, 0.0),
            Point::new(1.0, 1.0, 0.0),
            Point::new(0.0, 1.0, 0.0),
            Point::new(0.5, 0.5, 2.0),
            Point::new(0.0, 0.0, -3.0),
        ];
        let kinds = vec![CellKind::Tetra, CellKind::Pyramid];
        (points, kinds, vec![0, 1, 3, 5, 0, 1, 2, 3, 4])
    }

    fn step(time: f64, name: &str, values: Vec<f32>) -> Step {
        let field = Field::new(name.to_owned(), 1, Values::F32(values));
        Step { time, point_fields: vec![field], cell_fields: Vec::new() }
    }

    #[test]
    fn cells_of_several_kinds_keep_their_own_corners() {
        let (points, kinds, corners) = parts();
        let grid = CellGrid::new(points, kinds, corners, vec![step(0.0, "p", vec![1.0; 6])]).expect("grid");
        assert_eq!(grid.cell(0), (CellKind::Tetra, &[0, 1, 3, 5][..]), "tetra");
        assert_eq!(grid.cell(1), (CellKind::Pyramid, &[0, 1, 2, 3, 4][..]), "pyramid");
        assert_eq!(
            (grid.len(), grid.count(CellKind::Tetra), grid.count(CellKind::Wedge)),
            (2, 1, 0),
            "counts"
        );
        let bounds = [Point::new(0.0, 0.0, -3.0), Point::new(1.0, 1.0, 2.0)];
        assert_eq!(grid.bounds(), bounds, "bounds");
    }

    #[test]
    fn ranges_run_over_all_steps_and_skip_what_is_not_finite() {
        let (points, kinds, corners) = parts();
        let first = step(0.5, "p", vec![1.0, 2.0, f32::NAN, 4.0, 5.0, 6.0]);
        let second = step(0.75, "p", vec![-1.0; 6]);
        let grid = CellGrid::new(points, kinds, corners, vec![first, second]).expect("grid");
        assert_eq!(grid.range(Place::Points, "p", 0), Some([-1.0, 6.0]), "both steps");
        assert_eq!(grid.range(Place::Points, "p", 1), None, "no second component");
        assert_eq!(grid.range(Place::Cells, "p", 0), None, "not on cells");
        assert_eq!(grid.steps()[0].point_fields[0].non_finite(), 1, "NaN counted");
    }

    #[test]
    fn contradictions_are_refused_by_name() {
        let (points, kinds, corners) = parts();
        let steps = vec![step(0.0, "p", vec![0.0; 6])];
        let make = |points: &[Point], kinds: &[CellKind], corners: &[u32], steps: &[Step]| {
            CellGrid::new(points.to_vec(), kinds.to_vec(), corners.to_vec(), steps.to_vec()).err()
        };
        assert_eq!(make(&points, &[], &[], &steps), Some(CellGridError::Empty), "no cell");
        let wrong = Some(CellGridError::Corners { needed: 9, found: 8 });
        assert_eq!(make(&points, &kinds, &corners[1..], &steps), wrong, "corners missing");
        let mut far = corners.clone();
        far[4] = 6;
        let wrong = Some(CellGridError::Index { cell: 1, point: 6, count: 6 });
        assert_eq!(make(&points, &kinds, &far, &steps), wrong, "first corner of the second cell");
        let mut nan = points.clone();
        nan[2].y = f64::NAN;
        assert_eq!(make(&nan, &kinds, &corners, &steps), Some(CellGridError::NotFinite { point: 2 }), "NaN");
        assert_eq!(make(&points, &kinds, &corners, &[]), Some(CellGridError::NoStep), "no step");
        let twice = [steps[0].clone(), steps[0].clone()];
        let wrong = Some(CellGridError::Time { step: 1 });
        assert_eq!(make(&points, &kinds, &corners, &twice), wrong, "time stands still");
        let short = [step(0.0, "p", vec![0.0; 5])];
        let wrong = Some(CellGridError::FieldCount { name: "p".to_owned(), step: 0, found: 5, needed: 6 });
        assert_eq!(make(&points, &kinds, &corners, &short), wrong, "field short");
        let none = Field::new("v".to_owned(), 0, Values::F64(Vec::new()));
        let none = [Step { time: 0.0, point_fields: Vec::new(), cell_fields: vec![none] }];
        let wrong = Some(CellGridError::FieldCount { name: "v".to_owned(), step: 0, found: 0, needed: 0 });
        assert_eq!(make(&points, &kinds, &corners, &none), wrong, "no component");
    }
}
