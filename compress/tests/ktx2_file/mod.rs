//! KTX2 files as others see them: read by an independent crate, and broken in every byte.

use compress::bc::encode_volume;
use compress::ktx2::{
    KEY_RANGE, KEY_WORLD_FROM_VOXEL, KEY_WRITER, ReadError, Supercompression, Texture, TextureFormat,
    WriteError, read, write,
};
use compress::{BlockFormat, Extent3, Limits};

use crate::phantom;

const ZSTD: Supercompression = Supercompression::Zstd { level: 3 };

/// A texture of any format: part of a CT-like volume.
fn texture(format: TextureFormat, sizes: [u32; 3]) -> Texture {
    let extent = Extent3::new(sizes).unwrap();
    let hu = phantom::hounsfield(extent);
    let data = match format {
        TextureFormat::Block(BlockFormat::Bc4) => {
            encode_volume(BlockFormat::Bc4, &phantom::scalar(&hu), extent).unwrap()
        }
        TextureFormat::Block(format) => encode_volume(format, &phantom::colour(&hu), extent).unwrap(),
        TextureFormat::R8 => phantom::scalar(&hu),
        TextureFormat::R16 => hu.iter().flat_map(|hu| ((hu + 2000.0) as u16).to_le_bytes()).collect(),
        TextureFormat::Rgba8 => phantom::colour(&hu),
    };
    let mut texture = Texture::new(format, extent, data);
    texture.set_text(KEY_WORLD_FROM_VOXEL, "0.7 0 0 -90 0 0.7 0 -120 0 0 2.5 40 0 0 0 1");
    texture.set_text(KEY_RANGE, "-1024 3071");
    texture
}

fn file(texture: &Texture, supercompression: Supercompression) -> Vec<u8> {
    let mut file = Vec::new();
    write(&mut file, texture, supercompression).unwrap();
    file
}

/// The word at a place in a file's header.
fn word(file: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(file[at..at + 4].try_into().unwrap())
}

#[test]
fn every_format_is_read_block_for_block_by_an_independent_reader() {
    for format in TextureFormat::ALL {
        for supercompression in [Supercompression::None, ZSTD] {
            for sizes in [[16, 12, 5], [7, 5, 3], [1, 1, 1]] {
                let texture = texture(format, sizes);
                let reader = ktx2::Reader::new(file(&texture, supercompression)).unwrap();
                let header = reader.header();
                let case = format!("{format:?} {supercompression:?} {sizes:?}");
                assert_eq!(header.format.map(|format| format.value()), Some(format.vk_format()), "{case}");
                assert_eq!([header.pixel_width, header.pixel_height, header.pixel_depth], sizes, "{case}");
                let counts = (header.layer_count, header.face_count, header.level_count);
                assert_eq!(counts, (0, 1, 1), "{case}: layers, faces, levels");

                let levels: Vec<_> = reader.levels().collect();
                let [level] = levels.as_slice() else { unreachable!("{case}: {} levels", levels.len()) };
                let unpacked = match header.supercompression_scheme {
                    None => level.data.to_vec(),
                    Some(scheme) => {
                        assert_eq!(scheme, ktx2::SupercompressionScheme::Zstandard, "{case}");
                        zstd::decode_all(level.data).unwrap()
                    }
                };
                assert_eq!(level.uncompressed_byte_length, unpacked.len() as u64, "{case}");
                let element = format.element_bytes();
                assert_eq!(unpacked.len() % element, 0, "{case}: whole elements");
                for (i, (found, expected)) in
                    unpacked.chunks_exact(element).zip(texture.data.chunks_exact(element)).enumerate()
                {
                    assert_eq!(found, expected, "{case}: element {i}");
                }
                assert_eq!(unpacked.len(), texture.data.len(), "{case}: length");
            }
        }
    }
}

#[test]
fn the_descriptor_is_what_an_independent_crate_makes_of_the_format() {
    for format in TextureFormat::ALL {
        let reader = ktx2::Reader::new(file(&texture(format, [8, 8, 2]), ZSTD)).unwrap();
        let vk_format = reader.header().format.unwrap();
        let (basic, type_size) = ktx2::dfd::Basic::from_format(vk_format).unwrap();
        assert_eq!(reader.header().type_size, type_size, "{format:?}");
        assert_eq!(reader.dfd_blocks(), [ktx2::dfd::Block::Basic(basic)], "{format:?}");
    }
}

#[test]
fn offsets_keep_the_rules_of_the_standard() {
    for format in TextureFormat::ALL {
        for supercompression in [Supercompression::None, ZSTD] {
            let file = file(&texture(format, [7, 5, 3]), supercompression);
            let index = ktx2::Reader::new(file.as_slice()).unwrap().header().index;
            assert_eq!(index.dfd_byte_offset, 80 + 24, "{format:?}: the descriptor follows the level index");
            assert_eq!(word(&file, 104), index.dfd_byte_length, "{format:?}: its total size is its length");
            assert_eq!(index.kvd_byte_offset, 104 + index.dfd_byte_length, "{format:?}: the entries follow");
            assert_eq!((index.sgd_byte_offset, index.sgd_byte_length), (0, 0), "{format:?}: no global data");
            let entries_end = index.kvd_byte_offset + index.kvd_byte_length;
            let level_at = word(&file, 80);
            let element = format.element_bytes() as u32;
            if supercompression == Supercompression::None {
                assert_eq!((level_at % element, level_at % 4), (0, 0), "{format:?}: the level is aligned");
                assert!(level_at - entries_end < element.max(4), "{format:?}: by no more than it needs");
            } else {
                assert_eq!(level_at, entries_end, "{format:?}: a packed level is not aligned");
            }
            assert_eq!(
                level_at as usize + word(&file, 88) as usize,
                file.len(),
                "{format:?}: the level is last"
            );
        }
    }
}

#[test]
fn entries_are_sorted_by_key_and_say_who_wrote_the_file() {
    let mut texture = texture(TextureFormat::R8, [4, 4, 4]);
    texture.entries.insert("Zusatz".to_owned(), vec![1, 0, 2]);
    texture.entries.insert("ä".to_owned(), Vec::new());
    let reader = ktx2::Reader::new(file(&texture, Supercompression::None)).unwrap();
    let keys: Vec<&str> = reader.key_value_data().map(|(key, _)| key).collect();
    assert_eq!(keys, [KEY_WRITER, "Zusatz", KEY_RANGE, KEY_WORLD_FROM_VOXEL, "ä"], "keys by code point");
    assert!(reader.writer().unwrap().starts_with("osteotome"), "{:?}", reader.writer());
    let value =
        |key| reader.key_value_data().find(|(found, _)| *found == key).map(|(_, value)| value.to_vec());
    assert_eq!(value(KEY_RANGE), Some(b"-1024 3071\0".to_vec()), "text ends with a zero byte");
    assert_eq!(value("Zusatz"), Some(vec![1, 0, 2]), "bytes stay as they are");
}

#[test]
fn our_reader_gives_back_what_was_written() {
    for format in TextureFormat::ALL {
        for supercompression in [Supercompression::None, ZSTD] {
            let mut texture = texture(format, [9, 6, 4]);
            let back = read(&file(&texture, supercompression), &Limits::default()).unwrap();
            assert_eq!(back.text(KEY_RANGE), Some("-1024 3071"), "text without its zero byte");
            let writer = back.text(KEY_WRITER).unwrap();
            texture.set_text(KEY_WRITER, writer);
            assert_eq!(back, texture, "{format:?} {supercompression:?}");
        }
    }
}

#[test]
fn a_packed_file_with_any_byte_changed_is_refused_or_reads_the_same_volume() {
    let texture = texture(TextureFormat::Block(BlockFormat::Bc3), [8, 8, 3]);
    let original = file(&texture, ZSTD);
    let mut refused = 0;
    for at in 0..original.len() {
        let mut file = original.clone();
        for value in 0..=255 {
            file[at] = value;
            match read(&file, &Limits::default()) {
                // Entries may say anything; of the extent, what the same blocks cover.
                Ok(back) => {
                    assert_eq!(back.data, texture.data, "byte {at} = {value}");
                    assert_eq!(back.format, texture.format, "byte {at} = {value}");
                    assert_eq!(back.extent.blocks(), texture.extent.blocks(), "byte {at} = {value}");
                }
                Err(error) => {
                    assert!(!error.to_string().is_empty(), "byte {at} = {value}");
                    refused += 1;
                }
            }
        }
    }
    println!("{refused} of {} changes refused", original.len() * 255);
    assert!(refused > original.len() * 255 / 2, "only {refused} changes were noticed");
}

#[test]
fn a_plain_file_with_any_byte_changed_never_brings_the_reader_down() {
    let texture = texture(TextureFormat::R16, [5, 4, 3]);
    let original = file(&texture, Supercompression::None);
    let level_at = word(&original, 80) as usize;
    for at in 0..level_at {
        let mut file = original.clone();
        for value in 0..=255 {
            file[at] = value;
            if let Ok(back) = read(&file, &Limits::default()) {
                assert_eq!(back.data.len(), texture.data.len(), "byte {at} = {value}");
            }
        }
    }
}

#[test]
fn a_file_cut_off_anywhere_is_refused() {
    for supercompression in [Supercompression::None, ZSTD] {
        let file = file(&texture(TextureFormat::Block(BlockFormat::Bc4), [8, 8, 2]), supercompression);
        for len in 0..file.len() {
            let error = read(&file[..len], &Limits::default()).unwrap_err();
            let cut_off = matches!(error, ReadError::Truncated { .. } | ReadError::Identifier);
            assert!(cut_off, "{len} of {} bytes: {error:?}", file.len());
        }
    }
}

#[test]
fn broken_files_give_errors_that_name_the_fault() {
    let original = file(&texture(TextureFormat::Block(BlockFormat::Bc4), [8, 8, 2]), ZSTD);
    let entries_at = word(&original, 56) as usize;
    let level_at = word(&original, 80) as usize;
    type Expected = fn(&ReadError) -> bool;
    let unsupported: Expected = |error| matches!(error, ReadError::Unsupported { .. });
    let invalid: Expected = |error| matches!(error, ReadError::Invalid { .. });
    let cases: [(&str, usize, u32, Expected); 17] = [
        ("identifier", 0, 0, |error| matches!(error, ReadError::Identifier)),
        ("vkFormat BC2", 12, 135, unsupported),
        ("vkFormat BC1, descriptor BC4", 12, 133, |error| matches!(error, ReadError::Descriptor { .. })),
        ("typeSize", 16, 2, invalid),
        ("pixelWidth 0", 20, 0, invalid),
        ("a 2D texture", 28, 0, unsupported),
        ("a wider volume", 20, 16, |error| matches!(error, ReadError::LevelLength { .. })),
        ("a huge volume", 20, 1 << 31, |error| matches!(error, ReadError::TooLarge { .. })),
        ("layers", 32, 2, unsupported),
        ("faces", 36, 6, invalid),
        ("too many levels", 40, 5, invalid),
        ("no level", 40, 0, invalid),
        ("zlib", 44, 3, unsupported),
        ("descriptor far away", 48, u32::MAX, |error| matches!(error, ReadError::Truncated { .. })),
        ("global data", 72, 8, invalid),
        ("entry too long", entries_at, 1 << 30, |error| matches!(error, ReadError::Entry { .. })),
        ("zstd frame", level_at, 0, |error| matches!(error, ReadError::Zstd(_))),
    ];
    for (name, at, value, expected) in cases {
        let mut file = original.clone();
        file[at..at + 4].copy_from_slice(&value.to_le_bytes());
        let error = read(&file, &Limits::default()).unwrap_err();
        assert!(expected(&error), "{name}: {error:?}");
        println!("{name}: {error}");
    }
    // All three sizes at their largest: no product of them overflows.
    let mut file = original;
    file[20..32].fill(0xFF);
    let error = read(&file, &Limits::default()).unwrap_err();
    assert!(matches!(error, ReadError::Extent(_)), "{error:?}");
}

#[test]
fn a_small_file_that_claims_a_large_volume_is_refused_before_memory_is_taken() {
    let mut file = file(&texture(TextureFormat::Block(BlockFormat::Bc4), [8, 8, 2]), ZSTD);
    for (at, size) in [(20, 1 << 20), (24, 1 << 20), (28, 1 << 10)] {
        file[at..at + 4].copy_from_slice(&u32::to_le_bytes(size));
    }
    file[96..104].copy_from_slice(&(1_u64 << 49).to_le_bytes());
    let limits = Limits::default();
    let error = read(&file, &limits).unwrap_err();
    let refused = matches!(error, ReadError::TooLarge { bytes, limit } if bytes == 1 << 49 && limit == limits.decoded_bytes);
    assert!(refused, "{error:?}");
}

#[test]
fn the_first_of_several_levels_is_read() {
    let texture = texture(TextureFormat::R8, [4, 4, 4]);
    let plain = file(&texture, Supercompression::None);
    // A second level of one byte, put before the first: every offset moves by its 24 bytes of index, and the
    // first level stays aligned.
    let head = 80 + 24;
    let mut two = plain[..head].to_vec();
    two[40] = 2;
    for at in [48, 56] {
        let moved = word(&plain, at) + 24;
        two[at..at + 4].copy_from_slice(&moved.to_le_bytes());
    }
    let first_at = u64::from(word(&plain, 80)) + 24;
    two[80..88].copy_from_slice(&first_at.to_le_bytes());
    for word in [plain.len() as u64 + 24, 1, 1] {
        two.extend(word.to_le_bytes());
    }
    two.extend(&plain[head..]);
    two.push(7);
    let back = read(&two, &Limits::default()).unwrap();
    assert_eq!((back.extent, back.data), (texture.extent, texture.data), "the first level");
}

#[test]
fn what_a_file_cannot_hold_is_refused_by_name() {
    let mut output = Vec::new();
    let mut short = texture(TextureFormat::R16, [4, 4, 4]);
    short.data.pop();
    let error = write(&mut output, &short, ZSTD).unwrap_err();
    assert!(matches!(error, WriteError::Length { expected: 128, found: 127 }), "{error:?}");
    for key in ["", "a\0b", "KTXmine", "ktxmine"] {
        let mut texture = texture(TextureFormat::R8, [1, 1, 1]);
        texture.set_text(key, "value");
        let error = write(&mut output, &texture, ZSTD).unwrap_err();
        assert!(matches!(&error, WriteError::Key { key: found } if found == key), "{error:?}");
    }
    for level in [0, 23, -1] {
        let plain = texture(TextureFormat::R8, [1, 1, 1]);
        let error = write(&mut output, &plain, Supercompression::Zstd { level }).unwrap_err();
        assert!(matches!(error, WriteError::Zstd { .. }), "level {level}: {error:?}");
    }
    assert!(output.is_empty(), "nothing is written of what is refused");
}
