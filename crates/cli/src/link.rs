//! `fewbits send` and `fewbits receive`: rows as frames over a stream, UDP or a serial line, and back.

use crate::arguments::{ReceiveOptions, SendOptions};
use crate::error::Error;
use crate::input::Row;
use crate::output::{Shape, Writer};
use crate::unpack::{all_columns, write_blocks};
use crate::{Ending, node, output, pack, serial};
use fewbits_record::{BlockReader, FrameReader, FrameWriter};
use std::fs::File;
use std::io::{Read, Write};
use std::net::UdpSocket;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Instant;

/// Number of rows that are read ahead.
const AHEAD: usize = 1024;
/// Largest length of a datagram in bytes.
const MAX_DATAGRAM: usize = 1 << 16;

/// Sends one frame.
type Post = Box<dyn FnMut(&[u8]) -> std::io::Result<()>>;

/// Destination of frames.
enum Way {
    /// A stream without losses: the header once, then frames. It is a recording without an index.
    Stream {
        sink: Box<dyn Write>,
        name: String,
        begun: bool,
    },
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
                Self::Stream { sink, name, begun } => {
                    let failed = Error::io(name, "write");
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
        let (sink, name) = output::open_binary(options.output.as_deref())?;
        return Ok(Way::Stream {
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
pub(crate) fn send(options: &SendOptions) -> Result<Ending, Error> {
    let (mut table, schema) = pack::schema(&options.table, &options.bounds)?;
    let (time, file) = (schema.time(), table.file().to_owned());
    let failed = Error::recording(&file);
    let mut writer = FrameWriter::new(schema, options.max_bytes).map_err(&failed)?;
    let mut way = way(options)?;
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
                way.send(&writer, &frames)?;
                oldest = None;
                continue;
            }
        };
        let tick = row.0.unwrap_or(next);
        next = tick.wrapping_add(1);
        let before = writer.waiting();
        let frames = writer.push(tick, &row.1).map_err(&failed)?;
        way.send(&writer, &frames)?;
        // Behind a frame only the last rows are left, and their time is counted from here.
        if before == 0 || !frames.is_empty() {
            oldest = (writer.waiting() > 0).then(Instant::now);
        }
    }
    let frames = writer.flush().map_err(&failed)?;
    way.send(&writer, &frames)?;
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

/// Runs `receive`.
pub(crate) fn receive(options: &ReceiveOptions) -> Result<Ending, Error> {
    let sensor = options.sensor.as_deref();
    let sensor = sensor
        .map(|bound| node::config(bound, options.sequence_bits))
        .transpose()?;
    match (&options.udp, &options.serial, sensor) {
        (Some(address), ..) => receive_datagrams(options, address),
        (None, Some(device), sensor) => {
            let mut frames = serial::Frames::of_line(serial::open(device, options.baud)?, options.timeout);
            match sensor {
                Some(config) => node::receive(options, config, &mut frames, device),
                None => receive_frames(options, device, || frames.next()),
            }
        }
        (None, None, Some(config)) => {
            let (source, name) = open(&options.file)?;
            node::receive(options, config, &mut serial::Frames::of_stream(source), name)
        }
        (None, None, None) => receive_stream(options),
    }
}

/// Opens a file or standard input. Returns its name for messages too.
fn open(file: &str) -> Result<(Box<dyn Read + Send>, &str), Error> {
    Ok(match file {
        "-" => (Box::new(std::io::stdin()), "standard input"),
        file => (Box::new(File::open(file).map_err(Error::io(file, "open"))?), file),
    })
}

fn receive_stream(options: &ReceiveOptions) -> Result<Ending, Error> {
    let (source, name) = open(&options.file)?;
    let blocks = BlockReader::new(source).map_err(Error::recording(name))?;
    let (columns, names) = all_columns(blocks.schema());
    let mut writer = Writer::new(options.output.as_deref(), Shape::Csv, blocks.schema(), &names)?;
    let mut ending = Ending::Good;
    // Flush after each block, so that rows are written as soon as they arrive.
    for block in blocks {
        let one = write_blocks(std::iter::once(block), &mut writer, (i64::MIN, i64::MAX), &columns, name)?;
        if one == Ending::Failed {
            ending = Ending::Failed;
        }
    }
    writer.finish().map(|()| ending)
}

fn receive_datagrams(options: &ReceiveOptions, address: &str) -> Result<Ending, Error> {
    let socket = UdpSocket::bind(address).map_err(Error::io(address, "listen"))?;
    socket
        .set_read_timeout(options.timeout)
        .map_err(Error::io(address, "set the timeout"))?;
    if let Ok(local) = socket.local_addr() {
        eprintln!("listening at {local}");
    }
    let mut datagram = vec![0; MAX_DATAGRAM];
    receive_frames(options, address, || match socket.recv(&mut datagram) {
        Ok(length) => Ok(Some(datagram[..length].to_vec())),
        Err(error) if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => Ok(None),
        Err(error) => Err(error),
    })
}

/// Writes the rows of frames as they arrive, until there are no more. The result is a failure if the header never became complete.
fn receive_frames(
    options: &ReceiveOptions,
    address: &str,
    mut next: impl FnMut() -> std::io::Result<Option<Vec<u8>>>,
) -> Result<Ending, Error> {
    let (mut reader, mut writer) = (FrameReader::new(), None::<(Writer, Vec<usize>)>);
    while let Some(frame) = next().map_err(Error::io(address, "receive"))? {
        let blocks = match reader.handle(&frame) {
            Ok(blocks) => blocks,
            Err(error) => {
                eprintln!("warning: {address}: a frame was refused: {error}");
                continue;
            }
        };
        let Some(schema) = reader.schema() else { continue };
        if writer.is_none() {
            let (columns, names) = all_columns(schema);
            writer = Some((Writer::new(options.output.as_deref(), Shape::Csv, schema, &names)?, columns));
        }
        if let Some((writer, columns)) = &mut writer {
            write_blocks(blocks.into_iter().map(Ok), writer, (i64::MIN, i64::MAX), columns, address)?;
        }
    }
    match writer {
        Some((writer, _)) => writer.finish().map(|()| Ending::Good),
        None => Ok(Ending::no_frame(address)),
    }
}
