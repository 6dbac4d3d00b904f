//! `skips`: what is saved by not doing what a scene does not need, by both renderers; and what cutting costs in textures.
//!
//! What stands beside each other takes turns, frame by frame, and the least time of each counts.

use std::sync::Arc;

use ::render::cpu::{CpuRenderer, Finish, Skips};
use ::render::gpu::Gpu;
use ::render::image::FloatImage;
use ::render::renderer::{Quality, Renderer, Stats};
use ::render::scene::{Piece, Scene, Shading, VolumeItem};
use ::render::volume::{Affine, Cutter, Point, Side, Transfer, Vector};
use serde_json::json;

use super::Bench;
use crate::headless::Failure;
use crate::headless::input::Input;
use crate::scene;

/// The picture; pixels.
const SIZE: [u32; 2] = [512, 512];
/// Turns that count, after one that does not.
const TURNS: usize = 7;

/// Measures.
pub(super) fn run(input: &Input, bench: &mut Bench) -> Result<(), Failure> {
    let scene = scene::scene(&input.case, &input.assets);
    let gpu = Arc::new(Gpu::headless()?);
    let new: [(&str, &Maker<'_>); 2] = [
        ("cpu", &|| Ok(Drawer::Cpu(CpuRenderer::new()))),
        ("gpu", &|| Ok(Drawer::Gpu(Box::new(Renderer::new(Arc::clone(&gpu))?)))),
    ];
    for (name, new) in new {
        on_and_off(&scene, name, new, bench)?;
        edits(&scene, name, new()?, bench)?;
    }
    for volume in &scene.volumes {
        cuts(&Scene { volumes: vec![volume.clone()], meshes: Vec::new(), ..scene.clone() }, &gpu, bench)?;
    }
    Ok(())
}

/// Makes a renderer that has drawn nothing yet.
type Maker<'a> = dyn Fn() -> Result<Drawer, Failure> + 'a;

/// Either renderer.
enum Drawer {
    Cpu(CpuRenderer),
    Gpu(Box<Renderer>),
}

impl Drawer {
    fn set_skips(&mut self, skips: Skips) {
        match self {
            Self::Cpu(renderer) => renderer.set_skips(skips),
            Self::Gpu(renderer) => renderer.set_skips(skips),
        }
    }

    fn draw(&mut self, scene: &Scene) -> Result<(FloatImage, Stats), Failure> {
        match self {
            Self::Cpu(renderer) => Ok(renderer.render(scene, SIZE, Quality::Good, &|_, _| true)?),
            Self::Gpu(renderer) => {
                let stats = renderer.render(scene, SIZE, Quality::Good)?;
                Ok((renderer.read()?, stats))
            }
        }
    }
}

/// The least times of some things that take turns; ms.
fn least<const N: usize>(mut turn: impl FnMut(usize) -> Result<f64, Failure>) -> Result<[f64; N], Failure> {
    let mut least = [f64::INFINITY; N];
    for round in 0..=TURNS {
        for (which, least) in least.iter_mut().enumerate() {
            let took = turn(which)?;
            if round > 0 {
                *least = least.min(took);
            }
        }
    }
    Ok(least)
}

fn on_and_off(scene: &Scene, name: &str, new: &Maker<'_>, bench: &mut Bench) -> Result<(), Failure> {
    let settings = [
        Skips::default(),
        Skips { empty: false, ..Skips::default() },
        Skips { finished: Finish::Never, ..Skips::default() },
        Skips { empty: false, finished: Finish::Never },
    ];
    let mut drawers = Vec::with_capacity(settings.len());
    for skips in settings {
        let mut drawer = new()?;
        drawer.set_skips(skips);
        drawers.push(drawer);
    }
    let mut pictures: [Option<FloatImage>; 4] = [const { None }; 4];
    let [on, all_cells, to_the_end, off] = least(|which| {
        let (picture, stats) = drawers[which].draw(scene)?;
        pictures[which] = Some(picture);
        Ok(stats.frame_ms)
    })?;
    let apart = match &pictures {
        [Some(on), .., Some(off)] => {
            on.difference(off, scene.background).map_err(|e| Failure::Other(e.to_string()))?.max
        }
        _ => f64::NAN,
    };
    bench.report(json!({
        "bench": "skips", "what": "on and off", "renderer": name, "size": SIZE, "on_ms": on,
        "empty_bricks_drawn_ms": all_cells, "finished_pixels_drawn_ms": to_the_end, "off_ms": off,
        "off_to_on": off / on, "max_apart_255": apart,
    }))
}

/// A frame after a changed transfer function, and after a moved cut, beside a frame after nothing but another view.
fn edits(scene: &Scene, name: &str, mut drawer: Drawer, bench: &mut Bench) -> Result<(), Failure> {
    let mut scene = scene.clone();
    let (eye, mut frame) = (scene.camera.eye, 0.0);
    let [plain, edited, recut] = least(|which| {
        frame += 1.0;
        scene.camera.eye = eye + Vector::new(1e-3 * frame, 0.0, 0.0);
        match which {
            0 => {}
            1 => {
                for volume in &mut scene.volumes {
                    volume.transfer = nudged(&volume.transfer, frame)?;
                }
            }
            _ => {
                for volume in &mut scene.volumes {
                    volume.pieces = halves(volume, 1e-2 * frame)?;
                }
            }
        }
        let drawn = drawer.draw(&scene)?.1.frame_ms;
        if which == 2 {
            // The next two are of the whole again; what they know of the volume stays.
            for volume in &mut scene.volumes {
                volume.pieces = vec![Piece::whole()];
            }
        }
        // The new function is drawn once more, so that the next plain frame finds it ready.
        if which == 1 {
            drawer.draw(&scene)?;
        }
        Ok(drawn)
    })?;
    bench.report(json!({
        "bench": "skips", "what": "edits", "renderer": name, "size": SIZE, "plain_ms": plain,
        "transfer_edited_ms": edited, "transfer_above_plain": (edited - plain) / plain,
        "recut_ms": recut, "recut_to_plain": recut / plain,
    }))
}

/// The same function a hair higher.
fn nudged(transfer: &Transfer, by: f64) -> Result<Arc<Transfer>, Failure> {
    let mut points = transfer.points().to_vec();
    for point in &mut points {
        point.value += 1e-3 * by;
    }
    let made = Transfer::new(points, transfer.unit_mm());
    Ok(Arc::new(made.map_err(|e| Failure::Other(e.to_string()))?))
}

/// A plane through the middle of a volume, shifted along its normal.
fn plane(volume: &VolumeItem, normal: [f64; 3], shift_mm: f64) -> Result<Cutter, Failure> {
    let corners = volume.grid.corners_in_world();
    let middle = nalgebra::center(&corners[0], &corners[7]);
    let normal = Vector::from(normal);
    let point: Point = volume.pose.point(&middle) + normal * (shift_mm / normal.norm());
    Cutter::plane(point, normal).map_err(|e| Failure::Other(e.to_string()))
}

fn kept(sides: &[(Cutter, Side)]) -> Piece {
    Piece { keep: sides.to_vec(), pose: Affine::identity() }
}

fn halves(volume: &VolumeItem, shift_mm: f64) -> Result<Vec<Piece>, Failure> {
    let cut = plane(volume, [0.3, 0.5, 1.0], shift_mm)?;
    Ok(vec![kept(&[(cut, Side::Plus)]), kept(&[(cut, Side::Minus)])])
}

/// Doi's seven ways to cut (Fig. 2): two parts in three ways, then 3, 4, 5 and 7.
fn patterns(volume: &VolumeItem) -> Result<Vec<(&'static str, Vec<Piece>)>, Failure> {
    use Side::{Minus, Plus};
    let a = plane(volume, [1.0, 0.1, 0.2], 0.0)?;
    let b = plane(volume, [-0.1, 1.0, 0.3], 0.0)?;
    let c = plane(volume, [0.2, -0.2, 1.0], 0.0)?;
    let two = |cut| vec![kept(&[(cut, Plus)]), kept(&[(cut, Minus)])];
    let four = vec![
        kept(&[(a, Plus), (b, Plus)]),
        kept(&[(a, Plus), (b, Minus)]),
        kept(&[(a, Minus), (b, Plus)]),
        kept(&[(a, Minus), (b, Minus)]),
    ];
    let split = |pieces: &[Piece], which: std::ops::Range<usize>| {
        let mut parts = Vec::new();
        for (i, piece) in pieces.iter().enumerate() {
            if which.contains(&i) {
                for side in [Plus, Minus] {
                    let mut part = piece.clone();
                    part.keep.push((c, side));
                    parts.push(part);
                }
            } else {
                parts.push(piece.clone());
            }
        }
        parts
    };
    Ok(vec![
        ("2-1", two(plane(volume, [1.0, 1.0, 1.0], 0.0)?)),
        ("2-2", two(plane(volume, [0.0, 0.0, 1.0], 0.0)?)),
        ("3", vec![kept(&[(a, Plus)]), kept(&[(a, Minus), (b, Plus)]), kept(&[(a, Minus), (b, Minus)])]),
        ("2-3", two(plane(volume, [1.0, 0.4, 0.0], 9.0)?)),
        ("4", four.clone()),
        ("5", split(&four, 3..4)),
        ("7", split(&four, 1..4)),
    ])
}

/// Texture memory and time of each pattern, beside the volume in one piece.
fn cuts(scene: &Scene, gpu: &Arc<Gpu>, bench: &mut Bench) -> Result<(), Failure> {
    let mut renderer = Renderer::new(Arc::clone(gpu))?;
    let mut scene = scene.clone();
    let Some(whole) = scene.volumes.first().cloned() else { return Ok(()) };
    scene.volumes[0].shading = Shading::None;
    let mut draw = |scene: &Scene| renderer.render(scene, SIZE, Quality::Draft);
    draw(&scene)?;
    let uncut = draw(&scene)?;
    let bytes = |stats: &Stats| stats.textures.iter().map(|t| t.bytes).sum::<u64>();
    for (pattern, pieces) in patterns(&whole)? {
        scene.volumes[0].pieces = pieces;
        let first = draw(&scene)?;
        let next = draw(&scene)?;
        bench.report(json!({
            "bench": "skips", "what": "cut", "renderer": "gpu", "pattern": pattern,
            "fragments": first.fragments, "texture_bytes": bytes(&first),
            "to_uncut": bytes(&first) as f64 / bytes(&uncut) as f64, "textures_sent": first.textures_sent,
            "first_prepare_ms": first.prepare_ms, "next_prepare_ms": next.prepare_ms, "next_frame_ms": next.frame_ms,
            "uncut_frame_ms": uncut.frame_ms,
        }))?;
    }
    Ok(())
}
