//! Exodus II: blocks of finite elements, fields at the nodes and in the elements, over time.
//!
//! Classic netCDF only; files on HDF5 are told apart and refused with the way to convert them. Elements
//! of higher order keep their corners; surface elements and side sets are left out. Coordinates have no
//! stated unit; millimetres are taken. Fields `VX`, `VY`, `VZ` in a row become one field `V`.
//!
//! Source: Schoof and Yarberry, *EXODUS II: A Finite Element Data Model*, SAND92-2137, 1994, 4 and appendix.

mod netcdf;

use std::path::Path;

use render::volume::Point;
use render::volume::cells::{CellGrid, CellKind, Field, Step, Values};

use self::netcdf::{ENDIAN, Netcdf, Variable};
use super::bytes::{self, Fault};
use super::surface::{grid_item, tell_left_out};
use super::{Item, Limits, LoadError, Note, Progress};

const FORMAT: &str = "Exodus II";

/// The grid in the Exodus II file at `path`, with every time step.
///
/// # Errors
/// [`LoadError`] for a file that cannot be read, ends early, lies on HDF5 or has no volume element.
pub(super) fn read(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    let file = bytes::whole(path, FORMAT, limits)?;
    let item = parse(&file, bytes::file_name(path), limits, progress);
    item.map(|item| vec![item]).map_err(|fault| fault.at(FORMAT, path, limits))
}

fn parse(file: &[u8], name: String, limits: &Limits, progress: &dyn Progress) -> Result<Item, Fault> {
    if file.starts_with(b"\x89HDF") {
        return Err(Fault::Unsupported(
            "netCDF-4 (HDF5)".to_owned(),
            "convert it with nccopy -k classic IN OUT",
        ));
    }
    let netcdf = Netcdf::new(file)?;
    let points = points(&netcdf)?;
    let cells = blocks(&netcdf, points.len())?;
    let times = match netcdf.variable("time_whole") {
        Some(times) => {
            let count = netcdf.extent(times).first().copied().unwrap_or(0);
            (0..count).map(|step| one_time(&netcdf, times, step)).collect::<Result<Vec<_>, _>>()?
        }
        None => Vec::new(),
    };
    let node_names = names(&netcdf, "name_nod_var")?;
    let cell_names = names(&netcdf, "name_elem_var")?;
    let numbers = (node_names.len() as u64)
        .saturating_mul(points.len() as u64)
        .saturating_add((cell_names.len() as u64).saturating_add(1).saturating_mul(cells.kinds.len() as u64));
    bytes::afford(numbers.saturating_mul(times.len() as u64), 8, limits)?;
    let mut steps = Vec::new();
    let ids = Field::new("ObjectId".to_owned(), 1, Values::F64(cells.ids.clone()));
    for (step, &time) in (0_u64..).zip(&times) {
        bytes::step(progress, "reading Exodus II", steps.len(), times.len())?;
        let point_fields = joined(node_fields(&netcdf, &node_names, step)?);
        let mut cell_fields = joined(cell_fields(&netcdf, &cell_names, &cells.blocks, step)?);
        cell_fields.push(ids.clone());
        steps.push(Step { time, point_fields, cell_fields });
    }
    if steps.is_empty() {
        steps.push(Step { time: 0.0, point_fields: Vec::new(), cell_fields: vec![ids] });
    }
    let grid = CellGrid::new(points, cells.kinds, cells.corners, steps)?;
    Ok(grid_item(name, FORMAT, grid, cells.notes))
}

fn one_time(netcdf: &Netcdf<'_>, times: &Variable, step: u64) -> Result<f64, Fault> {
    let bytes = netcdf.slab(times, step)?;
    Netcdf::scalar(times).one(bytes, ENDIAN).ok_or_else(|| "its times are empty".into())
}

fn points(netcdf: &Netcdf<'_>) -> Result<Vec<Point>, Fault> {
    let axis = |axis: usize| -> Result<Vec<f64>, Fault> {
        let name = ["coordx", "coordy", "coordz"].get(axis).copied().unwrap_or_default();
        if let Some(own) = netcdf.variable(name) {
            return Ok(Netcdf::scalar(own).reals(netcdf.all(own)?, ENDIAN));
        }
        match netcdf.variable("coord") {
            Some(all) if netcdf.extent(all).first().is_some_and(|&axes| axes > axis as u64) => {
                Ok(Netcdf::scalar(all).reals(netcdf.slab(all, axis as u64)?, ENDIAN))
            }
            _ => Err(format!("it has no coordinates along axis {axis}; only grids in space are read").into()),
        }
    };
    let [x, y, z] = [axis(0)?, axis(1)?, axis(2)?];
    if x.len() != y.len() || x.len() != z.len() {
        return Err("its coordinates are not as many along each axis".into());
    }
    Ok(x.into_iter().zip(y).zip(z).map(|((x, y), z)| Point::new(x, y, z)).collect())
}

struct Cells {
    kinds: Vec<CellKind>,
    corners: Vec<u32>,
    /// Of each cell, its block's id.
    ids: Vec<f64>,
    /// Number of each block that was kept, and its cells.
    blocks: Vec<(u64, usize)>,
    notes: Vec<Note>,
}

/// The cells of all blocks.
fn blocks(netcdf: &Netcdf<'_>, points: usize) -> Result<Cells, Fault> {
    let mut cells = Cells {
        kinds: Vec::new(),
        corners: Vec::new(),
        ids: Vec::new(),
        blocks: Vec::new(),
        notes: Vec::new(),
    };
    let ids = match netcdf.variable("eb_prop1") {
        Some(ids) => Netcdf::scalar(ids).reals(netcdf.all(ids)?, ENDIAN),
        None => Vec::new(),
    };
    let (mut dropped, mut bent) = (0_usize, 0_usize);
    for position in 0..ids.len().max(1) {
        let block = (position as u64).saturating_add(1);
        // A block of no element has no array.
        let Some(connect) = netcdf.variable(&format!("connect{block}")) else { continue };
        let &[count, nodes] = netcdf.extent(connect).as_slice() else {
            return Err(format!("block {block} is not a table of elements").into());
        };
        let Some(kind) = kind_of(connect.text("elem_type").unwrap_or_default(), nodes) else {
            dropped = dropped.saturating_add(usize::try_from(count).unwrap_or(usize::MAX));
            continue;
        };
        let named = Netcdf::scalar(connect).positions(netcdf.all(connect)?, ENDIAN);
        let nodes = usize::try_from(nodes).unwrap_or(usize::MAX);
        for element in named.chunks_exact(nodes) {
            for &node in element.iter().take(kind.corners()) {
                // Exodus counts from 1.
                let corner = node.checked_sub(1).and_then(|node| u32::try_from(node).ok());
                let Some(corner) = corner.filter(|&corner| (corner as usize) < points) else {
                    return Err(
                        format!("block {block} names node {node}, but there are only {points}").into()
                    );
                };
                cells.corners.push(corner);
            }
            cells.kinds.push(kind);
            cells.ids.push(ids.get(position).copied().unwrap_or(1.0));
        }
        let own = named.len().checked_div(nodes).unwrap_or(0);
        bent = bent.saturating_add(if nodes > kind.corners() { own } else { 0 });
        cells.blocks.push((block, own));
    }
    tell_left_out(dropped, bent, &mut cells.notes);
    Ok(cells)
}

fn kind_of(elem_type: &str, nodes: u64) -> Option<CellKind> {
    let starts =
        |with: &str| elem_type.get(..with.len()).is_some_and(|start| start.eq_ignore_ascii_case(with));
    let kind = match () {
        () if starts("HEX") => CellKind::Hexahedron,
        () if starts("TET") => CellKind::Tetra,
        () if starts("PYR") => CellKind::Pyramid,
        () if starts("WEDGE") => CellKind::Wedge,
        () => return None,
    };
    Some(kind).filter(|kind| nodes >= kind.corners() as u64)
}

/// The names in a table of text, one a row.
fn names(netcdf: &Netcdf<'_>, table: &str) -> Result<Vec<String>, Fault> {
    let Some(table) = netcdf.variable(table) else { return Ok(Vec::new()) };
    let length =
        netcdf.extent(table).get(1).copied().and_then(|length| usize::try_from(length).ok()).unwrap_or(0);
    let name = |row: &[u8]| {
        let end = row.iter().position(|&byte| byte == 0).unwrap_or(row.len());
        String::from_utf8_lossy(row.get(..end).unwrap_or_default()).trim().to_owned()
    };
    Ok(netcdf.all(table)?.chunks_exact(length.max(1)).map(name).collect())
}

fn node_fields(netcdf: &Netcdf<'_>, names: &[String], step: u64) -> Result<Vec<Field>, Fault> {
    let mut fields = Vec::new();
    for (position, name) in names.iter().enumerate() {
        let own = format!("vals_nod_var{}", position.saturating_add(1));
        let (array, bytes) = if let Some(own) = netcdf.variable(&own) {
            (own, netcdf.slab(own, step)?)
        } else if let Some(all) = netcdf.variable("vals_nod_var") {
            let slab = netcdf.slab(all, step)?;
            let size = slab.len().checked_div(names.len()).unwrap_or(0);
            (all, slab.chunks_exact(size.max(1)).nth(position).unwrap_or_default())
        } else {
            continue;
        };
        fields.push(Field::new(name.clone(), 1, Netcdf::scalar(array).values(bytes, ENDIAN)));
    }
    Ok(fields)
}

fn cell_fields(
    netcdf: &Netcdf<'_>,
    names: &[String],
    blocks: &[(u64, usize)],
    step: u64,
) -> Result<Vec<Field>, Fault> {
    let mut fields = Vec::new();
    for (position, name) in names.iter().enumerate() {
        let mut values = Vec::new();
        for &(block, cells) in blocks {
            // A block that has not this variable has no array for it.
            match netcdf.variable(&format!("vals_elem_var{}eb{block}", position.saturating_add(1))) {
                Some(own) => values.extend(Netcdf::scalar(own).reals(netcdf.slab(own, step)?, ENDIAN)),
                None => values.extend(std::iter::repeat_n(f64::NAN, cells)),
            }
        }
        fields.push(Field::new(name.clone(), 1, Values::F64(values)));
    }
    Ok(fields)
}

/// Makes one field of each three in a row whose names end in x, y, z after the same beginning.
fn joined(fields: Vec<Field>) -> Vec<Field> {
    let mut all: Vec<Field> = Vec::new();
    for field in fields {
        all.push(field);
        let [.., x, y, z] = all.as_slice() else { continue };
        let Some(stem) = vector_name(x.name(), y.name(), z.name()) else { continue };
        let parts = [x.values(), y.values(), z.values()].map(Clone::clone);
        if parts.iter().any(|part| part.len() != x.values().len()) {
            continue;
        }
        let vector = Field::new(stem.to_owned(), 3, bytes::interleaved(&parts));
        all.truncate(all.len().saturating_sub(3));
        all.push(vector);
    }
    all
}

/// `V` for `VX`, `VY`, `VZ`; nothing for `SXX`, `SXY`, `SXZ`, which are a row of a tensor.
fn vector_name<'a>(x: &'a str, y: &str, z: &str) -> Option<&'a str> {
    let stem = x.strip_suffix(['x', 'X'])?;
    if y.strip_suffix(['y', 'Y'])? != stem || z.strip_suffix(['z', 'Z'])? != stem {
        return None;
    }
    let stem = stem.trim_end_matches('_');
    let tensor = stem.ends_with(['x', 'y', 'z', 'X', 'Y', 'Z']);
    Some(stem).filter(|stem| !stem.is_empty() && !tensor)
}

#[cfg(test)]
mod tests;
