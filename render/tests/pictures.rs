//! The GPU's picture against the `f64` reference, for every pairing of volumes, cuts, surfaces and cameras.

use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

use render::cpu::{CpuRenderer, Finish, Instructions, Skips};
use render::gpu::{Gpu, GpuError};
use render::image::{Difference, FloatImage};
use render::recovery::RecoveringRenderer;
use render::reference;
use render::renderer::{Quality, Renderer, Stats};
use render::scene::{
    Camera, Labels, MeshItem, Piece, Projection, Scene, Shading, TextureFormat, VolumeItem, VolumeMode,
};
use render::volume::{
    Affine, ControlPoint, Cutter, Grid, Point, Rescale, Samples, Side, Transfer, TriangleMesh, Vector, synth,
};
use render::{StepDecoder, Stored};

const SIZE: [u32; 2] = [96, 80];

/// One device for all tests. No adapter is a failure, not a skip, unless `NO_GPU=1` says so.
static RENDERER: LazyLock<Result<Mutex<Renderer>, GpuError>> =
    LazyLock::new(|| Renderer::new(Arc::new(Gpu::headless()?)).map(Mutex::new));

fn draw(scene: &Scene, quality: Quality) -> Option<(FloatImage, Stats)> {
    draw_sized(scene, SIZE, quality)
}

fn draw_sized(scene: &Scene, size: [u32; 2], quality: Quality) -> Option<(FloatImage, Stats)> {
    if !has_gpu() {
        return None;
    }
    let mut renderer = renderer();
    let stats = renderer.render(scene, size, quality).unwrap();
    Some((renderer.read().unwrap(), stats))
}

fn renderer() -> MutexGuard<'static, Renderer> {
    RENDERER.as_ref().map_err(Clone::clone).unwrap().lock().unwrap_or_else(PoisonError::into_inner)
}

/// The device, unless `NO_GPU=1` says there is none.
pub(crate) fn device() -> Option<Arc<Gpu>> {
    has_gpu().then(|| Arc::clone(renderer().gpu()))
}

fn has_gpu() -> bool {
    std::env::var_os("NO_GPU").is_none_or(|v| v != "1")
}

/// Draws scenes one after the other with nothing between them, steps decoded by `decoder`.
pub(crate) fn draw_in_turn(scenes: &[Scene], decoder: StepDecoder) -> Vec<(FloatImage, Stats)> {
    if !has_gpu() {
        return Vec::new();
    }
    let mut renderer = renderer();
    renderer.set_step_decoder(decoder);
    let drawn = scenes
        .iter()
        .map(|scene| {
            let stats = renderer.render(scene, SIZE, Quality::Finest).unwrap();
            (renderer.read().unwrap(), stats)
        })
        .collect();
    renderer.set_step_decoder(StepDecoder::Auto);
    drawn
}

/// One volume in the usual view.
pub(crate) fn perspective_scene(volume: VolumeItem) -> Scene {
    scene(vec![volume], vec![])
}

pub(crate) fn truth(scene: &Scene) -> FloatImage {
    reference::draw(scene, SIZE, &reference::Options::default(), &|_, _| true).unwrap()
}

/// Draws with both and holds the difference under bounds; returns what the GPU did.
pub(crate) fn agrees(scene: &Scene, what: &str, psnr_db: f64, max: f64) -> Stats {
    let truth = truth(scene);
    cpu_agrees(scene, &truth, what);
    let Some((picture, stats)) = draw(scene, Quality::Finest) else { return Stats::default() };
    let d = picture.difference(&truth, scene.background).unwrap();
    assert!(d.psnr_db >= psnr_db && d.max <= max, "{what}: {d:?}");
    let lit = truth.pixels.iter().filter(|p| p[3] > 0.1).count();
    assert!(lit > 200, "{what}: only {lit} pixels show anything");
    // Blocks lie elsewhere in a texture of the whole volume, and err elsewhere.
    if scene.volumes.iter().all(|v| matches!(v.texture, TextureFormat::R16 | TextureFormat::R32f)) {
        skips_agree(scene, what);
    }
    stats
}

/// Holds the GPU's picture to the one for which nothing is skipped.
fn skips_agree(scene: &Scene, what: &str) {
    let mut renderer = renderer();
    let [skipped, whole] = [true, false].map(|skip| {
        let finished = if skip { Finish::WithQuality } else { Finish::Never };
        renderer.set_skips(Skips { empty: skip, finished });
        let stats = renderer.render(scene, SIZE, Quality::Good).unwrap();
        (renderer.read().unwrap(), stats)
    });
    renderer.set_skips(Skips::default());
    let d = skipped.0.difference(&whole.0, scene.background).unwrap();
    assert!(d.max <= 255.0 / 512.0, "{what}: skipping on the GPU changed it by {} / 255", d.max);
    assert!(whole.1.bricks_skipped == 0 && whole.1.saturate_looks == 0, "{what}: nothing is skipped");
}

/// Holds the CPU's picture to the reference, and to itself with other instructions, threads and nothing skipped.
fn cpu_agrees(scene: &Scene, truth: &FloatImage, what: &str) {
    let draw = |instructions, skips, quality| {
        let mut renderer = CpuRenderer::new();
        renderer.set_instructions(instructions);
        renderer.set_skips(skips);
        renderer.render(scene, SIZE, quality, &|_, _| true).unwrap()
    };
    let all = Skips::default();
    let (picture, stats) = draw(Instructions::Best, all, Quality::Finest);
    let d = picture.difference(truth, scene.background).unwrap();
    assert!(d.psnr_db >= 66.0 && d.max <= 2.0, "{what}, by the CPU: {d:?}");
    let fragments: usize = scene.volumes.iter().map(|v| v.pieces.len()).sum();
    assert_eq!((stats.fragments + stats.fragments_skipped) as usize, fragments, "{what}: all are counted");
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let (plain, _) = one.install(|| draw(Instructions::Plain, all, Quality::Finest));
    assert!(plain.pixels == picture.pixels, "{what}: other instructions and threads, other bytes");
    let (good, _) = draw(Instructions::Best, all, Quality::Good);
    let (whole, _) = draw(Instructions::Best, Skips { empty: false, finished: Finish::Never }, Quality::Good);
    let d = good.difference(&whole, scene.background).unwrap();
    assert!(d.max <= 255.0 / 512.0, "{what}: skipping changed it by {} / 255", d.max);
}

fn cpu_difference(scene: &Scene, truth: &FloatImage) -> Difference {
    let drawn = CpuRenderer::new().render(scene, SIZE, Quality::Finest, &|_, _| true);
    drawn.unwrap().0.difference(truth, scene.background).unwrap()
}

fn point(value: f64, r: f64, g: f64, b: f64, a: f64) -> ControlPoint {
    ControlPoint { value, rgba: [r, g, b, a] }
}

/// Bone-like: clear outside, a soft rim, a dense core.
fn bone() -> Arc<Transfer> {
    let points = vec![
        point(-1000.0, 0.8, 0.3, 0.2, 0.0),
        point(0.0, 0.8, 0.3, 0.2, 0.0),
        point(300.0, 0.9, 0.6, 0.4, 0.05),
        point(700.0, 1.0, 0.95, 0.8, 0.5),
    ];
    Arc::new(Transfer::new(points, 1.0).unwrap())
}

/// A ball and a rod with a smooth rim, as whole HU, in a grid that is neither cubic nor axis-parallel.
fn grid() -> Arc<Grid> {
    let turn = Affine::rotation_about(Point::origin(), Vector::new(0.3, 1.0, 0.2), 0.4);
    let spacing =
        Affine::from_columns(Vector::x(), Vector::y() * 1.25, Vector::z() * 1.5, Point::origin()).unwrap();
    let place = turn * spacing * Affine::translation(Vector::new(-23.5, -19.5, -15.5));
    let value = |p: &Point| {
        let ball = 14.0 - (p - Point::new(-4.0, 2.0, 5.0)).norm();
        let rod = 6.0 - (p.x - 3.0).hypot(p.y + 3.0);
        (ball.max(rod) * 120.0).clamp(-1000.0, 1200.0).round()
    };
    let float = synth::from_places([48, 40, 32], place, value).unwrap();
    let whole = (0..48 * 40 * 32).map(|i| float.value_at(i) as i16).collect();
    Arc::new(Grid::new([48, 40, 32], Samples::I16(whole), Rescale::default(), place).unwrap())
}

pub(crate) fn volume(texture: TextureFormat) -> VolumeItem {
    VolumeItem {
        packed: None,
        grid: grid(),
        pose: Affine::identity(),
        transfer: bone(),
        shading: Shading::None,
        texture,
        pieces: vec![Piece::whole()],
        labels: None,
        mode: Default::default(),
    }
}

fn perspective() -> Camera {
    Camera {
        eye: Point::new(60.0, -120.0, 50.0),
        target: Point::origin(),
        up: Vector::z(),
        projection: Projection::Perspective { fov_rad: 0.45 },
    }
}

fn parallel() -> Camera {
    Camera { projection: Projection::Parallel { height_mm: 62.0 }, ..perspective() }
}

fn scene(volumes: Vec<VolumeItem>, meshes: Vec<MeshItem>) -> Scene {
    Scene { volumes, meshes, grids: Vec::new(), camera: perspective(), background: [0.1, 0.2, 0.3] }
}

/// A closed box as a mesh.
fn block(centre: [f64; 3], half: f64, color: [f64; 3], opacity: f64) -> MeshItem {
    let corner =
        |i: usize| Point::from([0, 1, 2].map(|a| centre[a] + if i >> a & 1 == 1 { half } else { -half }));
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = sides.iter().flat_map(|s| [[s[0], s[1], s[2]], [s[0], s[2], s[3]]]).collect();
    MeshItem {
        mesh: Arc::new(TriangleMesh::new((0..8).map(corner).collect(), triangles).unwrap()),
        pose: Affine::rotation_about(Point::origin(), Vector::new(0.2, 0.5, 1.0), 0.6),
        color,
        opacity,
        shading: Shading::None,
    }
}

fn plane(at: [f64; 3], normal: [f64; 3]) -> Cutter {
    Cutter::plane(Point::from(at), Vector::from(normal)).unwrap()
}

/// The pieces that two crossing planes make, each with its own pose.
fn pieces(poses: &[Affine; 3]) -> Vec<Piece> {
    let (a, b) = (plane([0.0, 0.0, 2.0], [0.3, 0.2, 1.0]), plane([2.0, 0.0, 0.0], [1.0, 0.4, -0.3]));
    let keeps = [
        vec![(a, Side::Plus)],
        vec![(a, Side::Minus), (b, Side::Plus)],
        vec![(a, Side::Minus), (b, Side::Minus)],
    ];
    keeps.into_iter().zip(poses).map(|(keep, &pose)| Piece { keep, pose }).collect()
}

#[test]
fn a_plain_volume_in_both_cameras() {
    let mut s = scene(vec![volume(TextureFormat::R16)], vec![]);
    let stats = agrees(&s, "perspective", 60.0, 2.0);
    assert!(stats.bricks_skipped > 0 || stats.bricks == 0, "some bricks are clear: {stats:?}");
    s.camera = parallel();
    agrees(&s, "parallel", 60.0, 2.0);
    s.volumes[0].texture = TextureFormat::R32f;
    agrees(&s, "float texture", 60.0, 2.0);
}

#[test]
fn a_lit_volume() {
    let mut s = scene(vec![volume(TextureFormat::R16)], vec![]);
    s.volumes[0].shading = Shading::Lit;
    agrees(&s, "lit", 60.0, 2.0);
}

#[test]
fn two_volumes_that_overlap() {
    let mut other = volume(TextureFormat::R16);
    other.pose = Affine::rotation_about(Point::origin(), Vector::new(1.0, 0.2, 0.1), 1.1)
        * Affine::translation(Vector::new(6.0, -3.0, 2.0));
    let points = vec![point(-200.0, 0.1, 0.4, 0.9, 0.0), point(600.0, 0.3, 0.9, 1.0, 0.12)];
    other.transfer = Arc::new(Transfer::new(points, 2.0).unwrap());
    let stats = agrees(&scene(vec![volume(TextureFormat::R16), other], vec![]), "overlap", 60.0, 2.0);
    assert!(stats.most_overlapping == 2 || stats.draws == 0, "they are integrated together: {stats:?}");
}

#[test]
fn a_volume_cut_and_left_in_place_is_the_whole() {
    let whole = scene(vec![volume(TextureFormat::R16)], vec![]);
    let mut cut = whole.clone();
    cut.volumes[0].pieces = pieces(&[Affine::identity(); 3]);
    agrees(&cut, "cut in place", 60.0, 2.0);
    let (Some((a, _)), Some((b, _))) = (draw(&whole, Quality::Good), draw(&cut, Quality::Good)) else {
        return;
    };
    let d = a.difference(&b, whole.background).unwrap();
    // Where a cut splits a sub-step it is integrated in two parts, which is finer.
    assert!(d.psnr_db > 55.0 && d.max < 4.0, "{d:?}");
}

#[test]
fn fragments_that_moved_and_overlap() {
    let mut s = scene(vec![volume(TextureFormat::R16)], vec![]);
    let turn = Affine::rotation_about(Point::origin(), Vector::new(0.1, 0.3, 1.0), 0.5);
    s.volumes[0].pieces = pieces(&[
        Affine::translation(Vector::new(3.0, -2.0, 9.0)) * turn,
        Affine::translation(Vector::new(-5.0, 1.0, 2.0)),
        turn,
    ]);
    agrees(&s, "moved fragments", 60.0, 2.0);
    s.camera = parallel();
    agrees(&s, "moved fragments, parallel", 60.0, 2.0);
}

#[test]
fn cylinders_keep_their_inside_and_their_outside() {
    both_sides("cylinder", tube());
}

#[test]
fn domes_keep_their_inside_and_their_outside() {
    both_sides("dome", dome());
}

#[test]
fn blades_keep_what_they_have_passed_and_the_rest() {
    both_sides("blade", blade());
}

fn tube() -> Cutter {
    Cutter::cylinder(Point::new(-2.0, 0.0, 4.0), Vector::new(0.2, 1.0, 0.3), 9.0).unwrap()
}

fn dome() -> Cutter {
    Cutter::dome(Point::new(-1.0, -4.0, 4.0), 10.0).unwrap()
}

fn blade() -> Cutter {
    let (normal, right) = (Vector::new(0.3, -0.5, 1.0), Vector::new(1.0, 0.2, 0.0));
    Cutter::blade(Point::new(-2.0, 1.0, 6.0), normal, right, [14.0, 18.0]).unwrap()
}

/// Each side of a cutter alone, both, and both of one with a kerf that is seen.
fn both_sides(what: &str, cutter: Cutter) {
    let piece = |side| Piece { keep: vec![(cutter, side)], pose: Affine::identity() };
    let mut s = scene(vec![volume(TextureFormat::R16)], vec![]);
    for side in [Side::Plus, Side::Minus] {
        s.volumes[0].pieces = vec![piece(side)];
        agrees(&s, &format!("{side:?} of a {what}"), 60.0, 2.0);
    }
    s.volumes[0].pieces = vec![piece(Side::Plus), piece(Side::Minus)];
    agrees(&s, &format!("both sides of a {what}"), 60.0, 2.0);
    s.camera = parallel();
    for piece in &mut s.volumes[0].pieces {
        piece.keep[0].0 = cutter.with_kerf(3.0).unwrap();
    }
    s.volumes[0].pieces[1].pose = Affine::translation(Vector::new(2.0, -3.0, 1.0));
    agrees(&s, &format!("a {what} with a kerf"), 60.0, 2.0);
}

#[test]
fn a_piece_outside_of_many_cutters_that_overlap() {
    let round = |i: i32| {
        let at = Point::new(f64::from(i) * 5.0 - 12.0, -3.0, f64::from(i % 2) * 3.0 + 2.0);
        Cutter::dome(at, 4.5).unwrap()
    };
    let mut keep: Vec<_> = [tube(), blade(), dome()].map(|c| (c, Side::Plus)).into();
    keep.extend((0..5).map(|i| (round(i), Side::Plus)));
    keep.push((plane([0.0, 0.0, -9.0], [0.2, 0.1, 1.0]).with_kerf(1.5).unwrap(), Side::Plus));
    let mut s = scene(vec![volume(TextureFormat::R16)], vec![]);
    s.volumes[0].pieces = vec![Piece { keep: keep.clone(), pose: Affine::identity() }];
    agrees(&s, "eight gaps", 60.0, 2.0);
    if has_gpu() {
        keep.push((round(5), Side::Plus));
        s.volumes[0].pieces[0].keep = keep;
        let refused = renderer().render(&s, SIZE, Quality::Good);
        assert_eq!(refused, Err(GpuError::Gaps { count: 9, limit: 8 }), "nine");
    }
}

#[test]
fn a_translucent_surface_before_inside_across_and_behind() {
    for (what, centre, half) in [
        ("before", [20.0, -40.0, 12.0], 6.0),
        ("inside", [-4.0, 2.0, 5.0], 5.0),
        ("across", [2.0, -8.0, 4.0], 12.0),
        ("behind", [-20.0, 40.0, -12.0], 14.0),
    ] {
        let mut s = scene(vec![volume(TextureFormat::R16)], vec![block(centre, half, [0.2, 0.6, 1.0], 0.4)]);
        agrees(&s, what, 60.0, 2.0);
        s.camera = parallel();
        s.meshes[0].shading = Shading::Lit;
        agrees(&s, what, 60.0, 2.0);
        s.meshes[0].opacity = 1.0;
        agrees(&s, what, 60.0, 2.0);
    }
}

#[test]
fn surfaces_that_cross_each_other_inside_a_cut_volume() {
    let mut s = scene(
        vec![volume(TextureFormat::R16)],
        vec![
            block([0.0, 0.0, 0.0], 11.0, [0.2, 0.6, 1.0], 0.3),
            block([5.0, -4.0, 3.0], 9.0, [1.0, 0.2, 0.3], 0.5),
            block([-9.0, 3.0, -6.0], 7.0, [0.3, 1.0, 0.3], 1.0),
        ],
    );
    s.volumes[0].pieces = pieces(&[
        Affine::translation(Vector::new(0.0, 0.0, 4.0)),
        Affine::identity(),
        Affine::translation(Vector::new(-3.0, 0.0, 0.0)),
    ]);
    let stats = agrees(&s, "crossing surfaces", 60.0, 2.0);
    assert!(stats.layers > 0 || stats.draws == 0, "translucent crossings were captured");
    s.volumes.clear();
    let d = agrees(&s, "surfaces alone", 100.0, 0.01);
    assert_eq!(d.textures.len(), 0, "no volume, no texture");
}

/// Holds the CPU alone to the reference: what the passes do not draw.
fn cpu_alone_agrees(scene: &Scene, what: &str) {
    let truth = truth(scene);
    let shown = truth.pixels.iter().filter(|p| p[3] > 0.1).count();
    assert!(shown > 200, "{what}: only {shown} pixels show anything");
    cpu_agrees(scene, &truth, what);
}

#[test]
fn sixteen_crossing_surfaces_inside_two_overlapping_volumes() {
    // Thin sheets through each other, so that every ray crosses all of them in an order of its own.
    let sheet = |i: usize| {
        let turn = Affine::rotation_about(
            Point::origin(),
            Vector::new((i as f64).sin(), (2.0 * i as f64).cos(), 0.3),
            0.2 + 0.37 * i as f64,
        );
        let corners = [[-30.0, -30.0], [30.0, -30.0], [30.0, 30.0], [-30.0, 30.0]];
        let corners = corners.map(|[x, z]| Point::new(x, i as f64 * 0.9 - 7.0, z));
        let hue = i as f64 / 15.0;
        MeshItem {
            mesh: Arc::new(TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).unwrap()),
            pose: turn,
            color: [hue, 1.0 - hue, 0.5],
            opacity: 0.15 + 0.02 * i as f64,
            shading: Shading::None,
        }
    };
    let mut other = volume(TextureFormat::R16);
    other.pose = Affine::rotation_about(Point::origin(), Vector::new(1.0, 0.2, 0.1), 1.1);
    let points = vec![point(-200.0, 0.1, 0.4, 0.9, 0.0), point(600.0, 0.3, 0.9, 1.0, 0.12)];
    other.transfer = Arc::new(Transfer::new(points, 2.0).unwrap());
    let s = scene(vec![volume(TextureFormat::R16), other], (0..16).map(sheet).collect());
    agrees(&s, "sixteen surfaces in two volumes", 60.0, 1.0);
    assert!(
        cpu_difference(&s, &truth(&s)).max <= 1.0,
        "sixteen surfaces in two volumes, by the CPU: {:?}",
        cpu_difference(&s, &truth(&s))
    );
}

#[test]
fn a_lost_device_costs_no_byte_of_the_picture() {
    if !has_gpu() {
        return;
    }
    let mut s = scene(
        vec![volume(TextureFormat::R16)],
        vec![
            block([0.0; 3], 11.0, [0.2, 0.6, 1.0], 0.3),
            block([-9.0, 3.0, -6.0], 7.0, [0.3, 1.0, 0.3], 1.0),
        ],
    );
    let mut next = s.clone();
    next.camera = parallel();
    s.volumes[0].shading = Shading::Lit;
    let size = [24, 20];
    let mut renderer = RecoveringRenderer::new(Gpu::headless).unwrap();
    let mut both = || {
        let (a, _) = renderer.render(&s, size, Quality::Draft).unwrap();
        let (b, stats) = renderer.render(&next, size, Quality::Draft).unwrap();
        (a.pixels, b.pixels, renderer.losses(), stats.notes.len(), renderer.gpu().cloned())
    };
    let known = both();
    // Calls of two pictures when nothing is kept yet, and when all is.
    let calls = |gpu: &Option<Arc<Gpu>>| 100_000 - gpu.as_ref().unwrap().lose_after(0);
    known.4.as_ref().unwrap().lose_after(100_000);
    let kept = calls(&both().4);
    assert!(kept >= 20, "only {kept} calls in two pictures");
    let mut lost = 0;
    for point in 1..=100 {
        let gpu = both().4.unwrap();
        gpu.lose_after(1 + (point - 1) % kept);
        let again = both();
        lost = again.2;
        assert!(again.0 == known.0 && again.1 == known.1, "other bytes after a loss at call {point}");
    }
    assert!(lost >= 100, "only {lost} of 100 devices were lost");
}

#[test]
fn textures_keep_to_their_memory_with_a_note() {
    if !has_gpu() {
        return;
    }
    let s = scene(vec![volume(TextureFormat::Auto)], vec![]);
    let truth = truth(&s);
    let mut renderer = Renderer::new(device().unwrap()).unwrap();
    // 48 x 40 x 32 voxels are 120 KiB in 16 bits.
    for (bytes, psnr_db) in [(1 << 20, 55.0), (70_000, 50.0), (40_000, 40.0), (6_000, 20.0)] {
        renderer.set_texture_bytes(bytes);
        let stats = renderer.render(&s, SIZE, Quality::Finest).unwrap();
        let taken: u64 = stats.textures.iter().map(|t| t.bytes).sum();
        assert!(taken <= bytes, "{taken} bytes of {bytes}");
        assert_eq!(stats.notes.is_empty(), bytes > 1 << 18, "{bytes}: {:?}", stats.notes);
        let d = renderer.read().unwrap().difference(&truth, s.background).unwrap();
        assert!(d.psnr_db >= psnr_db, "{bytes} bytes: {d:?}");
    }
}

#[test]
fn cutting_makes_no_texture_anew() {
    let mut s = scene(vec![volume(TextureFormat::Bc4)], vec![]);
    let Some((_, whole)) = draw(&s, Quality::Draft) else { return };
    let bytes = |stats: &Stats| stats.textures.iter().map(|t| t.bytes).sum::<u64>();
    s.volumes[0].pieces = pieces(&[Affine::translation(Vector::new(0.0, 0.0, 4.0)); 3]);
    let mut renderer = renderer();
    renderer.render(&scene(s.volumes.clone(), vec![]), SIZE, Quality::Draft).unwrap();
    let stats = renderer.render(&s, SIZE, Quality::Draft).unwrap();
    assert_eq!((bytes(&stats), stats.textures_sent), (bytes(&whole), 0), "the same texture");
    assert_eq!(stats.textures.len(), 1, "one for all fragments");
}

#[test]
fn labels_ride_with_their_fragments() {
    let extent = [24, 20, 16];
    // Blocks of two voxels of the volume, shifted by a third of one, in three labels of which one has no colour.
    let numbers = (0..24 * 20 * 16).map(|i| ((i % 24) / 3 + (i / 24 % 20) / 4 + i / 480 / 2) as u8 % 4);
    let place = *grid().world_from_voxel()
        * Affine::from_columns(
            Vector::x() * 2.0,
            Vector::y() * 2.0,
            Vector::z() * 2.0,
            Point::new(0.3, 0.3, 0.3),
        )
        .unwrap();
    let labels = Grid::new(extent, Samples::U8(numbers.collect()), Rescale::default(), place).unwrap();
    let colors = [[0.0; 4], [1.0, 0.0, 0.0, 0.5], [0.0, 0.0, 1.0, 1.0], [0.0; 4]];
    let mut s = scene(vec![volume(TextureFormat::R16)], vec![block([0.0; 3], 9.0, [0.2, 0.6, 1.0], 0.4)]);
    s.volumes[0].labels =
        Some(Labels { grid: Arc::new(labels), pose: Affine::identity(), colors: Arc::from(colors) });
    cpu_alone_agrees(&s, "labels");
    s.volumes[0].shading = Shading::Lit;
    s.volumes[0].pieces = pieces(&[
        Affine::translation(Vector::new(3.0, -2.0, 9.0)),
        Affine::translation(Vector::new(-5.0, 1.0, 2.0)),
        Affine::identity(),
    ]);
    cpu_alone_agrees(&s, "labels on moved fragments, lit");
    s.volumes[0].mode = VolumeMode::Isosurface { value: 350.0, opacity: 0.6 };
    cpu_alone_agrees(&s, "labels on an isosurface");
}

#[test]
fn greatest_values_and_isosurfaces() {
    let mut s =
        scene(vec![volume(TextureFormat::R16)], vec![block([4.0, -8.0, 2.0], 9.0, [0.2, 0.6, 1.0], 0.4)]);
    s.volumes[0].mode = VolumeMode::Mip;
    cpu_alone_agrees(&s, "MIP");
    s.camera = parallel();
    s.volumes[0].pieces = pieces(&[
        Affine::translation(Vector::new(3.0, -2.0, 9.0)),
        Affine::identity(),
        Affine::translation(Vector::new(-5.0, 1.0, 2.0)),
    ]);
    cpu_alone_agrees(&s, "MIP of fragments, parallel");
    s.volumes[0].mode = VolumeMode::Isosurface { value: 200.0, opacity: 0.5 };
    cpu_alone_agrees(&s, "isosurface of fragments, parallel");
    s.volumes.push(VolumeItem {
        pose: Affine::translation(Vector::new(9.0, 2.0, -3.0)),
        ..volume(TextureFormat::R16)
    });
    s.camera = perspective();
    cpu_alone_agrees(&s, "isosurface within a translucent volume");
    if !has_gpu() {
        return;
    }
    let refused = renderer().render(&s, SIZE, Quality::Good);
    assert!(matches!(refused, Err(GpuError::CpuOnly { .. })), "the passes say that they cannot: {refused:?}");
}

#[test]
fn more_fragments_than_slots_meet() {
    let mut s = scene(vec![volume(TextureFormat::R16)], vec![]);
    let cutters: Vec<Cutter> =
        (0..9).map(|i| plane([0.0, 0.0, f64::from(i) * 4.0 - 18.0], [0.2, 0.1, 1.0])).collect();
    s.volumes[0].pieces = (0..=9)
        .map(|i| {
            let mut keep = Vec::new();
            if i > 0 {
                keep.push((cutters[i - 1], Side::Plus));
            }
            if i < 9 {
                keep.push((cutters[i], Side::Minus));
            }
            Piece { keep, pose: Affine::identity() }
        })
        .collect();
    agrees(&s, "ten fragments", 60.0, 2.0);
}

#[test]
fn sixteen_volumes_that_overlap_with_surfaces_among_them() {
    let volumes = (0..16).map(|i| {
        let hue = f64::from(i) / 15.0;
        let points = vec![point(-200.0, hue, 1.0 - hue, 0.5, 0.0), point(600.0, hue, 1.0 - hue, 0.9, 0.04)];
        VolumeItem {
            pose: Affine::rotation_about(Point::origin(), Vector::new(1.0, 0.2, hue), 0.4 * f64::from(i)),
            transfer: Arc::new(Transfer::new(points, 2.0).unwrap()),
            ..volume(TextureFormat::R16)
        }
    });
    let meshes = vec![
        block([0.0, 0.0, 0.0], 11.0, [0.2, 0.6, 1.0], 0.3),
        block([5.0, -4.0, 3.0], 9.0, [1.0, 0.2, 0.3], 0.5),
        block([-9.0, 3.0, -6.0], 7.0, [0.3, 1.0, 0.3], 1.0),
    ];
    let stats = agrees(&scene(volumes.collect(), meshes), "sixteen volumes", 60.0, 2.0);
    assert!(stats.most_overlapping == 16 || stats.draws == 0, "all meet: {stats:?}");
}

#[test]
fn the_eye_may_be_inside_the_volume_or_look_along_up() {
    let mut s = scene(vec![volume(TextureFormat::R16)], vec![block([0.0; 3], 9.0, [0.2, 0.6, 1.0], 0.4)]);
    s.camera.eye = Point::new(6.0, -14.0, 6.0);
    s.camera.projection = Projection::Perspective { fov_rad: 1.2 };
    agrees(&s, "eye inside", 60.0, 2.0);
    s.camera = Camera { eye: Point::new(0.0, 0.0, 90.0), ..perspective() };
    agrees(&s, "up along the view", 60.0, 2.0);
}

#[test]
fn lossy_textures_state_their_error_and_stay_near() {
    for (format, psnr_db) in [
        (TextureFormat::Bc4, 45.0),
        (TextureFormat::Bc5, 52.0),
        (TextureFormat::Bc7, 30.0),
        (TextureFormat::Rgba8, 30.0),
        (TextureFormat::Bc3, 28.0),
    ] {
        let s = scene(vec![volume(format)], vec![]);
        let stats = agrees(&s, "lossy texture", psnr_db, 128.0);
        for t in &stats.textures {
            assert_eq!(t.stored, Stored::Grid(format), "no fall-back is needed here");
            assert!(t.max_error > 0.0 && t.psnr_db.is_finite(), "the error is stated: {t:?}");
        }
    }
}

#[test]
fn a_scene_far_from_the_origin_gives_the_same_picture() {
    let mut s =
        scene(vec![volume(TextureFormat::R16)], vec![block([2.0, -8.0, 4.0], 9.0, [0.2, 0.6, 1.0], 0.4)]);
    s.volumes[0].pieces = pieces(&[Affine::identity(); 3]);
    let near = draw(&s, Quality::Good);
    let far = Vector::new(1e6, -1e6, 1e6);
    let shift = Affine::translation(far);
    s.volumes[0].pose = shift * s.volumes[0].pose;
    for piece in &mut s.volumes[0].pieces {
        for (cutter, _) in &mut piece.keep {
            *cutter = cutter.moved(&shift);
        }
    }
    s.meshes[0].pose = shift * s.meshes[0].pose;
    s.camera.eye += far;
    s.camera.target += far;
    let (Some((a, _)), Some((b, _))) = (near, draw(&s, Quality::Good)) else { return };
    let d = a.difference(&b, s.background).unwrap();
    assert!(d.max <= 1.0, "{d:?}");
}

#[test]
fn the_error_falls_with_the_square_of_the_spacing() {
    let s = scene(vec![volume(TextureFormat::R16)], vec![]);
    let truth = truth(&s);
    let error = |voxels| {
        let (picture, _) = draw(&s, Quality::Spacing(voxels))?;
        Some(picture.difference(&truth, s.background).unwrap().mean)
    };
    let (Some(coarse), Some(fine)) = (error(1.0), error(0.25)) else { return };
    let order = (coarse / fine).log2() / 2.0;
    assert!(order > 1.8, "order {order}: mean error {coarse} at 1 voxel, {fine} at a quarter");
}

#[test]
fn thousands_of_faint_slices_keep_their_sum() {
    // 2048 sub-steps through a slab that lets e⁻¹ through in all.
    let grid = synth::homogeneous([16, 16, 16], 1.0, Affine::translation(Vector::repeat(-7.5))).unwrap();
    let opacity = -(-1.0_f64 / 16.0).exp_m1();
    let transfer =
        Transfer::new(vec![point(0.0, 1.0, 0.5, 0.25, opacity), point(2.0, 1.0, 0.5, 0.25, opacity)], 1.0);
    let mut s = scene(vec![volume(TextureFormat::R16)], vec![]);
    s.volumes[0].grid = Arc::new(grid);
    s.volumes[0].transfer = Arc::new(transfer.unwrap());
    s.camera = Camera {
        eye: Point::new(0.0, -40.0, 0.0),
        projection: Projection::Parallel { height_mm: 12.0 },
        ..perspective()
    };
    let Some((picture, stats)) = draw(&s, Quality::Spacing(1.0 / 128.0)) else { return };
    assert!(stats.slabs * stats.steps_per_slab >= 2048, "{stats:?}");
    let worst = picture
        .pixels
        .iter()
        .map(|p| (f64::from(p[3]) - (1.0 - (-1.0_f64).exp())).abs() * 255.0)
        .fold(0.0, f64::max);
    assert!(worst <= 0.25, "off by {worst}/255");
}

#[test]
fn what_is_hidden_or_clear_makes_no_texture() {
    let mut s = scene(vec![volume(TextureFormat::R16)], vec![]);
    s.volumes[0].transfer = Arc::new(Transfer::new(vec![point(0.0, 1.0, 1.0, 1.0, 0.0)], 1.0).unwrap());
    let Some((picture, stats)) = draw(&s, Quality::Good) else { return };
    assert!(stats.textures.is_empty() && stats.fragments_skipped == 1, "{stats:?}");
    assert!(picture.pixels.iter().all(|p| *p == [0.0; 4]), "nothing is drawn");
    s.volumes[0].pieces.clear();
    let Some((_, stats)) = draw(&s, Quality::Good) else { return };
    assert!(stats.textures.is_empty() && stats.bricks == 0, "{stats:?}");
}

#[test]
fn pictures_that_cannot_be_are_errors() {
    let s = scene(vec![volume(TextureFormat::R16)], vec![]);
    let Some((one, _)) = draw_sized(&s, [1, 1], Quality::Good) else { return };
    assert_eq!(one.pixels.len(), 1, "one pixel is a picture");
    let mut renderer =
        RENDERER.as_ref().map_err(Clone::clone).unwrap().lock().unwrap_or_else(PoisonError::into_inner);
    let empty = renderer.render(&s, [0, 5], Quality::Good);
    assert_eq!(empty, Err(GpuError::EmptyPicture { width: 0, height: 5 }), "no pixels");
    let huge = renderer.render(&s, [1 << 20, 5], Quality::Good);
    assert!(matches!(huge, Err(GpuError::TooLarge { .. })), "{huge:?}");
    let mut blind = s;
    blind.camera.target = blind.camera.eye;
    assert!(matches!(renderer.render(&blind, SIZE, Quality::Good), Err(GpuError::Camera(_))), "no direction");
}

#[test]
fn touched_voxels_cost_their_own_blocks_and_the_picture_is_that_of_the_whole() {
    if !has_gpu() {
        return;
    }
    let old = grid();
    let touched = [[20, 15, 10], [27, 22, 14]];
    let inside = |p: [usize; 3]| (0..3).all(|a| (touched[0][a]..touched[1][a]).contains(&p[a]));
    let [nx, ny, _] = old.extent();
    let painted = (0..48 * 40 * 32).map(|i| {
        let value = old.value_at(i) as i16;
        if inside([i % nx, i / nx % ny, i / (nx * ny)]) { value.max(500) } else { value }
    });
    let samples = Samples::I16(painted.collect());
    let new =
        Arc::new(Grid::new([48, 40, 32], samples, Rescale::default(), *old.world_from_voxel()).unwrap());
    assert_eq!(old.range(), new.range(), "the window of values stays");
    for texture in [TextureFormat::Bc3, TextureFormat::Bc4] {
        let with =
            |grid: &Arc<Grid>| scene(vec![VolumeItem { grid: Arc::clone(grid), ..volume(texture) }], vec![]);
        let whole = draw(&with(&new), Quality::Good).unwrap().0;
        let mut renderer = renderer();
        renderer.render(&with(&old), SIZE, Quality::Good).unwrap();
        assert_ne!(renderer.read().unwrap().pixels, whole.pixels, "{texture}: it shows");
        let [sent, stayed] = renderer.replace_grid(&old, &new, touched).unwrap();
        assert!((16..=36).contains(&sent), "{texture}: {sent} blocks for a box of 7 x 7 x 4 voxels");
        assert!(stayed > 10 * sent, "{texture}: {stayed} blocks stayed");
        let stats = renderer.render(&with(&new), SIZE, Quality::Good).unwrap();
        assert_eq!(stats.textures_sent, 0, "{texture}: no texture was made anew");
        assert_eq!(renderer.read().unwrap().pixels, whole.pixels, "{texture}: the picture of the whole");
    }
}
