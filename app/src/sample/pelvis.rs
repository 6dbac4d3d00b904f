//! The left half of the pelvis and the sacrum's edge as signed distances, in the hip frame.

use super::femur::array;
use super::noise;
use super::sdf::{Ellipsoid, RoundCone, V, dot, join, meet, norm, scale, smooth_step, sub, unit};
use super::table as t;

/// Beyond this much bone behind the cup's surface nothing is trimmed to the plane of its opening; mm.
const RIM_MM: f64 = 6.5;

#[derive(Debug)]
pub(super) struct Pelvis {
    cup_axis: V,
    wing_along: V,
    wing_centre: V,
    wing_middle: V,
    fossa: RoundCone,
    parts: Vec<(RoundCone, f64)>,
    roof: Ellipsoid,
    sacrum: [RoundCone; 2],
}

impl Pelvis {
    pub(super) fn new() -> Self {
        let along = unit([0.50, -0.866, 0.0]);
        let across = unit([0.85, 0.49, -0.20]);
        let middle = [-8.5, 11.0, 60.0];
        let cone = RoundCone::new;
        let parts = vec![
            // Posterior column, from the roof behind the cup to the ischial tuberosity.
            (cone([-12.0, 21.0, 28.0], 11.0, [-19.0, 27.0, -18.0], 11.0), 9.0),
            (cone([-19.0, 27.0, -18.0], 11.0, [-22.0, 29.0, -48.0], 12.0), 8.0),
            (cone([-22.0, 31.0, -50.0], 13.0, [-28.0, 24.0, -62.0], 10.5), 6.0),
            // Ischial spine.
            (cone([-23.0, 34.0, -8.0], 6.0, [-36.0, 41.0, -12.0], 2.2), 6.0),
            // Ischiopubic ramus.
            (cone([-30.0, 18.0, -63.0], 8.0, [-56.0, -13.0, -60.0], 6.0), 7.0),
            (cone([-56.0, -13.0, -60.0], 6.0, [-76.0, -32.0, -46.0], 7.0), 7.0),
            // Superior pubic ramus.
            (cone([-22.0, -15.0, 2.0], 12.5, [-50.0, -32.0, -13.0], 8.0), 9.0),
            (cone([-50.0, -32.0, -13.0], 8.0, [-76.0, -38.0, -24.0], 8.5), 8.0),
            // Pubic body, and its tubercle.
            (cone([-78.0, -37.0, -25.0], 9.0, [-79.0, -34.0, -46.0], 7.5), 9.0),
            (cone([-66.0, -38.0, -18.0], 6.0, [-65.0, -44.0, -17.0], 4.0), 6.0),
            // Quadrilateral surface behind the cup.
            (cone([-28.0, -6.0, 4.0], 7.0, [-27.0, 15.0, -6.0], 7.5), 8.0),
            // Anterior inferior iliac spine.
            (cone([-3.0, -17.0, 40.0], 9.0, [2.5, -27.0, 33.0], 5.5), 8.0),
            // Body of the ilium above the roof, to the greater sciatic notch.
            (cone([-3.0, -10.0, 40.0], 11.0, [-12.0, 18.0, 42.0], 10.0), 9.0),
        ];
        Self {
            cup_axis: array(t::cup_axis()),
            wing_along: along,
            wing_centre: sub(middle, scale(across, 105.0)),
            wing_middle: middle,
            fossa: cone([-13.0, 0.5, -10.0], 10.0, [-19.0, 1.0, -16.0], 10.5),
            parts,
            roof: Ellipsoid { centre: [-4.0, 2.0, 5.0], radii: [35.5, 35.0, 35.5] },
            sacrum: [
                cone([-96.0, 68.0, 66.0], 30.0, [-93.0, 74.0, 26.0], 19.0),
                cone([-93.0, 74.0, 26.0], 17.0, [-91.0, 62.0, -18.0], 5.0),
            ],
        }
    }

    /// Signed distance of the plane of the acetabular opening; positive outside the cup.
    fn opening(&self, p: V) -> f64 {
        dot(p, self.cup_axis) + t::CUP_DEPTH_MM
    }

    /// Signed distance of the iliac wing: a curved plate with an elliptic outline.
    fn wing(&self, p: V) -> f64 {
        let from = sub(p, self.wing_middle);
        let (a, b) = (dot(from, self.wing_along) / 58.0, (p[2] - 82.0) / 66.0);
        let k = (a * a + b * b).sqrt();
        let outline = (k - 1.0) * 60.0;
        let half = 3.4 + 5.5 * smooth_step(62.0, 26.0, p[2]) + 3.0 * smooth_step(0.72, 0.95, k);
        let plate = (norm(sub(p, self.wing_centre)) - 105.0).abs() - half;
        meet(plate, outline, 5.0)
    }

    /// Signed distance of the hip bone.
    pub(super) fn distance(&self, p: V) -> f64 {
        let opening = self.opening(p);
        let cup = meet(self.roof.distance(p), opening, 5.0);
        let mut bone = join(cup, self.wing(p), 10.0);
        for (part, blend) in &self.parts {
            bone = join(bone, part.distance(p), *blend);
        }
        if bone.abs() < 4.0 {
            bone += 0.7 * noise::smooth(11, p[0] * 0.11, p[1] * 0.11, p[2] * 0.11);
        }
        // The joint is carved last, so that its surface, edge and fossa are exact.
        let from_centre = norm(p);
        let cavity = from_centre - t::CUP_RADIUS_MM;
        let mouth = (-opening).max(from_centre - t::CUP_RADIUS_MM - RIM_MM);
        bone.max(-cavity.min(mouth)).max(-self.fossa.distance(p))
    }

    /// Signed distance of the sacrum, which keeps off the ilium by the sacroiliac gap.
    pub(super) fn sacrum(&self, p: V, hip_bone: f64) -> f64 {
        let bone = join(self.sacrum[0].distance(p), self.sacrum[1].distance(p), 10.0);
        bone.max(2.6 - hip_bone)
    }

    /// Thickness of the cortex at a place; mm.
    pub(super) fn cortex_mm(p: V) -> f64 {
        let from_centre = norm(p);
        let up = p[2] / from_centre.max(1.0);
        let near = smooth_step(t::CUP_RADIUS_MM + 6.0, t::CUP_RADIUS_MM + 3.0, from_centre);
        t::PELVIC_CORTEX_MM + (t::ROOF_CORTEX_MM - t::PELVIC_CORTEX_MM) * near * smooth_step(0.35, 0.75, up)
    }

    /// Signed distance of the cartilage that fills the gap under the cup's bony cover.
    pub(super) fn cartilage(&self, p: V) -> f64 {
        (norm(p) - t::CUP_RADIUS_MM).max(self.opening(p) - 2.0)
    }
}
