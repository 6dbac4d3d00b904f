//! VTK's legacy files: lines of words, with the numbers as words or big-endian bytes.

use render::volume::Point;
use render::volume::cells::Values;

use super::super::bytes::{Endian, Fault, Scalar, afford, split};
use super::super::surface::Frame;
use super::super::{Limits, Note, Severity};
use super::dataset::{Array, Dataset};

/// What the file says.
pub(super) fn parse(file: &[u8], limits: &Limits) -> Result<Dataset, Fault> {
    let mut reader = Reader { rest: file, binary: false, limits };
    reader.raw_line();
    let title = reader.raw_line();
    let mut dataset = Dataset::empty();
    reader.binary = match reader.line().as_slice() {
        [word] if word.eq_ignore_ascii_case("ASCII") => false,
        [word] if word.eq_ignore_ascii_case("BINARY") => true,
        _ => return Err("its third line is neither ASCII nor BINARY".into()),
    };
    let mut place = Place::Nowhere;
    let mut lists = Vec::new();
    let mut types = Vec::new();
    loop {
        let words = reader.line();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let [keyword, rest @ ..] = words.as_slice() else { break };
        match (keyword.to_ascii_uppercase().as_str(), rest) {
            ("DATASET", [kind]) => supported(kind)?,
            ("POINTS", [count, scalar]) => {
                let numbers = reader.values(number(count)?.saturating_mul(3), scalar)?;
                let numbers: Vec<f64> = numbers.iter().collect();
                dataset.points =
                    numbers.as_chunks().0.iter().map(|&xyz: &[f64; 3]| Point::from(xyz)).collect();
            }
            ("CELLS", [a, b]) => lists.push((None, reader.list(number(a)?, number(b)?)?)),
            ("CELL_TYPES", [count]) => types = reader.positions(number(count)?, "int")?,
            ("VERTICES", [a, b]) => lists.push((Some(2), reader.list(number(a)?, number(b)?)?)),
            ("LINES", [a, b]) => lists.push((Some(4), reader.list(number(a)?, number(b)?)?)),
            ("POLYGONS", [a, b]) => lists.push((Some(7), reader.list(number(a)?, number(b)?)?)),
            ("TRIANGLE_STRIPS", [a, b]) => lists.push((Some(6), reader.list(number(a)?, number(b)?)?)),
            ("POINT_DATA", [count]) => place = Place::Points(number(count)?),
            ("CELL_DATA", [count]) => place = Place::Cells(number(count)?),
            ("METADATA", []) => while !reader.raw_line().trim_ascii().is_empty() {},
            (keyword, rest) => {
                let arrays = reader.attribute(keyword, rest, place, &mut dataset.notes)?;
                match place {
                    Place::Points(_) => dataset.point_arrays.extend(arrays),
                    Place::Cells(_) => dataset.cell_arrays.extend(arrays),
                    // Of the whole data set: not used.
                    Place::Nowhere => {}
                }
            }
        }
    }
    Frame::in_text(title).into_lps(&mut dataset.points, &mut dataset.notes);
    let types = types.into_iter().map(|code| u8::try_from(code).unwrap_or(0)).collect::<Vec<_>>();
    for (code, (ends, corners)) in lists {
        match code {
            Some(code) => dataset.add_cells(&vec![code; ends.len()], &ends, &corners)?,
            None => dataset.add_cells(&types, &ends, &corners)?,
        }
    }
    Ok(dataset)
}

fn supported(kind: &str) -> Result<(), Fault> {
    match kind.to_ascii_uppercase().as_str() {
        "UNSTRUCTURED_GRID" | "POLYDATA" => Ok(()),
        "STRUCTURED_POINTS" => {
            Err(Fault::Unsupported("an image".to_owned(), "save it as MetaImage, NRRD or NIfTI"))
        }
        _ => Err(Fault::Unsupported(
            format!("a data set of type {kind:?}"),
            "save it as an unstructured grid (.vtu) or a surface (.vtp)",
        )),
    }
}

fn number(word: &str) -> Result<u64, Fault> {
    word.parse().map_err(|_error| format!("{word:?} stands where a count should").into())
}

/// What the attributes that follow belong to, and how many tuples they have.
#[derive(Clone, Copy)]
enum Place {
    Nowhere,
    Points(u64),
    Cells(u64),
}

struct Reader<'a> {
    rest: &'a [u8],
    binary: bool,
    limits: &'a Limits,
}

impl<'a> Reader<'a> {
    /// The rest of this line.
    fn raw_line(&mut self) -> &'a [u8] {
        let end = self.rest.iter().position(|&byte| byte == b'\n').unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at_checked(end).unwrap_or_default();
        self.rest = rest.get(1..).unwrap_or_default();
        line
    }

    /// The words of the next line that has any; none at the end.
    fn line(&mut self) -> Vec<String> {
        self.rest = self.rest.trim_ascii_start();
        let line = String::from_utf8_lossy(self.raw_line());
        line.split_ascii_whitespace().map(str::to_owned).collect()
    }

    /// Whether the next line begins with that word.
    fn begins(&self, word: &str) -> bool {
        let start = self.rest.trim_ascii_start().get(..word.len());
        start.is_some_and(|start| start.eq_ignore_ascii_case(word.as_bytes()))
    }

    fn words<T: std::str::FromStr>(&mut self, count: usize) -> Result<Vec<T>, Fault> {
        let mut numbers = Vec::new();
        for _ in 0..count {
            let start = self.rest.trim_ascii_start();
            let end = start.iter().position(u8::is_ascii_whitespace).unwrap_or(start.len());
            let (word, rest) = start.split_at_checked(end).unwrap_or_default();
            self.rest = rest;
            let number = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
            numbers.push(number.ok_or_else(|| {
                format!("number {} of {count} is {:?}", numbers.len(), String::from_utf8_lossy(word))
            })?);
        }
        Ok(numbers)
    }

    fn bytes(&mut self, count: u64, scalar: Scalar) -> Result<&'a [u8], Fault> {
        let needed = count.saturating_mul(scalar.size() as u64);
        let found = split(self.rest, needed);
        let (bytes, rest) = found.ok_or_else(|| format!("it ends inside an array of {count} numbers"))?;
        self.rest = rest;
        Ok(bytes)
    }

    /// The next `count` numbers of the type with that name.
    fn values(&mut self, count: u64, name: &str) -> Result<Values, Fault> {
        let scalar = self.scalar(name)?;
        let length = afford(count, scalar.size(), self.limits)?;
        match (self.binary, scalar.fits_f32()) {
            (true, _) => Ok(scalar.values(self.bytes(count, scalar)?, Endian::Big)),
            (false, true) => Ok(Values::F32(self.words(length)?)),
            (false, false) => Ok(Values::F64(self.words(length)?)),
        }
    }

    /// The next `count` whole numbers of the type with that name.
    fn positions(&mut self, count: u64, name: &str) -> Result<Vec<i64>, Fault> {
        let scalar = self.scalar(name)?;
        let length = afford(count, 8, self.limits)?;
        if self.binary {
            return Ok(scalar.positions(self.bytes(count, scalar)?, Endian::Big));
        }
        self.words(length)
    }

    fn scalar(&self, name: &str) -> Result<Scalar, Fault> {
        Ok(match name.to_ascii_lowercase().as_str() {
            "char" | "signed_char" => Scalar::I8,
            "unsigned_char" => Scalar::U8,
            "short" => Scalar::I16,
            "unsigned_short" => Scalar::U16,
            // VTK writes its index type as an int here.
            "int" | "vtkidtype" => Scalar::I32,
            "unsigned_int" => Scalar::U32,
            "long" | "long_long" | "vtktypeint64" => Scalar::I64,
            "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => Scalar::U64,
            "float" => Scalar::F32,
            "double" => Scalar::F64,
            "bit" if !self.binary => Scalar::U8,
            "bit" | "string" | "utf8_string" | "variant" | "unicode_string" => {
                let feature = format!("an array of type {name:?}");
                return Err(Fault::Unsupported(feature, "save it as .vtu, or without that array"));
            }
            _ => return Err(format!("{name:?} stands where a type should").into()),
        })
    }

    /// Where each cell ends, and the corners of all.
    fn list(&mut self, a: u64, b: u64) -> Result<(Vec<i64>, Vec<i64>), Fault> {
        if self.begins("OFFSETS") {
            // Version 5: `a` offsets, the first of them 0, and `b` corners.
            let words = self.line();
            let mut ends = self.positions(a, words.get(1).map_or("", String::as_str))?;
            if ends.first() != Some(&0) {
                return Err("its first cell does not begin at 0".into());
            }
            ends.remove(0);
            let words = self.line();
            let [keyword, scalar] = words.as_slice() else {
                return Err("its cells have no CONNECTIVITY".into());
            };
            if !keyword.eq_ignore_ascii_case("CONNECTIVITY") {
                return Err("its cells have no CONNECTIVITY".into());
            }
            return Ok((ends, self.positions(b, scalar)?));
        }
        // Before: `b` numbers, for each of `a` cells its number of corners and them.
        let numbers = self.positions(b, "int")?;
        let mut ends = Vec::new();
        let mut corners = Vec::new();
        let mut rest = numbers.as_slice();
        while let Some((&count, after)) = rest.split_first() {
            let own = usize::try_from(count).ok().and_then(|count| after.split_at_checked(count));
            let (own, after) = own.ok_or_else(|| format!("cell {} has {count} corners", ends.len()))?;
            corners.extend_from_slice(own);
            ends.push(i64::try_from(corners.len()).unwrap_or(i64::MAX));
            rest = after;
        }
        if ends.len() as u64 != a {
            return Err(format!("it announces {a} cells but has {}", ends.len()).into());
        }
        Ok((ends, corners))
    }

    /// The arrays that a line beginning with `keyword` stands for.
    fn attribute(
        &mut self,
        keyword: &str,
        rest: &[&str],
        place: Place,
        notes: &mut Vec<Note>,
    ) -> Result<Vec<Array>, Fault> {
        let tuples = match place {
            Place::Nowhere => 0,
            Place::Points(count) | Place::Cells(count) => count,
        };
        let (name, components, scalar) = match (keyword, rest) {
            ("FIELD", [_, count]) => return self.field(number(count)?, notes),
            ("SCALARS" | "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS", [name, scalar]) => (name, 1, *scalar),
            ("SCALARS", [name, scalar, components]) | ("TEXTURE_COORDINATES", [name, components, scalar]) => {
                (name, number(components)?, *scalar)
            }
            ("VECTORS" | "NORMALS", [name, scalar]) => (name, 3, *scalar),
            ("TENSORS", [name, scalar]) => (name, 9, *scalar),
            ("TENSORS6", [name, scalar]) => (name, 6, *scalar),
            ("COLOR_SCALARS", [name, components]) => {
                (name, number(components)?, if self.binary { "unsigned_char" } else { "float" })
            }
            ("LOOKUP_TABLE", [_, size]) => {
                // Colours of its own: read past.
                let scalar = if self.binary { "unsigned_char" } else { "float" };
                self.values(number(size)?.saturating_mul(4), scalar)?;
                return Ok(Vec::new());
            }
            _ => return Err(format!("a line begins with {keyword:?}").into()),
        };
        if keyword == "SCALARS" && self.begins("LOOKUP_TABLE") {
            self.line();
        }
        if matches!(place, Place::Nowhere) {
            return Err(format!("{keyword} stands before POINT_DATA and CELL_DATA").into());
        }
        let components = usize::try_from(components).ok().filter(|&components| components > 0);
        let components = components.ok_or_else(|| format!("field {name:?} has no component"))?;
        let values = self.values(tuples.saturating_mul(components as u64), scalar)?;
        Ok(vec![Array { name: unescaped(name), components, values }])
    }

    /// Arrays that each say their own size.
    fn field(&mut self, count: u64, notes: &mut Vec<Note>) -> Result<Vec<Array>, Fault> {
        let mut arrays = Vec::new();
        for _ in 0..count {
            let mut words = self.line();
            while words.first().is_some_and(|word| word == "METADATA") {
                while !self.raw_line().trim_ascii().is_empty() {}
                words = self.line();
            }
            let [name, components, tuples, scalar] = words.as_slice() else {
                return Err("an array of a field has no name, size and type".into());
            };
            let (components, tuples) = (number(components)?, number(tuples)?);
            if scalar == "string" && !self.binary {
                for _ in 0..components.saturating_mul(tuples) {
                    if self.rest.is_empty() {
                        return Err("it ends inside an array of text".into());
                    }
                    self.raw_line();
                }
                notes.push(Note {
                    severity: Severity::Loss,
                    code: "vtk.field-dropped",
                    text: "A field that is not of numbers was left out.".to_owned(),
                });
                continue;
            }
            let values = self.values(components.saturating_mul(tuples), scalar)?;
            let components = usize::try_from(components).unwrap_or(usize::MAX);
            arrays.push(Array { name: unescaped(name), components, values });
        }
        Ok(arrays)
    }
}

/// VTK writes spaces and the like in names as `%20`; what is no such sign stays.
fn unescaped(name: &str) -> String {
    super::super::bytes::unescaped(name).unwrap_or_else(|| name.to_owned())
}
