//! Unstructured grids of the case: results of a simulation, with the scalar that is shown of them.

use std::sync::Arc;

use render::volume::cells::{Part, Place, Scalar};
use render::volume::{Affine, CellGrid, Transfer};

use super::edit::{fragment_mut, new_id, positive, rigid};
use super::{Case, EditError, Other, Source};

/// What is out of its range, if it is.
const SCALE: &str = "a grid's scale";

/// A grid of finite elements or of flow, placed in the case.
#[derive(Debug, Clone, PartialEq)]
pub struct UnstructuredGrid {
    /// Unique among the grids, not empty.
    pub id: String,
    /// Its data.
    pub source: Source,
    /// Which of the source's grids, from 0.
    pub item: usize,
    /// The step shown, from 0. One past the end shows the last.
    pub step: usize,
    /// `world_from_grid`, rigid, after `scale`; where it rides on a fragment, about the fragment in its unmoved place.
    pub pose: Affine,
    /// Millimetres per unit of the grid, > 0: 1000 for one in metres.
    pub scale: f64,
    /// The id of the fragment that it rides on.
    pub fragment: Option<String>,
    /// Whether it is drawn.
    pub visible: bool,
    /// The scalar shown; none shows the first that the data have.
    pub field: Option<FieldChoice>,
    /// What the scalar is measured in: `MPa`; may be empty.
    pub unit: String,
    /// Colour and opacity; none shows the default over the scalar's range.
    pub transfer: Option<Arc<Transfer>>,
    /// Unknown keys beside the transfer function's.
    pub transfer_other: Other,
    /// Unknown keys.
    pub other: Other,
}

impl UnstructuredGrid {
    /// A visible grid where its file has it, with its first scalar in default colours.
    pub fn new(id: impl Into<String>, source: Source) -> Self {
        Self {
            id: id.into(),
            source,
            item: 0,
            step: 0,
            pose: Affine::identity(),
            scale: 1.0,
            fragment: None,
            visible: true,
            field: None,
            unit: String::new(),
            transfer: None,
            transfer_other: Other::new(),
            other: Other::new(),
        }
    }
}

/// Which scalar of a grid is shown, as people say it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldChoice {
    /// The field's name.
    pub name: String,
    /// Where it is; none takes that of the points, or else that of the cells.
    pub place: Option<Place>,
    /// What of it; none takes its only component, or the length of a vector.
    pub part: Option<Part>,
}

impl From<Scalar> for FieldChoice {
    fn from(scalar: Scalar) -> Self {
        Self { name: scalar.name, place: Some(scalar.place), part: Some(scalar.part) }
    }
}

impl FieldChoice {
    /// The scalar of a grid that this means; nothing where the first step has none such.
    pub fn of(&self, grid: &CellGrid) -> Option<Scalar> {
        let step = grid.steps().first()?;
        let mut places =
            [Place::Points, Place::Cells].into_iter().filter(|p| self.place.is_none_or(|own| own == *p));
        let (place, field) = places.find_map(|p| Some((p, step.field(p, &self.name)?)))?;
        let whole = if field.components() == 1 { Part::Component(0) } else { Part::Magnitude };
        let scalar = Scalar { place, name: self.name.clone(), part: self.part.unwrap_or(whole) };
        scalar.field(step).is_some().then_some(scalar)
    }
}

/// A change to a grid.
#[derive(Debug, Clone, PartialEq)]
pub enum GridChange {
    /// Takes the grid away.
    Remove,
    /// Another id.
    Rename(String),
    /// Moves it; rigid.
    Pose(Box<Affine>),
    /// Millimetres per unit; > 0.
    Scale(f64),
    /// The fragment that it rides on, by id.
    Fragment(Option<String>),
    /// Whether it is drawn.
    Visible(bool),
    /// Another scalar, with the default colours over its range, and without a unit where it is of another field.
    Field(Option<FieldChoice>),
    /// What the scalar is measured in.
    Unit(String),
    /// Colours and opacities.
    Transfer(Option<Arc<Transfer>>),
    /// The step shown. Not undone: see [`super::History`].
    Step(usize),
}

impl GridChange {
    /// Whether this and an earlier change of the same grid are steps of one drag.
    pub(super) fn continues(&self, earlier: &Self) -> bool {
        let drags = matches!(self, Self::Pose(_) | Self::Scale(_) | Self::Unit(_) | Self::Transfer(_));
        drags && std::mem::discriminant(self) == std::mem::discriminant(earlier)
    }
}

/// Changes the grid of that id, or leaves all as it was.
pub(super) fn apply(case: &mut Case, id: &str, change: GridChange) -> Result<(), EditError> {
    let missing = || EditError::Missing { kind: "grid", id: id.to_owned() };
    let index = case.grids.iter().position(|g| g.id == id).ok_or_else(missing)?;
    match change {
        GridChange::Remove => {
            case.grids.remove(index);
        }
        GridChange::Rename(to) => {
            new_id("grid", &to, id != to && case.grid(&to).is_some())?;
            case.grids[index].id = to;
        }
        GridChange::Fragment(fragment) => {
            if let Some(fragment) = &fragment {
                fragment_mut(case, fragment)?;
            }
            case.grids[index].fragment = fragment;
        }
        GridChange::Pose(pose) => case.grids[index].pose = rigid(id, *pose)?,
        GridChange::Scale(scale) => case.grids[index].scale = positive(scale, SCALE)?,
        GridChange::Visible(visible) => case.grids[index].visible = visible,
        GridChange::Field(field) => {
            let grid = &mut case.grids[index];
            let name = |choice: &Option<FieldChoice>| choice.as_ref().map(|f| f.name.clone());
            if name(&field) != name(&grid.field) {
                grid.unit.clear();
            }
            (grid.field, grid.transfer) = (field, None);
        }
        GridChange::Unit(unit) => case.grids[index].unit = unit,
        GridChange::Transfer(transfer) => case.grids[index].transfer = transfer,
        GridChange::Step(step) => case.grids[index].step = step,
    }
    Ok(())
}

/// Adds a grid at the end of the list, or leaves all as it was.
pub(super) fn add(case: &mut Case, grid: UnstructuredGrid) -> Result<(), EditError> {
    new_id("grid", &grid.id, case.grid(&grid.id).is_some())?;
    if let Some(fragment) = &grid.fragment {
        fragment_mut(case, fragment)?;
    }
    rigid(&grid.id, grid.pose)?;
    positive(grid.scale, SCALE)?;
    case.grids.push(grid);
    Ok(())
}

/// Grids whose fragment is gone ride on none: they stand where their own pose puts them.
pub(super) fn let_go(case: &mut Case) {
    let Case { grids, fragments, .. } = case;
    for grid in grids {
        grid.fragment = grid.fragment.take().filter(|id| fragments.iter().any(|f| f.id == *id));
    }
}

/// Grids that ride on a fragment ride on another.
pub(super) fn follow(case: &mut Case, from: &str, to: &str) {
    for grid in case.grids.iter_mut().filter(|g| g.fragment.as_deref() == Some(from)) {
        grid.fragment = Some(to.to_owned());
    }
}
