//! Which clusters each worker begins with.

use super::project::Frame;

/// Which clusters a worker begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spread {
    /// Those of one band of the picture, from front to back: what is opaque in front hides what is behind it without a word
    /// to another worker.
    #[default]
    Columns,
    /// Those of one part of the grid, whatever the view: as where each worker has only its own part.
    Blocks,
}

/// Clusters of each worker, about as many cells in each; nearest first.
pub(super) fn queues(frame: &Frame<'_>, workers: usize, spread: Spread) -> Vec<Vec<u32>> {
    let reaches: Vec<_> = (0..frame.clusters.len()).map(|cluster| frame.reach(cluster)).collect();
    let mut all: Vec<u32> = (0..frame.clusters.len() as u32).collect();
    let mut queues = vec![Vec::new(); workers];
    if spread == Spread::Columns {
        // Bands of rows from the top, as they are composited in the end, so that few segments go from one to another.
        let middle = |cluster: u32| {
            let (rect, _) = &reaches[cluster as usize];
            i64::from(rect.low[1]) + i64::from(rect.high[1])
        };
        all.sort_unstable_by_key(|&cluster| (middle(cluster), cluster));
    }
    let total: usize = (0..frame.clusters.len()).map(|c| frame.clusters.count(c)).sum();
    let mut before = 0;
    for cluster in all {
        let count = frame.clusters.count(cluster as usize);
        // Where its middle lies; of two that share that the first, which is where all cells are to begin with.
        let worker = ((2 * before + count) * workers).div_ceil((2 * total).max(1));
        queues[worker.clamp(1, workers) - 1].push(cluster);
        before += count;
    }
    for queue in &mut queues {
        queue.sort_unstable_by_key(|&cluster| {
            let (_, nearest) = reaches[cluster as usize];
            // Bits of floats are in their order where they are not negative.
            (nearest.max(0.0).to_bits(), cluster)
        });
    }
    queues
}
