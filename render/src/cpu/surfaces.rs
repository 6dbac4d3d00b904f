//! Triangles in the picture: every crossing of a pixel's ray with one, none twice, none missed.
//!
//! A ray passes an edge on the side that the sign of a determinant says, which is affine in the lens coordinates
//! (Olano, Greer 1997, "Triangle scan conversion using 2D homogeneous coordinates", Graphics Hardware). It is worked
//! out from the edge's two ends in an order of their own, so both triangles of an edge have the same number with
//! opposite signs, also where it is 0: a ray through a shared edge crosses exactly one of them.

use super::line::Rays;
use super::shine::shine;
use super::tiles::TILE;
use crate::scene::{MeshItem, Shading};
use crate::view::View;
use crate::volume::Vector;

/// A crossing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hit {
    pub(super) zeta: f32,
    /// As it is seen, lit if it is to be.
    pub(super) color: [f32; 3],
    pub(super) opacity: f32,
    /// Position of the triangle over all meshes, in their order: what decides between equal depths.
    order: u32,
}

impl Hit {
    /// A layer of a volume: at one depth it comes after all triangles.
    pub(super) fn layer(zeta: f32, color: [f32; 3], opacity: f32) -> Self {
        Self { zeta, color, opacity, order: u32::MAX }
    }
}

/// How a mesh looks.
#[derive(Debug)]
struct Look {
    color: [f64; 3],
    opacity: f64,
    lit: bool,
}

#[derive(Debug)]
struct Triangle {
    corners: [Vector; 3],
    look: u32,
    order: u32,
    /// Columns and rows, first and last, that it may cover.
    x: [u32; 2],
    y: [u32; 2],
}

/// All meshes of a scene before the camera.
#[derive(Debug)]
pub(super) struct Surfaces {
    triangles: Vec<Triangle>,
    looks: Vec<Look>,
    /// Triangles of each row of tiles, opaque ones first.
    bands: Vec<Vec<u32>>,
}

/// Room around a triangle's place in the picture; pixels.
const ROOM: f64 = 0.01;

impl Surfaces {
    pub(super) fn new(meshes: &[MeshItem], view: &View, rays: &Rays) -> Self {
        let [width, height] = view.size;
        let mut triangles = Vec::new();
        let mut looks = Vec::new();
        let mut order = 0;
        for item in meshes {
            let view_from_mesh = view.view_from_world * item.pose;
            let placed: Vec<Vector> =
                item.mesh.positions().iter().map(|p| view_from_mesh.point(p).coords).collect();
            let pixels: Vec<Option<[f64; 2]>> =
                placed.iter().map(|p| rays.lens_of(p).map(|lens| rays.pixel(lens))).collect();
            for corners in item.mesh.triangles() {
                let at = corners.map(|v| pixels[v as usize]);
                let corners = corners.map(|v| placed[v as usize]);
                order += 1;
                // A point is on no side of its edges: every ray near it would pass it.
                let is_point = corners[0] == corners[1] && corners[1] == corners[2];
                if item.opacity == 0.0 || is_point || corners.iter().all(|c| c.z < 0.0) {
                    continue;
                }
                let span = |axis: usize, size: u32| {
                    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
                    for corner in &at {
                        let Some(p) = corner else { return Some([0, size - 1]) };
                        range = [range[0].min(p[axis]), range[1].max(p[axis])];
                    }
                    let [low, high] = [(range[0] - ROOM).ceil().max(0.0), (range[1] + ROOM).floor()];
                    (low <= high && low < f64::from(size)).then(|| [low as u32, (high as u32).min(size - 1)])
                };
                if let (Some(x), Some(y)) = (span(0, width), span(1, height)) {
                    let look = looks.len() as u32;
                    triangles.push(Triangle { corners, look, order, x, y });
                }
            }
            looks.push(Look { color: item.color, opacity: item.opacity, lit: item.shading == Shading::Lit });
        }
        let mut bands = vec![Vec::new(); (height as usize).div_ceil(TILE)];
        for opaque in [true, false] {
            for (index, triangle) in triangles.iter().enumerate() {
                if (looks[triangle.look as usize].opacity >= 1.0) == opaque {
                    let [first, last] = triangle.y.map(|y| y as usize / TILE);
                    for band in &mut bands[first..=last] {
                        band.push(index as u32);
                    }
                }
            }
        }
        Self { triangles, looks, bands }
    }

    /// The crossings of the rays of a row of tiles.
    pub(super) fn band(&self, band: usize, rays: &Rays, width: usize, height: usize) -> Crossings {
        let rows = (height - band * TILE).min(TILE);
        if self.bands[band].is_empty() {
            return Crossings::default();
        }
        let mut nearest: Vec<Option<Hit>> = vec![None; rows * width];
        let mut found: Vec<(u32, Hit)> = Vec::new();
        for &index in &self.bands[band] {
            let triangle = &self.triangles[index as usize];
            let look = &self.looks[triangle.look as usize];
            let facet = Facet::new(&triangle.corners, rays);
            let first = (triangle.y[0] as usize).max(band * TILE);
            let last = (triangle.y[1] as usize).min(band * TILE + rows - 1);
            for y in first..=last {
                for x in triangle.x[0] as usize..=triangle.x[1] as usize {
                    let lens = rays.lens(x, y);
                    let Some(depth) = facet.crossing(lens) else { continue };
                    let zeta = (depth - rays.near_mm) as f32;
                    let pixel = (y - band * TILE) * width + x;
                    if nearest[pixel].is_some_and(|n| n.zeta < zeta) {
                        continue;
                    }
                    let color = if look.lit { facet.lit(look.color, lens, rays) } else { look.color };
                    let hit = Hit {
                        zeta,
                        color: color.map(|c| c as f32),
                        opacity: look.opacity as f32,
                        order: triangle.order,
                    };
                    if look.opacity < 1.0 {
                        found.push((pixel as u32, hit));
                    } else if nearest[pixel].is_none_or(|n| n.zeta > zeta || n.order > hit.order) {
                        nearest[pixel] = Some(hit);
                    }
                }
            }
        }
        let opaque = nearest.iter().enumerate().filter_map(|(pixel, hit)| hit.map(|h| (pixel as u32, h)));
        found.extend(opaque);
        found.sort_unstable_by(|(p, a), (q, b)| {
            p.cmp(q).then(a.zeta.total_cmp(&b.zeta)).then(a.order.cmp(&b.order))
        });
        let mut ends = vec![0_u32; rows * width];
        for (pixel, _) in &found {
            ends[*pixel as usize] += 1;
        }
        let mut sum = 0;
        for end in &mut ends {
            sum += *end;
            *end = sum;
        }
        Crossings { hits: found.into_iter().map(|(_, hit)| hit).collect(), ends }
    }
}

/// The crossings of a row of tiles, pixel by pixel, front to back.
#[derive(Debug, Default)]
pub(super) struct Crossings {
    hits: Vec<Hit>,
    /// Where each pixel's end among the hits; empty where there is none at all.
    ends: Vec<u32>,
}

impl Crossings {
    pub(super) fn of(&self, pixel: usize) -> &[Hit] {
        if self.ends.is_empty() {
            return &[];
        }
        let first = if pixel == 0 { 0 } else { self.ends[pixel - 1] };
        &self.hits[first as usize..self.ends[pixel] as usize]
    }

    pub(super) fn len(&self) -> usize {
        self.hits.len()
    }
}

/// A triangle as functions of the lens coordinates (1, x, y).
#[derive(Debug)]
struct Facet {
    /// Each edge's determinant and the sign that its order of ends brings.
    edges: [([f64; 3], f64); 3],
    normal: Vector,
    /// n·a of a corner.
    plane: f64,
    depth: [f64; 2],
    perspective: bool,
}

impl Facet {
    fn new(corners: &[Vector; 3], rays: &Rays) -> Self {
        let [a, b, c] = corners;
        let perspective = rays.perspective();
        let edge = |p: &Vector, q: &Vector| {
            let swap = (p.x, p.y, p.z) > (q.x, q.y, q.z);
            let (p, q) = if swap { (q, p) } else { (p, q) };
            let determinant = if perspective {
                let n = p.cross(q);
                [n.z, n.x, n.y]
            } else {
                [p.x * q.y - p.y * q.x, p.y - q.y, q.x - p.x]
            };
            (determinant, if swap { -1.0 } else { 1.0 })
        };
        let normal = (b - a).cross(&(c - a));
        let depth = [a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z)];
        Self { edges: [edge(b, c), edge(c, a), edge(a, b)], normal, plane: normal.dot(a), depth, perspective }
    }

    /// Depth behind the eye of the ray's crossing, mm; `None` beside the triangle, or behind the eye.
    #[inline(always)]
    fn crossing(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let side = |([constant, by_x, by_y], turn): ([f64; 3], f64)| {
            if constant + by_x * x + by_y * y >= 0.0 { turn } else { -turn }
        };
        let [u, v, w] = self.edges.map(side);
        if u != v || v != w {
            return None;
        }
        let n = &self.normal;
        let depth = if self.perspective {
            self.plane / (n.x * x + n.y * y + n.z)
        } else {
            (self.plane - n.x * x - n.y * y) / n.z
        };
        // Seen edge-on every depth of the triangle is as good.
        let depth = if depth.is_finite() { depth.clamp(self.depth[0], self.depth[1]) } else { self.depth[0] };
        (depth >= 0.0).then_some(depth)
    }

    fn lit(&self, color: [f64; 3], lens: [f64; 2], rays: &Rays) -> [f64; 3] {
        let [x, y, z] = rays.direction(lens);
        let size = self.normal.norm() * rays.mm_per_zeta(lens);
        if size == 0.0 {
            return color;
        }
        let facing = (self.normal.dot(&Vector::new(x, y, z)) / size).abs().min(1.0);
        let [shade, highlight] = shine(facing as f32).map(f64::from);
        color.map(|c| (c * shade + highlight).clamp(0.0, 1.0))
    }
}
