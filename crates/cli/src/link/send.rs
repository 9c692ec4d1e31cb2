//! `fewbits send`: rows as frames over a stream, UDP or a serial line.

use crate::arguments::SendOptions;
use crate::error::Error;
use crate::input::Row;
use crate::{Ending, output, pack, serial};
use fewbits_record::{FrameWriter, HeaderRepeats};
use std::io::Write;
use std::net::UdpSocket;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Instant;

/// Number of rows that are read ahead.
const AHEAD: usize = 1024;

/// Sends one frame.
type SendFrame = Box<dyn FnMut(&[u8]) -> std::io::Result<()>>;

/// Destination of frames.
enum Sink {
    /// A stream without losses: the header once, then frames. It is a recording without an index.
    Stream {
        sink: Box<dyn Write>,
        name: String,
        begun: bool,
    },
    /// Single frames that may be lost: pieces of the header are sent between them.
    Frames {
        send: SendFrame,
        address: String,
        repeats: HeaderRepeats,
    },
}

impl Sink {
    fn send(&mut self, writer: &FrameWriter, frames: Vec<Vec<u8>>) -> Result<(), Error> {
        for frame in frames {
            match self {
                Self::Stream { sink, name, begun } => {
                    let failed = Error::io(name, "write");
                    if !std::mem::replace(begun, true) {
                        sink.write_all(&writer.header().unwrap_or_default()).map_err(&failed)?;
                    }
                    sink.write_all(&frame).and_then(|()| sink.flush()).map_err(failed)?;
                }
                Self::Frames { send, address, repeats } => {
                    let mut all = repeats.around(writer, frame).into_iter();
                    all.try_for_each(|frame| send(&frame))
                        .map_err(Error::io(address, "send"))?;
                }
            }
        }
        Ok(())
    }

    fn finish(&mut self, writer: &FrameWriter) -> Result<(), Error> {
        let Self::Frames { send, address, repeats } = self else {
            return Ok(());
        };
        let mut all = repeats.at_end(writer).into_iter();
        all.try_for_each(|frame| send(&frame))
            .map_err(Error::io(address, "send"))
    }
}

fn sink(options: &SendOptions) -> Result<Sink, Error> {
    let repeats = match options.header_every {
        Some(frames) => HeaderRepeats::every(frames),
        None => HeaderRepeats::share(options.header_share / 100.0),
    };
    let repeats = repeats.map_err(Error::recording("--header-share"))?;
    let frames = |address: &str, send| Sink::Frames {
        send,
        address: address.to_owned(),
        repeats,
    };
    if let Some(device) = &options.serial {
        let mut line = serial::open(device, options.baud)?;
        return Ok(frames(device, Box::new(move |frame: &[u8]| serial::write(&mut line, frame))));
    }
    let Some(address) = &options.udp else {
        let (sink, name) = output::open_binary(options.output.as_deref())?;
        return Ok(Sink::Stream {
            sink,
            name,
            begun: false,
        });
    };
    // A socket can only send to addresses of its own family.
    let local = if address.starts_with('[') {
        "[::]:0"
    } else {
        "0.0.0.0:0"
    };
    let socket = UdpSocket::bind(local).and_then(|socket| socket.connect(address).map(|()| socket));
    let socket = socket.map_err(Error::io(address, "connect"))?;
    Ok(frames(
        address,
        Box::new(move |frame: &[u8]| match socket.send(frame) {
            // No receiver is listening: the datagram is lost, like any other.
            Err(error) if error.kind() == std::io::ErrorKind::ConnectionRefused => Ok(()),
            outcome => outcome.map(drop),
        }),
    ))
}

/// Runs `send`.
pub(crate) fn run(options: &SendOptions) -> Result<Ending, Error> {
    let (mut table, schema) = pack::schema(&options.table, &options.bounds)?;
    let (time, file) = (schema.time(), table.file().to_owned());
    let failed = Error::recording(&file);
    let mut writer = FrameWriter::new(schema, options.max_bytes).map_err(&failed)?;
    let mut sink = sink(options)?;
    let (sender, rows) = sync_channel::<Result<Row, Error>>(AHEAD);
    // Reading blocks and would delay the deadline: a thread of its own reads.
    let reader = std::thread::spawn(move || {
        loop {
            let row = match table.next(time) {
                Ok(Some(row)) => Ok(row),
                Ok(None) => return,
                Err(error) => Err(error),
            };
            let is_last = row.is_err();
            if sender.send(row).is_err() || is_last {
                return;
            }
        }
    });
    let (mut next, mut oldest) = (0_i64, None::<Instant>);
    loop {
        let row = match wait(&rows, options, oldest) {
            Ok(row) => row?,
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {
                let frames = writer.flush().map_err(&failed)?;
                sink.send(&writer, frames)?;
                oldest = None;
                continue;
            }
        };
        let tick = row.0.unwrap_or(next);
        next = tick.wrapping_add(1);
        let before = writer.waiting();
        let frames = writer.push(tick, &row.1).map_err(&failed)?;
        let is_first = before == 0 || !frames.is_empty();
        sink.send(&writer, frames)?;
        // Behind a frame only the last rows are left, and their time is counted from here.
        if is_first {
            oldest = (writer.waiting() > 0).then(Instant::now);
        }
    }
    let frames = writer.flush().map_err(&failed)?;
    sink.send(&writer, frames)?;
    sink.finish(&writer)?;
    // The thread has sent its last row and ends by itself.
    drop(reader);
    Ok(Ending::Good)
}

/// The next row, or a timeout when the oldest waiting row must be sent.
fn wait(
    rows: &Receiver<Result<Row, Error>>,
    options: &SendOptions,
    oldest: Option<Instant>,
) -> Result<Result<Row, Error>, RecvTimeoutError> {
    match (options.deadline, oldest) {
        (Some(deadline), Some(oldest)) => rows.recv_timeout(deadline.saturating_sub(oldest.elapsed())),
        _ => rows.recv().map_err(|_| RecvTimeoutError::Disconnected),
    }
}
