//! A foreign renderer as a process that draws a frame whenever it is asked, so that both can take turns.
//!
//! It is started with a file that says what to draw, `--mapper NAME`, `--step VOXELS` where there are voxels, `--size WxH`,
//! `--float` and `--serve`; it says `ready`, then answers `render` by the milliseconds of one frame and `write FILE` by `ok`,
//! the file being a `NumPy` array of `height`·`width`·4 floats. `tests/peers/vtk/volume.py` and `cells.py` are such.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use ::render::image::FloatImage;

use crate::headless::Failure;

/// A peer with one setting, ready to draw.
#[derive(Debug)]
pub(super) struct Peer {
    process: Child,
    questions: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Peer {
    /// Starts `command`, words divided by spaces, for a case or another file.
    pub(super) fn start(
        command: &str,
        file: &Path,
        mapper: &str,
        step: Option<f64>,
        [width, height]: [u32; 2],
    ) -> Result<Self, Failure> {
        let mut words = command.split_whitespace();
        let program = words.next().unwrap_or_default();
        let mut process = Command::new(program)
            .args(words)
            .arg(file)
            .args(["--mapper", mapper, "--size", &format!("{width}x{height}")])
            .args(step.map(|step| format!("--step={step}")))
            .args(["--float", "--serve"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| {
                Failure::Usage(format!("the peer does not start ({e}); change --peer: {command}"))
            })?;
        let (Some(questions), Some(answers)) = (process.stdin.take(), process.stdout.take()) else {
            return Err(Failure::Other("a process was started without its pipes".to_owned()));
        };
        let mut peer = Self { process, questions, answers: BufReader::new(answers) };
        peer.expect("ready")?;
        Ok(peer)
    }

    /// Milliseconds of one frame.
    pub(super) fn frame_ms(&mut self) -> Result<f64, Failure> {
        let answer = self.ask("render")?;
        answer.parse().map_err(|_not_a_number| said(&answer))
    }

    /// The picture drawn last, by way of a file.
    pub(super) fn picture(&mut self, [width, height]: [u32; 2]) -> Result<FloatImage, Failure> {
        let file = tempfile::Builder::new().suffix(".npy").tempfile();
        let file = file.map_err(|e| Failure::Other(format!("no temporary file can be made ({e})")))?;
        let answer = self.ask(&format!("write {}", file.path().display()))?;
        if answer != "ok" {
            return Err(said(&answer));
        }
        let bytes = std::fs::read(file.path()).map_err(|e| said(&e.to_string()))?;
        let pixels = pixels(&bytes, width as usize * height as usize)
            .ok_or_else(|| said("a picture of another size or type"))?;
        Ok(FloatImage { width, height, pixels })
    }

    fn ask(&mut self, question: &str) -> Result<String, Failure> {
        writeln!(self.questions, "{question}").map_err(|e| said(&e.to_string()))?;
        self.line()
    }

    fn expect(&mut self, answer: &str) -> Result<(), Failure> {
        let line = self.line()?;
        if line == answer { Ok(()) } else { Err(said(&line)) }
    }

    fn line(&mut self) -> Result<String, Failure> {
        let mut line = String::new();
        self.answers.read_line(&mut line).map_err(|e| said(&e.to_string()))?;
        Ok(line.trim().to_owned())
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It ends by itself when nobody asks it any more; one that hangs is not waited for.
        drop(self.process.kill().and_then(|()| self.process.wait()));
    }
}

fn said(what: &str) -> Failure {
    Failure::Other(format!("the peer answered \"{what}\"; run its command by itself to see why"))
}

/// The numbers of a `NumPy` file, version 1, of little-endian `f32`, rows first.
fn pixels(bytes: &[u8], count: usize) -> Option<Vec<[f32; 4]>> {
    let rest = bytes.strip_prefix(b"\x93NUMPY\x01\x00")?;
    let (length, rest) = rest.split_first_chunk::<2>()?;
    let (header, numbers) = rest.split_at_checked(usize::from(u16::from_le_bytes(*length)))?;
    let header = str::from_utf8(header).ok()?;
    if !(header.contains("'<f4'") && header.contains("'fortran_order': False")) || numbers.len() != count * 16
    {
        return None;
    }
    let (words, _) = numbers.as_chunks::<4>();
    let (pixels, _) = words.as_chunks::<4>();
    Some(pixels.iter().map(|p| p.map(f32::from_le_bytes)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(kind: &str, numbers: &[f32]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (1, 1, 4), }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        bytes
    }

    #[test]
    fn a_numpy_file_of_floats_is_pixels_and_others_are_refused() {
        let file = npy("<f4", &[0.5, 0.25, 0.0, 1.0]);
        assert_eq!(pixels(&file, 1), Some(vec![[0.5, 0.25, 0.0, 1.0]]), "one pixel");
        assert_eq!(pixels(&file, 2), None, "another size");
        assert_eq!(pixels(&npy("<f8", &[0.0; 4]), 1), None, "another type");
        assert_eq!(pixels(&file[..7], 1), None, "cut off");
    }

    #[cfg(unix)]
    #[test]
    fn a_peer_is_asked_for_frames_by_the_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let script = folder.path().join("peer.sh");
        let text = "echo ready\nwhile read line; do echo 12.5; done\n";
        std::fs::write(&script, text).expect("a script");
        let command = format!("sh {}", script.display());
        let mut peer =
            Peer::start(&command, Path::new("case.json"), "gpu", Some(0.5), [1, 1]).expect("a peer");
        assert_eq!(peer.frame_ms().expect("a time"), 12.5, "its answer");
        let wrong = peer.picture([1, 1]).expect_err("it wrote nothing").to_string();
        assert!(wrong.contains("12.5"), "the fault names the answer: {wrong}");
    }
}
