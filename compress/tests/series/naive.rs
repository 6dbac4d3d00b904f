//! A reader of series straight from the format page, sharing no code with the crate: slow, and without checks.

use compress::container::StepCodec;
use compress::lossless::ByteCodec;

use super::{codecs, header, payload, series, time_secs};

fn int(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// Elements of the payload, each run with the bytes of one of its elements.
fn runs([x, y, z]: [u64; 3], [id, s, _]: [u8; 3]) -> Vec<(u64, u64)> {
    let tiles = x.div_ceil(4) * y.div_ceil(4);
    match id {
        0 => vec![(x * y * z, 1)],
        1 => vec![(x * y * z, 2)],
        2 => {
            let n = tiles * z.div_ceil(s.into());
            vec![(n, 4), (n, 4 * u64::from(s))]
        }
        3 => vec![(tiles * z, 8)],
        _ => vec![(tiles * z.div_ceil(3), 8)],
    }
}

/// Joins planes, byte by byte.
fn join(planar: &[u8], planes: u8, runs: &[(u64, u64)]) -> Vec<u8> {
    let mut payload = Vec::new();
    for &(elements, bytes) in runs {
        let at = payload.len() as u64;
        let unit = match planes {
            1 if bytes % 4 == 0 => 4,
            2 => 1,
            _ => bytes,
        };
        for element in 0..elements {
            for byte in 0..bytes {
                let plane = byte / unit;
                let place = at + plane * elements * unit + element * unit + byte % unit;
                payload.push(planar[place as usize]);
            }
        }
    }
    payload
}

/// Payloads, times, largest error and PSNR of a series.
fn read(file: &[u8]) -> (Vec<Vec<u8>>, Vec<f64>, [f64; 2]) {
    let extent = [16, 20, 24].map(|at| int(&file[at..at + 4]));
    let runs = runs(extent, file[28..31].try_into().unwrap());
    let len: u64 = runs.iter().map(|(elements, bytes)| elements * bytes).sum();
    let trailer = &file[file.len() - 64..];
    let footer = &file[int(&trailer[..8]) as usize..];
    let chunks = int(&trailer[16..20]) as usize;
    let steps = int(&trailer[20..24]) as usize;
    let mut at = 512;
    let payloads = footer.chunks(16).take(chunks).map(|entry| {
        let packed = &file[at..at + int(&entry[..8]) as usize];
        at += packed.len();
        let planar = match entry[12] {
            0 => packed.to_vec(),
            1 => {
                let mut planar = vec![0; len as usize];
                lzo::decompress_into(packed, &mut planar).unwrap();
                planar
            }
            2 => lz4_flex::block::decompress(packed, len as usize).unwrap(),
            _ => zstd::bulk::decompress(packed, len as usize).unwrap(),
        };
        join(&planar, entry[13], &runs)
    });
    let payloads = payloads.collect();
    let float = |bytes: &[u8]| f64::from_bits(int(bytes));
    let times = footer[16 * chunks..].chunks(8).take(steps).map(float).collect();
    (payloads, times, [float(&trailer[24..32]), float(&trailer[32..40])])
}

#[test]
fn a_reader_made_from_the_format_page_alone_reads_what_is_written() {
    for codec in codecs() {
        for byte_codec in ByteCodec::ALL {
            let header = header([21, 10, 7], codec, byte_codec);
            let (payloads, times, figures) = read(&series(&header, 6));
            assert_eq!(times, (0..6).map(time_secs).collect::<Vec<_>>(), "times of {codec}");
            assert_eq!(figures, [7.5, 41.25], "figures");
            let chunks = 6_usize.div_ceil(codec.steps_per_chunk().into());
            assert_eq!(payloads.len(), chunks, "chunks of {codec}");
            for (chunk, read) in (0..).zip(&payloads) {
                assert!(*read == payload(chunk, read.len()), "chunk {chunk} of {codec}, {byte_codec:?}");
            }
        }
    }
}

#[test]
fn files_of_version_1_are_read_for_ever() {
    let files: [(&[u8], ByteCodec); 4] = [
        (include_bytes!("golden/v1_store.series"), ByteCodec::Store),
        (include_bytes!("golden/v1_lzo.series"), ByteCodec::Lzo),
        (include_bytes!("golden/v1_lz4.series"), ByteCodec::Lz4),
        (include_bytes!("golden/v1_zstd.series"), ByteCodec::Zstd),
    ];
    for (file, byte_codec) in files {
        let mut reader = super::open(file);
        let codec = StepCodec::Pvtc(compress::pvtc::Layout::new(4, 3).unwrap());
        assert_eq!(reader.header(), &header([13, 9, 6], codec, byte_codec), "header");
        assert_eq!(reader.figures(), super::FIGURES, "figures");
        for chunk in 0..3 {
            let read = reader.read_chunk(chunk).unwrap();
            assert!(read == payload(chunk, read.len()), "chunk {chunk}, {byte_codec:?}");
        }
    }
}
