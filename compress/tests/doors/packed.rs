//! The doors of the byte codecs.

use compress::Limits;
use compress::lossless::{ByteCodec, Form, PackOptions, Packer, Planes, Shape, unpack};

use crate::{Tally, knock};

/// Most bytes that a payload may take here, with its working memory.
const LIMITS: Limits = Limits { decoded_bytes: 1 << 16 };

const SHAPES: [(usize, usize, usize); 4] = [(1200, 4, 16), (30, 8, 4), (1, 4, 4), (0, 1, 1)];

fn shape((elements, first, second): (usize, usize, usize)) -> Shape {
    Shape::new(elements, first).then(elements, second)
}

/// Payloads of each shape.
const PAYLOADS: usize = 4;

/// Payloads of every kind, packed: [`PAYLOADS`] of each shape.
fn seeds(codec: ByteCodec) -> Vec<Vec<u8>> {
    let options = PackOptions { codec, planes: Some(Planes::AsIs), least_saving: -1.0, ..Default::default() };
    let mut packer = Packer::new(options).unwrap();
    let mut seeds = Vec::new();
    for shape in SHAPES.map(shape) {
        let bytes = shape.bytes();
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1664525).wrapping_add(1013904223);
            (state >> 24) as u8
        };
        let noisy: Vec<u8> = (0..bytes).map(|_| noise()).collect();
        let mixed: Vec<u8> = (0..bytes).map(|i| if i % 50 < 30 { (i / 9) as u8 } else { noise() }).collect();
        let payloads: [Vec<u8>; PAYLOADS] =
            [vec![9; bytes], noisy, mixed, (0..bytes).map(|i| (i % 7) as u8).collect()];
        for payload in payloads {
            seeds.push(packer.pack(&payload, shape).unwrap().bytes);
        }
    }
    seeds
}

fn byte_codec(door: &'static str, codec: ByteCodec) -> Tally {
    let seeds = seeds(codec);
    knock(
        door,
        |random| {
            let which = random.below(seeds.len());
            let packed = random.mutation_of(&seeds[which], &seeds);
            let shape = match random.next() % 8 {
                0 => Shape::new(random.next() as usize, random.below(40) + 1),
                1 => shape(*random.pick(&SHAPES)),
                _ => shape(SHAPES[which / PAYLOADS]),
            };
            (packed, shape, Form { codec, planes: *random.pick(&Planes::ALL) })
        },
        |(packed, shape, form)| {
            let payload = unpack(*form, *shape, packed, &LIMITS);
            if let Ok(payload) = &payload {
                assert_eq!(payload.len(), shape.bytes(), "bytes of the shape");
            }
            (payload.is_ok(), LIMITS.decoded_bytes as usize)
        },
    )
}

pub(crate) fn lzo(door: &'static str) -> Tally {
    byte_codec(door, ByteCodec::Lzo)
}

pub(crate) fn lz4(door: &'static str) -> Tally {
    byte_codec(door, ByteCodec::Lz4)
}

pub(crate) fn zstd(door: &'static str) -> Tally {
    byte_codec(door, ByteCodec::Zstd)
}

pub(crate) fn store(door: &'static str) -> Tally {
    byte_codec(door, ByteCodec::Store)
}
