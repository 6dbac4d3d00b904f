//! What was done and what was not.

/// Counts of one worker, or of all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Tetrahedra that do not show in the picture.
    pub outside: u64,
    /// Tetrahedra that the transfer function makes clear.
    pub clear: u64,
    /// Tetrahedra that lie behind what is opaque enough; by blocks, once in each. All of a cluster that does as a whole.
    pub hidden: u64,
    /// Tetrahedra with a value or a place in the picture that is not a number; left out.
    pub not_finite: u64,
    /// Tetrahedra scan-converted; by blocks, once in each.
    pub scanned: u64,
    /// Segments that came of them: pixels times cells.
    pub segments: u64,
    /// Segments left when those of a cluster that meet were merged.
    pub runs: u64,
    /// Segments fewer by merging those of clusters in the lists, or by what they hid; with early termination only.
    pub merged: u64,
    /// Pixels of clusters in which cells overlapped.
    pub overlaps: u64,
    /// Bytes sent to other workers.
    pub bytes: u64,
    /// Of these, bytes of cells and values that another worker had not got.
    pub cell_bytes: u64,
    /// Messages sent to other workers.
    pub messages: u64,
    /// Clusters taken over from other workers.
    pub taken: u64,
    /// Clusters drawn; by blocks, once in each.
    pub clusters: u64,
    /// Tetrahedra that the worker's process has in memory; all of the grid where workers share it.
    pub held: u64,
    /// Pixels in which runs of different clusters overlapped.
    pub overlapping_pixels: u64,
}

impl Counts {
    /// Work done, in segments: a cell costs as much as [`Counts::CELL`] of them to set up.
    pub fn work(&self) -> u64 {
        self.segments + Self::CELL * self.scanned
    }

    /// What scan-converting a cell costs, beside its segments; segments.
    pub const CELL: u64 = 4;

    fn fields(&mut self) -> [&mut u64; 16] {
        [
            &mut self.outside,
            &mut self.clear,
            &mut self.hidden,
            &mut self.not_finite,
            &mut self.scanned,
            &mut self.segments,
            &mut self.runs,
            &mut self.merged,
            &mut self.overlaps,
            &mut self.bytes,
            &mut self.cell_bytes,
            &mut self.messages,
            &mut self.taken,
            &mut self.clusters,
            &mut self.held,
            &mut self.overlapping_pixels,
        ]
    }

    pub(super) fn add(&mut self, mut other: Self) {
        for (sum, more) in self.fields().into_iter().zip(other.fields()) {
            *sum += *more;
        }
    }

    /// As a message has them.
    pub(super) fn to_list(mut self) -> Vec<u64> {
        self.fields().map(|v| *v).to_vec()
    }

    /// From a message.
    pub(super) fn from_list(list: &[u64]) -> Option<Self> {
        let mut counts = Self::default();
        let fields = counts.fields();
        if fields.len() != list.len() {
            return None;
        }
        for (field, v) in fields.into_iter().zip(list) {
            *field = *v;
        }
        Some(counts)
    }
}

/// How a picture of cells came about.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stats {
    /// Tetrahedra of the grid.
    pub tetrahedra: u64,
    /// Cells that were at fault.
    pub faults: super::Faults,
    /// Subscreens across the longer side; 0 without early termination.
    pub subscreens: u32,
    /// Sum over all workers.
    pub total: Counts,
    /// Each worker's.
    pub workers: Vec<Counts>,
    /// Making the grid ready, where it was not known; milliseconds.
    pub prepare_ms: f64,
    /// All of the frame but that.
    pub frame_ms: f64,
}

impl Stats {
    /// Work of the busiest worker over that of the mean one; 1 is even.
    pub fn imbalance(&self) -> f64 {
        let most = self.workers.iter().map(Counts::work).max().unwrap_or(0);
        let all: u64 = self.workers.iter().map(Counts::work).sum();
        if all == 0 { 1.0 } else { most as f64 * self.workers.len() as f64 / all as f64 }
    }
}
