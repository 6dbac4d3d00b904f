//! What the second stage gains, and how fast it is undone: every step codec, every byte codec, every choice of planes.
//!
//! ```text
//! cargo bench -p compress --bench second_stage -- FILE X Y Z
//! ```
//! reads raw 8-bit steps, x fastest, or makes a small series of its own where nothing is given. Speeds are bytes of
//! payload a second on one thread: the shortest of many rounds, all forms in turn in each round. `old lzo` is the
//! papers' second stage by an independent decoder (`lzokay`) on the payload as it is; the columns behind a speed
//! compare with it.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may fail loudly, and prints")]

use std::time::Instant;

use compress::Extent3;
use compress::bc::EncodeOptions;
use compress::container::StepCodec;
use compress::lossless::{ByteCodec, Form, PackOptions, Packer, Planes, Shape, Unpacker};
use compress::pvtc::packed::{Packing, encode_packed};
use compress::pvtc::{Encoder, Layout, encode};

/// Chunks of a series that are measured, from its middle on.
const CHUNKS: usize = 4;

fn main() {
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let (samples, extent, rounds) = if let [file, x, y, z] = arguments.as_slice() {
        let extent = Extent3::new([x, y, z].map(|size| size.parse().unwrap())).unwrap();
        (std::fs::read(file).unwrap(), extent, 15)
    } else {
        let extent = Extent3::new([32, 32, 16]).unwrap();
        let wave = |i: usize| ((i % 32) as f64 / 5.0 + (i / 1024) as f64 / 9.0).sin();
        ((0..12 * extent.voxels()).map(|i| (wave(i) * 90.0 + 120.0) as u8).collect(), extent, 2)
    };
    let steps: Vec<&[u8]> = samples.chunks_exact(extent.voxels()).collect();
    println!(
        "{:9} {:5} {:5} {:>7} {:>6} {:>9} {:>6}",
        "steps", "bytes", "planes", "ratio", "gain", "MB/s", "speed"
    );
    for encoder in [Encoder::MinMax, Encoder::Fitted] {
        println!("{encoder:?}");
        for codec in codecs() {
            let chunks = payloads(codec, &steps, extent, encoder);
            measure(codec, &chunks, codec.shape(extent), rounds);
        }
    }
}

fn codecs() -> Vec<StepCodec> {
    let layouts = [(4, 3), (4, 2), (1, 3), (1, 2)].map(|(s, t)| Layout::new(s, t).unwrap());
    let mut codecs = vec![StepCodec::Raw8];
    codecs.extend(layouts.map(StepCodec::Pvtc));
    codecs.extend(Packing::ALL.map(StepCodec::Packed));
    codecs
}

/// Payloads of some chunks from the middle of the series.
fn payloads(codec: StepCodec, steps: &[&[u8]], extent: Extent3, encoder: Encoder) -> Vec<Vec<u8>> {
    let groups: Vec<_> = steps.chunks_exact(codec.steps_per_chunk().into()).collect();
    let middle = groups.len().saturating_sub(CHUNKS) / 2;
    let some = groups.into_iter().skip(middle).take(CHUNKS);
    some.map(|group| match codec {
        StepCodec::Raw8 | StepCodec::Raw16 => group[0].to_vec(),
        StepCodec::Pvtc(layout) => encode(layout, group, extent, encoder).unwrap(),
        StepCodec::Packed(packing) => {
            encode_packed(packing, group, extent, EncodeOptions::default()).unwrap()
        }
    })
    .collect()
}

/// One way to pack, and what became of it.
struct Way {
    name: &'static str,
    planes: &'static str,
    form: Option<Form>,
    packed: Vec<Vec<u8>>,
    secs: f64,
}

impl Way {
    fn bytes(&self) -> f64 {
        self.packed.iter().map(Vec::len).sum::<usize>() as f64
    }
}

fn measure(codec: StepCodec, chunks: &[Vec<u8>], shape: Shape, rounds: usize) {
    let old = |chunk: &Vec<u8>| lzokay::compress::compress(chunk).unwrap();
    let packed = chunks.iter().map(old).collect();
    let mut ways = vec![Way { name: "old lzo", planes: "", form: None, packed, secs: f64::INFINITY }];
    for byte_codec in ByteCodec::ALL {
        for planes in Planes::ALL {
            let options = PackOptions { codec: byte_codec, planes: Some(planes), ..Default::default() };
            let mut packer = Packer::new(options).unwrap();
            let packed: Vec<_> = chunks.iter().map(|chunk| packer.pack(chunk, shape).unwrap()).collect();
            let form = packed[0].form;
            if form == (Form { codec: byte_codec, planes }) && packed.iter().all(|packed| packed.form == form)
            {
                let packed = packed.into_iter().map(|packed| packed.bytes).collect();
                let (name, planes) = (byte_codec.name(), planes.name());
                ways.push(Way { name, planes, form: Some(form), packed, secs: f64::INFINITY });
            }
        }
    }
    let mut unpacker = Unpacker::new();
    let mut out = vec![0; shape.bytes()];
    for _ in 0..rounds {
        for way in &mut ways {
            let start = Instant::now();
            for packed in &way.packed {
                match way.form {
                    Some(form) => unpacker.unpack_into(form, shape, packed, &mut out).unwrap(),
                    None => {
                        assert_eq!(lzokay::decompress::decompress(packed, &mut out), Ok(out.len()), "old");
                    }
                }
            }
            way.secs = way.secs.min(start.elapsed().as_secs_f64());
        }
    }
    let total = (shape.bytes() * chunks.len()) as f64;
    let (old_bytes, old_secs) = (ways[0].bytes(), ways[0].secs);
    for way in &ways {
        println!(
            "{:9} {:7} {:5} {:7.3} {:5.2}x {:9.0} {:5.2}x",
            codec.to_string().replace("pvtc ", ""),
            way.name,
            way.planes,
            total / way.bytes(),
            old_bytes / way.bytes(),
            total / way.secs / 1e6,
            old_secs / way.secs
        );
    }
}
