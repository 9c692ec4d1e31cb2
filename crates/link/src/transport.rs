//! The trait of transports, and the loops that run a station or a sensor over a transport by the clock of the machine.

use crate::error::Error;
use crate::sensor::{Request, SensorLink};
use crate::station::{Output, Station};
use fewbits_core::BitString;
use fewbits_protocol::{Note, Receiver, Slot};
use std::fmt::{Debug, Display};
use std::ops::ControlFlow;
use std::str::FromStr;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Longest datagram in bytes.
pub(crate) const MAX_DATAGRAM: usize = 65_535;
/// Largest number of datagrams that a station processes before timers are checked again: many datagrams do not delay a slot.
const BATCH: usize = 256;
/// Longest wait: the caller is asked ten times a second whether to continue.
const MAX_WAIT: Duration = Duration::from_millis(100);
const HELLO_EVERY: Duration = Duration::from_secs(1);

/// Address of the sender, and the bytes.
pub type Datagram<'a, A> = (A, &'a [u8]);

/// A carrier of datagrams between a centre and its sensors. It may lose, repeat and reorder them.
pub trait Transport {
    /// Address of a sender or receiver. A station stores it as text; text that does not parse counts as an unknown address.
    type Address: Clone + PartialEq + Debug + Display + FromStr;

    /// Sends a datagram without waiting. What cannot be sent is lost.
    fn send(&mut self, to: &Self::Address, bytes: &[u8]);

    /// The next datagram; `None` if none comes within `wait`.
    ///
    /// # Errors
    /// If the transport can receive no more.
    fn receive(&mut self, wait: Duration) -> Result<Option<Datagram<'_, Self::Address>>, Error>;
}

/// The time in nanoseconds since 1970.
pub fn now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

/// Waits for datagrams until the time `until`, and passes those that have come, at most `most`, to `take`.
fn receive<T: Transport>(
    transport: &mut T,
    until: u64,
    most: usize,
    mut take: impl FnMut(T::Address, &[u8]) -> Result<(), Error>,
) -> Result<(), Error> {
    // Zero would not wait at all, and the loop of the caller would spin until the timer is due.
    let mut wait = Duration::from_nanos(until.saturating_sub(now())).clamp(Duration::from_micros(50), MAX_WAIT);
    for _ in 0..most {
        let Some((from, bytes)) = transport.receive(wait)? else {
            break;
        };
        take(from, bytes)?;
        if now() >= until {
            break;
        }
        // Only what has come already: timers are due before later datagrams.
        wait = Duration::ZERO;
    }
    Ok(())
}

/// Runs a station until `watch` returns a break. `watch` is called with each step and note after it is stored, and at least ten times a
/// second with an empty list.
///
/// # Errors
/// If the transport or the store fails.
pub fn run_station<R: Receiver, T: Transport>(
    transport: &mut T,
    station: &mut Station<R, T::Address>,
    mut watch: impl FnMut(&Station<R, T::Address>, &[Output<T::Address>]) -> ControlFlow<()>,
) -> Result<(), Error> {
    let mut outputs = Vec::new();
    loop {
        station.on_time(now(), &mut outputs)?;
        for output in &outputs {
            if let Output::Datagram { to, bytes } = output {
                transport.send(to, bytes);
            }
        }
        if watch(station, &outputs).is_break() {
            return Ok(());
        }
        outputs.clear();
        // What datagrams cause is sent in the next round, and watched then.
        let until = station.next_timer().unwrap_or(u64::MAX);
        receive(transport, until, BATCH, |from, bytes| station.on_datagram(from, bytes, &mut outputs))?;
    }
}

/// The program of a sensor: measures, and decides when to end.
pub trait Program {
    /// Measures in a slot and encodes the report; `None` is silence. A break ends the sensor.
    fn sample(&mut self, slot: Slot, feedback: &BitString) -> ControlFlow<(), Option<BitString>>;

    /// Records a note.
    fn note(&mut self, _: Note) {}

    /// Whether to continue. Called at least ten times a second.
    fn goes_on(&mut self) -> bool {
        true
    }
}

/// Runs a sensor until its program ends. Datagrams that are not from `centre` are ignored.
///
/// # Errors
/// If the transport or the store fails.
pub fn run_sensor<T: Transport>(
    transport: &mut T,
    centre: &T::Address,
    link: &mut SensorLink,
    program: &mut impl Program,
) -> Result<(), Error> {
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
                    Request::Datagram(bytes) => transport.send(centre, &bytes),
                    Request::Note(note) => program.note(note),
                    Request::Sample { slot, feedback } => {
                        let ControlFlow::Continue(report) = program.sample(slot, &feedback) else {
                            return Ok(());
                        };
                        link.on_sample(now(), report.as_ref(), &mut requests)?;
                        // While the centre asks, it knows the sensor's address: no heartbeat is needed.
                        hello_at = now() + HELLO_EVERY.as_nanos() as u64;
                    }
                }
            }
        }
        let until = link.next_timer().unwrap_or(u64::MAX).min(hello_at);
        // One datagram at a time: a second question that waits would replace the slot of the sample that the first one asks for, and the
        // report would be sent as that of the wrong slot.
        receive(transport, until, 1, |from, bytes| match from == *centre {
            true => link.on_datagram(now(), bytes, &mut requests),
            false => Ok(()),
        })?;
    }
    Ok(())
}
