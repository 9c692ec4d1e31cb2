//! Stations and sensors over UDP, by the clock of the machine.

use crate::error::Error;
use crate::sensor::{Request, SensorLink};
use crate::station::{Output, Station};
use fewbits_core::BitString;
use fewbits_protocol::{Note, Receiver, Slot};
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::ops::ControlFlow;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Bytes of the longest datagram.
const MAX_DATAGRAM: usize = 65_535;
/// Datagrams that are taken before timers are looked at again: a flood does not hold up a slot.
const BATCH: usize = 256;
/// The longest wait: whoever watches is asked ten times a second.
const MAX_WAIT: Duration = Duration::from_millis(100);
const HELLO_EVERY: Duration = Duration::from_secs(1);

/// Nanoseconds since 1970.
pub fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

fn failed(address: impl std::fmt::Display) -> impl FnOnce(std::io::Error) -> Error {
    let address = address.to_string();
    move |source| Error::Socket { address, source }
}

/// A socket bound to this address.
///
/// # Errors
/// If the address is taken or none of this machine.
pub fn bind(address: impl ToSocketAddrs + std::fmt::Display) -> Result<UdpSocket, Error> {
    UdpSocket::bind(&address).map_err(failed(address))
}

/// Waits for datagrams until `until`, and takes those that are there.
fn receive(
    socket: &UdpSocket,
    until: u64,
    buffer: &mut [u8],
    mut take: impl FnMut(SocketAddr, &[u8]) -> Result<(), Error>,
) -> Result<(), Error> {
    let address = || socket.local_addr().map_or_else(|_| "?".to_owned(), |a| a.to_string());
    let wait = Duration::from_nanos(until.saturating_sub(now())).clamp(Duration::from_micros(50), MAX_WAIT);
    socket.set_read_timeout(Some(wait)).map_err(|e| failed(address())(e))?;
    let mut taken = 0;
    let outcome = loop {
        match socket.recv_from(buffer) {
            Ok((length, from)) => {
                if let Err(error) = take(from, &buffer[..length]) {
                    break Err(error);
                }
            }
            // A sensor that is gone is refused by its machine, and the error comes back here.
            Err(error) if matches!(error.kind(), std::io::ErrorKind::ConnectionRefused) => {}
            // Nothing is there.
            Err(_) => break Ok(()),
        }
        taken += 1;
        if taken == BATCH || now() >= until {
            break Ok(());
        }
        // What is there is taken without waiting: a timeout is rounded up to milliseconds.
        if taken == 1 {
            socket.set_nonblocking(true).map_err(|e| failed(address())(e))?;
        }
    };
    if taken > 0 {
        socket.set_nonblocking(false).map_err(|e| failed(address())(e))?;
    }
    outcome
}

/// Runs a station until `watch` breaks. `watch` sees every step and note once it is stored, and is asked at least ten times a second with an empty list.
///
/// # Errors
/// If the socket or the store fails.
pub fn run_station<R: Receiver>(
    socket: &UdpSocket,
    station: &mut Station<R>,
    mut watch: impl FnMut(&Station<R>, &[Output]) -> ControlFlow<()>,
) -> Result<(), Error> {
    let mut buffer = vec![0; MAX_DATAGRAM];
    let mut outputs = Vec::new();
    loop {
        station.on_time(now(), &mut outputs)?;
        for output in &outputs {
            if let Output::Datagram { to, bytes } = output {
                // A datagram that cannot be sent is one that is lost.
                let _ = socket.send_to(bytes, to);
            }
        }
        if watch(station, &outputs).is_break() {
            return Ok(());
        }
        outputs.clear();
        let until = station.next_timer().unwrap_or(u64::MAX);
        receive(socket, until, &mut buffer, |from, bytes| station.on_datagram(from, bytes, &mut outputs))?;
    }
}

/// What a sensor's program does.
pub trait Program {
    /// Measures in a slot and encodes the report; `None` is silence. Break if there is nothing more to measure.
    fn sample(&mut self, slot: Slot, feedback: &BitString) -> ControlFlow<(), Option<BitString>>;

    /// Writes down what was noticed.
    fn note(&mut self, _: Note) {}

    /// Asked at least ten times a second whether to go on.
    fn goes_on(&mut self) -> bool {
        true
    }
}

/// Runs a sensor until its program breaks.
///
/// # Errors
/// If the socket or the store fails.
pub fn run_sensor(
    socket: &UdpSocket,
    centre: SocketAddr,
    link: &mut SensorLink,
    program: &mut impl Program,
) -> Result<(), Error> {
    let mut buffer = vec![0; MAX_DATAGRAM];
    let mut requests = Vec::new();
    let mut hello_at = 0;
    while program.goes_on() {
        if now() >= hello_at {
            requests.push(link.hello()?);
            hello_at = now() + HELLO_EVERY.as_nanos() as u64;
        }
        link.on_time(now(), &mut requests)?;
        while !requests.is_empty() {
            for request in std::mem::take(&mut requests) {
                match request {
                    Request::Datagram(bytes) => {
                        let _ = socket.send_to(&bytes, centre);
                    }
                    Request::Note(note) => program.note(note),
                    Request::Sample { slot, feedback } => {
                        let ControlFlow::Continue(report) = program.sample(slot, &feedback) else {
                            return Ok(());
                        };
                        link.on_sample(now(), report.as_ref(), &mut requests)?;
                        // As long as the centre asks it knows where the sensor is.
                        hello_at = now() + HELLO_EVERY.as_nanos() as u64;
                    }
                }
            }
        }
        let until = link.next_timer().unwrap_or(u64::MAX).min(hello_at);
        receive(socket, until, &mut buffer, |from, bytes| match from == centre {
            true => link.on_datagram(now(), bytes, &mut requests),
            false => Ok(()),
        })?;
    }
    Ok(())
}
