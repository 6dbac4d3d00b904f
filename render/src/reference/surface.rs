//! Where a ray passes the triangles of meshes: every crossing, none twice.
//!
//! The plane across the ray is where it is decided whether a triangle is hit. Each corner is sheared
//! along the ray onto that plane (Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection"), by
//! an arithmetic that depends on the corner alone; from there on the decision is exact, and where the
//! ray meets an edge or a corner it is moved aside by an infinitely small amount, the same for every
//! triangle (Edelsbrunner, Mücke 1990, "Simulation of Simplicity"). So triangles that share an edge
//! agree on its side, and a closed mesh is crossed an even number of times. Differs from Woop et al.,
//! who let both triangles of an edge be hit.

use super::hierarchy::{Bounded, Hierarchy};
use super::light;
use crate::scene::{MeshItem, Shading};
use crate::volume::{Point, Vector};

/// A crossing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hit {
    /// mm along the ray.
    pub(super) at: f64,
    /// As it is seen, lit if it is to be.
    pub(super) color: [f64; 3],
    pub(super) opacity: f64,
    /// Position of the triangle over all meshes, in their order: what decides between equal depths.
    triangle: usize,
}

impl Hit {
    /// A layer that is no triangle: of a volume that is drawn as one.
    pub(super) fn layer(at: f64, color: [f64; 3], opacity: f64) -> Self {
        Self { at, color, opacity, triangle: usize::MAX }
    }
}

#[derive(Debug)]
struct Triangle {
    corners: [Vector; 3],
    mesh: usize,
    order: usize,
}

/// All meshes of a scene, relative to the eye.
#[derive(Debug)]
pub(super) struct Surfaces {
    triangles: Hierarchy<Triangle>,
    looks: Vec<([f64; 3], f64, Shading)>,
}

impl Surfaces {
    /// Places the meshes. Invisible ones are left out.
    pub(super) fn of(meshes: &[MeshItem], eye: &Point) -> Self {
        let mut triangles = Vec::new();
        let mut order = 0;
        for (mesh, item) in meshes.iter().enumerate() {
            let linear = item.pose.linear();
            let origin = item.pose.point(&Point::origin()) - eye;
            let placed: Vec<Vector> =
                item.mesh.positions().iter().map(|p| linear * p.coords + origin).collect();
            for corners in item.mesh.triangles() {
                if item.opacity > 0.0 {
                    triangles.push(Triangle { corners: corners.map(|v| placed[v as usize]), mesh, order });
                }
                order += 1;
            }
        }
        let looks = meshes.iter().map(|item| (item.color, item.opacity, item.shading)).collect();
        Self { triangles: Hierarchy::new(triangles), looks }
    }

    /// Every crossing of the ray at or after its start, sorted by distance; at one distance in the order
    /// of meshes and triangles. `offset` is the ray's start relative to the eye; `direction` is a unit
    /// vector.
    pub(super) fn hits(&self, offset: &Vector, direction: &Vector, into: &mut Vec<Hit>) {
        into.clear();
        let shear = Shear::along(direction);
        for triangle in self.triangles.near(offset, direction) {
            let Some(at) = shear.hit(&triangle.corners.map(|c| c - offset)) else { continue };
            if at >= 0.0 {
                let (color, opacity, shading) = self.looks[triangle.mesh];
                let color = match shading {
                    Shading::None => color,
                    Shading::Lit => light::lit(color, triangle.facing(direction)),
                };
                into.push(Hit { at, color, opacity, triangle: triangle.order });
            }
        }
        into.sort_unstable_by(|a, b| a.at.total_cmp(&b.at).then(a.triangle.cmp(&b.triangle)));
    }
}

impl Bounded for Triangle {
    fn corners(&self) -> &[Vector] {
        &self.corners
    }
}

impl Triangle {
    /// |n·v| of the face.
    fn facing(&self, direction: &Vector) -> f64 {
        let [a, b, c] = self.corners;
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector::zeros);
        normal.dot(direction).abs().min(1.0)
    }
}

/// What takes a ray onto the axis it is most along.
#[derive(Debug, Clone, Copy)]
struct Shear {
    axes: [usize; 3],
    by: [f64; 3],
}

impl Shear {
    fn along(direction: &Vector) -> Self {
        let z = direction.iamax();
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let [x, y, z] = axes.map(|a| direction[a]);
        Self { axes, by: [x / z, y / z, 1.0 / z] }
    }

    /// Distance of the triangle's crossing, mm, before or behind; corners are relative to the ray's start.
    fn hit(&self, corners: &[Vector; 3]) -> Option<f64> {
        let [x, y, z] = self.axes;
        let flat = corners.map(|c| [c[x] - self.by[0] * c[z], c[y] - self.by[1] * c[z]]);
        let sides: [f64; 3] = std::array::from_fn(|i| edge(flat[(i + 1) % 3], flat[(i + 2) % 3]));
        let same = sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0);
        if !same {
            return None;
        }
        // The signs are decided; the areas themselves may be rounded.
        let areas: [f64; 3] = std::array::from_fn(|i| {
            let (a, b) = (flat[(i + 1) % 3], flat[(i + 2) % 3]);
            (a[0] * b[1] - a[1] * b[0]).abs()
        });
        let depths = corners.map(|c| c[z] * self.by[2]);
        let all: f64 = areas.iter().sum();
        let (near, far) =
            depths.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &d| (a.min(d), b.max(d)));
        let at = (0..3).map(|i| areas[i] * depths[i]).sum::<f64>() / all;
        // Seen edge-on all areas may be nothing: then every depth of the triangle is as good.
        Some(if at.is_finite() { at.clamp(near, far) } else { near })
    }
}

/// A number with the exact sign of a × b, the side of the origin from the edge a to b. Where the origin
/// is on the edge's line, it is taken as moved by (ε, ε²); zero only for an edge of no length.
fn edge(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (p, q) = (a[0] * b[1], a[1] * b[0]);
    let rough = p - q;
    if rough.abs() > 4.0 * f64::EPSILON * (p.abs() + q.abs()) {
        return rough;
    }
    // p and q are close, so their difference is exact; what each product rounded off comes from a fused
    // multiply-add, and the difference of those two is kept in two parts.
    let (p_rest, q_rest) = (a[0].mul_add(b[1], -p), a[1].mul_add(b[0], -q));
    let rest = p_rest - q_rest;
    let virtual_part = p_rest - rest;
    let rest_of_rest = (p_rest - (rest + virtual_part)) + (virtual_part - q_rest);
    let sum = rough + rest;
    let signed = [sum, rest_of_rest, a[1] - b[1], b[0] - a[0]];
    signed.into_iter().find(|&s| s != 0.0).unwrap_or(0.0)
}
