//! Which clusters each worker begins with.

use super::project::Frame;

/// Which clusters a worker begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spread {
    /// Those of one part of the picture, from front to back: what is opaque in front hides what is behind it without a word
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
        // Halves of halves of the picture, for halves of the workers.
        let middle = |cluster: u32, axis: usize| {
            let (rect, _) = &reaches[cluster as usize];
            i64::from(rect.low[axis]) + i64::from(rect.high[axis])
        };
        let mut open = vec![(&mut all[..], workers, 0)];
        while let Some((list, count, first)) = open.pop() {
            if count == 1 {
                queues[first].extend_from_slice(list);
                continue;
            }
            let extent = |axis: usize| {
                let of = || list.iter().map(|&cluster| middle(cluster, axis));
                of().max().unwrap_or(0) - of().min().unwrap_or(0)
            };
            let axis = usize::from(extent(1) > extent(0));
            list.sort_unstable_by_key(|&cluster| (middle(cluster, axis), cluster));
            let lower = count / 2;
            let (a, b) = list.split_at_mut(list.len() * lower / count);
            open.push((b, count - lower, first + lower));
            open.push((a, lower, first));
        }
    } else {
        let total: usize = (0..frame.clusters.len()).map(|c| frame.clusters.count(c)).sum();
        let mut before = 0;
        for cluster in all {
            let worker = before * workers / total.max(1);
            queues[worker.min(workers - 1)].push(cluster);
            before += frame.clusters.count(cluster as usize);
        }
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
