//! What of a row of voxels a body surely holds, and what it may hold.
//!
//! Along a row the form of a face is linear in x and the squared distance of a round body is quadratic.
//! Both are compared with plus and minus a bound on everything that rounding can do to them, here and in
//! [`Body::holds`], which has the last word on what lies between.

use std::ops::Range;

use super::super::{Affine, Body, Face, Point, Vector};

/// Far above what a place in the world, and the few operations after it, lose of their size (less than
/// 1e-15): a wider bound only asks a few more voxels.
const ROUNDING: f64 = 1e-14;

/// A body of a cutter, as seen by the rows of one grid.
#[derive(Debug)]
pub(super) struct Wall {
    /// What a voxel in it gets.
    pub(super) bits: u32,
    body: Body,
    forms: Vec<Form>,
}

/// A function of the voxel that is negative in the body.
#[derive(Debug)]
enum Form {
    /// start + x·step.x + y·step.y + z·step.z.
    Linear { start: f64, step: Vector, slack: f64 },
    /// |start + x·steps[0] + y·steps[1] + z·steps[2]|² − square.
    Round { start: Vector, steps: [Vector; 3], square: f64, slack: f64 },
}

impl Wall {
    pub(super) fn new(body: Body, bits: u32, extent: [usize; 3], world_from_voxel: &Affine) -> Self {
        let corner = |bits: usize| {
            let last = |axis: usize| if bits >> axis & 1 == 1 { extent[axis] as f64 } else { 0.0 };
            world_from_voxel.point(&Point::new(last(0), last(1), last(2)))
        };
        let corners: [Point; 8] = std::array::from_fn(corner);
        let origin = corners[0];
        let linear = world_from_voxel.linear();
        let steps = [0, 1, 2].map(|axis| linear.column(axis).into_owned());
        // A place is summed of three products and an offset, each no larger than this.
        let terms: f64 = steps.iter().zip(extent).map(|(s, n)| s.amax() * n as f64).sum();
        let size = |point: &Point| origin.coords.amax() + terms + point.coords.amax();
        let of_face = |face: &Face| Form::Linear {
            start: face.normal.dot(&(origin - face.point)),
            step: Vector::from(steps.map(|s| face.normal.dot(&s))),
            slack: 8.0 * ROUNDING * face.normal.amax() * size(&face.point),
        };
        let round = |point: &Point, radius: f64, length: f64, across: &dyn Fn(Vector) -> Vector| {
            let far = corners.iter().map(|p| (p - point).norm()).fold(radius, f64::max) * length;
            let lost = ROUNDING * size(point) * length;
            Form::Round {
                start: across(origin - point),
                steps: steps.map(across),
                square: (radius * length).powi(2),
                slack: 8.0 * (far * lost + ROUNDING * far * far),
            }
        };
        let forms = match &body {
            Body::HalfSpace(_) | Body::Prism(_) => body.faces().iter().map(of_face).collect(),
            Body::Cylinder { point, axis, radius_mm } => {
                vec![round(point, *radius_mm, axis.norm(), &|v| v.cross(axis))]
            }
            Body::Ball { centre, radius_mm } => vec![round(centre, *radius_mm, 1.0, &|v| v)],
        };
        Self { bits, body, forms }
    }

    /// Whether the body holds a voxel's centre: the question itself.
    pub(super) fn holds(&self, voxel: [usize; 3], world_from_voxel: &Affine) -> bool {
        self.body.holds(&world_from_voxel.point(&Point::from(voxel.map(|v| v as f64))))
    }

    /// Of the `count` voxels of the row at `y` and `z`: those that the body surely holds, and those,
    /// among them the sure ones, that it may hold.
    pub(super) fn of_row(&self, [y, z]: [usize; 2], count: usize) -> (Range<usize>, Range<usize>) {
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        let (mut inside, mut perhaps) = (everywhere, everywhere);
        for form in &self.forms {
            let (surely, may) = form.of_row(y as f64, z as f64);
            inside = [inside[0].max(surely[0]), inside[1].min(surely[1])];
            perhaps = [perhaps[0].max(may[0]), perhaps[1].min(may[1])];
        }
        // A float that is negative or too large becomes the nearest whole number there is.
        let [from, to] = [perhaps[0].ceil() as usize, (perhaps[1] + 1.0).floor().max(0.0) as usize];
        let perhaps = from.min(count)..to.clamp(from.min(count), count);
        let [from, to] = [(inside[0] + 1.0).floor() as usize, inside[1].ceil().max(0.0) as usize];
        let from = from.clamp(perhaps.start, perhaps.end);
        (from..to.clamp(from, perhaps.end), perhaps)
    }
}

impl Form {
    /// The stretches of x in which the form is below −slack, and not above slack.
    fn of_row(&self, y: f64, z: f64) -> ([f64; 2], [f64; 2]) {
        match self {
            Self::Linear { start, step, slack } => {
                let start = start + step.y * y + step.z * z;
                (below(start + slack, step.x), below(start - slack, step.x))
            }
            Self::Round { start, steps: [along, up, back], square, slack } => {
                let start = start + up * y + back * z;
                (within(&start, along, square - slack), within(&start, along, square + slack))
            }
        }
    }
}

const NOWHERE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// Where start + x·step is below 0.
fn below(start: f64, step: f64) -> [f64; 2] {
    if step == 0.0 {
        return if start < 0.0 { [f64::NEG_INFINITY, f64::INFINITY] } else { NOWHERE };
    }
    let crossing = -start / step;
    if step > 0.0 { [f64::NEG_INFINITY, crossing] } else { [crossing, f64::INFINITY] }
}

/// Where |start + x·step|² is below `square`.
fn within(start: &Vector, step: &Vector, square: f64) -> [f64; 2] {
    let a = step.norm_squared();
    if a == 0.0 {
        return if start.norm_squared() < square { [f64::NEG_INFINITY, f64::INFINITY] } else { NOWHERE };
    }
    // By the distance of closest approach, which does not cancel.
    let discriminant = a * square - start.cross(step).norm_squared();
    if discriminant <= 0.0 {
        return NOWHERE;
    }
    let (middle, half) = (-start.dot(step) / a, discriminant.sqrt() / a);
    [middle - half, middle + half]
}
