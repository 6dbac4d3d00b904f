//! PLY, Stanford polygons: text, or binary of either byte order; any properties, faces of any size.
//!
//! Elements and properties other than the vertices' place and the faces' corners are read past. PLY has
//! no unit; millimetres are taken.
//!
//! Source: Turk, *The PLY Polygon File Format*, 1994.

use std::path::Path;

use render::volume::Point;

use super::bytes::{self, Endian, Fault, Scalar, split};
use super::surface::{Frame, Surface, Unit};
use super::{Item, Limits, LoadError, Progress};

const FORMAT: &str = "PLY";

/// The mesh in the PLY file at `path`.
///
/// # Errors
/// [`LoadError`] for a file that cannot be read, ends early, or a face whose vertex is not there.
pub(super) fn read(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    let file = bytes::whole(path, FORMAT, limits)?;
    let item = bytes::step(progress, "reading PLY", 0, 1).and_then(|()| parse(&file, bytes::file_name(path)));
    item.map(|item| vec![item]).map_err(|fault| fault.at(FORMAT, path, limits))
}

fn parse(file: &[u8], name: String) -> Result<Item, Fault> {
    let end = file.windows(10).position(|part| part == b"end_header").ok_or("its header has no end")?;
    let (header, body) = file.split_at_checked(end).ok_or("its header has no end")?;
    let body = body.iter().position(|&byte| byte == b'\n').and_then(|at| body.get(at..)).unwrap_or_default();
    let body = body.get(1..).unwrap_or_default();
    let frame = Frame::in_text(header);
    let (encoding, elements) = declared(&String::from_utf8_lossy(header))?;
    let mut source = match encoding {
        Some(endian) => Source::Binary(body, endian),
        None => Source::Words(body),
    };
    let mut surface = Surface::default();
    let mut faces: Vec<u32> = Vec::new();
    for element in &elements {
        let place = ["x", "y", "z"].map(|axis| element.properties.iter().position(|p| p.name == axis));
        let is_vertex = element.name == "vertex";
        if is_vertex && place.contains(&None) {
            return Err("its vertices have no x, y and z".into());
        }
        let is_face = element.name == "face";
        for record in 0..element.count {
            let mut xyz = [0.0; 3];
            for (position, property) in element.properties.iter().enumerate() {
                let cut = || format!("it ends in {} {record} of {}", element.name, element.count);
                let count = match property.list {
                    // A count below 0 or not whole is cut to what it begins with.
                    Some(scalar) => length(source.next(scalar).ok_or_else(cut)?)?,
                    None => 1,
                };
                let corners = is_face && matches!(property.name.as_str(), "vertex_indices" | "vertex_index");
                faces.clear();
                for _ in 0..count {
                    let value = source.next(property.scalar).ok_or_else(cut)?;
                    if corners {
                        faces.push(corner(value)?);
                    }
                    if let Some(axis) = place.iter().position(|&p| p == Some(position))
                        && let Some(slot) = xyz.get_mut(axis)
                    {
                        *slot = value;
                    }
                }
                if corners {
                    surface.fan(&faces)?;
                }
            }
            if is_vertex {
                surface.positions.push(Point::from(xyz));
            } else if element.properties.is_empty() {
                break;
            }
        }
    }
    surface.finish(name, FORMAT, frame, Unit::Unstated, Vec::new())
}

struct Property {
    name: String,
    /// Type of a list's length.
    list: Option<Scalar>,
    scalar: Scalar,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

/// Byte order, `None` for text, and what the header declares.
fn declared(header: &str) -> Result<(Option<Endian>, Vec<Element>), Fault> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for (number, line) in (1_usize..).zip(header.lines()) {
        let words = line.split_ascii_whitespace().collect::<Vec<_>>();
        let wrong = || Fault::Broken(format!("line {number} of its header is not PLY"));
        match words.as_slice() {
            ["ply"] if number == 1 => {}
            _ if number == 1 => return Err("it does not begin with \"ply\"".into()),
            ["format", kind, "1.0"] => {
                encoding = Some(match *kind {
                    "ascii" => None,
                    "binary_little_endian" => Some(Endian::Little),
                    "binary_big_endian" => Some(Endian::Big),
                    _ => return Err(wrong()),
                });
            }
            ["element", name, count] => elements.push(Element {
                name: (*name).to_owned(),
                count: count.parse().map_err(|_error: std::num::ParseIntError| wrong())?,
                properties: Vec::new(),
            }),
            ["property", kind @ .., name] => {
                let (list, scalar) = match kind {
                    ["list", length, scalar] => (Some(scalar_of(length).ok_or_else(wrong)?), scalar),
                    [scalar] => (None, scalar),
                    _ => return Err(wrong()),
                };
                let scalar = scalar_of(scalar).ok_or_else(wrong)?;
                let element = elements.last_mut().ok_or_else(wrong)?;
                element.properties.push(Property { name: (*name).to_owned(), list, scalar });
            }
            [] | ["comment" | "obj_info", ..] => {}
            _ => return Err(wrong()),
        }
    }
    Ok((encoding.ok_or("its header names no format")?, elements))
}

fn scalar_of(word: &str) -> Option<Scalar> {
    Some(match word {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}

/// What is left of the body.
enum Source<'a> {
    Words(&'a [u8]),
    Binary(&'a [u8], Endian),
}

impl Source<'_> {
    /// The next number, if there is one.
    fn next(&mut self, scalar: Scalar) -> Option<f64> {
        match self {
            Self::Words(rest) => {
                let start = rest.trim_ascii_start();
                let end = start.iter().position(u8::is_ascii_whitespace).unwrap_or(start.len());
                let (word, after) = start.split_at_checked(end)?;
                *rest = after;
                std::str::from_utf8(word).ok()?.parse().ok()
            }
            Self::Binary(rest, endian) => {
                let (number, after) = split(rest, scalar.size() as u64)?;
                *rest = after;
                scalar.one(number, *endian)
            }
        }
    }
}

/// A list's length.
fn length(value: f64) -> Result<u64, Fault> {
    corner(value).map(u64::from)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be a u32")]
fn corner(value: f64) -> Result<u32, Fault> {
    if value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0 {
        return Ok(value as u32);
    }
    Err(format!("a face has a length or a corner of {value}").into())
}

#[cfg(test)]
#[expect(clippy::indexing_slicing, clippy::cast_possible_truncation, reason = "a test may fail loudly")]
mod tests {
    use render::volume::TriangleMesh;

    use super::super::Content;
    use super::super::bytes::trial::survives;
    use super::*;

    fn mesh(item: &Item) -> &TriangleMesh {
        let Content::Mesh(mesh) = &item.content else { panic!("not a mesh") };
        mesh
    }

    fn header(format: &str) -> String {
        format!(
            "ply\nformat {format} 1.0\ncomment made here\nelement material 1\nproperty list uchar short ids\n\
             element vertex 4\nproperty uchar red\nproperty float x\nproperty double y\nproperty float z\n\
             element face 2\nproperty list uchar int vertex_indices\nproperty uchar flags\nend_header\n"
        )
    }

    /// A square of side 2, as one triangle and one quadrilateral.
    fn words() -> String {
        header("ascii") + "2 7 8\n9 0 0 0\n9 2 0 0\n9 2 2 0\n9 0 2 0\n3 0 1 2 5\n4 0 1 2 3 5\n"
    }

    fn bytes(endian: Endian) -> Vec<u8> {
        let big = endian == Endian::Big;
        let order = |mut bytes: Vec<u8>| {
            if !big {
                bytes.reverse();
            }
            bytes
        };
        let mut file = header(if big { "binary_big_endian" } else { "binary_little_endian" }).into_bytes();
        file.push(2);
        file.extend(order(7_i16.to_be_bytes().to_vec()));
        file.extend(order(8_i16.to_be_bytes().to_vec()));
        for (x, y) in [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)] {
            file.push(9);
            file.extend(order(f32::to_be_bytes(x).to_vec()));
            file.extend(order(f64::to_be_bytes(y).to_vec()));
            file.extend([0; 4]);
        }
        for corners in [&[0, 1, 2][..], &[0, 1, 2, 3]] {
            file.push(corners.len() as u8);
            for corner in corners {
                file.extend(order(i32::to_be_bytes(*corner).to_vec()));
            }
            file.push(5);
        }
        file
    }

    #[test]
    fn text_and_both_byte_orders_give_the_same_mesh() {
        let text = parse(words().as_bytes(), "a".to_owned()).expect("text");
        assert_eq!(mesh(&text).triangles(), [[0, 1, 2], [0, 1, 2], [0, 2, 3]], "a fan");
        assert_eq!(mesh(&text).bounds()[1], Point::new(2.0, 2.0, 0.0), "other properties are passed");
        for endian in [Endian::Little, Endian::Big] {
            let binary = parse(&bytes(endian), "a".to_owned()).expect("binary");
            assert_eq!(mesh(&binary), mesh(&text), "{endian:?}");
        }
    }

    #[test]
    fn what_is_not_there_is_told() {
        let told = |file: &[u8]| match parse(file, "a".to_owned()) {
            Err(Fault::Broken(fault)) => fault,
            other => panic!("{other:?}"),
        };
        let cut = bytes(Endian::Little);
        assert_eq!(told(&cut[..cut.len() - 1]), "it ends in face 1 of 2", "cut");
        let many = words().replace("element vertex 4", "element vertex 4000000000");
        assert!(told(many.as_bytes()).starts_with("it ends in vertex"), "a count that lies");
        let far = words().replace("4 0 1 2 3", "4 0 1 2 4");
        assert!(told(far.as_bytes()).contains("names vertex 4, but there are only 4"), "out of range");
        let negative = words().replace("4 0 1 2 3", "4 0 1 2 -1");
        assert!(told(negative.as_bytes()).contains("-1"), "negative");
        let flat = words().replace("property float z\n", "property float w\n");
        assert!(told(flat.as_bytes()).contains("no x, y and z"), "no z");
        let nan = words().replace("9 2 2 0", "9 2 nan 0");
        assert!(told(nan.as_bytes()).contains("not finite"), "NaN");
    }

    #[test]
    fn an_element_without_properties_does_not_take_for_ever() {
        let text = words().replace("element vertex", "element nothing 18446744073709551615\nelement vertex");
        assert!(parse(text.as_bytes(), "a".to_owned()).is_ok(), "passed at once");
    }

    #[test]
    fn slicers_comment_says_the_frame() {
        let text = words().replace("made here", "3D Slicer output. SPACE=RAS");
        let item = parse(text.as_bytes(), "a".to_owned()).expect("a mesh");
        assert_eq!(mesh(&item).bounds()[0], Point::new(-2.0, -2.0, 0.0), "turned");
    }

    #[test]
    fn no_byte_makes_it_panic() {
        survives(words().as_bytes(), |bytes| parse(bytes, String::new()));
        survives(&bytes(Endian::Little), |bytes| parse(bytes, String::new()));
    }
}
