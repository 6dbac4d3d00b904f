//! The series file: one volume over time, in chunks that are found by step and checked one by one.
//!
//! [`FileWriter`] writes one in a single pass and puts it under its name only when it is whole; [`Reader`] opens it,
//! finds the chunk of a step, and checks every byte that it hands out. A static volume is a [`ktx2`](crate::ktx2)
//! file instead.
//!
//! Parts: `codec` what a chunk decodes to, `header`, `footer` (index, times and trailer) as bytes, `write` and `read`
//! the two ways.
#![doc = include_str!("FORMAT.md")]
#![warn(clippy::arithmetic_side_effects, clippy::cast_possible_truncation, clippy::indexing_slicing)]

mod codec;
mod fields;
mod footer;
mod header;
mod read;
mod write;

pub use codec::StepCodec;
pub use footer::Figures;
pub use header::{Header, IDENTIFIER};
pub use read::{ReadError, Reader};
pub use write::{FileWriter, WriteError, Writer};

/// The version of the format that is written, and the only one that is read.
pub const VERSION: u32 = 1;

/// The end of a series file's name.
pub const EXTENSION: &str = "series";
