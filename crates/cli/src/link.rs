//! `fewbits receive`: frames over a stream, UDP or a serial line to rows.

use crate::arguments::ReceiveOptions;
use crate::error::Error;
use crate::output::{Shape, Writer};
use crate::say::say;
use crate::unpack::{all_columns, write_blocks};
use crate::{Ending, node, recording, serial};
use fewbits_record::{BlockReader, FrameReader};
use std::net::UdpSocket;

/// Largest length of a datagram in bytes.
const MAX_DATAGRAM: usize = 1 << 16;

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
            let (source, name) = recording::stream(&options.file)?;
            node::receive(options, config, &mut serial::Frames::of_stream(source), name)
        }
        (None, None, None) => receive_stream(options),
    }
}

fn receive_stream(options: &ReceiveOptions) -> Result<Ending, Error> {
    let (source, name) = recording::stream(&options.file)?;
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
        say!("listening at {local}");
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
                say!("warning: {address}: a frame was refused: {error}");
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
