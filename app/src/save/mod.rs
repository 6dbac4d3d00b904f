//! Data and pictures as the bytes of files: the other way round of [`crate::load`].
//!
//! Everything is made in memory and written by [`crate::case::file::write_whole`], but for `series`, which writes as
//! it goes under another name; so a file is whole or not there.

pub mod choice;
pub mod labels;
pub mod nrrd;
pub mod picture;
pub mod series;
pub mod stl;
