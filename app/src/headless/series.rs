//! `compress` of a volume over time, and `bench series`: codecs of time series, run time beside error.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use ::compress::Extent3;
use ::compress::container::{Figures, Header, StepCodec};
use ::compress::lossless::{ByteCodec, PackOptions, Packed, Packer, Unpacker};
use ::compress::pvtc::packed::Packing;
use ::compress::pvtc::{Encoder, Layout};
use ::render::gpu::Gpu;
use ::render::renderer::{Quality, Renderer};
use ::render::scene::{Scene, TextureFormat};
use ::render::volume::{Affine, Grid, Rescale, Samples};
use serde_json::{Value, json};

use super::bench::{Bench, psnr};
use super::input::Input;
use super::{Failure, Terminal, check_folder, compress, input, say};
use crate::case::Volume;
use crate::cli::{CompressArgs, EncoderName, Format, SecondStage};
use crate::load::Progress as _;
use crate::save::choice::{self, Choice, Machine};
use crate::save::series::{self, Quantiser, SeriesError, SeriesOptions, decode_step, encode_group};
use crate::scene;
use crate::steps::{Steps, packed_step};

/// Timed runs of each measurement; the shortest counts.
const REPEATS: usize = 3;
/// The picture that lossy steps are compared in; pixels.
const SIZE: [u32; 2] = [256, 256];

/// The first volume over time of an input.
///
/// # Errors
/// [`Failure::Unfit`] where there is none.
pub(super) fn steps<'a>(input: &'a Input, path: &Path) -> Result<(&'a Volume, &'a Arc<Steps>), Failure> {
    let found = input.case.volumes.iter().find_map(|v| Some((v, input.assets.steps(v)?)));
    found.ok_or_else(|| {
        let fault = "there is no volume over time; choose a 4D file, a DICOM series with temporal positions or a \
                     folder of numbered volumes";
        Failure::Unfit(format!("{fault}: {}", path.display()))
    })
}

impl Format {
    /// The codec that the arguments name, of a series; none for a texture.
    pub(super) fn of_series(self, layout: Layout) -> Option<StepCodec> {
        match self {
            Self::Raw8 => Some(StepCodec::Raw8),
            Self::Raw16 => Some(StepCodec::Raw16),
            Self::Pvtc => Some(StepCodec::Pvtc(layout)),
            Self::PvtcTe => Some(StepCodec::Packed(Packing::Te)),
            Self::PvtcSe => Some(StepCodec::Packed(Packing::Se)),
            _ => None,
        }
    }
}

/// Writes a series file and says what it cost.
///
/// # Errors
/// [`Failure`].
pub(super) fn compress(args: &CompressArgs) -> Result<(), Failure> {
    check_folder(&args.out)?;
    let input = input::open(&args.input)?;
    let (volume, steps) = steps(&input, &args.input)?;
    let key = crate::case::assets::Key::of_volume(volume);
    let modality = input.assets.asset(&key).and_then(|a| a.modality.clone()).unwrap_or_default();
    let pool = compress::pool(args.threads.map_or(0, usize::from))?;
    let (encoder, byte_codec) = (args.encoder.of_codec(), args.second.of_codec());
    let (options, chosen) = if let Some(codec) = args.format.of_series(args.layout) {
        (SeriesOptions { codec, encoder, byte_codec }, Value::Null)
    } else {
        pool.install(|| choose(steps, args))?
    };
    let codec = options.codec;
    let name = &input.case.name;
    let terminal = Terminal::default();
    let written = pool.install(|| series::write(&args.out, steps, name, &modality, options, &terminal))?;
    if args.stats {
        let voxels = written.samples as f64;
        say(&json!({
            "codec": codec.to_string(), "chosen": chosen, "encoder": args.encoder.name(), "second": options.byte_codec.name(),
            "steps": written.steps, "threads": pool.current_num_threads(),
            "sample_bytes": written.samples, "payload_bytes": written.payload_bytes,
            "file_bytes": written.file_bytes,
            "rate": written.payload_bytes as f64 / voxels, "ratio_file": voxels / written.file_bytes as f64,
            "encode_ms": written.encode.as_secs_f64() * 1e3, "pack_ms": written.pack.as_secs_f64() * 1e3,
            "encode_mvoxel_per_s": voxels / 1e6 / written.encode.as_secs_f64(),
            "largest_value_error": written.largest_error, "psnr_db": written.psnr_db,
            "lossy": written.largest_error > 0.0,
        })
        .to_string())?;
    }
    Ok(())
}

/// What keeps to the goal, tried on steps from the middle of the series; and what was found, as JSON.
fn choose(steps: &Steps, args: &CompressArgs) -> Result<(SeriesOptions, Value), Failure> {
    let count = steps.times_secs().len();
    let few = choice::SAMPLE_STEPS.min(count);
    let bytes = Bytes::new(steps, 1, (count - few) / 2..(count - few) / 2 + few)?;
    let alike = choice::likeness(&bytes.steps, bytes.extent).map_err(|e| Failure::Other(e.to_string()))?;
    let machine = Machine { disk_bytes_per_sec: args.disk * 1e6, threads: rayon::current_num_threads() };
    // Without a device nothing is drawn, and sending takes no time that is known.
    let mut sender = Gpu::headless().ok().and_then(|gpu| Sender::new(&Arc::new(gpu), &bytes).ok());
    let mut send = |codec, payload| match &mut sender {
        Some(sender) => sender.secs(codec, payload),
        None => Ok(0.0),
    };
    let trials = choice::trials(&bytes.steps, bytes.extent, &choice::codecs(), machine, &mut send);
    let trials = trials.map_err(|e| Failure::Other(e.to_string()))?;
    let found = choice::choose(&trials, args.goal, count);
    let found =
        found.ok_or_else(|| Failure::Other("no codec could be tried; please report this".to_owned()))?;
    let Choice { trial, meets_goal } = found;
    let options =
        SeriesOptions { codec: trial.codec, encoder: args.encoder.of_codec(), byte_codec: trial.byte_codec };
    let chosen = json!({
        "meets_goal": meets_goal, "tried": trials.len(), "sample_steps": few,
        "spatial_similarity": alike.spatial, "temporal_similarity": alike.temporal,
        "expected_psnr_db": Some(trial.psnr_db).filter(|p| p.is_finite()),
        "expected_bytes": trial.bytes * count as f64, "expected_steps_per_s": 1.0 / trial.secs,
    });
    Ok((options, chosen))
}

/// Sends steps to a device and says how long they take.
struct Sender<'a> {
    renderer: Renderer,
    bytes: &'a Bytes,
}

impl<'a> Sender<'a> {
    fn new(gpu: &Arc<Gpu>, bytes: &'a Bytes) -> Result<Self, Failure> {
        Ok(Self { renderer: Renderer::new(Arc::clone(gpu))?, bytes })
    }

    /// Seconds of one step of a payload, from its bytes to a texture that can be drawn.
    fn secs(&mut self, codec: StepCodec, payload: Vec<u8>) -> Result<f64, String> {
        let count = usize::from(codec.steps_per_chunk());
        let header = self.bytes.header(codec);
        let payload = Arc::new(payload);
        let begin = Instant::now();
        for within in 0..count {
            let step = packed_step(&header, Figures::default(), payload.clone(), within);
            self.renderer.send_step(&step.map_err(|e| e.to_string())?).map_err(|e| e.to_string())?;
        }
        self.renderer.finish().map_err(|e| e.to_string())?;
        Ok(begin.elapsed().as_secs_f64() / count as f64)
    }
}

impl From<SeriesError> for Failure {
    fn from(error: SeriesError) -> Self {
        match error {
            SeriesError::Step { .. } => Self::Unfit(error.to_string()),
            other => Self::Other(other.to_string()),
        }
    }
}

impl EncoderName {
    pub(super) fn of_codec(self) -> Encoder {
        match self {
            Self::MinMax => Encoder::MinMax,
            Self::Fitted => Encoder::Fitted,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::MinMax => "min-max",
            Self::Fitted => "fitted",
        }
    }
}

impl SecondStage {
    pub(super) fn of_codec(self) -> ByteCodec {
        match self {
            Self::None => ByteCodec::Store,
            Self::Lzo => ByteCodec::Lzo,
            Self::Lz4 => ByteCodec::Lz4,
            Self::Zstd => ByteCodec::Zstd,
        }
    }
}

/// The steps of a series in 8 bits, in memory, enlarged by a whole factor along each axis.
#[derive(Debug)]
pub(super) struct Bytes {
    pub(super) extent: Extent3,
    pub(super) steps: Vec<Vec<u8>>,
    pub(super) times_secs: Vec<f64>,
    pub(super) quantiser: Quantiser,
    pub(super) place: Affine,
}

impl Bytes {
    pub(super) fn new(steps: &Steps, enlarge: usize, which: Range<usize>) -> Result<Self, Failure> {
        let fault = || Failure::Unfit(steps.fault().unwrap_or_else(|| "a step cannot be read".to_owned()));
        let first = steps.grid(0).ok_or_else(fault)?;
        let quantiser = Quantiser::new(steps.range(), series::unit(&first), false);
        let large = first.extent().map(|n| n * enlarge);
        let extent = Extent3::new(large.map(|n| u32::try_from(n).unwrap_or(u32::MAX)))
            .map_err(|e| Failure::Usage(e.to_string()))?;
        let times_secs = steps.times_secs().get(which.clone()).unwrap_or_default().to_vec();
        let mut all = Vec::with_capacity(which.len());
        for step in which {
            let grid = steps.grid(step).ok_or_else(fault)?;
            let bytes = quantiser.bytes(&grid);
            all.push(if enlarge == 1 { bytes } else { enlarged(&bytes, grid.extent(), enlarge) });
        }
        let place = *first.world_from_voxel() * shrink(enlarge);
        Ok(Self { extent, steps: all, times_secs, quantiser, place })
    }

    /// The first steps of these.
    pub(super) fn first(&self, count: usize) -> Self {
        let count = count.min(self.steps.len());
        let Self { extent, quantiser, place, .. } = *self;
        Self {
            extent,
            steps: self.steps[..count].to_vec(),
            times_secs: self.times_secs[..count].to_vec(),
            quantiser,
            place,
        }
    }

    pub(super) fn voxels(&self) -> f64 {
        (self.extent.voxels() * self.steps.len()) as f64
    }

    /// A header that places the steps as they lie.
    pub(super) fn header(&self, codec: StepCodec) -> Header {
        let mut header = Header::new(self.extent, codec, ByteCodec::Store);
        (header.value_scale, header.value_offset) = (self.quantiser.scale, self.quantiser.offset);
        header.world_from_voxel = self.place.to_row_major();
        header
    }

    /// All steps through the first stage, a payload a group.
    fn payloads(&self, codec: StepCodec, encoder: Encoder) -> Result<Vec<Vec<u8>>, Failure> {
        let group = usize::from(codec.steps_per_chunk());
        let payloads = self.steps.chunks(group).map(|steps| encode_group(codec, encoder, steps, self.extent));
        Ok(payloads.collect::<Result<_, _>>()?)
    }

    fn grid(&self, samples: Vec<u8>) -> Result<Grid, Failure> {
        let rescale = Rescale { slope: self.quantiser.scale, intercept: self.quantiser.offset };
        let extent = self.extent.sizes().map(|n| n as usize);
        Grid::new(extent, Samples::U8(samples), rescale, self.place)
            .map_err(|e| Failure::Other(e.to_string()))
    }
}

/// `small_from_large`: voxel centres of a grid whose voxels were divided by `n`.
fn shrink(n: usize) -> Affine {
    use ::render::volume::{Point, Vector};
    let part = 1.0 / n as f64;
    let [x, y, z] = [Vector::x(), Vector::y(), Vector::z()].map(|axis| axis * part);
    Affine::from_columns(x, y, z, Point::from([0.5 * part - 0.5; 3])).unwrap_or_default()
}

/// Trilinear interpolation to `n` times the voxels along each axis; the outer half voxel is held.
fn enlarged(bytes: &[u8], extent: [usize; 3], n: usize) -> Vec<u8> {
    use rayon::prelude::*;
    let [nx, ny, nz] = extent;
    let large = extent.map(|e| e * n);
    let along = |i: usize, count: usize| {
        let at = ((i as f32 + 0.5) / n as f32 - 0.5).clamp(0.0, (count - 1) as f32);
        let low = at.floor();
        (low as usize, (low as usize + 1).min(count - 1), at - low)
    };
    let mut out = vec![0; large.iter().product()];
    out.par_chunks_mut(large[0]).enumerate().for_each(|(row, line)| {
        let (y0, y1, fy) = along(row % large[1], ny);
        let (z0, z1, fz) = along(row / large[1], nz);
        let at = |x: usize, y: usize, z: usize| f32::from(bytes[(z * ny + y) * nx + x]);
        let mix = |a: f32, b: f32, f: f32| a + (b - a) * f;
        for (x, voxel) in line.iter_mut().enumerate() {
            let (x0, x1, fx) = along(x, nx);
            let edge = |y, z| mix(at(x0, y, z), at(x1, y, z), fx);
            let value = mix(mix(edge(y0, z0), edge(y1, z0), fy), mix(edge(y0, z1), edge(y1, z1), fy), fz);
            *voxel = value.round() as u8;
        }
    });
    debug_assert_eq!(nz * n, large[2], "all slices");
    out
}

/// Every codec of the papers, and of ours the one that keeps most.
pub(super) fn codecs() -> Vec<StepCodec> {
    let layouts = [(4, 3), (4, 2), (1, 3), (1, 2), (1, 1)];
    let layouts = layouts.into_iter().filter_map(|(s, t)| Layout::new(s, t).ok());
    let packed = [Packing::Te, Packing::Se].map(StepCodec::Packed);
    layouts.map(StepCodec::Pvtc).chain(packed).chain([StepCodec::Raw8]).collect()
}

/// What was lost: of the samples, and of the differences between one step and the next.
#[derive(Debug, Default)]
struct Lost {
    errors: Vec<u64>,
    squares_of_change: f64,
}

impl Lost {
    /// Adds a step; `before` are the originals and the decoded samples of the step before it.
    fn add(&mut self, original: &[u8], decoded: &[u8], before: Option<(&[u8], &[u8])>) {
        self.errors.resize(256, 0);
        for (a, b) in original.iter().zip(decoded) {
            self.errors[usize::from(a.abs_diff(*b))] += 1;
        }
        let Some((original_before, decoded_before)) = before else { return };
        let change = |now: &[u8], before: &[u8], i: usize| i64::from(now[i]) - i64::from(before[i]);
        let squares = (0..original.len())
            .map(|i| (change(decoded, decoded_before, i) - change(original, original_before, i)).pow(2));
        self.squares_of_change += squares.sum::<i64>() as f64;
    }

    /// Samples, mean square, largest, 99.9th percentile.
    fn figures(&self) -> (f64, f64, usize, usize) {
        let count: u64 = self.errors.iter().sum();
        let squares: f64 = self.errors.iter().enumerate().map(|(e, n)| (e * e) as f64 * *n as f64).sum();
        let largest = self.errors.iter().rposition(|n| *n > 0).unwrap_or_default();
        let rank = (u128::from(count) * 999).div_ceil(1000) as u64;
        let mut below = 0;
        let percentile = self.errors.iter().position(|n| {
            below += n;
            below >= rank
        });
        (count as f64, squares / count as f64, largest, percentile.unwrap_or_default())
    }
}

/// `bench series`: every codec with every second stage, one thread for each measurement of speed.
pub(super) fn bench(input: &Input, path: &Path, bench: &mut Bench) -> Result<(), Failure> {
    let (volume, steps) = steps(input, path)?;
    let bytes = Bytes::new(steps, bench.enlarge(), 0..steps.times_secs().len())?;
    let gpu = Arc::new(Gpu::headless()?);
    let pool = compress::pool(1)?;
    let mut scene = scene::scene(&input.case, &input.assets);
    scene.volumes.retain(|v| v.packed.is_some() || scene_is_of(v, volume));
    let terminal = Terminal::default();
    let all = codecs();
    for (done, &codec) in all.iter().enumerate() {
        let encoders: &[EncoderName] = match codec {
            StepCodec::Raw8 => &[EncoderName::MinMax],
            _ => &[EncoderName::MinMax, EncoderName::Fitted],
        };
        for &encoder in encoders {
            if !terminal.step("measuring codecs", done, all.len()) {
                return Err(SeriesError::Cancelled.into());
            }
            let first = pool.install(|| FirstStage::measure(&bytes, codec, encoder.of_codec()))?;
            let picture = first.picture_psnr(&bytes, codec, &gpu, &mut scene)?;
            for second in ByteCodec::ALL {
                let packed = pack(&first.payloads, codec, second, &bytes)?;
                let (samples, mean_square, largest, percentile) = first.lost.figures();
                let changes = samples - bytes.extent.voxels() as f64;
                let name = if codec == StepCodec::Raw8 { "none" } else { encoder.name() };
                bench.report(json!({
                    "bench": "series", "codec": codec.to_string(), "encoder": name, "second": second.name(),
                    "threads": 1, "extent": bytes.extent.sizes(), "steps": bytes.steps.len(),
                    "sample_bytes": samples, "payload_bytes": first.bytes(), "bytes": packed.bytes,
                    "rate": first.bytes() as f64 / samples, "ratio": samples / packed.bytes as f64,
                    "second_gain": first.bytes() as f64 / packed.bytes as f64,
                    "stored_chunks": packed.stored,
                    "encode_mvoxel_per_s": samples / 1e6 / first.encode_secs,
                    "decode_mvoxel_per_s": samples / 1e6 / first.decode_secs,
                    "unpack_mb_per_s": first.bytes() as f64 / 1e6 / packed.unpack_secs,
                    "unpack_and_decode_mvoxel_per_s": samples / 1e6 / (first.decode_secs + packed.unpack_secs),
                    "psnr_db": psnr(mean_square), "largest_255": largest, "percentile_99_9_255": percentile,
                    "largest_value": largest as f64 * bytes.quantiser.scale,
                    "change_psnr_db": psnr(first.lost.squares_of_change / changes.max(1.0)),
                    "picture_psnr_db": picture,
                }))?;
            }
        }
    }
    Ok(())
}

fn scene_is_of(item: &::render::scene::VolumeItem, volume: &Volume) -> bool {
    Arc::ptr_eq(&item.transfer, &volume.transfer)
}

/// One codec's payloads of all steps, how long they took, and what they lost.
struct FirstStage {
    payloads: Vec<Vec<u8>>,
    encode_secs: f64,
    decode_secs: f64,
    lost: Lost,
}

impl FirstStage {
    fn measure(bytes: &Bytes, codec: StepCodec, encoder: Encoder) -> Result<Self, Failure> {
        let begin = Instant::now();
        let payloads = bytes.payloads(codec, encoder)?;
        let encode_secs = begin.elapsed().as_secs_f64();
        let group = usize::from(codec.steps_per_chunk());
        let mut stage = Self { payloads, encode_secs, decode_secs: 0.0, lost: Lost::default() };
        let (mut decoded, mut before) = (Vec::new(), Vec::new());
        for (i, original) in bytes.steps.iter().enumerate() {
            let mut shortest = f64::INFINITY;
            for _ in 0..REPEATS {
                let begin = Instant::now();
                decode_step(codec, &stage.payloads[i / group], bytes.extent, i % group, &mut decoded)?;
                shortest = shortest.min(begin.elapsed().as_secs_f64());
            }
            stage.decode_secs += shortest;
            let earlier = i.checked_sub(1).map(|i| (bytes.steps[i].as_slice(), before.as_slice()));
            stage.lost.add(original, &decoded, earlier);
            before.clone_from(&decoded);
        }
        Ok(stage)
    }

    fn bytes(&self) -> usize {
        self.payloads.iter().map(Vec::len).sum()
    }

    /// The middle step drawn from its compressed bytes, against the same drawn from the samples; dB.
    fn picture_psnr(
        &self,
        bytes: &Bytes,
        codec: StepCodec,
        gpu: &Arc<Gpu>,
        scene: &mut Scene,
    ) -> Result<Option<f64>, Failure> {
        let Some(item) = scene.volumes.first_mut() else { return Ok(None) };
        let middle = bytes.steps.len() / 2;
        let group = usize::from(codec.steps_per_chunk());
        let payload = Arc::new(self.payloads[middle / group].clone());
        let packed = packed_step(&bytes.header(codec), Figures::default(), payload, middle % group)
            .map_err(|e| Failure::Other(e.to_string()))?;
        item.grid = Arc::new(bytes.grid(bytes.steps[middle].clone())?);
        item.texture = TextureFormat::R16;
        let mut renderer = Renderer::new(Arc::clone(gpu))?;
        item.packed = None;
        renderer.render(scene, SIZE, Quality::Good)?;
        let exact = renderer.read()?;
        if let Some(item) = scene.volumes.first_mut() {
            item.packed = Some(Arc::new(packed));
        }
        renderer.render(scene, SIZE, Quality::Good)?;
        let apart = renderer.read()?.difference(&exact, scene.background);
        let psnr = apart.map_err(|e| Failure::Other(e.to_string()))?.psnr_db;
        Ok(psnr.is_finite().then_some(psnr))
    }
}

/// All payloads through the second stage.
struct SecondStageResult {
    bytes: usize,
    /// Chunks that it did not make smaller.
    stored: usize,
    unpack_secs: f64,
}

fn pack(
    payloads: &[Vec<u8>],
    codec: StepCodec,
    second: ByteCodec,
    bytes: &Bytes,
) -> Result<SecondStageResult, Failure> {
    let other = |e: &dyn std::error::Error| Failure::Other(e.to_string());
    let shape = codec.shape(bytes.extent);
    let options = PackOptions { codec: second, ..PackOptions::default() };
    let mut packer = Packer::new(options).map_err(|e| other(&e))?;
    let mut unpacker = Unpacker::new();
    let mut result = SecondStageResult { bytes: 0, stored: 0, unpack_secs: 0.0 };
    let mut out = vec![0; shape.bytes()];
    for payload in payloads {
        let Packed { form, bytes } = packer.pack(payload, shape).map_err(|e| other(&e))?;
        let mut shortest = f64::INFINITY;
        for _ in 0..REPEATS {
            let begin = Instant::now();
            unpacker.unpack_into(form, shape, &bytes, &mut out).map_err(|e| other(&e))?;
            shortest = shortest.min(begin.elapsed().as_secs_f64());
        }
        result.unpack_secs += shortest;
        result.bytes += bytes.len();
        result.stored += usize::from(form.codec == ByteCodec::Store);
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_enlarged_ramp_stays_a_ramp_and_keeps_its_ends() {
        let bytes: Vec<u8> = (0..4).map(|x| x * 60).collect();
        let large = enlarged(&bytes, [4, 1, 1], 2);
        assert_eq!(large.len(), 4 * 8, "twice along each axis");
        assert_eq!(large[..8], [0, 15, 45, 75, 105, 135, 165, 180], "linear between centres, held outside");
        assert_eq!(shrink(2).point(&[0.0; 3].into()).coords.as_slice(), [-0.25; 3], "half a small voxel in");
    }

    #[test]
    fn the_figures_of_a_known_loss_are_those_of_the_definition() {
        let mut lost = Lost::default();
        let (original, mut decoded) = (vec![100; 2000], vec![100; 2000]);
        decoded[0] = 110;
        decoded[1..11].fill(97);
        lost.add(&original, &decoded, None);
        lost.add(&original, &decoded, Some((&original, &decoded)));
        let (count, mean_square, largest, percentile) = lost.figures();
        assert_eq!((count, largest, percentile), (4000.0, 10, 3), "one in 2000 is off by 10");
        assert!((mean_square - 0.095).abs() < 1e-12, "{mean_square}");
        assert_eq!(lost.squares_of_change, 0.0, "the loss does not flicker");
    }
}
