//! What the tests share: where things lie, the program as a process, small cases, comparing pictures.

pub(crate) mod cases;
pub(crate) mod compare;
pub(crate) mod display;
pub(crate) mod program;

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The repository's root.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the tests package lies in the repository")
        .to_owned()
}

/// The folder of sample data beside the repository, or nothing, said aloud, where it is absent.
pub(crate) fn shared_data() -> Option<PathBuf> {
    let path = root().parent()?.join("shared").join("data");
    if path.is_dir() {
        return Some(path);
    }
    say(&format!("SKIPPED: the sample data is not at {}", path.display()));
    None
}

/// Whether pictures may be asked of a GPU. Only `NO_GPU=1` says no; a machine without an adapter fails instead, so
/// that no test passes by not running.
pub(crate) fn gpu_wanted() -> bool {
    let refused = std::env::var_os("NO_GPU").is_some_and(|v| v == "1");
    if refused {
        say("SKIPPED: NO_GPU=1 is set");
    }
    !refused
}

/// Tells whoever watches, past the test runner, which keeps what a passing test prints to itself.
pub(crate) fn say(text: &str) {
    let mut stderr = std::io::stderr().lock();
    writeln!(stderr, "{text}").unwrap();
}
