//! A display without a screen.

use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};

/// An X server of its own for one test; ended when dropped.
#[derive(Debug)]
pub(crate) struct Display {
    server: Child,
    /// What `DISPLAY` must be.
    pub(crate) name: String,
}

impl Display {
    /// Starts Xvfb on a free number; its absence fails the test, which would otherwise pass by not running.
    pub(crate) fn start() -> Self {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1600x1000x24", "-nolisten", "tcp"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|e| {
                panic!("Xvfb does not start ({e}); install it: apt-get install xvfb, or make test")
            });
        let mut number = String::new();
        BufReader::new(server.stdout.take().expect("piped above")).read_line(&mut number).unwrap();
        let name = format!(":{}", number.trim());
        if name == ":" {
            server.kill().unwrap();
            panic!("Xvfb ended before it had a display; see what `Xvfb -displayfd 1` says");
        }
        Self { server, name }
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let ended = self.server.kill().and_then(|()| self.server.wait());
        if let Err(error) = ended {
            super::say(&format!("Xvfb could not be ended: {error}"));
        }
    }
}
