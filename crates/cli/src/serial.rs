//! Frames on a serial line. Each is encoded by consistent-overhead byte stuffing (Cheshire and Baker 1999) and ends with a zero byte. A
//! receiver that starts in the middle, or after noise, therefore finds the next frame.

use crate::error::Error;
use crate::waiting::Source;
use std::fs::{File, OpenOptions};
use std::io::{IsTerminal, Read, Write};
use std::process::Command;
use std::time::Duration;

/// Largest length of a frame in bytes. Anything longer is noise.
const MAX_FRAME: usize = 1 << 16;
/// Pause before a line without data is read again.
const PAUSE: Duration = Duration::from_millis(20);

fn refused(device: &str, action: &'static str) -> impl Fn(std::io::Error) -> Error + use<> {
    Error::io(device, action)
}

/// Opens the device; a terminal is set to raw bytes at `baud`. Reads of a terminal wait a tenth of a second.
pub(crate) fn open(device: &str, baud: u32) -> Result<File, Error> {
    let line = OpenOptions::new().read(true).write(true).open(device);
    let line = line.map_err(refused(device, "open"))?;
    // A named pipe has no speed.
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
    source: Source,
    /// Bytes of an incomplete frame.
    collected: Vec<u8>,
}

impl Frames {
    /// Frames from a line. If it has no data, it is read again until the timeout.
    pub(crate) fn of_line(line: File, timeout: Option<Duration>) -> Self {
        Self::new(Source::new(line, timeout, Some(PAUSE)))
    }

    /// Frames from a stream, which ends.
    pub(crate) fn of_stream(source: impl Read + Send + 'static) -> Self {
        Self::new(Source::new(source, None, None))
    }

    fn new(source: Source) -> Self {
        Self {
            source,
            collected: Vec::new(),
        }
    }

    /// The next frame; `None` after the timeout, at a signal, or at the end of a stream.
    pub(crate) fn next(&mut self) -> std::io::Result<Option<Vec<u8>>> {
        loop {
            if let Some(end) = self.collected.iter().position(|byte| *byte == 0) {
                let bytes: Vec<u8> = self.collected.drain(..=end).collect();
                // Noise is no frame.
                match cobs::decode_vec(&bytes[..end]) {
                    Ok(frame) if !frame.is_empty() => return Ok(Some(frame)),
                    _ => continue,
                }
            }
            // Without a zero byte for so long, the line carries noise: memory is bounded.
            if self.collected.len() > MAX_FRAME {
                self.collected.clear();
            }
            let mut buffer = [0; 4096];
            match self.source.read(&mut buffer)? {
                0 => return Ok(None),
                count => self.collected.extend(&buffer[..count]),
            }
        }
    }
}
