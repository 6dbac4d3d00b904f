//! Widgets that more than one tool uses. They draw and return what was asked for; they know of no case.

pub mod curve;
pub mod name;
pub mod notes;
pub mod number;
pub mod pose;
pub mod theme;
pub mod value;
