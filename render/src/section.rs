//! Cross-sections: flat pictures sampled on the CPU from the original data, never from a texture.
//!
//! A [`Section`] is a rectangle of square pixels in world space. Each [`Layer`] is a volume with its
//! pieces, so a fragment shows where it was moved to. A pixel takes the value at its centre,
//! interpolated as [`Grid::sample`] does, through the inverse of the piece's pose; where two pieces
//! overlap, the later one is seen. Layers are blended in order. Outlines of meshes and cutters in the
//! plane come as lines in world millimetres.
//!
//! No GPU and no window here: what a section shows is what a measurement reads.

mod outline;

use std::sync::Arc;

pub use outline::cutter_outline;
use rayon::prelude::*;
use thiserror::Error;

use crate::scene::Piece;
use crate::volume::{Affine, Body, Grid, Point, TriangleMesh, Vector};

/// Most pixels of one section: beyond this a window size is a mistake.
const MAX_PIXELS: usize = 1 << 26;

/// Why numbers are not a section.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SectionError {
    /// A number is NaN or infinite, or the scale is not positive.
    #[error("a section has a number that is not finite, or a scale that is not positive")]
    NotFinite,
    /// The two directions have no length or are parallel.
    #[error("the directions of a section do not span a plane")]
    Flat,
    /// No pixel, or more than can be meant.
    #[error("a section of {width} by {height} pixels cannot be drawn")]
    Size {
        /// As given.
        width: usize,
        /// As given.
        height: usize,
    },
}

/// A rectangle of square pixels in world space; rows from the top.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    centre: Point,
    right: Vector,
    down: Vector,
    mm_per_pixel: f64,
    size: [usize; 2],
}

impl Section {
    /// A section whose middle is at `centre` (world mm), with the picture's `right` and `down` as world
    /// directions of any length (`down` is made perpendicular to `right`), `mm_per_pixel` > 0 along
    /// both, and `size` pixels `[width, height]`.
    ///
    /// # Errors
    /// [`SectionError`] for what its variants name.
    pub fn new(
        centre: Point,
        right: Vector,
        down: Vector,
        mm_per_pixel: f64,
        size: [usize; 2],
    ) -> Result<Self, SectionError> {
        let [width, height] = size;
        if width == 0 || height == 0 || width.checked_mul(height).is_none_or(|n| n > MAX_PIXELS) {
            return Err(SectionError::Size { width, height });
        }
        let numbers = centre.iter().chain(right.iter()).chain(down.iter());
        let finite = numbers.copied().all(f64::is_finite);
        if !(finite && mm_per_pixel > 0.0 && mm_per_pixel.is_finite()) {
            return Err(SectionError::NotFinite);
        }
        let right = right.try_normalize(1e-100).ok_or(SectionError::Flat)?;
        let unit_down = down.try_normalize(1e-100).ok_or(SectionError::Flat)?;
        let down =
            (unit_down - right * right.dot(&unit_down)).try_normalize(1e-9).ok_or(SectionError::Flat)?;
        Ok(Self { centre, right, down, mm_per_pixel, size })
    }

    /// Pixels, `[width, height]`.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Length of a pixel's side; mm.
    pub fn mm_per_pixel(&self) -> f64 {
        self.mm_per_pixel
    }

    /// Unit vector towards the picture's right.
    pub fn right(&self) -> Vector {
        self.right
    }

    /// Unit vector towards the picture's lower edge.
    pub fn down(&self) -> Vector {
        self.down
    }

    /// Unit vector away from the viewer.
    pub fn forward(&self) -> Vector {
        self.right.cross(&self.down)
    }

    /// World place of a position in pixels; the centre of pixel (i, j) is at (i + 0.5, j + 0.5).
    pub fn point(&self, x: f64, y: f64) -> Point {
        let [width, height] = self.size;
        self.centre
            + self.right * ((x - width as f64 / 2.0) * self.mm_per_pixel)
            + self.down * ((y - height as f64 / 2.0) * self.mm_per_pixel)
    }

    /// Position in pixels of a world place, projected onto the plane; the inverse of
    /// [`Section::point`] for points of the plane.
    pub fn pixel(&self, p: &Point) -> [f64; 2] {
        let from_centre = p - self.centre;
        let along =
            |axis: &Vector, size: usize| axis.dot(&from_centre) / self.mm_per_pixel + size as f64 / 2.0;
        [along(&self.right, self.size[0]), along(&self.down, self.size[1])]
    }

    /// Distance of a world place from the plane, positive behind it as seen by the viewer; mm.
    pub fn depth_mm(&self, p: &Point) -> f64 {
        self.forward().dot(&(p - self.centre))
    }
}

/// Values from black to white: what radiology calls window and level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Value of middle grey ("level").
    pub level: f64,
    /// Values from black to white, > 0.
    pub width: f64,
}

impl Window {
    /// Grey of a value, clamped to 0 (black) … 1 (white). A width that is not positive is a step.
    pub fn grey(&self, value: f64) -> f64 {
        if self.width > 0.0 {
            ((value - self.level) / self.width + 0.5).clamp(0.0, 1.0)
        } else {
            f64::from(u8::from(value >= self.level))
        }
    }
}

/// A volume as a section shows it.
#[derive(Debug, Clone)]
pub struct Layer {
    /// Its samples, as loaded.
    pub grid: Arc<Grid>,
    /// `world_from_patient`, as in [`crate::scene::VolumeItem`].
    pub pose: Affine,
    /// The pieces to show; none shows nothing.
    pub pieces: Vec<Piece>,
    /// What is black and what is white.
    pub window: Window,
    /// Display colour of white; 0 to 1.
    pub color: [f64; 3],
    /// Share of this layer where it lies over an earlier one; 0 to 1. Over nothing it is shown whole.
    pub share: f64,
}

/// What one piece needs per pixel, prepared once.
struct Prepared {
    /// The bodies of the cutters, and whether their inside is kept.
    keep: Vec<(Body, bool)>,
    unmoved_from_world: Affine,
    voxel_from_world: Affine,
}

impl Layer {
    fn prepare(&self) -> Vec<Prepared> {
        let voxel_from_unmoved = (self.pose * *self.grid.world_from_voxel()).inverse();
        self.pieces
            .iter()
            .map(|piece| {
                let unmoved_from_world = piece.pose.inverse();
                let voxel_from_world = voxel_from_unmoved * unmoved_from_world;
                let keep = piece.keep.iter().map(|(cutter, side)| cutter.solid(*side)).collect();
                Prepared { keep, unmoved_from_world, voxel_from_world }
            })
            .collect()
    }

    /// The value at a world place, of the last piece that lies there; `None` where none does.
    pub fn value(&self, p: &Point) -> Option<f64> {
        value(&self.grid, &self.prepare(), p)
    }
}

fn value(grid: &Grid, pieces: &[Prepared], p: &Point) -> Option<f64> {
    pieces.iter().rev().find_map(|piece| {
        // The box is the cheaper question, so it comes first.
        let value = grid.sample(&piece.voxel_from_world.point(p))?;
        let unmoved = piece.unmoved_from_world.point(p);
        piece.keep.iter().all(|(body, inside)| body.holds(&unmoved) == *inside).then_some(value)
    })
}

/// The values of one layer, row by row from the top; NaN where there is nothing.
pub fn values(section: &Section, layer: &Layer) -> Vec<f64> {
    let [width, _] = section.size;
    let pieces = layer.prepare();
    let mut values = vec![f64::NAN; section.size.iter().product()];
    values.par_chunks_mut(width).enumerate().for_each(|(j, row)| {
        for (i, slot) in row.iter_mut().enumerate() {
            let p = section.point(i as f64 + 0.5, j as f64 + 0.5);
            *slot = value(&layer.grid, &pieces, &p).unwrap_or(f64::NAN);
        }
    });
    values
}

/// The picture of all layers, blended in order over `background` (display values, 0 to 1); opaque
/// RGBA, 4 bytes a pixel, rows from the top.
pub fn picture(section: &Section, layers: &[Layer], background: [f64; 3]) -> Vec<u8> {
    let [width, height] = section.size;
    let prepared: Vec<_> = layers.iter().map(|layer| (layer, layer.prepare())).collect();
    let mut bytes = vec![255_u8; width * height * 4];
    bytes.par_chunks_mut(width * 4).enumerate().for_each(|(j, row)| {
        for (i, pixel) in row.chunks_exact_mut(4).enumerate() {
            let p = section.point(i as f64 + 0.5, j as f64 + 0.5);
            let mut color = None;
            for (layer, pieces) in &prepared {
                let Some(value) = value(&layer.grid, pieces, &p) else { continue };
                let grey = layer.window.grey(value);
                let over: [f64; 3] = layer.color.map(|c| c * grey);
                color = Some(match color {
                    None => over,
                    Some(under) => blend(under, over, layer.share),
                });
            }
            for (byte, c) in pixel.iter_mut().zip(color.unwrap_or(background)) {
                *byte = (c.clamp(0.0, 1.0) * 255.0).round() as u8;
            }
        }
    });
    bytes
}

fn blend(under: [f64; 3], over: [f64; 3], share: f64) -> [f64; 3] {
    std::array::from_fn(|c| under[c] + (over[c] - under[c]) * share)
}

/// Where a mesh crosses the section's plane: line pieces in world mm, unordered. `pose` is
/// `world_from_mesh`. A triangle that lies in the plane gives nothing; its neighbours draw its edges.
pub fn mesh_outline(section: &Section, mesh: &TriangleMesh, pose: &Affine) -> Vec<[Point; 2]> {
    let in_world: Vec<Point> = mesh.positions().par_iter().map(|p| pose.point(p)).collect();
    let depth: Vec<f64> = in_world.par_iter().map(|p| section.depth_mm(p)).collect();
    let crossing = |corners: &[u32; 3]| {
        let corner = corners.map(|v| v as usize);
        let mut ends = (0..3).filter_map(|k| {
            let (a, b) = (corner[k], corner[(k + 1) % 3]);
            // Half-open, so that a plane through a vertex meets two edges and not one or three.
            ((depth[a] < 0.0) != (depth[b] < 0.0)).then(|| {
                let part = depth[a] / (depth[a] - depth[b]);
                in_world[a] + (in_world[b] - in_world[a]) * part
            })
        });
        Some([ends.next()?, ends.next()?])
    };
    mesh.triangles().par_iter().filter_map(crossing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Cutter, Rescale, Samples, Side};

    /// 9 × 8 × 7 samples of a linear field (so that interpolation has a closed form), turned and moved.
    fn linear_grid() -> (Arc<Grid>, impl Fn(&Point) -> f64) {
        let turn = Affine::rotation_about(Point::new(5.0, 5.0, 5.0), Vector::new(1.0, 2.0, 3.0), 0.4);
        let scale = Affine::from_columns(
            Vector::new(2.0, 0.0, 0.0),
            Vector::new(0.0, 1.5, 0.0),
            Vector::new(0.0, 0.0, 3.0),
            Point::new(-7.0, 4.0, 11.0),
        )
        .expect("columns");
        let world_from_voxel = turn * scale;
        let field = |p: &Point| 3.0 * p.x - 2.0 * p.y + 0.5 * p.z + 10.0;
        let mut samples = Vec::new();
        for z in 0..7 {
            for y in 0..8 {
                for x in 0..9 {
                    let at = Point::new(f64::from(x), f64::from(y), f64::from(z));
                    samples.push(field(&world_from_voxel.point(&at)));
                }
            }
        }
        let grid = Grid::new([9, 8, 7], Samples::F64(samples), Rescale::default(), world_from_voxel);
        (Arc::new(grid.expect("grid")), field)
    }

    fn layer(grid: Arc<Grid>, pieces: Vec<Piece>) -> Layer {
        let window = Window { level: 0.0, width: 100.0 };
        Layer { grid, pose: Affine::identity(), pieces, window, color: [1.0; 3], share: 0.5 }
    }

    fn through(grid: &Grid, size: [usize; 2]) -> Section {
        let middle = grid.world_from_voxel().point(&Point::new(4.0, 3.5, 3.0));
        Section::new(middle, Vector::new(1.0, 0.2, 0.0), Vector::new(0.0, 0.3, -1.0), 0.7, size)
            .expect("section")
    }

    #[test]
    fn a_section_of_a_linear_field_is_that_field() {
        let (grid, field) = linear_grid();
        let section = through(&grid, [31, 25]);
        let values = values(&section, &layer(grid.clone(), vec![Piece::whole()]));
        let mut seen = 0;
        for (index, value) in values.iter().enumerate() {
            let p = section.point((index % 31) as f64 + 0.5, (index / 31) as f64 + 0.5);
            let at = grid.world_from_voxel().inverse().point(&p);
            let inside = at.iter().zip(grid.extent()).all(|(&c, n)| c >= -0.5 && c <= n as f64 - 0.5);
            assert_eq!(value.is_finite(), inside, "there is a value exactly inside, pixel {index}");
            // In the outer half voxel the edge is held, so the closed form is for the inner part.
            if at.iter().zip(grid.extent()).all(|(&c, n)| c >= 0.0 && c <= n as f64 - 1.0) {
                seen += 1;
                assert!((value - field(&p)).abs() < 1e-9, "pixel {index}: {value} is not {}", field(&p));
            }
        }
        assert!(seen > 100, "the section must pass through the data, not beside it: {seen}");
    }

    #[test]
    fn a_moved_fragment_is_shown_where_it_was_moved_to() {
        let (grid, field) = linear_grid();
        let section = through(&grid, [41, 41]);
        let plane = Cutter::plane(section.point(20.5, 20.5), Vector::new(1.0, 0.0, 0.0)).expect("plane");
        let shift = Vector::new(30.0, 2.0, 0.0);
        let pieces = vec![
            Piece { keep: vec![(plane, Side::Minus)], pose: Affine::identity() },
            Piece { keep: vec![(plane, Side::Plus)], pose: Affine::translation(shift) },
        ];
        let layer = layer(grid, pieces);
        let kept = section.point(18.5, 20.5);
        let went = section.point(22.5, 20.5);
        assert!(layer.value(&kept).is_some_and(|v| (v - field(&kept)).abs() < 1e-9), "the part that stayed");
        assert_eq!(layer.value(&went), None, "the place it left is empty");
        let value = layer.value(&(went + shift));
        assert!(value.is_some_and(|v| (v - field(&went)).abs() < 1e-9), "its values went with it");
    }

    #[test]
    fn pixels_and_places_are_each_others_inverse() {
        let (grid, _) = linear_grid();
        let section = through(&grid, [30, 20]);
        let [x, y] = section.pixel(&section.point(3.25, 17.5));
        assert!((x - 3.25).abs() < 1e-9 && (y - 17.5).abs() < 1e-9, "there and back: {x} {y}");
        let step = (section.point(1.0, 0.0) - section.point(0.0, 0.0)).norm();
        let down = (section.point(0.0, 1.0) - section.point(0.0, 0.0)).norm();
        assert!((step - 0.7).abs() < 1e-12 && (down - 0.7).abs() < 1e-12, "square pixels: {step} {down}");
        assert!(section.right().dot(&section.down()).abs() < 1e-12, "at right angles");
    }

    #[test]
    fn two_layers_blend_by_share_and_one_alone_is_whole() {
        let flat = |value: f64, n: usize| {
            let grid =
                Grid::new([n, 1, 1], Samples::F64(vec![value; n]), Rescale::default(), Affine::identity());
            Arc::new(grid.expect("grid"))
        };
        let mut low = layer(flat(-50.0, 4), vec![Piece::whole()]);
        let high = layer(flat(50.0, 2), vec![Piece::whole()]);
        low.window = Window { level: 0.0, width: 200.0 };
        let section = Section::new(Point::new(1.5, 0.0, 0.0), Vector::x(), Vector::y(), 1.0, [6, 1]);
        let bytes = picture(&section.expect("section"), &[low, high], [0.0, 0.0, 1.0]);
        let pixel = |i: usize| [bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]];
        assert_eq!(pixel(0), [0, 0, 255, 255], "background beside the data");
        // A quarter grey below, white above, half each: 0.625.
        assert_eq!(pixel(1), [159, 159, 159, 255], "blended where both are");
        assert_eq!(pixel(4), [64, 64, 64, 255], "one alone is shown whole");
    }

    #[test]
    fn a_cube_is_outlined_by_its_square() {
        let corner = |i: usize| Point::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64);
        let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let mesh = TriangleMesh::new((0..8).map(corner).collect(), triangles).expect("cube");
        let centre = Point::new(10.5, 0.5, 0.25);
        let section = Section::new(centre, Vector::x(), Vector::y(), 0.1, [40, 40]).expect("section");
        let pose = Affine::translation(Vector::new(10.0, 0.0, 0.0));
        let length: f64 = mesh_outline(&section, &mesh, &pose).iter().map(|[a, b]| (b - a).norm()).sum();
        assert!((length - 4.0).abs() < 1e-9, "the outline is as long as the square: {length}");
    }

    #[test]
    fn numbers_that_make_no_section_are_refused() {
        let make = |right, mm, size| Section::new(Point::origin(), right, Vector::y(), mm, size);
        assert_eq!(make(Vector::y(), 1.0, [4, 4]), Err(SectionError::Flat), "parallel");
        assert_eq!(make(Vector::x(), 0.0, [4, 4]), Err(SectionError::NotFinite), "no scale");
        let huge = make(Vector::x(), 1.0, [usize::MAX, 2]);
        assert!(matches!(huge, Err(SectionError::Size { .. })), "product does not overflow");
    }
}
