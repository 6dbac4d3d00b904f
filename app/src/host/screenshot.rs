//! `OSTEOTOME_SCREENSHOT=PATH.png`: draw until everything is loaded and at rest, write the window's
//! picture, close. For tests under a virtual display, and for `make run` without one.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use egui::ColorImage;
use thiserror::Error;

/// The environment variable that asks for it.
pub const VARIABLE: &str = "OSTEOTOME_SCREENSHOT";
/// Frames drawn at rest before the picture is taken, so that panels have settled.
const SETTLED: u32 = 4;

/// Why there is no file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ScreenshotError {
    /// The picture could not be written.
    #[error("the screenshot was not written ({source}); check the folder: {}", path.display())]
    Write {
        /// Where to.
        path: PathBuf,
        /// What was said.
        source: image::ImageError,
    },
}

/// A screenshot to be taken.
#[derive(Debug)]
pub struct Screenshot {
    path: PathBuf,
    rested: u32,
    asked: bool,
    taken: Arc<Mutex<Option<Arc<ColorImage>>>>,
}

impl Screenshot {
    /// What the environment asks for.
    pub fn from_environment() -> Option<Self> {
        let path = std::env::var_os(VARIABLE).filter(|p| !p.is_empty())?;
        Some(Self { path: PathBuf::from(path), rested: 0, asked: false, taken: Arc::default() })
    }

    /// Begins anew, in a window that takes the place of the one asked before.
    pub fn restart(&mut self) {
        (self.rested, self.asked) = (0, false);
    }

    /// To be called every frame; `at_rest` where nothing is loaded or drawn any more. Gives the result
    /// once the file is written, or is not.
    pub fn step(&mut self, ctx: &egui::Context, at_rest: bool) -> Option<Result<(), ScreenshotError>> {
        ctx.request_repaint();
        if let Some(image) = self.taken.lock().unwrap_or_else(PoisonError::into_inner).take() {
            return Some(write(&self.path, &image));
        }
        self.rested = if at_rest { self.rested + 1 } else { 0 };
        if self.rested >= SETTLED && !self.asked {
            self.asked = true;
            let taken = Arc::clone(&self.taken);
            let wake = ctx.clone();
            ctx.request_screenshot(move |image| {
                *taken.lock().unwrap_or_else(PoisonError::into_inner) = Some(image);
                wake.request_repaint();
            });
        }
        None
    }
}

fn write(path: &Path, picture: &ColorImage) -> Result<(), ScreenshotError> {
    let [width, height] = picture.size;
    let bytes: Vec<u8> = picture.pixels.iter().flat_map(|p| [p.r(), p.g(), p.b()]).collect();
    let written = image::save_buffer(path, &bytes, width as u32, height as u32, image::ColorType::Rgb8);
    written.map_err(|source| ScreenshotError::Write { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_the_picture() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a.png");
        let colors = [egui::Color32::from_rgb(1, 2, 3), egui::Color32::from_rgb(200, 0, 9)];
        write(&path, &ColorImage::new([2, 1], colors.to_vec())).expect("written");
        let back = image::open(&path).expect("a PNG").to_rgb8();
        assert_eq!((back.dimensions(), back.get_pixel(1, 0).0), ((2, 1), [200, 0, 9]), "as it was");
        let nowhere = write(&folder.path().join("no/such/a.png"), &ColorImage::new([1, 1], vec![colors[0]]));
        assert!(matches!(nowhere, Err(ScreenshotError::Write { .. })), "a folder that is not there");
    }
}
