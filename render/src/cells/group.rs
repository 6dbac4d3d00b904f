//! Several processes that draw together: the first has the grids and the pictures, the others do their part of each.
//!
//! The first deals a grid out: each of the others has its clusters and no more than these, and keeps them for the next
//! picture; what it lacks for another view is sent, what it no longer needs it forgets. Work that is taken over while a
//! picture is drawn brings its cells along, and they are forgotten at its end. The first has all of the grid, from which
//! it deals. Letters carry the number of the picture that they are about, so that a picture can be given up at any time.

use std::collections::VecDeque;
use std::sync::{Arc, Weak};

use super::clusters::{Clusters, Grain, Pack};
use super::link::{Link, LinkError};
use super::orders::{Drawing, Order};
use super::serve::serve;
use super::spread::queues;
use super::stats::Counts;
use super::worker::{Gathered, Start, Step, Worker};
use super::{CellItem, CellPicture, CellRenderer, CellsError, MAX_WORKERS, Options, Ready, Scalar};
use crate::scene::Camera;

/// About how many bytes of cells go into one letter.
const PIECE: usize = 1 << 20;

/// The first of several processes that draw grids together, each with one worker.
///
/// Draws what [`CellRenderer`] draws: without early termination, the same bytes. The others have only their part of the grid
/// that was drawn last. When this is dropped they are told that there is no more to do.
pub struct Group<L: Link> {
    desk: Desk<L>,
    renderer: CellRenderer,
    dealt: Option<Dealt>,
    /// Of the last picture.
    number: u32,
    /// Why the others can no longer be counted on.
    lost: Option<LinkError>,
}

/// What the others have.
#[derive(Debug)]
struct Dealt {
    clusters: Weak<Clusters>,
    scalar: Option<(usize, Scalar)>,
    /// For each cluster the process that has it beside the first; 0 where none has.
    homes: Vec<u32>,
}

impl<L: Link> Group<L> {
    /// Takes part in a group: all of its processes call this. The first gets the group; every other draws its part of what
    /// the first draws, until that has no more to draw, and then gets nothing.
    ///
    /// # Errors
    /// [`CellsError::Workers`] where there are too many; in the others [`CellsError::Link`], after the first was told.
    pub fn join(link: L) -> Result<Option<Self>, CellsError> {
        if link.rank() >= link.size() || link.size() > MAX_WORKERS {
            return Err(CellsError::Workers);
        }
        let desk = Desk { link, held: VecDeque::new() };
        if desk.link.rank() > 0 {
            serve(desk)?;
            return Ok(None);
        }
        Ok(Some(Self { desk, renderer: CellRenderer::new(), dealt: None, number: 0, lost: None }))
    }

    /// How many processes there are.
    pub fn size(&self) -> usize {
        self.desk.link.size()
    }

    /// Draws a picture as [`CellRenderer::render`] does, by all processes; of the options, the workers and the engine are not
    /// looked at. Progress is that of all, as far as it is known to the first.
    ///
    /// # Errors
    /// All of [`CellsError`]. After a [`CellsError::Link`] the group draws no more.
    pub fn render(
        &mut self,
        item: &CellItem,
        camera: &Camera,
        size: [u32; 2],
        options: &Options,
        progress: &(dyn Fn(usize, usize) -> bool + Sync),
    ) -> Result<CellPicture, CellsError> {
        if let Some(lost) = &self.lost {
            return Err(lost.clone().into());
        }
        self.number += 1;
        let ready = self.renderer.ready(item, camera, size, options, Grain::of(options, true))?;
        let result = draw(&mut self.desk, &mut self.dealt, self.number, item, &ready, options, progress);
        match result {
            Ok(gathered) => Ok(ready.picture(gathered, options)),
            Err(error) => {
                let error = self.desk.why(error);
                self.desk.tell_all(&Order::Stop);
                if let CellsError::Link(lost) = &error {
                    self.lost = Some(lost.clone());
                }
                Err(error)
            }
        }
    }
}

impl<L: Link> std::fmt::Debug for Group<L> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Group").field("size", &self.size()).field("lost", &self.lost).finish_non_exhaustive()
    }
}

impl<L: Link> Drop for Group<L> {
    fn drop(&mut self) {
        self.desk.tell_all(&Order::End);
    }
}

/// Deals out what is needed and does the first worker's part.
fn draw<L: Link>(
    desk: &mut Desk<L>,
    dealt: &mut Option<Dealt>,
    number: u32,
    item: &CellItem,
    ready: &Ready,
    options: &Options,
    progress: &(dyn Fn(usize, usize) -> bool + Sync),
) -> Result<Gathered, CellsError> {
    let (frame, manner) = (ready.placed.frame(), ready.manner(options));
    let mut queues = queues(&frame, desk.link.size(), options.spread);
    let dealt = dealt.get_or_insert_with(Dealt::nothing);
    let sent = dealt.deal(desk, item, ready, &queues)?;
    let drawing = Drawing {
        number,
        size: ready.placed.size,
        lens: ready.placed.lens,
        transfer: (*item.transfer).clone(),
        manner,
        spread: options.spread,
        skip_clear: options.skip_clear,
        wide: options.wide,
    };
    let drawing = Order::Draw(Box::new(drawing)).to_bytes();
    for to in 1..desk.link.size() {
        desk.order(to, drawing.clone())?;
    }
    let left: Vec<u32> = queues.iter().map(|queue| queue.len() as u32).collect();
    let total = frame.clusters.len();
    let start = Start { queue: std::mem::take(&mut queues[0]), left, homes: &dealt.homes };
    let mut worker = Worker::new(&frame, manner, desk.letters(number), start);
    loop {
        match worker.step()? {
            Step::Worked => {}
            Step::Waiting => worker.wait()?,
            Step::Done => break,
        }
        if !progress(total.saturating_sub(worker.remaining()), total) {
            return Err(CellsError::Cancelled);
        }
    }
    let mut gathered = worker.into_gathered();
    gathered.counts[0].add(sent);
    Ok(gathered)
}

impl Dealt {
    fn nothing() -> Self {
        Self { clusters: Weak::new(), scalar: None, homes: Vec::new() }
    }

    /// Sends each process what it lacks of its clusters; what was sent.
    fn deal<L: Link>(
        &mut self,
        desk: &mut Desk<L>,
        item: &CellItem,
        ready: &Ready,
        queues: &[Vec<u32>],
    ) -> Result<Counts, LinkError> {
        let (clusters, scalars) = (&*ready.placed.clusters, &*ready.placed.scalars);
        let others = 1..desk.link.size();
        let mut sent = Counts::default();
        let mut send = |desk: &mut Desk<L>, to, message: Vec<u8>| {
            sent.messages += 1;
            sent.bytes += message.len() as u64;
            sent.cell_bytes += message.len() as u64;
            desk.order(to, message)
        };
        if self.clusters.as_ptr() != Arc::as_ptr(&ready.placed.clusters) {
            *self = Self { homes: vec![0; clusters.len()], ..Self::nothing() };
            let outlines = Order::Grid(clusters.outlines().to_vec()).to_bytes();
            for to in others.clone() {
                send(desk, to, outlines.clone())?;
            }
            self.clusters = Arc::downgrade(&ready.placed.clusters);
        }
        let scalar = Some((item.step, item.scalar.clone()));
        let same = self.scalar == scalar;
        if !same {
            let ranges = Order::Field(scalars.place(), scalars.ranges().to_vec()).to_bytes();
            for to in others.clone() {
                send(desk, to, ranges.clone())?;
            }
            self.scalar = scalar;
        }
        for to in others {
            let mut packs = Vec::new();
            let mut bytes = 0;
            for &cluster in &queues[to] {
                let pack = match std::mem::replace(&mut self.homes[cluster as usize], to as u32) {
                    home if home as usize != to => Pack::of(clusters, scalars, cluster),
                    _ if same => continue,
                    _ => Pack::values_of(scalars, cluster),
                };
                bytes += pack.bytes();
                packs.push(pack);
                if bytes > PIECE {
                    bytes = 0;
                    send(desk, to, Order::Cells(std::mem::take(&mut packs)).to_bytes())?;
                }
            }
            if !packs.is_empty() {
                send(desk, to, Order::Cells(packs).to_bytes())?;
            }
        }
        for &cluster in &queues[0] {
            self.homes[cluster as usize] = 0;
        }
        Ok(sent)
    }
}

/// A message, and the number of the picture that it is about; 0 for an order.
#[derive(Debug)]
struct Letter {
    from: usize,
    number: u32,
    message: Vec<u8>,
}

/// A process's end of the group, where letters come in.
#[derive(Debug)]
pub(super) struct Desk<L> {
    pub(super) link: L,
    /// What came before its time.
    held: VecDeque<Letter>,
}

impl<L: Link> Desk<L> {
    /// Sends an order.
    pub(super) fn order(&mut self, to: usize, message: Vec<u8>) -> Result<(), LinkError> {
        self.post(to, 0, message)
    }

    /// Sends an order to all others, as far as they can be reached.
    fn tell_all(&mut self, order: &Order) {
        for to in 1..self.link.size() {
            // Who is gone needs to be told nothing.
            drop(self.order(to, order.to_bytes()));
        }
    }

    /// What another has said of why it ends, where that is not known from the error itself: it may have gone before its
    /// letter was read.
    fn why(&mut self, error: CellsError) -> CellsError {
        if !matches!(error, CellsError::Link(LinkError::Lost { .. })) {
            return error;
        }
        while let Ok(Some(Letter { from, number, message })) = self.collect() {
            if let (0, Some(Order::Failed(fault))) = (number, Order::from_bytes(&message)) {
                return LinkError::Failed { rank: from, fault }.into();
            }
        }
        error
    }

    /// Waits for the first worker's next order.
    pub(super) fn next_order(&mut self) -> Result<Order, LinkError> {
        loop {
            let letter = match self.held.iter().position(|letter| letter.number == 0) {
                Some(place) => self.held.remove(place),
                None => self.collect()?,
            };
            match letter {
                Some(Letter { from: 0, number: 0, message }) => {
                    return Order::from_bytes(&message).ok_or(LinkError::Message { rank: 0 });
                }
                Some(Letter { from, number: 0, .. }) => return Err(LinkError::Message { rank: from }),
                // Another was quicker to begin the next picture.
                Some(letter) => self.held.push_back(letter),
                None => self.link.wait()?,
            }
        }
    }

    /// The link for the messages of one picture.
    pub(super) fn letters(&mut self, number: u32) -> Letters<'_, L> {
        self.held.retain(|letter| letter.number == 0 || letter.number >= number);
        Letters { desk: self, number }
    }

    fn post(&mut self, to: usize, number: u32, mut message: Vec<u8>) -> Result<(), LinkError> {
        message.extend(number.to_le_bytes());
        self.link.send(to, message)
    }

    /// The next letter from the link, if one is there.
    fn collect(&mut self) -> Result<Option<Letter>, LinkError> {
        let Some((from, mut message)) = self.link.poll()? else { return Ok(None) };
        let Some(&number) = message.last_chunk() else { return Err(LinkError::Message { rank: from }) };
        message.truncate(message.len() - number.len());
        Ok(Some(Letter { from, number: u32::from_le_bytes(number), message }))
    }
}

/// A link that carries the messages of one picture. An order in between ends the picture.
#[derive(Debug)]
pub(super) struct Letters<'a, L> {
    desk: &'a mut Desk<L>,
    number: u32,
}

impl<L: Link> Link for Letters<'_, L> {
    fn rank(&self) -> usize {
        self.desk.link.rank()
    }

    fn size(&self) -> usize {
        self.desk.link.size()
    }

    fn send(&mut self, to: usize, message: Vec<u8>) -> Result<(), LinkError> {
        self.desk.post(to, self.number, message)
    }

    fn poll(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        if let Some(place) = self.desk.held.iter().position(|letter| letter.number == self.number) {
            return Ok(self.desk.held.remove(place).map(|letter| (letter.from, letter.message)));
        }
        while let Some(letter) = self.desk.collect()? {
            let Letter { from, number, message } = letter;
            if number == self.number {
                return Ok(Some((from, message)));
            }
            if number > self.number {
                self.desk.held.push_back(Letter { from, number, message });
            } else if number == 0 && from == 0 {
                self.desk.held.push_back(Letter { from, number, message });
                return Err(LinkError::Stopped);
            } else if number == 0 {
                return Err(match Order::from_bytes(&message) {
                    Some(Order::Failed(fault)) => LinkError::Failed { rank: from, fault },
                    _ => LinkError::Message { rank: from },
                });
            }
        }
        Ok(None)
    }

    fn wait(&mut self) -> Result<(), LinkError> {
        self.desk.link.wait()
    }
}
