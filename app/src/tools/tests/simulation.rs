//! The panel of simulations: what each of its widgets asks for.

use render::volume::cells::{Part, Place};

use super::*;
use crate::case::grids::{FieldChoice, GridChange};
use crate::colormaps::COLORMAPS;

fn shown(bench: Bench) -> Harness<'static, Bench> {
    let mut panel = panel(bench, ToolId("simulation"));
    panel.run();
    panel
}

/// The changes of the grid that were asked for.
fn changes(panel: &Harness<'_, Bench>) -> Vec<GridChange> {
    let of = |edit: &Edit| match edit {
        Edit::ChangeGrid { id, change } => {
            assert_eq!(id, "load", "of the chosen grid");
            change.clone()
        }
        other => panic!("a change of a grid, not {other:?}"),
    };
    panel.state().edits.iter().map(of).collect()
}

/// Does what was asked for, as the window does after the frame.
fn obey(panel: &mut Harness<'_, Bench>) {
    for step in std::mem::take(&mut panel.state_mut().edits) {
        edit::apply(&mut panel.state_mut().case, step).expect("a change");
    }
    panel.run();
}

fn choose(panel: &mut Harness<'_, Bench>, combo: &str, choice: &str) {
    panel.get_by_label(combo).click();
    panel.run();
    panel.get_by_label(choice).click();
    panel.run();
}

#[test]
fn a_grid_is_hidden_and_removed() {
    let mut panel = shown(bench());
    panel.get_by_label("Show load").click();
    panel.run();
    assert_eq!(changes(&panel), [GridChange::Visible(false)], "hidden");
    panel.state_mut().edits.clear();
    panel.get_by_label("Remove").click();
    panel.run();
    assert_eq!(changes(&panel), [GridChange::Remove], "taken away");
}

#[test]
fn a_field_is_chosen_and_what_of_it() {
    let mut panel = shown(bench());
    choose(&mut panel, "Field", "moved (points)");
    let choice = |part| FieldChoice { name: "moved".to_owned(), place: Some(Place::Points), part };
    assert_eq!(changes(&panel), [GridChange::Field(Some(choice(None)))], "the vector");
    obey(&mut panel);
    panel.get_by_label_contains("Greatest 22.56");
    choose(&mut panel, "of it", "y");
    assert_eq!(
        changes(&panel),
        [GridChange::Field(Some(choice(Some(Part::Component(1)))))],
        "its second part"
    );
    obey(&mut panel);
    panel.get_by_label_contains("Greatest 13");
    choose(&mut panel, "Field", "part (cells)");
    obey(&mut panel);
    panel.get_by_label_contains("Least 1");
    panel.get_by_label_contains("at 1.50, 1.50, 1.50 mm");
}

#[test]
fn colours_range_and_opacity_are_one_transfer_function() {
    let mut panel = shown(bench());
    choose(&mut panel, "Colour map", "Viridis");
    obey(&mut panel);
    let transfer =
        |panel: &Harness<'_, Bench>| panel.state().case.grids[0].transfer.clone().expect("its own");
    assert!(COLORMAPS[1].is_of(&transfer(&panel)), "in those colours");
    let ends = |t: &Transfer| [0, t.points().len() - 1].map(|i| t.points()[i].value);
    assert_eq!(ends(&transfer(&panel)), [-10.0, 50.5], "over both steps");
    panel.get_by_label("1 to 99 %").click();
    panel.run();
    obey(&mut panel);
    assert_eq!(ends(&transfer(&panel)), [-10.0, 50.0], "of the step that is shown");
    assert!(COLORMAPS[1].is_of(&transfer(&panel)), "in the same colours");
    panel.get_by_label("Full range").click();
    panel.run();
    obey(&mut panel);
    assert_eq!(ends(&transfer(&panel)), [-10.0, 50.5], "whole again");
    panel.get_by_label("Default colours").click();
    panel.run();
    assert_eq!(changes(&panel), [GridChange::Transfer(None)], "as before anybody chose");
}

#[test]
fn least_and_greatest_say_where_and_put_the_crosshair_there() {
    let mut bench = bench();
    bench.case.grids[0].pose = Affine::translation(Vector::new(0.0, 0.0, 100.0));
    bench.case.grids[0].scale = 2.0;
    bench.case.grids[0].unit = "MPa".to_owned();
    bench.views.crosshair = Some(Point::new(2.0, 2.0, 102.0));
    let mut panel = shown(bench);
    panel.get_by_label("Greatest 50 MPa");
    panel.get_by_label("Least -10 MPa");
    // Of the corners of the first cell: 1/6 of three, half of the origin.
    panel.get_by_label("At the crosshair 21.67 MPa");
    panel.get_by_label_contains("at 0.00, 0.00, 112.00 mm");
    assert_eq!(panel.state().drawn, 4, "two dots with words over the 3D view");
    panel.get_by_label("Go to the least").click();
    panel.run();
    assert_eq!(panel.state().views.crosshair, Some(Point::new(12.0, 12.0, 112.0)), "there");
    panel.get_by_label("At the crosshair -10 MPa");
    panel.state_mut().views.crosshair = Some(Point::new(0.0, 0.0, 99.0));
    panel.run();
    panel.get_by_label("The crosshair is outside of the grid.");
}

#[test]
fn a_grid_rides_on_a_fragment_and_is_put_at_the_crosshair_there() {
    let mut bench = bench();
    bench.case.fragments[0].pose = Affine::translation(Vector::new(0.0, 50.0, 0.0));
    bench.views.crosshair = Some(Point::new(1.0, 52.0, 3.0));
    let mut panel = shown(bench);
    choose(&mut panel, "is what it rides on", "left part");
    assert_eq!(changes(&panel), [GridChange::Fragment(Some("left part".to_owned()))], "by its id");
    obey(&mut panel);
    panel.get_by_label("Put its middle at the crosshair").click();
    panel.run();
    obey(&mut panel);
    let Bench { case, .. } = panel.state();
    let middle = crate::scene::world_from_grid(case, &case.grids[0]).point(&Point::new(3.0, 3.0, 3.0));
    assert!((middle - Point::new(1.0, 52.0, 3.0)).norm() < 1e-12, "where the fragment is now: {middle}");
}

#[test]
fn a_step_is_played() {
    let mut panel = shown(bench());
    panel.get_by_label("step 1 of 2, at 0");
    panel.get_by_label("Play").click();
    // It asks for frame after frame: a fixed number is run.
    panel.run_steps(40);
    let asked = changes(&panel);
    assert!(!asked.is_empty() && asked.iter().all(|c| *c == GridChange::Step(1)), "the next: {asked:?}");
    panel.get_by_label("Pause").click();
    panel.run_steps(2);
    panel.state_mut().edits.clear();
    panel.run_steps(40);
    assert!(panel.state().edits.is_empty(), "it has stopped");
}

#[test]
fn a_field_that_is_not_there_is_said_and_another_can_be_chosen() {
    let mut bench = bench();
    bench.case.grids[0].field = Some(FieldChoice { name: "strain".to_owned(), place: None, part: None });
    let mut panel = shown(bench);
    panel.get_by_label_contains("has no field \"strain\"");
    choose(&mut panel, "Field", "stress (points)");
    assert!(matches!(changes(&panel)[..], [GridChange::Field(Some(_))]), "another");
}
