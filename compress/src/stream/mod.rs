//! The data side of playback: chunks of a series, read and unpacked ahead of the player, in the order of playing.
//!
//! One thread reads packed chunks; others unpack them; the player takes payloads in order and hands them to the GPU.
//! Between them stands one queue of bounded length, in which a chunk has its place from the moment it is read: so
//! they come out in order however many threads unpack. There is no clock here: the player asks, and when it finds
//! that nothing is ready it decides itself to wait or to drop a frame; [`Counters::starved`] counts that.
//!
//! **Order.** [`Stream::play_from`] says where, in which [`Direction`], and whether to go round; prefetch follows it.
//! [`Stream::jump`] scrubs: what was prefetched and is not wanted any longer is dropped, what is still wanted stays.
//!
//! **Memory.** With capacity c and n threads at most c + n payloads and c + n + 1 packed chunks exist, next to a
//! payload of working memory a thread and to the payloads that the player holds. Buffers are used again.
//!
//! Parts: `prefetch` which chunk is wanted next, `queue` the places and their buffers, `pool` the threads.
//!
//! Source: *Nagayasu*, section 3.3, steps 1 and 2; that the steps overlap is from the authors' later pipeline, which
//! *Yamada* cites as reference 2.

mod pool;
mod prefetch;
mod queue;

use std::fmt;
use std::io::{self, Read, Seek};
use std::num::NonZeroUsize;
use std::ops::Range;
use std::sync::Arc;
use std::thread::JoinHandle;

use thiserror::Error;

pub use prefetch::{Direction, Repeat};
pub use queue::Counters;

use crate::container::{Header, ReadError, Reader};
use prefetch::Wanted;
use queue::{Queue, Taken};

/// How far and by how many a series is prefetched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Threads that unpack.
    pub threads: NonZeroUsize,
    /// Most chunks that are read or unpacked ahead of the player.
    pub capacity: NonZeroUsize,
}

impl Default for Options {
    /// Two threads, four chunks ahead.
    fn default() -> Self {
        const TWO: NonZeroUsize = NonZeroUsize::MIN.saturating_add(1);
        Self { threads: TWO, capacity: TWO.saturating_add(2) }
    }
}

/// Why a chunk did not come. The stream goes on with the next.
#[derive(Debug, Error)]
#[error("chunk {chunk} of the series cannot be played")]
pub struct StreamError {
    /// The chunk, counted from 0.
    pub chunk: u32,
    /// Why.
    #[source]
    pub source: ReadError,
}

/// A chunk, unpacked. Its memory goes back to the stream when it is dropped.
pub struct Chunk {
    index: u32,
    steps: Range<u32>,
    payload: Vec<u8>,
    queue: Arc<Queue>,
}

impl Chunk {
    /// Which chunk it is, counted from 0.
    pub fn chunk(&self) -> u32 {
        self.index
    }

    /// The steps in it.
    pub fn steps(&self) -> Range<u32> {
        self.steps.clone()
    }

    /// The payload, for the decoder of the series' step codec.
    pub fn payload(&self) -> &[u8] {
        &self.payload
    }
}

impl AsRef<[u8]> for Chunk {
    fn as_ref(&self) -> &[u8] {
        &self.payload
    }
}

impl fmt::Debug for Chunk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut debug = f.debug_struct("Chunk");
        debug.field("index", &self.index).field("steps", &self.steps).finish_non_exhaustive()
    }
}

impl Drop for Chunk {
    fn drop(&mut self) {
        self.queue.give_back(std::mem::take(&mut self.payload));
    }
}

/// What [`Stream::poll`] finds.
#[derive(Debug)]
pub enum Next {
    /// The next chunk.
    Ready(Chunk),
    /// The next chunk is not ready yet.
    Pending,
    /// Nothing is wanted any longer: the series was played once to its end, or playing was not begun.
    End,
}

/// A series that is being prefetched. Dropping it stops its threads.
#[derive(Debug)]
pub struct Stream {
    queue: Arc<Queue>,
    threads: Vec<JoinHandle<()>>,
    header: Header,
    times_secs: Vec<f64>,
    /// The steps of each chunk.
    chunks: Vec<Range<u32>>,
    direction: Direction,
    repeat: Repeat,
}

impl Stream {
    /// Starts the threads, which wait until [`Stream::play_from`] says what is wanted.
    ///
    /// # Errors
    /// That of the system if a thread cannot be started.
    pub fn spawn<R>(reader: Reader<R>, options: Options) -> io::Result<Self>
    where
        R: Read + Seek + Send + 'static,
    {
        let chunks: Vec<_> = (0..reader.chunks()).map_while(|chunk| reader.steps_of(chunk).ok()).collect();
        let header = reader.header().clone();
        let times_secs = reader.times_secs().to_vec();
        let queue = Arc::new(Queue::new(options));
        let mut stream = Self {
            queue: Arc::clone(&queue),
            threads: Vec::new(),
            header,
            times_secs,
            chunks,
            direction: Direction::Forward,
            repeat: Repeat::Once,
        };
        // An early return drops the stream, and with it the threads that were started.
        pool::start(&queue, reader, options.threads, &mut stream.threads)?;
        Ok(stream)
    }

    /// What the series is.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The time of each step, in s: finite and rising.
    pub fn times_secs(&self) -> &[f64] {
        &self.times_secs
    }

    /// Chunks of the series.
    pub fn chunks(&self) -> u32 {
        self.chunks.len() as u32
    }

    /// Wants the chunk of `step`, then those after it in `direction`; with [`Repeat::Loop`], round and round.
    ///
    /// # Errors
    /// [`ReadError::Step`] if the series has no such step; what was wanted before then stays.
    pub fn play_from(&mut self, step: u32, direction: Direction, repeat: Repeat) -> Result<(), ReadError> {
        let chunk = self.chunks.partition_point(|steps| steps.end <= step);
        if chunk >= self.chunks.len() {
            return Err(ReadError::Step { step, steps: self.times_secs.len() as u32 });
        }
        let same = direction == self.direction && repeat == self.repeat;
        (self.direction, self.repeat) = (direction, repeat);
        self.queue.want(Wanted::from(chunk as u32, self.chunks.len() as u32, direction, repeat), same);
        Ok(())
    }

    /// Wants the chunk of `step`, then those after it in the direction that was played: for scrubbing.
    ///
    /// # Errors
    /// [`ReadError::Step`] if the series has no such step.
    pub fn jump(&mut self, step: u32) -> Result<(), ReadError> {
        self.play_from(step, self.direction, self.repeat)
    }

    /// The next chunk, if it is ready.
    ///
    /// # Errors
    /// [`StreamError`] if the next chunk could not be read or unpacked; the call after goes on behind it.
    pub fn poll(&mut self) -> Result<Next, StreamError> {
        match self.queue.take(false) {
            Taken::Pending => Ok(Next::Pending),
            Taken::End => Ok(Next::End),
            Taken::Chunk(chunk, payload) => self.chunk(chunk, payload).map(Next::Ready),
        }
    }

    /// The next chunk, as soon as it is ready; none if nothing is wanted any longer.
    ///
    /// # Errors
    /// Those of [`Stream::poll`].
    pub fn wait(&mut self) -> Result<Option<Chunk>, StreamError> {
        match self.queue.take(true) {
            Taken::Pending | Taken::End => Ok(None),
            Taken::Chunk(chunk, payload) => self.chunk(chunk, payload).map(Some),
        }
    }

    /// What was done so far.
    pub fn counters(&self) -> Counters {
        self.queue.counters()
    }

    fn chunk(&self, chunk: u32, payload: Result<Vec<u8>, ReadError>) -> Result<Chunk, StreamError> {
        let payload = payload.map_err(|source| StreamError { chunk, source })?;
        let steps = self.chunks.get(chunk as usize).cloned().unwrap_or_default();
        Ok(Chunk { index: chunk, steps, payload, queue: Arc::clone(&self.queue) })
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.queue.close();
        for thread in self.threads.drain(..) {
            // A thread that panicked has nothing left to stop.
            drop(thread.join());
        }
    }
}
