//! Unstructured grids in a section: each tetrahedron that the plane meets is drawn where it lies in the plane.
//!
//! Nothing is kept from one section to the next: of all cells only the depths of their corners are asked, a few
//! nanoseconds each, and those that the plane passes are a small part.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::Section;
use crate::cells::tetrahedra;
use crate::scene::CellItem;
use crate::volume::cells::{Field, Place};
use crate::volume::{Point, Vector};

/// A place belongs to a tetrahedron where no corner has a smaller weight: by rounding, none is lost on a shared face.
const OUTSIDE: f64 = -1e-9;

/// Cells that one task looks at.
const CELLS: usize = 4096;

/// Rows of pixels that one task draws, at least.
const ROWS: usize = 16;

/// The scalar of one step of a grid, with its tetrahedra.
struct Scalars<'a> {
    item: &'a CellItem,
    field: &'a Field,
}

impl<'a> Scalars<'a> {
    /// Nothing where the grid has no such step or scalar.
    fn of(item: &'a CellItem) -> Option<Self> {
        let field = item.scalar.field(item.grid.steps().get(item.step)?)?;
        Some(Self { item, field })
    }

    /// Calls `found` with the corners of each tetrahedron of a cell, as numbers of points, and the scalar there. Those with
    /// a scalar that is not finite are left out, as in a picture.
    fn tetrahedra(&self, cell: usize, mut found: impl FnMut([usize; 4], [f64; 4])) {
        let (kind, corners) = self.item.grid.cell(cell);
        let part = self.item.scalar.part;
        tetrahedra(kind, corners, |numbers| {
            let numbers = numbers.map(|n| n as usize);
            let values = match self.item.scalar.place {
                Place::Points => numbers.map(|n| part.of(self.field, n)),
                Place::Cells => [part.of(self.field, cell); 4],
            };
            if values.iter().all(|v| v.is_finite()) {
                found(numbers, values);
            }
        });
    }
}

/// The weights of the last three corners of a tetrahedron at a place, as a matrix on the way there from the first; nothing
/// of one without a volume.
fn weights([a, b, c, d]: [Vector; 4]) -> Option<Matrix3<f64>> {
    Matrix3::from_columns(&[b - a, c - a, d - a]).try_inverse()
}

/// Whether the weights of the last three corners are those of a place within.
fn is_inside(weights: [f64; 3]) -> bool {
    let [b, c, d] = weights;
    b >= OUTSIDE && c >= OUTSIDE && d >= OUTSIDE && 1.0 - (b + c + d) >= OUTSIDE
}

/// The scalar where the last three corners have such weights; the very value where all corners have one.
fn value_of(values: [f64; 4], weights: [f64; 3]) -> f64 {
    (0..3).fold(values[0], |sum, k| sum + weights[k] * (values[k + 1] - values[0]))
}

/// A tetrahedron that the plane meets, in the pixels where it may.
struct Plate {
    /// From and to the one after the last.
    columns: [usize; 2],
    rows: [usize; 2],
    /// Of the last three corners, at the first of the pixels.
    first: [f64; 3],
    /// How they change from pixel to pixel, along a row and down.
    along: [f64; 3],
    down: [f64; 3],
    values: [f64; 4],
}

impl Plate {
    /// Corners in pixels, with their depth as the third coordinate.
    fn of(corners: [Vector; 4], values: [f64; 4], size: [usize; 2]) -> Option<Self> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut take = |x: f64, y: f64| {
            (low, high) = ([low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]);
        };
        for (i, a) in corners.iter().enumerate() {
            if a.z == 0.0 {
                take(a.x, a.y);
            }
            for b in &corners[i + 1..] {
                if (a.z < 0.0) != (b.z < 0.0) {
                    let part = a.z / (a.z - b.z);
                    take(a.x + (b.x - a.x) * part, a.y + (b.y - a.y) * part);
                }
            }
        }
        // Pixels whose centres may lie within; by rounding one more to either side.
        let range = |axis: usize| {
            let from = (low[axis] - 1.5).ceil().max(0.0) as usize;
            let to = (high[axis] + 1.5).floor().clamp(0.0, size[axis] as f64) as usize;
            [from, to]
        };
        let (columns, rows) = (range(0), range(1));
        if columns[0] >= columns[1] || rows[0] >= rows[1] {
            return None;
        }
        let weights = weights(corners)?;
        let at = Vector::new(columns[0] as f64 + 0.5, rows[0] as f64 + 0.5, 0.0);
        let first = weights * (at - corners[0]);
        Some(Self {
            columns,
            rows,
            first: first.into(),
            along: weights.column(0).into_owned().into(),
            down: weights.column(1).into_owned().into(),
            values,
        })
    }

    /// Draws row `j` where nothing was drawn yet.
    fn draw(&self, j: usize, row: &mut [f64]) {
        let below = (j - self.rows[0]) as f64;
        let [from, to] = self.columns;
        for (i, pixel) in row[from..to].iter_mut().enumerate() {
            let weights: [f64; 3] =
                std::array::from_fn(|k| self.first[k] + self.down[k] * below + self.along[k] * i as f64);
            if is_inside(weights) && pixel.is_nan() {
                *pixel = value_of(self.values, weights);
            }
        }
    }
}

/// The scalar of a grid in the middle plane of a section, row by row from the top; NaN where no cell is. Where cells
/// overlap, and on a face that two share, that of the first is seen.
pub fn cell_values(section: &Section, item: &CellItem) -> Vec<f64> {
    let [width, height] = section.size;
    let mut values = vec![f64::NAN; width * height];
    let Some(scalars) = Scalars::of(item) else { return values };
    let plates = plates(section, &scalars);
    let rows = ROWS.max(height.div_ceil(64));
    values.par_chunks_mut(rows * width).enumerate().for_each(|(strip, values)| {
        let begin = strip * rows;
        let end = begin + values.len() / width;
        for plate in plates.iter().filter(|p| p.rows[0] < end && p.rows[1] > begin) {
            for j in plate.rows[0].max(begin)..plate.rows[1].min(end) {
                plate.draw(j, &mut values[(j - begin) * width..][..width]);
            }
        }
    });
    values
}

/// The tetrahedra that the plane of a section meets within its picture, in the grid's order.
fn plates(section: &Section, scalars: &Scalars<'_>) -> Vec<Plate> {
    let item = scalars.item;
    let per_mm = 1.0 / section.mm_per_pixel;
    let pixel_from_world =
        Matrix3::from_rows(&[section.right, section.down, section.forward()].map(|axis| axis.transpose()))
            * per_mm;
    let linear = pixel_from_world * item.pose.linear();
    let [width, height] = section.size.map(|n| n as f64);
    let origin = pixel_from_world * (item.pose.point(&Point::origin()) - section.centre)
        + Vector::new(width / 2.0, height / 2.0, 0.0);
    let points = item.grid.points();
    let across = linear.row(2).transpose();
    let depths: Vec<f64> = points.par_iter().map(|p| across.dot(&p.coords) + origin.z).collect();
    let is_met = |cell: &usize| {
        let corners = item.grid.cell(*cell).1.iter().map(|&n| depths[n as usize]);
        let (low, high) =
            corners.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)));
        low <= 0.0 && high >= 0.0
    };
    let place = |n: usize| {
        let at = linear * points[n].coords + origin;
        Vector::new(at.x, at.y, depths[n])
    };
    let cells = (0..item.grid.len()).into_par_iter().with_min_len(CELLS).filter(is_met);
    let of_cell = |cell: usize| {
        let mut found = Vec::new();
        scalars.tetrahedra(cell, |numbers, values| {
            found.extend(Plate::of(numbers.map(place), values, section.size));
        });
        found
    };
    cells.flat_map_iter(of_cell).collect()
}

/// The scalar of a grid at a world place, of the first cell that it lies in; nothing where there is none.
pub fn cell_value(item: &CellItem, p: &Point) -> Option<f64> {
    let scalars = Scalars::of(item)?;
    let at = item.pose.inverse().point(p).coords;
    let points = item.grid.points();
    let in_cell = |cell: usize| {
        let mut found = None;
        let corners = || item.grid.cell(cell).1.iter().map(|&n| &points[n as usize].coords);
        let near = (0..3).all(|axis| {
            let (low, high) = corners()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), c| (a.min(c[axis]), b.max(c[axis])));
            // A weight that rounding makes negative reaches a little out of the box.
            let pad = 1e-8 * (high - low);
            low - pad <= at[axis] && at[axis] <= high + pad
        });
        if near {
            scalars.tetrahedra(cell, |numbers, values| {
                let corners = numbers.map(|n| points[n].coords);
                let weights = weights(corners).map(|w| <[f64; 3]>::from(w * (at - corners[0])));
                let value = weights.filter(|w| is_inside(*w)).map(|w| value_of(values, w));
                found = found.or(value);
            });
        }
        found
    };
    (0..item.grid.len()).into_par_iter().with_min_len(CELLS).find_map_first(in_cell)
}

/// A stretch of a ray in one tetrahedron of a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellSpan {
    /// Where the ray enters it and leaves it; along the ray, in lengths of its direction.
    pub reach: [f64; 2],
    /// The scalar there; linear between.
    pub values: [f64; 2],
}

impl CellSpan {
    /// The scalar at a place along the ray within the stretch.
    pub fn value(&self, at: f64) -> f64 {
        let [from, to] = self.reach;
        self.values[0] + (self.values[1] - self.values[0]) * ((at - from) / (to - from)).clamp(0.0, 1.0)
    }
}

/// Where a ray from a world place is in the cells of a grid, in the grid's order; nothing behind its start.
pub fn cell_spans(item: &CellItem, origin: &Point, direction: &Vector) -> Vec<CellSpan> {
    let Some(scalars) = Scalars::of(item) else { return Vec::new() };
    let back = item.pose.inverse();
    // Not normalised, so that lengths along it stay what they are.
    let (origin, direction) = (back.point(origin).coords, back.vector(direction));
    let points = item.grid.points();
    let in_cell = |cell: usize| {
        let mut found = Vec::new();
        let corners = || item.grid.cell(cell).1.iter().map(|&n| points[n as usize].coords - origin);
        // The ball about the first corner that has the others.
        let first = corners().next().unwrap_or_default();
        let radius = corners().map(|c| (c - first).norm_squared()).fold(0.0, f64::max);
        let beside = first - direction * (first.dot(&direction) / direction.norm_squared());
        if beside.norm_squared() > radius * (1.0 + 1e-9) {
            return found;
        }
        scalars.tetrahedra(cell, |numbers, values| {
            let corners = numbers.map(|n| points[n].coords);
            let Some(weights) = weights(corners) else { return };
            let start: [f64; 3] = (weights * (origin - corners[0])).into();
            let slope: [f64; 3] = (weights * direction).into();
            let all = |w: [f64; 3], whole: f64| [whole - (w[0] + w[1] + w[2]), w[0], w[1], w[2]];
            let (mut from, mut to) = (0.0_f64, f64::INFINITY);
            for (w, s) in all(start, 1.0).into_iter().zip(all(slope, 0.0)) {
                if s > 0.0 {
                    from = from.max(-w / s);
                } else if s < 0.0 {
                    to = to.min(-w / s);
                } else if w < 0.0 {
                    return;
                }
            }
            if from < to && to.is_finite() {
                let at = |t: f64| value_of(values, std::array::from_fn(|k| start[k] + slope[k] * t));
                found.push(CellSpan { reach: [from, to], values: [at(from), at(to)] });
            }
        });
        found
    };
    (0..item.grid.len()).into_par_iter().with_min_len(CELLS).flat_map_iter(in_cell).collect()
}
