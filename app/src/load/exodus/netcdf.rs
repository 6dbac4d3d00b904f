//! Classic netCDF, versions 1, 2 and 5: a list of named arrays, big-endian, by offset.
//!
//! Read here since `netcdf3` 0.6 reserves memory for as many entries as the header announces, and knows
//! no version 5. Here nothing is copied: each slab is cut out of the file's own bytes, or is not there.
//!
//! Source: Unidata, *User's Guide of netCDF*, "Classic Format Specification"; CDF-5 of parallel netCDF.

use super::super::bytes::{Endian, Fault, Scalar, split};

/// An array of the file.
#[derive(Debug)]
pub(super) struct Variable {
    pub(super) name: String,
    /// Positions in the list of dimensions, slowest first.
    dimensions: Vec<usize>,
    /// Its attributes of text.
    texts: Vec<(String, String)>,
    scalar: Scalar,
    begin: u64,
    /// Whether its slowest dimension is the one that grows.
    grows: bool,
    /// Bytes of one step of its slowest dimension.
    slab: u64,
}

impl Variable {
    /// What an attribute of text says.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        self.texts.iter().find(|(key, _)| key == name).map(|(_, text)| text.as_str())
    }
}

/// A file's arrays.
#[derive(Debug)]
pub(super) struct Netcdf<'a> {
    file: &'a [u8],
    dimensions: Vec<u64>,
    variables: Vec<Variable>,
    records: u64,
    record: u64,
}

impl<'a> Netcdf<'a> {
    /// Reads the header.
    pub(super) fn new(file: &'a [u8]) -> Result<Self, Fault> {
        let body = file.strip_prefix(b"CDF").and_then(<[u8]>::split_first);
        let (&version, rest) = body.ok_or("it is no classic netCDF")?;
        if !matches!(version, 1 | 2 | 5) {
            return Err(format!("its netCDF version is {version}").into());
        }
        let mut header = Header { rest, wide_counts: version == 5, wide_offsets: version != 1 };
        let announced = header.count()?;
        let endless = if version == 5 { u64::MAX } else { u64::from(u32::MAX) };
        let mut dimensions = Vec::new();
        for _ in 0..header.list(10)? {
            header.name()?;
            dimensions.push(header.count()?);
        }
        header.attributes()?;
        let mut variables = Vec::new();
        for _ in 0..header.list(11)? {
            variables.push(header.variable(&dimensions)?);
        }
        let growing = || variables.iter().filter(|variable| variable.grows);
        let padded = |bytes: u64| bytes.checked_next_multiple_of(4).unwrap_or(u64::MAX);
        let record = match growing().count() {
            // The one exception of the specification: a single growing array is not padded.
            1 => growing().map(|variable| variable.slab).sum(),
            _ => growing().fold(0_u64, |sum, variable| sum.saturating_add(padded(variable.slab))),
        };
        let first = growing().map(|variable| variable.begin).min().unwrap_or(0);
        let room = (file.len() as u64).saturating_sub(first);
        let records = if announced == endless { room.checked_div(record).unwrap_or(0) } else { announced };
        Ok(Self { file, dimensions, variables, records, record })
    }

    /// The array of that name.
    pub(super) fn variable(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.name == name)
    }

    /// Lengths of an array, slowest first.
    pub(super) fn extent(&self, variable: &Variable) -> Vec<u64> {
        variable.dimensions.iter().map(|&position| self.length_at(position)).collect()
    }

    /// Type of an array's numbers.
    pub(super) fn scalar(variable: &Variable) -> Scalar {
        variable.scalar
    }

    /// The bytes of an array at one step of its slowest dimension.
    pub(super) fn slab(&self, variable: &Variable, step: u64) -> Result<&'a [u8], Fault> {
        let first = variable.dimensions.first().map_or(1, |&position| self.length_at(position));
        let stride = if variable.grows { self.record } else { variable.slab };
        let start = stride.checked_mul(step).and_then(|offset| offset.checked_add(variable.begin));
        let found = start
            .filter(|_| step < first)
            .and_then(|start| split(self.file, start))
            .and_then(|(_, rest)| split(rest, variable.slab));
        match found {
            Some((bytes, _)) => Ok(bytes),
            None => Err(format!("step {step} of \"{}\" lies past the end of the file", variable.name).into()),
        }
    }

    /// All bytes of an array that does not grow.
    pub(super) fn all(&self, variable: &Variable) -> Result<&'a [u8], Fault> {
        let first = variable.dimensions.first().map_or(1, |&position| self.length_at(position));
        let bytes = variable.slab.checked_mul(first).filter(|_| !variable.grows);
        let found =
            split(self.file, variable.begin).zip(bytes).and_then(|((_, rest), bytes)| split(rest, bytes));
        match found {
            Some((bytes, _)) => Ok(bytes),
            None => Err(format!("\"{}\" lies past the end of the file", variable.name).into()),
        }
    }

    fn length_at(&self, position: usize) -> u64 {
        match self.dimensions.get(position) {
            Some(0) => self.records,
            Some(&length) => length,
            None => 0,
        }
    }
}

/// What is left of the header.
struct Header<'a> {
    rest: &'a [u8],
    wide_counts: bool,
    wide_offsets: bool,
}

impl<'a> Header<'a> {
    fn take(&mut self, count: u64) -> Result<&'a [u8], Fault> {
        let (bytes, rest) = split(self.rest, count).ok_or("it ends in its header")?;
        self.rest = rest;
        Ok(bytes)
    }

    fn number(&mut self, wide: bool) -> Result<u64, Fault> {
        let bytes = self.take(if wide { 8 } else { 4 })?;
        Ok(bytes.iter().fold(0, |number, &byte| (number << 8) | u64::from(byte)))
    }

    fn count(&mut self) -> Result<u64, Fault> {
        self.number(self.wide_counts)
    }

    /// How many entries the list with that tag has.
    fn list(&mut self, tag: u64) -> Result<u64, Fault> {
        let found = self.number(false)?;
        let count = self.count()?;
        // An empty list has the tag 0.
        if found == tag || (found == 0 && count == 0) {
            Ok(count)
        } else {
            Err("its header is garbled".into())
        }
    }

    fn padded(&mut self, count: u64) -> Result<&'a [u8], Fault> {
        let bytes = self.take(count)?;
        self.take(count.wrapping_neg() & 3)?;
        Ok(bytes)
    }

    fn name(&mut self) -> Result<String, Fault> {
        let count = self.count()?;
        Ok(String::from_utf8_lossy(self.padded(count)?).into_owned())
    }

    /// The attributes that are text.
    fn attributes(&mut self) -> Result<Vec<(String, String)>, Fault> {
        let mut texts = Vec::new();
        for _ in 0..self.list(12)? {
            let name = self.name()?;
            let (scalar, text) = scalar_of(self.number(false)?)?;
            let bytes = self.count()?.checked_mul(scalar.size() as u64).ok_or("an attribute is endless")?;
            let value = self.padded(bytes)?;
            if text {
                let value = String::from_utf8_lossy(value).trim_end_matches('\0').to_owned();
                texts.push((name, value));
            }
        }
        Ok(texts)
    }

    fn variable(&mut self, dimensions: &[u64]) -> Result<Variable, Fault> {
        let name = self.name()?;
        let mut own = Vec::new();
        let mut slab = 1_u64;
        let mut grows = false;
        for slowest in [true]
            .into_iter()
            .chain(std::iter::repeat(false))
            .take(usize::try_from(self.count()?).unwrap_or(0))
        {
            let position = usize::try_from(self.count()?).unwrap_or(usize::MAX);
            let length = dimensions.get(position).ok_or("an array has a dimension that is not there")?;
            match (slowest, length) {
                (true, length) => grows = *length == 0,
                (false, 0) => return Err("an array grows along a dimension that is not its slowest".into()),
                (false, length) => slab = slab.checked_mul(*length).ok_or("an array is endless")?,
            }
            own.push(position);
        }
        let texts = self.attributes()?;
        let (scalar, _) = scalar_of(self.number(false)?)?;
        self.count()?; // Its size, which may be cut short; the dimensions say it again.
        let begin = self.number(self.wide_offsets)?;
        let slab = slab.checked_mul(scalar.size() as u64).ok_or("an array is endless")?;
        Ok(Variable { name, dimensions: own, texts, scalar, begin, grows, slab })
    }
}

/// The type with that number, and whether it is text.
fn scalar_of(number: u64) -> Result<(Scalar, bool), Fault> {
    Ok(match number {
        1 => (Scalar::I8, false),
        2 => (Scalar::U8, true),
        3 => (Scalar::I16, false),
        4 => (Scalar::I32, false),
        5 => (Scalar::F32, false),
        6 => (Scalar::F64, false),
        7 => (Scalar::U8, false),
        8 => (Scalar::U16, false),
        9 => (Scalar::U32, false),
        10 => (Scalar::I64, false),
        11 => (Scalar::U64, false),
        _ => return Err(format!("an array has the unknown type {number}").into()),
    })
}

/// Numbers of a netCDF file are big-endian.
pub(super) const ENDIAN: Endian = Endian::Big;
