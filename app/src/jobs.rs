//! Background work: named threads with progress and cancel.
//!
//! A [`Job`] is one piece of work on its own thread. It reports how far it is through a bounded channel
//! that never makes it wait (a report nobody has fetched is simply replaced by the next), and asks now
//! and then whether to stop. Dropping a job cancels it without waiting.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crossbeam_channel::{Receiver, Sender, TryRecvError, TrySendError, bounded};

use crate::load::Progress;

/// How far a job has come.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Step {
    /// What it does now: `"reading slices"`.
    pub doing: String,
    /// Steps done.
    pub done: usize,
    /// Steps in all; 0 where that is not known.
    pub total: usize,
}

impl Step {
    /// The part that is done, 0 to 1; none where the whole is not known.
    pub fn part(&self) -> Option<f32> {
        (self.total > 0).then(|| (self.done as f32 / self.total as f32).clamp(0.0, 1.0))
    }
}

/// What a job's work is given: where it reports and learns that it should stop.
#[derive(Debug, Clone)]
pub struct Reporter {
    steps: Sender<Step>,
    stale: Receiver<Step>,
    cancelled: Arc<AtomicBool>,
}

impl Reporter {
    /// Whether the work should stop as soon as it can.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

impl Progress for Reporter {
    fn step(&self, doing: &str, done: usize, total: usize) -> bool {
        let mut step = Step { doing: doing.to_owned(), done, total };
        // The channel holds one: an older report makes way for this one.
        while let Err(TrySendError::Full(back)) = self.steps.try_send(step) {
            drop(self.stale.try_recv());
            step = back;
        }
        !self.is_cancelled()
    }
}

/// Where a job is.
#[derive(Debug)]
pub enum Poll<T> {
    /// Still at work.
    Running,
    /// Done, with its result; given out once.
    Done(T),
    /// The work ended without a result: its thread stopped with a fault of the program.
    Lost,
}

/// Work on its own thread, with a result of type `T`.
#[derive(Debug)]
pub struct Job<T> {
    name: String,
    steps: Receiver<Step>,
    last: Step,
    result: Receiver<T>,
    cancelled: Arc<AtomicBool>,
}

impl<T: Send + 'static> Job<T> {
    /// Starts `work` on a thread called `name`. `wake` is called from that thread when the result is
    /// there, so that a window that sleeps can look; it may do nothing.
    ///
    /// # Errors
    /// Where the system gives no thread.
    pub fn start(
        name: &str,
        work: impl FnOnce(&Reporter) -> T + Send + 'static,
        wake: impl FnOnce() + Send + 'static,
    ) -> io::Result<Self> {
        let (steps_in, steps) = bounded(1);
        let (result_in, result) = bounded(1);
        let cancelled = Arc::new(AtomicBool::new(false));
        let reporter = Reporter { steps: steps_in, stale: steps.clone(), cancelled: Arc::clone(&cancelled) };
        std::thread::Builder::new().name(name.to_owned()).spawn(move || {
            let made = work(&reporter);
            // The job may have been dropped meanwhile; then nobody wants the result.
            if result_in.send(made).is_ok() {
                wake();
            }
        })?;
        Ok(Self { name: name.to_owned(), steps, last: Step::default(), result, cancelled })
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The latest report.
    pub fn step(&mut self) -> &Step {
        if let Ok(step) = self.steps.try_recv() {
            self.last = step;
        }
        &self.last
    }

    /// Asks it to stop. It does so at its next report, and then has a result of its own choosing.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Where it is, without waiting.
    pub fn poll(&self) -> Poll<T> {
        match self.result.try_recv() {
            Ok(result) => Poll::Done(result),
            Err(TryRecvError::Empty) => Poll::Running,
            Err(TryRecvError::Disconnected) => Poll::Lost,
        }
    }

    /// Waits for the result; none where the work was lost or its result was already given out.
    pub fn wait(self) -> Option<T> {
        self.result.recv().ok()
    }
}

impl<T> Drop for Job<T> {
    fn drop(&mut self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_reports_and_gives_its_result_once() {
        let (go_in, go) = bounded::<()>(1);
        let (woken_in, woken) = bounded::<()>(1);
        let work = move |reporter: &Reporter| {
            for i in 0..=1000 {
                reporter.step("counting", i, 1000);
            }
            go.recv().expect("the test says go");
            std::thread::current().name().map(str::to_owned)
        };
        let mut job = Job::start("count", work, move || woken_in.send(()).expect("woken")).expect("thread");
        assert!(matches!(job.poll(), Poll::Running), "it waits for the test");
        while job.step().done < 1000 {
            std::thread::yield_now();
        }
        assert_eq!(job.step().part(), Some(1.0), "the last report is not lost");
        go_in.send(()).expect("go");
        woken.recv().expect("the wake-up comes after the result");
        match job.poll() {
            Poll::Done(name) => assert_eq!(name.as_deref(), Some("count"), "the thread has the job's name"),
            other => panic!("not done: {other:?}"),
        }
    }

    #[test]
    fn a_cancelled_job_stops_at_its_next_report() {
        let work = |reporter: &Reporter| {
            let mut steps = 0_usize;
            while reporter.step("for ever", steps, 0) {
                steps += 1;
            }
            steps
        };
        let job = Job::start("endless", work, || ()).expect("thread");
        job.cancel();
        assert!(job.wait().is_some(), "it ended with a result");
        let (ended_in, ended) = bounded::<()>(1);
        let work = move |reporter: &Reporter| {
            while reporter.step("for ever", 0, 0) {}
            ended_in.send(()).expect("the test waits");
        };
        drop(Job::start("dropped", work, || ()).expect("thread"));
        ended.recv().expect("dropping cancels");
    }
}
