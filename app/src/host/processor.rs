//! Pictures by the processor, drawn on threads of their own so that the window goes on answering.
//!
//! One picture is drawn at a time, and at most one order waits: a newer one takes its place. A draft is drawn to
//! its end, so that something is seen while the hand moves; a better picture gives way to a newer order at once.

use std::io;
use std::sync::Arc;

use rayon::{ThreadPool, ThreadPoolBuilder};
use render::cpu::{CpuError, CpuRenderer};
use render::renderer::{Quality, Stats};
use render::scene::Scene;
use thiserror::Error;

use super::session::Wake;
use crate::jobs::{Job, Poll, Reporter};

/// What comes back with a picture, so that it is known which one it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tag {
    /// Rises from order to order.
    pub number: u64,
    /// Width and height; pixels.
    pub size: [u32; 2],
    /// The part of the full size that this is, each way.
    pub scale: f64,
    /// How fine.
    pub quality: Quality,
}

/// A picture to be drawn.
#[derive(Debug)]
pub struct Order {
    /// Which one.
    pub tag: Tag,
    /// Of what.
    pub scene: Scene,
}

/// A picture that was drawn: display RGBA, rows from the top.
#[derive(Debug)]
pub struct Drawn {
    /// Four bytes a pixel.
    pub rgba: Vec<u8>,
    /// What it cost.
    pub stats: Stats,
}

/// Why the processor drew nothing.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ProcessorError {
    /// The picture cannot be drawn.
    #[error(transparent)]
    Cpu(#[from] CpuError),
    /// No thread to draw on.
    #[error("the system gives no thread to draw on ({0}); close other programs and try again")]
    Thread(#[from] io::Error),
    /// The drawing ended without a picture.
    #[error("drawing stopped because of a fault in the program; another view may still be drawn")]
    Fault,
}

/// What a job gives back: the renderer with what it knows, and the picture.
type Made = (CpuRenderer, Result<Drawn, CpuError>);

#[derive(Debug)]
struct Running {
    tag: Tag,
    job: Job<Made>,
    is_wanted: bool,
}

/// Draws on threads of its own.
pub struct Processor {
    renderer: Option<CpuRenderer>,
    running: Option<Running>,
    waiting: Option<Order>,
    /// Not the threads that sections are drawn on, which would wait for the picture.
    pool: Option<Arc<ThreadPool>>,
    wake: Wake,
}

impl std::fmt::Debug for Processor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Processor").field("running", &self.running).finish_non_exhaustive()
    }
}

impl Processor {
    /// Nothing is drawn yet. `wake` is called when a picture is there.
    pub fn new(wake: Wake) -> Self {
        Self { renderer: None, running: None, waiting: None, pool: None, wake }
    }

    /// Takes the order of a picture in place of the one that waits. It comes out of [`Processor::finished`].
    pub fn order(&mut self, order: Order) {
        if let Some(running) = self.running.as_ref().filter(|r| r.tag.quality != Quality::Draft) {
            running.job.cancel();
        }
        self.waiting = Some(order);
    }

    /// No picture that was ordered is wanted any more.
    pub fn abandon(&mut self) {
        self.waiting = None;
        if let Some(running) = &mut self.running {
            running.is_wanted = false;
            running.job.cancel();
        }
    }

    /// A picture that was drawn, or why one was not; to be asked until there is none, which begins the order that
    /// waits. Never waits itself.
    pub fn finished(&mut self) -> Option<(Tag, Result<Drawn, ProcessorError>)> {
        if let Some(came) = self.take() {
            return Some(came);
        }
        if self.running.is_some() {
            return None;
        }
        let order = self.waiting.take()?;
        let tag = order.tag;
        self.start(order).err().map(|error| (tag, Err(error.into())))
    }

    fn take(&mut self) -> Option<(Tag, Result<Drawn, ProcessorError>)> {
        let drawn = match self.running.as_ref()?.job.poll() {
            Poll::Running => return None,
            Poll::Done((renderer, drawn)) => {
                self.renderer = Some(renderer);
                drawn.map_err(ProcessorError::from)
            }
            Poll::Lost => Err(ProcessorError::Fault),
        };
        let running = self.running.take()?;
        let is_cancelled = matches!(drawn, Err(ProcessorError::Cpu(CpuError::Cancelled)));
        (running.is_wanted && !is_cancelled).then_some((running.tag, drawn))
    }

    fn start(&mut self, order: Order) -> io::Result<()> {
        let pool = match &self.pool {
            Some(pool) => pool,
            None => self.pool.insert(Arc::new(
                ThreadPoolBuilder::new()
                    .thread_name(|i| format!("picture-{i}"))
                    .build()
                    .map_err(io::Error::other)?,
            )),
        };
        let pool = Arc::clone(pool);
        let renderer = self.renderer.take().unwrap_or_default();
        let wake = Arc::clone(&self.wake);
        let tag = order.tag;
        let work = move |reporter: &Reporter| pool.install(|| draw(renderer, &order, reporter));
        let job = Job::start("picture", work, move || wake())?;
        self.running = Some(Running { tag, job, is_wanted: true });
        Ok(())
    }
}

fn draw(mut renderer: CpuRenderer, order: &Order, reporter: &Reporter) -> Made {
    let Tag { size, quality, .. } = order.tag;
    let drawn = renderer.render(&order.scene, size, quality, &|_, _| !reporter.is_cancelled());
    let drawn = drawn.map(|(picture, stats)| {
        let rgb = picture.to_rgb8(order.scene.background);
        let rgba = rgb.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect();
        Drawn { rgba, stats }
    });
    (renderer, drawn)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::{Duration, Instant};

    use super::*;
    use crate::case::Assets;
    use crate::case::assets;
    use crate::load::{Limits, Progress};
    use crate::sample;
    use crate::scene;

    struct Quiet;
    impl Progress for Quiet {
        fn step(&self, _: &str, _: usize, _: usize) -> bool {
            true
        }
    }

    fn hip() -> Scene {
        let case = sample::case();
        let mut loaded = Assets::default();
        let keys = loaded.missing(&case);
        for key in keys {
            loaded.extend(assets::load_keys(&[key], &Limits::default(), &Quiet).expect("built in"));
        }
        scene::scene(&case, &loaded)
    }

    fn order(number: u64, scene: &Scene, size: [u32; 2], quality: Quality) -> Order {
        Order { tag: Tag { number, size, scale: 1.0, quality }, scene: scene.clone() }
    }

    /// The numbers of the pictures that come, until the one of `last` does.
    fn until(processor: &mut Processor, last: u64) -> Vec<(u64, Drawn)> {
        let began = Instant::now();
        let mut came = Vec::new();
        while began.elapsed() < Duration::from_mins(2) {
            if let Some((tag, drawn)) = processor.finished() {
                came.push((tag.number, drawn.expect("drawn")));
                if tag.number == last {
                    return came;
                }
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("picture {last} does not come");
    }

    #[test]
    fn the_newest_order_takes_the_place_of_the_one_that_waits_and_of_a_good_picture() {
        let scene = hip();
        let mut processor = Processor::new(Arc::new(|| ()));
        let draft = |number| order(number, &scene, [64, 48], Quality::Draft);
        processor.order(draft(1));
        assert!(processor.finished().is_none(), "it does not wait");
        processor.order(draft(2));
        processor.order(draft(3));
        let numbers = |came: &[(u64, Drawn)]| came.iter().map(|(number, _)| *number).collect::<Vec<_>>();
        assert_eq!(numbers(&until(&mut processor, 3)), [1, 3], "a draft is drawn to its end, one waits");
        // Far more than the time until the next order.
        processor.order(order(4, &scene, [1600, 1200], Quality::Finest));
        assert!(processor.finished().is_none(), "begun");
        processor.order(order(5, &scene, [64, 48], Quality::Good));
        let came = until(&mut processor, 5);
        assert_eq!(numbers(&came), [5], "the better picture gave way");
        let (picture, _) =
            CpuRenderer::new().render(&scene, [64, 48], Quality::Good, &|_, _| true).expect("drawn");
        let rgb: Vec<u8> = came[0].1.rgba.chunks_exact(4).flat_map(|p| p[..3].iter().copied()).collect();
        assert!(rgb == picture.to_rgb8(scene.background), "the same bytes as drawn directly");
        processor.order(draft(6));
        assert!(processor.finished().is_none(), "begun");
        processor.abandon();
        processor.order(draft(7));
        assert_eq!(numbers(&until(&mut processor, 7)), [7], "what is not wanted does not come");
    }

    #[test]
    fn a_picture_that_cannot_be_drawn_is_an_error_and_the_next_is_drawn() {
        let scene = hip();
        let woken = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&woken);
        let mut processor = Processor::new(Arc::new(move || {
            count.fetch_add(1, Ordering::Relaxed);
        }));
        processor.order(order(1, &scene, [0, 48], Quality::Draft));
        let began = Instant::now();
        let fault = loop {
            assert!(began.elapsed() < Duration::from_mins(1), "no answer");
            if let Some((_, drawn)) = processor.finished() {
                break drawn.expect_err("no pixels");
            }
            std::thread::yield_now();
        };
        assert!(matches!(fault, ProcessorError::Cpu(CpuError::Size { .. })), "{fault}");
        processor.order(order(2, &scene, [32, 32], Quality::Draft));
        until(&mut processor, 2);
        let woken = woken.load(Ordering::Relaxed);
        assert!((1..=2).contains(&woken), "each picture wakes the window: {woken}");
    }
}
