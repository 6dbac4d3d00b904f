//! Data in space, on the CPU and in `f64`: the page every other module links to.
//!
//! **World** is DICOM patient space: LPS (x to the patient's left, y to the back, z to the head),
//! right-handed, millimetres. **Voxel** space has the centre of the first sample at (0, 0, 0) and the
//! next ones at integers; a grid of `n` samples covers `[-0.5, n - 0.5]`. **Texture** space runs
//! 0 to 1 over voxel *edges*. Arrays are `[x, y, z]`, x fastest. Angles are radians.
//!
//! Transforms are named by their ends, `world_from_voxel`, and chain by them. Nothing here knows of a
//! GPU, a file format or a window.

mod bricks;
pub mod cells;
pub mod convex;
pub mod cut;
mod cutter;
mod grid;
mod labels;
mod mesh;
mod packed;
pub mod partition;
mod series;
mod space;
pub mod synth;
mod transfer;

pub use bricks::{Bricks, Occupied};
pub use cells::CellGrid;
pub use cutter::{Body, Cutter, CutterError, Face, Shape, Side};
pub use grid::{Grid, GridError, Rescale, Samples};
pub use labels::{default_color, label_at, label_of};
pub use mesh::{MeshError, TriangleMesh};
pub use packed::{PackedError, PackedFormat, PackedStep, SharedBytes};
pub use series::{Series, SeriesError};
pub use space::{Affine, Point, SpaceError, Vector};
pub use transfer::{ControlPoint, Transfer, TransferError};
