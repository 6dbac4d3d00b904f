//! Light from the eye, as [`light`] defines it.

use crate::scene::light;

/// What it makes of a colour where a normal n and the view v have |n·v| = `facing`: the factor of the colour, and the
/// white that is added.
#[inline(always)]
pub(super) fn shine(facing: f32) -> [f32; 2] {
    let shade = (light::AMBIENT + light::DIFFUSE * f64::from(facing)) as f32;
    [shade, light::SPECULAR as f32 * facing.powi(light::SHININESS as i32)]
}
