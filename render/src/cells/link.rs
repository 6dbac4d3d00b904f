//! How workers reach each other: messages of bytes, so that they may be threads or processes on many machines.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, PoisonError};

use thiserror::Error;

/// Why workers cannot go on together.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum LinkError {
    /// Another worker is gone.
    #[error("worker {rank} stopped before the picture was done")]
    Lost {
        /// Which.
        rank: usize,
    },
    /// Another worker can do no more, and has said why.
    #[error("worker {rank} cannot go on: {fault}")]
    Failed {
        /// Which.
        rank: usize,
        /// What it said.
        fault: String,
    },
    /// The first worker has given the picture up.
    #[error("the picture was given up by the first worker")]
    Stopped,
    /// A message makes no sense.
    #[error("worker {rank} sent a message that cannot be read; every worker must run the same program")]
    Message {
        /// From which.
        rank: usize,
    },
}

/// One worker's end of a group of workers: what an engine gives to each.
///
/// Messages from one worker to another arrive in the order they were sent, whole, and never twice. Between different
/// workers there is no order.
pub trait Link {
    /// Its number, from 0.
    fn rank(&self) -> usize;

    /// How many workers there are; > 0.
    fn size(&self) -> usize;

    /// Sends a message; does not wait for it to arrive.
    ///
    /// # Errors
    /// [`LinkError::Lost`].
    fn send(&mut self, to: usize, message: Vec<u8>) -> Result<(), LinkError>;

    /// The next message that is there, with its sender.
    ///
    /// # Errors
    /// [`LinkError::Lost`].
    fn poll(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError>;

    /// Returns when there is a message, or may be.
    ///
    /// # Errors
    /// [`LinkError::Lost`].
    fn wait(&mut self) -> Result<(), LinkError>;
}

impl<L: Link + ?Sized> Link for Box<L> {
    fn rank(&self) -> usize {
        (**self).rank()
    }

    fn size(&self) -> usize {
        (**self).size()
    }

    fn send(&mut self, to: usize, message: Vec<u8>) -> Result<(), LinkError> {
        (**self).send(to, message)
    }

    fn poll(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        (**self).poll()
    }

    fn wait(&mut self) -> Result<(), LinkError> {
        (**self).wait()
    }
}

#[derive(Debug, Default)]
struct Inbox {
    messages: VecDeque<(usize, Vec<u8>)>,
    /// The worker that was the first to fail.
    lost: Option<usize>,
}

/// The inboxes of workers within one process.
#[derive(Debug)]
pub(super) struct Post {
    inboxes: Vec<(Mutex<Inbox>, Condvar)>,
}

impl Post {
    pub(super) fn new(workers: usize) -> Self {
        Self { inboxes: (0..workers).map(|_| Default::default()).collect() }
    }

    /// One worker's end.
    pub(super) fn link(&self, rank: usize) -> PostLink<'_> {
        PostLink { post: self, rank }
    }

    /// Whether a worker has a message.
    pub(super) fn has(&self, rank: usize) -> bool {
        !lock(&self.inboxes[rank].0).messages.is_empty()
    }

    /// Tells all that a worker has failed.
    pub(super) fn fail(&self, rank: usize) {
        for (inbox, arrived) in &self.inboxes {
            lock(inbox).lost.get_or_insert(rank);
            arrived.notify_all();
        }
    }
}

fn lock(inbox: &Mutex<Inbox>) -> std::sync::MutexGuard<'_, Inbox> {
    // A panic elsewhere leaves a queue whole.
    inbox.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A link within one process.
#[derive(Debug)]
pub(super) struct PostLink<'a> {
    post: &'a Post,
    rank: usize,
}

impl Link for PostLink<'_> {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.post.inboxes.len()
    }

    fn send(&mut self, to: usize, message: Vec<u8>) -> Result<(), LinkError> {
        let (inbox, arrived) = self.post.inboxes.get(to).ok_or(LinkError::Lost { rank: to })?;
        lock(inbox).messages.push_back((self.rank, message));
        arrived.notify_one();
        Ok(())
    }

    fn poll(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        let mut inbox = lock(&self.post.inboxes[self.rank].0);
        match inbox.lost {
            Some(rank) => Err(LinkError::Lost { rank }),
            None => Ok(inbox.messages.pop_front()),
        }
    }

    fn wait(&mut self) -> Result<(), LinkError> {
        let (inbox, arrived) = &self.post.inboxes[self.rank];
        let idle = |inbox: &mut Inbox| inbox.messages.is_empty() && inbox.lost.is_none();
        drop(arrived.wait_while(lock(inbox), idle).unwrap_or_else(PoisonError::into_inner));
        Ok(())
    }
}
