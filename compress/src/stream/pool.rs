//! The threads: one reads, others unpack.

use std::io::{self, Read, Seek};
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use super::queue::{Queue, ToRead};
use crate::container::{ReadError, Reader};
use crate::lossless::{Shape, UnpackError, Unpacker};

/// Starts the threads and puts each into `threads` as soon as it runs.
pub(super) fn start<R>(
    queue: &Arc<Queue>,
    reader: Reader<R>,
    unpackers: NonZeroUsize,
    threads: &mut Vec<JoinHandle<()>>,
) -> io::Result<()>
where
    R: Read + Seek + Send + 'static,
{
    let shape = reader.shape();
    for i in 0..unpackers.get() {
        let queue = Arc::clone(queue);
        let name = format!("series-unpack-{i}");
        threads.push(Builder::new().name(name).spawn(move || unpack(&queue, shape))?);
    }
    let queue = Arc::clone(queue);
    threads.push(Builder::new().name("series-read".to_owned()).spawn(move || read(&queue, reader))?);
    Ok(())
}

/// Reads what is wanted until the queue is closed.
fn read<R: Read + Seek>(queue: &Queue, mut reader: Reader<R>) {
    while let Some(ToRead { ticket, chunk, mut packed }) = queue.to_read() {
        let start = Instant::now();
        let read = reader.read_packed(chunk, &mut packed).and_then(|()| reader.form(chunk));
        queue.was_read(ticket, packed, read, start.elapsed());
    }
}

/// Unpacks what was read until the queue is closed.
fn unpack(queue: &Queue, shape: Shape) {
    let mut unpacker = Unpacker::new();
    while let Some(mut work) = queue.to_unpack() {
        let start = Instant::now();
        let bytes = shape.bytes();
        let missing = bytes.saturating_sub(work.payload.len());
        let unpacked = if work.payload.try_reserve_exact(missing).is_err() {
            Err(UnpackError::OutOfMemory { bytes })
        } else {
            work.payload.resize(bytes, 0);
            unpacker.unpack_into(work.form, shape, &work.packed, &mut work.payload)
        };
        let chunk = work.chunk;
        let unpacked = unpacked.map_err(|source| ReadError::Unpack { chunk, source });
        queue.was_unpacked(work, unpacked, start.elapsed());
    }
}
