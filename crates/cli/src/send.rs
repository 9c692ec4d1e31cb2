//! `fewbits send`: rows as frames over a stream, UDP or a serial line.

use crate::arguments::SendOptions;
use crate::error::Error;
use crate::live::{self, RowSink};
use crate::target::Target;
use crate::{Ending, pack, serial};
use fewbits_record::FrameWriter;
use std::io::Write;
use std::net::UdpSocket;

/// Sends one frame.
type Post = Box<dyn FnMut(&[u8]) -> std::io::Result<()>>;

/// Destination of frames.
enum Way {
    /// A stream without losses: the header once, then frames. It is a recording without an index.
    Stream { sink: Target, begun: bool },
    /// Single frames that may be lost: the header in pieces before every group of frames.
    Frames {
        post: Post,
        address: String,
        header_every: u64,
        sent: u64,
    },
}

impl Way {
    fn send(&mut self, writer: &FrameWriter, frames: &[Vec<u8>]) -> Result<(), Error> {
        for frame in frames {
            match self {
                Self::Stream { sink, begun } => {
                    let failed = Error::io(sink.name(), "write");
                    if !std::mem::replace(begun, true) {
                        sink.write_all(&writer.header().unwrap_or_default()).map_err(&failed)?;
                    }
                    sink.write_all(frame).and_then(|()| sink.flush()).map_err(failed)?;
                }
                Self::Frames {
                    post,
                    address,
                    header_every,
                    sent,
                } => {
                    let pieces = if sent.is_multiple_of(*header_every) {
                        writer.header_frames()
                    } else {
                        Vec::new()
                    };
                    let outcome = pieces
                        .iter()
                        .try_for_each(|piece| post(piece))
                        .and_then(|()| post(frame));
                    outcome.map_err(Error::io(address, "send"))?;
                    *sent += 1;
                }
            }
        }
        Ok(())
    }
}

fn way(options: &SendOptions) -> Result<Way, Error> {
    let frames = |address: &str, post| Way::Frames {
        post,
        address: address.to_owned(),
        header_every: options.header_every,
        sent: 0,
    };
    if let Some(device) = &options.serial {
        let mut line = serial::open(device, options.baud)?;
        return Ok(frames(device, Box::new(move |frame: &[u8]| serial::write(&mut line, frame))));
    }
    let Some(address) = &options.udp else {
        return Ok(Way::Stream {
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
    way: Way,
    next: i64,
    file: String,
}

impl RowSink for Sender {
    fn push(&mut self, tick: Option<i64>, cells: &[Option<f64>]) -> Result<(), Error> {
        let tick = tick.unwrap_or(self.next);
        self.next = tick.wrapping_add(1);
        let frames = self.writer.push(tick, cells).map_err(Error::recording(&self.file))?;
        self.way.send(&self.writer, &frames)
    }

    fn flush(&mut self) -> Result<(), Error> {
        let frames = self.writer.flush().map_err(Error::recording(&self.file))?;
        self.way.send(&self.writer, &frames)
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
        way: way(options)?,
        next: 0,
        file,
    };
    let ended = live::run(table, time, options.deadline, &mut sender)?;
    if let Some(error) = ended.error {
        return Err(error);
    }
    match sender.way {
        Way::Stream { sink, .. } => sink.finish()?,
        Way::Frames { .. } => {}
    }
    Ok(Ending::Good)
}
