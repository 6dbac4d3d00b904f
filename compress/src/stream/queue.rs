//! The places of the chunks that are on their way, and the buffers that go round.

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::Options;
use super::prefetch::Wanted;
use crate::container::ReadError;
use crate::lossless::Form;

/// What a stream did since it was started. Times are sums over its threads.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Chunks that were read, and their packed bytes.
    pub chunks_read: u64,
    /// Packed bytes that were read.
    pub bytes_read: u64,
    /// Time spent reading and checking.
    pub reading: Duration,
    /// Chunks that were unpacked.
    pub chunks_unpacked: u64,
    /// Bytes of their payloads.
    pub bytes_unpacked: u64,
    /// Time spent unpacking.
    pub unpacking: Duration,
    /// Chunks, and errors in place of chunks, that the player took.
    pub taken: u64,
    /// Chunks that were read, or were about to be, and that a jump made useless.
    pub stale: u64,
    /// How often the player asked and the next chunk was not ready.
    pub starved: u64,
    /// Chunks that are ready now.
    pub ready: usize,
    /// Chunks that have a place now, ready or not.
    pub queued: usize,
    /// Payloads that are in memory now: ready, being unpacked, held by the player, or free to be used again.
    pub payloads: usize,
}

/// Where a chunk is on its way.
enum Stage {
    Reading,
    Packed(Form, Vec<u8>),
    Unpacking,
    Ready(Result<Vec<u8>, ReadError>),
}

/// The place of one chunk.
struct Slot {
    ticket: u64,
    chunk: u32,
    stage: Stage,
}

/// All that threads share.
struct State {
    wanted: Wanted,
    /// In the order of playing.
    slots: VecDeque<Slot>,
    next_ticket: u64,
    free_packed: Vec<Vec<u8>>,
    free_payloads: Vec<Vec<u8>>,
    counters: Counters,
    closed: bool,
}

/// The queue between reader, unpackers and player.
pub(super) struct Queue {
    state: Mutex<State>,
    /// Told when there may be something to read.
    room: Condvar,
    /// Told when there may be something to unpack.
    packed: Condvar,
    /// Told when the first chunk may be ready.
    ready: Condvar,
    capacity: usize,
    /// Most buffers of a kind that are kept for later.
    kept: usize,
}

/// A chunk to read, with a buffer to read it into.
pub(super) struct ToRead {
    pub(super) ticket: u64,
    pub(super) chunk: u32,
    pub(super) packed: Vec<u8>,
}

/// A chunk to unpack, with a buffer to unpack it into.
pub(super) struct ToUnpack {
    pub(super) ticket: u64,
    pub(super) chunk: u32,
    pub(super) form: Form,
    pub(super) packed: Vec<u8>,
    pub(super) payload: Vec<u8>,
}

/// What the player gets.
pub(super) enum Taken {
    Chunk(u32, Result<Vec<u8>, ReadError>),
    Pending,
    End,
}

impl fmt::Debug for Queue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Queue").field("capacity", &self.capacity).finish_non_exhaustive()
    }
}

impl Queue {
    pub(super) fn new(options: Options) -> Self {
        let state = State {
            wanted: Wanted::NONE,
            slots: VecDeque::new(),
            next_ticket: 0,
            free_packed: Vec::new(),
            free_payloads: Vec::new(),
            counters: Counters::default(),
            closed: false,
        };
        let capacity = options.capacity.get();
        Self {
            state: Mutex::new(state),
            room: Condvar::new(),
            packed: Condvar::new(),
            ready: Condvar::new(),
            capacity,
            kept: capacity + options.threads.get(),
        }
    }

    /// No thread leaves the state half changed, so one that panicked left it whole.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// For the reader: the next chunk, when there is room for it; none when the stream is closed.
    pub(super) fn to_read(&self) -> Option<ToRead> {
        let mut state = self.state();
        loop {
            if state.closed {
                return None;
            }
            if state.slots.len() < self.capacity
                && let Some(chunk) = state.wanted.next()
            {
                let ticket = state.next_ticket;
                state.next_ticket += 1;
                state.slots.push_back(Slot { ticket, chunk, stage: Stage::Reading });
                let packed = state.free_packed.pop().unwrap_or_default();
                return Some(ToRead { ticket, chunk, packed });
            }
            state = self.room.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// From the reader: what it read, or why not, and how long that took.
    pub(super) fn was_read(
        &self,
        ticket: u64,
        packed: Vec<u8>,
        read: Result<Form, ReadError>,
        time: Duration,
    ) {
        let mut guard = self.state();
        let state = &mut *guard;
        if read.is_ok() {
            state.counters.chunks_read += 1;
            state.counters.bytes_read += packed.len() as u64;
        }
        state.counters.reading += time;
        let Some(slot) = state.slots.iter_mut().find(|slot| slot.ticket == ticket) else {
            state.counters.stale += 1;
            state.free_packed(packed, self.kept);
            return;
        };
        match read {
            Ok(form) => {
                slot.stage = Stage::Packed(form, packed);
                self.packed.notify_one();
            }
            Err(error) => {
                slot.stage = Stage::Ready(Err(error));
                state.free_packed(packed, self.kept);
                self.ready.notify_all();
            }
        }
    }

    /// For an unpacker: the chunk that is wanted soonest, when there is one; none when the stream is closed.
    pub(super) fn to_unpack(&self) -> Option<ToUnpack> {
        let mut guard = self.state();
        loop {
            let state = &mut *guard;
            if state.closed {
                return None;
            }
            let first = state.slots.iter_mut().find(|slot| matches!(slot.stage, Stage::Packed(..)));
            if let Some(Slot { ticket, chunk, stage }) = first
                && let Stage::Packed(form, packed) = std::mem::replace(stage, Stage::Unpacking)
            {
                let payload = state.free_payloads.pop().unwrap_or_else(|| {
                    state.counters.payloads += 1;
                    Vec::new()
                });
                return Some(ToUnpack { ticket: *ticket, chunk: *chunk, form, packed, payload });
            }
            guard = self.packed.wait(guard).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// From an unpacker: what it unpacked, or why not, and how long that took.
    pub(super) fn was_unpacked(
        &self,
        ToUnpack { ticket, packed, payload, .. }: ToUnpack,
        unpacked: Result<(), ReadError>,
        time: Duration,
    ) {
        let mut guard = self.state();
        let state = &mut *guard;
        state.free_packed(packed, self.kept);
        if unpacked.is_ok() {
            state.counters.chunks_unpacked += 1;
            state.counters.bytes_unpacked += payload.len() as u64;
        }
        state.counters.unpacking += time;
        let Some(at) = state.slots.iter().position(|slot| slot.ticket == ticket) else {
            state.counters.stale += 1;
            state.free_payload(payload, self.kept);
            return;
        };
        let ready = match unpacked {
            Ok(()) => Ok(payload),
            Err(error) => {
                state.free_payload(payload, self.kept);
                Err(error)
            }
        };
        if let Some(slot) = state.slots.get_mut(at) {
            slot.stage = Stage::Ready(ready);
        }
        self.ready.notify_all();
    }

    /// For the player: the first chunk; waits for it if asked to.
    pub(super) fn take(&self, wait: bool) -> Taken {
        let mut state = self.state();
        let mut starved = false;
        loop {
            match state.slots.pop_front() {
                None if state.wanted.peek().is_none() || state.closed => return Taken::End,
                None => {}
                Some(Slot { chunk, stage: Stage::Ready(payload), .. }) => {
                    state.counters.taken += 1;
                    self.room.notify_one();
                    return Taken::Chunk(chunk, payload);
                }
                Some(slot) => state.slots.push_front(slot),
            }
            state.counters.starved += u64::from(!starved);
            starved = true;
            if !wait {
                return Taken::Pending;
            }
            state = self.ready.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// From the player: what is wanted now. If only the place is new (`same`), chunks that are on their way and wanted
    /// still keep their places.
    pub(super) fn want(&self, wanted: Wanted, same: bool) {
        let mut guard = self.state();
        let state = &mut *guard;
        let here = state.slots.iter().position(|slot| Some(slot.chunk) == wanted.peek());
        let dropped = if let Some(here) = here.filter(|_| same) {
            here
        } else {
            state.wanted = wanted;
            state.slots.len()
        };
        for _ in 0..dropped {
            match state.slots.pop_front().map(|slot| slot.stage) {
                // Counted when they come back.
                None | Some(Stage::Reading | Stage::Unpacking) => continue,
                Some(Stage::Packed(_, packed)) => state.free_packed(packed, self.kept),
                Some(Stage::Ready(Ok(payload))) => state.free_payload(payload, self.kept),
                Some(Stage::Ready(Err(_))) => {}
            }
            state.counters.stale += 1;
        }
        self.room.notify_one();
    }

    /// From the player: a payload that it does not need any longer.
    pub(super) fn give_back(&self, payload: Vec<u8>) {
        self.state().free_payload(payload, self.kept);
    }

    pub(super) fn counters(&self) -> Counters {
        let state = self.state();
        let ready = state.slots.iter().filter(|slot| matches!(slot.stage, Stage::Ready(_))).count();
        Counters { ready, queued: state.slots.len(), ..state.counters }
    }

    /// Lets all threads end.
    pub(super) fn close(&self) {
        self.state().closed = true;
        for waiting in [&self.room, &self.packed, &self.ready] {
            waiting.notify_all();
        }
    }
}

impl State {
    /// Keeps a buffer of packed bytes for later, unless enough are kept.
    fn free_packed(&mut self, packed: Vec<u8>, kept: usize) {
        if self.free_packed.len() < kept {
            self.free_packed.push(packed);
        }
    }

    /// Keeps a payload for later, unless enough are kept.
    fn free_payload(&mut self, payload: Vec<u8>, kept: usize) {
        if self.free_payloads.len() < kept {
            self.free_payloads.push(payload);
        } else {
            self.counters.payloads -= 1;
        }
    }
}
