//! Playback's data side: order, direction, jumps, errors, memory, shutdown.

use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::num::NonZeroUsize;
use std::time::Duration;

use compress::Limits;
use compress::container::{Header, ReadError, Reader, StepCodec};
use compress::lossless::ByteCodec;
use compress::pvtc::Layout;
use compress::stream::{Direction, Next, Options, Repeat, Stream};

use super::{header, payload, series};

/// Steps of a chunk in these tests.
const T: u32 = 3;

fn test_header(byte_codec: ByteCodec) -> Header {
    header([16, 16, 8], StepCodec::Pvtc(Layout::new(4, T as u8).unwrap()), byte_codec)
}

fn options(threads: usize, capacity: usize) -> Options {
    Options { threads: NonZeroUsize::new(threads).unwrap(), capacity: NonZeroUsize::new(capacity).unwrap() }
}

/// A series of `steps` steps, streaming.
fn stream(steps: u32, options: Options) -> Stream {
    let file = series(&test_header(ByteCodec::Zstd), steps);
    Stream::spawn(Reader::new(Cursor::new(file), &Limits::default()).unwrap(), options).unwrap()
}

/// Takes the next chunk, checks its bytes and steps, and gives its number.
fn next(stream: &mut Stream) -> Option<u32> {
    let chunk = stream.wait().unwrap()?;
    let steps = stream.times_secs().len() as u32;
    assert_eq!(chunk.steps(), chunk.chunk() * T..steps.min((chunk.chunk() + 1) * T), "steps");
    assert!(chunk.payload() == payload(chunk.chunk(), chunk.payload().len()), "bytes of {}", chunk.chunk());
    Some(chunk.chunk())
}

fn take(stream: &mut Stream, count: usize) -> Vec<u32> {
    (0..count).map_while(|_| next(stream)).collect()
}

#[test]
fn chunks_come_in_the_order_of_playing_for_any_number_of_threads() {
    for threads in [1, 4] {
        for capacity in [1, 3, 100] {
            let mut stream = stream(31, options(threads, capacity));
            let mut played = |step, direction, repeat, count| {
                stream.play_from(step, direction, repeat).unwrap();
                take(&mut stream, count)
            };
            let all: Vec<u32> = (0..11).collect();
            assert_eq!(played(0, Direction::Forward, Repeat::Once, 100), all, "to the end");
            assert_eq!(played(13, Direction::Forward, Repeat::Once, 100), all[4..], "from step 13");
            assert_eq!(played(8, Direction::Backward, Repeat::Once, 100), [2, 1, 0], "backward");
            let round: Vec<u32> = (0..30).map(|i| (9 + i) % 11).collect();
            assert_eq!(played(27, Direction::Forward, Repeat::Loop, 30), round, "round");
            let round: Vec<u32> = (0..30).map(|i| (34 - i) % 11).collect();
            assert_eq!(played(3, Direction::Backward, Repeat::Loop, 30), round, "round, backward");
        }
    }
}

#[test]
fn nothing_comes_before_playing_is_begun_and_nothing_after_the_end() {
    let mut stream = stream(3, Options::default());
    assert!(matches!(stream.poll(), Ok(Next::End)), "before");
    stream.play_from(0, Direction::Forward, Repeat::Once).unwrap();
    assert_eq!(take(&mut stream, 5), [0], "one chunk");
    assert!(matches!(stream.poll(), Ok(Next::End)), "after");
    let refused = stream.play_from(3, Direction::Forward, Repeat::Once);
    assert!(matches!(refused, Err(ReadError::Step { step: 3, steps: 3 })), "{refused:?}");
}

#[test]
fn after_a_jump_the_chunk_of_its_step_is_next_whatever_was_prefetched() {
    let mut stream = stream(90, options(3, 6));
    stream.play_from(0, Direction::Forward, Repeat::Loop).unwrap();
    let mut state = 7_u32;
    let mut expected = 0;
    let mut jumps = 0;
    for _ in 0..3000 {
        state = state.wrapping_mul(1664525).wrapping_add(1013904223);
        if state >> 28 < 6 {
            let step = (state >> 8) % 90;
            stream.jump(step).unwrap();
            expected = step / T;
            jumps += 1;
        }
        assert_eq!(next(&mut stream), Some(expected), "after {jumps} jumps");
        expected = (expected + 1) % 30;
    }
    let counters = stream.counters();
    assert!(jumps > 900 && counters.stale > 0, "{jumps} jumps, {counters:?}");
    assert_eq!(counters.taken, 3000, "{counters:?}");
}

#[test]
fn a_jump_to_what_is_prefetched_reads_nothing_again() {
    let mut stream = stream(30, options(2, 5));
    stream.play_from(0, Direction::Forward, Repeat::Once).unwrap();
    while stream.counters().ready < 5 {
        std::thread::sleep(Duration::from_millis(1));
    }
    stream.jump(10).unwrap();
    assert_eq!(take(&mut stream, 100), [3, 4, 5, 6, 7, 8, 9], "from the chunk of step 10");
    let counters = stream.counters();
    assert_eq!((counters.chunks_read, counters.stale), (10, 3), "each chunk was read once: {counters:?}");
}

/// A source that fails, or waits, where it is told to.
struct Faulty {
    bytes: Cursor<Vec<u8>>,
    broken: Option<u64>,
    delay: Duration,
}

impl Read for Faulty {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.broken == Some(self.bytes.position()) {
            return Err(io::Error::other("a bad sector"));
        }
        std::thread::sleep(self.delay);
        self.bytes.read(buffer)
    }
}

impl Seek for Faulty {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.bytes.seek(to)
    }
}

#[test]
fn an_error_comes_out_in_its_chunks_place_and_the_rest_plays_on() {
    let file = series(&test_header(ByteCodec::Lz4), 15);
    let opened = super::open(&file);
    let offset = |chunk: u32| 512 + (0..chunk).map(|chunk| opened.packed_len(chunk).unwrap()).sum::<u64>();
    let mut flipped = file.clone();
    flipped[offset(3) as usize + 5] ^= 1;
    let source = Faulty { broken: Some(offset(1)), bytes: Cursor::new(flipped), delay: Duration::ZERO };
    let reader = Reader::new(source, &Limits::default()).unwrap();
    let mut stream = Stream::spawn(reader, options(2, 3)).unwrap();
    stream.play_from(0, Direction::Forward, Repeat::Once).unwrap();
    assert_eq!(next(&mut stream), Some(0), "first");
    let error = stream.wait().unwrap_err();
    assert!(error.chunk == 1 && matches!(error.source, ReadError::Input(_)), "{error:?}");
    assert_eq!(next(&mut stream), Some(2), "third");
    let error = stream.wait().unwrap_err();
    assert!(
        error.chunk == 3 && matches!(error.source, ReadError::ChunkChecksum { chunk: 3, .. }),
        "{error:?}"
    );
    assert_eq!(error.to_string(), "chunk 3 of the series cannot be played", "message");
    assert_eq!(take(&mut stream, 9), [4], "last");
}

#[test]
fn a_stream_that_is_dropped_while_busy_ends_its_threads() {
    for count in 0..40 {
        let file = series(&test_header(ByteCodec::Zstd), 60);
        let source = Faulty { broken: None, bytes: Cursor::new(file), delay: Duration::from_micros(50) };
        let reader = Reader::new(source, &Limits::default()).unwrap();
        let mut stream = Stream::spawn(reader, options(3, 4)).unwrap();
        stream.play_from(0, Direction::Forward, Repeat::Loop).unwrap();
        let held: Vec<_> = (0..count % 5).map(|_| stream.wait().unwrap()).collect();
        drop(stream); // joins: this test hangs if a thread does not end
        drop(held);
    }
}

#[test]
fn memory_is_bounded_by_the_capacity_the_threads_and_what_the_player_holds() {
    let (threads, capacity) = (3, 4);
    let mut stream = stream(90, options(threads, capacity));
    stream.play_from(0, Direction::Forward, Repeat::Loop).unwrap();
    let mut held = Vec::new();
    let mut most = 0;
    for i in 0..2000_u32 {
        held.push(stream.wait().unwrap().unwrap());
        if held.len() > 3 {
            held.clear();
        }
        if i % 7 == 0 {
            stream.jump(i * 31 % 90).unwrap();
        }
        let counters = stream.counters();
        most = most.max(counters.payloads);
        assert!(counters.queued <= capacity, "{counters:?}");
    }
    // 4 are held at most; as many may be free when they come back.
    assert!(most <= capacity + threads + 4, "{most} payloads");
}

#[test]
fn a_player_that_does_not_wait_is_told_and_counted() {
    let file = series(&test_header(ByteCodec::Zstd), 9);
    let source = Faulty { broken: None, bytes: Cursor::new(file), delay: Duration::from_millis(20) };
    let mut stream = Stream::spawn(Reader::new(source, &Limits::default()).unwrap(), options(1, 2)).unwrap();
    stream.play_from(0, Direction::Forward, Repeat::Once).unwrap();
    let mut pending = 0;
    let mut played = Vec::new();
    loop {
        match stream.poll().unwrap() {
            Next::Ready(chunk) => played.push(chunk.chunk()),
            Next::Pending => {
                pending += 1;
                std::thread::sleep(Duration::from_millis(1));
            }
            Next::End => break,
        }
    }
    assert_eq!(played, [0, 1, 2], "all came");
    assert!(pending > 0, "a slow disk makes the player wait");
    assert_eq!(stream.counters().starved, pending, "starved");
}
