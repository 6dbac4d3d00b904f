//! What crosses crates, as one test binary: each links wgpu and egui.
#![expect(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may fail loudly")]

mod bad_files;
mod grids;
mod headless;
mod layering;
mod loading;
mod stress;
mod support;
mod window;
