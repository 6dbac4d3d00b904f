//! PVTC against a naive codec from the papers, an independent BC1 decoder, and its own promises.

mod measure;
mod naive;
mod packed;

use compress::Extent3;
use compress::pvtc::{DecodeError, EncodeError, Encoder, Layout, LayoutError, decode_step, encode};
use naive::Naive;

use crate::phantom::Noise;

/// Sub-volumes of random bits that the decoder is tried on, for each layout.
const RANDOM_SUB_VOLUMES: usize = 100_000;

/// Extents with every remainder of sub-volumes, thin ones among them.
const EXTENTS: [[u32; 3]; 6] = [[1, 1, 1], [4, 4, 8], [5, 7, 3], [18, 3, 9], [67, 6, 5], [3, 21, 17]];

fn extent(sizes: [u32; 3]) -> Extent3 {
    Extent3::new(sizes).unwrap()
}

fn naive(layout: Layout, extent: Extent3) -> Naive {
    Naive { s: layout.s().into(), t: layout.t().into(), extent: [extent.x(), extent.y(), extent.z()] }
}

/// Steps of a smooth, moving pattern with noise: step `t` falls where others rise.
fn series(extent: Extent3, steps: usize, noise: u64) -> Vec<Vec<u8>> {
    let mut random = Noise(extent.voxels() as u64);
    let step = |t: usize, random: &mut Noise| {
        let sign = if t.is_multiple_of(2) { 1.0 } else { -1.0 };
        (0..extent.voxels())
            .map(|i| {
                let [x, y, z] = [i % extent.x(), i / extent.x() % extent.y(), i / extent.x() / extent.y()];
                let wave =
                    (0.31 * x as f64 + 0.2 * t as f64).sin() + (0.23 * y as f64 - 0.17 * z as f64).cos();
                (128.0 + 55.0 * sign * wave) as u8 / 2 + (random.bits() % (noise + 1)) as u8
            })
            .collect()
    };
    (0..steps).map(|t| step(t, &mut random)).collect()
}

fn borrowed(steps: &[Vec<u8>]) -> Vec<&[u8]> {
    steps.iter().map(Vec::as_slice).collect()
}

fn decoded(layout: Layout, bytes: &[u8], extent: Extent3, step: usize) -> Vec<u8> {
    let mut out = vec![0; extent.voxels()];
    decode_step(layout, bytes, extent, step, &mut out).unwrap();
    out
}

#[test]
fn the_papers_four_layouts_have_the_papers_rates() {
    let extent = extent([480, 720, 120]);
    for ((s, t), [part, whole]) in [((4, 3), [5, 48]), ((4, 2), [5, 32]), ((1, 3), [1, 6]), ((1, 2), [1, 4])]
    {
        let layout = Layout::new(s, t).unwrap();
        assert_eq!(layout.rate(), part as f64 / whole as f64, "{layout}");
        assert_eq!(layout.encoded_len(extent), extent.voxels() * usize::from(t) * part / whole, "{layout}");
        assert_eq!(layout.head_len(extent) * (1 + usize::from(s)), layout.encoded_len(extent), "{layout}");
    }
}

#[test]
fn a_layout_of_other_sizes_is_refused_by_name() {
    for s in [0, 3, 5, 16] {
        assert_eq!(Layout::new(s, 2), Err(LayoutError::Slices { s }), "{s} slices");
    }
    for t in [0, 5] {
        assert_eq!(Layout::new(4, t), Err(LayoutError::Steps { t }), "{t} steps");
    }
    for layout in Layout::ALL {
        assert_eq!(Layout::new(layout.s(), layout.t()), Ok(layout), "{layout}");
    }
}

#[test]
fn random_sub_volumes_decode_as_the_papers_say_byte_for_byte() {
    for layout in Layout::ALL {
        // 250·20·20 sub-volumes, the last of each axis partly outside.
        let extent =
            extent([4 * 250 - 1, 4 * 20 - 3, u32::from(layout.s()) * 20 - u32::from(layout.s()) / 2]);
        let bytes = Noise(layout.encoded_len(extent) as u64).bytes(layout.encoded_len(extent));
        assert!(bytes.len() / (4 + 4 * usize::from(layout.s())) >= RANDOM_SUB_VOLUMES, "{layout}");
        for step in 0..layout.t().into() {
            let expected = naive(layout, extent).decode(&bytes, step);
            assert!(decoded(layout, &bytes, extent, step) == expected, "{layout} step {step}");
        }
    }
}

#[test]
fn the_steps_of_1_3_are_the_channels_of_bc1_in_an_independent_decoder() {
    let layout = Layout::new(1, 3).unwrap();
    let count = 50_000;
    let extent = extent([4 * count, 4, 1]);
    let bytes = Noise(5).bytes(layout.encoded_len(extent));
    let steps: Vec<_> = (0..3).map(|step| decoded(layout, &bytes, extent, step)).collect();
    let (heads, tables) = bytes.split_at(layout.head_len(extent));
    for (i, (head, table)) in heads.chunks(4).zip(tables.chunks(4)).enumerate() {
        let (u, d) = (u16::from_le_bytes([head[0], head[1]]), u16::from_le_bytes([head[2], head[3]]));
        if u <= d {
            // BC1's other mode.
            continue;
        }
        // BC1 counts U, D, (2·U + D)/3, (U + 2·D)/3.
        let code =
            |byte: &u8| (0..4).map(|x| [0, 2, 3, 1][usize::from(byte >> (2 * x) & 3)] << (2 * x)).sum::<u8>();
        let block: Vec<u8> = head.iter().copied().chain(table.iter().map(code)).collect();
        let mut texels = [0; 64];
        bcdec_rs::bc1(&block, &mut texels, 16);
        for (texel, rgba) in texels.chunks(4).enumerate() {
            let at = texel / 4 * extent.x() + 4 * i + texel % 4;
            assert_eq!([0, 1, 2].map(|t: usize| steps[t][at]), rgba[..3], "block {i} texel {texel}");
        }
    }
}

#[test]
fn the_min_max_encoder_is_the_papers_to_the_bit() {
    for layout in Layout::ALL {
        for sizes in EXTENTS {
            for noise in [0, 6, 120] {
                let extent = extent(sizes);
                let steps = series(extent, layout.t().into(), noise);
                for given in 1..=steps.len() {
                    let steps = borrowed(&steps[..given]);
                    let bytes = encode(layout, &steps, extent, Encoder::MinMax).unwrap();
                    assert_eq!(bytes.len(), naive(layout, extent).encoded_len(), "{layout} {sizes:?}");
                    let expected = naive(layout, extent).encode_min_max(&steps);
                    assert!(bytes == expected, "{layout} {sizes:?} noise {noise} steps {given}");
                }
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let extent = extent([67, 45, 19]);
    for layout in Layout::ALL {
        let steps = series(extent, layout.t().into(), 9);
        let steps = borrowed(&steps);
        for encoder in [Encoder::MinMax, Encoder::Fitted] {
            let [one, four] = [1, 4].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let bytes = encode(layout, &steps, extent, encoder).unwrap();
                    let voxels = decoded(layout, &bytes, extent, steps.len() - 1);
                    (bytes, voxels)
                })
            });
            assert!(one == four, "{layout} {encoder:?}");
        }
    }
}

#[test]
fn wrong_sizes_are_refused_by_name() {
    let extent = extent([5, 5, 5]);
    let layout = Layout::new(4, 2).unwrap();
    let (good, short) = ([0_u8; 125], [0_u8; 124]);
    let encode = |steps: &[&[u8]]| encode(layout, steps, extent, Encoder::MinMax);
    assert_eq!(encode(&[]), Err(EncodeError::Steps { found: 0, most: 2 }), "no steps");
    assert_eq!(encode(&[good.as_slice(); 3]), Err(EncodeError::Steps { found: 3, most: 2 }), "three steps");
    let length = EncodeError::Length { step: 1, expected: 125, found: 124 };
    assert_eq!(encode(&[&good, &short]), Err(length), "short step");

    let bytes = encode(&[&good]).unwrap();
    let mut out = [0; 125];
    let cut = decode_step(layout, &bytes[1..], extent, 0, &mut out);
    assert_eq!(cut, Err(DecodeError::Length { expected: 160, found: 159 }), "cut off");
    let past = decode_step(layout, &bytes, extent, 2, &mut out);
    assert_eq!(past, Err(DecodeError::Step { step: 2, steps: 2 }), "third step");
    let narrow = decode_step(layout, &bytes, extent, 1, &mut out[1..]);
    assert_eq!(narrow, Err(DecodeError::Room { expected: 125, found: 124 }), "no room");
}

#[test]
fn the_fitted_encoder_never_loses_to_min_max_and_gains_more_where_steps_run_against_each_other() {
    for layout in Layout::ALL {
        for noise in [0, 6, 60] {
            let extent = extent([68, 36, 24]);
            let steps = series(extent, layout.t().into(), noise);
            let steps = borrowed(&steps);
            let [min_max, fitted] = [Encoder::MinMax, Encoder::Fitted].map(|encoder| {
                let bytes = encode(layout, &steps, extent, encoder).unwrap();
                squares_of_sub_volumes(layout, &bytes, &steps, extent)
            });
            assert!(min_max.iter().zip(&fitted).all(|(a, b)| b <= a), "{layout} noise {noise}");
            let [min_max, fitted] = [min_max, fitted].map(|squares| squares.iter().sum::<u64>() as f64);
            let gain_db = 10.0 * (min_max / fitted).log10();
            // The second and fourth step fall where the others rise; noise as large as the pattern hides it.
            let floor_db = if layout.t() > 1 && noise < 60 { 6.0 } else { 1.8 };
            assert!(gain_db >= floor_db, "{layout} noise {noise}: {gain_db:.2} dB");
        }
    }
}

/// The sum of squared errors of each sub-volume, over all steps.
fn squares_of_sub_volumes(layout: Layout, bytes: &[u8], steps: &[&[u8]], extent: Extent3) -> Vec<u64> {
    let [across, down, deep] = layout.sub_volumes(extent);
    let mut squares = vec![0; across * down * deep];
    for (step, samples) in steps.iter().enumerate() {
        let copy = decoded(layout, bytes, extent, step);
        for (i, (a, b)) in samples.iter().zip(copy).enumerate() {
            let [x, y, z] = [i % extent.x(), i / extent.x() % extent.y(), i / extent.x() / extent.y()];
            let sub_volume = (z / usize::from(layout.s()) * down + y / 4) * across + x / 4;
            squares[sub_volume] += u64::from(a.abs_diff(b)).pow(2);
        }
    }
    squares
}
