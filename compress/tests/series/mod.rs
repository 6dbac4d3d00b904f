//! The series file: what is written is read, by step; what is damaged, cut off or made to lie is named.

mod damage;
mod stream;
mod writer;

use std::io::Cursor;

use compress::container::{Figures, Header, Reader, StepCodec, Writer};
use compress::lossless::{ByteCodec, PackOptions};
use compress::pvtc::Layout;
use compress::pvtc::packed::Packing;
use compress::{Extent3, Limits};

/// Every step codec that a series is tried with.
pub(crate) fn codecs() -> Vec<StepCodec> {
    let layouts = [(4, 3), (4, 2), (1, 3), (1, 2), (8, 4), (2, 1)].map(|(s, t)| Layout::new(s, t).unwrap());
    let mut codecs = vec![StepCodec::Raw8, StepCodec::Raw16];
    codecs.extend(layouts.map(StepCodec::Pvtc));
    codecs.extend(Packing::ALL.map(StepCodec::Packed));
    codecs
}

/// A header with all its fields.
pub(crate) fn header(extent: [u32; 3], codec: StepCodec, byte_codec: ByteCodec) -> Header {
    let mut world_from_voxel = [0.0; 16];
    world_from_voxel.iter_mut().step_by(5).for_each(|diagonal| *diagonal = 1.0);
    world_from_voxel[3] = -80.25;
    Header {
        value_scale: 0.5,
        value_offset: -1024.0,
        steps_per_sec: 12.5,
        world_from_voxel,
        name: "Strömung".to_owned(),
        kind: "CT".to_owned(),
        unit: "HU".to_owned(),
        ..Header::new(Extent3::new(extent).unwrap(), codec, byte_codec)
    }
}

/// The payload of a chunk: partly smooth, partly constant, partly noise, different for each chunk.
pub(crate) fn payload(chunk: u32, bytes: usize) -> Vec<u8> {
    let mut state = u64::from(chunk) + 1;
    let mut noise = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 56) as u8
    };
    let third = bytes / 3;
    (0..bytes)
        .map(|i| match i {
            _ if i < third => (i / 16) as u8 ^ chunk as u8,
            _ if i < 2 * third => chunk as u8,
            _ => noise() & 31,
        })
        .collect()
}

/// The time of a step.
pub(crate) fn time_secs(step: u32) -> f64 {
    f64::from(step) * 0.08 + 1.0
}

/// What the figures of every test series are.
pub(crate) const FIGURES: Figures = Figures { largest_error: Some(7.5), psnr_db: Some(41.25) };

/// A series of `steps` steps in memory.
pub(crate) fn series(header: &Header, steps: u32) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new(), header, PackOptions::default()).unwrap();
    let full = u32::from(header.codec.steps_per_chunk());
    let bytes = header.codec.shape(header.extent).bytes();
    for chunk in 0..steps.div_ceil(full) {
        let times: Vec<f64> = (chunk * full..steps.min((chunk + 1) * full)).map(time_secs).collect();
        writer.push(&payload(chunk, bytes), &times).unwrap();
    }
    writer.finish(FIGURES).unwrap()
}

pub(crate) fn open(bytes: &[u8]) -> Reader<Cursor<Vec<u8>>> {
    Reader::new(Cursor::new(bytes.to_vec()), &Limits::default()).unwrap()
}

#[test]
fn a_series_is_read_as_it_was_written_by_every_codec() {
    for codec in codecs() {
        for byte_codec in ByteCodec::ALL {
            let header = header([13, 9, 6], codec, byte_codec);
            let mut reader = open(&series(&header, 7));
            assert_eq!(reader.header(), &header, "header of {codec}");
            assert_eq!(reader.figures(), FIGURES, "figures");
            assert_eq!(reader.steps(), 7, "steps");
            assert_eq!(reader.times_secs(), (0..7).map(time_secs).collect::<Vec<_>>(), "times");
            let full = u32::from(codec.steps_per_chunk());
            assert_eq!(reader.chunks(), 7_u32.div_ceil(full), "chunks of {codec}");
            // From the last to the first: access is random.
            for step in (0..7).rev() {
                let (chunk, within) = reader.chunk_of(step).unwrap();
                assert_eq!(chunk * full + u32::from(within), step, "place of step {step} of {codec}");
                assert!(reader.steps_of(chunk).unwrap().contains(&step), "steps of chunk {chunk}");
                let read = reader.read_chunk(chunk).unwrap();
                assert!(read == payload(chunk, read.len()), "chunk {chunk} of {codec}, {byte_codec:?}");
            }
            reader.verify().unwrap();
        }
    }
}

#[test]
fn the_same_steps_give_the_same_bytes() {
    for byte_codec in ByteCodec::ALL {
        let header = header([20, 20, 8], StepCodec::Pvtc(Layout::new(4, 3).unwrap()), byte_codec);
        assert!(series(&header, 8) == series(&header, 8), "{byte_codec:?}");
    }
}

#[test]
fn steps_and_chunks_past_the_end_are_refused_by_name() {
    let header = header([4, 4, 4], StepCodec::Pvtc(Layout::new(4, 3).unwrap()), ByteCodec::Lz4);
    let mut reader = open(&series(&header, 4));
    for step in [4, 5, 6, u32::MAX] {
        let refused = reader.chunk_of(step).unwrap_err().to_string();
        assert_eq!(refused, format!("step {step} was asked of a series of 4: count from 0"), "message");
    }
    assert_eq!(reader.steps_of(1).unwrap(), 3..4, "the last chunk has one step");
    let refused = reader.read_chunk(2).unwrap_err().to_string();
    assert_eq!(refused, "chunk 2 was asked of a series of 2: count from 0", "message");
}

#[test]
fn packing_on_other_threads_gives_the_bytes_of_one() {
    use compress::lossless::Packer;
    let header = header([24, 20, 8], StepCodec::Raw8, ByteCodec::Zstd);
    let shape = header.codec.shape(header.extent);
    let mut writer = Writer::new(Vec::new(), &header, PackOptions::default()).unwrap();
    let packed: Vec<_> = std::thread::scope(|scope| {
        let pack =
            |chunk| Packer::new(PackOptions::default()).unwrap().pack(&payload(chunk, shape.bytes()), shape);
        let workers: Vec<_> = (0..5).map(|chunk| scope.spawn(move || pack(chunk))).collect();
        workers.into_iter().map(|worker| worker.join().unwrap().unwrap()).collect()
    });
    for (step, packed) in (0..).zip(&packed) {
        writer.push_packed(packed, &[time_secs(step)]).unwrap();
    }
    assert!(writer.finish(FIGURES).unwrap() == series(&header, 5), "five threads and one");
}
