//! Textures that lose something, among the same hostile scenes: each picture lies between two of the reference that the
//! error which the texture itself states allows.
//!
//! One volume of one colour, so that what a pixel shows grows with extinction everywhere, whatever is cut: the two ends
//! are the same scene with the least and the greatest opacity that each place can have. A texture of scalars has values
//! within its error; one of colours has opacity and colour within its error of those at the samples, and
//! interpolates them.

use std::sync::Arc;

use render::scene::{Scene, TextureFormat};
use render::volume::{ControlPoint, Grid, Rescale, Samples, Transfer};
use render::{Stored, TextureSummary};

use super::cases::{self, Case, Contents};
use super::judge::between;
use super::random::Random;
use super::{drawers, each};
use crate::support::gpu_wanted;

/// What the steps and their arithmetic may add to what the texture states, in 1/255: as without a loss.
const MOST: f64 = 2.0;
/// What filtering may add, of the range of a texture whose channels have 8 bits: software drivers filter those in 8 bits.
const FILTER: f64 = 1.0 / 255.0;
const SIZES: [[u32; 2]; 3] = [[8, 8], [9, 5], [3, 16]];

/// A scene with a texture of some format.
fn case(random: &mut Random) -> Case {
    let mut case = cases::any(random, Contents { volumes: 1, cut: true, meshes: 0 });
    let volume = &mut case.scene.volumes[0];
    let [red, green, blue, _] = volume.transfer.points()[0].rgba;
    let points = volume.transfer.points().iter();
    let plain = points.map(|p| ControlPoint { rgba: [red, green, blue, p.rgba[3]], ..*p }).collect();
    volume.transfer = Arc::new(Transfer::new(plain, volume.transfer.unit_mm()).expect("the same values"));
    use TextureFormat::{Bc3, Bc4, Bc5, Bc7, R16, Rgba8};
    volume.texture = random.one(&[R16, Bc4, Bc4, Bc5, Rgba8, Bc3, Bc7]);
    case
}

/// The scene with the least and the greatest of what a texture with this error may show.
fn ends(scene: &Scene, texture: &TextureSummary) -> [Scene; 2] {
    let volume = &scene.volumes[0];
    let [low, high] = volume.grid.range();
    // Rounding of numbers of `f32`.
    let hair = 1e-6 * low.abs().max(high.abs()).max(high - low);
    if texture.stored.is_colour() {
        let off = texture.max_error * 1.001 / 255.0 + FILTER;
        // Samples of floats are told apart in 1/65535 of their range, and a jump lies between two of them.
        let apart =
            if matches!(volume.grid.samples(), Samples::I16(_)) { 0.0 } else { (high - low) / 65535.0 };
        return [-1.0, 1.0].map(|sign| classified(scene, sign * off, sign * (apart + hair)));
    }
    let has_8_bits = texture.stored != Stored::Grid(TextureFormat::R16);
    let filter = if has_8_bits { FILTER * (high - low) } else { 0.0 };
    let apart = texture.max_error * 1.001 + filter + hair;
    [false, true].map(|most| {
        let mut scene = scene.clone();
        scene.volumes[0].transfer = Arc::new(widest(&scene.volumes[0].transfer, apart, most));
        scene
    })
}

/// The opacities at the samples as samples, `off` more, and as much more colour. The function is taken where it is
/// least, or greatest, within `apart` of the value.
fn classified(scene: &Scene, off: f64, apart: f64) -> Scene {
    let mut scene = scene.clone();
    let volume = &mut scene.volumes[0];
    let transfer = widest(&volume.transfer, apart.abs(), apart > 0.0);
    let grid = &volume.grid;
    let opacity = |i: usize| transfer.rgba(grid.value_at(i))[3];
    let samples = Samples::F64((0..grid.samples().len()).map(opacity).collect());
    let made = Grid::new(grid.extent(), samples, Rescale::default(), *grid.world_from_voxel());
    volume.grid = Arc::new(made.expect("as many samples"));
    let color = transfer.points()[0].rgba;
    let shifted = |c: f64| (c + off).clamp(0.0, 1.0);
    let point = |value: f64| ControlPoint {
        value,
        rgba: [shifted(color[0]), shifted(color[1]), shifted(color[2]), shifted(value)],
    };
    // With bends where the opacity is held.
    let bend = if off > 0.0 { 1.0 - off } else { -off };
    let points = if (0.0..1.0).contains(&bend) { vec![0.0, bend, 1.0] } else { vec![0.0, 1.0] };
    let made = Transfer::new(points.into_iter().map(point).collect(), transfer.unit_mm());
    volume.transfer = Arc::new(made.expect("rising values"));
    scene
}

/// A function that is nowhere above, or nowhere below, what `transfer` is within `apart` of a value.
fn widest(transfer: &Transfer, apart: f64, most: bool) -> Transfer {
    let points = transfer.points();
    let opacity = |p: &ControlPoint| p.rgba[3];
    let pick = |a: f64, b: f64| if most { a.max(b) } else { a.min(b) };
    let mut bends: Vec<f64> = points.iter().flat_map(|p| [p.value - apart, p.value + apart]).collect();
    bends.sort_by(f64::total_cmp);
    // On an open stretch between two bends the ends of the window run along two straight lines, and the points within it
    // stay the same: the least is above its chord and the greatest below it, so the chord is safe.
    let mut made: Vec<ControlPoint> = Vec::new();
    let mut put = |value: f64, opacity: f64| {
        made.push(ControlPoint {
            value,
            rgba: [points[0].rgba[0], points[0].rgba[1], points[0].rgba[2], opacity],
        });
    };
    let first =
        points.iter().filter(|p| p.value == points[0].value).map(opacity).fold(opacity(&points[0]), pick);
    put(bends[0], opacity(&points[0]));
    put(bends[0], pick(opacity(&points[0]), first));
    for pair in bends.windows(2).filter(|pair| pair[0] < pair[1]) {
        let middle = f64::midpoint(pair[0], pair[1]);
        let within = points.iter().filter(|p| (p.value - middle).abs() <= apart).map(opacity);
        let within: Vec<f64> = within.collect();
        for at in *pair.first_chunk::<2>().expect("a pair") {
            let line = |from: f64| along(transfer, from + middle, from + at);
            let ends = pick(line(-apart), line(apart));
            put(at, within.iter().copied().fold(ends, pick));
        }
    }
    let last = points.last().map_or(0.0, opacity);
    put(bends[bends.len() - 1], last);
    Transfer::new(made, transfer.unit_mm()).expect("rising values")
}

/// The opacity at `value` of the straight line that holds at `on`.
fn along(transfer: &Transfer, on: f64, value: f64) -> f64 {
    let points = transfer.points();
    let after = points.partition_point(|p| p.value <= on);
    let (Some(below), Some(above)) = (after.checked_sub(1).map(|i| points[i]), points.get(after)) else {
        return transfer.rgba(on)[3];
    };
    let part = (value - below.value) / (above.value - below.value);
    (below.rgba[3] + (above.rgba[3] - below.rgba[3]) * part).clamp(0.0, 1.0)
}

fn check(case: &Case, size: [u32; 2]) -> Result<(), String> {
    let fine = cases::fine(case);
    let judged = |voxels| judged(case, size, voxels, 1.0);
    judged(fine).or_else(|_| judged(fine / 8.0)).or_else(|_| judged(fine / 64.0))
}

/// Draws with sub-steps of `voxels` and judges by a `part` of the error that the texture states.
fn judged(case: &Case, size: [u32; 2], voxels: f64, part: f64) -> Result<(), String> {
    let format = case.scene.volumes[0].texture;
    let (picture, textures) = drawers::with_textures(&case.scene, size, voxels)?;
    let Some(texture) = textures.first() else {
        return between(std::slice::from_ref(&case.scene), &picture, MOST);
    };
    if texture.stored != Stored::Grid(format) {
        return Err(format!("{format} was replaced by {}", texture.stored));
    }
    let stated = TextureSummary { max_error: texture.max_error * part, ..texture.clone() };
    between(&ends(&case.scene, &stated), &picture, MOST)
        .map_err(|e| format!("{format}, {} off: {e}", stated.max_error))
}

#[test]
fn a_texture_with_a_loss_is_within_what_it_states() {
    if !gpu_wanted() {
        return;
    }
    each("lossy textures", 150, |random| {
        let case = case(random);
        let size = random.one(&SIZES);
        check(&case, size)
    });
}

#[test]
fn a_texture_that_hid_its_loss_would_be_refused() {
    if !gpu_wanted() {
        return;
    }
    let refused = |seed: &u64| {
        let case = case(&mut Random::new("hidden losses", *seed));
        judged(&case, SIZES[0], cases::fine(&case), 0.0).is_err()
    };
    // Most textures lose less than shows in a picture of a few pixels: about one in twenty.
    let count = (0..80).filter(refused).count();
    assert!(count >= 2, "only {count} of 80 pictures show what their textures lost");
}

#[test]
fn the_widest_function_holds_every_value_within_reach() {
    each("widest functions", 200, |random| {
        let case = case(random);
        let transfer = &case.scene.volumes[0].transfer;
        let points = transfer.points();
        let span = (points[points.len() - 1].value - points[0].value).max(1.0);
        let apart = span * random.power(-4.0, 0.0);
        let [low, high] = [false, true].map(|most| widest(transfer, apart, most));
        for _ in 0..200 {
            let value = points[0].value + span * random.between(-0.5, 1.5);
            let there = transfer.rgba(value + apart * random.between(-1.0, 1.0))[3];
            let [least, greatest] = [&low, &high].map(|f| f.rgba(value)[3]);
            if !(least - 1e-9..=greatest + 1e-9).contains(&there) {
                return Err(format!("{there} is not from {least} to {greatest} at {value}"));
            }
        }
        Ok(())
    });
}
