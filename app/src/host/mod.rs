//! The window: input → tools → edits → scene → picture.
//!
//! [`run`] opens it. Each frame, [`frame::Host`] takes in what was loaded, shows the panels of the
//! [`registry`]'s tools and the four views, collects the edits they ask for through a
//! [`context::ToolContext`], and applies them after the frame. [`session`] holds the case and loads in
//! the background, [`views`] what the views show, [`viewport`] the renderer on the window's device; it
//! alone names wgpu. [`picture`] asks for the 3D picture when [`pacer`] says so, and [`processor`] draws it beside the
//! window where the GPU does not. [`camera`], [`cube`], [`layout`] and
//! [`pick`] are plain numbers.
//!
//! Setting `OSTEOTOME_SCREENSHOT=PATH.png` makes the window draw until everything is loaded and at
//! rest, write its picture there and close; see [`screenshot`]. A graphics device that is lost, or that
//! `OSTEOTOME_LOSE_GPU=N` gives up, closes the window, which opens again on another; see [`loss`].

pub mod camera;
mod color_bar;
pub mod context;
pub mod cube;
pub mod dialogs;
pub mod frame;
pub mod help;
pub mod layout;
pub mod loss;
pub mod overlay;
pub mod pacer;
pub mod pick;
pub mod picture;
pub mod pointer;
pub mod processor;
pub mod registry;
pub mod screenshot;
mod section_key;
pub mod section_view;
pub mod session;
pub mod spatial_view;
pub mod status;
pub mod tool;
mod turning;
pub mod viewport;
pub mod views;

#[cfg(test)]
mod tests;

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use thiserror::Error;

use crate::case::Case;
use crate::sample;
use crate::ui::theme;
use frame::Host;
use screenshot::ScreenshotError;

/// Why the window did not open, or did not do what was asked of it.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum HostError {
    /// No display, or no device that can draw on it.
    #[error(
        "the window cannot open ({0}); check the display and the graphics driver, or use `osteotome render`"
    )]
    Window(#[from] eframe::Error),
    /// The device of an open window is gone for good.
    #[error("the graphics device stopped answering and the window cannot open again ({reason}); {kept}")]
    Lost {
        /// Why it cannot.
        reason: String,
        /// Where the plan is.
        kept: loss::Rescued,
    },
    /// Two tools have one id.
    #[error(transparent)]
    Registry(#[from] registry::RegistryError),
    /// The screenshot asked for by the environment was not written.
    #[error(transparent)]
    Screenshot(#[from] ScreenshotError),
}

/// Opens the window on `paths` (cases, volumes, surfaces, folders), or on the built-in sample case where
/// there are none, and returns when it is closed.
///
/// Where its device is lost it is opened again, with all that was planned.
///
/// # Errors
/// [`HostError`].
pub fn run(paths: Vec<PathBuf>) -> Result<(), HostError> {
    let mut registry = registry::Registry::default();
    crate::tools::register_all(&mut registry)?;
    let failure: Arc<Mutex<Option<ScreenshotError>>> = Arc::default();
    // Work in the background outlives a window, and wakes the one that is open.
    let open: Arc<Mutex<Option<egui::Context>>> = Arc::default();
    let to_wake = Arc::clone(&open);
    let wake: session::Wake = Arc::new(move || {
        let ctx = to_wake.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(ctx) = ctx {
            ctx.request_repaint();
        }
    });
    let case = if paths.is_empty() { sample::case() } else { Case::default() };
    let mut host = Host::new(case, registry, Arc::clone(&wake));
    host.open(paths);
    host.screenshot(screenshot::Screenshot::from_environment(), Arc::clone(&failure));
    host.lose_before(loss::ordered());
    let mut losses = loss::Losses::new();
    loop {
        let window = &mut host;
        let (open, wake) = (Arc::clone(&open), Arc::clone(&wake));
        let create: eframe::AppCreator<'_> = Box::new(move |creation| {
            theme::apply(&creation.egui_ctx);
            *open.lock().unwrap_or_else(PoisonError::into_inner) = Some(creation.egui_ctx.clone());
            if let Some(state) = &creation.wgpu_render_state {
                window.attach(viewport::Viewport::new(state, wake));
            }
            Ok(Box::new(Window(window)))
        });
        match eframe::run_native("Osteotome", options(), create) {
            Ok(()) if !host.is_lost() => break,
            Ok(()) if losses.again(Instant::now()) => {}
            Ok(()) => {
                let reason = "it was lost time and again".to_owned();
                return Err(HostError::Lost { reason, kept: loss::rescue(host.session_mut()) });
            }
            Err(error) if losses.any() => {
                let reason = error.to_string();
                return Err(HostError::Lost { reason, kept: loss::rescue(host.session_mut()) });
            }
            Err(error) => return Err(error.into()),
        }
    }
    let failed = failure.lock().unwrap_or_else(PoisonError::into_inner).take();
    failed.map_or(Ok(()), |error| Err(error.into()))
}

fn options() -> eframe::NativeOptions {
    eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("Osteotome")
            .with_app_id("osteotome")
            .with_inner_size([1600.0, 1000.0])
            .with_min_inner_size([900.0, 600.0])
            .with_drag_and_drop(true),
        wgpu_options: viewport::configuration(),
        ..Default::default()
    }
}

/// The host as eframe shows it: lent, so that it outlives the window.
struct Window<'a>(&'a mut Host);

impl eframe::App for Window<'_> {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        self.0.frame_ui(ui);
    }
}
