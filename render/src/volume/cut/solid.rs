//! Convex solids as planes, and cutting by them.

use std::cell::LazyCell;
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use rayon::prelude::*;
use thiserror::Error;

use super::divide::{Crossings, Points, Triangle, divide};
use super::{CutError, Notes, Parts, Plane, by_plane, cap, part};
use crate::volume::{Affine, Body, Cutter, CutterError, Point, TriangleMesh, Vector};

/// How far a flat facet may lie from the round wall that it stands for; mm.
pub const DEFAULT_SAGITTA_MM: f64 = 0.01;

/// Most planes of a solid: finer walls are refused, since each plane is a cut.
const MAX_PLANES: usize = 20_000;

/// Why numbers are not a convex solid.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SolidError {
    /// No plane bounds it.
    #[error("a solid needs at least one plane")]
    NoPlane,
    /// The cutter is none.
    #[error("{0}")]
    Cutter(#[from] CutterError),
    /// The wall is too fine or the departure not positive.
    #[error(
        "a wall of radius {radius_mm} mm cannot be made of flat facets within {sagitta_mm} mm; allow a larger departure"
    )]
    Sagitta {
        /// As given.
        radius_mm: f64,
        /// As given.
        sagitta_mm: f64,
    },
}

/// The points on "-" of every one of some planes: a convex solid, possibly unbounded, its walls facing "+".
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    planes: Vec<Plane>,
}

impl Solid {
    /// The solid behind all of `planes`.
    ///
    /// # Errors
    /// [`SolidError::NoPlane`].
    pub fn new(planes: Vec<Plane>) -> Result<Self, SolidError> {
        if planes.is_empty() { Err(SolidError::NoPlane) } else { Ok(Self { planes }) }
    }

    /// The body of a cutter's side (see [`Cutter::solid`]), so that a mesh is cut as a volume is. A round wall becomes
    /// facets within `sagitta_mm` of it.
    ///
    /// # Errors
    /// [`SolidError::Cutter`], [`SolidError::Sagitta`].
    pub fn of(body: &Body, sagitta_mm: f64) -> Result<Self, SolidError> {
        match *body {
            Body::HalfSpace(_) | Body::Prism(_) => {
                let planes = body.faces().iter().map(|face| Plane::new(face.point, face.normal));
                Ok(Self { planes: planes.collect::<Result<_, _>>()? })
            }
            Body::Cylinder { point, axis, radius_mm } => Self::cylinder(point, axis, radius_mm, sagitta_mm),
            Body::Ball { centre, radius_mm } => Self::ball(centre, radius_mm, sagitta_mm),
        }
    }

    /// A cylinder without ends, as a prism whose edges lie on it: nowhere outside it, and inside it by
    /// `sagitta_mm` at most.
    ///
    /// # Errors
    /// [`SolidError::Cutter`], [`SolidError::Sagitta`].
    pub fn cylinder(point: Point, axis: Vector, radius_mm: f64, sagitta_mm: f64) -> Result<Self, SolidError> {
        Cutter::cylinder(point, axis, radius_mm)?;
        let refuse = || SolidError::Sagitta { radius_mm, sagitta_mm };
        let half = half_angle(radius_mm, sagitta_mm).ok_or_else(refuse)?;
        let count = (PI / half).ceil().max(3.0);
        if count > MAX_PLANES as f64 {
            return Err(refuse());
        }
        let along = axis / axis.norm();
        let mut pick = Vector::zeros();
        pick[along.iamin()] = 1.0;
        let u = along.cross(&pick).normalize();
        let v = along.cross(&u);
        let reach = radius_mm * (PI / count).cos();
        let plane = |i: usize| {
            let angle = TAU * i as f64 / count;
            let out = u * angle.cos() + v * angle.sin();
            Plane::new(point + out * reach, out)
        };
        Ok(Self { planes: (0..count as usize).map(plane).collect::<Result<_, _>>()? })
    }

    /// A ball, as a solid nowhere outside it, and inside it by `sagitta_mm` at most. It has a plane for each
    /// vertex of a finely divided icosahedron.
    ///
    /// # Errors
    /// [`SolidError::Cutter`], [`SolidError::Sagitta`].
    pub fn ball(centre: Point, radius_mm: f64, sagitta_mm: f64) -> Result<Self, SolidError> {
        Cutter::dome(centre, radius_mm)?;
        let refuse = || SolidError::Sagitta { radius_mm, sagitta_mm };
        let half = half_angle(radius_mm, sagitta_mm).ok_or_else(refuse)?;
        // The circle about a face of the icosahedron is 0.6524 rad wide. Of its parts the middle ones are the
        // widest, by less than 1.27 times the mean.
        let parts = (0.6524 * 1.27 / half).ceil().max(1.0);
        if 10.0 * parts * parts + 2.0 > MAX_PLANES as f64 {
            return Err(refuse());
        }
        let directions = directions(parts as usize);
        let reach = radius_mm * half.cos();
        let plane = |out: Vector| Plane::new(centre + out * reach, out);
        Ok(Self { planes: directions.into_iter().map(plane).collect::<Result<_, _>>()? })
    }

    /// The planes, each facing outwards.
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// The solid where a transform takes it.
    ///
    /// # Errors
    /// [`SolidError::Cutter`] where the numbers overflow or vanish.
    pub fn transformed(&self, b_from_a: &Affine) -> Result<Self, SolidError> {
        let planes = self.planes.iter().map(|plane| plane.transformed(b_from_a));
        Ok(Self { planes: planes.collect::<Result<_, _>>()? })
    }
}

/// The angle from the middle of a facet to its edge, where that lies on the round wall.
fn half_angle(radius_mm: f64, sagitta_mm: f64) -> Option<f64> {
    let is_departure = sagitta_mm > 0.0 && sagitta_mm.is_finite();
    let angle = is_departure.then(|| (1.0 - (sagitta_mm / radius_mm).min(0.5)).acos())?;
    (angle > 0.0).then_some(angle)
}

/// Unit vectors spread over the sphere: an icosahedron's faces divided into `parts` along each edge.
fn directions(parts: usize) -> Vec<Vector> {
    let g = f64::midpoint(1.0, 5.0_f64.sqrt());
    let mut corners = Vec::with_capacity(12);
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        corners.extend([Vector::new(0.0, a, b), Vector::new(a, b, 0.0), Vector::new(b, 0.0, a)]);
    }
    let near = |a: &Vector, b: &Vector| (a - b).norm_squared() < 4.5;
    let mut found = corners.clone();
    let n = parts as f64;
    for (i, a) in corners.iter().enumerate() {
        for (j, b) in corners.iter().enumerate().skip(i + 1).filter(|(_, b)| near(a, b)) {
            found.extend((1..parts).map(|k| a + (b - a) * (k as f64 / n)));
            for c in corners.iter().skip(j + 1).filter(|c| near(a, c) && near(b, c)) {
                let inner =
                    (1..parts).flat_map(|k| (1..parts - k).map(move |l| (k as f64 / n, l as f64 / n)));
                found.extend(inner.map(|(k, l)| a + (b - a) * k + (c - a) * l));
            }
        }
    }
    found.iter().map(|v| v / v.norm()).collect()
}

/// Divides a mesh by a convex solid: "-" is what lies within, "+" outside.
///
/// Both parts are closed where the mesh is, and have their vertices along the cut in common. Notes count the
/// lines of all planes, those included of whose caps later planes leave nothing.
///
/// # Errors
/// [`CutError::TooLarge`].
pub fn by_solid(mesh: &TriangleMesh, solid: &Solid) -> Result<Parts, CutError> {
    if let [plane] = solid.planes() {
        return by_plane(mesh, plane);
    }
    let mut points = Points::of(mesh);
    // No plane touches a triangle whose corners are within all of them.
    let within = |p: &Point| solid.planes().iter().all(|plane| plane.sign(p) < 0);
    let is_within: Vec<bool> = mesh.positions().par_iter().with_min_len(1024).map(within).collect();
    let (settled, mut surface): (Vec<Triangle>, Vec<Triangle>) =
        mesh.triangles().iter().partition(|t| t.iter().all(|&v| is_within[v as usize]));
    let mut caps: Vec<Triangle> = Vec::new();
    let mut outside: Vec<Triangle> = Vec::new();
    let mut rims = Rims { is_rim: vec![false; points.count()], ..Rims::default() };
    let mut notes = Notes::default();
    let mut signs = Signs::default();
    let is_inside_out = LazyCell::new(|| mesh.volume_mm3() < 0.0);
    for (round, plane) in solid.planes().iter().enumerate() {
        points.check_room(surface.len() + caps.len())?;
        if !signs.ask(round, plane, &points, [&surface, &caps]) {
            continue;
        }
        let mut crossings = Crossings::default();
        let cut_surface = divide(&mut points, plane, &signs.of, &surface, &mut crossings, || *is_inside_out);
        let cut_caps = divide(&mut points, plane, &signs.of, &caps, &mut crossings, || *is_inside_out);
        rims.take(crossings, &signs, round, points.count());
        outside.extend(cut_surface.plus);
        (surface, caps) = (cut_surface.minus, cut_caps.minus);
        let rim = [cut_surface.rim, cut_caps.rim].concat();
        let cap = cap::of(rim, &points, plane);
        notes.closed += cap.notes.closed;
        notes.open += cap.notes.open;
        caps.extend(cap.triangles);
    }
    let outside = rims.refined(outside, &points);
    let turned: Vec<Triangle> = caps.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let (plus, minus) = rayon::join(
        || part::gather(&points, &[&outside, &turned]),
        || part::gather(&points, &[&settled, &surface, &caps]),
    );
    Ok(Parts { plus, minus, notes })
}

/// The sides of the vertices of those triangles that are left.
#[derive(Default)]
struct Signs {
    of: Vec<i8>,
    /// The round, plus one, in which each was asked for.
    asked: Vec<usize>,
}

impl Signs {
    /// Asks for the sides of all vertices of `lists`; whether any is on "+" or in the plane.
    fn ask(&mut self, round: usize, plane: &Plane, points: &Points<'_>, lists: [&[Triangle]; 2]) -> bool {
        self.of.resize(points.count(), 0);
        self.asked.resize(points.count(), 0);
        let mut any = false;
        for vertex in lists.into_iter().flatten().flatten() {
            let at = *vertex as usize;
            if self.asked[at] != round + 1 {
                self.asked[at] = round + 1;
                self.of[at] = plane.sign(&points.at(*vertex));
                any |= self.of[at] >= 0;
            }
        }
        any
    }
}

/// Where later planes cut edges that earlier ones made, between what is kept and what was cut away.
#[derive(Default)]
struct Rims {
    /// The vertex between the ends of an edge that was cut, lower end first.
    cut: HashMap<[u32; 2], u32>,
    /// Whether a vertex lies in one of the planes.
    is_rim: Vec<bool>,
}

impl Rims {
    fn take(&mut self, crossings: Crossings, signs: &Signs, round: usize, count: usize) {
        self.cut.extend(crossings.into_edges());
        for (is_rim, _) in self
            .is_rim
            .iter_mut()
            .zip(signs.asked.iter().zip(&signs.of))
            .filter(|(_, (asked, sign))| **asked == round + 1 && **sign == 0)
        {
            *is_rim = true;
        }
        self.is_rim.resize(count, true);
    }

    /// Triangles that were cut away, divided where their edges were cut after that.
    fn refined(&self, triangles: Vec<Triangle>, points: &Points<'_>) -> Vec<Triangle> {
        let mut open = triangles;
        // From the front to the back, so that the order stays.
        open.reverse();
        let mut done = Vec::with_capacity(open.len());
        while let Some(triangle) = open.pop() {
            let is_rim = |v: u32| points.is_new(v) || self.is_rim[v as usize];
            let cut = (0..3).find_map(|i| {
                let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
                let edge = [a.min(b), a.max(b)];
                let at = if is_rim(a) && is_rim(b) { self.cut.get(&edge) } else { None };
                at.map(|&at| (a, b, triangle[(i + 2) % 3], at))
            });
            if let Some((a, b, c, at)) = cut {
                open.extend([[at, b, c], [a, at, c]]);
            } else {
                done.push(triangle);
            }
        }
        done
    }
}
