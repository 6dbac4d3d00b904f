//! VTK's XML files: the tags, and the arrays as text, base64 or raw bytes, compressed or not.
//!
//! A raw appended block makes the file no XML any more, so the tags before it are read alone.

use std::io::Read;

use render::volume::Point;
use render::volume::cells::Values;
use roxmltree::{Document, Node};

use super::super::bytes::{Base64, Endian, Fault, Scalar, afford};
use super::super::surface::Frame;
use super::super::{Limits, Note, Severity};
use super::Parsed;
use super::dataset::{Array, Dataset};

/// What the file says.
pub(super) fn parse(file: &[u8], limits: &Limits) -> Result<Parsed, Fault> {
    const TAG: &[u8] = b"<AppendedData";
    let cut = file.windows(TAG.len()).position(|part| part == TAG);
    let (tags, appended) = file.split_at_checked(cut.unwrap_or(file.len())).unwrap_or((file, &[]));
    let mut text =
        String::from_utf8(tags.to_vec()).map_err(|_error| Fault::from("its tags are not UTF-8"))?;
    if cut.is_some() {
        text.push_str("</VTKFile>");
    }
    let options = roxmltree::ParsingOptions { nodes_limit: 10_000_000, ..Default::default() };
    let document = Document::parse_with_options(&text, options)
        .map_err(|error| format!("its tags do not fit together ({error})"))?;
    let root = document.root_element();
    if !root.has_tag_name("VTKFile") {
        return Err(Fault::Broken("its first tag is not VTKFile".to_owned()));
    }
    let kind = root.attribute("type").unwrap_or_default();
    let body = root.children().find(|child| child.has_tag_name(kind)).ok_or("it has no data set")?;
    match kind {
        "Collection" => body
            .children()
            .filter(|child| child.has_tag_name("DataSet"))
            .map(entry)
            .collect::<Result<_, _>>()
            .map(Parsed::Steps),
        "PUnstructuredGrid" | "PPolyData" => {
            let pieces = body.children().filter(|child| child.has_tag_name("Piece"));
            let source = |piece: Node<'_, '_>| piece.attribute("Source").map(str::to_owned);
            Ok(Parsed::Pieces(pieces.map(source).collect::<Option<_>>().ok_or("a piece names no file")?))
        }
        "UnstructuredGrid" | "PolyData" => {
            let arrays = Arrays::new(&root, appended, limits)?;
            let mut all = Dataset::empty();
            for piece in body.children().filter(|child| child.has_tag_name("Piece")) {
                all.append(arrays.piece(&piece)?);
            }
            let title = tags.get(..tags.len().min(4096)).unwrap_or_default();
            Frame::in_text(title).into_lps(&mut all.points, &mut all.notes);
            Ok(Parsed::Dataset(all))
        }
        "ImageData" | "PImageData" => {
            Err(Fault::Unsupported("an image".to_owned(), "save it as MetaImage, NRRD or NIfTI"))
        }
        _ => Err(Fault::Unsupported(
            format!("a data set of type {kind:?}"),
            "save it as an unstructured grid (.vtu) or a surface (.vtp)",
        )),
    }
}

fn entry(dataset: Node<'_, '_>) -> Result<(f64, String), Fault> {
    let time = dataset.attribute("timestep").unwrap_or("0").trim().parse().ok();
    let time = time.filter(|time: &f64| time.is_finite()).ok_or("a step's time is not a finite number")?;
    Ok((time, dataset.attribute("file").ok_or("a step names no file")?.to_owned()))
}

#[derive(Clone, Copy)]
enum Compressor {
    Zlib,
    Lz4,
    Lzma,
}

/// How the arrays of a file are written.
struct Arrays<'a> {
    endian: Endian,
    /// Of the numbers before each block.
    header: Scalar,
    compressor: Option<Compressor>,
    /// What follows the underscore, and whether it is base64.
    appended: Option<(&'a [u8], bool)>,
    limits: &'a Limits,
}

impl<'a> Arrays<'a> {
    fn new(root: &Node<'_, '_>, appended: &'a [u8], limits: &'a Limits) -> Result<Self, Fault> {
        let endian = match root.attribute("byte_order") {
            Some("BigEndian") => Endian::Big,
            _ => Endian::Little,
        };
        let header = match root.attribute("header_type") {
            Some("UInt64") => Scalar::U64,
            _ => Scalar::U32,
        };
        let compressor = match root.attribute("compressor") {
            None | Some("") => None,
            Some("vtkZLibDataCompressor") => Some(Compressor::Zlib),
            Some("vtkLZ4DataCompressor") => Some(Compressor::Lz4),
            Some("vtkLZMADataCompressor") => Some(Compressor::Lzma),
            Some(other) => {
                return Err(Fault::Unsupported(
                    format!("{other:?}"),
                    "save it with zlib compression or none",
                ));
            }
        };
        let appended = match appended.iter().position(|&byte| byte == b'>') {
            Some(end) => {
                let (tag, rest) = appended.split_at_checked(end).unwrap_or_default();
                let base64 = tag.windows(6).any(|part| part.eq_ignore_ascii_case(b"base64"));
                let start =
                    rest.iter().position(|&byte| byte == b'_').ok_or("its appended data do not begin")?;
                Some((rest.get(start.saturating_add(1)..).unwrap_or_default(), base64))
            }
            None => None,
        };
        Ok(Self { endian, header, compressor, appended, limits })
    }

    fn piece(&self, piece: &Node<'_, '_>) -> Result<Dataset, Fault> {
        let count = |name: &str| -> Result<u64, Fault> {
            let text = piece.attribute(name).unwrap_or("0").trim();
            text.parse().map_err(|_error| format!("{name} is not a number").into())
        };
        let section = |name: &str| piece.children().find(|child| child.has_tag_name(name));
        let mut dataset = Dataset::empty();
        let points = count("NumberOfPoints")?;
        if points > 0 {
            let array = section("Points")
                .and_then(|points| points.children().find(is_array))
                .ok_or("it has no points")?;
            let numbers = self.values(&array, points.saturating_mul(3))?;
            let numbers: Vec<f64> = numbers.iter().collect();
            dataset.points = numbers.as_chunks().0.iter().map(|&xyz: &[f64; 3]| Point::from(xyz)).collect();
        }
        let cells = count("NumberOfCells")?;
        if cells > 0 {
            let cells_node = section("Cells").ok_or("it has no cells")?;
            let types = self.positions(&named(&cells_node, "types")?, cells)?;
            let types = types.into_iter().map(|code| u8::try_from(code).unwrap_or(0)).collect::<Vec<_>>();
            self.cells(&cells_node, &types, &mut dataset)?;
        }
        // vtkCellType of a poly-line, a polygon and a strip; vertices are a poly-vertex.
        let mut faces = 0_u64;
        for (name, number, code) in [
            ("Verts", "NumberOfVerts", 2),
            ("Lines", "NumberOfLines", 4),
            ("Polys", "NumberOfPolys", 7),
            ("Strips", "NumberOfStrips", 6),
        ] {
            let own = count(number)?;
            if own > 0 {
                let node = section(name).ok_or_else(|| format!("it has no {name}"))?;
                self.cells(&node, &vec![code; afford(own, 1, self.limits)?], &mut dataset)?;
            }
            faces = faces.saturating_add(own);
        }
        let cells = cells.saturating_add(faces);
        if let Some(node) = section("PointData") {
            dataset.point_arrays = self.fields(&node, points, &mut dataset.notes)?;
        }
        if let Some(node) = section("CellData") {
            dataset.cell_arrays = self.fields(&node, cells, &mut dataset.notes)?;
        }
        Ok(dataset)
    }

    fn cells(&self, node: &Node<'_, '_>, types: &[u8], dataset: &mut Dataset) -> Result<(), Fault> {
        let ends = self.positions(&named(node, "offsets")?, types.len() as u64)?;
        let corners = ends
            .last()
            .copied()
            .and_then(|end| u64::try_from(end).ok())
            .ok_or("a cell ends before it begins")?;
        let corners = self.positions(&named(node, "connectivity")?, corners)?;
        dataset.add_cells(types, &ends, &corners)
    }

    fn fields(&self, node: &Node<'_, '_>, tuples: u64, notes: &mut Vec<Note>) -> Result<Vec<Array>, Fault> {
        let mut fields = Vec::new();
        for array in node.children().filter(is_array) {
            let name = array.attribute("Name").unwrap_or_default().to_owned();
            let components = array.attribute("NumberOfComponents").unwrap_or("1").trim().parse::<usize>();
            let components = components.ok().filter(|&components| components > 0);
            let components = components.ok_or("a field has a number of components that is none")?;
            if scalar_of(&array).is_none() {
                notes.push(Note {
                    severity: Severity::Loss,
                    code: "vtk.field-dropped",
                    text: "A field that is not of numbers was left out.".to_owned(),
                });
                continue;
            }
            let values = self.values(&array, tuples.saturating_mul(components as u64))?;
            fields.push(Array { name, components, values });
        }
        Ok(fields)
    }

    /// The `count` numbers of an array.
    fn values(&self, array: &Node<'_, '_>, count: u64) -> Result<Values, Fault> {
        let scalar = scalar_of(array).ok_or("an array is not of numbers")?;
        let count = afford(count, scalar.size(), self.limits)?;
        if array.attribute("format") == Some("ascii") {
            return if scalar.fits_f32() {
                Ok(Values::F32(words(array, count)?))
            } else {
                Ok(Values::F64(words(array, count)?))
            };
        }
        Ok(scalar.values(&self.bytes(array, count.saturating_mul(scalar.size()))?, self.endian))
    }

    /// The `count` whole numbers of an array.
    fn positions(&self, array: &Node<'_, '_>, count: u64) -> Result<Vec<i64>, Fault> {
        let scalar = scalar_of(array).ok_or("an array is not of numbers")?;
        let count = afford(count, scalar.size(), self.limits)?;
        if array.attribute("format") == Some("ascii") {
            return words(array, count);
        }
        Ok(scalar.positions(&self.bytes(array, count.saturating_mul(scalar.size()))?, self.endian))
    }

    /// The `needed` bytes of an array.
    fn bytes(&self, array: &Node<'_, '_>, needed: usize) -> Result<Vec<u8>, Fault> {
        let named = |fault: Fault| match fault {
            Fault::Broken(clause) => {
                Fault::Broken(format!("array \"{}\": {clause}", array.attribute("Name").unwrap_or_default()))
            }
            other => other,
        };
        if needed == 0 {
            return Ok(Vec::new());
        }
        let result = match array.attribute("format") {
            Some("appended") => {
                let (data, base64) = self.appended.ok_or("its appended data are missing")?;
                let offset = array.attribute("offset").and_then(|offset| offset.trim().parse::<usize>().ok());
                let data = offset
                    .and_then(|offset| data.get(offset..))
                    .ok_or("an array lies past the end of the file")?;
                if base64 {
                    self.decoded(&mut Base64::new(data), needed)
                } else {
                    self.decoded(&mut { data }, needed)
                }
            }
            _ => self.decoded(&mut Base64::new(array.text().unwrap_or_default().as_bytes()), needed),
        };
        result.map_err(named)
    }

    /// The `needed` bytes that a header announces at the front of `source`.
    fn decoded(&self, source: &mut dyn Read, needed: usize) -> Result<Vec<u8>, Fault> {
        let Some(compressor) = self.compressor else {
            let announced = self.header_numbers(source, 1)?;
            if announced != [needed as u64] {
                return Err(format!("it announces {announced:?} bytes but needs {needed}").into());
            }
            return exactly(source, needed);
        };
        let head = self.header_numbers(source, 3)?;
        let &[blocks, block, last] = head.as_slice() else { return Err("its header is cut".into()) };
        let partial = u64::from(last > 0);
        let total = blocks
            .checked_sub(partial)
            .and_then(|full| full.checked_mul(block))
            .and_then(|n| n.checked_add(last));
        if total != Some(needed as u64) {
            return Err(
                format!("it announces {blocks} blocks of {block} bytes but needs {needed} bytes").into()
            );
        }
        let sizes = self.header_numbers(source, usize::try_from(blocks).unwrap_or(usize::MAX))?;
        let mut bytes = Vec::new();
        for size in sizes {
            let left = needed.saturating_sub(bytes.len());
            let own = usize::try_from(block).unwrap_or(usize::MAX).min(left);
            let packed = exactly(source, usize::try_from(size).unwrap_or(usize::MAX))?;
            unpack(compressor, &packed, own, &mut bytes)?;
        }
        if bytes.len() == needed {
            Ok(bytes)
        } else {
            Err(format!("it has {} bytes but needs {needed}", bytes.len()).into())
        }
    }

    fn header_numbers(&self, source: &mut dyn Read, count: usize) -> Result<Vec<u64>, Fault> {
        let bytes = exactly(source, count.saturating_mul(self.header.size()))?;
        let numbers = self.header.positions(&bytes, self.endian).into_iter();
        numbers.map(|n| u64::try_from(n).map_err(|_error| "its header is endless".into())).collect()
    }
}

fn is_array(node: &Node<'_, '_>) -> bool {
    node.has_tag_name("DataArray") || node.has_tag_name("Array")
}

fn named<'a, 'input>(node: &Node<'a, 'input>, name: &str) -> Result<Node<'a, 'input>, Fault> {
    let found = node.children().find(|child| is_array(child) && child.attribute("Name") == Some(name));
    found.ok_or_else(|| format!("its cells have no {name}").into())
}

fn scalar_of(array: &Node<'_, '_>) -> Option<Scalar> {
    Some(match array.attribute("type")? {
        "Int8" => Scalar::I8,
        "UInt8" => Scalar::U8,
        "Int16" => Scalar::I16,
        "UInt16" => Scalar::U16,
        "Int32" => Scalar::I32,
        "UInt32" => Scalar::U32,
        "Int64" => Scalar::I64,
        "UInt64" => Scalar::U64,
        "Float32" => Scalar::F32,
        "Float64" => Scalar::F64,
        _ => return None,
    })
}

/// Exactly `count` numbers of text.
fn words<T: std::str::FromStr>(array: &Node<'_, '_>, count: usize) -> Result<Vec<T>, Fault> {
    let name = array.attribute("Name").unwrap_or_default();
    let words = array.text().unwrap_or_default().split_ascii_whitespace();
    let numbers: Option<Vec<T>> = words.map(|word| word.parse().ok()).collect();
    let numbers = numbers.ok_or_else(|| format!("array \"{name}\" has a word that is no number"))?;
    if numbers.len() != count {
        return Err(format!("array \"{name}\" has {} numbers but needs {count}", numbers.len()).into());
    }
    Ok(numbers)
}

/// The next `count` bytes; memory grows as they come, so a count that lies takes none.
fn exactly(source: &mut dyn Read, count: usize) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    source.take(count as u64).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if bytes.len() == count {
        Ok(bytes)
    } else {
        Err(format!("it ends {} bytes early", count.saturating_sub(bytes.len())).into())
    }
}

/// Adds the `size` bytes that `packed` stands for.
fn unpack(compressor: Compressor, packed: &[u8], size: usize, bytes: &mut Vec<u8>) -> Result<(), Fault> {
    let before = bytes.len();
    let end = before.saturating_add(size);
    let broken = |what: String| Fault::Broken(format!("a compressed block cannot be unpacked ({what})"));
    match compressor {
        Compressor::Zlib => {
            let mut decoder = flate2::read::ZlibDecoder::new(packed).take(size as u64);
            decoder.read_to_end(bytes).map_err(|error| broken(error.to_string()))?;
        }
        Compressor::Lz4 => {
            // LZ4 cannot do better than 255 to 1.
            if size > packed.len().saturating_mul(255).saturating_add(64) {
                return Err(broken("it is too short".to_owned()));
            }
            bytes.resize(end, 0);
            let space = bytes.get_mut(before..).unwrap_or_default();
            let written =
                lz4_flex::block::decompress_into(packed, space).map_err(|error| broken(error.to_string()))?;
            bytes.truncate(before.saturating_add(written));
        }
        Compressor::Lzma => {
            let mut sink = Bounded { bytes, end };
            lzma_rs::xz_decompress(&mut { packed }, &mut sink).map_err(|error| broken(error.to_string()))?;
        }
    }
    if bytes.len() == end { Ok(()) } else { Err(broken("its length is wrong".to_owned())) }
}

/// Takes bytes up to an end and refuses more.
struct Bounded<'a> {
    bytes: &'a mut Vec<u8>,
    end: usize,
}

impl std::io::Write for Bounded<'_> {
    fn write(&mut self, more: &[u8]) -> std::io::Result<usize> {
        if more.len() > self.end.saturating_sub(self.bytes.len()) {
            return Err(std::io::Error::other("it is too long"));
        }
        self.bytes.extend_from_slice(more);
        Ok(more.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
