//! The proximal femur as a signed distance, in the hip frame.

use super::sdf::{
    Ellipsoid, RoundCone, V, add, cross, dot, join, norm, scale, smooth_step, stretch, sub, unit,
};
use super::table as t;
use render::volume::Vector;

/// Part of the neck's depth, front to back, to its height.
const NECK_FLATNESS: f64 = 0.86;

#[derive(Debug)]
pub(super) struct Femur {
    junction: V,
    down: V,
    neck: V,
    neck_depth: V,
    neck_solid: RoundCone,
    base: Ellipsoid,
    shaft: [RoundCone; 2],
    greater: [RoundCone; 2],
    lesser: RoundCone,
    compression: [V; 2],
    necrosis: V,
}

pub(super) fn array(v: Vector) -> V {
    [v.x, v.y, v.z]
}

impl Femur {
    pub(super) fn new() -> Self {
        let (down, neck) = (array(t::shaft_axis()), array(t::neck_axis()));
        let junction = scale(neck, -t::NECK_LENGTH_MM);
        let along_neck = |mm: f64| scale(neck, mm);
        let along_shaft = |mm: f64| add(junction, scale(down, mm));
        let isthmus = t::ISTHMUS_MM;
        let radius = t::SHAFT_RADIUS_MM;
        let medial = unit(sub(neck, scale(down, dot(neck, down))));
        let back = unit(cross(medial, down));
        let back = if back[1] < 0.0 { scale(back, -1.0) } else { back };
        let lesser_root = along_shaft(22.0);
        let lesser_tip = add(along_shaft(25.0), add(scale(medial, 13.5), scale(back, 12.5)));
        Self {
            junction,
            down,
            neck,
            neck_depth: unit(cross(neck, down)),
            neck_solid: RoundCone::new(along_neck(-10.0), 15.0, along_neck(-44.0), 20.0),
            base: Ellipsoid { centre: add(junction, [1.5, 1.0, -4.0]), radii: [21.0, 17.0, 25.0] },
            shaft: [
                RoundCone::new(along_shaft(2.0), 17.0, along_shaft(isthmus), radius),
                RoundCone::new(along_shaft(isthmus), radius, along_shaft(isthmus + 200.0), radius),
            ],
            greater: [
                RoundCone::new(add(junction, [9.0, 3.0, 2.0]), 16.0, add(junction, [12.0, 5.0, 24.0]), 11.5),
                RoundCone::new(add(junction, [12.0, 6.0, 22.0]), 11.0, add(junction, [6.5, 11.0, 33.0]), 6.5),
            ],
            lesser: RoundCone::new(lesser_root, 12.0, lesser_tip, 5.0),
            compression: [[-1.0, 0.0, 21.0], add(scale(neck, -36.0), scale(medial, 11.0))],
            necrosis: array(t::necrosis_centre() - t::head_centre()),
        }
    }

    /// Signed distance of the bone's surface. The head is an exact ball wherever the neck is farther
    /// than the blend.
    pub(super) fn distance(&self, p: V) -> f64 {
        let head = norm(p) - t::HEAD_RADIUS_MM;
        let flat = stretch(p, [0.0; 3], self.neck_depth, 1.0 / NECK_FLATNESS);
        let neck = self.neck_solid.distance(flat) * 0.94;
        let shaft = join(self.shaft[0].distance(p), self.shaft[1].distance(p), 2.0);
        let greater = join(self.greater[0].distance(p), self.greater[1].distance(p), 5.0);
        let trunk = join(join(shaft, self.base.distance(p), 9.0), self.lesser.distance(p), 7.0);
        let trunk = join(trunk, greater, 7.0);
        join(join(neck, trunk, 10.0), head, 5.0)
    }

    /// Thickness of the cortex at a place; mm.
    pub(super) fn cortex_mm(&self, p: V) -> f64 {
        let below = dot(sub(p, self.junction), self.down);
        let shaft = smooth_step(-2.0, t::ISTHMUS_MM - 8.0, below);
        let plain = t::HEAD_CORTEX_MM + (t::SHAFT_CORTEX_MM - t::HEAD_CORTEX_MM) * shaft;
        // The calcar: the neck's lower, medial cortex carries the load and is thicker.
        let along = dot(p, self.neck);
        let side = sub(sub(p, self.junction), scale(self.down, below));
        let medial = dot(unit(add(side, scale(self.neck, 1e-6))), self.neck);
        let calcar = smooth_step(-22.0, -36.0, along)
            * smooth_step(0.2, 0.75, medial)
            * smooth_step(-12.0, 0.0, below);
        plain + (2.4 * calcar).min((t::SHAFT_CORTEX_MM - plain).max(0.0))
    }

    /// How far down the shaft: 0 in head and trochanters, 1 where the cortex is thick.
    pub(super) fn shaftness(&self, p: V) -> f64 {
        smooth_step(0.0, 36.0, dot(sub(p, self.junction), self.down))
    }

    /// Part of the inside that is fatty marrow instead of cancellous bone.
    pub(super) fn marrow(&self, p: V) -> f64 {
        smooth_step(6.0, 34.0, dot(sub(p, self.junction), self.down))
    }

    /// Density of the principal compressive trabeculae, from the head's roof to the calcar: 0 to 1.
    pub(super) fn compression(&self, p: V) -> f64 {
        let [a, b] = self.compression;
        let (from, along) = (sub(p, a), sub(b, a));
        let part = (dot(from, along) / dot(along, along)).clamp(0.0, 1.0);
        let off = norm(sub(from, scale(along, part)));
        1.0 - smooth_step(1.0, 11.0 - 4.0 * part, off)
    }

    /// Signed distances of the necrosis: of its border towards the neck, and of all of it.
    pub(super) fn necrosis(&self, p: V) -> [f64; 2] {
        let border = norm(sub(p, self.necrosis)) - t::NECROSIS_RADIUS_MM;
        [border, border.max(norm(p) - t::HEAD_INNER_RADIUS_MM)]
    }
}
