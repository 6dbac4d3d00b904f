//! The window: input → tools → edits → scene → picture.
//!
//! [`run`] opens it. Each frame, [`frame::Host`] takes in what was loaded, shows the panels of the
//! [`registry`]'s tools and the four views, collects the edits they ask for through a
//! [`context::ToolContext`], and applies them after the frame. [`session`] holds the case and loads in
//! the background, [`views`] what the views show, [`viewport`] the renderer on the window's device; it
//! alone names wgpu. [`pacer`] decides when a picture is drawn. [`camera`], [`cube`], [`layout`] and
//! [`pick`] are plain numbers.
//!
//! Setting `OSTEOTOME_SCREENSHOT=PATH.png` makes the window draw until everything is loaded and at
//! rest, write its picture there and close; see [`screenshot`].

pub mod camera;
pub mod context;
pub mod cube;
pub mod dialogs;
pub mod frame;
pub mod help;
pub mod layout;
pub mod overlay;
pub mod pacer;
pub mod pick;
pub mod pointer;
pub mod registry;
pub mod screenshot;
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
/// # Errors
/// [`HostError`].
pub fn run(paths: Vec<PathBuf>) -> Result<(), HostError> {
    let mut registry = registry::Registry::default();
    crate::tools::register_all(&mut registry)?;
    let failure: Arc<Mutex<Option<ScreenshotError>>> = Arc::default();
    let seen = Arc::clone(&failure);
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("Osteotome")
            .with_app_id("osteotome")
            .with_inner_size([1600.0, 1000.0])
            .with_min_inner_size([900.0, 600.0])
            .with_drag_and_drop(true),
        wgpu_options: viewport::configuration(),
        ..Default::default()
    };
    let create: eframe::AppCreator<'_> = Box::new(move |creation| {
        theme::apply(&creation.egui_ctx);
        let ctx = creation.egui_ctx.clone();
        let wake: session::Wake = Arc::new(move || ctx.request_repaint());
        let case = if paths.is_empty() { sample::case() } else { Case::default() };
        let mut host = Host::new(case, registry, wake);
        host.open(paths);
        if let Some(window) = &creation.wgpu_render_state {
            host.attach(viewport::Viewport::new(window));
        }
        host.screenshot(screenshot::Screenshot::from_environment(), seen);
        Ok(Box::new(host))
    });
    eframe::run_native("Osteotome", options, create)?;
    let failed = failure.lock().unwrap_or_else(PoisonError::into_inner).take();
    failed.map_or(Ok(()), |error| Err(error.into()))
}
