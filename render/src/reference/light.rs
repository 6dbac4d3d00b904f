//! Light at the eye.

use crate::scene::light::{AMBIENT, DIFFUSE, SHININESS, SPECULAR};

/// A colour lit from the eye, as it is before it is held within the display's range.
fn unbounded(color: [f64; 3], facing: f64) -> [f64; 3] {
    let white = SPECULAR * facing.powf(SHININESS);
    color.map(|c| c * (AMBIENT + DIFFUSE * facing) + white)
}

/// A colour lit from the eye; `facing` is |n·v| in `[0, 1]`.
pub(super) fn lit(color: [f64; 3], facing: f64) -> [f64; 3] {
    unbounded(color, facing).map(|c| c.clamp(0.0, 1.0))
}

/// Which channels [`lit`] has to hold back.
pub(super) fn held(color: [f64; 3], facing: f64) -> [bool; 3] {
    unbounded(color, facing).map(|c| c > 1.0)
}

/// Whether it may hold back a channel of this value.
pub(super) fn may_hold(channel: f64) -> bool {
    channel * (AMBIENT + DIFFUSE) + SPECULAR > 1.0
}
