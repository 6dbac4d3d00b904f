//! `bench play`: volumes a second from a file that is in no cache to a texture that can be drawn, and drawn.
//!
//! Every codec plays the same steps through the same pipeline: a thread reads, others unpack, this one sends to the
//! device and has it decode. The uncompressed series goes first and last in each turn, so that the machine's moods
//! show.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use ::compress::Limits;
use ::compress::container::{Figures, FileWriter, Header, Reader, StepCodec};
use ::compress::lossless::{ByteCodec, PackOptions};
use ::compress::pvtc::packed::Packing;
use ::compress::pvtc::{Encoder, Layout};
use ::compress::stream::{Direction, Options, Repeat, Stream};
use ::render::StepDecoder;
use ::render::gpu::Gpu;
use ::render::renderer::{Quality, Renderer};
use serde_json::json;

use super::bench::Bench;
use super::input::Input;
use super::series::{Bytes, steps};
use super::{Failure, Terminal};
use crate::load::Progress as _;
use crate::save::choice;
use crate::save::series::encode_group;
use crate::scene;
use crate::steps::packed_step;

/// Turns; the shortest time of each counts.
const TURNS: usize = 4;
/// Turns of the few steps that the automatic choice plays.
const TRIED_TURNS: usize = 6;
/// The picture that every step is drawn in where drawing is measured too; pixels.
const SIZE: [u32; 2] = [128, 128];

/// A series file of one codec.
struct Candidate {
    codec: StepCodec,
    second: ByteCodec,
    decoder: StepDecoder,
    path: PathBuf,
    file_bytes: u64,
    figures: Figures,
    secs: f64,
}

impl Candidate {
    fn stage(&self) -> &'static str {
        match (self.codec, self.second) {
            (StepCodec::Raw8 | StepCodec::Raw16, ByteCodec::Store) => "none",
            (StepCodec::Raw8 | StepCodec::Raw16, _) => "second only",
            (_, ByteCodec::Store) => "one",
            _ => "two",
        }
    }
}

pub(super) fn bench(input: &Input, path: &Path, bench: &mut Bench) -> Result<(), Failure> {
    let (_, steps) = steps(input, path)?;
    let bytes = Bytes::new(steps, bench.enlarge(), 0..steps.times_secs().len())?;
    let folder =
        tempfile::tempdir().map_err(|e| Failure::Other(format!("no folder for the series files: {e}")))?;
    let terminal = Terminal::default();
    let settings = settings();
    let gpu = Arc::new(Gpu::headless()?);
    let automatic = automatic(&bytes, folder.path(), &gpu)?;
    let mut all = Vec::new();
    for (i, &(codec, second, decoder)) in settings.iter().enumerate() {
        terminal.step("writing series files", i, settings.len());
        all.push(write(&bytes, folder.path(), codec, second, decoder, i)?);
    }
    let mut cold = true;
    for turn in 0..TURNS {
        terminal.step("playing", turn, TURNS);
        for candidate in &mut all {
            cold &= forget(&candidate.path);
            let secs = play(candidate, &gpu)?;
            candidate.secs = candidate.secs.min(secs);
        }
    }
    let fastest = all.iter().map(|c| c.secs).fold(f64::INFINITY, f64::min);
    let count = bytes.steps.len() as f64;
    let raw_secs = all.first().map_or(f64::NAN, |c| c.secs);
    for candidate in &all {
        let drawn = drawn(candidate, input, &gpu)?;
        let Candidate { codec, second, decoder, file_bytes, figures, secs, .. } = candidate;
        bench.report(json!({
            "bench": "play", "adapter": gpu.adapter(), "codec": codec.to_string(), "second": second.name(),
            "stages": candidate.stage(), "decoder": format!("{decoder:?}").to_lowercase(),
            "extent": bytes.extent.sizes(), "steps": bytes.steps.len(),
            "cache": if cold { "dropped before each run" } else { "warm: this system keeps it" },
            "file_bytes": file_bytes, "ratio": bytes.voxels() / *file_bytes as f64,
            "volumes_per_s": count / secs, "mvoxel_per_s": bytes.voxels() / 1e6 / secs,
            "to_uncompressed": raw_secs / secs, "to_fastest": fastest / secs,
            "chosen_automatically": (*codec, *second) == automatic && *decoder != StepDecoder::Device,
            "drawn_volumes_per_s": drawn, "drawn_size": SIZE,
            "psnr_db": figures.psnr_db.filter(|p| p.is_finite()), "largest_value": figures.largest_error,
        }))?;
    }
    Ok(())
}

/// What is played: uncompressed first, then each way of one stage and of two.
fn settings() -> Vec<(StepCodec, ByteCodec, StepDecoder)> {
    let raw = StepCodec::Raw8;
    let [te, se] = [Packing::Te, Packing::Se].map(StepCodec::Packed);
    let mut settings = vec![(raw, ByteCodec::Store, StepDecoder::Auto)];
    let layouts = [(4, 3), (4, 2), (1, 3), (1, 2)].into_iter().filter_map(|(s, t)| Layout::new(s, t).ok());
    for layout in layouts.map(StepCodec::Pvtc) {
        settings.push((layout, ByteCodec::Store, StepDecoder::Cpu));
        settings.push((layout, ByteCodec::Store, StepDecoder::Device));
        settings.push((layout, ByteCodec::Lz4, StepDecoder::Auto));
    }
    for packed in [te, se] {
        for second in ByteCodec::ALL {
            settings.push((packed, second, StepDecoder::Auto));
        }
    }
    settings.extend([ByteCodec::Lz4, ByteCodec::Zstd].map(|second| (raw, second, StepDecoder::Auto)));
    settings
}

/// What is chosen for the fastest playing: every setting plays a few steps from the disk, and the fastest wins.
fn automatic(bytes: &Bytes, folder: &Path, gpu: &Arc<Gpu>) -> Result<(StepCodec, ByteCodec), Failure> {
    let few = bytes.first(choice::SAMPLE_STEPS);
    let mut tried = Vec::new();
    for (i, (codec, second, decoder)) in settings().into_iter().enumerate() {
        if decoder != StepDecoder::Device {
            tried.push(write(&few, folder, codec, second, StepDecoder::Auto, i)?);
        }
    }
    for _ in 0..TRIED_TURNS {
        for candidate in &mut tried {
            forget(&candidate.path);
            let secs = play(candidate, gpu)?;
            candidate.secs = candidate.secs.min(secs);
        }
    }
    let fastest = tried.into_iter().min_by(|a, b| a.secs.total_cmp(&b.secs));
    let fastest =
        fastest.ok_or_else(|| Failure::Other("nothing could be tried; please report this".to_owned()))?;
    Ok((fastest.codec, fastest.second))
}

fn other(error: &dyn std::error::Error) -> Failure {
    let cause = error.source().map_or_else(String::new, |cause| format!(" ({cause})"));
    Failure::Other(format!("{error}{cause}"))
}

fn write(
    bytes: &Bytes,
    folder: &Path,
    codec: StepCodec,
    second: ByteCodec,
    decoder: StepDecoder,
    number: usize,
) -> Result<Candidate, Failure> {
    let path = folder.join(format!("{number}.series"));
    let header = Header { byte_codec: second, ..bytes.header(codec) };
    let mut file = FileWriter::create(&path, &header, PackOptions::default()).map_err(|e| other(&e))?;
    let group = usize::from(codec.steps_per_chunk());
    let (mut largest, mut squares, mut decoded) = (0_u8, 0_u64, Vec::new());
    for (steps, times) in bytes.steps.chunks(group).zip(bytes.times_secs.chunks(group)) {
        let payload = encode_group(codec, Encoder::Fitted, steps, bytes.extent)?;
        file.push(&payload, times).map_err(|e| other(&e))?;
        for (i, step) in steps.iter().enumerate() {
            crate::save::series::decode_step(codec, &payload, bytes.extent, i, &mut decoded)?;
            for (a, b) in step.iter().zip(&decoded) {
                let error = a.abs_diff(*b);
                largest = largest.max(error);
                squares += u64::from(error) * u64::from(error);
            }
        }
    }
    let psnr_db = 10.0 * (255.0 * 255.0 * bytes.voxels() / squares as f64).log10();
    let largest_error = Some(f64::from(largest) * bytes.quantiser.scale);
    let figures = Figures { largest_error, psnr_db: Some(psnr_db) };
    let file_bytes = file.finish(figures).map_err(|e| other(&e))?;
    Ok(Candidate { codec, second, decoder, path, file_bytes, figures, secs: f64::INFINITY })
}

/// Has the system let go of what it keeps of a file; whether it can be asked to.
#[cfg(unix)]
fn forget(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    // What is not on the disk yet would be kept.
    file.sync_all().is_ok() && rustix::fs::fadvise(&file, 0, None, rustix::fs::Advice::DontNeed).is_ok()
}

#[cfg(not(unix))]
fn forget(_path: &Path) -> bool {
    false
}

fn stream(path: &Path) -> Result<(Stream, Figures), Failure> {
    let reader = Reader::open(path, &Limits::default()).map_err(|e| other(&e))?;
    let figures = reader.figures();
    let mut stream = Stream::spawn(reader, Options::default()).map_err(|e| Failure::Other(e.to_string()))?;
    stream.play_from(0, Direction::Forward, Repeat::Once).map_err(|e| other(&e))?;
    Ok((stream, figures))
}

/// Seconds from opening the file until the last step's texture is ready.
fn play(candidate: &Candidate, gpu: &Arc<Gpu>) -> Result<f64, Failure> {
    let mut renderer = Renderer::new(Arc::clone(gpu))?;
    renderer.set_step_decoder(candidate.decoder);
    let begin = Instant::now();
    let (mut stream, figures) = stream(&candidate.path)?;
    while let Some(chunk) = stream.wait().map_err(|e| other(&e))? {
        let count = chunk.steps().len();
        let chunk = Arc::new(chunk);
        for within in 0..count {
            let step = packed_step(stream.header(), figures, Arc::clone(&chunk) as _, within)
                .map_err(|e| other(&e))?;
            renderer.send_step(&step)?;
        }
    }
    renderer.finish()?;
    Ok(begin.elapsed().as_secs_f64())
}

/// Volumes a second with a small picture of each, half a dozen of them.
fn drawn(candidate: &Candidate, input: &Input, gpu: &Arc<Gpu>) -> Result<f64, Failure> {
    const STEPS: usize = 6;
    let mut scene = scene::scene(&input.case, &input.assets);
    scene.volumes.truncate(1);
    let mut renderer = Renderer::new(Arc::clone(gpu))?;
    renderer.set_step_decoder(candidate.decoder);
    forget(&candidate.path);
    let (mut stream, figures) = stream(&candidate.path)?;
    let (mut begin, mut count) = (Instant::now(), 0);
    while let Some(chunk) = stream.wait().map_err(|e| other(&e))? {
        let steps = chunk.steps().len();
        let chunk = Arc::new(chunk);
        for within in 0..steps {
            let step = packed_step(stream.header(), figures, Arc::clone(&chunk) as _, within)
                .map_err(|e| other(&e))?;
            if let Some(item) = scene.volumes.first_mut() {
                item.packed = Some(Arc::new(step));
            }
            renderer.render(&scene, SIZE, Quality::Draft)?;
            if count == 0 {
                // The first picture compiles the shaders.
                begin = Instant::now();
            }
            count += 1;
        }
        if count > STEPS {
            break;
        }
    }
    Ok((count.max(2) - 1) as f64 / begin.elapsed().as_secs_f64())
}
