//! PLOT3D: curvilinear grids (`xyz`) and solutions on them (`q`), binary; cells become hexahedra.
//!
//! The files say nothing of their own form. Byte order, Fortran's record marks, one or several grids,
//! 32 or 64 bits, and blanking are found by trying which of them account for every byte of the grid file;
//! the solution then has the same. A grid's solution is looked for beside it, and a solution's grid.
//! Coordinates have no stated unit; millimetres are taken.
//!
//! Source: Walatka et al., *PLOT3D User's Manual*, NASA TM-101067, 1990, chapter 8.

use std::path::{Path, PathBuf};

use render::volume::Point;
use render::volume::cells::{CellGrid, CellKind, Field, Step};

use super::bytes::{self, Endian, Fault, Scalar, split};
use super::surface::grid_item;
use super::{Item, Limits, LoadError, Note, Progress, Severity};

const FORMAT: &str = "PLOT3D";

/// One item for each grid in the PLOT3D file at `path`, with the solution that lies beside it.
///
/// # Errors
/// [`LoadError`] for a file that cannot be read or accounted for, and a solution without its grid.
pub(super) fn read(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    let fail = |fault: Fault| fault.at(FORMAT, path, limits);
    let file = bytes::whole(path, FORMAT, limits)?;
    bytes::step(progress, "reading PLOT3D", 0, 1).map_err(fail)?;
    let name = bytes::file_name(path);
    if let Some((form, blocks)) = grids(&file) {
        let beside = partner(path, "xyz", "q").filter(|q| q.is_file());
        let solution = beside.map(|q| bytes::whole(&q, FORMAT, limits)).transpose()?;
        return items(form, &blocks, solution.as_deref(), &name, limits).map_err(fail);
    }
    let grid = partner(path, "q", "xyz").filter(|xyz| xyz.is_file());
    if let Some(grid) = grid {
        let grid = bytes::whole(&grid, FORMAT, limits)?;
        if let Some((form, blocks)) = grids(&grid) {
            return items(form, &blocks, Some(&file), &name, limits).map_err(fail);
        }
    }
    if is_solution(&file) {
        let feature = "a solution (q), and its grid is not beside it".to_owned();
        let remedy = "put the grid beside it, with xyz in its name where this one has q";
        return Err(fail(Fault::Unsupported(feature, remedy)));
    }
    Err(fail("its length fits no form of a binary grid".into()))
}

/// The file of the same name with `other` in place of the last `own`, in the name or as its ending.
fn partner(path: &Path, own: &str, other: &str) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let (before, after) = name.rsplit_once(own)?;
    Some(path.with_file_name(format!("{before}{other}{after}")))
}

/// How a pair of files is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Form {
    endian: Endian,
    /// Whether each record stands between two marks of its length.
    marked: bool,
    /// Whether the number of grids comes first.
    several: bool,
    scalar: Scalar,
    blanked: bool,
}

/// One grid, as it stands in the file.
#[derive(Debug)]
struct Block<'a> {
    extent: [u64; 3],
    points: u64,
    /// All x, then all y, then all z.
    xyz: &'a [u8],
    /// 0 for each point that is not used.
    blanks: Option<&'a [u8]>,
}

struct Records<'a> {
    rest: &'a [u8],
    form: Form,
}

impl<'a> Records<'a> {
    fn mark(&mut self) -> Option<u64> {
        let (mark, rest) = split(self.rest, 4)?;
        self.rest = rest;
        u64::try_from(*Scalar::I32.positions(mark, self.form.endian).first()?).ok()
    }

    /// The next record, of `bytes`, if that is its length.
    fn take(&mut self, bytes: u64) -> Option<&'a [u8]> {
        if self.form.marked && self.mark()? != bytes {
            return None;
        }
        let (record, rest) = split(self.rest, bytes)?;
        self.rest = rest;
        if self.form.marked && self.mark()? != bytes {
            return None;
        }
        Some(record)
    }

    /// The sizes of each grid, which begin either kind of file.
    fn extents(&mut self) -> Option<Vec<[u64; 3]>> {
        let one = |bytes: &[u8], endian| Scalar::I32.positions(bytes, endian);
        let count = if self.form.several { *one(self.take(4)?, self.form.endian).first()? } else { 1 };
        let bytes = u64::try_from(count).ok().filter(|&count| count > 0)?.checked_mul(12)?;
        let sizes = one(self.take(bytes)?, self.form.endian);
        let extent = |sizes: &[i64; 3]| {
            let [i, j, k] = sizes.map(|size| u64::try_from(size).ok().filter(|&size| size > 0));
            Some([i?, j?, k?])
        };
        sizes.as_chunks().0.iter().map(extent).collect()
    }
}

fn product(extent: [u64; 3]) -> Option<u64> {
    extent.into_iter().try_fold(1_u64, u64::checked_mul)
}

/// The first form that accounts for every byte of a grid file, and its grids.
fn grids(file: &[u8]) -> Option<(Form, Vec<Block<'_>>)> {
    forms().find_map(|form| Some((form, grids_as(file, form)?)))
}

fn forms() -> impl Iterator<Item = Form> {
    (0..32_u8).map(|bits| Form {
        endian: if bits & 1 == 0 { Endian::Big } else { Endian::Little },
        marked: bits & 2 != 0,
        several: bits & 4 != 0,
        blanked: bits & 8 != 0,
        scalar: if bits & 16 == 0 { Scalar::F32 } else { Scalar::F64 },
    })
}

fn grids_as(file: &[u8], form: Form) -> Option<Vec<Block<'_>>> {
    let mut records = Records { rest: file, form };
    let mut blocks = Vec::new();
    for extent in records.extents()? {
        let points = product(extent)?;
        let coordinates = points.checked_mul(3)?.checked_mul(form.scalar.size() as u64)?;
        let blanks = if form.blanked { points.checked_mul(4)? } else { 0 };
        let record = records.take(coordinates.checked_add(blanks)?)?;
        let (xyz, blanks) = split(record, coordinates)?;
        blocks.push(Block { extent, points, xyz, blanks: form.blanked.then_some(blanks) });
    }
    records.rest.is_empty().then_some(blocks)
}

/// Whether a file without its grid looks like a solution.
fn is_solution(file: &[u8]) -> bool {
    forms().any(|form| {
        let mut records = Records { rest: file, form };
        let extents = records.extents().unwrap_or_default();
        !extents.is_empty() && solutions(&mut records, &extents).is_some()
    })
}

/// Flow conditions, then five numbers a point, of each grid.
fn solutions<'a>(records: &mut Records<'a>, extents: &[[u64; 3]]) -> Option<Vec<(&'a [u8], &'a [u8])>> {
    let size = records.form.scalar.size() as u64;
    let one = |extent: &[u64; 3]| {
        let conditions = records.take(size.checked_mul(4)?)?;
        let numbers = product(*extent)?.checked_mul(5)?.checked_mul(size)?;
        Some((conditions, records.take(numbers)?))
    };
    extents.iter().map(one).collect()
}

fn items(
    form: Form,
    blocks: &[Block<'_>],
    solution: Option<&[u8]>,
    name: &str,
    limits: &Limits,
) -> Result<Vec<Item>, Fault> {
    let mut trailing = 0;
    let solutions = match solution {
        Some(file) => {
            let mut records = Records { rest: file, form };
            let extents = records.extents().ok_or("its solution has not the form of its grid")?;
            if extents != blocks.iter().map(|block| block.extent).collect::<Vec<_>>() {
                return Err(format!("its solution is of {extents:?} points, which its grid is not").into());
            }
            let found = solutions(&mut records, &extents).ok_or("its solution ends early")?;
            trailing = records.rest.len();
            found
        }
        None => Vec::new(),
    };
    let mut items = Vec::new();
    for (position, block) in blocks.iter().enumerate() {
        let mut notes = Vec::new();
        let steps = match solutions.get(position) {
            Some((conditions, numbers)) => vec![step(form, conditions, numbers)],
            None => vec![Step { time: 0.0, point_fields: Vec::new(), cell_fields: Vec::new() }],
        };
        if trailing > 0 {
            notes.push(Note {
                severity: Severity::Fact,
                code: "plot3d.trailing",
                text: format!("{trailing} bytes follow the solution; they were not used."),
            });
        }
        let grid = cells(form, block, steps, &mut notes, limits)?;
        let name = match blocks.len() {
            1 => name.to_owned(),
            _ => format!("{name}, grid {}", position.saturating_add(1)),
        };
        items.push(grid_item(name, FORMAT, grid, notes));
    }
    Ok(items)
}

fn step(form: Form, conditions: &[u8], numbers: &[u8]) -> Step {
    // Mach number, angle of attack, Reynolds number, time.
    let time = form.scalar.reals(conditions, form.endian).get(3).copied().filter(|time| time.is_finite());
    let size = numbers.len().checked_div(5).unwrap_or(0);
    let part = |from: usize, count: usize| {
        let start = size.saturating_mul(from);
        let bytes = numbers.get(start..start.saturating_add(size.saturating_mul(count))).unwrap_or_default();
        form.scalar.values(bytes, form.endian)
    };
    let momentum = bytes::interleaved(&[part(1, 1), part(2, 1), part(3, 1)]);
    Step {
        time: time.unwrap_or(0.0),
        point_fields: vec![
            Field::new("Density".to_owned(), 1, part(0, 1)),
            Field::new("Momentum".to_owned(), 3, momentum),
            Field::new("StagnationEnergy".to_owned(), 1, part(4, 1)),
        ],
        cell_fields: Vec::new(),
    }
}

fn cells(
    form: Form,
    block: &Block<'_>,
    steps: Vec<Step>,
    notes: &mut Vec<Note>,
    limits: &Limits,
) -> Result<CellGrid, Fault> {
    // Three coordinates and, nearly, eight corners a point.
    let count = bytes::afford(block.points, 24 + 32, limits)?;
    let numbers = form.scalar.reals(block.xyz, form.endian);
    let mut axes = numbers.chunks_exact(count);
    let (Some(x), Some(y), Some(z)) = (axes.next(), axes.next(), axes.next()) else {
        return Err("a grid has no coordinates".into());
    };
    let points = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| Point::new(x, y, z)).collect();
    let blanks = block.blanks.map(|blanks| Scalar::I32.positions(blanks, form.endian));
    let used = |corner: u32| {
        blanks.as_ref().is_none_or(|blanks| blanks.get(corner as usize).is_some_and(|&blank| blank != 0))
    };
    let [i_count, j_count, k_count] = block.extent;
    let at = |i: u64, j: u64, k: u64| {
        // Below the number of points, which was afforded above.
        let index = i.saturating_add(i_count.saturating_mul(j.saturating_add(j_count.saturating_mul(k))));
        u32::try_from(index).unwrap_or(u32::MAX)
    };
    let mut corners = Vec::new();
    let (mut kept, mut blanked) = (0_usize, 0_usize);
    for (k, k_next) in (0..k_count).zip(1..k_count) {
        for (j, j_next) in (0..j_count).zip(1..j_count) {
            for (i, i_next) in (0..i_count).zip(1..i_count) {
                let base = |k| [at(i, j, k), at(i_next, j, k), at(i_next, j_next, k), at(i, j_next, k)];
                let cell = [base(k), base(k_next)];
                if cell.as_flattened().iter().all(|&corner| used(corner)) {
                    corners.extend_from_slice(cell.as_flattened());
                    kept = kept.saturating_add(1);
                } else {
                    blanked = blanked.saturating_add(1);
                }
            }
        }
    }
    if blanked > 0 {
        notes.push(Note {
            severity: Severity::Fact,
            code: "cells.blanked",
            text: format!(
                "{blanked} cells have a corner that the file marks as not used; they were left out."
            ),
        });
    }
    Ok(CellGrid::new(points, vec![CellKind::Hexahedron; kept], corners, steps)?)
}

#[cfg(test)]
#[expect(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "a test may fail loudly"
)]
mod tests {
    use render::volume::cells::Place;

    use super::super::bytes::trial::{sample, survives};
    use super::super::{Content, Silent};
    use super::*;

    const LIMITS: Limits = Limits { decoded_bytes: 1 << 20, files: 10 };

    /// Writes records as a form asks.
    struct Writer(Form, Vec<u8>);

    impl Writer {
        fn bytes(&mut self, mut bytes: Vec<u8>) {
            // Big-endian is given.
            if self.0.endian == Endian::Little {
                bytes.reverse();
            }
            self.1.extend(bytes);
        }

        fn record(&mut self, whole: &[i32], reals: &[f64], blanks: &[i32]) {
            let form = self.0;
            let length = (whole.len() + blanks.len()) * 4 + reals.len() * form.scalar.size();
            for part in 0..5 {
                match part {
                    0 | 4 if form.marked => self.bytes((length as i32).to_be_bytes().to_vec()),
                    1 | 3 => {
                        for n in if part == 1 { whole } else { blanks } {
                            self.bytes(n.to_be_bytes().to_vec());
                        }
                    }
                    2 => {
                        for &n in reals {
                            let wide = form.scalar == Scalar::F64;
                            self.bytes(if wide {
                                n.to_be_bytes().to_vec()
                            } else {
                                (n as f32).to_be_bytes().to_vec()
                            });
                        }
                    }
                    _ => {}
                }
            }
        }
    }

    /// A grid of 3 by 2 by 2 points, one after the other along x, and its solution.
    fn pair(form: Form) -> [Vec<u8>; 2] {
        let point = |n: i32| [n % 3, n / 3 % 2, n / 6].map(f64::from);
        let axis = |axis: usize| (0..12).map(move |n| point(n)[axis]);
        let xyz = axis(0).chain(axis(1)).chain(axis(2)).collect::<Vec<_>>();
        let mut blanks = if form.blanked { vec![1; 12] } else { Vec::new() };
        // The first corner of the first of two cells.
        if let Some(first) = blanks.first_mut() {
            *first = 0;
        }
        let numbers = (0..60).map(f64::from).collect::<Vec<_>>();
        let grids: i32 = if form.several { 2 } else { 1 };
        let mut files = [Writer(form, Vec::new()), Writer(form, Vec::new())];
        for file in &mut files {
            if form.several {
                file.record(&[grids], &[], &[]);
            }
            file.record(&[3, 2, 2].repeat(grids as usize), &[], &[]);
        }
        let [grid, solution] = &mut files;
        for _ in 0..grids {
            grid.record(&[], &xyz, &blanks);
            solution.record(&[], &[0.5, 0.0, 100.0, 2.5], &[]);
            solution.record(&[], &numbers, &[]);
        }
        files.map(|file| file.1)
    }

    fn cells_of(item: &Item) -> &CellGrid {
        let Content::Cells(grid) = &item.content else { panic!("no grid") };
        grid
    }

    #[test]
    fn every_form_is_found_by_its_length() {
        for form in forms() {
            let [grid, solution] = pair(form);
            let (found, blocks) = grids(&grid).expect("a form");
            assert_eq!(found, form, "the form it was written in");
            let items = items(found, &blocks, Some(&solution), "a", &LIMITS).expect("grids");
            assert_eq!(items.len(), if form.several { 2 } else { 1 }, "grids");
            let grid = cells_of(&items[0]);
            let expected: &[&[u32]] = &[&[0, 1, 4, 3, 6, 7, 10, 9], &[1, 2, 5, 4, 7, 8, 11, 10]];
            let expected = if form.blanked { &expected[1..] } else { expected };
            assert_eq!(
                (0..grid.len()).map(|cell| grid.cell(cell).1).collect::<Vec<_>>(),
                expected,
                "{form:?}"
            );
            assert_eq!(grid.bounds()[1], Point::new(2.0, 1.0, 1.0), "{form:?}");
            let step = &grid.steps()[0];
            assert_eq!(step.time, 2.5, "time");
            let momentum = step.field(Place::Points, "Momentum").expect("a field");
            assert_eq!([0, 1, 2].map(|part| momentum.value(1, part)), [13.0, 25.0, 37.0], "{form:?}");
            assert_eq!(grid.range(Place::Points, "StagnationEnergy", 0), Some([48.0, 59.0]), "{form:?}");
        }
    }

    #[test]
    fn grid_and_solution_find_each_other() {
        let [grid, solution] = pair(forms().next().expect("a form"));
        let folder = tempfile::tempdir().expect("a folder");
        let place = |name: &str| folder.path().join(name);
        std::fs::write(place("flowq.bin"), &solution).expect("written");
        let alone = read(&place("flowq.bin"), &LIMITS, &Silent);
        let Err(LoadError::Unsupported { feature, .. }) = alone else { panic!("{alone:?}") };
        assert!(feature.contains("its grid is not beside it"), "{feature}");
        std::fs::write(place("flowxyz.bin"), &grid).expect("written");
        for name in ["flowq.bin", "flowxyz.bin"] {
            let items = read(&place(name), &LIMITS, &Silent).expect("the pair");
            assert_eq!(cells_of(&items[0]).steps()[0].point_fields.len(), 3, "with fields from {name}");
        }
        std::fs::write(place("flow.xyz"), &grid).expect("written");
        let items = read(&place("flow.xyz"), &LIMITS, &Silent).expect("the grid");
        assert_eq!(cells_of(&items[0]).steps()[0].point_fields.len(), 0, "no solution of that name");
        std::fs::write(place("flow.q"), &solution[..100]).expect("written");
        assert!(read(&place("flow.xyz"), &LIMITS, &Silent).is_err(), "a solution that is cut");
        std::fs::write(place("other.bin"), [1; 100]).expect("written");
        assert!(read(&place("other.bin"), &LIMITS, &Silent).is_err(), "nothing known");
    }

    #[test]
    fn the_blunt_fin_has_the_facts_that_vtk_reads() {
        let Some(path) = sample("grid/bluntfinxyz.bin") else { return };
        let items = read(&path, &Limits::default(), &Silent).expect("the fin");
        let grid = cells_of(&items[0]);
        assert_eq!((grid.points().len(), grid.len()), (40_960, 37_479), "sizes");
        let found = grid.bounds().map(|p| [p.x, p.y, p.z]);
        let expected = [-7.815_747_261_05, 0.0, 0.0, 14.362_203_598_02, 8.327_558_517_46, 5.724_251_270_29];
        for (found, expected) in found.as_flattened().iter().zip(expected) {
            assert!((found - expected).abs() < 1e-8, "{found} for {expected}");
        }
        for (name, component, low, high) in [
            ("Density", 0, 0.192_599_996_924, 4.977_499_961_853),
            ("Momentum", 0, -2.183_500_051_498, 5.790_299_892_426),
            ("Momentum", 2, -3.733_900_070_190, 1.502_900_004_387),
            ("StagnationEnergy", 0, 0.768_956_959_248, 25.160_999_298_096),
        ] {
            let [found_low, found_high] = grid.range(Place::Points, name, component).expect(name);
            assert!((found_low - low).abs() < 1e-9 && (found_high - high).abs() < 1e-9, "{name} {component}");
        }
        assert!((grid.steps()[0].time - 1.3911).abs() < 1e-6, "time, which VTK gives as the fourth property");
        assert_eq!(
            items[0].notes.first().map(|note| note.code),
            Some("plot3d.trailing"),
            "484 bytes too many"
        );
        let Some(path) = sample("grid/bluntfinq.bin") else { return };
        let from_solution = read(&path, &Limits::default(), &Silent).expect("the fin");
        assert_eq!(cells_of(&from_solution[0]), grid, "opened by its solution");
    }

    #[test]
    fn no_byte_makes_it_panic() {
        for form in forms().filter(|form| form.blanked == form.marked && form.several == form.marked) {
            let [grid, solution] = pair(form);
            let open = |grid: &[u8], solution: &[u8]| {
                let (form, blocks) = grids(grid)?;
                items(form, &blocks, Some(solution), "", &LIMITS).ok()
            };
            survives(&grid, |bytes| open(bytes, &solution));
            survives(&solution, |bytes| (open(&grid, bytes), is_solution(bytes)));
        }
    }
}
