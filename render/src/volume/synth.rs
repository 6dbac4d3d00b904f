//! Grids made from formulas: what tests and benchmarks measure against, since the answer is known.
//!
//! Samples are `f64`, so that they are the formula's own numbers. Places are in the grid's own world,
//! mm, that is after `world_from_voxel`, unless a function says voxels.
//!
//! References: Marschner and Lobb 1994, "An Evaluation of Reconstruction Filters for Volume Rendering",
//! IEEE Visualization, equations (3) and (4). Steele, Lea, Flood 2014, "Fast Splittable Pseudorandom
//! Number Generators", OOPSLA (the finaliser of `SplitMix64`).

use std::f64::consts::PI;

use rayon::prelude::*;

use super::{Affine, Grid, GridError, Point, Rescale, Samples, Vector};

/// The largest grid made here, in samples: 2 GiB of them.
pub const MAX_SAMPLES: u128 = 1 << 28;

/// A grid of `value` at the place of every voxel centre, in parallel. The same on any number of threads.
///
/// # Errors
/// [`GridError::Empty`]; [`GridError::Count`] with none found where there would be more than
/// [`MAX_SAMPLES`], or memory does not hold them.
pub fn from_places(
    extent: [usize; 3],
    world_from_voxel: Affine,
    value: impl Fn(&Point) -> f64 + Sync,
) -> Result<Grid, GridError> {
    from_voxels(extent, world_from_voxel, |at| {
        value(&world_from_voxel.point(&Point::from(at.map(|i| i as f64))))
    })
}

/// A grid of `value` at every voxel's `[x, y, z]`, in parallel.
///
/// # Errors
/// As [`from_places`].
pub fn from_voxels(
    extent: [usize; 3],
    world_from_voxel: Affine,
    value: impl Fn([usize; 3]) -> f64 + Sync,
) -> Result<Grid, GridError> {
    let needed = extent.iter().fold(1_u128, |all, &n| all.saturating_mul(n as u128));
    let mut samples = Vec::new();
    if needed > MAX_SAMPLES || samples.try_reserve_exact(needed as usize).is_err() {
        return Err(GridError::Count { extent, needed, found: 0 });
    }
    let [nx, ny, _] = extent;
    let at = |i: usize| value([i % nx, i / nx % ny, i / (nx * ny)]);
    samples.par_extend((0..needed as usize).into_par_iter().map(at));
    Grid::new(extent, Samples::F64(samples), Rescale::default(), world_from_voxel)
}

/// The same value everywhere.
///
/// # Errors
/// As [`from_places`].
pub fn homogeneous(extent: [usize; 3], value: f64, world_from_voxel: Affine) -> Result<Grid, GridError> {
    from_voxels(extent, world_from_voxel, |_| value)
}

/// `base` at the origin of the world, rising by `per_mm` along each world axis. Trilinear interpolation
/// gives it back without error between the outermost voxel centres.
///
/// # Errors
/// As [`from_places`].
pub fn ramp(
    extent: [usize; 3],
    base: f64,
    per_mm: Vector,
    world_from_voxel: Affine,
) -> Result<Grid, GridError> {
    from_places(extent, world_from_voxel, |p| base + per_mm.dot(&p.coords))
}

/// Distance from the surface of a ball, mm: negative inside, positive outside. Its gradient has length 1.
///
/// # Errors
/// As [`from_places`].
pub fn ball_distance(
    extent: [usize; 3],
    centre: Point,
    radius_mm: f64,
    world_from_voxel: Affine,
) -> Result<Grid, GridError> {
    from_places(extent, world_from_voxel, |p| (p - centre).norm() - radius_mm)
}

/// The Marschner-Lobb signal on `[-1, 1]³`, in `[0, 1]`, with its own numbers: 6 rings, α = 0.25.
///
/// `p` is in units of the cube's half side. Source: Marschner and Lobb 1994, equations (3) and (4).
pub fn marschner_lobb(p: &Point) -> f64 {
    let ring = (2.0 * PI * RINGS * (0.5 * PI * p.x.hypot(p.y)).cos()).cos();
    (1.0 - (0.5 * PI * p.z).sin() + DEPTH * (1.0 + ring)) / (2.0 * (1.0 + DEPTH))
}

/// The gradient of [`marschner_lobb`], per unit of its cube.
pub fn marschner_lobb_gradient(p: &Point) -> Vector {
    let r = p.x.hypot(p.y);
    let (sin, cos) = (0.5 * PI * r).sin_cos();
    let phase = 2.0 * PI * RINGS;
    // d cos(phase · cos(π r / 2)) / dr, over r so that the axis is no exception.
    let over_r = if r > 0.0 { sin / r } else { 0.5 * PI };
    let ring = (phase * cos).sin() * phase * 0.5 * PI * over_r;
    let scale = 1.0 / (2.0 * (1.0 + DEPTH));
    Vector::new(DEPTH * ring * p.x, DEPTH * ring * p.y, -0.5 * PI * (0.5 * PI * p.z).cos()) * scale
}

/// Frequency of the rings, `f_M` in the paper.
const RINGS: f64 = 6.0;
/// Depth of the rings, α in the paper.
const DEPTH: f64 = 0.25;

/// A number from -1 to 1 for every voxel and seed, the same on every machine; no voxel tells of another.
pub fn noise(seed: u64, [x, y, z]: [usize; 3]) -> f64 {
    let place = (x as u64) | (y as u64) << 21 | (z as u64) << 42;
    let mixed = mix(mix(seed.wrapping_add(0x9E37_79B9_7F4A_7C15)) ^ place);
    (mixed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// The finaliser of `SplitMix64`.
fn mix(mut v: u64) -> u64 {
    v = (v ^ v >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    v = (v ^ v >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    v ^ v >> 31
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_interpolated_without_error() {
        let pose = Affine::rotation_about(Point::new(1.0, 0.0, 2.0), Vector::new(1.0, 2.0, 3.0), 0.5);
        let slope = Vector::new(0.3, -0.2, 0.7);
        let grid = ramp([5, 6, 7], 10.0, slope, pose).expect("a grid");
        let at = Point::new(1.3, 4.6, 2.9);
        let known = 10.0 + slope.dot(&pose.point(&at).coords);
        assert!((grid.sample(&at).expect("inside") - known).abs() < 1e-12, "between centres");
    }

    #[test]
    fn a_ball_is_nought_at_its_surface() {
        let centre = Point::new(4.0, 4.0, 4.0);
        let grid = ball_distance([9, 9, 9], centre, 3.0, Affine::identity()).expect("a grid");
        assert_eq!(grid.value(4, 4, 4), -3.0, "at the centre");
        assert_eq!(grid.value(7, 4, 4), 0.0, "on the surface");
    }

    #[test]
    fn the_marschner_lobb_gradient_is_that_of_its_signal() {
        for p in [[0.1, 0.2, 0.3], [-0.7, 0.4, -0.9], [0.0, 0.0, 0.5], [0.0, 0.6, 0.0]] {
            let p = Point::from(p);
            let gradient = marschner_lobb_gradient(&p);
            for axis in 0..3 {
                let mut step = Vector::zeros();
                step[axis] = 1e-5;
                let slope = (marschner_lobb(&(p + step)) - marschner_lobb(&(p - step))) / 2e-5;
                assert!((gradient[axis] - slope).abs() < 1e-6, "axis {axis} at {p}: {slope}");
            }
            assert!((0.0..=1.0).contains(&marschner_lobb(&p)), "in range at {p}");
        }
        // sin(0) = 0 and cos(0) = 1: (1 + 0.25 (1 + cos 12π)) / 2.5 at the origin.
        assert!((marschner_lobb(&Point::origin()) - 0.6).abs() < 1e-12, "the paper's value at the origin");
    }

    #[test]
    fn noise_has_no_mean_and_the_spread_of_a_uniform_number() {
        let values: Vec<f64> = (0..30_000).map(|i| noise(7, [i % 40, i / 40 % 30, i / 1200])).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let square = values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
        assert!(mean.abs() < 0.015 && (square - 1.0 / 3.0).abs() < 0.01, "mean {mean}, square {square}");
        assert!(noise(7, [1, 2, 3]) != noise(8, [1, 2, 3]), "seeds differ");
    }

    #[test]
    fn grids_that_memory_cannot_hold_are_refused() {
        let huge = homogeneous([usize::MAX, 2, 2], 0.0, Affine::identity());
        assert!(matches!(huge, Err(GridError::Count { found: 0, .. })), "refused before it is allocated");
        let none = homogeneous([0, 2, 2], 0.0, Affine::identity());
        assert!(matches!(none, Err(GridError::Empty { .. })), "nothing to make");
    }
}
