//! `fewbits send`: rows as frames over a stream, UDP or a serial line.

use crate::arguments::SendOptions;
use crate::error::Error;
use crate::live::{self, RowSink};
use crate::target::Target;
use crate::{Ending, pack, serial};
use fewbits_record::{FrameWriter, HeaderRepeats};
use std::io::Write;
use std::net::UdpSocket;

/// Sends one frame.
type SendFrame = Box<dyn FnMut(&[u8]) -> std::io::Result<()>>;

/// Destination of frames.
enum FrameSink {
    /// A stream without losses: the header once, then frames. It is a recording without an index.
    Stream { sink: Target, begun: bool },
    /// Single frames that may be lost: pieces of the header are sent between them.
    Frames {
        send: SendFrame,
        address: String,
        repeats: HeaderRepeats,
    },
}

impl FrameSink {
    /// Sends the header of a stream if no frame was sent: a table without rows is a recording without rows.
    fn finish(&mut self, writer: &FrameWriter) -> Result<(), Error> {
        match self {
            Self::Stream { sink, begun: false } => {
                let failed = Error::io(sink.name(), "write");
                sink.write_all(&writer.header_at_once()).map_err(failed)
            }
            _ => Ok(()),
        }
    }

    fn send(&mut self, writer: &FrameWriter, frames: Vec<Vec<u8>>) -> Result<(), Error> {
        for frame in frames {
            match self {
                Self::Stream { sink, begun } => {
                    let failed = Error::io(sink.name(), "write");
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
}

fn sink(options: &SendOptions) -> Result<FrameSink, Error> {
    let repeats = match options.header_every {
        Some(frames) => HeaderRepeats::every(frames),
        None => HeaderRepeats::share(options.header_share / 100.0),
    };
    let repeats = repeats.map_err(Error::recording("--header-share"))?;
    let frames = |address: &str, send| FrameSink::Frames {
        send,
        address: address.to_owned(),
        repeats,
    };
    if let Some(device) = &options.serial {
        let mut line = serial::open(device, options.baud)?;
        return Ok(frames(device, Box::new(move |frame: &[u8]| serial::write(&mut line, frame))));
    }
    let Some(address) = &options.udp else {
        return Ok(FrameSink::Stream {
            sink: Target::open_binary(options.output.as_deref())?,
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

/// Rows into frames.
struct Sender {
    writer: FrameWriter,
    sink: FrameSink,
    next: i64,
    file: String,
}

impl RowSink for Sender {
    fn push(&mut self, tick: Option<i64>, cells: &[Option<f64>]) -> Result<(), Error> {
        let tick = tick.unwrap_or(self.next);
        self.next = tick.wrapping_add(1);
        let frames = self.writer.push(tick, cells).map_err(Error::recording(&self.file))?;
        self.sink.send(&self.writer, frames)
    }

    fn flush(&mut self) -> Result<(), Error> {
        let frames = self.writer.flush().map_err(Error::recording(&self.file))?;
        self.sink.send(&self.writer, frames)
    }

    fn waiting(&self) -> usize {
        self.writer.waiting()
    }
}

/// Runs the task.
pub(crate) fn run(options: &SendOptions) -> Result<Ending, Error> {
    let (table, schema) = pack::schema(&options.table, &options.bounds)?;
    let (time, file) = (schema.time(), table.file().to_owned());
    let writer = FrameWriter::new(schema, options.max_bytes).map_err(Error::recording(&file))?;
    let mut sender = Sender {
        writer,
        sink: sink(options)?,
        next: 0,
        file,
    };
    let ended = live::run(table, time, options.deadline, &mut sender)?;
    // What was sent can be read, whatever ended the table: its last header says how many frames there were.
    if let FrameSink::Frames { send, address, repeats } = &mut sender.sink {
        let mut all = repeats.at_end(&sender.writer).into_iter();
        all.try_for_each(|frame| send(&frame))
            .map_err(Error::io(address, "send"))?;
    }
    if let Some(error) = ended.error {
        return Err(error);
    }
    sender.sink.finish(&sender.writer)?;
    match sender.sink {
        FrameSink::Stream { sink, .. } => sink.finish()?,
        FrameSink::Frames { .. } => {}
    }
    Ok(Ending::Good)
}
