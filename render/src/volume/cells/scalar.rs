//! The one scalar of a grid that is drawn, asked for and measured.

use super::{CellGrid, Field, Place, Step};

/// Which scalar of a field is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// One component.
    Component(usize),
    /// The length of the tuple as a vector.
    Magnitude,
}

impl Part {
    /// This of a tuple of a field; both must lie inside.
    pub fn of(self, field: &Field, tuple: usize) -> f64 {
        match self {
            Self::Component(c) => field.value(tuple, c),
            Self::Magnitude => field.magnitude(tuple),
        }
    }
}

/// A scalar of a grid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Scalar {
    /// Whether the field is on points or on cells.
    pub place: Place,
    /// The field's name.
    pub name: String,
    /// What of it.
    pub part: Part,
}

impl Scalar {
    /// The field of a step that it is of; nothing where the step has no such field, or the field no such component.
    pub fn field<'a>(&self, step: &'a Step) -> Option<&'a Field> {
        step.field(self.place, &self.name).filter(|field| match self.part {
            Part::Component(c) => c < field.components(),
            Part::Magnitude => true,
        })
    }

    /// Least and greatest finite value over all steps of a grid; nothing where there is none.
    pub fn range(&self, grid: &CellGrid) -> Option<[f64; 2]> {
        let of = |step: &Step| -> Option<[f64; 2]> {
            let field = self.field(step)?;
            match self.part {
                Part::Component(c) => field.range(c),
                Part::Magnitude => field.length_range(),
            }
        };
        grid.steps().iter().filter_map(of).reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
    }
}

impl CellGrid {
    /// What is shown of the grid before anybody has chosen: the first field of one component of the points of the first step,
    /// or else of its cells; where all are vectors, the length of the first. Nothing of a grid without fields.
    pub fn first_scalar(&self) -> Option<Scalar> {
        let step = self.steps.first()?;
        let of = |place: Place| step.fields(place).iter().map(move |field| (place, field));
        let fields = of(Place::Points).chain(of(Place::Cells));
        let (place, field) = fields.min_by_key(|(_, field)| field.components() != 1)?;
        let part = if field.components() == 1 { Part::Component(0) } else { Part::Magnitude };
        Some(Scalar { place, name: field.name().to_owned(), part })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{CellKind, Values};
    use super::*;
    use crate::volume::Point;

    fn grid(point_fields: Vec<Field>, cell_fields: Vec<Field>) -> CellGrid {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Point::from).to_vec();
        let step = Step { time: 0.0, point_fields, cell_fields };
        CellGrid::new(points, vec![CellKind::Tetra], vec![0, 1, 2, 3], vec![step]).expect("grid")
    }

    #[test]
    fn a_scalar_is_shown_before_a_vector_and_points_before_cells() {
        let vector = || Field::new("u".to_owned(), 3, Values::F32([1.0, -2.0, 2.0].repeat(4)));
        let on_points = || Field::new("p".to_owned(), 1, Values::F32(vec![1.0, 2.0, f32::NAN, 4.0]));
        let on_cells = || Field::new("q".to_owned(), 1, Values::F32(vec![7.0]));
        let first = |a, b| grid(a, b).first_scalar();
        let of = |place, name: &str, part| Some(Scalar { place, name: name.to_owned(), part });
        let component = Part::Component(0);
        let all = first(vec![vector(), on_points()], vec![on_cells()]);
        assert_eq!(all, of(Place::Points, "p", component), "of points");
        assert_eq!(first(vec![vector()], vec![on_cells()]), of(Place::Cells, "q", component), "of cells");
        let length = first(vec![vector()], vec![]);
        assert_eq!(length, of(Place::Points, "u", Part::Magnitude), "the length");
        assert_eq!(first(vec![], vec![]), None, "no field");
        let made = grid(vec![vector(), on_points()], vec![]);
        assert_eq!(length.and_then(|s| s.range(&made)), Some([3.0; 2]), "length of (1, -2, 2)");
        assert_eq!(all.and_then(|s| s.range(&made)), Some([1.0, 4.0]), "what is not finite is left out");
        let second = Scalar { place: Place::Points, name: "p".to_owned(), part: Part::Component(1) };
        assert_eq!((second.field(&made.steps()[0]), second.range(&made)), (None, None), "no such component");
    }
}
