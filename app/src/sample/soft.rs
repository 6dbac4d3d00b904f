//! Soft tissue around the hip as signed distances, in the hip frame: envelope, muscles, vessels.

use super::sdf::{Ellipsoid, RoundCone, V, join, meet};

/// Skin; mm.
pub(super) const SKIN_MM: f64 = 1.9;
/// Half of the fat plane between neighbouring muscles; mm.
const HALF_PLANE_MM: f64 = 0.55;
/// A muscle fills gaps up to this far beyond its own solid; mm.
const FILL_MM: f64 = 9.0;

#[derive(Debug)]
pub(super) struct Soft {
    thigh: RoundCone,
    buttock: Ellipsoid,
    /// Solids, each with the number of the muscle it belongs to.
    muscles: Vec<(RoundCone, u8)>,
    vessels: [RoundCone; 4],
    bladder: Ellipsoid,
    capsule: RoundCone,
    inner: Ellipsoid,
}

/// Which muscle solids can matter within a brick.
#[derive(Debug, Default, Clone)]
pub(super) struct NearMuscles(Vec<u8>);

impl Soft {
    pub(super) fn new() -> Self {
        let c = RoundCone::new;
        let muscles = vec![
            // Iliopsoas, over the front of the head to the lesser trochanter.
            (c([-34.0, -14.0, 80.0], 17.0, [-8.0, -34.0, 18.0], 12.0), 0),
            (c([-8.0, -34.0, 18.0], 12.0, [2.0, -28.0, -22.0], 11.0), 0),
            (c([2.0, -28.0, -22.0], 11.0, [21.0, 10.0, -58.0], 6.0), 0),
            // Rectus femoris.
            (c([5.0, -34.0, 26.0], 4.5, [14.0, -46.0, -40.0], 11.0), 1),
            (c([14.0, -46.0, -40.0], 11.0, [14.0, -42.0, -130.0], 14.0), 1),
            // Sartorius.
            (c([22.0, -52.0, 70.0], 6.0, [-4.0, -54.0, -30.0], 6.5), 2),
            (c([-4.0, -54.0, -30.0], 6.5, [-22.0, -44.0, -130.0], 7.5), 2),
            // Tensor of the fascia lata.
            (c([30.0, -46.0, 66.0], 8.0, [44.0, -40.0, 0.0], 11.0), 3),
            (c([44.0, -40.0, 0.0], 11.0, [56.0, -22.0, -60.0], 5.0), 3),
            // Gluteus medius, in front and behind.
            (c([21.0, -10.0, 78.0], 17.0, [46.0, 4.0, -4.0], 9.0), 4),
            (c([2.0, 34.0, 78.0], 17.0, [46.0, 14.0, -6.0], 9.0), 4),
            // Gluteus minimus.
            (c([10.0, -10.0, 52.0], 11.0, [43.0, -2.0, -6.0], 7.0), 5),
            (c([2.0, 20.0, 54.0], 11.0, [43.0, 4.0, -6.0], 7.0), 5),
            // Gluteus maximus.
            (c([-52.0, 74.0, 66.0], 14.0, [6.0, 62.0, 8.0], 19.0), 6),
            (c([6.0, 62.0, 8.0], 19.0, [50.0, 34.0, -52.0], 12.0), 6),
            (c([-56.0, 76.0, 20.0], 12.0, [2.0, 62.0, -34.0], 17.0), 6),
            (c([2.0, 62.0, -34.0], 17.0, [50.0, 32.0, -80.0], 10.0), 6),
            // Piriformis.
            (c([-66.0, 52.0, 36.0], 8.0, [-20.0, 44.0, 24.0], 9.0), 7),
            (c([-20.0, 44.0, 24.0], 9.0, [38.0, 22.0, -2.0], 4.0), 7),
            // Obturator internus, and its turn to the trochanter.
            (c([-40.0, -8.0, 2.0], 8.0, [-40.0, 26.0, -14.0], 9.0), 8),
            (c([-38.0, 32.0, -18.0], 8.0, [36.0, 24.0, -10.0], 5.0), 8),
            // Obturator externus.
            (c([-54.0, -16.0, -38.0], 10.0, [-20.0, -2.0, -38.0], 10.0), 9),
            (c([-20.0, -2.0, -38.0], 10.0, [34.0, 24.0, -18.0], 4.5), 9),
            // Pectineus.
            (c([-52.0, -40.0, -18.0], 8.0, [20.0, 4.0, -80.0], 8.0), 10),
            // Adductors: long, short, great.
            (c([-72.0, -40.0, -46.0], 8.0, [-14.0, -24.0, -140.0], 16.0), 11),
            (c([-62.0, -20.0, -58.0], 8.0, [8.0, 2.0, -140.0], 13.0), 12),
            (c([-46.0, 8.0, -66.0], 10.0, [-14.0, 20.0, -140.0], 22.0), 13),
            // Lateral, intermediate and medial vastus.
            (c([55.0, -2.0, -46.0], 9.0, [52.0, -2.0, -140.0], 20.0), 14),
            (c([33.0, -12.0, -52.0], 11.0, [30.0, -16.0, -140.0], 16.0), 15),
            (c([14.0, -8.0, -80.0], 7.0, [8.0, -14.0, -140.0], 12.0), 16),
            // Hamstrings.
            (c([-22.0, 44.0, -64.0], 7.0, [2.0, 46.0, -140.0], 19.0), 17),
            // Quadratus femoris.
            (c([-14.0, 30.0, -48.0], 8.0, [36.0, 30.0, -46.0], 8.0), 18),
        ];
        Self {
            thigh: c([2.0, 13.0, -60.0], 71.0, [-3.0, 10.0, -170.0], 66.0),
            buttock: Ellipsoid { centre: [-14.0, 22.0, -22.0], radii: [86.0, 63.0, 78.0] },
            muscles,
            vessels: [
                c([-30.0, -34.0, 80.0], 4.2, [-14.0, -45.0, 0.0], 4.2),
                c([-14.0, -45.0, 0.0], 4.2, [-8.0, -36.0, -130.0], 3.6),
                c([-41.0, -30.0, 80.0], 5.6, [-26.0, -43.0, 0.0], 5.6),
                c([-26.0, -43.0, 0.0], 5.6, [-14.0, -30.0, -130.0], 4.6),
            ],
            bladder: Ellipsoid { centre: [-86.0, -14.0, 16.0], radii: [40.0, 26.0, 27.0] },
            capsule: c([0.0, 0.0, 0.0], 30.5, [21.0, 6.0, -22.0], 23.0),
            inner: Ellipsoid { centre: [-100.0, 14.0, 40.0], radii: [74.0, 50.0, 70.0] },
        }
    }

    /// Signed distance of the body.
    pub(super) fn body(&self, p: V) -> f64 {
        // The trunk: a cylinder along z over a curve between ellipse and box, |x/a|³ + |y/b|³ = 1.
        let (x, y) = ((p[0] + 88.0) / 171.0, (p[1] - 10.0) / 67.0);
        let k = (x.abs().powi(3) + y.abs().powi(3)).cbrt().max(1e-3);
        let slope = (x * x / 171.0).hypot(y * y / 67.0) / (k * k);
        let trunk = meet((k - 1.0) / slope.max(1e-4), -82.0 - p[2], 30.0);
        join(join(trunk, self.thigh.distance(p), 24.0), self.buttock.distance(p), 20.0)
    }

    /// Thickness of skin and the fat under it; more at the back and the side.
    fn fascia_mm(p: V) -> f64 {
        12.0 + 0.08 * p[1].max(-20.0) + 0.03 * p[0].max(0.0)
    }

    pub(super) fn near_muscles(&self, centre: V, reach: f64) -> NearMuscles {
        let distances: Vec<f64> = self.muscles.iter().map(|m| m.0.distance(centre)).collect();
        let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let limit = (least + 2.0 * reach + 4.0 * HALF_PLANE_MM + 4.0).min(reach + FILL_MM + 8.0);
        NearMuscles((0..self.muscles.len()).filter(|&i| distances[i] <= limit).map(|i| i as u8).collect())
    }

    /// Signed distance of the muscles, fat planes between them left out.
    pub(super) fn muscle(&self, p: V, body: f64, near: &NearMuscles) -> f64 {
        let (mut first, mut first_of, mut second) = (f64::INFINITY, u8::MAX, f64::INFINITY);
        for &i in &near.0 {
            let (solid, of) = &self.muscles[usize::from(i)];
            let d = solid.distance(p);
            if d < first {
                if *of != first_of {
                    second = first;
                }
                (first, first_of) = (d, *of);
            } else if d < second && *of != first_of {
                second = d;
            }
        }
        let plane = HALF_PLANE_MM - 0.5 * (second - first);
        (first - FILL_MM).max(plane).max(body + Self::fascia_mm(p))
    }

    /// Signed distance of the space inside the pelvis, which holds fat and the bladder.
    pub(super) fn inner(&self, p: V) -> f64 {
        self.inner.distance(p)
    }

    pub(super) fn bladder(&self, p: V) -> f64 {
        self.bladder.distance(p)
    }

    pub(super) fn vessels(&self, p: V) -> f64 {
        self.vessels.iter().map(|v| v.distance(p)).fold(f64::INFINITY, f64::min)
    }

    /// Signed distance of the joint capsule, filled.
    pub(super) fn capsule(&self, p: V) -> f64 {
        self.capsule.distance(p)
    }
}
