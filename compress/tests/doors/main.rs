//! Hostile bytes at every door of the crate: no panic, and no memory above what a door declares.
//!
//! A *door* is a function that takes bytes from outside. Each has seeds, made here, that are well-formed, and is
//! given [`executions`] mutations of them: some 10⁴ in a plain run; the environment variable `OSTEOTOME_FUZZ` asks for
//! another number. Mutations follow from a fixed seed, so a run that fails fails again; the number of the execution
//! stands before the panic's trace.
//!
//! Memory is that of Rust's global allocator, all threads together, at its peak during an execution. Zstandard's
//! own context, of a fixed size, is C's and is not counted.

#![expect(clippy::print_stderr, clippy::unwrap_used, reason = "a test may fail loudly")]

mod blocks;
mod mutate;
mod packed;
mod series;
mod texture;

use peak_alloc::PeakAlloc;

use mutate::Random;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Bytes that an execution may take next to what its door declares: error texts, tables of codecs, the pool's jobs.
const SLACK: usize = 16 << 10;

/// Executions of each door.
fn executions() -> u64 {
    std::env::var("OSTEOTOME_FUZZ").ok().map_or(10_000, |count| count.parse().unwrap())
}

/// What became of the executions of a door.
#[derive(Default)]
struct Tally {
    executions: u64,
    accepted: u64,
    most_memory: usize,
}

/// A function that takes bytes from outside, executed again and again; it is given its name.
type Door = fn(&'static str) -> Tally;

/// Says which execution panicked.
struct Place {
    door: &'static str,
    execution: u64,
}

impl Drop for Place {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("the door {:?} failed in execution {}", self.door, self.execution);
        }
    }
}

/// Knocks at a door: `prepare` makes bytes by chance, `execute` gives them to the door and says whether they were
/// accepted and how much memory was allowed. Only what `execute` takes is measured.
fn knock<T>(
    door: &'static str,
    mut prepare: impl FnMut(&mut Random) -> T,
    mut execute: impl FnMut(&T) -> (bool, usize),
) -> Tally {
    let mut tally = Tally::default();
    let mut place = Place { door, execution: 0 };
    for execution in 0..executions() {
        place.execution = execution;
        let prepared = prepare(&mut Random::new(execution));
        let before = MEMORY.current_usage();
        MEMORY.reset_peak_usage();
        let (accepted, allowed) = execute(&prepared);
        let taken = MEMORY.peak_usage().saturating_sub(before);
        assert!(taken <= allowed + SLACK, "{door}: {taken} bytes were taken, {allowed} allowed");
        tally.executions += 1;
        tally.accepted += u64::from(accepted);
        tally.most_memory = tally.most_memory.max(taken);
    }
    tally
}

/// One test, so that no other allocates meanwhile.
#[test]
fn hostile_bytes_are_refused_or_read_within_the_memory_declared() {
    let doors: [(&str, Door); 9] = [
        ("ktx2", texture::ktx2),
        ("series", series::series),
        ("stream", series::stream),
        ("lzo", packed::lzo),
        ("lz4", packed::lz4),
        ("zstd", packed::zstd),
        ("store", packed::store),
        ("bc", blocks::bc),
        ("pvtc", blocks::pvtc),
    ];
    for (name, door) in doors {
        let start = std::time::Instant::now();
        let Tally { executions, accepted, most_memory } = door(name);
        println!(
            "{name}: {executions} executions in {:.1} s, {accepted} accepted, {most_memory} bytes at most",
            start.elapsed().as_secs_f64()
        );
        assert!(accepted > 0, "{name}: nothing was accepted, so the mutations reach nothing");
    }
}
