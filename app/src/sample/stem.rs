//! The stem implant: one closed surface, lofted from the tip over the neck to the ball.
//!
//! Own frame, mm: z up the stem, the neck in the x-z plane towards +x, origin where the two axes meet.

use std::f64::consts::{FRAC_PI_2, TAU};

use render::volume::{Point, TriangleMesh, Vector};

use super::{SampleError, table as t};

/// Corners of each ring.
const RING: u32 = 48;
/// Half of the bend from stem to neck, measured along each axis from the junction; mm.
const BEND_MM: f64 = 26.0;
/// Radius of the neck; mm.
const NECK_RADIUS_MM: f64 = 6.0;
/// From the ball's centre to its flat base; mm.
const BALL_BASE_MM: f64 = 10.0;

/// Half-widths of the body: `[height along the spine from the tip, in the neck's plane, across]`; mm.
const BODY: [[f64; 3]; 6] = [
    [t::STEM_TIP_RADIUS_MM, t::STEM_TIP_RADIUS_MM, t::STEM_TIP_RADIUS_MM],
    [16.0, 5.4, 5.3],
    [36.0, 6.8, 6.2],
    [58.0, 9.4, 7.4],
    [76.0, 11.4, 7.8],
    [101.0, NECK_RADIUS_MM + 0.4, NECK_RADIUS_MM + 0.4],
];

/// A smooth curve through the body's half-widths (cubic Hermite, slopes from neighbours).
fn half_widths(height: f64) -> [f64; 2] {
    let last = BODY.len() - 1;
    let i = BODY.iter().rposition(|b| b[0] <= height).unwrap_or(0).min(last - 1);
    let (low, high) = (BODY[i], BODY[i + 1]);
    let width = high[0] - low[0];
    let u = ((height - low[0]) / width).clamp(0.0, 1.0);
    let slope = |k: usize, axis: usize| {
        let (a, b) = (BODY[k.saturating_sub(1)], BODY[(k + 1).min(last)]);
        (b[axis] - a[axis]) / (b[0] - a[0])
    };
    [1, 2].map(|axis| {
        let (p, q) = (low[axis], high[axis]);
        let (m, n) = (slope(i, axis) * width, slope(i + 1, axis) * width);
        let (u2, u3) = (u * u, u * u * u);
        p * (2.0 * u3 - 3.0 * u2 + 1.0) + m * (u3 - 2.0 * u2 + u) + q * (3.0 * u2 - 2.0 * u3) + n * (u3 - u2)
    })
}

/// A cross-section: its centre, the direction of the surface's axis there, and its half-widths in the
/// neck's plane and across.
#[derive(Debug, Clone, Copy)]
struct Ring {
    centre: Vector,
    forward: Vector,
    half: [f64; 2],
}

fn rings(neck: Vector) -> Vec<Ring> {
    let up = Vector::z();
    let mut rings = Vec::new();
    let tip = t::STEM_TIP_RADIUS_MM;
    let foot = -up * t::STEM_LENGTH_MM;
    // The round tip, without its pole.
    for k in 1..8 {
        let angle = f64::from(k) / 8.0 * FRAC_PI_2;
        let radius = tip * angle.sin();
        rings.push(Ring { centre: foot + up * (tip * (1.0 - angle.cos())), forward: up, half: [radius; 2] });
    }
    let straight = t::STEM_LENGTH_MM - BEND_MM;
    for k in 0..30 {
        let height = tip + (straight - tip) * f64::from(k) / 30.0;
        rings.push(Ring { centre: foot + up * height, forward: up, half: half_widths(height) });
    }
    // The bend: a quadratic Bézier curve from axis to axis, with the junction as its control point.
    let (from, to) = (-up * BEND_MM, neck * BEND_MM);
    let mut height = straight;
    let mut before = from;
    for k in 0..=30 {
        let u = f64::from(k) / 30.0;
        let centre = from * ((1.0 - u) * (1.0 - u)) + to * (u * u);
        height += (centre - before).norm();
        before = centre;
        let forward = up * (1.0 - u) + neck * u;
        rings.push(Ring { centre, forward: forward.normalize(), half: half_widths(height) });
    }
    let base = t::NECK_LENGTH_MM - BALL_BASE_MM;
    for k in 1..=8 {
        let u = f64::from(k) / 8.0;
        let half = [NECK_RADIUS_MM + 0.4 * (1.0 - u); 2];
        rings.push(Ring { centre: neck * (BEND_MM + (base - BEND_MM) * u), forward: neck, half });
    }
    // The ball, from its flat base to just before its pole.
    let radius = t::STEM_BALL_RADIUS_MM;
    let start = (-BALL_BASE_MM / radius).asin();
    for k in 0..28 {
        let angle = start + (FRAC_PI_2 - start) * f64::from(k) / 28.0;
        let centre = neck * (t::NECK_LENGTH_MM + radius * angle.sin());
        rings.push(Ring { centre, forward: neck, half: [radius * angle.cos(); 2] });
    }
    rings
}

/// The neck's direction in the stem's frame.
fn neck_direction() -> Vector {
    let angle = std::f64::consts::PI - t::NECK_SHAFT_DEG.to_radians();
    Vector::new(angle.sin(), 0.0, angle.cos())
}

pub(super) fn mesh() -> Result<TriangleMesh, SampleError> {
    let neck = neck_direction();
    let rings = rings(neck);
    let mut positions = vec![Point::new(0.0, 0.0, -t::STEM_LENGTH_MM)];
    for ring in &rings {
        let across = Vector::y();
        let side = across.cross(&ring.forward);
        for corner in 0..RING {
            let angle = TAU * f64::from(corner) / f64::from(RING);
            let offset = side * (ring.half[0] * angle.cos()) + across * (ring.half[1] * angle.sin());
            positions.push(Point::from(ring.centre + offset));
        }
    }
    let pole = positions.len() as u32;
    positions.push(Point::from(neck * (t::NECK_LENGTH_MM + t::STEM_BALL_RADIUS_MM)));
    let mut triangles = Vec::new();
    let at = |ring: u32, corner: u32| 1 + ring * RING + corner % RING;
    let last = rings.len() as u32 - 1;
    for corner in 0..RING {
        triangles.push([0, at(0, corner + 1), at(0, corner)]);
        for ring in 0..last {
            let (a, b) = (at(ring, corner), at(ring, corner + 1));
            let (c, d) = (at(ring + 1, corner + 1), at(ring + 1, corner));
            triangles.push([a, b, c]);
            triangles.push([a, c, d]);
        }
        triangles.push([pole, at(last, corner), at(last, corner + 1)]);
    }
    Ok(TriangleMesh::new(positions, triangles)?)
}
