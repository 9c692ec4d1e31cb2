//! Frames on a serial line: each in consistent-overhead byte stuffing (Cheshire and Baker 1999), ended by a zero byte, so that a
//! receiver that begins in the middle, or after noise, finds the next frame.

use crate::error::Error;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, IsTerminal, Read, Write};
use std::process::Command;
use std::time::{Duration, Instant};

/// Longest frame that is put together; what is longer is noise.
const MAX_FRAME: usize = 1 << 16;
/// Pause before a line without bytes is read again.
const PAUSE: Duration = Duration::from_millis(20);

fn refused(device: &str, action: &'static str) -> impl Fn(std::io::Error) -> Error + use<> {
    Error::file(device, action)
}

/// Opens the device; a terminal is set to raw bytes at `baud`. Reads of a terminal wait a tenth of a second.
pub(crate) fn open(device: &str, baud: u32) -> Result<File, Error> {
    let line = OpenOptions::new().read(true).write(true).open(device);
    let line = line.map_err(refused(device, "open"))?;
    // Anything else (a named pipe) has no speed.
    if line.is_terminal() {
        let settings = ["raw", "-echo", "clocal", "min", "0", "time", "1"];
        let set = Command::new("stty")
            .args(["-F", device, &baud.to_string()])
            .args(settings)
            .output()
            .map_err(refused(device, "run stty for"))?;
        if !set.status.success() {
            let problem = String::from_utf8_lossy(&set.stderr).trim().to_owned();
            return Err(refused(device, "set up")(std::io::Error::other(problem)));
        }
    }
    Ok(line)
}

/// Writes one frame.
pub(crate) fn write(line: &mut File, frame: &[u8]) -> std::io::Result<()> {
    let mut bytes = cobs::encode_vec(frame);
    bytes.push(0);
    line.write_all(&bytes)
}

/// Frames as they come.
pub(crate) struct Frames {
    line: File,
    timeout: Option<Duration>,
    collected: Vec<u8>,
    /// Bytes that were read and not looked at.
    read: Vec<u8>,
}

impl Frames {
    pub(crate) fn new(line: File, timeout: Option<Duration>) -> Self {
        Self {
            line,
            timeout,
            collected: Vec::new(),
            read: Vec::new(),
        }
    }

    /// The next frame; `None` if nothing came for the timeout.
    pub(crate) fn next(&mut self) -> std::io::Result<Option<Vec<u8>>> {
        let mut silent_since = Instant::now();
        loop {
            while let Some(end) = self.read.iter().position(|byte| *byte == 0) {
                let bytes: Vec<u8> = self.read.drain(..=end).collect();
                self.collected.extend_from_slice(&bytes[..end]);
                // Noise is no frame.
                match cobs::decode_vec(&std::mem::take(&mut self.collected)) {
                    Ok(frame) if !frame.is_empty() => return Ok(Some(frame)),
                    _ => {}
                }
            }
            self.collected.append(&mut self.read);
            if self.collected.len() > MAX_FRAME {
                self.collected.clear();
            }
            let mut buffer = [0; 4096];
            match self.line.read(&mut buffer) {
                Ok(0) => {
                    if self.timeout.is_some_and(|timeout| silent_since.elapsed() >= timeout) {
                        return Ok(None);
                    }
                    std::thread::sleep(PAUSE);
                }
                Ok(count) => {
                    self.read.extend_from_slice(&buffer[..count]);
                    silent_since = Instant::now();
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
}
