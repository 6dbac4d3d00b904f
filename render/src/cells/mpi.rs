//! Workers as the processes of an MPI job: `mpirun -n N program`.
//!
//! Messages go from point to point over a communicator of their own, so that nothing else that the program does with MPI gets
//! among them. A message longer than `PIECE` goes in pieces, since MPI counts in 32 bits. A process that waits sleeps in
//! between; what it has sent stays in memory until MPI has passed it on, up to `OUTGOING` bytes, and then sending takes
//! letters in until there is room again.
//!
//! A fault inside MPI ends the whole job, which is how MPI comes: with its message and an exit code above 0. So does a process
//! that is killed: `mpirun` sees it and ends the others.
//!
//! Source: MPI 3.1, sections 3.7 (nonblocking communication), 3.8.2 (matching probe), 8.7 (startup, abort).

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use mpi::environment::Universe;
use mpi::request::{Request, StaticScope};
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator as _, Destination as _, MatchedReceiveVec as _, Source as _};
use mpi::{Tag, Threading};
use thiserror::Error;

use super::link::{Link, LinkError};

/// Bytes of a piece of a message.
const PIECE: usize = 1 << 24;

/// Bytes that may be under way; one message more may always be.
const OUTGOING: usize = 1 << 26;

/// The tag of a piece that others of the same message follow, and that of the last.
const MORE: Tag = 0;
const LAST: Tag = 1;

/// How long what was sent last may take to arrive, when a process has no more to do.
const PATIENCE: Duration = Duration::from_secs(10);

/// Why there is no link.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MpiError {
    /// MPI can be begun once in a process.
    #[error("MPI was already begun in this process; begin it once, and keep what it gives")]
    Begun,
    /// The library is not made for programs with threads.
    #[error("this MPI cannot be used by a program with threads; take one that gives MPI_THREAD_FUNNELED")]
    Threads,
}

/// A process's end of an MPI job.
///
/// Stays on the thread that made it. When it is dropped, what it sent last is passed on and MPI is ended; if another process
/// does not take that for ten seconds, the job is aborted with code 1.
pub struct MpiLink {
    sent: Vec<Sent>,
    /// Bytes in `sent`.
    outgoing: usize,
    inbox: VecDeque<(usize, Vec<u8>)>,
    /// What has come of each process's next message.
    begun: Vec<Vec<u8>>,
    // Dropped in this order: the communicator before MPI is ended.
    group: SimpleCommunicator,
    _universe: Universe,
}

impl std::fmt::Debug for MpiLink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [rank, size] = [self.group.rank(), self.group.size()];
        f.debug_struct("MpiLink").field("rank", &rank).field("size", &size).finish_non_exhaustive()
    }
}

impl MpiLink {
    /// Begins MPI; every process of the job must do so.
    ///
    /// # Errors
    /// [`MpiError`].
    pub fn begin() -> Result<Self, MpiError> {
        let (universe, threading) =
            mpi::initialize_with_threading(Threading::Funneled).ok_or(MpiError::Begun)?;
        if threading < Threading::Funneled {
            return Err(MpiError::Threads);
        }
        let group = universe.world().duplicate();
        let size = group.size() as usize;
        Ok(Self {
            sent: Vec::new(),
            outgoing: 0,
            inbox: VecDeque::new(),
            begun: vec![Vec::new(); size],
            group,
            _universe: universe,
        })
    }

    /// Takes in what has come and lets go of what was passed on.
    fn progress(&mut self) {
        while let Some(found) = self.group.any_process().immediate_matched_probe() {
            let (piece, status) = found.matched_receive_vec::<u8>();
            let from = status.source_rank() as usize;
            let begun = &mut self.begun[from];
            // Most are of one piece.
            if begun.is_empty() {
                *begun = piece;
            } else {
                begun.extend(piece);
            }
            if status.tag() == LAST {
                self.inbox.push_back((from, std::mem::take(begun)));
            }
        }
        let outgoing = &mut self.outgoing;
        self.sent = std::mem::take(&mut self.sent)
            .into_iter()
            .filter_map(|sent| sent.test().map_err(|bytes| *outgoing -= bytes).ok())
            .collect();
    }
}

impl Link for MpiLink {
    fn rank(&self) -> usize {
        self.group.rank() as usize
    }

    fn size(&self) -> usize {
        self.group.size() as usize
    }

    fn send(&mut self, to: usize, message: Vec<u8>) -> Result<(), LinkError> {
        let to_rank = i32::try_from(to).ok().filter(|&to| to < self.group.size());
        let to_rank = to_rank.ok_or(LinkError::Lost { rank: to })?;
        let mut pause = Pause::default();
        while self.outgoing > OUTGOING {
            self.progress();
            pause.rest();
        }
        self.outgoing += message.len();
        self.sent.push(Sent::new(&self.group, to_rank, message));
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        self.progress();
        Ok(self.inbox.pop_front())
    }

    fn wait(&mut self) -> Result<(), LinkError> {
        let mut pause = Pause::default();
        self.progress();
        while self.inbox.is_empty() && pause.slept < Duration::from_millis(100) {
            pause.rest();
            self.progress();
        }
        Ok(())
    }
}

impl Drop for MpiLink {
    fn drop(&mut self) {
        let end = Instant::now() + PATIENCE;
        let mut pause = Pause::default();
        while !self.sent.is_empty() {
            if Instant::now() > end {
                // The requests cannot be taken back, and MPI would wait for them.
                self.group.abort(1);
            }
            self.progress();
            pause.rest();
        }
    }
}

/// Rests that grow: what comes at once is not waited for, and who waits long does not take the processor from who works.
#[derive(Debug, Default)]
struct Pause {
    rests: u32,
    slept: Duration,
}

impl Pause {
    fn rest(&mut self) {
        self.rests += 1;
        if self.rests <= 16 {
            std::thread::yield_now();
            return;
        }
        let sleep = Duration::from_micros(10 << (self.rests - 17).min(6));
        self.slept += sleep;
        std::thread::sleep(sleep);
    }
}

/// A message that is under way.
struct Sent {
    pieces: Vec<Request<'static, [u8], StaticScope>>,
    /// What the pieces are of; from `Box::into_raw`.
    message: *mut [u8],
}

impl Sent {
    fn new(group: &SimpleCommunicator, to: i32, message: Vec<u8>) -> Self {
        let message = Box::into_raw(message.into_boxed_slice());
        #[expect(unsafe_code, reason = "MPI reads a message after the call that sends it")]
        // SAFETY: this points to a box that is taken apart by nobody but `test`, after the last request is done with it, and
        // which nobody writes to.
        let bytes: &'static [u8] = unsafe { &*message };
        let to = group.process_at_rank(to);
        let (last, more) = match bytes.len().saturating_sub(1) / PIECE {
            0 => (bytes, &[][..]),
            whole => (&bytes[whole * PIECE..], &bytes[..whole * PIECE]),
        };
        let mut pieces: Vec<_> =
            more.chunks(PIECE).map(|piece| to.immediate_send_with_tag(StaticScope, piece, MORE)).collect();
        pieces.push(to.immediate_send_with_tag(StaticScope, last, LAST));
        Self { pieces, message }
    }

    /// This, if MPI still needs it; otherwise the bytes that are free again.
    fn test(mut self) -> Result<Self, usize> {
        let pieces = std::mem::take(&mut self.pieces);
        self.pieces = pieces.into_iter().filter_map(|piece| piece.test().err()).collect();
        if !self.pieces.is_empty() {
            return Ok(self);
        }
        #[expect(unsafe_code, reason = "MPI has read the message")]
        // SAFETY: it came from `Box::into_raw`, every request that read it is done, and `self` goes away here.
        let message = unsafe { Box::from_raw(self.message) };
        Err(message.len())
    }
}
