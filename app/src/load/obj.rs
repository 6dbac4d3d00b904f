//! Wavefront OBJ: vertices and faces of all its objects as one mesh; materials, normals and texture
//! places are not used.
//!
//! `tobj` reads it, in `f64`, from text that is made ready for it: comments are taken off, which it reads as
//! colours where they follow a vertex; lines that go on with a backslash are joined; points and lines are
//! taken out, since a line of three points comes out of it as a triangle. OBJ has no unit; millimetres are
//! taken.
//!
//! Source: Wavefront, *Advanced Visualizer Manual*, appendix B1, "Object files".

use std::path::Path;

use render::volume::Point;

use super::bytes::{self, Fault};
use super::surface::{Frame, Surface, Unit};
use super::{Item, Limits, LoadError, Note, Progress, Severity};

const FORMAT: &str = "OBJ";

/// The mesh in the OBJ file at `path`.
///
/// # Errors
/// [`LoadError`] for a file that cannot be read, has no face, or a face whose vertex is not there.
pub(super) fn read(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    let file = bytes::whole(path, FORMAT, limits)?;
    let item = bytes::step(progress, "reading OBJ", 0, 1).and_then(|()| parse(&file, bytes::file_name(path)));
    item.map(|item| vec![item]).map_err(|fault| fault.at(FORMAT, path, limits))
}

fn parse(file: &[u8], name: String) -> Result<Item, Fault> {
    let joined = String::from_utf8_lossy(file).replace("\\\r\n", " ").replace("\\\n", " ");
    let mut text = String::with_capacity(joined.len());
    let mut frame = Frame::Lps;
    let mut thin = 0_usize;
    for line in joined.lines() {
        let (statement, comment) = line.split_once('#').unwrap_or((line, ""));
        if Frame::in_text(comment.as_bytes()) == Frame::Ras {
            frame = Frame::Ras;
        }
        if let Some("l" | "p") = statement.split_ascii_whitespace().next() {
            thin = thin.saturating_add(1);
        } else {
            text.push_str(statement.trim_end());
            text.push('\n');
        }
    }
    // Material files are never looked for.
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &tobj::LoadOptions::default(), no_materials)
        .map_err(fault_of)?;
    let mut surface = Surface::default();
    for tobj::Model { mesh, .. } in models {
        let first = u32::try_from(surface.positions.len()).map_err(|error| error.to_string())?;
        surface.positions.extend(mesh.positions.as_chunks().0.iter().map(|&xyz: &[f64; 3]| Point::from(xyz)));
        // No list of arities means triangles only.
        let triangles = if mesh.face_arities.is_empty() { mesh.indices.len() / 3 } else { 0 };
        let arities = mesh.face_arities.into_iter().chain(std::iter::repeat_n(3, triangles));
        let mut rest = mesh.indices.into_iter();
        for arity in arities {
            let corners = rest.by_ref().take(arity as usize);
            surface.fan(&corners.map(|corner| corner.saturating_add(first)).collect::<Vec<_>>())?;
        }
    }
    let mut notes = Vec::new();
    if thin > 0 {
        notes.push(Note {
            severity: Severity::Loss,
            code: "obj.points-and-lines",
            text: format!("{thin} points and lines were left out; only faces are read."),
        });
    }
    surface.finish(name, FORMAT, frame, Unit::Unstated, notes)
}

/// What the crate's refusal means to the user.
fn fault_of(error: tobj::LoadError) -> Fault {
    let clause = match error {
        tobj::LoadError::PositionParseError => "a vertex has not three numbers like 1.5",
        tobj::LoadError::FaceParseError => "a face has a corner that is not a number",
        tobj::LoadError::FaceVertexOutOfBounds => "a face names a vertex that is not there",
        other => return other.to_string().into(),
    };
    clause.into()
}

#[cfg(test)]
#[expect(clippy::indexing_slicing, reason = "a test may fail loudly")]
mod tests {
    use render::volume::TriangleMesh;

    use super::super::bytes::trial::{sample, survives};
    use super::super::{Content, Silent};
    use super::*;

    const SQUARE: &str = "# made here\no one\nv 0 0 0\nv 2 0 0 1.0\nv 2 2 0\nv 0 2 0 # last\nvn 0 0 1\n\
        f 1//1 2//1 3/7/1 \\\n 4\no two\nf -4 -2 -1\n";

    fn loaded(text: &str) -> Result<Item, Fault> {
        parse(text.as_bytes(), "a".to_owned())
    }

    fn mesh(item: &Item) -> &TriangleMesh {
        let Content::Mesh(mesh) = &item.content else { panic!("not a mesh") };
        mesh
    }

    #[test]
    fn polygons_are_fans_and_negative_indices_count_back() {
        let item = loaded(SQUARE).expect("a mesh");
        assert_eq!(mesh(&item).triangles(), [[0, 1, 2], [0, 2, 3], [0, 2, 3]], "fan, then from the end");
        assert_eq!(mesh(&item).bounds()[1], Point::new(2.0, 2.0, 0.0), "w is no coordinate");
    }

    #[test]
    fn numbers_keep_all_their_digits() {
        let text = "v 1000000.0625001 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3";
        assert_eq!(mesh(&loaded(text).expect("a mesh")).positions()[0].x, 1_000_000.062_500_1, "f64");
    }

    #[test]
    fn vertices_that_are_not_there_are_told() {
        let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        for (face, says) in [
            ("f 1 2 99", "vertex that is not there"),
            ("f -9 1 2", "vertex that is not there"),
            ("f 0 1 2", "vertex that is not there"),
            ("f 1 x 2", "corner that is not a number"),
            ("f 1 2", "a face has 2 corners"),
            ("v 0 0\nf 1 2 3", "not three numbers"),
            ("v 0 0 nan\nf 1 2 4", "not finite"),
            ("v 0 0 0\n", "no triangle"),
        ] {
            let Err(Fault::Broken(fault)) = loaded(&format!("{triangle}{face}\n")) else {
                panic!("{face} accepted")
            };
            assert!(fault.contains(says), "{face}: {fault}");
        }
    }

    #[test]
    fn points_and_lines_are_left_out_and_counted() {
        let item = loaded(&format!("{SQUARE}l 1 2 3\np 1\nf 1 2 3\n")).expect("a mesh");
        assert_eq!(mesh(&item).triangles().len(), 4, "the faces are all there");
        assert_eq!(item.notes.first().map(|note| note.code), Some("obj.points-and-lines"), "told");
    }

    #[test]
    fn slicers_comment_says_the_frame() {
        let item = loaded(&SQUARE.replace("made here", "3D Slicer output. SPACE=RAS")).expect("a mesh");
        assert_eq!(mesh(&item).bounds()[0], Point::new(-2.0, -2.0, 0.0), "turned");
    }

    #[test]
    fn no_byte_makes_it_panic() {
        survives(SQUARE.as_bytes(), |bytes| parse(bytes, String::new()));
    }

    #[test]
    fn the_sample_files_have_the_facts_that_trimesh_reads() {
        let Some(path) = sample("mesh/tka_tibial_insert.obj") else { return };
        let items = read(&path, &Limits::default(), &Silent).expect("the insert");
        let mesh = mesh(&items[0]);
        assert_eq!((mesh.triangles().len(), mesh.positions().len()), (15_042, 7_692), "sizes");
        let low = Point::new(-0.026_199_79, 0.005_883_35, -0.039_580_48);
        let high = Point::new(0.020_715_18, 0.015_357_94, 0.039_648_12);
        assert_eq!(mesh.bounds(), [low, high], "eight decimals, as they stand in the file");
        assert!(items[0].notes.iter().any(|note| note.code == "mesh.maybe-metres"), "5 cm in metres");
        let Some(bad) = sample("bad/obj_index_out_of_range.obj") else { return };
        let Err(error) = read(&bad, &Limits::default(), &Silent) else { panic!("accepted") };
        assert!(error.to_string().contains("a face has a corner that is not a number"), "{error}");
    }
}
