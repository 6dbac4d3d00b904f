//! The window: starts without a screen, draws, and closes.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::support::compare::{colours, open_rgb};
use crate::support::display::Display;
use crate::support::program::{PROGRAM, wait};
use crate::support::{cases, gpu_wanted};

/// Software rendering of every view, on a busy machine, with shaders compiled for the first time.
const LIMIT: Duration = Duration::from_mins(5);

/// The window's picture, and what it said on standard error.
fn screenshot_of(arguments: &[&str], folder: &Path, variables: &[(&str, &str)]) -> (image::RgbImage, String) {
    let display = Display::start();
    let picture = folder.join("window.png");
    let log = folder.join("window.log");
    let mut window = Command::new(PROGRAM)
        .args(arguments)
        .env("DISPLAY", &display.name)
        .env("XDG_RUNTIME_DIR", folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .env("XDG_DATA_HOME", folder.join("data"))
        .env("OSTEOTOME_SCREENSHOT", &picture)
        .env_remove("WAYLAND_DISPLAY")
        .envs(variables.iter().copied())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(&log).unwrap())
        .spawn()
        .unwrap();
    let status = wait(&mut window, LIMIT);
    let said = std::fs::read_to_string(&log).unwrap_or_default();
    let status = status.unwrap_or_else(|| panic!("the window neither drew nor closed in {LIMIT:?}: {said}"));
    assert!(status.success(), "the window closes cleanly after its screenshot: {status}: {said}");
    (open_rgb(&picture), said)
}

/// The ball is orange and nothing of the program's own look is: if it is drawn, some pixels are clearly so.
fn orange(picture: &image::RgbImage) -> usize {
    picture.pixels().filter(|p| p.0[0] > 120 && p.0[0] > p.0[2].saturating_add(60)).count()
}

#[test]
fn the_window_starts_on_a_case_draws_it_and_closes() {
    if !gpu_wanted() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let case = cases::write_case(folder.path(), &cases::cut_ball(folder.path()));
    let (picture, _) = screenshot_of(&[case.to_str().unwrap()], folder.path(), &[]);
    assert!(
        picture.width() >= 800 && picture.height() >= 500,
        "a window of a useful size: {:?}",
        picture.dimensions()
    );
    assert!(colours(&picture) > 1000, "views and panels, not an empty window: {} colours", colours(&picture));
    assert!(orange(&picture) > 2000, "the volume's own colour is on screen: {} pixels", orange(&picture));
}

#[test]
fn a_window_whose_device_is_lost_opens_again_and_draws_the_same_case() {
    if !gpu_wanted() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let case = cases::write_case(folder.path(), &cases::cut_ball(folder.path()));
    let lost = [("OSTEOTOME_LOSE_GPU", "5")];
    let (picture, said) = screenshot_of(&[case.to_str().unwrap()], folder.path(), &lost);
    assert!(said.contains("stopped answering") && !said.contains("panicked"), "{said}");
    assert!(orange(&picture) > 2000, "the case is drawn again: {} pixels", orange(&picture));
}

#[test]
fn the_window_shows_a_grid_in_3d_and_in_sections_with_its_colour_bar() {
    if !gpu_wanted() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let grid = folder.path().join("load.vtk");
    // A wedge of 40 mm whose scalar rises from one end to the other.
    let text = "# vtk DataFile Version 3.0\nmade\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 6 double\n\
                0 0 0 40 0 0 0 40 0 0 0 40 40 0 40 0 40 40\nCELLS 1 7\n6 0 2 1 3 5 4\nCELL_TYPES 1\n13\n\
                POINT_DATA 6\nSCALARS load double 1\nLOOKUP_TABLE default\n0 0 0 5 5 5\n";
    std::fs::write(&grid, text).unwrap();
    let (picture, _) = screenshot_of(&[grid.to_str().unwrap()], folder.path(), &[]);
    let near = |p: &image::Rgb<u8>, to: [u8; 3]| (0..3).all(|c| p.0[c].abs_diff(to[c]) < 12);
    let count = |to: [u8; 3]| picture.pixels().filter(|p| near(p, to)).count();
    // The ends of the default colours: at least in two sections, and at the ends of the bar.
    let (low, high) = (count([59, 76, 192]), count([180, 4, 38]));
    assert!(low > 500 && high > 500, "both ends of the colours are on screen: {low}, {high}");
    assert!(colours(&picture) > 300, "and what is between: {}", colours(&picture));
}
