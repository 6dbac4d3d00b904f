//! The door of series files, and of streams of them.

use std::io::Cursor;
use std::num::NonZeroUsize;

use compress::container::{Figures, Header, Reader, StepCodec, Writer};
use compress::lossless::{ByteCodec, PackOptions};
use compress::pvtc::Layout;
use compress::pvtc::packed::Packing;
use compress::stream::{Direction, Options, Repeat, Stream};
use compress::{Extent3, Limits};

use crate::mutate::Random;
use crate::{Tally, knock};

/// Most memory that reading may take here.
const LIMITS: Limits = Limits { decoded_bytes: 1 << 16 };

/// Where parts of the file are: see the format page.
const HEADER_BYTES: usize = 512;
const TRAILER_BYTES: usize = 64;
const ENTRY_BYTES: usize = 16;

fn seeds() -> Vec<Vec<u8>> {
    let layout = |s, t| StepCodec::Pvtc(Layout::new(s, t).unwrap());
    let codecs =
        [StepCodec::Raw8, StepCodec::Raw16, layout(4, 3), layout(1, 2), StepCodec::Packed(Packing::Te)];
    let mut seeds = Vec::new();
    for codec in codecs {
        for byte_codec in ByteCodec::ALL {
            let extent = Extent3::new([9, 8, 5]).unwrap();
            let header = Header { name: "a name".to_owned(), ..Header::new(extent, codec, byte_codec) };
            let mut writer = Writer::new(Vec::new(), &header, PackOptions::default()).unwrap();
            let full = usize::from(codec.steps_per_chunk());
            for chunk in 0..4 {
                let payload: Vec<u8> =
                    (0..codec.shape(extent).bytes()).map(|i| (i / 20 + i % 3 + chunk) as u8).collect();
                let times: Vec<f64> = (chunk * full..(chunk + 1) * full).map(|step| step as f64).collect();
                writer.push(&payload, &times).unwrap();
            }
            seeds.push(writer.finish(Figures::default()).unwrap());
        }
    }
    seeds
}

/// Puts the checksums right, as far as the parts can be found, so that what is behind them is reached.
fn mend(file: &mut [u8]) {
    let Some(end) = file.len().checked_sub(TRAILER_BYTES).filter(|&end| end >= HEADER_BYTES) else { return };
    let put = |file: &mut [u8], at: usize, sum: u32| file[at..at + 4].copy_from_slice(&sum.to_le_bytes());
    let sum = crc32fast::hash(&file[..HEADER_BYTES - 4]);
    put(file, HEADER_BYTES - 4, sum);
    let long = |file: &[u8], at: usize| {
        let bytes = file.get(at..).and_then(|rest| rest.first_chunk());
        bytes.map_or(u64::MAX, |bytes| u64::from_le_bytes(*bytes))
    };
    let footer = usize::try_from(long(file, end)).unwrap_or(usize::MAX).min(end);
    let chunks = (long(file, end + 16) as u32 as usize).min((end - footer) / ENTRY_BYTES);
    let mut at = HEADER_BYTES;
    for chunk in 0..chunks {
        let entry = footer + chunk * ENTRY_BYTES;
        let len = usize::try_from(long(file, entry)).unwrap_or(usize::MAX);
        let Some(packed) = file.get(at..at.saturating_add(len)) else { break };
        let sum = crc32fast::hash(packed);
        put(file, entry + 8, sum);
        at += len;
    }
    let sum = crc32fast::hash(&file[footer..end]);
    put(file, end + 48, sum);
    let sum = crc32fast::hash(&file[end..end + 52]);
    put(file, end + 52, sum);
}

/// A mutated file; most of the time mended, and often with the length and the end that it should have.
fn file(random: &mut Random, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut file = random.mutation(seeds);
    if let Some(end) = file.len().checked_sub(TRAILER_BYTES)
        && random.once_in(2)
    {
        let len = (file.len() as u64).to_le_bytes();
        file[end + 40..end + 48].copy_from_slice(&len);
        file[end + 56..].copy_from_slice(b"OSTEND\r\n");
    }
    if !random.once_in(4) {
        mend(&mut file);
    }
    file
}

pub(crate) fn series(door: &'static str) -> Tally {
    let seeds = seeds();
    knock(
        door,
        |random| (file(random, &seeds), random.next() as u32),
        |(file, any)| {
            let accepted = Reader::new(Cursor::new(file), &LIMITS).is_ok_and(|mut reader| {
                let step = any % (reader.steps() + 1);
                if let Ok((chunk, within)) = reader.chunk_of(step) {
                    assert!(within < reader.codec().steps_per_chunk(), "a step of its chunk");
                    if let Ok(payload) = reader.read_chunk(chunk) {
                        assert_eq!(payload.len(), reader.shape().bytes(), "bytes of the shape");
                    }
                } else {
                    assert_eq!(step, reader.steps(), "every step has a chunk");
                }
                reader.verify().is_ok()
            });
            (accepted, LIMITS.decoded_bytes as usize)
        },
    )
}

/// A stream starts threads, so it is executed on a tenth of the files.
pub(crate) fn stream(door: &'static str) -> Tally {
    let seeds = seeds();
    let options = Options { threads: NonZeroUsize::MIN, capacity: NonZeroUsize::MIN };
    knock(
        door,
        |random| random.once_in(10).then(|| file(random, &seeds)),
        |file| {
            let Some(file) = file else { return (false, 0) };
            // With one thread and a capacity of one: two payloads, three packed, one of working memory.
            let allowed = 2 * LIMITS.decoded_bytes as usize + file.len();
            let Ok(reader) = Reader::new(Cursor::new(file.clone()), &LIMITS) else { return (false, allowed) };
            let chunks = reader.chunks();
            let mut stream = Stream::spawn(reader, options).unwrap();
            stream.play_from(0, Direction::Forward, Repeat::Once).unwrap();
            let mut played = 0;
            while !matches!(stream.wait(), Ok(None)) {
                played += 1;
            }
            assert_eq!(played, chunks, "each chunk comes, or its error");
            (true, allowed)
        },
    )
}
