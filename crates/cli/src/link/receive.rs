//! `fewbits receive`: the rows of frames from a stream, UDP or a serial line.

use super::tables::{Senders, Tables};
use crate::arguments::ReceiveOptions;
use crate::error::Error;
use crate::output::{Shape, Writer};
use crate::say::say;
use crate::unpack::write_blocks;
use crate::{Ending, interrupt, node, recording, serial, waiting};
use fewbits_link::{Transport, Udp};
use fewbits_recipes::unpack::Selection;
use fewbits_record::BlockReader;

/// Runs `receive`.
pub(crate) fn run(options: &ReceiveOptions) -> Result<Ending, Error> {
    let ending = received(options)?;
    if interrupt::is_stopped() {
        say!("note: ended by a signal: the rows that had arrived are written");
    }
    Ok(ending)
}

fn received(options: &ReceiveOptions) -> Result<Ending, Error> {
    if let Some(format) = options.format {
        return super::messages::run(options, format);
    }
    let sensor = options.sensor.as_deref();
    let sensor = sensor
        .map(|bound| node::coding(bound, options.sequence_bits))
        .transpose()?;
    match (&options.udp, &options.serial, sensor) {
        (Some(address), ..) => receive_datagrams(options, address),
        (None, Some(device), sensor) => {
            let mut frames = serial::Frames::of_line(serial::open(device, options.baud)?, options.timeout);
            match sensor {
                Some(config) => node::receive(options, config, device, || frames.next()),
                None => receive_frames(options, device, Senders::One, || frames.next()),
            }
        }
        (None, None, Some(config)) => {
            let (source, name) = recording::stream(&options.file)?;
            let mut frames = serial::Frames::of_stream(source);
            node::receive(options, config, name, || frames.next())
        }
        (None, None, None) => receive_stream(options),
    }
}

fn receive_stream(options: &ReceiveOptions) -> Result<Ending, Error> {
    let (source, name) = recording::live(&options.file)?;
    let blocks = BlockReader::new(source).map_err(Error::recording(name))?;
    let all = Selection::all(blocks.schema());
    let mut writer = Writer::new(options.output.as_deref(), Shape::Csv, blocks.schema(), &all.names)?;
    let mut ending = Ending::Good;
    // Flush after each block, so that rows are written as soon as they arrive.
    for block in blocks {
        let one = write_blocks(std::iter::once(block), &mut writer, &all, name)?;
        if one == Ending::Failed {
            ending = Ending::Failed;
        }
    }
    writer.finish().map(|()| ending)
}

fn receive_datagrams(options: &ReceiveOptions, address: &str) -> Result<Ending, Error> {
    let mut socket = Udp::bind(address)
        .map_err(of_socket)
        .map_err(|error| match error.kind() {
            std::io::ErrorKind::InvalidInput => {
                Error::option("--udp", address, "an address of this machine and a port, as 0.0.0.0:9000")
            }
            std::io::ErrorKind::AddrInUse => {
                Error::content(address, "another program listens there: end it, or take another port")
            }
            _ => Error::io(address, "listen")(error),
        })?;
    say!("listening at {}", socket.address());
    // A signal is the end: what did not arrive is counted.
    interrupt::watch();
    let ending = receive_frames(options, address, Senders::Any, || {
        waiting::next(options.timeout, |wait| {
            let found = socket.receive(wait).map_err(of_socket)?;
            Ok(found.map(|(_, bytes)| bytes.to_vec()))
        })
    })?;
    if socket.dropped() > 0 {
        say!("{} datagrams were dropped: they came faster than their rows could be written", socket.dropped());
    }
    Ok(ending)
}

/// The system's error of a socket.
fn of_socket(error: fewbits_link::Error) -> std::io::Error {
    match error {
        fewbits_link::Error::Socket { source, .. } => source,
        other => std::io::Error::other(other),
    }
}

/// Writes the rows of frames as they arrive, until there are no more. The result is a failure if a table is not whole.
fn receive_frames(
    options: &ReceiveOptions,
    address: &str,
    senders: Senders,
    mut next: impl FnMut() -> std::io::Result<Option<Vec<u8>>>,
) -> Result<Ending, Error> {
    let mut tables = Tables::new(options.output.as_deref(), address, senders);
    while let Some(frame) = next().map_err(Error::io(address, "receive"))? {
        if !frame.is_empty() {
            tables.take(&frame)?;
        }
    }
    tables.finish()
}
