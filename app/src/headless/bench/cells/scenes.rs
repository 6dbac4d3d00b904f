//! What grids are drawn, from where and in which colours.

use std::path::Path;
use std::sync::Arc;

use ::render::scene::{Camera, Projection};
use ::render::volume::cells::{CellGrid, CellKind, Field, Step, Values};
use ::render::volume::{ControlPoint, Point, Transfer, Vector};

use crate::headless::{Failure, Terminal};
use crate::load::{self, Content, Limits};

pub(super) fn read(path: &Path) -> Result<Arc<CellGrid>, Failure> {
    let items = load::open(path, &Limits::default(), &Terminal::default())?;
    let grid = items.into_iter().find_map(|item| match item.content {
        Content::Cells(grid) => Some(Arc::new(grid)),
        _ => None,
    });
    let fault = "there is no unstructured grid in it; choose a VTU, VTK or Exodus file";
    grid.ok_or_else(|| Failure::Unfit(format!("{fault}: {}", path.display())))
}

/// Along the longest side of the grid, or across it with that side lying.
pub(super) fn camera(grid: &CellGrid, along: bool, size: [u32; 2]) -> Camera {
    let [low, high] = grid.bounds();
    let extent = high - low;
    let middle = low + extent * 0.5;
    let axis = |a: usize| Vector::from_fn(|i, _| f64::from(u8::from(i == a)));
    let longest = extent.imax();
    let [long, other, third] = [axis(longest), axis((longest + 1) % 3), axis((longest + 2) % 3)];
    let (forward, up, across) = if along {
        (long + 0.2 * other, third, extent.dot(&other).max(extent.dot(&third)))
    } else {
        (third + 0.1 * other, other, extent[longest] * f64::from(size[1]) / f64::from(size[0]))
    };
    let height_mm = 1.1 * across.max(extent.dot(&up)) + 0.2 * extent.dot(&long) * f64::from(u8::from(along));
    let eye = middle - forward.normalize() * extent.norm() * 1.5;
    Camera { eye, target: middle, up, projection: Projection::Parallel { height_mm } }
}

/// Colours over a range; a mean opacity of 0.3 a millimetre where `dense`.
pub(super) fn transfer([from, to]: [f64; 2], dense: bool) -> Result<Transfer, Failure> {
    let point = |part: f64, rgba: [f64; 4]| ControlPoint { value: from + (to - from) * part, rgba };
    let [a, b, c] = if dense { [0.3, 0.32, 0.4] } else { [0.0, 0.02, 0.2] };
    let points = vec![
        point(0.0, [0.1, 0.2, 0.9, a]),
        point(0.05, [0.2, 0.8, 0.6, b]),
        point(0.3, [0.9, 0.8, 0.2, b]),
        point(1.0, [1.0, 0.2, 0.1, c]),
    ];
    Transfer::new(points, 1.0).map_err(|e| Failure::Other(e.to_string()))
}

/// Cubes of a ball, six tetrahedra each, with a smooth scalar; `cells` millimetres across.
pub(super) fn ball(cells: usize) -> Result<Arc<CellGrid>, Failure> {
    let side = cells + 1;
    let number = |p: [usize; 3]| (p[0] + side * (p[1] + side * p[2])) as u32;
    let middle = cells as f64 / 2.0;
    let (mut points, mut corners, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for z in 0..side {
        for y in 0..side {
            for x in 0..side {
                let p = Point::new(x as f64, y as f64, z as f64);
                let wave = (p.x * 0.9).sin() + (p.y * 0.7).cos() + (p.z * 0.8).sin();
                points.push(p + Vector::new(0.2, 0.1, -0.1) * wave);
                values.push(wave as f32);
            }
        }
    }
    // The six orders in which a walk from corner to corner may go along the axes.
    for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
        for cell in 0..cells * cells * cells {
            let mut at = [cell % cells, cell / cells % cells, cell / cells / cells];
            let off = at.map(|v| (v as f64 + 0.5 - middle).powi(2)).iter().sum::<f64>();
            if off > middle * middle * 1.32 {
                continue;
            }
            corners.push(number(at));
            for axis in order {
                at[axis] += 1;
                corners.push(number(at));
            }
        }
    }
    let field = Field::new("wave".to_owned(), 1, Values::F32(values));
    let steps = vec![Step { time: 0.0, point_fields: vec![field], cell_fields: Vec::new() }];
    let kinds = vec![CellKind::Tetra; corners.len() / 4];
    let grid = CellGrid::new(points, kinds, corners, steps);
    grid.map(Arc::new).map_err(|e| Failure::Other(e.to_string()))
}
