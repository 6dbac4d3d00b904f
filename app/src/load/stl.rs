//! STL, both kinds: 50 bytes a triangle after an 84-byte header, or words.
//!
//! The kind is judged by the length, not by the first word: many binary files begin with "solid".
//! Normals and colours are not used. STL has no unit; millimetres are taken.
//!
//! Source: 3D Systems, *Stereolithography Interface Specification*, 1989.

use std::path::Path;

use render::volume::Point;

use super::bytes::{self, Endian, Fault, Scalar};
use super::surface::{Frame, Surface, Unit};
use super::{Item, Limits, LoadError, Note, Progress, Severity};

const FORMAT: &str = "STL";
const HEADER: usize = 84;
const RECORD: usize = 50;

/// The mesh in the STL file at `path`.
///
/// # Errors
/// [`LoadError`] for a file that cannot be read, is no STL, or holds fewer triangles than it says.
pub(super) fn read(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    let file = bytes::whole(path, FORMAT, limits)?;
    let item = bytes::step(progress, "reading STL", 0, 1).and_then(|()| parse(&file, bytes::file_name(path)));
    item.map(|item| vec![item]).map_err(|fault| fault.at(FORMAT, path, limits))
}

fn parse(file: &[u8], name: String) -> Result<Item, Fault> {
    let mut notes = Vec::new();
    let mut surface = Surface::default();
    let header = match kind(file)? {
        Kind::Binary { count, rest } => {
            if rest > 0 {
                notes.push(Note {
                    severity: Severity::Caution,
                    code: "stl.trailing",
                    text: format!(
                        "{rest} bytes follow the {count} triangles the file announces; they were not used."
                    ),
                });
            }
            let records = file.get(HEADER..).unwrap_or_default().as_chunks::<RECORD>().0;
            binary(records.get(..count).unwrap_or_default(), &mut surface);
            file.get(..80).unwrap_or_default()
        }
        Kind::Words => {
            if !words(file, &mut surface)? {
                notes.push(Note {
                    severity: Severity::Caution,
                    code: "stl.no-end",
                    text: "The file does not end with \"endsolid\", so triangles may be missing.".to_owned(),
                });
            }
            file.split(|&byte| byte == b'\n').next().unwrap_or_default()
        }
    };
    surface.finish(name, FORMAT, Frame::in_text(header), Unit::Unstated, notes)
}

enum Kind {
    Binary { count: usize, rest: usize },
    Words,
}

fn kind(file: &[u8]) -> Result<Kind, Fault> {
    if file.is_empty() {
        return Err("it has no bytes".into());
    }
    let body = file.len().checked_sub(HEADER);
    let count =
        file.get(80..HEADER).and_then(|field| Scalar::U32.positions(field, Endian::Little).first().copied());
    let needed = count.and_then(|n| usize::try_from(n).ok()).and_then(|n| n.checked_mul(RECORD));
    if let (Some(body), Some(needed)) = (body, needed)
        && body == needed
    {
        return Ok(Kind::Binary { count: body / RECORD, rest: 0 });
    }
    let start = file.trim_ascii_start();
    let solid = start.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let text = start.get(..start.len().min(1024)).unwrap_or_default();
    if solid && !text.contains(&0) {
        return Ok(Kind::Words);
    }
    match (body, needed) {
        (Some(body), Some(needed)) if body > needed && needed > 0 => {
            Ok(Kind::Binary { count: needed / RECORD, rest: body.saturating_sub(needed) })
        }
        (Some(body), _) => {
            Err(format!("it announces {} triangles but has room for {}", count.unwrap_or(0), body / RECORD)
                .into())
        }
        (None, _) => Err("it is shorter than the 84 bytes of a header".into()),
    }
}

fn binary(records: &[[u8; RECORD]], surface: &mut Surface) {
    for record in records {
        // Twelve bytes of normal, then three corners, then two bytes of colour.
        let numbers = Scalar::F32.reals(record.get(12..48).unwrap_or_default(), Endian::Little);
        let next = u32::try_from(surface.positions.len()).unwrap_or(u32::MAX);
        surface.positions.extend(numbers.as_chunks().0.iter().map(|&xyz: &[f64; 3]| Point::from(xyz)));
        surface.triangles.push([next, next.saturating_add(1), next.saturating_add(2)]);
    }
}

/// Reads words into `surface`; whether the last solid was ended.
fn words(file: &[u8], surface: &mut Surface) -> Result<bool, Fault> {
    let mut ended = false;
    let mut facet: Vec<u32> = Vec::new();
    let mut open = false;
    for (number, line) in (1_usize..).zip(file.split(|&byte| byte == b'\n')) {
        let line = String::from_utf8_lossy(line);
        let mut rest = line.split_ascii_whitespace();
        // A line may hold more than one statement; each begins with its word.
        while let Some(word) = rest.next() {
            match word.to_ascii_lowercase().as_str() {
                "vertex" => {
                    let mut xyz = [0.0_f64; 3];
                    for slot in &mut xyz {
                        let text = rest.next().unwrap_or("");
                        *slot =
                            text.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| {
                                format!("a coordinate in line {number} is not a finite number like 1.5")
                            })?;
                    }
                    facet.push(u32::try_from(surface.positions.len()).unwrap_or(u32::MAX));
                    surface.positions.push(Point::from(xyz));
                }
                "facet" => {
                    if open {
                        return Err(format!("a facet begins inside another at line {number}").into());
                    }
                    open = true;
                    ended = false;
                }
                "endfacet" => {
                    if facet.len() != 3 {
                        return Err(format!(
                            "the facet that ends at line {number} has {} corners",
                            facet.len()
                        )
                        .into());
                    }
                    surface.fan(&facet)?;
                    facet.clear();
                    open = false;
                }
                "endsolid" => {
                    ended = true;
                    break;
                }
                // The rest of a solid's line is its name.
                "solid" => break,
                _ => {}
            }
        }
    }
    if open || !facet.is_empty() {
        return Err("it ends inside a facet".into());
    }
    Ok(ended)
}

#[cfg(test)]
#[expect(clippy::indexing_slicing, reason = "a test may fail loudly")]
mod tests {
    use render::volume::TriangleMesh;

    use super::super::bytes::trial::{sample, survives};
    use super::super::{Content, Silent};
    use super::*;

    fn mesh(item: &Item) -> &TriangleMesh {
        let Content::Mesh(mesh) = &item.content else { panic!("not a mesh") };
        mesh
    }

    /// Two triangles of a square of side 2, as a binary file with that header.
    fn square(header: &str) -> Vec<u8> {
        let mut file = format!("{header:80}").into_bytes();
        file.extend(2_u32.to_le_bytes());
        for corners in [[[0, 0, 0], [2, 0, 0], [2, 2, 0]], [[0, 0, 0], [2, 2, 0], [0, 2, 0]]] {
            file.extend([0; 12]);
            file.extend(corners.as_flattened().iter().flat_map(|&c| (c as f32).to_le_bytes()));
            file.extend([0; 2]);
        }
        file
    }

    const WORDS: &str = "solid a facet of nothing\n facet normal 0 0 1\n  outer loop\n vertex 0 0 0\n vertex 2 0 0\n\
        VERTEX 2 2.0e0 0\r\nendloop endfacet\nfacet normal 0 0 1 outer loop vertex 0 0 0 vertex 2 2 0\n\
        vertex 0 2 0 endloop endfacet\nendsolid a vertex of nothing\n";

    #[test]
    fn words_and_bytes_give_the_same_mesh() {
        let binary = parse(&square("any"), "a".to_owned()).expect("binary");
        let words = parse(WORDS.as_bytes(), "a".to_owned()).expect("words");
        assert_eq!(mesh(&binary), mesh(&words), "same square");
        assert_eq!(mesh(&binary).positions().len(), 4, "welded");
        assert_eq!((binary.notes, words.notes), (vec![], vec![]), "nothing to say");
    }

    #[test]
    fn a_binary_file_that_begins_with_solid_is_still_binary() {
        let item = parse(&square("solid of words"), "a".to_owned()).expect("binary");
        assert_eq!(mesh(&item).triangles().len(), 2, "two triangles");
    }

    #[test]
    fn slicers_ras_header_is_honoured_in_both_kinds() {
        let binary = parse(&square("3D Slicer output. SPACE=RAS"), "a".to_owned()).expect("binary");
        let words = WORDS.replace("solid a facet", "solid SPACE=RAS facet");
        let words = parse(words.as_bytes(), "a".to_owned()).expect("words");
        assert_eq!(mesh(&binary), mesh(&words), "same square");
        assert_eq!(mesh(&words).bounds()[0], Point::new(-2.0, -2.0, 0.0), "turned");
    }

    #[test]
    fn counts_that_do_not_fit_the_length_are_told() {
        let mut more = square("x");
        more.extend([0; 7]);
        let item = parse(&more, "a".to_owned()).expect("trailing bytes are survived");
        assert_eq!(item.notes.first().map(|n| n.code), Some("stl.trailing"), "and told");
        let mut less = square("x");
        less[80] = 3;
        let Err(Fault::Broken(fault)) = parse(&less, "a".to_owned()) else { panic!("accepted") };
        assert_eq!(fault, "it announces 3 triangles but has room for 2", "both figures");
        let mut none = square("x");
        none[80] = 0;
        assert!(parse(&none, "a".to_owned()).is_err(), "no triangle at all");
    }

    #[test]
    fn words_that_stop_early_are_told() {
        let cut = WORDS.split("endsolid").next().expect("a part");
        let item = parse(cut.as_bytes(), "a".to_owned()).expect("all facets are there");
        assert_eq!(item.notes.first().map(|n| n.code), Some("stl.no-end"), "but perhaps not all");
        let cut = cut.trim_end().trim_end_matches("endfacet");
        assert!(parse(cut.as_bytes(), "a".to_owned()).is_err(), "inside a facet");
        let comma = WORDS.replace("2.0e0", "2,0");
        let Err(Fault::Broken(fault)) = parse(comma.as_bytes(), "a".to_owned()) else { panic!("accepted") };
        assert!(fault.contains("line 6"), "{fault}");
    }

    #[test]
    fn a_file_in_metres_is_doubted() {
        let small = WORDS.replace("2.0e0", "2").replace(" 2", " 0.05");
        let item = parse(small.as_bytes(), "a".to_owned()).expect("a mesh");
        assert_eq!(item.notes.first().map(|n| n.code), Some("mesh.maybe-metres"), "5 cm in metres");
    }

    #[test]
    fn no_byte_makes_it_panic() {
        survives(&square("solid"), |bytes| parse(bytes, String::new()));
        survives(WORDS.as_bytes(), |bytes| parse(bytes, String::new()));
    }

    fn sample_item(name: &str) -> Option<Result<Item, LoadError>> {
        let path = sample(name)?;
        Some(read(&path, &Limits::default(), &Silent).map(|mut items| items.remove(0)))
    }

    #[test]
    fn the_sample_files_have_the_facts_that_trimesh_reads() {
        // Triangles, vertices after merging, and bounds, by trimesh 4; of the tray numpy's count of different
        // vertices, as trimesh also merges two that differ in the eighth decimal.
        type Facts = (&'static str, usize, usize, [f64; 6], &'static [&'static str]);
        const METRES: &[&str] = &["mesh.maybe-metres"];
        let facts: [Facts; 6] = [
            (
                "mesh/libhip_m4_lfemur.stl",
                72_868,
                36_436,
                [53.236_003_88, 4.166_543_48, -505.531_25, 149.918_960_57, 69.090_202_33, -341.141_845_70],
                &[],
            ),
            (
                "mesh/tka_femoral_component.stl",
                24_442,
                12_223,
                [-0.032_173_15, -0.035_103_41, -0.037_230_35, 0.034_182_44, 0.020_472_53, 0.037_820_56],
                METRES,
            ),
            (
                "mesh/tka_patient_femur.stl",
                29_590,
                14_797,
                [-0.044_020_98, -0.444_472_13, -0.048_542_67, 0.036_175_29, 0.022_491_36, 0.060_852_19],
                METRES,
            ),
            (
                "mesh/tka_patient_tibia.stl",
                56_134,
                28_069,
                [-0.025_018_11, -0.425_865_41, -0.040_665_40, 0.042_234_72, -0.044_717_11, 0.039_076_42],
                METRES,
            ),
            (
                "mesh/tka_tibial_insert.stl",
                15_042,
                7_692,
                [-0.026_199_79, 0.005_883_35, -0.039_580_48, 0.020_715_18, 0.015_357_94, 0.039_648_12],
                METRES,
            ),
            (
                "mesh/tka_tibial_tray.stl",
                64_388,
                32_197,
                [-0.026_494_43, -0.107_670_52, -0.039_747_96, 0.026_482_97, 0.003_586_18, 0.039_752_92],
                METRES,
            ),
        ];
        for (name, triangles, vertices, bounds, codes) in facts {
            let Some(item) = sample_item(name) else { return };
            let item = item.expect(name);
            let mesh = mesh(&item);
            assert_eq!((mesh.triangles().len(), mesh.positions().len()), (triangles, vertices), "{name}");
            let found = mesh.bounds().map(|p| [p.x, p.y, p.z]);
            for (found, expected) in found.as_flattened().iter().zip(bounds) {
                assert!((found - expected).abs() < 1e-8, "{name}: {found} for {expected}");
            }
            let found = item.notes.iter().map(|note| note.code).filter(|&code| code != "mesh.degenerate");
            assert_eq!(found.collect::<Vec<_>>(), codes, "{name}");
        }
        let Some(Ok(femur)) = sample_item("mesh/libhip_m4_lfemur.stl") else { panic!("read before") };
        let volume = mesh(&femur).volume_mm3();
        assert!((volume - 213_371.290_096).abs() < 1e-3, "trimesh says 213371.290096 mm3, not {volume}");
    }

    #[test]
    fn the_broken_samples_are_refused_or_survived() {
        let Some(solid) = sample_item("bad/stl_binary_says_solid.stl") else { return };
        let solid = solid.expect("it is good but for its first word");
        assert_eq!(mesh(&solid).triangles().len(), 1000, "as trimesh reads it");
        for (name, says) in [
            ("bad/stl_count_4billion.stl", "announces 4294967295 triangles but has room for 1000"),
            ("bad/stl_truncated.stl", "but has room for"),
            ("bad/stl_empty.stl", "no bytes"),
            ("bad/stl_ascii_nan.stl", "line 5 is not a finite number"),
        ] {
            let Some(Err(error)) = sample_item(name) else { panic!("{name} accepted") };
            assert!(error.to_string().contains(says), "{error}");
        }
    }
}
