//! `pareto`: what a picture costs and how far it is from the truth, over all that makes it cheaper: spacing, texture and
//! renderer, on real data; with peers beside ours where a command for them is given.
//!
//! All settings take turns, frame by frame in one process, and the least time of each counts, so that other work on the
//! machine meets all alike.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use ::render::gpu::Gpu;
use ::render::image::{Difference, FloatImage};
use ::render::reference;
use ::render::scene::{Scene, Shading};
use serde_json::json;

use super::painter::{MAKERS, Painter};
use super::peer::Peer;
use super::{Bench, Row, number, series};
use crate::headless::input::Input;
use crate::headless::plot::{Chart, Scale};
use crate::headless::{Failure, Terminal};
use crate::load::Progress as _;
use crate::scene;

/// The picture; pixels.
const SIZE: [u32; 2] = [512, 512];
/// Slice spacings; voxels of the finest volume.
const SPACINGS: [f64; 6] = [4.0, 2.0, 1.0, 0.5, 0.25, 0.125];
/// What a peer is asked for: mapper and step in voxels.
const PEERS: [(&str, f64); 6] =
    [("gpu", 2.0), ("gpu", 1.0), ("gpu", 0.5), ("fixed", 2.0), ("fixed", 1.0), ("fixed", 0.5)];
/// Turns that count, unless they take longer than [`ENOUGH`].
const TURNS: usize = 7;
const ENOUGH: Duration = Duration::from_mins(2);

/// A renderer of ours with the scene as it draws it, or a peer; one way to make the picture.
enum Way {
    Ours { painter: usize, spacing: f64 },
    Peer { peer: Peer, mapper: &'static str, step: f64 },
}

/// A way, with the least time that it took, and how far its picture is from the truth.
struct Entry {
    way: Way,
    frame_ms: f64,
    apart: Option<Difference>,
}

impl Entry {
    fn new(way: Way) -> Self {
        Self { way, frame_ms: f64::INFINITY, apart: None }
    }
}

/// A renderer of ours, with a scene of its own: a renderer keeps the textures of the last one.
struct Ours {
    painter: Box<dyn Painter>,
    scene: Scene,
}

/// Measures.
pub(super) fn run(
    input: &Input,
    case: Option<&Path>,
    peer: Option<&str>,
    bench: &mut Bench,
) -> Result<(), Failure> {
    let mut scene = scene::scene(&input.case, &input.assets);
    // Colours classified beforehand have no gradient to be lit by: without light all textures compare.
    for volume in &mut scene.volumes {
        volume.shading = Shading::None;
    }
    let terminal = Terminal::default();
    let progress = |done: usize, total: usize| terminal.step("drawing the reference", done, total);
    let truth = reference::draw(&scene, SIZE, &reference::Options::default(), &progress)?;
    let (mut ours, mut entries) = ours(&scene)?;
    if let Some(command) = peer {
        let fault = "a peer draws a case file; name one with --data";
        let case = case.ok_or_else(|| Failure::Usage(fault.to_owned()))?;
        for (mapper, step) in PEERS {
            let peer = Peer::start(command, case, mapper, step, SIZE)?;
            entries.push(Entry::new(Way::Peer { peer, mapper, step }));
        }
    }
    let begin = Instant::now();
    let mut turns = 0;
    // The first turn makes textures, and is not counted.
    for turn in 0..=TURNS {
        if turn > 1 && begin.elapsed() > ENOUGH {
            break;
        }
        for entry in &mut entries {
            let (took, picture) = match &mut entry.way {
                Way::Ours { painter, spacing } => {
                    let Ours { painter, scene } = &mut ours[*painter];
                    let painted = painter.paint(scene, SIZE, *spacing)?;
                    (painted.frame_ms, Some(painted.picture))
                }
                Way::Peer { peer, .. } => (peer.frame_ms()?, None),
            };
            if turn > 0 {
                entry.frame_ms = entry.frame_ms.min(took);
                continue;
            }
            let picture = match (&mut entry.way, picture) {
                (Way::Peer { peer, .. }, None) => peer.picture(SIZE)?,
                (_, picture) => picture.unwrap_or_else(|| FloatImage::clear(SIZE[0], SIZE[1])),
            };
            let apart = picture.difference(&truth, scene.background);
            entry.apart = Some(apart.map_err(|e| Failure::Other(e.to_string()))?);
        }
        turns = turn;
        terminal.step("measuring", turn, TURNS);
    }
    for entry in &entries {
        report(entry, &ours, turns, bench)?;
    }
    Ok(())
}

/// Every renderer with every texture, and every spacing of each.
fn ours(scene: &Scene) -> Result<(Vec<Ours>, Vec<Entry>), Failure> {
    let gpu = Arc::new(Gpu::headless()?);
    let (mut ours, mut entries) = (Vec::new(), Vec::new());
    for make in MAKERS {
        let first = make(&gpu)?;
        if !first.has_spacing() {
            continue;
        }
        for &format in first.formats() {
            let mut scene = scene.clone();
            for volume in &mut scene.volumes {
                volume.texture = format;
            }
            for spacing in SPACINGS {
                entries.push(Entry::new(Way::Ours { painter: ours.len(), spacing }));
            }
            ours.push(Ours { painter: make(&gpu)?, scene });
        }
    }
    Ok((ours, entries))
}

fn report(entry: &Entry, ours: &[Ours], turns: usize, bench: &mut Bench) -> Result<(), Failure> {
    let (name, texture, spacing) = match &entry.way {
        Way::Ours { painter, spacing } => {
            let Ours { painter, scene } = &ours[*painter];
            (painter.name().to_owned(), scene.volumes.first().map(|v| v.texture.name()), *spacing)
        }
        Way::Peer { mapper, step, .. } => (format!("peer {mapper}"), None, *step),
    };
    let (psnr_db, max) = entry.apart.map_or((f64::NAN, f64::NAN), |apart| (apart.psnr_db, apart.max));
    let line = texture.map_or_else(|| name.clone(), |texture| format!("{name} {texture}"));
    bench.report(json!({
        "bench": "pareto", "renderer": name, "texture": texture, "spacing_voxels": spacing, "size": SIZE,
        "runs": turns, "frame_ms": entry.frame_ms, "psnr_db": psnr_db, "max_error_255": max, "line": line,
    }))
}

/// Time against error.
pub(super) fn chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| row["spacing_voxels"].to_string();
    Chart {
        title: "A frame of 512 x 512, spacing in voxels: time against error".to_owned(),
        x: "frame, ms".to_owned(),
        y: "PSNR against the reference, dB".to_owned(),
        y_scale: Scale::Linear,
        joined: true,
        series: series(rows, "line", &|row| (number(row, "frame_ms"), number(row, "psnr_db"), label(row))),
    }
}
