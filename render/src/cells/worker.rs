//! One worker: its cells, its lists and its part of the exchange, as a machine that goes step by step and never waits.
//!
//! 1. *Cells*: clusters from the nearest to the farthest. In between it answers who asks for work and shares which
//!    subscreens are terminated. Without work of its own it asks whoever has most left, and gets a third of that.
//! 2. *Ending*: waits until nobody asks any more.
//! 3. *Exchange*: binary swap. In each round two workers share out the rows that both have, so that in the end each has
//!    all segments of its own rows, and composites them. Where workers are no power of two, those beyond it first hand
//!    all they have to one within it.
//! 4. The first worker gathers the rows.
//!
//! Without early termination lists keep the runs of each cluster apart until they are complete and in order, so that the
//! same bytes come from any number of workers.

use super::clusters::Pack;
use super::early::{self, Early};
use super::fold::{Segment, composite};
use super::in_view::{Chosen, InView};
use super::link::{Link, LinkError};
use super::lists::Lists;
use super::project::{Frame, Projector, Sink};
use super::scan::Rect;
use super::stats::Counts;
use super::wire::Message;

/// What workers do about each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Manner {
    pub(super) early: Option<Early>,
    /// Pixels that a subscreen is wide.
    pub(super) side: usize,
    pub(super) share: bool,
    pub(super) balance: bool,
    pub(super) keep: bool,
}

/// What a worker begins with.
#[derive(Debug)]
pub(super) struct Start<'a> {
    /// Its clusters, nearest first.
    pub(super) queue: Vec<u32>,
    /// How many each worker has.
    pub(super) left: Vec<u32>,
    /// The worker that has each cluster's cells and values, beside the first, which has all; empty where all share them.
    pub(super) homes: &'a [u32],
}

/// What a step came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// A cluster, or something as small, was done.
    Worked,
    /// There is nothing to do until a message comes.
    Waiting,
    Done,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Cells,
    Ending,
    /// The next round, and whether its segments are sent.
    Exchange(u32, bool),
    Gathering,
    Done,
}

/// What is kept of the segments of pixels side by side.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct RowSegments {
    /// How many each pixel has; empty where they are not kept.
    pub(super) counts: Vec<u32>,
    pub(super) segments: Vec<Segment>,
}

impl Sink for Lists {
    fn done(&mut self, pixel: usize, run: Segment) {
        self.add(pixel, run);
    }
}

/// What is drawn of a cluster where some may not be seen.
struct Terminated<'a> {
    table: &'a early::Table,
    runs: &'a mut Vec<(usize, Segment)>,
}

impl Sink for Terminated<'_> {
    fn is_early(&self) -> bool {
        true
    }

    fn hides(&mut self, rect: &Rect, nearest: f64) -> bool {
        self.table.hides(rect, nearest)
    }

    fn done(&mut self, pixel: usize, run: Segment) {
        self.runs.push((pixel, run));
    }
}

/// What the first worker has in the end.
#[derive(Debug)]
pub(super) struct Gathered {
    /// Colours, row by row.
    pub(super) pixels: Vec<[f32; 4]>,
    /// Segments of each row.
    pub(super) kept: Vec<RowSegments>,
    /// What each worker did.
    pub(super) counts: Vec<Counts>,
}

#[derive(Debug)]
pub(super) struct Worker<'a, L> {
    frame: &'a Frame<'a>,
    manner: Manner,
    link: L,
    homes: &'a [u32],
    /// Clusters to do, the next one last.
    queue: Vec<u32>,
    lists: Lists,
    table: Option<early::Table>,
    projector: Projector,
    view: InView,
    scratch: Chosen,
    /// Runs of a cluster, which with early termination cannot be taken while it is drawn.
    runs: Vec<(usize, Segment)>,
    phase: Phase,
    /// Cells done since the table was brought up to date.
    since: u64,
    /// What others were last heard to have left, and whether they are at an end.
    left: Vec<u32>,
    finished: Vec<bool>,
    /// What was last told of this one.
    told: u32,
    asked: bool,
    /// Rounds of which segments have come, a bit each.
    came: u64,
    ended: usize,
    gathered: Gathered,
}

impl RowSegments {
    /// Puts more pixels behind it.
    pub(super) fn append(&mut self, mut more: Self) {
        self.counts.append(&mut more.counts);
        self.segments.append(&mut more.segments);
    }
}

impl<'a, L: Link> Worker<'a, L> {
    pub(super) fn new(frame: &'a Frame<'a>, manner: Manner, link: L, start: Start<'a>) -> Self {
        let Start { mut queue, left, homes } = start;
        let [width, height] = frame.size.map(|n| n as usize);
        let workers = link.size();
        queue.reverse();
        let first = usize::from(link.rank() == 0);
        let (pixels, kept) =
            (vec![[0.0; 4]; first * width * height], vec![RowSegments::default(); first * height]);
        Self {
            frame,
            manner,
            homes,
            told: queue.len() as u32,
            queue,
            lists: Lists::new(width * height),
            table: manner.early.map(|_| early::Table::new(&frame.rect(), manner.side)),
            projector: Projector::default(),
            view: InView::default(),
            scratch: Chosen::default(),
            runs: Vec::new(),
            phase: Phase::Cells,
            since: 0,
            left,
            finished: vec![false; workers],
            asked: false,
            came: 0,
            ended: 0,
            gathered: Gathered { pixels, kept, counts: vec![Counts::default(); workers] },
            link,
        }
    }

    /// What the first worker has gathered, when it is done.
    pub(super) fn into_gathered(self) -> Gathered {
        self.gathered
    }

    /// What this worker has done so far.
    pub(super) fn counts(&self) -> &Counts {
        &self.gathered.counts[self.link.rank()]
    }

    /// How many clusters are left to do, as far as is known here.
    pub(super) fn remaining(&self) -> usize {
        let me = self.link.rank();
        let others = self.left.iter().enumerate().filter(|&(rank, _)| rank != me);
        self.queue.len() + others.map(|(_, &left)| left as usize).sum::<usize>()
    }

    /// Waits for a message.
    pub(super) fn wait(&mut self) -> Result<(), LinkError> {
        self.link.wait()
    }

    /// Does what can be done next.
    pub(super) fn step(&mut self) -> Result<Step, LinkError> {
        if self.phase == Phase::Done {
            // What comes now is not about this picture.
            return Ok(Step::Done);
        }
        while let Some((from, bytes)) = self.link.poll()? {
            let message = Message::from_bytes(&bytes).ok_or(LinkError::Message { rank: from })?;
            self.receive(from, message)?;
        }
        match self.phase {
            Phase::Cells => self.cells(),
            Phase::Ending => {
                let me = self.link.rank();
                if !self.finished.iter().enumerate().all(|(rank, &f)| f || rank == me) {
                    return Ok(Step::Waiting);
                }
                self.count().held = self.frame.clusters.held();
                self.phase = Phase::Exchange(0, false);
                Ok(Step::Worked)
            }
            Phase::Exchange(round, sent) => self.exchange(round, sent),
            Phase::Gathering if self.ended + 1 < self.link.size() => Ok(Step::Waiting),
            Phase::Gathering | Phase::Done => Ok(Step::Done),
        }
    }

    fn count(&mut self) -> &mut Counts {
        &mut self.gathered.counts[self.link.rank()]
    }

    /// Sends a message; gives its length.
    fn send(&mut self, to: usize, message: &Message) -> Result<u64, LinkError> {
        let message = message.to_bytes();
        let bytes = message.len() as u64;
        let counts = self.count();
        counts.bytes += bytes;
        counts.messages += 1;
        self.link.send(to, message)?;
        Ok(bytes)
    }

    fn send_all(&mut self, message: &Message) -> Result<(), LinkError> {
        for to in (0..self.link.size()).filter(|&to| to != self.link.rank()).collect::<Vec<_>>() {
            self.send(to, message)?;
        }
        Ok(())
    }

    fn receive(&mut self, from: usize, message: Message) -> Result<(), LinkError> {
        let nonsense = LinkError::Message { rank: from };
        match message {
            Message::Left(left) => self.left[from] = left,
            Message::Terminated(list) => {
                for (index, deepest) in list {
                    if let Some(table) = &mut self.table {
                        table.learn(index, deepest);
                    }
                }
            }
            Message::Ask => {
                let given = self.give();
                let packs = self.packs(from, &given);
                self.told = self.queue.len() as u32;
                let with_cells = !packs.is_empty();
                let bytes = self.send(from, &Message::Work(given, self.told, packs))?;
                if with_cells {
                    self.count().cell_bytes += bytes;
                }
            }
            Message::Work(list, left, packs) => {
                let Frame { clusters, scalars, .. } = self.frame;
                let unpacked = packs.into_iter().all(|pack| pack.unpack(clusters, scalars));
                if !unpacked || !list.iter().all(|&cluster| scalars.has(clusters, cluster as usize)) {
                    return Err(nonsense);
                }
                self.asked = false;
                self.left[from] = left;
                if !list.is_empty() {
                    self.count().taken += list.len() as u64;
                    self.queue = list;
                    self.told = 0;
                    self.tell()?;
                }
            }
            Message::Finished => {
                self.left[from] = 0;
                self.finished[from] = true;
            }
            Message::Runs(round, list) => {
                let pixels = self.frame.size[0] as usize * self.frame.size[1] as usize;
                for (pixel, segment) in list {
                    if pixel as usize >= pixels {
                        return Err(nonsense);
                    }
                    self.lists.add(pixel as usize, segment);
                }
                self.came |= 1_u64.checked_shl(round).ok_or(nonsense)?;
            }
            Message::Row(row, colors, counts, segments) => {
                let width = self.frame.size[0] as usize;
                let counted = if self.manner.keep { width } else { 0 };
                let sum: u64 = counts.iter().map(|&count| u64::from(count)).sum();
                let whole = colors.len() == width && counts.len() == counted && sum == segments.len() as u64;
                if !whole || row as usize >= self.gathered.kept.len() {
                    return Err(nonsense);
                }
                self.put(row as usize, &colors, RowSegments { counts, segments });
            }
            Message::Counts(list) => {
                self.gathered.counts[from] = Counts::from_list(&list).ok_or(nonsense)?;
                self.ended += 1;
            }
        }
        Ok(())
    }

    /// What another worker has not got of clusters.
    fn packs(&self, to: usize, given: &[u32]) -> Vec<Pack> {
        let Frame { clusters, scalars, .. } = self.frame;
        let lacks = |cluster: u32| {
            to > 0 && self.homes.get(cluster as usize).is_some_and(|&home| home as usize != to)
        };
        let lacking = given.iter().filter(|&&cluster| lacks(cluster));
        lacking.map(|&cluster| Pack::of(clusters, scalars, cluster)).collect()
    }

    /// Every third of the clusters left, so that near and far ones go with it.
    fn give(&mut self) -> Vec<u32> {
        let mut given = Vec::new();
        if self.queue.len() < 2 {
            return given;
        }
        let mut position = 0;
        // Two stay and one goes, from the farthest on.
        self.queue.retain(|&cluster| {
            position += 1;
            let goes = position % 3 == 1;
            if goes {
                given.push(cluster);
            }
            !goes
        });
        given
    }

    /// Tells the others how much is left, where that has changed enough to matter.
    fn tell(&mut self) -> Result<(), LinkError> {
        let left = self.queue.len() as u32;
        let changed = left + left / 8 < self.told || left > self.told || (left < 2 && self.told >= 2);
        if self.manner.balance && changed {
            self.told = left;
            self.send_all(&Message::Left(left))?;
        }
        Ok(())
    }

    fn cells(&mut self) -> Result<Step, LinkError> {
        if let Some(cluster) = self.queue.pop() {
            self.draw(cluster as usize);
            self.refresh(cluster as usize)?;
            self.tell()?;
            return Ok(Step::Worked);
        }
        if self.asked {
            return Ok(Step::Waiting);
        }
        let me = self.link.rank();
        let others = self.left.iter().enumerate().filter(|&(rank, &left)| rank != me && left >= 2);
        // Of equals the next in number, so that not all ask the same one.
        let size = self.link.size();
        let fullest = others.max_by_key(|&(rank, &left)| (left, (me + size - rank) % size)).map(|o| o.0);
        if let Some(fullest) = fullest.filter(|_| self.manner.balance) {
            self.asked = true;
            self.send(fullest, &Message::Ask)?;
            return Ok(Step::Waiting);
        }
        self.send_all(&Message::Finished)?;
        self.phase = Phase::Ending;
        Ok(Step::Worked)
    }

    fn draw(&mut self, cluster: usize) {
        let rank = self.link.rank();
        let counts = &mut self.gathered.counts[rank];
        counts.clusters += 1;
        let frame = self.frame;
        let Some((reach, nearest)) = frame.shows(cluster, counts) else { return };
        if self.table.as_ref().is_some_and(|table| table.hides(&reach, nearest)) {
            counts.hidden += frame.clusters.count(cluster) as u64;
            return;
        }
        self.view.fill(frame, cluster, &mut self.scratch, counts);
        let (of, lists, picture) = (&self.view, &mut self.lists, frame.rect());
        let Some((table, early)) = self.table.as_mut().zip(self.manner.early) else {
            self.projector.draw(frame, of, &picture, lists, counts);
            return;
        };
        self.runs.clear();
        let mut sink = Terminated { table, runs: &mut self.runs };
        self.projector.draw(frame, of, &picture, &mut sink, counts);
        for &(pixel, run) in &self.runs {
            if run.front >= table.pixel(pixel) {
                counts.merged += 1;
                continue;
            }
            let end = lists.add_early(pixel, run, early.threshold as f32, &mut counts.merged);
            if let Some(depth) = end {
                table.terminate(pixel, depth);
            }
        }
    }

    /// Brings the table of subscreens up to date from time to time, and shares what is new.
    fn refresh(&mut self, cluster: usize) -> Result<(), LinkError> {
        let (Some(table), Some(early)) = (&mut self.table, self.manner.early) else { return Ok(()) };
        self.since += self.frame.clusters.count(cluster) as u64;
        let left: u64 = self.queue.iter().map(|&c| self.frame.clusters.count(c as usize) as u64).sum();
        if self.since < left / u64::from(early.refreshes.max(1)) {
            return Ok(());
        }
        self.since = 0;
        let nearer = table.refresh();
        if self.manner.share && !nearer.is_empty() {
            self.send_all(&Message::Terminated(nearer))?;
        }
        Ok(())
    }

    /// The largest power of two of workers.
    fn within(&self) -> usize {
        1 << self.link.size().ilog2()
    }

    fn exchange(&mut self, round: u32, sent: bool) -> Result<Step, LinkError> {
        let (me, size, within) = (self.link.rank(), self.link.size(), self.within());
        let height = self.frame.size[1];
        if round == 0 {
            if me >= within {
                let all = self.take_rows(|_| true);
                self.send(me - within, &Message::Runs(0, all))?;
                self.finish_counts()?;
                self.phase = Phase::Done;
                return Ok(Step::Worked);
            }
            if me + within < size && self.came & 1 == 0 {
                return Ok(Step::Waiting);
            }
            self.phase = Phase::Exchange(1, false);
            return Ok(Step::Worked);
        }
        // From the halves of the picture to their halves, so that a worker that began with a part of it gives little away.
        let band = move |y: usize| y * within / height as usize;
        let bit = within >> round;
        if bit > 0 {
            let partner = me ^ bit;
            if !sent {
                let theirs = self.take_rows(|y| (band(y) ^ partner) < bit);
                self.send(partner, &Message::Runs(round, theirs))?;
                self.phase = Phase::Exchange(round, true);
                return Ok(Step::Worked);
            }
            if self.came >> round & 1 == 0 {
                return Ok(Step::Waiting);
            }
            self.phase = Phase::Exchange(round + 1, false);
            return Ok(Step::Worked);
        }
        for y in (0..height).filter(|&y| band(y as usize) == me) {
            let (colors, kept) = self.row(y as usize);
            if me == 0 {
                self.put(y as usize, &colors, kept);
            } else {
                self.send(0, &Message::Row(y, colors, kept.counts, kept.segments))?;
            }
        }
        self.phase = Phase::Gathering;
        if me > 0 {
            self.finish_counts()?;
            self.phase = Phase::Done;
        }
        Ok(Step::Worked)
    }

    fn finish_counts(&mut self) -> Result<(), LinkError> {
        let list = self.counts().to_list();
        self.link.send(0, Message::Counts(list).to_bytes())
    }

    /// Takes the segments of some rows out of the lists.
    fn take_rows(&mut self, which: impl Fn(usize) -> bool) -> Vec<(u32, Segment)> {
        let [width, height] = self.frame.size.map(|n| n as usize);
        let mut taken = Vec::new();
        for y in (0..height).filter(|&y| which(y)) {
            for pixel in y * width..(y + 1) * width {
                taken.extend(self.lists.pixel(pixel).map(|s| (pixel as u32, *s)));
                self.lists.clear(pixel);
            }
        }
        taken
    }

    /// Puts a finished row into the picture, which the first worker has.
    fn put(&mut self, y: usize, colors: &[[f32; 4]], kept: RowSegments) {
        self.gathered.pixels[y * colors.len()..][..colors.len()].copy_from_slice(colors);
        self.gathered.kept[y] = kept;
    }

    /// Composites a row.
    fn row(&mut self, y: usize) -> (Vec<[f32; 4]>, RowSegments) {
        let width = self.frame.size[0] as usize;
        let (mut colors, mut row) = (Vec::with_capacity(width), RowSegments::default());
        let mut list: Vec<Segment> = Vec::new();
        let most = self.frame.table.most();
        let rank = self.link.rank();
        let counts = &mut self.gathered.counts[rank];
        for pixel in y * width..(y + 1) * width {
            let kept = self.manner.keep.then_some(&mut row);
            list.clear();
            list.extend(self.lists.pixel(pixel));
            // The nearest clusters came first, and lists begin with what came last.
            list.reverse();
            let mut color = composite(&mut list, kept, counts);
            if let Some(early) = &self.manner.early {
                early.complete(&mut color, most);
            }
            colors.push(color);
        }
        (colors, row)
    }
}
