//! Waiting for what arrives. A signal is the end, as a timeout is: what has arrived is taken before it.

use crate::interrupt;
use crate::target;
use std::io::{ErrorKind, Read, Result};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

/// Longest wait before it is looked whether a signal came.
const WAIT: Duration = Duration::from_millis(200);
/// Chunks that are read ahead.
const CHUNKS: usize = 64;

/// Receives once, waiting for `timeout` at most. `receive` waits for its argument and returns `None` if nothing came meanwhile.
pub(crate) fn next<T>(
    timeout: Option<Duration>,
    mut receive: impl FnMut(Duration) -> Result<Option<T>>,
) -> Result<Option<T>> {
    let begun = Instant::now();
    loop {
        let is_last = interrupt::is_stopped();
        let left = timeout.map_or(WAIT, |timeout| timeout.saturating_sub(begun.elapsed()).min(WAIT));
        let found = receive(if is_last { Duration::ZERO } else { left })?;
        if found.is_some() || is_last || left.is_zero() {
            return Ok(found);
        }
    }
}

/// A source that a thread reads, since reading blocks. It ends at the timeout and at a signal.
pub(crate) struct Source {
    chunks: Receiver<Result<Vec<u8>>>,
    timeout: Option<Duration>,
    chunk: Vec<u8>,
    used: usize,
}

impl Source {
    /// `pause`: of a line, which has no end. If it has no data, it is read again after this time.
    pub(crate) fn new(
        mut source: impl Read + Send + 'static,
        timeout: Option<Duration>,
        pause: Option<Duration>,
    ) -> Self {
        // A file can be read again: a signal ends the command at once.
        if target::is_live() {
            interrupt::watch();
        }
        let (sender, chunks) = sync_channel(CHUNKS);
        // It ends with the process.
        std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            loop {
                let chunk = match source.read(&mut buffer) {
                    Ok(0) => match pause {
                        Some(pause) => {
                            std::thread::sleep(pause);
                            continue;
                        }
                        None => return,
                    },
                    Ok(count) => Ok(buffer[..count].to_vec()),
                    Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                    Err(error) => Err(error),
                };
                let is_last = chunk.is_err();
                if sender.send(chunk).is_err() || is_last {
                    return;
                }
            }
        });
        Self {
            chunks,
            timeout,
            chunk: Vec::new(),
            used: 0,
        }
    }
}

impl Read for Source {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        if self.used == self.chunk.len() {
            let chunks = &self.chunks;
            let chunk = next(self.timeout, |wait| match chunks.recv_timeout(wait) {
                Ok(chunk) => chunk.map(Some),
                Err(RecvTimeoutError::Timeout) => Ok(None),
                Err(RecvTimeoutError::Disconnected) => Ok(Some(Vec::new())),
            })?;
            (self.chunk, self.used) = (chunk.unwrap_or_default(), 0);
        }
        let count = buffer.len().min(self.chunk.len() - self.used);
        buffer[..count].copy_from_slice(&self.chunk[self.used..self.used + count]);
        self.used += count;
        Ok(count)
    }
}
