//! The trait of transports, and the loops that run a station or a sensor over a transport by the clock of the machine.

use crate::error::Error;
use crate::hello::Hellos;
use crate::sensor::{Request, SensorLink};
use crate::station::{Output, Station};
use fewbits_core::BitString;
use fewbits_protocol::{Note, Receiver, Slot};
use std::collections::VecDeque;
use std::fmt::{Debug, Display};
use std::ops::ControlFlow;
use std::str::FromStr;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Longest datagram in bytes.
pub(crate) const MAX_DATAGRAM: usize = 65_535;
/// Largest number of datagrams that a station processes before timers are checked again: many datagrams do not delay a slot.
const BATCH: usize = 256;
/// So many datagrams are sent at once; before the next ones a station takes in what has come, for this time at least. Otherwise the questions
/// to many sensors would overflow the buffers between, and so would their answers.
const BURST: usize = 64;
const BURST_PAUSE: u64 = 1_000_000;
/// Longest wait: the caller is asked ten times a second whether to continue.
const MAX_WAIT: Duration = Duration::from_millis(100);
/// Before a program hears that its clock was never set again.
const UNSET_EVERY: Duration = Duration::from_secs(60);
/// The beginning of 2020 in nanoseconds since 1970. A clock before it was never set.
const EARLIEST: u64 = 1_577_836_800_000_000_000;

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

    /// The datagram that was received last was authentic: it came from the other end.
    fn accepted(&mut self) {}

    /// Number of datagrams that arrived and were dropped because too many waited.
    fn dropped(&self) -> u64 {
        0
    }
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
/// A clock before 2020 was never set: no slot begins by it, and [`Output::ClockBehind`] says so once a minute.
///
/// # Errors
/// If the transport can receive no more, or the estimator's state cannot be written.
pub fn run_station<R: Receiver, T: Transport>(
    transport: &mut T,
    station: &mut Station<R, T::Address>,
    mut watch: impl FnMut(&Station<R, T::Address>, &[Output<T::Address>]) -> ControlFlow<()>,
) -> Result<(), Error> {
    let mut outputs = Vec::new();
    let mut waiting: VecDeque<(T::Address, Vec<u8>)> = VecDeque::new();
    let mut said_unset = None::<Instant>;
    loop {
        let is_set = now() >= EARLIEST;
        if is_set {
            station.on_time(now(), &mut outputs)?;
        } else if said_unset.is_none_or(|said| said.elapsed() >= UNSET_EVERY) {
            said_unset = Some(Instant::now());
            let wait = EARLIEST - now();
            outputs.push(Output::ClockBehind { wait });
        }
        let mut room = BURST;
        while room > 0
            && let Some((to, bytes)) = waiting.pop_front()
        {
            transport.send(&to, &bytes);
            room -= 1;
        }
        for output in &outputs {
            match output {
                Output::Datagram { to, bytes } if room > 0 => {
                    transport.send(to, bytes);
                    room -= 1;
                }
                Output::Datagram { to, bytes } => waiting.push_back((to.clone(), bytes.clone())),
                _ => {}
            }
        }
        if watch(station, &outputs).is_break() {
            return Ok(());
        }
        outputs.clear();
        // What datagrams cause is sent in the next round, and watched then.
        let timer = station.next_timer().filter(|_| is_set).unwrap_or(u64::MAX);
        let until = match waiting.is_empty() {
            true => timer,
            false => timer.min(now() + BURST_PAUSE),
        };
        receive(transport, until, BATCH, |from, bytes| station.on_datagram(from, bytes, &mut outputs))?;
    }
}

/// The program of a sensor: measures, and decides when to end.
pub trait Program {
    /// Measures in a slot and encodes the report; `None` is silence. A break ends the sensor.
    fn sample(&mut self, slot: Slot, feedback: &BitString) -> ControlFlow<(), Option<BitString>>;

    /// Records a note.
    fn note(&mut self, _: Note) {}

    /// The state could not be stored, and nothing was sent because of that. It is tried again with the next frame.
    fn trouble(&mut self, _: &Error) {}

    /// No frame of the centre was accepted for this time, and at least three heartbeats were not answered. Called after ten seconds, and
    /// each minute from then on.
    fn unanswered(&mut self, _: Duration, _: &SensorLink) {}

    /// Whether to continue. Called at least ten times a second.
    fn goes_on(&mut self) -> bool {
        true
    }
}

/// Runs a sensor until its program ends. It sends to `centre`. Frames are accepted from any address under its key: a centre with several
/// addresses answers from another one.
///
/// # Errors
/// If the transport can receive no more.
pub fn run_sensor<T: Transport>(
    transport: &mut T,
    centre: &T::Address,
    link: &mut SensorLink,
    program: &mut impl Program,
) -> Result<(), Error> {
    let mut requests = Vec::new();
    let (mut hellos, mut taken) = (Hellos::new(Instant::now()), link.counts().taken);
    while program.goes_on() {
        if hellos.is_due(Instant::now()) {
            requests.extend(tolerate(link.hello(), program)?);
        }
        let outcome = link.on_time(now(), &mut requests);
        tolerate(outcome, program)?;
        while !requests.is_empty() {
            for request in std::mem::take(&mut requests) {
                match request {
                    Request::Datagram(bytes) => transport.send(centre, &bytes),
                    Request::Note(note) => program.note(note),
                    Request::Sample { slot, feedback } => {
                        hellos.on_question(Instant::now(), link.is_told());
                        let ControlFlow::Continue(report) = program.sample(slot, &feedback) else {
                            return Ok(());
                        };
                        let outcome = link.on_sample(now(), report.as_ref(), &mut requests);
                        tolerate(outcome, program)?;
                    }
                }
            }
        }
        let hello = u64::try_from(hellos.wait(Instant::now()).as_nanos()).unwrap_or(u64::MAX);
        let until = link.next_timer().unwrap_or(u64::MAX).min(now().saturating_add(hello));
        // One datagram at a time: a second question that waits would replace the slot of the sample that the first one asks for, and the
        // report would be sent as that of the wrong slot.
        receive(transport, until, 1, |_, bytes| {
            let outcome = link.on_datagram(now(), bytes, &mut requests);
            tolerate(outcome, program).map(drop)
        })?;
        if link.counts().taken != taken {
            taken = link.counts().taken;
            transport.accepted();
            hellos.on_answer(Instant::now());
        } else if link.is_asked()
            && let Some(since) = hellos.unanswered(Instant::now())
        {
            program.unanswered(since, link);
        }
    }
    Ok(())
}

/// Tells the program that the state could not be stored; other errors are returned.
fn tolerate<T>(outcome: Result<T, Error>, program: &mut impl Program) -> Result<Option<T>, Error> {
    match outcome {
        Ok(value) => Ok(Some(value)),
        Err(error) if error.is_of_file() => {
            program.trouble(&error);
            Ok(None)
        }
        Err(error) => Err(error),
    }
}
