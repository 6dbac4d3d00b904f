//! Whether a picture is the right one.
//!
//! Where a ray touches an edge of a surface, either side of it is right: a pixel passes if it lies among what the
//! reference shows when the eye is moved by a thousandth of a pixel.

use render::image::FloatImage;
use render::scene::{Projection, Scene};
use render::volume::Vector;

use super::drawers::truth;

/// The eye's move, in pixels, in which a surface's edge may be on either side.
const HAIR: f64 = 1e-3;

/// Refuses a picture of which a channel is off by more than `most`/255, with the worst pixel.
pub(super) fn right(scene: &Scene, picture: &FloatImage, most: f64) -> Result<(), String> {
    between(std::slice::from_ref(scene), picture, most)
}

/// Refuses a picture of which a channel is more than `most`/255 off what lies between the pictures of `scenes`, with the
/// worst pixel.
pub(super) fn between(scenes: &[Scene], picture: &FloatImage, most: f64) -> Result<(), String> {
    let size = [picture.width, picture.height];
    let mut around = Vec::new();
    for scene in scenes {
        around.push(truth(scene, size)?);
    }
    if within(&around, picture, most).is_ok() {
        return Ok(());
    }
    for scene in scenes {
        for [x, y] in [[1.0, 0.4], [-0.4, 1.0], [-1.0, -0.4], [0.4, -1.0]] {
            around.push(truth(&beside(scene, size, [x * HAIR, y * HAIR])?, size)?);
        }
    }
    within(&around, picture, most)
}

/// Refuses a picture of which a channel is more than `most`/255 off what lies between those `around`.
fn within(around: &[FloatImage], picture: &FloatImage, most: f64) -> Result<(), String> {
    let mut low = around[0].clone();
    let mut high = around[0].clone();
    for other in around {
        for ((low, high), p) in low.pixels.iter_mut().zip(&mut high.pixels).zip(&other.pixels) {
            for c in 0..4 {
                low[c] = low[c].min(p[c]);
                high[c] = high[c].max(p[c]);
            }
        }
    }
    let mut nearest = low.clone();
    for ((near, high), p) in nearest.pixels.iter_mut().zip(&high.pixels).zip(&picture.pixels) {
        *near = std::array::from_fn(|c| if p[c].is_nan() { near[c] } else { p[c].clamp(near[c], high[c]) });
    }
    match worst(picture, &nearest) {
        Some(wrong) if wrong.apart > most => Err(wrong.text()),
        _ => Ok(()),
    }
}

/// Refuses two pictures that differ by more than `most`/255.
pub(super) fn same(a: &FloatImage, b: &FloatImage, most: f64) -> Result<(), String> {
    match worst(a, b) {
        Some(wrong) if wrong.apart > most => Err(wrong.text()),
        _ => Ok(()),
    }
}

/// The pixel that is furthest off.
struct Wrong {
    place: [usize; 2],
    apart: f64,
    is: [f32; 4],
    should: [f32; 4],
}

impl Wrong {
    fn text(&self) -> String {
        let Self { place, apart, is, should } = self;
        format!("pixel {place:?} is off by {apart:.3}/255: {is:?} for {should:?}")
    }
}

/// NaN is further off than any number.
fn worst(a: &FloatImage, b: &FloatImage) -> Option<Wrong> {
    let apart = |p: &[f32; 4], q: &[f32; 4]| {
        let off = |c: usize| {
            let d = (f64::from(p[c]) - f64::from(q[c])).abs() * 255.0;
            if d.is_nan() { f64::INFINITY } else { d }
        };
        (0..4).map(off).fold(0.0, f64::max)
    };
    let wrong = |(i, (p, q)): (usize, (&[f32; 4], &[f32; 4]))| {
        let place = [i % a.width as usize, i / a.width as usize];
        Wrong { place, apart: apart(p, q), is: *p, should: *q }
    };
    let all = a.pixels.iter().zip(&b.pixels).enumerate().map(wrong);
    all.max_by(|a, b| a.apart.total_cmp(&b.apart))
}

/// The same scene with the view shifted by parts of a pixel at the target.
fn beside(scene: &Scene, [_, height]: [u32; 2], [x, y]: [f64; 2]) -> Result<Scene, String> {
    let mut scene = scene.clone();
    let frame = scene.camera.frame().map_err(|e| e.to_string())?;
    let reach = (scene.camera.target - scene.camera.eye).norm();
    let camera = &mut scene.camera;
    match camera.projection {
        Projection::Perspective { fov_rad } => {
            let pixel = 2.0 * (fov_rad / 2.0).tan() * reach / f64::from(height);
            camera.target += (frame.right * x + frame.up * y) * pixel;
        }
        Projection::Parallel { height_mm } => {
            let by: Vector = (frame.right * x + frame.up * y) * (height_mm / f64::from(height));
            camera.eye += by;
            camera.target += by;
        }
    }
    Ok(scene)
}

#[test]
fn a_channel_off_by_two_of_255_is_refused_and_nan_with_it() {
    let mut a = FloatImage::clear(2, 1);
    let b = a.clone();
    a.pixels[1][2] = 2.1 / 255.0;
    assert!(same(&a, &b, 2.0).unwrap_err().contains("[1, 0]"), "the pixel is named");
    assert!(same(&a, &b, 2.2).is_ok(), "within");
    a.pixels[0][0] = f32::NAN;
    assert!(same(&a, &b, 300.0).is_err(), "no number at all");
}
