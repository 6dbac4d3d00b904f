//! Points, cells of any of VTK's types and arrays, and what becomes of them.

use render::volume::Point;
use render::volume::cells::{CellGrid, CellKind, Field, Step, Values};

use super::super::bytes::{Fault, afford};
use super::super::surface::{Frame, Surface, Unit, grid_item, tell_left_out};
use super::super::{Item, Limits, Note, Severity};
use super::FORMAT;

/// A named array.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Array {
    pub(super) name: String,
    pub(super) components: usize,
    pub(super) values: Values,
}

/// A data set as its file gives it, in LPS.
#[derive(Debug)]
pub(super) struct Dataset {
    pub(super) points: Vec<Point>,
    /// `vtkCellType` of each cell.
    pub(super) types: Vec<u8>,
    /// End of each cell's corners in `connectivity`.
    pub(super) ends: Vec<usize>,
    pub(super) connectivity: Vec<u32>,
    pub(super) point_arrays: Vec<Array>,
    pub(super) cell_arrays: Vec<Array>,
    pub(super) notes: Vec<Note>,
}

impl Dataset {
    /// One without anything.
    pub(super) fn empty() -> Self {
        Self {
            points: Vec::new(),
            types: Vec::new(),
            ends: Vec::new(),
            connectivity: Vec::new(),
            point_arrays: Vec::new(),
            cell_arrays: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// Adds cells, whose corners are told by where they end.
    ///
    /// # Errors
    /// [`Fault::Broken`] for ends that go back or reach too far, and for corners that are not there.
    pub(super) fn add_cells(&mut self, types: &[u8], ends: &[i64], corners: &[i64]) -> Result<(), Fault> {
        if types.len() != ends.len() {
            return Err(format!("it has {} cell types but {} cells", types.len(), ends.len()).into());
        }
        let base = self.connectivity.len();
        let mut before = 0;
        for (cell, &end) in ends.iter().enumerate() {
            let end = usize::try_from(end).ok().filter(|&end| end >= before && end <= corners.len());
            before = end.ok_or_else(|| format!("the corners of cell {cell} are not there"))?;
            self.ends.push(base.saturating_add(before));
        }
        if before != corners.len() {
            return Err(format!("its cells use {before} corners, but there are {}", corners.len()).into());
        }
        let count = self.points.len();
        for &corner in corners {
            let inside = u32::try_from(corner).ok().filter(|&corner| (corner as usize) < count);
            let inside =
                inside.ok_or_else(|| format!("a cell names point {corner}, but there are only {count}"))?;
            self.connectivity.push(inside);
        }
        self.types.extend_from_slice(types);
        Ok(())
    }

    /// Adds another piece of the same data set. Arrays that are not in both are dropped.
    pub(super) fn append(&mut self, other: Self) {
        if self.points.is_empty() {
            *self = other;
            return;
        }
        if other.points.is_empty() {
            return;
        }
        let shift = u32::try_from(self.points.len()).unwrap_or(u32::MAX);
        let base = self.connectivity.len();
        self.points.extend(other.points);
        self.types.extend(other.types);
        self.ends.extend(other.ends.into_iter().map(|end| end.saturating_add(base)));
        // A sum beyond u32 is beyond the points too, and refused by the grid or mesh.
        self.connectivity.extend(other.connectivity.into_iter().map(|corner| corner.saturating_add(shift)));
        let lost = joined(&mut self.point_arrays, &other.point_arrays)
            .saturating_add(joined(&mut self.cell_arrays, &other.cell_arrays));
        self.tell(other.notes);
        if lost > 0 {
            self.notes.push(Note {
                severity: Severity::Loss,
                code: "vtk.fields-of-some-pieces",
                text: format!("{lost} fields are not in every piece of the grid; they were left out."),
            });
        }
    }

    /// Adds notes that are not there yet.
    pub(super) fn tell(&mut self, notes: Vec<Note>) {
        for note in notes {
            if !self.notes.contains(&note) {
                self.notes.push(note);
            }
        }
    }

    /// Whether both have the same points and cells.
    pub(super) fn same_geometry(&self, other: &Self) -> bool {
        self.points == other.points
            && self.types == other.types
            && self.ends == other.ends
            && self.connectivity == other.connectivity
    }

    /// The corners of each cell, with its type.
    fn cells(&self) -> impl Iterator<Item = (u8, &[u32])> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        let corners = starts.zip(&self.ends).map(|(start, &end)| self.connectivity.get(start..end));
        self.types.iter().copied().zip(corners.map(Option::unwrap_or_default))
    }

    /// The grid or mesh this is.
    ///
    /// # Errors
    /// [`Fault::Broken`] for a data set without a cell, and for what grid and mesh refuse.
    pub(super) fn into_item(self, name: String, limits: &Limits) -> Result<Item, Fault> {
        self.into_item_over_time(name, 0.0, Vec::new(), limits)
    }

    /// The same with later steps: their times and arrays, on the same points and cells.
    ///
    /// # Errors
    /// As [`Dataset::into_item`]; [`Fault::Unsupported`] for surfaces with later steps.
    pub(super) fn into_item_over_time(
        mut self,
        name: String,
        time: f64,
        later: Vec<(f64, Vec<Array>, Vec<Array>)>,
        limits: &Limits,
    ) -> Result<Item, Fault> {
        afford(self.connectivity.len() as u64, 24, limits)?;
        let ghosts = self.cell_arrays.iter().find(|array| array.name == "vtkGhostType").cloned();
        // Bit 0: a copy of a cell that another piece has.
        let is_ghost = |cell: usize| {
            ghosts
                .as_ref()
                .is_some_and(|array| cell < array.values.len() && array.values.at(cell) % 2.0 == 1.0)
        };
        let (mut kinds, mut corners, mut kept) = (Vec::new(), Vec::new(), Vec::new());
        let (mut dropped, mut bent) = (0_usize, 0_usize);
        let mut faces = Surface::default();
        for (cell, (code, own)) in self.cells().enumerate() {
            if is_ghost(cell) {
                continue;
            }
            if let Some((kind, order, linear)) = solid(code) {
                let start = corners.len();
                corners.extend(order.iter().filter_map(|&at| own.get(at)));
                if corners.len().saturating_sub(start) != kind.corners() {
                    return Err(format!("cell {cell} is a {} of {} corners", kind.name(), own.len()).into());
                }
                bent = bent.saturating_add(usize::from(!linear));
                kinds.push(kind);
                kept.push(cell);
            } else if let Some(order) = face(code) {
                dropped = dropped.saturating_add(1);
                match order {
                    Face::Strip => faces.strip(own),
                    Face::All => faces.fan(own)?,
                    Face::Of(order) => {
                        let polygon = order.iter().filter_map(|&at| own.get(at).copied()).collect::<Vec<_>>();
                        if polygon.len() != order.len() {
                            return Err(format!("cell {cell} is a face of {} corners", own.len()).into());
                        }
                        faces.fan(&polygon)?;
                    }
                }
            } else {
                dropped = dropped.saturating_add(1);
            }
        }
        if kinds.is_empty() && !faces.triangles.is_empty() {
            if !later.is_empty() {
                return Err(Fault::Unsupported("surfaces over time".to_owned(), "open one of its files"));
            }
            let lost = self.point_arrays.len().saturating_add(self.cell_arrays.len());
            if lost > 0 {
                self.notes.push(Note {
                    severity: Severity::Loss,
                    code: "mesh.fields-dropped",
                    text: format!("{lost} fields on the surface were left out: a mesh has a shape only."),
                });
            }
            faces.positions = self.points;
            return faces.finish(name, FORMAT, Frame::Lps, Unit::Unstated, self.notes);
        }
        if kinds.is_empty() && dropped > 0 {
            let what = format!("{dropped} cells, none of them a tetrahedron, pyramid, wedge or hexahedron");
            return Err(Fault::Unsupported(what, "export it with cells of these kinds"));
        }
        tell_left_out(dropped, bent, &mut self.notes);
        let count = self.types.len();
        let only = (kept.len() < count).then_some(kept.as_slice());
        let now = step(time, self.point_arrays, self.cell_arrays, count, only);
        let later = later.into_iter().map(|(time, points, cells)| step(time, points, cells, count, only));
        let steps = std::iter::once(now).chain(later).collect();
        let grid = CellGrid::new(self.points, kinds, corners, steps)?;
        Ok(grid_item(name, FORMAT, grid, self.notes))
    }
}

/// Adds each array of `other` to the one of its name; how many had no partner.
fn joined(own: &mut Vec<Array>, other: &[Array]) -> usize {
    let before = own.len().max(other.len());
    own.retain_mut(|array| {
        let partner = other.iter().find(|o| o.name == array.name && o.components == array.components);
        let Some(partner) = partner else { return false };
        match (&mut array.values, &partner.values) {
            (Values::F32(a), Values::F32(b)) => a.extend_from_slice(b),
            (Values::F64(a), b) => a.extend(b.iter()),
            (a, b) => *a = Values::F64(a.iter().chain(b.iter()).collect()),
        }
        true
    });
    before.saturating_sub(own.len())
}

/// The arrays as fields; of cells only those in `only`.
fn step(time: f64, points: Vec<Array>, cells: Vec<Array>, count: usize, only: Option<&[usize]>) -> Step {
    let field = |array: Array| Field::new(array.name, array.components, array.values);
    let picked = |mut array: Array| {
        let Some(only) = only else { return array };
        // A length that does not fit is left for the grid to refuse.
        if array.values.len() == count.saturating_mul(array.components) {
            array.values = match array.values {
                Values::F32(v) => Values::F32(tuples(&v, array.components, only)),
                Values::F64(v) => Values::F64(tuples(&v, array.components, only)),
                other => other,
            };
        }
        array
    };
    Step {
        time,
        point_fields: points.into_iter().map(field).collect(),
        cell_fields: cells.into_iter().map(picked).map(field).collect(),
    }
}

fn tuples<T: Copy>(values: &[T], components: usize, only: &[usize]) -> Vec<T> {
    let start = |cell: usize| cell.saturating_mul(components);
    let tuple = |&cell: &usize| values.get(start(cell)..start(cell.saturating_add(1))).unwrap_or_default();
    only.iter().flat_map(tuple).copied().collect()
}

/// Kind of a cell with a volume, which of its corners are the kind's, and whether it has no others.
fn solid(code: u8) -> Option<(CellKind, &'static [usize], bool)> {
    const FIRST: [usize; 8] = [0, 1, 2, 3, 4, 5, 6, 7];
    // The voxel's corners go row by row.
    const VOXEL: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];
    let (kind, linear) = match code {
        11 => return Some((CellKind::Hexahedron, &VOXEL, true)),
        10 => (CellKind::Tetra, true),
        12 => (CellKind::Hexahedron, true),
        13 => (CellKind::Wedge, true),
        14 => (CellKind::Pyramid, true),
        // Quadratic, then Lagrange, then Bézier: corners come first in all.
        24 | 71 | 78 => (CellKind::Tetra, false),
        25 | 29 | 33 | 72 | 79 => (CellKind::Hexahedron, false),
        26 | 31 | 32 | 73 | 80 => (CellKind::Wedge, false),
        27 | 37 | 74 | 81 => (CellKind::Pyramid, false),
        _ => return None,
    };
    Some((kind, FIRST.get(..kind.corners())?, linear))
}

enum Face {
    Strip,
    All,
    Of(&'static [usize]),
}

/// Which corners of a face go round it.
fn face(code: u8) -> Option<Face> {
    Some(match code {
        6 => Face::Strip,
        7 => Face::All,
        8 => Face::Of(&[0, 1, 3, 2]),
        5 | 22 | 34 | 69 | 76 => Face::Of(&[0, 1, 2]),
        9 | 23 | 28 | 70 | 77 => Face::Of(&[0, 1, 2, 3]),
        _ => return None,
    })
}
