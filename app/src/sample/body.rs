//! What a scan measures at a place: the tissues, painted over each other with smoothed edges.
//!
//! A measured value is the mean over about one voxel, so each surface is a smooth step of the signed
//! distance, as wide as the scanner blurs. Bricks of voxels far from a surface skip it; a test holds
//! that this changes no value.

use super::femur::Femur;
use super::noise;
use super::pelvis::Pelvis;
use super::sdf::{V, smooth_step};
use super::soft::{NearMuscles, SKIN_MM, Soft};
use super::table::{COMPRESSION_HU, NECROSIS_RIM_MM, Tissue, Tissue as T};

/// What the scanner is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Modality {
    Ct,
    Mri,
}

/// A scanner's view of tissue.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scanner {
    pub(super) modality: Modality,
    /// Width of a smoothed edge; mm.
    pub(super) edge_mm: f64,
}

impl Scanner {
    /// Part of the measured volume that lies inside a surface at signed distance `d`.
    fn inside(&self, d: f64) -> f64 {
        1.0 - smooth_step(-0.5 * self.edge_mm, 0.5 * self.edge_mm, d)
    }

    /// The value of tissue whose texture is at `texture`, -1 to 1.
    fn tissue(&self, tissue: Tissue, texture: f64) -> f64 {
        let look = tissue.look();
        match self.modality {
            Modality::Ct => look.hu + look.hu_texture * texture,
            Modality::Mri => look.t1 + look.t1_texture * texture,
        }
    }
}

/// What can matter within a brick.
#[derive(Debug)]
pub(super) struct Near {
    body: bool,
    /// Whether any of it is deeper than the skin.
    deep: bool,
    femur: bool,
    hip_bone: bool,
    sacrum: bool,
    capsule: bool,
    vessels: bool,
    bladder: bool,
    muscles: NearMuscles,
}

#[derive(Debug)]
pub(super) struct Body {
    femur: Femur,
    pelvis: Pelvis,
    soft: Soft,
}

fn mix(a: f64, b: f64, part: f64) -> f64 {
    a + (b - a) * part
}

impl Body {
    pub(super) fn new() -> Self {
        Self { femur: Femur::new(), pelvis: Pelvis::new(), soft: Soft::new() }
    }

    /// What lies within `radius` of `centre`.
    pub(super) fn near(&self, centre: V, radius: f64) -> Near {
        // Ellipsoids, squashed solids and blends are distances only roughly: half as much again, and
        // the width of an edge.
        let reach = 1.5 * radius + 3.0;
        let body = self.soft.body(centre);
        let hip_bone = self.pelvis.distance(centre);
        Near {
            body: body < reach,
            deep: body < -reach - SKIN_MM,
            femur: self.femur.distance(centre) < reach,
            hip_bone: hip_bone < reach,
            sacrum: self.pelvis.sacrum(centre, f64::INFINITY) < reach,
            capsule: self.soft.capsule(centre) < reach,
            vessels: self.soft.vessels(centre) < reach,
            bladder: self.soft.bladder(centre) < reach,
            muscles: self.soft.near_muscles(centre, reach),
        }
    }

    /// What the scanner measures at `p`, without noise; HU or MR units.
    pub(super) fn value(&self, p: V, scanner: &Scanner, near: &Near) -> f64 {
        if !near.body {
            return scanner.tissue(T::Air, 0.0);
        }
        let solid = -0.5 * scanner.edge_mm;
        let femur = if near.femur { self.femur.distance(p) } else { f64::INFINITY };
        if femur <= solid {
            return self.femur_inside(p, femur, scanner);
        }
        let mut value = self.around(p, scanner, near);
        if -femur > solid {
            value = mix(value, self.femur_inside(p, femur, scanner), scanner.inside(femur));
        }
        value
    }

    /// Everything but the femur.
    fn around(&self, p: V, scanner: &Scanner, near: &Near) -> f64 {
        let solid = -0.5 * scanner.edge_mm;
        let hip_bone = if near.hip_bone || near.sacrum { self.pelvis.distance(p) } else { f64::INFINITY };
        let sacrum = if near.sacrum { self.pelvis.sacrum(p, hip_bone) } else { f64::INFINITY };
        let bone = hip_bone.min(sacrum);
        if bone <= solid {
            return Self::pelvis_inside(p, bone, scanner);
        }
        let mut value = self.soft(p, scanner, near);
        if -bone > solid {
            value = mix(value, Self::pelvis_inside(p, bone, scanner), scanner.inside(bone));
        }
        value
    }

    fn soft(&self, p: V, scanner: &Scanner, near: &Near) -> f64 {
        let texture = noise::smooth(5, p[0] * 0.45, p[1] * 0.45, p[2] * 0.3);
        let body = self.soft.body(p);
        let fat = scanner.tissue(T::Fat, texture);
        let mut value = fat;
        if !near.deep {
            let air = scanner.tissue(T::Air, 0.0);
            let skin = mix(air, scanner.tissue(T::Skin, 0.0), scanner.inside(body));
            value = mix(skin, fat, scanner.inside(body + SKIN_MM));
        }
        let muscle = self.soft.muscle(p, body, &near.muscles).max(-self.soft.inner(p));
        value = mix(value, scanner.tissue(T::Muscle, texture), scanner.inside(muscle));
        if near.bladder {
            let bladder = self.soft.bladder(p);
            value = mix(value, scanner.tissue(T::Muscle, 0.0), scanner.inside(bladder));
            value = mix(value, scanner.tissue(T::Urine, 0.0), scanner.inside(bladder + 3.0));
        }
        if near.vessels {
            value = mix(value, scanner.tissue(T::Blood, 0.0), scanner.inside(self.soft.vessels(p)));
        }
        if near.capsule {
            let capsule = self.soft.capsule(p);
            value = mix(value, scanner.tissue(T::Capsule, texture), scanner.inside(capsule));
            let cartilage = self.pelvis.cartilage(p);
            value = mix(value, scanner.tissue(T::Cartilage, 0.0), scanner.inside(cartilage));
        }
        value
    }

    /// The hip bone's or sacrum's inside at a signed distance from its surface.
    fn pelvis_inside(p: V, distance: f64, scanner: &Scanner) -> f64 {
        let cortex = scanner.tissue(T::ThinCortex, 0.0);
        let part = scanner.inside(distance + Pelvis::cortex_mm(p));
        if part == 0.0 {
            return cortex;
        }
        mix(cortex, scanner.tissue(T::PelvicCancellous, trabeculae(p)), part)
    }

    fn femur_inside(&self, p: V, distance: f64, scanner: &Scanner) -> f64 {
        let thin = scanner.tissue(T::ThinCortex, 0.0);
        let cortex = mix(thin, scanner.tissue(T::Cortex, 0.0), self.femur.shaftness(p));
        let part = scanner.inside(distance + self.femur.cortex_mm(p));
        if part == 0.0 {
            return cortex;
        }
        let texture = trabeculae(p);
        let mut inside = scanner.tissue(T::Cancellous, texture);
        if scanner.modality == Modality::Ct {
            inside += COMPRESSION_HU * self.femur.compression(p);
        }
        inside = mix(inside, scanner.tissue(T::Marrow, texture), self.femur.marrow(p));
        let [border, necrosis] = self.femur.necrosis(p);
        let necrotic = scanner.inside(necrosis);
        if necrotic > 0.0 {
            let core = scanner.inside(border + NECROSIS_RIM_MM);
            let dead =
                mix(scanner.tissue(T::NecrosisRim, texture), scanner.tissue(T::Necrosis, texture), core);
            inside = mix(inside, dead, necrotic);
        }
        mix(cortex, inside, part)
    }
}

/// Texture of cancellous bone: two sizes of grain, longer along the load; -1 to 1.
fn trabeculae(p: V) -> f64 {
    let fine = noise::smooth(21, p[0] * 0.8, p[1] * 0.8, p[2] * 0.5);
    let coarse = noise::smooth(22, p[0] * 0.22, p[1] * 0.22, p[2] * 0.16);
    0.6 * fine + 0.4 * coarse
}
