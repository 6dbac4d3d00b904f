//! Grids of one frame over time.

use std::sync::Arc;

use thiserror::Error;

use super::Grid;

/// Why grids and times are not a series.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SeriesError {
    /// There is no step.
    #[error("a time series needs at least one step")]
    Empty,
    /// Not one time for each grid.
    #[error("a time series has {grids} grids but {times} times")]
    Count {
        /// Grids given.
        grids: usize,
        /// Times given.
        times: usize,
    },
    /// A grid has another extent or another place than the first.
    #[error("step {step} of the time series lies in another frame than the first")]
    Frame {
        /// Position of the odd one.
        step: usize,
    },
    /// A time is not finite or does not rise.
    #[error("the time of step {step} is not finite or not after the one before it")]
    Time {
        /// Position of the time.
        step: usize,
    },
}

/// Volumes of one frame over time: all have the extent and the `world_from_voxel` of the first.
///
/// A clone shares the samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    steps: Vec<Arc<Grid>>,
    times_secs: Vec<f64>,
}

impl Series {
    /// A series of `steps` at `times_secs`, which rise strictly.
    ///
    /// # Errors
    /// [`SeriesError`] for what its variants name.
    pub fn new(steps: Vec<Arc<Grid>>, times_secs: Vec<f64>) -> Result<Self, SeriesError> {
        let first = steps.first().ok_or(SeriesError::Empty)?;
        if steps.len() != times_secs.len() {
            return Err(SeriesError::Count { grids: steps.len(), times: times_secs.len() });
        }
        let same =
            |g: &Grid| g.extent() == first.extent() && g.world_from_voxel() == first.world_from_voxel();
        if let Some(step) = steps.iter().position(|g| !same(g)) {
            return Err(SeriesError::Frame { step });
        }
        let mut before = f64::NEG_INFINITY;
        for (step, &time) in times_secs.iter().enumerate() {
            if !time.is_finite() || time <= before {
                return Err(SeriesError::Time { step });
            }
            before = time;
        }
        Ok(Self { steps, times_secs })
    }

    /// How many steps there are; never 0.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether there are none (never).
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// The volumes, by time.
    pub fn steps(&self) -> &[Arc<Grid>] {
        &self.steps
    }

    /// When each step was; seconds, rising, as the source counts them.
    pub fn times_secs(&self) -> &[f64] {
        &self.times_secs
    }

    /// The step that holds at a time: the last one not after it, or the first.
    pub fn step_at(&self, time_secs: f64) -> usize {
        self.times_secs.partition_point(|&t| t <= time_secs).saturating_sub(1)
    }

    /// Least and greatest finite value over all steps, after rescale.
    pub fn range(&self) -> [f64; 2] {
        self.steps
            .iter()
            .map(|g| g.range())
            .fold([f64::INFINITY, f64::NEG_INFINITY], |all, r| [all[0].min(r[0]), all[1].max(r[1])])
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Affine, Rescale, Samples, Vector};
    use super::*;

    fn grid(value: u8, x_mm: f64) -> Arc<Grid> {
        let place = Affine::translation(Vector::new(x_mm, 0.0, 0.0));
        let samples = Samples::U8(vec![value; 2]);
        Arc::new(Grid::new([2, 1, 1], samples, Rescale::default(), place).expect("a grid"))
    }

    #[test]
    fn a_step_holds_until_the_next_begins() {
        let series = Series::new(vec![grid(1, 0.0), grid(5, 0.0)], vec![0.5, 2.0]).expect("a series");
        assert_eq!(series.step_at(-3.0), 0, "before the first");
        assert_eq!(series.step_at(1.999), 0, "before the second");
        assert_eq!(series.step_at(2.0), 1, "at its beginning");
        assert_eq!(series.range(), [1.0, 5.0], "over all steps");
    }

    #[test]
    fn steps_of_different_frames_or_falling_times_are_refused() {
        let moved = Series::new(vec![grid(0, 0.0), grid(0, 1.0)], vec![0.0, 1.0]);
        assert_eq!(moved, Err(SeriesError::Frame { step: 1 }), "moved");
        let falling = Series::new(vec![grid(0, 0.0), grid(0, 0.0)], vec![1.0, 1.0]);
        assert_eq!(falling, Err(SeriesError::Time { step: 1 }), "equal times");
        let count = Series::new(vec![grid(0, 0.0)], vec![]);
        assert_eq!(count, Err(SeriesError::Count { grids: 1, times: 0 }), "no time");
        assert_eq!(Series::new(vec![], vec![]), Err(SeriesError::Empty), "empty");
    }
}
