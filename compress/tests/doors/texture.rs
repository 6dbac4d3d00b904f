//! The door of KTX2 files.

use compress::ktx2::{Supercompression, Texture, TextureFormat, read, write};
use compress::{Extent3, Limits};

use crate::{Tally, knock};

/// Most bytes that a file may unpack to here.
const LIMITS: Limits = Limits { decoded_bytes: 1 << 16 };

fn seeds() -> Vec<Vec<u8>> {
    let extent = Extent3::new([6, 5, 3]).unwrap();
    let mut seeds = Vec::new();
    for format in TextureFormat::ALL {
        for packing in [Supercompression::None, Supercompression::Zstd { level: 3 }] {
            let data = (0..format.data_len(extent)).map(|i| (i / 7) as u8).collect();
            let mut texture = Texture::new(format, extent, data);
            texture.set_text("osteotome.range", "-1024 3071");
            let mut file = Vec::new();
            write(&mut file, &texture, packing).unwrap();
            seeds.push(file);
        }
    }
    seeds
}

pub(crate) fn ktx2(door: &'static str) -> Tally {
    let seeds = seeds();
    knock(
        door,
        |random| random.mutation(&seeds),
        |file| {
            let texture = read(file, &LIMITS);
            if let Ok(texture) = &texture {
                assert_eq!(texture.data.len(), texture.format.data_len(texture.extent), "data of the extent");
            }
            // The level within the limit; the entries, which are copied from the file.
            (texture.is_ok(), LIMITS.decoded_bytes as usize + 2 * file.len())
        },
    )
}
