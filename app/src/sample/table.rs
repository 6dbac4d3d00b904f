//! Every number of the sample hip, once. `assets/sample/README.md` is this table for people; a test
//! compares the two.
//!
//! **Hip frame**: the axes of world (LPS: x to the patient's left, which is lateral for this left
//! hip; y to the back; z to the head), origin at the centre of the femoral head, mm.

use render::volume::{Affine, Point, Vector};

/// What a point of the body is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(usize)]
pub enum Tissue {
    /// Around the patient.
    Air,
    /// The outer layer of the body.
    Skin,
    /// Under the skin and between muscles.
    Fat,
    /// All muscle groups.
    Muscle,
    /// Femoral artery and vein.
    Blood,
    /// Content of the bladder.
    Urine,
    /// Joint capsule and ligaments.
    Capsule,
    /// Cartilage and fluid of the joint gap.
    Cartilage,
    /// Thick cortex of the femoral shaft.
    Cortex,
    /// Thin cortex of the pelvis, femoral head and trochanters.
    ThinCortex,
    /// Cancellous bone of the femur.
    Cancellous,
    /// Cancellous bone of the pelvis and sacrum.
    PelvicCancellous,
    /// Fatty marrow in the canal of the shaft.
    Marrow,
    /// Inside of the necrosis.
    Necrosis,
    /// Sclerotic border of the necrosis.
    NecrosisRim,
}

/// How a tissue looks in both scans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// For people.
    pub name: &'static str,
    /// Mean CT value; HU.
    pub hu: f64,
    /// Largest departure of the tissue's own texture from that mean; HU.
    pub hu_texture: f64,
    /// Mean T1 signal, before noise; MR units.
    pub t1: f64,
    /// As `hu_texture`, in MR units.
    pub t1_texture: f64,
}

const fn look(name: &'static str, hu: f64, hu_texture: f64, t1: f64, t1_texture: f64) -> Look {
    Look { name, hu, hu_texture, t1, t1_texture }
}

/// The looks, in the order of [`Tissue`].
pub const LOOKS: [Look; 15] = [
    look("air", -1000.0, 0.0, 0.0, 0.0),
    look("skin", 15.0, 0.0, 280.0, 0.0),
    look("fat", -105.0, 14.0, 920.0, 50.0),
    look("muscle", 58.0, 18.0, 310.0, 45.0),
    look("blood", 48.0, 0.0, 110.0, 0.0),
    look("urine", 6.0, 0.0, 150.0, 0.0),
    look("capsule", 72.0, 10.0, 210.0, 20.0),
    look("cartilage", 95.0, 0.0, 430.0, 0.0),
    look("cortex", 1500.0, 0.0, 40.0, 0.0),
    look("thin cortex", 1000.0, 0.0, 50.0, 0.0),
    look("cancellous bone", 290.0, 110.0, 800.0, 60.0),
    look("pelvic cancellous bone", 230.0, 110.0, 640.0, 80.0),
    look("fatty marrow", -60.0, 15.0, 880.0, 25.0),
    look("necrosis", 330.0, 140.0, 330.0, 70.0),
    look("necrosis rim", 640.0, 80.0, 120.0, 20.0),
];

impl Tissue {
    /// How it looks.
    pub const fn look(self) -> &'static Look {
        &LOOKS[self as usize]
    }
}

/// Centre of the femoral head and origin of the hip frame; world mm.
pub const HEAD_CENTRE_MM: [f64; 3] = [87.4, 5.2, 12.6];
/// Radius of the bony femoral head; mm.
pub const HEAD_RADIUS_MM: f64 = 24.0;
/// Radius of the acetabulum's bony surface, concentric with the head; mm.
pub const CUP_RADIUS_MM: f64 = 27.8;
/// Inclination of the acetabular opening (angle of its axis to the body axis in the frontal plane);
/// radiographic definition (Murray 1993).
pub const CUP_INCLINATION_DEG: f64 = 48.0;
/// Radiographic anteversion of the acetabular opening.
pub const CUP_ANTEVERSION_DEG: f64 = 18.0;
/// The plane of the opening lies this far from the head's centre, towards the pelvis; mm.
pub const CUP_DEPTH_MM: f64 = 4.6;

/// The shaft's lower end leans medially by this much in the frontal plane.
pub const SHAFT_ADDUCTION_DEG: f64 = 7.0;
/// The shaft's lower end leans backwards by this much in the sagittal plane.
pub const SHAFT_TILT_DEG: f64 = 2.0;
/// Angle between the neck's axis (towards the head) and the shaft's axis (downwards).
pub const NECK_SHAFT_DEG: f64 = 130.0;
/// Anteversion of the neck: its angle about the shaft's axis, from medial towards the front.
pub const NECK_ANTEVERSION_DEG: f64 = 14.0;
/// From the head's centre to the shaft's axis, along the neck's axis; mm.
pub const NECK_LENGTH_MM: f64 = 54.0;
/// Outer radius of the shaft at and below [`ISTHMUS_MM`]; mm.
pub const SHAFT_RADIUS_MM: f64 = 13.6;
/// Cortex of the shaft at and below [`ISTHMUS_MM`]; mm. The canal's radius is what is left.
pub const SHAFT_CORTEX_MM: f64 = 6.2;
/// Cortex of the head, the neck's upper part and the trochanters; mm.
pub const HEAD_CORTEX_MM: f64 = 1.4;
/// Distance below the junction of neck and shaft axes from which the shaft is a plain tube; mm.
pub const ISTHMUS_MM: f64 = 66.0;
/// Cortex of the pelvis; mm.
pub const PELVIC_CORTEX_MM: f64 = 1.5;
/// Cortex that carries load in the roof of the acetabulum; mm.
pub const ROOF_CORTEX_MM: f64 = 2.6;

/// The necrosis is what two balls share: the head within its cortex, and a ball of this radius; mm.
pub const NECROSIS_RADIUS_MM: f64 = 20.0;
/// Distance of that ball's centre from the head's centre; mm.
pub const NECROSIS_OFFSET_MM: f64 = 20.0;
/// Where that centre lies from the head's centre: up, to the front and slightly medially; any length.
pub const NECROSIS_DIRECTION: [f64; 3] = [-0.12, -0.42, 0.9];
/// Thickness of the sclerotic border, inside the necrosis, on its side towards the neck; mm.
pub const NECROSIS_RIM_MM: f64 = 1.8;

/// What the densest principal compressive trabeculae (head's roof to calcar) add in the CT; HU.
pub const COMPRESSION_HU: f64 = 230.0;

/// Samples of the CT along x, y, z.
pub const CT_EXTENT: [usize; 3] = [200, 176, 192];
/// Spacing of the CT; mm.
pub const CT_SPACING_MM: [f64; 3] = [0.875, 0.875, 1.0];
/// World place of the CT's first sample; mm. Its axes are those of world.
pub const CT_ORIGIN_MM: [f64; 3] = [1.6, -61.1, -107.7];
/// Standard deviation of the CT's noise, everywhere, before rounding to whole HU.
pub const CT_NOISE_HU: f64 = 14.0;
/// Width over which an edge is smoothed in the CT; mm.
pub const CT_EDGE_MM: f64 = 1.7;

/// Samples of the MRI along its x, y, z (to the left, downwards, to the back, before its turn).
pub const MRI_EXTENT: [usize; 3] = [160, 180, 76];
/// Spacing of the MRI; mm.
pub const MRI_SPACING_MM: [f64; 3] = [1.0, 1.0, 1.5];
/// The middle of the MRI in the hip frame, once registered; mm.
pub const MRI_CENTRE_MM: [f64; 3] = [6.0, 6.0, -22.0];
/// Axis (any length) and angle by which the MRI's slices are turned against the hip frame.
pub const MRI_OBLIQUE: ([f64; 3], f64) = ([0.25, 0.35, 0.9], 14.0);
/// Standard deviation of each of the two channels whose magnitude the MRI is; MR units.
pub const MRI_NOISE: f64 = 16.0;
/// Width over which an edge is smoothed in the MRI; mm.
pub const MRI_EDGE_MM: f64 = 2.0;
/// Registration: axis (any length) and angle in degrees of the turn about the head's centre that
/// brings the MRI's patient space to the CT's, before the shift.
pub const REGISTRATION_TURN: ([f64; 3], f64) = ([0.3, -0.5, 0.8], 8.5);
/// Registration: the shift after the turn; mm.
pub const REGISTRATION_SHIFT_MM: [f64; 3] = [6.4, -11.2, 17.9];

/// Radius of the stem's ball; mm. Its centre is the head's centre.
pub const STEM_BALL_RADIUS_MM: f64 = 16.0;
/// From the tip to the junction of neck and stem axes; mm.
pub const STEM_LENGTH_MM: f64 = 78.0;
/// Radius of the stem's round tip; mm.
pub const STEM_TIP_RADIUS_MM: f64 = 4.6;

/// Centre of the femoral head; world.
pub fn head_centre() -> Point {
    Point::from(HEAD_CENTRE_MM)
}

/// The shaft's axis, downwards; world, unit length.
pub fn shaft_axis() -> Vector {
    Vector::new(-SHAFT_ADDUCTION_DEG.to_radians().tan(), SHAFT_TILT_DEG.to_radians().tan(), -1.0).normalize()
}

/// The neck's axis, from the shaft towards the head; world, unit length.
pub fn neck_axis() -> Vector {
    let down = shaft_axis();
    let medial = -Vector::x();
    let medial = (medial - down * medial.dot(&down)).normalize();
    let front = medial.cross(&down);
    let (angle, version) = (NECK_SHAFT_DEG.to_radians(), NECK_ANTEVERSION_DEG.to_radians());
    down * angle.cos() + (medial * version.cos() + front * version.sin()) * angle.sin()
}

/// Where the axes of neck and shaft meet; world.
pub fn neck_shaft_junction() -> Point {
    head_centre() - neck_axis() * NECK_LENGTH_MM
}

/// Distance of the head's centre from the shaft's axis (femoral offset); mm.
pub fn femoral_offset_mm() -> f64 {
    NECK_LENGTH_MM * NECK_SHAFT_DEG.to_radians().sin()
}

/// Radius of the medullary canal at and below [`ISTHMUS_MM`]; mm.
pub const CANAL_RADIUS_MM: f64 = SHAFT_RADIUS_MM - SHAFT_CORTEX_MM;

/// The axis of the acetabular opening, out of the cup; world, unit length.
pub fn cup_axis() -> Vector {
    let (inclination, version) = (CUP_INCLINATION_DEG.to_radians(), CUP_ANTEVERSION_DEG.to_radians());
    Vector::new(inclination.sin() * version.cos(), -version.sin(), -inclination.cos() * version.cos())
}

/// Lateral centre-edge angle of Wiberg: between straight up and the acetabulum's lateral edge, seen
/// from the head's centre in the frontal plane through it; radians. From n·p = −depth on the cup.
pub fn lateral_centre_edge_rad() -> f64 {
    let n = cup_axis();
    edge_angle(n.x, n.z)
}

/// Anterior centre-edge angle: the same towards the front, in the sagittal plane; radians.
pub fn anterior_centre_edge_rad() -> f64 {
    let n = cup_axis();
    edge_angle(-n.y, n.z)
}

/// The angle a from up at which (outward · sin a + up · cos a) · radius = −depth, past which the
/// opening begins.
fn edge_angle(outward: f64, up: f64) -> f64 {
    let length = outward.hypot(up);
    (-CUP_DEPTH_MM / (CUP_RADIUS_MM * length)).asin() - up.atan2(outward)
}

/// Radius of the ball inside the head's cortex; mm.
pub const HEAD_INNER_RADIUS_MM: f64 = HEAD_RADIUS_MM - HEAD_CORTEX_MM;

/// Centre of the ball that cuts the necrosis out of the head; world.
pub fn necrosis_centre() -> Point {
    head_centre() + Vector::from(NECROSIS_DIRECTION).normalize() * NECROSIS_OFFSET_MM
}

/// Volume that the necrosis shares with a ball of `radius_mm` about the head's centre; mm³. With
/// [`HEAD_INNER_RADIUS_MM`] it is all of the necrosis. The two surfaces must cross.
///
/// Source: E. W. Weisstein, "Sphere-Sphere Intersection", Wolfram `MathWorld`, eq. (16).
pub fn necrosis_volume_mm3(radius_mm: f64) -> f64 {
    let (a, b, d) = (radius_mm, NECROSIS_RADIUS_MM, NECROSIS_OFFSET_MM);
    let sum = a + b - d;
    std::f64::consts::PI * sum * sum * (d * d + 2.0 * d * (a + b) - 3.0 * (a - b) * (a - b)) / (12.0 * d)
}

/// Half of the angle that the necrosis takes of the head's inner surface, seen from its centre; radians.
pub fn necrosis_half_angle_rad() -> f64 {
    let (a, b, d) = (HEAD_INNER_RADIUS_MM, NECROSIS_RADIUS_MM, NECROSIS_OFFSET_MM);
    ((d * d + a * a - b * b) / (2.0 * d * a)).acos()
}

/// The registration: `ct_world_from_mri_world`, rigid; the MRI's pose in the case.
pub fn registration() -> Affine {
    let (axis, angle_deg) = REGISTRATION_TURN;
    let turn = Affine::rotation_about(head_centre(), Vector::from(axis), angle_deg.to_radians());
    Affine::translation(Vector::from(REGISTRATION_SHIFT_MM)) * turn
}

/// World from the stem's own frame, in the unmoved femur: the stem's z runs up the shaft's axis, its
/// x-z plane holds the neck, and its origin is the junction of the two axes.
pub fn stem_pose() -> Affine {
    let up = -shaft_axis();
    let side = neck_axis() - up * neck_axis().dot(&up);
    let side = side.normalize();
    let junction = neck_shaft_junction();
    // Columns of a rotation: they have an inverse.
    Affine::from_columns(side, up.cross(&side), up, junction).unwrap_or_default()
}
