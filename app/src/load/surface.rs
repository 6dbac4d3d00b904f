//! From a file's triangles or cells to an [`Item`]: frame, unit, welding, and what is said about them.

use std::collections::HashMap;

use render::cells::Faults;
use render::volume::cells::Place;
use render::volume::{CellGrid, Point, TriangleMesh};

use super::bytes::Fault;
use super::{Content, Item, Note, Severity};

/// The patient frame a file says its coordinates are in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Frame {
    /// It says nothing, or LPS: taken as it is.
    Lps,
    /// x to the right and y to the front: turned half about z.
    Ras,
}

impl Frame {
    /// What 3D Slicer writes into headers and comments: `SPACE=RAS` or `SPACE=LPS`.
    pub(super) fn in_text(header: &[u8]) -> Self {
        let says = |what: &[u8]| header.windows(what.len()).any(|part| part.eq_ignore_ascii_case(what));
        if says(b"SPACE=RAS") { Self::Ras } else { Self::Lps }
    }

    /// Turns points into LPS; tells so where something changed.
    pub(super) fn into_lps(self, points: &mut [Point], notes: &mut Vec<Note>) {
        if self == Self::Ras {
            for p in points {
                p.x = -p.x;
                p.y = -p.y;
            }
            notes.push(Note {
                severity: Severity::Fact,
                code: "mesh.ras",
                text: "The file says its points are RAS (SPACE=RAS): x and y were turned to LPS.".to_owned(),
            });
        }
    }
}

/// Whether the format says what unit its lengths have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unit {
    /// It does, and the lengths are millimetres now.
    Known,
    /// It does not: millimetres are taken, and doubted where they make something very small.
    Unstated,
}

/// Cautions where the largest side of a box is so small that it may be in metres, and says the remedy.
#[expect(clippy::arithmetic_side_effects, reason = "f64 has no side effects")]
fn doubt_unit([low, high]: [Point; 2], remedy: &str, notes: &mut Vec<Note>) {
    let largest = (high.coords - low.coords).max();
    if largest > 0.0 && largest < 1.0 {
        notes.push(Note {
            severity: Severity::Caution,
            code: "mesh.maybe-metres",
            text: format!(
                "The largest side is {largest:.4} mm, so the file may be in metres: if it is, {remedy}."
            ),
        });
    }
}

/// Triangles as a file gives them, before welding.
#[derive(Debug, Default)]
pub(super) struct Surface {
    /// Vertices; mm.
    pub(super) positions: Vec<Point>,
    /// Positions in `positions`.
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// Adds a polygon as a fan from its first corner, which is exact for a flat convex one.
    ///
    /// # Errors
    /// [`Fault::Broken`] for a polygon of fewer than three corners.
    pub(super) fn fan(&mut self, polygon: &[u32]) -> Result<(), Fault> {
        let [first, rest @ ..] = polygon else { return Err("a face has no corner".into()) };
        if rest.len() < 2 {
            return Err(format!("a face has {} corners", polygon.len()).into());
        }
        self.triangles.extend(rest.array_windows().map(|&[b, c]| [*first, b, c]));
        Ok(())
    }

    /// Adds a strip, whose every second triangle runs the other way round.
    pub(super) fn strip(&mut self, strip: &[u32]) {
        let turned = |(odd, &[a, b, c]): (bool, &[u32; 3])| if odd { [b, a, c] } else { [a, b, c] };
        let odd = [false, true].into_iter().cycle();
        self.triangles.extend(odd.zip(strip.array_windows()).map(turned));
    }

    /// The item: turned to LPS, vertices at exactly the same place made one.
    ///
    /// Triangles without area are kept, since a mesh may be closed only with them, and counted.
    ///
    /// # Errors
    /// [`Fault::Broken`] for what [`TriangleMesh::new`] refuses.
    pub(super) fn finish(
        mut self,
        name: String,
        format: &'static str,
        frame: Frame,
        unit: Unit,
        mut notes: Vec<Note>,
    ) -> Result<Item, Fault> {
        frame.into_lps(&mut self.positions, &mut notes);
        // Checked before welding, so that the message counts vertices as the file does.
        let mesh = TriangleMesh::new(self.positions, self.triangles)?;
        let (positions, triangles) = welded(&mesh);
        let mesh = TriangleMesh::new(positions, triangles)?;
        let flat = (0..mesh.triangles().len()).filter(|&triangle| is_flat(mesh.corners(triangle))).count();
        if unit == Unit::Unstated {
            doubt_unit(mesh.bounds(), "set \"scale\": 1000 on the implant in the case file", &mut notes);
        }
        if flat > 0 {
            notes.push(Note {
                severity: Severity::Fact,
                code: "mesh.degenerate",
                text: format!("{flat} of {} triangles have no area; they are kept.", mesh.triangles().len()),
            });
        }
        Ok(Item { name, format, modality: None, content: Content::Mesh(mesh), notes })
    }
}

#[expect(clippy::arithmetic_side_effects, reason = "f64 has no side effects")]
fn is_flat([a, b, c]: [Point; 3]) -> bool {
    (b - a).cross(&(c - a)).norm_squared() == 0.0
}

/// Says what was left out of a grid: cells without a volume or of unknown shape, and the inner nodes of
/// cells of higher order.
pub(super) fn tell_left_out(dropped: usize, bent: usize, notes: &mut Vec<Note>) {
    if dropped > 0 {
        notes.push(Note {
            severity: Severity::Loss,
            code: "cells.dropped",
            text: format!("{dropped} cells without a volume, or of a shape not read here, were left out."),
        });
    }
    if bent > 0 {
        notes.push(Note {
            severity: Severity::Loss,
            code: "cells.linearised",
            text: format!(
                "{bent} cells of higher order were read as linear ones: only their corners are used."
            ),
        });
    }
}

/// The item of a grid, with notes on its unit, on values that are not finite and on cells at fault.
pub(super) fn grid_item(name: String, format: &'static str, grid: CellGrid, mut notes: Vec<Note>) -> Item {
    doubt_unit(grid.bounds(), "save its points in millimetres", &mut notes);
    let fields =
        || grid.steps().iter().flat_map(|step| [Place::Points, Place::Cells].map(|at| step.fields(at)));
    let count = fields().flatten().fold(0_usize, |sum, field| sum.saturating_add(field.non_finite()));
    if count > 0 {
        notes.push(Note {
            severity: Severity::Caution,
            code: "cells.not-finite",
            text: format!(
                "{count} values of its fields are NaN or infinite; cells with such a value are not drawn."
            ),
        });
    }
    let Faults { flat, inverted } = Faults::of(&grid);
    if flat > 0 {
        notes.push(Note {
            severity: Severity::Caution,
            code: "cells.flat",
            text: format!("{flat} tetrahedra of its cells have no volume; they are not drawn."),
        });
    }
    if inverted > 0 {
        notes.push(Note {
            severity: Severity::Caution,
            code: "cells.inverted",
            text: format!(
                "{inverted} of its {} cells are turned inside out; they are drawn as they lie.",
                grid.len()
            ),
        });
    }
    Item { name, format, modality: None, content: Content::Cells(grid), notes }
}

/// Vertices made one where all coordinates are equal, in order of first use by the file.
fn welded(mesh: &TriangleMesh) -> (Vec<Point>, Vec<[u32; 3]>) {
    let mut seen: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.positions().len());
    let mut positions: Vec<Point> = Vec::new();
    let mut new_from_old: Vec<u32> = Vec::with_capacity(mesh.positions().len());
    for p in mesh.positions() {
        // Adding 0 makes -0 equal to 0 in its bits too.
        let place: [f64; 3] = p.coords.map(|c| c + 0.0).into();
        let next = u32::try_from(positions.len()).unwrap_or(u32::MAX);
        let vertex = *seen.entry(place.map(f64::to_bits)).or_insert(next);
        if vertex == next {
            positions.push(Point::from(place));
        }
        new_from_old.push(vertex);
    }
    let moved = |v: u32| new_from_old.get(v as usize).copied().unwrap_or(u32::MAX);
    (positions, mesh.triangles().iter().map(|corners| corners.map(moved)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Surface {
        let positions = vec![
            Point::new(0.0, 0.0, 0.0),
            Point::new(2.0, 0.0, 0.0),
            Point::new(2.0, 2.0, 0.0),
            Point::new(-0.0, 0.0, -0.0),
            Point::new(2.0, 2.0, 0.0),
            Point::new(0.0, 2.0, 0.0),
        ];
        Surface { positions, triangles: vec![[0, 1, 2], [3, 4, 5]] }
    }

    fn mesh(item: &Item) -> &TriangleMesh {
        let Content::Mesh(mesh) = &item.content else { panic!("not a mesh") };
        mesh
    }

    #[test]
    fn equal_vertices_become_one_and_nothing_moves() {
        let item =
            square().finish("s".to_owned(), "X", Frame::Lps, Unit::Unstated, Vec::new()).expect("a mesh");
        assert_eq!(mesh(&item).positions().len(), 4, "two of six were doubles, one of them by -0");
        assert_eq!(mesh(&item).triangles(), [[0, 1, 2], [0, 2, 3]], "same triangles");
        assert_eq!(item.notes, [], "nothing to say");
    }

    #[test]
    fn ras_is_turned_half_about_z() {
        assert_eq!(Frame::in_text(b"3D Slicer output. SPACE=RAS   "), Frame::Ras, "RAS");
        assert_eq!(Frame::in_text(b"3D Slicer output. SPACE=LPS"), Frame::Lps, "LPS");
        let item =
            square().finish("s".to_owned(), "X", Frame::Ras, Unit::Unstated, Vec::new()).expect("a mesh");
        let low = Point::new(-2.0, -2.0, 0.0);
        assert_eq!(mesh(&item).bounds(), [low, Point::origin()], "x and y change sign");
        assert_eq!(item.notes.iter().map(|n| n.code).collect::<Vec<_>>(), ["mesh.ras"], "said so");
    }

    #[test]
    fn polygons_and_strips_keep_their_sense_of_rotation() {
        let mut surface = Surface::default();
        surface.fan(&[5, 6, 7, 8]).expect("a quadrilateral");
        surface.strip(&[0, 1, 2, 3]);
        assert_eq!(surface.triangles, [[5, 6, 7], [5, 7, 8], [0, 1, 2], [2, 1, 3]], "fan, then strip");
        assert!(surface.fan(&[1, 2]).is_err(), "an edge is not a face");
        assert!(surface.fan(&[]).is_err(), "nothing is not a face");
    }

    #[test]
    fn triangles_without_area_are_kept_and_counted() {
        let mut surface = square();
        surface.triangles.push([0, 1, 1]);
        let item =
            surface.finish("s".to_owned(), "X", Frame::Lps, Unit::Unstated, Vec::new()).expect("a mesh");
        assert_eq!(mesh(&item).triangles().len(), 3, "kept");
        assert_eq!(item.notes.first().map(|n| n.code), Some("mesh.degenerate"), "counted");
    }

    #[test]
    fn less_than_a_millimetre_is_doubted() {
        let mut small = square();
        for p in &mut small.positions {
            *p *= 0.03;
        }
        let copy = Surface { positions: small.positions.clone(), triangles: small.triangles.clone() };
        let item = small.finish("s".to_owned(), "X", Frame::Lps, Unit::Unstated, Vec::new()).expect("a mesh");
        assert!(
            item.notes.iter().any(|n| n.text.contains("\"scale\": 1000")),
            "6 cm in metres: {:?}",
            item.notes
        );
        let item = copy.finish("s".to_owned(), "X", Frame::Lps, Unit::Known, Vec::new()).expect("a mesh");
        assert_eq!(item.notes, [], "a format with a unit is believed");
    }
}
