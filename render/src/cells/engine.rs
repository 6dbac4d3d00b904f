//! Engines: what drives the workers of one process.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::link::{Link, LinkError, Post};
use super::project::Frame;
use super::spread::{Spread, queues};
use super::worker::{Gathered, Manner, Start, Step, Worker};
use super::{CellsError, blocks};

/// How a picture is shared out among the threads of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Engine {
    /// By blocks of pixels: threads of the current pool draw one after the other. `spread`, `balance` and `share` are not
    /// looked at.
    #[default]
    Blocks,
    /// By cells, as among processes: workers, a thread each, have parts of the grid and exchange what they make of them.
    Threads,
    /// The same with all workers in turn on the calling thread, each with a clock that its work moves on; the one that is furthest behind goes
    /// next. For measuring how work is shared out among more workers than there are cores.
    Simulated,
}

/// One worker, until it is done.
pub(super) fn run<L: Link>(
    mut worker: Worker<'_, L>,
    mut goes_on: impl FnMut() -> bool,
) -> Result<Gathered, CellsError> {
    loop {
        match worker.step()? {
            Step::Worked if goes_on() => {}
            Step::Worked => return Err(CellsError::Cancelled),
            Step::Waiting => worker.wait()?,
            Step::Done => return Ok(worker.into_gathered()),
        }
    }
}

impl Engine {
    /// Draws with `count` workers.
    pub(super) fn run(
        self,
        frame: &Frame<'_>,
        manner: Manner,
        (count, spread): (usize, Spread),
        progress: &(dyn Fn(usize, usize) -> bool + Sync),
    ) -> Result<Gathered, CellsError> {
        if self == Self::Blocks {
            return blocks::run(frame, manner, count, progress);
        }
        let queues = queues(frame, count, spread);
        let total = queues.iter().map(Vec::len).sum::<usize>();
        let left: Vec<u32> = queues.iter().map(|q| q.len() as u32).collect();
        let post = Post::new(queues.len());
        let workers = queues.into_iter().enumerate();
        let mut workers: Vec<_> = workers
            .map(|(rank, queue)| {
                let start = Start { queue, left: left.clone(), homes: &[] };
                Worker::new(frame, manner, post.link(rank), start)
            })
            .collect();
        if self == Self::Threads {
            return threads(workers, &post, total, progress);
        }
        simulate(&mut workers, &post, total, progress)?;
        workers.into_iter().next().map(Worker::into_gathered).ok_or(CellsError::Workers)
    }
}

fn threads<L: Link + Send>(
    workers: Vec<Worker<'_, L>>,
    post: &Post,
    total: usize,
    progress: &(dyn Fn(usize, usize) -> bool + Sync),
) -> Result<Gathered, CellsError> {
    let done = AtomicUsize::new(0);
    let cancelled = AtomicBool::new(false);
    let go = |rank: usize, worker: Worker<'_, L>| {
        let result = run(worker, || {
            let goes_on = progress(done.fetch_add(1, Ordering::Relaxed).min(total), total);
            cancelled.fetch_or(!goes_on, Ordering::Relaxed);
            goes_on
        });
        if result.is_err() {
            post.fail(rank);
        }
        result
    };
    let mut workers = workers.into_iter().enumerate();
    let Some((_, first)) = workers.next() else { return Err(CellsError::Workers) };
    let result = std::thread::scope(|scope| {
        for (rank, worker) in workers {
            let go = &go;
            let thread = std::thread::Builder::new().name(format!("cells-{rank}"));
            // A worker that ends early has told the others, the first among them; a thread that cannot start has not.
            if thread.spawn_scoped(scope, move || go(rank, worker)).is_err() {
                post.fail(rank);
            }
        }
        go(0, first)
    });
    if cancelled.into_inner() { Err(CellsError::Cancelled) } else { result }
}

fn simulate<L: Link>(
    workers: &mut [Worker<'_, L>],
    post: &Post,
    total: usize,
    progress: &(dyn Fn(usize, usize) -> bool + Sync),
) -> Result<(), CellsError> {
    let mut clocks = vec![0_u64; workers.len()];
    let mut waits = vec![false; workers.len()];
    let mut ends = vec![false; workers.len()];
    let mut done = 0;
    loop {
        let able = (0..workers.len()).filter(|&w| !ends[w] && (!waits[w] || post.has(w)));
        let Some(next) = able.min_by_key(|&w| clocks[w]) else {
            // Nobody can go on: all are done, or one waits for a message that will not come.
            let stuck = ends.iter().position(|end| !end);
            return stuck.map_or(Ok(()), |rank| Err(LinkError::Lost { rank }.into()));
        };
        let heard: Vec<bool> = (0..workers.len()).map(|w| post.has(w)).collect();
        let before = workers[next].counts().work();
        let step = workers[next].step()?;
        clocks[next] += workers[next].counts().work() - before;
        waits[next] = step == Step::Waiting;
        ends[next] = step == Step::Done;
        // Who waits hears of it when it was sent, not before.
        for other in 0..workers.len() {
            if waits[other] && !heard[other] && post.has(other) {
                clocks[other] = clocks[other].max(clocks[next]);
            }
        }
        if step == Step::Worked {
            done += 1;
            if !progress(done.min(total), total) {
                return Err(CellsError::Cancelled);
            }
        }
    }
}
