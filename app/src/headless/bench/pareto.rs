//! `pareto`: what a picture costs and how far it is from the truth, over all that makes it cheaper: spacing, texture
//! with its precision, termination and renderer, on real data; with peers beside ours where a command for them is given.
//!
//! All settings take turns, frame by frame in one process, and the least time of each counts, so that other work on the
//! machine meets all alike.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use ::render::cpu::Finish;
use ::render::gpu::Gpu;
use ::render::image::{Difference, FloatImage};
use ::render::reference;
use ::render::scene::{Scene, Shading, TextureFormat};
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
    texture: TextureFormat,
    finish: Option<Finish>,
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
            let peer = Peer::start(command, case, mapper, Some(step), SIZE)?;
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
                    let Ours { painter, scene, .. } = &mut ours[*painter];
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

/// Every renderer with its textures and every termination, and every spacing of each.
fn ours(scene: &Scene) -> Result<(Vec<Ours>, Vec<Entry>), Failure> {
    let gpu = Arc::new(Gpu::headless()?);
    let (mut ours, mut entries) = (Vec::new(), Vec::new());
    for make in MAKERS {
        let first = make(&gpu)?;
        if !first.has_spacing() {
            continue;
        }
        // Software drivers take minutes for a frame of these, block by block for every sample.
        let software = gpu.caps().software;
        let is_slow =
            |format: &TextureFormat| software && matches!(format, TextureFormat::Bc5 | TextureFormat::Bc7);
        for &format in first.formats().iter().filter(|format| !is_slow(format)) {
            let mut scene = scene.clone();
            for volume in &mut scene.volumes {
                volume.texture = format;
            }
            for &finish in first.terminations() {
                for spacing in SPACINGS {
                    entries.push(Entry::new(Way::Ours { painter: ours.len(), spacing }));
                }
                let mut painter = make(&gpu)?;
                if let Some(finish) = finish {
                    painter.terminate(finish);
                }
                ours.push(Ours { painter, scene: scene.clone(), texture: format, finish });
            }
        }
    }
    Ok((ours, entries))
}

fn report(entry: &Entry, ours: &[Ours], turns: usize, bench: &mut Bench) -> Result<(), Failure> {
    let (name, texture, spacing, finish) = match &entry.way {
        Way::Ours { painter, spacing } => {
            let Ours { painter, texture, finish, .. } = &ours[*painter];
            (painter.name().to_owned(), Some(*texture), *spacing, *finish)
        }
        Way::Peer { mapper, step, .. } => (format!("peer {mapper}"), None, *step, None),
    };
    let (psnr_db, max) = entry.apart.map_or((f64::NAN, f64::NAN), |apart| (apart.psnr_db, apart.max));
    let stored = texture.map(stored);
    let line = stored.map_or_else(|| name.clone(), |(texture, _)| format!("{name} {texture}"));
    let (termination, through) = finish.map(termination).unzip();
    bench.report(json!({
        "bench": "pareto", "renderer": name, "texture": stored.map(|(texture, _)| texture),
        "bits_per_voxel": stored.and_then(|(_, bits)| bits), "spacing_voxels": spacing,
        "termination": termination, "finished_below": through.flatten(), "size": SIZE, "runs": turns,
        "frame_ms": entry.frame_ms, "psnr_db": psnr_db, "max_error_255": max, "line": line,
    }))
}

/// What a volume is drawn from, and its precision; the samples themselves have that of the file.
fn stored(texture: TextureFormat) -> (&'static str, Option<u32>) {
    use TextureFormat::{Auto, Bc3, Bc4, Bc5, Bc7, R16, R32f, Rgba8};
    let bits = match texture {
        R32f | Rgba8 => Some(32),
        R16 => Some(16),
        Bc5 | Bc3 | Bc7 => Some(8),
        Bc4 => Some(4),
        _ => None,
    };
    (if texture == Auto { "samples" } else { texture.name() }, bits)
}

/// How a line says when pixels are finished, and what they let through then, where it is one number.
fn termination(finish: Finish) -> (&'static str, Option<f64>) {
    match finish {
        Finish::Never => ("never", Some(0.0)),
        Finish::WithQuality => ("with quality", None),
        Finish::Below(through) => ("below", Some(f64::from(through))),
    }
}

/// Time against error: of renderers and textures as they terminate by themselves, and of the terminations of those that
/// have several.
pub(super) fn charts(rows: &[Row]) -> Vec<(&'static str, Chart)> {
    // Those whose pixels can be finished otherwise than they are.
    let several = |row: &Row| rows.iter().any(|r| r["line"] == row["line"] && r["termination"] == "never");
    let usual: Vec<Row> = rows
        .iter()
        .filter(|r| !matches!(r["termination"].as_str(), Some("never" | "below")))
        .cloned()
        .collect();
    let mut ended: Vec<Row> = rows.iter().filter(|r| several(r)).cloned().collect();
    for row in &mut ended {
        let how = match row["finished_below"].as_f64() {
            Some(through) if through > 0.0 => format!("below 1/{:.0}", 1.0 / through),
            _ => row["termination"].as_str().unwrap_or_default().to_owned(),
        };
        row.insert("line".to_owned(), how.into());
    }
    let title = "A frame of 512 x 512, spacing in voxels: time against error";
    vec![
        ("pareto.svg", chart(title, &usual)),
        ("pareto_termination.svg", chart(&format!("{title}, by when pixels are finished"), &ended)),
    ]
}

fn chart(title: &str, rows: &[Row]) -> Chart {
    let label = |row: &Row| row["spacing_voxels"].to_string();
    Chart {
        title: title.to_owned(),
        x: "frame, ms".to_owned(),
        y: "PSNR against the reference, dB".to_owned(),
        y_scale: Scale::Linear,
        joined: true,
        series: series(rows, "line", &|row| (number(row, "frame_ms"), number(row, "psnr_db"), label(row))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminations_have_a_chart_of_their_own_with_a_line_each() {
        let row = |line: &str, finish: Option<Finish>| {
            let (termination, through) = finish.map(termination).unzip();
            let row = json!({ "line": line, "termination": termination, "finished_below": through.flatten(),
                "spacing_voxels": 1.0, "frame_ms": 10.0, "psnr_db": 40.0 });
            row.as_object().expect("an object").clone()
        };
        let rows = [
            row("gpu r16", None),
            row("cpu samples", Some(Finish::WithQuality)),
            row("cpu samples", Some(Finish::Never)),
            row("cpu samples", Some(Finish::Below(1.0 / 64.0))),
        ];
        let names = |chart: &Chart| chart.series.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
        let charts = charts(&rows);
        assert_eq!(names(&charts[0].1), ["gpu r16", "cpu samples"], "each as it finishes by itself");
        assert_eq!(charts[0].1.series[1].points.len(), 1, "no other termination among them");
        assert_eq!(names(&charts[1].1), ["with quality", "never", "below 1/64"], "of the processor alone");
    }
}
