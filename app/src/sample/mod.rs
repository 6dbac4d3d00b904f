//! The built-in sample case: a left hip as CT and MRI, a stem implant, and a plan of them.
//!
//! All of it is made by code from one table of numbers ([`table`]), so that every measurement made on
//! it has a known answer. The way of a scan: solids as signed distances (`sdf`, `femur`, `pelvis`,
//! `soft`) are painted over each other (`body`), sampled on a grid with the scanner's noise (`scan`),
//! and kept in memory for the life of the program. They are not kept on disk: both scans together take
//! little more than a second on two cores, too little to be worth a cache that can go stale. World is the
//! CT's patient space, LPS, mm.

use std::sync::{Arc, OnceLock};

use render::volume::{Grid, GridError, MeshError, Series, SeriesError, SpaceError, TriangleMesh};
use thiserror::Error;

use crate::case::Case;

mod beat;
mod body;
mod femur;
mod noise;
mod pelvis;
mod plan;
mod scan;
mod sdf;
mod soft;
mod stem;
pub mod table;
#[cfg(test)]
mod tests;

/// Why the sample could not be made. Its numbers are fixed, so this says that the program is broken.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SampleError {
    /// The samples are no grid.
    #[error("the built-in scan could not be made ({0}); please report this")]
    Grid(#[from] GridError),
    /// The triangles are no mesh.
    #[error("the built-in stem could not be made ({0}); please report this")]
    Mesh(#[from] MeshError),
    /// The steps are no series.
    #[error("the built-in beat could not be made ({0}); please report this")]
    Series(#[from] SeriesError),
    /// A pose is no transform.
    #[error("a pose of the built-in case could not be made ({0}); please report this")]
    Space(#[from] SpaceError),
}

/// The CT: HU as `i16`, axes of world, made at the first call.
///
/// # Errors
/// [`SampleError`] where the program is broken.
pub fn ct() -> Result<Arc<Grid>, SampleError> {
    static CT: OnceLock<Result<Arc<Grid>, SampleError>> = OnceLock::new();
    CT.get_or_init(|| scan::ct().map(Arc::new)).clone()
}

/// The MRI: T1-weighted signal as `u16`, oblique, in its own patient space, which
/// [`table::registration`] brings to the CT's. Made at the first call.
///
/// # Errors
/// [`SampleError`] where the program is broken.
pub fn mri() -> Result<Arc<Grid>, SampleError> {
    static MRI: OnceLock<Result<Arc<Grid>, SampleError>> = OnceLock::new();
    MRI.get_or_init(|| scan::mri().map(Arc::new)).clone()
}

/// Name of the built-in volume over time, after `builtin:`.
pub const BEAT: &str = "beat";

/// A volume over time: 8-bit, one beat of a hollow ball. Made at the first call.
///
/// # Errors
/// [`SampleError`] where the program is broken.
pub fn beat() -> Result<Series, SampleError> {
    static BEAT: OnceLock<Result<Series, SampleError>> = OnceLock::new();
    BEAT.get_or_init(beat::beat).clone()
}

/// The stem implant, a closed surface that faces outwards, in its own frame: z up the stem, the neck in
/// the x-z plane. [`table::stem_pose`] puts it into the uncut femur. Made at the first call.
///
/// # Errors
/// [`SampleError`] where the program is broken.
pub fn stem() -> Result<Arc<TriangleMesh>, SampleError> {
    static STEM: OnceLock<Result<Arc<TriangleMesh>, SampleError>> = OnceLock::new();
    STEM.get_or_init(|| stem::mesh().map(Arc::new)).clone()
}

/// The plan that the program opens with. Its sources are `builtin:hip/ct`, `builtin:hip/mri` and
/// `builtin:hip/stem`; making it loads none of them.
pub fn case() -> Case {
    plan::case()
}
