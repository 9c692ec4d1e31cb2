//! `fewbits sensor`: samples from standard input, reports over UDP, MQTT or zenoh.

use crate::Ending;
use crate::arguments::SensorOptions;
use crate::error::Error;
use crate::notes::Limiter;
use crate::place::Place;
use crate::private::{configuration, configured};
use crate::report::Report;
use crate::say::say;
use crate::towards::Towards;
use fewbits_core::{BitString, SensorNode};
use fewbits_link::{Key, Program, SensorLink, Store, run_sensor};
use fewbits_monte_carlo::Stream;
use fewbits_protocol::{Feedback, Note, SensorSettings, Slot};
use nalgebra::Vector1;
use serde::Deserialize;
use std::io::{BufRead, Read};
use std::net::ToSocketAddrs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::time::Duration;

/// Longest line of a sample, in bytes.
const MAX_LINE: u64 = 1 << 16;

/// Content of `sensor.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Configuration {
    /// Address and port of the centre, or broker or endpoint and fleet.
    centre: String,
    number: u32,
    key: String,
    /// File that stores the counters of envelopes between runs. Without it the centre refuses a restarted sensor as a replay.
    state: Option<PathBuf>,
    /// Whether every write waits for the disk.
    #[serde(default)]
    durable: bool,
    /// Standard deviation of the measurement noise.
    deviation: f64,
    report: Report,
    /// Number of coordinates of the centre's state, and index of the measured one. For censored reports only.
    #[serde(default = "one")]
    coordinates: usize,
    #[serde(default)]
    reads: usize,
    /// Number of silent slots after which a heartbeat is sent; 0: never.
    #[serde(default)]
    heartbeat_after: u32,
    #[serde(default)]
    seed: u64,
}

fn one() -> usize {
    1
}

/// What `sensor.toml` says, and its parts.
struct Given {
    configuration: Configuration,
    node: Node,
    key: Key,
}

/// Reads a file and names its first fault.
fn read(file: &Path) -> Result<Given, Error> {
    let configuration: Configuration = configuration(file)?;
    let node = node(file, &configuration)?;
    let key = Key::from_hex(&configuration.key).map_err(configured(file))?;
    if !(configuration.deviation.is_finite() && configuration.deviation > 0.0) {
        return Err(configured(file)(format!("deviation is {}: expected above 0", configuration.deviation)));
    }
    let place = Place::of(&configuration.centre).map_err(configured(file))?;
    if matches!(&place, Place::Udp(address) if address.ends_with(":0")) {
        let centre = &configuration.centre;
        return Err(configured(file)(format!("centre is {centre}: expected the port at which the centre listens")));
    }
    Ok(Given {
        configuration,
        node,
        key,
    })
}

/// Runs `check` for a sensor.
pub(crate) fn check(file: &Path) -> Result<Ending, Error> {
    let number = read(file)?.configuration.number;
    crate::output::print(&format!("{}: no fault; sensor {number}\n", file.display()))?;
    Ok(Ending::Good)
}

/// Runs the task until the samples end.
pub(crate) fn run(options: &SensorOptions) -> Result<Ending, Error> {
    let file = &options.configuration;
    let Given {
        configuration: given,
        node,
        key,
    } = read(file)?;
    let mut settings = SensorSettings::new(Feedback::Told);
    settings.heartbeat_after = given.heartbeat_after;
    settings.meaning = given.report.meaning(given.deviation, (given.coordinates, given.reads));
    if given.state.is_none() {
        say!(
            "note: no `state`: when this sensor starts again, its centre refuses it until it has a new key, and it accepts old \
             questions"
        );
    }
    let store = given.state.clone().map(|path| match given.durable {
        true => Store::new(path).durable(),
        false => Store::new(path),
    });
    let mut link = SensorLink::new(settings, given.number, key, store)?;
    let mut program = Samples {
        lines: lines(),
        node,
        stream: Stream::new(given.seed).indexed(u64::from(given.number)),
        report: given.report,
        refused: None,
        bad: 0,
        centre: crate::place::shown(&given.centre),
        notes: Limiter::default(),
    };
    match Place::of(&given.centre).map_err(configured(file))? {
        Place::Udp(address) => {
            let unknown = |error| configured(file)(format!("centre is {address}: {error}"));
            let addresses: Vec<_> = address.to_socket_addrs().map_err(unknown)?.collect();
            let centre = *addresses
                .first()
                .ok_or_else(|| configured(file)("centre: no address of that name"))?;
            let mut socket = Towards::open(addresses)?;
            run_sensor(&mut socket, &centre, &mut link, &mut program)?;
        }
        #[cfg(feature = "mqtt")]
        Place::Mqtt { broker, fleet } => {
            let broker = crate::place::mqtt(broker).map_err(configured(file))?;
            let mut mqtt = fewbits_link::mqtt::Mqtt::sensor(broker, fleet, given.number)?;
            run_sensor(&mut mqtt, &given.number, &mut link, &mut program)?;
        }
        #[cfg(feature = "mqtt")]
        Place::Lorawan { .. } => {
            return Err(configured(file)("centre: a sensor behind a LoRaWAN server is a device, not a process"));
        }
        #[cfg(feature = "zenoh")]
        Place::Zenoh { endpoint, fleet } => {
            let session = crate::place::zenoh(endpoint, false).map_err(configured(file))?;
            let mut zenoh = fewbits_link::zenoh::Zenoh::sensor(session, fleet, given.number)?;
            run_sensor(&mut zenoh, &given.number, &mut link, &mut program)?;
        }
    }
    match program.refused {
        Some(error) => Err(error),
        None if program.bad > 0 => {
            say!("{} lines were no finite numbers: missing measurements", program.bad);
            Ok(Ending::Failed)
        }
        None => Ok(Ending::Good),
    }
}

type Node = Box<dyn SensorNode<1>>;

fn node(file: &Path, given: &Configuration) -> Result<Node, Error> {
    let (report, reads, variance) = (given.report, given.reads, given.deviation * given.deviation);
    let node = match (report.needs_coordinates(), given.coordinates) {
        (true, 2) => report.node::<2>(reads, variance),
        (true, 4) => report.node::<4>(reads, variance),
        (true, other) if other != 1 => Err(format!("coordinates is {other}: expected 1, 2 or 4").into()),
        _ => report.node::<1>(reads, variance),
    };
    node.map_err(configured(file))
}

/// Reads samples, one per line, in a thread, so that a slot never waits for one.
fn lines() -> Receiver<(u64, std::io::Result<String>)> {
    let (sender, receiver) = sync_channel(1024);
    std::thread::spawn(move || {
        let mut input = std::io::stdin().lock();
        for number in 1.. {
            let mut line = Vec::new();
            let read = (&mut input).take(MAX_LINE).read_until(b'\n', &mut line);
            let (is_end, is_failed) = (matches!(read, Ok(0)), read.is_err());
            let line = read.map(|_| String::from_utf8_lossy(&line).into_owned());
            if is_end || sender.send((number, line)).is_err() || is_failed {
                return;
            }
        }
    });
    receiver
}

struct Samples {
    lines: Receiver<(u64, std::io::Result<String>)>,
    node: Node,
    stream: Stream,
    report: Report,
    refused: Option<Error>,
    /// Number of lines that were no numbers.
    bad: u64,
    /// Where the centre is, without a password.
    centre: String,
    notes: Limiter,
}

impl Samples {
    fn refuse(&mut self, error: Error) -> ControlFlow<(), Option<BitString>> {
        self.refused = Some(error);
        ControlFlow::Break(())
    }
}

impl Program for Samples {
    /// Takes one line per slot. An empty line, NaN, a line that has not come yet, or one that is no number is a missing measurement: silence.
    fn sample(&mut self, slot: Slot, feedback: &BitString) -> ControlFlow<(), Option<BitString>> {
        let (number, line) = match self.lines.try_recv() {
            Ok((number, Ok(line))) => (number, line),
            Ok((_, Err(source))) => return self.refuse(Error::io("standard input", "read")(source)),
            Err(TryRecvError::Empty) => return ControlFlow::Continue(None),
            Err(TryRecvError::Disconnected) => return ControlFlow::Break(()),
        };
        let cell = line.trim();
        let sample = match cell.parse::<f64>() {
            Ok(sample) if sample.is_finite() => sample,
            Ok(sample) if sample.is_nan() => return ControlFlow::Continue(None),
            // The first line may be a name.
            Err(_) if cell.is_empty() || number == 1 => return ControlFlow::Continue(None),
            // A sensor goes on behind a garbled line.
            _ => {
                self.bad += 1;
                let shown: String = cell.chars().take(40).collect();
                self.notes
                    .say("line", &format!("line {number}: `{shown}` is no finite number: a missing measurement"));
                return ControlFlow::Continue(None);
            }
        };
        let mut rng = self.stream.indexed(u64::from(slot.number())).rng();
        match self.node.report(&mut rng, &Vector1::new(sample), feedback) {
            Ok(report) => ControlFlow::Continue(report),
            Err(error) => {
                self.notes.say(
                    "report",
                    &format!(
                        "slot {}: no report: {error} (is `report` the same here and at the centre?)",
                        slot.number()
                    ),
                );
                ControlFlow::Continue(None)
            }
        }
    }

    fn note(&mut self, note: Note) {
        let text = match note {
            Note::OtherMeaning { found, .. } => {
                let (own, other) = (self.report.word(), self.report.named(found));
                format!(
                    "the centre expects {}, here it is `{own}`, so no report is used; `report` must be the same here and at the centre",
                    other.unwrap_or_else(|| "another `report`".to_owned())
                )
            }
            note => note.to_string(),
        };
        let kind = text.split(',').next().unwrap_or_default().to_owned();
        self.notes.say(&kind, &text);
    }

    fn trouble(&mut self, error: &fewbits_link::Error) {
        let cause = std::error::Error::source(error).map_or_else(String::new, |cause| format!(": {cause}"));
        self.notes
            .say("state", &format!("the state cannot be stored, nothing is sent: {error}{cause}"));
    }

    fn unanswered(&mut self, since: Duration, link: &SensorLink) {
        let (seconds, counts) = (since.as_secs(), link.counts());
        let reason = match (counts.forged, counts.replayed, counts.unknown + counts.short) {
            (0, 0, 0) => "is it running, is this its address, and does it know this sensor and its key?".to_owned(),
            (0, 0, other) => format!("{other} frames came that are not for this sensor"),
            (0, old, _) => format!("{old} frames came that were used before: has the centre lost its state?"),
            (forged, ..) => format!("{forged} frames under another key were refused: do both ends have the same?"),
        };
        say!("no answer from {} for {seconds} s: {reason}", self.centre);
    }
}
