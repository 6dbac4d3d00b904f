//! Textures from samples: against the same in two steps, with everything that may not change a byte changed.

use compress::bc::{EncodeOptions, Level, decode_volume, encode_volume_with};
use compress::texture::{
    Bricks, ColourPoint, ColourTable, Mapping, SampleKind, Samples, Source, TexelFormat, TextureError,
    Volume, Window,
};
use compress::{BlockFormat, Extent3};

use crate::phantom;

/// HU, red, green, blue, opacity: bone with a bend, a jump and a clear stretch between seen ones.
const POINTS: [[f64; 5]; 8] = [
    [-1024.0, 0.0, 0.0, 0.0, 0.0],
    [-150.0, 0.9, 0.7, 0.4, 0.0],
    [-60.0, 0.8, 0.5, 0.3, 0.1],
    [-20.0, 0.8, 0.2, 0.2, 0.0],
    [90.0, 0.3, 0.2, 0.8, 0.0],
    [200.0, 0.9, 0.8, 0.6, 0.3],
    [600.0, 1.0, 0.9, 0.8, 0.7],
    [600.0, 1.0, 1.0, 1.0, 0.9],
];

/// A grid that is in no direction a multiple of a block, a group of blocks or a brick.
const SIZES: [u32; 3] = [61, 45, 7];

fn points() -> Vec<ColourPoint> {
    POINTS.iter().map(|&[value, r, g, b, a]| ColourPoint { value, rgba: [r, g, b, a] }).collect()
}

fn extent(sizes: [u32; 3]) -> Extent3 {
    Extent3::new(sizes).unwrap()
}

fn hounsfield() -> Vec<i16> {
    phantom::hounsfield(extent(SIZES)).iter().map(|hu| hu.round() as i16).collect()
}

fn table() -> ColourTable {
    ColourTable::new(&points(), SampleKind::I16, 0.0).unwrap()
}

fn options(level: Level) -> EncodeOptions {
    EncodeOptions::default().with_level(level)
}

/// The transfer function as the renderer defines it.
fn rgba(value: f64) -> [f64; 4] {
    let points = points();
    let after = points.partition_point(|point| point.value <= value);
    let below = points[after.saturating_sub(1)];
    if after == 0 || after == points.len() {
        return below.rgba;
    }
    let above = points[after];
    let part = (value - below.value) / (above.value - below.value);
    std::array::from_fn(|c| below.rgba[c] + (above.rgba[c] - below.rgba[c]) * part)
}

/// The largest error and the sum of squares of premultiplied colour and opacity, in 1/255.
fn premultiplied_error(samples: &[i16], decoded: &[u8]) -> (f64, f64) {
    let premultiplied = |[r, g, b, a]: [f64; 4]| [r * a, g * a, b * a, a].map(|c| c * 255.0);
    let mut error = (0.0_f64, 0.0);
    for (sample, texel) in samples.iter().zip(decoded.as_chunks::<4>().0) {
        let (truth, found) =
            (premultiplied(rgba(f64::from(*sample))), premultiplied(texel.map(|c| f64::from(c) / 255.0)));
        for (truth, found) in truth.iter().zip(found) {
            let off = (truth - found).abs();
            error = (error.0.max(off), error.1 + off * off);
        }
    }
    error
}

#[test]
fn uncompressed_colours_are_the_rounded_transfer_function_of_each_sample() {
    let (samples, table) = (hounsfield(), table());
    let volume = Volume::new(Samples::I16(&samples), extent(SIZES)).unwrap();
    let texels = Source::new(volume, Mapping::Colours(&table)).unwrap().texels(TexelFormat::Rgba8).unwrap();
    for (sample, texel) in samples.iter().zip(texels.as_chunks::<4>().0) {
        for (component, truth) in texel.iter().zip(rgba(f64::from(*sample))) {
            assert!((f64::from(*component) - truth * 255.0).abs() < 0.5 + 1e-9, "{sample}: {texel:?}");
        }
    }
}

#[test]
fn the_best_blocks_are_those_of_the_uncompressed_texture_but_for_clear_ones_which_show_nothing() {
    let (samples, table) = (hounsfield(), table());
    let volume = Volume::new(Samples::I16(&samples), extent(SIZES)).unwrap();
    let source = Source::new(volume, Mapping::Colours(&table)).unwrap();
    let texels = source.texels(TexelFormat::Rgba8).unwrap();
    let two_steps =
        encode_volume_with(BlockFormat::Bc3, &texels, extent(SIZES), options(Level::Best)).unwrap();
    let (blocks, stats) = source.blocks(BlockFormat::Bc3, options(Level::Best)).unwrap();
    let mut constant = 0;
    for (i, (found, expected)) in
        blocks.as_chunks::<16>().0.iter().zip(two_steps.as_chunks::<16>().0).enumerate()
    {
        if found != expected {
            let alpha = u64::from_le_bytes(*found.first_chunk().unwrap());
            assert_eq!((alpha, &expected[..8]), (0, &[0; 8][..]), "block {i} is seen, and differs");
            constant += 1;
        }
    }
    assert!(constant > 0 && constant <= stats.clear, "{constant} of {stats:?}");
}

#[test]
fn nothing_that_only_saves_time_changes_a_byte() {
    let (samples, table) = (hounsfield(), table());
    let grid = extent([61, 45, 7]);
    let volume = Volume::new(Samples::I16(&samples), grid).unwrap();
    // A box whose blocks do not lie on those of the grid.
    let part = volume.part([3, 2, 1], extent([50, 41, 5])).unwrap();
    let edge = 8_usize;
    let count = SIZES.map(|n| (n as usize).div_ceil(edge));
    let ranges: Vec<[f64; 2]> = (0..count.iter().product())
        .map(|b: usize| {
            let at = [b % count[0], b / count[0] % count[1], b / (count[0] * count[1])];
            let mut range = [f64::INFINITY, f64::NEG_INFINITY];
            for (i, sample) in samples.iter().enumerate() {
                let voxel = [i % 61, i / 61 % 45, i / (61 * 45)];
                if (0..3).all(|axis| voxel[axis] / edge == at[axis]) {
                    range = [range[0].min(f64::from(*sample)), range[1].max(f64::from(*sample))];
                }
            }
            range
        })
        .collect();
    let window = Window::new([-300.0, 900.0], SampleKind::I16, 0.0).unwrap();
    let formats = [
        (BlockFormat::Bc3, Mapping::Colours(&table), Level::Fast),
        (BlockFormat::Bc3, Mapping::Colours(&table), Level::Best),
        (BlockFormat::Bc7, Mapping::Colours(&table), Level::Fast),
        (BlockFormat::Bc7, Mapping::Colours(&table), Level::Best),
        (BlockFormat::Bc4, Mapping::Scalars(&window), Level::Best),
    ];
    for (format, mapping, level) in formats {
        let source = Source::new(part, mapping).unwrap();
        let (blocks, all) = source.blocks(format, options(level)).unwrap();
        for threads in [1, 4] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let again = pool.install(|| source.blocks(format, options(level)).unwrap());
            assert_eq!(again, (blocks.clone(), all), "{format:?} {level:?} with {threads} threads");
        }
        let bricks = Bricks { edge: edge as u32, ranges: &ranges };
        let skipping = Source::new(part, mapping).unwrap().with_bricks(bricks).unwrap();
        let (skipped, stats) = skipping.blocks(format, options(level)).unwrap();
        assert!(skipped == blocks, "{format:?} {level:?} with bricks");
        assert!(stats.skipped > 0, "bricks are skipped: {stats:?}");
        assert_eq!(
            stats.skipped + stats.clear + stats.solid,
            all.clear + all.solid,
            "what is skipped would be constant: {stats:?} {all:?}"
        );
        // Blocks of the cut-out alone, which is a volume of its own here.
        let copy: Vec<i16> = (0..5 * 41 * 50)
            .map(|i| samples[((i / (41 * 50) + 1) * 45 + i / 50 % 41 + 2) * 61 + i % 50 + 3])
            .collect();
        let alone = Volume::new(Samples::I16(&copy), extent([50, 41, 5])).unwrap();
        let alone = Source::new(alone, mapping).unwrap().blocks(format, options(level)).unwrap();
        assert!(alone.0 == blocks, "{format:?} {level:?} of a box of a larger grid");
    }
}

#[test]
fn a_patch_after_a_change_is_what_the_whole_would_have_there() {
    let (before, table) = (hounsfield(), table());
    let mut after = before.clone();
    // Painted: from [30, 41, 2] to before [61, 45, 5], which is to the far edge.
    for z in 2..5 {
        for y in 41..45 {
            after[(z * 45 + y) * 61 + 30..(z * 45 + y) * 61 + 61].fill(700);
        }
    }
    let window = Window::new([-1000.0, 2000.0], SampleKind::I16, 0.0).unwrap();
    let [colours, scalars] = [Mapping::Colours(&table), Mapping::Scalars(&window)];
    let source = |samples, mapping| {
        Source::new(Volume::new(Samples::I16(samples), extent(SIZES)).unwrap(), mapping).unwrap()
    };
    for (format, mapping) in
        [(BlockFormat::Bc3, colours), (BlockFormat::Bc7, colours), (BlockFormat::Bc4, scalars)]
    {
        for level in [Level::Fast, Level::Best] {
            let (mut patched, _) = source(&before, mapping).blocks(format, options(level)).unwrap();
            let source = source(&after, mapping);
            let (whole, _) = source.blocks(format, options(level)).unwrap();
            let patch = source.blocks_of(format, options(level), [30, 41, 2]..[61, 45, 5]).unwrap();
            assert_eq!((patch.low, patch.size), ([28, 40, 2], [36, 8, 3]), "whole blocks");
            let bytes = format.block_bytes();
            let row = patch.size[0] as usize / 4 * bytes;
            for (i, line) in patch.blocks.chunks_exact(row).enumerate() {
                let (y, z) = (i % 2 + 10, i / 2 + 2);
                let at = ((z * 12 + y) * 16 + 7) * bytes;
                patched[at..at + row].copy_from_slice(line);
            }
            assert!(patched == whole, "patched blocks of {format:?} at {level:?}");
            let far = source.blocks_of(format, options(level), [61, 0, 0]..[70, 4, 4]);
            assert!(matches!(far, Err(TextureError::Outside { .. })), "outside: {far:?}");
        }
    }
}

#[test]
fn the_loss_is_that_of_the_decoded_texture() {
    let (samples, table) = (hounsfield(), table());
    let volume = Volume::new(Samples::I16(&samples), extent(SIZES)).unwrap();
    let source = Source::new(volume, Mapping::Colours(&table)).unwrap();
    let both = [Level::Fast, Level::Best];
    for (format, level) in both.into_iter().flat_map(|l| [(BlockFormat::Bc3, l), (BlockFormat::Bc7, l)]) {
        let (blocks, _) = source.blocks(format, options(level)).unwrap();
        let decoded = decode_volume(format, &blocks, extent(SIZES)).unwrap();
        let (largest, squares) = premultiplied_error(&samples, &decoded);
        let loss = source.loss_of_blocks(format, &blocks).unwrap();
        assert!((loss.largest - largest).abs() < 1e-3, "largest {} {largest}", loss.largest);
        assert!((loss.squares / squares - 1.0).abs() < 1e-4, "squares {} {squares}", loss.squares);
        assert_eq!(loss.samples, 4 * samples.len() as u64, "four a voxel");
    }
    let texels = source.texels(TexelFormat::Rgba8).unwrap();
    let (largest, squares) = premultiplied_error(&samples, &texels);
    let loss = source.loss_of_texels(TexelFormat::Rgba8).unwrap();
    assert!((loss.largest - largest).abs() < 1e-3, "largest of texels {} {largest}", loss.largest);
    assert!((loss.squares / squares - 1.0).abs() < 1e-4, "squares of texels {} {squares}", loss.squares);
}

#[test]
fn fast_blocks_are_within_two_decibels_of_the_best() {
    let (samples, table) = (hounsfield(), table());
    let volume = Volume::new(Samples::I16(&samples), extent(SIZES)).unwrap();
    let source = Source::new(volume, Mapping::Colours(&table)).unwrap();
    let [fast, best] = [Level::Fast, Level::Best].map(|level| {
        let (blocks, stats) = source.blocks(BlockFormat::Bc3, options(level)).unwrap();
        assert_eq!(stats.curve > 0, level == Level::Fast, "{stats:?}");
        source.loss_of_blocks(BlockFormat::Bc3, &blocks).unwrap().psnr_db(255.0)
    });
    println!("fast {fast:.2} dB, best {best:.2} dB");
    assert!(fast > best - 2.0, "fast {fast:.2} dB, best {best:.2} dB");
}

#[test]
fn every_kind_of_sample_gives_the_same_blocks_for_the_same_values() {
    let samples: Vec<i16> = hounsfield().iter().map(|hu| (hu / 8 + 128).clamp(0, 255)).collect();
    let bytes: Vec<u8> = samples.iter().map(|v| *v as u8).collect();
    let words: Vec<u16> = samples.iter().map(|v| *v as u16).collect();
    let points: Vec<ColourPoint> = points()
        .iter()
        .map(|point| ColourPoint { value: (point.value / 8.0 + 128.0).round(), ..*point })
        .collect();
    let encoded = |samples: Samples<'_>| {
        let table = ColourTable::new(&points, samples.kind(), 0.0).unwrap();
        let volume = Volume::new(samples, extent(SIZES)).unwrap();
        let source = Source::new(volume, Mapping::Colours(&table)).unwrap();
        let (blocks, _) = source.blocks(BlockFormat::Bc3, options(Level::Best)).unwrap();
        (blocks, source.texels(TexelFormat::Rgba8).unwrap())
    };
    let (blocks, texels) = encoded(Samples::I16(&samples));
    assert!(encoded(Samples::U8(&bytes)) == (blocks.clone(), texels.clone()), "8 bits");
    assert!(encoded(Samples::U16(&words)) == (blocks, texels.clone()), "16 bits without sign");
    let floats: Vec<f32> = samples.iter().map(|v| f32::from(*v)).collect();
    let (_, of_floats) = encoded(Samples::F32(&floats));
    for (i, (whole, float)) in texels.iter().zip(&of_floats).enumerate() {
        // The nearest of 65536 steps; where the function jumps, at 600 HU, it may be on the other side.
        let at_jump = samples[i / 4] == 203;
        assert!(
            at_jump || whole.abs_diff(*float) <= 1,
            "{} of {}: {float}, not {whole}",
            i % 4,
            samples[i / 4]
        );
    }
}

#[test]
fn what_is_not_finite_counts_as_the_padding() {
    let samples = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 250.0, 1e30, -1e30, 600.0, 100.0];
    let table = ColourTable::new(&points(), SampleKind::F32, 300.0).unwrap();
    let volume = Volume::new(Samples::F32(&samples), extent([8, 1, 1])).unwrap();
    let texels = Source::new(volume, Mapping::Colours(&table)).unwrap().texels(TexelFormat::Rgba8).unwrap();
    let texels = texels.as_chunks::<4>().0;
    let expected = |value| rgba(value).map(|c| (c * 255.0).round() as i32);
    for (i, value) in [300.0, 300.0, 300.0, 250.0, 1e30, -1e30].into_iter().enumerate() {
        for (found, expected) in texels[i].iter().zip(expected(value)) {
            assert!((i32::from(*found) - expected).abs() <= 1, "sample {i}: {:?}", texels[i]);
        }
    }
}

#[test]
fn windows_keep_whole_numbers_in_16_bits_and_round_in_8() {
    let samples: Vec<i16> = (0..4096).map(|i| i - 1024).collect();
    let window = Window::new([-1000.0, 2000.0], SampleKind::I16, 0.0).unwrap();
    let volume = Volume::new(Samples::I16(&samples), extent([16, 16, 16])).unwrap();
    let source = Source::new(volume, Mapping::Scalars(&window)).unwrap();
    let (words, bytes) = (source.texels(TexelFormat::R16).unwrap(), source.texels(TexelFormat::R8).unwrap());
    for (i, sample) in samples.iter().enumerate() {
        let clamped = (*sample).clamp(-1000, 2000);
        assert_eq!(u16::from_le_bytes([words[2 * i], words[2 * i + 1]]), (clamped + 1000) as u16, "{sample}");
        let value = -1000.0 + 3000.0 * f64::from(bytes[i]) / 255.0;
        assert!((value - f64::from(clamped)).abs() <= 3000.0 / 510.0 + 1e-3, "{sample}: {value}");
    }
    assert_eq!(source.loss_of_texels(TexelFormat::R16).unwrap().largest, 0.0, "nothing is lost");
    assert!(source.loss_of_texels(TexelFormat::R8).unwrap().largest <= 3000.0 / 510.0 + 1e-3, "half a step");
    let (blocks, _) = source.blocks(BlockFormat::Bc4, EncodeOptions::default()).unwrap();
    let decoded = decode_volume(BlockFormat::Bc4, &blocks, extent([16, 16, 16])).unwrap();
    let largest = samples.iter().zip(&decoded).map(|(sample, texel)| {
        let value = -1000.0 + 3000.0 * f64::from(*texel) / 255.0;
        (value - f64::from((*sample).clamp(-1000, 2000))).abs()
    });
    let loss = source.loss_of_blocks(BlockFormat::Bc4, &blocks).unwrap();
    assert!((loss.largest - largest.fold(0.0, f64::max)).abs() < 1e-2, "{loss:?}");
}

#[test]
fn an_opaque_table_makes_bc1_of_what_it_colours() {
    let samples = hounsfield();
    let table = ColourTable::opaque(&points(), SampleKind::I16, 0.0).unwrap();
    let volume = Volume::new(Samples::I16(&samples), extent(SIZES)).unwrap();
    let source = Source::new(volume, Mapping::Colours(&table)).unwrap();
    // All colours count here, and these go from black over red to blue.
    for (level, floor_db) in [(Level::Fast, 26.0), (Level::Best, 27.9)] {
        let (blocks, stats) = source.blocks(BlockFormat::Bc1, options(level)).unwrap();
        let psnr_db = source.loss_of_blocks(BlockFormat::Bc1, &blocks).unwrap().psnr_db(255.0);
        assert!(psnr_db > floor_db && stats.clear == 0, "{level:?}: {psnr_db} dB, {stats:?}");
        let decoded = decode_volume(BlockFormat::Bc1, &blocks, extent(SIZES)).unwrap();
        assert!(decoded.as_chunks::<4>().0.iter().all(|texel| texel[3] == 255), "opaque");
    }
    let with_opacity = self::table();
    let source = Source::new(volume, Mapping::Colours(&with_opacity)).unwrap();
    let refused = source.blocks(BlockFormat::Bc1, options(Level::Fast));
    assert_eq!(refused.err(), Some(TextureError::Mapping), "BC1 keeps no opacity");
}

#[test]
fn bad_input_is_refused_by_name() {
    let (samples, table) = (hounsfield(), table());
    let too_few = Volume::new(Samples::I16(&samples[1..]), extent(SIZES));
    assert!(matches!(too_few, Err(TextureError::Samples { .. })), "{too_few:?}");
    let volume = Volume::new(Samples::I16(&samples), extent(SIZES)).unwrap();
    for low in [[1, 0, 0], [0, u32::MAX, 0]] {
        let outside = volume.part(low, extent(SIZES));
        assert!(matches!(outside, Err(TextureError::Outside { .. })), "{outside:?}");
    }
    let point = |value, a| ColourPoint { value, rgba: [0.5, 0.5, 0.5, a] };
    for points in [
        vec![],
        vec![point(1.0, 0.0), point(0.0, 0.0)],
        vec![point(f64::NAN, 0.0)],
        vec![point(0.0, 1.5)],
        vec![point(0.0, f64::NAN)],
    ] {
        let refused = ColourTable::new(&points, SampleKind::I16, 0.0);
        assert!(matches!(refused, Err(TextureError::Points { .. })), "{points:?}");
    }
    for range in [[1.0, 0.0], [f64::NAN, 0.0], [0.0, f64::INFINITY]] {
        let refused = Window::new(range, SampleKind::F32, 0.0);
        assert!(matches!(refused, Err(TextureError::Window { .. })), "{range:?}");
    }
    let bytes = [0; 8];
    let other = Volume::new(Samples::U8(&bytes), extent([8, 1, 1])).unwrap();
    let kind = Source::new(other, Mapping::Colours(&table)).err();
    let expected = TextureError::Kind { samples: SampleKind::U8, mapping: SampleKind::I16 };
    assert_eq!(kind, Some(expected), "kinds differ");
    let source = Source::new(volume, Mapping::Colours(&table)).unwrap();
    assert_eq!(source.texels(TexelFormat::R8).err(), Some(TextureError::Mapping), "scalars of colours");
    assert_eq!(
        source.texels_into(TexelFormat::Rgba8, &mut [0; 3]).err(),
        Some(TextureError::Length { expected: samples.len() * 4, found: 3 }),
        "three bytes"
    );
    let bricks = source.with_bricks(Bricks { edge: 8, ranges: &[] });
    assert!(matches!(bricks, Err(TextureError::Bricks { .. })), "{bricks:?}");
}
