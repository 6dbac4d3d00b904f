//! VTK files: legacy `.vtk`, XML `.vtu` and `.vtp`, their parallel `.pvtu` and `.pvtp`, and `.pvd` lists
//! of time steps.
//!
//! [`legacy`] and [`xml`] each give a [`Dataset`]: points, cells of any of VTK's types, arrays. A data set
//! with a cell that has a volume becomes a grid of cells, one with faces only a mesh. Coordinates have no
//! stated unit; millimetres are taken.
//!
//! Source: *VTK User's Guide*, 11th ed., "VTK file formats"; Kitware's discourse, "VTK legacy file format
//! 5.1"; `vtkCellType.h`.

mod dataset;
mod legacy;
mod series;
mod xml;

use std::path::Path;

use self::dataset::Dataset;
use super::bytes::{self, Fault};
use super::{Item, Limits, LoadError, Progress};

const FORMAT: &str = "VTK";

/// The grid or mesh in the VTK file at `path`; all time steps of a `.pvd`.
///
/// # Errors
/// [`LoadError`] for a file that cannot be read, contradicts itself, or is an image or another kind of
/// data set.
pub(super) fn read(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    let file = bytes::whole(path, FORMAT, limits)?;
    let name = bytes::file_name(path);
    let item = bytes::step(progress, "reading VTK", 0, 1).and_then(|()| match parse(&file, limits)? {
        Parsed::Dataset(dataset) => dataset.into_item(name, limits),
        Parsed::Pieces(sources) => series::pieces(path, &sources, limits)?.into_item(name, limits),
        Parsed::Steps(steps) => series::steps(path, &steps, limits, progress),
    });
    item.map(|item| vec![item]).map_err(|fault| fault.at(FORMAT, path, limits))
}

/// What one file says.
#[derive(Debug)]
enum Parsed {
    Dataset(Dataset),
    /// The files of a parallel one.
    Pieces(Vec<String>),
    /// Times and files of a collection, as they stand there.
    Steps(Vec<(f64, String)>),
}

fn parse(file: &[u8], limits: &Limits) -> Result<Parsed, Fault> {
    if file.starts_with(b"# vtk DataFile") {
        return Ok(Parsed::Dataset(legacy::parse(file, limits)?));
    }
    xml::parse(file, limits)
}

#[cfg(test)]
mod tests;
