//! The crate's surface, as one test binary: each links wgpu.
#![expect(clippy::unwrap_used, reason = "a test may fail loudly")]

mod pictures;
mod shaders;
mod steps;
