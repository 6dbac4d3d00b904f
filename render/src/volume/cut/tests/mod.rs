//! Cuts of shapes whose form is known, judged by their edges and volumes alone.

mod planes;
mod shapes;
mod solids;
