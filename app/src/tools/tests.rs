//! Every registered tool's panel, drawn by being listed; and what a few of their widgets ask for.

use std::sync::Arc;

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use render::volume::cells::{CellKind, Field, Step, Values};
use render::volume::{
    Affine, CellGrid, ControlPoint, Cutter, Grid, Point, Rescale, Samples, Series, Shape, Side, Transfer,
    TriangleMesh, Vector,
};

use super::register_all;
use crate::case::assets::{Asset, Data, Key};
use crate::case::labels::LabelChange;
use crate::case::{
    Assets, Case, Edit, Fragment, Implant, LabelSet, NamedCutter, Source, UnstructuredGrid, Volume, edit,
};
use crate::host::context::{Request, Selection, ToolContext, VolumeMode};
use crate::host::overlay::Overlay;
use crate::host::pointer::{Phase, SectionEvent};
use crate::host::registry::Registry;
use crate::host::tool::ToolId;
use crate::host::views::{Orientation, Views};
use crate::steps::Steps;

mod simulation;

/// What a tool is drawn in.
#[derive(Default)]
struct Bench {
    case: Case,
    assets: Assets,
    selection: Selection,
    views: Views,
    edits: Vec<Edit>,
    requests: Vec<Request>,
    registry: Registry,
    drawn: usize,
    width: f32,
}

fn asset(key: Key, data: Data) -> Arc<Asset> {
    Arc::new(Asset { key, name: "made".into(), format: "test", modality: None, data, notes: Vec::new() })
}

/// Two tetrahedra with a scalar and a vector on their points and a scalar on the cells, at two moments.
fn cells() -> CellGrid {
    let points = [[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [0.0, 6.0, 0.0], [0.0, 0.0, 6.0], [6.0, 6.0, 6.0]];
    let step = |time: f64| {
        let field = |name: &str, components, values: Vec<f64>| {
            Field::new(name.to_owned(), components, Values::F64(values))
        };
        let stress = field("stress", 1, [10.0, 20.0, 30.0, 50.0, -10.0].map(|v| v + time).to_vec());
        let moved = field("moved", 3, (0..15).map(f64::from).collect());
        let part = field("part", 1, vec![1.0, 2.0]);
        Step { time, point_fields: vec![stress, moved], cell_fields: vec![part] }
    };
    let corners = vec![0, 1, 2, 3, 1, 2, 3, 4];
    let points = points.map(Point::from).to_vec();
    CellGrid::new(points, vec![CellKind::Tetra; 2], corners, vec![step(0.0), step(0.5)]).expect("cells")
}

/// A bench with one of everything: a loaded volume in two fragments, a plane, a cylinder, an implant, a grid of cells.
fn bench() -> Bench {
    let samples = (0..8 * 8 * 8).map(|i| i as i16).collect();
    let grid = Grid::new([8, 8, 8], Samples::I16(samples), Rescale::default(), Affine::identity());
    let corners = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 4.0, 0.0]].map(Point::from).to_vec();
    let mesh = TriangleMesh::new(corners, vec![[0, 1, 2]]).expect("mesh");
    let point = |value, a| ControlPoint { value, rgba: [1.0, 0.8, 0.6, a] };
    let transfer = Transfer::new(vec![point(100.0, 0.0), point(400.0, 0.5)], 1.0).expect("transfer");
    let volume = Volume::new("ct", Source::Builtin("test/ct".into()), Arc::new(transfer));
    let implant = Implant::new("plate", Source::Builtin("test/plate".into()));
    let load = UnstructuredGrid::new("load", Source::Builtin("test/load".into()));
    let mut assets = Assets::default();
    assets.insert(asset(Key::of_volume(&volume), Data::Grid(Arc::new(grid.expect("grid")))));
    assets.insert(asset(Key::of_implant(&implant), Data::Mesh(Arc::new(mesh))));
    assets.insert(asset(Key::of_grid(&load), Data::Cells(Arc::new(cells()))));
    let plane = Cutter::plane(Point::new(3.5, 3.5, 3.5), Vector::x()).expect("plane");
    let tube = Cutter::cylinder(Point::new(3.5, 3.5, 3.5), Vector::z(), 2.0).expect("tube");
    let piece = |id: &str, side| Fragment::new(id, "ct", [("cut".to_owned(), side)].into());
    let case = Case {
        volumes: vec![volume],
        implants: vec![implant],
        grids: vec![load],
        cutters: vec![NamedCutter::new("cut", plane), NamedCutter::new("drill", tube)],
        fragments: vec![piece("left part", Side::Plus), piece("right part", Side::Minus)],
        labels: vec![LabelSet::new("necrosis", "ct", None)],
        ..Case::default()
    };
    let mut bench = Bench { case, assets, views: Views::new(), ..Bench::default() };
    register_all(&mut bench.registry).expect("no two tools of one id");
    bench.selection.repair(&bench.case);
    bench.views.adopt(&bench.case, &bench.assets);
    bench
}

/// The panel of one tool, as the window shows it.
fn panel(bench: Bench, id: ToolId) -> Harness<'static, Bench> {
    let draw = move |ui: &mut egui::Ui, bench: &mut Bench| {
        let Bench { case, assets, selection, views, edits, requests, registry, drawn, width } = bench;
        let mut context = ToolContext::new(case, assets, selection, views, edits, requests);
        let tool = registry.tool_mut(id).expect("a registered tool");
        tool.panel_ui(&mut context, ui);
        let mut overlay = Overlay::default();
        tool.draw(&context, &mut overlay);
        *drawn = overlay.len();
        *width = ui.min_rect().width();
    };
    Harness::builder().with_size([380.0, 1100.0]).build_ui_state(draw, bench)
}

fn ids() -> Vec<ToolId> {
    bench().registry.titles().map(|(id, _)| id).collect()
}

#[test]
fn every_registered_panel_draws_with_and_without_a_case() {
    assert!(
        ids().len() >= 9,
        "volumes, transfer, cutting, fragments, implants, simulation, labels, sections, player"
    );
    for id in ids() {
        let mut full = panel(bench(), id);
        full.run();
        let width = full.state().width;
        assert!(width > 50.0, "{id} shows something");
        assert!(width <= 381.0, "{id} fits the panel's width, not {width}");
        assert!(full.state().edits.is_empty(), "{id} asks for nothing by itself: {:?}", full.state().edits);
        let mut empty = bench();
        (empty.case, empty.assets, empty.selection) = Default::default();
        let mut empty = panel(empty, id);
        empty.run();
        assert!(empty.state().edits.is_empty(), "{id} asks for nothing of an empty case");
    }
}

#[test]
fn a_plane_is_added_through_the_crosshair() {
    let mut bench = bench();
    bench.views.crosshair = Some(Point::new(1.0, 2.0, 3.0));
    let mut panel = panel(bench, ToolId("cutting"));
    assert!(panel.state().drawn > 5, "the chosen cutter has a handle");
    panel.get_by_label("Coronal plane").click();
    panel.run();
    let [Edit::AddCutter(cutter)] = panel.state().edits.as_slice() else {
        panic!("one new cutter, not {:?}", panel.state().edits)
    };
    let Shape::Plane { point, normal } = *cutter.cutter.shape() else { panic!("a plane") };
    assert_eq!((point, normal), (Point::new(1.0, 2.0, 3.0), -Vector::y()), "there, facing the front");
    assert!(panel.state().selection.split_by.contains(&cutter.id), "ready to split by");
}

#[test]
fn splitting_names_the_chosen_cutters_and_the_box() {
    let mut bench = bench();
    bench.selection.split_by = ["cut".to_owned(), "drill".to_owned()].into();
    let mut panel = panel(bench, ToolId("fragments"));
    panel.get_by_label("Split into pieces").click();
    panel.run();
    let [Edit::Split { volume, cutters, corners }] = panel.state().edits.as_slice() else {
        panic!("one split, not {:?}", panel.state().edits)
    };
    assert_eq!((volume.as_str(), cutters.len()), ("ct", 2), "the volume, both cutters");
    assert_eq!(corners[7], Point::new(7.5, 7.5, 7.5), "the box reaches to the voxels' edges");
}

#[test]
fn hiding_a_volume_is_one_edit() {
    let mut panel = panel(bench(), ToolId("volumes"));
    panel.get_by_label("Show ct").click();
    panel.run();
    let wanted = Edit::SetVolumeVisible { id: "ct".to_owned(), visible: false };
    assert_eq!(panel.state().edits, [wanted], "that and nothing else");
}

#[test]
fn the_mode_in_3d_is_chosen_and_an_isosurface_has_a_value_and_an_opacity() {
    let mode = |mode| Edit::SetVolumeMode { id: "ct".to_owned(), mode };
    for (words, chosen) in [
        ("Greatest value (MIP)", VolumeMode::Mip),
        // Half of the greatest opacity is reached half way from 100 to 400.
        ("Isosurface", VolumeMode::Isosurface { value: 250.0, opacity: 1.0 }),
    ] {
        let mut panel = panel(bench(), ToolId("volumes"));
        panel.run();
        panel.get_by_label("Drawn as").click();
        panel.run();
        panel.get_by_label(words).click();
        panel.run();
        // The bench applies nothing, so that a choice that stays open is asked for once.
        assert_eq!(panel.state().edits, [mode(chosen)], "{words}");
    }
    let mut bench = bench();
    bench.case.volumes[0].mode = VolumeMode::Isosurface { value: 9000.0, opacity: 0.5 };
    let mut panel = panel(bench, ToolId("volumes"));
    panel.run();
    assert!(panel.state().edits.is_empty(), "a value out of range is left alone: {:?}", panel.state().edits);
    let opacity = panel.get_all_by_label("Opacity of the surface").next().expect("a slider");
    opacity.focus();
    panel.key_press(egui::Key::ArrowRight);
    panel.run();
    let [Edit::SetVolumeMode { mode: VolumeMode::Isosurface { value, opacity }, .. }] =
        panel.state().edits.as_slice()
    else {
        panic!("one change, not {:?}", panel.state().edits)
    };
    assert!(*value == 9000.0 && *opacity > 0.5, "the opacity alone: {value}, {opacity}");
}

#[test]
fn opening_is_asked_of_the_host() {
    let mut panel = panel(bench(), ToolId("implants"));
    panel.get_by_label("Open a surface…").click();
    panel.run();
    assert_eq!(panel.state().requests, [Request::OpenFile], "a dialog");
}

#[test]
fn an_implant_goes_to_the_crosshair() {
    let mut bench = bench();
    bench.views.crosshair = Some(Point::new(11.0, 12.0, 13.0));
    let mut panel = panel(bench, ToolId("implants"));
    panel.get_by_label("Put it at the crosshair").click();
    panel.run();
    let [Edit::SetImplantPose { id, pose }] = panel.state().edits.as_slice() else {
        panic!("one move, not {:?}", panel.state().edits)
    };
    let middle = pose.point(&Point::new(1.0, 2.0, 0.0));
    assert_eq!(id, "plate", "the chosen one");
    assert!((middle - Point::new(11.0, 12.0, 13.0)).norm() < 1e-12, "its middle is there: {middle}");
}

/// A bench whose volume has four steps, half a second apart.
fn moving() -> Bench {
    let mut bench = bench();
    let grid = |value: i16| {
        let samples = Samples::I16(vec![value; 512]);
        Arc::new(Grid::new([8, 8, 8], samples, Rescale::default(), Affine::identity()).expect("grid"))
    };
    let series = Series::new((0..4).map(grid).collect(), vec![0.0, 0.5, 1.0, 1.5]).expect("series");
    let key = Key::of_volume(&bench.case.volumes[0]);
    bench.assets.insert(asset(key, Data::Steps(Arc::new(Steps::in_memory(series)))));
    bench
}

#[test]
fn the_player_steps_and_plays() {
    let step = |step| Edit::SetStep { id: "ct".to_owned(), step };
    let mut player = panel(moving(), ToolId("player"));
    player.run();
    player.get_by_label_contains("step 1 of 4");
    player.get_by_label("Next").click();
    player.run();
    assert_eq!(player.state().edits, [step(1)], "one on");
    player.state_mut().edits.clear();
    player.get_by_label("Last").click();
    player.run();
    assert_eq!(player.state().edits, [step(3)], "the end");
    player.state_mut().edits.clear();
    player.get_by_label("Play").click();
    // It asks for frame after frame: a fixed number is run.
    player.run_steps(40);
    let edits = &player.state().edits;
    assert!(!edits.is_empty() && edits.iter().all(|e| matches!(e, Edit::SetStep { .. })), "steps: {edits:?}");
    player.get_by_label("Pause").click();
    player.run_steps(2);
    player.state_mut().edits.clear();
    player.run_steps(40);
    assert!(player.state().edits.is_empty(), "it has stopped");
}

#[test]
fn the_player_has_nothing_to_play_of_a_still_volume() {
    let mut player = panel(bench(), ToolId("player"));
    player.run();
    player.get_by_label_contains("No volume over time");
}

#[test]
fn a_stroke_of_the_brush_is_edits_that_paint() {
    let mut panel = panel(bench(), ToolId("labels"));
    panel.run();
    panel.get_by_label("Paint in the sections").click();
    panel.run();
    let Bench { case, assets, selection, views, edits, requests, registry, .. } = panel.state_mut();
    let mut context = ToolContext::new(case, assets, selection, views, edits, requests);
    let tool = registry.tool_mut(ToolId("labels")).expect("the tool");
    assert_eq!(tool.brush_mm(), Some(5.0), "a brush");
    for (phase, x) in [(Phase::Press, 1.0), (Phase::Drag, 2.0), (Phase::Release, 2.0)] {
        tool.section_pointer(&mut context, &SectionEvent { phase, place: Point::new(x, 3.0, 3.0) });
    }
    assert!(context.is_captured(), "the crosshair stays where it is");
    let mut case = panel.state().case.clone();
    for step in panel.state().edits.clone() {
        assert!(matches!(&step, Edit::ChangeLabels { change: LabelChange::Paint(_), .. }), "{step:?}");
        edit::apply(&mut case, step).expect("painted");
    }
    let labels = panel.state().assets.labels(&case, &case.labels[0]).expect("labels");
    assert_eq!(labels.grid.value(1, 3, 3), 1.0, "under the brush");
    assert_eq!(labels.grid.value(4, 3, 3), 0.0, "the other piece is left alone");
}

#[test]
fn a_section_is_turned_by_its_angles_and_reset() {
    let mut bench = bench();
    bench.views.turn(Orientation::Coronal, &Vector::x(), 0.3);
    let mut panel = panel(bench, ToolId("sections"));
    panel.run();
    panel.get_by_label("Back to coronal").click();
    panel.run();
    assert_eq!(panel.state().views.axes(Orientation::Coronal), Orientation::Coronal.axes(), "as it was");
}
