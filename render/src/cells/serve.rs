//! What the processes of a group other than the first do.

use super::clusters::{Clusters, Scalars};
use super::engine;
use super::group::Desk;
use super::link::{Link, LinkError};
use super::orders::{Drawing, Order};
use super::project::Frame;
use super::spread::queues;
use super::table::Table;
use super::worker::{Start, Worker};
use super::{CellsError, can_be_drawn};
use crate::simd::has_wide;
use crate::volume::cells::Place;

/// Draws its part of every picture, until the first process has no more to draw. Where that fails, the first is told.
pub(super) fn serve<L: Link>(desk: Desk<L>) -> Result<(), CellsError> {
    let mut server = Server { desk, fault: Some("its program broke down".to_owned()) };
    let result = server.run();
    server.fault = result.as_ref().err().map(ToString::to_string);
    result
}

/// A process at work.
struct Server<L: Link> {
    desk: Desk<L>,
    /// What the first is told where this ends now.
    fault: Option<String>,
}

impl<L: Link> Drop for Server<L> {
    fn drop(&mut self) {
        if let Some(fault) = self.fault.take() {
            // Where the first is gone as well, nobody is left to be told.
            drop(self.desk.order(0, Order::Failed(fault).to_bytes()));
        }
    }
}

impl<L: Link> Server<L> {
    fn run(&mut self) -> Result<(), CellsError> {
        let mut clusters = Clusters::elsewhere(Vec::new());
        let mut scalars = Scalars::elsewhere(Place::Points, Vec::new());
        let nonsense = LinkError::Message { rank: 0 };
        loop {
            match self.desk.next_order()? {
                Order::Grid(outlines) => clusters = Clusters::elsewhere(outlines),
                Order::Field(place, ranges) => scalars = Scalars::elsewhere(place, ranges),
                Order::Cells(packs) => {
                    if !packs.into_iter().all(|pack| pack.unpack(&clusters, &scalars)) {
                        return Err(nonsense.into());
                    }
                }
                Order::Draw(drawing) => match self.draw(&drawing, &mut clusters, &mut scalars) {
                    Ok(()) | Err(CellsError::Link(LinkError::Stopped)) => {}
                    Err(error) => return Err(error),
                },
                Order::Stop => {}
                Order::End => return Ok(()),
                Order::Failed(_) => return Err(nonsense.into()),
            }
        }
    }

    /// Does this worker's part of a picture.
    fn draw(
        &mut self,
        drawing: &Drawing,
        clusters: &mut Clusters,
        scalars: &mut Scalars,
    ) -> Result<(), CellsError> {
        let Drawing { number, size, spread, manner, .. } = *drawing;
        let sound = can_be_drawn(size) && scalars.ranges().len() == clusters.len();
        if !sound {
            return Err(LinkError::Message { rank: 0 }.into());
        }
        let me = self.desk.link.rank();
        let table = Table::new(&drawing.transfer);
        let whole = frame(drawing, &table, clusters, scalars);
        let mut queues = queues(&whole, self.desk.link.size(), spread);
        let mut homes = vec![0; clusters.len()];
        for (rank, queue) in (0..).zip(&queues) {
            for &cluster in queue {
                homes[cluster as usize] = rank;
            }
        }
        let mine = |cluster: usize| homes[cluster] as usize == me;
        forget(clusters, scalars, mine);
        if !queues[me].iter().all(|&cluster| scalars.has(clusters, cluster as usize)) {
            return Err(LinkError::Message { rank: 0 }.into());
        }
        let left = queues.iter().map(|queue| queue.len() as u32).collect();
        let start = Start { queue: std::mem::take(&mut queues[me]), left, homes: &homes };
        let mine_only = frame(drawing, &table, clusters, scalars);
        let worker = Worker::new(&mine_only, manner, self.desk.letters(number), start);
        let result = engine::run(worker, || true);
        // What was taken over from others.
        forget(clusters, scalars, mine);
        result.map(drop)
    }
}

/// What is drawn, of what is here.
fn frame<'a>(drawing: &Drawing, table: &'a Table, clusters: &'a Clusters, scalars: &'a Scalars) -> Frame<'a> {
    let Drawing { size, lens, skip_clear, wide, .. } = *drawing;
    Frame { clusters, scalars, table, lens, size, skip_clear, wide: wide && has_wide() }
}

/// Leaves only some clusters here.
fn forget(clusters: &mut Clusters, scalars: &mut Scalars, keep: impl Fn(usize) -> bool) {
    clusters.retain(&keep);
    scalars.retain(keep);
}
