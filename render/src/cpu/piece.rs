//! A piece of a volume as it lies before the camera: what its cutters leave of a ray, and the way into its voxels.

use super::field::{Field, Occupancy};
use super::line::{Form, Rays};
use super::painting::Painting;
use super::shine::shine;
use super::table::Table;
use crate::scene::{Piece, Shading, VolumeItem};
use crate::view::View;
use crate::volume::convex::HalfSpace;
use crate::volume::{Affine, Body, Face, Point, Vector};

/// A volume with its transfer function, kept from picture to picture.
#[derive(Debug)]
pub(super) struct Prepared<'a> {
    pub(super) field: &'a Field,
    pub(super) occupancy: &'a Occupancy,
    pub(super) table: &'a Table,
}

/// A convex body of a cutter: a ray is within it along one stretch.
#[derive(Debug)]
enum Inside {
    /// Within a distance of a line or a point, by its parts along two or three directions at right angles.
    Round { parts: Vec<Form>, radius_mm: f64 },
    /// Where all are positive.
    Prism(Vec<Form>),
}

/// A piece before the camera.
#[derive(Debug)]
pub(super) struct Placed<'a> {
    pub(super) volume: Prepared<'a>,
    /// Voxel coordinates.
    voxel: [Form; 3],
    /// The box and the planes: positive inside.
    planes: Vec<Form>,
    /// The same in view space.
    half_spaces: Vec<HalfSpace>,
    inside: Vec<Inside>,
    outside: Vec<Inside>,
    /// Takes a gradient by voxel steps, positions a voxel, to view space, positions a mm.
    gradient: [[f32; 3]; 3],
    pub(super) lit: bool,
    pub(super) painting: Option<Painting<'a>>,
    /// Depth of the near plane behind the eye; mm.
    pub(super) near_mm: f64,
    pub(super) view_from_voxel: Affine,
    /// Side of a voxel that is shortest; mm.
    pub(super) voxel_mm: f64,
}

/// What the cutters leave of a ray: stretches of zeta, rising.
pub(super) type Stretches = Vec<[f64; 2]>;

impl<'a> Placed<'a> {
    pub(super) fn new(
        item: &'a VolumeItem,
        piece: &Piece,
        volume: Prepared<'a>,
        view: &View,
        rays: &Rays,
    ) -> Self {
        let view_from_unmoved = view.view_from_world * piece.pose;
        let view_from_voxel = view_from_unmoved * item.pose * *item.grid.world_from_voxel();
        let voxel_from_view = view_from_voxel.inverse();
        let mut half_spaces = Vec::with_capacity(8);
        for axis in 0..3 {
            let mut inward = Vector::zeros();
            inward[axis] = 1.0;
            let last = item.grid.extent()[axis] as f64 - 0.5;
            let mut far = Point::origin();
            far[axis] = last;
            half_spaces.push(HalfSpace { normal: inward, offset: 0.5 }.transformed(&view_from_voxel));
            half_spaces.push(HalfSpace::new(&far, -inward).transformed(&view_from_voxel));
        }
        let (mut inside, mut outside) = (Vec::new(), Vec::new());
        for (cutter, side) in &piece.keep {
            let (body, is_inside) = cutter.solid(*side);
            let behind =
                |face: &Face| HalfSpace::new(&face.point, -face.normal).transformed(&view_from_unmoved);
            let round = match &body {
                Body::HalfSpace(face) if !is_inside => {
                    let half = HalfSpace::new(&face.point, face.normal);
                    half_spaces.push(half.transformed(&view_from_unmoved));
                    continue;
                }
                Body::HalfSpace(_) | Body::Prism(_) if is_inside => {
                    half_spaces.extend(body.faces().iter().map(behind));
                    continue;
                }
                Body::HalfSpace(_) | Body::Prism(_) => {
                    Inside::Prism(body.faces().iter().map(|face| rays.form(&behind(face))).collect())
                }
                Body::Cylinder { point, axis, radius_mm } => {
                    let [u, v] = across(axis);
                    Inside::round(point, &[u, v], *radius_mm, &view_from_unmoved, rays)
                }
                Body::Ball { centre, radius_mm } => {
                    let axes = [Vector::x(), Vector::y(), Vector::z()];
                    Inside::round(centre, &axes, *radius_mm, &view_from_unmoved, rays)
                }
            };
            if is_inside { inside.push(round) } else { outside.push(round) }
        }
        for half in &mut half_spaces {
            let length = half.normal.norm();
            if length > 0.0 {
                *half = HalfSpace { normal: half.normal / length, offset: half.offset / length };
            }
        }
        let scale = f64::from(volume.table.scale);
        let gradient = [0, 1, 2].map(|axis| {
            let mut along = Vector::zeros();
            along[axis] = 1.0;
            let g = view_from_voxel.normal(&along) * (scale / 2.0);
            [g.x as f32, g.y as f32, g.z as f32]
        });
        Self {
            volume,
            voxel: [0, 1, 2].map(|row| rays.row(&voxel_from_view, row)),
            planes: half_spaces.iter().map(|h| rays.form(h)).collect(),
            half_spaces,
            inside,
            outside,
            gradient,
            lit: item.shading == Shading::Lit,
            painting: item.labels.as_ref().map(|labels| Painting::new(labels, piece, view, rays)),
            near_mm: rays.near_mm,
            view_from_voxel,
            voxel_mm: view_from_voxel.column_lengths().into_iter().fold(f64::INFINITY, f64::min),
        }
    }

    /// Whether a convex set, given by its corners in view space, lies all outside one of the planes.
    pub(super) fn misses(&self, corners: &[Point; 8]) -> bool {
        self.half_spaces.iter().any(|h| corners.iter().all(|c| h.value(c) < 0.0))
    }

    /// Voxel coordinates at zeta 0, and per mm of zeta.
    #[inline(always)]
    pub(super) fn voxel_line(&self, lens: [f64; 2]) -> ([f64; 3], [f64; 3]) {
        let [x, y, z] = [self.voxel[0].on(lens), self.voxel[1].on(lens), self.voxel[2].on(lens)];
        ([x[0], y[0], z[0]], [x[1], y[1], z[1]])
    }

    /// |n·v| of the gradient at a voxel place, the central differences of the scalar; none where it is too flat to
    /// light.
    pub(super) fn facing(&self, at: [f32; 3], direction: [f32; 3]) -> Option<f32> {
        let field = self.volume.field;
        let values = field.values();
        let mut gradient = [0.0_f32; 3];
        for axis in 0..3 {
            let (mut before, mut after) = (at, at);
            before[axis] -= 1.0;
            after[axis] += 1.0;
            let rise = field.sample(values, after) - field.sample(values, before);
            for (sum, along) in gradient.iter_mut().zip(self.gradient[axis]) {
                *sum += rise * along;
            }
        }
        let [x, y, z] = gradient;
        let size = (x * x + y * y + z * z).sqrt();
        if size < self.volume.table.flat || size == 0.0 {
            return None;
        }
        let [dx, dy, dz] = direction;
        Some(((x * dx + y * dy + z * dz) / size).abs().min(1.0))
    }

    /// Lights the colour of a step, which is weighted with its optical depth, by the gradient at a voxel place.
    pub(super) fn light(&self, depth: &mut [f32; 4], at: [f32; 3], direction: [f32; 3]) {
        let Some(facing) = self.facing(at, direction) else { return };
        let [shade, highlight] = shine(facing);
        for c in 0..3 {
            depth[c] = (depth[c] * shade + depth[3] * highlight).clamp(0.0, depth[3]);
        }
    }

    /// Whether a ray meets it in one stretch at most.
    pub(super) fn is_convex(&self) -> bool {
        self.outside.is_empty()
    }

    /// What is left of `[from, to]` of a ray by all that leaves one stretch; none where nothing is.
    #[inline(always)]
    fn hull(&self, lens: [f64; 2], [mut from, mut to]: [f64; 2]) -> Option<[f64; 2]> {
        for plane in &self.planes {
            let [start, growth] = plane.on(lens);
            let crossing = -start / growth;
            if growth > 0.0 {
                from = from.max(crossing);
            } else if growth < 0.0 {
                to = to.min(crossing);
            } else if start < 0.0 {
                return None;
            }
        }
        for body in &self.inside {
            let [a, b] = body.within(lens);
            (from, to) = (from.max(a), to.min(b));
        }
        (from < to).then_some([from, to])
    }

    /// The one stretch of a ray through a convex piece.
    #[inline(always)]
    pub(super) fn stretch(&self, lens: [f64; 2], [from, to]: [f32; 2]) -> Option<[f32; 2]> {
        self.hull(lens, [f64::from(from), f64::from(to)]).map(|[a, b]| [a as f32, b as f32])
    }

    /// What is left of `[from, to]` of a ray.
    #[inline(always)]
    pub(super) fn stretches(&self, lens: [f64; 2], range: [f64; 2], into: &mut Stretches) {
        into.clear();
        into.extend(self.hull(lens, range));
        for body in &self.outside {
            let [a, b] = body.within(lens);
            if a < b {
                remove(into, a, b);
            }
        }
    }
}

/// Takes `a` to `b` away.
fn remove(stretches: &mut Stretches, a: f64, b: f64) {
    let mut i = 0;
    while i < stretches.len() {
        let [from, to] = stretches[i];
        if b <= from || a >= to {
            i += 1;
        } else if a > from && b < to {
            stretches[i] = [from, a];
            stretches.insert(i + 1, [b, to]);
            i += 2;
        } else if a > from {
            stretches[i] = [from, a];
            i += 1;
        } else if b < to {
            stretches[i] = [b, to];
            i += 1;
        } else {
            stretches.remove(i);
        }
    }
}

/// Two directions at right angles to `axis` and to each other, of length 1.
fn across(axis: &Vector) -> [Vector; 2] {
    let axis = axis.try_normalize(0.0).unwrap_or_else(Vector::z);
    let mut other = Vector::zeros();
    other[axis.iamin()] = 1.0;
    let u = axis.cross(&other).try_normalize(0.0).unwrap_or_else(Vector::x);
    [u, axis.cross(&u)]
}

/// A stretch that is none.
const NOWHERE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

impl Inside {
    fn round(
        centre: &Point,
        directions: &[Vector],
        radius_mm: f64,
        view_from_unmoved: &Affine,
        rays: &Rays,
    ) -> Self {
        let form =
            |normal: &Vector| rays.form(&HalfSpace::new(centre, *normal).transformed(view_from_unmoved));
        Self::Round { parts: directions.iter().map(form).collect(), radius_mm }
    }

    /// The stretch inside; not rising where there is none.
    fn within(&self, lens: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Round { parts, radius_mm } => within_round(parts, *radius_mm, lens),
            Self::Prism(faces) => {
                let [mut from, mut to] = [f64::NEG_INFINITY, f64::INFINITY];
                for face in faces {
                    let [start, growth] = face.on(lens);
                    let crossing = -start / growth;
                    if growth > 0.0 {
                        from = from.max(crossing);
                    } else if growth < 0.0 {
                        to = to.min(crossing);
                    } else if start <= 0.0 {
                        return NOWHERE;
                    }
                }
                [from, to]
            }
        }
    }
}

fn within_round(parts: &[Form], radius: f64, lens: [f64; 2]) -> [f64; 2] {
    let (mut start2, mut growth2, mut product) = (0.0, 0.0, 0.0);
    let mut lines = [[0.0; 2]; 3];
    for (line, part) in lines.iter_mut().zip(parts) {
        let [start, growth] = part.on(lens);
        *line = [start, growth];
        start2 += start * start;
        growth2 += growth * growth;
        product += start * growth;
    }
    if growth2 < 1e-30 {
        let is_inside = start2 < radius * radius;
        return if is_inside { [f64::NEG_INFINITY, f64::INFINITY] } else { NOWHERE };
    }
    // By the distance of closest approach: no cancellation for a far eye.
    let area = |i: usize, k: usize| lines[i][0] * lines[k][1] - lines[i][1] * lines[k][0];
    let closest2 = area(0, 1).powi(2) + area(1, 2).powi(2) + area(2, 0).powi(2);
    let discriminant = radius * radius * growth2 - closest2;
    if discriminant <= 0.0 {
        return NOWHERE;
    }
    let (middle, half) = (-product / growth2, discriminant.sqrt() / growth2);
    [middle - half, middle + half]
}
