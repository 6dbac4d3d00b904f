//! A volume over time of the program's own: a hollow ball that beats, in a body of slow waves.
//!
//! Alike from step to step, as a heart is, and noisy as an MRI is; computed, so that the player and its benchmarks
//! have something to play where no file is given.

use std::f64::consts::TAU;
use std::sync::Arc;

use rayon::prelude::*;
use render::volume::{Affine, Grid, Point, Rescale, Samples, Series, Vector};

use super::SampleError;
use super::noise;

/// Voxels along each axis.
const SIDE: usize = 96;
/// Steps of one beat.
const STEPS: usize = 24;
/// Seconds of one beat.
const BEAT_SECS: f64 = 0.96;
/// Distance of voxels, mm.
const SPACING_MM: f64 = 1.5;

/// The series: 8-bit, one beat.
///
/// # Errors
/// [`SampleError`], never for these sizes.
pub(super) fn beat() -> Result<Series, SampleError> {
    let place = Affine::from_columns(
        Vector::x() * SPACING_MM,
        Vector::y() * SPACING_MM,
        Vector::z() * SPACING_MM,
        Point::from([-0.5 * SPACING_MM * (SIDE - 1) as f64; 3]),
    )
    .unwrap_or_default();
    let grids = (0..STEPS).map(|step| {
        let samples = (0..SIDE * SIDE * SIDE).into_par_iter().with_min_len(SIDE * SIDE);
        let samples = samples.map(|i| voxel(step, [i % SIDE, i / SIDE % SIDE, i / (SIDE * SIDE)])).collect();
        Grid::new([SIDE; 3], Samples::U8(samples), Rescale::default(), place).map(Arc::new)
    });
    let grids = grids.collect::<Result<_, _>>()?;
    let times = (0..STEPS).map(|step| step as f64 * BEAT_SECS / STEPS as f64).collect();
    Ok(Series::new(grids, times)?)
}

fn voxel(step: usize, at: [usize; 3]) -> u8 {
    let phase = TAU * step as f64 / STEPS as f64;
    let p = at.map(|i| (i as f64 + 0.5) / SIDE as f64 * 2.0 - 1.0);
    // The ball leans and tightens; its wall thickens as it does.
    let tight = 0.5 - 0.5 * phase.cos();
    let r = ((p[0] - 0.1 * tight).powi(2) + p[1].powi(2) * 1.2 + (p[2] + 0.05 * tight).powi(2) * 0.8).sqrt();
    let (inner, outer) = (0.42 - 0.14 * tight, 0.62 - 0.06 * tight);
    let edge = |at: f64| 1.0 / (1.0 + ((r - at) * 60.0).exp());
    let (wall, pool) = (edge(outer) - edge(inner), edge(inner));
    let body = 35.0 + 20.0 * (3.0 * p[0] + 2.0 * p[1] + 0.3 * phase.sin()).sin() * (1.0 - edge(outer));
    let [x, y, z] = at.map(|i| i as i64);
    let noise = 2.0 * noise::white(step as u64 + 1, x, y, z);
    (body + 120.0 * wall + 185.0 * pool + f64::from(noise)).clamp(0.0, 255.0).round() as u8
}
