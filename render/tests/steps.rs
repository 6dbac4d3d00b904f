//! The steps of time series: bytes as the CPU decodes them, pictures as the reference draws the decoded samples.

use std::sync::Arc;

use compress::Extent3;
use compress::bc::EncodeOptions;
use compress::pvtc::packed::{Packing, decode_packed_step, encode_packed};
use compress::pvtc::{self, Encoder, Layout};
use render::scene::{Scene, Shading, TextureFormat, VolumeItem};
use render::volume::{Grid, PackedFormat, PackedStep, Rescale, Samples};
use render::{StepDecoder, Stored, decode_on_device};

use crate::pictures::{agrees, device, draw_in_turn, perspective_scene, truth, volume};

/// A ball that grows and drifts, in 8 bits: `count` steps of the volume that the pictures show.
fn steps(extent: [usize; 3], count: usize) -> Vec<Vec<u8>> {
    let [nx, ny, nz] = extent;
    let value = |t: usize, i: usize| {
        let at = [i % nx, i / nx % ny, i / (nx * ny)];
        let centre = [0.45 + 0.04 * t as f64, 0.5, 0.5];
        let d: f64 = (0..3).map(|a| ((at[a] as f64 + 0.5) / extent[a] as f64 - centre[a]).powi(2)).sum();
        let noise = (i * 7919 + t * 104_729) % 5;
        ((1.0 - (d.sqrt() / (0.3 + 0.03 * t as f64)).powi(2)).max(0.0) * 245.0) as u8 + noise as u8
    };
    (0..count).map(|t| (0..nx * ny * nz).map(|i| value(t, i)).collect()).collect()
}

fn slices(steps: &[Vec<u8>]) -> Vec<&[u8]> {
    steps.iter().map(Vec::as_slice).collect()
}

fn extent3(extent: [usize; 3]) -> Extent3 {
    Extent3::new(extent.map(|n| n as u32)).unwrap()
}

fn packed(format: PackedFormat, extent: [usize; 3], bytes: &Arc<Vec<u8>>, step: usize) -> PackedStep {
    let like = volume(TextureFormat::R16);
    let rescale = Rescale { slope: 6.0, intercept: -300.0 };
    let place = *like.grid.world_from_voxel();
    PackedStep::new(format, extent, place, rescale, bytes.clone(), step).unwrap()
}

/// The volume of the pictures with a step in it, and its decoded samples for the reference.
fn item(step: PackedStep, decoded: Samples, shading: Shading) -> VolumeItem {
    let grid = Grid::new(step.extent(), decoded, step.rescale(), *step.world_from_voxel()).unwrap();
    VolumeItem { grid: Arc::new(grid), packed: Some(Arc::new(step)), shading, ..volume(TextureFormat::R16) }
}

#[test]
fn the_device_decodes_every_layout_to_the_bytes_of_the_cpu() {
    let Some(gpu) = device() else { return };
    for extent in [[48, 40, 32], [13, 9, 11], [1, 1, 1], [260, 5, 3]] {
        let series = steps(extent, 4);
        for layout in Layout::ALL {
            let (s, t) = (layout.s(), layout.t());
            let group = &slices(&series)[..usize::from(t)];
            let bytes = Arc::new(pvtc::encode(layout, group, extent3(extent), Encoder::MinMax).unwrap());
            for step in 0..usize::from(t) {
                let mut expected = vec![0; extent.iter().product()];
                pvtc::decode_step(layout, &bytes, extent3(extent), step, &mut expected).unwrap();
                let found =
                    decode_on_device(&gpu, &packed(PackedFormat::Pvtc { s, t }, extent, &bytes, step))
                        .unwrap();
                assert!(found == expected, "{layout} step {step} of {extent:?}");
            }
        }
    }
}

#[test]
fn random_bytes_decode_alike_on_device_and_cpu() {
    let Some(gpu) = device() else { return };
    let extent = [64, 48, 40];
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    for layout in
        [Layout::new(1, 1), Layout::new(4, 3), Layout::new(2, 4), Layout::new(8, 2)].map(Result::unwrap)
    {
        let mut random = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 32) as u8
        };
        let bytes: Vec<u8> = (0..layout.encoded_len(extent3(extent))).map(|_| random()).collect();
        let bytes = Arc::new(bytes);
        let format = PackedFormat::Pvtc { s: layout.s(), t: layout.t() };
        for step in 0..usize::from(layout.t()) {
            let mut expected = vec![0; extent.iter().product()];
            pvtc::decode_step(layout, &bytes, extent3(extent), step, &mut expected).unwrap();
            let found = decode_on_device(&gpu, &packed(format, extent, &bytes, step)).unwrap();
            assert!(found == expected, "{layout} step {step}");
        }
    }
}

#[test]
fn a_pvtc_step_is_drawn_as_its_samples_by_either_decoder() {
    let extent = [48, 40, 32];
    let series = steps(extent, 3);
    let layout = Layout::new(4, 3).unwrap();
    let bytes = Arc::new(pvtc::encode(layout, &slices(&series), extent3(extent), Encoder::MinMax).unwrap());
    let scenes: Vec<Scene> = (0..3)
        .map(|step| {
            let mut samples = vec![0; extent.iter().product()];
            pvtc::decode_step(layout, &bytes, extent3(extent), step, &mut samples).unwrap();
            let step = packed(PackedFormat::Pvtc { s: 4, t: 3 }, extent, &bytes, step);
            perspective_scene(item(step, Samples::U8(samples), Shading::None))
        })
        .collect();
    let [by_device, by_cpu] = [StepDecoder::Device, StepDecoder::Cpu].map(|d| draw_in_turn(&scenes, d));
    for ((scene, (a, _)), (b, _)) in scenes.iter().zip(by_device).zip(by_cpu) {
        assert_eq!(a.pixels, b.pixels, "the same bytes give the same picture");
        let d = a.difference(&truth(scene), scene.background).unwrap();
        assert!(d.psnr_db >= 48.0 && d.max <= 3.0, "{d:?}");
    }
}

#[test]
fn te_and_se_are_decoded_by_the_texture_hardware() {
    let extent = [48, 40, 31];
    let series = steps(extent, 3);
    for (packing, format, count) in [(Packing::Te, PackedFormat::Te, 3), (Packing::Se, PackedFormat::Se, 1)] {
        let bytes = Arc::new(
            encode_packed(packing, &slices(&series)[..count], extent3(extent), EncodeOptions::default())
                .unwrap(),
        );
        for step in 0..count {
            let mut samples = vec![0; extent.iter().product()];
            decode_packed_step(packing, &bytes, extent3(extent), step, &mut samples).unwrap();
            for shading in [Shading::None, Shading::Lit] {
                let step = packed(format, extent, &bytes, step);
                let scene = perspective_scene(item(step, Samples::U8(samples.clone()), shading));
                let stats = agrees(&scene, &format!("{format} {shading:?}"), 40.0, 14.0);
                if let Some(texture) = stats.textures.first() {
                    assert_eq!(texture.stored, Stored::Step(format), "drawn from its own blocks");
                    let slices = if format == PackedFormat::Te { 31 } else { 11 };
                    assert_eq!(texture.bytes, 12 * 10 * slices * 8, "{format}: half a byte a texel");
                }
            }
        }
    }
}

#[test]
fn steps_of_one_te_texture_are_sent_once() {
    let extent = [16, 16, 16];
    let series = steps(extent, 3);
    let bytes = Arc::new(
        encode_packed(Packing::Te, &slices(&series), extent3(extent), EncodeOptions::default()).unwrap(),
    );
    let scenes: Vec<_> = (0..3)
        .map(|step| {
            let samples = Samples::U8(series[step].clone());
            perspective_scene(item(packed(PackedFormat::Te, extent, &bytes, step), samples, Shading::None))
        })
        .collect();
    let drawn = draw_in_turn(&scenes, StepDecoder::Auto);
    for ((_, stats), expected) in drawn.iter().zip([1, 0, 0]) {
        assert_eq!(stats.textures_sent, expected, "the second and third find the first one's texture");
    }
}

#[test]
fn raw_steps_of_8_and_16_bits_are_drawn_exactly_as_their_grid() {
    let extent = [48, 40, 32];
    let raw = steps(extent, 1).remove(0);
    let wide: Vec<u16> = raw.iter().map(|&v| u16::from(v) * 11).collect();
    let bytes = Arc::new(wide.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    let place = *volume(TextureFormat::R16).grid.world_from_voxel();
    let rescale = Rescale { slope: 0.5, intercept: -300.0 };
    let step = PackedStep::new(PackedFormat::R16, extent, place, rescale, bytes, 0).unwrap();
    let scene = perspective_scene(item(step, Samples::U16(wide), Shading::None));
    agrees(&scene, "16 bits", 60.0, 1.5);
    let step = packed(PackedFormat::R8, extent, &Arc::new(raw.clone()), 0);
    let scene = perspective_scene(item(step, Samples::U8(raw), Shading::None));
    agrees(&scene, "8 bits", 48.0, 3.0);
}
