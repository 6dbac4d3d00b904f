//! The program as a process, with a bound on its time and memory.

use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// What a run of the program left.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// How it ended.
    pub(crate) status: ExitStatus,
    /// Standard output.
    pub(crate) stdout: String,
    /// Standard error.
    pub(crate) stderr: String,
    /// How long it took.
    pub(crate) wall: Duration,
}

impl Outcome {
    /// The exit code.
    ///
    /// A signal (a crash, memory refused) fails the test, and so does 101, the code of a panic.
    pub(crate) fn code(&self) -> i32 {
        match self.status.code() {
            None => panic!("ended by a signal ({}): {}", self.status, self.stderr),
            Some(101) => panic!("panicked: {}", self.stderr),
            Some(code) => code,
        }
    }

    /// Standard output as the one JSON document that it must be, after a run that must have succeeded.
    pub(crate) fn json(&self) -> serde_json::Value {
        assert_eq!(self.code(), 0, "the run should succeed: {}", self.stderr);
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|e| panic!("standard output is not one JSON document ({e}): {}", self.stdout))
    }

    /// The one sentence of an error.
    ///
    /// Standard error may hold log lines before it; the error is the last line, and it is a single one.
    pub(crate) fn sentence(&self) -> &str {
        self.stderr.trim_end().lines().next_back().unwrap_or_default()
    }
}

/// The program, built from these sources by the same `cargo test`.
pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_osteotome-under-test");

/// Runs the program and waits; more than `limit` fails the test.
pub(crate) fn run(args: &[&str], limit: Duration) -> Outcome {
    let mut command = Command::new(PROGRAM);
    command.args(args);
    finish(&mut command, args, limit)
}

/// As [`run`], as if `mpirun` had started it as that one of so many processes.
pub(crate) fn run_as(rank: usize, processes: usize, args: &[&str], limit: Duration) -> Outcome {
    let mut command = Command::new(PROGRAM);
    let [rank, processes] = [rank, processes].map(|n| n.to_string());
    command.env("OMPI_COMM_WORLD_RANK", rank).env("OMPI_COMM_WORLD_SIZE", processes).args(args);
    finish(&mut command, args, limit)
}

/// As [`run`], with no more than `bytes` of address space: what asks for more is refused and shows as a crash.
pub(crate) fn run_within(args: &[&str], limit: Duration, bytes: u64) -> Outcome {
    if !cfg!(target_os = "linux") {
        return run(args, limit);
    }
    let mut command = Command::new("sh");
    command
        .arg("-c")
        .arg(format!("ulimit -v {} && exec \"$0\" \"$@\"", bytes / 1024))
        .arg(PROGRAM)
        .args(args);
    finish(&mut command, args, limit)
}

fn finish(command: &mut Command, args: &[&str], limit: Duration) -> Outcome {
    // Files, not pipes: a full pipe would stop a program that talks much.
    let folder = tempfile::tempdir().unwrap();
    let (out, err) = (folder.path().join("out"), folder.path().join("err"));
    command.stdin(Stdio::null()).stdout(File::create(&out).unwrap()).stderr(File::create(&err).unwrap());
    let begin = Instant::now();
    let mut child = command.spawn().unwrap_or_else(|e| panic!("{PROGRAM} does not start: {e}"));
    let status = wait(&mut child, limit)
        .unwrap_or_else(|| panic!("still running after {limit:?}: {args:?}\n{}", text(&err)));
    Outcome { status, stdout: text(&out), stderr: text(&err), wall: begin.elapsed() }
}

/// Waits for a process; one that is not done in time is ended, and nothing comes back.
pub(crate) fn wait(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return Some(status);
        }
        if begin.elapsed() > limit {
            child.kill().unwrap();
            child.wait().unwrap();
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn text(path: &Path) -> String {
    String::from_utf8_lossy(&std::fs::read(path).unwrap_or_default()).into_owned()
}
