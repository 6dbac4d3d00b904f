//! The whole window without a device: panels, sections, keys.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use egui::{Key, Modifiers, PointerButton, pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use render::volume::{Cutter, Point, Shape, Vector};

use super::frame::Host;
use super::registry::Registry;
use crate::case::grids::{FieldChoice, GridChange};
use crate::case::{Case, Edit, NamedCutter};

/// A volume of 24 × 20 × 16 voxels of 2 mm, written as NRRD: what a user would open.
fn nrrd(folder: &std::path::Path) -> PathBuf {
    let path = folder.join("box.nrrd");
    let head = "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: left-posterior-superior\n\
                sizes: 24 20 16\nspace directions: (2,0,0) (0,2,0) (0,0,2)\nspace origin: (0,0,0)\n\
                encoding: raw\n\n";
    let mut bytes = head.as_bytes().to_vec();
    bytes.extend((0..24 * 20 * 16).map(|i| (i % 251) as u8));
    std::fs::write(&path, bytes).expect("written");
    path
}

fn window(case: Case) -> Harness<'static, Host> {
    let mut registry = Registry::default();
    crate::tools::register_all(&mut registry).expect("tools");
    let host = Host::new(case, registry, Arc::new(|| ()));
    let draw = |ui: &mut egui::Ui, host: &mut Host| host.frame_ui(ui);
    Harness::builder().with_size([1200.0, 800.0]).with_max_steps(20).build_ui_state(draw, host)
}

/// Draws frames until nothing is being loaded.
fn rest(window: &mut Harness<'_, Host>) {
    for _ in 0..2000 {
        window.step();
        if window.state().session().is_idle() {
            window.run_steps(3);
            return;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("loading does not end");
}

#[test]
fn a_dropped_volume_is_shown_in_three_sections_and_a_click_moves_the_crosshair() {
    let folder = tempfile::tempdir().expect("folder");
    let mut window = window(Case::default());
    window.state_mut().open([nrrd(folder.path())]);
    rest(&mut window);
    assert_eq!(window.state().session().problems(), [], "no complaint");
    assert_eq!(window.state().session().case().volumes.len(), 1, "one volume");
    let before = window.state().views().crosshair.expect("a crosshair in the middle of the volume");
    assert_eq!(before, Point::new(23.0, 19.0, 15.0), "its middle");
    for name in ["Axial", "Coronal", "Sagittal", "3D view"] {
        assert!(window.query_by_label(name).is_some(), "{name} is there");
    }
    // In the axial view the right of the picture is the patient's left, +x, and down is the back, +y.
    let axial = window.get_by_label("Axial").rect();
    let at = axial.center() + egui::vec2(30.0, 12.0);
    for pressed in [true, false] {
        window.event(egui::Event::PointerMoved(at));
        window.event(egui::Event::PointerButton {
            pos: at,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        });
        window.step();
    }
    window.run_steps(2);
    let moved = window.state().views().crosshair.expect("a crosshair") - before;
    assert!(moved.x > 0.5 && moved.y > 0.2 && moved.z == 0.0, "left, back, same slice: {moved}");
    assert!((moved.x / moved.y - 2.5).abs() < 0.01, "millimetres are equal both ways: {moved}");
}

#[test]
fn an_edit_is_undone_and_redone_by_its_keys() {
    let plane = Cutter::plane(Point::origin(), Vector::z()).expect("plane");
    let case = Case { cutters: vec![NamedCutter::new("cut", plane)], ..Case::default() };
    let mut window = window(case);
    window.run_steps(2);
    window.get_by_label("Cutting").click();
    window.run_steps(2);
    window.get_by_label("Remove").click();
    window.run_steps(2);
    let count = |window: &Harness<'_, Host>| window.state().session().case().cutters.len();
    assert_eq!(count(&window), 0, "removed");
    window.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    window.run_steps(2);
    assert_eq!(count(&window), 1, "undone");
    window.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    window.run_steps(2);
    assert_eq!(count(&window), 0, "redone");
}

#[test]
fn a_fault_is_shown_until_it_is_dismissed() {
    let mut window = window(Case::default());
    window.state_mut().open([PathBuf::from("/there/is/no/such.nii")]);
    rest(&mut window);
    assert_eq!(window.state().session().problems().len(), 1, "one complaint");
    window.get_by_label("Dismiss").click();
    window.run_steps(2);
    assert!(window.query_by_label("Dismiss").is_none(), "read and gone");
}

#[test]
fn dragging_the_view_orbits_and_a_letter_key_looks_from_that_side() {
    let folder = tempfile::tempdir().expect("folder");
    let mut window = window(Case::default());
    window.state_mut().open([nrrd(folder.path())]);
    rest(&mut window);
    let camera = |window: &Harness<'_, Host>| window.state().session().case().camera;
    assert_eq!(camera(&window), None, "nobody has chosen one");
    window.key_press(Key::L);
    window.run_steps(2);
    let left = camera(&window).expect("a camera");
    let out = (left.eye - left.target).normalize();
    assert!((out - Vector::x()).norm() < 1e-9, "from the patient's left: {out}");
    let middle = window.get_by_label("3D view").rect().center();
    drag(&mut window, middle, pos2(middle.x + 80.0, middle.y));
    let turned = camera(&window).expect("a camera");
    assert!((turned.eye - left.eye).norm() > 1.0, "it turned");
    assert!((turned.target - left.target).norm() < 1e-9, "about its target");
    assert!(window.state().session().history().is_saved(), "looking is no change of the plan");
}

#[test]
fn a_handle_is_dragged_in_the_view_and_escape_puts_it_back() {
    let folder = tempfile::tempdir().expect("folder");
    let mut window = window(Case::default());
    window.state_mut().open([nrrd(folder.path())]);
    rest(&mut window);
    let plane = Cutter::plane(Point::new(23.0, 19.0, 15.0), Vector::z()).expect("plane");
    let add = Edit::AddCutter(NamedCutter::new("cut", plane));
    window.state_mut().apply(add);
    window.get_by_label("Cutting").click();
    window.run_steps(3);
    let view = window.get_by_label("3D view").rect();
    let cutter = |window: &Harness<'_, Host>| window.state().session().case().cutters[0].cutter;
    // The volume's ball is in the middle of the picture; the arrow of its axial plane points upwards.
    let ball_mm = 0.5 * (48.0_f64.powi(2) + 40.0_f64.powi(2) + 32.0_f64.powi(2)).sqrt();
    let distance = ball_mm / (15.0_f64.to_radians()).sin();
    let points_per_mm = f64::from(view.height()) / 2.0 / (distance * 15.0_f64.to_radians().tan());
    let tip = view.center() - egui::vec2(0.0, (ball_mm * 0.35 * 0.8 * points_per_mm) as f32);
    drag(&mut window, tip, tip - egui::vec2(0.0, 40.0));
    let dragged = cutter(&window);
    let Shape::Plane { point, normal } = *dragged.shape() else { panic!("a plane") };
    let went = point.z - 15.0;
    assert!((went - 40.0 / points_per_mm).abs() < 0.05 * went, "as far as the pointer: {went} mm");
    assert_eq!((point.x, point.y, normal), (23.0, 19.0, Vector::z()), "along its normal alone");
    // Again, but thought better of.
    let tip = tip - egui::vec2(0.0, 40.0);
    press(&mut window, tip, true);
    for step in 1..=5 {
        window.event(egui::Event::PointerMoved(tip - egui::vec2(0.0, 10.0 * step as f32)));
        window.step();
    }
    assert_ne!(cutter(&window), dragged, "it follows");
    window.key_press(Key::Escape);
    window.run_steps(2);
    assert_eq!(cutter(&window), dragged, "back where the drag began");
}

/// A tetrahedron from (10, 0, 0), 8 mm along each axis, with the scalar "load" on its corners, as legacy VTK.
fn vtk(folder: &std::path::Path) -> PathBuf {
    let path = folder.join("bone.vtk");
    let text = "# vtk DataFile Version 3.0\nmade\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n\
                10 0 0 18 0 0 10 8 0 10 0 8\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 4\n\
                SCALARS load double 1\nLOOKUP_TABLE default\n0 4 8 12\n";
    std::fs::write(&path, text).expect("written");
    path
}

#[test]
fn a_dropped_grid_is_shown_and_a_field_that_it_has_not_is_said_once() {
    let folder = tempfile::tempdir().expect("folder");
    let mut window = window(Case::default());
    window.state_mut().open([vtk(folder.path())]);
    rest(&mut window);
    assert_eq!(window.state().session().problems(), [], "no complaint");
    assert_eq!(window.state().session().case().grids[0].id, "bone", "one grid");
    assert_eq!(window.state().views().crosshair, Some(Point::new(14.0, 4.0, 4.0)), "the middle of its box");
    window.get_by_label("Simulation").click();
    window.run_steps(3);
    window.get_by_label("The crosshair is outside of the grid.");
    window.get_by_label("Go to the greatest").click();
    window.run_steps(3);
    assert_eq!(window.state().views().crosshair, Some(Point::new(10.0, 0.0, 8.0)), "where it is greatest");
    window.get_by_label("At the crosshair 12");
    let change = |change| Edit::ChangeGrid { id: "bone".to_owned(), change };
    let strain = FieldChoice { name: "strain".to_owned(), place: None, part: None };
    window.state_mut().apply(change(GridChange::Field(Some(strain))));
    window.run_steps(3);
    let problems = window.state().session().problems();
    assert_eq!(problems.len(), 1, "one sentence for many frames");
    assert!(problems[0].text.contains("no field \"strain\""), "{problems:?}");
    window.get_by_label("Dismiss").click();
    window.run_steps(3);
    assert_eq!(window.state().session().problems(), [], "read, and not said again");
}

fn press(window: &mut Harness<'_, Host>, at: egui::Pos2, pressed: bool) {
    window.event(egui::Event::PointerMoved(at));
    window.step();
    window.event(egui::Event::PointerButton {
        pos: at,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    });
    window.step();
}

fn drag(window: &mut Harness<'_, Host>, from: egui::Pos2, to: egui::Pos2) {
    press(window, from, true);
    for step in 1..=8 {
        let part = step as f32 / 8.0;
        window.event(egui::Event::PointerMoved(from + (to - from) * part));
        window.step();
    }
    press(window, to, false);
    window.run_steps(2);
}
