//! The steps of a volume over time, wherever they are: in memory, or in a series file that is read as it plays.
//!
//! [`Steps::grid`] and [`Steps::packed`] give a step at once, and read it first where they must. A player asks with
//! [`Steps::want`] ahead of time and shows what [`Steps::is_ready`], so that no frame waits for a disk.
//!
//! Parts: `file` is the series file with its stream, `packed` what the renderer takes of it, [`clock`] which step is due.

pub mod clock;
mod file;
mod packed;
#[cfg(test)]
mod tests;

use std::path::Path;
use std::sync::Arc;

pub use compress::stream::{Direction, Repeat};
use render::volume::{Grid, PackedStep, Series};

pub use file::{SeriesFileError, is_series};
pub use packed::{StepError, format_of, packed_step};

use file::SeriesFile;

/// A volume over time.
#[derive(Debug)]
pub struct Steps {
    source: Source,
}

#[derive(Debug)]
enum Source {
    Memory(Series),
    File(Box<SeriesFile>),
}

impl Steps {
    /// Steps that are in memory.
    pub fn in_memory(series: Series) -> Self {
        Self { source: Source::Memory(series) }
    }

    /// The steps of a series file, of which a few are in memory at a time; `limit` bounds the bytes that take.
    ///
    /// # Errors
    /// [`SeriesFileError`] for a file that is none, damaged or too large.
    pub fn open(path: &Path, limit: u64) -> Result<Self, SeriesFileError> {
        Ok(Self { source: Source::File(Box::new(SeriesFile::open(path, limit)?)) })
    }

    /// When each step was; seconds, rising. Never empty.
    pub fn times_secs(&self) -> &[f64] {
        match &self.source {
            Source::Memory(series) => series.times_secs(),
            Source::File(file) => file.times_secs(),
        }
    }

    /// Least and greatest value over all steps; of a file, that its stored numbers can stand for.
    pub fn range(&self) -> [f64; 2] {
        match &self.source {
            Source::Memory(series) => series.range(),
            Source::File(file) => file.range(),
        }
    }

    /// What the file calls itself, and the kind of data in it; none in memory.
    pub fn title(&self) -> Option<(&str, &str)> {
        match &self.source {
            Source::Memory(_) => None,
            Source::File(file) => Some((&file.header().name, &file.header().kind)),
        }
    }

    /// The samples of a step; past the end, of the last one. None where the file cannot be read: see
    /// [`Steps::fault`].
    pub fn grid(&self, step: usize) -> Option<Arc<Grid>> {
        let step = step.min(self.times_secs().len() - 1);
        match &self.source {
            Source::Memory(series) => series.steps().get(step).cloned(),
            Source::File(file) => file.grid(step),
        }
    }

    /// The same step as the compressed bytes that it was stored in; none in memory.
    pub fn packed(&self, step: usize) -> Option<Arc<PackedStep>> {
        match &self.source {
            Source::Memory(_) => None,
            Source::File(file) => file.packed(step.min(self.times_secs().len() - 1)),
        }
    }

    /// Says that a step is due, and which come after it: they are read meanwhile.
    pub fn want(&self, step: usize, direction: Direction, repeat: Repeat) {
        if let Source::File(file) = &self.source {
            file.want(step, direction, repeat);
        }
    }

    /// Whether a step can be shown without waiting.
    pub fn is_ready(&self, step: usize) -> bool {
        match &self.source {
            Source::Memory(_) => true,
            Source::File(file) => file.is_ready(step),
        }
    }

    /// The last fault of the file, for people.
    pub fn fault(&self) -> Option<String> {
        match &self.source {
            Source::Memory(_) => None,
            Source::File(file) => file.fault(),
        }
    }

    /// The same, and forgets it: for whoever has shown it.
    pub fn take_fault(&self) -> Option<String> {
        match &self.source {
            Source::Memory(_) => None,
            Source::File(file) => file.take_fault(),
        }
    }

    /// Whether the values may differ from those that were compressed.
    pub fn is_lossy(&self) -> bool {
        match &self.source {
            Source::Memory(_) => false,
            Source::File(file) => file.is_lossy(),
        }
    }

    /// Where the steps are and what was lost, for people.
    pub fn description(&self) -> String {
        match &self.source {
            Source::Memory(_) => "All steps are in memory, as they were read.".to_owned(),
            Source::File(file) => file.description(),
        }
    }
}
