//! Tests of the crate's surface: one binary, `mod` lines only.

#![expect(clippy::unwrap_used, reason = "a test may fail loudly")]

mod bc;
mod ktx2_file;
mod naive;
mod phantom;
mod pvtc;
mod series;
mod texture;
