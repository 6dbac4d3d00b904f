//! `series FILE X Y Z STEPS`: PVTC and zfp on a series of 8-bit volumes, raw, x fastest, time slowest.

use std::error::Error;
use std::time::Instant;

use compress::bc::EncodeOptions;
use compress::pvtc::packed::{Packing, decode_packed_step, encode_packed};
use compress::pvtc::{Encoder, Layout, decode_step, encode};
use compress::{Extent3, quality};
use serde_json::json;

use crate::zfp::{Array, Scalar};

/// Each codec runs so often, in turn with the others; the shortest time counts.
const REPEATS: usize = 3;

/// zfp's rates, in bits a sample: those of <4,3>, <4,2>, <1,3> and <1,2>.
const RATES: [f64; 4] = [5.0 / 6.0, 1.25, 4.0 / 3.0, 2.0];

/// A codec at a rate.
#[derive(Debug, Clone, Copy)]
enum Codec {
    Pvtc(Layout, Encoder),
    Packed(Packing),
    /// Each step alone in three dimensions.
    Zfp3(Scalar, f64),
    /// The whole series in four.
    Zfp4(Scalar, f64),
}

/// What one run gave.
struct Run {
    bytes: usize,
    encode_secs: f64,
    decode_secs: f64,
    decoded: Vec<u8>,
}

/// Measures all codecs and prints a line for each.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [file, sizes @ ..] = arguments else { return Err("give FILE X Y Z STEPS".into()) };
    let sizes: Vec<u32> = sizes.iter().map(|size| size.parse()).collect::<Result<_, _>>()?;
    let [x, y, z, steps] = *sizes.as_slice() else { return Err("give X Y Z STEPS".into()) };
    let extent = Extent3::new([x, y, z])?;
    let samples = std::fs::read(file)?;
    if samples.len() != extent.voxels() * steps as usize {
        return Err(format!("{} bytes are not {steps} steps of {x}×{y}×{z}", samples.len()).into());
    }
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;

    let mut codecs = Vec::new();
    for layout in Layout::ALL {
        codecs.extend([Encoder::MinMax, Encoder::Fitted].map(|encoder| Codec::Pvtc(layout, encoder)));
    }
    codecs.extend(Packing::ALL.map(Codec::Packed));
    for rate in RATES {
        for scalar in [Scalar::Int32, Scalar::Float32] {
            codecs.extend([Codec::Zfp3(scalar, rate), Codec::Zfp4(scalar, rate)]);
        }
    }
    let mut best: Vec<Option<Run>> = codecs.iter().map(|_| None).collect();
    for _ in 0..REPEATS {
        for (codec, best) in codecs.iter().zip(&mut best) {
            let mut run = codec.run(&samples, extent)?;
            if let Some(before) = best {
                run.encode_secs = run.encode_secs.min(before.encode_secs);
                run.decode_secs = run.decode_secs.min(before.decode_secs);
            }
            *best = Some(run);
        }
    }
    for (codec, run) in codecs.iter().zip(best.into_iter().flatten()) {
        let quality = quality::compare(&samples, &run.decoded, 255.0)?;
        let mega = samples.len() as f64 / 1e6;
        let line = json!({
            "codec": codec.name(),
            "rate_percent": 100.0 * run.bytes as f64 / samples.len() as f64,
            "psnr_db": quality.psnr_db,
            "largest": quality.largest,
            "p99_9": quality.percentile_999,
            "encode_mvoxel_per_s": mega / run.encode_secs,
            "decode_mvoxel_per_s": mega / run.decode_secs,
        });
        println!("{line}");
    }
    Ok(())
}

impl Codec {
    fn name(self) -> String {
        match self {
            Self::Pvtc(layout, Encoder::MinMax) => format!("pvtc {layout} min-max"),
            Self::Pvtc(layout, Encoder::Fitted) => format!("pvtc {layout} fitted"),
            Self::Packed(packing) => format!("pvtc-{}", packing.name()),
            Self::Zfp3(scalar, rate) => format!("zfp 3D {scalar:?} rate {rate:.3}"),
            Self::Zfp4(scalar, rate) => format!("zfp 4D {scalar:?} rate {rate:.3}"),
        }
    }

    fn run(self, samples: &[u8], extent: Extent3) -> Result<Run, Box<dyn Error>> {
        let mut run = Run { bytes: 0, encode_secs: 0.0, decode_secs: 0.0, decoded: Vec::new() };
        let step = extent.voxels();
        let sizes = [extent.x(), extent.y(), extent.z(), samples.len() / step];
        match self {
            Self::Pvtc(layout, encoder) => {
                run.groups(
                    samples,
                    step,
                    layout.t().into(),
                    |steps| Ok(encode(layout, steps, extent, encoder)?),
                    |bytes, at, out| Ok(decode_step(layout, bytes, extent, at, out)?),
                )?;
            }
            Self::Packed(packing) => {
                let options = EncodeOptions::default();
                run.groups(
                    samples,
                    step,
                    packing.steps(),
                    |steps| Ok(encode_packed(packing, steps, extent, options)?),
                    |bytes, at, out| Ok(decode_packed_step(packing, bytes, extent, at, out)?),
                )?;
            }
            Self::Zfp3(scalar, rate) => {
                samples.chunks(step).for_each(|samples| run.zfp(scalar, rate, samples, &sizes[..3]));
            }
            Self::Zfp4(scalar, rate) => run.zfp(scalar, rate, samples, &sizes),
        }
        Ok(run)
    }
}

impl Run {
    /// Encodes groups of `count` steps of `step` samples, and decodes each step of them.
    fn groups(
        &mut self,
        samples: &[u8],
        step: usize,
        count: usize,
        encode: impl Fn(&[&[u8]]) -> Result<Vec<u8>, Box<dyn Error>>,
        decode: impl Fn(&[u8], usize, &mut [u8]) -> Result<(), Box<dyn Error>>,
    ) -> Result<(), Box<dyn Error>> {
        // Touched before it is timed, as zfp's arrays are.
        let mut decoded = vec![1; samples.len()];
        for (group, out) in samples.chunks(step * count).zip(decoded.chunks_mut(step * count)) {
            let steps: Vec<&[u8]> = group.chunks(step).collect();
            let start = Instant::now();
            let bytes = encode(&steps)?;
            self.encode_secs += start.elapsed().as_secs_f64();
            let start = Instant::now();
            for (at, out) in out.chunks_mut(step).enumerate() {
                decode(&bytes, at, out)?;
            }
            self.decode_secs += start.elapsed().as_secs_f64();
            self.bytes += bytes.len();
        }
        self.decoded = decoded;
        Ok(())
    }

    /// Runs zfp on one array. Only zfp itself is timed, not the promotion to and from its types.
    fn zfp(&mut self, scalar: Scalar, rate: f64, samples: &[u8], sizes: &[usize]) {
        let mut array = Array::new(scalar, samples, sizes);
        let start = Instant::now();
        let mut bytes = array.compress(rate);
        self.encode_secs += start.elapsed().as_secs_f64();
        let start = Instant::now();
        array.decompress(&mut bytes, rate);
        self.decode_secs += start.elapsed().as_secs_f64();
        self.bytes += bytes.len();
        self.decoded.extend(array.samples());
    }
}
