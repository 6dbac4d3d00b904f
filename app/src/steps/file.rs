//! A series file that plays: a stream reads ahead, the chunk shown and the next stay at hand.

use std::collections::VecDeque;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use compress::Limits;
use compress::container::{Figures, Header, ReadError, Reader, StepCodec};
use compress::stream::{Chunk, Direction, Next, Options, Repeat, Stream};
use render::volume::{Affine, Grid, PackedStep, Rescale, Samples, SharedBytes};
use thiserror::Error;

use super::packed::packed_step;
use crate::save::series::decode_step;

/// Chunks at hand: the one shown, and the one before or after it.
const CHUNKS: usize = 2;
/// Decoded steps at hand: each is decoded anew for sections and picking else.
const GRIDS: usize = 2;

/// Why a series file cannot be used. The path stands last.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SeriesFileError {
    /// What the file is lacking.
    #[error("{source}{}: {}", because(source), path.display())]
    Read {
        /// The fault.
        source: ReadError,
        /// The file.
        path: PathBuf,
    },
    /// The volume has no place that can be.
    #[error("the series file places its volume where none can be: it was written by a faulty program: {}", path.display())]
    Place {
        /// The file.
        path: PathBuf,
    },
    /// The threads that read ahead cannot be started.
    #[error("the series cannot be played, the system starts no more threads ({source}); close other programs: {}", path.display())]
    Threads {
        /// What the system says.
        source: std::io::Error,
        /// The file.
        path: PathBuf,
    },
}

/// The cause of an error, if it has one, in brackets.
fn because(error: &ReadError) -> String {
    std::error::Error::source(error).map_or_else(String::new, |cause| format!(" ({cause})"))
}

/// Whether a file begins as a series file does.
pub fn is_series(path: &Path) -> bool {
    let mut begin = [0; 8];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut begin));
    read.is_ok() && begin == compress::container::IDENTIFIER
}

/// See the module.
#[derive(Debug)]
pub(super) struct SeriesFile {
    path: PathBuf,
    header: Header,
    figures: Figures,
    times_secs: Vec<f64>,
    place: Affine,
    /// Of raw samples of 16 bits that of the first step, since their numbers reach further than they do.
    range: [f64; 2],
    file_bytes: u64,
    playing: Mutex<Playing>,
}

#[derive(Debug)]
struct Playing {
    stream: Stream,
    /// How the stream plays, and the chunk that it gives next; none before it was asked.
    order: Option<(Direction, Repeat, u32)>,
    chunks: VecDeque<Arc<Chunk>>,
    grids: VecDeque<(usize, Arc<Grid>)>,
    fault: Option<String>,
}

impl SeriesFile {
    pub(super) fn open(path: &Path, limit: u64) -> Result<Self, SeriesFileError> {
        let read = |source| SeriesFileError::Read { source, path: path.to_owned() };
        let reader = Reader::open(path, &Limits { decoded_bytes: limit }).map_err(read)?;
        let (header, figures) = (reader.header().clone(), reader.figures());
        let place = Affine::from_row_major(&header.world_from_voxel)
            .map_err(|_singular| SeriesFileError::Place { path: path.to_owned() })?;
        let times_secs = reader.times_secs().to_vec();
        let file_bytes = std::fs::metadata(path).map(|m| m.len()).map_err(|e| read(e.into()))?;
        let stream = Stream::spawn(reader, Options::default())
            .map_err(|source| SeriesFileError::Threads { source, path: path.to_owned() })?;
        let playing =
            Playing { stream, order: None, chunks: VecDeque::new(), grids: VecDeque::new(), fault: None };
        let ends = [0.0, 255.0].map(|stored| header.value_offset + header.value_scale * stored);
        let range = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let playing = Mutex::new(playing);
        let path = path.to_owned();
        let mut file = Self { path, header, figures, times_secs, place, range, file_bytes, playing };
        if file.header.codec == StepCodec::Raw16
            && let Some(first) = file.grid(0)
        {
            file.range = first.range();
        }
        Ok(file)
    }

    pub(super) fn header(&self) -> &Header {
        &self.header
    }

    pub(super) fn times_secs(&self) -> &[f64] {
        &self.times_secs
    }

    pub(super) fn range(&self) -> [f64; 2] {
        self.range
    }

    pub(super) fn fault(&self) -> Option<String> {
        self.playing().fault.clone()
    }

    pub(super) fn is_lossy(&self) -> bool {
        self.figures.largest_error != Some(0.0)
    }

    pub(super) fn take_fault(&self) -> Option<String> {
        self.playing().fault.take()
    }

    pub(super) fn description(&self) -> String {
        let Header { codec, byte_codec, .. } = self.header;
        let lost = match (self.figures.largest_error, self.figures.psnr_db) {
            (Some(0.0), _) => "nothing lost".to_owned(),
            (Some(error), Some(psnr)) => format!("largest error {error:.3}, PSNR {psnr:.1} dB"),
            _ => "losses not stated".to_owned(),
        };
        let mib = self.file_bytes as f64 / f64::from(1 << 20);
        format!("{codec}, {}, {mib:.1} MiB on disk; {lost}", byte_codec.name())
    }

    fn playing(&self) -> std::sync::MutexGuard<'_, Playing> {
        self.playing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The step's chunk, waited for where it is not there.
    fn chunk(&self, playing: &mut Playing, step: usize) -> Option<Arc<Chunk>> {
        if let Some(chunk) = playing.at_hand(step) {
            return Some(chunk);
        }
        playing.seek(self.chunk_of(step), step, playing.way());
        loop {
            match playing.stream.wait() {
                Ok(Some(chunk)) => {
                    let chunk = playing.take(chunk);
                    if chunk.steps().contains(&(step as u32)) {
                        return Some(chunk);
                    }
                }
                Ok(None) => return None,
                Err(error) => {
                    playing.fail(&error, &self.path);
                    return None;
                }
            }
        }
    }

    fn chunk_of(&self, step: usize) -> u32 {
        (step / usize::from(self.header.codec.steps_per_chunk())) as u32
    }

    pub(super) fn packed(&self, step: usize) -> Option<Arc<PackedStep>> {
        let mut playing = self.playing();
        let chunk = self.chunk(&mut playing, step)?;
        let within = step - chunk.steps().start as usize;
        // The same chunk is the same address, by which the renderer knows its textures.
        let bytes: SharedBytes = chunk;
        match packed_step(&self.header, self.figures, bytes, within) {
            Ok(packed) => Some(Arc::new(packed)),
            Err(error) => {
                playing.fault = Some(format!("{error}: {}", self.path.display()));
                None
            }
        }
    }

    pub(super) fn grid(&self, step: usize) -> Option<Arc<Grid>> {
        let mut playing = self.playing();
        if let Some((_, grid)) = playing.grids.iter().find(|(of, _)| *of == step) {
            return Some(Arc::clone(grid));
        }
        let chunk = self.chunk(&mut playing, step)?;
        let mut bytes = Vec::new();
        let within = step - chunk.steps().start as usize;
        let made = decode_step(self.header.codec, chunk.payload(), self.header.extent, within, &mut bytes)
            .map_err(|e| e.to_string())
            .and_then(|()| {
                let samples = if self.header.codec == StepCodec::Raw16 {
                    let (words, _) = bytes.as_chunks::<2>();
                    Samples::U16(words.iter().map(|word| u16::from_le_bytes(*word)).collect())
                } else {
                    Samples::U8(bytes)
                };
                let rescale = Rescale { slope: self.header.value_scale, intercept: self.header.value_offset };
                let extent = self.header.extent.sizes().map(|n| n as usize);
                Grid::new(extent, samples, rescale, self.place).map_err(|e| e.to_string())
            });
        match made {
            Ok(grid) => {
                let grid = Arc::new(grid);
                playing.grids.truncate(GRIDS - 1);
                playing.grids.push_front((step, Arc::clone(&grid)));
                Some(grid)
            }
            Err(fault) => {
                playing.fault = Some(format!("{fault}: {}", self.path.display()));
                None
            }
        }
    }

    pub(super) fn want(&self, step: usize, direction: Direction, repeat: Repeat) {
        let mut playing = self.playing();
        let chunk = self.chunk_of(step);
        let goes_on =
            playing.order.is_some_and(|(d, r, next)| (d, r) == (direction, repeat) && next == chunk);
        let is_there = playing.way() == (direction, repeat) && playing.at_hand(step).is_some();
        if !goes_on && !is_there {
            playing.seek(chunk, step, (direction, repeat));
        }
    }

    pub(super) fn is_ready(&self, step: usize) -> bool {
        let mut playing = self.playing();
        if playing.at_hand(step).is_some() {
            return true;
        }
        // What is not wanted would be waited for in vain.
        if playing.order.is_none_or(|(_, _, next)| next != self.chunk_of(step)) {
            return false;
        }
        match playing.stream.poll() {
            Ok(Next::Ready(chunk)) => playing.take(chunk).steps().contains(&(step as u32)),
            Ok(Next::Pending | Next::End) => false,
            Err(error) => {
                playing.fail(&error, &self.path);
                false
            }
        }
    }
}

impl Playing {
    fn at_hand(&self, step: usize) -> Option<Arc<Chunk>> {
        self.chunks.iter().find(|c| c.steps().contains(&(step as u32))).cloned()
    }

    /// How the stream plays.
    fn way(&self) -> (Direction, Repeat) {
        self.order.map_or((Direction::Forward, Repeat::Loop), |(direction, repeat, _)| (direction, repeat))
    }

    /// Turns the stream to the chunk of a step, unless that is the next one anyway.
    fn seek(&mut self, chunk: u32, step: usize, way: (Direction, Repeat)) {
        let asked = (way.0, way.1, chunk);
        if self.order != Some(asked) && self.stream.play_from(step as u32, way.0, way.1).is_ok() {
            self.order = Some(asked);
        }
    }

    /// Takes what the stream gave, and knows what it gives next.
    fn take(&mut self, chunk: Chunk) -> Arc<Chunk> {
        let count = self.stream.chunks();
        let at = chunk.chunk();
        if let Some((direction, repeat, next)) = &mut self.order {
            let (on, is_last) = match direction {
                Direction::Forward => ((at + 1) % count, at + 1 == count),
                Direction::Backward => ((at + count - 1) % count, at == 0),
            };
            *next = on;
            if is_last && *repeat == Repeat::Once {
                self.order = None;
            }
        }
        let chunk = Arc::new(chunk);
        self.chunks.truncate(CHUNKS - 1);
        self.chunks.push_front(Arc::clone(&chunk));
        chunk
    }

    fn fail(&mut self, error: &compress::stream::StreamError, path: &Path) {
        self.fault = Some(format!("{}{}: {}", error.source, because(&error.source), path.display()));
        // The stream goes on behind the chunk that failed: ask it anew.
        self.order = None;
    }
}
